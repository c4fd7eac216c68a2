//! Literals of ST, read as the bytes of a type: what people type to set or force a variable.
//!
//! Prefixes that name the type (`INT#5`, `T#1s`) are accepted where they fit. A text without quotes is a STRING as it stands, because a shell takes
//! quotes away. NaN and the infinities have no literal.

use crate::calendar::day_of;
use crate::symbols::{closest, same};
use crate::types::{Enumeration, Type, TypeId, Types, elem_name, elem_size};
use crate::value::SPAN_UNITS;
use takt_abi::Elem;

/// Why a text is no value of a type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ValueError {
    /// Not a literal of the type.
    Malformed {
        /// The text.
        text: String,
        /// The type.
        ty: String,
        /// How such a literal is written.
        example: &'static str,
    },
    /// Outside the type's range.
    OutOfRange {
        /// The text.
        text: String,
        /// The type.
        ty: String,
        /// Lowest value.
        low: String,
        /// Highest value.
        high: String,
    },
    /// Finer than the type resolves.
    TooFine {
        /// The text.
        text: String,
        /// The type.
        ty: String,
    },
    /// A string that does not fit.
    TooLong {
        /// Bytes (WSTRING: units) of the text.
        len: usize,
        /// Bytes (units) that fit.
        cap: u32,
    },
    /// No member of the enumeration.
    UnknownMember {
        /// The text.
        text: String,
        /// The enumeration.
        ty: String,
        /// The closest member.
        suggestion: Option<String>,
    },
    /// Arrays, structures, pointers and references cannot be written as a whole.
    NotSettable {
        /// The type.
        ty: String,
    },
}

impl std::fmt::Display for ValueError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Malformed { text, ty, example } => write!(f, "`{text}` is not a value of `{ty}`; write for example `{example}`"),
            Self::OutOfRange { text, ty, low, high } => write!(f, "`{text}` is outside the range of `{ty}`, {low}..{high}"),
            Self::TooFine { text, ty } => write!(f, "`{text}` is finer than `{ty}` resolves"),
            Self::TooLong { len, cap } => write!(f, "the text is {len} long, only {cap} fit"),
            Self::UnknownMember { text, ty, suggestion } => {
                write!(f, "`{ty}` has no member `{text}`")?;
                suggestion.as_ref().map_or(Ok(()), |name| write!(f, "; did you mean `{name}`?"))
            }
            Self::NotSettable { ty } => write!(f, "a `{ty}` cannot be set as a whole; name a member or an element"),
        }
    }
}
impl std::error::Error for ValueError {}

/// The bytes of a literal of the type (as many as the type has; of a bit the byte around it with that bit), range-checked: elementary types, subranges, strings, enumerations by member or number.
pub fn parse_value(types: &Types, ty: TypeId, text: &str) -> Result<Vec<u8>, ValueError> {
    let name = types.name(ty);
    match types.get(ty) {
        Type::Elem(elem) => Literal { text, ty: &name }.elem(*elem, range(*elem)),
        Type::Bit(bit) => {
            let value = Literal { text, ty: "BOOL" }.elem(Elem::Bool, (0, 1))?;
            Ok(vec![value[0].checked_shl((*bit).into()).unwrap_or(0)])
        }
        Type::Subrange { base, low, high } => Literal { text, ty: &name }.elem(*base, (*low, *high)),
        Type::Enum(e) => Literal { text, ty: &name }.member(e),
        Type::String(cap) => Literal { text, ty: &name }.string(*cap),
        Type::WString(cap) => Literal { text, ty: &name }.wstring(*cap),
        _ => Err(ValueError::NotSettable { ty: name }),
    }
}

/// Lowest and highest value of an integer-like type in its unit.
fn range(elem: Elem) -> (i128, i128) {
    let bits = 8 * elem_size(elem);
    match elem {
        Elem::Bool => (0, 1),
        Elem::Sint | Elem::Int | Elem::Dint | Elem::Lint | Elem::Ltime => (-(1 << (bits - 1)), (1 << (bits - 1)) - 1),
        Elem::Ltod => (0, DAY - 1),
        Elem::Tod => (0, DAY / MS - 1),
        _ => (0, (1 << bits) - 1),
    }
}

const MS: i128 = 1_000_000;
const SECOND: i128 = 1_000_000_000;
const DAY: i128 = 86_400 * SECOND;

struct Literal<'a> {
    text: &'a str,
    ty: &'a str,
}

impl Literal<'_> {
    fn malformed(&self, example: &'static str) -> ValueError {
        ValueError::Malformed { text: self.text.into(), ty: self.ty.into(), example }
    }
    /// The text behind one of the prefixes, or the whole.
    fn body(&self, prefixes: &[&str]) -> &str {
        let text = self.text.trim();
        match text.split_once('#') {
            Some((prefix, rest)) if prefixes.iter().any(|p| same(p, prefix)) => rest.trim(),
            _ => text,
        }
    }
    fn has_prefix(&self, prefixes: &[&str]) -> bool {
        self.text.trim().split_once('#').is_some_and(|(prefix, _)| prefixes.iter().any(|p| same(p, prefix.trim())))
    }
    fn elem(&self, elem: Elem, range: (i128, i128)) -> Result<Vec<u8>, ValueError> {
        let unit = match elem {
            Elem::Time | Elem::Tod => MS,
            Elem::Date | Elem::Dt => SECOND,
            _ => 1,
        };
        let value = match elem {
            Elem::Real | Elem::Lreal => return self.real(elem),
            Elem::Bool => self.truth()?,
            Elem::Time => self.prefixed(&["T", "TIME"], span, "T#1s500ms")?,
            Elem::Ltime => self.prefixed(&["T", "TIME", "LT", "LTIME"], span, "LTIME#1s500us")?,
            Elem::Date | Elem::Ldate => self.prefixed(&["D", "DATE", "LD", "LDATE"], date, "D#2024-01-31")?,
            Elem::Tod | Elem::Ltod => self.prefixed(&["TOD", "TIME_OF_DAY", "LTOD", "LTIME_OF_DAY"], clock, "TOD#23:59:59.999")?,
            Elem::Dt | Elem::Ldt => {
                self.prefixed(&["DT", "DATE_AND_TIME", "LDT", "LDATE_AND_TIME"], date_and_clock, "DT#2024-01-31-23:59:59")?
            }
            Elem::Char | Elem::Wchar => self.character(elem)?,
            _ => integer(self.body(&[elem_name(elem)])).ok_or_else(|| self.malformed("5` or `16#1F"))?,
        };
        if value % unit != 0 {
            return Err(ValueError::TooFine { text: self.text.into(), ty: self.ty.into() });
        }
        self.in_range(value / unit, range, elem)
    }
    fn in_range(&self, value: i128, (low, high): (i128, i128), elem: Elem) -> Result<Vec<u8>, ValueError> {
        if (low..=high).contains(&value) {
            return Ok(value.to_le_bytes()[..elem_size(elem) as usize].to_vec());
        }
        Err(ValueError::OutOfRange { text: self.text.into(), ty: self.ty.into(), low: low.to_string(), high: high.to_string() })
    }
    fn truth(&self) -> Result<i128, ValueError> {
        match self.body(&["BOOL"]) {
            text if same(text, "TRUE") || text == "1" => Ok(1),
            text if same(text, "FALSE") || text == "0" => Ok(0),
            _ => Err(self.malformed("TRUE")),
        }
    }
    fn real(&self, elem: Elem) -> Result<Vec<u8>, ValueError> {
        let text = self.body(&["REAL", "LREAL"]);
        let plain = digits(text).filter(|t| t.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b)));
        let value = plain.and_then(|t| t.parse::<f64>().ok()).or_else(|| integer(text).map(|v| v as f64));
        let value = value.ok_or_else(|| self.malformed("1.5` or `-2.0E-3"))?;
        // Straight from the text: two roundings may differ from one.
        let narrow = plain_f32(text).unwrap_or(value as f32);
        let limit = if elem == Elem::Real { f64::from(f32::MAX) } else { f64::MAX };
        if !value.is_finite() || elem == Elem::Real && !narrow.is_finite() {
            let (low, high) = (format!("-{limit:?}"), format!("{limit:?}"));
            return Err(ValueError::OutOfRange { text: self.text.into(), ty: self.ty.into(), low, high });
        }
        Ok(if elem == Elem::Real { narrow.to_le_bytes().to_vec() } else { value.to_le_bytes().to_vec() })
    }
    fn prefixed(&self, prefixes: &[&str], read: fn(&str) -> Option<i128>, example: &'static str) -> Result<i128, ValueError> {
        Some(self.body(prefixes)).filter(|_| self.has_prefix(prefixes)).and_then(read).ok_or_else(|| self.malformed(example))
    }
    fn member(&self, e: &Enumeration) -> Result<Vec<u8>, ValueError> {
        let text = self.text.trim();
        let name = match text.split_once(['.', '#']) {
            Some((ty, member)) if same(ty.trim(), &e.name) => member.trim(),
            _ => text,
        };
        if let Some((_, value)) = e.members.iter().find(|(member, _)| same(member, name)) {
            return Ok(value.to_le_bytes()[..elem_size(e.base) as usize].to_vec());
        }
        if let Some(value) = integer(name) {
            return self.in_range(value, range(e.base), e.base);
        }
        let suggestion = closest(name, e.members.iter().map(|(member, _)| member.as_str())).map(Into::into);
        Err(ValueError::UnknownMember { text: name.into(), ty: self.ty.into(), suggestion })
    }
    fn string(&self, cap: u32) -> Result<Vec<u8>, ValueError> {
        let text = self.quoted('\'', "'text'")?.map_or_else(|| Some(self.text.into()), narrow).ok_or_else(|| self.malformed("'it$'s'"))?;
        fit(&text, cap, &[0])
    }
    fn wstring(&self, cap: u32) -> Result<Vec<u8>, ValueError> {
        let plain = || Some(self.text.encode_utf16().collect());
        let units = self.quoted('"', "\"text\"")?.map_or_else(plain, wide).ok_or_else(|| self.malformed("\"a$\"b\""))?;
        let bytes: Vec<[u8; 2]> = units.iter().map(|u| u.to_le_bytes()).collect();
        fit(&bytes, cap, &[[0; 2]]).map(|units| units.concat())
    }
    /// What stands in quotes; `None` if the text does not begin with a quote.
    fn quoted(&self, quote: char, example: &'static str) -> Result<Option<&str>, ValueError> {
        let text = self.body(&[if quote == '"' { "WSTRING" } else { "STRING" }, if quote == '"' { "WCHAR" } else { "CHAR" }]);
        if !text.starts_with(['\'', '"']) {
            return Ok(None);
        }
        let inner = text.strip_prefix(quote).and_then(|t| t.strip_suffix(quote));
        inner.map(Some).ok_or_else(|| self.malformed(example))
    }
    fn character(&self, elem: Elem) -> Result<i128, ValueError> {
        let read = match elem {
            Elem::Char => self.quoted('\'', "'a'")?.and_then(narrow).and_then(|b| <[u8; 1]>::try_from(b).ok()).map(|[b]| b.into()),
            _ => self.quoted('"', "\"a\"")?.and_then(wide).and_then(|u| <[u16; 1]>::try_from(u).ok()).map(|[u]| u.into()),
        };
        let number = || integer(self.body(&[elem_name(elem)]));
        read.or_else(number).ok_or_else(|| self.malformed(if elem == Elem::Char { "'a'" } else { "\"a\"" }))
    }
}

/// `text` with the NULs behind it that make `cap + 1`.
fn fit<T: Copy>(text: &[T], cap: u32, nul: &[T; 1]) -> Result<Vec<T>, ValueError> {
    if text.len() > cap as usize {
        return Err(ValueError::TooLong { len: text.len(), cap });
    }
    let mut all = text.to_vec();
    all.resize(cap as usize + 1, nul[0]);
    Ok(all)
}

/// The text without `_`, if each stands between two letters or digits.
fn digits(text: &str) -> Option<String> {
    let between = |(i, b): (usize, u8)| {
        let beside = |j: Option<usize>| j.and_then(|j| text.as_bytes().get(j)).is_some_and(u8::is_ascii_alphanumeric);
        b != b'_' || beside(i.checked_sub(1)) && beside(Some(i + 1))
    };
    text.bytes().enumerate().all(between).then(|| text.replace('_', ""))
}

fn plain_f32(text: &str) -> Option<f32> {
    digits(text)?.parse().ok()
}

/// A whole number: `-5`, `1_000`, `16#FF`, `2#1010`.
pub(crate) fn integer(text: &str) -> Option<i128> {
    let (negative, magnitude) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (radix, magnitude) = match magnitude.split_once('#') {
        Some((radix, rest)) => (radix.parse().ok().filter(|r| [2, 8, 10, 16].contains(r))?, rest),
        None => (10, magnitude),
    };
    let value = i128::from(u64::from_str_radix(digits(magnitude).filter(|m| !m.starts_with('+'))?.as_str(), radix).ok()?);
    Some(if negative { -value } else { value })
}

/// Nanoseconds of `1d2h3m4s5ms6us7ns`, larger units first, the last part with decimals.
fn span(text: &str) -> Option<i128> {
    let (negative, mut rest) = text.strip_prefix('-').map_or((false, text), |rest| (true, rest));
    let (mut total, mut from) = (0i128, 0);
    while !rest.is_empty() || from == 0 {
        rest = rest.strip_prefix('_').filter(|_| from > 0).unwrap_or(rest);
        let (number, tail) = rest.split_at(rest.find(|c: char| c.is_ascii_alphabetic())?);
        let (unit, tail) = tail.split_at(tail.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(tail.len()));
        let index = SPAN_UNITS.iter().position(|(name, _)| name.eq_ignore_ascii_case(unit)).filter(|i| *i >= from)?;
        if number.contains('.') && !tail.is_empty() {
            return None;
        }
        total += scaled(number, SPAN_UNITS[index].1.into())?;
        (from, rest) = (index + 1, tail);
    }
    Some(if negative { -total } else { total })
}

/// A number with decimals in units of `unit` nanoseconds, rounded half up to the nanosecond.
fn scaled(number: &str, unit: i128) -> Option<i128> {
    let (whole, decimals) = number.split_once('.').unwrap_or((number, "0"));
    let decimals = digits(decimals)?;
    let decimals: String = decimals.chars().take(18).collect();
    let scale = 10i128.pow(decimals.len() as u32);
    let parts = [whole, &decimals].map(|t| digits(t).filter(|t| t.bytes().all(|b| b.is_ascii_digit())).and_then(|t| t.parse::<u64>().ok()));
    let [Some(whole), Some(decimals)] = parts else { return None };
    Some(i128::from(whole) * unit + (i128::from(decimals) * unit * 2 + scale) / (2 * scale))
}

/// Nanoseconds since 1970 of `2024-01-31`.
fn date(text: &str) -> Option<i128> {
    let parts: Vec<i64> =
        text.split('-').map(|p| p.parse().ok().filter(|_| p.bytes().all(|b| b.is_ascii_digit()))).collect::<Option<_>>()?;
    let [year, month, day] = parts[..] else { return None };
    Some(i128::from(day_of(year, month, day)?) * DAY)
}

/// Nanoseconds since midnight of `12:00`, `12:00:00.5`.
fn clock(text: &str) -> Option<i128> {
    let parts: Vec<&str> = text.split(':').collect();
    let (&[hour, minute] | &[hour, minute, _]) = &parts[..] else { return None };
    let second = parts.get(2).map_or(Some(0), |s| scaled(s, SECOND))?;
    let whole = |text: &str, limit| integer(text).filter(|v| (0..limit).contains(v));
    Some((whole(hour, 24)? * 60 + whole(minute, 60)?) * 60 * SECOND + Some(second).filter(|s| *s < 60 * SECOND)?)
}

/// Nanoseconds since 1970 of `2024-01-31-12:00:00`.
fn date_and_clock(text: &str) -> Option<i128> {
    let (day, time) = text.rsplit_once('-')?;
    Some(date(day)? + clock(time)?)
}

/// The letter behind a `$`.
fn escape(letter: char) -> Option<u8> {
    Some(match letter.to_ascii_uppercase() {
        'N' | 'L' => b'\n',
        'R' => b'\r',
        'T' => b'\t',
        'P' => 0x0C,
        '$' => b'$',
        '\'' => b'\'',
        '"' => b'"',
        _ => return None,
    })
}

/// The text with its escapes resolved: each piece is a character or the code behind a `$`, of `width` hexadecimal digits.
fn pieces(text: &str, width: usize) -> Option<Vec<Result<char, u16>>> {
    let mut pieces = vec![];
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        rest = &rest[c.len_utf8()..];
        if matches!(c, '\'' | '"') && text.contains(c) && (c == '\'') == (width == 2) {
            return None;
        }
        if c != '$' {
            pieces.push(Ok(c));
            continue;
        }
        let letter = rest.chars().next()?;
        if let Some(code) = escape(letter) {
            pieces.push(Err(code.into()));
            rest = &rest[1..];
        } else {
            let code = rest.get(..width).filter(|t| t.bytes().all(|b| b.is_ascii_hexdigit()))?;
            pieces.push(Err(u16::from_str_radix(code, 16).ok()?));
            rest = &rest[width..];
        }
    }
    Some(pieces)
}
fn narrow(text: &str) -> Option<Vec<u8>> {
    let mut bytes = vec![];
    for piece in pieces(text, 2)? {
        match piece {
            Ok(c) => bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes()),
            Err(code) => bytes.push(code as u8),
        }
    }
    Some(bytes)
}
fn wide(text: &str) -> Option<Vec<u16>> {
    let mut units = vec![];
    for piece in pieces(text, 4)? {
        match piece {
            Ok(c) => units.extend_from_slice(c.encode_utf16(&mut [0; 2])),
            Err(code) => units.push(code),
        }
    }
    Some(units)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::{Scalar, format_value, read_scalar};
    use std::sync::Arc;

    fn types() -> (Types, Vec<TypeId>) {
        use Elem::*;
        let mut types = Types::default();
        let elems = [
            Bool, Byte, Word, Dword, Lword, Sint, Int, Dint, Lint, Usint, Uint, Udint, Ulint, Real, Lreal, Time, Ltime, Date, Ldate, Tod,
            Ltod, Dt, Ldt, Char, Wchar,
        ];
        let mut ids: Vec<TypeId> = elems.into_iter().map(|e| types.intern(Type::Elem(e))).collect();
        let members = vec![("idle".into(), 0), ("positive".into(), 1), ("Back".into(), -1)];
        ids.push(types.intern(Type::Enum(Arc::new(Enumeration { name: "WAY".into(), base: Int, members }))));
        ids.push(types.intern(Type::Subrange { base: Int, low: -5, high: 5 }));
        ids.push(types.intern(Type::String(5)));
        ids.push(types.intern(Type::WString(3)));
        let int = ids[6];
        ids.push(types.intern(Type::Array { elem: int, dims: vec![(0, 2)] }));
        (types, ids)
    }
    fn named(name: &str) -> (Types, TypeId) {
        let (types, ids) = types();
        let id = *ids.iter().find(|id| types.name(**id) == name).unwrap_or_else(|| panic!("no {name}"));
        (types, id)
    }
    /// Reads `text` as a `ty` and shows it again.
    #[track_caller]
    fn check(ty: &str, text: &str, shown: &str) {
        let (types, id) = named(ty);
        let bytes = parse_value(&types, id, text).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(bytes.len() as u32, types.size(id));
        assert_eq!(format_value(&types, id, &bytes), shown);
        assert_eq!(parse_value(&types, id, shown).as_ref(), Ok(&bytes), "{shown} reads back");
    }
    #[track_caller]
    fn refused(ty: &str, text: &str, message: &str) {
        let (types, id) = named(ty);
        assert_eq!(parse_value(&types, id, text).expect_err("is refused").to_string(), message);
    }

    #[test]
    fn numbers_read_and_show() {
        check("BOOL", "true", "TRUE");
        check("BOOL", "BOOL#0", "FALSE");
        check("INT", "-32768", "-32768");
        check("INT", "INT#16#7F_FF", "32767");
        check("UINT", "65_535", "65535");
        check("ULINT", "18446744073709551615", "18446744073709551615");
        check("LINT", "-9223372036854775808", "-9223372036854775808");
        check("WORD", "2#1010", "16#A");
        check("LREAL", "0.1", "0.1");
        check("LREAL", "1", "1.0");
        check("LREAL", "-2.5e-3", "-0.0025");
        check("LREAL", "1e300", "1.0E300");
        check("LREAL", "16#10", "16.0");
        check("REAL", "0.1", "0.1");
        check("REAL", "REAL#3.4028235E38", "3.4028235E38");
        check("INT(-5..5)", "-5", "-5");
        check("CHAR", "'$41'", "'A'");
        check("WCHAR", "\"度\"", "\"度\"");
    }

    #[test]
    fn times_and_dates_read_and_show() {
        check("TIME", "T#1s500ms", "T#1s500ms");
        check("TIME", "t#1.5s", "T#1s500ms");
        check("TIME", "TIME#90m", "T#1h30m");
        check("TIME", "T#0s", "T#0ms");
        check("TIME", "T#49d17h2m47s295ms", "T#49d17h2m47s295ms");
        check("LTIME", "LTIME#-1us", "LTIME#-1us");
        check("LTIME", "LT#0.5ns", "LTIME#1ns");
        check("DATE", "D#2024-02-29", "D#2024-02-29");
        check("LDATE", "LDATE#2024-02-29", "LDATE#2024-02-29");
        check("TIME_OF_DAY", "TOD#23:59:59.999", "TOD#23:59:59.999");
        check("LTIME_OF_DAY", "LTOD#12:00", "LTOD#12:00:00");
        check("DATE_AND_TIME", "DT#2024-01-31-23:59:59", "DT#2024-01-31-23:59:59");
        check("LDATE_AND_TIME", "LDT#2024-01-31-23:59:59.000000001", "LDT#2024-01-31-23:59:59.000000001");
    }

    #[test]
    fn texts_and_members_read_and_show() {
        check("STRING(5)", "'a$'b'", "'a$'b'");
        check("STRING(5)", "abc", "'abc'");
        check("STRING(5)", "", "''");
        check("STRING(5)", "'$N$FF$$'", "'$N$FF$$'");
        check("STRING(5)", "'ä度'", "'ä度'");
        check("WSTRING(3)", "\"ä$D800\"", "\"ä$D800\"");
        check("WSTRING(3)", "abc", "\"abc\"");
        check("WAY", "Positive", "WAY.positive");
        check("WAY", "way.back", "WAY.Back");
        check("WAY", "WAY#idle", "WAY.idle");
        check("WAY", "7", "7");
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        refused("BOOL", "2", "`2` is not a value of `BOOL`; write for example `TRUE`");
        refused("SINT", "128", "`128` is outside the range of `SINT`, -128..127");
        refused("INT", "1.5", "`1.5` is not a value of `INT`; write for example `5` or `16#1F`");
        refused("INT", "DINT#5", "`DINT#5` is not a value of `INT`; write for example `5` or `16#1F`");
        refused("INT(-5..5)", "6", "`6` is outside the range of `INT(-5..5)`, -5..5");
        refused("REAL", "1e39", "`1e39` is outside the range of `REAL`, -3.4028234663852886e38..3.4028234663852886e38");
        refused("LREAL", "1e309", "`1e309` is outside the range of `LREAL`, -1.7976931348623157e308..1.7976931348623157e308");
        refused("LREAL", "NaN", "`NaN` is not a value of `LREAL`; write for example `1.5` or `-2.0E-3`");
        refused("TIME", "5", "`5` is not a value of `TIME`; write for example `T#1s500ms`");
        refused("TIME", "T#500ms1s", "`T#500ms1s` is not a value of `TIME`; write for example `T#1s500ms`");
        refused("TIME", "T#", "`T#` is not a value of `TIME`; write for example `T#1s500ms`");
        refused("TIME", "T#1us", "`T#1us` is finer than `TIME` resolves");
        refused("TIME", "T#50d", "`T#50d` is outside the range of `TIME`, 0..4294967295");
        refused("DATE", "D#2023-02-29", "`D#2023-02-29` is not a value of `DATE`; write for example `D#2024-01-31`");
        refused("STRING(5)", "abcdef", "the text is 6 long, only 5 fit");
        refused("STRING(5)", "'abc", "`'abc` is not a value of `STRING(5)`; write for example `'text'`");
        refused("STRING(5)", "'a'b'", "`'a'b'` is not a value of `STRING(5)`; write for example `'it$'s'`");
        refused("WAY", "posiitve", "`WAY` has no member `posiitve`; did you mean `positive`?");
        refused("ARRAY[0..2] OF INT", "1", "a `ARRAY[0..2] OF INT` cannot be set as a whole; name a member or an element");
    }

    #[test]
    fn every_bit_pattern_has_a_text_and_scalars_read_as_numbers() {
        let (types, ids) = types();
        for id in ids {
            for fill in [0u8, 1, 0x7F, 0x80, 0xFF] {
                let bytes = vec![fill; types.size(id) as usize];
                let text = format_value(&types, id, &bytes);
                assert!(!text.contains('?'), "{text}");
                assert!(format_value(&types, id, &[]).contains('?'), "{}", types.name(id));
            }
        }
        let (types, id) = named("INT");
        assert_eq!(read_scalar(&types, id, &[0xFF, 0xFF]), Some(Scalar::Int(-1)));
        assert_eq!(read_scalar(&types, id, &[0xFF]), None);
        let (types, id) = named("REAL");
        assert_eq!(read_scalar(&types, id, &1.5f32.to_le_bytes()), Some(Scalar::Real(1.5)));
    }
}
