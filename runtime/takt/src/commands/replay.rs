//! `takt replay`: runs a recording again.

use super::run::{places, refuse, usage};
use super::{EngineKind, Exit, Format, ReplayArgs, check};
use crate::clock;
use crate::console;
use crate::language::{self, Word};
use crate::machine::{Machine, Setup};
use crate::project;
use crate::recording::header::state_hash;
use crate::recording::player::{PlayError, Player};
use crate::trace::{self, Trace};
use crate::values;
use serde_json::{Value, json};
use std::path::PathBuf;
use takt_engine::Clock;
use takt_ir::Place;

pub(super) fn execute(args: &ReplayArgs) -> Exit {
    match try_replay(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

/// How a player's machine is set up.
pub(super) fn setup(engine: EngineKind, until: Option<String>) -> Setup {
    Setup { executor: engine.into(), clock: Clock::Virtual, until, native_stack: Some(crate::machine::NATIVE_STACK), ..Setup::default() }
}

/// Says why a recording cannot be played.
pub(super) fn refused(error: &PlayError) -> Exit {
    match error {
        PlayError::Build(error) => refuse(error),
        PlayError::Strayed { .. } | PlayError::Differs { .. } => {
            usage(&error.to_string());
            Exit::Findings
        }
        _ => usage(&error.to_string()),
    }
}

/// What is collected on the way.
struct Seen {
    trace: Option<(Trace, Vec<Place>, PathBuf)>,
    every: Option<u64>,
    hashes: Vec<(u64, u64)>,
    json: bool,
    cycle: u64,
}

impl Seen {
    fn open(args: &ReplayArgs, machine: &Machine) -> Result<Self, Exit> {
        let trace = match &args.trace {
            Some(path) => {
                let places = places(machine, &args.record, "--record")?.into_iter().map(|(_, place)| place).collect();
                let trace =
                    trace::create(path, &args.record).map_err(|error| usage(&format!("{} cannot be written: {error}", path.display())))?;
                Some((trace, places, path.clone()))
            }
            None => None,
        };
        Ok(Self { trace, every: args.hash, hashes: Vec::new(), json: args.json, cycle: machine.cycles() })
    }

    /// After a step.
    fn look(&mut self, machine: &mut Machine) -> Result<(), Exit> {
        let cycle = machine.cycles();
        if cycle == self.cycle {
            return Ok(());
        }
        self.cycle = cycle;
        if let Some((trace, places, path)) = &mut self.trace {
            let types = &machine.program().types;
            let values: Vec<_> = places.iter().map(|place| takt_ir::format_value(types, place.ty, machine.bytes(*place))).collect();
            trace.row(machine.now(), values).map_err(|error| usage(&format!("{} cannot be written: {error}", path.display())))?;
        }
        if self.every.is_some_and(|every| cycle.is_multiple_of(every)) {
            let hash = state_hash(machine.engine());
            if self.json {
                self.hashes.push((cycle, hash));
            } else {
                console::result(format_args!("{cycle} {hash:016x}"));
            }
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Exit> {
        let Some((trace, _, path)) = self.trace.take() else { return Ok(()) };
        trace.finish().map_err(|error| usage(&format!("{} cannot be written: {error}", path.display())))?;
        console::tell(format_args!("{}: {}", Word::TraceWritten.text(language::of_environment()), path.display()));
        Ok(())
    }
}

fn try_replay(args: &ReplayArgs) -> Result<Exit, Exit> {
    if args.hash == Some(0) {
        return Err(usage("--hash: every how many scans? It must be 1 or more"));
    }
    let paths = if args.paths.is_empty() { vec![PathBuf::from(".")] } else { args.paths.clone() };
    let project = project::load_all(&paths).map_err(|error| check::refuse(&error, Format::Text))?;
    let setup = setup(args.engine, args.until.clone());
    let mut player = Player::open(&args.file, &project, setup).map_err(|error| refused(&error))?;
    let printed = places(player.machine(), &args.print, "--print")?;
    let mut seen = Seen::open(args, player.machine())?;
    let (first, started) = (player.machine().cycles(), clock::nanoseconds());
    let mut whole = false;
    loop {
        if args.to.is_some_and(|to| player.machine().cycles() >= to) {
            break;
        }
        match player.step() {
            Ok(true) => seen.look(player.machine())?,
            Ok(false) => {
                whole = true;
                break;
            }
            Err(error) => return Err(refused(&error)),
        }
        match player.machine().until_holds() {
            Ok(false) => {}
            Ok(true) => break,
            Err(fault) => return Err(usage(&format!("--until: {fault}"))),
        }
    }
    let wall = (clock::nanoseconds() - started) as f64 * 1e-9;
    seen.finish()?;
    let complete = whole && player.check_end().map_err(|error| refused(&error))?;
    let played = player.machine().cycles() - first;
    let factor = player.machine().elapsed().seconds() / wall.max(1e-9);
    if let Some(back) = args.back {
        let to = player.machine().cycles().saturating_sub(back);
        player.back_to(to).map_err(|error| refused(&error))?;
    }
    let machine = player.machine();
    if args.json {
        console::result(to_json(machine, &printed, &seen, complete));
    } else {
        for (name, place) in &printed {
            console::result(format_args!("{name} = {}", takt_ir::format_value(&machine.program().types, place.ty, machine.bytes(*place))));
        }
        tell(machine, played, factor, whole && !complete);
    }
    Ok(Exit::Good)
}

fn to_json(machine: &mut Machine, printed: &[(String, Place)], seen: &Seen, complete: bool) -> Value {
    let types = &machine.program().types;
    let values: serde_json::Map<_, _> =
        printed.iter().map(|(name, place)| (name.clone(), values::to_json(types, place.ty, machine.bytes(*place)))).collect();
    let hashes: Vec<_> = seen.hashes.iter().map(|(cycle, hash)| json!({ "cycle": cycle, "hash": format!("{hash:016x}") })).collect();
    json!({
        "schema": 1,
        "cycles": machine.cycles(),
        "time_ns": machine.elapsed().0,
        "fault": machine.fault().map(crate::machine::fault_json),
        "values": values,
        "hashes": hashes,
        "complete": complete,
    })
}

fn tell(machine: &mut Machine, played: u64, factor: f64, cut: bool) {
    let language = language::of_environment();
    let seconds = machine.elapsed().seconds();
    console::tell(format_args!(
        "{}: {played} {}, {seconds:.3} s ({factor:.1} {})",
        Word::Replayed.text(language),
        Word::Scans.text(language),
        Word::RealTimeFactor.text(language)
    ));
    if cut {
        console::tell(Word::RecordingCut.text(language));
    }
    if let Some(record) = machine.fault().filter(|record| record.fault != takt_abi::Fault::Stopped) {
        console::tell(format_args!("\x1b[1;31m{}\x1b[0m: {record}", Word::Fault.text(language)));
    }
}
