//! Calls: functions, blocks, programs, actions, native functions.

use crate::body::Passing;
use crate::enable::is_enable;
use crate::expression::{BLOCK_OUTPUT, Kind, Lowering, Operand, Thing};
use crate::near::nearest;
use crate::object::{Bound, Target};
use crate::operator::Class;
use crate::place::Place;
use crate::scope::{Item, Owner, PouKind, Variable, key, same};
use takt_abi::{Elem, FnDesc, Section};
use takt_ir::{Base, Field, Inst, Local, Mem, StructKind, Structure, Ty, Type, TypeId};
use takt_syntax::tree::{Arg, ArgKind, Expr, ExprKind, VarKind};
use takt_syntax::{Code, Span};

impl<'a> Lowering<'_, 'a> {
    pub(crate) fn call(&mut self, callee: &'a Expr, args: &'a [Arg], span: Span) -> Operand {
        if let ExprKind::Name(name) = &callee.kind {
            let wanted = key(name);
            let variable = self.local(&wanted).is_some_and(|(level, i)| self.is_callable(level, i));
            let local = variable || self.block().is_some_and(|c| self.c.member_of(c, &wanted).is_some());
            if let (false, true) = (local, wanted.starts_with("__"))
                && let Some(result) = self.system_function(name, args, span)
            {
                return result;
            }
            let hidden = self.local(&wanted).is_some() && !crate::intrinsic::is_known(&wanted);
            if !local
                && !hidden
                && self.c.global_name(name).is_none_or(|i| matches!(i, crate::scope::Item::Member(..) | crate::scope::Item::Enumerator(..)))
            {
                return self.intrinsic(name, callee.span, args, span);
            }
            let recursive = self.pou.filter(|p| self.is_result(*p, &wanted) && !variable);
            match recursive {
                Some(pou) if self.c.pous[pou].tree.kind == PouKind::Function => return self.call_function(pou, args, span),
                Some(_) => {
                    if let Some(Thing::Member(bound)) = self.own_member(&wanted, span) {
                        return self.call_member(*bound, args, span);
                    }
                }
                None => {}
            }
        }
        match self.callee(callee) {
            Thing::Function(pou) => self.call_function(pou, args, span),
            Thing::Native(desc) => self.call_native(desc, args, span),
            Thing::Member(bound) => self.call_member(*bound, args, span),
            Thing::Value(operand) => self.call_instance(operand, args, span),
            Thing::Type(ty) => {
                let name = self.type_name(ty);
                self.check_arguments(args);
                self.report(Code::NotCallable, callee.span, format!("`{name}` is a type; an instance of it can be called")).help =
                    Some(format!("declare one: `VAR inst : {name}; END_VAR`, and call `inst(…)`"));
                self.error(span)
            }
            Thing::Error => {
                self.check_arguments(args);
                self.error(span)
            }
            Thing::List(_) | Thing::Space(_) => {
                self.report(Code::NotCallable, callee.span, "a list, library or namespace cannot be called");
                self.error(span)
            }
        }
    }

    /// Whether a variable is an instance that can be called; one that is not does not hide a function of its name.
    fn is_callable(&self, level: usize, i: usize) -> bool {
        let mut ty = self.c.pous[self.levels[level].pou].vars[i].ty;
        while let Type::Reference(to) = self.c.types.get(ty) {
            ty = *to;
        }
        matches!(self.c.types.get(ty), Type::Struct(_) | Type::Error)
    }

    /// What is called. A variable that cannot be called does not hide a function.
    fn callee(&mut self, callee: &'a Expr) -> Thing {
        if let ExprKind::Name(name) = &callee.kind {
            let wanted = key(name);
            let hidden = self.local(&wanted).is_some_and(|(level, i)| !self.is_callable(level, i));
            let function = |item: &Item| match item {
                Item::Pou(i) => self.c.pous[*i].tree.kind == PouKind::Function,
                Item::NativeFunction(_) => true,
                _ => false,
            };
            if let Some(item) = self.c.global_name(name).filter(function).filter(|_| hidden) {
                return self.item(item, name, callee.span);
            }
        }
        self.thing(callee)
    }

    /// Checks the arguments of a call that is wrong anyway.
    pub(crate) fn check_arguments(&mut self, args: &'a [Arg]) {
        for value in args.iter().filter_map(|a| a.value.as_ref()) {
            self.expr(value);
        }
    }

    pub(crate) fn void(&mut self, span: Span) -> Operand {
        let operand = self.error(span);
        Operand { kind: Kind::Void, ..operand }
    }

    /// Which parameter each argument is for; wrong ones are reported and left out.
    fn match_arguments(&mut self, callee: &str, names: &[(&str, Section)], args: &'a [Arg]) -> Vec<(usize, &'a Arg)> {
        let mut matched: Vec<(usize, &'a Arg)> = Vec::new();
        let positional: Vec<usize> = names.iter().enumerate().filter(|(_, n)| n.1 != Section::State).map(|(i, _)| i).collect();
        for (position, arg) in args.iter().filter(|arg| !is_enable(arg, names)).enumerate() {
            let found = match &arg.name {
                Some(name) => names.iter().position(|(n, s)| same(n, &name.text) && *s != Section::State),
                None => positional.get(position).copied(),
            };
            let Some(i) = found else {
                self.wrong_argument(callee, names, arg, args.len(), positional.len());
                continue;
            };
            let out = matches!(arg.kind, ArgKind::Out | ArgKind::NotOut);
            match (names[i].1, out, arg.name.is_some()) {
                (Section::Output, false, true) => {
                    self.report(Code::BadArgument, arg.span, format!("`{}` is an output of `{callee}`", names[i].0)).help =
                        Some("write `=>`".into());
                    arg.value.iter().for_each(|v| drop(self.expr(v)));
                    continue;
                }
                (Section::Input | Section::InOut, true, _) => {
                    self.report(Code::BadArgument, arg.span, format!("`{}` is an input of `{callee}`", names[i].0)).help =
                        Some("write `:=`".into());
                    continue;
                }
                _ => {}
            }
            if matched.iter().any(|(other, _)| *other == i) {
                self.report(Code::BadArgument, arg.span, format!("`{}` is given twice", names[i].0));
                continue;
            }
            matched.push((i, arg));
        }
        matched
    }

    /// How many arguments are for parameters.
    fn given(&self, names: &[(&str, Section)], args: &[Arg]) -> usize {
        args.iter().filter(|arg| !is_enable(arg, names)).count()
    }

    fn wrong_argument(&mut self, callee: &str, names: &[(&str, Section)], arg: &'a Arg, found: usize, most: usize) {
        arg.value.iter().for_each(|v| drop(self.expr(v)));
        match &arg.name {
            Some(name) => {
                let near = nearest(&key(&name.text), names.iter().filter(|n| n.1 != Section::State).map(|(n, _)| key(n)));
                let spelled = near.and_then(|n| names.iter().find(|(m, _)| key(m) == n).map(|(m, _)| *m));
                self.report(Code::BadArgument, name.span, format!("`{callee}` has no parameter `{}`", name.text)).help =
                    spelled.map(|n| format!("did you mean `{n}`?"));
            }
            None => {
                self.report(Code::BadArgument, arg.span, format!("`{callee}` takes {most} argument(s), found {found}"));
            }
        }
    }

    fn call_function(&mut self, pou: usize, args: &'a [Arg], span: Span) -> Operand {
        self.call_unit(pou, Target::Plain, Vec::new(), args, span)
    }

    /// Calls a function, method or action. What is `preset` (by number of the parameter) is not among the arguments.
    pub(crate) fn call_unit(&mut self, pou: usize, target: Target, preset: Vec<(usize, Operand)>, args: &'a [Arg], span: Span) -> Operand {
        self.c.resolve_pou(pou, span);
        let vars: Vec<Variable<'a>> = self.c.pous[pou].vars.iter().filter(|v| self.c.passing(v).is_some()).cloned().collect();
        let name = self.c.pous[pou].tree.name.text.clone();
        let is_preset = |i: usize| preset.iter().any(|(p, _)| *p == i);
        let names: Vec<(&str, Section)> =
            vars.iter().enumerate().map(|(i, v)| (v.name.as_str(), if is_preset(i) { Section::State } else { section(v.kind) })).collect();
        let enable = self.enable(&names, args);
        let matched = self.match_arguments(&name, &names, args);
        let before = self.c.diagnostics.len();
        let mut words: Vec<Option<Vec<Local>>> = vec![None; vars.len()];
        for (i, operand) in preset {
            if let Some(v) = vars.get(i) {
                words[i] = self.pass(v, operand);
            }
        }
        for wanted in [VarKind::Input, VarKind::InOut] {
            for (i, arg) in matched.iter().filter(|(i, _)| vars[*i].kind == wanted) {
                words[*i] = self.argument(&vars[*i], arg);
            }
        }
        let mut outputs = Vec::new();
        let all_known = matched.len() == self.given(&names, args);
        for (i, v) in vars.iter().enumerate() {
            let given = matched.iter().find(|(n, _)| *n == i).map(|(_, a)| *a);
            if words[i].is_none() && given.is_none_or(|_| v.kind == VarKind::Output) && (all_known || v.kind == VarKind::Output) {
                words[i] = self.missing_argument(pou, v, given, &mut outputs, span);
            }
        }
        let result = self.c.pous[pou].result;
        let site = self.site(span);
        let body = if let Target::Virtual(..) = target { takt_ir::BodyId(0) } else { self.c.body_of(pou) };
        let failed =
            words.iter().any(Option::is_none) || self.c.diagnostics[before..].iter().any(|d| d.severity() == takt_syntax::Severity::Error);
        let mut words: Vec<Local> = words.into_iter().flatten().flatten().collect();
        let value = self.result_of(result, span, |l, dst, place| {
            words.extend(place);
            match target {
                Target::Virtual(method, this) => l.b.push(Inst::Virtual { method, this, args: words, dst, site }),
                Target::Direct(this) => {
                    words.insert(0, this);
                    l.b.push(Inst::Call { body, args: words, dst, site });
                }
                Target::Plain => l.b.push(Inst::Call { body, args: words, dst, site }),
            }
        });
        self.assign_outputs(outputs);
        let value = self.end_enable(enable, value);
        if failed { self.error(span) } else { value }
    }

    /// The call's result: in a local, or in a slot whose address is passed last.
    fn result_of(&mut self, result: Option<TypeId>, span: Span, emit: impl FnOnce(&mut Self, Option<Local>, Option<Local>)) -> Operand {
        let Some(ty) = result else {
            emit(self, None, None);
            return self.void(span);
        };
        match self.c.register(ty) {
            Some(class) => {
                let dst = self.b.local(class);
                emit(self, Some(dst), None);
                self.exact(dst, ty, span)
            }
            None => {
                let (size, align) = self.c.types.layout(ty);
                let slot = self.b.slot(size, align);
                self.put_instances(ty, slot, 1);
                let address = self.b.address(Base::Frame, slot, size);
                emit(self, None, Some(address));
                let mut value = self.at(Place::Memory { base: Base::Frame, offset: slot }, ty, span);
                value.fixed = Some("a result");
                value
            }
        }
    }

    fn assign_outputs(&mut self, outputs: Vec<(&'a Arg, TypeId, u32)>) {
        for (arg, ty, slot) in outputs {
            let value = self.at(Place::Memory { base: Base::Frame, offset: slot }, ty, arg.span);
            self.assign_output(arg, value);
        }
    }

    fn assign_output(&mut self, arg: &'a Arg, value: Operand) {
        let Some(target) = &arg.value else { return };
        let value = match arg.kind {
            ArgKind::NotOut => self.unary(takt_syntax::tree::UnaryOp::Not, value, arg.span),
            _ => value,
        };
        let target = self.target(target);
        let value = Operand { span: target.span, ..value };
        self.assign(target, value);
    }

    /// A parameter that was not given: its initial value, or a slot for an output.
    fn missing_argument(
        &mut self,
        unit: usize,
        v: &Variable<'a>,
        given: Option<&'a Arg>,
        outputs: &mut Vec<(&'a Arg, TypeId, u32)>,
        span: Span,
    ) -> Option<Vec<Local>> {
        match v.kind {
            VarKind::Output => {
                let (size, align) = self.c.types.layout(v.ty);
                let slot = self.b.slot(size, align);
                outputs.extend(given.map(|arg| (arg, v.ty, slot)));
                Some(vec![self.b.address(Base::Frame, slot, size)])
            }
            VarKind::Input if v.init.is_some() => {
                let Some(takt_syntax::tree::Init::Expr(e)) = v.init else { return None };
                let mut scratch = Lowering::scratch(self.c, Some(unit));
                let operand = scratch.expr(e);
                let operand = scratch.convert(operand, v.ty);
                match operand.kind {
                    Kind::Const(_) => self.pass(v, operand),
                    _ => {
                        self.report(Code::NotConstant, e.span, "the default of an input must be a constant");
                        None
                    }
                }
            }
            _ => {
                let callee = &self.c.pous[unit].tree.name.text;
                let message = format!("`{callee}` needs `{}` : `{}`", v.name, self.c.types.name(v.ty));
                self.report(Code::MissingArgument, span, message);
                None
            }
        }
    }

    fn argument(&mut self, v: &Variable<'a>, arg: &'a Arg) -> Option<Vec<Local>> {
        let value = arg.value.as_ref()?;
        match (v.kind, crate::any::generic(&v.decl.ty)) {
            (VarKind::InOut, _) if v.constant => self.by_constant_reference(v, value),
            (VarKind::InOut, _) => self.by_reference(&v.name, v.ty, value),
            (_, Some(wanted)) if v.ty == self.c.any_type(value.span) => Some(vec![self.describe(wanted, value)?]),
            _ => {
                let operand = match *self.c.types.get(v.ty) {
                    Type::Reference(to) => self.reference_argument(value, v.ty, to)?,
                    _ => {
                        let operand = self.expr(value);
                        self.for_parameter(operand, v.ty)?
                    }
                };
                self.pass(v, operand)
            }
        }
    }

    /// What a REFERENCE parameter is given: a variable of its type.
    fn reference_argument(&mut self, value: &'a Expr, ty: TypeId, to: TypeId) -> Option<Operand> {
        let operand = self.expr(value);
        if operand.is_error() {
            return None;
        }
        if !self.refers_to(to, operand.ty) {
            let (wanted, found) = (self.type_name(to), self.operand_name(&operand));
            self.report(Code::TypeMismatch, value.span, format!("expected a variable of type `{wanted}`, found {found}"));
            return None;
        }
        let pointer = self.address_of(operand, value.span);
        (!pointer.is_error()).then_some(Operand { ty, ..pointer })
    }

    /// The operand as the parameter's type; strings may keep their own length.
    pub(crate) fn for_parameter(&mut self, operand: Operand, ty: TypeId) -> Option<Operand> {
        let same = operand.ty == ty && !matches!(operand.kind, Kind::Void);
        let operand = if same { operand } else { self.convert(operand, ty) };
        (!operand.is_error()).then_some(operand)
    }

    fn pass(&mut self, v: &Variable<'a>, operand: Operand) -> Option<Vec<Local>> {
        match self.c.passing(v)? {
            Passing::Value(_) => {
                let operand = Operand { ty: v.ty, ..operand };
                Some(vec![self.exact_value(&operand)])
            }
            _ => Some(vec![self.aggregate(&operand, v.ty)?]),
        }
    }

    /// The address of a string or structure value of exactly this type; strings of other lengths are copied.
    fn aggregate(&mut self, operand: &Operand, ty: TypeId) -> Option<Local> {
        let (size, align) = self.c.types.layout(ty);
        if let (Kind::Place(place @ Place::Memory { .. }), true) = (&operand.kind, operand.ty == ty) {
            return Some(self.address(place, size));
        }
        if !matches!(self.class(ty), Class::Text | Class::Wide) {
            return None;
        }
        let slot = self.b.slot(size, align);
        self.assign_text(&Place::Memory { base: Base::Frame, offset: slot }, ty, operand, operand.span);
        Some(self.b.address(Base::Frame, slot, size))
    }

    /// What a VAR_IN_OUT is given: an address, or pointer and bounds for `ARRAY[*]`.
    fn by_reference(&mut self, name: &str, ty: TypeId, value: &'a Expr) -> Option<Vec<Local>> {
        let operand = self.expr(value);
        if operand.is_error() {
            return None;
        }
        if let Type::OpenArray { elem, dims } = *self.c.types.get(ty) {
            return self.open_argument(name, elem, dims, &operand);
        }
        let place = self.variable_argument(name, ty, &operand)?;
        Some(vec![self.address(&place, self.c.types.size(ty))])
    }

    /// What a VAR_IN_OUT CONSTANT is given: a variable of its type, or a copy of any value that converts to it.
    fn by_constant_reference(&mut self, v: &Variable<'a>, value: &'a Expr) -> Option<Vec<Local>> {
        let mut operand = self.expr(value);
        if operand.is_error() {
            return None;
        }
        let texts = matches!(self.class(v.ty), Class::Text | Class::Wide);
        let fits = matches!(self.c.types.get(v.ty), Type::OpenArray { .. }) || self.refers_to(v.ty, operand.ty);
        if fits && matches!(operand.kind, Kind::Place(Place::Memory { .. } | Place::Open { .. })) {
            operand.fixed = None;
            if let Type::OpenArray { elem, dims } = *self.c.types.get(v.ty) {
                return self.open_argument(&v.name, elem, dims, &operand);
            }
            let place = self.variable_argument(&v.name, v.ty, &operand)?;
            return Some(vec![self.address(&place, self.c.types.size(v.ty))]);
        }
        let operand = if texts { operand } else { self.convert(operand, v.ty) };
        if operand.is_error() {
            return None;
        }
        let (size, align) = self.c.types.layout(v.ty);
        let offset = self.b.slot(size, align);
        self.assign_place(&Place::Memory { base: Base::Frame, offset }, v.ty, operand, value.span);
        Some(vec![self.b.address(Base::Frame, offset, size)])
    }

    /// The memory place of an argument for a VAR_IN_OUT, if it is a variable of the right type.
    fn variable_argument(&mut self, name: &str, ty: TypeId, operand: &Operand) -> Option<Place> {
        let place = match (&operand.kind, operand.fixed) {
            // CODESYS programs hand an output such as SMC_ReadNCFile2.sentences on to the next block.
            (Kind::Place(place @ Place::Memory { .. }), None | Some(BLOCK_OUTPUT)) => place.clone(),
            (Kind::Place(Place::Bits { .. }), None) => {
                self.report(Code::BadArgument, operand.span, format!("a single bit cannot be passed to the VAR_IN_OUT `{name}`")).help =
                    Some("pass a BOOL variable and assign it to the bit behind the call".into());
                return None;
            }
            (_, why) => {
                let what = why.unwrap_or("this");
                self.report(
                    Code::BadArgument,
                    operand.span,
                    format!("the VAR_IN_OUT `{name}` needs a variable; {what} is none that can be written"),
                );
                return None;
            }
        };
        let same = match (self.c.types.get(ty), self.c.types.get(operand.ty)) {
            (Type::String(wanted), Type::String(found)) | (Type::WString(wanted), Type::WString(found)) => found >= wanted,
            // An enumeration is handed on as the integer that it is; not the other way, where any number could come out.
            (Type::Elem(wanted), Type::Enum(found)) => found.base == *wanted,
            (Type::Elem(wanted), Type::Elem(found)) => wanted == found || are_same_bits(*wanted, *found),
            _ => self.refers_to(ty, operand.ty),
        };
        if !same {
            let (wanted, found) = (self.type_name(ty), self.type_name(operand.ty));
            self.report(Code::TypeMismatch, operand.span, format!("the VAR_IN_OUT `{name}` expected `{wanted}`, found `{found}`"));
            return None;
        }
        Some(place)
    }

    fn open_argument(&mut self, name: &str, elem: TypeId, dims: u32, operand: &Operand) -> Option<Vec<Local>> {
        match (self.c.types.get(operand.ty).clone(), &operand.kind, operand.fixed) {
            (Type::Array { elem: e, dims: bounds }, Kind::Place(place), None) if e == elem && bounds.len() == dims as usize => {
                let mut words = vec![self.pointer_to(place)];
                for (low, high) in bounds {
                    words.push(self.b.int(low));
                    words.push(self.b.int(high));
                }
                Some(words)
            }
            (Type::OpenArray { elem: e, dims: d }, Kind::Place(Place::Open { pointer, bounds }), None) if e == elem && d == dims => {
                Some(std::iter::once(*pointer).chain(bounds.iter().flat_map(|(l, h)| [*l, *h])).collect())
            }
            _ => {
                let found = self.operand_name(operand);
                let wanted = self.type_name(elem);
                self.report(
                    Code::TypeMismatch,
                    operand.span,
                    format!("the VAR_IN_OUT `{name}` expected an array variable of `{wanted}` with {dims} dimension(s), found {found}"),
                );
                None
            }
        }
    }

    pub(crate) fn call_instance(&mut self, instance: Operand, args: &'a [Arg], span: Span) -> Operand {
        self.call_part(instance, None, args, span)
    }

    /// Sets inputs, calls the body of an instance or one of its actions, and takes outputs.
    pub(crate) fn call_part(&mut self, instance: Operand, action: Option<(Bound, usize)>, args: &'a [Arg], span: Span) -> Operand {
        let orphan = self.c.pou_of_type.get(&instance.ty).is_some_and(|unit| self.c.is_orphan(*unit));
        if instance.is_error() || orphan {
            self.check_arguments(args);
            return self.error(span);
        }
        let structure = match self.c.types.get(instance.ty) {
            Type::Struct(s) if matches!(s.kind, StructKind::Block | StructKind::Program) => (**s).clone(),
            _ => {
                let name = self.operand_name(&instance);
                self.check_arguments(args);
                self.report(Code::NotCallable, span, format!("expected a function or block instance, found a value of type {name}"));
                return self.error(span);
            }
        };
        let Kind::Place(place @ Place::Memory { .. }) = instance.kind.clone() else { return self.error(span) };
        let names: Vec<(&str, Section)> = structure.fields.iter().map(|f| (f.name.as_str(), f.section)).collect();
        let enable = self.enable(&names, args);
        let matched = self.match_arguments(&structure.name, &names, args);
        for (i, arg) in matched.iter().filter(|(i, _)| names[*i].1 == Section::Input) {
            let field = &structure.fields[*i];
            match self.generic_input(instance.ty, &field.name).zip(arg.value.as_ref()) {
                Some((wanted, value)) if field.ty == self.c.any_type(arg.span) => self.set_description(&place, field, wanted, value),
                _ => self.set_input(&place, field, arg),
            }
        }
        for (i, field) in structure.fields.iter().enumerate().filter(|(_, f)| f.section == Section::InOut) {
            match matched.iter().find(|(n, _)| *n == i) {
                Some((_, arg)) => self.set_in_out(&place, field, arg),
                None if matched.len() != self.given(&names, args) || action.is_some() => {}
                None => {
                    let (wanted, name) = (self.type_name(field.ty), &structure.name);
                    self.report(
                        Code::MissingArgument,
                        span,
                        format!("`{name}` needs its VAR_IN_OUT `{}` : `{wanted}` at each call", field.name),
                    );
                }
            }
        }
        match action {
            Some((bound, unit)) => drop(self.call_bound(&bound, unit, &[], span)),
            None => self.invoke(&instance, &structure, &place, span),
        }
        for (i, arg) in matched.iter().filter(|(i, _)| names[*i].1 == Section::Output) {
            let field = &structure.fields[*i];
            let value = self.at(place.inside(field.offset), field.ty, arg.span);
            self.assign_output(arg, value);
        }
        let nothing = self.void(span);
        self.end_enable(enable, nothing)
    }

    fn invoke(&mut self, instance: &Operand, structure: &Structure, place: &Place, span: Span) {
        let site = self.site(span);
        if let Some(desc) = self.c.native_blocks.get(&instance.ty).copied() {
            match desc.cycle {
                Some(cycle) => {
                    let native = self.c.native(desc.name, cycle);
                    let this = self.pointer_to(place);
                    self.b.push(Inst::Native { native, args: vec![this], dst: None, site });
                    // A block may work for 20 µs: a higher task need not wait for the next one too.
                    self.b.push(Inst::Poll { cost: 1, site });
                }
                None => {
                    self.report(Code::NotCallable, span, format!("`{}` has no body", structure.name));
                }
            }
            return;
        }
        let Some(pou) = self.c.pou_of_type.get(&instance.ty).copied() else { return };
        if instance.dynamic && self.c.overridden(pou, "") {
            let this = self.pointer_to(place);
            let method = self.c.method_number(Owner::Pou(pou), "");
            self.b.push(Inst::Virtual { method, this, args: Vec::new(), dst: None, site });
            return;
        }
        let body = self.c.body_of(pou);
        let args = match structure.kind {
            StructKind::Program => Vec::new(),
            _ => vec![self.address(place, structure.size)],
        };
        self.b.push(Inst::Call { body, args, dst: None, site });
    }

    fn set_input(&mut self, place: &Place, field: &Field, arg: &'a Arg) {
        let Some(value) = &arg.value else { return };
        let target = place.inside(field.offset);
        if let Type::Reference(to) = *self.c.types.get(field.ty) {
            if let Some(pointer) = self.reference_argument(value, field.ty, to) {
                let word = self.value(&pointer);
                self.store(&target, field.ty, word, true, arg.span);
            }
            return;
        }
        let operand = self.expr(value);
        if !operand.is_error() {
            self.assign_place(&target, field.ty, operand, arg.span);
        }
    }

    fn set_in_out(&mut self, place: &Place, field: &Field, arg: &'a Arg) {
        let Some(value) = &arg.value else { return };
        let operand = self.expr(value);
        if operand.is_error() {
            return;
        }
        let words = match *self.c.types.get(field.ty) {
            Type::OpenArray { elem, dims } => self.open_argument(&field.name, elem, dims, &operand),
            _ => self.variable_argument(&field.name, field.ty, &operand).map(|p| vec![self.pointer_to(&p)]),
        };
        let Place::Memory { base, offset } = place.inside(field.offset) else { return };
        for (i, src) in words.into_iter().flatten().enumerate() {
            self.b.push(Inst::Store { src, mem: Mem::I64, base, offset: offset + 8 * i as u32 });
        }
    }

    /// The address of a variable as POINTER TO its type.
    pub(crate) fn address_of(&mut self, operand: Operand, span: Span) -> Operand {
        if operand.is_error() {
            return operand;
        }
        match &operand.kind {
            Kind::Place(place @ (Place::Memory { .. } | Place::Open { .. })) => {
                let pointer = self.pointer_to(place);
                let to = match *self.c.types.get(operand.ty) {
                    Type::OpenArray { elem, .. } => elem,
                    _ => operand.ty,
                };
                let ty = self.c.types.intern(Type::Pointer(to));
                self.exact(pointer, ty, span)
            }
            Kind::Place(Place::Bits { .. }) => {
                self.report(Code::BadArgument, span, "a single bit has no address").help =
                    Some("point to a BOOL variable or to the whole byte; `BITADR` gives the number of a bit in its area".into());
                self.error(span)
            }
            _ => {
                self.report(Code::BadArgument, span, "only a variable has an address");
                self.error(span)
            }
        }
    }

    pub(crate) fn call_native(&mut self, desc: &'static FnDesc, args: &'a [Arg], span: Span) -> Operand {
        if let Some(result) = self.overloaded(desc, args, span) {
            return result;
        }
        let names: Vec<(&str, Section)> = desc.params.iter().map(|p| (p.name, Section::Input)).collect();
        let enable = self.enable(&names, args);
        let matched = self.match_arguments(desc.name, &names, args);
        let mut operands: Vec<Option<Operand>> = vec![None; desc.params.len()];
        let mut failed = matched.len() != self.given(&names, args);
        for (i, arg) in matched {
            operands[i] = arg.value.as_ref().map(|v| self.expr(v));
        }
        for (param, operand) in desc.params.iter().zip(&operands) {
            if operand.is_none() && !failed {
                failed = true;
                let ty = self.c.native_type(&param.ty);
                let wanted = self.type_name(ty);
                self.report(Code::MissingArgument, span, format!("`{}` needs `{}` : `{wanted}`", desc.name, param.name));
            }
        }
        let operands: Vec<Operand> = operands.into_iter().flatten().collect();
        if failed || operands.iter().any(Operand::is_error) {
            return self.error(span);
        }
        let value = self.native_with(desc, operands, span);
        self.end_enable(enable, value)
    }

    /// Calls a native function with as many operands as it has parameters.
    pub(crate) fn native_with(&mut self, desc: &'static FnDesc, operands: Vec<Operand>, span: Span) -> Operand {
        let mut words = Vec::new();
        for (param, operand) in desc.params.iter().zip(operands) {
            let ty = self.c.native_type(&param.ty);
            let Some(operand) = self.for_parameter(operand, ty) else { return self.error(span) };
            let word = match self.c.register(ty) {
                Some(_) => Some(self.exact_value(&Operand { ty, ..operand })),
                None => self.aggregate(&operand, ty),
            };
            match word {
                Some(word) => words.push(word),
                None => return self.error(span),
            }
        }
        let native = self.c.native(desc.name, desc.call);
        let ty = self.c.native_type(&desc.result);
        let site = self.site(span);
        self.result_of(Some(ty), span, |l, dst, place| {
            words.extend(place);
            l.b.push(Inst::Native { native, args: words, dst, site });
        })
    }

    /// The class of local for an operand that stays as it is.
    pub(crate) fn class_of(&self, ty: TypeId) -> Ty {
        self.c.register(ty).unwrap_or(Ty::I64)
    }
}

fn section(kind: VarKind) -> Section {
    match kind {
        VarKind::Input => Section::Input,
        VarKind::Output => Section::Output,
        VarKind::InOut => Section::InOut,
        _ => Section::State,
    }
}

/// Whether one is a bit string and the other an integer of its width, as WORD and UINT, which TwinCAT passes for each other.
fn are_same_bits(a: Elem, b: Elem) -> bool {
    let of_bits = |bits, integer| {
        matches!(
            (bits, integer),
            (Elem::Byte, Elem::Usint | Elem::Sint)
                | (Elem::Word, Elem::Uint | Elem::Int)
                | (Elem::Dword, Elem::Udint | Elem::Dint)
                | (Elem::Lword, Elem::Ulint | Elem::Lint)
        )
    };
    of_bits(a, b) || of_bits(b, a)
}
