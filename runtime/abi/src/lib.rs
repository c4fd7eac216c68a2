//! The contract between compiled Structured Text and native blocks.
//!
//! Everything that machine code, the interpreter, the engine and the block library must agree on stands here: what a plain value looks like in the
//! image ([`Plain`]), how a block describes itself ([`BlockDesc`], written by [`function_block!`]), what a scan hands to a block ([`Cx`]),
//! how a scan fails ([`Fault`]) and how a block reaches the world outside ([`Host`]).
//!
//! **Invariants.** No machine address is stored in the image: a pointer is an offset, 0 is NULL. A native block never borrows Rust references
//! into the image while its body runs: it works on a copy of its fields, and every load and store through [`Cx`] is checked.

mod axis;
mod block;
mod class;
mod context;
mod desc;
mod fault;
mod heap;
mod host;
mod plain;
mod resource;
mod system;

pub use axis::{AxisRef, AxisState, BufferMode, ControllerMode, Direction, SmcError};
pub use block::{Arg, run_block, run_function};
pub use class::{Classes, GRANULE};
pub use context::{Context, Cx, Env, PollFn, TRACE_DEPTH};
pub use desc::{BlockDesc, Elem, EnumDesc, FieldDesc, FieldType, FnDesc, Library, NativeFn, ParamDesc, Section, StructDesc};
pub use fault::Fault;
pub use heap::Heap;
pub use host::{CHUNK, Chunk, Folder, Host, HostError, NoHost, Request, Ticket};
pub use plain::{
    Bool, Byte, Dword, InOut, Lword, OpenArray, Plain, Ptr, StChar, StDate, StDateTime, StLdate, StLdateTime, StLtime, StLtimeOfDay,
    StTime, StTimeOfDay, StWchar, Str, WStr, Word,
};
pub use resource::{Handle, Resource, Resources};
pub use system::{AppInfo, Message, MessageLevel, Messages, TaskInfo};

/// A point or span of machine time in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Hash)]
pub struct Time(pub i64);

impl Time {
    /// The span in seconds.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }
    /// Whole milliseconds as a span.
    pub const fn from_millis(ms: i64) -> Self {
        Self(ms * 1_000_000)
    }
}
