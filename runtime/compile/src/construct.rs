//! What instances do before the first scan: members that are not bytes, FB_Init, initial values of the declaration.
//!
//! Order: the members of the base, then the own ones, each with its own FB_Init; FB_Init of the base, then the own one; the initial values of the
//! declaration; methods with `{attribute 'call_after_init'}`.

use crate::constant::Value;
use crate::expression::{Lowering, Operand};
use crate::initial::{Late, What};
use crate::object::Target;
use crate::place::Place;
use crate::scope::{Member, key, same};
use crate::unit::Compiler;
use takt_abi::Elem;
use takt_ir::{Base, Body, BodyId, Inst, Local, Op, StructKind, Term, Ty, Type, TypeId};
use takt_syntax::Span;
use takt_syntax::tree::{Arg, Init, InitItem, VarDecl};

/// Elements of an array that are set one by one rather than in a loop.
const UNROLLED: u32 = 4;

impl<'a> Compiler<'a> {
    /// Whether variables of a type have something to do at the start that is not bytes.
    pub(crate) fn constructs(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Array { elem, .. } => self.constructs(*elem),
            Type::Struct(s) if s.kind == StructKind::Program => false,
            Type::Struct(_) => match self.pou_of_type.get(&ty) {
                Some(pou) => self.has_start(*pou) || self.bases(*pou).any(|b| !self.start_methods(b).is_empty()),
                None => self.type_late.contains_key(&ty),
            },
            _ => false,
        }
    }

    /// Whether the members of a block, or of what it extends, have something to do at the start.
    fn has_start(&self, pou: usize) -> bool {
        self.bases(pou).any(|b| self.pous[b].ty.is_some_and(|ty| self.type_late.contains_key(&ty)))
    }

    /// FB_Init and the methods that are called after it, of the block itself.
    fn start_methods(&self, pou: usize) -> Vec<usize> {
        let mut found: Vec<usize> = self.init_method(pou).into_iter().collect();
        found.extend(self.after_init(pou));
        found
    }

    fn init_method(&self, pou: usize) -> Option<usize> {
        match self.pous[pou].members.get("FB_INIT") {
            Some(Member::Method(unit)) => Some(*unit),
            _ => None,
        }
    }

    fn after_init(&self, pou: usize) -> Vec<usize> {
        let marked = |unit: &usize| self.pous[*unit].tree.pragmas.iter().any(|p| p.name == "call_after_init");
        let methods = self.pous[pou].members.values().filter_map(|m| if let Member::Method(unit) = m { Some(*unit) } else { None });
        let mut methods: Vec<usize> = methods.filter(marked).collect();
        methods.sort_unstable();
        methods
    }

    /// The body that sets the members of an instance.
    pub(crate) fn lower_start(&mut self, id: BodyId, pou: usize) -> Body {
        let name = format!("{} (initial values)", self.pous[pou].tree.name.text);
        let at = self.pous[pou].tree.name.span;
        let mut lowering = Lowering::new(self, id, &name, Some(pou), at);
        lowering.open_instance();
        let Some(this) = lowering.this else { return lowering.finish() };
        if let Some(base) = lowering.c.pous[pou].base.filter(|base| lowering.c.has_start(*base)) {
            lowering.call_start(base, &Place::Memory { base: Base::Local(this), offset: 0 }, at);
        }
        let late = lowering.c.pous[pou].ty.and_then(|ty| lowering.c.type_late.get(&ty).cloned()).unwrap_or_default();
        for late in late.iter() {
            lowering.set_late(Base::Local(this), 0, *late);
        }
        lowering.b.end(Term::Return(None));
        lowering.finish()
    }
}

impl<'a> Lowering<'_, 'a> {
    /// Sets what is not bytes; its offset is from `offset` on.
    pub(crate) fn set_late(&mut self, base: Base, offset: u32, late: Late<'a>) {
        let at = offset + late.offset;
        let retained = self.c.retained_at(at).filter(|_| matches!(base, Base::Image));
        self.in_retained(retained, late.span(), |l| l.set_late_here(base, at, late));
    }

    fn set_late_here(&mut self, base: Base, at: u32, late: Late<'a>) {
        match late.what {
            What::Expr(expr) if !self.points(late.ty) && (!matches!(base, Base::Image) || self.c.retained_at(at).is_some()) => {
                self.unless_kept(|l| l.set_initial(base, at, late.ty, expr));
            }
            What::Expr(expr) => self.set_initial(base, at, late.ty, expr),
            What::Construct(decl) => {
                let mark = self.b.mark();
                self.construct(&Place::Memory { base, offset: at }, late.ty, Some(decl), &decl.fb_init, decl.name.span);
                self.b.release(mark);
            }
        }
    }

    /// What the instances in a place do at the start.
    pub(crate) fn construct(&mut self, place: &Place, ty: TypeId, decl: Option<&'a VarDecl>, args: &'a [Arg], span: Span) {
        match self.c.types.get(ty).clone() {
            Type::Array { elem, .. } => {
                let count = self.c.types.size(ty) / self.c.types.size(elem).max(1);
                if let Some(decl) = decl.filter(|d| !d.fb_inits.is_empty()) {
                    return self.construct_listed(place, elem, count, decl, span);
                }
                self.each(place, elem, count, span, &mut |l, place| l.construct(place, elem, None, args, span));
                if let Some(init) = decl.and_then(|d| d.init.as_ref()).filter(|_| self.c.constructs(elem)) {
                    self.unless_kept(|l| l.set_again(place, ty, init));
                }
            }
            Type::Struct(_) => match self.c.pou_of_type.get(&ty).copied() {
                Some(pou) => {
                    let whole = self.c.block_kind(pou);
                    self.in_retained(whole, span, |l| l.construct_block(pou, place, ty, decl, args, span));
                }
                None => self.construct_structure(place, ty),
            },
            _ => {}
        }
    }

    /// The elements of an array with arguments of FB_Init for each.
    fn construct_listed(&mut self, place: &Place, elem: TypeId, count: u32, decl: &'a VarDecl, span: Span) {
        if decl.fb_inits.len() != count as usize {
            let found = decl.fb_inits.len();
            self.report(takt_syntax::Code::BadInitializer, span, format!("the array has {count} elements, found arguments for {found}"));
        }
        let stride = self.c.types.size(elem);
        for (i, args) in (0..count).zip(&decl.fb_inits) {
            self.construct(&place.inside(i * stride), elem, None, args, span);
        }
    }

    fn construct_structure(&mut self, place: &Place, ty: TypeId) {
        let late = self.c.type_late.get(&ty).cloned().unwrap_or_default();
        let Place::Memory { base, offset } = place else { return };
        // The names in a TYPE are global ones.
        let (pou, levels, this) = (self.pou.take(), std::mem::take(&mut self.levels), self.this.take());
        for late in late.iter() {
            self.set_late(*base, *offset, *late);
        }
        (self.pou, self.levels, self.this) = (pou, levels, this);
    }

    fn construct_block(&mut self, pou: usize, place: &Place, ty: TypeId, decl: Option<&'a VarDecl>, args: &'a [Arg], span: Span) {
        if self.c.has_start(pou) {
            self.call_start(pou, place, span);
        }
        let mut bases: Vec<usize> = self.c.bases(pou).collect();
        bases.reverse();
        let with_init: Vec<(usize, usize)> = bases.iter().filter_map(|b| Some((*b, self.c.init_method(*b)?))).collect();
        let last = with_init.last().map(|(_, unit)| *unit);
        for (base, unit) in &with_init {
            self.call_init(*base, *unit, place, if Some(*unit) == last { Some(args) } else { None }, args, span);
        }
        if let (None, Some(arg)) = (last, args.first()) {
            let name = self.c.types.name(ty);
            self.report(takt_syntax::Code::BadArgument, arg.span, format!("`{name}` has no method FB_Init that takes arguments"));
        }
        if let Some(init) = decl.and_then(|d| d.init.as_ref()).filter(|_| last.is_some()) {
            self.unless_kept(|l| l.set_again(place, ty, init));
        }
        for base in bases {
            for unit in self.c.after_init(base) {
                let target = self.on_instance(base, place);
                self.call_unit(unit, target, Vec::new(), &[], span);
            }
        }
    }

    /// Calls FB_Init of one block of the chain. Those of bases take the arguments that are named as their parameters.
    fn call_init(&mut self, base: usize, unit: usize, place: &Place, args: Option<&'a [Arg]>, all: &'a [Arg], span: Span) {
        self.c.resolve_pou(unit, span);
        let bool_type = self.c.elem(Elem::Bool);
        let vars = self.c.pous[unit].vars.clone();
        let taken: Vec<_> = vars.iter().filter(|v| self.c.passing(v).is_some()).cloned().collect();
        let mut preset: Vec<(usize, Operand)> = Vec::new();
        for (i, v) in taken.iter().enumerate() {
            let name = key(&v.name);
            if matches!(name.as_str(), "BINITRETAINS" | "BINCOPYCODE") && v.ty == bool_type {
                let retains = name == "BINITRETAINS";
                let value = if retains { self.init_retains(bool_type, span) } else { self.constant(Value::Int(0), bool_type, span) };
                preset.push((i, value));
                continue;
            }
            if args.is_some() {
                continue;
            }
            let given = all.iter().find(|a| a.name.as_ref().is_some_and(|n| same(&n.text, &v.name)));
            if let Some(value) = given.and_then(|a| a.value.as_ref()) {
                let operand = self.expr(value);
                if let Some(operand) = self.for_parameter(operand, v.ty) {
                    preset.push((i, operand));
                }
            }
        }
        let target = self.on_instance(base, place);
        self.call_unit(unit, target, preset, args.unwrap_or_default(), span);
    }

    fn on_instance(&mut self, pou: usize, place: &Place) -> Target {
        let ty = self.c.pou_type(pou);
        let size = self.c.types.size(ty);
        Target::Direct(self.address(place, size))
    }

    fn call_start(&mut self, pou: usize, place: &Place, span: Span) {
        let ty = self.c.pou_type(pou);
        let (body, site) = (self.c.start_of(pou), self.site(span));
        let this = self.address(place, self.c.types.size(ty));
        self.b.push(Inst::Call { body, args: vec![this], dst: None, site });
    }

    /// Sets initial values of a declaration that FB_Init may have changed.
    fn set_again(&mut self, place: &Place, ty: TypeId, init: &'a Init) {
        let Place::Memory { base, offset } = *place else { return };
        match (init, self.c.types.get(ty).clone()) {
            (Init::Expr(e), _) => self.set_initial(base, offset, ty, e),
            (Init::Struct(members, _), Type::Struct(s)) => {
                for (name, init) in members {
                    if let Some(field) = s.fields.iter().find(|f| same(&f.name, &name.text)) {
                        self.set_again(&place.inside(field.offset), field.ty, init);
                    }
                }
            }
            (Init::Array(items, _), Type::Array { elem, .. }) => {
                let size = self.c.types.size(elem);
                let mut at = 0;
                for item in items {
                    let (count, values) = match item {
                        InitItem::One(init) => (1, std::slice::from_ref(init)),
                        InitItem::Repeat(count, values) => (self.c.constant_int(count, self.pou).unwrap_or(0), values.as_slice()),
                    };
                    for _ in 0..count.min(1 << 16) {
                        for init in values {
                            self.set_again(&place.inside(at), elem, init);
                            at += size;
                        }
                        at += if values.is_empty() { size } else { 0 };
                    }
                }
            }
            _ => {}
        }
    }

    /// Does something for each element of an array of known length.
    fn each(&mut self, place: &Place, elem: TypeId, count: u32, span: Span, work: &mut dyn FnMut(&mut Self, &Place)) {
        let stride = self.c.types.size(elem);
        if count <= UNROLLED {
            return (0..count).for_each(|i| work(self, &place.inside(i * stride)));
        }
        let Place::Memory { base, offset } = *place else { return };
        let site = self.site(span);
        let last = i64::from(count) - 1;
        self.count_up(last, span, &mut |l, index| {
            let dst = l.b.local(Ty::Addr(stride));
            l.b.push(Inst::Index { dst, base, offset, index, low: 0, high: last, stride, site });
            work(l, &Place::Memory { base: Base::Local(dst), offset: 0 });
        });
    }

    /// A loop from 0 to `last`.
    fn count_up(&mut self, last: i64, span: Span, work: &mut dyn FnMut(&mut Self, Local)) {
        let site = self.site(span);
        let index = self.b.local(Ty::I64);
        let zero = self.b.int(0);
        self.b.push(Inst::Copy { dst: index, src: zero });
        let (inside, exit) = (self.b.block(), self.b.block());
        self.b.continue_in(inside);
        work(self, index);
        let (one, end) = (self.b.int(1), self.b.int(last));
        let next = self.b.op(Op::Add, &[index, one], site);
        self.b.push(Inst::Copy { dst: index, src: next });
        let more = self.b.op(Op::Le, &[index, end], site);
        let again = self.b.block();
        self.b.end(Term::Branch { cond: more, then: again, other: exit });
        self.b.go_to(again);
        self.b.push(Inst::Poll { cost: 1, site });
        self.b.end(Term::Jump(inside));
        self.b.go_to(exit);
    }

    /// Notes the instances of classes in a slot of the frame.
    pub(crate) fn put_instances(&mut self, ty: TypeId, offset: u32, count: u32) {
        let mut found = Vec::new();
        let size = self.c.types.size(ty);
        for i in 0..count {
            self.c.instances_in(ty, offset + i * size, &mut |_, class, offset, count| found.push(Inst::Place { offset, class, count }));
        }
        found.into_iter().for_each(|inst| self.b.push(inst));
    }
}
