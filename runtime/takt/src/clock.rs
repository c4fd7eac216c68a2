//! The wall clock: the only place that asks what time it is.

use crate::platform;
use crate::realtime::system;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use takt_abi::Time;

/// Machine time 0 under the real clock, in nanoseconds of the system's monotonic clock.
pub fn origin() -> u64 {
    static ORIGIN: OnceLock<u64> = OnceLock::new();
    *ORIGIN.get_or_init(system::monotonic)
}

/// Monotonic nanoseconds since the process first asked.
pub fn nanoseconds() -> u64 {
    let origin = origin();
    system::monotonic() - origin
}

/// An alarm for the calling thread, on the scale of [`machine_time`]; `None` where the system has none to give.
pub fn alarm() -> Option<Box<dyn takt_engine::Alarm>> {
    #[cfg(target_os = "linux")]
    return system::SignalAlarm::new(origin()).ok().map(|alarm| Box::new(alarm) as _);
    #[cfg(not(target_os = "linux"))]
    None
}

/// Nanoseconds for which machine time stood still.
static HELD: AtomicU64 = AtomicU64::new(0);

/// Nanoseconds for which machine time stood still, because somebody paused the machine.
pub fn held() -> u64 {
    HELD.load(Ordering::Relaxed)
}

/// Monotonic time since the process first asked, without the time in which the machine was paused.
pub fn machine_time() -> Time {
    Time(nanoseconds() as i64 - held() as i64)
}

/// Machine time goes on from here: to be called when a paused machine goes on, by the thread that steps it. It never goes forward.
pub fn go_on_from(time: Time) {
    let ahead = machine_time().0.saturating_sub(time.0).max(0);
    HELD.fetch_add(ahead as u64, Ordering::Relaxed);
}

/// How machine time is paced.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// `None`: as fast as possible.
    factor: Option<f64>,
    start: Time,
    spin: Time,
}

impl Pace {
    /// Starts now, at so many times real time.
    pub fn start(factor: Option<f64>) -> Self {
        Self { factor, start: machine_time(), spin: Time(0) }
    }
    /// Sleeping ends so long before the time comes; then the clock is looked at until it is there.
    pub fn spinning(self, spin: Time) -> Self {
        Self { spin, ..self }
    }
    /// Whether nothing is waited for.
    pub fn is_max(&self) -> bool {
        self.factor.is_none()
    }
    /// Sleeps until the wall clock has reached a machine time, or a stop is asked for; the time to step with. At real time it is the wall clock's.
    pub fn wait(&self, release: Time) -> Time {
        self.wait_unless(release, platform::stop_requested)
    }
    /// The same, and nothing ends the wait early.
    pub fn wait_fully(&self, release: Time) -> Time {
        self.wait_unless(release, || false)
    }

    fn wait_unless(&self, release: Time, stop: fn() -> bool) -> Time {
        let Some(factor) = self.factor else { return release };
        if factor == 1.0 {
            // Machine time is the wall clock's; the first release is now.
            if release > Time(0) {
                self.sleep_until(release, stop);
            }
            return machine_time();
        }
        self.sleep_until(Time(self.start.0 + (release.0 as f64 / factor) as i64), stop);
        release
    }

    fn sleep_until(&self, time: Time, stop: fn() -> bool) {
        let wake = time.0.saturating_sub(self.spin.0);
        while machine_time().0 < wake && !stop() {
            system::sleep_until((origin() + held()).saturating_add_signed(wake));
        }
        while machine_time() < time && !stop() {
            std::hint::spin_loop();
        }
    }
}
