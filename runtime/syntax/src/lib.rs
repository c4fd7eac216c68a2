//! Text to tree: the lexer, the parser and the diagnostics of Structured Text.
//!
//! Promises: never panics, always ends, reports every mistake once and goes on; every node carries its span. Lacks: any meaning. Names are not
//! resolved here, types not known; that is `compile`.

mod conditions;
mod diagnostic;
mod lexer;
mod lines;
mod parser;
pub mod tree;

pub use conditions::Conditions;
pub use diagnostic::{Code, Diagnostic, Note, Severity, codes, explain};
pub use lines::LineIndex;
pub use parser::{parse, parse_expression, parse_under};

/// Names a source file: index into the list that the caller keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FileId(pub u32);

/// A range of bytes in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Span {
    /// Which file.
    pub file: FileId,
    /// First byte.
    pub start: u32,
    /// Behind the last byte.
    pub end: u32,
}

impl Span {
    /// From the start of `self` to the end of `other`.
    pub fn to(self, other: Self) -> Self {
        Self { end: other.end.max(self.start), ..self }
    }
}

/// A source text and the name that messages call it.
#[derive(Debug, Clone)]
pub struct Source {
    /// Path as shown to people.
    pub name: String,
    /// Text, UTF-8.
    pub text: String,
}
