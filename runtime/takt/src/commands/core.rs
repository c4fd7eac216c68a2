//! `takt core`: what happened, from a core file.

use super::replay::refused;
use super::run::{places, usage};
use super::{CoreArgs, Exit};
use crate::console;
use crate::language::{self, Word};
use crate::machine::NATIVE_STACK;
use crate::recording::file::{Chunks, Kind};
use crate::recording::postmortem::{self, Call, Postmortem, Shown};
use crate::values;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Calls that are shown to people, of the innermost and of the outermost ones.
const SHOWN: usize = 16;
/// Characters of a value that are shown to people.
const WIDE: usize = 160;

pub(super) fn execute(args: &CoreArgs) -> Exit {
    let result = if args.file.is_dir() { list(&args.file) } else { show(args) };
    match result {
        Ok(exit) | Err(exit) => exit,
    }
}

/// The core files of a folder, the newest first.
fn list(folder: &Path) -> Result<Exit, Exit> {
    let entries = std::fs::read_dir(folder).map_err(|error| usage(&format!("{} cannot be read: {error}", folder.display())))?;
    let is_core = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "core");
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).filter(is_core).collect();
    files.sort();
    for path in files.iter().rev() {
        let fault = Chunks::open(path).and_then(|mut chunks| chunks.json(Kind::Fault));
        match fault {
            Ok(fault) => console::result(format_args!("{}  {}", path.display(), headline(&fault))),
            Err(error) => console::tell(error),
        }
    }
    Ok(Exit::Good)
}

fn headline(fault: &serde_json::Value) -> String {
    let text = |key: &str| fault.get(key).and_then(serde_json::Value::as_str).unwrap_or("?");
    let number = |key: &str| fault.get(key).and_then(serde_json::Value::as_i64).unwrap_or(0);
    format!(
        "{}: {}:{}, task {}, scan {}, {:.6} s",
        text("message"),
        text("file"),
        number("line"),
        text("task"),
        number("cycle"),
        number("time_ns") as f64 * 1e-9
    )
}

fn show(args: &CoreArgs) -> Result<Exit, Exit> {
    let mut core = postmortem::open(&args.file, Some(NATIVE_STACK)).map_err(|error| refused(&error))?;
    let printed = places(core.machine(), &args.print, "--print")?;
    if args.json {
        let machine = core.machine();
        let types = &machine.program().types;
        let values: serde_json::Map<_, _> =
            printed.iter().map(|(name, place)| (name.clone(), values::to_json(types, place.ty, machine.bytes(*place)))).collect();
        console::result(json!({
            "schema": 1,
            "fault": core.recorded,
            "reached": core.again.is_some(),
            "calls": core.calls.iter().map(call_json).collect::<Vec<_>>(),
            "inputs": core.inputs.iter().map(|(name, value)| json!({ "name": name, "value": value })).collect::<Vec<_>>(),
            "values": values,
        }));
        return Ok(Exit::Good);
    }
    for (name, place) in &printed {
        let machine = core.machine();
        console::result(format_args!("{name} = {}", takt_ir::format_value(&machine.program().types, place.ty, machine.bytes(*place))));
    }
    if printed.is_empty() {
        tell(&core);
    }
    Ok(Exit::Good)
}

fn shown_json(list: &[Shown]) -> Vec<serde_json::Value> {
    list.iter().map(|shown| json!({ "name": shown.name, "type": shown.ty, "value": shown.value })).collect()
}

fn call_json(call: &Call) -> serde_json::Value {
    let (file, line, column) = &call.place;
    json!({
        "body": call.body, "instance": call.instance, "file": file, "line": line, "column": column, "source": call.source,
        "locals": shown_json(&call.locals), "members": shown_json(&call.members),
    })
}

fn tell(core: &Postmortem) {
    let language = language::of_environment();
    console::result(headline(&core.recorded));
    if core.again.is_none() {
        console::result(Word::CoreTooShort.text(language));
    }
    let (first, last) = (SHOWN, core.calls.len().saturating_sub(SHOWN));
    for (number, call) in core.calls.iter().enumerate() {
        if number >= first && number < last {
            if number == first {
                console::result("\n…");
            }
            continue;
        }
        let (file, line, column) = &call.place;
        let instance = call.instance.as_ref().map_or_else(String::new, |path| format!(" ({path})"));
        console::result(format_args!("\n#{number} {}{instance}  {file}:{line}:{column}", call.body));
        console::result(format_args!("    {}", call.source.trim_start()));
        variables(Word::Locals.text(language), &call.locals);
        variables(Word::Members.text(language), &call.members);
    }
    if !core.inputs.is_empty() {
        console::result(format_args!("\n{}", Word::LastInputs.text(language)));
    }
    core.inputs.iter().for_each(|(name, value)| console::result(format_args!("  {name} = {value}")));
}

fn variables(title: &str, list: &[Shown]) {
    if list.is_empty() {
        return;
    }
    console::result(format_args!("  {title}"));
    for Shown { name, ty, value } in list {
        let short: String = value.chars().take(WIDE).collect();
        let more = if short.len() < value.len() { "…" } else { "" };
        console::result(format_args!("    {name} : {ty} = {short}{more}"));
    }
}
