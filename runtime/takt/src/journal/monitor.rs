//! Sees after each step what the journal should know, and posts it: no more than once a second of each kind.

use super::{Notice, ScanPoster};
use takt_abi::{Fault, Time};
use takt_engine::Engine;

/// Least time between two notices of a kind.
const PAUSE: i64 = 1_000_000_000;

/// What has been posted of a count.
#[derive(Debug, Clone, Copy)]
struct Told {
    count: u64,
    next: Time,
}

impl Told {
    const NOTHING: Self = Self { count: 0, next: Time(i64::MIN) };

    /// How many are new, if it is time to say so.
    fn more(&mut self, count: u64, now: Time) -> Option<u64> {
        let new = count.saturating_sub(self.count);
        if new == 0 || now < self.next {
            return None;
        }
        *self = Self { count, next: Time(now.0.saturating_add(PAUSE)) };
        Some(new)
    }
}

/// Compares the machine with what was posted of it. Looking allocates nothing, but for the record of a fault.
#[derive(Debug)]
pub struct Monitor {
    poster: ScanPoster,
    overruns: Vec<Told>,
    io: Told,
    io_bad: bool,
    faulted: bool,
    /// Tasks that were stopped alone.
    stopped: Vec<bool>,
}

impl Monitor {
    /// For an engine.
    pub fn new(poster: ScanPoster, engine: &Engine) -> Self {
        let tasks = engine.program().tasks.len();
        let overruns = vec![Told::NOTHING; tasks];
        Self { poster, overruns, io: Told::NOTHING, io_bad: false, faulted: false, stopped: vec![false; tasks] }
    }

    /// After a step.
    pub fn look(&mut self, engine: &Engine) {
        let time = engine.now();
        for (task, told) in self.overruns.iter_mut().enumerate() {
            if let Some(count) = told.more(engine.statistics(task).overruns, time) {
                self.poster.post(Notice::Overrun { task, count, time });
            }
        }
        self.look_at_bus(engine, time);
        let fault = engine.fault().filter(|record| record.fault != Fault::Stopped);
        if let (false, Some(record)) = (self.faulted, fault) {
            self.poster.post(Notice::Fault(Box::new(record.clone())));
        }
        self.faulted = fault.is_some();
        for (task, stopped) in self.stopped.iter_mut().enumerate() {
            let fault = engine.task_fault(task);
            if let (false, Some(record)) = (*stopped, fault) {
                self.poster.post(Notice::Fault(Box::new(record.clone())));
            }
            *stopped = fault.is_some();
        }
    }

    fn look_at_bus(&mut self, engine: &Engine, time: Time) {
        let (fault, count) = engine.io_faults();
        match fault {
            Some(fault) => {
                if let Some(count) = self.io.more(count, time) {
                    self.io_bad = true;
                    self.poster.post(Notice::IoFault { fault, count, time });
                }
            }
            None if self.io_bad => {
                self.io_bad = false;
                self.poster.post(Notice::IoGood { time });
            }
            None => {}
        }
    }
}
