//! The verifier: a program that it accepts can touch nothing but its own image.
//!
//! It runs before either executor and trusts nobody: types and numbers of operands, the extent of every access, addresses that are written before they
//! are read, calls, tasks and their stack regions, tables. What depends on values is checked where it happens, by [`crate::Inst::Index`],
//! [`crate::Inst::Check`], [`crate::Inst::Deref`] and at the entry of bodies.
//!
//! **What it does not promise:** that a loop polls (a compiler may prove a trip count), that two variables do not overlap (a UNION wants that), that a
//! program has a task, or that a native function takes as many words as it is handed ([`crate::Native`] does not tell).

use crate::inst::{BlockId, BodyId, Ty};
use crate::program::{NULL_ZONE, Program, Trigger};

mod body;
mod calls;
mod classes;
mod flow;
mod layout;

/// Why a program is refused, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VerifyError {
    /// The body, if it is about one.
    pub body: Option<BodyId>,
    /// Its block.
    pub block: Option<BlockId>,
    /// Instruction in the block, from 0; the number of instructions for its end.
    pub inst: Option<usize>,
    /// What is wrong.
    pub defect: Defect,
}

/// What is wrong with a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Defect {
    /// A local that the body does not have.
    Local(u32),
    /// A block that the body does not have (or it has none).
    Block(u32),
    /// A body that the program does not have.
    Body(u32),
    /// A native function that the program does not have.
    Native(u32),
    /// A site that the program does not have, or one whose file or body it does not have.
    Site(u32),
    /// A type that the program does not have, that contains itself, or whose members leave it.
    Type(u32),
    /// A local of another type than is needed here.
    Mismatch {
        /// What is needed.
        expected: Ty,
        /// What is there. An address must have at least the extent that is needed.
        found: Ty,
    },
    /// An address where a number is needed or may be the result.
    Address,
    /// No address where one is needed.
    NoAddress,
    /// Too many or too few operands or parameters.
    Arity {
        /// As many are taken.
        expected: usize,
        /// As many are given.
        found: usize,
    },
    /// A result where there is none, or none where there is one.
    Result,
    /// An access that leaves its base (or touches the null zone).
    Extent {
        /// First byte behind the base.
        from: u64,
        /// Byte behind the last one; huge where an index may lead anywhere.
        to: u64,
        /// Bytes of the base.
        size: u64,
    },
    /// A lower bound above the upper one.
    Bounds {
        /// Lower.
        low: i64,
        /// Upper.
        high: i64,
    },
    /// A range outside the constant bytes.
    Data {
        /// First byte.
        from: u32,
        /// Bytes.
        len: u32,
    },
    /// A label that a switch has twice.
    Label(i64),
    /// An address that may be read before it is written.
    Unassigned(u32),
    /// More parameters than locals.
    Parameters,
    /// A size that is no multiple of 16, or an image smaller than its null zone.
    Size(u32),
    /// A body on a cycle of calls that is not marked as recursive.
    Recursion,
    /// More initial bytes than the image has.
    Init,
    /// A body that starts from outside takes parameters.
    Entry,
    /// The stack region of this task leaves the image, touches the null zone, or overlaps the one of an earlier task.
    Stack(usize),
    /// A period of this task that is not positive, or an event outside the image.
    Trigger(usize),
    /// This variable leaves the image.
    Global(usize),
    /// Resources not in rising order of their offsets, or outside the image.
    Resources,
    /// A class that the program does not have, whose size is no multiple of the granule, or whose instances leave their place.
    Class(u32),
    /// A method that the program does not have, or whose bodies do not take its parameters and an instance of their class.
    Method(u32),
    /// A family that the program does not have.
    Family(u32),
    /// A heap that leaves the image or overlaps the stack region of a task, or is not 16 · 2ⁿ bytes long.
    Heap,
    /// An area of direct addresses that leaves the image.
    Area(usize),
    /// A variable with an address from VAR_CONFIG that leaves the image, as its address does, or a bit that is no BOOL.
    Mapped(usize),
    /// This retained variable leaves the image, or the switch of the start code does.
    Retained(usize),
    /// This variable with a copy per task leaves the image, overlaps another one, or names a task that the program does not have.
    Latched(usize),
    /// A handler that does not begin with [`crate::Inst::Catch`], or one of these anywhere else.
    Handler,
}

impl std::fmt::Display for Defect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Local(n) => write!(f, "there is no local {n}"),
            Self::Block(n) => write!(f, "there is no block {n}"),
            Self::Body(n) => write!(f, "there is no body {n}"),
            Self::Native(n) => write!(f, "there is no native function {n}"),
            Self::Site(n) => write!(f, "there is no site {n}, or its file or body is missing"),
            Self::Type(n) => write!(f, "type {n} is missing, contains itself, or its members leave it"),
            Self::Mismatch { expected, found } => write!(f, "expected {expected:?}, found {found:?}"),
            Self::Address => write!(f, "an address may not stand here"),
            Self::NoAddress => write!(f, "an address is needed here"),
            Self::Arity { expected, found } => write!(f, "expected {expected} operands, found {found}"),
            Self::Result => write!(f, "a result where there is none, or none where there is one"),
            Self::Extent { from, to, size } => write!(f, "bytes {from}..{to} leave the {size} bytes of their base"),
            Self::Bounds { low, high } => write!(f, "the bounds {low}..{high} are empty"),
            Self::Data { from, len } => write!(f, "{len} bytes from {from} leave the constant bytes"),
            Self::Label(value) => write!(f, "the label {value} stands twice"),
            Self::Unassigned(n) => write!(f, "the address in local {n} may be read before it is written"),
            Self::Parameters => write!(f, "more parameters than locals"),
            Self::Size(n) => write!(f, "{n} is no size for an image or frame"),
            Self::Recursion => write!(f, "the body calls itself, directly or through others, and is not marked as recursive"),
            Self::Init => write!(f, "more initial bytes than the image has"),
            Self::Entry => write!(f, "a body that is started from outside takes parameters"),
            Self::Stack(n) => write!(f, "the stack region of task {n} leaves the image or overlaps another"),
            Self::Trigger(n) => write!(f, "the trigger of task {n} is impossible"),
            Self::Global(n) => write!(f, "variable {n} leaves the image"),
            Self::Class(n) => write!(f, "class {n} is missing, or its instances leave their place"),
            Self::Method(n) => write!(f, "method {n} is missing, or one of its bodies takes other parameters"),
            Self::Family(n) => write!(f, "there is no family {n}"),
            Self::Heap => write!(f, "the heap leaves the image, overlaps a stack region or has no possible size"),
            Self::Area(n) => write!(f, "area {n} of direct addresses leaves the image"),
            Self::Mapped(n) => write!(f, "variable {n} of VAR_CONFIG leaves the image, or its bit is no BOOL"),
            Self::Retained(n) => write!(f, "retained variable {n} leaves the image, or the switch of the start code does"),
            Self::Latched(n) => {
                write!(f, "variable {n} with a copy per task leaves the image, overlaps another one, or names a task that is missing")
            }
            Self::Handler => write!(f, "a fault is caught where no handler begins, or a handler does not catch it"),
            Self::Resources => write!(f, "resources are not in rising order or leave the image"),
        }
    }
}

impl std::fmt::Display for VerifyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (what, number) in
            [("body", self.body.map(|b| b.0 as usize)), ("block", self.block.map(|b| b.0 as usize)), ("instruction", self.inst)]
        {
            if let Some(number) = number {
                write!(f, "{what} {number}: ")?;
            }
        }
        write!(f, "{}", self.defect)
    }
}
impl std::error::Error for VerifyError {}

impl From<Defect> for VerifyError {
    fn from(defect: Defect) -> Self {
        Self { body: None, block: None, inst: None, defect }
    }
}

/// Checks everything that the sandbox relies on.
pub fn verify(program: &Program) -> Result<(), VerifyError> {
    tables(program)?;
    layout::check(program)?;
    tasks(program)?;
    classes::check(program)?;
    for id in 0..program.bodies.len() {
        body::check(program, BodyId(id as u32))?;
    }
    calls::check(program)
}

fn ensure(fine: bool, defect: Defect) -> Result<(), Defect> {
    if fine { Ok(()) } else { Err(defect) }
}

fn tables(program: &Program) -> Result<(), Defect> {
    let size = program.image_size;
    ensure(size.is_multiple_of(16) && size >= NULL_ZONE, Defect::Size(size))?;
    ensure(program.init.len() as u64 <= size.into(), Defect::Init)?;
    for (i, site) in program.sites.iter().enumerate() {
        let known = (site.file as usize) < program.files.len() && (site.body.0 as usize) < program.bodies.len();
        ensure(known, Defect::Site(i as u32))?;
    }
    let rising = program.resources.windows(2).all(|pair| pair[0].offset < pair[1].offset);
    ensure(rising && program.resources.iter().all(|r| in_image(program, r.offset, 1)), Defect::Resources)
}

/// Whether `len` bytes from `offset` lie behind the null zone and inside the image.
fn in_image(program: &Program, offset: u32, len: u32) -> bool {
    offset >= NULL_ZONE && u64::from(offset) + u64::from(len) <= program.image_size.into()
}

fn tasks(program: &Program) -> Result<(), Defect> {
    for (i, task) in program.tasks.iter().enumerate() {
        entry(program, task.entry)?;
        let (start, len) = task.stack;
        let apart = |other: &(u32, u32)| {
            u64::from(start) + u64::from(len) <= other.0.into() || u64::from(other.0) + u64::from(other.1) <= start.into()
        };
        let fine = len == 0 || in_image(program, start, len) && program.tasks[..i].iter().all(|t| t.stack.1 == 0 || apart(&t.stack));
        ensure(fine, Defect::Stack(i))?;
        let possible = match task.trigger {
            Trigger::Cyclic(period) => period > 0,
            Trigger::Event(offset, bit) => in_image(program, offset, 1) && bit.is_none_or(|bit| bit < 8),
            Trigger::Freewheeling => true,
        };
        ensure(possible, Defect::Trigger(i))?;
    }
    program.init_body.map_or(Ok(()), |body| entry(program, body))
}

fn entry(program: &Program, id: BodyId) -> Result<(), Defect> {
    let body = program.bodies.get(id.0 as usize).ok_or(Defect::Body(id.0))?;
    ensure(body.params == 0, Defect::Entry)
}

#[cfg(test)]
mod tests;
