//! `takt run`: runs a program until it is over.

use super::{EngineKind, Exit, Format, RunArgs, Speed, check, live::Live, summary};
use crate::clock::{self, Pace};
use crate::console;
use crate::language::{self, Word};
use crate::machine::{BuildError, End, Machine, Setup};
use crate::plot::Recording;
use crate::project::{self, Project};
use crate::sources::Sources;
use crate::trace::{self, Trace};
use crate::{messages, platform, state};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use takt_abi::Time;
use takt_engine::{Clock, ExecutorKind};
use takt_ir::Place;

/// Why a run is over.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Over {
    /// By itself.
    End(End),
    /// `--cycles`.
    Cycles,
    /// `--for`.
    Duration,
    /// Somebody stopped it.
    Stopped,
}

pub(super) fn execute(args: &RunArgs) -> Exit {
    match try_run(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn try_run(args: &RunArgs) -> Result<Exit, Exit> {
    let project = project::load_all(&args.paths).map_err(|error| check::refuse(&error, Format::Text))?;
    tell_encodings(&project.sources);
    let speed = speed(args, &project);
    let mut machine = build(args, &project, speed)?;
    let real = speed == Speed::Factor(1.0);
    let _state = state::of_run(&project, args.state.as_deref(), real).map_err(|error| usage(&error.to_string()))?;
    for (variable, value) in &args.set {
        machine.set(variable, value).map_err(|error| usage(&format!("--set {variable}: {error}")))?;
    }
    let printed = places(&machine, &args.print, "--print")?;
    let mut outputs = Outputs::open(args, &machine)?;
    let started = clock::nanoseconds();
    let over = turn(args, &mut machine, speed, &mut outputs);
    let wall = (clock::nanoseconds() - started) as f64 * 1e-9;
    outputs.finish(args)?;
    if args.json {
        console::result(summary::to_json(&machine, &printed));
    } else {
        printed.iter().for_each(|(name, place)| console::result(format_args!("{name} = {}", literal(&machine, *place))));
    }
    summary::tell(&project, &machine, &over, (!args.json).then_some(wall));
    let bad = matches!(over, Over::End(End::Fault | End::TimedOut { .. } | End::Condition { .. }));
    Ok(if bad { Exit::Findings } else { Exit::Good })
}

/// The speed asked for, or the one that fits what is to be run.
fn speed(args: &RunArgs, project: &Project) -> Speed {
    let ends = args.cycles.is_some() || args.duration.is_some() || args.until.is_some();
    let demonstration = project.manifest.simulation.as_ref().is_some_and(|s| s.done.is_some());
    if args.speed.is_none() && demonstration && !ends && !args.json {
        console::tell(Word::Demonstration.text(language::of_environment()));
    }
    args.speed.unwrap_or(if ends || demonstration { Speed::Max } else { Speed::Factor(1.0) })
}

fn build(args: &RunArgs, project: &Project, speed: Speed) -> Result<Machine, Exit> {
    let executor = match args.engine {
        EngineKind::Jit => ExecutorKind::Jit,
        EngineKind::Interp => ExecutorKind::Interpreter,
    };
    let clock = if speed == Speed::Factor(1.0) { Clock::Real(clock::machine_time) } else { Clock::Virtual };
    let setup = Setup {
        executor,
        clock,
        stopwatch: Some(clock::nanoseconds),
        until: args.until.clone(),
        native_stack: Some(crate::machine::NATIVE_STACK),
    };
    let machine = Machine::new(project, setup).map_err(|error| refuse(&error))?;
    check::tell(machine.compiled());
    Ok(machine)
}

fn refuse(error: &BuildError) -> Exit {
    match error {
        BuildError::Program(compiled) => {
            check::tell(compiled);
            let (errors, warnings) = compiled.counts();
            check::summarise(errors, warnings);
            if compiled.errors_in_sources() { Exit::Findings } else { Exit::Usage }
        }
        BuildError::Manifest(errors) => {
            console::tell(format_args!("{}\n", messages::draw_manifest(errors)));
            Exit::Usage
        }
        BuildError::Load(takt_engine::LoadError::Initial(_)) => {
            usage(&error.to_string());
            Exit::Findings
        }
        _ => usage(&error.to_string()),
    }
}

fn usage(message: &str) -> Exit {
    console::tell(format_args!("{}: {message}", Word::Error.text(language::of_environment())));
    Exit::Usage
}

fn places(machine: &Machine, names: &[String], option: &str) -> Result<Vec<(String, Place)>, Exit> {
    let place = |name: &String| match machine.place(name) {
        Ok(place) => Ok((name.clone(), place)),
        Err(error) => Err(usage(&format!("{option}: {error}"))),
    };
    names.iter().map(place).collect()
}

fn literal(machine: &Machine, place: Place) -> String {
    takt_ir::format_value(&machine.program().types, place.ty, machine.bytes(place))
}

/// What is written while it runs.
struct Outputs {
    trace: Option<(Trace, Vec<Place>)>,
    plot: Option<(Recording, File)>,
    live: Live,
    failed: Option<std::io::Error>,
}

impl Outputs {
    fn open(args: &RunArgs, machine: &Machine) -> Result<Self, Exit> {
        let trace = match &args.trace {
            Some(path) => {
                let places = places(machine, &args.record, "--record")?;
                let file = trace::create(path, &args.record).map_err(|error| cannot_write(path, &error))?;
                Some((file, places.into_iter().map(|(_, place)| place).collect()))
            }
            None => None,
        };
        let plot = match (&args.plot, &machine.view().plot) {
            (None, _) => None,
            (Some(path), Some(places)) => Some((Recording::new(places), File::create(path).map_err(|error| cannot_write(path, &error))?)),
            (Some(_), None) => return Err(usage("--plot: the manifest has no [plot]; docs/manifest.md shows one")),
        };
        Ok(Self { trace, plot, live: Live::new(!args.json), failed: None })
    }

    /// After a scan of the fastest task.
    fn scanned(&mut self, machine: &mut Machine) {
        if let Some((trace, places)) = &mut self.trace {
            let values: Vec<String> = places.iter().map(|place| literal(machine, *place)).collect();
            if let Err(error) = trace.row(machine.now(), values) {
                self.failed.get_or_insert(error);
            }
        }
        if let Some((plot, _)) = &mut self.plot
            && machine.is_plotted()
        {
            plot.add(machine);
        }
        self.live.show(machine);
    }

    fn finish(&mut self, args: &RunArgs) -> Result<(), Exit> {
        self.live.clear();
        let language = language::of_environment();
        if let (Some((trace, _)), Some(path)) = (self.trace.take(), &args.trace) {
            let failed = self.failed.take().map_or_else(|| trace.finish(), Err);
            failed.map_err(|error| cannot_write(path, &error))?;
            console::tell(format_args!("{}: {}", Word::TraceWritten.text(language), path.display()));
        }
        if let (Some((plot, mut file)), Some(path)) = (self.plot.take(), &args.plot) {
            file.write_all(plot.draw().as_bytes()).map_err(|error| cannot_write(path, &error))?;
            console::tell(format_args!("{}: {}", Word::PlotWritten.text(language), path.display()));
        }
        Ok(())
    }
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Exit {
    usage(&format!("{} cannot be written: {error}", path.display()))
}

/// Steps until something ends the run.
fn turn(args: &RunArgs, machine: &mut Machine, speed: Speed, outputs: &mut Outputs) -> Over {
    platform::listen_for_stop();
    let pace = Pace::start(match speed {
        Speed::Max => None,
        Speed::Factor(factor) => Some(factor),
    });
    loop {
        if args.cycles.is_some_and(|cycles| machine.cycles() >= cycles) {
            return Over::Cycles;
        }
        if args.duration.is_some_and(|duration| machine.elapsed() >= duration) {
            return Over::Duration;
        }
        if platform::stop_requested() {
            rest(machine, &pace);
            return Over::Stopped;
        }
        let now = pace.wait(machine.engine().next_release());
        if machine.step_at(now) {
            outputs.scanned(machine);
        }
        if let Some(end) = machine.ended() {
            if !pace.is_max() {
                rest(machine, &pace);
            }
            return Over::End(end);
        }
    }
}

/// Longest time that axes are given to come to rest.
const REST: Time = Time::from_millis(5000);

/// Stops the program and lets the axes come to rest.
fn rest(machine: &mut Machine, pace: &Pace) {
    let engine = machine.engine();
    if engine.fault().is_none() {
        engine.halt();
    }
    let end = Time(engine.now().0.saturating_add(REST.0));
    loop {
        let now = pace.wait(engine.next_release());
        engine.step(now);
        if engine.at_rest() || now >= end {
            return;
        }
    }
}

/// Says which sources were not UTF-8.
pub(super) fn tell_encodings(sources: &Sources) {
    let language = language::of_environment();
    for (file, encoding) in &sources.converted {
        console::tell(format_args!("{file} {} {}", Word::ReadAs.text(language), encoding.name()));
    }
}
