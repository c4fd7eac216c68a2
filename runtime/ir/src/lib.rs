//! What a program means: its types, its typed IR, the verifier and the reference interpreter.
//!
//! A [`Program`] is complete: image layout with initial bytes, bodies, tasks, symbols and sites. It is handed to an executor only after [`verify`]
//! has accepted it. **Invariant:** a verified body reaches memory only through an address whose extent is known, so that no program can touch
//! anything but its own image.

mod address;
mod calendar;
mod calls;
pub mod heap;
mod inst;
mod instance;
mod interp;
mod literal;
mod memory;
mod op;
mod parse;
mod print;
mod program;
pub mod retain;
mod symbols;
#[cfg(test)]
mod testing;
pub mod text;
mod types;
mod value;
mod verify;

pub use address::{Address, AddressError, Area, Areas, LARGEST_AREA, Mapped, parse_address, placeholder};
pub use calls::{CallGraph, Components};
pub use inst::{Base, Block, BlockId, Body, BodyId, Const, Inst, Local, Mem, NativeId, SiteId, Term, Ty};
pub use instance::instance_at;
pub use interp::{Interpreter, run_body};
pub use literal::{ValueError, parse_value};
pub use op::{Op, Word, ops};
pub use parse::{ParseError, parse_program};
pub use print::print_program;
pub use program::{
    Class, Dispatch, Family, Global, Home, Instances, NULL_ZONE, Native, Program, ResourceInstance, Site, Task, Trigger, Variables,
};
pub use retain::{Latched, RetainKind, Retained};
pub use symbols::{Place, SymbolError, resolve};
pub use types::{Enumeration, Field, StructKind, Structure, Type, TypeId, Types, elem_name, elem_size};
pub use value::{Scalar, format_value, read_scalar};
pub use verify::{Defect, VerifyError, verify};
