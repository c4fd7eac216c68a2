//! Functions that ask about a variable or type: ADR, SIZEOF, LOWER_BOUND, UPPER_BOUND.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand, Thing};
use takt_abi::Elem;
use takt_ir::Type;
use takt_syntax::tree::{Arg, Expr, ExprKind};
use takt_syntax::{Code, Span};

impl<'a> Lowering<'_, 'a> {
    pub(super) fn adr(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(value), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "`ADR` takes one variable");
            return self.error(span);
        };
        let operand = self.expr(value);
        self.address_of(operand, span)
    }

    pub(super) fn size_of(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(value), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "`SIZEOF` takes one variable or type");
            return self.error(span);
        };
        let ty = match &value.kind {
            ExprKind::Name(_) | ExprKind::Member(..) => match self.thing(value) {
                Thing::Type(ty) => ty,
                Thing::Value(operand) if !operand.is_error() => operand.ty,
                Thing::Value(_) | Thing::Error => return self.error(span),
                _ => {
                    self.report(Code::BadArgument, value.span, "`SIZEOF` takes one variable or type");
                    return self.error(span);
                }
            },
            _ => {
                let operand = self.expr(value);
                if operand.is_error() {
                    return operand;
                }
                operand.ty
            }
        };
        let size = self.c.types.size(ty);
        let udint = self.c.elem(Elem::Udint);
        Operand { flex: true, ..self.constant(Value::Int(size.into()), udint, span) }
    }

    pub(super) fn bound(&mut self, name: &str, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(array), .. }, Arg { value: Some(dimension), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, format!("`{name}` takes an array and the number of a dimension"));
            return self.error(span);
        };
        let array = self.expr(array);
        let dimension = self.dimension(dimension);
        let (Some(d), false) = (dimension, array.is_error()) else { return self.error(span) };
        let lower = name == "LOWER_BOUND";
        let dint = self.c.elem(Elem::Dint);
        match (self.c.types.get(array.ty), &array.kind) {
            (Type::Array { dims, .. }, _) if d <= dims.len() => {
                let (low, high) = dims[d - 1];
                self.constant(Value::Int(if lower { low } else { high }.into()), dint, span)
            }
            (_, Kind::Place(crate::place::Place::Open { bounds, .. })) if d <= bounds.len() => {
                let (low, high) = bounds[d - 1];
                self.temp(if lower { low } else { high }, dint, span)
            }
            _ => {
                let found = self.operand_name(&array);
                self.report(Code::NotIndexable, span, format!("{found} has no dimension {d}"));
                self.error(span)
            }
        }
    }

    pub(super) fn dimension(&mut self, e: &'a Expr) -> Option<usize> {
        let operand = self.expr(e);
        match operand.kind {
            Kind::Const(Value::Int(d)) if (1..=100).contains(&d) => Some(d as usize),
            Kind::Error => None,
            _ => {
                self.report(Code::NotConstant, e.span, "the number of a dimension is a constant from 1");
                None
            }
        }
    }
}
