//! Variables at addresses that overlap.

use super::Owner;
use crate::scope::Variable;
use crate::unit::Compiler;
use takt_ir::{Type, TypeId};
use takt_syntax::{Code, Note, Span};

/// Bits that a variable takes.
struct Taken {
    area: usize,
    from: u64,
    to: u64,
    is_bit: bool,
    ty: TypeId,
    name: String,
    span: Span,
}

impl<'a> Compiler<'a> {
    /// Warns of variables that share bytes and are not the same place, nor a bit inside of its byte or word.
    pub(super) fn warn_of_overlaps(&mut self, fixed: &[(Variable<'a>, Owner)]) {
        let mut taken: Vec<Taken> = fixed.iter().filter_map(|(var, _)| self.taken(var)).collect();
        taken.sort_by_key(|t| (t.area, t.from, std::cmp::Reverse(t.to), t.span.file, t.span.start));
        // Of those before, the one that reaches furthest; bits never reach behind what is longer.
        let mut furthest: Option<Taken> = None;
        for next in taken {
            let Some(before) = furthest.take().filter(|b| b.area == next.area && b.to > next.from) else {
                furthest = Some(next);
                continue;
            };
            let same = (before.from, before.to, before.ty) == (next.from, next.to, next.ty);
            let inside = next.is_bit && matches!(self.types.get(before.ty), Type::Elem(_) | Type::Enum(_) | Type::Subrange { .. });
            if !same && !inside {
                let message = format!("`{}` shares memory with `{}`", next.name, before.name);
                let diagnostic = self.report(Code::SharedAddress, next.span, message);
                diagnostic.notes.push(Note { span: before.span, message: "it lies here".into() });
                diagnostic.help = Some("give one of them another address, or declare both as one UNION".into());
            }
            furthest = Some(if next.to > before.to { next } else { before });
        }
    }

    fn taken(&self, var: &Variable<'a>) -> Option<Taken> {
        let address = self.fixed_address(var.decl)?;
        let at = var.decl.at.as_ref()?;
        let from = 8 * u64::from(address.byte) + u64::from(address.bit.unwrap_or(0));
        let bits = if address.bit.is_some() { 1 } else { 8 * u64::from(self.types.size(var.ty)) };
        let area = address.area as usize;
        let is_bit = address.bit.is_some();
        Some(Taken { area, from, to: from + bits, is_bit, ty: var.ty, name: var.name.clone(), span: at.span })
    }
}
