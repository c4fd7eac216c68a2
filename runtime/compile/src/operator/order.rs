//! Operands are read from left to right: what a later one calls or assigns does not change an earlier one.

use crate::expression::{Kind, Lowering, Operand};
use crate::place::Place;
use takt_ir::Inst;
use takt_syntax::tree::{Expr, ExprKind};

impl Lowering<'_, '_> {
    /// A scalar operand read now, before `next` is evaluated.
    pub(crate) fn settled(&mut self, a: Operand, next: &Expr) -> Operand {
        let Kind::Place(place) = &a.kind else { return a };
        let Some(class) = self.c.register(a.ty) else { return a };
        let local = match place {
            Place::Register(_) if !assigns(next) => return a,
            Place::Register(src) => {
                let (dst, src) = (self.b.local(class), *src);
                self.b.push(Inst::Copy { dst, src });
                dst
            }
            _ => self.value(&a),
        };
        self.exact(local, a.ty, a.span)
    }
}

/// Whether an assignment stands in the expression. Only that can change a variable that has no address.
fn assigns(e: &Expr) -> bool {
    match &e.kind {
        ExprKind::Assign(..) => true,
        ExprKind::Member(a, _) | ExprKind::Part(a, _) | ExprKind::Deref(a) | ExprKind::Unary(_, a) => assigns(a),
        ExprKind::Binary(_, a, b) => assigns(a) || assigns(b),
        ExprKind::Index(a, indices) => assigns(a) || indices.iter().any(assigns),
        ExprKind::Call(a, args) => assigns(a) || args.iter().filter_map(|arg| arg.value.as_ref()).any(assigns),
        _ => false,
    }
}
