//! Placeholders (`lamp AT %Q*`) and VAR_CONFIG, which gives their instances addresses.

use super::Section;
use crate::scope::key;
use crate::unit::Compiler;
use rustc_hash::{FxHashMap as HashMap, FxHashSet as HashSet};
use std::collections::BTreeSet;
use takt_ir::{Address, Area, Mapped, Program, StructKind, Type, TypeId};
use takt_syntax::tree::{VarDecl, VarKind};
use takt_syntax::{Code, Note, Span};

/// A declaration whose instances wait for addresses.
#[derive(Debug, Clone)]
pub(crate) struct Waiting {
    name: String,
    area: Area,
    span: Span,
}

/// An instance of one.
struct Found {
    area: Area,
    span: Span,
    offset: u32,
    ty: TypeId,
    /// Stands for others in the same array too.
    many: bool,
}

impl<'a> Compiler<'a> {
    pub(super) fn note_placeholder(&mut self, decl: &VarDecl, area: Area, section: Section) {
        let span = decl.at.as_ref().map_or(decl.name.span, |at| at.span);
        let waiting = Waiting { name: decl.name.text.clone(), area, span };
        match section {
            Section::Global(i) => self.addresses.waiting_globals.push((i, waiting)),
            Section::Structure(ty) | Section::Unit(VarKind::Var | VarKind::Input | VarKind::Output, Some(ty)) => {
                self.addresses.waiting.entry(ty).or_default().push(waiting);
            }
            Section::Unit(..) => {
                self.report(Code::BadAddress, span, "a variable that is declared here cannot wait for an address").help =
                    Some("declare it in VAR_GLOBAL, or in VAR of a PROGRAM or FUNCTION_BLOCK".into());
            }
        }
    }

    /// Reads the entries of VAR_CONFIG.
    pub(super) fn read_entries(&mut self) {
        for decl in std::mem::take(&mut self.addresses.configured) {
            let ty = self.type_expr(&decl.ty, None, true);
            let Some(at) = &decl.at else {
                self.report(Code::NoEffect, decl.name.span, format!("`{}` has no effect: it has no address", decl.name.text)).help = Some(
                    "VAR_CONFIG gives addresses: `PLC_PRG.lamp AT %QX0.0 : BOOL;`; initial values stand where variables are declared"
                        .into(),
                );
                continue;
            };
            if takt_ir::placeholder(&at.text).is_some() {
                self.report(Code::BadAddress, at.span, "VAR_CONFIG needs a complete address").help =
                    Some("write for example `%IX0.0`".into());
                continue;
            }
            let Some(address) = self.address(at) else { continue };
            if self.goes_with(address, ty, at) {
                self.addresses.entries.push((decl, ty, address));
            }
        }
    }

    /// Joins what waits for addresses with those that VAR_CONFIG gives, and tells what is left on either side.
    pub(crate) fn map(&mut self, program: &mut Program) {
        let entries = std::mem::take(&mut self.addresses.entries);
        let mut given: HashMap<(u32, TypeId), (usize, bool)> = HashMap::default();
        for (i, (decl, ..)) in entries.iter().enumerate() {
            let Some(place) = self.entry_place(program, decl) else { continue };
            if let Some((first, _)) = given.insert((place.offset, place.ty), (i, false)) {
                let (message, span) = (format!("`{}` is given an address twice", decl.name.text), entries[first].0.name.span);
                self.report(Code::DuplicateName, decl.name.span, message).notes.push(Note { span, message: "the first is here".into() });
            }
        }
        let wired = self.options.wired.iter().filter_map(|path| takt_ir::resolve(program, path).ok());
        let wired: HashSet<(u32, TypeId)> = wired.map(|place| (place.offset, place.ty)).collect();
        let mut mapped = Vec::new();
        let mut left: Vec<(Span, String, bool)> = Vec::new();
        let known = given.keys().chain(&wired).map(|(offset, _)| *offset).collect();
        self.each_waiting(program, known, &mut |c, found, path| {
            let place = (found.offset, found.ty);
            match given.get_mut(&place) {
                Some((entry, used)) => {
                    *used = true;
                    let (decl, ty, address) = entries[*entry];
                    mapped.extend(c.mapped(program, &found, decl, ty, address));
                }
                None if wired.contains(&place) => {}
                None => match left.iter_mut().rev().find(|(span, ..)| *span == found.span) {
                    Some((.., others)) => *others = true,
                    None => left.push((found.span, path.to_owned(), found.many)),
                },
            }
        });
        program.mapped = mapped;
        for (entry, used) in given.into_values() {
            let name = &entries[entry].0.name;
            if !used {
                self.report(Code::BadAddress, name.span, format!("`{}` does not wait for an address", name.text)).help =
                    Some("declare it AT %I*, %Q* or %M*".into());
            }
        }
        self.warn_of_left(left);
    }

    fn warn_of_left(&mut self, left: Vec<(Span, String, bool)>) {
        for (span, path, others) in left {
            let others = if others { " and others of its kind" } else { "" };
            let message = format!("nothing gives `{path}`{others} an address");
            self.report(Code::NoAddress, span, message).help =
                Some(format!("write `{path} AT …` in VAR_CONFIG, or wire \"{path}\" in the [io] section of takt.toml"));
        }
    }

    /// The variable that an entry of VAR_CONFIG names; the name of a resource may stand before it.
    fn entry_place(&mut self, program: &Program, decl: &VarDecl) -> Option<takt_ir::Place> {
        let path = &decl.name.text;
        let behind = path.split_once('.').map(|(_, rest)| rest).filter(|rest| rest.contains('.'));
        match takt_ir::resolve(program, path) {
            Ok(place) => Some(place),
            Err(error) => match behind.and_then(|rest| takt_ir::resolve(program, rest).ok()) {
                Some(place) => Some(place),
                None => {
                    self.report(Code::UnknownName, decl.name.span, error.to_string()).help =
                        Some("VAR_CONFIG names variables by their instance paths: `PLC_PRG.valve.lamp`".into());
                    None
                }
            },
        }
    }

    fn mapped(&mut self, program: &Program, found: &Found, decl: &VarDecl, ty: TypeId, address: Address) -> Option<Mapped> {
        let at = decl.at.as_ref()?;
        if address.area != found.area {
            let (wanted, is) = (found.area.letter(), &at.text);
            self.report(Code::BadAddress, at.span, format!("`{}` is declared AT %{wanted}*, found `{is}`", decl.name.text));
            return None;
        }
        if ty != found.ty {
            let (wanted, is) = (program.types.name(found.ty), program.types.name(ty));
            self.report(Code::TypeMismatch, decl.ty.span, format!("`{}` is `{wanted}`, found `{is}`", decl.name.text));
            return None;
        }
        let offset = program.areas.offset(Address { size: 1, ..address })?;
        Some(Mapped { area: found.area, ty, offset: found.offset, address: offset, bit: address.bit })
    }

    /// Finds the instances that wait for an address, with their paths; of those in arrays the ones at `known` offsets and one that stands for the others.
    fn each_waiting(&mut self, program: &Program, known: BTreeSet<u32>, found: &mut dyn FnMut(&mut Self, Found, &str)) {
        if self.addresses.waiting.is_empty() && self.addresses.waiting_globals.is_empty() {
            return;
        }
        for (i, waiting) in std::mem::take(&mut self.addresses.waiting_globals) {
            let name = self.global_path(i);
            if let Some(global) = program.globals.iter().find(|global| global.name == name) {
                let Waiting { area, span, .. } = waiting;
                found(self, Found { area, span, offset: global.offset, ty: global.ty, many: false }, &name);
            }
        }
        let mut walk = Walk { types: &program.types, known, holds: HashMap::default(), path: String::new(), many: false };
        let mut seen = HashSet::default();
        for global in &program.globals {
            if seen.insert((global.offset, global.ty)) {
                walk.path.clone_from(&global.name);
                walk.inside(self, global.ty, global.offset, found);
            }
        }
    }

    /// What waits among the members of a type, those of its bases included.
    fn waiting_in(&self, ty: TypeId) -> impl Iterator<Item = &Waiting> {
        let units = self.pou_of_type.get(&ty).into_iter().flat_map(|pou| self.bases(*pou)).filter_map(|pou| self.pous[pou].ty);
        let is_unit = self.pou_of_type.contains_key(&ty);
        let structures = std::iter::successors(Some(ty), |ty| self.struct_bases.get(ty).copied()).filter(move |_| !is_unit);
        units.chain(structures).filter_map(|ty| self.addresses.waiting.get(&ty)).flatten()
    }
}

/// A walk through the members of variables.
struct Walk<'t> {
    types: &'t takt_ir::Types,
    known: BTreeSet<u32>,
    holds: HashMap<TypeId, bool>,
    path: String,
    /// What is looked at stands for other elements too.
    many: bool,
}

impl Walk<'_> {
    fn inside<'a>(&mut self, c: &mut Compiler<'a>, ty: TypeId, offset: u32, found: &mut dyn FnMut(&mut Compiler<'a>, Found, &str)) {
        if !self.holds(c, ty) {
            return;
        }
        let len = self.path.len();
        let types = self.types;
        match types.get(ty) {
            Type::Array { elem, dims } => {
                let (size, many) = (types.size(*elem).max(1), self.many);
                let count = types.size(ty) / size;
                let mut chosen: BTreeSet<u32> = self.known.range(offset..offset + count * size).map(|at| (at - offset) / size).collect();
                let other = (0..count).find(|n| !chosen.contains(n));
                let left = count as usize - chosen.len();
                chosen.extend(other);
                for n in chosen {
                    self.many = many || Some(n) == other && left > 1;
                    self.path.push_str(&indices(dims, n));
                    self.inside(c, *elem, offset + n * size, found);
                    self.path.truncate(len);
                }
                self.many = many;
            }
            Type::Struct(s) => {
                for field in s.fields.iter().filter(|f| f.section != takt_abi::Section::InOut) {
                    self.path.push('.');
                    self.path.push_str(&field.name);
                    let at = offset + field.offset;
                    let waiting = c.waiting_in(ty).find(|w| key(&w.name) == key(&field.name)).map(|w| (w.area, w.span));
                    if let Some((area, span)) = waiting {
                        found(c, Found { area, span, offset: at, ty: field.ty, many: self.many }, &self.path);
                    }
                    self.inside(c, field.ty, at, found);
                    self.path.truncate(len);
                }
            }
            _ => {}
        }
    }

    /// Whether something in variables of a type waits.
    fn holds(&mut self, c: &Compiler<'_>, ty: TypeId) -> bool {
        if let Some(known) = self.holds.get(&ty) {
            return *known;
        }
        let types = self.types;
        let holds = match types.get(ty) {
            Type::Array { elem, .. } => self.holds(c, *elem),
            Type::Struct(s) => {
                let members = s.fields.iter().filter(|f| s.kind != StructKind::Union && f.section != takt_abi::Section::InOut);
                c.waiting_in(ty).next().is_some() || members.map(|f| f.ty).collect::<Vec<_>>().into_iter().any(|ty| self.holds(c, ty))
            }
            _ => false,
        };
        self.holds.insert(ty, holds);
        holds
    }
}

/// The indices of the element with that number as they are written.
pub(crate) fn indices(dims: &[(i64, i64)], number: u32) -> String {
    let mut rest = u64::from(number);
    let mut parts: Vec<String> = Vec::new();
    for (low, high) in dims.iter().rev() {
        let len = (high - low + 1).max(1) as u64;
        parts.push((low + (rest % len) as i64).to_string());
        rest /= len;
    }
    parts.reverse();
    format!("[{}]", parts.join(", "))
}
