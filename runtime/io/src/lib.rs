//! Buses: the simulated segment, and drivers around drivers.
//!
//! A bus is a [`takt_engine::IoDriver`]: `open` does the slow work once and finds channels by name, `exchange` only moves numbers. [`sim`] has servo drives,
//! terminals and a valve in memory. [`Recorder`], [`Delayed`] and [`Lossy`] wrap any driver.
//!
//! **What is absent:** EtherCAT and Modbus.

mod delayed;
mod lossy;
mod recorder;
pub mod sim;

pub use delayed::Delayed;
pub use lossy::{Losses, Lossy};
pub use recorder::{Record, Recorder, Recording};
