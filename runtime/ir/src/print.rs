//! The text form of a program, written.

use crate::program::Program;

/// The program as text that [`crate::parse_program`] reads.
pub fn print_program(program: &Program) -> String {
    format!("{:#?}", program.bodies)
}
