//! The test bench: cases as data, run in both executors and compared bit for bit.

pub mod bench;
pub mod case;
