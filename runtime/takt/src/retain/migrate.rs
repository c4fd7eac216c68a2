//! From the values of a file to those of a program, by instance path and type.
//!
//! What is the same is copied. What is new gets its initial value, what is gone is put aside, what has another type is converted where nothing is lost.
//! A value that does not fit is a reason to refuse all of them: nothing is set to 0 in silence.

use super::convert::convert;
use super::layout::indices;
use super::{Generation, Source};
use std::collections::HashMap;
use takt_abi::Section;
use takt_engine::Restore;
use takt_ir::retain::{Span, restored};
use takt_ir::{Program, StructKind, Type, TypeId, Types};

/// A value that does not go with the program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Where.
    pub path: String,
    /// Why.
    pub reason: String,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct Migration {
    /// For the engine.
    pub restore: Restore,
    /// Variables that start with their initial values, because the file does not have them.
    pub added: Vec<String>,
    /// Variables of the file that the program no longer retains: their numbers there.
    pub removed: Vec<usize>,
    /// Elements of arrays and members that are gone, of variables that stay.
    pub dropped: Vec<String>,
    /// Values with another type than in the file.
    pub converted: Vec<String>,
    /// Values that do not fit.
    pub refused: Vec<Refusal>,
}

/// Paths that are told at the most, of each kind.
const TOLD: usize = 20;

impl Migration {
    /// Nothing to tell: the program retains what it did when the file was written.
    pub fn is_silent(&self) -> bool {
        self.added.is_empty() && self.removed.is_empty() && self.dropped.is_empty() && self.converted.is_empty()
    }
}

/// A list of paths for people.
pub fn listed(paths: &[String]) -> String {
    let more = paths.len().saturating_sub(TOLD);
    let shown = paths[..paths.len() - more].join(", ");
    if more > 0 { format!("{shown}, … ({more} more)") } else { shown }
}

fn key(name: &str) -> String {
    name.to_uppercase()
}

/// Takes over what goes with the kind of start.
pub fn migrate(program: &Program, source: &Source) -> Option<Migration> {
    let generation = source.generation.as_ref()?;
    let by_path: HashMap<String, usize> = generation.description.places.iter().enumerate().map(|(i, p)| (key(&p.path), i)).collect();
    let restore = Restore::new(source.kind);
    let result =
        Migration { restore, added: Vec::new(), removed: Vec::new(), dropped: Vec::new(), converted: Vec::new(), refused: Vec::new() };
    let mut walk = Walk { program, generation, same: HashMap::new(), path: String::new(), result };
    let mut used = vec![false; generation.description.places.len()];
    for retained in program.retained.iter().filter(|r| source.kind.keeps(r.kind)) {
        walk.path.clone_from(&retained.path);
        if let Some(i) = by_path.get(&key(&retained.path)) {
            used[*i] = true;
            let ty = TypeId(generation.description.places[*i].ty);
            walk.value(ty, generation.value(*i), retained.ty, retained.offset);
        } else if let Some((ty, bytes)) = walk.part_of_a_variable(&retained.path) {
            walk.value(ty, bytes, retained.ty, retained.offset);
        } else {
            walk.parts_of(retained.ty, retained.offset, &by_path, &mut used);
        }
    }
    let mut result = walk.result;
    let wanted = |i: &usize| source.kind.keeps(generation.description.places[*i].kind());
    result.removed = (0..used.len()).filter(|i| !used[*i]).filter(wanted).collect();
    result.restore.complete = result.added.is_empty() && result.refused.is_empty();
    Some(result)
}

struct Walk<'a> {
    program: &'a Program,
    generation: &'a Generation,
    /// Whether a type of the file and one of the program are the same.
    same: HashMap<(TypeId, TypeId), bool>,
    path: String,
    result: Migration,
}

impl<'a> Walk<'a> {
    fn old(&self) -> &'a Types {
        &self.generation.decoded.types
    }

    /// A variable of the program that was part of a larger one.
    fn part_of_a_variable(&self, path: &str) -> Option<(TypeId, &'a [u8])> {
        let path = key(path);
        let places = self.generation.description.places.iter().enumerate();
        places.filter_map(|(i, place)| Some((i, place, path.strip_prefix(key(&place.path).as_str())?))).find_map(|(i, place, rest)| {
            let mut rest = rest.strip_prefix('.')?;
            let (mut ty, mut bytes) = (TypeId(place.ty), self.generation.value(i));
            while !rest.is_empty() {
                let Type::Struct(s) = self.old().get(ty) else { return None };
                let field = s.fields.iter().find(|f| {
                    let name = key(&f.name);
                    rest.strip_prefix(name.as_str()).is_some_and(|behind| behind.is_empty() || behind.starts_with('.'))
                })?;
                rest = rest[key(&field.name).len()..].trim_start_matches('.');
                ty = field.ty;
                bytes = bytes.get(field.offset as usize..)?;
            }
            Some((ty, bytes))
        })
    }

    /// A variable of the program of which the file may have parts.
    fn parts_of(&mut self, ty: TypeId, offset: u32, by_path: &HashMap<String, usize>, used: &mut [bool]) {
        if let Some(i) = by_path.get(&key(&self.path)) {
            used[*i] = true;
            let old = TypeId(self.generation.description.places[*i].ty);
            return self.value(old, self.generation.value(*i), ty, offset);
        }
        let inside = format!("{}.", key(&self.path));
        let types = &self.program.types;
        match types.get(ty) {
            Type::Struct(s) if s.kind != StructKind::Union && by_path.keys().any(|path| path.starts_with(&inside)) => {
                for field in s.fields.iter().filter(|f| f.section != Section::InOut) {
                    self.inside(&format!(".{}", field.name), |walk| walk.parts_of(field.ty, offset + field.offset, by_path, used));
                }
            }
            _ => self.added(ty),
        }
    }

    fn inside(&mut self, step: &str, work: impl FnOnce(&mut Self)) {
        let len = self.path.len();
        self.path.push_str(step);
        work(self);
        self.path.truncate(len);
    }

    /// A new variable, unless there is nothing in it that would be kept.
    fn added(&mut self, ty: TypeId) {
        let mut any = false;
        restored(self.program, ty, takt_ir::NULL_ZONE, &mut |_| any = true);
        if any {
            self.result.added.push(self.path.clone());
        }
    }

    fn refuse(&mut self, reason: String) {
        self.result.refused.push(Refusal { path: self.path.clone(), reason });
    }

    /// One variable, element or member.
    fn value(&mut self, from: TypeId, bytes: &'a [u8], to: TypeId, offset: u32) {
        if self.is_same(from, to) {
            let restore = &mut self.result.restore;
            return restored(self.program, to, offset, &mut |span| {
                let start = (span.offset - offset) as usize;
                if let Some(bytes) = bytes.get(start..start + span.len as usize) {
                    restore.push(span, bytes);
                }
            });
        }
        let (old, new) = (self.old(), &self.program.types);
        let points = |ty: &Type| matches!(ty, Type::Pointer(_) | Type::Reference(_) | Type::Interface(_));
        match (old.get(from), new.get(to)) {
            (_, b) if points(b) => {}
            (a, _) if points(a) => self.added(to),
            (Type::Array { elem: a, dims: before }, Type::Array { elem: b, dims: now }) if before.len() == now.len() => {
                self.array((*a, before), (*b, now), bytes, offset);
            }
            (Type::Struct(a), Type::Struct(b)) if a.kind != StructKind::Union && b.kind != StructKind::Union => {
                for field in b.fields.iter().filter(|f| f.section != Section::InOut) {
                    let before = a.fields.iter().find(|f| key(&f.name) == key(&field.name));
                    self.inside(&format!(".{}", field.name), |walk| match before {
                        Some(f) => {
                            walk.value(f.ty, bytes.get(f.offset as usize..).unwrap_or_default(), field.ty, offset + field.offset);
                        }
                        None => walk.added(field.ty),
                    });
                }
                for gone in a.fields.iter().filter(|f| !b.fields.iter().any(|g| key(&g.name) == key(&f.name))) {
                    if !points(old.get(gone.ty)) {
                        self.result.dropped.push(format!("{}.{}", self.path, gone.name));
                    }
                }
            }
            _ => match convert(old, from, bytes, new, to) {
                Ok(value) => {
                    let mask = if let Type::Bit(bit) = new.get(to) { 1u8.checked_shl((*bit).into()).unwrap_or(0) } else { u8::MAX };
                    self.result.restore.push(Span { offset, len: value.len() as u32, mask }, &value);
                    self.result.converted.push(self.path.clone());
                }
                Err(reason) => self.refuse(reason),
            },
        }
    }

    /// Elements go by their indices.
    fn array(&mut self, (a, before): (TypeId, &[(i64, i64)]), (b, now): (TypeId, &[(i64, i64)]), bytes: &'a [u8], offset: u32) {
        let (stride, size) = (self.old().size(a) as usize, self.program.types.size(b));
        let count = |dims: &[(i64, i64)]| dims.iter().map(|(l, h)| h.abs_diff(*l) + 1).product::<u64>();
        let mut new = 0u64;
        for n in 0..count(now) {
            match position(now, before, n) {
                Some(i) => {
                    let bytes = bytes.get(i as usize * stride..).unwrap_or_default();
                    self.inside(&indices(now, n), |walk| walk.value(a, bytes, b, offset + n as u32 * size));
                }
                None => new += 1,
            }
        }
        if new > 0 {
            let path = format!("{}[…] ({new})", self.path);
            self.result.added.push(path);
        }
        let gone = (0..count(before)).filter(|n| position(before, now, *n).is_none()).count();
        if gone > 0 {
            self.result.dropped.push(format!("{}[…] ({gone})", self.path));
        }
    }

    fn is_same(&mut self, from: TypeId, to: TypeId) -> bool {
        if let Some(known) = self.same.get(&(from, to)) {
            return *known;
        }
        let (old, new) = (self.old(), &self.program.types);
        let same = match (old.get(from), new.get(to)) {
            (Type::Array { elem: a, dims: x }, Type::Array { elem: b, dims: y }) => x == y && self.is_same(*a, *b),
            (Type::Struct(a), Type::Struct(b)) => {
                let fields: Vec<_> = b.fields.iter().filter(|f| f.section != Section::InOut).collect();
                let union = |kind| kind == StructKind::Union;
                a.size == b.size
                    && union(a.kind) == union(b.kind)
                    && a.fields.len() == fields.len()
                    && a.fields
                        .iter()
                        .zip(fields)
                        .all(|(f, g)| f.offset == g.offset && key(&f.name) == key(&g.name) && self.is_same(f.ty, g.ty))
            }
            (Type::Enum(a), Type::Enum(b)) => a.base == b.base && a.members == b.members,
            (Type::Interface(_), Type::Pointer(_) | Type::Reference(_) | Type::Interface(_)) => true,
            (a, b) => a == b,
        };
        self.same.insert((from, to), same);
        same
    }
}

/// The number that element `n` of an array with one set of bounds has in another, if it is there.
fn position(of: &[(i64, i64)], within: &[(i64, i64)], n: u64) -> Option<u64> {
    let mut rest = n;
    let mut found = Vec::with_capacity(of.len());
    for (low, high) in of.iter().rev() {
        let len = high.abs_diff(*low) + 1;
        found.push(low + (rest % len) as i64);
        rest /= len;
    }
    found.iter().rev().zip(within).try_fold(0u64, |number, (index, (low, high))| {
        (low..=high).contains(&index).then(|| number * (high.abs_diff(*low) + 1) + index.abs_diff(*low))
    })
}
