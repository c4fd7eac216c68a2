//! A project compiled: the program, what there is to say about it, and where conditions came from.

use crate::manifest::{Addressing, Arithmetic, Located};
use crate::messages::Spot;
use crate::places::Places;
use crate::project::Project;
use crate::sources::{Origin, Sources};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, OnceLock};
use takt_abi::Library;
use takt_ir::{BodyId, Program};
use takt_syntax::{Diagnostic, Severity, Source, Span};

/// The libraries that every program may use.
pub const LIBRARIES: &[&Library] = &[&takt_stdlib_fb::LIBRARY];

/// A BOOL expression from outside the sources.
#[derive(Debug, Clone)]
pub struct Condition {
    /// ST.
    pub text: String,
    /// Its place in the manifest; `None`: the command line.
    pub span: Option<Range<usize>>,
}

impl Condition {
    /// From the manifest.
    pub fn of_manifest(text: &Located<String>) -> Self {
        Self { text: text.value.clone(), span: Some(text.span.clone()) }
    }
}

/// What came of a project.
#[derive(Debug)]
pub struct Compiled {
    /// `None` if there are errors.
    pub program: Option<Arc<Program>>,
    /// In order of file and place.
    pub diagnostics: Vec<Diagnostic>,
    /// A body per condition, in order.
    pub conditions: Vec<BodyId>,
    files: Vec<Source>,
    /// Lines of the files, once they were asked for.
    places: Vec<OnceLock<Places>>,
    first_condition: usize,
    spans: Vec<Option<Range<usize>>>,
    manifest: Option<(String, String)>,
    origins: BTreeMap<usize, Arc<Origin>>,
}

/// Compiles a project with conditions in global scope.
pub fn compile(project: &Project, conditions: &[Condition]) -> Compiled {
    let manifest_name = project.manifest_file.as_ref().map_or("--until", |(name, _)| name.as_str());
    let name = |condition: &Condition| if condition.span.is_some() { manifest_name } else { "--until" }.to_string();
    let options = takt_compile::Options {
        name: project.name.clone(),
        namespaces: project.sources.namespaces.clone(),
        iec_arithmetic: project.manifest.arithmetic == Arithmetic::Iec,
        strict: project.manifest.strict,
        lint: true,
        byte_addresses: project.manifest.addressing.map_or(project.sources.are_twincat(), |addressing| addressing == Addressing::Byte),
        wired: project.manifest.wires.iter().map(|wire| wire.variable.value.clone()).collect(),
        heap: project.manifest.heap,
        defines: project.manifest.defines.clone(),
        conditions: conditions.iter().map(|condition| Source { name: name(condition), text: condition.text.clone() }).collect(),
    };
    // What is missing from a file that cannot be read would only be said again as unknown names.
    let is_readable = project.sources.findings.iter().all(|finding| finding.code != takt_syntax::Code::BadFile);
    let sources: &[Source] = if is_readable { &project.sources.list } else { &[] };
    let mut output = takt_compile::compile(takt_compile::Input { sources, libraries: LIBRARIES, options: &options });
    if is_readable {
        output.diagnostics.extend(project.sources.findings.iter().cloned());
        output.diagnostics.sort_by_key(|d| (d.span.file, d.span.start, d.span.end, d.code));
    } else {
        output.diagnostics.clone_from(&project.sources.findings);
        output.files.clone_from(&project.sources.list);
    }
    if !project.sources.findings.is_empty() {
        output.program = None;
    }
    if let Some(program) = &mut output.program {
        move_sites(program, &project.sources);
    }
    Compiled {
        program: output.program.map(Arc::new),
        diagnostics: output.diagnostics,
        conditions: output.conditions,
        places: vec![OnceLock::new(); output.files.len()],
        files: output.files,
        first_condition: project.sources.list.len(),
        spans: conditions.iter().map(|condition| condition.span.clone()).collect(),
        manifest: project.manifest_file.clone(),
        origins: project.sources.origins.clone(),
    }
}

/// Places of faults are those of the files that people edit.
fn move_sites(program: &mut Program, sources: &Sources) {
    for (&index, origin) in &sources.origins {
        let Some(source) = sources.list.get(index) else { continue };
        let lines = origin.lines(&source.text);
        for site in program.sites.iter_mut().filter(|site| site.file as usize == index) {
            let Some((file, line, column)) = lines.place(site.line, site.column) else { continue };
            let known = if file == source.name { Some(index) } else { program.files.iter().position(|name| name == file) };
            let file = known.unwrap_or_else(|| {
                program.files.push(file.into());
                program.files.len() - 1
            });
            (site.file, site.line, site.column) = (file as u32, line, column);
        }
    }
}

impl Compiled {
    /// Whether an error stands in a source; else all of them stand in conditions of the manifest or the command line.
    pub fn errors_in_sources(&self) -> bool {
        let error = |d: &&takt_syntax::Diagnostic| d.severity() == takt_syntax::Severity::Error;
        self.diagnostics.iter().filter(error).any(|d| (d.span.file.0 as usize) < self.first_condition)
    }

    /// Errors and warnings, counted.
    pub fn counts(&self) -> (usize, usize) {
        let errors = self.diagnostics.iter().filter(|d| d.severity() == Severity::Error).count();
        (errors, self.diagnostics.len() - errors)
    }
    /// Where a span is shown: a condition of the manifest is shown there.
    pub fn locate(&self, span: Span) -> Spot<'_> {
        let range = span.start as usize..span.end as usize;
        let index = span.file.0 as usize;
        let condition = index.checked_sub(self.first_condition).and_then(|i| self.spans.get(i)).and_then(Option::as_ref);
        if let (Some(place), Some((name, text))) = (condition, &self.manifest) {
            let inside = place.start + 1..place.end.saturating_sub(1);
            let verbatim = text.get(inside.clone()) == self.files.get(index).map(|file| file.text.as_str());
            let shown = if verbatim { inside.start + range.start..inside.start + range.end } else { place.clone() };
            return Spot::new(name, text, shown);
        }
        if let Some(origin) = self.origins.get(&index) {
            let (file, range) = origin.place(range);
            return Spot::new(&file.name, &file.text, range).with(origin.places(file));
        }
        match self.files.get(index) {
            Some(file) => {
                let places = self.places.get(index).map(|places| places.get_or_init(|| Places::new(&file.text)));
                Spot::new(&file.name, &file.text, range).with(places)
            }
            None => Spot::new("?", "", 0..0),
        }
    }
}
