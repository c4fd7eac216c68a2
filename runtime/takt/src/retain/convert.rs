//! Single values from one type to another, where nothing is lost.

use takt_abi::Elem;
use takt_ir::{Enumeration, Scalar, Type, TypeId, Types, elem_size, format_value, read_scalar};

/// The bytes of a value in another type, or why it does not go.
pub fn convert(old: &Types, from: TypeId, bytes: &[u8], new: &Types, to: TypeId) -> Result<Vec<u8>, String> {
    let shown = || format_value(old, from, bytes);
    let lossy = || format!("{} is no value of `{}`", shown(), new.name(to));
    let apart = || format!("a `{}` does not become a `{}`", old.name(from), new.name(to));
    let value = read_scalar(old, from, bytes).ok_or_else(apart)?;
    match (old.get(from), new.get(to)) {
        (Type::String(_), Type::String(cap)) => text(bytes, 1, *cap).ok_or_else(lossy),
        (Type::WString(_), Type::WString(cap)) => text(bytes, 2, *cap).ok_or_else(lossy),
        (Type::Enum(a), Type::Enum(b)) => by_name(a, b, &value).ok_or_else(lossy),
        (a, b) => {
            let (a, b) = (base(a).ok_or_else(apart)?, base(b).ok_or_else(apart)?);
            if family(a) != family(b) {
                return Err(apart());
            }
            let stored = number(a, &value, b).filter(|stored| fits(new.get(to), stored)).ok_or_else(lossy)?;
            Ok(match new.get(to) {
                Type::Bit(bit) => vec![stored[0] << bit],
                _ => stored,
            })
        }
    }
}

/// A text with its NUL, if it is no longer than `cap` units of so many bytes.
fn text(bytes: &[u8], unit: usize, cap: u32) -> Option<Vec<u8>> {
    let len = bytes.chunks_exact(unit).take_while(|c| c.iter().any(|b| *b != 0)).count();
    let mut out = bytes[..len * unit].to_vec();
    out.resize((cap as usize + 1) * unit, 0);
    (len <= cap as usize).then_some(out)
}

/// The value of the member that has the same name.
fn by_name(old: &Enumeration, new: &Enumeration, value: &Scalar) -> Option<Vec<u8>> {
    let Scalar::Int(value) = value else { return None };
    let cut = |base: Elem, v: i64| v as u64 & (u64::MAX >> (64 - 8 * elem_size(base)));
    let (name, _) = old.members.iter().find(|(_, v)| cut(old.base, *v) == cut(old.base, *value as i64))?;
    let (_, value) = new.members.iter().find(|(n, _)| n.to_uppercase() == name.to_uppercase())?;
    Some(value.to_le_bytes()[..elem_size(new.base) as usize].to_vec())
}

fn base(ty: &Type) -> Option<Elem> {
    Some(match ty {
        Type::Elem(elem) | Type::Subrange { base: elem, .. } => *elem,
        Type::Enum(e) => e.base,
        Type::Bit(_) => Elem::Bool,
        _ => return None,
    })
}

/// Whether a converted value is one of the new type.
fn fits(ty: &Type, stored: &[u8]) -> bool {
    let mut types = Types::default();
    let value = base(ty).and_then(|elem| {
        let elem = types.intern(Type::Elem(elem));
        read_scalar(&types, elem, stored)
    });
    match (ty, value) {
        (Type::Subrange { low, high, .. }, Some(Scalar::Int(value))) => (*low..=*high).contains(&value),
        (Type::Enum(e), Some(Scalar::Int(value))) => e.members.iter().any(|(_, v)| i128::from(*v) == value),
        _ => true,
    }
}

/// Values of one family mean the same as numbers, once their units are taken into account.
#[derive(PartialEq)]
enum Family {
    Bool,
    Number,
    Text,
    Duration,
    Date,
    Clock,
    Moment,
}

fn family(elem: Elem) -> Family {
    match elem {
        Elem::Bool => Family::Bool,
        Elem::Time | Elem::Ltime => Family::Duration,
        Elem::Date | Elem::Ldate => Family::Date,
        Elem::Tod | Elem::Ltod => Family::Clock,
        Elem::Dt | Elem::Ldt => Family::Moment,
        Elem::Char | Elem::Wchar => Family::Text,
        _ => Family::Number,
    }
}

/// Nanoseconds per unit.
fn unit(elem: Elem) -> i128 {
    match elem {
        Elem::Time | Elem::Tod => 1_000_000,
        Elem::Date | Elem::Dt => 1_000_000_000,
        _ => 1,
    }
}

/// The bytes of a number in another elementary type, if it is exactly the same number there.
fn number(from: Elem, value: &Scalar, to: Elem) -> Option<Vec<u8>> {
    let integer = match value {
        Scalar::Bool(value) => i128::from(*value),
        Scalar::Int(value) => *value,
        Scalar::Real(value) => return real(*value, to),
        Scalar::Text(_) => return None,
    };
    if matches!(to, Elem::Real | Elem::Lreal) {
        let as_real = integer as f64;
        return if as_real as i128 == integer { real(as_real, to) } else { None };
    }
    let scaled = integer.checked_mul(unit(from))?;
    let integer = (scaled % unit(to) == 0).then_some(scaled / unit(to))?;
    let bits = 8 * elem_size(to);
    let signed = matches!(to, Elem::Sint | Elem::Int | Elem::Dint | Elem::Lint | Elem::Ltime);
    let range = match (to, signed) {
        (Elem::Bool, _) => 0..=1,
        (_, true) => -(1i128 << (bits - 1))..=(1i128 << (bits - 1)) - 1,
        _ => 0..=(1i128 << bits) - 1,
    };
    range.contains(&integer).then(|| integer.to_le_bytes()[..elem_size(to) as usize].to_vec())
}

fn real(value: f64, to: Elem) -> Option<Vec<u8>> {
    match to {
        Elem::Lreal => Some(value.to_le_bytes().to_vec()),
        Elem::Real => {
            let narrow = value as f32;
            (f64::from(narrow).to_bits() == value.to_bits() || value.is_nan()).then(|| narrow.to_le_bytes().to_vec())
        }
        _ => {
            let integer = value as i128;
            if integer as f64 != value || value == 0.0 && value.is_sign_negative() {
                return None;
            }
            number(Elem::Lint, &Scalar::Int(integer), to)
        }
    }
}
