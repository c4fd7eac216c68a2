//! Descriptors: how native types, blocks and functions present themselves to the compiler.
//!
//! They are written once, by the macros of this crate, from the Rust declaration; offsets come from `offset_of!`. The compiler reads them and
//! knows no block by name.

use crate::context::Context;

/// The elementary types of IEC 61131-3 (table 10).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names are those of the standard")]
pub enum Elem {
    Bool,
    Byte,
    Word,
    Dword,
    Lword,
    Sint,
    Int,
    Dint,
    Lint,
    Usint,
    Uint,
    Udint,
    Ulint,
    Real,
    Lreal,
    Time,
    Ltime,
    Date,
    Ldate,
    Tod,
    Ltod,
    Dt,
    Ldt,
    Char,
    Wchar,
}

/// The type of a native field or parameter.
#[derive(Debug, Clone, Copy)]
pub enum FieldType {
    /// An elementary type.
    Elem(Elem),
    /// STRING(n): n+1 bytes.
    String(u32),
    /// WSTRING(n): n+1 units of 16 bits.
    WString(u32),
    /// ARRAY[low..high] OF elem.
    Array {
        /// Element type.
        elem: &'static FieldType,
        /// Lower bound.
        low: i64,
        /// Upper bound.
        high: i64,
    },
    /// A structure declared with [`crate::st_struct!`].
    Struct(&'static StructDesc),
    /// An enumeration declared with [`crate::st_enum!`].
    Enum(&'static EnumDesc),
    /// POINTER TO.
    Pointer(&'static FieldType),
    /// `ARRAY[*]` OF elem; only as VAR_IN_OUT of a block.
    OpenArray(&'static FieldType),
}

/// Which VAR section a field stands in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Section {
    /// VAR_INPUT.
    Input,
    /// VAR_OUTPUT.
    Output,
    /// VAR_IN_OUT: the field holds an offset ([`crate::InOut`]) or an [`crate::OpenArray`].
    InOut,
    /// VAR, not visible from outside.
    State,
}

/// A field of a structure or block.
#[derive(Debug, Clone, Copy)]
pub struct FieldDesc {
    /// ST name.
    pub name: &'static str,
    /// Documentation, Markdown.
    pub doc: &'static str,
    /// VAR section ([`Section::State`] in structures).
    pub section: Section,
    /// Type.
    pub ty: FieldType,
    /// Byte offset.
    pub offset: usize,
}

/// A STRUCT.
#[derive(Debug, Clone, Copy)]
pub struct StructDesc {
    /// ST name.
    pub name: &'static str,
    /// Documentation.
    pub doc: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// Alignment in bytes.
    pub align: usize,
    /// Fields in order.
    pub fields: &'static [FieldDesc],
    /// Writes the initial values of all fields.
    pub init: fn(&mut [u8]),
}

/// An enumeration; its members resolve without qualifier unless it says otherwise.
#[derive(Debug, Clone, Copy)]
pub struct EnumDesc {
    /// ST name.
    pub name: &'static str,
    /// Documentation.
    pub doc: &'static str,
    /// Base type.
    pub base: Elem,
    /// Members and values.
    pub members: &'static [(&'static str, i64)],
    /// Members resolve only behind the name of the type.
    pub qualified_only: bool,
}

/// What compiled code calls: context, arguments (and place of the result); 0 or the code of the fault, whose facts are then in the context.
///
/// # Safety
/// `ctx` must be the live context of the running program, `args` must point to as many words as the callee has parameters (at least one).
pub type NativeFn = unsafe extern "C" fn(ctx: *mut Context, args: *mut u64) -> u32;

/// A function block in Rust.
#[derive(Debug, Clone, Copy)]
pub struct BlockDesc {
    /// Canonical ST name.
    pub name: &'static str,
    /// Other names of the same block (the CODESYS ones).
    pub aliases: &'static [&'static str],
    /// Documentation.
    pub doc: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// Alignment in bytes.
    pub align: usize,
    /// Fields in order.
    pub fields: &'static [FieldDesc],
    /// Writes the initial values of all fields.
    pub init: fn(&mut [u8]),
    /// The body; `args[0]` is the offset of the instance. `None`: a block without a body (AXIS_REF_SM3).
    pub cycle: Option<NativeFn>,
    /// Makes the resource that each instance owns, before the first scan.
    pub resource: Option<fn() -> Box<dyn crate::Resource>>,
}

/// A parameter of a native function.
#[derive(Debug, Clone, Copy)]
pub struct ParamDesc {
    /// ST name.
    pub name: &'static str,
    /// Type. Elementary types, enums and pointers go by value (integers sign- or zero-extended to 64 bits, BOOL 0 or 1, REAL as its 32 bits, LREAL as its 64 bits);
    /// everything else as the offset of a copy.
    pub ty: FieldType,
}

/// A function in Rust. The result comes back in `args[0]`; a STRING or STRUCT result is written at the offset that is passed *after* the last parameter.
#[derive(Debug, Clone, Copy)]
pub struct FnDesc {
    /// ST name.
    pub name: &'static str,
    /// Documentation.
    pub doc: &'static str,
    /// Parameters.
    pub params: &'static [ParamDesc],
    /// Result.
    pub result: FieldType,
    /// The body.
    pub call: NativeFn,
}

/// A library: all that the compiler is handed.
#[derive(Debug, Clone, Copy)]
pub struct Library {
    /// Name for qualified access (`SM3_Basic.MC_Power`).
    pub name: &'static str,
    /// Native blocks.
    pub blocks: &'static [&'static BlockDesc],
    /// Native functions.
    pub functions: &'static [&'static FnDesc],
    /// Structures.
    pub structs: &'static [&'static StructDesc],
    /// Enumerations.
    pub enums: &'static [&'static EnumDesc],
    /// Other names of types: (alias, canonical).
    pub aliases: &'static [(&'static str, &'static str)],
    /// ST sources: (file name, text).
    pub sources: &'static [(&'static str, &'static str)],
}
