//! Literals and the types they take.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand};
use crate::scope::key;
use crate::types::elementary;
use takt_abi::Elem;
use takt_ir::Type;
use takt_syntax::tree::{Literal, LiteralValue, Name};
use takt_syntax::{Code, Span};

impl<'a> Lowering<'_, 'a> {
    pub(crate) fn literal(&mut self, literal: &Literal, span: Span) -> Operand {
        if let Some(name) = &literal.ty {
            return self.typed_literal(name, &literal.value, span);
        }
        let (value, elem) = match &literal.value {
            LiteralValue::Int(v) => (Value::Int(*v), int_type(*v)),
            LiteralValue::Real(v) => (Value::Real(*v), Elem::Lreal),
            LiteralValue::Bool(v) => (Value::Int(i128::from(*v)), Elem::Bool),
            LiteralValue::String(text) => {
                let ty = self.c.types.intern(Type::String((text.len() as u32).max(1)));
                return Operand { flex: true, ..self.constant(Value::Text(text.clone()), ty, span) };
            }
            LiteralValue::WString(text) => {
                let ty = self.c.types.intern(Type::WString((text.len() as u32).max(1)));
                return Operand { flex: true, ..self.constant(Value::Wide(text.clone()), ty, span) };
            }
            LiteralValue::Time(ns) => (Value::Int(ns / 1_000_000), Elem::Time),
            LiteralValue::Ltime(ns) => (Value::Int(*ns), Elem::Ltime),
            LiteralValue::Date(days) => (Value::Int(i128::from(*days) * 86_400), Elem::Date),
            LiteralValue::Ldate(days) => (Value::Int(i128::from(*days) * 86_400_000_000_000), Elem::Ldate),
            LiteralValue::Tod(ns) => (Value::Int(i128::from(*ns) / 1_000_000), Elem::Tod),
            LiteralValue::Ltod(ns) => (Value::Int((*ns).into()), Elem::Ltod),
            LiteralValue::Dt(ns) => (Value::Int(ns / 1_000_000_000), Elem::Dt),
            LiteralValue::Ldt(ns) => (Value::Int(*ns), Elem::Ldt),
        };
        let flex = matches!(literal.value, LiteralValue::Int(_) | LiteralValue::Real(_));
        let ty = self.c.elem(elem);
        if let (Value::Int(v), false) = (&value, flex) {
            let (low, high) = crate::constant::range(elem);
            if elem == Elem::Ltime && (high + 1..=i128::from(u64::MAX)).contains(v) {
                // Other controllers count up to here without a sign; the bits are the same.
                self.report(Code::ConstantOverflow, span, "`LTIME` ends at 292 years: a literal beyond it is negative here".to_string());
                return self.constant(Value::Int(i128::from(*v as u64 as i64)), ty, span);
            }
            if !(low..=high).contains(v) {
                let name = takt_ir::elem_name(elem);
                self.report(Code::OutOfRange, span, format!("this literal does not fit the type `{name}`"));
                return self.error(span);
            }
        }
        Operand { flex, ..self.constant(value, ty, span) }
    }

    pub(crate) fn typed_literal(&mut self, name: &Name, value: &LiteralValue, span: Span) -> Operand {
        let untyped = Literal { ty: None, value: value.clone() };
        let plain = self.literal(&untyped, span);
        let Some(elem) = elementary(&name.text) else {
            return match (key(&name.text).as_str(), value) {
                ("STRING", LiteralValue::String(_)) | ("WSTRING", LiteralValue::WString(_)) => plain,
                _ => {
                    self.report(Code::UnknownType, name.span, format!("`{}` is not an elementary type", name.text));
                    self.error(span)
                }
            };
        };
        let ty = self.c.elem(elem);
        let flex = match (elem, &plain.kind) {
            (Elem::Bool, Kind::Const(Value::Int(v @ (0 | 1)))) => return self.constant(Value::Int(*v), ty, span),
            (Elem::Char, Kind::Const(Value::Text(t))) if t.len() == 1 => return self.constant(Value::Int(t[0].into()), ty, span),
            (Elem::Wchar, Kind::Const(Value::Wide(t))) if t.len() == 1 => return self.constant(Value::Int(t[0].into()), ty, span),
            _ => plain,
        };
        let converted = self.convert(flex, ty);
        Operand { flex: false, ..converted }
    }
}

/// The smallest of the types that literals take by themselves.
fn int_type(v: i128) -> Elem {
    if i16::try_from(v).is_ok() {
        Elem::Int
    } else if i32::try_from(v).is_ok() {
        Elem::Dint
    } else if i64::try_from(v).is_ok() {
        Elem::Lint
    } else {
        Elem::Ulint
    }
}
