//! `__NEW` and `__DELETE`.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand, Thing};
use crate::operator::Class;
use crate::place::Place;
use crate::scope::{Item, Member, Owner, PouKind};
use takt_abi::Elem;
use takt_ir::{Base, Inst, Local, Op, Term, Ty, Type, TypeId, heap};
use takt_syntax::tree::{Arg, Expr, ExprKind};
use takt_syntax::{Code, Span};

impl<'a> Lowering<'_, 'a> {
    fn names_type(&self, name: &str) -> bool {
        match self.c.global_name(name) {
            Some(Item::Pou(pou)) => self.c.pous[pou].tree.kind == PouKind::FunctionBlock,
            Some(Item::Type(_) | Item::Ready(_) | Item::NativeBlock(_)) => true,
            _ => false,
        }
    }

    /// `__NEW(type)`, `__NEW(type, count)`, `__NEW(block(arguments of FB_Init))`.
    pub(crate) fn new_instance(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let (what, count) = match args {
            [Arg { value: Some(what), .. }] => (what, None),
            [Arg { value: Some(what), .. }, Arg { value: Some(count), .. }] => (what, Some(count)),
            _ => {
                self.check_arguments(args);
                self.report(Code::BadArgument, span, "`__NEW` takes a type, and the number of elements");
                return self.error(span);
            }
        };
        let (callee, init): (&'a Expr, &'a [Arg]) = match &what.kind {
            ExprKind::Call(callee, init) => (callee, init),
            _ => (what, &[]),
        };
        // A variable may have the name of its type in other letters: `fb : FB`.
        let hidden = matches!(&callee.kind, ExprKind::Name(name) if self.names_type(name));
        let found = match &callee.kind {
            ExprKind::Name(name) if hidden => self.global_thing(name, callee.span),
            _ => self.thing(callee),
        };
        let ty = match found {
            Thing::Type(ty) => ty,
            Thing::Error => return self.error(span),
            _ => {
                self.report(Code::BadArgument, what.span, "`__NEW` needs the name of a type");
                return self.error(span);
            }
        };
        if !self.may_be_new(ty, what.span) {
            return self.error(span);
        }
        let count = match count {
            Some(e) => self.expr(e),
            None => {
                let ty = self.c.elem(Elem::Lint);
                self.constant(Value::Int(1), ty, span)
            }
        };
        if !matches!(self.class(count.ty), Class::Int(_)) {
            if !count.is_error() {
                self.report(Code::TypeMismatch, count.span, "the number of elements is an integer");
            }
            return self.error(span);
        }
        let pointer = self.take_memory(ty, &count, init, span);
        let ty = self.c.types.intern(Type::Pointer(ty));
        self.exact(pointer, ty, span)
    }

    fn may_be_new(&mut self, ty: TypeId, span: Span) -> bool {
        if let Some(pou) = self.c.pou_of_type.get(&ty).copied() {
            self.c.resolve_pou(pou, span);
        }
        let problem = match self.c.types.get(ty) {
            Type::Interface(_) => Some("an interface has no instances"),
            Type::Error => return false,
            _ if self.c.may_own(ty) => Some("a block that works with files or queues cannot be made while the program runs"),
            _ => None,
        };
        if let Some(problem) = problem {
            self.report(Code::BadArgument, span, problem);
        } else if let Some(name) = self.c.abstract_block(ty) {
            self.report(Code::Abstract, span, format!("`{name}` is ABSTRACT and has no instances"));
            return false;
        }
        problem.is_none()
    }

    fn take_memory(&mut self, ty: TypeId, count: &Operand, init: &'a [Arg], span: Span) -> Local {
        self.c.heap = true;
        let site = self.site(span);
        let stride = self.c.types.size(ty);
        let (size, count) = (self.b.int(stride.into()), self.exact_value(count));
        let pointer = self.b.local(Ty::I64);
        let native = self.c.native(heap::New::DESC.name, heap::New::DESC.call);
        self.b.push(Inst::Native { native, args: vec![size, count], dst: Some(pointer), site });
        let (there, end) = (self.b.block(), self.b.block());
        self.b.end(Term::Branch { cond: pointer, then: there, other: end });
        self.b.go_to(there);
        if !self.c.initial_fits(ty, span) {
            return pointer;
        }
        let plain = self.c.type_bytes(ty).is_none() && !self.c.constructs(ty) && !self.c.has_classes(ty);
        if plain {
            self.b.continue_in(end);
            return pointer;
        }
        let (at, left) = (self.b.local(Ty::I64), self.b.local(Ty::I64));
        self.b.push(Inst::Copy { dst: at, src: pointer });
        self.b.push(Inst::Copy { dst: left, src: count });
        let each = self.b.block();
        self.b.continue_in(each);
        self.fill_memory(at, ty, init, span);
        let one = self.b.int(1);
        let (next, rest) = (self.b.op(Op::Add, &[at, size], site), self.b.op(Op::Sub, &[left, one], site));
        self.b.push(Inst::Copy { dst: at, src: next });
        self.b.push(Inst::Copy { dst: left, src: rest });
        self.b.push(Inst::Poll { cost: 1, site });
        self.b.end(Term::Branch { cond: left, then: each, other: end });
        self.b.go_to(end);
        pointer
    }

    /// The initial value of one variable in the heap.
    fn fill_memory(&mut self, at: Local, ty: TypeId, init: &'a [Arg], span: Span) {
        let place = self.deref(at, ty, span);
        let Place::Memory { base, offset } = place else { return };
        if let Some(bytes) = self.c.type_bytes(ty) {
            let data = self.pool(&bytes);
            self.b.push(Inst::Data { dst: base, offset, data, len: bytes.len() as u32 });
        }
        let mut found = Vec::new();
        self.c.instances_in(ty, 0, &mut |_, class, offset, count| found.push((class, offset, count)));
        let site = self.site(span);
        for (class, offset, count) in found {
            let stride = self.c.classes.get(class as usize - 1).and_then(|pou| self.c.pous[*pou].ty).map_or(16, |ty| self.c.types.size(ty));
            let start = self.b.local(Ty::I64);
            self.b.push(Inst::Pointer { dst: start, base, offset });
            let words = [class.into(), i64::from(stride), count.into()].map(|word| self.b.int(word));
            let native = self.c.native(heap::PutInstances::DESC.name, heap::PutInstances::DESC.call);
            self.b.push(Inst::Native { native, args: vec![start, words[0], words[1], words[2]], dst: None, site });
        }
        if self.c.constructs(ty) {
            self.construct(&place, ty, None, init, span);
        }
    }

    /// `__DELETE(pointer)`: FB_Exit, then the memory goes back, and the pointer is NULL.
    pub(crate) fn delete_instance(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(value), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "`__DELETE` takes one pointer");
            return self.error(span);
        };
        let operand = self.expr(value);
        if operand.is_error() {
            return operand;
        }
        let to = match *self.c.types.get(operand.ty) {
            Type::Pointer(to) => Some(to),
            Type::Interface(_) => None,
            _ => {
                let found = self.operand_name(&operand);
                self.report(Code::NotPointer, span, format!("`__DELETE` needs a pointer that `__NEW` gave, found {found}"));
                return self.error(span);
            }
        };
        self.c.heap = true;
        let site = self.site(span);
        let word = self.value(&operand);
        let pointer = self.b.local(Ty::I64);
        self.b.push(Inst::Copy { dst: pointer, src: word });
        let (there, end) = (self.b.block(), self.b.block());
        self.b.end(Term::Branch { cond: pointer, then: there, other: end });
        self.b.go_to(there);
        if let Some(pou) = to.and_then(|to| self.c.pou_of_type.get(&to).copied()) {
            self.call_exit(pou, pointer, span);
        }
        let native = self.c.native(heap::Delete::DESC.name, heap::Delete::DESC.call);
        self.b.push(Inst::Native { native, args: vec![pointer], dst: None, site });
        if let (Kind::Place(place), None) = (&operand.kind, operand.fixed) {
            let zero = self.b.int(0);
            self.store(place, operand.ty, zero, true, span);
        }
        self.b.continue_in(end);
        self.void(span)
    }

    fn call_exit(&mut self, pou: usize, pointer: Local, span: Span) {
        let Some((_, Member::Method(unit))) = self.c.member_of(pou, "FB_EXIT") else { return };
        self.c.resolve_pou(unit, span);
        let target = if self.c.overridden(pou, "FB_EXIT") {
            crate::object::Target::Virtual(self.c.method_number(Owner::Pou(pou), "FB_EXIT"), pointer)
        } else {
            let ty = self.c.pou_type(pou);
            match self.deref(pointer, ty, span) {
                Place::Memory { base: Base::Local(address), .. } => crate::object::Target::Direct(address),
                _ => return,
            }
        };
        let bool_type = self.c.elem(Elem::Bool);
        let implicit = self.c.pous[unit].vars.first().is_some_and(|v| v.ty == bool_type);
        let preset = if implicit { vec![(0, self.constant(Value::Int(0), bool_type, span))] } else { Vec::new() };
        self.call_unit(unit, target, preset, &[], span);
    }
}
