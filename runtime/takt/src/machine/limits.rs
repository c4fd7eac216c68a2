//! Limits of tasks on a machine: those of the manifest, and what holds without.

use crate::manifest::{Manifest, TaskSettings};
use takt_abi::Time;
use takt_engine::Limits;
use takt_ir::{Program, Trigger};

/// The least watchdog of a task that has none of its own.
const LEAST: Time = Time::from_millis(100);
/// The watchdog of a task without an interval.
const WITHOUT_INTERVAL: Time = Time::from_millis(1000);

/// The watchdog of a task that has none of its own: an endless loop has to end on a machine too. Ten intervals, but not less than 100 ms; 1 s
/// where there is no interval.
fn watchdog(trigger: Trigger) -> Time {
    match trigger {
        Trigger::Cyclic(interval) => Time(interval.saturating_mul(10)).max(LEAST),
        Trigger::Event(..) | Trigger::Freewheeling => WITHOUT_INTERVAL,
    }
}

/// Limits of all tasks of a program, and of those the manifest names besides, so that a wrong name is found.
pub(super) fn limits(manifest: &Manifest, program: &Program) -> Vec<(String, Limits)> {
    let given = |name: &str| manifest.tasks.iter().find(|task| task.name.value.eq_ignore_ascii_case(name));
    let of = |settings: Option<&TaskSettings>, trigger| Limits {
        watchdog: settings.and_then(|s| s.watchdog).unwrap_or(watchdog(trigger)),
        sensitivity: settings.and_then(|s| s.sensitivity).unwrap_or(1),
        max_overruns: settings.and_then(|s| s.max_overruns).unwrap_or(0),
    };
    let known = program.tasks.iter().map(|task| (task.name.clone(), of(given(&task.name), task.trigger)));
    let unknown = manifest.tasks.iter().filter(|task| !program.tasks.iter().any(|t| t.name.eq_ignore_ascii_case(&task.name.value)));
    known.chain(unknown.map(|task| (task.name.value.clone(), Limits::default()))).collect()
}
