//! `takt param`: the parameters of a machine: of one that runs over its control socket, of one that does not in what it keeps.

mod stored;

use super::{Exit, Where, ctl, log};
use crate::console;
use crate::control::{self, connect::Client};
use crate::journal::clean;
use crate::language::{self, Word};
use crate::parameters::{File, SCHEMA};
use crate::spelling::nearest;
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stored::Stored;

/// What `takt param` is told.
#[derive(Debug, Clone, Args)]
pub(super) struct ParamArgs {
    #[command(flatten)]
    machine: Where,
    /// One JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Who changes something, for the journal. Default: $TAKT_AS, else the user.
    #[arg(long = "as", value_name = "NAME", global = true)]
    name: Option<String>,
    /// Why, for the journal; needed to change something. Default: $TAKT_REASON.
    #[arg(long, value_name = "TEXT", global = true)]
    reason: Option<String>,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Clone, Subcommand)]
enum Verb {
    /// Shows parameters; all of them without a name.
    Get {
        #[arg(value_name = "VAR")]
        names: Vec<String>,
    },
    /// Sets parameters, all or none.
    Set {
        #[arg(required = true, value_name = "VAR=VALUE", value_parser = super::assignment)]
        values: Vec<(String, String)>,
    },
    /// Writes all parameters to a file.
    Export {
        #[arg(value_name = "FILE.toml|.json")]
        file: PathBuf,
        /// Writes over a file that is there.
        #[arg(long)]
        force: bool,
    },
    /// Sets the parameters of a file, all or none.
    Import {
        #[arg(value_name = "FILE.toml|.json")]
        file: PathBuf,
    },
    /// Shows where a file differs from the machine; exit code 1 if it does.
    Diff {
        #[arg(value_name = "FILE.toml|.json")]
        file: PathBuf,
    },
}

/// Where the parameters are.
enum Place {
    Running(Box<Client>),
    Stored(Box<Stored>),
}

/// Who changes something, and why.
struct Who {
    name: Option<String>,
    reason: Option<String>,
}

fn refuse(message: &dyn std::fmt::Display) -> Exit {
    console::tell(format_args!("{}: {message}", Word::Error.text(language::of_environment())));
    Exit::Usage
}

impl Place {
    /// The machine that runs, else what it keeps.
    fn open(machine: &Where) -> Result<Self, Exit> {
        match Client::connect(&log::folder(machine)?.join(control::NAME)) {
            Ok(client) => Ok(Self::Running(Box::new(client))),
            Err(control::connect::ClientError::NoMachine(..)) => Ok(Self::Stored(Box::new(Stored::open(machine)?))),
            Err(error) => Err(refuse(&error)),
        }
    }

    fn project(&self) -> String {
        match self {
            Self::Running(client) => client.about["project"].as_str().unwrap_or_default().into(),
            Self::Stored(stored) => stored.project(),
        }
    }

    /// Literals by paths.
    fn values(&mut self) -> Result<BTreeMap<String, String>, Exit> {
        match self {
            Self::Running(client) => {
                let mut result = client.ask("parameters", json!({})).map_err(|error| refuse(&error))?;
                let Value::Array(list) = result["parameters"].take() else { return Ok(BTreeMap::new()) };
                let text = |value: &Value| value.as_str().unwrap_or_default().to_string();
                Ok(list.iter().map(|one| (text(&one["variable"]), text(&one["literal"]))).collect())
            }
            Self::Stored(stored) => stored.values().map_err(|error| refuse(&error)),
        }
    }

    fn set(&mut self, values: &[(String, String)], who: &Who) -> Result<(), Exit> {
        if values.is_empty() {
            return Ok(());
        }
        match self {
            Self::Running(client) => {
                ctl::arm(client, who.name.as_ref(), who.reason.as_ref())?;
                let list: Vec<Value> = values.iter().map(|(path, literal)| json!({ "variable": path, "literal": literal })).collect();
                client.ask("write", json!({ "variables": list })).map_err(|error| refuse(&error)).map(|_| ())
            }
            Self::Stored(stored) => {
                let (name, reason) = ctl::who(who.name.as_ref(), who.reason.as_ref())?;
                stored.set(values, &name, &reason).map_err(|error| refuse(&error))
            }
        }
    }
}

pub(super) fn execute(args: &ParamArgs) -> Exit {
    match try_execute(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

/// The names of parameters as the program spells them; all mistakes at once.
fn resolve(values: &BTreeMap<String, String>, wanted: impl Iterator<Item = (String, String)>) -> Result<Vec<(String, String)>, Exit> {
    let spelled: BTreeMap<String, &String> = values.keys().map(|path| (key(path), path)).collect();
    let (mut good, mut mistakes) = (Vec::new(), Vec::new());
    for (name, value) in wanted {
        let wanted = key(&name);
        // A name may stand without its list where that names one only.
        let bare = || {
            let mut ends = spelled.iter().filter(|(path, _)| path.strip_suffix(&wanted).is_some_and(|list| list.ends_with('.')));
            ends.next().filter(|_| ends.next().is_none()).map(|(_, path)| path)
        };
        match spelled.get(&wanted).or_else(bare) {
            Some(path) => good.push(((*path).clone(), value)),
            None => {
                let near =
                    nearest(&name, values.keys().map(String::as_str)).map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
                mistakes.push(format!("there is no parameter `{}`{near}", clean(&name)));
            }
        }
    }
    if mistakes.is_empty() { Ok(good) } else { Err(refuse(&mistakes.join("\n  "))) }
}

/// What is not so already.
fn changes(values: &BTreeMap<String, String>, wanted: Vec<(String, String)>) -> Vec<(String, String)> {
    wanted.into_iter().filter(|(path, value)| values.get(path) != Some(value)).collect()
}

/// A path without what does not matter in it.
fn key(path: &str) -> String {
    path.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_uppercase).collect()
}

fn try_execute(args: &ParamArgs) -> Result<Exit, Exit> {
    let mut place = Place::open(&args.machine)?;
    let values = place.values()?;
    let who = Who { name: args.name.clone(), reason: args.reason.clone() };
    match &args.verb {
        Verb::Get { names } => {
            let all = values.iter().map(|(path, value)| (path.clone(), value.clone()));
            let wanted = names.iter().map(|name| (name.clone(), String::new()));
            let shown = if names.is_empty() { all.collect() } else { resolve(&values, wanted)? };
            show(shown.iter().map(|(path, _)| (path, &values[path])), args.json);
        }
        Verb::Set { values: wanted } => {
            let list = changes(&values, resolve(&values, wanted.iter().cloned())?);
            place.set(&list, &who)?;
            tell_changes(&values, &place.values()?, args.json);
        }
        Verb::Export { file, force } => export(&place.project(), &values, file, *force)?,
        Verb::Import { file } => {
            let content = File::read(file).map_err(|error| refuse(&error))?;
            let list = changes(&values, resolve(&values, content.parameters.into_iter())?);
            place.set(&list, &who)?;
            tell_changes(&values, &place.values()?, args.json);
        }
        Verb::Diff { file } => return diff(&values, file, args.json),
    }
    Ok(Exit::Good)
}

fn show<'v>(values: impl Iterator<Item = (&'v String, &'v String)>, json: bool) {
    if json {
        console::result(json!(values.collect::<BTreeMap<_, _>>()));
    } else {
        values.for_each(|(path, value)| console::result(format_args!("{path} = {}", clean(value))));
    }
}

fn tell_changes(before: &BTreeMap<String, String>, after: &BTreeMap<String, String>, json: bool) {
    let changed = after.iter().filter(|(path, value)| before.get(*path) != Some(value));
    if json {
        console::result(json!({ "changed": changed.collect::<BTreeMap<_, _>>() }));
    } else {
        let old = |path: &String| before.get(path).map_or_else(String::new, |old| clean(old));
        changed.for_each(|(path, new)| console::result(format_args!("{path}: {} → {}", old(path), clean(new))));
    }
}

fn export(project: &str, values: &BTreeMap<String, String>, path: &Path, force: bool) -> Result<(), Exit> {
    let text = File { schema: SCHEMA, project: project.into(), parameters: values.clone() }.text(path).map_err(|error| refuse(&error))?;
    if path.exists() && !force {
        return Err(refuse(&format_args!("{} {}", path.display(), Word::ExistsForce.text(language::of_environment()))));
    }
    std::fs::write(path, text).map_err(|error| refuse(&format_args!("{}: {error}", path.display())))
}

fn diff(values: &BTreeMap<String, String>, path: &Path, json: bool) -> Result<Exit, Exit> {
    let file = File::read(path).map_err(|error| refuse(&error))?;
    let of_file: BTreeMap<String, (&String, &String)> = file.parameters.iter().map(|(path, value)| (key(path), (path, value))).collect();
    let machine: BTreeMap<String, (&String, &String)> = values.iter().map(|(path, value)| (key(path), (path, value))).collect();
    let mut lines = Vec::new();
    for key in of_file.keys().chain(machine.keys()).collect::<std::collections::BTreeSet<_>>() {
        let (left, right) = (machine.get(key), of_file.get(key));
        let name = left.or(right).map_or("", |(path, _)| path.as_str());
        let (left, right) = (left.map(|(_, value)| value.as_str()), right.map(|(_, value)| value.as_str()));
        if left != right {
            lines.push((name, left, right));
        }
    }
    if json {
        let line =
            |(path, machine, file): &(&str, Option<&str>, Option<&str>)| json!({ "variable": path, "machine": machine, "file": file });
        console::result(json!({ "differences": lines.iter().map(line).collect::<Vec<_>>() }));
    } else {
        let language = language::of_environment();
        let text = |value: &Option<&str>| value.map_or_else(|| Word::Missing.text(language).to_string(), clean);
        for (path, machine, file) in &lines {
            console::result(format_args!("{}: {} | {}", clean(path), text(machine), text(file)));
        }
    }
    Ok(if lines.is_empty() { Exit::Good } else { Exit::Findings })
}
