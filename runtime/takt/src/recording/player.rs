//! A recording that is played back: forwards, backwards, to any scan.

use super::codec::{Damaged, Decoder, Item};
use super::file::{Chunks, FileError, Kind, Place};
use super::header::{Header, Identity, state_hash};
use super::host::{Answers, Played};
use super::writer::snapshot_of_bytes;
use crate::machine::{BuildError, Machine, Setup};
use crate::project::Project;
use std::any::Any;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use takt_abi::Time;
use takt_engine::{BusSize, Checkpoint, CheckpointError, Event, IoDriver, IoFault, ProcessImage};

/// Scans between the states that are kept for going back, at first.
const EVERY: u64 = 2_000;
/// States that are kept at the most; then every second one goes.
const KEPT: usize = 64;

/// Why a recording cannot be played.
#[derive(Debug)]
pub enum PlayError {
    /// The file.
    File(FileError),
    /// It belongs to another program.
    Other(PathBuf, Vec<String>),
    /// The program cannot be built.
    Build(Box<BuildError>),
    /// Its state does not fit.
    State(PathBuf, CheckpointError),
    /// The run is not the one that was recorded.
    Strayed {
        /// Where.
        cycle: u64,
        /// When.
        time: Time,
    },
    /// The run ended in another state.
    Differs {
        /// Hash of the recording.
        expected: String,
        /// Hash found.
        found: String,
    },
}

impl std::fmt::Display for PlayError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(error) => write!(f, "{error}"),
            Self::Other(path, differences) => {
                write!(f, "{} was not recorded with this program:", path.display())?;
                differences.iter().try_for_each(|difference| write!(f, "\n  {difference}"))?;
                write!(f, "\nreplay it with the sources that it was recorded with")
            }
            Self::Build(error) => write!(f, "{error}"),
            Self::State(path, error) => write!(f, "{}: its state cannot be restored: {error}", path.display()),
            Self::Strayed { cycle, time } => write!(
                f,
                "at {:.6} s (scan {cycle}) the program does something else than when it was recorded: the recording is damaged, or this is a defect of Takt",
                time.seconds()
            ),
            Self::Differs { expected, found } => {
                write!(
                    f,
                    "the run ended in another state than when it was recorded (hash {found}, expected {expected}); this is a defect of Takt"
                )
            }
        }
    }
}
impl std::error::Error for PlayError {}
impl From<FileError> for PlayError {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

/// Exchanges of the present step.
type Tape = Rc<RefCell<VecDeque<(Result<(), IoFault>, ProcessImage)>>>;

/// A bus that brings what was recorded.
struct PlayedBus {
    size: BusSize,
    tape: Tape,
}

impl IoDriver for PlayedBus {
    fn size(&self) -> BusSize {
        self.size
    }
    fn exchange(&mut self, _: Time, io: &mut ProcessImage) -> Result<(), IoFault> {
        let Some((result, inputs)) = self.tape.borrow_mut().pop_front() else { return Err(IoFault::Lost) };
        io.drives_in.clone_from(&inputs.drives_in);
        io.bits_in.clone_from(&inputs.bits_in);
        io.analog_in.clone_from(&inputs.analog_in);
        result
    }
    fn save(&self) -> Option<Box<dyn Any + Send>> {
        None
    }
}

/// A place in the recording that can be gone back to.
struct Saved {
    cycle: u64,
    steps: u64,
    chunk: usize,
    bytes: Vec<u8>,
    at: usize,
    decoder: Decoder,
    pending: Option<Item>,
    answers: Answers,
    state: Checkpoint,
}

/// A recording and the machine that plays it.
pub struct Player {
    machine: Machine,
    header: Header,
    chunks: Chunks,
    events: Vec<Place>,
    /// The next chunk of events.
    chunk: usize,
    bytes: Vec<u8>,
    at: usize,
    decoder: Decoder,
    pending: Option<Item>,
    tape: Tape,
    answers: Rc<RefCell<Answers>>,
    step_events: Vec<Event>,
    steps: u64,
    saved: Vec<Saved>,
    every: u64,
}

impl std::fmt::Debug for Player {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Player").field("file", &self.chunks.path()).field("cycle", &self.machine.cycles()).finish_non_exhaustive()
    }
}

impl Player {
    /// Opens a recording or a core file and restores the state that it starts at.
    pub fn open(path: &Path, project: &Project, setup: Setup) -> Result<Self, PlayError> {
        let chunks = Chunks::open(path)?;
        Self::of(chunks, project, setup)
    }

    /// The same with a file that is open.
    pub fn of(mut chunks: Chunks, project: &Project, setup: Setup) -> Result<Self, PlayError> {
        let header = header(&mut chunks)?;
        let size: BusSize = header.identity.bus.into();
        let first = chunks.list.iter().position(|place| place.kind == Kind::Checkpoint);
        let (tape, answers) = (Tape::default(), Rc::new(RefCell::new(Answers::default())));
        let mut now = None;
        let mut machine = {
            let (bus, host) = (tape.clone(), answers.clone());
            let wrap = |driver: Box<dyn IoDriver>, _| {
                now = Some(driver.size());
                (
                    Box::new(PlayedBus { size: driver.size(), tape: bus }) as Box<dyn IoDriver>,
                    Box::new(Played(host)) as Box<dyn takt_abi::Host>,
                )
            };
            Machine::wrapped(project, setup, wrap).map_err(|error| PlayError::Build(Box::new(error)))?
        };
        let identity = Identity::of(project, machine.compiled(), machine.program(), now.unwrap_or_default());
        let differences = header.identity.differences(&identity);
        if !differences.is_empty() {
            return Err(PlayError::Other(chunks.path().into(), differences));
        }
        machine.dismiss_operator();
        let Some(first) = first else {
            let at = chunks.cut.unwrap_or(8);
            return Err(damaged(&chunks, at, "there is no state to start at").into());
        };
        let events = chunks.list[first..].iter().filter(|place| place.kind == Kind::Events).copied().collect();
        let mut player = Self {
            machine,
            header,
            events,
            chunk: 0,
            bytes: Vec::new(),
            at: 0,
            decoder: Decoder::new(size),
            pending: None,
            tape,
            answers,
            step_events: Vec::new(),
            steps: 0,
            saved: Vec::new(),
            every: EVERY,
            chunks,
        };
        player.restore(player.chunks.list[first])?;
        Ok(player)
    }

    fn restore(&mut self, place: Place) -> Result<(), PlayError> {
        let bytes = self.chunks.read(place)?;
        let snapshot = snapshot_of_bytes(&bytes).ok_or_else(|| damaged(&self.chunks, place.at, "the state is cut"))?;
        let restored = self.machine.engine().restore(&snapshot.engine);
        restored.map_err(|error| PlayError::State(self.chunks.path().into(), error))?;
        self.answers.borrow_mut().calls = snapshot.calls;
        Ok(())
    }

    /// Goes on from the last state before the end of the file instead of from the first; of use in core files.
    pub fn skip_to_last_state(&mut self) -> Result<(), PlayError> {
        let Some(last) = self.chunks.list.iter().rposition(|place| place.kind == Kind::Checkpoint) else { return Ok(()) };
        let place = self.chunks.list[last];
        self.events = self.chunks.list[last..].iter().filter(|place| place.kind == Kind::Events).copied().collect();
        (self.chunk, self.at, self.pending) = (0, 0, None);
        self.bytes.clear();
        self.saved.clear();
        self.restore(place)
    }

    /// The machine as it is now.
    pub fn machine(&mut self) -> &mut Machine {
        &mut self.machine
    }
    /// What the file says of itself.
    pub fn header(&self) -> &Header {
        &self.header
    }
    /// The file.
    pub fn chunks(&mut self) -> &mut Chunks {
        &mut self.chunks
    }

    /// The next item of the recording.
    fn item(&mut self) -> Result<Option<Item>, PlayError> {
        if let Some(item) = self.pending.take() {
            return Ok(Some(item));
        }
        loop {
            let start = self.at;
            let place = self.chunk.checked_sub(1).map(|i| self.events[i].at).unwrap_or(8);
            match self.decoder.next(&self.bytes, &mut self.at) {
                Ok(Some(item)) => return Ok(Some(item)),
                Ok(None) => {}
                Err(Damaged { at, expected }) => {
                    let message = format!("in the item at byte {start} of the chunk: expected {expected} at byte {at}");
                    return Err(damaged(&self.chunks, place, message).into());
                }
            }
            let Some(next) = self.events.get(self.chunk).copied() else { return Ok(None) };
            self.bytes = self.chunks.read(next)?;
            (self.chunk, self.at) = (self.chunk + 1, 0);
        }
    }

    /// What belongs to the item before: up to the next step, command or mark.
    fn gather(&mut self) -> Result<(), PlayError> {
        self.step_events.clear();
        self.tape.borrow_mut().clear();
        while let Some(item) = self.item()? {
            match item {
                Item::Event(event) => self.step_events.push(event),
                Item::Exchange(result) => self.tape.borrow_mut().push_back((result, self.decoder.io().clone())),
                Item::Take(call, result) => self.answers.borrow_mut().taken.push_back((call, result)),
                Item::Refused(call, error) => self.answers.borrow_mut().refused.push_back((call, error)),
                Item::Mark | Item::Step(_) | Item::Command(_) => {
                    self.pending = Some(item);
                    break;
                }
            }
        }
        Ok(())
    }

    /// The next step, with the commands before it; false at the end.
    pub fn step(&mut self) -> Result<bool, PlayError> {
        self.keep();
        loop {
            let Some(item) = self.item()? else { return Ok(false) };
            match item {
                Item::Mark => {}
                Item::Command(command) => {
                    self.gather()?;
                    // What was refused then is refused now.
                    let _ = self.machine.engine().command(&command);
                }
                Item::Step(now) => {
                    self.gather()?;
                    let replayed = self.machine.replay(now, &self.step_events);
                    self.steps += 1;
                    if replayed.is_err() || !self.tape.borrow().is_empty() {
                        return Err(PlayError::Strayed { cycle: self.machine.cycles(), time: self.machine.engine().now() });
                    }
                    return Ok(true);
                }
                Item::Event(_) | Item::Exchange(_) | Item::Take(..) | Item::Refused(..) => {
                    let at = self.chunk.checked_sub(1).map_or(8, |i| self.events[i].at);
                    return Err(damaged(&self.chunks, at, "something happens outside of any step").into());
                }
            }
        }
    }

    /// Keeps a state for going back, now and then.
    fn keep(&mut self) {
        let cycle = self.machine.cycles();
        if self.saved.last().is_some_and(|last| cycle < last.cycle + self.every) {
            return;
        }
        let mut state = Checkpoint::default();
        self.machine.engine().checkpoint_into(&mut state);
        self.saved.push(Saved {
            cycle,
            steps: self.steps,
            chunk: self.chunk,
            bytes: self.bytes.clone(),
            at: self.at,
            decoder: self.decoder.clone(),
            pending: self.pending.clone(),
            answers: self.answers.borrow().clone(),
            state,
        });
        if self.saved.len() > KEPT {
            let mut number = 0;
            self.saved.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.every *= 2;
        }
    }

    /// Goes back to a scan of the fastest task, or as far as the recording reaches.
    pub fn back_to(&mut self, cycle: u64) -> Result<(), PlayError> {
        let index = self.saved.iter().rposition(|saved| saved.cycle <= cycle).unwrap_or(0);
        self.saved.truncate(index + 1);
        let Some(saved) = self.saved.last() else { return Ok(()) };
        let restored = self.machine.engine().restore(&saved.state);
        restored.map_err(|error| PlayError::State(self.chunks.path().into(), error))?;
        (self.chunk, self.at, self.steps) = (saved.chunk, saved.at, saved.steps);
        self.bytes.clone_from(&saved.bytes);
        self.decoder.clone_from(&saved.decoder);
        self.pending.clone_from(&saved.pending);
        self.answers.borrow_mut().clone_from(&saved.answers);
        while self.machine.cycles() < cycle && self.step()? {}
        Ok(())
    }

    /// Whether the recording was ended properly; then the state must be the one that it ended in.
    pub fn check_end(&mut self) -> Result<bool, PlayError> {
        if self.chunks.cut.is_some() || !self.chunks.list.iter().any(|place| place.kind == Kind::End) {
            return Ok(false);
        }
        let end = self.chunks.json(Kind::End)?;
        let Some(expected) = end.get("hash").and_then(serde_json::Value::as_str) else { return Ok(true) };
        let found = format!("{:016x}", state_hash(self.machine.engine()));
        if found == expected { Ok(true) } else { Err(PlayError::Differs { expected: expected.into(), found }) }
    }
}

/// The header of a file.
pub fn header(chunks: &mut Chunks) -> Result<Header, FileError> {
    let json = chunks.json(Kind::Header)?;
    serde_json::from_value(json).map_err(|error| damaged(chunks, 8, format!("the header: {error}")))
}

fn damaged(chunks: &Chunks, at: u64, message: impl Into<String>) -> FileError {
    FileError::Damaged { path: chunks.path().into(), at, message: message.into() }
}
