//! The simulated bus of a project: drives with the mechanics of the manifest, terminals, a valve.

use crate::manifest::{Axis, AxisPlant, Manifest, ManifestError};
use crate::spelling::nearest;
use takt_abi::Time;
use takt_engine::{Channel, Encoder, Home, IoDriver};
use takt_io::sim::{self, DriveConfig, OpenError, SimConfig, SimControl, Switches, ValveConfig};

/// Share of the travel that the hard stops lie beyond the software limits, if the manifest does not say where.
const BEYOND: f64 = 0.05;

/// The bus while the machine runs: what a hand can do to it. Every drive has the index of its axis in the manifest.
#[derive(Debug)]
pub struct Bus {
    /// Breaks drives, sticks switches, looks at the mechanics.
    pub control: SimControl,
}

impl Bus {
    /// Sets a digital or analogue input by its name in [sim]; a number other than 0 is TRUE. False if there is none.
    pub fn set_input(&mut self, name: &str, value: f64) -> bool {
        self.control.set_input(name, value != 0.0).is_ok() || self.control.set_analog(name, value).is_ok()
    }
}

/// A bus that is open.
pub(super) struct Open {
    driver: Box<dyn IoDriver>,
    bus: Bus,
    /// Its channels.
    pub(super) channels: Channels,
}

impl Open {
    pub(super) fn split(self) -> (Box<dyn IoDriver>, Bus) {
        (self.driver, self.bus)
    }
}

/// Channels by the names of the manifest: `sim/estop`.
pub(super) struct Channels(Vec<(String, Channel)>);

impl Channels {
    pub(super) fn find(&self, name: &str) -> Option<Channel> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, channel)| *channel)
    }
    pub(super) fn names(&self) -> Vec<String> {
        self.0.iter().map(|(name, _)| name.clone()).collect()
    }
    /// Inputs, by their names in [sim].
    pub(super) fn input_names(&self) -> Vec<&str> {
        self.0.iter().filter(|(_, channel)| channel.is_input()).map(|(name, _)| name.trim_start_matches("sim/")).collect()
    }
    pub(super) fn is_input(&self, name: &str) -> bool {
        self.input_names().contains(&name)
    }
}

/// Opens the bus of a manifest with a bus cycle of `period`.
pub(super) fn open(manifest: &Manifest, period: Time) -> Result<Open, ManifestError> {
    let sim = &manifest.sim;
    for plant in &sim.axes {
        let names = || manifest.axes.iter().map(|axis| axis.name.value.as_str());
        if !names().any(|name| name.eq_ignore_ascii_case(&plant.name.value)) {
            let help = nearest(&plant.name.value, names()).map_or_else(String::new, |name| format!("did you mean [sim.axis.{name}]?"));
            return Err(ManifestError {
                span: plant.name.span.clone(),
                message: format!("[sim.axis.{0}] has no [axis.{0}]", plant.name.value),
                help,
            });
        }
    }
    let plant = |axis: &Axis| sim.axes.iter().find(|plant| plant.name.value.eq_ignore_ascii_case(&axis.name.value));
    let config = SimConfig {
        period,
        drives: manifest.axes.iter().map(|axis| drive(axis, plant(axis))).collect(),
        inputs: sim.inputs.iter().map(|input| (input.name.value.clone(), input.value != 0.0)).collect(),
        analog: sim.analog.iter().map(|input| (input.name.value.clone(), input.value)).collect(),
        outputs: sim.outputs.iter().map(|name| name.value.clone()).collect(),
        analog_outputs: sim.analog_outputs.iter().map(|name| name.value.clone()).collect(),
        valve: sim.valve.as_ref().map(|valve| ValveConfig {
            open_delay: valve.open_delay,
            close_delay: valve.close_delay,
            pressure: valve.pressure,
            air: valve.air.as_ref().map(|air| air.value.clone()),
        }),
    };
    let (driver, control) = sim::open(&config).map_err(|error| refused(manifest, &error))?;
    let channels = control.channels().into_iter().map(|(name, channel)| (format!("sim/{name}"), channel)).collect();
    Ok(Open { driver, bus: Bus { control }, channels: Channels(channels) })
}

/// A refusal of the simulation, shown at the axis or input that it is about.
fn refused(manifest: &Manifest, error: &OpenError) -> ManifestError {
    let of = match error {
        OpenError::Twice { name } | OpenError::NoInput { name } => name,
        OpenError::Range { of, .. } | OpenError::Method { of, .. } | OpenError::NoSwitch { of, .. } => of,
        OpenError::Period => "",
    };
    let sim = &manifest.sim;
    let inputs = sim.inputs.iter().chain(&sim.analog).map(|input| &input.name);
    let air = sim.valve.iter().filter_map(|valve| valve.air.as_ref());
    let mut places = manifest.axes.iter().map(|axis| &axis.name).chain(air).chain(inputs).chain(&sim.outputs).chain(&sim.analog_outputs);
    let span = places.find(|place| place.value == *of).map_or(0..0, |place| place.span.clone());
    ManifestError { span, message: format!("the simulated bus: {error}"), help: String::new() }
}

fn drive(axis: &Axis, plant: Option<&AxisPlant>) -> DriveConfig {
    let limits = axis.limits;
    let beyond = |(low, high): (f64, f64)| (low - BEYOND * (high - low), high + BEYOND * (high - low));
    let travel = if axis.modulo > 0.0 { None } else { limits.travel.map(beyond) };
    let switches = plant.map_or(Switches::default(), |plant| {
        let given = plant.switches;
        Switches { negative: given.negative, positive: given.positive, home: given.home }
    });
    let config = DriveConfig {
        increments_per_unit: axis.increments_per_unit,
        invert: axis.invert,
        start: plant.map_or(0.0, |plant| plant.start),
        encoder: if axis.absolute { Encoder::Absolute } else { Encoder::Incremental },
        velocity: limits.velocity * 1.1,
        acceleration: limits.acceleration,
        deceleration: limits.deceleration,
        lag: 0.0,
        travel: plant.and_then(|plant| plant.travel).or(travel),
        switches,
        home: Home { method: axis.home.method, fast: axis.home.fast, slow: axis.home.slow, offset: axis.home.offset },
        ..DriveConfig::new(&axis.name.value)
    };
    match plant {
        Some(plant) => DriveConfig { bandwidth: plant.bandwidth, damping: plant.damping, ..config },
        None => config,
    }
}
