//! `takt log`: the journal, for people or as it is.

use super::{Exit, Format, LogArgs, Where, check};
use crate::console;
use crate::journal::{self, read};
use crate::language::{self, Word};
use crate::{project, state};
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// How often the file is looked at.
const PERIOD: Duration = Duration::from_millis(200);

/// The state folder of the machine that is meant.
pub(super) fn folder(machine: &Where) -> Result<PathBuf, Exit> {
    if let Some(folder) = &machine.state {
        return Ok(folder.clone());
    }
    let own = machine.path.join(state::FOLDER);
    if machine.path.join(project::MANIFEST).is_file() {
        return Ok(own);
    }
    let project = project::load(&machine.path).map_err(|error| check::refuse(&error, Format::Text))?;
    Ok(state::folder_of(&project, None))
}

pub(super) fn execute(args: &LogArgs) -> Exit {
    match show(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn show(args: &LogArgs) -> Result<Exit, Exit> {
    let folder = folder(&args.machine)?;
    let refused = |error: std::io::Error| {
        let path = journal::generation(&folder, 0);
        let language = language::of_environment();
        let help = if error.kind() == std::io::ErrorKind::NotFound { Word::NoJournal.text(language) } else { "" };
        console::tell(format_args!("{}: {}: {error}. {help}", Word::Error.text(language), path.display()));
        Exit::Usage
    };
    let count = Some(args.lines).filter(|count| *count > 0);
    let (lines, mut follower) = read::last(&folder, count).map_err(refused)?;
    let mut more = lines;
    // A reader that has gone away ends it.
    while print(&more, args.json).is_ok() && args.follow {
        std::thread::sleep(PERIOD);
        more = follower.more().map_err(refused)?;
    }
    Ok(Exit::Good)
}

fn print(lines: &[read::Line], json: bool) -> std::io::Result<()> {
    let mut out = anstream::stdout().lock();
    for line in lines {
        match line {
            Ok(entry) if json => writeln!(out, "{}", serde_json::to_string(entry).unwrap_or_default())?,
            Ok(entry) if read::is_bad(entry) => writeln!(out, "\x1b[31m{}\x1b[0m", read::for_people(entry))?,
            Ok(entry) => writeln!(out, "{}", read::for_people(entry))?,
            Err(problem) => console::tell(problem),
        }
    }
    out.flush()
}
