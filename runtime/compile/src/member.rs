//! `a.b`: members of structures, blocks, enumerations, lists, libraries and namespaces.

use crate::constant::Value;
use crate::expression::{BLOCK_OUTPUT, BLOCK_VARIABLE, Kind, Lowering, Operand, Thing};
use crate::near::nearest;
use crate::place::Place;
use crate::scope::{Item, Owner, key, same};
use takt_abi::Section;
use takt_ir::{StructKind, Type, TypeId};
use takt_syntax::tree::{Expr, ExprKind, Name, Part};
use takt_syntax::{Code, Span};

impl<'a> Lowering<'_, 'a> {
    pub(crate) fn enumerator(&mut self, ty: TypeId, member: &Name) -> Thing {
        let Type::Enum(e) = self.c.types.get(ty) else {
            let name = self.type_name(ty);
            if *self.c.types.get(ty) != Type::Error {
                let help = matches!(self.c.types.get(ty), Type::Struct(_) | Type::Interface(_))
                    .then(|| format!("`{name}` is a type; declare a variable of it, and write that before the dot"));
                self.report(Code::UnknownMember, member.span, format!("the type `{name}` has no member `{}`", member.text)).help = help;
            }
            return Thing::Error;
        };
        match e.members.iter().find(|(n, _)| same(n, &member.text)) {
            Some((_, value)) => {
                let value = Value::Int((*value).into());
                Thing::Value(self.constant(value, ty, member.span))
            }
            None => {
                let near = nearest(&key(&member.text), e.members.iter().map(|(n, _)| key(n)));
                let name = e.name.clone();
                self.report(Code::UnknownMember, member.span, format!("`{name}` has no member `{}`", member.text)).help =
                    near.map(|n| format!("did you mean `{n}`?"));
                Thing::Error
            }
        }
    }

    pub(crate) fn member(&mut self, base: &'a Expr, member: &Name, span: Span) -> Thing {
        if let ExprKind::Deref(inner) = &base.kind
            && inner.kind == ExprKind::Super
        {
            return match self.super_instance(base.span) {
                Some(operand) => self.field(operand, member, span),
                None => Thing::Error,
            };
        }
        match self.thing(base) {
            Thing::Value(operand) => self.field(operand, member, span),
            Thing::List(list) => match self.c.lists[list].vars.get(&key(&member.text)).copied() {
                Some(i) => Thing::Value(self.global(i, span)),
                None => {
                    let near = nearest(&key(&member.text), self.c.lists[list].vars.keys().cloned());
                    let near = near.map(|n| self.c.lists[list].vars[&n]).map(|i| self.c.globals[i].decl.name.text.clone());
                    let name = self.c.lists[list].name.clone();
                    self.report(Code::UnknownMember, member.span, format!("the list `{name}` has no variable `{}`", member.text)).help =
                        near.map(|n| format!("did you mean `{n}`?"));
                    Thing::Error
                }
            },
            Thing::Type(ty) => self.enumerator(ty, member),
            Thing::Space(space) => {
                let library = if let ExprKind::Name(library) = &base.kind { library } else { "" };
                match self.c.item_in(space, library, &member.text) {
                    Some(item) => self.item(item, &member.text, span),
                    None => {
                        let what = if let Item::Library | Item::Sources = space { "library" } else { "namespace" };
                        self.report(Code::UnknownMember, member.span, format!("the {what} has no `{}`", member.text));
                        Thing::Error
                    }
                }
            }
            Thing::Error => Thing::Error,
            Thing::Function(_) | Thing::Native(_) | Thing::Member(_) => {
                self.report(Code::UnknownMember, member.span, format!("a function has no member `{}`", member.text));
                Thing::Error
            }
        }
    }

    pub(crate) fn field(&mut self, operand: Operand, member: &Name, span: Span) -> Thing {
        if operand.is_error() {
            return Thing::Error;
        }
        let wanted = key(&member.text);
        if let Some(thing) = self.member_thing(&operand, &wanted) {
            return thing;
        }
        let Type::Struct(structure) = self.c.types.get(operand.ty) else {
            return match self.bit_number(&operand, member) {
                Some(bit) => Thing::Value(self.part_of(operand, Part::Bit(bit), span)),
                None => self.no_member(&operand, member),
            };
        };
        let (kind, found) = (structure.kind, structure.fields.iter().find(|f| same(&f.name, &member.text)).cloned());
        let unit = self.c.pou_of_type.get(&operand.ty).copied();
        let constant = unit.and_then(|unit| {
            let var = self.c.bases(unit).find_map(|b| self.c.pous[b].index.get(&wanted).map(|i| &self.c.pous[b].vars[*i]))?;
            Some((var.value.clone()?, var.ty))
        });
        if let Some((value, ty)) = constant {
            return Thing::Value(self.constant(value, ty, span));
        }
        if let (None, Some(value)) = (&found, unit.and_then(|unit| self.fixed_member(unit, &wanted, member.span))) {
            return Thing::Value(value);
        }
        let Some(field) = found else { return self.no_member(&operand, member) };
        // A block sees all of its own type and of what it extends: `THIS^.x`.
        let related = |unit: usize| self.block().is_some_and(|c| self.c.is_a(c, Owner::Pou(unit)) || self.c.is_a(unit, Owner::Pou(c)));
        let foreign = kind == StructKind::Block && !unit.is_some_and(related);
        if foreign && field.section == Section::InOut {
            let message = format!("`{}` is a VAR_IN_OUT of the block and cannot be used from outside", member.text);
            self.report(Code::NotAccessible, member.span, message);
            return Thing::Error;
        }
        if *self.c.types.get(field.ty) == Type::Error {
            return Thing::Error;
        }
        let Kind::Place(place) = operand.kind else { return Thing::Error };
        if field.section == Section::InOut
            && let Place::Memory { base, offset } = place.inside(field.offset)
        {
            return Thing::Value(Operand { dynamic: true, ..self.in_out_at(base, offset, field.ty, span) });
        }
        let (place, ty) = self.bit_place(place.inside(field.offset), field.ty);
        let mut value = self.at(place, ty, span);
        // CODESYS refuses to assign an output from outside, and lets the members of a structure there be assigned.
        value.fixed = operand.fixed.filter(|why| kind == StructKind::Block || *why != BLOCK_OUTPUT);
        match field.section {
            Section::Output if foreign => value.fixed = Some(BLOCK_OUTPUT),
            Section::State if foreign => value.fixed = Some(BLOCK_VARIABLE),
            _ => {}
        }
        Thing::Value(value)
    }

    /// `flags.READY` with a constant READY: the number of the bit.
    pub(crate) fn bit_number(&mut self, operand: &Operand, member: &Name) -> Option<u32> {
        self.scalar(operand.ty).filter(|e| crate::types::is_integer(*e))?;
        let known = self.local(&key(&member.text)).is_some() || self.c.global_name(&member.text).is_some();
        match known.then(|| self.name(&member.text, member.span))? {
            Thing::Value(Operand { kind: Kind::Const(Value::Int(bit)), .. }) => u32::try_from(bit).ok(),
            _ => None,
        }
    }

    pub(crate) fn no_member(&mut self, operand: &Operand, member: &Name) -> Thing {
        if self.c.pou_of_type.get(&operand.ty).is_some_and(|unit| self.c.is_orphan(*unit)) {
            return Thing::Error;
        }
        let name = self.type_name(operand.ty);
        let help = match self.c.types.get(operand.ty) {
            Type::Struct(_) | Type::Interface(_) => {
                let known = self.member_names(operand.ty);
                nearest(&key(&member.text), known.iter().map(|n| key(n)))
                    .and_then(|n| known.iter().find(|k| key(k) == n).map(|k| format!("did you mean `{k}`?")))
            }
            Type::Pointer(_) => Some(format!("follow the pointer first: `^.{}`", member.text)),
            _ => None,
        };
        self.report(Code::UnknownMember, member.span, format!("`{name}` has no member `{}`", member.text)).help = help;
        Thing::Error
    }
}
