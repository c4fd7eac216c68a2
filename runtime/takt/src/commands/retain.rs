//! `takt retain show|export|import`: the retained values of a machine that is not running, as people and tools read them.

use super::outputs::warning;
use super::run::{refuse, usage};
use super::{Exit, Format, RetainArgs, RetainCommand, check};
use crate::console;
use crate::language::{self, Word};
use crate::machine::{Machine, Setup};
use crate::project::{self, Project};
use crate::retain::layout::{Description, leaves};
use crate::retain::migrate::listed;
use crate::retain::slot::{self, Store};
use crate::retain::writer::now;
use crate::retain::{Generation, Loaded, Source, pack};
use crate::state::{self, State};
use serde::{Deserialize, Serialize};
use std::path::Path;
use takt_abi::Elem;
use takt_engine::{ExecutorKind, Reset, Restore, RetainLayout};
use takt_ir::retain::Span;
use takt_ir::{Place, Program, Type, Types, format_value};

/// A file of values.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Exported {
    /// Version of the form, 1.
    schema: u32,
    /// Name of the project.
    project: String,
    /// When the values were stored.
    saved: String,
    /// Number of the generation.
    generation: u64,
    values: Vec<ExportedValue>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExportedValue {
    path: String,
    #[serde(default)]
    kind: String,
    #[serde(rename = "type")]
    ty: String,
    /// A literal of ST.
    value: String,
}

/// Largest file that an import reads.
const LARGEST: u64 = 1 << 28;
/// Mistakes that are told at the most.
const TOLD: usize = 20;

pub(super) fn execute(command: &RetainCommand) -> Exit {
    let result = match command {
        RetainCommand::Show(args) => show(args),
        RetainCommand::Export(args) => export(args),
        RetainCommand::Import(args) => import(args),
    };
    result.unwrap_or_else(|exit| exit)
}

fn load(args: &RetainArgs) -> Result<(Project, Loaded), Exit> {
    let project = project::load(&args.path).map_err(|error| check::refuse(&error, Format::Text))?;
    let folder = state::folder_of(&project, args.state.as_deref());
    let loaded = slot::load(&folder).map_err(|error| usage(&error.to_string()))?;
    if let Some((path, defect)) = &loaded.torn {
        let word = Word::RetainTorn.text(language::of_environment());
        console::tell(format_args!("{}: {word} ({}: {defect})", warning(), path.display()));
    }
    Ok((project, loaded))
}

fn stored(args: &RetainArgs) -> Result<Generation, Exit> {
    let (project, loaded) = load(args)?;
    loaded.newest.map(|(generation, _)| generation).ok_or_else(|| {
        let folder = state::folder_of(&project, args.state.as_deref());
        usage(&format!("{}: {}", folder.display(), Word::RetainNone.text(language::of_environment())))
    })
}

/// Seconds since 1970 as ST writes them (UTC).
fn moment(seconds: u64) -> String {
    let mut types = Types::default();
    let ty = types.intern(Type::Elem(Elem::Ldt));
    format_value(&types, ty, &seconds.saturating_mul(1_000_000_000).to_le_bytes())
}

fn exported(generation: &Generation) -> Exported {
    let types = &generation.decoded.types;
    let mut values = Vec::new();
    for (i, place) in generation.description.places.iter().enumerate() {
        let kind = place.kind().text();
        leaves(types, takt_ir::TypeId(place.ty), generation.value(i), &mut place.path.clone(), &mut |path, ty, bytes| {
            let size = types.size(ty) as usize;
            let value = format_value(types, ty, bytes.get(..size).unwrap_or_default());
            values.push(ExportedValue { path: path.into(), kind: kind.into(), ty: types.name(ty), value });
        });
    }
    let Generation { number, saved, description, .. } = generation;
    Exported { schema: 1, project: description.project.clone(), saved: moment(*saved), generation: *number, values }
}

/// All values of a generation in the form that an import reads.
pub(super) fn to_json(generation: &Generation) -> String {
    serde_json::to_string_pretty(&exported(generation)).unwrap_or_default() + "\n"
}

fn show(args: &RetainArgs) -> Result<Exit, Exit> {
    if let Some(file) = &args.file {
        return Err(usage(&format!("`takt retain show` takes no file, found {}; `takt retain export` writes one", file.display())));
    }
    let exported = exported(&stored(args)?);
    console::result(format_args!("// {}, {}, {}", exported.project, exported.saved, exported.generation));
    for value in exported.values {
        console::result(format_args!("{} : {} := {}; // {}", value.path, value.ty, value.value, value.kind));
    }
    Ok(Exit::Good)
}

fn export(args: &RetainArgs) -> Result<Exit, Exit> {
    let text = to_json(&stored(args)?);
    match &args.file {
        Some(file) => std::fs::write(file, text).map_err(|error| usage(&format!("{} cannot be written: {error}", file.display())))?,
        None => console::result(text.trim_end()),
    }
    Ok(Exit::Good)
}

fn read_values(file: &Path) -> Result<Exported, String> {
    let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let len = std::fs::metadata(file).map_err(|error| wrong(&error))?.len();
    if len > LARGEST {
        return Err(wrong(&format!("it has {len} bytes, at the most {LARGEST} are read")));
    }
    let text = std::fs::read_to_string(file).map_err(|error| wrong(&error))?;
    let values: Exported = serde_json::from_str(&text).map_err(|error| wrong(&error))?;
    match values.schema {
        1 => Ok(values),
        other => Err(wrong(&format!("its form has version {other}, this Takt reads version 1"))),
    }
}

fn import(args: &RetainArgs) -> Result<Exit, Exit> {
    let Some(file) = &args.file else {
        return Err(usage("`takt retain import PATH FILE` needs the file with the values; `takt retain export` writes one"));
    };
    let values = read_values(file).map_err(|error| usage(&error))?;
    let project = project::load(&args.path).map_err(|error| check::refuse(&error, Format::Text))?;
    let state = State::open(state::folder_of(&project, args.state.as_deref())).map_err(|error| usage(&error.to_string()))?;
    let (_, loaded) = load(args)?;
    let generation = loaded.newest.as_ref().map(|(generation, _)| generation.clone());
    let source = Source { generation, kind: Reset::Warm, lenient: true };
    let setup = Setup { executor: ExecutorKind::Interpreter, retained: Some(source), ..Setup::default() };
    let mut machine = Machine::new(&project, setup).map_err(|error| refuse(&error))?;
    let written = take_over(&mut machine, &values).map_err(|mistakes| {
        let more = mistakes.len().saturating_sub(TOLD);
        let mut text = format!("{}: nothing was imported:", file.display());
        mistakes.iter().take(TOLD).for_each(|mistake| text += &format!("\n  {mistake}"));
        text += &if more > 0 { format!("\n  … {more} more") } else { String::new() };
        usage(&text)
    })?;
    let program = machine.program().clone();
    let mut data = Vec::new();
    pack(&program, &RetainLayout::new(&program), &machine.engine().retained(), &mut data);
    let mut store = Store::new(state.path(), &Description::of(&project.name, &program), &loaded);
    store.write(&data, now()).map_err(|error| usage(&format!("{}: {error}", state.path().display())))?;
    let language = language::of_environment();
    console::tell(format_args!("{written} {}", Word::RetainImported.text(language)));
    let initial: Vec<String> = match machine.migration() {
        Some(migration) => migration.added.clone(),
        None => program.retained.iter().map(|r| r.path.clone()).collect(),
    };
    let given = |path: &String| values.values.iter().any(|v| within(&v.path, path));
    let initial: Vec<String> = initial.into_iter().filter(|path| !given(path)).collect();
    if !initial.is_empty() {
        console::tell(format_args!("{}: {}", Word::RetainInitial.text(language), listed(&initial)));
    }
    Ok(Exit::Good)
}

/// Whether a path is another one or a part of it.
fn within(path: &str, whole: &str) -> bool {
    let (path, whole) = (path.to_uppercase(), whole.to_uppercase());
    path.strip_prefix(&whole).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// Checks all values, then sets them; how many, or all mistakes.
fn take_over(machine: &mut Machine, values: &Exported) -> Result<usize, Vec<String>> {
    let (mut good, mut mistakes) = (Vec::new(), Vec::new());
    for value in &values.values {
        match parse(machine.program(), value) {
            Ok(parsed) => good.push((&value.path, parsed)),
            Err(mistake) => mistakes.push(format!("{}: {mistake}", value.path)),
        }
    }
    for refusal in machine.migration().map_or(&[][..], |m| &m.refused) {
        if !values.values.iter().any(|value| within(&value.path, &refusal.path)) {
            mistakes.push(format!(
                "{}: the stored value does not go with the program ({}), and the file has none",
                refusal.path, refusal.reason
            ));
        }
    }
    if !mistakes.is_empty() {
        return Err(mistakes);
    }
    for (path, (place, bytes)) in &good {
        machine.engine().write(*place, bytes).map_err(|error| vec![format!("{path}: {error}")])?;
    }
    Ok(good.len())
}

fn parse(program: &Program, value: &ExportedValue) -> Result<(Place, Vec<u8>), String> {
    let place = find(program, &value.path)?;
    let types = &program.types;
    let span = Span { offset: place.offset, len: types.size(place.ty), mask: u8::MAX };
    let one = Restore { kind: Reset::Warm, parts: vec![span], data: vec![0; span.len as usize], complete: true };
    if one.defect(program).is_some() {
        return Err("it is neither RETAIN nor PERSISTENT in this program".into());
    }
    let name = types.name(place.ty);
    if !name.eq_ignore_ascii_case(&value.ty) {
        return Err(format!("it is `{name}` in this program, the file says `{}`; correct type and value there", value.ty));
    }
    let special = match value.value.as_str() {
        "NaN" => Some(f64::NAN),
        "Infinity" => Some(f64::INFINITY),
        "-Infinity" => Some(f64::NEG_INFINITY),
        _ => None,
    };
    let bytes = match (special, types.get(place.ty)) {
        (Some(number), Type::Elem(Elem::Lreal)) => number.to_le_bytes().to_vec(),
        (Some(number), Type::Elem(Elem::Real)) => (number as f32).to_le_bytes().to_vec(),
        _ => takt_ir::parse_value(types, place.ty, &value.value).map_err(|error| error.to_string())?,
    };
    Ok((place, bytes))
}

/// The place of a path; VAR_STAT can be named here too.
fn find(program: &Program, path: &str) -> Result<Place, String> {
    let error = match takt_ir::resolve(program, path) {
        Ok(place) => return Ok(place),
        Err(error) => error,
    };
    let global = |r: &takt_ir::Retained| takt_ir::Global {
        name: r.path.clone(),
        bare: false,
        ty: r.ty,
        offset: r.offset,
        constant: false,
        doc: String::new(),
    };
    let holds = program.retained.iter().filter(|r| within(path, &r.path));
    let named = Program { globals: holds.map(global).collect(), types: program.types.clone(), ..Program::default() };
    takt_ir::resolve(&named, path).map_err(|_| error.to_string())
}
