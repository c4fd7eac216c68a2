//! Strings in the image: what compiled code calls to assign and compare them.
//!
//! A STRING(n) is n + 1 bytes, a WSTRING(n) n + 1 units of 16 bits; the text ends at the first NUL or after n of them. LEN counts bytes (units), so an
//! assignment that does not fit is cut at exactly n, as CODESYS does, even inside a UTF-8 character. What lies behind the NUL stays as it was.
//! Source and target may overlap. All four check both ranges: a place outside the image is a fault.

use takt_abi::{Cx, Fault, FnDesc};

/// The functions, for a compiler to find by name.
pub static NATIVES: &[&FnDesc] = &[StrAssign::DESC, StrCompare::DESC, WstrAssign::DESC, WstrCompare::DESC];

/// Bytes of the text at `offset` in a string of `cap` units of `unit` bytes.
fn length(cx: &Cx<'_>, offset: u64, cap: u32, unit: usize) -> Result<usize, Fault> {
    let bytes = cx.bytes(offset, cap as usize * unit)?;
    let end = bytes.chunks_exact(unit).position(|c| c.iter().all(|b| *b == 0));
    Ok(end.unwrap_or(cap as usize) * unit)
}

fn assign(cx: &mut Cx<'_>, dst: u64, dst_cap: u32, src: u64, src_cap: u32, unit: usize) -> Result<i64, Fault> {
    let len = length(cx, src, src_cap.min(dst_cap), unit)?;
    *cx.fuel = cx.fuel.saturating_sub(len as i64 / FUEL_BYTES);
    cx.bytes(dst, (dst_cap as usize + 1) * unit)?;
    let (low, high) = (dst.min(src), dst.max(src) + len as u64);
    let both = cx.bytes_mut(low, (high - low) as usize)?;
    both.copy_within((src - low) as usize..(src - low) as usize + len, (dst - low) as usize);
    cx.bytes_mut(dst + len as u64, unit)?.fill(0);
    Ok((len / unit) as i64)
}

fn compare(cx: &mut Cx<'_>, a: u64, a_cap: u32, b: u64, b_cap: u32, unit: usize) -> Result<i64, Fault> {
    let (a_len, b_len) = (length(cx, a, a_cap, unit)?, length(cx, b, b_cap, unit)?);
    *cx.fuel = cx.fuel.saturating_sub(a_len.min(b_len) as i64 / FUEL_BYTES);
    let (a, b) = (cx.bytes(a, a_len)?, cx.bytes(b, b_len)?);
    // The high byte of a little-endian unit decides first.
    let order = a.chunks_exact(unit).flat_map(|c| c.iter().rev()).cmp(b.chunks_exact(unit).flat_map(|c| c.iter().rev()));
    Ok(order as i64)
}

/// Bytes that one unit of fuel pays for.
const FUEL_BYTES: i64 = 256;

takt_abi::native_fn! {
    /// Assigns the STRING(`SrcCap`) at `Src` to the STRING(`DstCap`) at `Dst`; the length in bytes.
    pub fn STR_ASSIGN as StrAssign(cx, Dst: u64, DstCap: u32, Src: u64, SrcCap: u32) -> i64 { assign(cx, Dst, DstCap, Src, SrcCap, 1) }
}
takt_abi::native_fn! {
    /// Compares the STRING(`ACap`) at `A` with the STRING(`BCap`) at `B` byte by byte: -1, 0 or 1.
    pub fn STR_COMPARE as StrCompare(cx, A: u64, ACap: u32, B: u64, BCap: u32) -> i64 { compare(cx, A, ACap, B, BCap, 1) }
}
takt_abi::native_fn! {
    /// Assigns the WSTRING(`SrcCap`) at `Src` to the WSTRING(`DstCap`) at `Dst`; the length in units.
    pub fn WSTR_ASSIGN as WstrAssign(cx, Dst: u64, DstCap: u32, Src: u64, SrcCap: u32) -> i64 { assign(cx, Dst, DstCap, Src, SrcCap, 2) }
}
takt_abi::native_fn! {
    /// Compares the WSTRING(`ACap`) at `A` with the WSTRING(`BCap`) at `B` unit by unit: -1, 0 or 1.
    pub fn WSTR_COMPARE as WstrCompare(cx, A: u64, ACap: u32, B: u64, BCap: u32) -> i64 { compare(cx, A, ACap, B, BCap, 2) }
}
