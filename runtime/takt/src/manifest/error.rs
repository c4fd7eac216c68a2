//! Mistakes in a manifest: each with its place, what was expected and found, and what to do.

use std::fmt;
use std::ops::Range;

/// A place in the manifest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// From 1.
    pub line: usize,
    /// In characters, from 1.
    pub column: usize,
}

impl Place {
    /// The place of a byte of a text.
    pub fn of(text: &str, byte: usize) -> Self {
        let mut byte = byte.min(text.len());
        while !text.is_char_boundary(byte) {
            byte -= 1;
        }
        let start = text[..byte].rfind('\n').map_or(0, |i| i + 1);
        Self { line: text[..byte].matches('\n').count() + 1, column: text[start..byte].chars().count() + 1 }
    }
}

/// One mistake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManifestError {
    /// Bytes of the manifest.
    pub span: Range<usize>,
    /// What is wrong: starts lower-case, says what was expected and found.
    pub message: String,
    /// What to do.
    pub help: String,
}

/// All mistakes of a manifest, in order of their places.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManifestErrors {
    /// The file, as shown to people.
    pub file: String,
    /// Its text.
    pub text: String,
    /// Not empty.
    pub errors: Vec<ManifestError>,
}

impl fmt::Display for ManifestErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, error) in self.errors.iter().enumerate() {
            let Place { line, column } = Place::of(&self.text, error.span.start);
            let separator = if i == 0 { "" } else { "\n" };
            write!(f, "{separator}{}:{line}:{column}: {}", self.file, error.message)?;
            if !error.help.is_empty() {
                write!(f, " ({})", error.help)?;
            }
        }
        Ok(())
    }
}
impl std::error::Error for ManifestErrors {}

/// Collects mistakes while a manifest is read.
#[derive(Debug)]
pub(crate) struct Sink {
    found: ManifestErrors,
}

impl Sink {
    /// Nothing found yet.
    pub(crate) fn new(file: &str, text: &str) -> Self {
        Self { found: ManifestErrors { file: file.into(), text: text.into(), errors: Vec::new() } }
    }
    /// Adds a mistake.
    pub(crate) fn push(&mut self, span: Range<usize>, message: impl Into<String>, help: impl Into<String>) {
        self.found.errors.push(ManifestError { span, message: message.into(), help: help.into() });
    }
    /// Whether nothing was found.
    pub(crate) fn is_empty(&self) -> bool {
        self.found.errors.is_empty()
    }
    /// The result, or everything that was found.
    pub(crate) fn finish<T>(mut self, value: T) -> Result<T, ManifestErrors> {
        if self.is_empty() {
            return Ok(value);
        }
        self.found.errors.sort_by_key(|error| error.span.start);
        Err(self.found)
    }
}
