//! A project compiled: the program, what there is to say about it, and where conditions came from.

use crate::manifest::{Arithmetic, Located};
use crate::messages::Spot;
use crate::project::Project;
use std::ops::Range;
use std::sync::Arc;
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
    first_condition: usize,
    spans: Vec<Option<Range<usize>>>,
    manifest: Option<(String, String)>,
}

/// Compiles a project with conditions in global scope.
pub fn compile(project: &Project, conditions: &[Condition]) -> Compiled {
    let manifest_name = project.manifest_file.as_ref().map_or("--until", |(name, _)| name.as_str());
    let name = |condition: &Condition| if condition.span.is_some() { manifest_name } else { "--until" }.to_string();
    let options = takt_compile::Options {
        iec_arithmetic: project.manifest.arithmetic == Arithmetic::Iec,
        strict: project.manifest.strict,
        heap: project.manifest.heap,
        defines: project.manifest.defines.clone(),
        conditions: conditions.iter().map(|condition| Source { name: name(condition), text: condition.text.clone() }).collect(),
    };
    let output = takt_compile::compile(takt_compile::Input { sources: &project.sources.list, libraries: LIBRARIES, options: &options });
    Compiled {
        program: output.program.map(Arc::new),
        diagnostics: output.diagnostics,
        conditions: output.conditions,
        files: output.files,
        first_condition: project.sources.list.len(),
        spans: conditions.iter().map(|condition| condition.span.clone()).collect(),
        manifest: project.manifest_file.clone(),
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
        match self.files.get(index) {
            Some(file) => Spot::new(&file.name, &file.text, range),
            None => Spot::new("?", "", 0..0),
        }
    }
}
