//! `takt doctor`: examines the computer.

use super::{DoctorArgs, Exit, Format, check};
use crate::console;
use crate::doctor::{self, Level, Wishes};
use crate::language::{self, Word};
use crate::{project, state};

pub(super) fn execute(args: &DoctorArgs) -> Exit {
    match try_examine(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn try_examine(args: &DoctorArgs) -> Result<Exit, Exit> {
    let settings = match &args.path {
        Some(path) => Some(project::load(path).map_err(|error| check::refuse(&error, Format::Text))?),
        None => None,
    };
    let realtime = settings.as_ref().map(|project| project.manifest.realtime).unwrap_or_default();
    let state = settings.as_ref().map(|project| state::folder_of(project, args.state.as_deref()));
    let wishes =
        Wishes { priority: realtime.priority, cpu: realtime.cpu, state: state.map(|state| std::path::absolute(&state).unwrap_or(state)) };
    let language = language::of_environment();
    let findings = doctor::examine(&args.root, &wishes);
    if args.json {
        console::result(doctor::to_json(&findings, language));
    } else {
        findings.iter().for_each(|finding| console::result(finding.line(language)));
        let count = |level| findings.iter().filter(|finding| finding.level == level).count();
        let (missing, advice) = (count(Level::Missing), count(Level::Advice));
        if missing + advice == 0 {
            console::tell(Word::DoctorGood.text(language));
        } else {
            console::tell(format_args!("{missing} {}, {advice} {}", Word::DoctorMissing.text(language), Word::DoctorAdvice.text(language)));
        }
    }
    let missing = findings.iter().any(|finding| finding.level == Level::Missing);
    Ok(if missing { Exit::Findings } else { Exit::Good })
}
