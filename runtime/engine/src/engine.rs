//! The engine as others hold it: steps, snapshots out, commands in. Everything here happens between scans.

use crate::axis::stage::AxisStatus;
use crate::bus::{IoFault, ProcessImage};
use crate::command::AccessError;
use crate::command::Command;
use crate::core::Core;
use crate::executor::Executor;
use crate::fault::{FaultRecord, RawFault};
use crate::memory::execute;
use crate::observe::Observer;
use crate::options::Preemption;
use crate::retain::{Reset, Restore, RetainLayout, SnapshotReader};
use crate::statistics::TaskStatistics;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use takt_abi::{Fault, Message, Time};
use takt_ir::{Base, BodyId, Inst, Place, Program};

/// Fuel of a condition.
pub(crate) const CONDITION_FUEL: i64 = 100_000;

/// Stops a scan from another thread or a signal handler: at its next poll it ends with [`Fault::Stopped`].
#[derive(Debug, Clone)]
pub struct StopHandle(Arc<AtomicBool>);

impl StopHandle {
    /// Asks for the stop. It is also remembered when no scan is running: see [`Engine::step`].
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A loaded program.
pub struct Engine {
    pub(crate) core: Box<Core>,
    /// Copy of the image for conditions that might change it.
    scratch: Vec<u8>,
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine").field("now", &self.core.now).field("cycles", &self.cycles()).finish_non_exhaustive()
    }
}

impl Engine {
    pub(crate) fn new(core: Box<Core>) -> Self {
        Self { core, scratch: Vec::new() }
    }

    /// Runs the tasks that are due at `now`, the most important first, with a bus cycle around the bus task.
    ///
    /// `now` never goes back. In virtual time pass [`Engine::next_release`]; the first call sets the phase of all cyclic tasks. After a fault only axis
    /// stage and bus go on. A stop that was asked for is obeyed here.
    pub fn step(&mut self, now: Time) {
        if self.core.stop.load(Ordering::Relaxed) {
            self.halt();
        }
        let now = now.max(self.core.now);
        self.core.step(now);
        if self.core.stop.swap(false, Ordering::Relaxed) {
            self.halt();
        }
    }

    /// When the next task is due by time: what to pass to [`Engine::step`] next. After a fault: the next bus cycle.
    pub fn next_release(&self) -> Time {
        let core = &self.core;
        let all = core.tasks.iter().enumerate().filter(|(i, _)| core.fault.is_none() || *i == core.bus);
        all.filter_map(|(_, t)| t.next_release()).min().unwrap_or(Time(core.now.0 + core.tasks[core.bus].period.0))
    }

    /// Time of the last step.
    pub fn now(&self) -> Time {
        self.core.now
    }

    /// The program.
    pub fn program(&self) -> &Program {
        &self.core.program
    }

    /// Bytes of native stack that a step can use at the most; [`crate::load`] has held it to [`crate::Options::native_stack`].
    pub fn native_stack(&self) -> usize {
        self.core.native_stack()
    }

    /// Index of the task that owns the bus.
    pub fn bus_task(&self) -> usize {
        self.core.bus
    }

    /// Period of a bus cycle.
    pub fn bus_period(&self) -> Time {
        self.core.tasks[self.core.bus].period
    }

    /// Bus cycles so far, those after a fault included.
    pub fn cycles(&self) -> u64 {
        self.core.tasks[self.core.bus].statistics.cycles
    }

    /// What is known of the scans of a task (index into [`Program::tasks`]).
    ///
    /// # Panics
    /// If there is no such task.
    pub fn statistics(&self, task: usize) -> &TaskStatistics {
        &self.core.tasks[task].statistics
    }

    /// Starts the statistics of all tasks anew. The number of a task's scan ([`TaskStatistics::cycles`]) goes on.
    pub fn reset_statistics(&mut self) {
        self.core.tasks.iter_mut().for_each(|task| task.statistics.reset());
    }

    /// Where tasks were interrupted under a real clock, in order (the first 65 536).
    pub fn preemptions(&self) -> &[Preemption] {
        &self.core.recorded
    }

    /// The fault that stopped the application.
    pub fn fault(&self) -> Option<&FaultRecord> {
        let raw = self.core.fault.as_ref()?;
        Some(self.core.record.get_or_init(|| raw.record(&self.core.program)))
    }

    /// The fault that stopped a task alone ([`takt_ir::Task::isolated`]).
    pub fn task_fault(&self, task: usize) -> Option<&FaultRecord> {
        let stopped = self.core.tasks.get(task)?.stopped.as_ref()?;
        Some(stopped.record.get_or_init(|| stopped.raw.record(&self.core.program)))
    }

    /// The calls that were under way in a task of the interpreter when a fault ended its scan, the innermost first: body, number of the place
    /// where it was, its locals as words, offset of its frame. Empty under machine code, which keeps no locals.
    pub fn stopped_calls(&self, task: usize) -> Vec<(BodyId, u32, Vec<u64>, u64)> {
        let Some(task) = self.core.tasks.get(task) else { return Vec::new() };
        task.lane.get().interpreter.stopped().map(|(body, site, words, frame)| (body, site.0, words.to_vec(), frame)).collect()
    }

    /// Stops the application as a fault does, with [`Fault::Stopped`]: axes are brought to rest, outputs go to their safe values.
    pub fn halt(&mut self) {
        self.tell(&Command::Halt);
        let core = &mut self.core;
        if let (None, None, Some(keeper)) = (&core.fault, core.current, &mut core.keeper) {
            keeper.halt(core.image.bytes());
        }
        let cycle = core.tasks[core.bus].statistics.cycles;
        core.stop_application(RawFault::outside(Fault::Stopped, core.bus, core.now, cycle));
    }

    /// Tells the recorder of a command.
    pub(crate) fn tell(&mut self, command: &Command) {
        if let Some(recorder) = &mut self.core.recorder {
            recorder.command(command);
        }
    }

    /// What the program said to people: the oldest message, once. Messages that nobody takes in time are lost, see [`Engine::lost_messages`].
    pub fn take_message(&mut self) -> Option<Message> {
        self.core.env.get_mut().messages.take()
    }

    /// How many messages were lost since this was asked the last time.
    pub fn lost_messages(&mut self) -> u64 {
        self.core.env.get_mut().messages.lost()
    }

    /// For another thread or a signal handler.
    pub fn stop_handle(&self) -> StopHandle {
        StopHandle(self.core.stop.clone())
    }

    /// Clears the fault and starts the program with its initial values, but for the variables that this kind of restart keeps: they keep what they hold
    /// now, after a fault too. Axes keep their reference. On an error the fault stays.
    pub fn reset(&mut self, kind: Reset) -> Result<(), Box<FaultRecord>> {
        self.tell(&Command::Reset(kind));
        let core = &mut self.core;
        let kept = Restore::of_image(&core.program, kind, core.image.bytes());
        core.initialise(Some(&kept))?;
        core.fault = None;
        if let Some(keeper) = &mut core.keeper {
            keeper.start();
        }
        core.stop.store(false, Ordering::Relaxed);
        let release = core.tasks[core.bus].release;
        core.tasks.iter_mut().for_each(|task| task.go_on(release));
        Ok(())
    }

    /// Where snapshots of the retained variables come out, if [`crate::Options::retain_interval`] asks for them; can be taken once.
    pub fn snapshots(&mut self) -> Option<SnapshotReader> {
        self.core.keeper.as_mut()?.reader()
    }

    /// The last whole state of the retained variables: as they are now, between steps, or as they were when the program was halted. `None` after a fault,
    /// which leaves them half changed, and without [`crate::Options::retain_interval`].
    pub fn last_retained(&self) -> Option<Vec<u8>> {
        self.core.keeper.as_ref()?.last(self.image(), self.core.fault.is_some())
    }

    /// The retained variables as they are now, between steps; see [`RetainLayout`]. After a fault they may be half changed.
    pub fn retained(&self) -> Vec<u8> {
        let layout = RetainLayout::new(&self.core.program);
        let mut bytes = vec![0; layout.len()];
        layout.copy(self.image(), &mut bytes);
        bytes
    }

    /// Whether all axes stand still with their drives off.
    pub fn at_rest(&self) -> bool {
        self.core.stage.at_rest()
    }

    /// The axes, in the order of [`crate::Options::axes`].
    pub fn axes(&self) -> impl ExactSizeIterator<Item = AxisStatus> {
        self.core.stage.status()
    }

    /// What went over the bus last.
    pub fn process_image(&self) -> &ProcessImage {
        &self.core.io
    }

    /// Why the last exchange failed, if it did, and how many have.
    pub fn io_faults(&self) -> (Option<IoFault>, u64) {
        (self.core.io_fault, self.core.io_faults)
    }

    /// The whole image.
    pub fn image(&self) -> &[u8] {
        self.core.image.bytes()
    }

    fn range(&self, place: Place) -> Result<std::ops::Range<usize>, AccessError> {
        let types = &self.core.program.types;
        if place.ty.0 as usize >= types.all().len() {
            return Err(AccessError::Outside);
        }
        let start = place.offset as usize;
        let end = start + types.size(place.ty) as usize;
        if end > self.image().len() { Err(AccessError::Outside) } else { Ok(start..end) }
    }

    /// The bytes of a variable (see [`takt_ir::resolve`]), of a bit the byte around it; empty if the place is not of this program.
    pub fn read(&self, place: Place) -> &[u8] {
        self.range(place).map_or(&[], |range| &self.image()[range])
    }

    /// From now on this observer looks at the program after each scan; the one before, if there was one.
    pub fn observe(&mut self, observer: Option<Box<dyn Observer>>) -> Option<Box<dyn Observer>> {
        std::mem::replace(&mut self.core.observer, observer)
    }

    /// Makes room for [`Engine::evaluate`], so that it allocates nothing later.
    ///
    /// # Panics
    /// If there is no such body.
    pub fn prepare(&mut self, body: BodyId) {
        if changes_image(&self.core.program, body) {
            self.scratch.reserve(self.core.image.bytes().len());
        }
    }

    /// Runs a body without parameters in the interpreter and returns its result (a condition: 0 or 1). What it changes in the image is undone.
    ///
    /// # Panics
    /// If there is no such body.
    pub fn evaluate(&mut self, body: BodyId) -> Result<u64, Fault> {
        let changes = changes_image(&self.core.program, body);
        if changes {
            self.scratch.clear();
            self.scratch.extend_from_slice(self.core.image.bytes());
        }
        let core = self.core.as_mut();
        let (start, size) = core.tasks[core.bus].stack;
        core.spare.get_mut().prepare(CONDITION_FUEL, u64::from(start) + u64::from(size));
        let fault = execute(core, |core, _| &mut core.spare, 0, &Executor::Interpreter, body, start.into());
        let result = core.spare.get().interpreter.result();
        if changes {
            core.image.bytes_mut().copy_from_slice(&self.scratch);
        }
        fault.map_or(Ok(result), Err)
    }
}

/// Whether a body might write something that is not its own frame.
pub(crate) fn changes_image(program: &Program, body: BodyId) -> bool {
    let own = |base: &Base| matches!(base, Base::Frame);
    program.bodies[body.0 as usize].blocks.iter().flat_map(|b| &b.insts).any(|inst| match inst {
        Inst::Store { base, .. } => !own(base),
        Inst::Move { dst, .. } | Inst::Data { dst, .. } => !own(dst),
        Inst::Call { .. } | Inst::Virtual { .. } | Inst::Native { .. } => true,
        _ => false,
    })
}
