//! Inputs of type ANY and its kin: what is passed is a description of the variable (`__SYSTEM.AnyType`): its class of type, address and size.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand};
use crate::operator::Class;
use crate::place::Place;
use crate::scope::{Item, key};
use crate::unit::Compiler;
use takt_abi::Elem;
use takt_ir::{Base, Field, Inst, Local, Mem, Ty, Type, TypeId};
use takt_syntax::tree::{Arg, Expr, TypeExpr, TypeExprKind};
use takt_syntax::{Code, Span};

/// The generic types of IEC 61131-3 (6.4.3) that an input may have.
const GENERIC: [&str; 13] = [
    "ANY",
    "ANY_BIT",
    "ANY_CHAR",
    "ANY_CHARS",
    "ANY_DATE",
    "ANY_DERIVED",
    "ANY_DURATION",
    "ANY_ELEMENTARY",
    "ANY_INT",
    "ANY_MAGNITUDE",
    "ANY_NUM",
    "ANY_REAL",
    "ANY_STRING",
];

/// Whether a name is that of a generic type.
pub(crate) fn is_generic(name: &str) -> bool {
    GENERIC.iter().any(|known| known.eq_ignore_ascii_case(name))
}

impl<'a> Compiler<'a> {
    /// The type that describes a variable, as the library declares it.
    pub(crate) fn any_type(&mut self, span: Span) -> TypeId {
        match self.library_names.get("ANYTYPE").copied() {
            Some(Item::Type(declared)) => self.resolve_declared(declared, span),
            _ => {
                self.report(Code::UnknownType, span, "no library of this project has `__SYSTEM.AnyType`, which ANY needs");
                self.error_type()
            }
        }
    }
}

/// The generic type that a parameter is declared with.
pub(crate) fn generic(ty: &TypeExpr) -> Option<&str> {
    match &ty.kind {
        TypeExprKind::Named(parts) => parts.last().map(|name| name.text.as_str()).filter(|name| is_generic(name)),
        _ => None,
    }
}

impl<'a> Lowering<'_, 'a> {
    /// The generic type that an input of a block is declared with.
    pub(crate) fn generic_input(&self, block: TypeId, name: &str) -> Option<&'a str> {
        let pou = *self.c.pou_of_type.get(&block)?;
        let var = self.c.bases(pou).find_map(|b| self.c.pous[b].index.get(&key(name)).map(|i| &self.c.pous[b].vars[*i]))?;
        generic(&var.decl.ty)
    }

    /// The description of an argument: an address of [`Compiler::any_type`]. One that is a description already is handed on.
    pub(crate) fn describe(&mut self, wanted: &str, value: &'a Expr) -> Option<Local> {
        let operand = self.expr(value);
        if operand.is_error() {
            return None;
        }
        let any = self.c.any_type(value.span);
        if let (true, Kind::Place(place @ Place::Memory { .. })) = (operand.ty == any, &operand.kind) {
            return Some(self.address(&place.clone(), self.c.types.size(any)));
        }
        if matches!(operand.kind, Kind::Void) || !self.is_of(wanted, operand.ty) {
            let found = self.operand_name(&operand);
            self.report(Code::TypeMismatch, value.span, format!("expected a value of {wanted}, found {found}"));
            return None;
        }
        let pointer = self.described(&operand);
        let (size, align) = self.c.types.layout(any);
        let slot = self.b.slot(size, align);
        let Type::Struct(structure) = self.c.types.get(any).clone() else { return None };
        let class = self.b.int(self.type_class(operand.ty));
        let bytes = self.b.int(self.c.types.size(operand.ty).into());
        for field in &structure.fields {
            let (src, mem) = match field.name.as_str() {
                "pValue" => (pointer, Mem::I64),
                "diSize" => (bytes, Mem::I32),
                _ => (class, Mem::I16),
            };
            self.b.push(Inst::Store { src, mem, base: Base::Frame, offset: slot + field.offset });
        }
        Some(self.b.address(Base::Frame, slot, size))
    }

    /// Sets an input of a block to the description of an argument.
    pub(crate) fn set_description(&mut self, place: &Place, field: &Field, wanted: &str, value: &'a Expr) {
        let Place::Memory { base, offset } = place.inside(field.offset) else { return };
        if let Some(address) = self.describe(wanted, value) {
            let len = self.c.types.size(field.ty);
            self.b.push(Inst::Move { dst: base, dst_offset: offset, src: Base::Local(address), src_offset: 0, len });
        }
    }

    /// `__VARINFO(variable)`: what is known of a variable, as `__SYSTEM.VAR_INFO`.
    pub(crate) fn variable_info(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(value), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "`__VARINFO` takes one variable");
            return self.error(span);
        };
        let operand = self.expr(value);
        let info = match self.c.library_names.get("VAR_INFO").copied() {
            Some(Item::Type(declared)) => self.c.resolve_declared(declared, span),
            _ => self.c.error_type(),
        };
        let (Kind::Place(place @ Place::Memory { .. }), Type::Struct(structure)) = (&operand.kind, self.c.types.get(info).clone()) else {
            if !operand.is_error() {
                self.report(Code::BadArgument, value.span, "`__VARINFO` takes a variable that lies in memory");
            }
            return self.error(span);
        };
        let address = self.pointer_to(place);
        let (size, align) = self.c.types.layout(info);
        let slot = self.b.slot(size, align);
        let mut bytes = vec![0; size as usize];
        for field in &structure.fields {
            if let Some(known) = self.fact(&field.name, value, operand.ty) {
                self.c.store_value(&known, field.ty, &mut bytes[field.offset as usize..]);
            }
        }
        let data = self.pool(&bytes);
        self.b.push(Inst::Data { dst: Base::Frame, offset: slot, data, len: size });
        for field in structure.fields.iter().filter(|f| matches!(f.name.as_str(), "ByteAddress" | "ByteOffset")) {
            self.b.push(Inst::Store { src: address, mem: Mem::U32, base: Base::Frame, offset: slot + field.offset });
        }
        let mut result = self.at(Place::Memory { base: Base::Frame, offset: slot }, info, span);
        result.fixed = Some("a result");
        result
    }

    /// What is known of a variable at compile time, by the name of the member that tells it.
    fn fact(&self, name: &str, variable: &Expr, ty: TypeId) -> Option<Value> {
        let size = i128::from(self.c.types.size(ty)) * 8;
        let (count, elem) = match self.c.types.get(ty) {
            Type::Array { elem, .. } => (i128::from(self.c.types.size(ty) / self.c.types.size(*elem).max(1)), *elem),
            _ => (1, ty),
        };
        Some(match name {
            "BitSize" => Value::Int(size),
            "BitNr" => Value::Int(-1),
            "TypeClass" => Value::Int(self.type_class(ty).into()),
            "BaseTypeClass" => Value::Int(self.type_class(elem).into()),
            "NumElements" => Value::Int(count),
            "ElemBitSize" => Value::Int(size / count.max(1)),
            "TypeName" => Value::Text(self.type_name(ty).into_bytes()),
            "Symbol" => Value::Text(
                self.c.files[variable.span.file.0 as usize].text.get(variable.span.start as usize..variable.span.end as usize)?.into(),
            ),
            _ => return None,
        })
    }

    /// The address of a value; of one that is no variable, of a copy.
    fn described(&mut self, operand: &Operand) -> Local {
        if let Kind::Place(place @ Place::Memory { .. }) = &operand.kind {
            return self.pointer_to(place);
        }
        let (size, align) = self.c.types.layout(operand.ty);
        let offset = self.b.slot(size, align);
        let place = Place::Memory { base: Base::Frame, offset };
        self.assign_place(&place, operand.ty, Operand { flex: false, ..operand.clone() }, operand.span);
        let dst = self.b.local(Ty::I64);
        self.b.push(Inst::Pointer { dst, base: Base::Frame, offset });
        dst
    }

    fn is_of(&self, wanted: &str, ty: TypeId) -> bool {
        let class = self.class(ty);
        let (int, real) = (matches!(class, Class::Int(_)), matches!(class, Class::Real(_)));
        let bits = matches!(self.scalar(ty), Some(Elem::Bool | Elem::Byte | Elem::Word | Elem::Dword | Elem::Lword));
        let duration = matches!(class, Class::Duration(_));
        let text = matches!(class, Class::Text | Class::Wide);
        match wanted.to_uppercase().as_str() {
            "ANY_INT" => int && !bits,
            "ANY_REAL" => real,
            "ANY_NUM" => real || int && !bits,
            "ANY_MAGNITUDE" => real || duration || int && !bits,
            "ANY_BIT" => bits,
            "ANY_STRING" => text,
            "ANY_CHARS" => text || matches!(class, Class::Char(_)),
            "ANY_CHAR" => matches!(class, Class::Char(_)),
            "ANY_DATE" => matches!(class, Class::Moment(_)),
            "ANY_DURATION" => duration,
            "ANY_ELEMENTARY" => class != Class::Other,
            "ANY_DERIVED" => class == Class::Other,
            _ => true,
        }
    }

    /// `__SYSTEM.TYPE_CLASS` of a type.
    fn type_class(&self, ty: TypeId) -> i64 {
        match self.c.types.get(ty) {
            Type::Elem(e) => match e {
                Elem::Bool => 0,
                Elem::Byte => 2,
                Elem::Word => 3,
                Elem::Dword => 4,
                Elem::Lword => 5,
                Elem::Sint => 6,
                Elem::Int => 7,
                Elem::Dint => 8,
                Elem::Lint => 9,
                Elem::Usint => 10,
                Elem::Uint => 11,
                Elem::Udint => 12,
                Elem::Ulint => 13,
                Elem::Real => 14,
                Elem::Lreal => 15,
                Elem::Time => 18,
                Elem::Date => 19,
                Elem::Dt => 20,
                Elem::Tod => 21,
                Elem::Ltime => 37,
                Elem::Ldate => 41,
                Elem::Ldt => 42,
                Elem::Ltod => 43,
                Elem::Char => 44,
                Elem::Wchar => 45,
            },
            Type::Bit(_) => 1,
            Type::String(_) => 16,
            Type::WString(_) => 17,
            Type::Pointer(_) => 22,
            Type::Reference(_) => 23,
            Type::Subrange { .. } => 24,
            Type::Enum(_) => 25,
            Type::Array { .. } | Type::OpenArray { .. } => 26,
            Type::Struct(_) => 28,
            Type::Interface(_) => 40,
            Type::Error => 29,
        }
    }
}
