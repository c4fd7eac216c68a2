//! What people and tools do to a running program. All of it goes through [`Engine::command`], between scans, so that it can be recorded and audited.

use crate::engine::Engine;
use crate::fault::FaultRecord;
use crate::force::{Forced, put};
use crate::retain::Reset;
use takt_ir::{Place, Program, Type};

/// A change from outside.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Command {
    /// Writes a variable once.
    Write {
        /// The variable.
        place: Place,
        /// Its bytes; of a bit, the byte around it with that bit.
        bytes: Box<[u8]>,
    },
    /// Holds a variable at a value: written before and after the programs of each scan, until it is released. What it was is remembered.
    Force {
        /// The variable.
        place: Place,
        /// As for a write.
        bytes: Box<[u8]>,
    },
    /// Lets a forced variable go.
    Release {
        /// The variable.
        place: Place,
        /// Puts back what it was before it was forced; else it keeps the forced value until the program writes it.
        restore: bool,
    },
    /// Lets all of them go.
    ReleaseAll {
        /// As for one.
        restore: bool,
    },
    /// Clears a fault and starts the program anew, with the retained values that this kind of restart keeps.
    Reset(Reset),
    /// Lets a task go on that a fault of its own stopped alone, with the variables as they are.
    ResetTask(u32),
    /// Stops the program as a fault does: axes are brought to rest, outputs go to their safe values.
    Halt,
}

/// Why a command on a variable, or a look at it, was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AccessError {
    /// The place lies outside the image.
    Outside,
    /// The place lies in the stack of a task or in the heap: what is there changes its meaning while the program runs.
    NotLasting,
    /// The value has another size than the variable.
    Size {
        /// Bytes of the variable.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// An array, a structure, a block, a pointer, a reference or an interface.
    NotElementary,
    /// A constant.
    Constant,
    /// More forces than there is room for.
    TooManyForces {
        /// Forces.
        most: usize,
        /// Bytes of their values.
        bytes: usize,
    },
    /// The variable is not forced.
    NotForced,
}

impl std::fmt::Display for AccessError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Outside => write!(f, "the variable lies outside the program's memory"),
            Self::NotLasting => write!(f, "the variable lies in a stack or in the heap and does not last; name one that does"),
            Self::Size { expected, found } => write!(f, "the variable has {expected} bytes, the value {found}"),
            Self::NotElementary => write!(f, "only elementary variables can be written; name a member or an element"),
            Self::Constant => write!(f, "a constant cannot be written"),
            Self::TooManyForces { most, bytes } => {
                write!(f, "there is room for {most} forces with {bytes} bytes together; release some")
            }
            Self::NotForced => write!(f, "the variable is not forced"),
        }
    }
}
impl std::error::Error for AccessError {}

/// Why a command was refused. Nothing has changed then, except where a reset failed.
#[derive(Debug, Clone, PartialEq)]
pub enum CommandError {
    /// The variable.
    Access(AccessError),
    /// The program cannot start: its initial values fault.
    Initial(Box<FaultRecord>),
    /// There is no such task, or no fault has stopped it alone.
    NotStopped,
}

impl std::fmt::Display for CommandError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Access(error) => write!(f, "{error}"),
            Self::Initial(record) => write!(f, "the initial values fault: {record}"),
            Self::NotStopped => write!(f, "no fault has stopped this task alone"),
        }
    }
}
impl std::error::Error for CommandError {}
impl From<AccessError> for CommandError {
    fn from(error: AccessError) -> Self {
        Self::Access(error)
    }
}

/// Where a variable that may be written from outside lies, and the bits of its first byte: it is elementary, no constant, and lasts.
///
/// Which bytes are a value of its type is for the caller to know ([`takt_ir::parse_value`]): nothing in the image is trusted.
pub fn writable(program: &Program, place: Place) -> Result<(std::ops::Range<usize>, u8), AccessError> {
    let Some(ty) = program.types.all().get(place.ty.0 as usize) else { return Err(AccessError::Outside) };
    let mask = match ty {
        Type::Bit(bit) => 1u8.checked_shl((*bit).into()).unwrap_or(0),
        Type::Elem(_) | Type::String(_) | Type::WString(_) | Type::Enum(_) | Type::Subrange { .. } => u8::MAX,
        _ => return Err(AccessError::NotElementary),
    };
    let start = u64::from(place.offset);
    let end = start + u64::from(program.types.size(place.ty));
    if place.offset < takt_ir::NULL_ZONE || end > program.image_size.into() {
        return Err(AccessError::Outside);
    }
    let meets = |first: u32, len: u32| len > 0 && u64::from(first) < end && start < u64::from(first) + u64::from(len);
    let stacks = program.tasks.iter().map(|task| task.stack);
    if stacks.chain([program.heap]).any(|(first, len)| meets(first, len)) {
        return Err(AccessError::NotLasting);
    }
    if program.globals.iter().any(|global| global.constant && meets(global.offset, program.types.size(global.ty))) {
        return Err(AccessError::Constant);
    }
    Ok((start as usize..end as usize, mask))
}

impl Engine {
    /// Does what is commanded. Allocates nothing, except for the record of a reset that fails.
    pub fn command(&mut self, command: &Command) -> Result<(), CommandError> {
        if !matches!(command, Command::Reset(_) | Command::Halt) {
            self.tell(command);
        }
        match command {
            Command::Write { place, bytes } => self.put(*place, bytes, false)?,
            Command::Force { place, bytes } => self.put(*place, bytes, true)?,
            Command::Release { place, restore } => {
                if !self.core.forces.release(Some(*place), self.core.image.bytes_mut(), *restore) {
                    return Err(AccessError::NotForced.into());
                }
            }
            // The last one first: of two forces on the same bytes the older knows what was there.
            Command::ReleaseAll { restore } => while self.core.forces.release(None, self.core.image.bytes_mut(), *restore) {},
            Command::Reset(kind) => self.reset(*kind).map_err(CommandError::Initial)?,
            Command::ResetTask(task) => {
                let release = self.core.tasks[self.core.bus].release;
                let stopped = self.core.tasks.get_mut(*task as usize).filter(|task| task.stopped.is_some());
                stopped.ok_or(CommandError::NotStopped)?.go_on(release);
            }
            Command::Halt => self.halt(),
        }
        Ok(())
    }

    fn put(&mut self, place: Place, bytes: &[u8], hold: bool) -> Result<(), AccessError> {
        let (range, mask) = writable(&self.core.program, place)?;
        if range.len() != bytes.len() {
            return Err(AccessError::Size { expected: range.len(), found: bytes.len() });
        }
        let core = self.core.as_mut();
        let target = core.image.bytes_mut().get_mut(range).ok_or(AccessError::Outside)?;
        if hold {
            core.forces.add(place, mask, bytes, target)?;
        }
        put(target, bytes, mask);
        Ok(())
    }

    /// A [`Command::Write`].
    pub fn write(&mut self, place: Place, bytes: &[u8]) -> Result<(), CommandError> {
        self.command(&Command::Write { place, bytes: bytes.into() })
    }

    /// A [`Command::Force`].
    pub fn force(&mut self, place: Place, bytes: &[u8]) -> Result<(), CommandError> {
        self.command(&Command::Force { place, bytes: bytes.into() })
    }

    /// The forced variables, in the order they were forced.
    pub fn forces(&self) -> impl Iterator<Item = Forced<'_>> {
        self.core.forces.iter()
    }

    /// How many variables are forced.
    pub fn force_count(&self) -> usize {
        self.core.forces.len()
    }

    /// A force by its number in [`Engine::forces`].
    pub fn force_at(&self, index: usize) -> Option<Forced<'_>> {
        self.core.forces.get(index)
    }
}
