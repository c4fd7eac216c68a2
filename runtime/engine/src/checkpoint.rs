//! Checkpoints: everything between two steps that a later step depends on.
//!
//! [`Engine::restore`] puts a checkpoint of the same program and configuration back, and the run goes on as it went on then: image, instances, heap,
//! resources, tasks, axes, forces, faults, what went over the bus last. In the same process also what is behind a simulated bus, and requests to the host.
//! A checkpoint that comes from a file is checked as a whole before anything is changed. Statistics of execution times are no part of it.

use crate::bus::{IoFault, ProcessImage};
use crate::core::Core;
use crate::engine::Engine;
use crate::fault::RawFault;
use crate::force::Forces;
use crate::pack::Pack;
use crate::schedule::{Stopped, TaskState};
use std::any::Any;
use std::cell::OnceCell;
use takt_abi::{Heap, Resources, Time};
use takt_ir::Program;

/// Says which layout follows.
const LAYOUT: u32 = 2;

/// A state of an engine between two steps.
#[derive(Default)]
pub struct Checkpoint {
    image: Vec<u8>,
    state: Vec<u8>,
    /// What is behind the bus, and requests to the host; only in the process that took it.
    driver: Option<Box<dyn Any + Send>>,
    host: Option<Box<dyn Any + Send>>,
}

impl std::fmt::Debug for Checkpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Checkpoint({} + {} bytes)", self.image.len(), self.state.len())
    }
}

impl Checkpoint {
    /// From its parts, as [`Checkpoint::image`] and [`Checkpoint::state`] gave them. They are checked by [`Engine::restore`].
    pub fn from_parts(image: Vec<u8>, state: Vec<u8>) -> Self {
        Self { image, state, ..Self::default() }
    }
    /// The bytes of the image.
    pub fn image(&self) -> &[u8] {
        &self.image
    }
    /// All the rest of the engine.
    pub fn state(&self) -> &[u8] {
        &self.state
    }
}

/// Why a checkpoint cannot be put back. Nothing has changed then.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CheckpointError {
    /// Its image has another size.
    Image {
        /// Bytes of the program's image.
        expected: usize,
        /// Bytes found.
        found: usize,
    },
    /// A part of it is cut, of another version, or does not go with the program.
    Part(&'static str),
}

impl std::fmt::Display for CheckpointError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Image { expected, found } => write!(f, "its image has {found} bytes, the program's has {expected}"),
            Self::Part(part) => write!(f, "its part `{part}` is damaged or of another program"),
        }
    }
}
impl std::error::Error for CheckpointError {}

/// A part with its length before it.
fn part(out: &mut Vec<u8>, write: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    0u64.pack(out);
    write(out);
    let length = (out.len() - start - 8) as u64;
    out[start..start + 8].copy_from_slice(&length.to_le_bytes());
}

fn take_part<'a>(from: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = usize::unpack(from)?;
    let (part, rest) = from.split_at_checked(length)?;
    *from = rest;
    Some(part)
}

/// What changes in a task.
#[derive(Debug, Clone)]
struct SavedTask {
    release: Time,
    pending: bool,
    level: bool,
    step: u64,
    next_preemption: usize,
    cycles: u64,
    overruns: u64,
    preempted: u64,
    fuel_max: u64,
    stopped: Option<RawFault>,
}
crate::pack::pack_fields!(SavedTask { release, pending, level, step, next_preemption, cycles, overruns, preempted, fuel_max, stopped });

impl SavedTask {
    fn of(task: &TaskState) -> Self {
        // A new field that a later step depends on is written here and put back below.
        let TaskState {
            trigger: _,
            period: _,
            priority: _,
            entry: _,
            stack: _,
            lane: _,
            lower: _,
            // Counts under a real clock only.
            watched: _,
            release,
            pending,
            level,
            running: _,
            step,
            granted: _,
            next_preemption,
            statistics,
            isolated: _,
            stopped,
        } = task;
        Self {
            release: *release,
            pending: *pending,
            level: *level,
            step: *step,
            next_preemption: *next_preemption,
            cycles: statistics.cycles,
            overruns: statistics.overruns,
            preempted: statistics.preempted,
            fuel_max: statistics.fuel_max,
            stopped: stopped.as_ref().map(|stopped| stopped.raw.clone()),
        }
    }
    fn put(&self, task: &mut TaskState) {
        (task.release, task.pending, task.level) = (self.release, self.pending, self.level);
        (task.step, task.next_preemption, task.running) = (self.step, self.next_preemption, false);
        task.stopped = self.stopped.clone().map(|raw| Stopped { raw, record: OnceCell::new() });
        let statistics = &mut task.statistics;
        (statistics.cycles, statistics.overruns) = (self.cycles, self.overruns);
        (statistics.preempted, statistics.fuel_max) = (self.preempted, self.fuel_max);
    }
}

/// The small parts of the engine.
#[derive(Debug)]
struct General {
    now: Time,
    steps: u64,
    fault: Option<RawFault>,
    io: ProcessImage,
    io_fault: Option<IoFault>,
    io_faults: u64,
    taken: Vec<Vec<u8>>,
}
crate::pack::pack_fields!(General { now, steps, fault, io, io_fault, io_faults, taken });

/// Everything decoded and checked, ready to be put in place.
struct Restored {
    general: General,
    tasks: Vec<SavedTask>,
    stage: crate::axis::stage::Stage,
    forces: Forces,
    heap: Heap,
    resources: Resources,
    /// Bytes of the table of classes.
    classes: Vec<u8>,
}

impl Core {
    /// Appends everything but the image.
    pub(crate) fn save(&self, out: &mut Vec<u8>) {
        LAYOUT.pack(out);
        part(out, |out| {
            (self.now, self.steps).pack(out);
            self.fault.pack(out);
            self.io.pack(out);
            self.io_fault.pack(out);
            self.io_faults.pack(out);
            self.mappings.len().pack(out);
            self.mappings.iter().for_each(|mapping| {
                mapping.taken().len().pack(out);
                out.extend_from_slice(mapping.taken());
            });
        });
        part(out, |out| self.tasks.iter().for_each(|task| SavedTask::of(task).pack(out)));
        part(out, |out| self.stage.save(out));
        part(out, |out| self.forces.save(out));
        let env = self.env.get();
        part(out, |out| env.heap.save_into(out));
        part(out, |out| env.classes.save_into(out));
        part(out, |out| env.resources.save_into(out));
    }

    fn decode(&self, checkpoint: &Checkpoint) -> Result<Restored, CheckpointError> {
        let (expected, found) = (self.image.bytes().len(), checkpoint.image.len());
        if expected != found {
            return Err(CheckpointError::Image { expected, found });
        }
        let mut from = checkpoint.state.as_slice();
        if u32::unpack(&mut from) != Some(LAYOUT) {
            return Err(CheckpointError::Part("layout"));
        }
        let mut next = |name| take_part(&mut from).map(|part| (name, part)).ok_or(CheckpointError::Part(name));
        let general = whole(next("bus")?, Pack::unpack)?;
        self.check_general(&general).ok_or(CheckpointError::Part("bus"))?;
        let tasks: Vec<SavedTask> = whole(next("tasks")?, |from| self.tasks.iter().map(|_| Pack::unpack(from)).collect())?;
        let alone = |(task, saved): (&TaskState, &SavedTask)| saved.stopped.is_none() || task.isolated;
        if !self.tasks.iter().zip(&tasks).all(alone) {
            return Err(CheckpointError::Part("tasks"));
        }
        let stage = whole(next("axes")?, |from| self.stage.restored(from))?;
        let forces = whole(next("forces")?, |from| Forces::restored(&self.program, from))?;
        let heap = self.program.heap().restored(next("heap")?.1).ok_or(CheckpointError::Part("heap"))?;
        let classes = next("instances")?.1;
        if !self.program.instances().restore(classes, |offset, class| class_fits(&self.program, offset, class)) {
            return Err(CheckpointError::Part("instances"));
        }
        let resources = whole(next("resources")?, |from| self.resources(from))?;
        if !from.is_empty() {
            return Err(CheckpointError::Part("end"));
        }
        Ok(Restored { general, tasks, stage, forces, heap, resources, classes: classes.to_vec() })
    }

    fn check_general(&self, general: &General) -> Option<()> {
        let sizes = |io: &ProcessImage| {
            let drives = (io.drives_in.len(), io.drives_out.len());
            (drives, io.bits_in.len(), io.bits_out.len(), io.analog_in.len(), io.analog_out.len())
        };
        let taken = general.taken.iter().map(Vec::len).eq(self.mappings.iter().map(|mapping| mapping.taken().len()));
        let task = general.fault.as_ref().and_then(|fault| fault.task).is_none_or(|task| task < self.tasks.len());
        (sizes(&general.io) == sizes(&self.io) && taken && task).then_some(())
    }

    /// New resources with the saved contents.
    fn resources(&self, from: &mut &[u8]) -> Option<Resources> {
        let mut resources = self.new_resources();
        for _ in 0..resources.len() {
            let owner = u64::unpack(from)?;
            let content = take_part(from)?;
            if !resources.restore(owner, content) {
                return None;
            }
        }
        Some(resources)
    }

    /// The resources of the program as they are at the start.
    pub(crate) fn new_resources(&self) -> Resources {
        let mut resources = Resources::default();
        for instance in &self.program.resources {
            resources.add(instance.offset.into(), (instance.make)());
        }
        resources
    }

    fn put_back(&mut self, image: &[u8], restored: Restored) {
        let Restored { general, tasks, stage, forces, heap, resources, classes } = restored;
        let General { now, steps, fault, io, io_fault, io_faults, taken } = general;
        self.image.bytes_mut().copy_from_slice(image);
        (self.now, self.steps, self.fault, self.io) = (now, steps, fault, io);
        (self.io_fault, self.io_faults, self.record) = (io_fault, io_faults, OnceCell::new());
        self.mappings.iter_mut().zip(taken).for_each(|(mapping, taken)| mapping.set_taken(taken));
        self.tasks.iter_mut().zip(&tasks).for_each(|(task, saved)| saved.put(task));
        (self.stage, self.forces) = (stage, forces);
        let env = self.env.get_mut();
        (env.heap, env.resources) = (heap, resources);
        // Machine code knows the table by its address: it is filled, not replaced. `decode` has checked the bytes.
        env.classes.restore(&classes, |_, _| true);
    }
}

/// Decodes a part that must be used up.
fn whole<T>((name, mut part): (&'static str, &[u8]), decode: impl FnOnce(&mut &[u8]) -> Option<T>) -> Result<T, CheckpointError> {
    decode(&mut part).filter(|_| part.is_empty()).ok_or(CheckpointError::Part(name))
}

/// Machine code finds methods by class and trusts the table: an instance of a known class, whole inside the image.
fn class_fits(program: &Program, offset: u64, class: u32) -> bool {
    program.class(class).is_some_and(|class| offset + u64::from(class.size) <= program.image_size.into())
}

impl Engine {
    /// Everything that later steps depend on. Waits for requests to the host that are under way.
    pub fn checkpoint(&mut self) -> Checkpoint {
        let mut checkpoint = Checkpoint::default();
        self.checkpoint_into(&mut checkpoint);
        checkpoint.driver = self.core.driver.save();
        checkpoint.host = self.core.env.get_mut().host.save();
        checkpoint
    }

    /// The same without bus and host, into the memory of an earlier checkpoint: allocates nothing where that has room.
    pub fn checkpoint_into(&self, checkpoint: &mut Checkpoint) {
        let Checkpoint { image, state, driver, host } = checkpoint;
        (*driver, *host) = (None, None);
        image.clear();
        image.extend_from_slice(self.core.image.bytes());
        state.clear();
        self.core.save(state);
    }

    /// Goes back to a checkpoint of this program with this configuration. On an error nothing has changed.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), CheckpointError> {
        let core = self.core.as_mut();
        let restored = core.decode(checkpoint)?;
        if checkpoint.driver.as_ref().is_some_and(|driver| !core.driver.restore(driver.as_ref())) {
            return Err(CheckpointError::Part("driver"));
        }
        if checkpoint.host.as_ref().is_some_and(|host| !core.env.get_mut().host.restore(host.as_ref())) {
            return Err(CheckpointError::Part("host"));
        }
        core.put_back(&checkpoint.image, restored);
        Ok(())
    }

    /// Shows all that a run is to be compared by: the bytes of all variables (without stacks), the heap and the resources, always in the same order.
    pub fn state(&self, see: &mut dyn FnMut(&[u8])) {
        let core = &self.core;
        let program = &core.program;
        let image = core.image.bytes();
        let stacks = program.tasks.iter().map(|task| task.stack.0 as usize).min().unwrap_or(image.len());
        see(&image[..stacks.min(image.len())]);
        let (start, len) = (program.heap.0 as usize, program.heap.1 as usize);
        if start >= stacks {
            see(image.get(start..start + len).unwrap_or_default());
        }
        let mut resources = Vec::new();
        core.env.get().resources.save_into(&mut resources);
        see(&resources);
    }
}
