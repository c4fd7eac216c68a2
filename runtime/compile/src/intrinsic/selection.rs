//! Functions that select one of their operands: SEL, MUX, MIN, MAX, LIMIT.

use crate::expression::{Kind, Lowering, Operand};
use crate::operator::{Class, common_int};
use takt_abi::Elem;
use takt_ir::{Op, Ty, TypeId};
use takt_syntax::tree::BinaryOp;
use takt_syntax::{Code, Span};

impl Lowering<'_, '_> {
    /// The type that all operands of a selection share.
    pub(super) fn common(&mut self, name: &str, operands: &[Operand]) -> Option<TypeId> {
        let mut ty = operands.first()?.ty;
        let mut flex = operands.first()?.flex;
        for operand in &operands[1..] {
            ty = match (self.class(ty), self.class(operand.ty)) {
                _ if ty == operand.ty => ty,
                (Class::Int(_), Class::Int(_)) if flex => operand.ty,
                (Class::Int(_), Class::Int(_)) if operand.flex => ty,
                (Class::Int(a), Class::Int(b)) => self.c.elem(common_int(a, b)),
                // 0 is the pointer to nothing
                (Class::Int(_), Class::Pointer) if flex => operand.ty,
                (Class::Pointer, Class::Int(_)) if operand.flex => ty,
                (Class::Real(_), Class::Int(e)) if operand.flex || takt_ir::elem_size(e) < 8 => ty,
                (Class::Int(e), Class::Real(_)) if flex || takt_ir::elem_size(e) < 8 => operand.ty,
                (Class::Real(_), Class::Int(_)) | (Class::Int(_), Class::Real(_)) => self.c.elem(Elem::Lreal),
                (Class::Real(_), Class::Real(_)) if flex => operand.ty,
                (Class::Real(_), Class::Real(_)) if operand.flex => ty,
                (Class::Real(_), Class::Real(_)) => self.c.elem(Elem::Lreal),
                (Class::Duration(_), Class::Duration(_)) => self.c.elem(Elem::Ltime),
                (Class::Text, Class::Text) | (Class::Wide, Class::Wide) => {
                    if self.capacity(ty) >= self.capacity(operand.ty) {
                        ty
                    } else {
                        operand.ty
                    }
                }
                _ => {
                    let (wanted, found) = (self.type_name(ty), self.operand_name(operand));
                    self.report(Code::TypeMismatch, operand.span, format!("`{name}` expected `{wanted}`, found {found}"));
                    return None;
                }
            };
            flex &= operand.flex;
        }
        Some(ty)
    }

    /// `MIN(MAX(MN, IN), MX)`: MX wins where the bounds are the wrong way round.
    pub(super) fn limit(&mut self, operands: Vec<Operand>, span: Span) -> Operand {
        let mut three = operands.into_iter();
        let (Some(low), Some(value), Some(high)) = (three.next(), three.next(), three.next()) else { return self.error(span) };
        let raised = self.extreme("MAX", vec![low, value], span);
        self.extreme("MIN", vec![raised, high], span)
    }

    pub(super) fn extreme(&mut self, name: &str, operands: Vec<Operand>, span: Span) -> Operand {
        if operands.iter().any(Operand::is_error) {
            return self.error(span);
        }
        let Some(ty) = self.common(name, &operands) else { return self.error(span) };
        let text = matches!(self.class(ty), Class::Text | Class::Wide);
        if matches!(self.class(ty), Class::Bool | Class::Other | Class::Pointer) {
            return self.refuse(name, &operands[0], span);
        }
        let flex = operands.iter().all(|o| o.flex);
        let op = if name == "MIN" { BinaryOp::Le } else { BinaryOp::Ge };
        let mut best: Option<Operand> = None;
        for operand in operands {
            let operand = if text { operand } else { self.convert_operand(operand, ty) };
            best = Some(match best {
                None => operand,
                Some(best) => {
                    let takes = self.binary(op, best.clone(), operand.clone(), span);
                    if text {
                        let takes = self.value(&takes);
                        self.pick(&[(takes, best)], &operand, ty, span)
                    } else {
                        self.choose(takes, best, operand, ty, span)
                    }
                }
            });
        }
        let best = best.unwrap_or_else(|| self.error(span));
        Operand { flex: flex && matches!(best.kind, Kind::Const(_)), ..best }
    }

    /// `a` if `cond`, else `b`; both of type `ty`.
    pub(super) fn choose(&mut self, cond: Operand, a: Operand, b: Operand, ty: TypeId, span: Span) -> Operand {
        if cond.is_error() || a.is_error() || b.is_error() {
            return self.error(span);
        }
        let op = match self.class_of(ty) {
            Ty::F32 => Op::SelectF32,
            Ty::F64 => Op::SelectF64,
            _ => Op::Select,
        };
        let exact = a.exact && b.exact;
        let result = self.fold_or_emit(op, &[&cond, &a, &b], ty, span);
        Operand { exact, ..result }
    }

    pub(super) fn select(&mut self, selector: Operand, operands: Vec<Operand>, span: Span) -> Operand {
        let selector = self.condition_operand(selector);
        let Some(ty) = self.common("SEL", &operands) else { return self.error(span) };
        if selector.is_error() {
            return selector;
        }
        if self.c.register(ty).is_none() {
            let cond = self.value(&selector);
            let zero = self.b.int(0);
            return self.pick(&[(cond, operands[1].clone()), (zero, operands[0].clone())], &operands[0].clone(), ty, span);
        }
        let mut converted: Vec<Operand> = operands.into_iter().map(|o| self.convert_operand(o, ty)).collect();
        let (no, yes) = (converted.remove(0), converted.remove(0));
        self.choose(selector, yes, no, ty, span)
    }

    pub(super) fn multiplex(&mut self, selector: Operand, operands: Vec<Operand>, span: Span) -> Operand {
        if !matches!(self.class(selector.ty), Class::Int(_)) {
            return self.refuse("MUX", &selector, span);
        }
        let Some(ty) = self.common("MUX", &operands) else { return self.error(span) };
        let word = self.exact_value(&selector);
        let site = self.site(span);
        let last = operands.last().cloned().unwrap_or_else(|| self.error(span));
        let mut choices = Vec::new();
        for (i, operand) in operands.into_iter().enumerate() {
            let number = self.b.int(i as i64);
            choices.push((self.b.op(Op::Eq, &[word, number], site), operand));
        }
        if self.c.register(ty).is_none() {
            return self.pick(&choices, &last, ty, span);
        }
        let bool_type = self.bool_type();
        let mut result = self.convert_operand(last, ty);
        for (cond, operand) in choices.into_iter().rev() {
            let operand = self.convert_operand(operand, ty);
            let cond = self.exact(cond, bool_type, span);
            result = self.choose(cond, operand, result, ty, span);
        }
        result
    }

    /// The first value whose condition is not 0, copied to a slot: for strings and structures.
    pub(super) fn pick(&mut self, choices: &[(takt_ir::Local, Operand)], otherwise: &Operand, ty: TypeId, span: Span) -> Operand {
        let (size, align) = self.c.types.layout(ty);
        let slot = self.b.slot(size, align);
        let place = crate::place::Place::Memory { base: takt_ir::Base::Frame, offset: slot };
        let end = self.b.block();
        for (cond, operand) in choices {
            let (then, other) = (self.b.block(), self.b.block());
            self.b.end(takt_ir::Term::Branch { cond: *cond, then, other });
            self.b.go_to(then);
            self.assign_place(&place, ty, operand.clone(), span);
            self.b.end(takt_ir::Term::Jump(end));
            self.b.go_to(other);
        }
        self.assign_place(&place, ty, otherwise.clone(), span);
        self.b.continue_in(end);
        let mut value = self.at(place, ty, span);
        value.fixed = Some("a result");
        value
    }
}
