//! What names mean: the entries of the scopes.

use crate::constant::Value;
use rustc_hash::FxHashMap as HashMap;
use takt_abi::FnDesc;
use takt_ir::{BodyId, Local, TypeId};
use takt_syntax::Span;
use takt_syntax::tree::{self, Modifiers, VarKind};

/// The key under which a name is found.
pub(crate) fn key(name: &str) -> String {
    if name.is_ascii() { name.to_ascii_uppercase() } else { name.to_uppercase() }
}

/// Whether two names are the same: have the same [`key`].
pub(crate) fn same(a: &str, b: &str) -> bool {
    if a.is_ascii() && b.is_ascii() { a.eq_ignore_ascii_case(b) } else { key(a) == key(b) }
}

/// Where a variable lives.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Storage {
    /// At a fixed offset of the image.
    Image(u32),
    /// A bit of a byte at a fixed offset of the image.
    Bit(u32, u8),
    /// In the instance that the body runs on.
    This(u32),
    /// In the body's frame.
    Frame(u32),
    /// In a local.
    Register(Local),
    /// Behind an address that a local holds (VAR_IN_OUT, large parameters and results).
    Behind(Local),
    /// `ARRAY[*]`: pointer and bounds in locals.
    Open(Local, Vec<(Local, Local)>),
    /// Not laid out yet, or nothing but its constant value.
    Nowhere,
}

/// A declared variable.
#[derive(Debug, Clone)]
pub(crate) struct Variable<'a> {
    pub(crate) name: String,
    pub(crate) kind: VarKind,
    pub(crate) ty: TypeId,
    pub(crate) constant: bool,
    pub(crate) init: Option<&'a tree::Init>,
    pub(crate) storage: Storage,
    /// Value of a scalar or string constant.
    pub(crate) value: Option<Value>,
    pub(crate) decl: &'a tree::VarDecl,
    pub(crate) span: Span,
}

/// What a body belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PouKind {
    Function,
    FunctionBlock,
    Program,
    /// METHOD, or GET or SET of a PROPERTY.
    Method,
    Action,
}

/// What the source says of something with a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Head<'a> {
    pub(crate) kind: PouKind,
    pub(crate) name: &'a tree::Name,
    pub(crate) modifiers: Modifiers,
    pub(crate) result: Option<&'a tree::TypeExpr>,
    pub(crate) vars: &'a [tree::VarBlock],
    pub(crate) body: &'a [tree::Stmt],
    pub(crate) pragmas: &'a [tree::Pragma],
    pub(crate) doc: Option<&'a str>,
}

/// What a method belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Owner {
    Pou(usize),
    Interface(usize),
}

/// A member of a block, program or interface that has bodies: their units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Member {
    Method(usize),
    Action(usize),
    Property { get: Option<usize>, set: Option<usize> },
}

/// A unit with a body.
#[derive(Debug)]
pub(crate) struct Pou<'a> {
    pub(crate) tree: Head<'a>,
    pub(crate) state: Progress,
    /// The namespaces around it, if there are any.
    pub(crate) home: Option<&'a tree::Home>,
    /// Type of instances (FUNCTION_BLOCK, PROGRAM).
    pub(crate) ty: Option<TypeId>,
    /// Result type of a FUNCTION or METHOD.
    pub(crate) result: Option<TypeId>,
    /// All variables with types; storage as far as it does not depend on the body.
    pub(crate) vars: Vec<Variable<'a>>,
    /// Where in `vars` a name is.
    pub(crate) index: HashMap<String, usize>,
    /// Where the names of the constants stand whose declarations were begun.
    pub(crate) begun: rustc_hash::FxHashSet<u32>,
    /// Offset of the singleton of a PROGRAM.
    pub(crate) instance: u32,
    /// Its body, once asked for.
    pub(crate) body: Option<BodyId>,
    /// The body that sets what its instances hold at the start and what is not bytes, once asked for.
    pub(crate) start: Option<BodyId>,
    pub(crate) library: bool,
    /// Where a METHOD or ACTION belongs to.
    pub(crate) owner: Option<Owner>,
    /// Methods, properties and actions of its own.
    pub(crate) members: HashMap<String, Member>,
    /// EXTENDS.
    pub(crate) base: Option<usize>,
    /// EXTENDS names what there is not: what it inherits is not known, and nothing is said of names that it may have from there.
    pub(crate) is_orphan: bool,
    /// What extends it directly.
    pub(crate) children: Vec<usize>,
    /// IMPLEMENTS, without what its base implements.
    pub(crate) implements: Vec<usize>,
    /// Number of the class (see [`takt_ir::Class`]), 0 if its instances need not be found.
    pub(crate) class: u32,
    /// Members of enumerations that are declared in place.
    pub(crate) enumerators: HashMap<String, (TypeId, i64)>,
    /// Offsets of VAR_INST in the instance of the owner.
    pub(crate) kept: HashMap<String, (TypeId, u32)>,
}

/// An INTERFACE.
#[derive(Debug)]
pub(crate) struct Interface<'a> {
    pub(crate) tree: &'a tree::Interface,
    pub(crate) ty: TypeId,
    pub(crate) extends: Vec<usize>,
    /// Itself and what it extends, directly or through others, each once.
    pub(crate) all: Vec<usize>,
    pub(crate) members: HashMap<String, Member>,
}

/// How far something is resolved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Progress {
    Untouched,
    Running,
    Done,
}

/// A declared type, resolved on demand.
#[derive(Debug)]
pub(crate) struct Declared<'a> {
    pub(crate) tree: &'a tree::TypeDecl,
    pub(crate) home: Option<&'a tree::Home>,
    pub(crate) state: Progress,
    pub(crate) ty: Option<TypeId>,
}

/// A global variable.
#[derive(Debug)]
pub(crate) struct GlobalVar<'a> {
    /// Complete when `state` is Done.
    pub(crate) var: Option<Variable<'a>>,
    pub(crate) list: Option<usize>,
    pub(crate) decl: &'a tree::VarDecl,
    pub(crate) kind: VarKind,
    pub(crate) home: Option<&'a tree::Home>,
    pub(crate) constant: bool,
    pub(crate) retain: Option<takt_ir::RetainKind>,
    /// `{attribute 'task_snapshot'}`.
    pub(crate) latched: bool,
    pub(crate) state: Progress,
}

/// A global variable list.
#[derive(Debug)]
pub(crate) struct List {
    pub(crate) name: String,
    pub(crate) qualified_only: bool,
    pub(crate) vars: HashMap<String, usize>,
    pub(crate) slot: i64,
}

/// What a global name means.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Item {
    Pou(usize),
    Interface(usize),
    Type(usize),
    /// A type that is complete (native ones).
    Ready(TypeId),
    NativeBlock(TypeId),
    NativeFunction(&'static FnDesc),
    Global(usize),
    /// In several lists: needs a qualifier.
    Ambiguous,
    List(usize),
    Enumerator(TypeId, i64),
    /// Member of a declared enumeration that may not be resolved yet.
    Member(usize, usize),
    Library,
    /// The sources themselves, by the name of a library among them.
    Sources,
    Namespace(usize),
}
