//! `takt backup` and `takt restore`.

use super::{BackupArgs, Exit, Format, RestoreArgs, Where, check, log};
use crate::journal::{Entry, Event, Journal};
use crate::language::{self, Word};
use crate::{backup, console, project, state};
use serde_json::json;
use std::path::Path;

fn refuse(error: &dyn std::fmt::Display) -> Exit {
    console::tell(format_args!("{}: {error}", Word::Error.text(language::of_environment())));
    Exit::Usage
}

/// The only form that there is.
fn is_backup(file: &Path) -> Result<(), Exit> {
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if name.ends_with(".tar.gz") || name.ends_with(".tgz") {
        return Ok(());
    }
    Err(refuse(&format_args!("{}: a backup is a .tar.gz", file.display())))
}

pub(super) fn save(args: &BackupArgs) -> Exit {
    match try_save(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn try_save(args: &BackupArgs) -> Result<Exit, Exit> {
    is_backup(&args.file)?;
    if args.file.exists() && !args.force {
        return Err(refuse(&format_args!("{} {}", args.file.display(), Word::ExistsForce.text(language::of_environment()))));
    }
    let project = project::load(&args.path).map_err(|error| check::refuse(&error, Format::Text))?;
    if project.manifest_file.is_none() {
        return Err(refuse(&format_args!("{} {}", args.path.display(), Word::NeedsManifest.text(language::of_environment()))));
    }
    let state = log::folder(&Where { path: args.path.clone(), state: args.state.clone() })?;
    let (list, left_out) = backup::save(&project.name, &project.root, &state, &args.file).map_err(|error| refuse(&error))?;
    let language = language::of_environment();
    for path in &left_out {
        console::tell(format_args!("{}: {}", Word::LeftOut.text(language), path.display()));
    }
    let bytes: u64 = list.files.iter().map(|member| member.size).sum();
    if args.json {
        console::result(json!({ "file": args.file, "files": list.files.len(), "bytes": bytes, "left_out": left_out }));
    } else {
        console::tell(format_args!(
            "{}: {} {}, {bytes} {}",
            args.file.display(),
            list.files.len(),
            Word::Files.text(language),
            Word::Bytes.text(language)
        ));
    }
    Ok(Exit::Good)
}

pub(super) fn restore(args: &RestoreArgs) -> Exit {
    match try_restore(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn try_restore(args: &RestoreArgs) -> Result<Exit, Exit> {
    is_backup(&args.file)?;
    let list = backup::restore(&args.file, &args.folder, args.force).map_err(|error| refuse(&error))?;
    let folder = args.folder.join(state::FOLDER);
    if let Ok((journal, _)) = std::fs::create_dir_all(&folder).and_then(|()| Journal::open(&folder, Vec::new())) {
        let user = std::env::var("USER").unwrap_or_default();
        let message = format!("restored from {} of {}", args.file.display(), list.time);
        journal.post(Entry::new(Event::Load).variable(&list.project).message(message).by(&user, "takt restore", ""));
    }
    let language = language::of_environment();
    if args.json {
        console::result(json!({ "folder": args.folder, "project": list.project, "time": list.time, "files": list.files.len() }));
    } else {
        console::tell(format_args!(
            "{}: {}, {} {}, {}",
            args.folder.display(),
            list.project,
            list.files.len(),
            Word::Files.text(language),
            list.time
        ));
    }
    Ok(Exit::Good)
}
