//! Recordings: everything that decided a run beside its program, so that it can be run again, bit for bit (docs/replay.md).
//!
//! A [`stream::Stream`] takes what happens on the thread that steps the engine, into buffers that are there from the start; a [`writer`] thread packs it
//! into chunks with checksums. A [`player::Player`] plays them back. A core file is the end of such a recording with the program beside it.

pub mod codec;
pub mod file;
pub mod header;
pub mod host;
pub mod player;
pub mod postmortem;
pub mod stream;
pub mod writer;
