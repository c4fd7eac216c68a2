//! Names of the manifest bound to the program: axes, wires, the operator's script, what is shown. Every name that does not exist is found at once.

use super::bus::Channels;
use super::operator::BoundStep;
use crate::manifest::{self, Item, Located, ManifestError, ManifestErrors};
use crate::project::Project;
use crate::spelling::nearest;
use takt_engine::{AxisConfig, AxisLimits, Command, Encoder, FeedForward, Signal, Wire};
use takt_ir::{Global, Place, Program, Type};

/// A value to be shown.
#[derive(Debug, Clone)]
pub struct Shown {
    /// What the manifest says of it.
    pub item: Item,
    /// The variable.
    pub place: Place,
}

/// Variables of a plot.
#[derive(Debug, Clone, Default)]
pub struct PlotPlaces {
    /// X, Y, Z, mm.
    pub tcp: Option<[Place; 3]>,
    /// mm/s.
    pub speed: Option<Place>,
    /// theta1, theta2, degrees.
    pub tool: Option<[Place; 2]>,
    /// Counts up with each dot.
    pub dots: Option<Place>,
    /// The valve's command.
    pub valve: Option<Place>,
    /// Hz.
    pub frequency_limit: Option<f64>,
}

/// What the manifest wants shown.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// The live line.
    pub live: Vec<Shown>,
    /// The table at the end.
    pub report: Vec<Shown>,
    /// The plot, if the manifest has one.
    pub plot: Option<PlotPlaces>,
}

/// Everything that is bound.
pub(super) struct Bound {
    pub(super) axes: Vec<AxisConfig>,
    pub(super) wires: Vec<Wire>,
    pub(super) steps: Vec<BoundStep>,
    pub(super) view: View,
}

/// Binds a manifest to a program and a bus.
pub(super) fn bind(project: &Project, program: &Program, channels: &Channels) -> Result<Bound, ManifestErrors> {
    let mut binder = Binder { program, channels, errors: Vec::new() };
    let manifest = &project.manifest;
    let axes = binder.axes(&manifest.axes, project.manifest_file.is_some());
    let wires = manifest.wires.iter().filter_map(|wire| binder.wire(wire)).collect();
    let steps = manifest.simulation.iter().flat_map(|s| &s.operator).map(|step| binder.step(step)).collect();
    let live = binder.items(&manifest.live);
    let report = binder.items(&manifest.report);
    let plot = manifest.plot.as_ref().map(|plot| binder.plot(plot));
    if !binder.errors.is_empty() {
        return Err(project.errors(binder.errors));
    }
    Ok(Bound { axes, wires, steps, view: View { live, report, plot } })
}

struct Binder<'a> {
    program: &'a Program,
    channels: &'a Channels,
    errors: Vec<ManifestError>,
}

impl Binder<'_> {
    fn error(&mut self, span: std::ops::Range<usize>, message: String, help: impl Into<String>) {
        self.errors.push(ManifestError { span, message, help: help.into() });
    }

    fn variable(&mut self, path: &Located<String>) -> Option<Place> {
        match takt_ir::resolve(self.program, &path.value) {
            Ok(place) => Some(place),
            Err(error) => {
                self.error(path.span.clone(), error.to_string(), "a variable is named as in `--print`");
                None
            }
        }
    }

    fn axes(&mut self, axes: &[manifest::Axis], all: bool) -> Vec<AxisConfig> {
        let globals: Vec<&Global> = self.program.globals.iter().filter(|global| is_axis(self.program, global)).collect();
        let mut configs: Vec<AxisConfig> = Vec::new();
        let mut taken: Vec<&str> = Vec::new();
        for axis in axes {
            let found: Vec<_> = globals.iter().filter(|global| names(global, &axis.name.value)).collect();
            match found[..] {
                [global] if taken.contains(&global.name.as_str()) => {
                    self.error(axis.name.span.clone(), format!("axis `{}` is bound twice", global.name), "an axis has one table");
                }
                [global] => {
                    taken.push(&global.name);
                    configs.push(config(axis, Place { offset: global.offset, ty: global.ty }, configs.len()));
                }
                [] => {
                    let near = nearest(&axis.name.value, globals.iter().map(|global| stem(global)));
                    let help =
                        near.map_or("declare it as AXIS_REF_SM3 in a global list".to_string(), |name| format!("did you mean `{name}`?"));
                    self.error(axis.name.span.clone(), format!("there is no global axis `{}`", axis.name.value), help);
                }
                _ => {
                    let all: Vec<_> = found.iter().map(|global| global.name.as_str()).collect();
                    self.error(
                        axis.name.span.clone(),
                        format!("axis `{}` is ambiguous: {}", axis.name.value, all.join(", ")),
                        "quote the whole name: [axis.\"GVL.X\"]",
                    );
                }
            }
        }
        if all && self.errors.is_empty() {
            for global in globals.iter().filter(|global| !taken.contains(&global.name.as_str())) {
                let message = format!("the global axis `{}` has no table", global.name);
                self.error(0..0, message, format!("add [axis.{}]; docs/manifest.md shows one", stem(global)));
            }
        }
        configs
    }

    fn wire(&mut self, wire: &manifest::Wire) -> Option<Wire> {
        let place = self.variable(&wire.variable);
        let channel = self.channels.find(&wire.channel.value);
        if channel.is_none() {
            let names = self.channels.names();
            let help = nearest(&wire.channel.value, names.iter().map(String::as_str))
                .map_or_else(|| format!("there are: {}", names.join(", ")), |n| format!("did you mean \"{n}\"?"));
            self.error(wire.channel.span.clone(), format!("the bus has no channel \"{}\"", wire.channel.value), help);
        }
        let (place, channel) = place.zip(channel)?;
        let digital = matches!(channel, takt_engine::Channel::BitIn(_) | takt_engine::Channel::BitOut(_));
        let safe = if digital { Signal::Bit(wire.safe != 0.0) } else { Signal::Analog(wire.safe) };
        Some(Wire { name: wire.variable.value.clone(), place, channel, safe: Some(safe) })
    }

    fn step(&mut self, step: &manifest::Step) -> BoundStep {
        let set: Vec<Command> = step.set.iter().filter_map(|setting| self.setting(setting)).collect();
        let mut inputs = Vec::new();
        for input in &step.inputs {
            let name = &input.name.value;
            if self.channels.is_input(name) {
                inputs.push((name.clone(), input.value));
            } else {
                let names = self.channels.input_names();
                let help = nearest(name, names.iter().copied())
                    .map_or_else(|| format!("there are: {}", names.join(", ")), |n| format!("did you mean `{n}`?"));
                self.error(input.name.span.clone(), format!("the simulated bus has no input `{name}`"), help);
            }
        }
        BoundStep { after: step.after, back: set.clone(), set, pulse: step.pulse, inputs }
    }

    fn setting(&mut self, setting: &manifest::Setting) -> Option<Command> {
        let place = self.variable(&setting.variable)?;
        if let Err(error) = takt_engine::writable(self.program, place) {
            self.error(setting.variable.span.clone(), format!("`{}`: {error}", setting.variable.value), "only variables can be set");
            return None;
        }
        match takt_ir::parse_value(&self.program.types, place.ty, &setting.value.value) {
            Ok(bytes) => Some(Command::Write { place, bytes: bytes.into() }),
            Err(error) => {
                self.error(setting.value.span.clone(), error.to_string(), "");
                None
            }
        }
    }

    fn items(&mut self, items: &[Item]) -> Vec<Shown> {
        items.iter().filter_map(|item| Some(Shown { place: self.variable(&item.value)?, item: item.clone() })).collect()
    }

    fn number(&mut self, path: &Located<String>) -> Option<Place> {
        let place = self.variable(path)?;
        let size = self.program.types.size(place.ty) as usize;
        if crate::values::to_number(&self.program.types, place.ty, &vec![0; size]).is_none() {
            self.error(
                path.span.clone(),
                format!("`{}` is `{}`, expected a number or BOOL", path.value, self.program.types.name(place.ty)),
                "",
            );
            return None;
        }
        Some(place)
    }

    fn numbers<const N: usize>(&mut self, paths: &[Located<String>; N]) -> Option<[Place; N]> {
        let places: Vec<Place> = paths.iter().filter_map(|path| self.number(path)).collect();
        places.try_into().ok()
    }

    fn plot(&mut self, plot: &manifest::Plot) -> PlotPlaces {
        PlotPlaces {
            tcp: plot.tcp.as_ref().and_then(|paths| self.numbers(paths)),
            speed: plot.speed.as_ref().and_then(|path| self.number(path)),
            tool: plot.tool.as_ref().and_then(|paths| self.numbers(paths)),
            dots: plot.dots.as_ref().and_then(|path| self.number(path)),
            valve: plot.valve.as_ref().and_then(|path| self.number(path)),
            frequency_limit: plot.frequency_limit,
        }
    }
}

fn is_axis(program: &Program, global: &Global) -> bool {
    matches!(program.types.get(global.ty), Type::Struct(structure) if structure.name.eq_ignore_ascii_case("AXIS_REF_SM3"))
}

fn stem(global: &Global) -> &str {
    global.name.rsplit('.').next().unwrap_or(&global.name)
}

fn names(global: &Global, name: &str) -> bool {
    global.name.eq_ignore_ascii_case(name) || stem(global).eq_ignore_ascii_case(name)
}

fn config(axis: &manifest::Axis, place: Place, drive: usize) -> AxisConfig {
    let limits = axis.limits;
    let (negative, positive) = limits.travel.unwrap_or((-1e7, 1e7));
    let (velocity, acceleration) = (limits.velocity, limits.acceleration);
    AxisConfig {
        increments_per_unit: axis.increments_per_unit,
        invert: axis.invert,
        modulo: axis.modulo,
        limits: AxisLimits { negative, positive, velocity, acceleration, deceleration: limits.deceleration, jerk: limits.jerk },
        lag: axis.lag.map(|lag| takt_engine::Lag { warn: lag.warn, trip: lag.trip }),
        encoder: if axis.absolute { Encoder::Absolute } else { Encoder::Incremental },
        home: takt_engine::Home { method: axis.home.method, fast: axis.home.fast, slow: axis.home.slow, offset: axis.home.offset },
        feed_forward: if axis.feed_forward { FeedForward::Velocity } else { FeedForward::None },
        ..AxisConfig::new(&axis.name.value, place, drive)
    }
}
