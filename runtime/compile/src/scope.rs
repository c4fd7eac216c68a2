//! What names mean: the entries of the scopes.

use crate::constant::Value;
use takt_abi::FnDesc;
use takt_ir::{BodyId, Local, TypeId};
use takt_syntax::Span;
use takt_syntax::tree::{self, VarKind};

/// The key under which a name is found.
pub(crate) fn key(name: &str) -> String {
    name.to_uppercase()
}

/// Where a variable lives.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Storage {
    /// At a fixed offset of the image.
    Image(u32),
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

/// A unit with a body.
#[derive(Debug)]
pub(crate) struct Pou<'a> {
    pub(crate) tree: &'a tree::Pou,
    pub(crate) state: Progress,
    /// Type of instances (FUNCTION_BLOCK, PROGRAM).
    pub(crate) ty: Option<TypeId>,
    /// Result type of a FUNCTION.
    pub(crate) result: Option<TypeId>,
    /// All variables with types; storage as far as it does not depend on the body.
    pub(crate) vars: Vec<Variable<'a>>,
    /// Where in `vars` a name is.
    pub(crate) index: std::collections::HashMap<String, usize>,
    /// Initial values that are not bytes: offset in the instance, type, expression.
    pub(crate) late: Vec<(u32, TypeId, &'a tree::Expr)>,
    /// Offset of the singleton of a PROGRAM.
    pub(crate) instance: u32,
    /// Its body, once asked for.
    pub(crate) body: Option<BodyId>,
    /// Bodies of its actions, once asked for.
    pub(crate) actions: Vec<(String, Option<BodyId>)>,
    pub(crate) library: bool,
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
    pub(crate) constant: bool,
    pub(crate) state: Progress,
}

/// A global variable list.
#[derive(Debug)]
pub(crate) struct List {
    pub(crate) name: String,
    pub(crate) qualified_only: bool,
    pub(crate) vars: std::collections::HashMap<String, usize>,
    pub(crate) slot: i64,
}

/// What a global name means.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Item {
    Pou(usize),
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
}
