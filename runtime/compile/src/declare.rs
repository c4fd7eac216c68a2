//! Collecting names: which units, types and global lists there are.

use crate::scope::{Declared, GlobalVar, Head, Interface, Item, List, Member, Owner, Pou, PouKind, Progress, key};
use crate::unit::Compiler;
use rustc_hash::FxHashMap as HashMap;
use takt_syntax::tree::{self, TypeKind, Unit, VarKind};
use takt_syntax::{Code, Span};

impl<'a> Compiler<'a> {
    pub(crate) fn collect(&mut self) {
        let trees = self.trees;
        for (file, tree) in trees.iter().enumerate() {
            for unit in &tree.units {
                self.collect_unit(file, unit);
            }
        }
        self.home = None;
    }

    fn collect_unit(&mut self, file: usize, unit: &'a Unit) {
        let library = file >= self.user_files;
        self.enter_home(match unit {
            Unit::Pou(unit) => &unit.home,
            Unit::Type(unit) => &unit.home,
            Unit::Globals(unit) => &unit.home,
            Unit::Configuration(unit) => &unit.home,
            Unit::Interface(unit) => &unit.home,
        });
        match unit {
            Unit::Pou(tree) => self.collect_pou(library, tree),
            Unit::Type(tree) => {
                let index = self.declared.len();
                self.declared.push(Declared { tree, home: self.home, state: Progress::Untouched, ty: None });
                self.add(library, &tree.name, Item::Type(index));
                let qualified = tree.pragmas.iter().any(|p| p.name == "qualified_only");
                if let (TypeKind::Enum(body), false) = (&tree.kind, qualified) {
                    for (member, (name, _)) in body.members.iter().enumerate() {
                        self.add_bare(library, &name.text, Item::Member(index, member));
                    }
                }
            }
            Unit::Globals(globals) => self.collect_globals(file, globals),
            Unit::Configuration(configuration) => {
                for block in &configuration.globals {
                    self.collect_list_block(library, None, block, false);
                }
            }
            Unit::Interface(tree) => {
                let ty = self.types.intern(takt_ir::Type::Interface(tree.name.text.as_str().into()));
                let index = self.interfaces.len();
                self.interfaces.push(Interface { tree, ty, extends: Vec::new(), all: vec![index], members: HashMap::default() });
                self.interface_of_type.insert(ty, index);
                self.interfaces[index].members = self.collect_members(library, Owner::Interface(index), &tree.methods, &tree.properties);
                self.add(library, &tree.name, Item::Interface(index));
            }
        }
    }

    fn collect_pou(&mut self, library: bool, tree: &'a tree::Pou) {
        let kind = match tree.kind {
            tree::PouKind::Function => PouKind::Function,
            tree::PouKind::FunctionBlock => PouKind::FunctionBlock,
            tree::PouKind::Program => PouKind::Program,
        };
        let head = Head {
            kind,
            name: &tree.name,
            modifiers: tree.modifiers,
            result: tree.result.as_ref(),
            vars: &tree.vars,
            body: &tree.body,
            pragmas: &tree.pragmas,
            doc: tree.doc.as_deref(),
        };
        let index = self.push_pou(head, library, None);
        let mut members = self.collect_members(library, Owner::Pou(index), &tree.methods, &tree.properties);
        for action in &tree.actions {
            let (pragmas, doc) = (action.pragmas.as_slice(), action.doc.as_deref());
            let head =
                Head { kind: PouKind::Action, name: &action.name, body: &action.body, vars: &[], result: None, pragmas, doc, ..head };
            let unit = self.push_pou(head, library, Some(Owner::Pou(index)));
            self.add_member(&mut members, &action.name, Member::Action(unit));
        }
        let first = members.values().filter_map(|member| self.declared_member_at(*member)).min_by_key(|span| span.start);
        if let (PouKind::Function, Some(span)) = (kind, first) {
            self.report(Code::BadStatement, span, "a FUNCTION has no methods, properties or actions").help =
                Some("make it a FUNCTION_BLOCK, or this a FUNCTION of its own".into());
        }
        self.pous[index].members = members;
        if let Some(base) = &tree.extends {
            self.extends.push((Owner::Pou(index), base));
        }
        self.implements.extend(tree.implements.iter().map(|name| (index, name)));
        self.add(library, &tree.name, Item::Pou(index));
    }

    fn push_pou(&mut self, tree: Head<'a>, library: bool, owner: Option<Owner>) -> usize {
        self.pous.push(Pou {
            tree,
            state: Progress::Untouched,
            ty: None,
            result: None,
            vars: Vec::new(),
            index: HashMap::default(),
            begun: Default::default(),
            home: self.home,
            instance: 0,
            body: None,
            start: None,
            library,
            owner,
            members: HashMap::default(),
            base: None,
            is_orphan: false,
            children: Vec::new(),
            implements: Vec::new(),
            class: 0,
            kept: HashMap::default(),
            enumerators: HashMap::default(),
        });
        self.pous.len() - 1
    }

    /// Methods and properties as units of their own.
    fn collect_members(
        &mut self,
        library: bool,
        owner: Owner,
        methods: &'a [tree::Method],
        properties: &'a [tree::Property],
    ) -> HashMap<String, Member> {
        let mut members = HashMap::default();
        for method in methods {
            let head = Head {
                kind: PouKind::Method,
                name: &method.name,
                modifiers: method.modifiers,
                result: method.result.as_ref(),
                vars: &method.vars,
                body: &method.body,
                pragmas: &method.pragmas,
                doc: method.doc.as_deref(),
            };
            let unit = self.push_pou(head, library, Some(owner));
            self.add_member(&mut members, &method.name, Member::Method(unit));
        }
        for property in properties {
            let mut accessor = |part: &'a Option<(Vec<tree::VarBlock>, Vec<tree::Stmt>)>, access, result: Option<&'a tree::TypeExpr>| {
                let (vars, body) = part.as_ref()?;
                let (name, modifiers) = (&property.name, tree::Modifiers { access, ..property.modifiers });
                let (pragmas, doc) = (property.pragmas.as_slice(), property.doc.as_deref());
                let head = Head { kind: PouKind::Method, name, modifiers, result, vars, body, pragmas, doc };
                Some(self.push_pou(head, library, Some(owner)))
            };
            let get = accessor(&property.get, property.get_access, Some(&property.ty));
            let set = accessor(&property.set, property.set_access, None);
            self.add_member(&mut members, &property.name, Member::Property { get, set });
        }
        members
    }

    fn add_member(&mut self, members: &mut HashMap<String, Member>, name: &tree::Name, member: Member) {
        match members.get(&key(&name.text)) {
            Some(first) => self.declared_twice(name, None, self.declared_member_at(*first)),
            None => drop(members.insert(key(&name.text), member)),
        }
    }

    fn collect_globals(&mut self, file: usize, globals: &'a tree::Globals) {
        let library = file >= self.user_files;
        let attribute = |name: &str| globals.pragmas.iter().find(|p| p.name == name);
        let name = match attribute("gvl_name").and_then(|p| p.value.clone()) {
            Some(name) => name,
            None => stem(&self.files[file].name).to_string(),
        };
        let qualified_only = attribute("qualified_only").is_some();
        let slot = attribute("global_init_slot").and_then(|p| p.value.as_deref()?.trim().parse().ok()).unwrap_or(0);
        let list = match self.list_names.get(&key(&name)) {
            Some(list) => *list,
            None => {
                self.lists.push(List { name: name.clone(), qualified_only, vars: rustc_hash::FxHashMap::default(), slot });
                let list = self.lists.len() - 1;
                self.list_names.insert(key(&name), list);
                self.add_bare(library, &name, Item::List(list));
                list
            }
        };
        self.collect_list_block(library, Some(list), &globals.vars, attribute("task_snapshot").is_some());
    }

    fn collect_list_block(&mut self, library: bool, list: Option<usize>, block: &'a tree::VarBlock, latched: bool) {
        if block.kind == VarKind::Config {
            return self.addresses.configured.extend(&block.vars);
        }
        for decl in &block.vars {
            let index = self.globals.len();
            self.globals.push(GlobalVar {
                var: None,
                list,
                decl,
                kind: VarKind::Global,
                home: self.home,
                constant: block.constant,
                retain: crate::retain::kind_of(block),
                latched: latched || crate::snapshot::is_marked(&decl.pragmas),
                state: Progress::Untouched,
            });
            match list {
                Some(list) => {
                    if let Some(first) = self.lists[list].vars.get(&key(&decl.name.text)) {
                        let (first, within) = (self.globals[*first].decl.name.span, self.lists[list].name.clone());
                        self.declared_twice(&decl.name, Some(&within), Some(first));
                        continue;
                    }
                    self.lists[list].vars.insert(key(&decl.name.text), index);
                    if !self.lists[list].qualified_only {
                        self.add_global(library, &decl.name.text, index);
                    }
                }
                None => self.add(library, &decl.name, Item::Global(index)),
            }
        }
    }

    fn add_global(&mut self, library: bool, name: &str, index: usize) {
        let key = self.entered(name);
        let names = if library { &mut self.library_names } else { &mut self.names };
        match names.get(&key) {
            None => {
                names.insert(key, Item::Global(index));
            }
            Some(Item::Global(_)) => {
                names.insert(key, Item::Ambiguous);
            }
            Some(_) => {}
        }
    }

    fn add(&mut self, library: bool, name: &tree::Name, item: Item) {
        let key = self.entered(&name.text);
        let names = if library { &mut self.library_names } else { &mut self.names };
        let weak = matches!(names.get(&key), None | Some(Item::Member(..) | Item::Global(_) | Item::List(_) | Item::Ambiguous));
        if weak || library {
            names.insert(key.clone(), item);
            self.declared_at.entry(key).or_insert(name.span);
            return;
        }
        let first: Option<Span> = self.declared_at.get(&key).copied();
        let diagnostic = self.report(Code::DuplicateName, name.span, format!("`{}` is declared twice", name.text));
        if let Some(first) = first {
            diagnostic.notes.push(takt_syntax::Note { span: first, message: "first declared here".into() });
        }
    }

    pub(crate) fn add_bare(&mut self, library: bool, name: &str, item: Item) {
        let key = self.entered(name);
        let names = if library { &mut self.library_names } else { &mut self.names };
        match (names.get(&key), item) {
            (None, _) => {
                names.insert(key, item);
            }
            (Some(Item::Member(..)), Item::Member(..)) => {
                names.insert(key, Item::Ambiguous);
            }
            _ => {}
        }
    }
}

/// The file's name without folder and extension: the name of its global list.
fn stem(name: &str) -> &str {
    let name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}
