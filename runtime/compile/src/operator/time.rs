//! Operators on TIME, dates and their long forms.

use super::{Class, int_op, is_comparison, real_op};
use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand};
use takt_abi::Elem;
use takt_ir::{Op, TypeId};
use takt_syntax::Span;
use takt_syntax::tree::BinaryOp;

impl Lowering<'_, '_> {
    /// TIME and dates: durations add, scale and compare; a moment minus a moment is a duration.
    pub(super) fn time_binary(&mut self, op: BinaryOp, a: Operand, b: Operand, span: Span) -> Operand {
        use BinaryOp::*;
        let (ca, cb) = (self.class(a.ty), self.class(b.ty));
        match (op, ca, cb) {
            (Add | Sub | Div | Mod | Eq | Ne | Lt | Le | Gt | Ge, Class::Duration(x), Class::Duration(y)) => {
                let e = if x == y { x } else { Elem::Ltime };
                let ty = self.c.elem(e);
                let (a, b) = (self.explicit(a, ty), self.explicit(b, ty));
                self.same_time(op, e, a, b, span)
            }
            (Mul | Div, Class::Duration(_), Class::Int(_)) | (Mul, Class::Int(_), Class::Duration(_)) => {
                let ty = if matches!(ca, Class::Duration(_)) { a.ty } else { b.ty };
                if let (Div, Kind::Const(Value::Int(0))) = (op, &b.kind) {
                    return self.constant_zero(&b, span);
                }
                let result = self.fold_or_emit(int_op(op, Elem::Lint), &[&a, &b], ty, span);
                self.computed(result)
            }
            (Mul | Div, Class::Duration(_), Class::Real(_)) | (Mul, Class::Real(_), Class::Duration(_)) => {
                let lreal = self.c.elem(Elem::Lreal);
                let ty = if matches!(ca, Class::Duration(_)) { a.ty } else { b.ty };
                let (a, b) = (self.explicit(a, lreal), self.explicit(b, lreal));
                let product = self.fold_or_emit(real_op(op, false), &[&a, &b], lreal, span);
                self.explicit(product, ty)
            }
            (Eq | Ne | Lt | Le | Gt | Ge, Class::Moment(x), Class::Moment(y)) if x == y => self.same_time(op, x, a, b, span),
            (Sub, Class::Moment(x), Class::Moment(y)) if x == y => {
                let (unit, result) = moment_unit(x);
                let ty = self.c.elem(result);
                let difference = self.fold_or_emit(Op::Sub, &[&a, &b], ty, span);
                self.scale(difference, Op::Mul, unit, ty, span)
            }
            (Add | Sub, Class::Moment(x), Class::Duration(y)) => {
                let (unit, duration) = moment_unit(x);
                if y == Elem::Ltime && duration == Elem::Time {
                    return self.bad_operands(op, &a, &b, span);
                }
                let (ty, span_type) = (a.ty, self.c.elem(duration));
                let b = self.explicit(b, span_type);
                let steps = self.scale(b, Op::Div, unit, ty, span);
                let result = self.fold_or_emit(if op == Add { Op::Add } else { Op::Sub }, &[&a, &steps], ty, span);
                self.computed(result)
            }
            _ => self.bad_operands(op, &a, &b, span),
        }
    }

    fn same_time(&mut self, op: BinaryOp, e: Elem, a: Operand, b: Operand, span: Span) -> Operand {
        let comparison = is_comparison(op);
        let ty = match op {
            _ if comparison => self.bool_type(),
            BinaryOp::Div => self.c.elem(Elem::Lint),
            _ => self.c.elem(e),
        };
        if let (BinaryOp::Div, Kind::Const(Value::Int(0))) = (op, &b.kind) {
            return self.constant_zero(&b, span);
        }
        let result = self.fold_or_emit(int_op(op, e), &[&a, &b], ty, span);
        if comparison { Operand { exact: true, ..result } } else { self.computed(result) }
    }

    fn scale(&mut self, a: Operand, op: Op, unit: i64, ty: TypeId, span: Span) -> Operand {
        if unit == 1 {
            return a;
        }
        let lint = self.c.elem(Elem::Lint);
        let unit = self.constant(Value::Int(unit.into()), lint, span);
        let result = self.fold_or_emit(op, &[&a, &unit], ty, span);
        self.computed(result)
    }
}

/// Units per step of a date type and the duration that goes with it.
fn moment_unit(e: Elem) -> (i64, Elem) {
    match e {
        Elem::Date | Elem::Dt => (1000, Elem::Time),
        Elem::Tod => (1, Elem::Time),
        _ => (1, Elem::Ltime),
    }
}
