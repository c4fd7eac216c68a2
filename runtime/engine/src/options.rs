//! What an engine is told when it is loaded.

use crate::axis::AxisConfig;
use crate::bus::Wire;
use crate::limits::{Alarm, Limits};
use crate::retain::Restore;
use takt_abi::{Host, NoHost, Time};

/// Which executor runs the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ExecutorKind {
    /// Machine code.
    #[default]
    Jit,
    /// Machine code without the instructions that only newer processors have; the same results ([`takt_jit::Processor::Common`]).
    Portable,
    /// The reference interpreter.
    Interpreter,
}

/// Who knows what time it is while a scan runs.
#[derive(Debug, Clone, Copy, Default)]
pub enum Clock {
    /// Nobody: a scan takes no time, and nothing preempts except where [`Options::preempt`] says so.
    #[default]
    Virtual,
    /// This function, on the same scale as the argument of [`crate::Engine::step`]. Higher tasks preempt when they are due, and the watchdog counts time.
    Real(fn() -> Time),
}

/// A preemption: where a task was interrupted by one of higher priority. Recorded under [`Clock::Real`], obeyed under [`Clock::Virtual`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preemption {
    /// Number of the scan of the interrupted task (the first is 1).
    pub cycle: u64,
    /// The interrupted task (index into [`takt_ir::Program::tasks`]).
    pub task: usize,
    /// It happens at the first poll at which the scan has consumed at least so much fuel.
    pub at_fuel: u64,
}

/// How a program is to be run.
pub struct Options {
    /// Which executor.
    pub executor: ExecutorKind,
    /// The task that owns the bus. `None`: the fastest cyclic one.
    pub bus_task: Option<String>,
    /// Files for blocks.
    pub host: Box<dyn Host>,
    /// Axes; a drive serves one axis at the most.
    pub axes: Vec<AxisConfig>,
    /// Variables on terminals.
    pub wires: Vec<Wire>,
    /// Units of fuel that one scan may take before it is a [`takt_abi::Fault::Watchdog`].
    pub fuel_limit: u64,
    /// Depth of calls in recursive cycles before it is a [`takt_abi::Fault::StackOverflow`].
    pub depth_limit: u32,
    /// Bytes of native stack that the thread which loads and steps the engine has for it. A program that may need more is refused.
    pub native_stack: usize,
    /// Virtual or real.
    pub clock: Clock,
    /// Limits under [`Clock::Real`] of the tasks that have none of their own.
    pub limits: Limits,
    /// Limits of single tasks under [`Clock::Real`], by name.
    pub task_limits: Vec<(String, Limits)>,
    /// Brings a scan to its next poll in time under [`Clock::Real`]. `None`: scans look at the clock every few hundred units of fuel.
    pub alarm: Option<Box<dyn Alarm>>,
    /// Where tasks are interrupted under [`Clock::Virtual`]; a test or a recording says so.
    pub preempt: Vec<Preemption>,
    /// Retained values that are put back before the program starts.
    pub restore: Option<Restore>,
    /// How often a snapshot of the retained variables is taken ([`crate::Engine::snapshots`]). `None`: never.
    pub retain_interval: Option<Time>,
    /// Monotonic nanoseconds, for the statistics of execution times only. `None`: no statistics.
    pub stopwatch: Option<fn() -> u64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            executor: ExecutorKind::default(),
            bus_task: None,
            host: Box::new(NoHost),
            axes: Vec::new(),
            wires: Vec::new(),
            fuel_limit: 20_000_000,
            depth_limit: 1000,
            native_stack: 7 << 18, // of the 2 MiB that a thread has by default
            clock: Clock::Virtual,
            limits: Limits::default(),
            task_limits: Vec::new(),
            alarm: None,
            preempt: Vec::new(),
            restore: None,
            retain_interval: None,
            stopwatch: None,
        }
    }
}

impl std::fmt::Debug for Options {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Options")
            .field("executor", &self.executor)
            .field("bus_task", &self.bus_task)
            .field("axes", &self.axes.len())
            .finish_non_exhaustive()
    }
}
