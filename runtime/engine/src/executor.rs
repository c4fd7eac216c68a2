//! The two ways to run a program.

use std::rc::Rc;
use takt_jit::Code;

/// How bodies are run. Cheap to clone: a clone is held while a body runs.
#[derive(Clone)]
pub(crate) enum Executor {
    /// The reference interpreter.
    Interpreter,
    /// Machine code.
    Jit(Rc<Code>),
}
