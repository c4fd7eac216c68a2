//! What is printed: results on standard output, everything for people on standard error.
//!
//! Colours are taken out where they are not wanted (`NO_COLOR`, no terminal). A reader that went away is no reason to stop a machine: what cannot be
//! written is dropped.

use std::io::Write;

/// Prints a line of a result.
pub fn result(line: impl std::fmt::Display) {
    let _ = writeln!(anstream::stdout(), "{line}");
}

/// Prints a line for people.
pub fn tell(line: impl std::fmt::Display) {
    let _ = writeln!(anstream::stderr(), "{line}");
}
