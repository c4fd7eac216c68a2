//! Functions of numbers from TwinCAT's libraries that ported programs call.

use super::{Text, written};
use takt_abi::{Bool, Dword, FnDesc, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[Frac::DESC, Lmod::DESC, Ltrunc::DESC, Modabs::DESC, HexText::DESC, FixedText::DESC];

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
native_fn! {
    /// At least `iPrecision` hexadecimal digits (Tc2_Utilities), small letters with `bLoCase`.
    pub fn DWORD_TO_HEXSTR as HexText(_cx, IN: Dword, iPrecision: i16, bLoCase: Bool) -> Text {
        let width = usize::try_from(iPrecision).unwrap_or(0).min(255);
        Ok(if bLoCase.get() { written(format_args!("{:0width$x}", IN.0)) } else { written(format_args!("{:0width$X}", IN.0)) })
    }
}
native_fn! {
    /// The number with `iPrecision` digits behind the point (Tc2_Utilities), rounded with `bRound`, else cut.
    pub fn LREAL_TO_FMTSTR as FixedText(_cx, IN: f64, iPrecision: i16, bRound: Bool) -> Text {
        let places = usize::from(u16::try_from(iPrecision).unwrap_or(0)).min(100);
        Ok(super::format::fixed(IN, places, bRound.get()))
    }
}
