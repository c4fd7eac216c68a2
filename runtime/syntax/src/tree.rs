//! The tree: what a source file says, before any name is known.
//!
//! Names keep the spelling of the source; comparing them is case-insensitive and left to the reader. Nodes that could not be read are `Error` nodes,
//! of which nobody need complain again.

use crate::{Code, Diagnostic, Span};

/// A name as written.
#[derive(Debug, Clone, PartialEq)]
pub struct Name {
    /// Spelling.
    pub text: String,
    /// Place.
    pub span: Span,
}

/// `{attribute 'name' := 'value'}` or another pragma.
#[derive(Debug, Clone, PartialEq)]
pub struct Pragma {
    /// Lower-case first word or attribute name (`qualified_only`, `gvl_name`, `warning`, …).
    pub name: String,
    /// Value of an attribute, or the rest of the pragma's text.
    pub value: Option<String>,
    /// Place.
    pub span: Span,
}

/// A source file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct File {
    /// Program units in order.
    pub units: Vec<Unit>,
    /// Every direct address in it, in order.
    pub addresses: Vec<Direct>,
    /// `{warning disable W0301} … {warning restore W0301}`.
    pub suppressed: Vec<Suppressed>,
}

impl File {
    /// Whether the file says that this message about it is not wanted.
    pub fn suppresses(&self, diagnostic: &Diagnostic) -> bool {
        let place = diagnostic.span.start;
        self.suppressed.iter().any(|part| part.code == diagnostic.code && part.start <= place && place < part.end)
    }
}

/// A part of a file where a warning is not wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct Suppressed {
    /// Which.
    pub code: Code,
    /// First byte.
    pub start: u32,
    /// Behind the last byte.
    pub end: u32,
}

/// What may stand at the top of a file.
#[derive(Debug, Clone, PartialEq)]
pub enum Unit {
    /// FUNCTION, FUNCTION_BLOCK, PROGRAM.
    Pou(Pou),
    /// TYPE … END_TYPE: one per name.
    Type(TypeDecl),
    /// VAR_GLOBAL … END_VAR outside of a configuration.
    Globals(Globals),
    /// CONFIGURATION … END_CONFIGURATION.
    Configuration(Configuration),
    /// INTERFACE … END_INTERFACE.
    Interface(Interface),
}

/// Where a unit stands: what `NAMESPACE` and `USING` around it say.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Home {
    /// The namespaces around it, the outermost first; `NAMESPACE a.b` is two.
    pub namespace: Vec<Name>,
    /// The namespaces whose names it uses without prefix, each as a dotted name: those of the file, of the namespaces around it, its own.
    pub using: Vec<Name>,
    /// A namespace around it is INTERNAL: other namespaces must not use it.
    pub is_internal: bool,
}

/// A global variable list (a VAR_GLOBAL block of a file).
#[derive(Debug, Clone, PartialEq)]
pub struct Globals {
    /// Pragmas before it.
    pub pragmas: Vec<Pragma>,
    /// Variables.
    pub vars: VarBlock,
    /// Where it stands.
    pub home: Home,
}

/// Kind of program unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PouKind {
    /// FUNCTION.
    Function,
    /// FUNCTION_BLOCK (CLASS too: a block without body).
    FunctionBlock,
    /// PROGRAM.
    Program,
}

/// Modifiers of a unit, method or property.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Modifiers {
    /// ABSTRACT.
    pub is_abstract: bool,
    /// FINAL.
    pub is_final: bool,
    /// OVERRIDE.
    pub is_override: bool,
    /// PUBLIC (the default), PRIVATE, PROTECTED, INTERNAL.
    pub access: Access,
}

/// Who may use a member.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(missing_docs, reason = "the names are those of the standard")]
pub enum Access {
    #[default]
    Public,
    Private,
    Protected,
    Internal,
}

/// FUNCTION, FUNCTION_BLOCK or PROGRAM.
#[derive(Debug, Clone, PartialEq)]
pub struct Pou {
    /// Which.
    pub kind: PouKind,
    /// Its name.
    pub name: Name,
    /// ABSTRACT, FINAL, access.
    pub modifiers: Modifiers,
    /// EXTENDS.
    pub extends: Option<Name>,
    /// IMPLEMENTS.
    pub implements: Vec<Name>,
    /// Result type of a function.
    pub result: Option<TypeExpr>,
    /// Declarations.
    pub vars: Vec<VarBlock>,
    /// Statements.
    pub body: Vec<Stmt>,
    /// METHODs.
    pub methods: Vec<Method>,
    /// PROPERTYs.
    pub properties: Vec<Property>,
    /// ACTIONs.
    pub actions: Vec<Action>,
    /// Pragmas before the unit.
    pub pragmas: Vec<Pragma>,
    /// Comment before the unit, without its signs.
    pub doc: Option<String>,
    /// Where it stands.
    pub home: Home,
    /// From the keyword to the END_.
    pub span: Span,
    /// The END_ keyword (where a fault after the last statement is placed).
    pub end: Span,
}

/// METHOD.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// Its name.
    pub name: Name,
    /// Modifiers.
    pub modifiers: Modifiers,
    /// Result type.
    pub result: Option<TypeExpr>,
    /// Declarations.
    pub vars: Vec<VarBlock>,
    /// Statements.
    pub body: Vec<Stmt>,
    /// Pragmas.
    pub pragmas: Vec<Pragma>,
    /// Comment before it.
    pub doc: Option<String>,
    /// Whole.
    pub span: Span,
}

/// PROPERTY with its accessors.
#[derive(Debug, Clone, PartialEq)]
pub struct Property {
    /// Its name.
    pub name: Name,
    /// Modifiers.
    pub modifiers: Modifiers,
    /// Type.
    pub ty: TypeExpr,
    /// GET: declarations and statements.
    pub get: Option<(Vec<VarBlock>, Vec<Stmt>)>,
    /// SET: declarations and statements. The first block is an input with the name and type of the property: the new value.
    pub set: Option<(Vec<VarBlock>, Vec<Stmt>)>,
    /// Who may read: the access of GET, that of the property where it has none.
    pub get_access: Access,
    /// Who may write: the access of SET, that of the property where it has none.
    pub set_access: Access,
    /// Pragmas.
    pub pragmas: Vec<Pragma>,
    /// Comment before it.
    pub doc: Option<String>,
    /// Whole.
    pub span: Span,
}

/// ACTION.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    /// Its name.
    pub name: Name,
    /// Statements.
    pub body: Vec<Stmt>,
    /// Pragmas.
    pub pragmas: Vec<Pragma>,
    /// Comment before it.
    pub doc: Option<String>,
    /// Whole.
    pub span: Span,
}

/// INTERFACE.
#[derive(Debug, Clone, PartialEq)]
pub struct Interface {
    /// Its name.
    pub name: Name,
    /// EXTENDS.
    pub extends: Vec<Name>,
    /// Methods without bodies.
    pub methods: Vec<Method>,
    /// Properties without bodies.
    pub properties: Vec<Property>,
    /// Pragmas.
    pub pragmas: Vec<Pragma>,
    /// Comment before it.
    pub doc: Option<String>,
    /// Where it stands.
    pub home: Home,
    /// Whole.
    pub span: Span,
}

/// Which VAR section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of the standard")]
pub enum VarKind {
    Var,
    Input,
    Output,
    InOut,
    Temp,
    Stat,
    Inst,
    Global,
    External,
    Config,
    /// VAR_GENERIC CONSTANT.
    Generic,
}

/// VAR… END_VAR.
#[derive(Debug, Clone, PartialEq)]
pub struct VarBlock {
    /// Section.
    pub kind: VarKind,
    /// CONSTANT.
    pub constant: bool,
    /// RETAIN.
    pub retain: bool,
    /// PERSISTENT.
    pub persistent: bool,
    /// Declarations; `a, b : INT` is two.
    pub vars: Vec<VarDecl>,
    /// Whole.
    pub span: Span,
}

/// One declared variable.
#[derive(Debug, Clone, PartialEq)]
pub struct VarDecl {
    /// Its name.
    pub name: Name,
    /// AT %IX0.0.
    pub at: Option<Direct>,
    /// Type.
    pub ty: TypeExpr,
    /// `:=`.
    pub init: Option<Init>,
    /// Arguments of FB_Init: `fb : FB(a := 1)`.
    pub fb_init: Vec<Arg>,
    /// Arguments of FB_Init for each element: `fbs : ARRAY [0..1] OF FB[(a := 1), (a := 2)]`.
    pub fb_inits: Vec<Vec<Arg>>,
    /// Pragmas before it.
    pub pragmas: Vec<Pragma>,
    /// Comment before it or at the end of its line.
    pub doc: Option<String>,
}

/// A direct address: `%IX1.0`, `%QB4`, `%I*`.
#[derive(Debug, Clone, PartialEq)]
pub struct Direct {
    /// As written, upper case.
    pub text: String,
    /// Place.
    pub span: Span,
}

/// One type of a TYPE block.
#[derive(Debug, Clone, PartialEq)]
pub struct TypeDecl {
    /// Its name.
    pub name: Name,
    /// What it is.
    pub kind: TypeKind,
    /// Pragmas before it.
    pub pragmas: Vec<Pragma>,
    /// Comment before it.
    pub doc: Option<String>,
    /// Where it stands.
    pub home: Home,
    /// Whole.
    pub span: Span,
}

/// What a declared type is.
#[derive(Debug, Clone, PartialEq)]
pub enum TypeKind {
    /// STRUCT.
    Struct {
        /// EXTENDS.
        extends: Option<Name>,
        /// Fields.
        fields: Vec<VarDecl>,
    },
    /// UNION.
    Union {
        /// Fields.
        fields: Vec<VarDecl>,
    },
    /// `(a, b := 5) INT := a`.
    Enum(EnumBody),
    /// `TYPE A : INT := 5; END_TYPE`.
    Alias {
        /// The type.
        ty: TypeExpr,
        /// Initial value of all its variables.
        init: Option<Init>,
    },
}

/// Members of an enumeration.
#[derive(Debug, Clone, PartialEq)]
pub struct EnumBody {
    /// Names and values.
    pub members: Vec<(Name, Option<Expr>)>,
    /// Base type.
    pub base: Option<Name>,
    /// Initial value.
    pub init: Option<Expr>,
}

/// A type as written.
#[derive(Debug, Clone, PartialEq)]
pub struct TypeExpr {
    /// What.
    pub kind: TypeExprKind,
    /// Place.
    pub span: Span,
}

/// A type as written.
#[derive(Debug, Clone, PartialEq)]
pub enum TypeExprKind {
    /// `INT`, `Lib.TON`: the parts in order.
    Named(Vec<Name>),
    /// STRING, `STRING(n)`, `STRING[n]`.
    String(Option<Box<Expr>>),
    /// WSTRING.
    WString(Option<Box<Expr>>),
    /// ARRAY [a..b, c..d] OF t.
    Array {
        /// Bounds per dimension; `None` is `*`.
        dims: Vec<Option<(Expr, Expr)>>,
        /// Element type.
        elem: Box<TypeExpr>,
    },
    /// POINTER TO.
    Pointer(Box<TypeExpr>),
    /// REFERENCE TO.
    Reference(Box<TypeExpr>),
    /// REF_TO.
    RefTo(Box<TypeExpr>),
    /// `INT(0..100)`.
    Subrange {
        /// Base type.
        base: Name,
        /// Lower bound.
        low: Box<Expr>,
        /// Upper bound.
        high: Box<Expr>,
    },
    /// An enumeration declared in place.
    Enum(Box<EnumBody>),
    /// A structure declared in place.
    Struct(Vec<VarDecl>),
    /// `FB<6>`: a block with values for its VAR_GENERIC constants.
    Generic {
        /// The block: the parts of its name in order.
        path: Vec<Name>,
        /// Values.
        values: Vec<Expr>,
    },
    /// Could not be read.
    Error,
}

/// An initial value.
#[derive(Debug, Clone, PartialEq)]
pub enum Init {
    /// An expression.
    Expr(Expr),
    /// `[1, 2, 3(0)]`.
    Array(Vec<InitItem>, Span),
    /// `(x := 1, y := 2)`.
    Struct(Vec<(Name, Init)>, Span),
}

impl Init {
    /// Its place.
    pub fn span(&self) -> Span {
        match self {
            Self::Expr(expr) => expr.span,
            Self::Array(_, span) | Self::Struct(_, span) => *span,
        }
    }
}

/// One item of an array's initial value.
#[derive(Debug, Clone, PartialEq)]
pub enum InitItem {
    /// One element.
    One(Init),
    /// `n(a, b)`; `n()` repeats the type's initial value.
    Repeat(Expr, Vec<Init>),
}

/// CONFIGURATION.
#[derive(Debug, Clone, PartialEq)]
pub struct Configuration {
    /// Its name.
    pub name: Name,
    /// VAR_GLOBAL blocks in it and in its resources.
    pub globals: Vec<VarBlock>,
    /// Tasks of all resources.
    pub tasks: Vec<TaskDecl>,
    /// Program instances of all resources.
    pub programs: Vec<ProgramDecl>,
    /// Names of the resources (empty: tasks stand in the configuration itself).
    pub resources: Vec<Name>,
    /// VAR_ACCESS: names for communication services, which nobody reads.
    pub access: Vec<AccessDecl>,
    /// Where it stands.
    pub home: Home,
    /// Whole.
    pub span: Span,
}

/// TASK name(INTERVAL := …, PRIORITY := …).
#[derive(Debug, Clone, PartialEq)]
pub struct TaskDecl {
    /// Its name.
    pub name: Name,
    /// Named arguments.
    pub args: Vec<(Name, Expr)>,
    /// Pragmas before it.
    pub pragmas: Vec<Pragma>,
    /// Whole.
    pub span: Span,
}

/// `name : path : INT READ_WRITE;` in VAR_ACCESS.
#[derive(Debug, Clone, PartialEq)]
pub struct AccessDecl {
    /// Its name.
    pub name: Name,
    /// What it names: a path of variables or a direct address.
    pub path: Expr,
    /// Its type.
    pub ty: TypeExpr,
    /// READ_WRITE.
    pub is_writable: bool,
}

/// PROGRAM inst WITH task : Type;
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramDecl {
    /// Instance name.
    pub name: Name,
    /// RETAIN.
    pub retain: bool,
    /// Task.
    pub task: Option<Name>,
    /// Program type.
    pub ty: Name,
    /// Blocks of it that run in a task of their own: `fb WITH task`.
    pub blocks: Vec<(Name, Name)>,
    /// Connections: `x := GVL.a, y => GVL.b`.
    pub connections: Vec<Arg>,
    /// Whole.
    pub span: Span,
}

/// A statement.
#[derive(Debug, Clone, PartialEq)]
pub struct Stmt {
    /// What.
    pub kind: StmtKind,
    /// Place.
    pub span: Span,
}

/// How an assignment is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AssignOp {
    /// `:=`
    Assign,
    /// `S=`
    Set,
    /// `R=`
    Reset,
    /// `REF=`
    Ref,
    /// `?=`
    Try,
}

/// A statement.
#[derive(Debug, Clone, PartialEq)]
pub enum StmtKind {
    /// `a := b := c;` is targets [a, b], value c.
    Assign {
        /// Places, in written order.
        targets: Vec<(Expr, AssignOp)>,
        /// Value.
        value: Expr,
    },
    /// An expression as a statement: a call.
    Expr(Expr),
    /// IF, ELSIF…, ELSE.
    If {
        /// Conditions and bodies.
        arms: Vec<(Expr, Vec<Stmt>)>,
        /// ELSE.
        otherwise: Option<Vec<Stmt>>,
    },
    /// CASE.
    Case {
        /// Selector.
        value: Expr,
        /// Labels and bodies.
        arms: Vec<(Vec<CaseLabel>, Vec<Stmt>)>,
        /// ELSE.
        otherwise: Option<Vec<Stmt>>,
    },
    /// FOR.
    For {
        /// Control variable.
        var: Box<Expr>,
        /// Start.
        from: Box<Expr>,
        /// End.
        to: Box<Expr>,
        /// BY.
        by: Option<Expr>,
        /// Body.
        body: Vec<Stmt>,
    },
    /// WHILE.
    While {
        /// Condition.
        cond: Expr,
        /// Body.
        body: Vec<Stmt>,
    },
    /// REPEAT … UNTIL.
    Repeat {
        /// Body.
        body: Vec<Stmt>,
        /// Condition.
        until: Expr,
    },
    /// EXIT.
    Exit,
    /// CONTINUE.
    Continue,
    /// RETURN.
    Return,
    /// JMP label.
    Jump(Name),
    /// `label:`
    Label(Name),
    /// `;`
    Empty,
    /// `__TRY … __CATCH(e) … __FINALLY … __ENDTRY`.
    Try {
        /// Body.
        body: Vec<Stmt>,
        /// Variable and body.
        catch: Option<(Option<Name>, Vec<Stmt>)>,
        /// FINALLY.
        finally: Option<Vec<Stmt>>,
    },
    /// Could not be read.
    Error,
}

/// A label of CASE.
#[derive(Debug, Clone, PartialEq)]
pub enum CaseLabel {
    /// One value.
    Value(Expr),
    /// `a..b`.
    Range(Expr, Expr),
}

/// An expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr {
    /// What.
    pub kind: ExprKind,
    /// Place.
    pub span: Span,
}

/// An argument of a call.
#[derive(Debug, Clone, PartialEq)]
pub struct Arg {
    /// `IN :=` or `Q =>`.
    pub name: Option<Name>,
    /// How.
    pub kind: ArgKind,
    /// Value or place; `None` in `Q => ` (left open).
    pub value: Option<Expr>,
    /// Place.
    pub span: Span,
}

/// How an argument is passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArgKind {
    /// By position or `:=`.
    In,
    /// `=>`.
    Out,
    /// `NOT Q =>`.
    NotOut,
    /// `REF=`.
    Ref,
}

/// An expression.
#[derive(Debug, Clone, PartialEq)]
pub enum ExprKind {
    /// A literal.
    Literal(Literal),
    /// A name.
    Name(String),
    /// `.name` at the start: global scope.
    Global(Name),
    /// `a.b`.
    Member(Box<Expr>, Name),
    /// `a.3`, `a.%X3`, `a.%B1`.
    Part(Box<Expr>, Part),
    /// `a[i, j]`.
    Index(Box<Expr>, Vec<Expr>),
    /// `a^`.
    Deref(Box<Expr>),
    /// `f(…)`.
    Call(Box<Expr>, Vec<Arg>),
    /// `-a`, `NOT a`.
    Unary(UnaryOp, Box<Expr>),
    /// `a + b`.
    Binary(BinaryOp, Box<Expr>, Box<Expr>),
    /// A long row `a + b - c …` of operators that are applied from the left: what would make too high a tree of `Binary` nodes.
    Chain(Box<Expr>, Vec<Link>),
    /// `THIS`.
    This,
    /// `SUPER`.
    Super,
    /// `%IX0.0`.
    Direct(Direct),
    /// `E_COLOR#red`: a qualified enumerator written with `#`.
    Typed(Name, Name),
    /// An assignment used as a value: `IF (a := f()) > 0`.
    Assign(Box<Expr>, Box<Expr>),
    /// Could not be read.
    Error,
}

/// An operator of a [`ExprKind::Chain`] with what stands right of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Which.
    pub op: BinaryOp,
    /// Right operand; the left one is all that stands before it.
    pub right: Expr,
    /// From the first operand of the chain to this one.
    pub span: Span,
}

/// Part of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Bit (`.3`, `.%X3`).
    Bit(u32),
    /// Byte (`.%B1`).
    Byte(u32),
    /// Word (`.%W1`).
    Word(u32),
    /// Double word (`.%D1`).
    Dword(u32),
}

/// `-`, `NOT`, `+`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum UnaryOp {
    Neg,
    Not,
    Plus,
}

/// Operators of two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of the standard")]
pub enum BinaryOp {
    Add,
    Sub,
    Mul,
    Div,
    Mod,
    Power,
    Eq,
    Ne,
    Lt,
    Le,
    Gt,
    Ge,
    And,
    Or,
    Xor,
    AndThen,
    OrElse,
}

/// A literal.
#[derive(Debug, Clone, PartialEq)]
pub struct Literal {
    /// `INT#`: the type named before, upper case (`BYTE`, `LREAL`, `STRING`…). Not for times and dates, whose kind says it.
    pub ty: Option<Name>,
    /// Value.
    pub value: LiteralValue,
}

/// Value of a literal.
#[derive(Debug, Clone, PartialEq)]
pub enum LiteralValue {
    /// `5`, `16#FF`, `1_000`. Magnitude up to 2^64 - 1 (a minus sign is an operator; `INT#-5` is negative here).
    Int(i128),
    /// `1.5e3`.
    Real(f64),
    /// TRUE, FALSE.
    Bool(bool),
    /// 'text': escapes resolved.
    String(Vec<u8>),
    /// "text": escapes resolved, UTF-16.
    WString(Vec<u16>),
    /// T#, TIME#: nanoseconds (ms resolution is checked later).
    Time(i128),
    /// LTIME#: nanoseconds.
    Ltime(i128),
    /// D#: days since 1970.
    Date(i64),
    /// LDATE#: days since 1970.
    Ldate(i64),
    /// TOD#: nanoseconds since midnight.
    Tod(i64),
    /// LTOD#: nanoseconds since midnight.
    Ltod(i64),
    /// DT#: nanoseconds since 1970.
    Dt(i128),
    /// LDT#: nanoseconds since 1970.
    Ldt(i128),
}
