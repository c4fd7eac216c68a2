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

#[cfg(test)]
mod tests {
    use super::*;
    use takt_abi::{Env, NoHost, Time};

    /// Runs on 64 bytes that hold `text` at 16.
    fn with<T>(text: &[u8], run: impl FnOnce(&mut Cx<'_>) -> T) -> (T, Vec<u8>, i64) {
        let mut image = vec![0xEE; 64];
        image[16..16 + text.len()].copy_from_slice(text);
        let mut env = Env::new(Time(1), Box::new(NoHost));
        let mut fuel = 100;
        let result = run(&mut Cx::new(&mut image, &mut env, &mut fuel, 0));
        (result, image, fuel)
    }
    #[track_caller]
    fn assigned(dst: u64, dst_cap: u32, src_cap: u32, expected: &[u8]) {
        let (len, image, _) = with(b"hello\0", |cx| StrAssign::call(cx, dst, dst_cap, 16, src_cap));
        assert_eq!(len, Ok(expected.len() as i64 - 2));
        assert_eq!(&image[dst as usize..dst as usize + expected.len()], expected);
    }

    #[test]
    fn an_assignment_ends_with_nul_and_leaves_the_rest() {
        assigned(32, 10, 10, b"hello\0\xEE");
        assigned(32, 3, 10, b"hel\0\xEE");
        assigned(32, 10, 2, b"he\0\xEE");
        assigned(32, 0, 10, b"\0\xEE");
        assigned(18, 10, 10, b"hello\0\xEE");
        assigned(14, 10, 10, b"hello\0o");
        assigned(16, 10, 10, b"hello\0\xEE");
    }

    #[test]
    fn an_assignment_is_cut_at_exactly_its_capacity() {
        let (len, image, _) = with("aä\0".as_bytes(), |cx| StrAssign::call(cx, 32, 2, 16, 10));
        assert_eq!((len, &image[32..36]), (Ok(2), &b"a\xC3\0\xEE"[..]));
    }

    #[test]
    fn comparison_is_by_bytes_and_units() {
        let order = |a: &[u8], b: &[u8]| {
            let text = [a, &[0, 0][..], b, &[0, 0]].concat();
            let second = 16 + a.len() as u64 + 2;
            let narrow = with(&text, |cx| StrCompare::call(cx, 16, 8, second, 8)).0;
            let wide = with(&text, |cx| WstrCompare::call(cx, 16, 4, second, 4)).0;
            (narrow, wide)
        };
        assert_eq!(order(b"ab", b"ab"), (Ok(0), Ok(0)));
        assert_eq!(order(b"ab", b"abcd"), (Ok(-1), Ok(-1)));
        assert_eq!(order(b"\xFFa", b"a\xFF"), (Ok(1), Ok(-1)));
    }

    #[test]
    fn wide_texts_count_units() {
        let (len, image, _) = with(b"a\0b\0c\0\0\0", |cx| WstrAssign::call(cx, 32, 2, 16, 10));
        assert_eq!((len, &image[32..39]), (Ok(2), &b"a\0b\0\0\0\xEE"[..]));
    }

    #[test]
    fn a_place_outside_the_image_is_a_fault() {
        let wild = |dst, cap, src| with(b"hello\0", |cx| StrAssign::call(cx, dst, cap, src, 10)).0;
        assert_eq!(wild(60, 4, 16), Err(Fault::WildPointer { offset: 60, size: 5 }));
        assert_eq!(wild(u64::MAX, 4, 16), Err(Fault::WildPointer { offset: u64::MAX, size: 5 }));
        assert_eq!(wild(32, 4, 0), Err(Fault::NullPointer));
        assert_eq!(wild(0, 4, 16), Err(Fault::NullPointer));
        assert_eq!(wild(32, u32::MAX, 16), Err(Fault::WildPointer { offset: 32, size: 1 << 32 }));
        assert_eq!(
            with(b"", |cx| StrAssign::call(cx, 16, u32::MAX, 16, u32::MAX)).0,
            Err(Fault::WildPointer { offset: 16, size: u64::from(u32::MAX) })
        );
    }

    #[test]
    fn long_texts_take_fuel() {
        let mut image = vec![b'a'; 4096];
        let (_, _, fuel) = with(b"", |cx| {
            let mut own = Cx::new(&mut image, cx.env, cx.fuel, 0);
            StrAssign::call(&mut own, 16, 1024, 2048, 1024)
        });
        assert_eq!(fuel, 96);
    }
}
