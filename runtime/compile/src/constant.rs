//! Values known at compile time.

use takt_abi::Elem;

/// A constant. Its type stands beside it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value {
    /// Integer, BOOL (0, 1), enumeration, time (in the unit of its type), pointer.
    Int(i128),
    /// REAL (already rounded to it) or LREAL.
    Real(f64),
    /// STRING without its NUL.
    Text(Vec<u8>),
    /// WSTRING without its NUL.
    Wide(Vec<u16>),
}

impl Value {
    /// The 64-bit word of an integer.
    pub(crate) fn word(&self) -> i64 {
        match self {
            Self::Int(v) => *v as i64,
            _ => 0,
        }
    }
    /// Whether its bytes are all 0.
    pub(crate) fn is_zero(&self) -> bool {
        match self {
            Self::Int(v) => *v == 0,
            Self::Real(v) => v.to_bits() == 0,
            Self::Text(text) => text.is_empty(),
            Self::Wide(text) => text.is_empty(),
        }
    }
}

/// Lowest and highest value of an integer-like type.
pub(crate) fn range(e: Elem) -> (i128, i128) {
    let signed = |bits: u32| (-(1i128 << (bits - 1)), (1i128 << (bits - 1)) - 1);
    let unsigned = |bits: u32| (0, (1i128 << bits) - 1);
    match e {
        Elem::Bool => (0, 1),
        Elem::Sint => signed(8),
        Elem::Int => signed(16),
        Elem::Dint => signed(32),
        Elem::Lint | Elem::Ltime => signed(64),
        Elem::Byte | Elem::Usint | Elem::Char => unsigned(8),
        Elem::Word | Elem::Uint | Elem::Wchar => unsigned(16),
        Elem::Dword | Elem::Udint | Elem::Time | Elem::Date | Elem::Tod | Elem::Dt => unsigned(32),
        _ => unsigned(64),
    }
}

/// `value` cut to the type, as a mathematical number.
pub(crate) fn cut(value: i128, e: Elem) -> i128 {
    let (low, high) = range(e);
    if (low..=high).contains(&value) {
        return value;
    }
    if e == Elem::Bool {
        return i128::from(value != 0);
    }
    (value - low).rem_euclid(high - low + 1) + low
}

/// Writes a value of an elementary type as it lies in memory.
pub(crate) fn store(value: &Value, e: Elem, bytes: &mut [u8]) {
    match (value, e) {
        (Value::Real(v), Elem::Real) => bytes[..4].copy_from_slice(&canonical_f32(*v as f32).to_le_bytes()),
        (Value::Real(v), Elem::Lreal) => bytes[..8].copy_from_slice(&canonical_f64(*v).to_le_bytes()),
        (Value::Int(v), _) => {
            let size = takt_ir::elem_size(e) as usize;
            bytes[..size].copy_from_slice(&v.to_le_bytes()[..size]);
        }
        _ => {}
    }
}

fn canonical_f32(v: f32) -> f32 {
    if v.is_nan() { f32::from_bits(0x7FC0_0000) } else { v }
}

fn canonical_f64(v: f64) -> f64 {
    if v.is_nan() { f64::from_bits(0x7FF8_0000_0000_0000) } else { v }
}
