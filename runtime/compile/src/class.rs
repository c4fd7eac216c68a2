//! Blocks that extend blocks and implement interfaces: who is of which type, and which body a method has for each class.

use crate::limits::EXTENDS;
use crate::scope::{Item, Member, Owner, PouKind, key};
use crate::unit::Compiler;
use rustc_hash::{FxHashMap as HashMap, FxHashSet as HashSet};
use takt_ir::{BodyId, Class, Dispatch, Family, Ty};
use takt_syntax::tree::{Name, VarKind};
use takt_syntax::{Code, Note, Span};

/// Methods that are found by class at run time: the type that declares them and their key (see [`method_key`]).
#[derive(Debug, Default)]
pub(crate) struct Methods {
    numbers: HashMap<(Owner, String), u32>,
    all: Vec<(Owner, String)>,
}

/// Methods that the system calls: each block of a chain has its own, and its own parameters, and seldom sets its result.
pub(crate) const LIFE: [&str; 3] = ["FB_INIT", "FB_REINIT", "FB_EXIT"];

/// Which body of a member is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// A method or action.
    Call,
    Get,
    Set,
}

/// The key of a method among those of its type. The body of a block has the empty key.
pub(crate) fn method_key(name: &str, part: Part) -> String {
    match part {
        Part::Call => key(name),
        Part::Get => key(name) + " GET",
        Part::Set => key(name) + " SET",
    }
}

impl Member {
    /// The unit of one of its bodies.
    fn part(self, part: Part) -> Option<usize> {
        match (self, part) {
            (Self::Method(unit) | Self::Action(unit), Part::Call) => Some(unit),
            (Self::Property { get, .. }, Part::Get) => get,
            (Self::Property { set, .. }, Part::Set) => set,
            _ => None,
        }
    }
}

fn split(method: &str) -> (&str, Part) {
    match (method.strip_suffix(" GET"), method.strip_suffix(" SET")) {
        (Some(name), _) => (name, Part::Get),
        (_, Some(name)) => (name, Part::Set),
        _ => (method, Part::Call),
    }
}

impl<'a> Compiler<'a> {
    /// Resolves EXTENDS and IMPLEMENTS and numbers the classes.
    pub(crate) fn link(&mut self) {
        for i in 0..self.interfaces.len() {
            self.link_interface(i);
        }
        for i in 0..self.interfaces.len() {
            self.interfaces[i].all = self.extended(i);
            if self.interfaces[i].all.len() > EXTENDS {
                self.interfaces[i].all.truncate(1);
                self.extends_too_many(self.interfaces[i].tree.name.span, "interfaces");
                break;
            }
        }
        for (owner, name) in std::mem::take(&mut self.extends) {
            if let Owner::Pou(pou) = owner {
                self.home = self.pous[pou].home;
                self.link_base(pou, name);
            }
        }
        for (pou, name) in std::mem::take(&mut self.implements) {
            self.home = self.pous[pou].home;
            if let Some(interface) = self.named_interface(name) {
                self.pous[pou].implements.push(interface);
            }
        }
        self.home = None;
        for pou in 0..self.pous.len() {
            if self.pous[pou].base.is_none() {
                self.number(pou);
            }
        }
    }

    /// Whether a block inherits from one that is not known.
    pub(crate) fn is_orphan(&self, pou: usize) -> bool {
        self.bases(pou).any(|base| self.pous[base].is_orphan)
    }

    fn link_interface(&mut self, i: usize) {
        let tree = self.interfaces[i].tree;
        self.home = Some(&tree.home);
        for name in &tree.extends {
            let Some(base) = self.named_interface(name) else { continue };
            if self.extended(base).contains(&i) {
                self.report(Code::Circular, name.span, format!("`{}` extends itself", tree.name.text));
                continue;
            }
            self.interfaces[i].extends.push(base);
        }
    }

    fn link_base(&mut self, pou: usize, name: &'a Name) {
        let own = self.pous[pou].tree.name.text.clone();
        let base = match self.qualified_item(&name.text) {
            Some(Item::Pou(base)) if self.pous[base].tree.kind == PouKind::FunctionBlock => base,
            Some(Item::NativeBlock(_)) => {
                let message = format!("`{}` is built in and cannot be extended", name.text);
                self.report(Code::NotSupported, name.span, message).help = Some("put an instance of it into the block instead".into());
                return;
            }
            found => {
                self.pous[pou].is_orphan = true;
                return self.no_such_unit(name, found.is_some(), "FUNCTION_BLOCK");
            }
        };
        if self.pous[base].tree.modifiers.is_final {
            self.report(Code::BadOverride, name.span, format!("`{}` is FINAL and cannot be extended", name.text));
            return;
        }
        let cycle = std::iter::successors(Some(base), |b| self.pous[*b].base).any(|b| b == pou);
        if cycle {
            self.report(Code::Circular, name.span, format!("`{own}` extends itself"));
            return;
        }
        self.pous[pou].base = Some(base);
        self.pous[base].children.push(pou);
    }

    fn named_interface(&mut self, name: &'a Name) -> Option<usize> {
        match self.qualified_item(&name.text) {
            Some(Item::Interface(i)) => Some(i),
            found => {
                self.no_such_unit(name, found.is_some(), "INTERFACE");
                None
            }
        }
    }

    fn no_such_unit(&mut self, name: &Name, exists: bool, what: &str) {
        if exists {
            self.report(Code::UnknownType, name.span, format!("expected the name of a {what}, found `{}`", name.text));
            return;
        }
        let help = self.suggest(&name.text, true);
        self.report(Code::UnknownType, name.span, format!("there is no {what} `{}`", name.text)).help = help;
    }

    /// `Name` or `Library.Name`.
    fn qualified_item(&self, name: &str) -> Option<Item> {
        self.path_item(name.split('.'))
    }

    /// Numbers a block and what extends it, one behind the other, so that the classes of a type lie together.
    fn number(&mut self, root: usize) {
        let mut open = vec![(root, 0)];
        while let Some((pou, depth)) = open.pop() {
            if depth > EXTENDS {
                self.extends_too_many(self.pous[pou].tree.name.span, "blocks");
                self.pous[pou].base = None;
            }
            let depth = if depth > EXTENDS { 0 } else { depth + 1 };
            let unit = &self.pous[pou];
            if unit.base.is_some() || !unit.children.is_empty() || !unit.implements.is_empty() {
                self.classes.push(pou);
                self.pous[pou].class = self.classes.len() as u32;
            }
            open.extend(self.pous[pou].children.iter().rev().map(|child| (*child, depth)));
        }
    }

    /// A block and what it extends, from itself on.
    pub(crate) fn bases(&self, pou: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(Some(pou), |pou| self.pous[*pou].base)
    }

    /// An interface and what it extends, each once, in the order in which members are looked for.
    fn extended(&self, interface: usize) -> Vec<usize> {
        let (mut all, mut seen, mut open) = (Vec::new(), HashSet::default(), vec![interface]);
        while let Some(next) = open.pop().filter(|_| all.len() <= EXTENDS) {
            if seen.insert(next) {
                all.push(next);
                open.extend(self.interfaces[next].extends.iter().rev());
            }
        }
        all
    }

    fn extends_too_many(&mut self, at: Span, what: &str) {
        let message = format!("this extends more than {EXTENDS} {what}, directly or through others");
        self.report(Code::TooDeep, at, message).help = Some("extend fewer of them and put instances into the block instead".into());
    }

    /// Whether a block is of the type `of`.
    pub(crate) fn is_a(&self, pou: usize, of: Owner) -> bool {
        match of {
            Owner::Pou(base) => self.bases(pou).any(|b| b == base),
            Owner::Interface(i) => self.bases(pou).any(|b| self.pous[b].implements.iter().any(|own| self.interface_is(*own, i))),
        }
    }

    /// Whether an interface is, or extends, another.
    pub(crate) fn interface_is(&self, interface: usize, of: usize) -> bool {
        self.interfaces[interface].all.contains(&of)
    }

    /// A member of a block or of what it extends, and who declares it.
    pub(crate) fn member_of(&self, pou: usize, name: &str) -> Option<(usize, Member)> {
        self.bases(pou).find_map(|b| Some((b, *self.pous[b].members.get(name)?)))
    }

    /// A member of an interface or of what it extends, and who declares it.
    pub(crate) fn interface_member(&self, interface: usize, name: &str) -> Option<(usize, Member)> {
        self.interfaces[interface].all.iter().find_map(|i| Some((*i, *self.interfaces[*i].members.get(name)?)))
    }

    /// The members of an interface and of what it extends.
    pub(crate) fn interface_members(&self, interface: usize) -> Vec<&Member> {
        self.interfaces[interface].all.iter().flat_map(|i| self.interfaces[*i].members.values()).collect()
    }

    /// The unit that a block runs for a method.
    pub(crate) fn unit_for(&self, pou: usize, method: &str) -> Option<usize> {
        let (name, part) = split(method);
        match name {
            "" => Some(pou),
            _ => self.bases(pou).find_map(|b| self.pous[b].members.get(name)?.part(part)),
        }
    }

    /// Whether something that extends the block has a body of its own for the method.
    pub(crate) fn overridden(&self, pou: usize, method: &str) -> bool {
        let (name, part) = split(method);
        let mut open = self.pous[pou].children.clone();
        while let Some(child) = open.pop() {
            if name.is_empty() || self.pous[child].members.get(name).is_some_and(|m| m.part(part).is_some()) {
                return true;
            }
            open.extend(&self.pous[child].children);
        }
        false
    }

    /// The number under which a method of a type is found at run time.
    pub(crate) fn method_number(&mut self, owner: Owner, method: &str) -> u32 {
        if let Some(number) = self.methods.numbers.get(&(owner, method.to_owned())) {
            return *number;
        }
        let (params, result) = self.signature(owner, method);
        let name = match (self.owner_name(owner), method) {
            (owner, "") => owner,
            (owner, method) => format!("{owner}.{method}"),
        };
        let number = self.methods.all.len() as u32;
        self.methods.all.push((owner, method.to_owned()));
        self.methods.numbers.insert((owner, method.to_owned()), number);
        self.program.dispatch.push(Dispatch { name, params, result, low: 0, targets: Vec::new() });
        number
    }

    /// Types of the parameters behind the instance, and of the result.
    fn signature(&mut self, owner: Owner, method: &str) -> (Vec<Ty>, Option<Ty>) {
        let (name, part) = split(method);
        let unit = match owner {
            _ if name.is_empty() => None,
            Owner::Pou(pou) => self.unit_for(pou, method),
            Owner::Interface(i) => self.interface_member(i, name).and_then(|(_, m)| m.part(part)),
        };
        let Some(unit) = unit else { return (Vec::new(), None) };
        self.resolve_pou(unit, self.pous[unit].tree.name.span);
        let mut params: Vec<Ty> = self.pous[unit].vars.iter().filter_map(|v| self.passing(v)).flat_map(|p| p.locals()).collect();
        let result = self.pous[unit].result.and_then(|ty| {
            let class = self.register(ty);
            if class.is_none() {
                params.push(Ty::Addr(self.types.size(ty)));
            }
            class
        });
        (params, result)
    }

    /// The name of a block or interface.
    pub(crate) fn owner_name(&self, owner: Owner) -> String {
        match owner {
            Owner::Pou(pou) => self.pous[pou].tree.name.text.clone(),
            Owner::Interface(i) => self.interfaces[i].tree.name.text.clone(),
        }
    }

    /// The number under which a type is asked for at run time.
    pub(crate) fn family_number(&mut self, of: Owner) -> u32 {
        let known = self.families.iter().position(|f| *f == of);
        known.unwrap_or_else(|| {
            self.families.push(of);
            self.families.len() - 1
        }) as u32
    }

    /// Fills the tables of methods, families and classes; lowering a body may ask for more.
    pub(crate) fn finish_classes(&mut self) {
        let implementors = self.implementors();
        let mut done = 0;
        while done < self.methods.all.len() {
            let (owner, method) = self.methods.all[done].clone();
            let mut targets: Vec<Option<BodyId>> = vec![None; self.classes.len()];
            for class in self.classes_of(owner, &implementors) {
                targets[class] = self.target(self.classes[class], &method);
            }
            let low = targets.iter().position(Option::is_some).unwrap_or(0);
            let end = targets.iter().rposition(Option::is_some).map_or(low, |last| last + 1);
            let row = &mut self.program.dispatch[done];
            (row.low, row.targets) = (low as u32 + 1, targets[low..end].to_vec());
            done += 1;
            self.drain();
        }
        for of in self.families.clone() {
            let mut members = vec![false; self.classes.len()];
            self.classes_of(of, &implementors).into_iter().for_each(|class| members[class] = true);
            self.program.families.push(Family { name: self.owner_name(of), low: 1, members });
        }
        for pou in self.classes.clone() {
            let size = self.pous[pou].ty.map_or(16, |ty| self.types.size(ty));
            self.program.classes.push(Class { name: self.pous[pou].tree.name.text.clone(), size });
        }
    }

    /// Indices of the classes that implement an interface, for each interface.
    fn implementors(&self) -> Vec<Vec<usize>> {
        let mut found = vec![Vec::new(); self.interfaces.len()];
        for (class, pou) in self.classes.iter().enumerate() {
            for own in self.bases(*pou).flat_map(|base| &self.pous[base].implements) {
                for interface in &self.interfaces[*own].all {
                    if found[*interface].last() != Some(&class) {
                        found[*interface].push(class);
                    }
                }
            }
        }
        found
    }

    /// Indices of the classes of a type.
    fn classes_of(&self, of: Owner, implementors: &[Vec<usize>]) -> Vec<usize> {
        match of {
            Owner::Interface(i) => implementors[i].clone(),
            // What extends a block is numbered behind it.
            Owner::Pou(pou) => {
                let first = (self.pous[pou].class as usize).saturating_sub(1);
                (first..self.classes.len()).take_while(|class| self.is_a(self.classes[*class], of)).collect()
            }
        }
    }

    fn target(&mut self, pou: usize, method: &str) -> Option<BodyId> {
        if self.pous[pou].tree.modifiers.is_abstract {
            return None;
        }
        let unit = self.unit_for(pou, method)?;
        let abstract_ = self.pous[unit].tree.modifiers.is_abstract && !method.is_empty();
        (!abstract_).then(|| self.body_of(unit))
    }

    /// Checks what overrides and implements.
    pub(crate) fn check_classes(&mut self) {
        for pou in 0..self.pous.len() {
            if self.pous[pou].tree.kind != PouKind::FunctionBlock || self.pous[pou].library {
                continue;
            }
            let mut own: Vec<(String, Member)> = self.pous[pou].members.iter().map(|(name, member)| (name.clone(), *member)).collect();
            own.sort_by(|a, b| a.0.cmp(&b.0));
            for (name, member) in own {
                self.check_override(pou, &name, member);
                self.check_name(pou, &name, member);
            }
            if !self.pous[pou].tree.modifiers.is_abstract {
                self.check_complete(pou);
            }
        }
    }

    fn check_override(&mut self, pou: usize, name: &str, member: Member) {
        let base = self.pous[pou].base.and_then(|base| self.member_of(base, name));
        for part in [Part::Call, Part::Get, Part::Set] {
            let Some(own) = member.part(part) else { continue };
            let replaced = base.and_then(|(_, base)| base.part(part));
            let head = self.pous[own].tree;
            if head.modifiers.is_override && replaced.is_none() && base.is_none() {
                let block = self.pous[pou].tree.name.text.clone();
                let message = format!("`{}` overrides nothing: what `{block}` extends has no such member", head.name.text);
                self.report(Code::BadOverride, head.name.span, message);
            }
            if head.modifiers.is_abstract && !self.pous[pou].tree.modifiers.is_abstract {
                let message = format!("`{}` is ABSTRACT, its block is not", head.name.text);
                self.report(Code::BadOverride, head.name.span, message).help = Some("write FUNCTION_BLOCK ABSTRACT".into());
            }
            let Some(replaced) = replaced else { continue };
            if self.pous[replaced].tree.modifiers.is_final {
                let first = self.pous[replaced].tree.name.span;
                self.report(Code::BadOverride, head.name.span, format!("`{}` is FINAL in what is extended", head.name.text))
                    .notes
                    .push(Note { span: first, message: "declared FINAL here".into() });
            }
            if !LIFE.contains(&name) {
                self.check_same(own, replaced);
            }
        }
        if let Some((_, base)) = base
            && std::mem::discriminant(&base) != std::mem::discriminant(&member)
        {
            let unit = [Part::Call, Part::Get, Part::Set].into_iter().find_map(|part| member.part(part));
            if let Some(unit) = unit {
                let head = self.pous[unit].tree;
                self.report(
                    Code::BadOverride,
                    head.name.span,
                    format!("`{}` is another kind of member in what is extended", head.name.text),
                );
            }
        }
    }

    /// A variable and a method of one name cannot be told apart.
    fn check_name(&mut self, pou: usize, name: &str, member: Member) {
        let first = self.pous[pou].index.get(name).map(|i| self.pous[pou].vars[*i].span);
        let unit = [Part::Call, Part::Get, Part::Set].into_iter().find_map(|part| member.part(part));
        if let (Some(first), Some(unit)) = (first, unit) {
            let tree = self.pous[unit].tree;
            self.report(Code::DuplicateName, tree.name.span, format!("`{}` is the name of a variable too", tree.name.text))
                .notes
                .push(Note { span: first, message: "declared here".into() });
        }
    }

    /// Reports if one unit does not take and give what the other does.
    fn check_same(&mut self, own: usize, other: usize) {
        for unit in [own, other] {
            self.resolve_pou(unit, self.pous[unit].tree.name.span);
        }
        let shape = |unit: usize| -> Vec<(VarKind, takt_ir::TypeId)> {
            self.pous[unit].vars.iter().filter(|v| self.passing(v).is_some()).map(|v| (v.kind, v.ty)).collect()
        };
        if shape(own) == shape(other) && self.pous[own].result == self.pous[other].result {
            return;
        }
        let (name, expected, found) = (self.pou_name(own), self.spelled(other), self.spelled(own));
        let (at, there) = (self.pous[own].tree.name.span, self.pous[other].tree.name.span);
        self.report(Code::BadOverride, at, format!("expected `{name}` to be {expected}, found {found}"))
            .notes
            .push(Note { span: there, message: "declared here".into() });
    }

    /// A signature in words.
    fn spelled(&self, unit: usize) -> String {
        let unit = &self.pous[unit];
        let params = unit.vars.iter().filter(|v| self.passing(v).is_some()).map(|v| {
            let kind = match v.kind {
                VarKind::InOut => "VAR_IN_OUT ",
                VarKind::Output => "VAR_OUTPUT ",
                _ => "",
            };
            format!("{kind}{} : {}", v.name, self.types.name(v.ty))
        });
        let result = unit.result.map_or_else(String::new, |ty| format!(" : {}", self.types.name(ty)));
        format!("`({}){result}`", params.collect::<Vec<_>>().join("; "))
    }

    /// A block that has instances has a body for everything that its bases and interfaces ask for.
    fn check_complete(&mut self, pou: usize) {
        let mut missing: Vec<String> = Vec::new();
        let bases: Vec<usize> = self.bases(pou).collect();
        // A member that the block itself declares ABSTRACT has been reported.
        for base in bases.iter().skip(1) {
            let mut abstract_: Vec<usize> =
                self.pous[*base].members.values().flat_map(|m| [Part::Call, Part::Get, Part::Set].map(|p| m.part(p))).flatten().collect();
            abstract_.retain(|unit| self.pous[*unit].tree.modifiers.is_abstract);
            abstract_.sort_unstable();
            for unit in abstract_ {
                let name = self.pous[unit].tree.name.text.clone();
                let found =
                    self.member_of(pou, &key(&name)).and_then(|(_, m)| m.part(Part::Call).or(m.part(Part::Get)).or(m.part(Part::Set)));
                if found.is_none_or(|found| self.pous[found].tree.modifiers.is_abstract) {
                    missing.push(self.pou_name(unit));
                }
            }
        }
        for own in self.pous[pou].implements.clone() {
            for interface in self.interfaces[own].all.clone() {
                self.check_interface(pou, interface, &mut missing);
            }
        }
        missing.dedup();
        if !missing.is_empty() {
            let tree = self.pous[pou].tree;
            let list = missing.iter().map(|m| format!("`{m}`")).collect::<Vec<_>>().join(", ");
            self.report(Code::NotImplemented, tree.name.span, format!("`{}` does not have {list}", tree.name.text)).help =
                Some("declare them, or make the block ABSTRACT".into());
        }
    }

    fn check_interface(&mut self, pou: usize, interface: usize, missing: &mut Vec<String>) {
        let mut members: Vec<(String, Member)> = self.interfaces[interface].members.iter().map(|(n, m)| (n.clone(), *m)).collect();
        members.sort_by(|a, b| a.0.cmp(&b.0));
        for (name, member) in members {
            for part in [Part::Call, Part::Get, Part::Set] {
                let Some(wanted) = member.part(part) else { continue };
                match self.unit_for(pou, &method_key(&name, part)) {
                    Some(own) => self.check_same(own, wanted),
                    None => missing.push(self.pou_name(wanted)),
                }
            }
        }
    }
}
