//! When tasks are due.
//!
//! Cyclic tasks are released at whole multiples of their interval after the first step; a release that has passed while the task could not run is an
//! overrun and is skipped. An event task is due once per rising edge of its variable, seen after inputs are latched, after each scan and at polls. A
//! freewheeling task is released every millisecond in virtual time, where a scan takes none; under a real clock it starts again 1 ms after its scan
//! ended, or, where tasks of lower priority wait, after as long as the scan took if that is longer: it leaves them half of the processor.

use crate::fault::{FaultRecord, RawFault};
use crate::limits::Watched;
use crate::memory::{Lane, Pinned};
use crate::statistics::TaskStatistics;
use std::cell::OnceCell;
use takt_abi::Time;
use takt_ir::{BodyId, Program, Trigger};

/// Interval of a freewheeling task, and of an event task for blocks that ask for their period.
pub(crate) const IDLE_PERIOD: Time = Time(1_000_000);

/// A task at run time.
pub(crate) struct TaskState {
    pub trigger: Trigger,
    pub period: Time,
    pub priority: u32,
    pub entry: BodyId,
    pub stack: (u32, u32),
    pub lane: Pinned<Lane>,
    /// When it is due next. Event tasks: the time of the edge while `pending`.
    pub release: Time,
    /// An event task that waits for its scan.
    pub pending: bool,
    /// Last value of an event task's variable.
    pub level: bool,
    /// There are tasks of lower priority.
    pub lower: bool,
    pub watched: Watched,
    /// A scan is under way (perhaps interrupted).
    pub running: bool,
    /// Number of the step in which it last ran.
    pub step: u64,
    /// Fuel granted to the scan so far.
    pub granted: u64,
    /// Index of the next preemption of this task in the sorted list.
    pub next_preemption: usize,
    pub statistics: TaskStatistics,
    /// A fault stops this task alone: the program says so, and it does not own the bus.
    pub isolated: bool,
    /// The fault that stopped it alone.
    pub stopped: Option<Stopped>,
}

/// A fault of an isolated task.
pub(crate) struct Stopped {
    pub raw: RawFault,
    pub record: OnceCell<FaultRecord>,
}

impl TaskState {
    pub fn new(program: &Program, index: usize, lane: Lane) -> Self {
        let task = &program.tasks[index];
        let period = match task.trigger {
            Trigger::Cyclic(ns) => Time(ns.max(1)),
            Trigger::Event(..) | Trigger::Freewheeling => IDLE_PERIOD,
        };
        Self {
            trigger: task.trigger,
            period,
            priority: task.priority,
            entry: task.entry,
            stack: task.stack,
            lane: Pinned::new(lane),
            release: Time(0),
            pending: false,
            level: false,
            lower: program.tasks.iter().any(|other| other.priority > task.priority),
            watched: Watched::default(),
            running: false,
            step: 0,
            granted: 0,
            next_preemption: 0,
            statistics: TaskStatistics::default(),
            isolated: task.isolated,
            stopped: None,
        }
    }
    fn is_event(&self) -> bool {
        matches!(self.trigger, Trigger::Event(..))
    }
    pub fn due(&self, now: Time) -> bool {
        !self.running && self.stopped.is_none() && if self.is_event() { self.pending } else { self.release <= now }
    }
    /// When it is due next, if time alone makes it so.
    pub fn next_release(&self) -> Option<Time> {
        let waits = self.stopped.is_none() && (self.pending || !self.is_event());
        waits.then_some(self.release)
    }
    /// The task goes on after a fault of its own, from the release at `now` on.
    pub fn go_on(&mut self, now: Time) {
        self.stopped = None;
        (self.release, self.pending) = (now, false);
        (self.watched.slow, self.watched.missed) = (0, 0);
    }
    /// A scan starts at `now`: sets the next release behind it and counts those that were missed.
    pub fn start(&mut self, now: Time) {
        self.statistics.cycles += 1;
        if self.is_event() {
            self.pending = false;
            return;
        }
        let late = now.0.saturating_sub(self.release.0) / self.period.0;
        let late = late.max(0);
        if !matches!(self.trigger, Trigger::Freewheeling) {
            self.statistics.overruns += late as u64;
            self.watched.missed = if late > 0 { self.watched.missed.saturating_add(1) } else { 0 };
        }
        self.release = Time(self.release.0.saturating_add((late + 1).saturating_mul(self.period.0)));
    }
    /// A scan that took so long has ended, under a real clock.
    pub fn ended(&mut self, now: Time, took: Time) {
        if matches!(self.trigger, Trigger::Freewheeling) {
            let pause = if self.lower { took.max(IDLE_PERIOD) } else { IDLE_PERIOD };
            self.release = Time(now.0.saturating_add(pause.0));
        }
    }
    /// Looks at an event task's variable.
    pub fn watch(&mut self, image: &[u8], now: Time) {
        if let Trigger::Event(offset, bit) = self.trigger {
            let mask = bit.map_or(u8::MAX, |bit| 1 << bit);
            let level = image.get(offset as usize).is_some_and(|b| b & mask != 0);
            if level && !self.level {
                (self.pending, self.release) = (true, now);
            }
            self.level = level;
        }
    }
}

/// The fastest cyclic task (of equals the one with the higher priority, then the first); without a cyclic one the first task.
pub(crate) fn default_bus_task(program: &Program) -> usize {
    let cyclic = program.tasks.iter().enumerate().filter_map(|(i, t)| match t.trigger {
        Trigger::Cyclic(ns) => Some((ns, t.priority, i)),
        _ => None,
    });
    cyclic.min().map_or(0, |(_, _, i)| i)
}
