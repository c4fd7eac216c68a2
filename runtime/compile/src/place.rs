//! Places: where values lie, and how they are loaded, stored, indexed and pointed to.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand};
use takt_abi::Elem;
use takt_ir::{Base, Inst, Local, Mem, Op, Ty, Type, TypeId};
use takt_syntax::tree::{Expr, Part};
use takt_syntax::{Code, Span};

/// Where a value lies.
#[derive(Debug, Clone)]
pub(crate) enum Place {
    /// Behind a base.
    Memory { base: Base, offset: u32 },
    /// In a variable's local.
    Register(Local),
    /// Bits of an integer place.
    Bits { whole: Box<Place>, ty: TypeId, shift: u32, width: u32 },
    /// `ARRAY[*]`: pointer to the first element, bounds per dimension.
    Open { pointer: Local, bounds: Vec<(Local, Local)> },
}

impl Place {
    /// The place so many bytes further.
    pub(crate) fn inside(&self, bytes: u32) -> Self {
        match self {
            Self::Memory { base, offset } => Self::Memory { base: *base, offset: offset + bytes },
            other => other.clone(),
        }
    }
}

/// How an elementary type lies in memory.
pub(crate) fn mem(e: Elem) -> Mem {
    match e {
        Elem::Bool => Mem::Bool,
        Elem::Sint => Mem::I8,
        Elem::Byte | Elem::Usint | Elem::Char => Mem::U8,
        Elem::Int => Mem::I16,
        Elem::Word | Elem::Uint | Elem::Wchar => Mem::U16,
        Elem::Dint => Mem::I32,
        Elem::Dword | Elem::Udint | Elem::Time | Elem::Date | Elem::Tod | Elem::Dt => Mem::U32,
        Elem::Real => Mem::F32,
        Elem::Lreal => Mem::F64,
        _ => Mem::I64,
    }
}

impl<'a> Lowering<'_, 'a> {
    /// The elementary type that a scalar type lies in memory as.
    pub(crate) fn scalar(&self, ty: TypeId) -> Option<Elem> {
        match self.c.types.get(ty) {
            Type::Elem(e) | Type::Subrange { base: e, .. } => Some(*e),
            Type::Enum(e) => Some(e.base),
            Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) => Some(Elem::Lword),
            _ => None,
        }
    }

    pub(crate) fn load(&mut self, place: &Place, ty: TypeId, span: Span) -> Local {
        let Some(elem) = self.scalar(ty) else { return self.b.int(0) };
        match place {
            Place::Register(local) => *local,
            Place::Memory { base, offset } => {
                let mem = mem(elem);
                let dst = self.b.local(mem.ty());
                self.b.push(Inst::Load { dst, mem, base: *base, offset: *offset });
                dst
            }
            Place::Bits { whole, ty, shift, width } => {
                let site = self.site(span);
                let word = self.load(whole, *ty, span);
                let shift = self.b.int((*shift).into());
                let moved = self.b.op(Op::ShrU, &[word, shift], site);
                let mask = self.b.int(mask(*width));
                self.b.op(Op::And, &[moved, mask], site)
            }
            Place::Open { .. } => self.b.int(0),
        }
    }

    /// Stores a local of the right class; integers are cut to the type unless `exact`.
    pub(crate) fn store(&mut self, place: &Place, ty: TypeId, src: Local, exact: bool, span: Span) {
        let Some(elem) = self.scalar(ty) else { return };
        match place {
            Place::Register(local) => {
                let src = if exact { src } else { self.cut(src, elem, span) };
                self.b.push(Inst::Copy { dst: *local, src });
            }
            Place::Memory { base, offset } => self.b.push(Inst::Store { src, mem: mem(elem), base: *base, offset: *offset }),
            Place::Bits { whole, ty, shift, width } => {
                let site = self.site(span);
                let word = self.load(whole, *ty, span);
                let field = mask(*width).wrapping_shl(*shift);
                let keep = self.b.int(!field);
                let kept = self.b.op(Op::And, &[word, keep], site);
                let shift = self.b.int((*shift).into());
                let moved = self.b.op(Op::Shl, &[src, shift], site);
                let field = self.b.int(field);
                let placed = self.b.op(Op::And, &[moved, field], site);
                let all = self.b.op(Op::Or, &[kept, placed], site);
                self.store(whole, *ty, all, false, span);
            }
            Place::Open { .. } => {}
        }
    }

    /// The operator that cuts a 64-bit value to the type's width.
    pub(crate) fn cut(&mut self, src: Local, elem: Elem, span: Span) -> Local {
        let op = match elem {
            Elem::Sint => Op::SExt8,
            Elem::Int => Op::SExt16,
            Elem::Dint => Op::SExt32,
            Elem::Byte | Elem::Usint | Elem::Char => Op::ZExt8,
            Elem::Word | Elem::Uint | Elem::Wchar => Op::ZExt16,
            Elem::Dword | Elem::Udint | Elem::Time | Elem::Date | Elem::Tod | Elem::Dt => Op::ZExt32,
            Elem::Bool => {
                let site = self.site(span);
                let zero = self.b.int(0);
                return self.b.op(Op::Ne, &[src, zero], site);
            }
            _ => return src,
        };
        let site = self.site(span);
        self.b.op(op, &[src], site)
    }

    /// The value cut to its own type, if it may exceed it.
    pub(crate) fn exact_value(&mut self, operand: &Operand) -> Local {
        let local = self.value(operand);
        match (operand.exact, self.scalar(operand.ty)) {
            (false, Some(elem)) => self.cut(local, elem, operand.span),
            _ => local,
        }
    }

    /// An address of at least `extent` bytes.
    pub(crate) fn address(&mut self, place: &Place, extent: u32) -> Local {
        match place {
            Place::Memory { base, offset } => self.b.address(*base, *offset, extent),
            _ => self.b.address(Base::Image, takt_ir::NULL_ZONE, extent),
        }
    }

    /// The offset of a place in the image, as ADR gives it.
    pub(crate) fn pointer_to(&mut self, place: &Place) -> Local {
        match place {
            Place::Memory { base, offset } => {
                let dst = self.b.local(Ty::I64);
                self.b.push(Inst::Pointer { dst, base: *base, offset: *offset });
                dst
            }
            Place::Open { pointer, .. } => *pointer,
            _ => self.b.int(0),
        }
    }

    pub(crate) fn deref(&mut self, pointer: Local, to: TypeId, span: Span) -> Place {
        let extent = self.c.types.size(to);
        let site = self.site(span);
        let dst = self.b.local(Ty::Addr(extent));
        self.b.push(Inst::Deref { dst, pointer, site });
        Place::Memory { base: Base::Local(dst), offset: 0 }
    }

    pub(crate) fn deref_expr(&mut self, base: &'a Expr, span: Span) -> Operand {
        match crate::object::is_self(base) {
            Some(true) => return self.this_instance(span),
            Some(false) => return self.super_instance(span).unwrap_or_else(|| self.error(span)),
            None => {}
        }
        let operand = self.expr(base);
        if operand.is_error() {
            return operand;
        }
        let Type::Pointer(to) = *self.c.types.get(operand.ty) else {
            let name = self.type_name(operand.ty);
            self.report(Code::NotPointer, span, format!("`^` needs a POINTER, found `{name}`"));
            return self.error(span);
        };
        let operand = self.check_pointer(operand, to);
        let pointer = self.value(&operand);
        let place = self.deref(pointer, to, span);
        Operand { dynamic: true, ..self.at(place, to, span) }
    }

    pub(crate) fn index(&mut self, base: &'a Expr, indices: &'a [Expr], span: Span) -> Operand {
        let array = self.expr(base);
        let mut values = Vec::new();
        for index in indices {
            values.push(self.index_value(index));
        }
        let Some(values) = values.into_iter().collect::<Option<Vec<_>>>() else { return self.error(span) };
        if array.is_error() {
            return array;
        }
        match (self.c.types.get(array.ty).clone(), &array.kind) {
            (Type::Array { elem, dims }, Kind::Place(place)) if dims.len() == values.len() => {
                self.element(place.clone(), elem, &dims, &values, &array, span)
            }
            (Type::OpenArray { elem, dims }, Kind::Place(Place::Open { pointer, bounds })) if dims as usize == values.len() => {
                self.open_element(*pointer, bounds, elem, &values, span)
            }
            (Type::Array { dims, .. }, _) if dims.len() != values.len() => self.wrong_count(dims.len(), values.len(), span),
            (Type::OpenArray { dims, .. }, _) if dims as usize != values.len() => self.wrong_count(dims as usize, values.len(), span),
            (Type::String(n), Kind::Place(place)) if values.len() == 1 => {
                let byte = self.c.elem(Elem::Byte);
                self.element(place.clone(), byte, &[(0, n.into())], &values, &array, span)
            }
            (Type::WString(n), Kind::Place(place)) if values.len() == 1 => {
                let word = self.c.elem(Elem::Word);
                self.element(place.clone(), word, &[(0, n.into())], &values, &array, span)
            }
            (Type::Pointer(to), _) if values.len() == 1 => self.pointer_element(&array, to, &values[0], span),
            _ => {
                let name = self.type_name(array.ty);
                self.report(Code::NotIndexable, span, format!("`{name}` is not an array"));
                self.error(span)
            }
        }
    }

    fn wrong_count(&mut self, expected: usize, found: usize, span: Span) -> Operand {
        self.report(Code::NotIndexable, span, format!("this array has {expected} dimension(s), found {found} index value(s)"));
        self.error(span)
    }

    fn index_value(&mut self, index: &'a Expr) -> Option<Operand> {
        let operand = self.expr(index);
        if operand.is_error() {
            return None;
        }
        let usable = self.scalar(operand.ty).is_some_and(|e| !matches!(e, Elem::Real | Elem::Lreal | Elem::Bool));
        if !usable {
            let name = self.type_name(operand.ty);
            self.report(Code::TypeMismatch, index.span, format!("an index must be an integer, found `{name}`"));
            return None;
        }
        Some(operand)
    }

    fn element(&mut self, place: Place, elem: TypeId, dims: &[(i64, i64)], values: &[Operand], array: &Operand, span: Span) -> Operand {
        let mut stride = u64::from(self.c.types.size(elem)) * dims.iter().map(|(l, h)| (h - l + 1) as u64).product::<u64>();
        let mut place = place;
        for ((low, high), value) in dims.iter().zip(values) {
            stride /= (high - low + 1) as u64;
            place = match &value.kind {
                Kind::Const(Value::Int(v)) => {
                    if *v < (*low).into() || *v > (*high).into() {
                        self.report(Code::OutOfRange, value.span, format!("index {v} is outside the array's bounds {low}..{high}"));
                        return self.error(span);
                    }
                    place.inside(((*v - i128::from(*low)) as u64 * stride) as u32)
                }
                _ => {
                    let Place::Memory { base, offset } = place else { return self.error(span) };
                    let value = self.check_bounds(value.clone(), *low, *high);
                    let index = self.value(&value);
                    let site = self.site(value.span);
                    let dst = self.b.local(Ty::Addr(stride as u32));
                    self.b.push(Inst::Index { dst, base, offset, index, low: *low, high: *high, stride: stride as u32, site });
                    Place::Memory { base: Base::Local(dst), offset: 0 }
                }
            };
        }
        let mut element = self.at(place, elem, span);
        element.fixed = array.fixed;
        element
    }

    fn open_element(&mut self, pointer: Local, bounds: &[(Local, Local)], elem: TypeId, values: &[Operand], span: Span) -> Operand {
        let site = self.site(span);
        let mut linear = self.b.int(0);
        for ((low, high), value) in bounds.iter().zip(values) {
            let index = self.value(value);
            let at = self.site(value.span);
            self.b.push(Inst::Check { index, low: *low, high: *high, site: at });
            let span_of = self.b.op(Op::Sub, &[*high, *low], site);
            let one = self.b.int(1);
            let count = self.b.op(Op::Add, &[span_of, one], site);
            let scaled = self.b.op(Op::Mul, &[linear, count], site);
            let from_low = self.b.op(Op::Sub, &[index, *low], site);
            linear = self.b.op(Op::Add, &[scaled, from_low], site);
        }
        let size = self.b.int(self.c.types.size(elem).into());
        let bytes = self.b.op(Op::Mul, &[linear, size], site);
        let address = self.b.op(Op::Add, &[pointer, bytes], site);
        let place = self.deref(address, elem, span);
        self.at(place, elem, span)
    }

    fn pointer_element(&mut self, pointer: &Operand, to: TypeId, index: &Operand, span: Span) -> Operand {
        let site = self.site(span);
        let start = self.value(pointer);
        let index = self.value(index);
        let size = self.b.int(self.c.types.size(to).into());
        let bytes = self.b.op(Op::Mul, &[index, size], site);
        let address = self.b.op(Op::Add, &[start, bytes], site);
        let place = self.deref(address, to, span);
        Operand { dynamic: true, ..self.at(place, to, span) }
    }

    pub(crate) fn part(&mut self, base: &'a Expr, part: Part, span: Span) -> Operand {
        let operand = self.expr(base);
        self.part_of(operand, part, span)
    }

    /// Bits of a number.
    pub(crate) fn part_of(&mut self, operand: Operand, part: Part, span: Span) -> Operand {
        if operand.is_error() {
            return operand;
        }
        let size = match self.scalar(operand.ty) {
            Some(e) if crate::types::is_integer(e) => takt_ir::elem_size(e) * 8,
            _ => {
                let name = self.type_name(operand.ty);
                self.report(Code::BadOperand, span, format!("bits can be taken from integers and bit strings, found `{name}`"));
                return self.error(span);
            }
        };
        let (number, width, elem) = match part {
            Part::Bit(n) => (n, 1, Elem::Bool),
            Part::Byte(n) => (n, 8, Elem::Byte),
            Part::Word(n) => (n, 16, Elem::Word),
            Part::Dword(n) => (n, 32, Elem::Dword),
        };
        let ty = self.c.elem(elem);
        let Some(shift) = number.checked_mul(width).filter(|s| *s < size) else {
            let name = self.type_name(operand.ty);
            self.report(Code::OutOfRange, span, format!("`{name}` has no part number {number} of {width} bit(s)"));
            return self.error(span);
        };
        match operand.kind {
            Kind::Place(place) => {
                let whole = Box::new(place);
                let mut bits = self.at(Place::Bits { whole, ty: operand.ty, shift, width }, ty, span);
                bits.fixed = operand.fixed;
                bits
            }
            Kind::Const(Value::Int(v)) => self.constant(Value::Int(v >> shift & i128::from(mask(width))), ty, span),
            _ => {
                let site = self.site(span);
                let word = self.exact_value(&operand);
                let shift = self.b.int(shift.into());
                let moved = self.b.op(Op::ShrU, &[word, shift], site);
                let mask = self.b.int(mask(width));
                let bits = self.b.op(Op::And, &[moved, mask], site);
                self.exact(bits, ty, span)
            }
        }
    }
}

fn mask(width: u32) -> i64 {
    if width >= 64 { -1 } else { (1i64 << width) - 1 }
}
