//! Answers of a machine for people.

use super::Verb;
use crate::console;
use crate::journal::clean;
use crate::language::{self, Word};
use serde_json::Value;

/// Text of a value; nothing in it moves the cursor.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => clean(text),
        Value::Bool(truth) => truth.to_string().to_uppercase(),
        Value::Null => "-".into(),
        other => other.to_string(),
    }
}

fn seconds(value: &Value) -> String {
    format!("{:.3} s", value.as_f64().unwrap_or(0.0) * 1e-9)
}

fn micro(value: &Value) -> String {
    format!("{:.1}", value.as_f64().unwrap_or(0.0) * 1e-3)
}

/// The answer to a request.
pub(super) fn result(verb: &Verb, about: &Value, result: &Value) {
    let language = language::of_environment();
    match verb {
        Verb::Status => status(about, result),
        Verb::Tasks => tasks(&result["tasks"]),
        Verb::Forces => {
            if !forces(&result["forces"]) {
                console::result(Word::NothingForced.text(language));
            }
        }
        Verb::Read { variables } => {
            variables.iter().for_each(|name| console::result(format_args!("{name} = {}", text(&result["values"][name]))));
        }
        Verb::Write(_) | Verb::Force(_) | Verb::Release { .. } => {
            console::result(format_args!(
                "{} {}, {} {}",
                Word::Done.text(language),
                result["done"],
                result["forces"],
                Word::Forced.text(language)
            ));
        }
        _ => console::result(Word::Done.text(language)),
    }
}

fn status(about: &Value, status: &Value) {
    let language = language::of_environment();
    let state = text(&status["state"]);
    let colour = match state.as_str() {
        "running" => "\x1b[32m",
        "faulted" => "\x1b[1;31m",
        _ => "\x1b[33m",
    };
    console::result(format_args!("\x1b[1m{}\x1b[0m  {colour}{state}\x1b[0m  {}", text(&about["project"]), seconds(&status["time_ns"])));
    let fault = &status["fault"];
    if !fault.is_null() {
        console::result(format_args!("  {}: {}", Word::Fault.text(language), text(&fault["message"])));
        for frame in fault["stack"].as_array().into_iter().flatten() {
            console::result(format_args!("    {}:{} {}", text(&frame["file"]), frame["line"], text(&frame["body"])));
        }
    }
    if !status["bus"]["fault"].is_null() {
        console::result(format_args!("  {} ({})", text(&status["bus"]["fault"]), status["bus"]["faults"]));
    }
    if status["journal"] == false {
        console::result(Word::JournalFails.text(language));
    }
    tasks(&status["tasks"]);
    forces(&status["forces"]);
}

/// A table; columns are as wide as what is in them.
fn table(rows: &[Vec<String>]) {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let wide = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(wide).collect();
    for row in rows {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, wide)| format!("{cell:<wide$}")).collect();
        console::result(format_args!("  {}", cells.join("  ").trim_end()));
    }
}

fn tasks(tasks: &Value) {
    let head = ["task", "state", "cycles", "last µs", "mean µs", "max µs", "jitter p99 µs", "overruns"].map(String::from).to_vec();
    let row = |task: &Value| {
        let (scan, jitter) = (&task["scan_ns"], &task["jitter_ns"]);
        vec![
            text(&task["name"]),
            text(&task["state"]),
            text(&task["cycles"]),
            micro(&scan["last"]),
            micro(&scan["mean"]),
            micro(&scan["max"]),
            micro(&jitter["p99"]),
            text(&task["overruns"]),
        ]
    };
    let tasks: Vec<&Value> = tasks.as_array().into_iter().flatten().collect();
    let rows: Vec<_> = std::iter::once(head).chain(tasks.iter().copied().map(row)).collect();
    table(&rows);
    for fault in tasks.iter().filter_map(|task| task["fault"].as_str()) {
        console::result(format_args!("\x1b[1;31m  {}\x1b[0m: {fault}", Word::TaskStopped.text(language::of_environment())));
    }
}

/// The forces; false if there are none.
fn forces(forces: &Value) -> bool {
    let Some(list) = forces.as_array().filter(|list| !list.is_empty()) else { return false };
    let language = language::of_environment();
    console::result(format_args!("\x1b[1;33m  {} {}\x1b[0m", list.len(), Word::Forced.text(language)));
    let row = |force: &Value| {
        let lease = force["lease_ms"].as_u64().map_or_else(String::new, |left| format!("lease {left} ms"));
        let value = format!("= {} (was {})", text(&force["value"]), text(&force["before"]));
        vec![text(&force["variable"]), value, text(&force["by"]), format!("“{}”", text(&force["reason"])), text(&force["since"]), lease]
    };
    table(&list.iter().map(row).collect::<Vec<_>>());
    true
}

/// A line of values that were subscribed to.
pub(super) fn values(line: &Value, variables: &[String]) -> String {
    let values: Vec<String> = variables.iter().map(|name| format!("{name} = {}", text(&line["values"][name]))).collect();
    format!("{:>10}  {}", seconds(&line["time_ns"]), values.join("  "))
}
