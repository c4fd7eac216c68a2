//! Where numbers, durations and dates end, and what a prefix `NAME#` or a full-width sign stands for.

use super::Kind;

/// What follows `PREFIX#`.
#[derive(Clone, Copy)]
pub(super) enum PrefixClass {
    Duration,
    Date,
    DateTime,
    Number,
    Text,
}

pub(super) fn prefix_class(word: &str) -> Option<PrefixClass> {
    const TABLE: &[(&str, PrefixClass)] = &[
        ("T", PrefixClass::Duration),
        ("TIME", PrefixClass::Duration),
        ("LT", PrefixClass::Duration),
        ("LTIME", PrefixClass::Duration),
        ("D", PrefixClass::Date),
        ("DATE", PrefixClass::Date),
        ("LD", PrefixClass::Date),
        ("LDATE", PrefixClass::Date),
        ("TOD", PrefixClass::DateTime),
        ("TIME_OF_DAY", PrefixClass::DateTime),
        ("LTOD", PrefixClass::DateTime),
        ("LTIME_OF_DAY", PrefixClass::DateTime),
        ("DT", PrefixClass::DateTime),
        ("DATE_AND_TIME", PrefixClass::DateTime),
        ("LDT", PrefixClass::DateTime),
        ("LDATE_AND_TIME", PrefixClass::DateTime),
        ("BOOL", PrefixClass::Number),
        ("BIT", PrefixClass::Number),
        ("BYTE", PrefixClass::Number),
        ("WORD", PrefixClass::Number),
        ("DWORD", PrefixClass::Number),
        ("LWORD", PrefixClass::Number),
        ("SINT", PrefixClass::Number),
        ("INT", PrefixClass::Number),
        ("DINT", PrefixClass::Number),
        ("LINT", PrefixClass::Number),
        ("USINT", PrefixClass::Number),
        ("UINT", PrefixClass::Number),
        ("UDINT", PrefixClass::Number),
        ("ULINT", PrefixClass::Number),
        ("REAL", PrefixClass::Number),
        ("LREAL", PrefixClass::Number),
        ("STRING", PrefixClass::Text),
        ("WSTRING", PrefixClass::Text),
        ("UTF8", PrefixClass::Text),
        ("CHAR", PrefixClass::Text),
        ("WCHAR", PrefixClass::Text),
    ];
    TABLE.iter().find(|(text, _)| text.eq_ignore_ascii_case(word)).map(|(_, class)| *class)
}

/// Behind the last byte from `at` on that satisfies `belongs`.
pub(super) fn run(bytes: &[u8], at: usize, belongs: impl Fn(u8) -> bool) -> usize {
    bytes[at..].iter().position(|&byte| !belongs(byte)).map_or(bytes.len(), |length| at + length)
}

/// Behind the last letter, digit or `_` from `at` on.
pub(super) fn word_end(text: &str, at: usize) -> usize {
    text[at..].find(|c: char| !c.is_alphanumeric() && c != '_').map_or(text.len(), |length| at + length)
}

/// The end of the number that begins at `at`, which is a digit.
pub(super) fn scan_number(bytes: &[u8], at: usize) -> (usize, Kind) {
    let digit = |byte: u8| byte.is_ascii_digit() || byte == b'_';
    let mut end = run(bytes, at, digit);
    let mut kind = Kind::Int;
    if bytes.get(end) == Some(&b'#') {
        return (run(bytes, end + 1, |byte| byte.is_ascii_alphanumeric() || byte == b'_'), Kind::Literal);
    }
    if bytes.get(end) == Some(&b'.') && bytes.get(end + 1).is_some_and(u8::is_ascii_digit) {
        end = run(bytes, end + 1, digit);
        kind = Kind::Literal;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        if bytes.get(end + 1 + sign).is_some_and(u8::is_ascii_digit) {
            return (run(bytes, end + 1 + sign, |byte| byte.is_ascii_digit()), Kind::Literal);
        }
    }
    (end, kind)
}

/// Lines of a text behind its first that are looked at for its end.
const MORE_LINES: usize = 8;

/// The closing quote of a text that goes on behind a line break, as CODESYS reads it. A quote that was forgotten is not such a text: assignments or statements
/// follow it, or the next line has texts of its own.
pub(super) fn text_over_lines(bytes: &[u8], line_break: usize, quote: u8) -> Option<usize> {
    let mut at = line_break + 1;
    for _ in 0..MORE_LINES {
        let end = run(bytes, at, |byte| byte != b'\n');
        let line = &bytes[at..end];
        if let Some(close) = line.iter().position(|&byte| byte == quote) {
            let is_text = !line[..close].contains(&b';') && !line[..close].windows(2).any(|pair| pair == b":=");
            let is_odd = line.iter().filter(|&&byte| byte == quote).count() % 2 == 1;
            return (is_text && is_odd).then_some(at + close);
        }
        if end == bytes.len() || line.contains(&b';') || line.windows(2).any(|pair| pair == b":=") {
            return None;
        }
        at = end + 1;
    }
    None
}

pub(super) fn scan_duration(bytes: &[u8], from: usize) -> usize {
    let mut end = from + usize::from(matches!(bytes.get(from), Some(b'+' | b'-')));
    loop {
        end = run(bytes, end, |byte| byte.is_ascii_alphanumeric() || byte == b'_');
        let fraction = bytes.get(end) == Some(&b'.') && bytes.get(end + 1).is_some_and(u8::is_ascii_digit);
        if !fraction {
            return end;
        }
        end += 1;
    }
}

pub(super) fn scan_date(bytes: &[u8], from: usize, with_time: bool) -> usize {
    let mut end = from;
    while let Some(&byte) = bytes.get(end) {
        let next_is_digit = bytes.get(end + 1).is_some_and(u8::is_ascii_digit);
        let belongs = match byte {
            b'0'..=b'9' | b'_' => true,
            b'-' => next_is_digit,
            b':' | b'.' => with_time && next_is_digit,
            _ => false,
        };
        if !belongs {
            break;
        }
        end += 1;
    }
    end
}

/// The sign that a full-width character stands for.
pub(super) fn full_width(stranger: char) -> Option<Kind> {
    Some(match stranger {
        '\u{ff1b}' => Kind::Semi,
        '\u{ff1a}' => Kind::Colon,
        '\u{ff0c}' | '\u{3001}' => Kind::Comma,
        '\u{ff08}' => Kind::LParen,
        '\u{ff09}' => Kind::RParen,
        '\u{ff3b}' | '\u{3010}' => Kind::LBracket,
        '\u{ff3d}' | '\u{3011}' => Kind::RBracket,
        '\u{ff1d}' => Kind::Eq,
        '\u{ff1c}' => Kind::Lt,
        '\u{ff1e}' => Kind::Gt,
        '\u{ff0b}' => Kind::Plus,
        '\u{ff0d}' | '\u{2212}' | '\u{2013}' | '\u{2014}' => Kind::Minus,
        '\u{ff0a}' | '\u{00d7}' => Kind::Star,
        '\u{ff0f}' | '\u{00f7}' => Kind::Slash,
        '\u{ff0e}' | '\u{3002}' => Kind::Dot,
        '\u{ff06}' => Kind::Amp,
        '\u{ff3e}' => Kind::Caret,
        '\u{2264}' => Kind::Le,
        '\u{2265}' => Kind::Ge,
        '\u{2260}' => Kind::Ne,
        _ => return None,
    })
}
