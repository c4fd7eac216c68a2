//! What only Linux offers: absolute sleeping, locked memory, SCHED_FIFO, timers that signal a thread.
#![allow(unsafe_code, reason = "system calls that the standard library does not make")]

use super::Disturbances;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU32, Ordering};
use takt_abi::Time;
use takt_engine::Alarm;

fn checked(result: libc::c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

fn timespec(ns: u64) -> libc::timespec {
    libc::timespec { tv_sec: (ns / 1_000_000_000) as libc::time_t, tv_nsec: (ns % 1_000_000_000) as libc::c_long }
}

/// Nanoseconds of CLOCK_MONOTONIC.
pub fn monotonic() -> u64 {
    let mut now = timespec(0);
    // SAFETY: writes one timespec to a valid pointer.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Sleeps until CLOCK_MONOTONIC has reached that many nanoseconds, or a signal has come.
pub fn sleep_until(ns: u64) {
    let until = timespec(ns);
    // SAFETY: reads one timespec from a valid pointer; with TIMER_ABSTIME nothing is written back.
    unsafe { libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &raw const until, std::ptr::null_mut()) };
}

/// Locks what is mapped and what will be, as soon as it is touched.
pub fn lock_memory() -> io::Result<()> {
    // SAFETY: no memory is passed.
    checked(unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE | libc::MCL_ONFAULT) })
}

/// Takes the lock away.
pub fn unlock_memory() {
    // SAFETY: no memory is passed.
    unsafe { libc::munlockall() };
}

/// Touches that many bytes of the calling thread's stack; the caller knows that it is so large.
#[inline(never)]
pub fn touch_stack(bytes: usize) {
    const STEP: usize = 16 << 10;
    let mut block = [0u8; STEP];
    std::hint::black_box(&mut block);
    if bytes > STEP {
        touch_stack(bytes - STEP);
    }
    std::hint::black_box(&mut block);
}

/// Touches everything that is mapped: code, data, heap, image; not the stack of the calling thread, of which only a part is used.
pub fn touch_memory() {
    let Ok(maps) = std::fs::read_to_string("/proc/self/maps") else { return };
    let here = (&raw const maps) as usize;
    for (start, end, write) in maps.lines().filter_map(mapping) {
        if (start..end).contains(&here) {
            continue;
        }
        let advice = if write { libc::MADV_POPULATE_WRITE } else { libc::MADV_POPULATE_READ };
        // SAFETY: populating changes no content; a range that has gone meanwhile, and a kernel that cannot, is an error that changes nothing.
        unsafe { libc::madvise(start as *mut libc::c_void, end - start, advice) };
    }
}

/// Start, end, and whether it may be written, of a line of `/proc/self/maps` that can be touched.
fn mapping(line: &str) -> Option<(usize, usize, bool)> {
    let mut words = line.split_ascii_whitespace();
    let (start, end) = words.next()?.split_once('-')?;
    let rights = words.next()?;
    let name = words.nth(3).unwrap_or_default();
    let special = name.starts_with("[v") || name.starts_with("/dev/");
    let number = |text| usize::from_str_radix(text, 16).ok();
    (rights.starts_with('r') && !special).then_some((number(start)?, number(end)?, rights.as_bytes().get(1) == Some(&b'w')))
}

/// Keeps processors out of sleep states that take long to leave, until the file is closed.
pub fn stay_awake() -> io::Result<File> {
    let mut file = OpenOptions::new().write(true).open("/dev/cpu_dma_latency")?;
    file.write_all(&0i32.to_ne_bytes())?;
    Ok(file)
}

/// Ordinary threads are woken up to 50 µs late otherwise.
pub fn least_timer_slack() {
    // SAFETY: this option takes a number only.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) };
}

/// Keeps the calling thread on one processor.
pub fn stay_on(cpu: u16) -> io::Result<()> {
    // SAFETY: an all-zero set is the empty one.
    let mut set: libc::cpu_set_t = unsafe { std::mem::zeroed() };
    if usize::from(cpu) >= 8 * size_of::<libc::cpu_set_t>() {
        return Err(io::Error::from_raw_os_error(libc::EINVAL));
    }
    // SAFETY: the number lies inside the set.
    unsafe { libc::CPU_SET(cpu.into(), &mut set) };
    // SAFETY: reads a set of the size given.
    checked(unsafe { libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &raw const set) })
}

fn schedule(policy: libc::c_int, priority: u8) -> io::Result<()> {
    let parameter = libc::sched_param { sched_priority: priority.into() };
    // SAFETY: reads one parameter from a valid pointer; 0 is the calling thread.
    checked(unsafe { libc::sched_setscheduler(0, policy, &raw const parameter) })
}

/// Puts the calling thread under SCHED_FIFO; threads that it starts are ordinary ones.
pub fn fifo(priority: u8) -> io::Result<()> {
    schedule(libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, priority)
}

/// Puts the calling thread back.
pub fn ordinary() {
    // Always allowed.
    let _ = schedule(libc::SCHED_OTHER, 0);
}

/// Policy (0 other, 1 FIFO) and priority of the calling thread.
pub fn policy() -> Option<(i32, i32)> {
    let mut parameter = libc::sched_param { sched_priority: 0 };
    // SAFETY: writes one parameter to a valid pointer; 0 is the calling thread.
    let (policy, result) = unsafe { (libc::sched_getscheduler(0), libc::sched_getparam(0, &raw mut parameter)) };
    (policy >= 0 && result == 0).then_some((policy & !libc::SCHED_RESET_ON_FORK, parameter.sched_priority))
}

/// What the system did to the calling thread so far.
pub fn disturbances() -> Disturbances {
    // SAFETY: all zero is a valid rusage.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: writes one rusage to a valid pointer.
    unsafe { libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage) };
    Disturbances {
        minor_faults: usage.ru_minflt as u64,
        major_faults: usage.ru_majflt as u64,
        waits: usage.ru_nvcsw as u64,
        preempted: usage.ru_nivcsw as u64,
        allocations: super::guard::requests(),
    }
}

/// What the signal handler is handed. It is never freed, because a signal may still be on its way when the timer is gone.
#[derive(Debug)]
struct Slot {
    flag: AtomicPtr<AtomicU32>,
    fired: AtomicBool,
}

/// An alarm that signals the thread that made it.
#[derive(Debug)]
pub struct SignalAlarm {
    timer: libc::timer_t,
    slot: &'static Slot,
    /// When the timer fires; 0: it has not been set.
    armed: Time,
    /// Of machine time, in nanoseconds of CLOCK_MONOTONIC.
    origin: u64,
}

fn signal() -> libc::c_int {
    libc::SIGRTMIN() + 5
}

extern "C" fn ring(_: libc::c_int, info: *mut libc::siginfo_t, _: *mut libc::c_void) {
    // SAFETY: the kernel passes a valid siginfo. Only signals of a timer carry a slot; any process may send this signal otherwise.
    let slot = unsafe {
        if (*info).si_code != libc::SI_TIMER {
            return;
        }
        &*(*info).si_value().sival_ptr.cast::<Slot>()
    };
    slot.fired.store(true, Ordering::Relaxed);
    // SAFETY: null, or a flag that the engine keeps alive until it is taken out of the slot; this handler runs on the same thread.
    if let Some(flag) = unsafe { slot.flag.load(Ordering::Relaxed).as_ref() } {
        flag.store(1, Ordering::Relaxed);
    }
}

impl SignalAlarm {
    /// For the calling thread. `origin` is machine time 0 in nanoseconds of CLOCK_MONOTONIC.
    pub fn new(origin: u64) -> io::Result<Self> {
        // SAFETY: all zero is a valid sigaction and sigevent; the handler has the signature that SA_SIGINFO asks for and touches atomics only.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = ring as extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void) as libc::sighandler_t;
            action.sa_flags = libc::SA_SIGINFO | libc::SA_RESTART;
            checked(libc::sigaction(signal(), &raw const action, std::ptr::null_mut()))?;
            let slot: &'static Slot =
                Box::leak(Box::new(Slot { flag: AtomicPtr::new(std::ptr::null_mut()), fired: AtomicBool::new(false) }));
            let mut event: libc::sigevent = std::mem::zeroed();
            event.sigev_notify = libc::SIGEV_THREAD_ID;
            event.sigev_signo = signal();
            event.sigev_notify_thread_id = libc::gettid();
            event.sigev_value.sival_ptr = std::ptr::from_ref(slot).cast_mut().cast();
            let mut timer: libc::timer_t = std::ptr::null_mut();
            checked(libc::timer_create(libc::CLOCK_MONOTONIC, &raw mut event, &raw mut timer))?;
            Ok(Self { timer, slot, armed: Time(0), origin })
        }
    }
}

impl Alarm for SignalAlarm {
    unsafe fn arm(&mut self, at: Time, flag: NonNull<AtomicU32>) {
        self.slot.flag.store(flag.as_ptr(), Ordering::Relaxed);
        // A timer that is to fire sooner stays: it costs one look at the clock more, and saves a system call in nearly every scan.
        let fired = self.slot.fired.swap(false, Ordering::Relaxed);
        if !fired && self.armed != Time(0) && self.armed <= at {
            return;
        }
        self.armed = at;
        let setting = libc::itimerspec {
            it_interval: timespec(0),
            it_value: timespec((self.origin + crate::clock::held()).saturating_add_signed(at.0).max(1)),
        };
        // SAFETY: reads one setting from a valid pointer; the timer lives as long as this value.
        unsafe { libc::timer_settime(self.timer, libc::TIMER_ABSTIME, &raw const setting, std::ptr::null_mut()) };
    }
    fn disarm(&mut self) {
        self.slot.flag.store(std::ptr::null_mut(), Ordering::Relaxed);
    }
}

impl Drop for SignalAlarm {
    fn drop(&mut self) {
        self.disarm();
        // SAFETY: the timer was made in `new` and is deleted once.
        unsafe { libc::timer_delete(self.timer) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_map_is_read() {
        assert_eq!(mapping("55d0-55e0 r-xp 00001000 fe:00 123   /usr/bin/takt"), Some((0x55d0, 0x55e0, false)));
        assert_eq!(mapping("7f00-7f10 rw-p 00000000 00:00 0"), Some((0x7f00, 0x7f10, true)));
        for no in ["7f00-7f10 ---p 00000000 00:00 0", "7f00-7f10 r-xp 00000000 00:00 0   [vdso]", "", "x y"] {
            assert_eq!(mapping(no), None, "{no}");
        }
    }

    #[test]
    fn an_alarm_sets_the_flag_at_its_time() {
        let origin = monotonic();
        let now = || Time((monotonic() - origin) as i64);
        let mut alarm = SignalAlarm::new(origin).unwrap();
        let flag = AtomicU32::new(0);
        for _ in 0..3 {
            let at = Time(now().0 + 2_000_000);
            // SAFETY: the flag outlives the alarm's use of it.
            unsafe { alarm.arm(at, NonNull::from(&flag)) };
            while flag.load(Ordering::Relaxed) == 0 {
                assert!(now().0 < at.0 + 5_000_000_000, "it never came");
            }
            assert!(now() >= at, "not too soon");
            flag.store(0, Ordering::Relaxed);
        }
        // SAFETY: as above.
        unsafe { alarm.arm(Time(now().0 + 1_000_000), NonNull::from(&flag)) };
        alarm.disarm();
        sleep_until(monotonic() + 3_000_000);
        sleep_until(monotonic() + 1_000_000);
        assert_eq!(flag.load(Ordering::Relaxed), 0, "nobody listens");
    }
}
