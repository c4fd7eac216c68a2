//! Types of a generated program.

use super::Generator;

/// What an operator sees in an elementary type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// BOOL.
    Bool,
    /// Integers and bit strings.
    Int,
    /// REAL and LREAL.
    Real,
    /// TIME and LTIME.
    Duration,
    /// Dates and times of day.
    Moment,
    /// CHAR and WCHAR.
    Char,
}

/// An elementary type.
#[derive(Debug, PartialEq, Eq)]
pub struct Scalar {
    /// ST name.
    pub name: &'static str,
    /// What operators see.
    pub class: Class,
    /// Width.
    pub bits: u32,
    /// Has negative values.
    pub signed: bool,
}

const fn scalar(name: &'static str, class: Class, bits: u32, signed: bool) -> Scalar {
    Scalar { name, class, bits, signed }
}

/// All elementary types but the strings.
pub static SCALARS: [Scalar; 25] = [
    scalar("BOOL", Class::Bool, 8, false),
    scalar("SINT", Class::Int, 8, true),
    scalar("INT", Class::Int, 16, true),
    scalar("DINT", Class::Int, 32, true),
    scalar("LINT", Class::Int, 64, true),
    scalar("USINT", Class::Int, 8, false),
    scalar("UINT", Class::Int, 16, false),
    scalar("UDINT", Class::Int, 32, false),
    scalar("ULINT", Class::Int, 64, false),
    scalar("BYTE", Class::Int, 8, false),
    scalar("WORD", Class::Int, 16, false),
    scalar("DWORD", Class::Int, 32, false),
    scalar("LWORD", Class::Int, 64, false),
    scalar("REAL", Class::Real, 32, true),
    scalar("LREAL", Class::Real, 64, true),
    scalar("TIME", Class::Duration, 32, false),
    scalar("LTIME", Class::Duration, 64, true),
    scalar("DATE", Class::Moment, 32, false),
    scalar("TOD", Class::Moment, 32, false),
    scalar("DT", Class::Moment, 32, false),
    scalar("LDATE", Class::Moment, 64, false),
    scalar("LTOD", Class::Moment, 64, false),
    scalar("LDT", Class::Moment, 64, false),
    scalar("CHAR", Class::Char, 8, false),
    scalar("WCHAR", Class::Char, 16, false),
];

/// The elementary type of a name in the table.
pub fn named(name: &str) -> &'static Scalar {
    SCALARS.iter().find(|s| s.name == name).expect("a name of the table")
}

/// A type.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Elementary.
    Scalar(&'static Scalar),
    /// STRING(n).
    Text(u32),
    /// WSTRING(n).
    Wide(u32),
    /// A declared enumeration.
    Enumeration(usize),
    /// A declared subrange.
    Range(usize),
    /// A declared structure or union.
    Structure(usize),
    /// A block.
    Block(usize),
    /// ARRAY with bounds.
    Array(Box<Shape>, Vec<(i64, i64)>),
    /// `ARRAY[*]`, one dimension.
    Open(Box<Shape>),
    /// POINTER TO.
    Pointer(Box<Shape>),
    /// REFERENCE TO; in a scope it stands for its target.
    Reference(Box<Shape>),
}

impl Shape {
    /// The elementary type, if it is one.
    pub fn scalar(&self) -> Option<&'static Scalar> {
        match self {
            Self::Scalar(s) => Some(s),
            _ => None,
        }
    }
    /// Whether it is elementary, of this class.
    pub fn is(&self, class: Class) -> bool {
        self.scalar().is_some_and(|s| s.class == class)
    }
    /// Whether one assignment of an expression fills it.
    pub fn is_leaf(&self) -> bool {
        matches!(self, Self::Scalar(_) | Self::Text(_) | Self::Wide(_) | Self::Enumeration(_) | Self::Range(_) | Self::Pointer(_))
    }
}

/// A variable that can be named here.
#[derive(Debug, Clone)]
pub struct Variable {
    /// How it is named.
    pub path: String,
    /// Its type.
    pub shape: Shape,
    /// May be assigned.
    pub writable: bool,
}

impl Variable {
    /// A variable that may be written.
    pub fn new(path: impl Into<String>, shape: Shape) -> Self {
        Self { path: path.into(), shape, writable: true }
    }
    /// A variable that may only be read.
    pub fn fixed(path: impl Into<String>, shape: Shape) -> Self {
        Self { path: path.into(), shape, writable: false }
    }
}

/// A declared enumeration.
#[derive(Debug, Clone)]
pub struct Enumeration {
    /// Name.
    pub name: String,
    /// Members.
    pub members: Vec<String>,
}

/// A declared subrange.
#[derive(Debug, Clone)]
pub struct Range {
    /// Name.
    pub name: String,
    /// Base.
    pub base: &'static Scalar,
    /// Lowest value.
    pub low: i64,
    /// Highest value.
    pub high: i64,
}

/// A declared structure or union.
#[derive(Debug, Clone)]
pub struct Structure {
    /// Name.
    pub name: String,
    /// Fields.
    pub fields: Vec<(String, Shape)>,
}

/// A function or block as a caller sees it.
#[derive(Debug, Clone, Default)]
pub struct Signature {
    /// Name.
    pub name: String,
    /// Inputs.
    pub inputs: Vec<(String, Shape)>,
    /// VAR_IN_OUT.
    pub in_outs: Vec<(String, Shape)>,
    /// Outputs.
    pub outputs: Vec<(String, Shape)>,
    /// Result of a function.
    pub result: Option<Shape>,
    /// An action's name, for blocks that have one.
    pub action: Option<String>,
    /// The first input limits how deep the function calls itself.
    pub recursive: bool,
}

/// Bytes of a variable of data: structures of arrays of structures would soon fill the memory.
const LARGEST: u64 = 1 << 16;

impl Generator {
    /// The type as it is written in a declaration.
    pub(super) fn spell(&self, shape: &Shape) -> String {
        match shape {
            Shape::Scalar(s) => s.name.into(),
            Shape::Text(n) => format!("STRING({n})"),
            Shape::Wide(n) => format!("WSTRING({n})"),
            Shape::Enumeration(i) => self.enumerations[*i].name.clone(),
            Shape::Range(i) => self.ranges[*i].name.clone(),
            Shape::Structure(i) => self.structures[*i].name.clone(),
            Shape::Block(i) => self.blocks[*i].name.clone(),
            Shape::Array(elem, dims) => {
                let dims: Vec<_> = dims.iter().map(|(l, h)| format!("{l}..{h}")).collect();
                format!("ARRAY[{}] OF {}", dims.join(", "), self.spell(elem))
            }
            Shape::Open(elem) => format!("ARRAY[*] OF {}", self.spell(elem)),
            Shape::Pointer(to) => format!("POINTER TO {}", self.spell(to)),
            Shape::Reference(to) => format!("REFERENCE TO {}", self.spell(to)),
        }
    }

    /// An elementary type, the common ones more often.
    pub(super) fn elementary(&mut self) -> Shape {
        match self.random.below(10) {
            0..=3 => Shape::Scalar(&SCALARS[self.random.below(15)]),
            4 | 5 => Shape::Scalar(named(self.random.pick(&["REAL", "LREAL"]))),
            _ => Shape::Scalar(&SCALARS[self.random.below(SCALARS.len())]),
        }
    }

    /// A type that one assignment fills.
    pub(super) fn leaf(&mut self) -> Shape {
        match self.random.below(20) {
            0 => Shape::Text(self.random.pick(&[1, 5, 20, 80, 255])),
            1 => Shape::Wide(self.random.pick(&[3, 10, 40])),
            2 if !self.enumerations.is_empty() => Shape::Enumeration(self.random.below(self.enumerations.len())),
            3 if !self.ranges.is_empty() => Shape::Range(self.random.below(self.ranges.len())),
            _ => self.elementary(),
        }
    }

    /// Bytes of a variable, about.
    pub(super) fn bytes(&self, shape: &Shape) -> u64 {
        match shape {
            Shape::Scalar(s) => u64::from(s.bits / 8),
            Shape::Text(n) => u64::from(*n) + 1,
            Shape::Wide(n) => 2 * (u64::from(*n) + 1),
            Shape::Structure(i) => self.structures[*i].fields.iter().map(|(_, field)| self.bytes(field).next_multiple_of(8)).sum(),
            Shape::Array(elem, dims) => dims.iter().fold(self.bytes(elem), |all, (l, h)| all.saturating_mul((h - l + 1) as u64)),
            _ => 8,
        }
    }

    /// Any type of data that is not large: no block, no pointer.
    pub(super) fn data(&mut self, depth: usize) -> Shape {
        let shape = self.any_data(depth);
        if self.bytes(&shape) <= LARGEST { shape } else { self.leaf() }
    }

    fn any_data(&mut self, depth: usize) -> Shape {
        match self.random.below(12) {
            0 | 1 if depth > 0 => self.array(depth),
            2 | 3 if !self.structures.is_empty() => Shape::Structure(self.random.below(self.structures.len())),
            _ => self.leaf(),
        }
    }

    /// An array of data, of one to three dimensions.
    pub(super) fn array(&mut self, depth: usize) -> Shape {
        let dims = (0..self.random.pick(&[1, 1, 1, 2, 2, 3])).map(|_| self.bounds()).collect();
        Shape::Array(Box::new(self.any_data(depth - 1)), dims)
    }

    fn bounds(&mut self) -> (i64, i64) {
        let low = self.random.pick(&[0, 0, 1, 1, -3, 5]);
        (low, low + self.random.below(5) as i64)
    }
}
