//! What retained values are: instance paths and types, as text that travels with the values.

use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::Arc;
use takt_abi::{Elem, Section};
use takt_ir::{Enumeration, Field, Program, RetainKind, StructKind, Structure, Type, TypeId, Types, elem_name};

/// Bytes that all values together may have.
pub const LARGEST: u64 = 1 << 30;
/// Nesting of types beyond which a description is refused.
const DEEPEST: u32 = 200;

/// The variables of a file, in the order of their values.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Name of the project.
    pub project: String,
    /// The variables.
    pub places: Vec<Described>,
    /// Their types; each stands behind those it is made of.
    pub types: Vec<TypeText>,
}

/// A variable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Described {
    /// Instance path.
    pub path: String,
    /// PERSISTENT rather than RETAIN.
    pub persistent: bool,
    /// Number of its type.
    pub ty: u32,
}

impl Described {
    /// How long it is kept.
    pub fn kind(&self) -> RetainKind {
        if self.persistent { RetainKind::Persistent } else { RetainKind::Retain }
    }
}

/// A type.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum TypeText {
    /// Elementary, by its name in ST.
    Elem(String),
    /// STRING(n).
    String(u32),
    /// WSTRING(n).
    Wstring(u32),
    /// ARRAY: element, bounds.
    Array(u32, Vec<(i64, i64)>),
    /// STRUCT, FUNCTION_BLOCK, PROGRAM: name, bytes, members (name, type, offset).
    Struct(String, u32, Vec<(String, u32, u32)>),
    /// UNION.
    Union(String, u32, Vec<(String, u32, u32)>),
    /// Enumeration: name, base type, members.
    Enum(String, String, Vec<(String, i64)>),
    /// Subrange: base type, bounds.
    Subrange(String, String, String),
    /// A bit of a byte.
    Bit(u8),
    /// What points elsewhere, and is not kept: its name.
    Pointer(String),
}

/// All elementary types.
const ELEMS: [Elem; 25] = [
    Elem::Bool,
    Elem::Byte,
    Elem::Word,
    Elem::Dword,
    Elem::Lword,
    Elem::Sint,
    Elem::Int,
    Elem::Dint,
    Elem::Lint,
    Elem::Usint,
    Elem::Uint,
    Elem::Udint,
    Elem::Ulint,
    Elem::Real,
    Elem::Lreal,
    Elem::Time,
    Elem::Ltime,
    Elem::Date,
    Elem::Ldate,
    Elem::Tod,
    Elem::Ltod,
    Elem::Dt,
    Elem::Ldt,
    Elem::Char,
    Elem::Wchar,
];

fn elem_of(name: &str) -> Option<Elem> {
    ELEMS.into_iter().find(|elem| elem_name(*elem) == name)
}

/// Numbers of the types that have been described.
struct Describer<'p> {
    types: &'p Types,
    known: HashMap<TypeId, u32>,
    texts: Vec<TypeText>,
}

impl Describer<'_> {
    fn number(&mut self, id: TypeId) -> u32 {
        if let Some(number) = self.known.get(&id) {
            return *number;
        }
        let types = self.types;
        let text = match types.get(id) {
            Type::Elem(elem) => TypeText::Elem(elem_name(*elem).into()),
            Type::String(n) => TypeText::String(*n),
            Type::WString(n) => TypeText::Wstring(*n),
            Type::Array { elem, dims } => TypeText::Array(self.number(*elem), dims.clone()),
            Type::Struct(s) => {
                let fields = s.fields.iter().filter(|f| f.section != Section::InOut);
                let fields = fields.map(|f| (f.name.clone(), self.number(f.ty), f.offset)).collect();
                match s.kind {
                    StructKind::Union => TypeText::Union(s.name.clone(), s.size, fields),
                    _ => TypeText::Struct(s.name.clone(), s.size, fields),
                }
            }
            Type::Enum(e) => TypeText::Enum(e.name.clone(), elem_name(e.base).into(), e.members.clone()),
            Type::Subrange { base, low, high } => TypeText::Subrange(elem_name(*base).into(), low.to_string(), high.to_string()),
            Type::Bit(n) => TypeText::Bit(*n),
            Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) | Type::OpenArray { .. } | Type::Error => {
                TypeText::Pointer(types.name(id))
            }
        };
        self.texts.push(text);
        let number = self.texts.len() as u32 - 1;
        self.known.insert(id, number);
        number
    }
}

impl Description {
    /// What a program retains.
    pub fn of(project: &str, program: &Program) -> Self {
        let mut describer = Describer { types: &program.types, known: HashMap::new(), texts: Vec::new() };
        let place = |r: &takt_ir::Retained| Described {
            path: r.path.clone(),
            persistent: r.kind == RetainKind::Persistent,
            ty: describer.number(r.ty),
        };
        let places = program.retained.iter().map(place).collect();
        Self { project: project.into(), places, types: describer.texts }
    }

    /// As it stands in a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// Reads one; what it says must hold together.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, Decoded), String> {
        let description: Self = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        let decoded = description.decode()?;
        Ok((description, decoded))
    }

    fn decode(&self) -> Result<Decoded, String> {
        let mut types = Types::default();
        let mut depths: Vec<u32> = Vec::with_capacity(self.types.len());
        for (number, text) in self.types.iter().enumerate() {
            let (ty, depth) = decode(text, &types, &depths).ok_or_else(|| format!("type {number} makes no sense"))?;
            types.push(ty);
            depths.push(depth);
        }
        let (mut at, mut offsets) = (0u64, Vec::with_capacity(self.places.len()));
        for place in &self.places {
            if place.ty as usize >= self.types.len() {
                return Err(format!("`{}` has type {}, which is missing", place.path, place.ty));
            }
            offsets.push(at as usize);
            at += u64::from(types.size(TypeId(place.ty)));
            if at > LARGEST {
                return Err(format!("the values have more than {LARGEST} bytes"));
            }
        }
        Ok(Decoded { types, offsets, len: at as usize })
    }
}

/// A description with its layout.
#[derive(Debug, Clone, Default)]
pub struct Decoded {
    /// Types, with the numbers of the description.
    pub types: Types,
    /// Where each variable's value begins.
    pub offsets: Vec<usize>,
    /// Bytes of all values.
    pub len: usize,
}

/// A type and how deep it is nested.
fn decode(text: &TypeText, types: &Types, depths: &[u32]) -> Option<(Type, u32)> {
    let depth = |number: u32| depths.get(number as usize).map(|d| d + 1).filter(|d| *d <= DEEPEST);
    Some(match text {
        TypeText::Elem(name) => (Type::Elem(elem_of(name)?), 0),
        TypeText::String(n) if u64::from(*n) < LARGEST => (Type::String(*n), 0),
        TypeText::Wstring(n) if u64::from(*n) < LARGEST / 2 => (Type::WString(*n), 0),
        TypeText::Array(elem, dims) => {
            let depth = depth(*elem)?;
            let mut size = u64::from(types.size(TypeId(*elem)));
            for (low, high) in dims {
                let count = u64::try_from(i128::from(*high) - i128::from(*low) + 1).ok()?;
                size = size.checked_mul(count).filter(|size| *size <= LARGEST)?;
            }
            (Type::Array { elem: TypeId(*elem), dims: dims.clone() }, depth)
        }
        TypeText::Struct(name, size, fields) | TypeText::Union(name, size, fields) => {
            let mut deepest = 0;
            let mut members = Vec::with_capacity(fields.len());
            for (name, ty, offset) in fields {
                deepest = deepest.max(depth(*ty)?);
                let end = u64::from(*offset) + u64::from(types.size(TypeId(*ty)));
                if end > u64::from(*size) {
                    return None;
                }
                let (ty, section) = (TypeId(*ty), Section::State);
                members.push(Field { name: name.clone(), ty, offset: *offset, section, doc: String::new() });
            }
            let kind = if let TypeText::Union(..) = text { StructKind::Union } else { StructKind::Struct };
            (Type::Struct(Arc::new(Structure { name: name.clone(), kind, fields: members, size: *size, align: 1 })), deepest)
        }
        TypeText::Enum(name, base, members) => {
            let base = elem_of(base)?;
            (Type::Enum(Arc::new(Enumeration { name: name.clone(), base, members: members.clone() })), 0)
        }
        TypeText::Subrange(base, low, high) => {
            let (low, high) = (low.parse().ok()?, high.parse().ok()?);
            (Type::Subrange { base: elem_of(base)?, low, high }, 0)
        }
        TypeText::Bit(n) if *n < 8 => (Type::Bit(*n), 0),
        TypeText::Pointer(name) => (Type::Interface(name.as_str().into()), 0),
        _ => return None,
    })
}

/// Calls `found` for each elementary value, string or enumeration in a variable: path, type, bytes.
pub fn leaves(types: &Types, ty: TypeId, bytes: &[u8], path: &mut String, found: &mut dyn FnMut(&str, TypeId, &[u8])) {
    let len = path.len();
    match types.get(ty) {
        Type::Array { elem, dims } => {
            let size = types.size(*elem) as usize;
            let count = types.size(ty) as usize / size.max(1);
            for n in 0..count {
                path.push_str(&indices(dims, n as u64));
                leaves(types, *elem, bytes.get(n * size..).unwrap_or_default(), path, found);
                path.truncate(len);
            }
        }
        Type::Struct(s) => {
            for field in s.fields.iter().filter(|f| f.section != Section::InOut) {
                path.push('.');
                path.push_str(&field.name);
                leaves(types, field.ty, bytes.get(field.offset as usize..).unwrap_or_default(), path, found);
                path.truncate(len);
            }
        }
        Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) | Type::OpenArray { .. } | Type::Error => {}
        _ => found(path, ty, bytes),
    }
}

/// The indices of the element with that number as they are written.
pub fn indices(dims: &[(i64, i64)], number: u64) -> String {
    let mut rest = number;
    let mut parts: Vec<String> = Vec::new();
    for (low, high) in dims.iter().rev() {
        let len = high.abs_diff(*low) + 1;
        parts.push((low + (rest % len) as i64).to_string());
        rest /= len;
    }
    parts.reverse();
    format!("[{}]", parts.join(", "))
}
