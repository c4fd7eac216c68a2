//! A complete program.

use crate::address::{Areas, Mapped};
use crate::inst::{Body, BodyId, Local, Ty};
use crate::retain::{Latched, Retained};
use crate::types::{TypeId, Types};
use std::collections::BTreeMap;
use takt_abi::{Classes, GRANULE, Heap, NativeFn};

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
    /// Rising edge of the BOOL at this offset, or of a bit of the byte there.
    Event(u32, Option<u8>),
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
    /// A fault stops this task alone, not the application.
    pub isolated: bool,
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
    /// Its type.
    pub ty: TypeId,
    /// Makes it.
    pub make: fn() -> Box<dyn takt_abi::Resource>,
}

/// A block type whose instances calls may be dispatched on. Classes are numbered from 1 ([`Program::class`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Class {
    /// Name of the type.
    pub name: String,
    /// Bytes of an instance, a multiple of [`takt_abi::GRANULE`].
    pub size: u32,
}

/// Instances of one class that lie one behind the other when the program starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Instances {
    /// Offset of the first one, a multiple of [`takt_abi::GRANULE`].
    pub offset: u32,
    /// Number of the class.
    pub class: u32,
    /// How many.
    pub count: u32,
}

/// What a call of a method that types may override means for each class.
#[derive(Debug, Clone, PartialEq)]
pub struct Dispatch {
    /// As people know it: `I_Axis.Enable`.
    pub name: String,
    /// Types of the parameters behind the instance.
    pub params: Vec<Ty>,
    /// Result.
    pub result: Option<Ty>,
    /// Number of the class that the first target is for.
    pub low: u32,
    /// The body per class; the first parameter is the instance. `None`: the class has no such method.
    pub targets: Vec<Option<BodyId>>,
}

impl Dispatch {
    /// The body for a class.
    pub fn target(&self, class: u32) -> Option<BodyId> {
        *self.targets.get(class.checked_sub(self.low)? as usize)?
    }
}

/// The classes that are of a type: those that extend a block or implement an interface.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Family {
    /// Name of the type.
    pub name: String,
    /// Number of the class that the first member is for.
    pub low: u32,
    /// Whether the class belongs to it.
    pub members: Vec<bool>,
}

impl Family {
    /// Whether a class belongs to it.
    pub fn has(&self, class: u32) -> bool {
        class.checked_sub(self.low).and_then(|i| self.members.get(i as usize)).is_some_and(|member| *member)
    }
}

/// Where a variable of a call is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Home {
    /// In a local.
    Local(Local),
    /// In the body's frame.
    Frame(u32),
    /// Behind the address in a local.
    Behind(Local),
}

/// Variables of a body that live for one call.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Variables {
    /// The first parameter is the instance that the body runs on.
    pub instance: bool,
    /// Names, types and places, in declared order; the result last.
    pub list: Vec<(String, TypeId, Home)>,
}

/// A program, ready to be verified and run.
#[derive(Debug, Clone, Default)]
pub struct Program {
    /// Name of the project.
    pub name: String,
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
    /// Classes.
    pub classes: Vec<Class>,
    /// What instances of classes stand where at the start.
    pub instances: Vec<Instances>,
    /// Methods that are found by class.
    pub dispatch: Vec<Dispatch>,
    /// Types that are asked for at run time.
    pub families: Vec<Family>,
    /// Where what is addressed directly lies.
    pub areas: Areas,
    /// Variables that VAR_CONFIG gives addresses.
    pub mapped: Vec<Mapped>,
    /// Variables that outlive a restart.
    pub retained: Vec<Retained>,
    /// Offset of two bytes that code at the start looks at, 0 if it does not: the first one is not 0 when retained values were put back, so that they are
    /// not initialised again; the second one belongs to that code.
    pub restart: u32,
    /// Variables of which tasks see a copy.
    pub latched: Vec<Latched>,
    /// Variables of a call, by body, for people who look at a fault.
    pub variables: BTreeMap<BodyId, Variables>,
    /// The heap of `__NEW`: first byte and bytes (16 · 2ⁿ, or 0).
    pub heap: (u32, u32),
}

impl Program {
    /// A class by its number.
    pub fn class(&self, number: u32) -> Option<&Class> {
        self.classes.get(number.checked_sub(1)? as usize)
    }
    /// The table of instances as it is at the start; empty without classes.
    pub fn instances(&self) -> Classes {
        if self.classes.is_empty() {
            return Classes::default();
        }
        let table = Classes::new(self.image_size.into());
        for run in &self.instances {
            let stride = self.class(run.class).map_or(GRANULE, |class| class.size.into());
            table.put(run.offset.into(), run.class, stride, run.count.into());
        }
        table
    }
    /// The heap as it is at the start.
    pub fn heap(&self) -> Heap {
        Heap::new(self.heap.0, self.heap.1)
    }
}
