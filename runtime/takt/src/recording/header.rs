//! Which program a recording belongs to, and how it was run.

use crate::program::Compiled;
use crate::project::Project;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use takt_engine::BusSize;
use takt_ir::{BodyId, Program};
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

/// Sections of a manifest that do not change what a program does with the same inputs.
const SHOWN_ONLY: [&str; 4] = ["simulation", "live", "report", "plot"];

/// How many calls of the host there were when a recording starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Calls {
    /// Of `take`.
    pub takes: u64,
    /// Of `submit`.
    pub submits: u64,
    /// Requests that were accepted; the number of the last ticket.
    pub accepted: u64,
}

/// Channels of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Size {
    drives: usize,
    bits_in: usize,
    bits_out: usize,
    analog_in: usize,
    analog_out: usize,
}

impl From<BusSize> for Size {
    fn from(size: BusSize) -> Self {
        let BusSize { drives, bits_in, bits_out, analog_in, analog_out } = size;
        Self { drives, bits_in, bits_out, analog_in, analog_out }
    }
}

impl From<Size> for BusSize {
    fn from(size: Size) -> Self {
        let Size { drives, bits_in, bits_out, analog_in, analog_out } = size;
        Self { drives, bits_in, bits_out, analog_in, analog_out }
    }
}

/// What must be the same for a recording to be played back.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Identity {
    /// Version of Takt.
    pub takt: String,
    /// Hash of each source, by its name in the project.
    pub sources: BTreeMap<String, String>,
    /// Hash of each section of the manifest that matters.
    pub manifest: BTreeMap<String, String>,
    /// Hash of the places of variables and the shape of the code: the same sources compiled by another Takt may differ.
    pub layout: String,
    /// Channels of the bus.
    pub bus: Size,
}

/// The first chunk of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// `recording` or `core`.
    pub kind: String,
    /// For people.
    pub project: String,
    /// What must be the same.
    pub identity: Identity,
    /// What ran the program: `jit` or `interp`.
    pub engine: String,
}

fn hash(bytes: &[u8]) -> String {
    format!("{:032x}", xxh3_128(bytes))
}

/// The name of a file in its project.
pub(crate) fn name_in(project: &Project, name: &str) -> String {
    let path = std::path::Path::new(name);
    path.strip_prefix(&project.root).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

impl Identity {
    /// Of a project that was compiled.
    pub fn of(project: &Project, compiled: &Compiled, program: &Program, bus: BusSize) -> Self {
        let sources = project.sources.list.iter().map(|source| (name_in(project, &source.name), hash(source.text.as_bytes())));
        let table: toml::Table = project.manifest_file.as_ref().and_then(|(_, text)| text.parse().ok()).unwrap_or_default();
        let sections = table.iter().filter(|(name, _)| !SHOWN_ONLY.contains(&name.as_str()));
        Self {
            takt: env!("CARGO_PKG_VERSION").into(),
            sources: sources.collect(),
            manifest: sections.map(|(name, value)| (name.clone(), hash(value.to_string().as_bytes()))).collect(),
            layout: layout(program, &compiled.conditions),
            bus: bus.into(),
        }
    }

    /// What is not the same, in words: `self` is the recording's, `now` the project's.
    pub fn differences(&self, now: &Self) -> Vec<String> {
        let mut found = Vec::new();
        if self.takt != now.takt {
            found.push(format!("it was made by Takt {}, this is {}", self.takt, now.takt));
        }
        compare(&self.sources, &now.sources, "the source", &mut found);
        compare(&self.manifest, &now.manifest, "the manifest's section", &mut found);
        if self.bus != now.bus {
            found.push(format!("its bus has {:?}, the project's {:?}", BusSize::from(self.bus), BusSize::from(now.bus)));
        }
        if found.is_empty() && self.layout != now.layout {
            found.push("another build of Takt compiles the same sources otherwise".into());
        }
        found
    }
}

fn compare(then: &BTreeMap<String, String>, now: &BTreeMap<String, String>, what: &str, found: &mut Vec<String>) {
    for (name, hash) in then {
        match now.get(name) {
            None => found.push(format!("{what} `{name}` is missing")),
            Some(other) if other != hash => found.push(format!("{what} `{name}` has changed")),
            Some(_) => {}
        }
    }
    found.extend(now.keys().filter(|name| !then.contains_key(*name)).map(|name| format!("{what} `{name}` is new")));
}

/// Places of variables, and shape of the code.
fn layout(program: &Program, conditions: &[BodyId]) -> String {
    let mut hasher = Xxh3::new();
    hasher.update(&program.image_size.to_le_bytes());
    for global in &program.globals {
        hasher.update(global.name.as_bytes());
        hasher.update(&global.offset.to_le_bytes());
    }
    let lasting = program.bodies.iter().enumerate().filter(|(i, _)| !conditions.contains(&BodyId(*i as u32)));
    for (_, body) in lasting {
        hasher.update(body.name.as_bytes());
        let insts: usize = body.blocks.iter().map(|block| block.insts.len()).sum();
        hasher.update(&(insts as u64).to_le_bytes());
        hasher.update(&(body.locals.len() as u64).to_le_bytes());
    }
    hasher.update(&program.init);
    format!("{:032x}", hasher.digest128())
}

/// The number that two runs are compared by: all variables, the heap and the resources.
pub fn state_hash(engine: &takt_engine::Engine) -> u64 {
    let mut hasher = Xxh3::new();
    engine.state(&mut |bytes| hasher.update(bytes));
    hasher.digest()
}
