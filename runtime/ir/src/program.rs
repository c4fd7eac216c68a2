//! A complete program.

use crate::inst::{Body, BodyId};
use crate::types::{TypeId, Types};
use takt_abi::NativeFn;

/// Bytes at the start of the image that no variable uses, so that NULL and its neighbours are never valid.
pub const NULL_ZONE: u32 = 16;

/// A native function or block body.
#[derive(Debug, Clone, Copy)]
pub struct Native {
    /// ST name.
    pub name: &'static str,
    /// What is called.
    pub call: NativeFn,
}

/// A place in a source file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Site {
    /// Index into [`Program::files`].
    pub file: u32,
    /// From 1.
    pub line: u32,
    /// In characters, from 1.
    pub column: u32,
    /// The body it stands in.
    pub body: BodyId,
}

/// What starts a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// Every so many nanoseconds.
    Cyclic(i64),
    /// Rising edge of the BOOL at this offset.
    Event(u32),
    /// As often as possible.
    Freewheeling,
}

/// A task.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Name.
    pub name: String,
    /// When.
    pub trigger: Trigger,
    /// 0 is the highest.
    pub priority: u32,
    /// Without parameters; calls the programs of the task.
    pub entry: BodyId,
    /// The task's own stack region: first byte and bytes.
    pub stack: (u32, u32),
}

/// A variable that can be named from outside: a global (`GVL.x`, plain `x`) or a program instance.
#[derive(Debug, Clone, PartialEq)]
pub struct Global {
    /// Name, with its list's name where it has one: `GVL.Theta1`, `PLC_PRG`.
    pub name: String,
    /// May be named without its list.
    pub bare: bool,
    /// Type.
    pub ty: TypeId,
    /// Offset into the image.
    pub offset: u32,
    /// CONSTANT.
    pub constant: bool,
    /// Documentation.
    pub doc: String,
}

/// A block instance that owns a resource.
#[derive(Debug, Clone, Copy)]
pub struct ResourceInstance {
    /// Offset of the instance.
    pub offset: u32,
    /// Makes it.
    pub make: fn() -> Box<dyn takt_abi::Resource>,
}

/// A program, ready to be verified and run.
#[derive(Debug, Clone, Default)]
pub struct Program {
    /// Bodies.
    pub bodies: Vec<Body>,
    /// Native functions that bodies call.
    pub natives: Vec<Native>,
    /// Constant bytes.
    pub data: Vec<u8>,
    /// Places.
    pub sites: Vec<Site>,
    /// Source files, as shown to people.
    pub files: Vec<String>,
    /// Bytes of the image, stack regions included. Multiple of 16.
    pub image_size: u32,
    /// First bytes of the image at start (the rest is 0).
    pub init: Vec<u8>,
    /// Runs once before the first scan, if there is anything that cannot be bytes.
    pub init_body: Option<BodyId>,
    /// Tasks, in declared order. Not empty.
    pub tasks: Vec<Task>,
    /// Types.
    pub types: Types,
    /// Variables.
    pub globals: Vec<Global>,
    /// Block instances with resources, in order of their offsets.
    pub resources: Vec<ResourceInstance>,
}
