//! The clock of the machine. It stands still during a scan, and in simulation it is the simulated one; there is no way to ask the computer's own.

use takt_abi::{FnDesc, StLtime, StTime, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[MachineTime::DESC, MachineLtime::DESC, Milliseconds::DESC, Microseconds::DESC];

native_fn! {
    /// Machine time in milliseconds; wraps after 49 days. Constant during a scan.
    pub fn TIME as MachineTime(cx) -> StTime { Ok(StTime((cx.now.0 / 1_000_000) as u32)) }
}
native_fn! {
    /// Machine time in nanoseconds. Constant during a scan.
    pub fn LTIME as MachineLtime(cx) -> StLtime { Ok(StLtime(cx.now.0)) }
}
native_fn! {
    /// Machine time in milliseconds, as a number (library SysTime); wraps after 49 days.
    pub fn SysTimeGetMs as Milliseconds(cx) -> u32 { Ok((cx.now.0 / 1_000_000) as u32) }
}
native_fn! {
    /// Writes the machine time in microseconds to the ULINT at `pUsTime`; always 0.
    pub fn SysTimeGetUs as Microseconds(cx, pUsTime: u64) -> u32 {
        let now = (cx.now.0 / 1000) as u64;
        cx.store(pUsTime, &now)?;
        Ok(0)
    }
}
