//! Tokens to tree.

use crate::{tree, Diagnostic, FileId};

/// Parses a source file.
pub fn parse(_file: FileId, _text: &str) -> (tree::File, Vec<Diagnostic>) {
    (tree::File::default(), Vec::new())
}

/// Parses one expression.
pub fn parse_expression(file: FileId, text: &str) -> (tree::Expr, Vec<Diagnostic>) {
    (tree::Expr { kind: tree::ExprKind::Error, span: crate::Span { file, start: 0, end: text.len() as u32 } }, Vec::new())
}
