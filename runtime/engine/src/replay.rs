//! What decides a run beside the program: told to a [`Recorder`] while it happens, obeyed by [`Engine::replay`].
//!
//! Everything that comes from outside passes one of these places: the time of each step and scan, the poll at which a scan was interrupted or ended, the
//! inputs and the result of each bus exchange, commands. (Completions of the host are recorded by whoever implements it: calls of a host are numbered, and
//! the program makes the same calls again.) The engine records into memory that the recorder has; what becomes of it is the recorder's business.

use crate::bus::{IoFault, ProcessImage};
use crate::command::Command;
use crate::core::Core;
use crate::engine::Engine;
use takt_abi::{Fault, Time};

/// What happened in a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A scan started.
    Scan {
        /// Of this task.
        task: usize,
        /// At this time.
        now: Time,
        /// Scans under way at that moment; not 0: it interrupts the innermost of them.
        depth: u32,
        /// The poll of the interrupted scan: its first one that has consumed so much fuel. 0 if `depth` is 0.
        at: u64,
    },
    /// The innermost scan was ended at a poll: by a watchdog or a stop.
    Cut {
        /// Scans under way.
        depth: u32,
        /// As for a scan.
        at: u64,
        /// How.
        fault: Fault,
    },
    /// The innermost scan stopped the application at its start or end, because of the time that it or those before it took.
    Stop {
        /// Scans under way.
        depth: u32,
        /// At its start, and without a run of its programs.
        entry: bool,
        /// How.
        fault: Fault,
    },
}

impl Event {
    fn depth(&self) -> u32 {
        match self {
            Self::Scan { depth, .. } | Self::Cut { depth, .. } | Self::Stop { depth, .. } => *depth,
        }
    }
    /// The fuel of the poll at which it happens, if it happens at one.
    fn poll(&self) -> Option<u64> {
        match self {
            Self::Scan { depth: 0, .. } | Self::Stop { .. } => None,
            Self::Scan { at, .. } | Self::Cut { at, .. } => Some(*at),
        }
    }
}

/// Is told everything that comes from outside, in order. Called on the thread that steps the engine: must not allocate, lock or wait.
pub trait Recorder {
    /// A step starts. Before its first scan the engine may be copied ([`Engine::checkpoint_into`]).
    fn step(&mut self, now: Time);
    /// Something happened in the step.
    fn event(&mut self, event: &Event);
    /// The bus was exchanged with this result and these inputs.
    fn exchange(&mut self, result: Result<(), IoFault>, io: &ProcessImage);
    /// A command is about to be obeyed.
    fn command(&mut self, command: &Command);
}

/// A recording that is obeyed: the events of the present step.
#[derive(Debug, Default)]
pub(crate) struct Script {
    events: Vec<Event>,
    next: usize,
    /// The run has left the recording: an event could not happen where it should have.
    strayed: bool,
}

impl Script {
    /// The next event, if it belongs to a scan at this depth.
    fn peek(&self, depth: u32) -> Option<Event> {
        self.events.get(self.next).copied().filter(|event| event.depth() == depth)
    }
}

/// The run is no longer the recorded one: another program, another machine, or a damaged recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Strayed;

impl std::fmt::Display for Strayed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the run has left the recording")
    }
}
impl std::error::Error for Strayed {}

impl Core {
    /// Scans under way.
    fn depth(&self) -> u32 {
        self.tasks.iter().filter(|task| task.running).count() as u32
    }

    pub(crate) fn tell(&mut self, event: Event) {
        if let Some(recorder) = &mut self.recorder {
            recorder.event(&event);
        }
    }

    /// A scan of a task is about to start; `at` is the fuel of the interrupted one.
    pub(crate) fn tell_scan(&mut self, task: usize, now: Time, at: u64) {
        if self.recorder.is_some() {
            let depth = self.depth();
            self.tell(Event::Scan { task, now, depth, at });
        }
    }

    /// The innermost scan ends at a poll.
    pub(crate) fn tell_cut(&mut self, at: u64, fault: Fault) -> Option<Fault> {
        if self.recorder.is_some() {
            let depth = self.depth();
            self.tell(Event::Cut { depth, at, fault });
        }
        Some(fault)
    }

    /// The next scan of the step as the recording has it; `None` at its end.
    pub(crate) fn pick_as_told(&mut self) -> Option<(usize, Time)> {
        let script = self.script.as_mut()?;
        let Some(Event::Scan { task, now, .. }) = script.peek(0) else {
            script.strayed |= script.next < script.events.len();
            return None;
        };
        script.next += 1;
        if task >= self.tasks.len() || self.tasks[task].running {
            script.strayed = true;
            return None;
        }
        Some((task, now))
    }

    /// The fuel of the poll at which the recording has something for the innermost scan.
    pub(crate) fn next_told(&self) -> Option<u64> {
        self.script.as_ref()?.peek(self.depth())?.poll()
    }

    /// What the recording has for this poll; `Some` ends the scan.
    pub(crate) fn poll_as_told(&mut self, index: usize, consumed: u64) -> Option<Fault> {
        while self.fault.is_none() {
            let depth = self.depth();
            let Some(script) = &mut self.script else { return None };
            let event = script.peek(depth).filter(|event| event.poll().is_some_and(|at| at <= consumed))?;
            script.next += 1;
            match event {
                Event::Scan { task, now, .. } if task < self.tasks.len() && !self.tasks[task].running => {
                    self.interrupt(index, task, now, consumed)
                }
                Event::Cut { fault, .. } => return Some(fault),
                _ => script.strayed = true,
            }
        }
        None
    }

    /// The innermost scan stops the application; at its end it no longer counts as under way.
    pub(crate) fn tell_stop(&mut self, entry: bool, fault: Fault) {
        if self.recorder.is_some() {
            let depth = self.depth() + u32::from(!entry);
            self.tell(Event::Stop { depth, entry, fault });
        }
    }

    /// Whether the recording stops the application at the start or end of the innermost scan.
    pub(crate) fn stop_as_told(&mut self, at_entry: bool) -> Option<Fault> {
        let depth = self.depth();
        let script = self.script.as_mut()?;
        match script.peek(depth)? {
            Event::Stop { entry, fault, .. } if entry == at_entry => {
                script.next += 1;
                Some(fault)
            }
            _ => None,
        }
    }

    /// What the recording has for the end of the innermost scan.
    pub(crate) fn leave_as_told(&mut self, index: usize, now: Time) {
        if let Some(fault) = self.stop_as_told(false) {
            self.stop_at_entry(index, fault, now);
        }
        let depth = self.depth();
        if let Some(script) = &mut self.script {
            // What should have happened at a poll that never came.
            script.strayed |= script.peek(depth).is_some();
        }
    }
}

impl Engine {
    /// From now on `recorder` is told what happens; `None`: nobody. Take a checkpoint first: a recording starts at one.
    pub fn record(&mut self, recorder: Option<Box<dyn Recorder>>) {
        self.core.recorder = recorder;
    }

    /// A step as it was recorded: at this time, with these events. The bus and the host are to play back theirs. Under [`crate::Clock::Virtual`].
    pub fn replay(&mut self, now: Time, events: &[Event]) -> Result<(), Strayed> {
        let script = self.core.script.get_or_insert_default();
        script.events.clear();
        script.events.extend_from_slice(events);
        (script.next, script.strayed) = (0, false);
        self.step(now);
        let script = self.core.script.get_or_insert_default();
        if script.strayed || script.next < script.events.len() { Err(Strayed) } else { Ok(()) }
    }
}
