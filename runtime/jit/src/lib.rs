//! IR to machine code. The only crate that knows Cranelift.
//!
//! [`compile`] verifies a program and turns each of its bodies into a function of the processor; [`Code::run`] runs one with exactly the outcome of
//! [`takt_ir::run_body`]: the same image, the same fuel, the same fault with the same facts, site and call stack.
//!
//! **Invariants.** Machine addresses live in registers only; the image holds offsets. Every access to memory is one that the verifier has proved to
//! lie inside the image, behind a check that the IR asked for. No signal handlers, no unwinding through machine code: each call returns a status.
//!
//! **What is absent:** optimisations that need the source (inlining of blocks, promotion of variables to locals) belong to the compiler; here an
//! instruction is an instruction.

mod body;
mod code;
mod defect;
mod machine;
mod place;
mod runtime;
mod stack;

pub use code::{Code, JitError, compile, compile_for, compile_with};
#[doc(hidden)]
pub use defect::Defect;
pub use machine::Processor;
pub use stack::NATIVE_STACK;
