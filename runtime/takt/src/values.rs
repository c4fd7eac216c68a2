//! Values of variables: as JSON for tools, as short text for people, as numbers for plots.

use serde_json::{Map, Number, Value};
use takt_ir::{Place, Scalar, Type, TypeId, Types, format_value, read_scalar};

/// A value as DESIGN §9 says: numbers are JSON numbers, BOOL true or false, STRING text, an enumerator
/// its number; times and dates ST literals as text; NaN and the
/// infinities text; arrays and structures by element and member.
pub fn to_json(types: &Types, ty: TypeId, bytes: &[u8]) -> Value {
    match types.get(ty) {
        Type::Array { elem, dims } => array(types, *elem, dims, bytes),
        Type::Struct(structure) => {
            let member = |field: &takt_ir::Field| {
                let end = field.offset as usize + types.size(field.ty) as usize;
                let value = bytes.get(field.offset as usize..end).map_or(Value::Null, |inner| to_json(types, field.ty, inner));
                (field.name.clone(), value)
            };
            let own = |field: &&takt_ir::Field| field.section != takt_abi::Section::InOut;
            Value::Object(structure.fields.iter().filter(own).map(member).collect::<Map<_, _>>())
        }
        other => scalar(types, ty, other, bytes),
    }
}

fn array(types: &Types, elem: TypeId, dims: &[(i64, i64)], bytes: &[u8]) -> Value {
    let Some(((low, high), rest)) = dims.split_first() else { return to_json(types, elem, bytes) };
    let size = rest.iter().fold(types.size(elem) as usize, |size, (low, high)| size.saturating_mul((high - low + 1).max(0) as usize));
    let count = (high - low + 1).max(0) as usize;
    Value::Array((0..count).map_while(|i| bytes.get(i * size..(i + 1) * size)).map(|inner| array(types, elem, rest, inner)).collect())
}

fn scalar(types: &Types, ty: TypeId, shape: &Type, bytes: &[u8]) -> Value {
    use takt_abi::Elem::{Char, Date, Dt, Ldate, Ldt, Ltime, Ltod, Time, Tod, Wchar};
    let literal = || Value::String(format_value(types, ty, bytes));
    if let Type::Elem(Time | Ltime | Date | Ldate | Tod | Ltod | Dt | Ldt | Char | Wchar) = shape {
        return literal();
    }
    match read_scalar(types, ty, bytes) {
        Some(Scalar::Bool(bit)) => Value::Bool(bit),
        Some(Scalar::Text(text)) => Value::String(text),
        Some(Scalar::Real(number)) => real(shape, number).map_or_else(literal, Value::Number),
        Some(Scalar::Int(number)) => i64::try_from(number)
            .map(Number::from)
            .or_else(|_| u64::try_from(number).map(Number::from))
            .map_or_else(|_| literal(), Value::Number),
        None => literal(),
    }
}

/// A REAL is shown with the digits of a REAL: 0.1 and not 0.10000000149011612.
fn real(shape: &Type, number: f64) -> Option<Number> {
    let single = matches!(shape, Type::Elem(takt_abi::Elem::Real));
    Number::from_f64(if single { (number as f32).to_string().parse().unwrap_or(number) } else { number })
}

/// A value as a number: BOOL is 0 or 1; `None` for texts, arrays and structures.
pub fn to_number(types: &Types, ty: TypeId, bytes: &[u8]) -> Option<f64> {
    match read_scalar(types, ty, bytes)? {
        Scalar::Int(number) => Some(number as f64),
        Scalar::Real(number) => Some(number),
        Scalar::Bool(bit) => Some(f64::from(u8::from(bit))),
        Scalar::Text(_) => None,
    }
}

/// A value for people: a text without quotes, an enumerator without its type, a number scaled and rounded to `digits` places.
pub fn for_people(types: &Types, place: Place, bytes: &[u8], digits: Option<usize>, scale: f64) -> String {
    match (types.get(place.ty), read_scalar(types, place.ty, bytes)) {
        (_, Some(Scalar::Text(text))) => text,
        (Type::Elem(takt_abi::Elem::Real | takt_abi::Elem::Lreal), Some(Scalar::Real(number))) => {
            rounded(number * scale, digits.unwrap_or(3))
        }
        (Type::Elem(_), Some(Scalar::Int(number))) if digits.is_some() || scale != 1.0 => {
            rounded(number as f64 * scale, digits.unwrap_or(0))
        }
        (Type::Enum(enumeration), _) => {
            let text = format_value(types, place.ty, bytes);
            text.strip_prefix(&format!("{}.", enumeration.name)).map_or(text.clone(), str::to_string)
        }
        _ => format_value(types, place.ty, bytes),
    }
}

fn rounded(number: f64, digits: usize) -> String {
    let text = format!("{number:.digits$}");
    // A rounded -0.00 is 0.00.
    if text.starts_with('-') && text.chars().all(|c| matches!(c, '-' | '0' | '.')) { text[1..].to_string() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use takt_abi::Elem;

    #[track_caller]
    fn check(ty: Type, bytes: &[u8], expected: Value) {
        let mut types = Types::default();
        let id = types.intern(ty);
        assert_eq!(to_json(&types, id, bytes), expected);
    }

    #[test]
    fn json_follows_the_contract() {
        check(Type::Elem(Elem::Bool), &[1], json!(true));
        check(Type::Elem(Elem::Int), &(-5i16).to_le_bytes(), json!(-5));
        check(Type::Elem(Elem::Ulint), &u64::MAX.to_le_bytes(), json!(u64::MAX));
        check(Type::Elem(Elem::Lreal), &1.5f64.to_le_bytes(), json!(1.5));
        check(Type::Elem(Elem::Real), &0.1f32.to_le_bytes(), json!(0.1));
        check(Type::Elem(Elem::Lreal), &f64::NAN.to_le_bytes(), json!("NaN"));
        check(Type::Elem(Elem::Time), &1500u32.to_le_bytes(), json!("T#1s500ms"));
        check(Type::String(4), b"ab\0xx", json!("ab"));
    }

    #[test]
    fn arrays_are_lists_of_lists() {
        let mut types = Types::default();
        let elem = types.intern(Type::Elem(Elem::Usint));
        let array = types.intern(Type::Array { elem, dims: vec![(1, 2), (0, 2)] });
        assert_eq!(to_json(&types, array, &[1, 2, 3, 4, 5, 6]), json!([[1, 2, 3], [4, 5, 6]]));
    }

    #[test]
    fn people_see_no_negative_zero() {
        assert_eq!(rounded(-0.0001, 2), "0.00");
        assert_eq!(rounded(-1.25, 1), "-1.2");
    }
}
