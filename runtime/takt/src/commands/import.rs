//! `takt import`: a Takt project of sources in other forms.
//!
//! Writes a manifest and a file of ST per unit, and lists what could not be carried over. Promises: nothing that exists is overwritten, and nothing is
//! written if a file is damaged; `takt check` says of the project what it says of the sources.

use super::{Exit, Format, ImportArgs, check, run};
use crate::console;
use crate::language::{self, Word};
use crate::program;
use crate::project::{MANIFEST, Project, ProjectError};
use crate::sources::{self, Export, Left};
use serde_json::json;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use takt_syntax::Code;

pub(super) fn execute(args: &ImportArgs) -> Exit {
    let language = language::of_environment();
    if args.to.symlink_metadata().is_ok() {
        return refuse(&format!("{} {}", args.to.display(), Word::AlreadyThere.text(language)));
    }
    let (checked, export) = match sources::export(&args.paths) {
        Ok(read) => read,
        Err(error) => return check::refuse(&ProjectError::Source(error), Format::Text),
    };
    run::tell_encodings(&checked);
    let is_whole = checked.findings.is_empty();
    if checked.findings.iter().any(|finding| finding.code == Code::BadFile) {
        let compiled = program::compile(&Project { sources: checked, ..Project::default() }, &[]);
        check::tell(&compiled);
        let (errors, warnings) = compiled.counts();
        check::summarise(errors, warnings);
        return Exit::Findings;
    }
    match write(args, &export, checked.are_twincat()) {
        Ok(files) => {
            report(args, &files, &export.left);
            if is_whole { Exit::Good } else { Exit::Findings }
        }
        Err((path, error)) => refuse(&format!("{} cannot be written: {error}", path.display())),
    }
}

fn refuse(message: &str) -> Exit {
    console::tell(format_args!("{}: {message}", Word::Error.text(language::of_environment())));
    Exit::Usage
}

/// Writes the project and returns its files, relative to its folder.
fn write(args: &ImportArgs, export: &Export, is_twincat: bool) -> Result<Vec<PathBuf>, (PathBuf, io::Error)> {
    let folder = args.to.file_name().map_or_else(|| "takt".into(), |name| name.to_string_lossy().into_owned());
    let name = toml::Value::String(args.name.clone().unwrap_or(folder));
    let addressing = if is_twincat { "addressing = \"byte\"\n" } else { "" };
    create(&args.to, Path::new(MANIFEST), &format!("[project]\nname = {name}\n{addressing}"))?;
    fs::create_dir_all(args.to.join("src")).map_err(|error| (args.to.join("src"), error))?;
    let mut files = vec![PathBuf::from(MANIFEST)];
    for (folder, name, text) in &export.units {
        let file = Path::new("src").join(folder).join(format!("{name}.st"));
        create(&args.to, &file, text)?;
        files.push(file);
    }
    Ok(files)
}

fn create(root: &Path, file: &Path, text: &str) -> Result<(), (PathBuf, io::Error)> {
    let path = root.join(file);
    let folder = path.parent().unwrap_or(root);
    let written = fs::create_dir_all(folder)
        .and_then(|()| fs::OpenOptions::new().write(true).create_new(true).open(&path))
        .and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|error| (path, error))
}

/// Says what was written and what was left behind.
fn report(args: &ImportArgs, files: &[PathBuf], left: &[Left]) {
    if args.json {
        return console::result(to_json(&args.to, files, left));
    }
    let language = language::of_environment();
    if !left.is_empty() {
        console::tell(format_args!("{}:", Word::LeftBehind.text(language)));
    }
    for Left { file, line, column, what, reason } in left {
        console::tell(format_args!("  {file}:{line}:{column}: {what} ({reason})"));
    }
    console::tell(format_args!("{} {} {}", files.len(), Word::FilesWritten.text(language), args.to.display()));
}

fn to_json(folder: &Path, files: &[PathBuf], left: &[Left]) -> serde_json::Value {
    let left: Vec<_> = left
        .iter()
        .map(|left| json!({ "file": left.file, "line": left.line, "column": left.column, "what": left.what, "reason": left.reason }))
        .collect();
    let files: Vec<_> = files.iter().map(|file| file.to_string_lossy()).collect();
    json!({ "schema": 1, "folder": folder.to_string_lossy(), "files": files, "left": left })
}
