//! `takt run`: runs a program until it is over.

use super::keep::{self, Keep};
use super::outputs::{Outputs, Writer, warning};
use super::said::Teller;
use super::{Exit, Format, RunArgs, Speed, check, summary};
use crate::attached::{Attached, Places};
use crate::clock::{self, Pace};
use crate::console;
use crate::journal::{Entry, Event};
use crate::language::{self, Word};
use crate::machine::{BuildError, End, Machine, Setup};
use crate::project::{self, Project};
use crate::realtime::{Held, system};
use crate::recording::writer::Summary;
use crate::sources::Sources;
use crate::{messages, platform, state};
use std::path::PathBuf;
use takt_abi::Time;
use takt_engine::Clock;
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
    let real = speed == Speed::Factor(1.0);
    let keep = Keep::open(args, &project, real)?;
    let mut machine = build(args, &project, speed, &keep)?;
    let places_of_it = Places::of(keep.state().map(state::State::path), args.control.as_deref());
    let mut attached = Attached::open(&places_of_it, &project, &mut machine, real).map_err(|error| usage(&error))?;
    for (variable, value) in &args.set {
        let old = machine.literal(variable).ok();
        machine.set(variable, value).map_err(|error| usage(&format!("--set {variable}: {error}")))?;
        let entry = Entry::new(Event::Write).by("", "takt run --set", "");
        attached.post(entry.variable(variable).values(old, machine.literal(variable).ok()));
    }
    let cores = keep.state().map(|state| state.path().join("cores"));
    start_recording(args, &project, &mut machine, cores)?;
    let printed = places(&machine, &args.print, "--print")?;
    let stats = args.stats.as_deref().map(|path| summary::statistics_file(path).map_err(|error| usage(&error))).transpose()?;
    let mut outputs = Outputs::open(args, &machine)?;
    outputs.show_forces(attached.force_count());
    let keeping = keep.start(&project, &mut machine)?;
    keep.loaded(&machine).into_iter().for_each(|entry| attached.post(entry));
    let mut writer = Writer::start(outputs, &mut machine, real)?;
    let mut teller = Teller::start(real)?;
    platform::listen_for_stop();
    let settings = project.manifest.realtime;
    let held = real.then(|| Held::hold(settings, machine.engine().native_stack()));
    held.iter().for_each(tell_missing);
    let before = system::disturbances();
    let started = clock::nanoseconds();
    let pace = Pace::start(match speed {
        Speed::Max => None,
        Speed::Factor(factor) => Some(factor),
    });
    let pace = if real { pace.spinning(settings.spin) } else { pace };
    let over = turn(args, &mut machine, &pace, &mut attached, |machine| {
        teller.scanned(machine);
        writer.scanned(machine);
    });
    let disturbances = held.as_ref().map(|_| system::disturbances().since(before));
    drop(held);
    attached.post(Entry::new(Event::Stop).at(machine.now()).message(summary::ended(&over)));
    let wall = (clock::nanoseconds() - started) as f64 * 1e-9;
    keep::finish(keeping, &mut machine);
    let lost = writer.finish(&mut machine, args)?;
    teller.finish(&mut machine);
    let recorded = machine.finish_recording();
    let thread = disturbances.map(|disturbances| summary::Thread { disturbances, lost });
    if let Some(format) = stats {
        format.write(&mut machine, thread.as_ref()).map_err(|error| usage(&error))?;
    }
    if args.json {
        console::result(summary::to_json(&mut machine, &printed, thread.as_ref()));
    } else {
        printed.iter().for_each(|(name, place)| console::result(format_args!("{name} = {}", literal(&machine, *place))));
    }
    summary::tell(&project, &machine, &over, (!args.json).then_some(wall));
    if real && !args.json {
        summary::tell_tasks(&mut machine);
    }
    tell_recording(args, recorded.as_ref());
    let bad =
        matches!(over, Over::End(End::Fault | End::TimedOut { .. } | End::Condition { .. })) || machine.task_faults().next().is_some();
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

fn build(args: &RunArgs, project: &Project, speed: Speed, keep: &Keep) -> Result<Machine, Exit> {
    let executor = args.engine.into();
    let clock = if speed == Speed::Factor(1.0) { Clock::Real(clock::machine_time) } else { Clock::Virtual };
    let setup = Setup {
        executor,
        clock,
        alarm: matches!(clock, Clock::Real(_)),
        stopwatch: Some(clock::nanoseconds),
        retained: keep.source(),
        until: args.until.clone(),
        preempt: Vec::new(),
        native_stack: Some(crate::machine::NATIVE_STACK),
    };
    let machine = Machine::new(project, setup).map_err(|error| refuse(&error))?;
    check::tell(machine.compiled());
    Ok(machine)
}

pub(super) fn refuse(error: &BuildError) -> Exit {
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

/// Records what was asked for, and in a state folder the last minutes for core files.
fn start_recording(args: &RunArgs, project: &Project, machine: &mut Machine, cores: Option<PathBuf>) -> Result<(), Exit> {
    if args.record_inputs.is_none() && cores.is_none() {
        return Ok(());
    }
    let started = machine.record(project, args.record_inputs.clone(), cores);
    started.map_err(|error| match &args.record_inputs {
        Some(path) => usage(&format!("{} cannot be written: {error}", path.display())),
        None => usage(&format!("the recorder cannot start: {error}")),
    })
}

/// Says what became of recording and core files.
fn tell_recording(args: &RunArgs, recorded: Option<&Summary>) {
    let Some(summary) = recorded else { return };
    let language = language::of_environment();
    if let Some(path) = &args.record_inputs {
        match &summary.incomplete {
            None => console::tell(format_args!(
                "{}: {} ({} KiB)",
                Word::RecordingWritten.text(language),
                path.display(),
                summary.bytes.div_ceil(1024)
            )),
            Some(why) => {
                console::tell(format_args!("{}: {} {}: {why}", warning(), path.display(), Word::RecordingIncomplete.text(language)))
            }
        }
    }
    for path in &summary.cores {
        console::tell(format_args!("{}: {}", Word::CoreWritten.text(language), path.display()));
    }
    summary.failed.iter().for_each(|why| console::tell(format_args!("{}: {}: {why}", warning(), Word::NoCore.text(language))));
}

/// Says in one warning what the resource thread could not get, and how to grant it.
fn tell_missing(held: &Held) {
    if held.missing.is_empty() {
        return;
    }
    let language = language::of_environment();
    console::tell(format_args!("{}: {}:", warning(), Word::NotRealTime.text(language)));
    for missing in &held.missing {
        console::tell(format_args!("  {}: {}", missing.what.text(language), missing.error));
    }
    console::tell(format_args!("  {}", Word::HowToGrant.text(language)));
}

pub(super) fn usage(message: &str) -> Exit {
    console::tell(format_args!("{}: {message}", Word::Error.text(language::of_environment())));
    Exit::Usage
}

pub(super) fn places(machine: &Machine, names: &[String], option: &str) -> Result<Vec<(String, Place)>, Exit> {
    let place = |name: &String| match machine.place(name) {
        Ok(place) => Ok((name.clone(), place)),
        Err(error) => Err(usage(&format!("{option}: {error}"))),
    };
    names.iter().map(place).collect()
}

fn literal(machine: &Machine, place: Place) -> String {
    takt_ir::format_value(&machine.program().types, place.ty, machine.bytes(place))
}

/// Steps until something ends the run; `seen` looks at the machine after each scan of the fastest task. Nothing here allocates.
fn turn(args: &RunArgs, machine: &mut Machine, pace: &Pace, attached: &mut Attached, mut seen: impl FnMut(&mut Machine)) -> Over {
    let endless = args.cycles.is_none() && args.duration.is_none() && args.until.is_none() && !machine.is_demonstration();
    let stays = endless && attached.is_reachable();
    loop {
        if args.cycles.is_some_and(|cycles| machine.cycles() >= cycles) {
            return Over::Cycles;
        }
        if args.duration.is_some_and(|duration| machine.elapsed() >= duration) {
            return Over::Duration;
        }
        let release = machine.engine().next_release();
        let now = if attached.is_held() { release } else { pace.wait(release) };
        if platform::stop_requested() || attached.end_requested() {
            let fault = machine.fault().is_some_and(|record| record.fault != takt_abi::Fault::Stopped);
            rest(machine, pace);
            return if fault { Over::End(End::Fault) } else { Over::Stopped };
        }
        let scanned = machine.step_at(now);
        if scanned {
            seen(machine);
        }
        attached.stepped(machine, scanned);
        match machine.ended() {
            Some(End::Fault) if stays => tell_fault(machine, attached),
            Some(end) => {
                if !pace.is_max() {
                    rest(machine, pace);
                }
                return Over::End(end);
            }
            None => _ = attached.newly_faulted(false),
        }
        if attached.is_held() {
            attached.stand_still(machine, platform::stop_requested);
        }
    }
}

/// Says once that the program has faulted, and that the machine waits for somebody.
fn tell_fault(machine: &Machine, attached: &mut Attached) {
    if attached.newly_faulted(true)
        && let Some(record) = machine.fault()
    {
        let language = language::of_environment();
        if record.fault == takt_abi::Fault::Stopped {
            console::tell(Word::Stopped.text(language));
        } else {
            console::tell(format_args!("\x1b[1;31m{}\x1b[0m: {record}", Word::Fault.text(language)));
        }
        console::tell(Word::WaitsForReset.text(language));
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
        let now = pace.wait_fully(engine.next_release());
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
