//! What a program knows of the system that it runs in, and what it says to people.

use crate::plain::Str;
use crate::{Bool, Dword, StDateTime, Time, st_struct};

st_struct! {
    /// What TwinCAT's `_TaskInfo` tells of a task. Execution times and real-time violations are not told: a recorded run would not be the same again.
    pub struct PlcTaskSystemInfo as TaskInfo {
        /// 0.
        ObjId: u32,
        /// Period in 100 ns.
        CycleTime: u32,
        /// Priority, 0 is the highest.
        Priority: u16,
        /// 0: there is no ADS.
        AdsPort: u16,
        /// Scans so far, this one included.
        CycleCount: u32,
        /// Start of the scan in ns of the machine's clock.
        DcTaskTime: i64,
        /// 0.
        LastExecTime: u32,
        /// This is the first scan.
        FirstCycle: Bool,
        /// The scan before this one took longer than the period.
        CycleTimeExceeded: Bool,
        /// FALSE.
        InCallAfterOutputUpdate: Bool,
        /// FALSE.
        RTViolation: Bool,
        /// Name of the task.
        TaskName: Str<64>,
    }
}
st_struct! {
    /// What TwinCAT's `_AppInfo` tells of the application.
    pub struct PlcAppSystemInfo as AppInfo {
        /// 0.
        ObjId: u32,
        /// How many tasks there are.
        TaskCnt: u32,
        /// Online changes since the program was loaded.
        OnlineChangeCnt: u32,
        /// 0.
        Flags: Dword,
        /// 0: there is no ADS.
        AdsPort: u16,
        /// Retained values were loaded.
        BootDataLoaded: Bool,
        /// FALSE.
        OldBootData: Bool,
        /// DT#1970-1-1: when it was built is not known.
        AppTimestamp: StDateTime,
        /// FALSE.
        KeepOutputsOnBP: Bool,
        /// FALSE.
        ShutdownInProgress: Bool,
        /// FALSE.
        LicensesPending: Bool,
        /// FALSE.
        BSODOccured: Bool,
        /// Name of the project.
        AppName: Str<64>,
        /// Name of the project.
        ProjectName: Str<64>,
    }
}

/// How much a message matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MessageLevel {
    /// For information.
    #[default]
    Info,
    /// Something may be wrong.
    Warning,
    /// Something is wrong.
    Error,
}

/// What a program says to people.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Message {
    /// When: start of the scan.
    pub time: Time,
    /// How much it matters.
    pub level: MessageLevel,
    /// What.
    pub text: Str<256>,
}

/// Messages that wait for somebody to take them.
const WAITING: usize = 256;

/// The messages of a program: written in scans, taken between them. When nobody takes them the first ones stay and the others are counted.
#[derive(Debug)]
pub struct Messages {
    ring: Box<[Message]>,
    first: usize,
    count: usize,
    lost: u64,
}

impl Default for Messages {
    fn default() -> Self {
        let none = Message { time: Time(0), level: MessageLevel::Info, text: Str::EMPTY };
        Self { ring: vec![none; WAITING].into_boxed_slice(), first: 0, count: 0, lost: 0 }
    }
}

impl Messages {
    /// Says something; allocates nothing.
    pub fn push(&mut self, message: Message) {
        if self.count == self.ring.len() {
            self.lost += 1;
            return;
        }
        let at = (self.first + self.count) % self.ring.len();
        self.ring[at] = message;
        self.count += 1;
    }
    /// The oldest, once.
    pub fn take(&mut self) -> Option<Message> {
        self.count = self.count.checked_sub(1)?;
        let message = self.ring[self.first];
        self.first = (self.first + 1) % self.ring.len();
        Some(message)
    }
    /// How many were lost since this was asked the last time.
    pub fn lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_out_in_order_and_those_too_many_are_counted() {
        let mut messages = Messages::default();
        let message = |n: usize| Message { time: Time(n as i64), level: MessageLevel::Info, text: Str::new("a") };
        for round in 0..3 {
            (0..WAITING + round).for_each(|n| messages.push(message(n)));
            assert_eq!(messages.lost(), round as u64);
            let taken: Vec<i64> = std::iter::from_fn(|| messages.take()).map(|m| m.time.0).collect();
            assert_eq!(taken, (0..WAITING as i64).collect::<Vec<_>>());
        }
        assert_eq!((messages.take(), messages.lost()), (None, 0));
    }
}
