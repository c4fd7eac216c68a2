//! What tasks may take under a real clock: time per scan, releases missed in a row; and the alarm that brings a scan to its next poll in time.

use crate::core::Core;
use crate::fault::RawFault;
use crate::options::Clock;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};
use takt_abi::{Fault, Time};

/// Fuel between two polls that look at the clock, where an alarm ends the wait earlier.
const ALARM_SLICE: u64 = 1 << 14;
/// The same without an alarm.
const PREEMPT_SLICE: u64 = 1 << 8;

/// Limits of one task under [`Clock::Real`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Time that a scan may take, without the scans that interrupt it. 0: no limit but fuel.
    pub watchdog: Time,
    /// The fault comes after so many scans in a row that took longer, or within one scan that takes so many times as long. 0 counts as 1.
    pub sensitivity: u32,
    /// So many scans in a row that start behind a missed release are a [`Fault::Overruns`]. 0: they are only counted.
    pub max_overruns: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self { watchdog: Time(0), sensitivity: 1, max_overruns: 0 }
    }
}

impl Limits {
    /// Time that a single scan may take at the most.
    fn of_one_scan(&self) -> Option<Time> {
        (self.watchdog.0 > 0).then(|| Time(self.watchdog.0.saturating_mul(self.sensitivity.max(1).into())))
    }
}

/// Sets a flag at a time, so that compiled code comes to its next poll without looking at a clock in each turn of a loop.
pub trait Alarm {
    /// From now on `flag` is to become 1 when the clock reaches `at`, or sooner; what was asked for before is forgotten.
    ///
    /// # Safety
    /// The flag must stay valid until [`Alarm::disarm`] or the next call of this function.
    #[allow(unsafe_code, reason = "it keeps an address beyond the call")]
    unsafe fn arm(&mut self, at: Time, flag: NonNull<AtomicU32>);
    /// The flag is not touched any more.
    fn disarm(&mut self);
}

/// What is known of a task's limits while it runs.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Watched {
    pub limits: Limits,
    /// Scans in a row that took longer than the watchdog's time.
    pub slow: u32,
    /// Scans in a row that started behind a missed release.
    pub missed: u32,
}

impl Core {
    /// Units of fuel that a scan of the task may take; with a watchdog on a real clock time alone counts.
    pub fn fuel_limit_of(&self, index: usize) -> u64 {
        let by_time = matches!(self.clock, Clock::Real(_)) && self.tasks[index].watched.limits.watchdog.0 > 0;
        if by_time { i64::MAX as u64 / 2 } else { self.fuel_limit }
    }

    /// Units until the next look at a real clock.
    pub fn slice(&self) -> u64 {
        if self.alarm.is_some() { ALARM_SLICE } else { PREEMPT_SLICE }
    }

    /// Whether the scan of the task has taken too long at `now`.
    pub fn too_long(&self, index: usize, now: Time) -> bool {
        let limit = self.tasks[index].watched.limits.of_one_scan();
        limit.is_some_and(|limit| now.0 - self.scan_started.0 - self.inner_time.0 > limit.0)
    }

    /// Asks for a poll of the task when a higher one is due or its watchdog strikes.
    #[allow(unsafe_code, reason = "the alarm keeps the address of the lane's flag")]
    pub fn set_alarm(&mut self, index: usize) {
        let Some(alarm) = &mut self.alarm else { return };
        let task = &self.tasks[index];
        let higher = self.tasks.iter().filter(|t| t.priority < task.priority && !t.running);
        let release = higher.filter_map(|t| t.next_release()).min();
        let limit = task.watched.limits.of_one_scan();
        let struck =
            limit.map(|limit| Time(self.scan_started.0.saturating_add(self.inner_time.0).saturating_add(limit.0).saturating_add(1)));
        let flag = NonNull::from(&task.lane.get().ctx.flag);
        match release.into_iter().chain(struck).min() {
            // SAFETY: the lane is pinned and lives as long as the core, which disarms the alarm when the scan is over.
            Some(at) => unsafe { alarm.arm(at, flag) },
            None => alarm.disarm(),
        }
    }

    /// The scan is over; the one around it, if there is one, asks anew behind its poll.
    pub fn clear_alarm(&mut self) {
        if let Some(alarm) = &mut self.alarm {
            alarm.disarm();
        }
    }

    /// The alarm was heard.
    pub fn hear_alarm(ctx: &takt_abi::Context) {
        ctx.flag.store(0, Ordering::Relaxed);
    }

    /// A task that has missed too many releases in a row stops the application; whether it did.
    pub fn check_overruns(&mut self, index: usize, now: Time) -> bool {
        let task = &self.tasks[index];
        let Watched { limits, missed, .. } = task.watched;
        if let Some(fault) = self.stop_as_told(true) {
            self.stop_at_entry(index, fault, now);
            return true;
        }
        if !matches!(self.clock, Clock::Real(_)) || limits.max_overruns == 0 || missed < limits.max_overruns {
            return false;
        }
        self.tell_stop(true, Fault::Overruns { count: missed });
        self.stop_at_entry(index, Fault::Overruns { count: missed }, now);
        true
    }

    /// A scan is over that took so long.
    pub fn check_time(&mut self, index: usize, took: Time, now: Time) {
        let watched = &mut self.tasks[index].watched;
        let limits = watched.limits;
        if limits.watchdog.0 <= 0 {
            return;
        }
        watched.slow = if took.0 > limits.watchdog.0 { watched.slow + 1 } else { 0 };
        if watched.slow >= limits.sensitivity.max(1) {
            self.tell_stop(false, Fault::Watchdog);
            self.stop_at_entry(index, Fault::Watchdog, now);
        }
    }

    /// A fault that belongs to the task as a whole.
    pub fn stop_at_entry(&mut self, index: usize, fault: Fault, now: Time) {
        let task = &self.tasks[index];
        let site = self.program.bodies.get(task.entry.0 as usize).map_or(u32::MAX, |body| body.entry_site.0);
        let raw = RawFault {
            fault,
            site,
            trace: [0; takt_abi::TRACE_DEPTH],
            trace_len: 0,
            task: Some(index),
            time: now,
            cycle: task.statistics.cycles,
        };
        self.stop_application(raw);
    }
}
