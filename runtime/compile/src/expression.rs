//! Checking and lowering expressions: names, literals, members, operands.

use crate::constant::Value;
use crate::emit::Builder;
use crate::object::Bound;
use crate::place::Place;
use crate::scope::{Item, Owner, PouKind, Storage, key, same};
use crate::types::{elementary, nearest};
use crate::unit::Compiler;
use takt_abi::{Elem, FnDesc, Section};
use takt_ir::{Base, BlockId, Body, BodyId, Const, Local, SiteId, StructKind, Type, TypeId};
use takt_syntax::tree::{Expr, ExprKind, Literal, LiteralValue, Name, Part, VarKind};
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
    pub(crate) labels: std::collections::HashMap<String, (BlockId, bool, Span)>,
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
        Operand { ty, kind: Kind::Place(place), span, flex: false, exact: true, fixed: None, dynamic: false }
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
        match (self.this, self.block().and_then(|p| self.c.pous[p].ty)) {
            (Some(this), Some(ty)) => {
                let place = Place::Memory { base: Base::Local(this), offset: 0 };
                let pointer = self.pointer_to(&place);
                let ty = self.c.types.intern(Type::Pointer(ty));
                Thing::Value(self.exact(pointer, ty, span))
            }
            _ => {
                self.report(Code::BadStatement, span, "THIS is only possible in a FUNCTION_BLOCK");
                Thing::Error
            }
        }
    }

    pub(crate) fn name(&mut self, name: &str, span: Span) -> Thing {
        let Some(pou) = self.pou else { return self.global_thing(name, span) };
        let wanted = key(name);
        if self.declare_ahead(&wanted, span) {
            return Thing::Error;
        }
        if let Some((level, i)) = self.local(&wanted)
            && (level == 0 || !self.is_result(pou, &wanted))
        {
            return Thing::Value(self.variable(level, i, span));
        }
        if let (Some((ty, storage)), true) = (&self.result, self.is_result(pou, &wanted)) {
            let (ty, storage) = (*ty, storage.clone());
            return Thing::Value(self.stored(&storage, ty, span));
        }
        if let Some(thing) = self.own_member(&wanted, span) {
            return thing;
        }
        match self.levels.iter().find_map(|l| self.c.pous[l.pou].enumerators.get(&wanted).copied()) {
            Some((ty, value)) => Thing::Value(self.constant(Value::Int(value.into()), ty, span)),
            None => self.global_thing(name, span),
        }
    }

    /// Whether a name is that of the unit's result.
    pub(crate) fn is_result(&self, pou: usize, wanted: &str) -> bool {
        self.result.is_some() && key(&self.c.pous[pou].tree.name.text) == wanted
    }

    fn variable(&mut self, level: usize, i: usize, span: Span) -> Operand {
        let v = &self.c.pous[self.levels[level].pou].vars[i];
        let (ty, constant, in_out) = (v.ty, v.constant, v.kind == VarKind::InOut);
        if let Some(value) = v.value.clone() {
            return self.constant(value, ty, span);
        }
        if *self.c.types.get(ty) == Type::Error || constant && self.c.lacks_value(ty, v.decl) {
            return self.error(span);
        }
        let storage = self.storage_of(level, i);
        let mut operand = match (in_out, &storage) {
            (true, Storage::This(_) | Storage::Image(_)) => self.follow_in_out(&storage, ty, span),
            _ => self.stored(&storage, ty, span),
        };
        operand.dynamic = in_out;
        if constant {
            operand.fixed = Some("a constant");
        }
        operand
    }

    /// The operand of a variable that lies there.
    pub(crate) fn stored(&mut self, storage: &Storage, ty: TypeId, span: Span) -> Operand {
        let place = match storage {
            Storage::Image(offset) => Place::Memory { base: Base::Image, offset: *offset },
            Storage::Bit(offset, bit) => {
                let byte = Place::Memory { base: Base::Image, offset: *offset };
                let bit = self.c.types.intern(Type::Bit(*bit));
                self.bit_place(byte, bit).0
            }
            Storage::This(offset) => match self.this {
                Some(this) => Place::Memory { base: Base::Local(this), offset: *offset },
                None => Place::Memory { base: Base::Image, offset: takt_ir::NULL_ZONE },
            },
            Storage::Frame(offset) => Place::Memory { base: Base::Frame, offset: *offset },
            Storage::Register(local) => Place::Register(*local),
            Storage::Behind(address) => Place::Memory { base: Base::Local(*address), offset: 0 },
            Storage::Open(pointer, bounds) => Place::Open { pointer: *pointer, bounds: bounds.clone() },
            Storage::Nowhere => Place::Memory { base: Base::Image, offset: takt_ir::NULL_ZONE },
        };
        self.at(place, ty, span)
    }

    pub(crate) fn global_thing(&mut self, name: &str, span: Span) -> Thing {
        match self.c.global_name(name) {
            Some(item) => self.item(item, name, span),
            None => {
                if let Some(e) = elementary(name) {
                    return Thing::Type(self.c.elem(e));
                }
                if key(name) == "NULL" {
                    let ty = self.c.elem(Elem::Lword);
                    return Thing::Value(Operand { flex: true, ..self.constant(Value::Int(0), ty, span) });
                }
                let help = self.suggest(name);
                self.c.unknown_name(self.pou, name, span, help);
                Thing::Error
            }
        }
    }

    fn suggest(&mut self, name: &str) -> Option<String> {
        let seen: usize = self.levels.iter().map(|l| self.c.pous[l.pou].vars.len()).sum();
        if !self.c.may_compare(seen) {
            return None;
        }
        let seen = || self.levels.iter().flat_map(|l| &self.c.pous[l.pou].vars);
        match nearest(&key(name), seen().map(|v| key(&v.name))) {
            Some(found) => {
                let spelled = seen().find(|v| key(&v.name) == found).map_or(found, |v| v.name.clone());
                Some(format!("did you mean `{spelled}`?"))
            }
            None => {
                let wanted = key(name);
                let list = self.c.lists.iter().find(|list| list.vars.contains_key(&wanted));
                list.map(|list| format!("write `{}.{name}`", list.name)).or_else(|| self.c.suggest(name, false))
            }
        }
    }

    pub(crate) fn item(&mut self, item: Item, name: &str, span: Span) -> Thing {
        match item {
            Item::Global(i) => Thing::Value(self.global(i, span)),
            Item::Pou(i) => self.pou_thing(i, span),
            Item::Type(i) => {
                let ty = self.c.declared[i].ty;
                ty.map_or(Thing::Error, Thing::Type)
            }
            Item::Interface(i) => Thing::Type(self.c.interfaces[i].ty),
            Item::Ready(ty) | Item::NativeBlock(ty) => Thing::Type(ty),
            Item::NativeFunction(desc) => Thing::Native(desc),
            Item::List(i) => Thing::List(i),
            Item::Library | Item::Namespace(_) => Thing::Space(item),
            Item::Enumerator(ty, value) => Thing::Value(self.constant(Value::Int(value.into()), ty, span)),
            Item::Member(declared, member) => self.declared_member(declared, member, span),
            Item::Ambiguous => {
                self.report(Code::DuplicateName, span, format!("`{name}` is declared in several lists or enumerations")).help =
                    Some("write the list's or type's name before it".into());
                Thing::Error
            }
        }
    }

    fn declared_member(&mut self, declared: usize, member: usize, span: Span) -> Thing {
        let ty = self.c.resolve_declared(declared, span);
        let Type::Enum(e) = self.c.types.get(ty) else { return Thing::Error };
        let Some((_, value)) = e.members.get(member) else { return Thing::Error };
        let value = Value::Int((*value).into());
        Thing::Value(self.constant(value, ty, span))
    }

    fn pou_thing(&mut self, i: usize, span: Span) -> Thing {
        self.c.resolve_pou(i, span);
        match self.c.pous[i].tree.kind {
            PouKind::FunctionBlock => Thing::Type(self.c.pou_type(i)),
            PouKind::Function | PouKind::Method | PouKind::Action => Thing::Function(i),
            PouKind::Program => {
                let ty = self.c.pou_type(i);
                let offset = self.c.pous[i].instance.max(takt_ir::NULL_ZONE);
                Thing::Value(self.at(Place::Memory { base: Base::Image, offset }, ty, span))
            }
        }
    }

    fn global(&mut self, i: usize, span: Span) -> Operand {
        self.c.resolve_global(i);
        let Some(var) = &self.c.globals[i].var else { return self.error(span) };
        let (ty, value, storage, constant) = (var.ty, var.value.clone(), var.storage.clone(), var.constant);
        // What was wrong with a constant has been said where it is declared.
        let failed = constant && value.is_none() && var.init.is_some() && self.c.folds(ty);
        if failed || *self.c.types.get(ty) == Type::Error {
            return self.error(span);
        }
        if let Some(value) = value {
            return self.constant(value, ty, span);
        }
        if constant && self.c.lacks_value(ty, self.c.globals[i].decl) {
            return self.error(span);
        }
        let mut operand = self.stored(&storage, ty, span);
        if constant {
            operand.fixed = Some("a constant");
        }
        operand
    }

    fn enumerator(&mut self, ty: TypeId, member: &Name) -> Thing {
        let Type::Enum(e) = self.c.types.get(ty) else {
            let name = self.type_name(ty);
            if *self.c.types.get(ty) != Type::Error {
                let help = matches!(self.c.types.get(ty), Type::Struct(_) | Type::Interface(_))
                    .then(|| format!("`{name}` is a type; declare a variable of it, and write that before the dot"));
                self.report(Code::UnknownMember, member.span, format!("the type `{name}` has no member `{}`", member.text)).help = help;
            }
            return Thing::Error;
        };
        match e.members.iter().find(|(n, _)| same(n, &member.text)) {
            Some((_, value)) => {
                let value = Value::Int((*value).into());
                Thing::Value(self.constant(value, ty, member.span))
            }
            None => {
                let near = nearest(&key(&member.text), e.members.iter().map(|(n, _)| key(n)));
                let name = e.name.clone();
                self.report(Code::UnknownMember, member.span, format!("`{name}` has no member `{}`", member.text)).help =
                    near.map(|n| format!("did you mean `{n}`?"));
                Thing::Error
            }
        }
    }

    fn member(&mut self, base: &'a Expr, member: &Name, span: Span) -> Thing {
        if let ExprKind::Deref(inner) = &base.kind
            && inner.kind == ExprKind::Super
        {
            return match self.super_instance(base.span) {
                Some(operand) => self.field(operand, member, span),
                None => Thing::Error,
            };
        }
        match self.thing(base) {
            Thing::Value(operand) => self.field(operand, member, span),
            Thing::List(list) => match self.c.lists[list].vars.get(&key(&member.text)).copied() {
                Some(i) => Thing::Value(self.global(i, span)),
                None => {
                    let near = nearest(&key(&member.text), self.c.lists[list].vars.keys().cloned());
                    let near = near.map(|n| self.c.lists[list].vars[&n]).map(|i| self.c.globals[i].decl.name.text.clone());
                    let name = self.c.lists[list].name.clone();
                    self.report(Code::UnknownMember, member.span, format!("the list `{name}` has no variable `{}`", member.text)).help =
                        near.map(|n| format!("did you mean `{n}`?"));
                    Thing::Error
                }
            },
            Thing::Type(ty) => self.enumerator(ty, member),
            Thing::Space(space) => {
                let library = if let ExprKind::Name(library) = &base.kind { library } else { "" };
                match self.c.item_in(space, library, &member.text) {
                    Some(item) => self.item(item, &member.text, span),
                    None => {
                        let what = if let Item::Library = space { "library" } else { "namespace" };
                        self.report(Code::UnknownMember, member.span, format!("the {what} has no `{}`", member.text));
                        Thing::Error
                    }
                }
            }
            Thing::Error => Thing::Error,
            Thing::Function(_) | Thing::Native(_) | Thing::Member(_) => {
                self.report(Code::UnknownMember, member.span, format!("a function has no member `{}`", member.text));
                Thing::Error
            }
        }
    }

    fn field(&mut self, operand: Operand, member: &Name, span: Span) -> Thing {
        if operand.is_error() {
            return Thing::Error;
        }
        let wanted = key(&member.text);
        if let Some(thing) = self.member_thing(&operand, &wanted) {
            return thing;
        }
        let Type::Struct(structure) = self.c.types.get(operand.ty) else {
            return match self.bit_number(&operand, member) {
                Some(bit) => Thing::Value(self.part_of(operand, Part::Bit(bit), span)),
                None => self.no_member(&operand, member),
            };
        };
        let (kind, found) = (structure.kind, structure.fields.iter().find(|f| same(&f.name, &member.text)).cloned());
        let unit = self.c.pou_of_type.get(&operand.ty).copied();
        let constant = unit.and_then(|unit| {
            let var = self.c.bases(unit).find_map(|b| self.c.pous[b].index.get(&wanted).map(|i| &self.c.pous[b].vars[*i]))?;
            Some((var.value.clone()?, var.ty))
        });
        if let Some((value, ty)) = constant {
            return Thing::Value(self.constant(value, ty, span));
        }
        if let (None, Some(value)) = (&found, unit.and_then(|unit| self.fixed_member(unit, &wanted, member.span))) {
            return Thing::Value(value);
        }
        let Some(field) = found else { return self.no_member(&operand, member) };
        // A block sees all of its own type and of what it extends: `THIS^.x`.
        let related = |unit: usize| self.block().is_some_and(|c| self.c.is_a(c, Owner::Pou(unit)) || self.c.is_a(unit, Owner::Pou(c)));
        let foreign = kind == StructKind::Block && !unit.is_some_and(related);
        if foreign && field.section == Section::InOut {
            let message = format!("`{}` is a VAR_IN_OUT of the block and cannot be used from outside", member.text);
            self.report(Code::NotAccessible, member.span, message);
            return Thing::Error;
        }
        if *self.c.types.get(field.ty) == Type::Error {
            return Thing::Error;
        }
        let Kind::Place(place) = operand.kind else { return Thing::Error };
        if field.section == Section::InOut
            && let Place::Memory { base, offset } = place.inside(field.offset)
        {
            return Thing::Value(Operand { dynamic: true, ..self.in_out_at(base, offset, field.ty, span) });
        }
        let (place, ty) = self.bit_place(place.inside(field.offset), field.ty);
        let mut value = self.at(place, ty, span);
        value.fixed = operand.fixed;
        match field.section {
            Section::Output if foreign => value.fixed = Some(BLOCK_OUTPUT),
            Section::State if foreign => value.fixed = Some(BLOCK_VARIABLE),
            _ => {}
        }
        Thing::Value(value)
    }

    /// `flags.READY` with a constant READY: the number of the bit.
    fn bit_number(&mut self, operand: &Operand, member: &Name) -> Option<u32> {
        self.scalar(operand.ty).filter(|e| crate::types::is_integer(*e))?;
        let known = self.local(&key(&member.text)).is_some() || self.c.global_name(&member.text).is_some();
        match known.then(|| self.name(&member.text, member.span))? {
            Thing::Value(Operand { kind: Kind::Const(Value::Int(bit)), .. }) => u32::try_from(bit).ok(),
            _ => None,
        }
    }

    fn no_member(&mut self, operand: &Operand, member: &Name) -> Thing {
        let name = self.type_name(operand.ty);
        let help = match self.c.types.get(operand.ty) {
            Type::Struct(_) | Type::Interface(_) => {
                let known = self.member_names(operand.ty);
                nearest(&key(&member.text), known.iter().map(|n| key(n)))
                    .and_then(|n| known.iter().find(|k| key(k) == n).map(|k| format!("did you mean `{k}`?")))
            }
            Type::Pointer(_) => Some(format!("follow the pointer first: `^.{}`", member.text)),
            _ => None,
        };
        self.report(Code::UnknownMember, member.span, format!("`{name}` has no member `{}`", member.text)).help = help;
        Thing::Error
    }

    fn literal(&mut self, literal: &Literal, span: Span) -> Operand {
        if let Some(name) = &literal.ty {
            return self.typed_literal(name, &literal.value, span);
        }
        let (value, elem) = match &literal.value {
            LiteralValue::Int(v) => (Value::Int(*v), int_type(*v)),
            LiteralValue::Real(v) => (Value::Real(*v), Elem::Lreal),
            LiteralValue::Bool(v) => (Value::Int(i128::from(*v)), Elem::Bool),
            LiteralValue::String(text) => {
                let ty = self.c.types.intern(Type::String((text.len() as u32).max(1)));
                return Operand { flex: true, ..self.constant(Value::Text(text.clone()), ty, span) };
            }
            LiteralValue::WString(text) => {
                let ty = self.c.types.intern(Type::WString((text.len() as u32).max(1)));
                return Operand { flex: true, ..self.constant(Value::Wide(text.clone()), ty, span) };
            }
            LiteralValue::Time(ns) => (Value::Int(ns / 1_000_000), Elem::Time),
            LiteralValue::Ltime(ns) => (Value::Int(*ns), Elem::Ltime),
            LiteralValue::Date(days) => (Value::Int(i128::from(*days) * 86_400), Elem::Date),
            LiteralValue::Ldate(days) => (Value::Int(i128::from(*days) * 86_400_000_000_000), Elem::Ldate),
            LiteralValue::Tod(ns) => (Value::Int(i128::from(*ns) / 1_000_000), Elem::Tod),
            LiteralValue::Ltod(ns) => (Value::Int((*ns).into()), Elem::Ltod),
            LiteralValue::Dt(ns) => (Value::Int(ns / 1_000_000_000), Elem::Dt),
            LiteralValue::Ldt(ns) => (Value::Int(*ns), Elem::Ldt),
        };
        let flex = matches!(literal.value, LiteralValue::Int(_) | LiteralValue::Real(_));
        let ty = self.c.elem(elem);
        if let (Value::Int(v), false) = (&value, flex) {
            let (low, high) = crate::constant::range(elem);
            if !(low..=high).contains(v) {
                let name = takt_ir::elem_name(elem);
                self.report(Code::OutOfRange, span, format!("this literal does not fit the type `{name}`"));
                return self.error(span);
            }
        }
        Operand { flex, ..self.constant(value, ty, span) }
    }

    fn typed_literal(&mut self, name: &Name, value: &LiteralValue, span: Span) -> Operand {
        let untyped = Literal { ty: None, value: value.clone() };
        let plain = self.literal(&untyped, span);
        let Some(elem) = elementary(&name.text) else {
            return match (key(&name.text).as_str(), value) {
                ("STRING", LiteralValue::String(_)) | ("WSTRING", LiteralValue::WString(_)) => plain,
                _ => {
                    self.report(Code::UnknownType, name.span, format!("`{}` is not an elementary type", name.text));
                    self.error(span)
                }
            };
        };
        let ty = self.c.elem(elem);
        let flex = match (elem, &plain.kind) {
            (Elem::Bool, Kind::Const(Value::Int(v @ (0 | 1)))) => return self.constant(Value::Int(*v), ty, span),
            (Elem::Char, Kind::Const(Value::Text(t))) if t.len() == 1 => return self.constant(Value::Int(t[0].into()), ty, span),
            (Elem::Wchar, Kind::Const(Value::Wide(t))) if t.len() == 1 => return self.constant(Value::Int(t[0].into()), ty, span),
            _ => plain,
        };
        let converted = self.convert(flex, ty);
        Operand { flex: false, ..converted }
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

/// The smallest of the types that literals take by themselves.
fn int_type(v: i128) -> Elem {
    if i16::try_from(v).is_ok() {
        Elem::Int
    } else if i32::try_from(v).is_ok() {
        Elem::Dint
    } else if i64::try_from(v).is_ok() {
        Elem::Lint
    } else {
        Elem::Ulint
    }
}
