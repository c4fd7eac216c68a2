//! Instances: methods, properties and actions, THIS and SUPER, interfaces.

use crate::class::{Part, method_key};
use crate::expression::{Kind, Lowering, Operand, Thing};
use crate::place::Place;
use crate::scope::{Member, Owner, PouKind, Storage, key};
use takt_ir::{Base, Inst, Local, Mem, Ty, Type, TypeId};
use takt_syntax::tree::{Access, Arg, Expr, ExprKind};
use takt_syntax::{Code, Span};

/// A member and the instance it runs on.
#[derive(Debug, Clone)]
pub(crate) struct Bound {
    /// The instance (of a block or an interface); `None` for a member of a PROGRAM.
    instance: Option<Operand>,
    member: Member,
    /// The type through which it is reached.
    of: Owner,
    /// Key of its name.
    name: String,
}

impl Bound {
    pub(crate) fn is_property(&self) -> bool {
        matches!(self.member, Member::Property { .. })
    }
}

/// Which body a call leads to, and the instance.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Target {
    /// The unit's own body, without instance.
    Plain,
    /// The unit's own body on the instance at this address.
    Direct(Local),
    /// The body that the instance at this offset has for a method.
    Virtual(u32, Local),
}

impl<'a> Lowering<'_, 'a> {
    /// The instance that the body runs on.
    fn own_instance(&mut self, span: Span) -> Option<Operand> {
        let class = self.block()?;
        let ty = self.c.pou_type(class);
        let place = match self.this {
            Some(this) => Place::Memory { base: Base::Local(this), offset: 0 },
            None => Place::Memory { base: Base::Image, offset: self.c.pous[class].instance.max(takt_ir::NULL_ZONE) },
        };
        Some(Operand { dynamic: true, ..self.at(place, ty, span) })
    }

    /// Gives an expression that is lowered apart an instance that `THIS` can mean; what uses it is no constant.
    pub(crate) fn imagine_instance(&mut self) {
        let block = self.block().is_some_and(|class| self.c.pous[class].tree.kind == PouKind::FunctionBlock);
        if block && self.this.is_none() {
            self.this = Some(self.b.local(Ty::Addr(0)));
        }
    }

    /// What `THIS^` means.
    pub(crate) fn this_instance(&mut self, span: Span) -> Operand {
        let block = self.this.is_some();
        match self.own_instance(span).filter(|_| block) {
            Some(instance) => instance,
            None => {
                self.report(Code::BadStatement, span, "THIS is only possible in a FUNCTION_BLOCK");
                self.error(span)
            }
        }
    }

    /// Whether the body belongs to a block that inherits from one that is not known.
    pub(crate) fn is_in_orphan(&self) -> bool {
        self.block().is_some_and(|class| self.c.is_orphan(class))
    }

    /// What `SUPER^` means: the instance as one of the type that its own extends.
    pub(crate) fn super_instance(&mut self, span: Span) -> Option<Operand> {
        let base = self.block().and_then(|class| self.c.pous[class].base);
        if base.is_none() && self.is_in_orphan() {
            return None;
        }
        let (Some(base), Some(this)) = (base, self.this) else {
            self.report(Code::BadStatement, span, "SUPER is only possible in a FUNCTION_BLOCK that extends another");
            return None;
        };
        let ty = self.c.pou_type(base);
        Some(self.at(Place::Memory { base: Base::Local(this), offset: 0 }, ty, span))
    }

    /// A member of the block that the body belongs to.
    pub(crate) fn own_member(&mut self, wanted: &str, span: Span) -> Option<Thing> {
        let class = self.block()?;
        let (_, member) = self.c.member_of(class, wanted)?;
        let instance = self.this.is_some().then(|| self.own_instance(span)).flatten();
        Some(Thing::Member(Box::new(Bound { instance, member, of: Owner::Pou(class), name: wanted.into() })))
    }

    /// A method, property or action of an instance.
    pub(crate) fn member_thing(&mut self, operand: &Operand, wanted: &str) -> Option<Thing> {
        let (of, member) = match self.c.types.get(operand.ty) {
            Type::Interface(_) => {
                let interface = *self.c.interface_of_type.get(&operand.ty)?;
                let (_, member) = self.c.interface_member(interface, wanted)?;
                (Owner::Interface(interface), member)
            }
            _ => {
                let pou = *self.c.pou_of_type.get(&operand.ty)?;
                let (_, member) = self.c.member_of(pou, wanted)?;
                (Owner::Pou(pou), member)
            }
        };
        let program = matches!(of, Owner::Pou(pou) if self.c.pous[pou].tree.kind == PouKind::Program);
        let instance = (!program).then(|| operand.clone());
        Some(Thing::Member(Box::new(Bound { instance, member, of, name: wanted.into() })))
    }

    /// Names of the fields, methods, properties and actions of a type, as they are spelled.
    pub(crate) fn member_names(&self, ty: TypeId) -> Vec<String> {
        let mut names: Vec<String> = match self.c.types.get(ty) {
            Type::Struct(s) => s.fields.iter().map(|f| f.name.clone()).collect(),
            _ => Vec::new(),
        };
        let of_block =
            self.c.pou_of_type.get(&ty).into_iter().flat_map(|pou| self.c.bases(*pou)).flat_map(|b| self.c.pous[b].members.values());
        let of_interface = self.c.interface_of_type.get(&ty).into_iter().flat_map(|i| self.c.interface_members(*i));
        let units = of_block.chain(of_interface).filter_map(|member| match *member {
            Member::Method(unit) | Member::Action(unit) => Some(unit),
            Member::Property { get, set } => get.or(set),
        });
        names.extend(units.map(|unit| self.c.pous[unit].tree.name.text.clone()));
        names
    }

    fn check_access(&mut self, unit: usize, at: Span) {
        let Some(Owner::Pou(holder)) = self.c.pous[unit].owner else { return };
        let head = self.c.pous[unit].tree;
        let access = if head.kind == PouKind::Action { Access::Public } else { head.modifiers.access };
        let class = self.block();
        let (allowed, word) = match access {
            Access::Public => return,
            Access::Private => (class == Some(holder), "PRIVATE"),
            Access::Protected => (class.is_some_and(|c| self.c.is_a(c, Owner::Pou(holder))), "PROTECTED"),
            Access::Internal => {
                let library = self.pou.is_some_and(|p| self.c.pous[p].library);
                (library == self.c.pous[holder].library, "INTERNAL")
            }
        };
        if !allowed {
            let (name, block) = (head.name.text.clone(), self.c.pous[holder].tree.name.text.clone());
            self.report(Code::NotAccessible, at, format!("`{name}` is {word} in `{block}` and cannot be used from here"));
        }
    }

    /// Calls a method or action.
    pub(crate) fn call_member(&mut self, bound: Bound, args: &'a [Arg], span: Span) -> Operand {
        let (Member::Method(unit) | Member::Action(unit)) = bound.member else {
            let value = self.get_property(bound, span);
            let value = self.follow(value);
            return self.call_instance(value, args, span);
        };
        match (bound.member, bound.instance.clone()) {
            // `fb.Action(in := x, out => y)` sets inputs and takes outputs of the block, as `fb(…)` does.
            (Member::Action(_), Some(instance)) if !args.is_empty() => self.call_part(instance, Some((bound, unit)), args, span),
            _ => self.call_bound(&bound, unit, args, span),
        }
    }

    /// Calls a method or action.
    pub(crate) fn call_bound(&mut self, bound: &Bound, unit: usize, args: &'a [Arg], span: Span) -> Operand {
        match self.bind(bound, unit, Part::Call, span) {
            Some(target) => self.call_unit(unit, target, Vec::new(), args, span),
            None => {
                self.check_arguments(args);
                self.error(span)
            }
        }
    }

    /// Which body of a member runs, and on what.
    fn bind(&mut self, bound: &Bound, unit: usize, part: Part, span: Span) -> Option<Target> {
        self.check_access(unit, span);
        let method = method_key(&bound.name, part);
        let Some(instance) = &bound.instance else { return Some(Target::Plain) };
        if let Owner::Interface(_) = bound.of {
            let this = self.value(instance);
            return Some(Target::Virtual(self.c.method_number(bound.of, &method), this));
        }
        let Owner::Pou(pou) = bound.of else { return None };
        let Kind::Place(place @ Place::Memory { .. }) = &instance.kind else { return None };
        let is_abstract = self.c.pous[unit].tree.modifiers.is_abstract && self.c.pous[unit].tree.kind == PouKind::Method;
        if instance.dynamic && (is_abstract || self.c.overridden(pou, &method)) {
            let this = self.pointer_to(place);
            return Some(Target::Virtual(self.c.method_number(bound.of, &method), this));
        }
        if is_abstract {
            let name = self.c.pou_name(unit);
            self.report(Code::Abstract, span, format!("`{name}` is ABSTRACT and has no body"));
            return None;
        }
        let Some(Owner::Pou(owner)) = self.c.pous[unit].owner else { return None };
        let ty = self.c.pou_type(owner);
        let size = self.c.types.size(ty);
        Some(Target::Direct(self.address(place, size)))
    }

    /// The value of a property: a call of its GET.
    pub(crate) fn get_property(&mut self, bound: Bound, span: Span) -> Operand {
        let get = match bound.of {
            Owner::Pou(pou) => self.c.unit_for(pou, &method_key(&bound.name, Part::Get)),
            Owner::Interface(_) => match bound.member {
                Member::Property { get, .. } => get,
                _ => None,
            },
        };
        let Some(get) = get else {
            self.report(Code::NotAccessible, span, "this property has no GET and cannot be read");
            return self.error(span);
        };
        match self.bind(&bound, get, Part::Get, span) {
            Some(target) => {
                let value = self.call_unit(get, target, Vec::new(), &[], span);
                Operand { fixed: Some("the value of a property"), ..value }
            }
            None => self.error(span),
        }
    }

    /// A property that is about to be written. One that gives a REFERENCE is read, and what it refers to is written.
    pub(crate) fn property_target(&mut self, bound: Bound, span: Span) -> Operand {
        let Some((_, ty)) = self.setter(&bound) else {
            if !bound.is_property() {
                self.report(Code::NotAssignable, span, "a method or action cannot be assigned");
                return self.error(span);
            }
            let value = self.get_property(bound, span);
            if let Type::Reference(_) = self.c.types.get(value.ty) {
                return self.follow(value);
            }
            if !value.is_error() {
                self.report(Code::NotAssignable, span, "this property has no SET and cannot be assigned");
            }
            return self.error(span);
        };
        let has_get = matches!(bound.member, Member::Property { get: Some(_), .. });
        if let (Type::Reference(_), true) = (self.c.types.get(ty), has_get) {
            let value = self.get_property(bound, span);
            return self.follow(value);
        }
        let mut operand = self.error(span);
        (operand.ty, operand.kind) = (ty, Kind::Property(Box::new(bound)));
        operand
    }

    /// The unit of SET, and the type of what it takes.
    fn setter(&mut self, bound: &Bound) -> Option<(usize, TypeId)> {
        let set = match bound.of {
            Owner::Pou(pou) => self.c.unit_for(pou, &method_key(&bound.name, Part::Set)),
            Owner::Interface(_) => match bound.member {
                Member::Property { set, .. } => set,
                _ => None,
            },
        }?;
        self.c.resolve_pou(set, self.c.pous[set].tree.name.span);
        Some((set, self.c.pous[set].vars.first()?.ty))
    }

    /// `property := value`: a call of its SET.
    pub(crate) fn set_property(&mut self, bound: &Bound, value: Operand, span: Span) {
        let Some((set, ty)) = self.setter(bound) else { return };
        let value = match self.c.types.get(ty) {
            Type::Reference(_) => Operand { ty, ..value },
            _ => value,
        };
        let Some(value) = self.for_parameter(value, ty) else { return };
        if let Some(target) = self.bind(bound, set, Part::Set, span) {
            self.call_unit(set, target, vec![(0, value)], &[], span);
        }
    }

    /// The value of what has just been assigned.
    pub(crate) fn read_back(&mut self, target: Operand) -> Operand {
        match target.kind {
            Kind::Property(bound) => {
                let value = self.get_property(*bound, target.span);
                self.follow(value)
            }
            _ => target,
        }
    }

    /// What a VAR_IN_OUT of the instance refers to; checked at each use, because a method may run before the block was called.
    pub(crate) fn follow_in_out(&mut self, storage: &Storage, ty: TypeId, span: Span) -> Operand {
        let (base, offset) = match (storage, self.this) {
            (Storage::This(offset), Some(this)) => (Base::Local(this), *offset),
            (Storage::Image(offset), _) => (Base::Image, *offset),
            _ => return self.error(span),
        };
        self.in_out_at(base, offset, ty, span)
    }

    /// What the VAR_IN_OUT at a place refers to.
    pub(crate) fn in_out_at(&mut self, base: Base, offset: u32, ty: TypeId, span: Span) -> Operand {
        let word = |l: &mut Self, at: u32| {
            let dst = l.b.local(Ty::I64);
            l.b.push(Inst::Load { dst, mem: Mem::I64, base, offset: offset + at });
            dst
        };
        let pointer = word(self, 0);
        let place = match *self.c.types.get(ty) {
            Type::OpenArray { dims, .. } => {
                let bounds = (0..dims).map(|d| (word(self, 8 + 16 * d), word(self, 16 + 16 * d))).collect();
                Place::Open { pointer, bounds }
            }
            _ => self.deref(pointer, ty, span),
        };
        self.at(place, ty, span)
    }

    /// Conversion to an interface, or of one; `None` if neither side is.
    pub(crate) fn object_conversion(&mut self, a: &Operand, to: TypeId) -> Option<Operand> {
        let wanted = match self.c.types.get(to) {
            Type::Interface(_) => self.c.interface_of_type.get(&to).copied(),
            _ if !matches!(self.c.types.get(a.ty), Type::Interface(_)) => return None,
            Type::Pointer(_) => None,
            _ => return None,
        };
        let a = a.clone();
        if let (Kind::Const(crate::constant::Value::Int(0)), Some(_)) = (&a.kind, wanted) {
            return Some(self.constant(crate::constant::Value::Int(0), to, a.span));
        }
        let of = |l: &Self, ty: TypeId| l.c.pou_of_type.get(&ty).copied();
        let fits = |l: &Self, ty: TypeId| wanted.is_some_and(|w| of(l, ty).is_some_and(|pou| l.c.is_a(pou, Owner::Interface(w))));
        match (self.c.types.get(a.ty).clone(), &a.kind, wanted) {
            (Type::Interface(_), _, Some(wanted)) => {
                let from = self.c.interface_of_type.get(&a.ty).copied();
                if from.is_some_and(|from| self.c.interface_is(from, wanted)) {
                    return Some(Operand { ty: to, ..a });
                }
            }
            (Type::Struct(_), Kind::Place(place @ Place::Memory { .. }), _) if fits(self, a.ty) => {
                let pointer = self.pointer_to(place);
                return Some(self.exact(pointer, to, a.span));
            }
            (Type::Pointer(block), ..) if fits(self, block) => return Some(Operand { ty: to, ..a }),
            _ => {}
        }
        let (wanted, found) = (self.type_name(to), self.operand_name(&a));
        let help = match self.c.types.get(a.ty) {
            Type::Interface(_) => Some("ask for it at run time: `__QUERYINTERFACE(from, to)`".to_owned()),
            Type::Struct(_) => Some(format!("`{wanted}` must stand behind IMPLEMENTS of the block")),
            _ => None,
        };
        self.report(Code::TypeMismatch, a.span, format!("expected `{wanted}`, found {found}")).help = help;
        Some(self.error(a.span))
    }

    /// Whether a variable of type `found` may stand where one of type `wanted` is referred to.
    pub(crate) fn refers_to(&self, wanted: TypeId, found: TypeId) -> bool {
        wanted == found
            || match (self.c.pou_of_type.get(&wanted), self.c.pou_of_type.get(&found)) {
                (Some(wanted), Some(found)) => self.c.is_a(*found, Owner::Pou(*wanted)),
                _ => self.c.struct_extends(found, wanted),
            }
    }

    /// The functions whose names begin with `__`; `None` if there is none of that name.
    pub(crate) fn system_function(&mut self, name: &str, args: &'a [Arg], span: Span) -> Option<Operand> {
        Some(match key(name).as_str() {
            "__ISVALIDREF" => self.is_valid_reference(args, span),
            "__QUERYINTERFACE" => self.query(args, true, span),
            "__QUERYPOINTER" => self.query(args, false, span),
            "__NEW" => self.new_instance(args, span),
            "__DELETE" => self.delete_instance(args, span),
            "__POUNAME" => self.unit_name(args, span),
            "__VARINFO" => self.variable_info(args, span),
            _ => return None,
        })
    }

    /// `__POUNAME()`: the name of the unit that it stands in.
    fn unit_name(&mut self, args: &'a [Arg], span: Span) -> Operand {
        if let Some(arg) = args.first() {
            self.report(Code::BadArgument, arg.span, "`__POUNAME` takes no arguments");
        }
        let name = self.pou.map_or_else(String::new, |pou| self.c.pou_name(pou)).into_bytes();
        let ty = self.c.types.intern(Type::String((name.len() as u32).max(1)));
        self.constant(crate::constant::Value::Text(name), ty, span)
    }

    fn is_valid_reference(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let raw = match args {
            [Arg { value: Some(value), .. }] => match self.thing_raw(value) {
                Thing::Value(operand) if operand.is_error() => return operand,
                Thing::Value(operand) => Some(operand),
                _ => None,
            },
            _ => None,
        };
        let usable = |ty: &Type| matches!(ty, Type::Reference(_) | Type::Pointer(_) | Type::Interface(_));
        let Some(operand) = raw.filter(|o| usable(self.c.types.get(o.ty))) else {
            self.report(Code::BadArgument, span, "`__ISVALIDREF` takes one REFERENCE");
            return self.error(span);
        };
        let word = self.value(&operand);
        let (zero, site) = (self.b.int(0), self.site(span));
        let valid = self.b.op(takt_ir::Op::Ne, &[word, zero], site);
        let ty = self.bool_type();
        self.exact(valid, ty, span)
    }

    /// `__QUERYINTERFACE(from, to)` and `__QUERYPOINTER(from, to)`: whether the instance behind `from` is what `to` refers to; `to` is set, to NULL if not.
    fn query(&mut self, args: &'a [Arg], interface: bool, span: Span) -> Operand {
        let [Arg { value: Some(from), .. }, Arg { value: Some(to), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "expected two arguments: an interface or block, and the variable that gets it");
            return self.error(span);
        };
        let from = self.expr(from);
        let to = self.expr(to);
        if from.is_error() || to.is_error() {
            return self.error(span);
        }
        let family = match *self.c.types.get(to.ty) {
            Type::Interface(_) if interface => self.c.interface_of_type.get(&to.ty).copied().map(Owner::Interface),
            Type::Pointer(block) if !interface => self.c.pou_of_type.get(&block).copied().map(Owner::Pou),
            _ => None,
        };
        let any = !interface && family.is_none() && matches!(self.c.types.get(to.ty), Type::Pointer(_));
        let (Kind::Place(target), Some(pointer)) = (to.kind.clone(), self.instance_pointer(&from)) else {
            self.report(Code::BadArgument, span, "expected an interface or block, and a variable that gets it");
            return self.error(span);
        };
        if family.is_none() && !any {
            let found = self.operand_name(&to);
            let wanted = if interface { "a variable of an interface" } else { "a POINTER TO a block" };
            self.report(Code::TypeMismatch, to.span, format!("expected {wanted}, found {found}"));
            return self.error(span);
        }
        let site = self.site(span);
        let zero = self.b.int(0);
        let found = match family {
            Some(of) => {
                let family = self.c.family_number(of);
                let dst = self.b.local(Ty::I64);
                self.b.push(Inst::IsA { dst, pointer, family });
                dst
            }
            None => self.b.op(takt_ir::Op::Ne, &[pointer, zero], site),
        };
        let word = self.b.op(takt_ir::Op::Select, &[found, pointer, zero], site);
        self.store(&target, to.ty, word, true, span);
        let ty = self.bool_type();
        self.exact(found, ty, span)
    }

    /// The offset of the instance that an operand is or refers to.
    pub(crate) fn instance_pointer(&mut self, operand: &Operand) -> Option<Local> {
        match (self.c.types.get(operand.ty), &operand.kind) {
            (Type::Interface(_) | Type::Pointer(_), _) => Some(self.value(operand)),
            (Type::Struct(_), Kind::Place(place @ Place::Memory { .. })) if self.c.pou_of_type.contains_key(&operand.ty) => {
                Some(self.pointer_to(place))
            }
            _ => None,
        }
    }
}

/// `THIS` and `SUPER` where they are followed by `^`.
pub(crate) fn is_self(e: &Expr) -> Option<bool> {
    match e.kind {
        ExprKind::This => Some(true),
        ExprKind::Super => Some(false),
        _ => None,
    }
}
