//! The tool: manifest, commands, files for programs.
//!
//! Only this crate touches files, wall clocks and serialization for the tool's own purposes. Everything a command does can be called as a library:
//! [`project::load`] reads a project, [`machine::Machine::new`] makes it run.

pub mod attached;
pub mod backup;
pub mod clock;
pub mod commands;
pub mod console;
pub mod control;
pub mod doctor;

pub mod host;
pub mod journal;
pub mod language;
pub mod machine;
pub mod manifest;
pub mod messages;
pub mod parameters;
pub mod places;
pub mod platform;
pub mod plot;
pub mod program;
pub mod project;
pub mod realtime;
pub mod recording;
pub mod retain;
pub mod sources;
pub mod spelling;
pub mod state;
pub mod statistics;
pub mod trace;
pub mod unit;
pub mod values;
