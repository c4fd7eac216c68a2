//! `__NEW` and `__DELETE`: what compiled code calls to get and give back memory of the heap.

use takt_abi::{Cx, Fault, FnDesc};

/// The functions, for a compiler to find by name.
pub static NATIVES: &[&FnDesc] = &[New::DESC, Delete::DESC, PutInstances::DESC];

/// Bytes that one unit of fuel pays for.
const FUEL_BYTES: i64 = 256;

fn give(cx: &mut Cx<'_>, size: u64, count: i64) -> Result<u64, Fault> {
    let Some(bytes) = u64::try_from(count).ok().filter(|n| *n > 0).and_then(|n| n.checked_mul(size)) else { return Ok(0) };
    let Some(at) = cx.env.heap.give(bytes) else { return Ok(0) };
    *cx.fuel = cx.fuel.saturating_sub(bytes as i64 / FUEL_BYTES);
    cx.bytes_mut(at, bytes as usize)?.fill(0);
    Ok(at)
}

fn take(cx: &mut Cx<'_>, at: u64) -> Result<u64, Fault> {
    let bytes = cx.env.heap.take(at)?;
    cx.env.classes.clear(at, bytes);
    Ok(bytes)
}

fn put(cx: &mut Cx<'_>, at: u64, class: u32, stride: u64, count: u64) -> Result<u64, Fault> {
    let bytes = stride.checked_mul(count).ok_or(Fault::WildPointer { offset: at, size: u64::MAX })?;
    cx.bytes(at, bytes as usize)?;
    cx.env.classes.put(at, class, stride, count);
    Ok(bytes)
}

takt_abi::native_fn! {
    /// Memory of the heap for `Count` variables of `Size` bytes, all 0; its offset, or 0 if there is no room.
    pub fn __NEW as New(cx, Size: u64, Count: i64) -> u64 { give(cx, Size, Count) }
}
takt_abi::native_fn! {
    /// Gives back what `__NEW` gave.
    pub fn __DELETE as Delete(cx, At: u64) -> u64 { take(cx, At) }
}
takt_abi::native_fn! {
    /// From now on `Count` instances of a class, of `Stride` bytes each, stand at `At`.
    pub fn __PUT_INSTANCES as PutInstances(cx, At: u64, Class: u32, Stride: u64, Count: u64) -> u64 { put(cx, At, Class, Stride, Count) }
}
