//! Functions of numbers and bits: validity and byte order of IEC 61131-3, and what ported programs call of TwinCAT's libraries.

use super::{Text, written};
use takt_abi::{Bool, Byte, Dword, FnDesc, Lword, Word, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[
    IsValid::DESC,
    SwapBytes::DESC,
    Frac::DESC,
    Lmod::DESC,
    Ltrunc::DESC,
    Modabs::DESC,
    HexByte::DESC,
    HexWord::DESC,
    HexDword::DESC,
    HexLword::DESC,
    BinaryText::DESC,
    DecimalText::DESC,
    FixedText::DESC,
    GetBit::DESC,
    SetBit::DESC,
    ClearBit::DESC,
    PutBit::DESC,
];

native_fn! {
    /// Whether a REAL or LREAL is a number: neither NaN nor infinite (IEC 61131-3, table 37).
    pub fn IS_VALID as IsValid(_cx, IN: f64) -> Bool { Ok(IN.is_finite().into()) }
}
native_fn! {
    /// The low `SIZE` bytes of a number in reverse; what TO_BIG_ENDIAN is made of.
    pub fn SWAP_BYTES as SwapBytes(_cx, IN: Lword, SIZE: u8) -> Lword {
        Ok(Lword(IN.0.swap_bytes() >> (64 - 8 * u32::from(SIZE.clamp(1, 8)))))
    }
}
native_fn! {
    /// Bit `bitNo` of a number, 0 to 31 (Tc2_System); else FALSE.
    pub fn GETBIT32 as GetBit(_cx, inVal32: Dword, bitNo: i8) -> Bool { Ok((inVal32.0 & bit(bitNo) != 0).into()) }
}
native_fn! {
    /// The number with bit `bitNo` set (Tc2_System).
    pub fn SETBIT32 as SetBit(_cx, inVal32: Dword, bitNo: i8) -> Dword { Ok(Dword(inVal32.0 | bit(bitNo))) }
}
native_fn! {
    /// The number with bit `bitNo` cleared (Tc2_System).
    pub fn CLEARBIT32 as ClearBit(_cx, inVal32: Dword, bitNo: i8) -> Dword { Ok(Dword(inVal32.0 & !bit(bitNo))) }
}
native_fn! {
    /// The number with bit `bitNo` set to `bitVal` (Tc2_System).
    pub fn CSETBIT32 as PutBit(_cx, inVal32: Dword, bitNo: i8, bitVal: Bool) -> Dword {
        Ok(Dword(if bitVal.get() { inVal32.0 | bit(bitNo) } else { inVal32.0 & !bit(bitNo) }))
    }
}

/// The bit of that number; none outside of 0 to 31.
fn bit(number: i8) -> u32 {
    u32::try_from(number).ok().and_then(|n| 1u32.checked_shl(n)).unwrap_or(0)
}

native_fn! {
    /// What stands behind the point, with the sign of the number (Tc2_Math).
    pub fn FRAC as Frac(_cx, lr_in: f64) -> f64 { Ok(lr_in - lr_in.trunc()) }
}
native_fn! {
    /// Remainder of a division, with the sign of the dividend (Tc2_Math); NaN when `lr_Arg` is 0.
    pub fn LMOD as Lmod(_cx, lr_Value: f64, lr_Arg: f64) -> f64 { Ok(libm::fmod(lr_Value, lr_Arg)) }
}
native_fn! {
    /// The whole part, as LREAL (Tc2_Math).
    pub fn LTRUNC as Ltrunc(_cx, lr_in: f64) -> f64 { Ok(lr_in.trunc()) }
}
native_fn! {
    /// Remainder of a division that is never negative (Tc2_Math); NaN when `lr_Arg` is 0.
    pub fn MODABS as Modabs(_cx, lr_Val: f64, lr_Arg: f64) -> f64 {
        let rest = libm::fmod(lr_Val, lr_Arg);
        Ok(if rest < 0.0 { rest + lr_Arg.abs() } else { rest })
    }
}
macro_rules! hexadecimal {
    ($name:ident as $rust:ident($type:ty)) => {
        native_fn! {
            /// At least `iPrecision` hexadecimal digits (Tc2_Utilities), small letters with `bLoCase`.
            pub fn $name as $rust(_cx, IN: $type, iPrecision: i16, bLoCase: Bool) -> Text {
                let width = digits(iPrecision);
                Ok(if bLoCase.get() { written(format_args!("{:0width$x}", IN.0)) } else { written(format_args!("{:0width$X}", IN.0)) })
            }
        }
    };
}
hexadecimal!(BYTE_TO_HEXSTR as HexByte(Byte));
hexadecimal!(WORD_TO_HEXSTR as HexWord(Word));
hexadecimal!(DWORD_TO_HEXSTR as HexDword(Dword));
hexadecimal!(LWORD_TO_HEXSTR as HexLword(Lword));

native_fn! {
    /// At least `iPrecision` binary digits (Tc2_Utilities).
    pub fn DWORD_TO_BINSTR as BinaryText(_cx, IN: Dword, iPrecision: i16) -> Text {
        Ok(written(format_args!("{:0width$b}", IN.0, width = digits(iPrecision))))
    }
}
native_fn! {
    /// At least `iPrecision` decimal digits behind the sign (Tc2_Utilities).
    pub fn DINT_TO_DECSTR as DecimalText(_cx, IN: i32, iPrecision: i16) -> Text {
        let sign = if IN < 0 { "-" } else { "" };
        Ok(written(format_args!("{sign}{:0width$}", IN.unsigned_abs(), width = digits(iPrecision))))
    }
}

/// A number of digits that a text holds.
fn digits(precision: i16) -> usize {
    usize::try_from(precision).unwrap_or(0).min(200)
}

native_fn! {
    /// The number with `iPrecision` digits behind the point (Tc2_Utilities), rounded with `bRound`, else cut; from 1E60 on with an exponent.
    pub fn LREAL_TO_FMTSTR as FixedText(_cx, IN: f64, iPrecision: i16, bRound: Bool) -> Text {
        let places = usize::from(u16::try_from(iPrecision).unwrap_or(0)).min(100);
        Ok(super::format::fixed(IN, places, bRound.get()))
    }
}
