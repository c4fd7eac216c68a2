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
        if a.is_error() {
            return a;
        }
        if a.ty == to && !matches!(a.kind, Kind::Void) {
            return self.folded(a);
        }
        if *self.c.types.get(to) == Type::Error {
            return self.error(a.span);
        }
        if matches!(a.kind, Kind::Void) {
            return self.mismatch(a, to);
        }
        if let Some(done) = self.object_conversion(&a, to) {
            return done;
        }
        if self.c.strict_enums.contains(&to) {
            return self.mismatch(a, to);
        }
        let a = self.character(a, to);
        if a.ty == to {
            return a;
        }
        if let Some(checked) = self.check_range(&a, to) {
            return self.explicit(checked, to);
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
                if let (Kind::Const(Value::Real(v)), Elem::Real, true) = (&a.kind, into, a.flex && a.exceeds_real()) {
                    let v = *v;
                    self.report(Code::OutOfRange, a.span, format!("{v:?} does not fit `REAL` (up to {:?})", f32::MAX)).help =
                        Some("use LREAL".into());
                    return self.error(a.span);
                }
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
            (Class::Pointer, Class::Pointer) => {
                self.lint_pointer(&a, to);
                Operand { ty: to, ..a }
            }
            (Class::Int(e), Class::Pointer) | (Class::Pointer, Class::Int(e))
                if takt_ir::elem_size(e) == 8 || matches!(a.kind, Kind::Const(Value::Int(0))) =>
            {
                Operand { ty: to, flex: false, ..a }
            }
            (Class::Char(x), Class::Char(y)) if x == y => Operand { ty: to, ..a },
            (Class::Bool, Class::Bool) => Operand { ty: to, ..a },
            (Class::Int(_), Class::Bool) if a.is_bit() => Operand { ty: to, flex: false, ..a },
            (Class::Moment(x), Class::Moment(y)) if x == y => Operand { ty: to, ..a },
            _ => self.mismatch(a, to),
        }
    }

    /// A literal of one character, where a CHAR or WCHAR is needed.
    pub(crate) fn character(&mut self, a: Operand, to: TypeId) -> Operand {
        let unit: i128 = match (&a.kind, self.class(to)) {
            (Kind::Const(Value::Text(text)), Class::Char(Elem::Char)) if a.flex && text.len() == 1 => text[0].into(),
            (Kind::Const(Value::Wide(text)), Class::Char(Elem::Wchar)) if a.flex && text.len() == 1 => text[0].into(),
            _ => return a,
        };
        self.constant(Value::Int(unit), to, a.span)
    }

    /// As [`Lowering::convert`], for an operand beside others: what is computed in 64 bits stays so, folded or not.
    pub(crate) fn convert_operand(&mut self, a: Operand, to: TypeId) -> Operand {
        match (&a.kind, self.class(a.ty), self.class(to)) {
            _ if a.ty == to => a,
            (Kind::Const(Value::Int(v)), Class::Int(_), Class::Int(into)) if !a.flex && !(range(into).0..=range(into).1).contains(v) => {
                Operand { ty: to, exact: false, ..a }
            }
            _ => self.convert(a, to),
        }
    }

    /// A constant that was computed beyond its own type, cut to it.
    fn folded(&mut self, a: Operand) -> Operand {
        let (Kind::Const(Value::Int(v)), Some(e)) = (&a.kind, self.scalar(a.ty)) else { return a };
        let (v, (low, high)) = (*v, range(e));
        if (low..=high).contains(&v) {
            return a;
        }
        let name = self.type_name(a.ty);
        self.report(Code::ConstantOverflow, a.span, format!("{v} does not fit `{name}` and is cut to {}", cut(v, e)));
        self.constant(Value::Int(cut(v, e)), a.ty, a.span)
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
        self.maybe_lossy(&a, to, fits || a.flex);
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
            (true, false) if into == Elem::Bool => {
                let ty = self.c.elem(from);
                let zero = self.constant(Value::Real(0.0), ty, span);
                let op = if from == Elem::Real { Op::NeF32 } else { Op::NeF64 };
                let result = self.fold_or_emit(op, &[&a, &zero], to, span);
                Operand { exact: true, ..result }
            }
            (true, false) => {
                let op = if from == Elem::Real { Op::RoundF32 } else { Op::RoundF64 };
                let whole = self.fold_or_emit(op, &[&a], to, span);
                self.limit_to(whole, into, to)
            }
            (false, true) => {
                let a = self.own_range(a);
                if let Kind::Const(Value::Int(v)) = a.kind {
                    let v = if into == Elem::Real { f64::from(v as f32) } else { v as f64 };
                    return self.constant(Value::Real(v), to, span);
                }
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
    pub(crate) fn own_range(&mut self, a: Operand) -> Operand {
        match (&a.kind, a.exact) {
            (Kind::Const(Value::Int(v)), _) => match self.scalar(a.ty) {
                Some(e) if !a.flex => self.constant(Value::Int(cut(*v, e)), a.ty, a.span),
                _ => a,
            },
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

    /// Between times and dates what is meant stays: units change, DATE and LDATE are cut to the beginning of the day, TOD and LTOD of a date are
    /// what is left of the day. All else keeps its number.
    fn between_times(&mut self, a: Operand, from: Elem, into: Elem, to: TypeId) -> Operand {
        let (Some(unit), Some(target)) = (nanoseconds(from), nanoseconds(into)) else { return a };
        let unsigned = is_unsigned_64(from);
        let div = if unsigned { Op::DivU } else { Op::Div };
        let (is_day, is_clock) = (|e| matches!(e, Elem::Date | Elem::Ldate), |e| matches!(e, Elem::Tod | Elem::Ltod));
        let is_date = |e| is_day(e) || matches!(e, Elem::Dt | Elem::Ldt);
        let mut a = a;
        if is_day(into) && !is_day(from) {
            a = self.step(a, div, DAY / unit, to);
            return self.step(a, Op::Mul, DAY / target, to);
        }
        if is_clock(into) && is_date(from) {
            a = self.step(a, if unsigned { Op::RemU } else { Op::Rem }, DAY / unit, to);
        }
        if unit > target { self.step(a, Op::Mul, unit / target, to) } else { self.step(a, div, target / unit, to) }
    }

    fn step(&mut self, a: Operand, op: Op, by: i64, to: TypeId) -> Operand {
        if by == 1 {
            return a;
        }
        let (lint, span) = (self.c.elem(Elem::Lint), a.span);
        let by = self.constant(Value::Int(by.into()), lint, span);
        Operand { exact: false, ..self.fold_or_emit(op, &[&a, &by], to, span) }
    }
}

/// Nanoseconds of a day.
const DAY: i64 = 86_400_000_000_000;

/// Nanoseconds that the unit of a time or date has.
fn nanoseconds(e: Elem) -> Option<i64> {
    match e {
        Elem::Time | Elem::Tod => Some(1_000_000),
        Elem::Date | Elem::Dt => Some(1_000_000_000),
        Elem::Ltime | Elem::Ltod | Elem::Ldate | Elem::Ldt => Some(1),
        _ => None,
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
