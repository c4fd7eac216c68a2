//! `takt check`: everything there is to say about a program.

use super::{Exit, Format};
use crate::console;
use crate::language::{self, Word};
use crate::manifest::Located;
use crate::messages;
use crate::program::{self, Compiled, Condition};
use crate::project::{self, Project, ProjectError};
use std::path::PathBuf;

pub(super) fn execute(paths: &[PathBuf], format: Format) -> Exit {
    let project = match project::load_all(paths) {
        Ok(project) => project,
        Err(error) => return refuse(&error, format),
    };
    super::run::tell_encodings(&project.sources);
    let compiled = program::compile(&project, &conditions(&project));
    match format {
        Format::Text => tell(&compiled),
        Format::Json => compiled.diagnostics.iter().for_each(|d| console::result(messages::to_json(d, &|span| compiled.locate(span)))),
    }
    let (errors, warnings) = compiled.counts();
    if format == Format::Text {
        summarise(errors, warnings);
    }
    if errors > 0 { Exit::Findings } else { bound(&project, format) }
}

/// Every condition of the manifest.
fn conditions(project: &Project) -> Vec<Condition> {
    let manifest = &project.manifest;
    let simulation = manifest.simulation.iter();
    let of_simulation = simulation.flat_map(|s| s.done.iter().chain(s.operator.iter().filter_map(|step| step.when.as_ref())));
    let plotted = manifest.plot.iter().filter_map(|plot| plot.only.as_ref());
    of_simulation.chain(plotted).map(|text: &Located<String>| Condition::of_manifest(text)).collect()
}

/// Whether manifest and program fit together.
fn bound(project: &Project, format: Format) -> Exit {
    match crate::machine::Machine::new(
        project,
        crate::machine::Setup { executor: takt_engine::ExecutorKind::Interpreter, ..Default::default() },
    ) {
        Ok(_) => Exit::Good,
        Err(crate::machine::BuildError::Manifest(errors)) => refuse(&ProjectError::Manifest(errors), format),
        Err(error) => {
            console::tell(error);
            Exit::Findings
        }
    }
}

/// Diagnostics that people are shown; tools get all of them.
const SHOWN: usize = 500;

/// Draws the diagnostics on standard error.
pub(super) fn tell(compiled: &Compiled) {
    for diagnostic in compiled.diagnostics.iter().take(SHOWN) {
        console::tell(format_args!("{}\n", messages::draw(diagnostic, &|span| compiled.locate(span))));
    }
    if let more @ 1.. = compiled.diagnostics.len().saturating_sub(SHOWN) {
        console::tell(format_args!("{more} {}\n", Word::MoreFindings.text(language::of_environment())));
    }
}

/// Says how many there were.
pub(super) fn summarise(errors: usize, warnings: usize) {
    let language = language::of_environment();
    let count = |n: usize, one: Word, many: Word| match (n, language) {
        (1, language::Language::English) => format!("1 {}", one.text(language)),
        _ => format!("{n} {}", many.text(language)),
    };
    match (errors, warnings) {
        (0, 0) => console::tell(Word::NoFindings.text(language)),
        _ => {
            console::tell(format_args!("{}, {}", count(errors, Word::Error, Word::Errors), count(warnings, Word::Warning, Word::Warnings)))
        }
    }
}

/// Says why a project cannot be read.
pub(super) fn refuse(error: &ProjectError, format: Format) -> Exit {
    match (error, format) {
        (ProjectError::Manifest(errors), Format::Json) => messages::manifest_to_json(errors).iter().for_each(console::result),
        (ProjectError::Manifest(errors), Format::Text) => console::tell(format_args!("{}\n", messages::draw_manifest(errors))),
        _ => console::tell(format_args!("{}: {error}", Word::Error.text(language::of_environment()))),
    }
    Exit::Usage
}
