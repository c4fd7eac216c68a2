//! The test bench: cases as data and random programs, run in both executors and compared bit for bit.

pub mod agreement;
pub mod bench;
pub mod case;
pub mod coverage;
pub mod generate;
pub mod large;
pub mod shrink;
pub mod trial;
