//! What goes between server and port. A job is made by the server with all the room it needs; the port fills it in.

use super::limits;
use std::sync::Arc;
use takt_abi::Time;
use takt_engine::{AccessError, Command, CommandError, FaultRecord, IoFault, TaskStatistics};
use takt_ir::Place;

/// Bytes of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// First byte.
    pub start: u32,
    /// How many.
    pub len: u32,
}

/// A job and when it was done.
#[derive(Debug)]
pub struct Job {
    /// Who asked; the port leaves it alone.
    pub ticket: u64,
    /// The task.
    pub work: Work,
    /// Scans of the bus task so far.
    pub cycle: u64,
    /// Machine time of the last step.
    pub time: Time,
}

impl Job {
    /// A job that is still to be done.
    pub fn new(ticket: u64, work: Work) -> Self {
        Self { ticket, work, cycle: 0, time: Time(0) }
    }
    /// Its batch, if it carries one.
    pub(super) fn batch(&mut self) -> Option<&mut Batch> {
        if let Work::Batch(batch) = &mut self.work { Some(batch) } else { None }
    }
}

/// An empty list with room for so many, all of which has been written to: no page of it is mapped while the port fills it.
fn room<T: Clone>(len: usize, of: T) -> Vec<T> {
    let mut list = vec![of; len];
    list.clear();
    list
}

/// Bytes for a read, all of which have been written to.
pub(super) fn bytes(spans: &[Span]) -> Vec<u8> {
    vec![1; length(spans)]
}

/// What is to be done.
#[derive(Debug)]
pub enum Work {
    /// Copies variables.
    Read {
        /// Which.
        spans: Arc<[Span]>,
        /// Their bytes, one behind the other; as long as all of them.
        bytes: Vec<u8>,
    },
    /// Does commands one behind the other, until one is refused.
    Commands {
        /// The commands.
        list: Vec<Item>,
        /// Why the one behind the last done was refused.
        refused: Option<CommandError>,
        /// How many were done.
        done: usize,
        /// Room that the forces took afterwards.
        forces: usize,
    },
    /// Copies what is known of the machine.
    Status(Box<Status>),
    /// Starts the statistics of the tasks anew.
    ResetStatistics,
    /// Pauses, steps, goes on, ends.
    Run {
        /// What.
        change: Change,
        /// How the machine was before.
        before: Mode,
    },
    /// Begins to copy variables after scans.
    Sample(Box<Sampler>),
    /// Values of a sampler; back to the port they are room for the next.
    Batch(Batch),
    /// Ends a sampler, by its ticket; its room comes back.
    EndSample(Option<Box<Sampler>>),
}

/// A command and what the variable was.
#[derive(Debug)]
pub struct Item {
    /// The command.
    pub command: Command,
    /// As many bytes as the variable has: what it was.
    pub old: Box<[u8]>,
    /// As many bytes: what it is now.
    pub new: Box<[u8]>,
}

/// How a machine runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// It runs.
    Running,
    /// It stands between two scans.
    Paused,
    /// So many scans of the fastest task are still to be done.
    Stepping(u64),
}

/// How it shall run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Stand still between two scans.
    Pause,
    /// So many scans.
    Step(u64),
    /// Run.
    Continue,
    /// End the run.
    Stop,
}

/// What is known of a machine.
#[derive(Debug)]
pub struct Status {
    /// Per task.
    pub tasks: Vec<TaskStatistics>,
    /// How it runs.
    pub mode: Mode,
    /// The fault that stopped the program.
    pub fault: Option<Arc<FaultRecord>>,
    /// Per task, the fault that stopped it alone.
    pub stopped: Vec<Option<Arc<FaultRecord>>>,
    /// Why the last exchange failed.
    pub io_fault: Option<IoFault>,
    /// How many failed.
    pub io_faults: u64,
    /// Whether all axes stand still with their drives off.
    pub at_rest: bool,
    /// Forced variables, in the order they were forced.
    pub forces: Vec<Place>,
    /// Their values, and what was there before, alternately.
    pub bytes: Vec<u8>,
}

impl Status {
    /// With room for everything.
    pub fn new(tasks: usize) -> Self {
        Self {
            tasks: vec![TaskStatistics::default(); tasks],
            mode: Mode::Running,
            fault: None,
            stopped: vec![None; tasks],
            io_fault: None,
            io_faults: 0,
            at_rest: false,
            forces: room(takt_engine::FORCES, Place { offset: 1, ty: takt_ir::TypeId(0) }),
            bytes: room(2 * takt_engine::FORCED_BYTES, 1),
        }
    }
}

/// Copies variables after every so many scans.
#[derive(Debug)]
pub struct Sampler {
    /// As of the job that began it.
    pub ticket: u64,
    /// Which variables.
    pub spans: Arc<[Span]>,
    /// After every so many scans of the bus task.
    pub every: u64,
    /// Scan of the bus task that comes next.
    pub next: u64,
    /// The batch that is being filled.
    pub filling: Option<Box<Job>>,
    /// Batches that are empty.
    pub spare: Vec<Box<Job>>,
    /// Scans that were not copied because there was no room.
    pub missed: u64,
}

/// Values of a few scans.
#[derive(Debug)]
pub struct Batch {
    /// Scan and time of each row.
    pub stamps: Vec<(u64, Time)>,
    /// The rows.
    pub bytes: Vec<u8>,
    /// Rows that there is room for.
    pub rows: usize,
    /// Scans that were not copied before the first row.
    pub missed: u64,
}

/// Batches of a sampler.
pub const BATCHES: usize = 4;
/// Bytes of a batch, about.
const BATCH: usize = 16 << 10;
/// Rows of a batch at the most.
const ROWS: usize = 64;

impl Sampler {
    /// With all its room; `row` is the sum of the lengths.
    pub fn new(ticket: u64, spans: Arc<[Span]>, every: u64, row: usize) -> Self {
        let rows = (BATCH / row.max(1)).clamp(1, ROWS);
        let batch = || Batch { stamps: room(rows, (1, Time(1))), bytes: room(rows * row, 1), rows, missed: 0 };
        let batch = || Box::new(Job::new(ticket, Work::Batch(batch())));
        Self { ticket, spans, every, next: 0, filling: None, spare: (0..BATCHES).map(|_| batch()).collect(), missed: 0 }
    }
}

/// The bytes of all spans.
pub fn length(spans: &[Span]) -> usize {
    spans.iter().map(|span| span.len as usize).sum()
}

/// Why a place cannot be copied.
pub fn span(program: &takt_ir::Program, place: Place) -> Result<Span, AccessError> {
    let len = program.types.all().get(place.ty.0 as usize).map(|_| program.types.size(place.ty)).ok_or(AccessError::Outside)?;
    if u64::from(place.offset) + u64::from(len) > program.image_size.into() {
        return Err(AccessError::Outside);
    }
    if len as usize > limits::BYTES {
        return Err(AccessError::Size { expected: limits::BYTES, found: len as usize });
    }
    Ok(Span { start: place.offset, len })
}
