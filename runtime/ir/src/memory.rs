//! The image as the interpreter sees it: every access checked against the size in the [`Context`], and calls out of Rust.
//!
//! The interpreter does not trust the verifier: what would leave the image is [`Fault::WildPointer`], never undefined behaviour. This is the only
//! module of the crate with `unsafe`.
//!
//! **Invariant:** whoever hands a [`Context`] to an executor has set `image` and `image_size` to one live allocation that nobody else touches
//! meanwhile, and `env` to a live environment.

use crate::inst::Mem;
use takt_abi::{Context, Fault, NativeFn};

/// Words that a native call has room for, the extra one included.
pub(crate) const NATIVE_WORDS: usize = 64;

fn check(ctx: &Context, offset: u64, len: u64) -> Result<(), Fault> {
    match offset.checked_add(len) {
        Some(end) if end <= ctx.image_size && !ctx.image.is_null() => Ok(()),
        _ => Err(Fault::WildPointer { offset, size: len }),
    }
}

/// `len` bytes of the image.
#[allow(unsafe_code, reason = "the image is shared with machine code as a raw pointer")]
fn bytes(ctx: &Context, offset: u64, len: u64) -> Result<&[u8], Fault> {
    check(ctx, offset, len)?;
    // SAFETY: the range lies in the image, which lives as long as the context (module invariant).
    Ok(unsafe { std::slice::from_raw_parts(ctx.image.add(offset as usize), len as usize) })
}

/// The same, writable.
#[allow(unsafe_code, reason = "the image is shared with machine code as a raw pointer")]
fn bytes_mut(ctx: &mut Context, offset: u64, len: u64) -> Result<&mut [u8], Fault> {
    check(ctx, offset, len)?;
    // SAFETY: as in `bytes`; `ctx` is borrowed exclusively.
    Ok(unsafe { std::slice::from_raw_parts_mut(ctx.image.add(offset as usize), len as usize) })
}

/// The word that a load brings.
#[inline]
pub(crate) fn load(ctx: &Context, mem: Mem, offset: u64) -> Result<u64, Fault> {
    let raw = bytes(ctx, offset, mem.size().into())?;
    Ok(match (mem, raw) {
        (Mem::Bool, [a]) => u64::from(*a != 0),
        (Mem::I8, [a]) => *a as i8 as i64 as u64,
        (Mem::I16, [a, b]) => i16::from_le_bytes([*a, *b]) as i64 as u64,
        (Mem::I32, [a, b, c, d]) => i32::from_le_bytes([*a, *b, *c, *d]) as i64 as u64,
        (_, [a]) => (*a).into(),
        (_, [a, b]) => u16::from_le_bytes([*a, *b]).into(),
        (_, [a, b, c, d]) => u32::from_le_bytes([*a, *b, *c, *d]).into(),
        (_, _) => {
            let mut word = [0; 8];
            word.copy_from_slice(raw);
            u64::from_le_bytes(word)
        }
    })
}

/// Stores the low bytes of a word; NaN becomes canonical.
#[inline]
pub(crate) fn store(ctx: &mut Context, mem: Mem, offset: u64, word: u64) -> Result<(), Fault> {
    let word = canonical(mem, word);
    let size = mem.size();
    bytes_mut(ctx, offset, size.into())?.copy_from_slice(&word.to_le_bytes()[..size as usize]);
    Ok(())
}

/// The word with any NaN made the canonical one, if `mem` is a float.
pub(crate) fn canonical(mem: Mem, word: u64) -> u64 {
    match mem {
        Mem::F32 if f32::from_bits(word as u32).is_nan() => 0x7FC0_0000,
        Mem::F64 if f64::from_bits(word).is_nan() => 0x7FF8_0000_0000_0000,
        _ => word,
    }
}

/// Copies `len` bytes inside the image; the ranges may overlap.
pub(crate) fn copy(ctx: &mut Context, dst: u64, src: u64, len: u64) -> Result<(), Fault> {
    check(ctx, src, len)?;
    check(ctx, dst, len)?;
    let size = ctx.image_size;
    bytes_mut(ctx, 0, size)?.copy_within(src as usize..(src + len) as usize, dst as usize);
    Ok(())
}

/// Writes bytes into the image.
pub(crate) fn write(ctx: &mut Context, dst: u64, from: &[u8]) -> Result<(), Fault> {
    bytes_mut(ctx, dst, from.len() as u64)?.copy_from_slice(from);
    Ok(())
}

/// The class of the instance that begins there.
#[allow(unsafe_code, reason = "the environment is shared with machine code as a raw pointer")]
pub(crate) fn class_at(ctx: &Context, offset: u64) -> u32 {
    // SAFETY: the environment lives as long as the context (module invariant), and nobody else uses it while an executor runs.
    unsafe { &*ctx.env }.classes.at(offset)
}

/// Notes instances.
#[allow(unsafe_code, reason = "the environment is shared with machine code as a raw pointer")]
pub(crate) fn place(ctx: &mut Context, offset: u64, class: u32, stride: u64, count: u64) {
    // SAFETY: as in `class_at`.
    unsafe { &*ctx.env }.classes.put(offset, class, stride, count);
}

/// Calls a native function; word 0 holds the result if the status is 0.
#[allow(unsafe_code, reason = "native blocks are called through the same pointer as from machine code")]
pub(crate) fn call_native(ctx: &mut Context, call: NativeFn, words: &mut [u64; NATIVE_WORDS]) -> u32 {
    // SAFETY: `ctx` is live and exclusively ours, the words are more than any callee takes.
    unsafe { call(ctx, words.as_mut_ptr()) }
}

/// Calls the slow path of a poll.
#[allow(unsafe_code, reason = "the engine's callback is called through the same pointer as from machine code")]
pub(crate) fn call_poll(ctx: &mut Context, site: u32) -> u32 {
    let poll = ctx.poll;
    // SAFETY: `ctx` is live and exclusively ours.
    unsafe { poll(ctx, site) }
}
