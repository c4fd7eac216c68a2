//! Values of literals (IEC 61131-3, tables 5 to 9).
//!
//! Promises: a value is exact, or there is a message; nothing wraps. Durations and dates are in nanoseconds and days; how fine they may be is left to
//! the types of the program.

use super::Parser;
use super::expressions::Tall;
use crate::lexer::{Kind, Token, shorten};
use crate::tree::{Expr, ExprKind, Literal, LiteralValue, Name};
use crate::{Code, Diagnostic};

/// What is wrong with a literal, and what to do.
type Fault = (&'static str, Option<&'static str>);

impl Parser<'_> {
    /// The value of a token that was taken.
    pub(super) fn literal(&mut self, token: Token) -> Tall {
        let text = self.text_of(token);
        let span = self.span_of(token);
        let result = match token.kind {
            Kind::True => Ok((None, LiteralValue::Bool(true))),
            Kind::False => Ok((None, LiteralValue::Bool(false))),
            _ => value(text),
        };
        let kind = match result {
            Ok((ty, value)) => {
                let ty = ty.map(|text| Name {
                    span: crate::Span { end: span.start + text.len() as u32, ..span },
                    text: text.to_ascii_uppercase(),
                });
                ExprKind::Literal(Literal { ty, value })
            }
            Err((why, help)) => {
                let mut diagnostic = Diagnostic::new(Code::BadLiteral, span, format!("`{}` {why}", shorten(text)));
                diagnostic.help = help.map(str::to_owned);
                self.tell(diagnostic);
                ExprKind::Error
            }
        };
        Tall { expr: Expr { kind, span }, height: 1, is_bracketed: false }
    }
}

/// Type before the `#` and value.
fn value(text: &str) -> Result<(Option<&str>, LiteralValue), Fault> {
    match text.as_bytes().first() {
        Some(b'0'..=b'9') => Ok((None, number(text)?)),
        Some(b'\'') => Ok((None, LiteralValue::String(narrow(text)?))),
        Some(b'"') => Ok((None, LiteralValue::WString(wide(text)?))),
        _ => typed(text),
    }
}

fn typed(text: &str) -> Result<(Option<&str>, LiteralValue), Fault> {
    let (prefix, body) = text.split_once('#').ok_or(("is not a literal", None))?;
    let upper = prefix.to_ascii_uppercase();
    let value = match upper.as_str() {
        "T" | "TIME" => LiteralValue::Time(duration(body)?),
        "LT" | "LTIME" => LiteralValue::Ltime(duration(body)?),
        "D" | "DATE" => LiteralValue::Date(date(body)?),
        "LD" | "LDATE" => LiteralValue::Ldate(date(body)?),
        "TOD" | "TIME_OF_DAY" => LiteralValue::Tod(time_of_day(body)?),
        "LTOD" | "LTIME_OF_DAY" => LiteralValue::Ltod(time_of_day(body)?),
        "DT" | "DATE_AND_TIME" => LiteralValue::Dt(date_and_time(body)?),
        "LDT" | "LDATE_AND_TIME" => LiteralValue::Ldt(date_and_time(body)?),
        "BOOL" => return Ok((Some(prefix), truth(body)?)),
        "REAL" | "LREAL" => return Ok((Some(prefix), real(body)?)),
        // A STRING is UTF-8 anyhow.
        "UTF8" => text_of_type(body, false)?,
        "STRING" | "CHAR" | "WSTRING" | "WCHAR" => return Ok((Some(prefix), text_of_type(body, upper.starts_with('W'))?)),
        _ => return Ok((Some(prefix), signed(body)?)),
    };
    Ok((None, value))
}

fn text_of_type(body: &str, is_wide: bool) -> Result<LiteralValue, Fault> {
    match (body.as_bytes().first(), is_wide) {
        (Some(b'\''), false) => Ok(LiteralValue::String(narrow(body)?)),
        (Some(b'"'), true) => Ok(LiteralValue::WString(wide(body)?)),
        (_, false) => Err(("must stand in `'`", None)),
        (_, true) => Err(("must stand in `\"`", None)),
    }
}

fn truth(body: &str) -> Result<LiteralValue, Fault> {
    match body.to_ascii_uppercase().as_str() {
        "TRUE" | "1" => Ok(LiteralValue::Bool(true)),
        "FALSE" | "0" => Ok(LiteralValue::Bool(false)),
        _ => match number(body) {
            Ok(LiteralValue::Int(value @ 0..=1)) => Ok(LiteralValue::Bool(value == 1)),
            _ => Err(("is no BOOL", Some("a BOOL is TRUE, FALSE, 1 or 0"))),
        },
    }
}

fn sign(body: &str) -> (bool, &str) {
    match body.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, body.strip_prefix('+').unwrap_or(body)),
    }
}

fn signed(body: &str) -> Result<LiteralValue, Fault> {
    let (negative, magnitude) = sign(body);
    match number(magnitude)? {
        LiteralValue::Int(value) => Ok(LiteralValue::Int(if negative { -value } else { value })),
        _ => Err(("is not a whole number", Some("a REAL is written `REAL#1.5` or `1.5`"))),
    }
}

fn real(body: &str) -> Result<LiteralValue, Fault> {
    let (negative, magnitude) = sign(body);
    let value = match number(magnitude)? {
        LiteralValue::Int(value) => value as f64,
        LiteralValue::Real(value) => value,
        _ => return Err(NOT_A_NUMBER),
    };
    Ok(LiteralValue::Real(if negative { -value } else { value }))
}

const NOT_A_NUMBER: Fault = ("is not a number", None);
const TOO_LARGE: Fault = ("is too large for any type", None);

/// An unsigned number, whole, with a base, or real.
fn number(text: &str) -> Result<LiteralValue, Fault> {
    check_underscores(text)?;
    if let Some((base, digits)) = text.split_once('#') {
        let base: u32 = base.parse().map_err(|_| NOT_A_NUMBER)?;
        if !matches!(base, 2 | 8 | 10 | 16) {
            return Err(("has a base other than 2, 8, 10 and 16", None));
        }
        return whole(digits, base).map(LiteralValue::Int);
    }
    if text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'_') {
        return whole(text, 10).map(LiteralValue::Int);
    }
    let plain: String = text.chars().filter(|&c| c != '_').collect();
    match plain.parse::<f64>() {
        Ok(value) if value.is_finite() && plain.starts_with(|c: char| c.is_ascii_digit()) => Ok(LiteralValue::Real(value)),
        Ok(_) => Err(TOO_LARGE),
        Err(_) => Err(NOT_A_NUMBER),
    }
}

fn check_underscores(text: &str) -> Result<(), Fault> {
    let misplaced = text.ends_with('_') || text.contains("__") || text.contains("_.") || text.contains("._") || text.contains("#_");
    if misplaced { Err(("has a `_` that is not between two digits", None)) } else { Ok(()) }
}

fn whole(digits: &str, base: u32) -> Result<i128, Fault> {
    let mut value: u64 = 0;
    let mut any = false;
    for digit in digits.chars().filter(|&c| c != '_') {
        let digit = digit.to_digit(base).ok_or(("has a digit that its base does not have", None))?;
        let next = value.checked_mul(u64::from(base)).and_then(|value| value.checked_add(u64::from(digit)));
        value = next.ok_or(TOO_LARGE)?;
        any = true;
    }
    if any { Ok(i128::from(value)) } else { Err(NOT_A_NUMBER) }
}

/// Units of a duration, from the largest, in nanoseconds.
const UNITS: &[(&str, i128)] = &[
    ("d", 86_400_000_000_000),
    ("h", 3_600_000_000_000),
    ("m", 60_000_000_000),
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1000),
    ("ns", 1),
];

const DURATION_HELP: Option<&str> = Some("write for example `T#1h30m`, `T#250ms` or `T#1.5s`, the larger unit first");

/// `-1d2h3m4s5ms6us7ns`; the last part may have decimals, which below a nanosecond are rounded.
fn duration(body: &str) -> Result<i128, Fault> {
    let (negative, mut rest) = sign(body);
    let mut total: i128 = 0;
    let mut next_unit = 0;
    if rest.is_empty() {
        return Err(("has no duration", DURATION_HELP));
    }
    while !rest.is_empty() {
        rest = rest.strip_prefix('_').unwrap_or(rest);
        let (digits, tail) = rest.split_at(rest.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(rest.len()));
        let (unit, tail) = tail.split_at(tail.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(tail.len()));
        let digits = digits.trim_end_matches('_');
        let found = UNITS.iter().position(|(name, _)| name.eq_ignore_ascii_case(unit));
        let index = found.ok_or(("has a part without a unit d, h, m, s, ms, us or ns", DURATION_HELP))?;
        if index < next_unit {
            return Err(("names a unit twice or a smaller one first", DURATION_HELP));
        }
        if digits.contains('.') && !tail.is_empty() {
            return Err(("has decimals before its last part", DURATION_HELP));
        }
        next_unit = index + 1;
        total = total.checked_add(scaled(digits, UNITS[index].1)?).ok_or(TOO_LARGE)?;
        rest = tail;
    }
    if total > i128::from(u64::MAX) {
        return Err(TOO_LARGE);
    }
    Ok(if negative { -total } else { total })
}

/// `digits` with decimals times `unit`, rounded half up, exact otherwise.
fn scaled(digits: &str, unit: i128) -> Result<i128, Fault> {
    let (before, after) = digits.split_once('.').unwrap_or((digits, ""));
    let plain = |text: &str| text.chars().filter(|&c| c != '_').collect::<String>();
    let mut total = whole(before, 10).map_err(|_| ("has a part without a number", DURATION_HELP))?.checked_mul(unit).ok_or(TOO_LARGE)?;
    // Eighteen decimals of a day are below a nanosecond by far.
    let decimals: String = plain(after).chars().take(18).collect();
    if !decimals.is_empty() {
        let scale = 10_i128.pow(decimals.len() as u32);
        total += (whole(&decimals, 10)? * unit * 2 + scale) / (2 * scale);
    }
    Ok(total)
}

const DATE_HELP: Option<&str> = Some("a date is written `D#2024-01-31`");
const TOD_HELP: Option<&str> = Some("a time of day is written `TOD#23:59:59.999`");

fn part(text: &str, range: std::ops::RangeInclusive<i64>) -> Option<i64> {
    let plain: String = text.chars().filter(|&c| c != '_').collect();
    plain.parse().ok().filter(|value| range.contains(value))
}

/// Days since 1970-01-01 in the Gregorian calendar.
fn date(body: &str) -> Result<i64, Fault> {
    let mut parts = body.split('-');
    let fault = ("is no date of the calendar", DATE_HELP);
    let year = parts.next().and_then(|text| part(text, 1..=9999)).ok_or(fault)?;
    let month = parts.next().and_then(|text| part(text, 1..=12)).ok_or(fault)?;
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let length = match month {
        2 => 28 + i64::from(leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    };
    let day = parts.next().and_then(|text| part(text, 1..=length)).ok_or(fault)?;
    if parts.next().is_some() {
        return Err(fault);
    }
    // Days of a year that begins in March, so that the leap day is its last.
    let (years, months) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days = years * 365 + years.div_euclid(4) - years.div_euclid(100) + years.div_euclid(400) + (153 * months + 2) / 5 + day - 1;
    Ok(days - 719_468)
}

/// Nanoseconds since midnight of `12:00` or `12:00:00.123`.
fn time_of_day(body: &str) -> Result<i64, Fault> {
    let fault = ("is no time of the day", TOD_HELP);
    let mut parts = body.split(':');
    let hour = parts.next().and_then(|text| part(text, 0..=23)).ok_or(fault)?;
    let minute = parts.next().and_then(|text| part(text, 0..=59)).ok_or(fault)?;
    let second = match parts.next() {
        Some(text) => scaled(text, 1_000_000_000).map_err(|_| fault)?,
        None => 0,
    };
    if parts.next().is_some() || second >= 60_000_000_000 {
        return Err(fault);
    }
    Ok((hour * 60 + minute) * 60_000_000_000 + second as i64)
}

/// Nanoseconds since 1970 of `2024-01-31-12:00:00.5`.
fn date_and_time(body: &str) -> Result<i128, Fault> {
    let split = body.match_indices('-').nth(2).map(|(at, _)| at);
    let at = split.ok_or(("is no date and time", Some("write `DT#2024-01-31-23:59:59`")))?;
    let days = date(&body[..at])?;
    let time = time_of_day(&body[at + 1..])?;
    Ok(i128::from(days) * 86_400_000_000_000 + i128::from(time))
}

const ESCAPE: Fault = (
    "has an unknown `$` escape",
    Some("known are $N $L $R $T $P $$ $' $\" and two (in \"…\" four) hexadecimal digits; a `$` itself is `$$`"),
);

/// The character of `$N` and the like.
fn escape(letter: u8) -> Option<u8> {
    Some(match letter.to_ascii_uppercase() {
        b'N' | b'L' => b'\n',
        b'R' => b'\r',
        b'T' => b'\t',
        b'P' => 0x0c,
        b'$' | b'\'' | b'"' => letter,
        _ => return None,
    })
}

/// Bytes of `'text'`.
fn narrow(text: &str) -> Result<Vec<u8>, Fault> {
    let body = &text.as_bytes()[1..text.len() - 1];
    let mut out = Vec::with_capacity(body.len());
    let mut at = 0;
    while let Some(&byte) = body.get(at) {
        at += 1;
        if byte != b'$' {
            out.push(byte);
            continue;
        }
        let letter = *body.get(at).ok_or(ESCAPE)?;
        let hex = body.get(at..at + 2).and_then(hexadecimal);
        match (escape(letter), hex) {
            (Some(plain), _) => {
                out.push(plain);
                at += 1;
            }
            (None, Some(code)) => {
                out.push(code as u8);
                at += 2;
            }
            (None, None) => return Err(ESCAPE),
        }
    }
    Ok(out)
}

/// Code units of `"text"`.
fn wide(text: &str) -> Result<Vec<u16>, Fault> {
    let body = &text[1..text.len() - 1];
    let mut out = Vec::with_capacity(body.len());
    let mut rest = body.chars();
    let mut unit = [0; 2];
    while let Some(c) = rest.next() {
        if c != '$' {
            out.extend_from_slice(c.encode_utf16(&mut unit));
            continue;
        }
        let tail = rest.as_str().as_bytes();
        let letter = *tail.first().ok_or(ESCAPE)?;
        let hex = tail.get(..4).and_then(hexadecimal);
        let skip = match (escape(letter), hex) {
            (Some(plain), _) => {
                out.push(u16::from(plain));
                1
            }
            (None, Some(code)) => {
                out.push(code);
                4
            }
            (None, None) => return Err(ESCAPE),
        };
        rest.nth(skip - 1);
    }
    Ok(out)
}

fn hexadecimal(digits: &[u8]) -> Option<u16> {
    digits.iter().try_fold(0_u16, |value, &digit| Some(value << 4 | (digit as char).to_digit(16)? as u16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FileId, parse_expression};

    #[track_caller]
    fn check(text: &str, expected: LiteralValue) {
        let (expr, diagnostics) = parse_expression(FileId(0), text);
        assert_eq!(diagnostics, [], "{text}");
        let ExprKind::Literal(literal) = expr.kind else { panic!("{text}: {expr:?}") };
        assert_eq!(literal.value, expected, "{text}");
    }

    #[track_caller]
    fn refused(text: &str) {
        let (expr, diagnostics) = parse_expression(FileId(0), text);
        assert!(matches!(expr.kind, ExprKind::Error), "{text}: {expr:?}");
        let codes: Vec<_> = diagnostics.iter().map(|d| (d.code.text(), d.span.start, d.span.end as usize)).collect();
        assert_eq!(codes, [("E0104", 0, text.len())], "{text}");
    }

    #[test]
    fn numbers() {
        use LiteralValue::*;
        for (text, value) in [
            ("0", Int(0)),
            ("1_000", Int(1000)),
            ("16#FF", Int(255)),
            ("2#1010_1010", Int(170)),
            ("8#17", Int(15)),
            ("10#9", Int(9)),
            ("18446744073709551615", Int(u64::MAX.into())),
            ("INT#5", Int(5)),
            ("INT#-5", Int(-5)),
            ("WORD#16#ffff", Int(65535)),
            ("DINT#2#11", Int(3)),
            ("1.5", Real(1.5)),
            ("1_0.2_5e-3", Real(0.01025)),
            ("1e3", Real(1000.0)),
            ("REAL#-1.5E2", Real(-150.0)),
            ("LREAL#3", Real(3.0)),
            ("TRUE", Bool(true)),
            ("false", Bool(false)),
            ("BOOL#1", Bool(true)),
            ("bool#FALSE", Bool(false)),
            ("4.9e-324", Real(4.9e-324)),
        ] {
            check(text, value);
        }
        for text in [
            "18446744073709551616",
            "16#10000000000000000",
            "2#12",
            "7#1",
            "16#",
            "1e999",
            "1__0",
            "1_",
            "INT#1.5",
            "INT#x",
            "BOOL#2",
            "BYTE#",
            "REAL#x",
            "0x1F",
            "5ms",
            "1abc",
            "16#FG",
            "INT#-",
            "8#8",
            "16#_",
            "99999999999#1",
            "1.5e3e",
            "REAL#1.5x",
        ] {
            refused(text);
        }
    }

    #[test]
    fn the_type_of_a_literal_is_upper_case() {
        let (expr, _) = parse_expression(FileId(0), "int#5");
        let ExprKind::Literal(Literal { ty: Some(ty), .. }) = expr.kind else { panic!("{expr:?}") };
        assert_eq!((ty.text.as_str(), ty.span.end), ("INT", 3));
    }

    #[test]
    fn durations() {
        let check_time = |text: &str, ns: i128| check(text, LiteralValue::Time(ns));
        check_time("T#1d2h3m4s5ms6us7ns", 93_784_005_006_007);
        check_time("t#1.5s", 1_500_000_000);
        check_time("TIME#-5s", -5_000_000_000);
        check_time("T#90m", 5_400_000_000_000);
        check_time("T#1h_30m", 5_400_000_000_000);
        check_time("T#0.1ms", 100_000);
        check_time("T#0s", 0);
        check_time("T#1D", 86_400_000_000_000);
        check("LTIME#1us", LiteralValue::Ltime(1000));
        check("LT#0.5ns", LiteralValue::Ltime(1));
        for text in ["T#", "T#5", "T#1s2h", "T#1s1s", "T#1.5s2ms", "T#1x", "T#-", "T#99999999999999d", "T#ms", "T#18446744073709551615d"] {
            refused(text);
        }
    }

    #[test]
    fn dates() {
        check("D#1970-01-01", LiteralValue::Date(0));
        check("DATE#2024-02-29", LiteralValue::Date(19_782));
        check("D#2000-03-01", LiteralValue::Date(11_017));
        check("LDATE#1969-12-31", LiteralValue::Ldate(-1));
        check("TOD#12:00:00.123", LiteralValue::Tod(43_200_123_000_000));
        check("TIME_OF_DAY#23:59", LiteralValue::Tod(86_340_000_000_000));
        check("LTOD#0:0:0.000000001", LiteralValue::Ltod(1));
        check("DT#1970-01-02-00:00:01.5", LiteralValue::Dt(86_401_500_000_000));
        check("LDT#2024-01-31-12:30:00", LiteralValue::Ldt(1_706_704_200_000_000_000));
        for text in
            ["D#2023-02-29", "D#2024-13-01", "D#2024-1", "D#2024-01-01-5", "TOD#24:00", "TOD#12", "TOD#1:2:60", "DT#2024-01-31", "D#0-1-1"]
        {
            refused(text);
        }
    }

    #[test]
    fn strings() {
        let bytes = |text: &str| LiteralValue::String(text.as_bytes().to_vec());
        check("'it$'s $$5$N$L$R$T$P'", bytes("it's $5\n\n\r\t\x0c"));
        check("''", bytes(""));
        check("'$41$0d\"'", bytes("A\r\""));
        check("'温'", bytes("温"));
        check("STRING#'x'", bytes("x"));
        check("\"a$0041$\"'温\"", LiteralValue::WString("aA\"'温".encode_utf16().collect()));
        check("'$FF'", LiteralValue::String(vec![255]));
        for text in ["'$'", "'abc", "\"abc", "'a$", "'"] {
            let (_, diagnostics) = parse_expression(FileId(0), text);
            assert_eq!(diagnostics.iter().map(|d| d.code.text()).collect::<Vec<_>>(), ["E0103"], "{text}");
        }
        for text in ["'$x'", "'$4'", "\"$004\"", "'$é'", "\"$é\"", "STRING#\"a\"", "WSTRING#'a'"] {
            refused(text);
        }
    }
}
