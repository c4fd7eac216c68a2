//! Variables by name, and their values as people write them.

use crate::program::Program;
use crate::types::{TypeId, Types};

/// A named place in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Offset into the image.
    pub offset: u32,
    /// Type.
    pub ty: TypeId,
}

/// Why a path names nothing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SymbolError {
    /// A part of the path is unknown.
    Unknown {
        /// The part as written.
        part: String,
        /// What was resolved so far (`GVL.Theta1`), empty at the start.
        within: String,
        /// The closest existing name.
        suggestion: Option<String>,
    },
}

impl std::fmt::Display for SymbolError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self:?}")
    }
}
impl std::error::Error for SymbolError {}

/// A value of an elementary type, string or enumeration.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// Integers, times (in their unit), pointers, enumerations.
    Int(i128),
    /// REAL, LREAL.
    Real(f64),
    /// BOOL.
    Bool(bool),
    /// STRING, WSTRING.
    Text(String),
}

/// Why a text is no value of a type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ValueError {
    /// Not a literal of the type.
    Malformed {
        /// The text.
        text: String,
        /// The type.
        ty: String,
    },
}

impl std::fmt::Display for ValueError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self:?}")
    }
}
impl std::error::Error for ValueError {}

/// The place that a path names: `GVL.Theta1.fActPosition`, `PLC_PRG.a[3].b`. Case does not matter.
pub fn resolve(program: &Program, path: &str) -> Result<Place, SymbolError> {
    let _ = program;
    Err(SymbolError::Unknown { part: path.into(), within: String::new(), suggestion: None })
}

/// The value as ST writes it.
pub fn format_value(types: &Types, ty: TypeId, bytes: &[u8]) -> String {
    let _ = (types, ty, bytes);
    String::new()
}

/// The value of an elementary type, string, enumeration or pointer; `None` for arrays and structures, or if bytes are missing.
pub fn read_scalar(types: &Types, ty: TypeId, bytes: &[u8]) -> Option<Scalar> {
    let _ = (types, ty, bytes);
    None
}

/// The bytes of a literal of the type, range-checked.
pub fn parse_value(types: &Types, ty: TypeId, text: &str) -> Result<Vec<u8>, ValueError> {
    let _ = bytes_of(types, ty);
    Err(ValueError::Malformed { text: text.into(), ty: types.name(ty) })
}

fn bytes_of(types: &Types, ty: TypeId) -> u32 {
    types.size(ty)
}
