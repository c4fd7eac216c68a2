//! Decimal digits of four bits each (BCD). The compiler makes `WORD_BCD_TO_UINT`, `TO_BCD_BYTE` and their like of these two.

use takt_abi::{Bool, FnDesc, Lword, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[Decode::DESC, Encode::DESC, ValidDecimal::DESC];

native_fn! {
    /// The number that sixteen digits of four bits show. A digit above 9 counts with its value.
    pub fn LWORD_BCD_TO_ULINT as Decode(_cx, IN: Lword) -> u64 {
        Ok((0..16).rev().fold(0u64, |number, digit| number.wrapping_mul(10).wrapping_add(IN.0 >> (4 * digit) & 15)))
    }
}
native_fn! {
    /// The last sixteen decimal digits of a number, four bits each.
    pub fn ULINT_TO_BCD_LWORD as Encode(_cx, IN: u64) -> Lword {
        let mut rest = IN;
        Ok(Lword((0..16).fold(0, |digits, place| {
            let digit = rest % 10;
            rest /= 10;
            digits | digit << (4 * place)
        })))
    }
}
native_fn! {
    /// Whether each four bits are a decimal digit (IEC 61131-3, table 37).
    pub fn IS_VALID_BCD as ValidDecimal(_cx, IN: Lword) -> Bool { Ok((0..16).all(|place| IN.0 >> (4 * place) & 15 < 10).into()) }
}
