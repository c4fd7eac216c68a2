//! Functions of numbers and bits: SQRT, ABS, SHL, TRUNC, BCD.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand};
use crate::operator::{Class, is_unsigned_64};
use crate::types::elementary;
use takt_abi::Elem;
use takt_ir::Op;
use takt_syntax::Span;

impl Lowering<'_, '_> {
    pub(super) fn real_function(&mut self, name: &str, single: Op, double: Op, a: Operand, span: Span) -> Operand {
        let real = match self.class(a.ty) {
            Class::Real(Elem::Real) => Elem::Real,
            Class::Real(_) | Class::Int(_) => Elem::Lreal,
            _ => return self.refuse(name, &a, span),
        };
        let ty = self.c.elem(real);
        let a = self.as_real(a, ty);
        let result = self.fold_or_emit(if real == Elem::Real { single } else { double }, &[&a], ty, span);
        Operand { exact: true, ..result }
    }

    pub(super) fn atan2(&mut self, mut operands: Vec<Operand>, span: Span) -> Operand {
        let (y, x) = (operands.remove(0), operands.remove(0));
        for operand in [&y, &x] {
            if !matches!(self.class(operand.ty), Class::Real(_) | Class::Int(_)) {
                return self.refuse("ATAN2", operand, span);
            }
        }
        let single = self.class(y.ty) == Class::Real(Elem::Real) && self.class(x.ty) == Class::Real(Elem::Real);
        let ty = self.c.elem(if single { Elem::Real } else { Elem::Lreal });
        let (y, x) = (self.as_real(y, ty), self.as_real(x, ty));
        let result = self.fold_or_emit(if single { Op::Atan2F32 } else { Op::Atan2F64 }, &[&y, &x], ty, span);
        Operand { exact: true, ..result }
    }

    pub(super) fn abs(&mut self, a: Operand, span: Span) -> Operand {
        match self.class(a.ty) {
            Class::Int(e) if is_unsigned_64(e) => a,
            Class::Int(_) => {
                let flex = a.flex;
                let result = self.fold_or_emit(Op::Abs, &[&a], a.ty, span);
                let result = Operand { flex, ..result };
                self.computed(result)
            }
            Class::Real(e) => {
                let result = self.fold_or_emit(if e == Elem::Real { Op::AbsF32 } else { Op::AbsF64 }, &[&a], a.ty, span);
                Operand { exact: true, ..result }
            }
            _ => self.refuse("ABS", &a, span),
        }
    }

    pub(super) fn shift(&mut self, name: &str, mut operands: Vec<Operand>, span: Span) -> Operand {
        let (value, count) = (operands.remove(0), operands.remove(0));
        let Class::Int(e) = self.class(value.ty) else { return self.refuse(name, &value, span) };
        if !matches!(self.class(count.ty), Class::Int(_)) {
            return self.refuse(name, &count, span);
        }
        let (flex, e) = (value.flex, shifted_as(name, &value).unwrap_or(e));
        let value = if flex { Operand { ty: self.c.elem(e), ..value } } else { value };
        let lint = self.c.elem(Elem::Lint);
        let width = self.constant(Value::Int((takt_ir::elem_size(e) * 8).into()), lint, span);
        let ty = value.ty;
        let value = self.own_range(value);
        let signed = matches!(e, Elem::Sint | Elem::Int | Elem::Dint | Elem::Lint);
        let result = match name {
            "SHL" => self.fold_or_emit(Op::Shl, &[&value, &count], ty, span),
            "SHR" if signed => self.fold_or_emit(Op::ShrS, &[&value, &count, &width], ty, span),
            "SHR" => self.fold_or_emit(Op::ShrU, &[&value, &count], ty, span),
            "ROL" => self.fold_or_emit(Op::Rol, &[&value, &count, &width], ty, span),
            _ => self.fold_or_emit(Op::Ror, &[&value, &count, &width], ty, span),
        };
        if let Kind::Const(Value::Int(v)) = result.kind {
            return Operand { flex, ..self.constant(Value::Int(crate::constant::cut(v, e)), ty, span) };
        }
        let local = self.value(&result);
        let local = self.cut(local, e, span);
        Operand { flex, ..self.exact(local, ty, span) }
    }

    /// The whole part of a REAL, cut to the integer type.
    pub(super) fn trunc(&mut self, name: &str, from: Option<Elem>, into: Elem, a: Operand, span: Span) -> Operand {
        let a = match from {
            Some(e) => {
                let ty = self.c.elem(e);
                self.convert(a, ty)
            }
            None => a,
        };
        if a.is_error() {
            return a;
        }
        let Class::Real(e) = self.class(a.ty) else { return self.refuse(name, &a, span) };
        let ty = self.c.elem(into);
        let whole = self.fold_or_emit(if e == Elem::Real { Op::CutF32 } else { Op::CutF64 }, &[&a], ty, span);
        match whole.kind {
            Kind::Const(Value::Int(v)) => self.constant(Value::Int(crate::constant::cut(v, into)), ty, span),
            _ => {
                let local = self.value(&whole);
                let local = self.cut(local, into, span);
                self.exact(local, ty, span)
            }
        }
    }

    /// An integer with its bytes in the other order.
    pub(super) fn byte_order(&mut self, name: &str, swaps: bool, a: Operand, span: Span) -> Operand {
        let Class::Int(e) = self.class(a.ty) else { return self.refuse(name, &a, span) };
        let (ty, size) = (a.ty, takt_ir::elem_size(e));
        if !swaps || size == 1 {
            return a;
        }
        let (word, byte) = (self.c.elem(Elem::Lword), self.c.elem(Elem::Usint));
        let a = self.explicit(Operand { flex: false, ..a }, word);
        let size = self.constant(Value::Int(size.into()), byte, span);
        let result = self.library_call("SWAP_BYTES", vec![a, size], span);
        self.explicit(result, ty)
    }

    /// Conversions to and from decimal digits of four bits each.
    pub(super) fn decimal(&mut self, name: &str, form: Decimal, a: Operand, span: Span) -> Operand {
        let (helper, word, from, into) = match form {
            Decimal::Decode(from, into) => ("LWORD_BCD_TO_ULINT", Elem::Lword, from, into),
            Decimal::Encode(from, into) => ("ULINT_TO_BCD_LWORD", Elem::Ulint, from, into),
        };
        if !matches!(self.class(a.ty), Class::Int(_)) {
            return self.refuse(name, &a, span);
        }
        let a = match from {
            Some(e) => {
                let ty = self.c.elem(e);
                self.convert(a, ty)
            }
            None => a,
        };
        let word = self.c.elem(word);
        let a = self.explicit(a, word);
        let result = self.library_function(helper, a, span);
        let ty = self.c.elem(into);
        self.explicit(result, ty)
    }

    pub(super) fn round(&mut self, a: Operand, span: Span) -> Operand {
        if !matches!(self.class(a.ty), Class::Real(_)) {
            return self.refuse("ROUND", &a, span);
        }
        let lint = self.c.elem(Elem::Lint);
        self.explicit(a, lint)
    }
}

/// The type that a literal is shifted as: in 64 bits, so that `SHL(1, 20)` is what it looks like; rotated, the smallest bit string that holds it.
fn shifted_as(name: &str, value: &Operand) -> Option<Elem> {
    let Kind::Const(Value::Int(v)) = value.kind else { return None };
    let rotated = matches!(name, "ROL" | "ROR");
    match v {
        _ if !value.flex => None,
        ..0 => Some(Elem::Lint),
        0..=0xFF if rotated => Some(Elem::Byte),
        0x100..=0xFFFF if rotated => Some(Elem::Word),
        0x1_0000..=0xFFFF_FFFF if rotated => Some(Elem::Dword),
        _ => Some(Elem::Lword),
    }
}

/// A function between numbers and decimal digits of four bits each.
#[derive(Debug, Clone, Copy)]
pub(super) enum Decimal {
    /// `WORD_BCD_TO_UINT`, `BCD_TO_UINT`: from digits.
    Decode(Option<Elem>, Elem),
    /// `UINT_TO_BCD_WORD`, `TO_BCD_WORD`: to digits.
    Encode(Option<Elem>, Elem),
}

impl Decimal {
    /// The function of that name.
    pub(super) fn find(name: &str) -> Option<Self> {
        let digits = |name: &str| elementary(name).filter(|e| matches!(e, Elem::Byte | Elem::Word | Elem::Dword | Elem::Lword));
        let number = |name: &str| elementary(name).filter(|e| matches!(e, Elem::Usint | Elem::Uint | Elem::Udint | Elem::Ulint));
        if let Some(into) = name.strip_prefix("BCD_TO_") {
            return Some(Self::Decode(None, number(into)?));
        }
        if let Some(into) = name.strip_prefix("TO_BCD_") {
            return Some(Self::Encode(None, digits(into)?));
        }
        if let Some((from, into)) = name.split_once("_BCD_TO_") {
            return Some(Self::Decode(Some(digits(from)?), number(into)?));
        }
        let (from, into) = name.split_once("_TO_BCD_")?;
        Some(Self::Encode(Some(number(from)?), digits(into)?))
    }
}

/// `TRUNC` (to DINT), `TRUNC_INT`, `LREAL_TRUNC_LINT`: the REAL type named, the integer type.
pub(super) fn truncation(name: &str) -> Option<(Option<Elem>, Elem)> {
    let integer = |name: &str| elementary(name).filter(|e| crate::types::is_integer(*e));
    if name == "TRUNC" {
        return Some((None, Elem::Dint));
    }
    if let Some(into) = name.strip_prefix("TRUNC_") {
        return Some((None, integer(into)?));
    }
    let (from, into) = name.split_once("_TRUNC_")?;
    let from = elementary(from).filter(|e| matches!(e, Elem::Real | Elem::Lreal))?;
    Some((Some(from), integer(into)?))
}
