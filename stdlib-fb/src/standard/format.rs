//! Values as text, in the formats of CODESYS.
//!
//! A REAL shows 7 significant digits, an LREAL 15, rounded half up, with at least one behind the point. REAL has an exponent from 1E08 on and below 0.0001
//! (as many digits as make the same REAL: `1.2345679E08`), LREAL from `1.0e14` on and below 1 (`1.0e-1`). What is no number is `#NaN`, `#Inf`, `-#Inf`. Times and dates are literals.

use super::{Line, Text, Wide, date, filled, written};
use std::fmt::Write;
use takt_abi::{
    Bool, FnDesc, StChar, StDate, StDateTime, StLdate, StLdateTime, StLtime, StLtimeOfDay, StTime, StTimeOfDay, StWchar, Str, WStr,
    native_fn,
};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[
    LintToString::DESC,
    UlintToString::DESC,
    RealToString::DESC,
    LrealToString::DESC,
    BoolToString::DESC,
    TimeToString::DESC,
    LtimeToString::DESC,
    DateToString::DESC,
    LdateToString::DESC,
    TodToString::DESC,
    LtodToString::DESC,
    DtToString::DESC,
    LdtToString::DESC,
    CharToString::DESC,
    WcharToString::DESC,
    StringToWstring::DESC,
];

native_fn! {
    /// An integer in decimal digits.
    pub fn LINT_TO_STRING as LintToString(_cx, IN: i64) -> Text { Ok(written(format_args!("{IN}"))) }
}
native_fn! {
    /// An unsigned integer in decimal digits.
    pub fn ULINT_TO_STRING as UlintToString(_cx, IN: u64) -> Text { Ok(written(format_args!("{IN}"))) }
}
native_fn! {
    /// A REAL with 7 significant digits: `0.7`, `1.5`, `1.2345679E08`, `1E-20`.
    pub fn REAL_TO_STRING as RealToString(_cx, IN: f32) -> Text { Ok(real(IN)) }
}
native_fn! {
    /// An LREAL with 15 significant digits: `1.5`, `7.0e-1`, `1.0e20`.
    pub fn LREAL_TO_STRING as LrealToString(_cx, IN: f64) -> Text { Ok(long_real(IN)) }
}
native_fn! {
    /// TRUE or FALSE.
    pub fn BOOL_TO_STRING as BoolToString(_cx, IN: Bool) -> Text { Ok(Text::new(if IN.get() { "TRUE" } else { "FALSE" })) }
}
native_fn! {
    /// As a literal: `T#1m2s3ms`.
    pub fn TIME_TO_STRING as TimeToString(_cx, IN: StTime) -> Text { Ok(duration("T#", i128::from(IN.0) * 1_000_000, "0ms")) }
}
native_fn! {
    /// As a literal: `LTIME#1s500us`.
    pub fn LTIME_TO_STRING as LtimeToString(_cx, IN: StLtime) -> Text { Ok(duration("LTIME#", IN.0.into(), "0ns")) }
}
native_fn! {
    /// As a literal: `D#2024-01-31`.
    pub fn DATE_TO_STRING as DateToString(_cx, IN: StDate) -> Text { Ok(written(format_args!("D#{}", Day(u64::from(IN.0) / date::DAY_SECONDS)))) }
}
native_fn! {
    /// As a literal: `LD#2024-01-31`.
    pub fn LDATE_TO_STRING as LdateToString(_cx, IN: StLdate) -> Text { Ok(written(format_args!("LD#{}", Day(IN.0 / DAY_NANOS)))) }
}
native_fn! {
    /// As a literal: `TOD#12:30:15`, with milliseconds where there are any.
    pub fn TOD_TO_STRING as TodToString(_cx, IN: StTimeOfDay) -> Text {
        Ok(written(format_args!("TOD#{}", Clock { nanos: u64::from(IN.0) * 1_000_000, digits: 3 })))
    }
}
native_fn! {
    /// As a literal: `LTOD#12:30:15`, with nanoseconds where there are any.
    pub fn LTOD_TO_STRING as LtodToString(_cx, IN: StLtimeOfDay) -> Text {
        Ok(written(format_args!("LTOD#{}", Clock { nanos: IN.0, digits: 9 })))
    }
}
native_fn! {
    /// As a literal: `DT#2024-01-31-12:30:15`.
    pub fn DT_TO_STRING as DtToString(_cx, IN: StDateTime) -> Text {
        let nanos = u64::from(IN.0) * date::SECOND_NANOS;
        Ok(written(format_args!("DT#{}-{}", Day(nanos / DAY_NANOS), Clock { nanos: nanos % DAY_NANOS, digits: 9 })))
    }
}
native_fn! {
    /// As a literal: `LDT#2024-01-31-12:30:15`, with nanoseconds where there are any.
    pub fn LDT_TO_STRING as LdtToString(_cx, IN: StLdateTime) -> Text {
        Ok(written(format_args!("LDT#{}-{}", Day(IN.0 / DAY_NANOS), Clock { nanos: IN.0 % DAY_NANOS, digits: 9 })))
    }
}
native_fn! {
    /// A text of one character.
    pub fn CHAR_TO_STRING as CharToString(_cx, IN: StChar) -> Text { Ok(Str(filled([IN.0]))) }
}
native_fn! {
    /// A text of one character, in UTF-8.
    pub fn WCHAR_TO_STRING as WcharToString(_cx, IN: StWchar) -> Text {
        Ok(written(format_args!("{}", char::from_u32(IN.0.into()).unwrap_or(char::REPLACEMENT_CHARACTER))))
    }
}
native_fn! {
    /// The text in units of 16 bits. Bytes that are no UTF-8 are taken as Latin-1.
    pub fn STRING_TO_WSTRING as StringToWstring(_cx, IN: Text) -> Wide {
        let units = IN.bytes().utf8_chunks().flat_map(|chunk| chunk.valid().encode_utf16().chain(chunk.invalid().iter().map(|b| u16::from(*b))));
        Ok(WStr(filled(units)))
    }
}

const DAY_NANOS: u64 = date::DAY_SECONDS * date::SECOND_NANOS;

/// Units of durations, from the largest.
pub(super) const UNITS: [(&str, u64); 7] =
    [("d", DAY_NANOS), ("h", 3_600_000_000_000), ("m", 60_000_000_000), ("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1000), ("ns", 1)];

fn duration(prefix: &str, nanos: i128, zero: &str) -> Text {
    let mut line = Line::new();
    line.push(prefix.as_bytes());
    if nanos < 0 {
        line.push(b"-");
    }
    let mut rest = nanos.unsigned_abs();
    for (unit, size) in UNITS {
        if rest >= u128::from(size) {
            // A line cuts, it does not fail.
            let _ = write!(line, "{}{unit}", rest / u128::from(size));
            rest %= u128::from(size);
        }
    }
    if nanos == 0 {
        line.push(zero.as_bytes());
    }
    Str(line.bytes)
}

/// A day number from 1970-01-01.
struct Day(u64);

impl std::fmt::Display for Day {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (year, month, day) = date::civil(self.0);
        write!(f, "{year:04}-{month:02}-{day:02}")
    }
}

/// A time of day, with so many digits behind the point where they are not 0.
struct Clock {
    nanos: u64,
    digits: u32,
}

impl std::fmt::Display for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (seconds, rest) = (self.nanos / date::SECOND_NANOS, self.nanos % date::SECOND_NANOS);
        write!(f, "{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)?;
        if rest == 0 {
            return Ok(());
        }
        write!(f, ".{:0width$}", rest / 10u64.pow(9 - self.digits), width = self.digits as usize)
    }
}

/// A number as so many significant digits, rounded half up, and the decimal exponent of the first.
struct Digits {
    all: [u8; 15],
    count: usize,
    exponent: i32,
}

/// Digits that decide how to round: no REAL or LREAL that is not a tie is as close to one.
const EXPANSION: usize = 60;

impl Digits {
    /// Of a positive finite number; `count` is at most 15.
    fn new(value: f64, count: usize) -> Self {
        let text = written(format_args!("{value:.EXPANSION$e}"));
        let (mantissa, exponent) = text.bytes().split_at(EXPANSION + 2);
        let exponent = std::str::from_utf8(&exponent[1..]).ok().and_then(|e| e.parse().ok()).unwrap_or(0);
        let mut digits = mantissa.iter().filter(|b| b.is_ascii_digit()).map(|b| b - b'0');
        let mut all = [0; 15];
        all[..count].iter_mut().zip(&mut digits).for_each(|(place, digit)| *place = digit);
        let mut this = Self { all, count, exponent };
        if digits.next().is_some_and(|d| d >= 5) {
            this.increment();
        }
        this
    }

    fn increment(&mut self) {
        for digit in self.all[..self.count].iter_mut().rev() {
            *digit += 1;
            if *digit < 10 {
                return;
            }
            *digit = 0;
        }
        self.all[0] = 1;
        self.exponent += 1;
    }

    /// How many there are without the zeros at the end.
    fn significant(&self) -> usize {
        self.all[..self.count].iter().rposition(|d| *d != 0).map_or(1, |i| i + 1)
    }

    fn digit(&self, place: usize) -> u8 {
        b'0' + if place < self.count { self.all[place] } else { 0 }
    }

    /// With a point and at least one digit behind it.
    fn plain(&self, line: &mut Line) {
        let before = self.exponent + 1;
        if before <= 0 {
            line.push(b"0.");
            (before..0).for_each(|_| line.push(b"0"));
            (0..self.significant()).for_each(|i| line.push(&[self.digit(i)]));
            return;
        }
        let before = before as usize;
        (0..before).for_each(|i| line.push(&[self.digit(i)]));
        line.push(b".");
        (before..self.significant().max(before + 1)).for_each(|i| line.push(&[self.digit(i)]));
    }

    /// One digit, and a point if there are more.
    fn mantissa(&self, line: &mut Line) {
        line.push(&[self.digit(0)]);
        if self.significant() > 1 {
            line.push(b".");
            (1..self.significant()).for_each(|i| line.push(&[self.digit(i)]));
        }
    }
}

/// The text of what has no digits, and the sign of what has.
fn special(value: f64, line: &mut Line) -> bool {
    match value {
        v if v.is_nan() => line.push(b"#NaN"),
        v if v.is_infinite() => line.push(if v < 0.0 { b"-#Inf" } else { b"#Inf" }),
        0.0 => line.push(b"0.0"),
        v => {
            if v < 0.0 {
                line.push(b"-");
            }
            return false;
        }
    }
    true
}

fn real(value: f32) -> Text {
    let mut line = Line::new();
    let magnitude = f64::from(value.abs());
    if special(value.into(), &mut line) {
        return Str(line.bytes);
    }
    let digits = Digits::new(magnitude, 7);
    if (-4..8).contains(&digits.exponent) && magnitude < 1e8 {
        digits.plain(&mut line);
    } else {
        let shortest = written(format_args!("{:e}", value.abs()));
        let mut parts = shortest.bytes().split(|b| *b == b'e');
        line.push(parts.next().unwrap_or(&[]));
        let exponent = parts.next().unwrap_or(b"0");
        let (sign, exponent): (&[u8], _) = exponent.strip_prefix(b"-").map_or((b"", exponent), |rest| (b"-", rest));
        line.push(b"E");
        line.push(sign);
        line.push(if exponent.len() < 2 { b"0" } else { b"" });
        line.push(exponent);
    }
    Str(line.bytes)
}

fn long_real(value: f64) -> Text {
    let mut line = Line::new();
    if special(value, &mut line) {
        return Str(line.bytes);
    }
    let digits = Digits::new(value.abs(), 15);
    if (0..14).contains(&digits.exponent) {
        digits.plain(&mut line);
    } else {
        digits.mantissa(&mut line);
        if digits.significant() == 1 {
            line.push(b".0");
        }
        // A line cuts, it does not fail.
        let _ = write!(line, "e{}", digits.exponent);
    }
    Str(line.bytes)
}

/// The number with `places` (at most 100) digits behind the point, rounded half up or cut; from 1E60 on as LREAL_TO_STRING shows it.
pub(super) fn fixed(value: f64, places: usize, round: bool) -> Text {
    if value.abs() >= 1e60 {
        return long_real(value);
    }
    let mut line = Line::new();
    if value != 0.0 && special(value, &mut line) {
        return Str(line.bytes);
    }
    // All digits that an LREAL between 1E-60 and 1E60 has are exact.
    let text = written(format_args!("{:.1$}", value.abs(), places + EXPANSION));
    let end = text.bytes().len().saturating_sub(EXPANSION);
    let (kept, cut) = text.bytes().split_at(end);
    let mut kept = filled(kept.iter().copied());
    if round && cut.first().is_some_and(|d| *d >= b'5') && carry(&mut kept[..end]) {
        line.push(b"1");
    }
    let shown = if places == 0 { end.saturating_sub(1) } else { end };
    line.push(&kept[..shown]);
    Str(line.bytes)
}

/// Adds one to the last digit; whether a digit comes before the first.
fn carry(digits: &mut [u8]) -> bool {
    for digit in digits.iter_mut().rev().filter(|b| b.is_ascii_digit()) {
        if *digit < b'9' {
            *digit += 1;
            return false;
        }
        *digit = b'0';
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn shows(found: Text, expected: &str) {
        assert_eq!(found.to_text(), expected);
    }

    #[test]
    fn a_real_shows_seven_digits() {
        for (value, text) in [
            (0.0, "0.0"),
            (-0.0, "0.0"),
            (1.0, "1.0"),
            (0.7, "0.7"),
            (-2.25, "-2.25"),
            (std::f32::consts::PI, "3.141593"),
            (1234.5678, "1234.568"),
            (100_000.0, "100000.0"),
            (99_999_990.0, "99999990.0"),
            (1e8, "1E08"),
            (123_456_789.0, "1.2345679E08"),
            (1e20, "1E20"),
            (f32::from_bits(0x5015_02f8), "9.999999E09"),
            (-1e-20, "-1E-20"),
            (1e-4, "0.0001"),
            (1e-5, "1E-05"),
            (f32::NAN, "#NaN"),
            (f32::INFINITY, "#Inf"),
            (f32::NEG_INFINITY, "-#Inf"),
        ] {
            shows(real(value), text);
        }
    }

    #[test]
    fn an_lreal_shows_fifteen_digits() {
        for (value, text) in [
            (0.0, "0.0"),
            (1.5, "1.5"),
            (0.1, "1.0e-1"),
            (0.7, "7.0e-1"),
            (1.0 / 3.0, "3.33333333333333e-1"),
            (1234.5678, "1234.5678"),
            (123_456_789.0, "123456789.0"),
            (1e13, "10000000000000.0"),
            (1e14, "1.0e14"),
            (-1e20, "-1.0e20"),
            (1_234_567_890_123_445.0, "1.23456789012345e15"),
            (1_000_000_000_000_005.0, "1.00000000000001e15"),
            (1_000_000_000_000_004.0, "1.0e15"),
            (0.999_999_999_999_999_9, "1.0"),
            (f64::MAX, "1.79769313486232e308"),
            (5e-324, "4.94065645841247e-324"),
        ] {
            shows(long_real(value), text);
        }
    }

    #[test]
    fn any_bits_show_as_a_number_that_is_close() {
        let mut bits = 0x9E37_79B9_7F4A_7C15u64;
        for _ in 0..20_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (long, short) = (f64::from_bits(bits), f32::from_bits((bits >> 32) as u32));
            if long.is_finite() {
                let back: f64 = long_real(long).to_text().parse().expect("a number");
                assert!((back - long).abs() <= long.abs() * 1e-14, "{long:e}");
            }
            if short.is_finite() {
                let back: f64 = real(short).to_text().parse().expect("a number");
                assert!((back - f64::from(short)).abs() <= f64::from(short.abs()) * 1e-6, "{short:e}");
            }
            assert!(!fixed(long, (bits % 101) as usize, bits & 1 == 0).bytes().is_empty());
        }
    }

    #[test]
    fn a_number_shows_as_many_decimals_as_are_asked_for() {
        for (value, places, round, text) in [
            (0.46523, 2, true, "0.47"),
            (0.46523, 2, false, "0.46"),
            (-1.5, 0, true, "-2"),
            (9.999, 2, true, "10.00"),
            (0.0, 3, true, "0.000"),
            (2.5, 0, true, "3"),
            (12.0, 1, false, "12.0"),
            (1e200, 2, true, "1.0e200"),
            (f64::NAN, 2, true, "#NaN"),
        ] {
            shows(fixed(value, places, round), text);
        }
    }

    #[test]
    fn times_show_as_literals() {
        shows(duration("T#", 93_784_005_000_000, "0ms"), "T#1d2h3m4s5ms");
        shows(duration("T#", 0, "0ms"), "T#0ms");
        shows(duration("LTIME#", -1_500, "0ns"), "LTIME#-1us500ns");
        shows(written(format_args!("{}", Clock { nanos: 1_500_000_000, digits: 3 })), "00:00:01.500");
        shows(written(format_args!("{}", Clock { nanos: 1_000_000_000, digits: 3 })), "00:00:01");
    }
}
