//! Paths of block instances by their offsets, for people who look at a call stack.

use crate::program::Program;
use crate::types::{StructKind, Type, TypeId};
use std::fmt::Write;

/// The path of the instance of a block at an offset of the image: the one of the type that is called `block`, else the outermost that begins there.
/// `None` where none does: on the heap, in a frame.
pub fn instance_at(program: &Program, offset: u32, block: &str) -> Option<String> {
    let size = |ty: TypeId| program.types.size(ty);
    let inside = |start: u32, ty: TypeId| offset >= start && u64::from(offset) < u64::from(start) + u64::from(size(ty));
    let global = program.globals.iter().find(|global| inside(global.offset, global.ty) && !global.constant)?;
    let (mut path, mut start, mut ty) = (global.name.clone(), global.offset, global.ty);
    let mut outermost = None;
    loop {
        match program.types.get(ty) {
            Type::Struct(structure) => {
                if start == offset && matches!(structure.kind, StructKind::Block | StructKind::Program) {
                    if structure.name.eq_ignore_ascii_case(block) {
                        return Some(path);
                    }
                    outermost.get_or_insert_with(|| path.clone());
                }
                let Some(field) = structure.fields.iter().find(|field| inside(start + field.offset, field.ty)) else { return outermost };
                let _ = write!(path, ".{}", field.name);
                (start, ty) = (start + field.offset, field.ty);
            }
            Type::Array { elem, dims } => {
                let stride = size(*elem).max(1);
                let mut number = i64::from((offset - start) / stride);
                start += (offset - start) / stride * stride;
                let mut indices = Vec::new();
                for (low, high) in dims.iter().rev() {
                    let count = (high - low + 1).max(1);
                    indices.push((low + number % count).to_string());
                    number /= count;
                }
                indices.reverse();
                let _ = write!(path, "[{}]", indices.join(","));
                ty = *elem;
            }
            _ => return outermost,
        }
    }
}
