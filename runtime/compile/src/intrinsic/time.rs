//! The typed functions of times and dates: ADD_TIME, SUB_DT_DT, MULTIME. They are the operators with their types written out.

use crate::expression::{Lowering, Operand};
use takt_abi::Elem::{self, Date, Dt, Ldate, Ldt, Ltime, Ltod, Time, Tod};
use takt_syntax::Span;
use takt_syntax::tree::BinaryOp::{self, Add, Div, Mul, Sub};

/// A function: its operator, type of the first operand, type of the second (`None`: any number).
pub(super) type Form = (BinaryOp, Elem, Option<Elem>);

const FORMS: &[(&str, Form)] = &[
    ("ADD_TIME", (Add, Time, Some(Time))),
    ("ADD_LTIME", (Add, Ltime, Some(Ltime))),
    ("ADD_TOD_TIME", (Add, Tod, Some(Time))),
    ("ADD_LTOD_LTIME", (Add, Ltod, Some(Ltime))),
    ("ADD_DT_TIME", (Add, Dt, Some(Time))),
    ("ADD_LDT_LTIME", (Add, Ldt, Some(Ltime))),
    ("SUB_TIME", (Sub, Time, Some(Time))),
    ("SUB_LTIME", (Sub, Ltime, Some(Ltime))),
    ("SUB_DATE_DATE", (Sub, Date, Some(Date))),
    ("SUB_LDATE_LDATE", (Sub, Ldate, Some(Ldate))),
    ("SUB_TOD_TIME", (Sub, Tod, Some(Time))),
    ("SUB_LTOD_LTIME", (Sub, Ltod, Some(Ltime))),
    ("SUB_TOD_TOD", (Sub, Tod, Some(Tod))),
    ("SUB_LTOD_LTOD", (Sub, Ltod, Some(Ltod))),
    ("SUB_DT_TIME", (Sub, Dt, Some(Time))),
    ("SUB_LDT_LTIME", (Sub, Ldt, Some(Ltime))),
    ("SUB_DT_DT", (Sub, Dt, Some(Dt))),
    ("SUB_LDT_LDT", (Sub, Ldt, Some(Ldt))),
    ("MULTIME", (Mul, Time, None)),
    ("MUL_TIME", (Mul, Time, None)),
    ("MUL_LTIME", (Mul, Ltime, None)),
    ("DIVTIME", (Div, Time, None)),
    ("DIV_TIME", (Div, Time, None)),
    ("DIV_LTIME", (Div, Ltime, None)),
];

/// The function of that name.
pub(super) fn find(name: &str) -> Option<Form> {
    FORMS.iter().find(|(n, _)| *n == name).map(|(_, form)| *form)
}

impl Lowering<'_, '_> {
    pub(super) fn time_function(&mut self, (op, first, second): Form, operands: Vec<Operand>, span: Span) -> Operand {
        let mut two = operands.into_iter();
        let (Some(a), Some(b)) = (two.next(), two.next()) else { return self.error(span) };
        let ty = self.c.elem(first);
        let a = self.convert(a, ty);
        let b = match second {
            Some(e) => {
                let ty = self.c.elem(e);
                self.convert(b, ty)
            }
            None => b,
        };
        self.binary(op, a, b, span)
    }
}
