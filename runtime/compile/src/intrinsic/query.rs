//! Functions that ask about a variable or type: ADR, SIZEOF, LOWER_BOUND, UPPER_BOUND.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand, Thing};
use crate::place::Place;
use crate::types::elementary;
use takt_abi::Elem;
use takt_ir::{Inst, Local, Op, Type};
use takt_syntax::tree::{Arg, ExprKind};
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
                thing => {
                    // TIME and LTIME are functions too.
                    let elem = match (&thing, &value.kind) {
                        (Thing::Native(_), ExprKind::Name(name)) => elementary(name),
                        _ => None,
                    };
                    let Some(elem) = elem else {
                        self.report(Code::BadArgument, value.span, "`SIZEOF` takes one variable or type");
                        return self.error(span);
                    };
                    self.c.elem(elem)
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
        let dimension = self.expr(dimension);
        let lower = name == "LOWER_BOUND";
        if let (false, None) = (array.is_error(), constant_dimension(&dimension)) {
            return self.bound_at(lower, &array, &dimension, span);
        }
        let (Some(d), false) = (constant_dimension(&dimension), array.is_error()) else { return self.error(span) };
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

    /// The bound of a dimension whose number is only known when the program runs.
    fn bound_at(&mut self, lower: bool, array: &Operand, dimension: &Operand, span: Span) -> Operand {
        let usable = self.scalar(dimension.ty).is_some_and(crate::types::is_integer) && !matches!(dimension.kind, Kind::Const(_));
        let bounds: Vec<Local> = match (self.c.types.get(array.ty).clone(), &array.kind) {
            _ if dimension.is_error() => return self.error(span),
            (Type::Array { dims, .. }, _) if usable => dims.iter().map(|(l, h)| self.b.int(if lower { *l } else { *h })).collect(),
            (_, Kind::Place(Place::Open { bounds, .. })) if usable => bounds.iter().map(|(l, h)| if lower { *l } else { *h }).collect(),
            _ => {
                let found = self.operand_name(array);
                self.report(Code::NotIndexable, dimension.span, format!("{found} has no such dimension: they are numbered from 1"));
                return self.error(span);
            }
        };
        let index = self.value(dimension);
        let (low, high) = (self.b.int(1), self.b.int(bounds.len() as i64));
        let site = self.site(dimension.span);
        self.b.push(Inst::Check { index, low, high, site });
        let mut bounds = bounds.into_iter();
        let Some(mut result) = bounds.next() else { return self.error(span) };
        for (number, bound) in (2..).zip(bounds) {
            let number = self.b.int(number);
            let hit = self.b.op(Op::Eq, &[index, number], site);
            result = self.b.op(Op::Select, &[hit, bound, result], site);
        }
        let dint = self.c.elem(Elem::Dint);
        self.temp(result, dint, span)
    }
}

fn constant_dimension(operand: &Operand) -> Option<usize> {
    match operand.kind {
        Kind::Const(Value::Int(d)) if (1..=100).contains(&d) => Some(d as usize),
        _ => None,
    }
}
