//! What a simple name means.

use crate::constant::Value;
use crate::expression::{Lowering, Operand, Thing};
use crate::near::nearest;
use crate::place::Place;
use crate::scope::{Item, PouKind, Storage, key};
use crate::types::elementary;
use takt_abi::Elem;
use takt_ir::{Base, Type, TypeId};
use takt_syntax::tree::VarKind;
use takt_syntax::{Code, Span};

impl<'a> Lowering<'_, 'a> {
    pub(crate) fn name(&mut self, name: &str, span: Span) -> Thing {
        let Some(pou) = self.pou else { return self.global_thing(name, span) };
        let wanted = key(name);
        if self.declare_ahead(&wanted, span) {
            return Thing::Error;
        }
        if let Some((level, i)) = self.local(&wanted)
            && (level == 0 || !self.is_result(pou, &wanted))
        {
            return Thing::Value(self.variable(level, i, span));
        }
        if let (Some((ty, storage)), true) = (&self.result, self.is_result(pou, &wanted)) {
            let (ty, storage) = (*ty, storage.clone());
            return Thing::Value(self.stored(&storage, ty, span));
        }
        if let Some(thing) = self.own_member(&wanted, span) {
            return thing;
        }
        match self.levels.iter().find_map(|l| self.c.pous[l.pou].enumerators.get(&wanted).copied()) {
            Some((ty, value)) => Thing::Value(self.constant(Value::Int(value.into()), ty, span)),
            None => self.global_thing(name, span),
        }
    }

    /// Whether a name is that of the unit's result.
    pub(crate) fn is_result(&self, pou: usize, wanted: &str) -> bool {
        self.result.is_some() && key(&self.c.pous[pou].tree.name.text) == wanted
    }

    pub(crate) fn variable(&mut self, level: usize, i: usize, span: Span) -> Operand {
        let v = &self.c.pous[self.levels[level].pou].vars[i];
        let (ty, constant, in_out) = (v.ty, v.constant, v.kind == VarKind::InOut);
        if let Some(value) = v.value.clone() {
            return self.constant(value, ty, span);
        }
        if *self.c.types.get(ty) == Type::Error || constant && self.c.lacks_value(ty, v.decl) {
            return self.error(span);
        }
        let storage = self.storage_of(level, i);
        let mut operand = match (in_out, &storage) {
            (true, Storage::This(_) | Storage::Image(_)) => self.follow_in_out(&storage, ty, span),
            _ => self.stored(&storage, ty, span),
        };
        operand.dynamic = in_out;
        if constant {
            operand.fixed = Some("a constant");
        }
        operand
    }

    /// The operand of a variable that lies there.
    pub(crate) fn stored(&mut self, storage: &Storage, ty: TypeId, span: Span) -> Operand {
        let place = match storage {
            Storage::Image(offset) => Place::Memory { base: Base::Image, offset: *offset },
            Storage::Bit(offset, bit) => {
                let byte = Place::Memory { base: Base::Image, offset: *offset };
                let bit = self.c.types.intern(Type::Bit(*bit));
                self.bit_place(byte, bit).0
            }
            Storage::This(offset) => match self.this {
                Some(this) => Place::Memory { base: Base::Local(this), offset: *offset },
                None => Place::Memory { base: Base::Image, offset: takt_ir::NULL_ZONE },
            },
            Storage::Frame(offset) => Place::Memory { base: Base::Frame, offset: *offset },
            Storage::Register(local) => Place::Register(*local),
            Storage::Behind(address) => Place::Memory { base: Base::Local(*address), offset: 0 },
            Storage::Open(pointer, bounds) => Place::Open { pointer: *pointer, bounds: bounds.clone() },
            Storage::Nowhere => Place::Memory { base: Base::Image, offset: takt_ir::NULL_ZONE },
        };
        self.at(place, ty, span)
    }

    pub(crate) fn global_thing(&mut self, name: &str, span: Span) -> Thing {
        match self.c.global_name(name) {
            Some(item) => self.item(item, name, span),
            None => {
                if let Some(e) = elementary(name) {
                    return Thing::Type(self.c.elem(e));
                }
                if key(name) == "NULL" {
                    let ty = self.c.elem(Elem::Lword);
                    return Thing::Value(Operand { flex: true, ..self.constant(Value::Int(0), ty, span) });
                }
                if self.is_in_orphan() {
                    return Thing::Error;
                }
                let help = self.suggest(name);
                self.c.unknown_name(self.pou, name, span, help);
                Thing::Error
            }
        }
    }

    pub(crate) fn suggest(&mut self, name: &str) -> Option<String> {
        let seen: usize = self.levels.iter().map(|l| self.c.pous[l.pou].vars.len()).sum();
        if !self.c.may_compare(seen) {
            return None;
        }
        let seen = || self.levels.iter().flat_map(|l| &self.c.pous[l.pou].vars);
        match nearest(&key(name), seen().map(|v| key(&v.name))) {
            Some(found) => {
                let spelled = seen().find(|v| key(&v.name) == found).map_or(found, |v| v.name.clone());
                Some(format!("did you mean `{spelled}`?"))
            }
            None => {
                let wanted = key(name);
                let list = self.c.lists.iter().find(|list| list.vars.contains_key(&wanted));
                list.map(|list| format!("write `{}.{name}`", list.name)).or_else(|| self.c.suggest(name, false))
            }
        }
    }

    pub(crate) fn item(&mut self, item: Item, name: &str, span: Span) -> Thing {
        match item {
            Item::Global(i) => Thing::Value(self.global(i, span)),
            Item::Pou(i) => self.pou_thing(i, span),
            Item::Type(i) => {
                let ty = self.c.declared[i].ty;
                ty.map_or(Thing::Error, Thing::Type)
            }
            Item::Interface(i) => Thing::Type(self.c.interfaces[i].ty),
            Item::Ready(ty) | Item::NativeBlock(ty) => Thing::Type(ty),
            Item::NativeFunction(desc) => Thing::Native(desc),
            Item::List(i) => Thing::List(i),
            Item::Library | Item::Sources | Item::Namespace(_) => Thing::Space(item),
            Item::Enumerator(ty, value) => Thing::Value(self.constant(Value::Int(value.into()), ty, span)),
            Item::Member(declared, member) => self.declared_member(declared, member, span),
            Item::Ambiguous => {
                self.report(Code::DuplicateName, span, format!("`{name}` is declared in several lists or enumerations")).help =
                    Some("write the list's or type's name before it".into());
                Thing::Error
            }
        }
    }

    pub(crate) fn declared_member(&mut self, declared: usize, member: usize, span: Span) -> Thing {
        let ty = self.c.resolve_declared(declared, span);
        let Type::Enum(e) = self.c.types.get(ty) else { return Thing::Error };
        let Some((_, value)) = e.members.get(member) else { return Thing::Error };
        let value = Value::Int((*value).into());
        Thing::Value(self.constant(value, ty, span))
    }

    pub(crate) fn pou_thing(&mut self, i: usize, span: Span) -> Thing {
        self.c.resolve_pou(i, span);
        match self.c.pous[i].tree.kind {
            PouKind::FunctionBlock => Thing::Type(self.c.pou_type(i)),
            PouKind::Function | PouKind::Method | PouKind::Action => Thing::Function(i),
            PouKind::Program => {
                let ty = self.c.pou_type(i);
                let offset = self.c.pous[i].instance.max(takt_ir::NULL_ZONE);
                Thing::Value(self.at(Place::Memory { base: Base::Image, offset }, ty, span))
            }
        }
    }

    pub(crate) fn global(&mut self, i: usize, span: Span) -> Operand {
        self.c.resolve_global(i);
        self.c.lay_out_library_global(i);
        let Some(var) = &self.c.globals[i].var else { return self.error(span) };
        let (ty, value, storage, constant) = (var.ty, var.value.clone(), var.storage.clone(), var.constant);
        // What was wrong with a constant has been said where it is declared.
        let failed = constant && value.is_none() && var.init.is_some() && self.c.folds(ty);
        if failed || *self.c.types.get(ty) == Type::Error {
            return self.error(span);
        }
        if let Some(value) = value {
            return self.constant(value, ty, span);
        }
        if constant && self.c.lacks_value(ty, self.c.globals[i].decl) {
            return self.error(span);
        }
        let mut operand = self.stored(&storage, ty, span);
        if constant {
            operand.fixed = Some("a constant");
        }
        operand
    }
}
