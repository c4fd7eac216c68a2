//! What a program means: its types, its typed IR, the verifier and the reference interpreter.
//!
//! A [`Program`] is complete: image layout with initial bytes, bodies, tasks, symbols and sites. It is handed to an executor only after [`verify`]
//! has accepted it. **Invariant:** a verified body reaches memory only through an address whose extent is known, so that no program can touch
//! anything but its own image.

mod inst;
mod interp;
mod op;
mod parse;
mod print;
mod program;
mod symbols;
pub mod text;
mod types;
mod verify;

pub use inst::{Base, Block, BlockId, Body, BodyId, Const, Inst, Local, Mem, NativeId, SiteId, Term, Ty};
pub use interp::{Interpreter, run_body};
pub use op::{Op, Word, ops};
pub use parse::{ParseError, parse_program};
pub use print::print_program;
pub use program::{Global, Native, Program, ResourceInstance, Site, Task, Trigger, NULL_ZONE};
pub use symbols::{format_value, parse_value, resolve, Place, SymbolError};
pub use types::{elem_name, elem_size, Enumeration, Field, StructKind, Structure, Type, TypeId, Types};
pub use verify::{VerifyError, verify};
