//! Conversions: implicit where a value meets its place, explicit by function.

use crate::constant::{Value, cut, range};
use crate::expression::{Kind, Lowering, Operand};
use crate::operator::{Class, is_unsigned_64};
use takt_abi::Elem;
use takt_ir::{Op, Type, TypeId};
use takt_syntax::Code;

impl Lowering<'_, '_> {
    /// Converts implicitly to the type of a place: silent without loss, a warning with, an error where there is no such conversion.
    pub(crate) fn convert(&mut self, a: Operand, to: TypeId) -> Operand {
        if a.is_error() || a.ty == to && !matches!(a.kind, Kind::Void) {
            return a;
        }
        if *self.c.types.get(to) == Type::Error {
            return self.error(a.span);
        }
        if matches!(a.kind, Kind::Void) {
            return self.mismatch(a, to);
        }
        match (self.class(a.ty), self.class(to)) {
            (Class::Int(from), Class::Int(into)) => self.int_to_int(a, from, into, to),
            (Class::Int(from), Class::Real(into)) => {
                let digits = if into == Elem::Real { 24 } else { 53 };
                let exact = takt_ir::elem_size(from) * 8 <= digits || a.flex || matches!(a.kind, Kind::Const(_));
                self.maybe_lossy(&a, to, exact);
                self.explicit(a, to)
            }
            (Class::Real(_), Class::Real(into)) => {
                self.maybe_lossy(&a, to, into == Elem::Lreal || a.flex);
                self.explicit(a, to)
            }
            (Class::Real(_), Class::Int(_)) => {
                self.maybe_lossy(&a, to, false);
                self.explicit(a, to)
            }
            (Class::Duration(from), Class::Duration(into)) => {
                self.maybe_lossy(&a, to, from == into || into == Elem::Ltime);
                self.explicit(a, to)
            }
            (Class::Text, Class::Text) | (Class::Wide, Class::Wide) => self.text_to_text(a, to),
            (Class::Pointer, Class::Pointer) => Operand { ty: to, ..a },
            (Class::Int(e), Class::Pointer) | (Class::Pointer, Class::Int(e))
                if takt_ir::elem_size(e) == 8 || matches!(a.kind, Kind::Const(Value::Int(0))) =>
            {
                Operand { ty: to, flex: false, ..a }
            }
            (Class::Char(x), Class::Char(y)) if x == y => Operand { ty: to, ..a },
            (Class::Bool, Class::Bool) => Operand { ty: to, ..a },
            (Class::Moment(x), Class::Moment(y)) if x == y => Operand { ty: to, ..a },
            _ => self.mismatch(a, to),
        }
    }

    fn mismatch(&mut self, a: Operand, to: TypeId) -> Operand {
        let (wanted, found, span) = (self.type_name(to), self.operand_name(&a), a.span);
        let help = match (self.class(a.ty), self.class(to)) {
            (Class::Other, _) | (_, Class::Other) => None,
            _ if matches!(a.kind, Kind::Void) => None,
            _ => Some(format!("convert it: `{}_TO_{}(…)`", short(&self.type_name(a.ty)), short(&wanted))),
        };
        self.report(Code::TypeMismatch, span, format!("expected `{wanted}`, found {found}")).help = help;
        self.error(span)
    }

    fn maybe_lossy(&mut self, a: &Operand, to: TypeId, exact: bool) {
        if exact {
            return;
        }
        let (wanted, found) = (self.type_name(to), self.type_name(a.ty));
        let code = if self.c.options.strict { Code::TypeMismatch } else { Code::LossyConversion };
        let help = format!("say it is meant: `{}_TO_{}(…)`", short(&found), short(&wanted));
        self.report(code, a.span, format!("`{found}` becomes `{wanted}`, which may lose information")).help = Some(help);
    }

    fn int_to_int(&mut self, a: Operand, from: Elem, into: Elem, to: TypeId) -> Operand {
        let (low, high) = match self.c.types.get(to) {
            Type::Subrange { low, high, .. } => (*low, *high),
            _ => range(into),
        };
        if let Kind::Const(Value::Int(v)) = a.kind {
            let subrange = matches!(self.c.types.get(to), Type::Subrange { .. });
            if !(low..=high).contains(&v) {
                let name = self.type_name(to);
                if a.flex || subrange {
                    self.report(Code::OutOfRange, a.span, format!("{v} does not fit `{name}` ({low}..{high})"));
                    return self.error(a.span);
                }
                self.report(Code::ConstantOverflow, a.span, format!("{v} does not fit `{name}` and is cut to {}", cut(v, into)));
            }
            return self.constant(Value::Int(cut(v, into)), to, a.span);
        }
        let (fl, fh) = range(from);
        let fits = low <= fl && high >= fh;
        self.maybe_lossy(&a, to, fits);
        if matches!(a.kind, Kind::Place(_)) {
            // read as what it is: its place has another width than the type it becomes
            let local = self.value(&a);
            return Operand { exact: fits, ..self.exact(local, to, a.span) };
        }
        // The sum of two WORDs may exceed WORD until it is stored: what is computed in 64 bits stays uncut here.
        Operand { ty: to, exact: a.exact && fits, flex: false, ..a }
    }

    /// Converts by the meaning of `X_TO_Y`; both types are scalar.
    pub(crate) fn explicit(&mut self, a: Operand, to: TypeId) -> Operand {
        if a.is_error() || a.ty == to {
            return a;
        }
        let (Some(from), Some(into)) = (self.scalar(a.ty), self.scalar(to)) else { return self.mismatch(a, to) };
        let span = a.span;
        let real = |e| matches!(e, Elem::Real | Elem::Lreal);
        match (real(from), real(into)) {
            (true, true) if from == into => Operand { ty: to, ..a },
            (true, true) => {
                let op = if into == Elem::Lreal { Op::F32ToF64 } else { Op::F64ToF32 };
                self.real_to_real(op, a, to)
            }
            (true, false) => {
                let op = if from == Elem::Real { Op::RoundF32 } else { Op::RoundF64 };
                let whole = self.fold_or_emit(op, &[&a], to, span);
                self.limit_to(whole, into, to)
            }
            (false, true) => {
                let a = self.own_range(a);
                let op = match (is_unsigned_64(from), into == Elem::Real) {
                    (false, false) => Op::I64ToF64,
                    (false, true) => Op::I64ToF32,
                    (true, false) => Op::U64ToF64,
                    (true, true) => Op::U64ToF32,
                };
                let result = self.fold_or_emit(op, &[&a], to, span);
                Operand { exact: true, ..result }
            }
            (false, false) => {
                let a = self.own_range(a);
                let scaled = self.between_times(a, from, into, to);
                self.limit_to(scaled, into, to)
            }
        }
    }

    fn real_to_real(&mut self, op: Op, a: Operand, to: TypeId) -> Operand {
        if let Kind::Const(Value::Real(v)) = a.kind {
            let v = if op == Op::F64ToF32 { f64::from(v as f32) } else { v };
            return self.constant(Value::Real(v), to, a.span);
        }
        let result = self.fold_or_emit(op, &[&a], to, a.span);
        Operand { exact: true, ..result }
    }

    /// The operand within the range of its own type.
    fn own_range(&mut self, a: Operand) -> Operand {
        match (&a.kind, a.exact) {
            (Kind::Const(_), _) | (_, true) => a,
            _ => {
                let local = self.exact_value(&a);
                self.exact(local, a.ty, a.span)
            }
        }
    }

    /// The operand within the range of the type it is converted to.
    fn limit_to(&mut self, a: Operand, into: Elem, to: TypeId) -> Operand {
        let span = a.span;
        if let Kind::Const(Value::Int(v)) = a.kind {
            return self.constant(Value::Int(cut(v, into)), to, span);
        }
        let from = self.scalar(a.ty).map(range);
        if a.exact && a.ty != to && from.is_some_and(|(l, h)| range(into).0 <= l && range(into).1 >= h) {
            // read as what it is: its place is narrower than the type it becomes
            let local = self.value(&a);
            return self.exact(local, to, span);
        }
        let local = self.value(&a);
        let local = self.cut(local, into, span);
        self.exact(local, to, span)
    }

    /// Units change between TIME and LTIME and between kinds of dates; numbers stay.
    fn between_times(&mut self, a: Operand, from: Elem, into: Elem, to: TypeId) -> Operand {
        use Elem::*;
        const DAY: i64 = 86_400;
        let steps: &[(Op, i64)] = match (from, into) {
            (Time | Tod, Ltime | Ltod) => &[(Op::Mul, 1_000_000)],
            (Ltime, Time | Tod) => &[(Op::Div, 1_000_000)],
            (Ltod, Tod | Time) => &[(Op::DivU, 1_000_000)],
            (Dt, Ldate) => &[(Op::Div, DAY), (Op::Mul, DAY * 1_000_000_000)],
            (Dt | Date, Ldt | Ldate) => &[(Op::Mul, 1_000_000_000)],
            (Ldt | Ldate, Dt) | (Ldate, Date) => &[(Op::DivU, 1_000_000_000)],
            (Ldt, Date) => &[(Op::DivU, DAY * 1_000_000_000), (Op::Mul, DAY)],
            (Dt, Date) => &[(Op::Div, DAY), (Op::Mul, DAY)],
            (Dt, Tod) => &[(Op::Rem, DAY), (Op::Mul, 1000)],
            (Ldt, Ldate) => &[(Op::DivU, DAY * 1_000_000_000), (Op::Mul, DAY * 1_000_000_000)],
            (Ldt, Ltod) => &[(Op::RemU, DAY * 1_000_000_000)],
            (Ldt, Tod) => &[(Op::RemU, DAY * 1_000_000_000), (Op::DivU, 1_000_000)],
            (Dt, Ltod) => &[(Op::Rem, DAY), (Op::Mul, 1_000_000_000)],
            _ => return a,
        };
        let lint = self.c.elem(Lint);
        let mut a = a;
        for (op, unit) in steps {
            let span = a.span;
            let unit = self.constant(Value::Int((*unit).into()), lint, span);
            a = Operand { exact: false, ..self.fold_or_emit(*op, &[&a, &unit], to, span) };
        }
        a
    }
}

/// A type's name as it stands in the name of a conversion.
fn short(name: &str) -> &str {
    match name {
        "TIME_OF_DAY" => "TOD",
        "DATE_AND_TIME" => "DT",
        _ if name.starts_with("STRING") => "STRING",
        _ if name.starts_with("WSTRING") => "WSTRING",
        _ => name,
    }
}
