//! Strings: literals in memory, assignment with cutting, comparison.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand};
use crate::operator::{Class, int_op};
use crate::place::Place;
use takt_abi::Elem;
use takt_ir::{Base, Inst, Local, NativeId, Ty, Type, TypeId, text};
use takt_syntax::Span;
use takt_syntax::tree::BinaryOp;

impl Lowering<'_, '_> {
    /// A string for a place of another length: a literal is cut, a variable stays what it is.
    pub(crate) fn text_to_text(&mut self, a: Operand, to: TypeId) -> Operand {
        let (length, most) = match (&a.kind, self.c.types.get(to)) {
            (Kind::Const(Value::Text(t)), Type::String(n)) => (t.len(), *n as usize),
            (Kind::Const(Value::Wide(t)), Type::WString(n)) => (t.len(), *n as usize),
            _ => return a,
        };
        if length > most {
            let name = self.type_name(to);
            self.report(
                takt_syntax::Code::ConstantOverflow,
                a.span,
                format!("this text has {length} characters and `{name}` keeps {most}"),
            );
        }
        let kind = match a.kind {
            Kind::Const(Value::Text(t)) => Kind::Const(Value::Text(t[..length.min(most)].to_vec())),
            Kind::Const(Value::Wide(t)) => Kind::Const(Value::Wide(t[..length.min(most)].to_vec())),
            kind => kind,
        };
        Operand { kind, ty: to, flex: false, ..a }
    }

    /// Characters that a string type keeps.
    pub(crate) fn capacity(&self, ty: TypeId) -> u32 {
        match self.c.types.get(ty) {
            Type::String(n) | Type::WString(n) => *n,
            _ => 0,
        }
    }

    /// The bytes of a string constant with its NUL.
    fn text_bytes(value: &Value) -> Vec<u8> {
        match value {
            Value::Text(t) => t.iter().copied().chain([0]).collect(),
            Value::Wide(t) => t.iter().copied().chain([0]).flat_map(u16::to_le_bytes).collect(),
            _ => Vec::new(),
        }
    }

    /// Puts constant bytes into the pool.
    pub(crate) fn pool(&mut self, bytes: &[u8]) -> u32 {
        let data = &mut self.c.program.data;
        data.extend_from_slice(bytes);
        (data.len() - bytes.len()) as u32
    }

    /// So many bytes of 0, which others use too.
    pub(crate) fn zeros(&mut self, len: u32) -> u32 {
        let (at, known) = self.c.zeros;
        if len <= known {
            return at;
        }
        let data = &mut self.c.program.data;
        let at = data.len() as u32;
        data.resize(data.len() + len as usize, 0);
        self.c.zeros = (at, len);
        at
    }

    /// A string in memory: base, offset, capacity. A literal goes to the frame.
    pub(crate) fn text_place(&mut self, a: &Operand) -> (Base, u32, u32) {
        match &a.kind {
            Kind::Place(Place::Memory { base, offset }) => (*base, *offset, self.capacity(a.ty)),
            Kind::Const(value) => {
                let bytes = Self::text_bytes(value);
                let slot = self.b.slot(bytes.len() as u32, 2);
                let data = self.pool(&bytes);
                self.b.push(Inst::Data { dst: Base::Frame, offset: slot, data, len: bytes.len() as u32 });
                let unit = if matches!(value, Value::Wide(_)) { 2 } else { 1 };
                (Base::Frame, slot, (bytes.len() as u32 / unit).saturating_sub(1))
            }
            _ => (Base::Image, takt_ir::NULL_ZONE, 0),
        }
    }

    fn text_words(&mut self, base: Base, offset: u32, capacity: u32) -> (Local, Local) {
        let pointer = self.b.local(Ty::I64);
        self.b.push(Inst::Pointer { dst: pointer, base, offset });
        (pointer, self.b.int(capacity.into()))
    }

    fn text_native(&mut self, desc: &'static takt_abi::FnDesc) -> NativeId {
        self.c.native(desc.name, desc.call)
    }

    /// `place := source`, cut to the place's length.
    pub(crate) fn assign_text(&mut self, place: &Place, ty: TypeId, source: &Operand, span: Span) {
        let Place::Memory { base, offset } = place else { return };
        let capacity = self.capacity(ty);
        let wide = self.class(ty) == Class::Wide;
        if let Kind::Const(value) = &source.kind {
            let mut bytes = Self::text_bytes(value);
            let unit = if wide { 2 } else { 1 };
            if bytes.len() > (capacity as usize + 1) * unit {
                bytes.truncate(capacity as usize * unit);
                bytes.extend(std::iter::repeat_n(0, unit));
            }
            let data = self.pool(&bytes);
            self.b.push(Inst::Data { dst: *base, offset: *offset, data, len: bytes.len() as u32 });
            return;
        }
        let (from, at, length) = self.text_place(source);
        let (dst, dst_cap) = self.text_words(*base, *offset, capacity);
        let (src, src_cap) = self.text_words(from, at, length);
        let native = self.text_native(if wide { text::WstrAssign::DESC } else { text::StrAssign::DESC });
        let site = self.site(span);
        self.b.push(Inst::Native { native, args: vec![dst, dst_cap, src, src_cap], dst: None, site });
    }

    pub(crate) fn text_comparison(&mut self, op: BinaryOp, a: Operand, b: Operand, span: Span) -> Operand {
        let ty = self.bool_type();
        let wide = self.class(a.ty) == Class::Wide;
        let (base, offset, capacity) = self.text_place(&a);
        let (left, left_cap) = self.text_words(base, offset, capacity);
        let (base, offset, capacity) = self.text_place(&b);
        let (right, right_cap) = self.text_words(base, offset, capacity);
        let native = self.text_native(if wide { text::WstrCompare::DESC } else { text::StrCompare::DESC });
        let site = self.site(span);
        let order = self.b.local(Ty::I64);
        self.b.push(Inst::Native { native, args: vec![left, left_cap, right, right_cap], dst: Some(order), site });
        let zero = self.b.int(0);
        let result = self.b.op(int_op(op, Elem::Lint), &[order, zero], site);
        self.exact(result, ty, span)
    }
}
