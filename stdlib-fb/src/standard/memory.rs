//! Copying, filling and comparing memory by address, under the names of CODESYS and TwinCAT.
//!
//! An address is an offset into the program's own memory. Each range is checked as a whole before a byte is touched: a wild pointer is a fault, never a
//! write beside the program's data. Source and target may overlap. One unit of fuel pays for 256 bytes.

use takt_abi::{Cx, Fault, FnDesc, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[
    Copy::DESC,
    Move::DESC,
    Fill::DESC,
    Compare::DESC,
    SysCopy::DESC,
    SysMove::DESC,
    SysFill::DESC,
    SysCompare::DESC,
    SysSwap::DESC,
    CaaMove::DESC,
    CaaFill::DESC,
];

/// Other names: (alias, canonical).
pub const ALIASES: &[(&str, &str)] =
    &[("MEM.MemMove", "MEM_MemMove"), ("MEM.MemFill", "MEM_MemFill"), ("MEM", "Takt"), ("MemUtils", "Takt")];

/// Bytes that one unit of fuel pays for.
const FUEL_BYTES: u64 = 256;

fn charge(cx: &mut Cx<'_>, n: u64) {
    *cx.fuel = cx.fuel.saturating_sub((n / FUEL_BYTES) as i64);
}

/// A count as a size; what no memory holds is a wild pointer.
fn size(offset: u64, n: u64) -> Result<usize, Fault> {
    usize::try_from(n).map_err(|_| Fault::WildPointer { offset, size: n })
}

fn copy(cx: &mut Cx<'_>, dst: u64, src: u64, n: u64) -> Result<(), Fault> {
    if n == 0 {
        return Ok(());
    }
    let length = size(dst, n)?;
    cx.bytes(dst, length)?;
    cx.bytes(src, length)?;
    charge(cx, n);
    let (low, high) = (dst.min(src), dst.max(src) + n);
    let both = cx.bytes_mut(low, size(low, high - low)?)?;
    let (from, to) = ((src - low) as usize, (dst - low) as usize);
    both.copy_within(from..from + length, to);
    Ok(())
}

fn fill(cx: &mut Cx<'_>, dst: u64, value: u8, n: u64) -> Result<(), Fault> {
    if n == 0 {
        return Ok(());
    }
    let length = size(dst, n)?;
    cx.bytes(dst, length)?;
    charge(cx, n);
    cx.bytes_mut(dst, length)?.fill(value);
    Ok(())
}

fn compare(cx: &mut Cx<'_>, a: u64, b: u64, n: u64) -> Result<i32, Fault> {
    if n == 0 {
        return Ok(0);
    }
    let length = size(a, n)?;
    let order = cx.bytes(a, length)?.cmp(cx.bytes(b, length)?) as i32;
    charge(cx, n);
    Ok(order)
}

native_fn! {
    /// Copies `n` bytes from `srcAddr` to `destAddr`, which may overlap; returns `n`.
    pub fn MEMCPY as Copy(cx, destAddr: u64, srcAddr: u64, n: u64) -> u32 { copy(cx, destAddr, srcAddr, n).map(|()| n as u32) }
}
native_fn! {
    /// Copies `n` bytes from `srcAddr` to `destAddr`, which may overlap; returns `n`.
    pub fn MEMMOVE as Move(cx, destAddr: u64, srcAddr: u64, n: u64) -> u32 { copy(cx, destAddr, srcAddr, n).map(|()| n as u32) }
}
native_fn! {
    /// Sets `n` bytes from `destAddr` to `fillByte`; returns `n`.
    pub fn MEMSET as Fill(cx, destAddr: u64, fillByte: u8, n: u64) -> u32 { fill(cx, destAddr, fillByte, n).map(|()| n as u32) }
}
native_fn! {
    /// Compares `n` bytes: -1, 0 or 1 as the first that differ.
    pub fn MEMCMP as Compare(cx, pBuf1: u64, pBuf2: u64, n: u64) -> i32 { compare(cx, pBuf1, pBuf2, n) }
}
native_fn! {
    /// Copies `udiCount` bytes from `pSrc` to `pDest` (library SysMem); returns `pDest`.
    pub fn SysMemCpy as SysCopy(cx, pDest: u64, pSrc: u64, udiCount: u64) -> u64 { copy(cx, pDest, pSrc, udiCount).map(|()| pDest) }
}
native_fn! {
    /// Copies `udiCount` bytes from `pSrc` to `pDest`, which may overlap (library SysMem); returns `pDest`.
    pub fn SysMemMove as SysMove(cx, pDest: u64, pSrc: u64, udiCount: u64) -> u64 { copy(cx, pDest, pSrc, udiCount).map(|()| pDest) }
}
native_fn! {
    /// Sets `udiCount` bytes from `pDest` to the low byte of `udiValue` (library SysMem); returns `pDest`.
    pub fn SysMemSet as SysFill(cx, pDest: u64, udiValue: u32, udiCount: u64) -> u64 {
        fill(cx, pDest, udiValue as u8, udiCount).map(|()| pDest)
    }
}
native_fn! {
    /// Compares `udiCount` bytes (library SysMem): -1, 0 or 1 as the first that differ.
    pub fn SysMemCmp as SysCompare(cx, pBuffer1: u64, pBuffer2: u64, udiCount: u64) -> i32 { compare(cx, pBuffer1, pBuffer2, udiCount) }
}
native_fn! {
    /// Reverses the bytes of `iCount` elements of `iSize` bytes from `pbyBuffer` (library SysMem); returns the bytes swapped.
    pub fn SysMemSwap as SysSwap(cx, pbyBuffer: u64, iSize: i32, iCount: i32) -> i32 {
        let (Ok(each), Ok(elements)) = (usize::try_from(iSize), usize::try_from(iCount)) else { return Ok(0) };
        let Some(all) = each.checked_mul(elements).filter(|n| *n > 0) else { return Ok(0) };
        cx.bytes(pbyBuffer, all)?;
        charge(cx, all as u64);
        cx.bytes_mut(pbyBuffer, all)?.chunks_exact_mut(each).for_each(<[u8]>::reverse);
        Ok(all as i32)
    }
}
native_fn! {
    /// `MEM.MemMove` of CAA Memory: copies `uiNumberOfBytes` bytes from `pSource` to `pDestination`; always 0.
    pub fn MEM_MemMove as CaaMove(cx, pSource: u64, pDestination: u64, uiNumberOfBytes: u64) -> u16 {
        copy(cx, pDestination, pSource, uiNumberOfBytes).map(|()| 0)
    }
}
native_fn! {
    /// `MEM.MemFill` of CAA Memory: sets `uiLength` bytes from `pMemoryBlock` to `byFillValue`; always 0.
    pub fn MEM_MemFill as CaaFill(cx, pMemoryBlock: u64, uiLength: u64, byFillValue: takt_abi::Byte) -> u16 {
        fill(cx, pMemoryBlock, byFillValue.0, uiLength).map(|()| 0)
    }
}
