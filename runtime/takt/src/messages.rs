//! Diagnostics and manifest mistakes, drawn for people or as JSON for tools.
//!
//! Columns are counted in characters; the drawing knows that some are wide.

use crate::manifest::{ManifestErrors, Place};
use crate::places::Places;
use annotate_snippets::{AnnotationKind, Element, Group, Level, Origin, Renderer, Snippet};
use serde_json::{Value, json};
use std::ops::Range;
use takt_syntax::{Diagnostic, Severity, Span};

/// A range of bytes in a text that people see.
#[derive(Debug, Clone)]
pub struct Spot<'a> {
    /// Name of the file.
    pub file: &'a str,
    /// Its text.
    pub text: &'a str,
    /// Bytes.
    pub range: Range<usize>,
    /// The lines of the text, where they were counted before.
    pub places: Option<&'a Places>,
}

impl<'a> Spot<'a> {
    /// A spot whose range is inside the text and on character boundaries, whatever was asked for.
    pub fn new(file: &'a str, text: &'a str, range: Range<usize>) -> Self {
        let floor = |mut byte: usize| {
            byte = byte.min(text.len());
            while !text.is_char_boundary(byte) {
                byte -= 1;
            }
            byte
        };
        let start = floor(range.start);
        Self { file, text, range: start..floor(range.end).max(start), places: None }
    }

    /// With the lines of the text, so that they need not be counted again.
    pub fn with(self, places: Option<&'a Places>) -> Self {
        Self { places, ..self }
    }

    /// The lines that are drawn and the number of the first: all, if nobody counted them. The end of the file is drawn behind its last line.
    fn lines(&self) -> (Range<usize>, u32) {
        let Some(places) = self.places else { return (0..self.text.len(), 1) };
        if self.range.start < self.text.len() || !self.text.ends_with('\n') {
            return places.lines(self.text, &self.range);
        }
        let (last, number) = places.lines(self.text, &(self.range.start - 1..self.range.start - 1));
        (last.start..self.text.len(), number)
    }

    /// Line and column of a byte.
    fn place(&self, byte: usize) -> Place {
        let Some(places) = self.places else { return Place::of(self.text, byte) };
        let (line, column) = places.position(self.text, byte);
        Place { line: line as usize, column: column as usize }
    }
}

/// Where a span of the compiler is shown.
pub type Locate<'a, 'f> = &'f dyn Fn(Span) -> Spot<'a>;

/// A line longer than this is named, not drawn: no person wrote it.
const DRAWN: usize = 1 << 16;

fn snippet<'a>(spot: &Spot<'a>, kind: AnnotationKind, label: Option<&'a str>) -> Vec<Element<'a>> {
    let (lines, first) = spot.lines();
    if spot.places.is_some() && lines.len() > DRAWN {
        let Place { line, column } = spot.place(spot.range.start);
        let origin = Origin::path(spot.file).line(line).char_column(column);
        return std::iter::once(origin.into()).chain(label.map(|label| Level::NOTE.message(label).into())).collect();
    }
    let start = spot.range.start.min(lines.end);
    let mut annotation = kind.span(start - lines.start..spot.range.end.clamp(start, lines.end) - lines.start);
    if let Some(label) = label {
        annotation = annotation.label(label);
    }
    vec![Snippet::source(&spot.text[lines]).line_start(first as usize).path(spot.file).annotation(annotation).into()]
}

/// Draws a diagnostic. Colours are in it; the stream takes them out where they are not wanted.
pub fn draw(diagnostic: &Diagnostic, locate: Locate<'_, '_>) -> String {
    let level = match diagnostic.severity() {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let title = level.primary_title(diagnostic.message.as_str()).id(diagnostic.code.text());
    let mut group = title.elements(snippet(&locate(diagnostic.span), AnnotationKind::Primary, None));
    for note in &diagnostic.notes {
        group = group.elements(snippet(&locate(note.span), AnnotationKind::Context, Some(note.message.as_str())));
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(help.as_str()));
    }
    Renderer::styled().render(&[group])
}

/// A diagnostic for tools (DESIGN §9).
pub fn to_json(diagnostic: &Diagnostic, locate: Locate<'_, '_>) -> Value {
    let severity = match diagnostic.severity() {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    place_json(diagnostic.code.text(), severity, &diagnostic.message, &locate(diagnostic.span), diagnostic.help.as_deref())
}

fn place_json(code: &str, severity: &str, message: &str, spot: &Spot<'_>, help: Option<&str>) -> Value {
    let (start, end) = (spot.place(spot.range.start), spot.place(spot.range.end));
    json!({
        "code": code, "severity": severity, "message": message, "file": spot.file,
        "line": start.line, "column": start.column, "end_line": end.line, "end_column": end.column, "help": help,
    })
}

/// Draws the mistakes of a manifest.
pub fn draw_manifest(errors: &ManifestErrors) -> String {
    let groups: Vec<Group<'_>> = errors.errors.iter().map(|error| manifest_group(errors, error)).collect();
    let drawn: Vec<String> = groups.into_iter().map(|group| Renderer::styled().render(&[group])).collect();
    drawn.join("\n\n")
}

fn manifest_group<'a>(errors: &'a ManifestErrors, error: &'a crate::manifest::ManifestError) -> Group<'a> {
    let spot = Spot::new(&errors.file, &errors.text, error.span.clone());
    let group = Level::ERROR.primary_title(error.message.as_str()).elements(snippet(&spot, AnnotationKind::Primary, None));
    if error.help.is_empty() { group } else { group.element(Level::HELP.message(error.help.as_str())) }
}

/// The mistakes of a manifest for tools; their code is `manifest`.
pub fn manifest_to_json(errors: &ManifestErrors) -> Vec<Value> {
    let json = |error: &crate::manifest::ManifestError| {
        let spot = Spot::new(&errors.file, &errors.text, error.span.clone());
        place_json("manifest", "error", &error.message, &spot, Some(error.help.as_str()).filter(|help| !help.is_empty()))
    };
    errors.errors.iter().map(json).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_syntax::{Code, FileId};

    const TEXT: &str = "PROGRAM main\n压力 := 'Bar';\nEND_PROGRAM\n";

    fn diagnostic() -> Diagnostic {
        let start = TEXT.find("'Bar'").unwrap() as u32;
        let span = Span { file: FileId(0), start, end: start + 5 };
        Diagnostic::new(Code::TypeMismatch, span, "expected `INT`, found `STRING`").help("write a number")
    }

    #[test]
    fn json_has_every_key_and_counts_characters() {
        let json = to_json(&diagnostic(), &|span| Spot::new("a.st", TEXT, span.start as usize..span.end as usize));
        let expected = json!({
            "code": "E0301", "severity": "error", "message": "expected `INT`, found `STRING`", "file": "a.st",
            "line": 2, "column": 7, "end_line": 2, "end_column": 12, "help": "write a number",
        });
        assert_eq!(json, expected);
    }

    #[test]
    fn carets_stand_under_wide_characters() {
        let drawn = draw(&diagnostic(), &|span| Spot::new("a.st", TEXT, span.start as usize..span.end as usize));
        let plain = anstream::adapter::strip_str(&drawn).to_string();
        let lines: Vec<&str> = plain.lines().collect();
        let source = lines.iter().position(|line| line.contains("压力")).expect("the line is shown");
        let cells = |text: &str| text.chars().map(|c| if c.is_ascii() { 1 } else { 2 }).sum::<usize>();
        let at = lines[source].find("'Bar'").unwrap();
        assert_eq!(lines[source + 1].find('^'), Some(cells(&lines[source][..at])), "{plain}");
        assert!(plain.contains("error[E0301]") && plain.contains("a.st:2:7") && plain.contains("help: write a number"), "{plain}");
    }

    #[test]
    fn lines_counted_before_change_nothing() {
        let places = Places::new(TEXT);
        for range in [0..7, 13..24, 20..20, 13..TEXT.len(), TEXT.len()..TEXT.len(), 8..30] {
            let span = Span { file: FileId(0), start: range.start as u32, end: range.end as u32 };
            let diagnostic = Diagnostic::new(Code::TypeMismatch, span, "expected `INT`").note(diagnostic().span, "here");
            let plain = |span: Span| Spot::new("a.st", TEXT, span.start as usize..span.end as usize);
            let counted = |span: Span| plain(span).with(Some(&places));
            assert_eq!(draw(&diagnostic, &counted), draw(&diagnostic, &plain), "{range:?}");
            assert_eq!(to_json(&diagnostic, &counted), to_json(&diagnostic, &plain), "{range:?}");
        }
    }

    #[test]
    fn a_line_that_nobody_wrote_is_named_and_not_drawn() {
        let text = format!("{TEXT}{}x", "点".repeat(DRAWN));
        let places = Places::new(&text);
        let start = text.len() as u32 - 1;
        let span = Span { file: FileId(0), start, end: start + 1 };
        let diagnostic = Diagnostic::new(Code::TypeMismatch, span, "expected `INT`").note(span, "declared here").help("write a number");
        let drawn = draw(&diagnostic, &|span| Spot::new("a.st", &text, span.start as usize..span.end as usize).with(Some(&places)));
        let plain = anstream::adapter::strip_str(&drawn).to_string();
        assert!(plain.contains("a.st:4:65537") && plain.contains("declared here") && plain.contains("write a number"), "{plain}");
        assert!(plain.len() < 1000, "{plain}");
    }

    #[test]
    fn a_span_outside_the_text_does_no_harm() {
        let spot = Spot::new("a.st", TEXT, 15..9999);
        assert_eq!(spot.range.end, TEXT.len());
        assert!(TEXT.is_char_boundary(spot.range.start));
    }
}
