//! NAMESPACE and USING: which names are meant where.
//!
//! A unit of a namespace is entered under its full name (`A.B.UNIT`). Where it stands, a simple name means what its own namespace has, then those around
//! it, then those named by USING, then what is global.

use crate::scope::{Item, key};
use crate::unit::Compiler;
use takt_syntax::Code;
use takt_syntax::tree::{Home, Unit};

impl<'a> Compiler<'a> {
    /// Notes the namespaces around a unit, which is entered from now on under its full name.
    pub(crate) fn enter_home(&mut self, home: &'a Home) {
        self.home = Some(home).filter(|home| !home.namespace.is_empty() || !home.using.is_empty());
        for n in 1..=home.namespace.len() {
            let path = path(home, n);
            if !self.namespaces.contains(&path) {
                self.namespaces.push(path);
            }
        }
    }

    /// The key under which a name is entered where we are.
    pub(crate) fn entered(&self, name: &str) -> String {
        match self.home.filter(|home| !home.namespace.is_empty()) {
            Some(home) => format!("{}.{}", path(home, home.namespace.len()), key(name)),
            None => key(name),
        }
    }

    /// Whether a place is in a source of a library.
    pub(crate) fn is_of_library(&self, span: takt_syntax::Span) -> bool {
        span.file.0 as usize >= self.user_files + self.options.conditions.len()
    }

    /// What a name means outside of any unit: the user's first, then the libraries'; in a library its own.
    pub(crate) fn global_name(&self, name: &str) -> Option<Item> {
        let key = key(name);
        if self.in_library
            && let Some(own) = self.library_names.get(&key)
        {
            return Some(*own);
        }
        if !self.namespaces.is_empty()
            && let Some(found) = self.near_name(&key)
        {
            return Some(found);
        }
        self.names
            .get(&key)
            .or_else(|| self.library_names.get(&key))
            .copied()
            .or_else(|| self.namespace(&key))
            .or_else(|| self.own_library(&key))
    }

    /// The sources, if that is the name of a library among them.
    fn own_library(&self, key: &str) -> Option<Item> {
        self.options.namespaces.iter().any(|name| crate::scope::key(name) == key).then_some(Item::Sources)
    }

    fn near_name(&self, key: &str) -> Option<Item> {
        let home = self.home?;
        let around = (1..=home.namespace.len()).rev().map(|n| path(home, n));
        let used = home.using.iter().map(|name| crate::scope::key(&name.text));
        around.chain(used).find_map(|space| self.in_namespace(&space, key))
    }

    fn in_namespace(&self, space: &str, key: &str) -> Option<Item> {
        let full = format!("{space}.{key}");
        self.names.get(&full).copied().or_else(|| self.namespace(&full))
    }

    fn namespace(&self, full: &str) -> Option<Item> {
        self.namespaces.iter().position(|known| known == full).map(Item::Namespace)
    }

    /// What `item.name` means, if `item` is a namespace or the library that is called `library`.
    pub(crate) fn item_in(&self, item: Item, library: &str, name: &str) -> Option<Item> {
        match item {
            Item::Namespace(space) => self.in_namespace(&self.namespaces[space], &key(name)),
            Item::Library => self.library_member(library, name),
            Item::Sources => self.names.get(&key(name)).copied().or_else(|| self.namespace(&key(name))),
            _ => None,
        }
    }

    /// What a dotted name means.
    pub(crate) fn path_item<'n>(&self, mut parts: impl Iterator<Item = &'n str>) -> Option<Item> {
        let first = parts.next()?;
        let (_, item) =
            parts.try_fold((first, self.global_name(first)?), |(before, item), name| Some((name, self.item_in(item, before, name)?)))?;
        Some(item)
    }

    /// Reports USING of what is no namespace.
    pub(crate) fn check_using(&mut self) {
        for unit in self.trees.iter().flat_map(|tree| &tree.units) {
            let home = match unit {
                Unit::Pou(unit) => &unit.home,
                Unit::Type(unit) => &unit.home,
                Unit::Globals(unit) => &unit.home,
                Unit::Configuration(unit) => &unit.home,
                Unit::Interface(unit) => &unit.home,
            };
            for name in &home.using {
                let library =
                    matches!(self.library_names.get(&key(&name.text)), Some(Item::Library)) || self.own_library(&key(&name.text)).is_some();
                if !library && !self.namespaces.contains(&key(&name.text)) {
                    self.report(Code::UnknownName, name.span, format!("there is no namespace `{}`", name.text));
                }
            }
        }
    }
}

/// The first `n` namespaces of a home as a key.
fn path(home: &Home, n: usize) -> String {
    home.namespace[..n].iter().map(|name| key(&name.text)).collect::<Vec<_>>().join(".")
}
