//! The functions of strings, overloaded by the type of their arguments: `LEN` of a WSTRING is `WLEN`. CONCAT takes as many strings as there are.
//!
//! A library function is overloaded when the library also has one of its name with a `W` before it. Arguments may be named as in CODESYS (the
//! library's own names) or as in IEC 61131-3 (IN, IN1, L, P).

use crate::expression::{Lowering, Operand};
use crate::operator::Class;
use crate::scope::{Item, key};
use takt_abi::{FieldType, FnDesc};
use takt_syntax::Span;
use takt_syntax::tree::Arg;

/// The parameter of a string function that an argument's name means.
fn parameter(desc: &FnDesc, argument: &str) -> Option<usize> {
    let own = desc.params.iter().position(|p| key(p.name) == argument);
    own.or_else(|| match argument {
        "IN" => Some(0),
        "L" => Some(1),
        "P" => desc.params.len().checked_sub(1),
        _ => argument.strip_prefix("IN")?.parse::<usize>().ok()?.checked_sub(1),
    })
}

impl<'a> Lowering<'_, 'a> {
    /// Calls a native function that is overloaded for WSTRING; `None` if it is not.
    pub(crate) fn overloaded(&mut self, desc: &'static FnDesc, args: &'a [Arg], span: Span) -> Option<Operand> {
        let FieldType::String(_) = desc.params.first()?.ty else { return None };
        let Some(Item::NativeFunction(wide)) = self.c.library_names.get(&format!("W{}", key(desc.name))).copied() else { return None };
        let wanted = desc.params.len();
        let many = desc.name == "CONCAT";
        let named = |argument: &str, _| parameter(desc, argument);
        let most = if many { usize::MAX } else { wanted };
        let Some(mut operands) = self.arguments(desc.name, args, (wanted, most), &named, span) else { return Some(self.error(span)) };
        let desc = if operands.iter().any(|o| self.class(o.ty) == Class::Wide) { wide } else { desc };
        if !many {
            return Some(self.native_with(desc, operands, span));
        }
        let first = operands.remove(0);
        Some(operands.into_iter().fold(first, |a, b| if a.is_error() { a } else { self.native_with(desc, vec![a, b], span) }))
    }
}
