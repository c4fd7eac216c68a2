//! The wall clock: the only place that asks what time it is.

use std::sync::OnceLock;
use std::time::{Duration, Instant};
use takt_abi::Time;

fn origin() -> Instant {
    static ORIGIN: OnceLock<Instant> = OnceLock::new();
    *ORIGIN.get_or_init(Instant::now)
}

/// Monotonic nanoseconds since the process first asked.
pub fn nanoseconds() -> u64 {
    origin().elapsed().as_nanos() as u64
}

/// Monotonic time since the process first asked.
pub fn machine_time() -> Time {
    Time(nanoseconds() as i64)
}

/// How machine time is paced.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// `None`: as fast as possible.
    factor: Option<f64>,
    start: Time,
}

impl Pace {
    /// Starts now, at so many times real time.
    pub fn start(factor: Option<f64>) -> Self {
        Self { factor, start: machine_time() }
    }
    /// Whether nothing is waited for.
    pub fn is_max(&self) -> bool {
        self.factor.is_none()
    }
    /// Sleeps until the wall clock has reached a machine time; the time to step with. At real time it is the wall clock's.
    pub fn wait(&self, release: Time) -> Time {
        let Some(factor) = self.factor else { return release };
        if factor == 1.0 {
            // Machine time is the wall clock's; the first release is now.
            if release > Time(0) {
                sleep_until(release);
            }
            return machine_time().max(release);
        }
        sleep_until(Time(self.start.0 + (release.0 as f64 / factor) as i64));
        release
    }
}

fn sleep_until(time: Time) {
    let left = time.0 - machine_time().0;
    if left > 0 {
        std::thread::sleep(Duration::from_nanos(left as u64));
    }
}
