//! `[sim]` and `[simulation]`: the simulated bus, and who plays the operator.

use super::reader::Table;
use super::{Located, Switches};
use takt_abi::Time;

/// A digital or analogue input of the simulated bus with its value at power-up.
#[derive(Debug, Clone, PartialEq)]
pub struct SimInput {
    /// Name, without `sim/`.
    pub name: Located<String>,
    /// Value; a BOOL is 0 or 1.
    pub value: f64,
}

/// The mechanics of a simulated axis, technical units.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisPlant {
    /// Name of the axis.
    pub name: Located<String>,
    /// Where it stands at power-up.
    pub start: f64,
    /// Hard stops, if given.
    pub travel: Option<(f64, f64)>,
    /// Switches.
    pub switches: Switches,
    /// Of the position loop, Hz.
    pub bandwidth: f64,
    /// 1 = no overshoot.
    pub damping: f64,
}

/// A jetting valve.
#[derive(Debug, Clone, PartialEq)]
pub struct Valve {
    /// From the command to open.
    pub open_delay: Time,
    /// From the command to shut.
    pub close_delay: Time,
    /// With air, bar.
    pub pressure: f64,
    /// Digital input that says that there is air.
    pub air: Option<Located<String>>,
}

/// The simulated bus.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sim {
    /// Digital inputs, in order.
    pub inputs: Vec<SimInput>,
    /// Analogue inputs, in order.
    pub analog: Vec<SimInput>,
    /// Digital outputs.
    pub outputs: Vec<Located<String>>,
    /// Analogue outputs.
    pub analog_outputs: Vec<Located<String>>,
    /// Mechanics; an axis without an entry is an ideal one.
    pub axes: Vec<AxisPlant>,
    /// The valve, if there is one.
    pub valve: Option<Valve>,
}

/// A value that a step writes.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Path of the variable.
    pub variable: Located<String>,
    /// ST literal.
    pub value: Located<String>,
}

/// One act of the operator.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Step {
    /// Waits for this condition.
    pub when: Option<Located<String>>,
    /// Then waits so long.
    pub after: Time,
    /// Then writes these variables.
    pub set: Vec<Setting>,
    /// And after this time writes back what they were.
    pub pulse: Option<Time>,
    /// And sets these inputs.
    pub inputs: Vec<SimInput>,
}

/// The operator's script.
pub type Operator = Vec<Step>;

/// A demonstration.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Simulation {
    /// Condition: it is over.
    pub done: Option<Located<String>>,
    /// Machine time until it must be.
    pub timeout: Option<Time>,
    /// Who plays the operator.
    pub operator: Operator,
}

const POSITION: std::ops::RangeInclusive<f64> = -1e7..=1e7;

pub(super) fn read_sim(table: &mut Table<'_, '_>) -> Sim {
    let mut axes = Vec::new();
    let inputs = table.section("inputs", |inner| read_bits(inner)).unwrap_or_default();
    let analog = table.section("analog", |inner| read_values(inner)).unwrap_or_default();
    let outputs = table.strings("outputs").unwrap_or_default();
    let analog_outputs = table.strings("analog-outputs").unwrap_or_default();
    table.named_sections("axis", |name, inner| axes.push(read_plant(name, inner)));
    let valve = table.section("valve", read_valve);
    Sim { inputs, analog, outputs, analog_outputs, axes, valve }
}

fn read_bits(table: &mut Table<'_, '_>) -> Vec<SimInput> {
    let read = |name: Located<String>, table: &mut Table<'_, '_>| {
        let value = f64::from(u8::from(table.boolean(&name.value)?));
        Some(SimInput { name, value })
    };
    table.free_keys().into_iter().filter_map(|name| read(name, table)).collect()
}

fn read_values(table: &mut Table<'_, '_>) -> Vec<SimInput> {
    let read = |name: Located<String>, table: &mut Table<'_, '_>| {
        let value = table.bit_or_number(&name.value)?;
        Some(SimInput { name, value })
    };
    table.free_keys().into_iter().filter_map(|name| read(name, table)).collect()
}

fn read_plant(name: Located<String>, table: &mut Table<'_, '_>) -> AxisPlant {
    let start = table.number("start", POSITION).unwrap_or(0.0);
    let travel = table.section("travel", |inner| {
        let travel = inner.required_number("negative", POSITION).zip(inner.required_number("positive", POSITION));
        if let Some((negative, positive)) = travel.filter(|(negative, positive)| negative >= positive) {
            let span = inner.span();
            inner.error(span, format!("`negative` must be below `positive`, found {negative} and {positive}"), "they are the hard stops");
        }
        travel
    });
    let switches = table.section("switches", |inner| Switches {
        negative: inner.number("negative", POSITION),
        positive: inner.number("positive", POSITION),
        home: inner.number("home", POSITION),
    });
    let bandwidth = table.number("bandwidth", 0.1..=1000.0).unwrap_or(40.0);
    let damping = table.number("damping", 0.1..=10.0).unwrap_or(0.9);
    AxisPlant { name, start, travel: travel.flatten(), switches: switches.unwrap_or_default(), bandwidth, damping }
}

fn read_valve(table: &mut Table<'_, '_>) -> Valve {
    Valve {
        open_delay: table.duration("open-delay").unwrap_or(Time::from_millis(1)),
        close_delay: table.duration("close-delay").unwrap_or(Time::from_millis(1)),
        pressure: table.number("pressure", 0.0..=100.0).unwrap_or(4.0),
        air: table.string("air"),
    }
}

pub(super) fn read_simulation(table: &mut Table<'_, '_>) -> Simulation {
    let done = table.string("done");
    let timeout = table.duration("timeout");
    let operator = table.tables("operator", read_step);
    Simulation { done, timeout, operator }
}

fn read_step(table: &mut Table<'_, '_>) -> Option<Step> {
    let when = table.string("when");
    let after = table.duration("after").unwrap_or_default();
    let set = table.section("set", read_settings).unwrap_or_default();
    let pulse = table.duration("pulse");
    let inputs = table.section("input", read_values).unwrap_or_default();
    if pulse.is_some() && set.is_empty() {
        let span = table.span();
        table.error(span, "a `pulse` without `set`", "`pulse` writes back the variables that `set` wrote");
    }
    Some(Step { when, after, set, pulse, inputs })
}

fn read_settings(table: &mut Table<'_, '_>) -> Vec<Setting> {
    let read = |variable: Located<String>, table: &mut Table<'_, '_>| {
        let value = table.literal(&variable.value)?;
        Some(Setting { variable, value })
    };
    table.free_keys().into_iter().filter_map(|variable| read(variable, table)).collect()
}
