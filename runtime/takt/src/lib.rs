//! The tool: manifest, commands, files for programs.
//!
//! Only this crate touches files, wall clocks and serialization for the tool's own purposes. Everything a command does can be called as a library:
//! [`manifest::read`] a manifest.

pub mod host;
pub mod manifest;
pub mod sources;
pub mod spelling;
