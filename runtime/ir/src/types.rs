//! Types with their layout: what compiler, symbols and tools know of a variable.

use std::sync::Arc;
use takt_abi::{Elem, Section};

/// A type of a program. Equal structural types have equal ids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TypeId(pub u32);

/// What a structured type is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StructKind {
    /// STRUCT.
    Struct,
    /// UNION.
    Union,
    /// FUNCTION_BLOCK.
    Block,
    /// PROGRAM.
    Program,
}

/// A member of a structured type.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Field {
    /// Name as declared.
    pub name: String,
    /// Type. For a VAR_IN_OUT the type of the variable passed: 8 bytes hold its offset (24 for `ARRAY[*]`: offset, then per dimension two bounds).
    pub ty: TypeId,
    /// Bytes behind the start.
    pub offset: u32,
    /// Section; `State` for VAR and for STRUCT members.
    pub section: Section,
    /// Documentation.
    pub doc: String,
}

/// A structured type with its layout.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Structure {
    /// Name as declared.
    pub name: String,
    /// What it is.
    pub kind: StructKind,
    /// Members in order.
    pub fields: Vec<Field>,
    /// Bytes.
    pub size: u32,
    /// Alignment.
    pub align: u32,
}

/// An enumeration.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Enumeration {
    /// Name as declared.
    pub name: String,
    /// Base type.
    pub base: Elem,
    /// Names and values.
    pub members: Vec<(String, i64)>,
}

/// A type.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Type {
    /// Elementary.
    Elem(Elem),
    /// STRING(n).
    String(u32),
    /// WSTRING(n).
    WString(u32),
    /// ARRAY.
    Array {
        /// Element.
        elem: TypeId,
        /// Bounds per dimension, the last runs fastest.
        dims: Vec<(i64, i64)>,
    },
    /// `ARRAY[*, …]`: only as VAR_IN_OUT.
    OpenArray {
        /// Element.
        elem: TypeId,
        /// Dimensions.
        dims: u32,
    },
    /// STRUCT, UNION, FUNCTION_BLOCK, PROGRAM. Identity is the name within a program.
    Struct(Arc<Structure>),
    /// Enumeration.
    Enum(Arc<Enumeration>),
    /// POINTER TO: 8 bytes, an offset into the image.
    Pointer(TypeId),
    /// REFERENCE TO.
    Reference(TypeId),
    /// INTERFACE, by its name: 8 bytes, the offset of an instance that implements it.
    Interface(Box<str>),
    /// Subrange.
    Subrange {
        /// Base type.
        base: Elem,
        /// Lower bound.
        low: i128,
        /// Upper bound.
        high: i128,
    },
    /// One bit of a byte, a BOOL: a BIT in a STRUCT, `%IX0.3`. Nothing but a member or a global has this type.
    Bit(u8),
    /// What an erroneous program means here; never in a program that runs.
    Error,
}

/// The types of a program.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Types {
    all: Vec<Type>,
    ids: std::collections::HashMap<Type, TypeId>,
}

impl Types {
    /// The id of a type; equal types get equal ids.
    pub fn intern(&mut self, ty: Type) -> TypeId {
        if let Some(id) = self.ids.get(&ty) {
            return *id;
        }
        let id = self.push(ty.clone());
        self.ids.insert(ty, id);
        id
    }
    /// A new id for a type that will be completed with [`Types::set`] (structures, while their members are being read).
    pub fn push(&mut self, ty: Type) -> TypeId {
        self.all.push(ty);
        TypeId(self.all.len() as u32 - 1)
    }
    /// Completes a type.
    pub fn set(&mut self, id: TypeId, ty: Type) {
        self.all[id.0 as usize] = ty;
    }
    /// The id of a type, if the program has it.
    pub fn find(&self, ty: &Type) -> Option<TypeId> {
        self.ids.get(ty).copied()
    }
    /// The type.
    pub fn get(&self, id: TypeId) -> &Type {
        &self.all[id.0 as usize]
    }
    /// All types in order of their ids.
    pub fn all(&self) -> &[Type] {
        &self.all
    }
    /// Bytes and alignment.
    pub fn layout(&self, id: TypeId) -> (u32, u32) {
        match self.get(id) {
            Type::Elem(e) => (elem_size(*e), elem_size(*e)),
            Type::String(n) => (n + 1, 1),
            Type::WString(n) => (2 * (n + 1), 2),
            Type::Array { elem, dims } => {
                let (size, align) = self.layout(*elem);
                let count = dims.iter().map(|(l, h)| (h - l + 1).max(0) as u64).fold(1u64, u64::saturating_mul);
                (count.saturating_mul(size.into()).min(u32::MAX.into()) as u32, align)
            }
            Type::OpenArray { dims, .. } => (8 + 16 * dims, 8),
            Type::Struct(s) => (s.size, s.align.max(1)),
            Type::Enum(e) => (elem_size(e.base), elem_size(e.base)),
            Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) => (8, 8),
            Type::Subrange { base, .. } => (elem_size(*base), elem_size(*base)),
            Type::Bit(_) | Type::Error => (1, 1),
        }
    }
    /// Bytes.
    pub fn size(&self, id: TypeId) -> u32 {
        self.layout(id).0
    }
    /// The name in messages: `ARRAY[0..9] OF INT`.
    pub fn name(&self, id: TypeId) -> String {
        match self.get(id) {
            Type::Elem(e) => elem_name(*e).into(),
            Type::String(80) => "STRING".into(),
            Type::String(n) => format!("STRING({n})"),
            Type::WString(80) => "WSTRING".into(),
            Type::WString(n) => format!("WSTRING({n})"),
            Type::Array { elem, dims } => {
                let dims: Vec<_> = dims.iter().map(|(l, h)| format!("{l}..{h}")).collect();
                format!("ARRAY[{}] OF {}", dims.join(", "), self.name(*elem))
            }
            Type::OpenArray { elem, dims } => format!("ARRAY[{}] OF {}", vec!["*"; *dims as usize].join(", "), self.name(*elem)),
            Type::Struct(s) => s.name.clone(),
            Type::Enum(e) => e.name.clone(),
            Type::Pointer(t) => format!("POINTER TO {}", self.name(*t)),
            Type::Reference(t) => format!("REFERENCE TO {}", self.name(*t)),
            Type::Interface(name) => name.to_string(),
            Type::Subrange { base, low, high } => format!("{}({low}..{high})", elem_name(*base)),
            Type::Bit(_) => "BIT".into(),
            Type::Error => "?".into(),
        }
    }
}

/// Bytes of an elementary type.
pub fn elem_size(e: Elem) -> u32 {
    match e {
        Elem::Bool | Elem::Byte | Elem::Sint | Elem::Usint | Elem::Char => 1,
        Elem::Word | Elem::Int | Elem::Uint | Elem::Wchar => 2,
        Elem::Dword | Elem::Dint | Elem::Udint | Elem::Real | Elem::Time | Elem::Date | Elem::Tod | Elem::Dt => 4,
        Elem::Lword | Elem::Lint | Elem::Ulint | Elem::Lreal | Elem::Ltime | Elem::Ldate | Elem::Ltod | Elem::Ldt => 8,
    }
}

/// Name of an elementary type in ST.
pub fn elem_name(e: Elem) -> &'static str {
    match e {
        Elem::Bool => "BOOL",
        Elem::Byte => "BYTE",
        Elem::Word => "WORD",
        Elem::Dword => "DWORD",
        Elem::Lword => "LWORD",
        Elem::Sint => "SINT",
        Elem::Int => "INT",
        Elem::Dint => "DINT",
        Elem::Lint => "LINT",
        Elem::Usint => "USINT",
        Elem::Uint => "UINT",
        Elem::Udint => "UDINT",
        Elem::Ulint => "ULINT",
        Elem::Real => "REAL",
        Elem::Lreal => "LREAL",
        Elem::Time => "TIME",
        Elem::Ltime => "LTIME",
        Elem::Date => "DATE",
        Elem::Ldate => "LDATE",
        Elem::Tod => "TIME_OF_DAY",
        Elem::Ltod => "LTIME_OF_DAY",
        Elem::Dt => "DATE_AND_TIME",
        Elem::Ldt => "LDATE_AND_TIME",
        Elem::Char => "CHAR",
        Elem::Wchar => "WCHAR",
    }
}
