//! Variables that nothing uses, values that nothing reads, results that nothing sets, names that hide others.

use super::Known;
use super::names::{CALLED, GIVEN, MEMBER, PART, READ, WRITTEN};
use crate::class::LIFE;
use crate::scope::{Item, Owner, PouKind, Variable, key};
use crate::unit::Compiler;
use takt_ir::{StructKind, Type, TypeId};
use takt_syntax::tree::{StmtKind, VarKind};
use takt_syntax::{Code, Span};

impl<'a> Compiler<'a> {
    /// Variables of a unit that are its own affair.
    pub(super) fn lint_variables(&mut self, pou: usize, known: &Known) {
        for i in 0..self.pous[pou].vars.len() {
            let v = &self.pous[pou].vars[i];
            if !matches!(v.kind, VarKind::Var | VarKind::Temp | VarKind::Stat | VarKind::Inst) {
                continue;
            }
            let wanted = key(&v.name);
            self.lint_use(pou, i, &wanted, known);
            self.lint_shadow(pou, i, &wanted);
        }
    }

    fn lint_use(&mut self, pou: usize, i: usize, wanted: &str, known: &Known) {
        let v = &self.pous[pou].vars[i];
        let meant = v.name.starts_with('_') || !v.decl.pragmas.is_empty() || v.decl.at.is_some() || !v.decl.fb_init.is_empty();
        if meant || !v.decl.fb_inits.is_empty() || self.constructs(v.ty) || self.is_kept(pou, v.span) {
            return;
        }
        let units = known.seen_by.get(&pou).map_or(&[][..], Vec::as_slice);
        let mut how = units.iter().filter_map(|unit| known.uses[*unit].get(wanted)).fold(0, |all, how| all | how) & !MEMBER;
        // What a call's own variables are called elsewhere does not matter.
        if !self.lives_for_a_call(pou, v) && known.members.contains(wanted) {
            how |= READ;
        }
        let (name, span) = (v.name.clone(), v.span);
        // What is assigned through a reference is somebody else's.
        let reads = READ | GIVEN | CALLED | if let Type::Reference(_) = self.types.get(v.ty) { WRITTEN } else { 0 };
        if how == 0 && self.stands_in_a_branch(&name, span) {
            return;
        }
        if how == 0 {
            self.report(Code::Unused, span, format!("`{name}` is never used")).help = Some(unused_help(&name));
        } else if how & reads == 0 && self.lives_for_a_call(pou, v) && (how & PART == 0 || self.is_plain(v.ty)) {
            self.report(Code::NeverRead, span, format!("`{name}` is assigned, and its value is never used")).help =
                Some(unused_help(&name));
        }
    }

    /// Whether a variable is RETAIN or PERSISTENT: what is kept may be there for others.
    fn is_kept(&self, pou: usize, span: Span) -> bool {
        let mut kept = self.pous[pou].tree.vars.iter().filter(|block| block.retain || block.persistent);
        kept.any(|block| block.vars.iter().any(|decl| decl.name.span == span))
    }

    /// Whether the name stands elsewhere in a file with conditional pragmas: what they exclude may use it.
    fn stands_in_a_branch(&self, name: &str, span: Span) -> bool {
        let text = &self.files[span.file.0 as usize].text;
        let excludes =
            text.match_indices('{').any(|(at, _)| text[at + 1..].trim_start().get(..2).is_some_and(|w| w.eq_ignore_ascii_case("IF")));
        let words = |c: char| !c.is_alphanumeric() && c != '_';
        excludes && text.split(words).filter(|word| word.eq_ignore_ascii_case(name)).count() > 1
    }

    /// Whether nobody sees the variable behind the end of the call.
    fn lives_for_a_call(&self, pou: usize, v: &Variable<'a>) -> bool {
        let function = matches!(self.pous[pou].tree.kind, PouKind::Function | PouKind::Method);
        v.kind == VarKind::Temp || function && v.kind == VarKind::Var
    }

    /// Whether writing a part of a variable writes nothing else.
    fn is_plain(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Elem(_) | Type::Subrange { .. } | Type::Enum(_) | Type::String(_) | Type::WString(_) => true,
            Type::Array { elem, .. } => self.is_plain(*elem),
            Type::Struct(s) => s.kind == StructKind::Struct && s.fields.iter().all(|field| self.is_plain(field.ty)),
            _ => false,
        }
    }

    fn lint_shadow(&mut self, pou: usize, i: usize, wanted: &str) {
        let v = &self.pous[pou].vars[i];
        let Some((first, what)) = self.hidden_member(pou, wanted).or_else(|| self.hidden_global(wanted)) else { return };
        let (name, span) = (v.name.clone(), v.span);
        let diagnostic = self.report(Code::Shadowed, span, format!("`{name}` hides {what} of the same name"));
        diagnostic.notes.push(takt_syntax::Note { span: first, message: "this one cannot be seen there".into() });
        diagnostic.help = Some("give one of them another name".into());
    }

    /// The variable of the block that a method's variable of that name hides.
    fn hidden_member(&self, pou: usize, wanted: &str) -> Option<(Span, &'static str)> {
        let Some(Owner::Pou(owner)) = self.pous[pou].owner else { return None };
        let hidden = self.bases(owner).find_map(|b| Some(&self.pous[b].vars[*self.pous[b].index.get(wanted)?]))?;
        (hidden.kind != VarKind::Temp).then_some((hidden.span, "a variable of the block"))
    }

    fn hidden_global(&self, wanted: &str) -> Option<(Span, &'static str)> {
        let Some(Item::Global(global)) = self.names.get(wanted) else { return None };
        Some((self.globals[*global].decl.name.span, "a global variable"))
    }

    /// A function that returns what nobody has set.
    pub(super) fn lint_result(&mut self, pou: usize, known: &Known) {
        let head = self.pous[pou].tree;
        let empty = head.body.iter().all(|s| matches!(s.kind, StmtKind::Empty));
        let name = key(&head.name.text);
        if self.pous[pou].result.is_none() || empty || head.modifiers.is_abstract || LIFE.contains(&name.as_str()) {
            return;
        }
        let how = known.uses[pou].get(&name).copied().unwrap_or(0);
        if how & (WRITTEN | PART | GIVEN) == 0 {
            let (name, span) = (&head.name.text, head.name.span);
            self.report(Code::NeverAssigned, span, format!("`{name}` never assigns its result")).help =
                Some(format!("write `{name} := …;`"));
        }
    }
}

fn unused_help(name: &str) -> String {
    format!("remove it; if it is meant to be there, call it `_{name}`")
}
