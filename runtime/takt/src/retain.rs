//! Retained variables on disk: RETAIN and PERSISTENT survive `kill -9` and power cuts at any instant.
//!
//! Two files in the state folder take turns ([`slot`]); whichever is whole and newest counts. With the values travels a description of where they belong
//! ([`layout`]), so that another version of the program can take them over by path and type ([`migrate`]), or refuse with a reason. A thread of its own
//! writes ([`writer`]); the scan only copies.

mod convert;
pub mod layout;
pub mod migrate;
pub mod slot;
pub mod writer;

pub use migrate::{Migration, Refusal};
pub use slot::{Generation, LoadError, Loaded};

use layout::Description;
use takt_engine::{Reset, RetainLayout};
use takt_ir::Program;

/// How often snapshots are taken unless the manifest says otherwise.
pub const INTERVAL: takt_abi::Time = takt_abi::Time::from_millis(100);

/// What a machine starts from.
#[derive(Debug, Clone)]
pub struct Source {
    /// What was found in the state folder.
    pub generation: Option<Generation>,
    /// What kind of start it is.
    pub kind: Reset,
    /// Values that cannot be taken over are left out rather than a reason to refuse: an import brings others.
    pub lenient: bool,
}

/// The values of a snapshot or of [`takt_engine::Engine::retained`], one variable behind the other as files have them.
pub fn pack(program: &Program, layout: &RetainLayout, bytes: &[u8], out: &mut Vec<u8>) {
    out.clear();
    for (i, retained) in program.retained.iter().enumerate() {
        let (at, len) = (layout.place(i), program.types.size(retained.ty) as usize);
        out.extend_from_slice(bytes.get(at..at + len).unwrap_or_default());
    }
}

/// The description of a program's retained variables.
pub fn describe(name: &str, program: &Program) -> Description {
    Description::of(name, program)
}

#[cfg(test)]
mod tests;
