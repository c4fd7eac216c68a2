//! `[realtime]` and `[task.NAME]`: what the machine gives the program, and what it demands of it.

use super::Located;
use super::reader::Table;
use crate::realtime::Settings;
use takt_abi::Time;

/// Limits of a task; what is not given has a default.
#[derive(Debug, Clone, PartialEq)]
pub struct TaskSettings {
    /// Name of the task.
    pub name: Located<String>,
    /// Time that a scan may take; 0: no limit but fuel.
    pub watchdog: Option<Time>,
    /// Slow scans in a row, or multiples of the time in one scan, that are the fault.
    pub sensitivity: Option<u32>,
    /// Missed releases in a row that are a fault; 0: none.
    pub max_overruns: Option<u32>,
}

pub(super) fn read_realtime(table: &mut Table<'_, '_>) -> Settings {
    let ordinary = Settings::default();
    let spin = table.duration("spin");
    if spin.is_some_and(|spin| spin > Time::from_millis(1)) {
        let span = table.span();
        table.error(
            span,
            "`spin` in [realtime] must be at most 1ms",
            "it is time that the processor burns before each scan; 20us to 50us are usual",
        );
    }
    Settings {
        priority: whole(table, "priority", 98.0).map_or(ordinary.priority, |number| number as u8),
        cpu: whole(table, "cpu", 1023.0).map(|number| number as u16),
        spin: spin.unwrap_or(ordinary.spin),
        lock_memory: table.boolean("lock-memory").unwrap_or(ordinary.lock_memory),
        stay_awake: table.boolean("stay-awake").unwrap_or(ordinary.stay_awake),
    }
}

pub(super) fn read_task(name: Located<String>, table: &mut Table<'_, '_>) -> TaskSettings {
    TaskSettings {
        name,
        watchdog: table.duration("watchdog"),
        sensitivity: whole(table, "sensitivity", 1000.0).map(|number| (number as u32).max(1)),
        max_overruns: whole(table, "max-overruns", 1e9).map(|number| number as u32),
    }
}

/// A whole number from 0.
fn whole(table: &mut Table<'_, '_>, key: &str, most: f64) -> Option<f64> {
    let number = table.number(key, 0.0..=most)?;
    if number.fract() != 0.0 {
        let span = table.span();
        table.error(span, format!("`{key}` must be a whole number, found {number}"), "write it without a point");
        return None;
    }
    Some(number)
}
