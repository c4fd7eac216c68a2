//! The names that stand in a unit, and what is done with them.

use crate::scope::{Head, key};
use rustc_hash::FxHashMap as HashMap;
use takt_syntax::tree::{
    Arg, ArgKind, AssignOp, CaseLabel, Expr, ExprKind, Init, InitItem, Stmt, StmtKind, TypeExpr, TypeExprKind, VarDecl,
};

/// Its value is used.
pub(super) const READ: u8 = 1;
/// It is assigned.
pub(super) const WRITTEN: u8 = 2;
/// A part of it is assigned.
pub(super) const PART: u8 = 4;
/// It is handed on: whoever gets it may read and write it.
pub(super) const GIVEN: u8 = 8;
/// It is called.
pub(super) const CALLED: u8 = 16;
/// It stands behind a dot, or before an argument: somebody else's variable has this name. No use by itself.
pub(super) const MEMBER: u8 = 32;

/// What a walk through a unit finds, as it is spelled.
#[derive(Debug, Default)]
pub(super) struct Names<'a> {
    /// What is done with a name.
    pub(super) names: HashMap<&'a str, u8>,
}

/// The same by key.
pub(super) fn folded(names: HashMap<&str, u8>) -> HashMap<String, u8> {
    let mut folded = HashMap::with_capacity_and_hasher(names.len(), Default::default());
    for (name, how) in names {
        *folded.entry(key(name)).or_insert(0) |= how;
    }
    folded
}

impl<'a> Names<'a> {
    /// Declarations and statements.
    pub(super) fn unit(&mut self, head: &Head<'a>) {
        head.vars.iter().flat_map(|block| &block.vars).for_each(|decl| self.declaration(decl));
        self.statements(head.body);
    }

    fn declaration(&mut self, decl: &'a VarDecl) {
        self.type_(&decl.ty);
        decl.init.iter().for_each(|init| self.initial(init));
        decl.fb_init.iter().chain(decl.fb_inits.iter().flatten()).for_each(|arg| self.argument(arg));
    }

    fn type_(&mut self, ty: &'a TypeExpr) {
        match &ty.kind {
            TypeExprKind::Array { dims, elem } => {
                for (low, high) in dims.iter().flatten() {
                    self.read(low);
                    self.read(high);
                }
                self.type_(elem);
            }
            TypeExprKind::String(Some(n)) | TypeExprKind::WString(Some(n)) => self.read(n),
            TypeExprKind::Pointer(to) | TypeExprKind::Reference(to) | TypeExprKind::RefTo(to) => self.type_(to),
            TypeExprKind::Subrange { low, high, .. } => {
                self.read(low);
                self.read(high);
            }
            TypeExprKind::Enum(body) => body.members.iter().filter_map(|(_, value)| value.as_ref()).for_each(|e| self.read(e)),
            TypeExprKind::Struct(fields) => fields.iter().for_each(|field| self.declaration(field)),
            TypeExprKind::Generic { values, .. } => values.iter().for_each(|value| self.read(value)),
            _ => {}
        }
    }

    fn initial(&mut self, init: &'a Init) {
        match init {
            Init::Expr(e) => self.given(e),
            Init::Struct(members, _) => members.iter().for_each(|(_, init)| self.initial(init)),
            Init::Array(items, _) => {
                for item in items {
                    match item {
                        InitItem::One(init) => self.initial(init),
                        InitItem::Repeat(count, values) => {
                            self.read(count);
                            values.iter().for_each(|init| self.initial(init));
                        }
                    }
                }
            }
        }
    }

    fn statements(&mut self, list: &'a [Stmt]) {
        list.iter().for_each(|statement| self.statement(statement));
    }

    fn statement(&mut self, statement: &'a Stmt) {
        match &statement.kind {
            StmtKind::Assign { targets, value } => self.assignment(targets, value),
            StmtKind::Expr(e) => self.read(e),
            StmtKind::If { arms, otherwise } => {
                for (condition, body) in arms {
                    self.read(condition);
                    self.statements(body);
                }
                self.statements(otherwise.as_deref().unwrap_or_default());
            }
            StmtKind::Case { value, arms, otherwise } => {
                self.read(value);
                for (labels, body) in arms {
                    labels.iter().for_each(|label| self.label(label));
                    self.statements(body);
                }
                self.statements(otherwise.as_deref().unwrap_or_default());
            }
            StmtKind::For { var, from, to, by, body } => {
                self.given(var);
                [Some(&**from), Some(&**to), by.as_ref()].into_iter().flatten().for_each(|e| self.read(e));
                self.statements(body);
            }
            StmtKind::While { cond, body } | StmtKind::Repeat { body, until: cond } => {
                self.read(cond);
                self.statements(body);
            }
            StmtKind::Try { body, catch, finally } => {
                self.statements(body);
                if let Some((name, handler)) = catch {
                    name.iter().for_each(|name| self.mark(&name.text, GIVEN));
                    self.statements(handler);
                }
                self.statements(finally.as_deref().unwrap_or_default());
            }
            StmtKind::Exit | StmtKind::Continue | StmtKind::Return | StmtKind::Jump(_) | StmtKind::Label(_) => {}
            StmtKind::Empty | StmtKind::Error => {}
        }
    }

    fn assignment(&mut self, targets: &'a [(Expr, AssignOp)], value: &'a Expr) {
        targets.iter().for_each(|(target, _)| self.target(target, WRITTEN));
        match targets.last() {
            Some((_, AssignOp::Ref | AssignOp::Try)) => self.given(value),
            _ => self.read(value),
        }
    }

    fn label(&mut self, label: &'a CaseLabel) {
        match label {
            CaseLabel::Value(e) => self.read(e),
            CaseLabel::Range(low, high) => {
                self.read(low);
                self.read(high);
            }
        }
    }

    fn mark(&mut self, name: &'a str, how: u8) {
        *self.names.entry(name).or_insert(0) |= how;
    }

    /// What is assigned, or whose part is.
    fn target(&mut self, e: &'a Expr, how: u8) {
        match &e.kind {
            ExprKind::Name(name) => self.mark(name, how),
            ExprKind::Member(base, member) => {
                self.member(&member.text);
                self.target(base, PART);
            }
            ExprKind::Part(base, _) => self.target(base, PART),
            ExprKind::Index(base, indices) => {
                self.target(base, PART);
                indices.iter().for_each(|index| self.read(index));
            }
            _ => self.read(e),
        }
    }

    /// A name behind a dot; it may be a constant that numbers a bit.
    fn member(&mut self, name: &'a str) {
        self.mark(name, READ | MEMBER);
    }

    /// What may be changed by whoever gets it, if it is a variable.
    fn given(&mut self, e: &'a Expr) {
        match &e.kind {
            ExprKind::Name(name) => self.mark(name, GIVEN),
            _ => self.read(e),
        }
    }

    fn argument(&mut self, arg: &'a Arg) {
        arg.name.iter().for_each(|name| self.mark(&name.text, MEMBER));
        match (&arg.value, arg.kind) {
            (Some(value), ArgKind::Out | ArgKind::NotOut) => self.target(value, WRITTEN),
            (Some(value), _) => self.given(value),
            (None, _) => {}
        }
    }

    fn read(&mut self, e: &'a Expr) {
        match &e.kind {
            ExprKind::Name(name) => self.mark(name, READ),
            ExprKind::Global(name) => self.mark(&name.text, MEMBER),
            ExprKind::Member(base, member) => {
                self.member(&member.text);
                self.read(base);
            }
            ExprKind::Part(base, _) | ExprKind::Deref(base) | ExprKind::Unary(_, base) => self.read(base),
            ExprKind::Index(base, indices) => {
                self.read(base);
                indices.iter().for_each(|index| self.read(index));
            }
            ExprKind::Binary(_, a, b) => {
                self.read(a);
                self.read(b);
            }
            ExprKind::Chain(first, links) => {
                self.read(first);
                links.iter().for_each(|link| self.read(&link.right));
            }
            ExprKind::Assign(target, value) => {
                self.target(target, WRITTEN);
                self.read(value);
            }
            ExprKind::Call(callee, args) => {
                match &callee.kind {
                    ExprKind::Name(name) => self.mark(name, CALLED),
                    _ => self.read(callee),
                }
                args.iter().for_each(|arg| self.argument(arg));
            }
            ExprKind::Literal(_) | ExprKind::This | ExprKind::Super | ExprKind::Direct(_) => {}
            ExprKind::Typed(..) | ExprKind::Error => {}
        }
    }
}
