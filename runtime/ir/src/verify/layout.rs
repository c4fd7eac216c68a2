//! Types and variables: what tools read of the image stays inside it.

use super::{Defect, ensure, in_image};
use crate::program::Program;
use crate::types::{Type, TypeId, Types};
use takt_abi::Section;

/// Nesting of types beyond which a program is refused.
const DEEPEST: usize = 200;

pub(super) fn check(program: &Program) -> Result<(), Defect> {
    let mut sizes = Sizes { types: &program.types, known: vec![None; program.types.all().len()] };
    for id in 0..program.types.all().len() {
        sizes.of(TypeId(id as u32), 0)?;
    }
    for (i, global) in program.globals.iter().enumerate() {
        let size = u32::try_from(sizes.of(global.ty, 0)?).map_err(|_| Defect::Global(i))?;
        ensure(in_image(program, global.offset, size), Defect::Global(i))?;
    }
    for (i, (start, len)) in program.areas.ranges.into_iter().enumerate() {
        ensure(len == 0 || in_image(program, start, len), Defect::Area(i))?;
    }
    for (i, mapped) in program.mapped.iter().enumerate() {
        let size = u32::try_from(sizes.of(mapped.ty, 0)?).map_err(|_| Defect::Mapped(i))?;
        let there = if mapped.bit.is_some() { 1 } else { size };
        let bool = *program.types.get(mapped.ty) == Type::Elem(takt_abi::Elem::Bool);
        let bit = mapped.bit.is_none_or(|bit| bit < 8 && bool);
        ensure(bit && in_image(program, mapped.offset, size) && in_image(program, mapped.address, there), Defect::Mapped(i))?;
    }
    for (i, retained) in program.retained.iter().enumerate() {
        let size = u32::try_from(sizes.of(retained.ty, 0)?).map_err(|_| Defect::Retained(i))?;
        ensure(in_image(program, retained.offset, size), Defect::Retained(i))?;
    }
    let switch = program.restart == 0 || in_image(program, program.restart, crate::retain::RESTART_BYTES);
    ensure(switch, Defect::Retained(program.retained.len()))?;
    for resource in &program.resources {
        sizes.of(resource.ty, 0)?;
    }
    let mut taken: Vec<(u64, u64)> = Vec::new();
    for (i, latched) in program.latched.iter().enumerate() {
        let size = u32::try_from(sizes.of(latched.ty, 0)?).map_err(|_| Defect::Latched(i))?;
        let tasks = latched.writers.iter().all(|task| (*task as usize) < program.tasks.len());
        let (start, end) = (u64::from(latched.offset), u64::from(latched.offset) + u64::from(size));
        let apart = taken.iter().all(|(s, e)| end <= *s || *e <= start);
        let stacks = program.tasks.iter().all(|t| {
            let (s, len) = (u64::from(t.stack.0), u64::from(t.stack.1));
            len == 0 || end <= s || s + len <= start
        });
        ensure(tasks && apart && stacks && in_image(program, latched.offset, size), Defect::Latched(i))?;
        taken.push((start, end));
    }
    Ok(())
}

/// Bytes of each type, once known.
struct Sizes<'a> {
    types: &'a Types,
    known: Vec<Option<u64>>,
}

impl Sizes<'_> {
    fn of(&mut self, id: TypeId, depth: usize) -> Result<u64, Defect> {
        let index = id.0 as usize;
        ensure(index < self.known.len() && depth < DEEPEST, Defect::Type(id.0))?;
        if let Some(size) = self.known[index] {
            return Ok(size);
        }
        let types = self.types;
        let size = match types.get(id) {
            Type::Array { elem, dims } => {
                let mut size = self.of(*elem, depth + 1)?;
                for (low, high) in dims {
                    let count = u64::try_from(i128::from(*high) - i128::from(*low) + 1).map_err(|_| Defect::Type(id.0))?;
                    size = size.checked_mul(count).filter(|s| *s <= u32::MAX.into()).ok_or(Defect::Type(id.0))?;
                }
                size
            }
            Type::Struct(s) => {
                for field in &s.fields {
                    let end = self.field(field.ty, field.section, depth)? + u64::from(field.offset);
                    ensure(end <= s.size.into(), Defect::Type(id.0))?;
                }
                s.size.into()
            }
            Type::OpenArray { elem, dims } => {
                self.exists(*elem)?;
                8 + 16 * u64::from(*dims)
            }
            Type::Pointer(target) | Type::Reference(target) => {
                self.exists(*target)?;
                8
            }
            Type::String(n) => u64::from(*n) + 1,
            Type::WString(n) => 2 * u64::from(*n) + 2,
            Type::Bit(n) => {
                ensure(*n < 8, Defect::Type(id.0))?;
                1
            }
            Type::Elem(_) | Type::Enum(_) | Type::Subrange { .. } | Type::Interface(_) | Type::Error => types.size(id).into(),
        };
        ensure(size <= u32::MAX.into(), Defect::Type(id.0))?;
        self.known[index] = Some(size);
        Ok(size)
    }
    /// Bytes of a member: those of its type, or of the offset that a VAR_IN_OUT holds.
    fn field(&mut self, ty: TypeId, section: Section, depth: usize) -> Result<u64, Defect> {
        self.exists(ty)?;
        match self.types.get(ty) {
            Type::OpenArray { .. } => self.of(ty, depth + 1),
            _ if section == Section::InOut => Ok(8),
            _ => self.of(ty, depth + 1),
        }
    }
    fn exists(&self, id: TypeId) -> Result<(), Defect> {
        ensure((id.0 as usize) < self.known.len(), Defect::Type(id.0))
    }
}
