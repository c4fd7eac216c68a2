//! Statistics of tasks: as JSON and CSV for tools, as a table for people.

use crate::language::{Language, Word};
use crate::machine::Machine;
use serde_json::{Value, json};
use takt_engine::{Engine, FaultRecord, TaskStatistics};
use takt_ir::{Program, Task, Trigger};

/// What a task is doing: `running`; `fault` where a fault of its own stopped it or the application; `stopped` where another task did, or somebody.
fn state(fault: Option<&FaultRecord>, own: Option<&FaultRecord>, task: &Task) -> &'static str {
    match fault {
        None if own.is_some() => "fault",
        None => "running",
        Some(record) if record.fault != takt_abi::Fault::Stopped && record.task == task.name => "fault",
        Some(_) => "stopped",
    }
}

fn trigger(task: &Task) -> (&'static str, Option<i64>) {
    match task.trigger {
        Trigger::Cyclic(interval) => ("cyclic", Some(interval)),
        Trigger::Event(..) => ("event", None),
        Trigger::Freewheeling => ("freewheeling", None),
    }
}

/// All tasks, in the order of the program. Times are nanoseconds.
pub fn to_json(program: &Program, engine: &Engine) -> Value {
    let tasks = program.tasks.iter().enumerate();
    tasks.map(|(i, task)| task_to_json(task, engine.fault(), engine.task_fault(i), engine.statistics(i))).collect()
}

/// One task, with the fault that stopped the application and the one that stopped the task alone.
pub fn task_to_json(task: &Task, fault: Option<&FaultRecord>, own: Option<&FaultRecord>, statistics: &TaskStatistics) -> Value {
    let TaskStatistics { cycles, overruns, preempted, fuel_max, scan_ns, jitter_ns } = statistics;
    let (kind, interval) = trigger(task);
    json!({
        "name": task.name, "state": state(fault, own, task), "fault": own.map(ToString::to_string), "kind": kind, "interval_ns": interval, "priority": task.priority,
        "cycles": cycles, "overruns": overruns, "preempted": preempted, "fuel_max": fuel_max,
        "scan_ns": {
            "last": scan_ns.last(), "mean": scan_ns.mean().round() as u64, "min": scan_ns.min(), "max": scan_ns.max(),
            "p50": scan_ns.percentile(0.5), "p99": scan_ns.percentile(0.99),
        },
        "jitter_ns": { "p50": jitter_ns.percentile(0.5), "p99": jitter_ns.percentile(0.99), "max": jitter_ns.max() },
    })
}

/// The same as a table with a header line.
pub fn to_csv(program: &Program, engine: &Engine) -> String {
    let mut text = String::from(
        "task,state,kind,interval_ns,priority,cycles,overruns,preempted,scan_last_ns,scan_mean_ns,scan_min_ns,scan_max_ns,jitter_p50_ns,jitter_p99_ns,jitter_max_ns\n",
    );
    for (i, task) in program.tasks.iter().enumerate() {
        let of = engine.statistics(i);
        let (kind, interval) = trigger(task);
        let name = if task.name.contains([',', '"']) { format!("\"{}\"", task.name.replace('"', "\"\"")) } else { task.name.clone() };
        let (scan, jitter) = (&of.scan_ns, &of.jitter_ns);
        let numbers = [
            of.cycles,
            of.overruns,
            of.preempted,
            scan.last(),
            scan.mean().round() as u64,
            scan.min(),
            scan.max(),
            jitter.percentile(0.5),
            jitter.percentile(0.99),
            jitter.max(),
        ];
        let interval = interval.map_or_else(String::new, |ns| ns.to_string());
        text.push_str(&format!("{name},{},{kind},{interval},{}", state(engine.fault(), engine.task_fault(i), task), task.priority));
        numbers.iter().for_each(|number| text.push_str(&format!(",{number}")));
        text.push('\n');
    }
    text
}

/// Lines for people: one per task.
pub fn lines(machine: &mut Machine, language: Language) -> Vec<String> {
    let program = machine.program().clone();
    let engine = machine.engine();
    let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
    let wide = program.tasks.iter().map(|task| task.name.chars().count()).max().unwrap_or(0);
    let line = |(i, task): (usize, &Task)| {
        let of = engine.statistics(i);
        let (scan, jitter) = (&of.scan_ns, &of.jitter_ns);
        let [scans, execution, late, missed, interrupted] =
            [Word::Scans, Word::Execution, Word::Jitter, Word::MissedReleases, Word::Interrupted].map(|word| word.text(language));
        format!(
            "  {:wide$}  {} {scans}; {execution} {} {} {} {}; {late} {} {} {}; {missed} {}; {interrupted} {}",
            task.name,
            of.cycles,
            us(scan.last()),
            us(scan.mean().round() as u64),
            us(scan.min()),
            us(scan.max()),
            us(jitter.percentile(0.5)),
            us(jitter.percentile(0.99)),
            us(jitter.max()),
            of.overruns,
            of.preempted,
        )
    };
    program.tasks.iter().enumerate().map(line).collect()
}
