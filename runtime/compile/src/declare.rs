//! Collecting names: which units, types and global lists there are.

use crate::scope::{Declared, GlobalVar, Item, List, Pou, Progress, key};
use crate::unit::Compiler;
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
    }

    fn collect_unit(&mut self, file: usize, unit: &'a Unit) {
        let library = file >= self.user_files;
        match unit {
            Unit::Pou(tree) => {
                self.refuse_objects(tree);
                let index = self.pous.len();
                let actions = tree.actions.iter().map(|a| (key(&a.name.text), None)).collect();
                self.pous.push(Pou {
                    tree,
                    state: Progress::Untouched,
                    ty: None,
                    result: None,
                    vars: Vec::new(),
                    index: std::collections::HashMap::new(),
                    late: Vec::new(),
                    instance: 0,
                    body: None,
                    actions,
                    library,
                });
                self.add(library, &tree.name, Item::Pou(index));
            }
            Unit::Type(tree) => {
                let index = self.declared.len();
                self.declared.push(Declared { tree, state: Progress::Untouched, ty: None });
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
                    self.collect_list_block(library, None, block);
                }
            }
            Unit::Interface(interface) => {
                self.report(Code::NotSupported, interface.name.span, "INTERFACE is not supported yet");
            }
        }
    }

    fn refuse_objects(&mut self, tree: &'a tree::Pou) {
        let places = [
            (tree.extends.as_ref().map(|n| n.span), "EXTENDS"),
            (tree.implements.first().map(|n| n.span), "IMPLEMENTS"),
            (tree.methods.first().map(|m| m.name.span), "METHOD"),
            (tree.properties.first().map(|p| p.name.span), "PROPERTY"),
        ];
        for (span, what) in places {
            if let Some(span) = span {
                self.report(Code::NotSupported, span, format!("{what} is not supported yet"));
            }
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
        let list = match self.lists.iter().position(|l| key(&l.name) == key(&name)) {
            Some(list) => list,
            None => {
                self.lists.push(List { name: name.clone(), qualified_only, vars: std::collections::HashMap::new(), slot });
                let list = self.lists.len() - 1;
                self.add_bare(library, &name, Item::List(list));
                list
            }
        };
        self.collect_list_block(library, Some(list), &globals.vars);
    }

    fn collect_list_block(&mut self, library: bool, list: Option<usize>, block: &'a tree::VarBlock) {
        for decl in &block.vars {
            let index = self.globals.len();
            let kind = if block.kind == VarKind::Config { VarKind::Config } else { VarKind::Global };
            self.globals.push(GlobalVar { var: None, list, decl, kind, constant: block.constant, state: Progress::Untouched });
            match list {
                Some(list) => {
                    if self.lists[list].vars.insert(key(&decl.name.text), index).is_some() {
                        let name = &self.lists[list].name;
                        let message = format!("`{}` is declared twice in `{name}`", decl.name.text);
                        self.report(Code::DuplicateName, decl.name.span, message);
                    }
                    if !self.lists[list].qualified_only {
                        self.add_global(library, &decl.name.text, index);
                    }
                }
                None => self.add(library, &decl.name, Item::Global(index)),
            }
        }
    }

    fn add_global(&mut self, library: bool, name: &str, index: usize) {
        let names = if library { &mut self.library_names } else { &mut self.names };
        match names.get(&key(name)) {
            None => {
                names.insert(key(name), Item::Global(index));
            }
            Some(Item::Global(_)) => {
                names.insert(key(name), Item::Ambiguous);
            }
            Some(_) => {}
        }
    }

    fn add(&mut self, library: bool, name: &tree::Name, item: Item) {
        let names = if library { &mut self.library_names } else { &mut self.names };
        let weak = matches!(names.get(&key(&name.text)), None | Some(Item::Member(..) | Item::Global(_) | Item::List(_) | Item::Ambiguous));
        if weak || library {
            names.insert(key(&name.text), item);
            self.declared_at.entry(key(&name.text)).or_insert(name.span);
            return;
        }
        let first: Option<Span> = self.declared_at.get(&key(&name.text)).copied();
        let diagnostic = self.report(Code::DuplicateName, name.span, format!("`{}` is declared twice", name.text));
        if let Some(first) = first {
            diagnostic.notes.push(takt_syntax::Note { span: first, message: "first declared here".into() });
        }
    }

    fn add_bare(&mut self, library: bool, name: &str, item: Item) {
        let names = if library { &mut self.library_names } else { &mut self.names };
        match (names.get(&key(name)), item) {
            (None, _) => {
                names.insert(key(name), item);
            }
            (Some(Item::Member(..)), Item::Member(..)) => {
                names.insert(key(name), Item::Ambiguous);
            }
            _ => {}
        }
    }

    /// What a name means outside of any unit: the user's first, then the libraries'.
    pub(crate) fn global_name(&self, name: &str) -> Option<Item> {
        let key = key(name);
        self.names.get(&key).or_else(|| self.library_names.get(&key)).copied()
    }
}

/// The file's name without folder and extension: the name of its global list.
fn stem(name: &str) -> &str {
    let name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}
