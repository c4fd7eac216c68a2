//! Bounds that no program written by people reaches, so that none costs unbounded time, memory or stack.

use crate::unit::Compiler;
use takt_syntax::{Code, Span};

/// How deep declarations and expressions that need each other may be nested.
const DEPTH: u32 = 1000;

/// What a declaration counts for: finding out its type or value takes more stack than an expression does.
pub(crate) const DECLARATION: u32 = 4;

/// How many blocks may extend one another in a row, and how many interfaces one may extend.
pub(crate) const EXTENDS: usize = 250;

/// Names that are compared with misspelled ones, all in all. Who has made so many mistakes is not helped by more guesses.
pub(crate) const COMPARISONS: usize = 1_000_000;

impl Compiler<'_> {
    /// Goes `levels` deeper into declarations that need each other, or reports that this is too deep. [`Compiler::back`] must follow if it is `true`.
    pub(crate) fn deeper(&mut self, levels: u32, at: Span) -> bool {
        if self.depth + levels > DEPTH {
            let message = format!("this needs declarations in a row of more than {}, each of which needs the next", DEPTH / DECLARATION);
            self.report(Code::TooDeep, at, message).help =
                Some("contain fewer types in each other, or declare constants behind those they need".into());
            return false;
        }
        self.depth += levels;
        true
    }

    /// Whether a misspelled name may be compared with so many others.
    pub(crate) fn may_compare(&mut self, names: usize) -> bool {
        let left = self.comparisons.checked_sub(names);
        self.comparisons = left.unwrap_or(self.comparisons);
        left.is_some()
    }

    /// Ends what [`Compiler::deeper`] began.
    pub(crate) fn back(&mut self, levels: u32) {
        self.depth -= levels;
    }
}
