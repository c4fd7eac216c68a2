//! Variables that outlive a restart, and variables of which tasks see a copy.

use crate::program::Program;
use crate::types::{StructKind, Type, TypeId};
use takt_abi::Section;

/// Bytes of the switch that start code looks at ([`Program::restart`]).
pub const RESTART_BYTES: u32 = 2;

/// How long a variable is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RetainKind {
    /// RETAIN: over a warm start, not over a cold one.
    Retain,
    /// PERSISTENT: over both.
    Persistent,
}

impl RetainKind {
    /// As it is written in ST.
    pub fn text(self) -> &'static str {
        match self {
            Self::Retain => "RETAIN",
            Self::Persistent => "PERSISTENT",
        }
    }
}

/// A variable that outlives a restart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Retained {
    /// Its instance path: `GVL.count`, `PLC_PRG.motor`.
    pub path: String,
    /// Type.
    pub ty: TypeId,
    /// Offset into the image.
    pub offset: u32,
    /// How long it is kept.
    pub kind: RetainKind,
}

/// A variable with `{attribute 'task_snapshot'}`: a task that does not write it sees, during a scan, the value it had at the start of that scan, or, where
/// another task was just writing it, the value before that task's scan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Latched {
    /// Type.
    pub ty: TypeId,
    /// Offset into the image.
    pub offset: u32,
    /// The tasks that write it, as indices into [`Program::tasks`].
    pub writers: Vec<u32>,
}

/// Bytes of a retained variable that are restored: first one, how many, and which bits of the first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// Offset into the image.
    pub offset: u32,
    /// Bytes.
    pub len: u32,
    /// Bits of the first byte.
    pub mask: u8,
}

/// What of a variable is restored: everything but pointers, references, interfaces and VAR_IN_OUT, which are offsets into the image of one run, and blocks
/// that own a resource (an open file), which are nothing without it. Padding may be in it.
pub fn restored(program: &Program, ty: TypeId, offset: u32, found: &mut dyn FnMut(Span)) {
    let types = &program.types;
    match types.get(ty) {
        Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) | Type::OpenArray { .. } | Type::Error => {}
        Type::Bit(bit) => found(Span { offset, len: 1, mask: 1u8.checked_shl((*bit).into()).unwrap_or(0) }),
        Type::Array { elem, .. } => {
            if is_plain(program, *elem) {
                return found(Span { offset, len: types.size(ty), mask: u8::MAX });
            }
            let stride = types.size(*elem).max(1);
            for n in 0..types.size(ty) / stride {
                restored(program, *elem, offset.saturating_add(n * stride), found);
            }
        }
        Type::Struct(_) if owns(program, ty, offset) => {}
        Type::Struct(s) if s.kind == StructKind::Union => {
            if is_plain(program, ty) {
                found(Span { offset, len: s.size, mask: u8::MAX });
            }
        }
        Type::Struct(s) => {
            for field in s.fields.iter().filter(|f| f.section != Section::InOut) {
                restored(program, field.ty, offset.saturating_add(field.offset), found);
            }
        }
        _ => found(Span { offset, len: types.size(ty), mask: u8::MAX }),
    }
}

/// Whether a block of that size at that offset owns a resource.
fn owns(program: &Program, ty: TypeId, offset: u32) -> bool {
    let found = program.resources.binary_search_by_key(&offset, |r| r.offset);
    found.is_ok_and(|i| program.resources[i].ty == ty)
}

/// Whether all bytes of a type are values: no pointers, bits or blocks in it.
pub fn is_plain(program: &Program, ty: TypeId) -> bool {
    match program.types.get(ty) {
        Type::Elem(_) | Type::String(_) | Type::WString(_) | Type::Enum(_) | Type::Subrange { .. } => true,
        Type::Array { elem, .. } => is_plain(program, *elem),
        Type::Struct(s) => matches!(s.kind, StructKind::Struct | StructKind::Union) && s.fields.iter().all(|f| is_plain(program, f.ty)),
        _ => false,
    }
}

/// Whether something in variables of a type is not restored.
pub fn is_partial(program: &Program, ty: TypeId) -> bool {
    match program.types.get(ty) {
        Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) => true,
        Type::Array { elem, .. } => is_partial(program, *elem),
        Type::Struct(s) => s.fields.iter().any(|f| f.section != Section::InOut && is_partial(program, f.ty)),
        _ => false,
    }
}
