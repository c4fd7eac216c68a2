//! Warnings that need the types of operands; asked for while a body is lowered.

use crate::constant::{Value, range};
use crate::expression::{Kind, Lowering, Operand};
use crate::operator::Class;
use crate::scope::{PouKind, key};
use takt_abi::Elem;
use takt_ir::{Type, TypeId};
use takt_syntax::tree::{BinaryOp, Expr, ExprKind, VarKind};
use takt_syntax::{Code, Span};

/// Members that a message names.
const NAMED: usize = 4;

impl<'a> Lowering<'_, 'a> {
    fn linted(&self, span: Span) -> bool {
        !self.scratch && self.c.linted(span)
    }

    /// Whether two REALs are equal. Silent where that is a fair question: against a whole number, of a value with itself (which finds NaN), and whether
    /// a variable has changed (`new <> old`).
    pub(crate) fn lint_equality(&mut self, op: BinaryOp, a: &Operand, b: &Operand, span: Span) {
        let real = |l: &Self, o: &Operand| matches!(l.class(o.ty), Class::Real(_));
        if !matches!(op, BinaryOp::Eq | BinaryOp::Ne) || !self.linted(span) || !(real(self, a) || real(self, b)) {
            return;
        }
        let text = |o: &Operand| self.c.files[o.span.file.0 as usize].text.get(o.span.start as usize..o.span.end as usize);
        let change = op == BinaryOp::Ne && [a, b].iter().all(|o| text(o).is_some_and(is_path));
        if is_whole(a) || is_whole(b) || change || text(a).is_some() && text(a) == text(b) {
            return;
        }
        let sign = if op == BinaryOp::Eq { "=" } else { "<>" };
        let diagnostic = self.report(Code::FloatEquality, span, format!("`{sign}` compares values with rounding errors to the last bit"));
        diagnostic.help = Some("compare the distance: `ABS(a - b) < tolerance`".into());
    }

    /// A comparison of a variable with a literal that its type never reaches.
    pub(crate) fn lint_range(&mut self, op: BinaryOp, a: &Operand, b: &Operand, span: Span) {
        if !self.linted(span) {
            return;
        }
        let found = match (self.variable_range(a), literal(b), literal(a), self.variable_range(b)) {
            (Some(range), Some(v), ..) => always(op, range, v).map(|truth| (truth, a)),
            (.., Some(v), Some(range)) => always(mirrored(op), range, v).map(|truth| (truth, b)),
            _ => None,
        };
        if let Some((truth, variable)) = found {
            let (word, name) = (if truth { "TRUE" } else { "FALSE" }, self.type_name(variable.ty));
            let message = format!("this comparison is always {word}: `{name}` has no other values");
            self.report(Code::AlwaysSame, span, message);
        }
    }

    fn variable_range(&self, operand: &Operand) -> Option<(i128, i128)> {
        match (&operand.kind, self.c.types.get(operand.ty)) {
            (Kind::Const(_), _) => None,
            (_, Type::Elem(e) | Type::Subrange { base: e, .. }) if operand.exact && crate::types::is_integer(*e) => Some(range(*e)),
            _ => None,
        }
    }

    /// A CASE over an enumeration, without ELSE, that has no label for some of the members.
    pub(crate) fn lint_case(&mut self, ty: TypeId, seen: &[(i128, i128, Span)], span: Span) {
        let Type::Enum(e) = self.c.types.get(ty) else { return };
        if !self.linted(span) {
            return;
        }
        let covered = |v: i64| seen.iter().any(|(low, high, _)| (*low..=*high).contains(&v.into()));
        let missing: Vec<String> = e.members.iter().filter(|(_, v)| !covered(*v)).map(|(n, _)| format!("`{n}`")).collect();
        if missing.is_empty() {
            return;
        }
        let (name, more) = (e.name.clone(), missing.len().saturating_sub(NAMED));
        let mut list = missing[..missing.len().min(NAMED)].join(", ");
        if more > 0 {
            list += &format!(" and {more} more");
        }
        let of = if name.starts_with('(') { "its enumeration".into() } else { format!("`{name}`") };
        let message = format!("this CASE has no label for {list} of {of}");
        self.report(Code::MissingMember, span, message).help = Some("add labels, or an ELSE for the rest".into());
    }

    /// A call as a statement: of a function that does nothing but compute.
    pub(crate) fn lint_call(&mut self, e: &'a Expr, result: &Operand) {
        let ExprKind::Call(callee, _) = &e.kind else { return };
        let ExprKind::Name(name) = &callee.kind else { return };
        if !self.linted(e.span) || matches!(result.kind, Kind::Void | Kind::Error) || !self.only_computes(name) {
            return;
        }
        let diagnostic = self.report(Code::ResultUnused, e.span, format!("the result of `{name}` is not used"));
        diagnostic.help = Some(format!("assign it: `x := {name}(…);`"));
    }

    /// Whether a function has no effect but its result: the operators, and functions of scalar inputs that touch nothing else.
    fn only_computes(&self, name: &str) -> bool {
        let wanted = key(name);
        if self.local(&wanted).is_some() || self.block().is_some_and(|c| self.c.member_of(c, &wanted).is_some()) {
            return false;
        }
        match self.c.global_name(name) {
            None => !wanted.starts_with("__"),
            Some(crate::scope::Item::Pou(pou)) if self.c.pous[pou].tree.kind == PouKind::Function => self.is_pure(pou),
            _ => false,
        }
    }

    fn is_pure(&self, pou: usize) -> bool {
        let head = &self.c.pous[pou].tree;
        let scalar = |ty: TypeId| matches!(self.c.types.get(ty), Type::Elem(_) | Type::Subrange { .. } | Type::Enum(_));
        let closed = self.c.pous[pou].vars.iter().all(|v| matches!(v.kind, VarKind::Input | VarKind::Var | VarKind::Temp) && scalar(v.ty));
        let mut found = super::names::Names::default();
        found.unit(head);
        let inside = |name: &str| key(name) == key(&head.name.text) || self.c.pous[pou].index.contains_key(&key(name));
        let quiet = |name: &str, how: u8| {
            let changes = how & (super::names::WRITTEN | super::names::PART | super::names::GIVEN) != 0;
            let calls = how & super::names::CALLED != 0;
            how & super::names::MEMBER == 0 && (!changes || inside(name)) && (!calls || self.c.global_name(name).is_none())
        };
        closed && found.names.iter().all(|(name, how)| quiet(name, *how))
    }

    /// `p := ADR(x)` where `p` is a pointer to something else.
    pub(crate) fn lint_pointer(&mut self, a: &Operand, to: TypeId) {
        let (&Type::Pointer(found), &Type::Pointer(wanted)) = (self.c.types.get(a.ty), self.c.types.get(to)) else { return };
        if !self.linted(a.span) || self.points_at(wanted, found) {
            return;
        }
        let (wanted, found) = (self.type_name(wanted), self.type_name(found));
        let message = format!("expected the address of a `{wanted}`, found that of a `{found}`");
        self.report(Code::PointerType, a.span, message).help =
            Some(format!("what is read through it is not a `{wanted}`; declare `POINTER TO {found}`"));
    }

    /// Whether a pointer to `wanted` is at home on a `found`: bytes of anything, first elements, related types, texts of other lengths.
    fn points_at(&self, wanted: TypeId, found: TypeId) -> bool {
        let bytes =
            |ty: TypeId| matches!(self.c.types.get(ty), Type::Elem(Elem::Byte | Elem::Usint | Elem::Sint | Elem::Char) | Type::Error);
        let element = |ty: TypeId| match self.c.types.get(ty) {
            Type::Array { elem, .. } => Some(*elem),
            _ => None,
        };
        let integers = match (self.scalar(wanted), self.scalar(found)) {
            (Some(x), Some(y)) => {
                takt_ir::elem_size(x) == takt_ir::elem_size(y) && crate::types::is_integer(x) && crate::types::is_integer(y)
            }
            _ => false,
        };
        let texts = matches!(
            (self.c.types.get(wanted), self.c.types.get(found)),
            (Type::String(_), Type::String(_)) | (Type::WString(_), Type::WString(_))
        );
        bytes(wanted)
            || bytes(found)
            || integers
            || texts
            || self.refers_to(wanted, found)
            || self.refers_to(found, wanted)
            || element(found).is_some_and(|elem| self.points_at(wanted, elem))
            || element(wanted).is_some_and(|elem| self.points_at(elem, found))
    }
}

fn is_whole(operand: &Operand) -> bool {
    match &operand.kind {
        Kind::Const(Value::Int(_)) => true,
        Kind::Const(Value::Real(v)) => v.fract() == 0.0,
        _ => false,
    }
}

/// Whether a text names a variable and computes nothing.
fn is_path(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || c == '_') && text.chars().all(|c| c.is_alphanumeric() || "_.^[]".contains(c))
}

fn literal(operand: &Operand) -> Option<i128> {
    match operand.kind {
        Kind::Const(Value::Int(v)) if operand.flex => Some(v),
        _ => None,
    }
}

fn mirrored(op: BinaryOp) -> BinaryOp {
    use BinaryOp::*;
    match op {
        Lt => Gt,
        Le => Ge,
        Gt => Lt,
        Ge => Le,
        other => other,
    }
}

/// What `x op v` is for every x of a range, if it is the same.
fn always(op: BinaryOp, (low, high): (i128, i128), v: i128) -> Option<bool> {
    use BinaryOp::*;
    let decided = |yes: bool, no: bool| if yes { Some(true) } else { no.then_some(false) };
    match op {
        Eq => decided(false, v < low || v > high),
        Ne => decided(v < low || v > high, false),
        Lt => decided(v > high, v <= low),
        Le => decided(v >= high, v < low),
        Gt => decided(v < low, v >= high),
        Ge => decided(v <= low, v > high),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::always;
    use takt_syntax::tree::BinaryOp::{Eq, Ge, Gt, Le, Lt, Ne};

    #[test]
    fn a_range_decides_comparisons_outside_of_it() {
        let byte = (0, 255);
        assert_eq!(always(Lt, byte, 0), Some(false));
        assert_eq!(always(Ge, byte, 0), Some(true));
        assert_eq!(always(Le, byte, 255), Some(true));
        assert_eq!(always(Gt, byte, 255), Some(false));
        assert_eq!(always(Eq, byte, 300), Some(false));
        assert_eq!(always(Ne, byte, -1), Some(true));
        assert!([Lt, Le, Gt, Ge, Eq, Ne].iter().all(|op| always(*op, byte, 7).is_none()));
    }
}
