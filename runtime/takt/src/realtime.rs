//! The resource thread: the thread that steps the engine under the real clock, as free from disturbances as the system allows.
//!
//! [`Held::hold`] is called when everything is compiled, loaded and opened, and immediately before the first scan. It locks and touches memory, keeps
//! the processor out of deep sleep, and only then asks for SCHED_FIFO, so that no other thread inherits it. What the process may not do is collected as
//! [`Missing`] and said; the program runs anyway. When the value is dropped the thread is an ordinary one again.

#[cfg(target_os = "linux")]
#[path = "realtime/linux.rs"]
pub mod system;
#[cfg(not(target_os = "linux"))]
#[path = "realtime/other.rs"]
pub mod system;

pub mod guard;
pub mod samples;

use crate::language::{self, Word};
use takt_abi::Time;

/// `[realtime]` of the manifest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// SCHED_FIFO priority, 1 to 98; 0: the scheduling of ordinary programs.
    pub priority: u8,
    /// The processor that the thread stays on.
    pub cpu: Option<u16>,
    /// So long before a release the thread stops sleeping and looks at the clock until it is time.
    pub spin: Time,
    /// Memory is locked and touched before the first scan.
    pub lock_memory: bool,
    /// Processors are kept out of sleep states that take long to leave.
    pub stay_awake: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { priority: 80, cpu: None, spin: Time(0), lock_memory: true, stay_awake: true }
    }
}

/// Something that the system does not let the process do.
#[derive(Debug)]
pub struct Missing {
    /// What.
    pub what: Right,
    /// What the system says.
    pub error: std::io::Error,
}

/// What a resource thread asks of the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Right {
    /// A real-time priority.
    Priority,
    /// Locked memory.
    Memory,
    /// Processors that do not sleep deeply.
    Awake,
    /// A processor of its own.
    Affinity,
}

impl Right {
    /// What it is, and what it takes.
    pub fn text(self, language: language::Language) -> &'static str {
        match self {
            Self::Priority => Word::NoPriority,
            Self::Memory => Word::NoLockedMemory,
            Self::Awake => Word::NoWakefulness,
            Self::Affinity => Word::NoAffinity,
        }
        .text(language)
    }
}

/// The thread while it is the resource thread.
#[derive(Debug)]
pub struct Held {
    /// What could not be had.
    pub missing: Vec<Missing>,
    _awake: Option<std::fs::File>,
    settings: Settings,
}

impl Held {
    /// Makes the calling thread the resource thread. `stack` are the bytes of native stack that the engine may use.
    pub fn hold(settings: Settings, stack: usize) -> Self {
        let mut missing = Vec::new();
        let mut need = |what: Right, result: std::io::Result<()>| missing.extend(result.err().map(|error| Missing { what, error }));
        if settings.lock_memory {
            need(Right::Memory, system::lock_memory());
            system::touch_stack(stack);
            system::touch_memory();
        }
        let mut awake = None;
        if settings.stay_awake {
            match system::stay_awake() {
                Ok(file) => awake = Some(file),
                // A system without sleep states has no such file, and nothing is missing.
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => need(Right::Awake, Err(error)),
            }
        }
        system::least_timer_slack();
        if let Some(cpu) = settings.cpu {
            need(Right::Affinity, system::stay_on(cpu));
        }
        if settings.priority > 0 {
            need(Right::Priority, system::fifo(settings.priority));
        }
        guard::watch(true);
        Self { missing, _awake: awake, settings }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        guard::watch(false);
        if self.settings.priority > 0 {
            system::ordinary();
        }
        if self.settings.lock_memory {
            system::unlock_memory();
        }
    }
}

/// What the system did to the calling thread so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Disturbances {
    /// Pages that had to be mapped.
    pub minor_faults: u64,
    /// Pages that had to be read from a disk.
    pub major_faults: u64,
    /// Times that the thread waited of its own accord: once per sleep.
    pub waits: u64,
    /// Times that another thread took the processor.
    pub preempted: u64,
    /// Requests to the allocator, while it was held.
    pub allocations: u64,
}

impl Disturbances {
    /// Since `start`.
    pub fn since(self, start: Self) -> Self {
        Self {
            minor_faults: self.minor_faults - start.minor_faults,
            major_faults: self.major_faults - start.major_faults,
            waits: self.waits - start.waits,
            preempted: self.preempted - start.preempted,
            allocations: self.allocations - start.allocations,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_is_held_as_far_as_the_system_allows_and_let_go() {
        std::thread::spawn(|| {
            let held = Held::hold(Settings { cpu: Some(4000), ..Settings::default() }, 1 << 20);
            let of = |right| held.missing.iter().any(|m| m.what == right);
            assert!(of(Right::Affinity), "there is no processor 4000: {:?}", held.missing);
            if cfg!(target_os = "linux") && !of(Right::Priority) {
                assert_eq!(system::policy(), Some((1, 80)));
                let inherited = std::thread::spawn(system::policy).join().unwrap();
                assert_eq!(inherited.map(|(policy, _)| policy), Some(0), "threads started now are ordinary ones");
            }
            drop(held);
            assert!(system::policy().is_none_or(|(policy, _)| policy == 0));
        })
        .join()
        .unwrap();
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn touched_stack_and_memory_do_not_fault_again() {
        std::thread::Builder::new()
            .stack_size(16 << 20)
            .spawn(|| {
                let mut heap = vec![1u8; 4 << 20].into_boxed_slice();
                system::touch_stack(8 << 20);
                system::touch_memory();
                let before = system::disturbances();
                system::touch_stack(7 << 20);
                heap.chunks_mut(4096).for_each(|page| page[0] += 1);
                let faults = system::disturbances().since(before).minor_faults;
                assert!(faults < 8, "{faults} of 2800 pages");
                drop(heap);
            })
            .unwrap()
            .join()
            .unwrap();
    }
}
