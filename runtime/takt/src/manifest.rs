//! `takt.toml`: what Structured Text cannot say of a machine.
//!
//! [`read`] turns text into a typed [`Manifest`] and finds every mistake in it, each with its place. It touches no file and knows no program: whether
//! an axis or a variable exists is found when the program is bound (`machine`). The format is documented in `docs/manifest.md`.

mod axis;
mod duration;
mod error;
mod number;
mod reader;
mod realtime;
mod simulation;
mod view;

pub use axis::{Axis, Home, Lag, Limits, Switches};
pub use duration::parse_duration;
pub use error::{ManifestError, ManifestErrors, Place};
pub use realtime::TaskSettings;
pub use simulation::{AxisPlant, Operator, Setting, Sim, SimInput, Simulation, Step, Valve};
pub use view::{Item, Plot};

use error::Sink;
use reader::Table;
use std::ops::Range;

/// Something read from the manifest, with its place there.
#[derive(Debug, Clone, PartialEq)]
pub struct Located<T> {
    /// What.
    pub value: T,
    /// Bytes of the manifest.
    pub span: Range<usize>,
}

/// Integer arithmetic (DESIGN §8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Arithmetic {
    /// 64 bits, cut when stored.
    #[default]
    Codesys,
    /// Cut at each operator.
    Iec,
}

/// How the numbers of direct addresses count (DESIGN §8).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Addressing {
    /// In units of the address' own width: `%IW3` is bytes 6 and 7.
    Word,
    /// In bytes: `%IW3` is bytes 3 and 4.
    Byte,
}

/// A variable joined to a channel of the bus.
#[derive(Debug, Clone, PartialEq)]
pub struct Wire {
    /// Path of the variable.
    pub variable: Located<String>,
    /// `sim/estop`.
    pub channel: Located<String>,
    /// What an output goes to when the program stops with a fault; a BOOL is 0 or 1.
    pub safe: f64,
}

/// A whole manifest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Manifest {
    /// Name of the project, if given.
    pub name: Option<String>,
    /// Folders or files with sources; `src` if not given.
    pub sources: Vec<Located<String>>,
    /// Integer arithmetic.
    pub arithmetic: Arithmetic,
    /// How the numbers of direct addresses count, if given; else as the form of the sources wants it.
    pub addressing: Option<Addressing>,
    /// Lossy implicit conversions are errors.
    pub strict: bool,
    /// Bytes of the heap of `__NEW`; 0 if not given.
    pub heap: u32,
    /// What conditional pragmas find defined, with its values.
    pub defines: Vec<(String, String)>,
    /// The task that owns the bus, if named.
    pub bus_task: Option<Located<String>>,
    /// How the resource thread runs under the real clock.
    pub realtime: crate::realtime::Settings,
    /// Limits of tasks.
    pub tasks: Vec<TaskSettings>,
    /// Axes in the order of the manifest.
    pub axes: Vec<Axis>,
    /// Wiring in the order of the manifest.
    pub wires: Vec<Wire>,
    /// The simulated bus.
    pub sim: Sim,
    /// Who plays the operator.
    pub simulation: Option<Simulation>,
    /// The live line.
    pub live: Vec<Item>,
    /// The table at the end.
    pub report: Vec<Item>,
    /// How often retained variables are written, if given.
    pub retain_interval: Option<takt_abi::Time>,
    /// What a plot draws.
    pub plot: Option<Plot>,
}

/// Reads a manifest. `name` is what messages call the file.
pub fn read(name: &str, text: &str) -> Result<Manifest, ManifestErrors> {
    let mut sink = Sink::new(name, text);
    let (root, errors) = toml::de::DeTable::parse_recoverable(text);
    for error in errors {
        sink.push(
            error.span().unwrap_or(0..0),
            error.message().to_string(),
            "a TOML document is a list of `key = value` under `[headings]`",
        );
    }
    let mut manifest = Manifest::default();
    if sink.is_empty() {
        sections(&mut Table::root(root.get_ref(), &mut sink), &mut manifest);
    }
    sink.finish(manifest)
}

fn sections(root: &mut Table<'_, '_>, manifest: &mut Manifest) {
    root.section("project", |table| project(table, manifest));
    root.section("defines", |table| defines(table, &mut manifest.defines));
    root.section("bus", |table| {
        table.choice("kind", &[("sim", ())]);
        manifest.bus_task = table.string("task");
    });
    root.section("realtime", |table| manifest.realtime = realtime::read_realtime(table));
    root.named_sections("task", |name, table| manifest.tasks.push(realtime::read_task(name, table)));
    root.named_sections("axis", |name, table| {
        if let Some(axis) = axis::read(name, table) {
            manifest.axes.push(axis);
        }
    });
    root.section("io", |table| wires(table, &mut manifest.wires));
    root.section("sim", |table| manifest.sim = simulation::read_sim(table));
    root.section("simulation", |table| manifest.simulation = Some(simulation::read_simulation(table)));
    root.section("live", |table| manifest.live = view::read_items(table, "items"));
    root.section("report", |table| manifest.report = view::read_items(table, "lines"));
    root.section("plot", |table| manifest.plot = Some(view::read_plot(table)));
    root.section("retain", |table| manifest.retain_interval = retain(table));
    root.finish();
}

fn project(table: &mut Table<'_, '_>, manifest: &mut Manifest) {
    manifest.name = table.string("name").map(|name| name.value);
    manifest.sources = table.strings("sources").unwrap_or_default();
    manifest.arithmetic = table.choice("arithmetic", &[("codesys", Arithmetic::Codesys), ("iec", Arithmetic::Iec)]).unwrap_or_default();
    manifest.addressing = table.choice("addressing", &[("word", Addressing::Word), ("byte", Addressing::Byte)]);
    manifest.strict = table.boolean("strict").unwrap_or(false);
    manifest.heap = table.number("heap", 16.0..=1073741824.0).map_or(0, |bytes| bytes as u32);
}

/// How often retained variables are written.
fn retain(table: &mut Table<'_, '_>) -> Option<takt_abi::Time> {
    let place = table.span();
    let interval = table.duration("interval")?;
    let (least, most) = (takt_abi::Time::from_millis(1), takt_abi::Time::from_millis(3_600_000));
    if !(least..=most).contains(&interval) {
        table.error(place, "`interval` in [retain] must be from 1ms to 1h", "the default is \"100ms\": what a power cut can lose");
        return None;
    }
    Some(interval)
}

fn defines(table: &mut Table<'_, '_>, defines: &mut Vec<(String, String)>) {
    for name in table.free_keys() {
        let is_name = name.value.chars().all(|c| c.is_alphanumeric() || c == '_') && !name.value.is_empty();
        if !is_name {
            table.error(name.span, format!("`{}` in [defines] must be a name", name.value), "write for example `SIMULATION = \"\"`");
        }
        defines.extend(table.free_string(&name.value).map(|value| (name.value, value.value)));
    }
}

fn wires(table: &mut Table<'_, '_>, wires: &mut Vec<Wire>) {
    for variable in table.free_keys() {
        if table.is_table(&variable.value) {
            table.free_section(&variable.value, |inner| {
                let Some(channel) = inner.required_string("channel") else { return };
                let safe = inner.bit_or_number("safe").unwrap_or(0.0);
                wires.push(Wire { variable: variable.clone(), channel, safe });
            });
        } else if let Some(channel) = table.free_string(&variable.value) {
            wires.push(Wire { variable, channel, safe: 0.0 });
        }
    }
    wires.sort_by_key(|wire| wire.variable.span.start);
}

#[cfg(test)]
mod tests;
