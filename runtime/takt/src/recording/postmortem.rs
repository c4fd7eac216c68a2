//! A core file looked at: the program that it holds is run again in the interpreter, up to the fault.

use super::file::{Chunks, FileError, Kind};
use super::player::{PlayError, Player};
use crate::machine::{Machine, Setup};
use crate::manifest;
use crate::project::Project;
use crate::sources::Sources;
use std::path::{Path, PathBuf};
use takt_engine::{ExecutorKind, FaultRecord};
use takt_ir::{Home, Program, Type, instance_at};
use takt_syntax::Source;

/// A variable of a call or an instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shown {
    /// Its name.
    pub name: String,
    /// Its type.
    pub ty: String,
    /// Its value as an ST literal.
    pub value: String,
}

/// A call that was under way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Call {
    /// The function, block, method or program.
    pub body: String,
    /// Path of the instance it ran on, if it has one.
    pub instance: Option<String>,
    /// Source file, line, column.
    pub place: (String, u32, u32),
    /// The line of the source.
    pub source: String,
    /// Parameters, local variables, result.
    pub locals: Vec<Shown>,
    /// Variables of the instance or program.
    pub members: Vec<Shown>,
}

/// What a core file shows.
#[derive(Debug)]
pub struct Postmortem {
    /// The fault as it was when it happened, as JSON.
    pub recorded: serde_json::Value,
    /// The fault as it came again; `None`: the recording does not reach it.
    pub again: Option<FaultRecord>,
    /// Calls, the innermost first.
    pub calls: Vec<Call>,
    /// Inputs of the last exchange, by name.
    pub inputs: Vec<(String, String)>,
    player: Player,
}

/// The project that a core file holds.
pub fn project(chunks: &mut Chunks) -> Result<Project, FileError> {
    let json = chunks.json(Kind::Sources)?;
    let path = chunks.path().to_path_buf();
    let wrong = move |message: &str| FileError::Damaged { path: path.clone(), at: 8, message: format!("the chunk `sources`: {message}") };
    let text = |value: &serde_json::Value| value.as_str().map(str::to_string);
    let list = json.get("sources").and_then(serde_json::Value::as_array).ok_or_else(|| wrong("expected a list `sources`"))?;
    let source = |entry: &serde_json::Value| Some(Source { name: text(entry.get("name")?)?, text: text(entry.get("text")?)? });
    let list: Option<Vec<_>> = list.iter().map(source).collect();
    let list = list.ok_or_else(|| wrong("expected a name and a text of each source"))?;
    let mut project = Project {
        name: json.get("name").and_then(text).unwrap_or_default(),
        root: PathBuf::from("."),
        sources: Sources { list, ..Sources::default() },
        ..Project::default()
    };
    if let Some(text) = json.get("manifest").and_then(text) {
        let name = crate::project::MANIFEST;
        project.manifest = manifest::read(name, &text).map_err(|errors| wrong(&errors.to_string()))?;
        project.manifest_file = Some((name.into(), text));
    }
    Ok(project)
}

/// Opens a core file and runs its program up to the fault.
pub fn open(path: &Path, native_stack: Option<usize>) -> Result<Postmortem, PlayError> {
    let mut chunks = Chunks::open(path)?;
    let project = project(&mut chunks)?;
    let recorded = chunks.json(Kind::Fault)?;
    let setup = Setup { executor: ExecutorKind::Interpreter, native_stack, ..Setup::default() };
    let mut player = Player::of(chunks, &project, setup)?;
    player.skip_to_last_state()?;
    // There may have been others before it, each with a reset.
    let wanted = |record: &FaultRecord| {
        recorded["code"] == record.fault.name() && recorded["task"] == record.task.as_str() && recorded["cycle"] == record.cycle
    };
    while !player.machine().fault().is_some_and(wanted) && player.step()? {}
    let machine = player.machine();
    let again = machine.fault().filter(|record| wanted(record)).cloned();
    let calls = again.as_ref().map_or_else(Vec::new, |record| calls(machine, &project, record));
    let inputs = inputs(machine);
    Ok(Postmortem { recorded, again, calls, inputs, player })
}

impl Postmortem {
    /// The machine at the fault.
    pub fn machine(&mut self) -> &mut Machine {
        self.player.machine()
    }
}

fn calls(machine: &mut Machine, project: &Project, record: &FaultRecord) -> Vec<Call> {
    let program = machine.program().clone();
    let task = program.tasks.iter().position(|task| task.name == record.task).unwrap_or(0);
    let stopped = machine.engine().stopped_calls(task);
    let image = machine.engine().image().to_vec();
    let line = |file: &str, line: u32| {
        let source = project.sources.list.iter().find(|source| source.name == file);
        source.and_then(|source| source.text.lines().nth((line as usize).checked_sub(1)?)).unwrap_or_default().trim_end().to_string()
    };
    // The task's own body calls the programs; it is nobody's.
    let own = stopped.into_iter().filter(|(body, ..)| program.variables.contains_key(body));
    own.map(|(body, site, words, frame)| {
        let site = program.sites.get(site as usize);
        let file = site.and_then(|site| program.files.get(site.file as usize)).map_or("?", String::as_str);
        let (row, column) = site.map_or((0, 0), |site| (site.line, site.column));
        let name = program.bodies.get(body.0 as usize).map_or("?", |body| body.name.as_str());
        let variables = &program.variables[&body];
        let block = name.split('.').next().unwrap_or(name);
        let offset = variables.instance.then(|| words.first().copied().unwrap_or(0) as u32);
        let instance = offset.and_then(|offset| instance_at(&program, offset, block));
        let locals = variables.list.iter().map(|(name, ty, home)| {
            let size = program.types.size(*ty) as usize;
            let word = |local: takt_ir::Local| words.get(local.0 as usize).copied().unwrap_or(0);
            let at = |offset: u64| image.get(offset as usize..).and_then(|rest| rest.get(..size)).map(<[u8]>::to_vec);
            let bytes = match home {
                Home::Local(local) => Some(word(*local).to_le_bytes()[..size.min(8)].to_vec()),
                Home::Frame(offset) => at(frame + u64::from(*offset)),
                Home::Behind(local) => at(word(*local)),
            };
            let value = bytes.map_or_else(|| "?".into(), |bytes| takt_ir::format_value(&program.types, *ty, &bytes));
            Shown { name: name.clone(), ty: program.types.name(*ty), value }
        });
        let path = instance.clone().or_else(|| (!variables.instance).then(|| block.to_string()));
        Call {
            body: name.into(),
            place: (file.into(), row, column),
            source: line(file, row),
            locals: locals.collect(),
            members: path.map_or_else(Vec::new, |path| members(&program, &image, &path)),
            instance,
        }
    })
    .collect()
}

/// The variables of an instance.
fn members(program: &Program, image: &[u8], path: &str) -> Vec<Shown> {
    let Ok(place) = takt_ir::resolve(program, path) else { return Vec::new() };
    let Type::Struct(structure) = program.types.get(place.ty) else { return Vec::new() };
    let show = |field: &takt_ir::Field| {
        let start = (place.offset + field.offset) as usize;
        let bytes = image.get(start..start + program.types.size(field.ty) as usize)?;
        Some(Shown {
            name: field.name.clone(),
            ty: program.types.name(field.ty),
            value: takt_ir::format_value(&program.types, field.ty, bytes),
        })
    };
    structure.fields.iter().filter_map(show).collect()
}

/// What the bus brought last.
fn inputs(machine: &mut Machine) -> Vec<(String, String)> {
    let mut channels = machine.bus().control.channels();
    channels.retain(|(_, channel)| channel.is_input());
    let io = machine.engine().process_image();
    let mut list: Vec<_> = channels
        .into_iter()
        .map(|(name, channel)| {
            let value = match channel {
                takt_engine::Channel::BitIn(i) => if io.bits_in.get(i).is_some_and(|bit| *bit != 0) { "TRUE" } else { "FALSE" }.to_string(),
                takt_engine::Channel::AnalogIn(i) => io.analog_in.get(i).map_or_else(|| "?".into(), f64::to_string),
                _ => "?".into(),
            };
            (name, value)
        })
        .collect();
    list.extend(io.drives_in.iter().enumerate().map(|(i, drive)| {
        let online = if drive.online { "" } else { ", offline" };
        let text = format!(
            "statusword 16#{:04X}, position {}, velocity {}, error 16#{:04X}{online}",
            drive.status_word, drive.position, drive.velocity, drive.error_code
        );
        (format!("drive {i}"), text)
    }));
    list
}
