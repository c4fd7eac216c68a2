//! Conversions by name: `INT_TO_REAL`, `TO_STRING`, `WSTRING_TO_DT`.
//!
//! Between scalars they are operators; to and from texts they call a function of the library, of which one per kind of value is enough: `INT_TO_WSTRING`
//! is `LINT_TO_STRING` and `STRING_TO_WSTRING`.

use crate::expression::{Lowering, Operand};
use crate::operator::{Class, is_unsigned_64};
use crate::scope::Item;
use crate::types::elementary;
use takt_abi::Elem;
use takt_ir::{Op, Type, TypeId};
use takt_syntax::{Code, Span};

/// A side of a conversion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    Elem(Elem),
    Text,
    Wide,
}

fn target(name: &str) -> Option<Target> {
    match name {
        "STRING" => Some(Target::Text),
        "WSTRING" => Some(Target::Wide),
        "BIT" => Some(Target::Elem(Elem::Bool)),
        _ => elementary(name).map(Target::Elem),
    }
}

/// `INT_TO_REAL`, `TO_REAL`, `ANY_TO_REAL`: the types named.
pub(super) fn conversion(name: &str) -> Option<(Option<Target>, Target)> {
    if let Some(to) = name.strip_prefix("ANY_").unwrap_or(name).strip_prefix("TO_") {
        return Some((None, target(to)?));
    }
    let (from, to) = name.split_once("_TO_")?;
    Some((Some(target(from)?), target(to)?))
}

/// The library's function to text for a kind of value, and what it takes.
fn to_text(class: Class) -> Option<(&'static str, Elem)> {
    Some(match class {
        Class::Bool => ("BOOL_TO_STRING", Elem::Bool),
        Class::Int(e) if is_unsigned_64(e) => ("ULINT_TO_STRING", Elem::Ulint),
        Class::Int(_) => ("LINT_TO_STRING", Elem::Lint),
        Class::Char(Elem::Char) => ("CHAR_TO_STRING", Elem::Char),
        Class::Char(_) => ("WCHAR_TO_STRING", Elem::Wchar),
        Class::Pointer => ("ULINT_TO_STRING", Elem::Ulint),
        Class::Real(Elem::Real) => ("REAL_TO_STRING", Elem::Real),
        Class::Real(_) => ("LREAL_TO_STRING", Elem::Lreal),
        Class::Duration(Elem::Time) => ("TIME_TO_STRING", Elem::Time),
        Class::Duration(_) => ("LTIME_TO_STRING", Elem::Ltime),
        Class::Moment(e) => match e {
            Elem::Date => ("DATE_TO_STRING", e),
            Elem::Ldate => ("LDATE_TO_STRING", e),
            Elem::Tod => ("TOD_TO_STRING", e),
            Elem::Ltod => ("LTOD_TO_STRING", e),
            Elem::Ldt => ("LDT_TO_STRING", e),
            _ => ("DT_TO_STRING", Elem::Dt),
        },
        Class::Text | Class::Wide | Class::Other => return None,
    })
}

/// The library's function from text to a type.
fn from_text(e: Elem) -> &'static str {
    match e {
        Elem::Real => "STRING_TO_REAL",
        Elem::Lreal => "STRING_TO_LREAL",
        Elem::Bool => "STRING_TO_BOOL",
        Elem::Time | Elem::Ltime => "STRING_TO_LTIME",
        Elem::Tod | Elem::Ltod => "STRING_TO_LTOD",
        Elem::Date | Elem::Ldate | Elem::Dt | Elem::Ldt => "STRING_TO_LDT",
        Elem::Char => "STRING_TO_CHAR",
        Elem::Wchar => "STRING_TO_WCHAR",
        _ => "STRING_TO_LINT",
    }
}

impl Lowering<'_, '_> {
    /// `X_TO_Y(a)` and `TO_Y(a)`.
    pub(super) fn named_conversion(&mut self, from: Option<Target>, to: Target, a: Operand, span: Span) -> Operand {
        let a = self.source(from, a);
        if a.is_error() {
            return a;
        }
        let a = Operand { span, ..a };
        match (self.class(a.ty), to) {
            (Class::Text, Target::Text) | (Class::Wide, Target::Wide) => a,
            (Class::Text, Target::Wide) => self.library_function("STRING_TO_WSTRING", a, span),
            (Class::Wide, Target::Text) => self.library_function("WSTRING_TO_STRING", a, span),
            (Class::Wide, Target::Elem(e)) => {
                let narrow = self.library_function("WSTRING_TO_STRING", a, span);
                self.value_of(narrow, e, span)
            }
            (Class::Text, Target::Elem(e)) => self.value_of(a, e, span),
            (Class::Other, _) => self.refuse("a conversion", &a, span),
            (_, Target::Elem(e)) => self.scalar_to(a, e, span),
            (_, Target::Text) => self.text_of(a, span),
            (_, Target::Wide) => {
                let narrow = self.text_of(a, span);
                self.library_function("STRING_TO_WSTRING", narrow, span)
            }
        }
    }

    /// The argument as the type that the function's name begins with.
    fn source(&mut self, from: Option<Target>, a: Operand) -> Operand {
        let text = matches!(self.class(a.ty), Class::Text | Class::Wide);
        match from {
            Some(Target::Elem(e)) => {
                let ty = self.c.elem(e);
                match a.flex {
                    true => self.flex_as(a, ty),
                    false if a.ty != ty => self.convert(a, ty),
                    false => a,
                }
            }
            Some(side) if text && (self.class(a.ty) == Class::Wide) == (side == Target::Wide) => a,
            Some(side) => {
                let name = if side == Target::Wide { "a conversion from WSTRING" } else { "a conversion from STRING" };
                let span = a.span;
                self.refuse(name, &a, span)
            }
            None => a,
        }
    }

    /// A literal given to `X_TO_Y` becomes an `X` if it can.
    fn flex_as(&mut self, a: Operand, ty: TypeId) -> Operand {
        match (self.class(a.ty), self.class(ty)) {
            (Class::Int(_) | Class::Real(_), Class::Int(_) | Class::Real(_)) => self.convert(a, ty),
            _ => self.explicit(a, ty),
        }
    }

    fn scalar_to(&mut self, a: Operand, e: Elem, span: Span) -> Operand {
        let ty = self.c.elem(e);
        if let (Class::Real(real), Elem::Bool) = (self.class(a.ty), e) {
            // Any number but 0, however small.
            let lreal = self.c.elem(Elem::Lreal);
            let a = if real == Elem::Lreal { a } else { self.explicit(a, lreal) };
            let zero = self.constant(crate::constant::Value::Real(0.0), lreal, span);
            let result = self.fold_or_emit(Op::NeF64, &[&a, &zero], ty, span);
            return Operand { exact: true, ..result };
        }
        let a = self.own_range(Operand { flex: false, ..a });
        let result = self.explicit(a, ty);
        Operand { flex: false, ty, ..result }
    }

    fn text_of(&mut self, a: Operand, span: Span) -> Operand {
        if self.c.spelled_enums.contains(&a.ty) {
            return self.enumerator_name(a, span);
        }
        self.digits_of(a, span)
    }

    /// The name of an enumerator; the number where it is none.
    fn enumerator_name(&mut self, a: Operand, span: Span) -> Operand {
        let Type::Enum(e) = self.c.types.get(a.ty).clone() else { return self.digits_of(a, span) };
        let word = self.exact_value(&a);
        let site = self.site(span);
        let mut choices = Vec::new();
        for (name, value) in &e.members {
            let text = name.clone().into_bytes();
            let ty = self.c.types.intern(Type::String(text.len() as u32));
            let number = self.b.int(*value);
            let hit = self.b.op(Op::Eq, &[word, number], site);
            choices.push((hit, self.constant(crate::constant::Value::Text(text), ty, span)));
        }
        let number = self.exact(word, a.ty, span);
        let other = self.digits_of(number, span);
        let ty = self.c.types.intern(Type::String(80));
        self.pick(&choices, &other, ty, span)
    }

    fn digits_of(&mut self, a: Operand, span: Span) -> Operand {
        let Some((name, elem)) = to_text(self.class(a.ty)) else { return self.refuse("conversion to STRING", &a, span) };
        let ty = self.c.elem(elem);
        let a = self.explicit(a, ty);
        self.library_function(name, a, span)
    }

    fn value_of(&mut self, a: Operand, e: Elem, span: Span) -> Operand {
        let result = self.library_function(from_text(e), a, span);
        let ty = self.c.elem(e);
        self.explicit(result, ty)
    }

    /// Calls a function of the library with one argument.
    pub(super) fn library_function(&mut self, name: &str, a: Operand, span: Span) -> Operand {
        self.library_call(name, vec![a], span)
    }

    /// Calls a function of the library.
    pub(super) fn library_call(&mut self, name: &str, operands: Vec<Operand>, span: Span) -> Operand {
        if operands.iter().any(Operand::is_error) {
            return self.error(span);
        }
        match self.c.library_names.get(name).copied() {
            Some(Item::NativeFunction(desc)) => self.native_with(desc, operands, span),
            _ => {
                self.report(Code::UnknownName, span, format!("no library of this project has `{name}`"));
                self.error(span)
            }
        }
    }
}
