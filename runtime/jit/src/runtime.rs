//! What machine code calls: faults are recorded by Rust, not by generated stores, and long copies are done by the system's `memmove`.
//!
//! All of these are cold except [`move_bytes`]. Each returns the code that the calling body returns in turn.

#![allow(unsafe_code, reason = "called by machine code with raw pointers")]

use takt_abi::{Context, Fault};

/// Fault `Index`.
pub(crate) unsafe extern "C" fn index(ctx: *mut Context, site: u32, value: i64, low: i64, high: i64) -> u32 {
    // SAFETY: machine code passes the context that it was run with, which nobody else uses meanwhile.
    unsafe { &mut *ctx }.fail(Fault::Index { value, low, high }, site)
}

/// Fault `NullPointer` or `WildPointer`, by the pointer.
pub(crate) unsafe extern "C" fn pointer(ctx: *mut Context, site: u32, offset: u64, size: u64) -> u32 {
    let fault = if offset == 0 { Fault::NullPointer } else { Fault::WildPointer { offset, size } };
    // SAFETY: as in `index`.
    unsafe { &mut *ctx }.fail(fault, site)
}

/// Fault `NullPointer` or `NoInstance`, by the offset.
pub(crate) unsafe extern "C" fn instance(ctx: *mut Context, site: u32, offset: u64) -> u32 {
    let fault = if offset == 0 { Fault::NullPointer } else { Fault::NoInstance { offset } };
    // SAFETY: as in `index`.
    unsafe { &mut *ctx }.fail(fault, site)
}

/// Whether the instance at `offset` belongs to a family.
pub(crate) unsafe extern "C" fn is_a(ctx: *mut Context, offset: u64, family: *const takt_ir::Family) -> u64 {
    // SAFETY: the environment lives as long as the context, the family as long as the code that asks.
    let (classes, family) = unsafe { (&(*(*ctx).env).classes, &*family) };
    family.has(classes.at(offset)).into()
}

/// Notes instances in a frame.
pub(crate) unsafe extern "C" fn put_instances(ctx: *mut Context, offset: u64, class: u32, stride: u64, count: u64) {
    // SAFETY: as in `is_a`.
    unsafe { &(*(*ctx).env).classes }.put(offset, class, stride, count);
}

/// Fault `DivisionByZero`.
pub(crate) unsafe extern "C" fn division(ctx: *mut Context, site: u32) -> u32 {
    // SAFETY: as in `index`.
    unsafe { &mut *ctx }.fail(Fault::DivisionByZero, site)
}

/// Fault `StackOverflow` at the entry of a body.
pub(crate) unsafe extern "C" fn overflow(ctx: *mut Context, site: u32) -> u32 {
    // SAFETY: as in `index`.
    let ctx = unsafe { &mut *ctx };
    ctx.fail(Fault::StackOverflow { depth: ctx.depth }, site)
}

/// A fault that the IR states.
pub(crate) unsafe extern "C" fn stated(ctx: *mut Context, site: u32, code: u32, a: i64, b: i64, c: i64) -> u32 {
    let fault = Fault::from_raw(code, [a, b, c]).unwrap_or(Fault::Panic);
    // SAFETY: as in `index`.
    unsafe { &mut *ctx }.fail(fault, site)
}

/// A fault that was caught goes on.
pub(crate) unsafe extern "C" fn again(ctx: *mut Context, code: u64) -> u32 {
    // SAFETY: as in `index`.
    unsafe { &mut *ctx }.again(code)
}

/// A native block or the engine has recorded a fault: what is missing is where.
pub(crate) unsafe extern "C" fn stopped(ctx: *mut Context, site: u32, code: u32) -> u32 {
    // SAFETY: as in `index`.
    let ctx = unsafe { &mut *ctx };
    ctx.fault_site = site;
    ctx.trace_len = 0;
    code
}

/// A callee returned a fault: its caller adds itself to the trace.
pub(crate) unsafe extern "C" fn caller(ctx: *mut Context, site: u32, code: u32) -> u32 {
    // SAFETY: as in `index`.
    unsafe { &mut *ctx }.push_trace(site);
    code
}

/// Copies bytes; the ranges may overlap.
pub(crate) unsafe extern "C" fn move_bytes(dst: *mut u8, src: *const u8, len: u64) {
    // SAFETY: the verifier has proved that both ranges lie in the image (or the source in the pool of constants).
    unsafe { std::ptr::copy(src, dst, len as usize) }
}

/// What [`crate::Defect::MoveForward`] does instead.
pub(crate) unsafe extern "C" fn move_forward(dst: *mut u8, src: *const u8, len: u64) {
    for i in 0..len as usize {
        // SAFETY: as in `move_bytes`.
        unsafe { dst.add(i).write(src.add(i).read()) }
    }
}
