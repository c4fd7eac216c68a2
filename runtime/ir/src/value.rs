//! Values in the image as people and tools read them.
//!
//! Bytes may hold anything (a pointer may have written there): whatever they are, there is a text for them. Bytes that are missing read as `?`.

use crate::calendar::date_of;
use crate::types::{Type, TypeId, Types, elem_size};
use std::fmt::Write;
use takt_abi::{Elem, Section};

/// A value of an elementary type, string, enumeration or pointer.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// Integers, bit strings, characters, times and dates (in their unit: TIME and TOD in ms, DATE and DT in s, the long ones in ns), pointers, enumerations.
    Int(i128),
    /// REAL (exactly, as LREAL), LREAL.
    Real(f64),
    /// BOOL.
    Bool(bool),
    /// STRING, WSTRING up to the first NUL, with what is no valid text replaced.
    Text(String),
}

/// The value of an elementary type, string, enumeration or pointer; `None` for arrays and structures, and if bytes are missing.
pub fn read_scalar(types: &Types, ty: TypeId, bytes: &[u8]) -> Option<Scalar> {
    Some(match types.get(ty) {
        Type::Elem(elem) | Type::Subrange { base: elem, .. } => read_elem(*elem, bytes)?,
        Type::Enum(enumeration) => read_elem(enumeration.base, bytes)?,
        Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) => Scalar::Int(word(bytes, 8)?.into()),
        Type::String(n) => Scalar::Text(String::from_utf8_lossy(string_bytes(bytes, *n)?).into_owned()),
        Type::WString(n) => Scalar::Text(String::from_utf16_lossy(&string_units(bytes, *n)?)),
        Type::Bit(n) => Scalar::Bool(bit(bytes, *n)?),
        Type::Array { .. } | Type::OpenArray { .. } | Type::Struct(_) | Type::Error => return None,
    })
}

fn read_elem(elem: Elem, bytes: &[u8]) -> Option<Scalar> {
    let size = elem_size(elem);
    let raw = word(bytes, size)?;
    let shift = 64 - 8 * size;
    Some(match elem {
        Elem::Bool => Scalar::Bool(raw != 0),
        Elem::Real => Scalar::Real(f32::from_bits(raw as u32).into()),
        Elem::Lreal => Scalar::Real(f64::from_bits(raw)),
        Elem::Sint | Elem::Int | Elem::Dint | Elem::Lint | Elem::Ltime => Scalar::Int((((raw << shift) as i64) >> shift).into()),
        _ => Scalar::Int(raw.into()),
    })
}

/// Whether a bit of the first byte is set.
fn bit(bytes: &[u8], number: u8) -> Option<bool> {
    Some(bytes.first()?.checked_shr(number.into())? & 1 != 0)
}

/// The first `size` bytes as an unsigned number.
fn word(bytes: &[u8], size: u32) -> Option<u64> {
    let mut raw = [0; 8];
    raw[..size as usize].copy_from_slice(bytes.get(..size as usize)?);
    Some(u64::from_le_bytes(raw))
}
fn string_bytes(bytes: &[u8], cap: u32) -> Option<&[u8]> {
    let text = bytes.get(..cap as usize)?;
    Some(text.split(|b| *b == 0).next().unwrap_or(text))
}
fn string_units(bytes: &[u8], cap: u32) -> Option<Vec<u16>> {
    let units = bytes.get(..2 * cap as usize)?.chunks_exact(2).map(|c| u16::from_le_bytes([c[0], c[1]]));
    Some(units.take_while(|u| *u != 0).collect())
}

/// The value as a literal of ST: `TRUE`, `5`, `1.0`, `T#1s500ms`, `'abc'`, `MC_DIRECTION.positive`, `[1, 2, 5(0)]`, `(x := 1, y := 2)`. Bit strings, pointers and
/// VAR_IN_OUT members are shown as `16#1F`. NaN and the infinities, which have no literal, are `NaN`, `Infinity`, `-Infinity`.
pub fn format_value(types: &Types, ty: TypeId, bytes: &[u8]) -> String {
    let mut out = String::new();
    put(types, ty, bytes, &mut out).unwrap_or_else(|| out.push('?'));
    out
}

fn put(types: &Types, ty: TypeId, bytes: &[u8], out: &mut String) -> Option<()> {
    match types.get(ty) {
        Type::Elem(elem) | Type::Subrange { base: elem, .. } => put_elem(*elem, bytes, out)?,
        Type::Enum(e) => {
            let Scalar::Int(value) = read_elem(e.base, bytes)? else { return None };
            match e.members.iter().find(|(_, v)| member_value(e.base, *v) == value) {
                Some((name, _)) => show(out, format_args!("{}.{name}", e.name)),
                None => show(out, format_args!("{value}")),
            }
        }
        Type::String(n) => put_string(string_bytes(bytes, *n)?, out),
        Type::WString(n) => put_wstring(&string_units(bytes, *n)?, out),
        Type::Array { elem, dims } => {
            let count = dims.iter().map(|(l, h)| (i128::from(*h) - i128::from(*l) + 1).max(0)).product::<i128>();
            put_array(types, *elem, usize::try_from(count).ok()?, bytes, out);
        }
        Type::Struct(s) => {
            out.push('(');
            for (i, field) in s.fields.iter().enumerate() {
                show(out, format_args!("{}{} := ", if i > 0 { ", " } else { "" }, field.name));
                let bytes = bytes.get(field.offset as usize..).unwrap_or_default();
                let done = if field.section == Section::InOut { put_hex(bytes, 8, out) } else { put(types, field.ty, bytes, out) };
                done.unwrap_or_else(|| out.push('?'));
            }
            out.push(')');
        }
        Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) | Type::OpenArray { .. } => put_hex(bytes, 8, out)?,
        Type::Bit(n) => out.push_str(if bit(bytes, *n)? { "TRUE" } else { "FALSE" }),
        Type::Error => return None,
    }
    Some(())
}

/// What a member's value reads as in its base type (16#FFFF of a WORD may be written -1).
fn member_value(base: Elem, value: i64) -> i128 {
    match read_elem(base, &value.to_le_bytes()) {
        Some(Scalar::Int(v)) => v,
        _ => value.into(),
    }
}

fn show(out: &mut String, text: std::fmt::Arguments<'_>) {
    out.write_fmt(text).expect("writing to a String cannot fail");
}
fn put_hex(bytes: &[u8], size: u32, out: &mut String) -> Option<()> {
    show(out, format_args!("16#{:X}", word(bytes, size)?));
    Some(())
}

/// Equal elements that are written as `n(value)`.
const RUN: usize = 4;

fn put_array(types: &Types, elem: TypeId, count: usize, bytes: &[u8], out: &mut String) {
    let size = types.size(elem).max(1) as usize;
    let at = |i: usize| bytes.get(i * size..).map(|b| &b[..b.len().min(size)]).unwrap_or_default();
    out.push('[');
    let mut i = 0;
    while i < count && i * size < bytes.len() {
        let run = (i..count).take_while(|j| at(*j) == at(i)).count();
        let text = format_value(types, elem, at(i));
        let separator = if i > 0 { ", " } else { "" };
        if run >= RUN {
            show(out, format_args!("{separator}{run}({text})"));
            i += run;
        } else {
            show(out, format_args!("{separator}{text}"));
            i += 1;
        }
    }
    if i < count {
        out.push('?');
    }
    out.push(']');
}

fn put_elem(elem: Elem, bytes: &[u8], out: &mut String) -> Option<()> {
    let value = match read_elem(elem, bytes)? {
        Scalar::Bool(value) => {
            out.push_str(if value { "TRUE" } else { "FALSE" });
            return Some(());
        }
        Scalar::Real(value) => {
            out.push_str(&if elem == Elem::Real { real(format!("{:?}", value as f32)) } else { real(format!("{value:?}")) });
            return Some(());
        }
        Scalar::Int(value) => value,
        Scalar::Text(_) => return None,
    };
    match elem {
        Elem::Byte | Elem::Word | Elem::Dword | Elem::Lword => show(out, format_args!("16#{value:X}")),
        Elem::Char => put_string(&[value as u8], out),
        Elem::Wchar => put_wstring(&[value as u16], out),
        Elem::Time => put_span("T#", value as u64 * 1_000_000, "0ms", out),
        Elem::Ltime => put_span(if value < 0 { "LTIME#-" } else { "LTIME#" }, value.unsigned_abs() as u64, "0ns", out),
        Elem::Date => show(out, format_args!("D#{}", Date(value as i64 / 86_400))),
        Elem::Ldate => show(out, format_args!("LDATE#{}", Date((value / 86_400_000_000_000) as i64))),
        Elem::Tod => show(out, format_args!("TOD#{}", Clock(value as u64 * 1_000_000))),
        Elem::Ltod => show(out, format_args!("LTOD#{}", Clock(value as u64))),
        Elem::Dt => show(out, format_args!("DT#{}-{}", Date(value as i64 / 86_400), Clock(value as u64 % 86_400 * NANOS))),
        Elem::Ldt => {
            let (day, rest) = (value as u64 / (86_400 * NANOS), value as u64 % (86_400 * NANOS));
            show(out, format_args!("LDT#{}-{}", Date(day as i64), Clock(rest)));
        }
        _ => show(out, format_args!("{value}")),
    }
    Some(())
}

const NANOS: u64 = 1_000_000_000;

/// Rust's shortest text that reads back the same, as an ST literal.
fn real(text: String) -> String {
    match text.as_str() {
        "inf" => "Infinity".into(),
        "-inf" => "-Infinity".into(),
        _ => match text.split_once('e') {
            Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
            Some((mantissa, exponent)) => format!("{mantissa}.0E{exponent}"),
            None => text,
        },
    }
}

/// Nanoseconds as `1d2h3m4s5ms6us7ns`, without the parts that are 0.
fn put_span(prefix: &str, mut nanos: u64, zero: &str, out: &mut String) {
    out.push_str(prefix);
    if nanos == 0 {
        out.push_str(zero);
    }
    for (unit, size) in SPAN_UNITS {
        if nanos >= size {
            show(out, format_args!("{}{unit}", nanos / size));
            nanos %= size;
        }
    }
}

/// Units of TIME literals with their nanoseconds, from the largest.
pub(crate) const SPAN_UNITS: [(&str, u64); 7] =
    [("d", 86_400 * NANOS), ("h", 3600 * NANOS), ("m", 60 * NANOS), ("s", NANOS), ("ms", 1_000_000), ("us", 1000), ("ns", 1)];

/// A day since 1970.
struct Date(i64);
impl std::fmt::Display for Date {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (year, month, day) = date_of(self.0);
        write!(f, "{year:04}-{month:02}-{day:02}")
    }
}

/// Nanoseconds since midnight.
struct Clock(u64);
impl std::fmt::Display for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (seconds, nanos) = (self.0 / NANOS, self.0 % NANOS);
        write!(f, "{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)?;
        match nanos {
            0 => Ok(()),
            _ if nanos % 1_000_000 == 0 => write!(f, ".{:03}", nanos / 1_000_000),
            _ => write!(f, ".{nanos:09}"),
        }
    }
}

fn escape(c: char, quote: char) -> Option<&'static str> {
    Some(match c {
        '$' => "$$",
        '\n' => "$N",
        '\r' => "$R",
        '\t' => "$T",
        '\x0C' => "$P",
        '\'' if quote == '\'' => "$'",
        '"' if quote == '"' => "$\"",
        _ => return None,
    })
}

fn put_string(bytes: &[u8], out: &mut String) {
    out.push('\'');
    for chunk in bytes.utf8_chunks() {
        for c in chunk.valid().chars() {
            match escape(c, '\'') {
                Some(text) => out.push_str(text),
                None if c.is_control() => c.to_string().bytes().for_each(|b| show(out, format_args!("${b:02X}"))),
                None => out.push(c),
            }
        }
        chunk.invalid().iter().for_each(|b| show(out, format_args!("${b:02X}")));
    }
    out.push('\'');
}

fn put_wstring(units: &[u16], out: &mut String) {
    out.push('"');
    for c in char::decode_utf16(units.iter().copied()) {
        match c {
            Ok(c) => match escape(c, '"') {
                Some(text) => out.push_str(text),
                None if c.is_control() => show(out, format_args!("${:04X}", u32::from(c))),
                None => out.push(c),
            },
            Err(lone) => show(out, format_args!("${:04X}", lone.unpaired_surrogate())),
        }
    }
    out.push('"');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{Field, StructKind, Structure};
    use std::sync::Arc;

    #[test]
    fn arrays_and_structures_show_as_initial_values() {
        let mut types = Types::default();
        let int = types.intern(Type::Elem(Elem::Int));
        let array = types.intern(Type::Array { elem: int, dims: vec![(1, 2), (0, 3)] });
        let pointer = types.intern(Type::Pointer(int));
        let field = |name: &str, ty, offset, section| Field { name: name.into(), ty, offset, section, doc: String::new() };
        let fields = vec![field("x", int, 0, Section::State), field("p", pointer, 8, Section::Input), field("io", int, 16, Section::InOut)];
        let structure =
            types.intern(Type::Struct(Arc::new(Structure { name: "S".into(), kind: StructKind::Struct, fields, size: 24, align: 8 })));
        let bytes: Vec<u8> = [1i16, 2, 2, 0, 0, 0, 0, 5].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(format_value(&types, array, &bytes), "[1, 2, 2, 4(0), 5]");
        assert_eq!(format_value(&types, array, &bytes[..4]), "[1, 2?]");
        let mut bytes = vec![0; 24];
        (bytes[0], bytes[8], bytes[17]) = (7, 0x34, 1);
        assert_eq!(format_value(&types, structure, &bytes), "(x := 7, p := 16#34, io := 16#100)");
        assert_eq!(format_value(&types, structure, &bytes[..10]), "(x := 7, p := ?, io := ?)");
    }

    #[test]
    fn what_has_no_literal_still_has_a_text() {
        let mut types = Types::default();
        let lreal = types.intern(Type::Elem(Elem::Lreal));
        for (value, text) in [(f64::NAN, "NaN"), (f64::INFINITY, "Infinity"), (-0.0, "-0.0"), (5e-324, "5.0E-324")] {
            assert_eq!(format_value(&types, lreal, &value.to_le_bytes()), text);
        }
    }
}
