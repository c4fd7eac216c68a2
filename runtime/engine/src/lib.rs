//! The scan: tasks, image, faults, forces, axes.
//!
//! [`load`] makes an [`Engine`] of a program; [`Engine::step`] runs what is due. The engine asks no clock, reads no file and knows no source text: time is
//! an argument, the bus is an [`IoDriver`], files are behind `abi::Host`. Two runs with the same arguments are the same run.
//!
//! **A bus cycle** (once per scan of the bus task): latch inputs → actual values of the axes → forces → programs → forces → set values of the axes →
//! outputs → [`IoDriver::exchange`], which brings the inputs of the next cycle.
//!
//! **Invariants.** A step allocates nothing, except the record of a fault. A fault stops the application; axes and bus go on, with safe outputs.
//! Nothing in the image is trusted by the axis stage.
//!
//! **What is absent:** traces, online change, several resources.

mod axis;
mod bus;
mod checkpoint;
mod command;
mod core;
mod engine;
mod executor;
mod fault;
mod force;
mod latch;
mod limits;
mod load;
mod mapping;
mod memory;
mod observe;
mod options;
mod pack;
mod replay;
mod retain;
mod schedule;
mod statistics;
mod system;

pub use axis::stage::AxisStatus;
pub use axis::{AxisConfig, AxisLimits, AxisProblem, Encoder, FeedForward, Home, Lag, cia402::DriveState};
pub use bus::{BusSize, Channel, DriveIn, DriveOut, IoDriver, IoFault, NoBus, ProcessImage, Signal, Wire};
pub use checkpoint::{Checkpoint, CheckpointError};
pub use command::{AccessError, Command, CommandError, writable};
pub use engine::{Engine, StopHandle};
pub use fault::{FaultRecord, Frame};
pub use force::{FORCED_BYTES, FORCES, Forced};
pub use limits::{Alarm, Limits};
pub use load::{LoadError, WireProblem, load};
pub use observe::{Observer, Scanned};
pub use options::{Clock, ExecutorKind, Options, Preemption};
pub use replay::{Event, Recorder, Strayed};
pub use retain::{Reset, Restore, RetainLayout, Snapshot, SnapshotReader};
pub use statistics::{Histogram, TaskStatistics};

#[cfg(test)]
mod tests;
