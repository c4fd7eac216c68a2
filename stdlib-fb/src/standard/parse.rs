//! Texts as values. What stands behind the value is ignored; a text that begins with none is 0, as in CODESYS.

use super::{Line, Text, Wide, date, format::UNITS};
use std::fmt::Write;
use takt_abi::{Bool, FnDesc, StChar, StLdateTime, StLtime, StLtimeOfDay, StWchar, Str, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[
    StringToLint::DESC,
    StringToReal::DESC,
    StringToLreal::DESC,
    StringToBool::DESC,
    StringToLtime::DESC,
    StringToLtod::DESC,
    StringToLdt::DESC,
    StringToChar::DESC,
    StringToWchar::DESC,
    WstringToString::DESC,
];

native_fn! {
    /// The whole number at the start of the text: `-12`, `16#FF`, `2#1111_0000`; what needs more than 64 bits is 0.
    pub fn STRING_TO_LINT as StringToLint(_cx, IN: Text) -> i64 { Ok(integer(IN.bytes())) }
}
native_fn! {
    /// The number at the start of the text: `9.876`, `1.2E-34`.
    pub fn STRING_TO_REAL as StringToReal(_cx, IN: Text) -> f32 { Ok(number(IN.bytes()).and_then(|n| n.parse()).unwrap_or(0.0)) }
}
native_fn! {
    /// The number at the start of the text: `9.876`, `1.2E-34`.
    pub fn STRING_TO_LREAL as StringToLreal(_cx, IN: Text) -> f64 { Ok(number(IN.bytes()).and_then(|n| n.parse()).unwrap_or(0.0)) }
}
native_fn! {
    /// TRUE for `TRUE` in any case.
    pub fn STRING_TO_BOOL as StringToBool(_cx, IN: Text) -> Bool { Ok(IN.bytes().trim_ascii().eq_ignore_ascii_case(b"TRUE").into()) }
}
native_fn! {
    /// The duration of a literal such as `T#1s500ms` or `LTIME#-1.5us`.
    pub fn STRING_TO_LTIME as StringToLtime(_cx, IN: Text) -> StLtime {
        Ok(StLtime(body(IN.bytes(), &["T", "TIME", "LT", "LTIME"]).and_then(span).unwrap_or(0)))
    }
}
native_fn! {
    /// The time of day of a literal such as `TOD#12:30:15.25`.
    pub fn STRING_TO_LTOD as StringToLtod(_cx, IN: Text) -> StLtimeOfDay {
        let prefixes = ["TOD", "TIME_OF_DAY", "LTOD", "LTIME_OF_DAY"];
        Ok(StLtimeOfDay(body(IN.bytes(), &prefixes).and_then(clock).unwrap_or(0)))
    }
}
native_fn! {
    /// The moment of a literal such as `DT#2024-01-31-12:30:15` or `D#2024-1-31`.
    pub fn STRING_TO_LDT as StringToLdt(_cx, IN: Text) -> StLdateTime {
        let prefixes = ["D", "DATE", "LD", "LDATE", "DT", "DATE_AND_TIME", "LDT", "LDATE_AND_TIME"];
        Ok(StLdateTime(body(IN.bytes(), &prefixes).and_then(moment).unwrap_or(0)))
    }
}
native_fn! {
    /// The first character of a text; 0 if it is empty.
    pub fn STRING_TO_CHAR as StringToChar(_cx, IN: Text) -> StChar { Ok(StChar(IN.bytes().first().copied().unwrap_or(0))) }
}
native_fn! {
    /// The first character of a text, in 16 bits; 0 if it is empty.
    pub fn STRING_TO_WCHAR as StringToWchar(_cx, IN: Text) -> StWchar { Ok(StWchar(IN.to_text().encode_utf16().next().unwrap_or(0))) }
}
native_fn! {
    /// The text in UTF-8, at most 255 bytes and cut at a character; lone surrogates become U+FFFD.
    pub fn WSTRING_TO_STRING as WstringToString(_cx, IN: Wide) -> Text {
        let mut line = Line::new();
        for character in char::decode_utf16(IN.units().iter().copied()) {
            let character = character.unwrap_or(char::REPLACEMENT_CHARACTER);
            if line.bytes().len() + character.len_utf8() > 255 {
                break;
            }
            // A line cuts, it does not fail.
            let _ = line.write_char(character);
        }
        Ok(Str(line.bytes))
    }
}

/// The number of the digits at the start and what follows them; `_` between two digits is skipped. `None` without a digit or beyond 64 bits.
fn digits(text: &[u8], base: u32) -> Option<(u64, &[u8])> {
    let value = |b: u8| char::from(b).to_digit(base);
    let (mut number, mut at) = (0u64, 0);
    while let Some(byte) = text.get(at) {
        match value(*byte) {
            Some(digit) => number = number.checked_mul(base.into())?.checked_add(digit.into())?,
            None if *byte == b'_' && at > 0 && text.get(at + 1).is_some_and(|b| value(*b).is_some()) => {}
            None => break,
        }
        at += 1;
    }
    (at > 0).then(|| (number, &text[at..]))
}

fn integer(text: &[u8]) -> i64 {
    let text = text.trim_ascii_start();
    let (negative, text) = match text.split_first() {
        Some((b'-', rest)) => (true, rest),
        Some((b'+', rest)) => (false, rest),
        _ => (false, text),
    };
    let Some((value, rest)) = digits(text, 10) else { return 0 };
    let based = rest.strip_prefix(b"#").filter(|_| (2..=16).contains(&value)).map(|rest| digits(rest, value as u32).map_or(0, |(v, _)| v));
    let value = based.unwrap_or(value) as i64;
    if negative { value.wrapping_neg() } else { value }
}

/// The text of a number, in a form that has one reading.
struct Number(Line);

impl Number {
    fn parse<T: std::str::FromStr>(&self) -> Option<T> {
        std::str::from_utf8(self.0.bytes()).ok()?.parse().ok()
    }
}

/// The number at the start of the text, without its `_`.
fn number(text: &[u8]) -> Option<Number> {
    let mut line = Line::new();
    let mut rest = text.trim_ascii_start();
    let copied = |line: &mut Line, rest: &[u8]| {
        let end = rest.iter().position(|b| !b.is_ascii_digit() && *b != b'_').unwrap_or(rest.len());
        rest[..end].iter().filter(|b| **b != b'_').for_each(|b| line.push(&[*b]));
        end
    };
    if let Some(sign @ (b'-' | b'+')) = rest.first() {
        line.push(&[*sign]);
        rest = &rest[1..];
    }
    let whole = copied(&mut line, rest);
    rest = &rest[whole..];
    let mut decimals = 0;
    if rest.first() == Some(&b'.') {
        line.push(b".");
        decimals = copied(&mut line, &rest[1..]);
        rest = &rest[1 + decimals..];
    }
    if whole + decimals == 0 {
        return None;
    }
    if let [b'e' | b'E', tail @ ..] = rest {
        let sign = usize::from(matches!(tail.first(), Some(b'-' | b'+')));
        let length = tail[sign..].iter().take_while(|b| b.is_ascii_digit()).count();
        if length > 0 {
            line.push(b"e");
            line.push(&tail[..sign + length]);
        }
    }
    Some(Number(line))
}

/// What stands behind one of the prefixes and `#`.
fn body<'a>(text: &'a [u8], prefixes: &[&str]) -> Option<&'a [u8]> {
    let text = text.trim_ascii();
    let at = text.iter().position(|b| *b == b'#')?;
    prefixes.iter().any(|p| p.as_bytes().eq_ignore_ascii_case(&text[..at])).then(|| &text[at + 1..])
}

/// Digits behind a point in billionths, and what follows.
fn billionths(text: &[u8]) -> (u64, &[u8]) {
    let Some(decimals) = text.strip_prefix(b".") else { return (0, text) };
    let end = decimals.iter().position(|b| !b.is_ascii_digit()).unwrap_or(decimals.len());
    let first = decimals[..end].iter().copied().chain(std::iter::repeat(b'0')).take(9);
    (first.fold(0, |n, b| n * 10 + u64::from(b - b'0')), &decimals[end..])
}

/// Nanoseconds of `1d2h3m4s5ms6us7ns`; a part may have decimals.
fn span(text: &[u8]) -> Option<i64> {
    let (negative, mut rest) = text.strip_prefix(b"-").map_or((false, text), |rest| (true, rest));
    let mut total = 0i128;
    while !rest.is_empty() {
        rest = rest.strip_prefix(b"_").unwrap_or(rest);
        let (whole, tail) = digits(rest, 10)?;
        let (billionths, tail) = billionths(tail);
        let end = tail.iter().position(|b| !b.is_ascii_alphabetic()).unwrap_or(tail.len());
        let size = i128::from(UNITS.iter().find(|(name, _)| name.as_bytes().eq_ignore_ascii_case(&tail[..end]))?.1);
        total += i128::from(whole) * size + i128::from(billionths) * size / 1_000_000_000;
        rest = &tail[end..];
    }
    i64::try_from(if negative { -total } else { total }).ok()
}

/// A small number and what follows the separator behind it.
fn part(text: &[u8], separator: u8) -> Option<(i64, &[u8])> {
    let (value, rest) = digits(text, 10)?;
    Some((i64::try_from(value).ok()?, rest.strip_prefix(&[separator])?))
}

/// Nanoseconds of `12:30`, `12:30:15.25`.
fn clock(text: &[u8]) -> Option<u64> {
    let (hour, rest) = part(text, b':')?;
    let (minute, rest) = digits(rest, 10)?;
    let (second, nanos) = match rest.strip_prefix(b":") {
        Some(rest) => {
            let (second, rest) = digits(rest, 10)?;
            (second, billionths(rest).0)
        }
        None => (0, 0),
    };
    date::clock(hour, i64::try_from(minute).ok()?, i64::try_from(second).ok()?, nanos as i64)
}

/// Nanoseconds from 1970 of `2024-01-31`, `2024-01-31-12:30:15`.
fn moment(text: &[u8]) -> Option<u64> {
    let (year, rest) = part(text, b'-')?;
    let (month, rest) = part(rest, b'-')?;
    let (day, rest) = digits(rest, 10)?;
    let days = date::day(year, month, i64::try_from(day).ok()?)?;
    let time = rest.strip_prefix(b"-").map_or(Some(0), clock)?;
    (days * date::DAY_SECONDS).checked_mul(date::SECOND_NANOS)?.checked_add(time)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_from_the_start_of_a_text() {
        for (text, value) in [
            ("-12abc", -12),
            ("  +7", 7),
            ("16#FF", 255),
            ("2#1111_0000", 240),
            ("1_000", 1000),
            ("", 0),
            ("abc", 0),
            ("99999999999999999999", 0),
            ("18446744073709551615", -1),
        ] {
            assert_eq!(integer(text.as_bytes()), value, "{text}");
        }
        for (text, value) in [("1.5e3mm", 1500.0), (".5", 0.5), ("2.", 2.0), ("1e", 1.0), ("-1_0.2_5", -10.25), ("1.7E+400", f64::INFINITY)]
        {
            assert_eq!(number(text.as_bytes()).and_then(|n| n.parse::<f64>()), Some(value), "{text}");
        }
        for text in ["x", "", ".", "inf", "NaN", "-"] {
            assert!(number(text.as_bytes()).is_none(), "{text}");
        }
    }

    #[test]
    fn times_are_read_from_their_literals() {
        let time = |text: &str| body(text.as_bytes(), &["T", "LTIME"]).and_then(span);
        assert_eq!(
            (time("T#1s500ms"), time("t#1.5s"), time("LTIME#-2us"), time(" T#1d_2h ")),
            (Some(1_500_000_000), Some(1_500_000_000), Some(-2000), Some(93_600_000_000_000))
        );
        assert_eq!((time("T#5x"), time("5s"), time("D#1s"), time("T#99999999999d")), (None, None, None, None));
        assert_eq!(
            (clock(b"12:30"), clock(b"00:00:01.25"), clock(b"24:00"), clock(b"12")),
            (Some(45_000_000_000_000), Some(1_250_000_000), None, None)
        );
        assert_eq!(
            (moment(b"1970-1-2"), moment(b"2024-02-30"), moment(b"1970-01-01-00:00:09.9")),
            (Some(86_400_000_000_000), None, Some(9_900_000_000))
        );
    }
    #[test]
    fn any_text_is_read_without_a_panic() {
        let letters = b"0123456789-+._:#TDLOtdhmsunE \xFF";
        let mut state = 1u64;
        for _ in 0..50_000 {
            let text: Vec<u8> = (0..state % 24)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    letters[(state >> 33) as usize % letters.len()]
                })
                .collect();
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            integer(&text);
            number(&text).map(|n| n.parse::<f64>());
            body(&text, &["T"]);
            span(&text);
            clock(&text);
            moment(&text);
        }
    }
}
