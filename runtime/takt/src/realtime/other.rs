//! Systems other than Linux check and simulate: time passes there, but nothing is promised about it.

use super::Disturbances;
use std::fs::File;
use std::io;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

fn unsupported() -> io::Error {
    io::Error::from(io::ErrorKind::Unsupported)
}

/// Nanoseconds of a monotonic clock.
pub fn monotonic() -> u64 {
    static ORIGIN: OnceLock<Instant> = OnceLock::new();
    ORIGIN.get_or_init(Instant::now).elapsed().as_nanos() as u64 + 1
}

/// Sleeps until that clock has reached that many nanoseconds.
pub fn sleep_until(ns: u64) {
    std::thread::sleep(Duration::from_nanos(ns.saturating_sub(monotonic())));
}

/// Not here.
pub fn lock_memory() -> io::Result<()> {
    Err(unsupported())
}
/// Not here.
pub fn unlock_memory() {}
/// Not here.
pub fn touch_stack(_: usize) {}
/// Not here.
pub fn touch_memory() {}
/// Not here.
pub fn stay_awake() -> io::Result<File> {
    Err(unsupported())
}
/// Not here.
pub fn least_timer_slack() {}
/// Not here.
pub fn stay_on(_: u16) -> io::Result<()> {
    Err(unsupported())
}
/// Not here.
pub fn fifo(_: u8) -> io::Result<()> {
    Err(unsupported())
}
/// Not here.
pub fn ordinary() {}
/// Not known here.
pub fn policy() -> Option<(i32, i32)> {
    None
}
/// Not known here.
pub fn disturbances() -> Disturbances {
    Disturbances::default()
}
