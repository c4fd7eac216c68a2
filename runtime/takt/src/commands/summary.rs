//! What is said at the end of a run: a short table for people, one object for tools.

use super::run::Over;
use crate::console;
use crate::language::{self, Language, Word};
use crate::machine::{End, Machine};
use crate::project::Project;
use crate::realtime::Disturbances;
use crate::{statistics, values};
use serde_json::{Value, json};
use std::path::Path;
use takt_engine::{FaultRecord, Frame};
use takt_ir::Place;

/// What is known of the resource thread at the end of a run under the real clock.
pub(super) struct Thread {
    /// What the system did to it, from the first scan on.
    pub(super) disturbances: Disturbances,
    /// Samples that found their queue full.
    pub(super) lost: u64,
}

impl Thread {
    fn to_json(&self) -> Value {
        let Disturbances { minor_faults, major_faults, waits, preempted, allocations } = self.disturbances;
        json!({ "allocations": allocations, "minor_faults": minor_faults, "major_faults": major_faults, "waits": waits, "preempted": preempted, "samples_lost": self.lost })
    }
}

/// The file of `--stats`.
pub(super) struct StatisticsFile<'p> {
    path: &'p Path,
    csv: bool,
}

/// The file of `--stats`, if its name says in which form.
pub(super) fn statistics_file(path: &Path) -> Result<StatisticsFile<'_>, String> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("json") => Ok(StatisticsFile { path, csv: false }),
        Some("csv") => Ok(StatisticsFile { path, csv: true }),
        _ => Err(format!("--stats: the file must end in .json or .csv, found {}", path.display())),
    }
}

impl StatisticsFile<'_> {
    /// Writes the statistics of the tasks.
    pub(super) fn write(&self, machine: &mut Machine, thread: Option<&Thread>) -> Result<(), String> {
        let program = machine.program().clone();
        let text = if self.csv {
            statistics::to_csv(&program, machine.engine())
        } else {
            let tasks = statistics::to_json(&program, machine.engine());
            let object = json!({ "schema": 1, "tasks": tasks, "thread": thread.map(Thread::to_json) });
            format!("{object:#}\n")
        };
        std::fs::write(self.path, text).map_err(|error| format!("{} cannot be written: {error}", self.path.display()))?;
        console::tell(format_args!("{}: {}", Word::StatisticsWritten.text(language::of_environment()), self.path.display()));
        Ok(())
    }
}

/// The tasks, one line each.
pub(super) fn tell_tasks(machine: &mut Machine) {
    let language = language::of_environment();
    console::tell(format_args!("\x1b[1m{}\x1b[0m", Word::Tasks.text(language)));
    statistics::lines(machine, language).iter().for_each(console::tell);
}

/// The object of `--json` (DESIGN §9).
pub(super) fn to_json(machine: &mut Machine, printed: &[(String, Place)], thread: Option<&Thread>) -> Value {
    let program = machine.program().clone();
    let tasks = statistics::to_json(&program, machine.engine());
    let times = &machine.statistics().scan_ns;
    let types = &machine.program().types;
    let values: serde_json::Map<String, Value> =
        printed.iter().map(|(name, place)| (name.clone(), values::to_json(types, place.ty, machine.bytes(*place)))).collect();
    let mut object = json!({
        "schema": 1,
        "cycles": machine.cycles(),
        "time_ns": machine.elapsed().0,
        "scan_ns": { "mean": times.mean().round() as u64, "p50": times.percentile(0.5), "p99": times.percentile(0.99), "max": times.max() },
        "fault": machine.fault().filter(|record| record.fault != takt_abi::Fault::Stopped).map(fault),
        "values": values,
        "tasks": tasks,
        "thread": thread.map(Thread::to_json),
    });
    if machine.forces() > 0 {
        object["forces"] = machine.forces().into();
    }
    object
}

fn fault(record: &FaultRecord) -> Value {
    let frame = |frame: &Frame| json!({ "file": frame.file, "line": frame.line, "column": frame.column, "body": frame.body });
    json!({
        "code": record.fault.name(), "message": record.fault.to_string(), "file": record.place.file, "line": record.place.line,
        "task": record.task, "stack": std::iter::once(&record.place).chain(&record.stack).map(frame).collect::<Vec<_>>(),
    })
}

/// The table for people, on standard error, with the seconds of the wall clock that the run took; without them only what went wrong.
pub(super) fn tell(project: &Project, machine: &Machine, over: &Over, wall: Option<f64>) {
    let language = language::of_environment();
    if let Some(why) = why(over, language) {
        console::tell(why);
    }
    if let (Over::End(End::Fault), Some(record)) = (over, machine.fault()) {
        console::tell(format_args!("\x1b[1;31m{}\x1b[0m: {record}", Word::Fault.text(language)));
    }
    for record in machine.task_faults() {
        console::tell(format_args!("\x1b[1;31m{}\x1b[0m: {record}", Word::TaskStopped.text(language)));
    }
    let Some(wall) = wall else { return };
    let rows = rows(machine, over, wall, language);
    let wide = rows.iter().map(|(label, _)| cells(label)).max().unwrap_or(0);
    console::tell(format_args!("\x1b[1m{}\x1b[0m", project.name));
    for (label, value) in rows {
        console::tell(format_args!("  {label}{}  {value}", " ".repeat(wide - cells(&label))));
    }
}

/// How a run ended, for the journal.
pub(super) fn ended(over: &Over) -> String {
    match over {
        Over::End(End::Fault) => "with a fault".into(),
        Over::End(End::Until) => "its condition came true".into(),
        Over::End(End::Done) => "the demonstration is over".into(),
        Over::End(End::TimedOut { waiting_for }) => format!("the demonstration timed out, waiting for {waiting_for}"),
        Over::End(End::Condition { text, fault }) => format!("{text}: {fault}"),
        Over::Cycles | Over::Duration => "it has run as long as it was to".into(),
        Over::Stopped => "on request".into(),
    }
}

fn why(over: &Over, language: Language) -> Option<String> {
    match over {
        Over::Stopped => Some(Word::Stopped.text(language).into()),
        Over::End(End::TimedOut { waiting_for }) => {
            Some(format!("{}; {} `{waiting_for}`", Word::TimedOut.text(language), Word::WaitingFor.text(language)))
        }
        Over::End(End::Condition { text, fault }) => Some(format!("{}: `{text}`: {fault}", Word::Error.text(language))),
        _ => None,
    }
}

fn rows(machine: &Machine, over: &Over, wall: f64, language: Language) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    let mut row = |word: Word, value: String| rows.push((word.text(language).to_string(), value));
    let statistics = machine.statistics();
    let times = &statistics.scan_ns;
    row(Word::Cycles, machine.cycles().to_string());
    if machine.forces() > 0 {
        row(Word::ForcedVariables, machine.forces().to_string());
    }
    let factor = machine.elapsed().seconds() / wall.max(1e-9);
    row(Word::MachineTime, format!("{:.3} s ({factor:.1} {})", machine.elapsed().seconds(), Word::RealTimeFactor.text(language)));
    if times.count() > 0 {
        let us = |ns: u64| ns as f64 * 1e-3;
        row(
            Word::ScanTime,
            format!("p50 {:.1} µs, p99 {:.1} µs, max {:.1} µs", us(times.percentile(0.5)), us(times.percentile(0.99)), us(times.max())),
        );
    }
    if statistics.overruns > 0 {
        row(Word::Overruns, statistics.overruns.to_string());
    }
    let fault = if matches!(over, Over::End(End::Fault)) { machine.fault().map(|record| record.fault.to_string()) } else { None };
    row(Word::Fault, fault.unwrap_or_else(|| Word::NoFault.text(language).into()));
    let types = &machine.program().types;
    for shown in &machine.view().report {
        let value = values::for_people(types, shown.place, machine.bytes(shown.place), shown.item.digits, shown.item.scale);
        let unit = if shown.item.unit.is_empty() { String::new() } else { format!(" {}", shown.item.unit) };
        let label = if shown.item.label.is_empty() { &shown.item.value.value } else { &shown.item.label };
        rows.push((label.clone(), format!("{value}{unit}")));
    }
    rows
}

/// Cells of a terminal that a text takes: most of what is not Latin is two wide.
fn cells(text: &str) -> usize {
    text.chars().map(|c| if (c as u32) < 0x1100 { 1 } else { 2 }).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Setup;
    use crate::sources::Sources;
    use takt_syntax::Source;

    fn run(text: &str, scans: usize) -> Machine {
        let source = Source { name: "main.st".into(), text: text.into() };
        let sources = Sources { list: vec![source], ..Sources::default() };
        let project = Project { root: std::env::temp_dir(), sources, ..Project::default() };
        let mut machine = Machine::new(&project, Setup::default()).unwrap_or_else(|error| panic!("{error}"));
        (0..scans).for_each(|_| {
            machine.step();
        });
        machine
    }

    #[test]
    fn json_has_the_shape_of_the_contract() {
        let mut machine = run("PROGRAM p VAR x : INT; END_VAR x := x + 2; END_PROGRAM", 3);
        let place = machine.place("p.x").unwrap();
        let json = to_json(&mut machine, &[("p.x".into(), place)], None);
        let scan_ns = json!({ "mean": 0, "p50": 0, "p99": 0, "max": 0 });
        let none = json!({ "last": 0, "mean": 0, "min": 0, "max": 0, "p50": 0, "p99": 0 });
        let name = &machine.program().tasks[0].name;
        let task = json!({
            "name": name, "state": "running", "fault": null, "kind": "cyclic", "interval_ns": 10_000_000, "priority": json["tasks"][0]["priority"], "cycles": 3,
            "overruns": 0, "preempted": 0, "fuel_max": 0, "scan_ns": none, "jitter_ns": { "p50": 0, "p99": 0, "max": 0 },
        });
        let expected = json!({
            "schema": 1, "cycles": 3, "time_ns": 30_000_000, "scan_ns": scan_ns, "fault": null, "values": { "p.x": 6 },
            "tasks": [task], "thread": null,
        });
        assert_eq!(json, expected);
    }

    #[test]
    fn a_fault_is_an_object_with_its_place() {
        let mut machine = run("PROGRAM p\nVAR a, b : INT; END_VAR\na := a / b;\nEND_PROGRAM", 1);
        let fault = &to_json(&mut machine, &[], None)["fault"];
        let expected = json!({ "code": "division-by-zero", "message": "integer division by zero", "file": "main.st", "line": 3, "task": fault["task"], "stack": fault["stack"] });
        assert_eq!(fault, &expected);
        assert!(fault["task"].is_string() && fault["stack"].is_array());
    }
}
