//! The processor that code is made for, and the threads that make it.

use crate::body::{self, Tables};
use crate::code::JitError;
use crate::defect::Defect;
use crate::place;
use cranelift_codegen::Context;
use cranelift_codegen::control::ControlPlane;
use cranelift_codegen::ir::{AbiParam, Function, InstBuilder, MemFlagsData, Signature, UserFuncName, types};
use cranelift_codegen::isa::{CallConv, OwnedTargetIsa, TargetIsa};
use cranelift_codegen::settings::{self, Configurable};
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext};
use cranelift_module::{FuncId, ModuleReloc, ModuleRelocTarget};
use std::mem::offset_of;
use takt_ir::{Program, Ty};

/// Instructions of the IR from which a second thread is worth its start.
const PARALLEL: usize = 4000;

/// A function of machine code before it has a place.
pub(crate) struct Compiled {
    pub(crate) bytes: Vec<u8>,
    pub(crate) align: u64,
    pub(crate) relocations: Vec<ModuleReloc>,
    /// Bytes of stack that one activation takes.
    pub(crate) frame: usize,
}

/// Which instructions machine code may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Processor {
    /// All of the processor we run on.
    #[default]
    Host,
    /// Those that any processor of its architecture has: x86-64-v2 (no AVX, FMA, BMI), the base of aarch64. The results are the same, bit for bit.
    Common,
}

/// The processor we run on, with our settings.
pub(crate) fn isa(processor: Processor) -> Result<OwnedTargetIsa, JitError> {
    let mut flags = settings::builder();
    let verifier = if cfg!(debug_assertions) { "true" } else { "false" };
    let wanted = [
        ("opt_level", "speed"),
        ("is_pic", "false"),
        ("use_colocated_libcalls", "false"),
        ("enable_verifier", verifier),
        ("preserve_frame_pointers", "true"),
        ("enable_probestack", "true"),
        ("probestack_strategy", "inline"),
        ("unwind_info", "false"),
        ("machine_code_cfg_info", "true"),
    ];
    for (name, value) in wanted {
        flags.set(name, value).map_err(|e| JitError::Machine(e.to_string()))?;
    }
    let host = processor == Processor::Host;
    let mut builder = cranelift_native::builder_with_options(host).map_err(|e| JitError::Machine(e.to_string()))?;
    if !host && cfg!(target_arch = "x86_64") {
        builder.enable("x86-64-v2").map_err(|e| JitError::Machine(e.to_string()))?;
    }
    builder.finish(settings::Flags::new(flags)).map_err(|e| JitError::Machine(e.to_string()))
}

/// Machine code of all bodies, in order.
pub(crate) fn bodies(program: &Program, isa: &dyn TargetIsa, tables: &Tables, defect: Defect) -> Result<Vec<Compiled>, JitError> {
    let count = program.bodies.len();
    let size: usize = program.bodies.iter().flat_map(|b| &b.blocks).map(|b| b.insts.len() + 1).sum();
    let threads = if size < PARALLEL { 1 } else { std::thread::available_parallelism().map_or(1, |n| n.get().min(8)) };
    let share = |first: usize| -> Vec<(usize, Result<Compiled, JitError>)> {
        let mut maker = Maker::new(isa);
        (first..count).step_by(threads).map(|i| (i, maker.body(program, i, tables, defect))).collect()
    };
    let mut all: Vec<(usize, Result<Compiled, JitError>)> = if threads == 1 {
        share(0)
    } else {
        std::thread::scope(|scope| {
            let share = &share;
            let workers: Vec<_> = (0..threads).map(|first| scope.spawn(move || share(first))).collect();
            workers.into_iter().flat_map(|w| w.join().unwrap_or_default()).collect()
        })
    };
    all.sort_by_key(|(i, _)| *i);
    if all.len() < count {
        return Err(JitError::Machine("a thread of the code generator ended early".into()));
    }
    all.into_iter().map(|(_, code)| code).collect()
}

/// The way from Rust into a body without parameters: `extern "C" fn(ctx, image, frame, target, result: *mut u64) -> u32`.
pub(crate) fn entry(isa: &dyn TargetIsa, result: Option<Ty>, id: FuncId) -> Result<Compiled, JitError> {
    let mut maker = Maker::new(isa);
    let mut signature = Signature::new(isa.default_call_conv());
    signature.params.extend([AbiParam::new(types::I64); 5]);
    signature.returns.push(AbiParam::new(types::I32));
    maker.context.func = Function::with_name_signature(UserFuncName::user(0, id.as_u32()), signature);
    let mut b = FunctionBuilder::new(&mut maker.context.func, &mut maker.builder);
    let block = b.create_block();
    b.append_block_params_for_function_params(block);
    b.switch_to_block(block);
    b.seal_all_blocks();
    let params = b.block_params(block).to_vec();
    let callee = b.import_signature(body::signature(&[], result));
    let call = b.ins().call_indirect(callee, params[3], &params[..3]);
    let results = b.inst_results(call).to_vec();
    if let Some(value) = results.get(1) {
        b.ins().store(MemFlagsData::trusted(), *value, params[4], 0);
    }
    b.ins().return_(&results[..1]);
    b.finalize(isa.frontend_config());
    maker.emit("entry", id)
}

/// The slow path of a poll, for bodies to call: `fn(ctx, site)` that leaves every register as it was and the status of [`Context::poll`] in
/// `ctx.fault_code`. So a poll in a loop costs no register.
///
/// [`Context::poll`]: takt_abi::Context
pub(crate) fn slow_poll(isa: &dyn TargetIsa, id: FuncId) -> Result<Compiled, JitError> {
    let mut maker = Maker::new(isa);
    maker.context.func = Function::with_name_signature(UserFuncName::user(0, id.as_u32()), slow_poll_signature());
    let mut b = FunctionBuilder::new(&mut maker.context.func, &mut maker.builder);
    let block = b.create_block();
    b.append_block_params_for_function_params(block);
    b.switch_to_block(block);
    b.seal_all_blocks();
    let params = b.block_params(block).to_vec();
    let mut signature = Signature::new(isa.default_call_conv());
    signature.params.extend([AbiParam::new(types::I64), AbiParam::new(types::I32)]);
    signature.returns.push(AbiParam::new(types::I32));
    let callee = b.import_signature(signature);
    let target = b.ins().load(types::I64, MemFlagsData::trusted(), params[0], offset_of!(takt_abi::Context, poll) as i32);
    let call = b.ins().call_indirect(callee, target, &params);
    let code = b.inst_results(call)[0];
    b.ins().store(MemFlagsData::trusted(), code, params[0], offset_of!(takt_abi::Context, fault_code) as i32);
    b.ins().return_(&[]);
    b.finalize(isa.frontend_config());
    maker.emit("poll", id)
}

/// The signature of [`slow_poll`].
pub(crate) fn slow_poll_signature() -> Signature {
    let mut signature = Signature::new(CallConv::PreserveAll);
    signature.params.extend([AbiParam::new(types::I64), AbiParam::new(types::I32)]);
    signature
}

/// Memory of the code generator, used again for each function.
struct Maker<'a> {
    isa: &'a dyn TargetIsa,
    context: Context,
    builder: FunctionBuilderContext,
}

impl<'a> Maker<'a> {
    fn new(isa: &'a dyn TargetIsa) -> Self {
        Self { isa, context: Context::new(), builder: FunctionBuilderContext::new() }
    }
    fn body(&mut self, program: &Program, i: usize, tables: &Tables, defect: Defect) -> Result<Compiled, JitError> {
        let ours = &program.bodies[i];
        let signature = body::signature(&ours.locals[..ours.params as usize], ours.result);
        self.context.func = Function::with_name_signature(UserFuncName::user(0, i as u32), signature);
        let b = FunctionBuilder::new(&mut self.context.func, &mut self.builder);
        body::lower(program, ours, b, self.isa, tables, defect);
        self.emit(&ours.name, FuncId::from_u32(i as u32))
    }
    fn emit(&mut self, name: &str, id: FuncId) -> Result<Compiled, JitError> {
        let result = self.context.compile(self.isa, &mut ControlPlane::default());
        let done = match result {
            Err(e) => Err(JitError::Body { name: name.into(), reason: format!("{:?}", e.inner) }),
            Ok(code) => Ok((code.code_buffer().to_vec(), u64::from(code.buffer.alignment), frame_size(code))),
        };
        let done = done.map(|(bytes, align, frame)| {
            let relocations = self.context.compiled_code().map_or(&[][..], |c| c.buffer.relocs());
            let relocations = relocations.iter().map(|r| ModuleReloc::from_mach_reloc(r, &self.context.func, id)).collect();
            let shift = self.context.compiled_code().map_or(0, |c| place::shift(&c.bb_starts, &c.bb_edges, bytes.len() as u32));
            shifted(Compiled { bytes, align, relocations, frame }, shift)
        });
        self.context.clear();
        done
    }
}

/// The function moved by `shift` bytes within its cache line.
fn shifted(function: Compiled, shift: u32) -> Compiled {
    let fixed = function.relocations.iter().any(|r| matches!(r.name, ModuleRelocTarget::FunctionOffset(..)));
    let Some(mut bytes) = place::padding(shift).filter(|_| shift > 0 && !fixed) else { return function };
    bytes.extend_from_slice(&function.bytes);
    let mut relocations = function.relocations;
    for relocation in &mut relocations {
        relocation.offset += shift;
    }
    Compiled { bytes, align: function.align.max(place::LINE.into()), relocations, frame: function.frame }
}

/// Return address, frame pointer, saved registers, slots and outgoing arguments, rounded up.
fn frame_size(code: &cranelift_codegen::CompiledCode) -> usize {
    code.buffer.frame_layout().map_or(0, |layout| layout.frame_to_fp_offset as usize) + 48
}

/// The calling convention between bodies.
pub(crate) const BETWEEN: CallConv = CallConv::Fast;
