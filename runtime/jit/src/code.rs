//! Compiled programs: from IR to memory that can be run, and the way in.

use crate::body::Tables;
use crate::defect::Defect;
use crate::machine::{self, Compiled, Processor};
use crate::stack::StackUse;
use cranelift_codegen::ir::{LibCall, Signature};
use cranelift_jit::{ArenaMemoryProvider, JITBuilder, JITModule};
use cranelift_module::{FuncId, Module, default_libcall_names};
use std::sync::Mutex;
use takt_abi::{Context, Fault};
use takt_ir::{Body, BodyId, Op, Program, Ty, VerifyError};

/// Why a program could not be compiled. Only [`JitError::Verify`] can be the program's fault.
#[derive(Debug, Clone, PartialEq)]
pub enum JitError {
    /// The verifier refuses the program.
    Verify(VerifyError),
    /// The code generator refuses a body: too large, or a defect of ours.
    Body {
        /// The body's name.
        name: String,
        /// What the code generator says.
        reason: String,
    },
    /// The processor or the system's memory does not allow it.
    Machine(String),
}

impl std::fmt::Display for JitError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Verify(error) => write!(f, "the program is not well-formed: {error}"),
            Self::Body { name, reason } => write!(f, "no machine code for `{name}`: {reason}"),
            Self::Machine(reason) => write!(f, "this machine cannot run compiled programs: {reason}"),
        }
    }
}
impl std::error::Error for JitError {}

/// Verifies a program and compiles it for the processor we run on.
///
/// # Errors
/// See [`JitError`].
pub fn compile(program: &Program) -> Result<Code, JitError> {
    compile_for(program, Processor::Host)
}

/// As [`compile`], with the instructions of another processor.
///
/// # Errors
/// See [`JitError`].
pub fn compile_for(program: &Program, processor: Processor) -> Result<Code, JitError> {
    generate(program, Defect::None, processor)
}

/// As [`compile`], with a deliberate mistake in the code.
#[doc(hidden)]
pub fn compile_with(program: &Program, defect: Defect) -> Result<Code, JitError> {
    generate(program, defect, Processor::Host)
}

fn generate(program: &Program, defect: Defect, processor: Processor) -> Result<Code, JitError> {
    takt_ir::verify(program).map_err(JitError::Verify)?;
    let isa = machine::isa(processor)?;
    let pool: Box<[u8]> = program.data.clone().into_boxed_slice();
    let families = program.families.clone().into_boxed_slice();
    let mut rows: Box<[usize]> = program.dispatch.iter().flat_map(|method| &method.targets).map(|_| 0).collect();
    let tables = tables(program, &pool, &rows, &families);
    let mut functions = machine::bodies(program, &*isa, &tables, defect)?;
    let frames: Vec<usize> = functions.iter().map(|f| f.frame).collect();
    // The bodies keep their numbers; behind them stand the slow path of polls and the ways in.
    functions.push(machine::slow_poll(&*isa, FuncId::from_u32(functions.len() as u32))?);
    let mut ways: Vec<(Option<Ty>, usize)> = Vec::new();
    for body in program.bodies.iter().filter(|body| enterable(body)) {
        if ways.iter().all(|(result, _)| *result != body.result) {
            ways.push((body.result, functions.len()));
            functions.push(machine::entry(&*isa, body.result, FuncId::from_u32(functions.len() as u32))?);
        }
    }
    let size = functions.iter().map(|f| f.bytes.len()).sum();
    let (module, addresses) = link(isa, &functions)?;
    for (row, target) in rows.iter_mut().zip(program.dispatch.iter().flat_map(|method| &method.targets)) {
        *row = target.map_or(0, |body| addresses[body.0 as usize]);
    }
    let bodies = program.bodies.iter().zip(&addresses).map(|(body, &address)| {
        let way = ways.iter().find(|(result, _)| enterable(body) && *result == body.result);
        Entry { address, by: way.map(|(_, i)| addresses[*i]), site: body.entry_site.0 }
    });
    let image_size = program.image_size.into();
    Ok(Code {
        bodies: bodies.collect(),
        image_size,
        size,
        stack: StackUse::new(program, &frames),
        module: Mutex::new(Some(module)),
        _pool: pool,
        _rows: rows,
        _families: families,
        classes: !program.classes.is_empty(),
    })
}

/// Where machine code finds the tables; they are boxed and do not move.
fn tables(program: &Program, pool: &[u8], rows: &[usize], families: &[takt_ir::Family]) -> Tables {
    let starts = program.dispatch.iter().scan(0, |start, method| {
        *start += method.targets.len();
        Some(*start - method.targets.len())
    });
    Tables { pool: pool.as_ptr() as usize, rows: rows.as_ptr() as usize, starts: starts.collect(), families: families.as_ptr() as usize }
}

/// Whether a body can be run from outside: without parameters, with a result that is a value.
fn enterable(body: &Body) -> bool {
    body.params == 0 && !matches!(body.result, Some(Ty::Addr(_)))
}

/// Places functions beside each other and connects them; addresses in order.
fn link(isa: cranelift_codegen::isa::OwnedTargetIsa, functions: &[Compiled]) -> Result<(JITModule, Vec<usize>), JitError> {
    let machine = |reason: String| JitError::Machine(reason);
    let room: usize = functions.iter().map(|f| f.bytes.len() + 64).sum();
    let arena = ArenaMemoryProvider::new_with_size(room + (64 << 10)).map_err(|e| machine(e.to_string()))?;
    let mut builder = JITBuilder::with_isa(isa, default_libcall_names());
    builder.memory_provider(Box::new(arena));
    let names = default_libcall_names();
    // Processors without the rounding instructions call the same functions as the interpreter.
    for (call, op) in ROUNDING {
        builder.symbol(names(call), op.address());
    }
    let mut module = JITModule::new(builder);
    let signature = Signature::new(machine::BETWEEN);
    let mut ids = Vec::with_capacity(functions.len());
    for _ in functions {
        ids.push(module.declare_anonymous_function(&signature).map_err(|e| machine(e.to_string()))?);
    }
    for (id, function) in ids.iter().zip(functions) {
        module.define_function_bytes(*id, function.align, &function.bytes, &function.relocations).map_err(|e| machine(e.to_string()))?;
    }
    module.finalize_definitions().map_err(|e| machine(e.to_string()))?;
    let addresses = ids.iter().map(|id| module.get_finalized_function(*id) as usize).collect();
    Ok((module, addresses))
}

const ROUNDING: [(LibCall, Op); 6] = [
    (LibCall::FloorF64, Op::FloorF64),
    (LibCall::FloorF32, Op::FloorF32),
    (LibCall::CeilF64, Op::CeilF64),
    (LibCall::CeilF32, Op::CeilF32),
    (LibCall::TruncF64, Op::TruncF64),
    (LibCall::TruncF32, Op::TruncF32),
];

/// A compiled program. Its memory is executable, never writable, and freed when it is dropped.
pub struct Code {
    bodies: Vec<Entry>,
    image_size: u64,
    size: usize,
    stack: StackUse,
    /// Owner of the memory; touched only to free it (the lock lets `Code` be shared between threads).
    module: Mutex<Option<JITModule>>,
    /// Constants, at a fixed address; machine code reads them.
    _pool: Box<[u8]>,
    /// Addresses of the bodies of methods, likewise.
    _rows: Box<[usize]>,
    /// Types that are asked for at run time, likewise.
    _families: Box<[takt_ir::Family]>,
    /// Whether a context must have a table of instances.
    classes: bool,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    address: usize,
    /// The function that leads from Rust into it; `None` with parameters.
    by: Option<usize>,
    site: u32,
}

impl std::fmt::Debug for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Code({} bodies, {} bytes)", self.bodies.len(), self.size)
    }
}

type Way = unsafe extern "C" fn(ctx: *mut Context, image: *mut u8, frame: *mut u8, target: usize, result: *mut u64) -> u32;

impl Code {
    /// Runs a body on the image of `ctx`: 0, or the code of the fault that ended it, with facts, site and call stack in `ctx`, as [`takt_ir::run_body`].
    ///
    /// `frame` is the offset at which the body's frame starts. `ctx.image` must point to `ctx.image_size` live bytes that nobody else touches meanwhile,
    /// `ctx.env` to a live environment. The thread must have [`Code::native_stack_bound`] bytes of stack left. A body with parameters, an image of
    /// another size than the program's or a frame outside it is [`Fault::Panic`].
    pub fn run(&self, body: BodyId, frame: u64, ctx: &mut Context) -> u32 {
        self.call(body, frame, ctx).map_or_else(|code| code, |_| 0)
    }

    /// As [`Code::run`], with what the body returns as a word (0 if nothing; which NaN a float is may differ from
    /// the interpreter's).
    ///
    /// # Errors
    /// The code of the fault.
    pub fn call(&self, body: BodyId, frame: u64, ctx: &mut Context) -> Result<u64, u32> {
        let Some((entry, by)) = self.bodies.get(body.0 as usize).and_then(|e| Some((e, e.by?))) else {
            return Err(ctx.fail(Fault::Panic, 0));
        };
        let table = !self.classes || !ctx.classes.is_null();
        let fits = table
            && ctx.image_size == self.image_size
            && frame <= ctx.image_size
            && ctx.stack_end <= ctx.image_size
            && !ctx.image.is_null();
        if !fits {
            return Err(ctx.fail(Fault::Panic, entry.site));
        }
        let (image, mut result) = (ctx.image, 0);
        #[allow(unsafe_code, reason = "the way into machine code")]
        // SAFETY: `by` is the finalized entry function for the result type of the body at `address`; both live as long as `self`. The image has the size
        // that the program was compiled for and `frame` lies inside; machine code reaches nothing but it, `ctx` and `result`.
        let code = unsafe { std::mem::transmute::<usize, Way>(by)(ctx, image, image.add(frame as usize), entry.address, &mut result) };
        if code == 0 { Ok(result) } else { Err(code) }
    }

    /// Bytes of machine code.
    pub fn code_size(&self) -> usize {
        self.size
    }

    /// Bytes of native stack that one run can use at the most when recursion is at most `depth_limit` deep, [`crate::NATIVE_STACK`] for native functions
    /// included. A task that preempts another at a poll needs its own share on top.
    pub fn native_stack_bound(&self, depth_limit: u32) -> usize {
        self.stack.bound(depth_limit)
    }
}

impl Drop for Code {
    fn drop(&mut self) {
        if let Some(module) = self.module.get_mut().ok().and_then(Option::take) {
            #[allow(unsafe_code, reason = "nobody else holds the addresses")]
            // SAFETY: addresses leave this value only for the length of a borrow of it, so none of its functions is running.
            unsafe {
                module.free_memory();
            }
        }
    }
}
