//! Functions of strings, each for STRING and (with a `W` before its name) for WSTRING.
//!
//! Strings count and cut in bytes (WSTRING: units of 16 bits), as CODESYS does; positions start at 1; what lies outside of a string is empty, never an
//! error. A result keeps 255 of them.

use super::{Text, Wide, filled};
use takt_abi::{FnDesc, Str, WStr, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[
    Len::DESC,
    Left::DESC,
    Right::DESC,
    Mid::DESC,
    Concat::DESC,
    Insert::DESC,
    Delete::DESC,
    Replace::DESC,
    Find::DESC,
    Wlen::DESC,
    Wleft::DESC,
    Wright::DESC,
    Wmid::DESC,
    Wconcat::DESC,
    Winsert::DESC,
    Wdelete::DESC,
    Wreplace::DESC,
    Wfind::DESC,
    UpperCase::DESC,
    LowerCase::DESC,
    TrimLeft::DESC,
    TrimRight::DESC,
];

/// A count or position as an index: below 0 is 0.
fn count(n: i16) -> usize {
    usize::try_from(n).unwrap_or(0)
}

/// What stands before and behind the units from `position` on, `length` of them; of those before position 1 there are none to take away.
fn around<T>(all: &[T], length: i16, position: i16) -> (&[T], &[T]) {
    let from = i32::from(position) - 1;
    let start = count(position).saturating_sub(1).min(all.len());
    let end = usize::try_from(from + i32::from(length).max(0)).unwrap_or(0).clamp(start, all.len());
    (&all[..start], &all[end..])
}

/// `all` with `length` units from `position` replaced; unchanged when the position lies behind it.
fn replaced<T: Copy + Default>(all: &[T], with: &[T], length: i16, position: i16) -> [T; 256] {
    let (head, tail) = around(all, length, position);
    let with = if count(position) <= all.len() + 1 { with } else { &[] };
    filled(head.iter().chain(with).chain(tail).copied())
}

/// Position of the first `part` in `all`, 0 if there is none.
fn found<T: PartialEq>(all: &[T], part: &[T]) -> i16 {
    if part.is_empty() {
        return 0;
    }
    all.windows(part.len()).position(|w| w == part).map_or(0, |i| i as i16 + 1)
}

macro_rules! text_functions {
    ($text:ident, $wrap:ident, $units:ident: $len:ident $Len:ident, $left:ident $Left:ident, $right:ident $Right:ident, $mid:ident $Mid:ident,
     $concat:ident $Concat:ident, $insert:ident $Insert:ident, $delete:ident $Delete:ident, $replace:ident $Replace:ident, $find:ident $Find:ident) => {
        native_fn! {
            /// Length (IEC 61131-3, table 34).
            pub fn $len as $Len(_cx, STR: $text) -> i16 { Ok(STR.$units().len() as i16) }
        }
        native_fn! {
            /// The first `SIZE` characters.
            pub fn $left as $Left(_cx, STR: $text, SIZE: i16) -> $text {
                Ok($wrap(filled(STR.$units().iter().copied().take(count(SIZE)))))
            }
        }
        native_fn! {
            /// The last `SIZE` characters.
            pub fn $right as $Right(_cx, STR: $text, SIZE: i16) -> $text {
                let all = STR.$units();
                Ok($wrap(filled(all[all.len() - count(SIZE).min(all.len())..].iter().copied())))
            }
        }
        native_fn! {
            /// `LEN` characters from position `POS`; none from before the first.
            pub fn $mid as $Mid(_cx, STR: $text, LEN: i16, POS: i16) -> $text {
                let length = if POS < 1 { 0 } else { count(LEN) };
                Ok($wrap(filled(STR.$units().iter().copied().skip(count(POS).saturating_sub(1)).take(length))))
            }
        }
        native_fn! {
            /// `STR1` followed by `STR2`, and by any further strings.
            pub fn $concat as $Concat(_cx, STR1: $text, STR2: $text) -> $text {
                Ok($wrap(filled(STR1.$units().iter().chain(STR2.$units()).copied())))
            }
        }
        native_fn! {
            /// `STR1` with `STR2` put in behind position `POS`; 0 is before the first character; unchanged where there is no such position.
            pub fn $insert as $Insert(_cx, STR1: $text, STR2: $text, POS: i16) -> $text {
                let Some((head, tail)) = usize::try_from(POS).ok().and_then(|at| STR1.$units().split_at_checked(at)) else { return Ok(STR1) };
                Ok($wrap(filled(head.iter().chain(STR2.$units()).chain(tail).copied())))
            }
        }
        native_fn! {
            /// `STR` without `LEN` characters from position `POS`.
            pub fn $delete as $Delete(_cx, STR: $text, LEN: i16, POS: i16) -> $text { Ok($wrap(replaced(STR.$units(), &[], LEN, POS))) }
        }
        native_fn! {
            /// `STR1` with `L` characters from position `P` replaced by `STR2`; unchanged where there is no such position.
            pub fn $replace as $Replace(_cx, STR1: $text, STR2: $text, L: i16, P: i16) -> $text {
                Ok($wrap(replaced(STR1.$units(), STR2.$units(), L, P)))
            }
        }
        native_fn! {
            /// Position of the first `STR2` in `STR1`; 0 if there is none.
            pub fn $find as $Find(_cx, STR1: $text, STR2: $text) -> i16 { Ok(found(STR1.$units(), STR2.$units())) }
        }
    };
}

text_functions!(Text, Str, bytes: LEN Len, LEFT Left, RIGHT Right, MID Mid, CONCAT Concat, INSERT Insert, DELETE Delete, REPLACE Replace, FIND Find);
text_functions!(Wide, WStr, units: WLEN Wlen, WLEFT Wleft, WRIGHT Wright, WMID Wmid, WCONCAT Wconcat, WINSERT Winsert, WDELETE Wdelete, WREPLACE Wreplace, WFIND Wfind);

native_fn! {
    /// The text in capital letters; letters beyond A to Z stay.
    pub fn F_ToUCase as UpperCase(_cx, IN: Text) -> Text { Ok(Str(filled(IN.bytes().iter().map(u8::to_ascii_uppercase)))) }
}
native_fn! {
    /// The text in small letters; letters beyond a to z stay.
    pub fn F_ToLCase as LowerCase(_cx, IN: Text) -> Text { Ok(Str(filled(IN.bytes().iter().map(u8::to_ascii_lowercase)))) }
}
native_fn! {
    /// The text without the spaces before it.
    pub fn F_LTrim as TrimLeft(_cx, IN: Text) -> Text { Ok(Str(filled(IN.bytes().trim_ascii_start().iter().copied()))) }
}
native_fn! {
    /// The text without the spaces behind it.
    pub fn F_RTrim as TrimRight(_cx, IN: Text) -> Text { Ok(Str(filled(IN.bytes().trim_ascii_end().iter().copied()))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(found: [u8; 256], expected: &[u8]) {
        assert_eq!(Str(found).bytes(), expected);
    }

    #[test]
    fn parts_of_strings_count_from_one_and_never_leave_it() {
        let s = b"ABCDEF";
        check(replaced(s, b"xy", 2, 3), b"ABxyEF");
        check(replaced(s, b"", 9, 5), b"ABCD");
        check(replaced(s, b"!", -1, 99), b"ABCDEF");
        check(replaced(s, b"!", 3, 7), b"ABCDEF!");
        check(replaced(s, b"!", 0, 1), b"!ABCDEF");
        check(replaced(s, b"", 2, 0), b"BCDEF");
        check(replaced(s, b"", 2, -1), b"ABCDEF");
        check(replaced(s, b"", i16::MAX, i16::MAX), b"ABCDEF");
        check(replaced(s, b"", i16::MAX, i16::MIN), b"ABCDEF");
    }

    #[test]
    fn a_result_is_cut_at_255() {
        let long = [b'a'; 200];
        assert_eq!(Str(replaced(&long, &long, 0, 1)).bytes().len(), 255);
    }

    #[test]
    fn a_part_is_found_at_its_first_place() {
        assert_eq!((found(b"abcabc", b"bc"), found(b"abc", b"x"), found(b"abc", b""), found(b"a", b"ab")), (2, 0, 0, 0));
    }
}
