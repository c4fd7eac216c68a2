//! Functions of IEC 61131-3 that have one signature: the clock, strings, numbers as text.
//!
//! Strings count and cut in bytes, as CODESYS does; positions start at 1; what lies outside of a string is empty, never an error.

use takt_abi::{Bool, FnDesc, StDate, StDateTime, StLtime, StTime, StTimeOfDay, Str, native_fn};

/// STRING(255).
type Text = Str<256>;

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[
    MachineTime::DESC,
    MachineLtime::DESC,
    Len::DESC,
    Left::DESC,
    Right::DESC,
    Mid::DESC,
    Concat::DESC,
    Insert::DESC,
    Delete::DESC,
    Replace::DESC,
    Find::DESC,
    LintToString::DESC,
    UlintToString::DESC,
    RealToString::DESC,
    LrealToString::DESC,
    BoolToString::DESC,
    TimeToString::DESC,
    LtimeToString::DESC,
    DateToString::DESC,
    TodToString::DESC,
    DtToString::DESC,
    StringToLint::DESC,
    StringToLreal::DESC,
    StringToBool::DESC,
    StringToLtime::DESC,
];

/// The first 255 bytes.
fn text(bytes: impl IntoIterator<Item = u8>) -> Text {
    let mut result = Text::EMPTY;
    for (place, byte) in result.0[..255].iter_mut().zip(bytes) {
        *place = byte;
    }
    result
}

/// A count or position as an index: below 0 is 0.
fn count(n: i16) -> usize {
    usize::try_from(n).unwrap_or(0)
}

native_fn! {
    /// Machine time in milliseconds; wraps after 49 days. Constant during a scan.
    pub fn TIME as MachineTime(cx) -> StTime { Ok(StTime((cx.now.0 / 1_000_000) as u32)) }
}
native_fn! {
    /// Machine time in nanoseconds. Constant during a scan.
    pub fn LTIME as MachineLtime(cx) -> StLtime { Ok(StLtime(cx.now.0)) }
}
native_fn! {
    /// Length in bytes (IEC 61131-3, table 34).
    pub fn LEN as Len(_cx, STR: Text) -> i16 { Ok(STR.bytes().len() as i16) }
}
native_fn! {
    /// The first `SIZE` bytes.
    pub fn LEFT as Left(_cx, STR: Text, SIZE: i16) -> Text { Ok(text(STR.bytes().iter().copied().take(count(SIZE)))) }
}
native_fn! {
    /// The last `SIZE` bytes.
    pub fn RIGHT as Right(_cx, STR: Text, SIZE: i16) -> Text {
        let bytes = STR.bytes();
        Ok(text(bytes[bytes.len() - count(SIZE).min(bytes.len())..].iter().copied()))
    }
}
native_fn! {
    /// `LEN` bytes from position `POS`.
    pub fn MID as Mid(_cx, STR: Text, LEN: i16, POS: i16) -> Text {
        Ok(text(STR.bytes().iter().copied().skip(count(POS).saturating_sub(1)).take(count(LEN))))
    }
}
native_fn! {
    /// `STR1` followed by `STR2`, at most 255 bytes.
    pub fn CONCAT as Concat(_cx, STR1: Text, STR2: Text) -> Text { Ok(text(STR1.bytes().iter().chain(STR2.bytes()).copied())) }
}
native_fn! {
    /// `STR1` with `STR2` put in behind position `POS`.
    pub fn INSERT as Insert(_cx, STR1: Text, STR2: Text, POS: i16) -> Text {
        let (head, tail) = STR1.bytes().split_at(count(POS).min(STR1.bytes().len()));
        Ok(text(head.iter().chain(STR2.bytes()).chain(tail).copied()))
    }
}
native_fn! {
    /// `STR` without `LEN` bytes from position `POS`.
    pub fn DELETE as Delete(_cx, STR: Text, LEN: i16, POS: i16) -> Text { Ok(replaced(STR.bytes(), &[], LEN, POS)) }
}
native_fn! {
    /// `STR1` with `L` bytes from position `P` replaced by `STR2`.
    pub fn REPLACE as Replace(_cx, STR1: Text, STR2: Text, L: i16, P: i16) -> Text { Ok(replaced(STR1.bytes(), STR2.bytes(), L, P)) }
}
native_fn! {
    /// Position of the first `STR2` in `STR1`; 0 if there is none.
    pub fn FIND as Find(_cx, STR1: Text, STR2: Text) -> i16 {
        let (all, part) = (STR1.bytes(), STR2.bytes());
        if part.is_empty() {
            return Ok(0);
        }
        Ok(all.windows(part.len()).position(|w| w == part).map_or(0, |i| i as i16 + 1))
    }
}

/// `all` with `length` bytes from `position` replaced.
fn replaced(all: &[u8], with: &[u8], length: i16, position: i16) -> Text {
    let start = count(position).saturating_sub(1).min(all.len());
    let end = (start + count(length)).min(all.len());
    text(all[..start].iter().chain(with).chain(&all[end..]).copied())
}

native_fn! {
    /// An integer in decimal digits.
    pub fn LINT_TO_STRING as LintToString(_cx, IN: i64) -> Text { Ok(text(IN.to_string().bytes())) }
}
native_fn! {
    /// An unsigned integer in decimal digits.
    pub fn ULINT_TO_STRING as UlintToString(_cx, IN: u64) -> Text { Ok(text(IN.to_string().bytes())) }
}
native_fn! {
    /// The shortest digits that give the same REAL.
    pub fn REAL_TO_STRING as RealToString(_cx, IN: f32) -> Text { Ok(text(format!("{IN:?}").bytes())) }
}
native_fn! {
    /// The shortest digits that give the same LREAL.
    pub fn LREAL_TO_STRING as LrealToString(_cx, IN: f64) -> Text { Ok(text(format!("{IN:?}").bytes())) }
}
native_fn! {
    /// TRUE or FALSE.
    pub fn BOOL_TO_STRING as BoolToString(_cx, IN: Bool) -> Text { Ok(Text::new(if IN.get() { "TRUE" } else { "FALSE" })) }
}
native_fn! {
    /// As a literal: `T#1m2s3ms`.
    pub fn TIME_TO_STRING as TimeToString(_cx, IN: StTime) -> Text { Ok(duration("T#", i128::from(IN.0) * 1_000_000)) }
}
native_fn! {
    /// As a literal: `LTIME#1s500us`.
    pub fn LTIME_TO_STRING as LtimeToString(_cx, IN: StLtime) -> Text { Ok(duration("LTIME#", IN.0.into())) }
}
native_fn! {
    /// As a literal: `D#2024-01-31`.
    pub fn DATE_TO_STRING as DateToString(_cx, IN: StDate) -> Text { Ok(text(format!("D#{}", day(IN.0)).bytes())) }
}
native_fn! {
    /// As a literal: `TOD#12:30:15.250`.
    pub fn TOD_TO_STRING as TodToString(_cx, IN: StTimeOfDay) -> Text { Ok(text(format!("TOD#{}.{:03}", clock(IN.0 / 1000), IN.0 % 1000).bytes())) }
}
native_fn! {
    /// As a literal: `DT#2024-01-31-12:30:15`.
    pub fn DT_TO_STRING as DtToString(_cx, IN: StDateTime) -> Text { Ok(text(format!("DT#{}-{}", day(IN.0), clock(IN.0 % 86_400)).bytes())) }
}
native_fn! {
    /// The number at the start of the text; 0 if there is none. `16#` and other bases are understood.
    pub fn STRING_TO_LINT as StringToLint(_cx, IN: Text) -> i64 { Ok(integer(&IN.to_text())) }
}
native_fn! {
    /// The number at the start of the text; 0 if there is none.
    pub fn STRING_TO_LREAL as StringToLreal(_cx, IN: Text) -> f64 { Ok(number(&IN.to_text())) }
}
native_fn! {
    /// TRUE for `TRUE` in any case.
    pub fn STRING_TO_BOOL as StringToBool(_cx, IN: Text) -> Bool { Ok(IN.to_text().trim().eq_ignore_ascii_case("TRUE").into()) }
}
native_fn! {
    /// The duration of a literal such as `T#1s500ms`; 0 if it is none.
    pub fn STRING_TO_LTIME as StringToLtime(_cx, IN: Text) -> StLtime { Ok(StLtime(span(&IN.to_text()).unwrap_or(0))) }
}

const UNITS: [(&str, i128); 7] = [
    ("d", 86_400_000_000_000),
    ("h", 3_600_000_000_000),
    ("m", 60_000_000_000),
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1000),
    ("ns", 1),
];

fn duration(prefix: &str, ns: i128) -> Text {
    let mut result = String::from(prefix);
    if ns < 0 {
        result.push('-');
    }
    let mut rest = ns.abs();
    for (unit, size) in UNITS {
        if rest >= size {
            result.push_str(&format!("{}{unit}", rest / size));
            rest %= size;
        }
    }
    if ns == 0 {
        result.push_str(if prefix == "T#" { "0ms" } else { "0ns" });
    }
    text(result.bytes())
}

/// Civil date of seconds since 1970 (proleptic Gregorian calendar).
fn day(seconds: u32) -> String {
    let days = i64::from(seconds / 86_400) + 719_468;
    let era = days / 146_097;
    let of_era = days % 146_097;
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * of_year + 2) / 153;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{:02}", of_year - (153 * shifted + 2) / 5 + 1)
}

fn clock(seconds: u32) -> String {
    format!("{:02}:{:02}:{:02}", seconds / 3600 % 24, seconds / 60 % 60, seconds % 60)
}

fn integer(text: &str) -> i64 {
    let text = text.trim();
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (base, digits) = match digits.split_once('#').and_then(|(b, d)| Some((b.parse().ok().filter(|b| (2..=16).contains(b))?, d))) {
        Some((base, digits)) => (base, digits),
        None => (10, digits),
    };
    let end = digits.find(|c: char| !c.is_digit(base)).unwrap_or(digits.len());
    let value = u64::from_str_radix(&digits[..end], base).unwrap_or(0) as i64;
    if negative { value.wrapping_neg() } else { value }
}

fn number(text: &str) -> f64 {
    let text = text.trim();
    let end = (0..=text.len()).rev().find(|n| text.is_char_boundary(*n) && text[..*n].parse::<f64>().is_ok());
    end.map_or(0.0, |n| text[..n].parse().unwrap_or(0.0))
}

fn span(text: &str) -> Option<i64> {
    let mut rest = text.trim().split_once('#')?.1;
    let mut total = 0i128;
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit())?;
        let unit_end = rest[digits..].find(|c: char| c.is_ascii_digit()).map_or(rest.len(), |n| n + digits);
        let unit = rest[digits..unit_end].to_ascii_lowercase();
        let size = UNITS.iter().find(|(name, _)| *name == unit)?.1;
        total += rest[..digits].parse::<i128>().ok()?.checked_mul(size)?;
        rest = &rest[unit_end..];
    }
    i64::try_from(total).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_strings_count_from_one_and_never_leave_it() {
        let s = text(*b"ABCDEF");
        assert_eq!(replaced(s.bytes(), b"xy", 2, 3).bytes(), b"ABxyEF");
        assert_eq!(replaced(s.bytes(), b"", 9, 5).bytes(), b"ABCD");
        assert_eq!(replaced(s.bytes(), b"!", -1, 99).bytes(), b"ABCDEF!");
    }

    #[test]
    fn numbers_and_times_are_read_from_text() {
        assert_eq!((integer("-12abc"), integer("16#FF"), integer(""), integer("99999999999999999999")), (-12, 255, 0, 0));
        assert_eq!((number("1.5e3mm"), number("x")), (1500.0, 0.0));
        assert_eq!((span("T#1s500ms"), span("T#5x")), (Some(1_500_000_000), None));
    }

    #[test]
    fn dates_are_civil() {
        assert_eq!((day(0), day(951_782_400), clock(86_399)), ("1970-01-01".into(), "2000-02-29".into(), "23:59:59".into()));
    }
}
