//! Checking and lowering expressions: names, literals, members, operands.

use crate::constant::Value;
use crate::emit::Builder;
use crate::object::Bound;
use crate::place::Place;
use crate::scope::{Item, Owner, PouKind, Storage};
use crate::unit::Compiler;
use takt_abi::{Elem, FnDesc};
use takt_ir::{BlockId, Body, BodyId, Const, Local, SiteId, Type, TypeId};
use takt_syntax::tree::{Expr, ExprKind, VarKind};
use takt_syntax::{Code, Diagnostic, Span};

/// What an expression came to.
#[derive(Debug, Clone)]
pub(crate) enum Kind {
    /// Reported; whoever meets it is silent.
    Error,
    /// A call without result.
    Void,
    /// Known.
    Const(Value),
    /// A scalar in a local.
    Temp(Local),
    /// In memory or in a variable's register.
    Place(Place),
    /// A property that is about to be written.
    Property(Box<Bound>),
}

/// An expression's value or place with its type.
#[derive(Debug, Clone)]
pub(crate) struct Operand {
    pub(crate) ty: TypeId,
    pub(crate) kind: Kind,
    pub(crate) span: Span,
    /// A literal (or an expression of literals) that takes the type it is needed in.
    pub(crate) flex: bool,
    /// A local's value lies within the range of `ty` (it was loaded, compared or cut).
    pub(crate) exact: bool,
    /// Why it must not be written.
    pub(crate) fixed: Option<&'static str>,
    /// The instance may be of a type that extends `ty`: it was reached through a pointer, reference, VAR_IN_OUT or THIS.
    pub(crate) dynamic: bool,
}

impl Operand {
    pub(crate) fn is_error(&self) -> bool {
        matches!(self.kind, Kind::Error)
    }
    /// Whether this is a finite constant that only LREAL holds.
    pub(crate) fn exceeds_real(&self) -> bool {
        matches!(self.kind, Kind::Const(Value::Real(v)) if v.is_finite() && (v as f32).is_infinite())
    }
    /// Whether this is the literal 0 or 1.
    pub(crate) fn is_bit(&self) -> bool {
        self.flex && matches!(self.kind, Kind::Const(Value::Int(0 | 1)))
    }
}

/// Why an output is not written from outside.
pub(crate) const BLOCK_OUTPUT: &str = "an output of a block";
/// Why a local variable of a block is not written from outside.
pub(crate) const BLOCK_VARIABLE: &str = "a VAR of a block, from outside,";

/// What a name or path means.
pub(crate) enum Thing {
    Value(Operand),
    List(usize),
    Type(TypeId),
    /// A library or namespace.
    Space(Item),
    Function(usize),
    Native(&'static FnDesc),
    /// A method, property or action and the instance it runs on.
    Member(Box<Bound>),
    Error,
}

/// A unit whose names are seen, the innermost first.
#[derive(Debug)]
pub(crate) struct Level {
    pub(crate) pou: usize,
    /// Where its variables are if the body has places of its own for them, parallel to its table.
    pub(crate) storage: Option<Vec<Storage>>,
}

/// A loop that EXIT and CONTINUE refer to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loop {
    pub(crate) exit: BlockId,
    pub(crate) next: BlockId,
}

/// One body being checked and lowered.
pub(crate) struct Lowering<'c, 'a> {
    pub(crate) c: &'c mut Compiler<'a>,
    pub(crate) b: Builder,
    pub(crate) id: BodyId,
    pub(crate) pou: Option<usize>,
    /// The unit, the block that it belongs to, and what that extends.
    pub(crate) levels: Vec<Level>,
    /// Address of the instance.
    pub(crate) this: Option<Local>,
    /// Result variable of a function.
    pub(crate) result: Option<(TypeId, Storage)>,
    pub(crate) loops: Vec<Loop>,
    /// __TRY statements under way: loops around them, and what __FINALLY says.
    pub(crate) protected: Vec<(usize, &'a [takt_syntax::tree::Stmt])>,
    pub(crate) labels: rustc_hash::FxHashMap<String, (BlockId, bool, Span)>,
    pub(crate) scratch: bool,
    /// What is being lowered is about to be written.
    pub(crate) writes: bool,
}

impl<'c, 'a> Lowering<'c, 'a> {
    pub(crate) fn new(c: &'c mut Compiler<'a>, id: BodyId, name: &str, pou: Option<usize>, at: Span) -> Self {
        let site = c.sites.at(c.files, at, id);
        let b = Builder::new(name, site);
        let mut new = Self {
            c,
            b,
            id,
            pou: None,
            levels: Vec::new(),
            this: None,
            result: None,
            loops: Vec::new(),
            protected: Vec::new(),
            labels: Default::default(),
            scratch: false,
            writes: false,
        };
        new.enter(pou);
        new
    }

    /// A lowering whose code is thrown away: for constants.
    pub(crate) fn scratch(c: &'c mut Compiler<'a>, pou: Option<usize>) -> Self {
        let b = Builder::new("", SiteId(0));
        let mut new = Self {
            c,
            b,
            id: BodyId(0),
            pou: None,
            levels: Vec::new(),
            this: None,
            result: None,
            loops: Vec::new(),
            protected: Vec::new(),
            labels: Default::default(),
            scratch: true,
            writes: false,
        };
        new.enter(pou);
        new
    }

    /// Looks names up in this unit from now on; a program's variables are at its instance.
    pub(crate) fn enter(&mut self, pou: Option<usize>) {
        self.pou = pou;
        self.levels.clear();
        let Some(pou) = pou else { return };
        let own = match self.c.pous[pou].owner {
            Some(Owner::Pou(owner)) => {
                self.levels.push(Level { pou, storage: None });
                owner
            }
            _ => pou,
        };
        self.levels.extend(self.c.bases(own).map(|pou| Level { pou, storage: None }));
    }

    /// The block or program whose instance the body runs on.
    pub(crate) fn block(&self) -> Option<usize> {
        let pou = self.pou?;
        match (self.c.pous[pou].owner, self.c.pous[pou].tree.kind) {
            (Some(Owner::Pou(owner)), _) => Some(owner),
            (_, PouKind::FunctionBlock | PouKind::Program) => Some(pou),
            _ => None,
        }
    }

    /// Places of the innermost unit's variables, to be changed.
    pub(crate) fn own_storage(&mut self) -> &mut Vec<Storage> {
        self.level_storage(0)
    }

    /// Places of the variables of a level, to be changed.
    pub(crate) fn level_storage(&mut self, level: usize) -> &mut Vec<Storage> {
        let vars = &self.c.pous[self.levels[level].pou].vars;
        self.levels[level].storage.get_or_insert_with(|| vars.iter().map(|v| v.storage.clone()).collect())
    }

    /// Where a variable is.
    pub(crate) fn storage_of(&self, level: usize, i: usize) -> Storage {
        let Level { pou, storage } = &self.levels[level];
        let pou = &self.c.pous[*pou];
        let found = storage.as_ref().map_or_else(|| &pou.vars[i].storage, |s| s.get(i).unwrap_or(&Storage::Nowhere));
        match found {
            Storage::This(offset) if pou.tree.kind == PouKind::Program || self.in_program() => {
                Storage::Image(self.block().map_or(pou.instance, |c| self.c.pous[c].instance) + offset)
            }
            other => other.clone(),
        }
    }

    fn in_program(&self) -> bool {
        self.block().is_some_and(|c| self.c.pous[c].tree.kind == PouKind::Program)
    }

    /// The level and number of a variable that is seen here.
    pub(crate) fn local(&self, wanted: &str) -> Option<(usize, usize)> {
        self.levels.iter().enumerate().find_map(|(level, l)| {
            let pou = &self.c.pous[l.pou];
            let i = *pou.index.get(wanted)?;
            // What lives for one call is seen by that call only.
            let elsewhere = level > 0 && l.storage.is_none() && pou.vars[i].kind == VarKind::Temp;
            (!elsewhere).then_some((level, i))
        })
    }

    pub(crate) fn finish(self) -> Body {
        self.b.finish()
    }

    pub(crate) fn site(&mut self, span: Span) -> SiteId {
        if self.scratch { SiteId(0) } else { self.c.sites.at(self.c.files, span, self.id) }
    }

    pub(crate) fn report(&mut self, code: Code, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.c.report(code, span, message)
    }

    pub(crate) fn error(&mut self, span: Span) -> Operand {
        let ty = self.c.error_type();
        Operand { ty, kind: Kind::Error, span, flex: false, exact: true, fixed: None, dynamic: false }
    }
    pub(crate) fn constant(&self, value: Value, ty: TypeId, span: Span) -> Operand {
        Operand { ty, kind: Kind::Const(value), span, flex: false, exact: true, fixed: Some("a constant"), dynamic: false }
    }
    pub(crate) fn temp(&self, local: Local, ty: TypeId, span: Span) -> Operand {
        Operand { ty, kind: Kind::Temp(local), span, flex: false, exact: false, fixed: Some("an expression"), dynamic: false }
    }
    pub(crate) fn exact(&self, local: Local, ty: TypeId, span: Span) -> Operand {
        Operand { exact: true, ..self.temp(local, ty, span) }
    }
    pub(crate) fn at(&self, place: Place, ty: TypeId, span: Span) -> Operand {
        let kind = if *self.c.types.get(ty) == Type::Error { Kind::Error } else { Kind::Place(place) };
        Operand { ty, kind, span, flex: false, exact: true, fixed: None, dynamic: false }
    }
    pub(crate) fn bool_type(&mut self) -> TypeId {
        self.c.elem(Elem::Bool)
    }
    pub(crate) fn type_name(&self, ty: TypeId) -> String {
        self.c.types.name(ty)
    }

    /// Lowers an expression that has a value.
    pub(crate) fn expr(&mut self, e: &'a Expr) -> Operand {
        if !self.c.deeper(1, e.span) {
            return self.error(e.span);
        }
        let operand = self.expr_inside(e);
        self.c.back(1);
        operand
    }

    fn expr_inside(&mut self, e: &'a Expr) -> Operand {
        match &e.kind {
            ExprKind::Literal(literal) => self.literal(literal, e.span),
            ExprKind::Unary(op, a) => {
                let a = self.expr(a);
                self.unary(*op, a, e.span)
            }
            ExprKind::Binary(op, a, b) => self.binary_expr(*op, a, b, e.span),
            ExprKind::Chain(first, links) => self.chain(first, links),
            ExprKind::Call(callee, args) => {
                let result = self.call(callee, args, e.span);
                self.follow(result)
            }
            ExprKind::Assign(target, value) => {
                let target = self.target(target);
                let value = self.expr(value);
                self.assign(target.clone(), value);
                self.read_back(target)
            }
            ExprKind::Error => self.error(e.span),
            _ => match self.thing(e) {
                Thing::Value(operand) => operand,
                Thing::Error => self.error(e.span),
                Thing::Function(_) | Thing::Native(_) | Thing::Member(_) => {
                    self.report(Code::BadStatement, e.span, "a call needs brackets").help = Some("write `name()`".into());
                    self.error(e.span)
                }
                Thing::Type(ty) => {
                    let name = self.type_name(ty);
                    self.report(Code::TypeMismatch, e.span, format!("expected a value, found the type `{name}`"));
                    self.error(e.span)
                }
                Thing::List(_) | Thing::Space(_) => {
                    self.report(Code::TypeMismatch, e.span, "expected a value, found the name of a list, library or namespace");
                    self.error(e.span)
                }
            },
        }
    }

    /// Lowers what is about to be written: a property stays one.
    pub(crate) fn target(&mut self, e: &'a Expr) -> Operand {
        match &e.kind {
            ExprKind::Name(_) | ExprKind::Member(..) => match self.thing_raw(e) {
                Thing::Member(bound) => self.property_target(*bound, e.span),
                Thing::Value(operand) => self.follow(operand),
                _ => self.expr(e),
            },
            _ => {
                let before = std::mem::replace(&mut self.writes, true);
                let target = self.expr(e);
                self.writes = before;
                target
            }
        }
    }

    /// What a path means: a value, or something that only a member or a call makes one of. References are followed, properties read.
    pub(crate) fn thing(&mut self, e: &'a Expr) -> Thing {
        match self.thing_raw(e) {
            Thing::Value(operand) => Thing::Value(self.follow(operand)),
            Thing::Member(bound) if bound.is_property() => {
                let value = self.get_property(*bound, e.span);
                Thing::Value(self.follow(value))
            }
            other => other,
        }
    }

    /// A REFERENCE becomes what it refers to.
    pub(crate) fn follow(&mut self, operand: Operand) -> Operand {
        let Type::Reference(to) = *self.c.types.get(operand.ty) else { return operand };
        let span = operand.span;
        let pointer = self.value(&operand);
        let place = self.deref(pointer, to, span);
        Operand { dynamic: true, ..self.at(place, to, span) }
    }

    /// As [`Lowering::thing`], but a REFERENCE stays one, and a property is not read.
    pub(crate) fn thing_raw(&mut self, e: &'a Expr) -> Thing {
        match &e.kind {
            ExprKind::Name(name) => self.name(name, e.span),
            ExprKind::Global(name) => self.global_thing(&name.text, name.span),
            ExprKind::Member(base, member) => self.member(base, member, e.span),
            ExprKind::Typed(ty, member) => match self.global_thing(&ty.text, ty.span) {
                Thing::Type(ty) => self.enumerator(ty, member),
                Thing::Error => Thing::Error,
                _ => {
                    self.report(Code::UnknownType, ty.span, format!("`{}` is not an enumeration", ty.text));
                    Thing::Error
                }
            },
            ExprKind::Index(base, indices) => Thing::Value(self.index(base, indices, e.span)),
            ExprKind::Deref(base) => Thing::Value(self.deref_expr(base, e.span)),
            ExprKind::Part(base, part) => Thing::Value(self.part(base, *part, e.span)),
            ExprKind::This => self.this_thing(e.span),
            ExprKind::Super => {
                self.report(Code::BadStatement, e.span, "SUPER stands before `^`").help =
                    Some("write `SUPER^.Method()` or `SUPER^()`".into());
                Thing::Error
            }
            ExprKind::Call(callee, args) => Thing::Value(self.call(callee, args, e.span)),
            ExprKind::Direct(direct) => self.direct(direct),
            ExprKind::Error => Thing::Error,
            _ => Thing::Value(self.expr(e)),
        }
    }

    fn this_thing(&mut self, span: Span) -> Thing {
        let instance = self.this_instance(span);
        let Kind::Place(place) = &instance.kind else { return Thing::Error };
        let pointer = self.pointer_to(place);
        let ty = self.c.types.intern(Type::Pointer(instance.ty));
        Thing::Value(self.exact(pointer, ty, span))
    }

    /// The operand as a local of its type's class. Structures and strings have none.
    pub(crate) fn value(&mut self, operand: &Operand) -> Local {
        match &operand.kind {
            Kind::Temp(local) => *local,
            Kind::Const(value) => {
                let value = match (self.c.types.get(operand.ty), value) {
                    (Type::Elem(Elem::Real), Value::Real(v)) => Const::F32((*v as f32).to_bits()),
                    (_, Value::Real(v)) => Const::F64(v.to_bits()),
                    (_, v) => Const::I64(v.word()),
                };
                self.b.constant(value)
            }
            Kind::Place(place) => self.load(place, operand.ty, operand.span),
            Kind::Error | Kind::Void | Kind::Property(_) => self.b.int(0),
        }
    }
}
