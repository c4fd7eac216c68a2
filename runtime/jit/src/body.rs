//! One body of the IR to one function of Cranelift's.
//!
//! The function takes the context, the image's address, the frame's address and the parameters, and returns a status (0, or the code of a fault) and the
//! result. Locals are Cranelift variables; an address is a machine address. What can fail branches to a cold block at the end of the function, one for
//! each kind of fault, that calls [`crate::runtime`] and returns its code.

mod dispatch;
mod flow;
mod memory;
mod operator;

use crate::defect::Defect;
use crate::machine::BETWEEN;
use crate::runtime;
use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{
    self, AbiParam, AliasRegionData, BlockArg, FuncRef, InstBuilder, MemFlagsData, SigRef, Signature, StackSlot, Type, Value, types,
};
use cranelift_codegen::isa::{CallConv, TargetIsa};
use cranelift_frontend::{FunctionBuilder, Variable};
use takt_abi::Fault;
use takt_ir::{BlockId, Body, Const, Inst, Local, Program, SiteId, Ty};

/// The signature of a body with parameters and result of these types.
pub(crate) fn signature(params: &[Ty], result: Option<Ty>) -> Signature {
    let mut signature = Signature::new(BETWEEN);
    signature.params.extend([AbiParam::new(types::I64); 3]);
    signature.params.extend(params.iter().map(|ty| AbiParam::new(register(*ty))));
    signature.returns.push(AbiParam::new(types::I32));
    signature.returns.extend(result.map(|ty| AbiParam::new(register(ty))));
    signature
}

/// The type of the register that holds a local.
fn register(ty: Ty) -> Type {
    match ty {
        Ty::I64 | Ty::Addr(_) => types::I64,
        Ty::F32 => types::F32,
        Ty::F64 => types::F64,
    }
}

/// Fills the function of `builder` with `body`.
pub(crate) fn lower(program: &Program, body: &Body, builder: FunctionBuilder<'_>, isa: &dyn TargetIsa, tables: &Tables, defect: Defect) {
    let mut lowering = Lowering::new(program, body, builder, isa, tables, defect);
    lowering.enter();
    for (i, block) in body.blocks.iter().enumerate() {
        lowering.open(i, block.handler);
        for inst in &block.insts {
            lowering.inst(inst);
        }
        lowering.close(&block.term);
    }
    lowering.cold_blocks();
    lowering.b.seal_all_blocks();
    lowering.b.finalize(isa.frontend_config());
}

/// Tables of the program that machine code reads, by address.
#[derive(Debug)]
pub(crate) struct Tables {
    /// Constant bytes.
    pub(crate) pool: usize,
    /// Addresses of the bodies of all methods, one row behind the other.
    pub(crate) rows: usize,
    /// Where the row of each method starts.
    pub(crate) starts: Vec<usize>,
    /// [`takt_ir::Family`]s.
    pub(crate) families: usize,
}

/// The kinds of faults, each with one cold block per handler. Its first parameter is the site.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cold {
    /// value, low, high.
    Index,
    /// offset, size.
    Pointer,
    /// offset.
    Instance,
    Division,
    Overflow,
    /// code.
    Stopped,
    /// code.
    Caller,
}

impl Cold {
    /// Types behind the site.
    fn params(self) -> &'static [Type] {
        match self {
            Self::Index => &[types::I64, types::I64, types::I64],
            Self::Pointer => &[types::I64, types::I64],
            Self::Instance => &[types::I64],
            Self::Division | Self::Overflow => &[],
            Self::Stopped | Self::Caller => &[types::I32],
        }
    }
    /// What it calls.
    fn address(self) -> usize {
        match self {
            Self::Index => runtime::index as *const u8 as usize,
            Self::Pointer => runtime::pointer as *const u8 as usize,
            Self::Instance => runtime::instance as *const u8 as usize,
            Self::Division => runtime::division as *const u8 as usize,
            Self::Overflow => runtime::overflow as *const u8 as usize,
            Self::Stopped => runtime::stopped as *const u8 as usize,
            Self::Caller => runtime::caller as *const u8 as usize,
        }
    }
}

struct Lowering<'a, 'f> {
    program: &'a Program,
    body: &'a Body,
    b: FunctionBuilder<'f>,
    defect: Defect,
    /// The calling convention of Rust's `extern "C"`.
    host: CallConv,
    tables: &'a Tables,
    ctx: Value,
    image: Value,
    frame: Value,
    locals: Vec<Variable>,
    blocks: Vec<ir::Block>,
    /// Branches to each block that have not been made yet; at 0 it is sealed.
    missing: Vec<usize>,
    /// Where a fault in the block under way leads.
    handler: Option<BlockId>,
    cold: Vec<(Cold, Option<BlockId>, ir::Block)>,
    /// Words of native calls.
    words: Option<StackSlot>,
    callees: Vec<(u32, FuncRef)>,
    signatures: Vec<(Signature, SigRef)>,
    image_flags: MemFlagsData,
    ctx_flags: MemFlagsData,
}

impl<'a, 'f> Lowering<'a, 'f> {
    fn new(
        program: &'a Program,
        body: &'a Body,
        mut b: FunctionBuilder<'f>,
        isa: &dyn TargetIsa,
        tables: &'a Tables,
        defect: Defect,
    ) -> Self {
        let mut flags = |user_id: u32, description: &'static str| {
            let region = b.func.dfg.alias_regions.insert(AliasRegionData { user_id, description: description.into() });
            MemFlagsData::new().with_notrap().with_alias_region(Some(region))
        };
        let (image_flags, ctx_flags) = (flags(1, "image"), flags(2, "context").with_aligned());
        let locals = body.locals.iter().map(|ty| b.declare_var(register(*ty))).collect();
        let blocks = body.blocks.iter().map(|_| b.create_block()).collect();
        let entry = b.create_block();
        b.append_block_params_for_function_params(entry);
        b.switch_to_block(entry);
        b.seal_block(entry);
        let (ctx, image, frame) = (b.block_params(entry)[0], b.block_params(entry)[1], b.block_params(entry)[2]);
        let mut missing = vec![0; body.blocks.len()];
        missing[0] = 1;
        for target in body.blocks.iter().flat_map(|block| flow::targets(&block.term).into_iter().chain(block.handler)) {
            missing[target.0 as usize] += 1;
        }
        let host = isa.default_call_conv();
        let (cold, words, callees, signatures) = (Vec::new(), None, Vec::new(), Vec::new());
        Self {
            program,
            body,
            b,
            defect,
            host,
            tables,
            ctx,
            image,
            frame,
            locals,
            blocks,
            missing,
            handler: None,
            cold,
            words,
            callees,
            signatures,
            image_flags,
            ctx_flags,
        }
    }

    fn is(&self, defect: Defect) -> bool {
        self.defect == defect
    }
    fn ty(&self, local: Local) -> Ty {
        self.body.locals[local.0 as usize]
    }
    fn get(&mut self, local: Local) -> Value {
        self.b.use_var(self.locals[local.0 as usize])
    }
    fn set(&mut self, local: Local, value: Value) {
        self.b.def_var(self.locals[local.0 as usize], value);
    }
    fn int(&mut self, value: i64) -> Value {
        self.b.ins().iconst(types::I64, value)
    }
    fn zero(&mut self, ty: Type) -> Value {
        match ty {
            types::F32 => self.b.ins().f32const(0.0),
            types::F64 => self.b.ins().f64const(0.0),
            ty => self.b.ins().iconst(ty, 0),
        }
    }
    /// The constant behind a value, if it is one in sight.
    fn constant(&self, value: Value) -> Option<i64> {
        let inst = self.b.func.dfg.value_def(value).inst()?;
        match self.b.func.dfg.insts[inst] {
            ir::InstructionData::UnaryImm { opcode: ir::Opcode::Iconst, imm } => Some(imm.bits()),
            _ => None,
        }
    }

    /// The start of the function: parameters, locals, and what the IR counts at an entry.
    fn enter(&mut self) {
        let entry = self.b.current_block();
        let params: Vec<Value> = entry.map(|entry| self.b.block_params(entry)[3..].to_vec()).unwrap_or_default();
        for (variable, value) in self.locals.clone().into_iter().zip(&params) {
            self.b.def_var(variable, *value);
        }
        // Cranelift's front end makes a variable that is read before it is written 0, as the IR wants it.
        if self.is(Defect::LocalsDirty) {
            for local in params.len()..self.locals.len() {
                if self.body.locals[local] == Ty::I64 {
                    let one = self.int(1);
                    self.b.def_var(self.locals[local], one);
                }
            }
        }
        self.admit();
        self.b.ins().jump(self.blocks[0], &[]);
        self.reached(0);
    }

    fn inst(&mut self, inst: &Inst) {
        match inst {
            Inst::Const { dst, value } => {
                let value = match *value {
                    Const::I64(v) => self.int(v),
                    Const::F32(bits) => self.b.ins().f32const(ir::immediates::Ieee32::with_bits(bits)),
                    Const::F64(bits) => self.b.ins().f64const(ir::immediates::Ieee64::with_bits(bits)),
                };
                self.set(*dst, value);
            }
            Inst::Op { op, dst, args, site } => {
                let args: Vec<Value> = args.iter().map(|arg| self.get(*arg)).collect();
                let value = self.operator(*op, &args, *site);
                self.set(*dst, value);
            }
            Inst::Copy { dst, src } => {
                let value = self.get(*src);
                self.set(*dst, value);
            }
            Inst::Load { dst, mem, base, offset } => {
                let value = self.load(*mem, *base, *offset);
                self.set(*dst, value);
            }
            Inst::Store { src, mem, base, offset } => {
                let value = self.get(*src);
                self.store(*mem, value, *base, *offset);
            }
            Inst::Address { dst, base, offset } => {
                let value = self.address(*base, *offset);
                self.set(*dst, value);
            }
            Inst::Index { dst, base, offset, index, low, high, stride, site } => {
                let index = self.get(*index);
                let index = self.bounded(index, *low, *high, *site);
                let value = self.element(*base, *offset, index, *low, *stride);
                self.set(*dst, value);
            }
            Inst::Check { index, low, high, site } => self.check([*index, *low, *high], *site),
            Inst::Deref { dst, pointer, site } => {
                let value = self.deref(*dst, *pointer, *site);
                self.set(*dst, value);
            }
            Inst::Pointer { dst, base, offset } => {
                let address = self.address(*base, *offset);
                let value = self.b.ins().isub(address, self.image);
                self.set(*dst, value);
            }
            Inst::Move { dst, dst_offset, src, src_offset, len } => self.move_bytes((*dst, *dst_offset), (*src, *src_offset), *len),
            Inst::Data { dst, offset, data, len } => self.data((*dst, *offset), *data, *len),
            Inst::Call { body, args, dst, site } => self.call(*body, args, *dst, *site),
            Inst::Native { native, args, dst, site } => self.native(*native, args, *dst, *site),
            Inst::Virtual { method, this, args, dst, site } => self.call_virtual(*method, *this, args, *dst, *site),
            Inst::IsA { dst, pointer, family } => self.is_a(*dst, *pointer, *family),
            Inst::Place { offset, class, count } => self.put_instances(*offset, *class, *count),
            Inst::Guard { dst } => self.guard(*dst),
            Inst::Catch { dst, depth } => self.catch(*dst, *depth),
            Inst::Poll { cost, site } => self.poll(*cost, *site),
        }
    }

    /// Goes to the cold block of `kind` if `condition` is not 0; otherwise on.
    fn fault_if(&mut self, condition: Value, kind: Cold, site: SiteId, facts: &[Value]) {
        let (cold, args) = self.cold_target(kind, site, facts);
        let next = self.b.create_block();
        self.b.ins().brif(condition, cold, &args, next, &[]);
        self.b.switch_to_block(next);
        self.b.seal_block(next);
    }
    /// Goes on if `condition` is not 0; otherwise to the cold block of `kind`.
    fn fault_unless(&mut self, condition: Value, kind: Cold, site: SiteId, facts: &[Value]) {
        let (cold, args) = self.cold_target(kind, site, facts);
        let next = self.b.create_block();
        self.b.ins().brif(condition, next, &[], cold, &args);
        self.b.switch_to_block(next);
        self.b.seal_block(next);
    }
    fn cold_target(&mut self, kind: Cold, site: SiteId, facts: &[Value]) -> (ir::Block, Vec<BlockArg>) {
        let known = self.cold.iter().find(|(k, handler, _)| *k == kind && *handler == self.handler).map(|(.., block)| *block);
        let block = match known {
            Some(block) => block,
            None => {
                let block = self.b.create_block();
                self.b.set_cold_block(block);
                self.b.append_block_param(block, types::I32);
                for ty in kind.params() {
                    self.b.append_block_param(block, *ty);
                }
                self.cold.push((kind, self.handler, block));
                block
            }
        };
        let site = self.b.ins().iconst(types::I32, i64::from(site.0));
        (block, [site].iter().chain(facts).map(|value| BlockArg::Value(*value)).collect())
    }
    /// Fills the cold blocks that were used.
    fn cold_blocks(&mut self) {
        for (kind, handler, block) in std::mem::take(&mut self.cold) {
            self.b.switch_to_block(block);
            let mut args = vec![self.ctx];
            args.extend_from_slice(self.b.block_params(block));
            if kind == Cold::Caller && self.is(Defect::TraceLost) {
                self.leave(args[2]);
                continue;
            }
            let code = self.call_host(kind.address(), &args, Some(types::I32));
            self.fail(code, handler);
        }
    }
    /// Goes to the handler if there is one and the fault is one that a program may handle; otherwise back to the caller.
    fn fail(&mut self, code: Value, handler: Option<BlockId>) {
        let Some(handler) = handler.filter(|_| !self.is(Defect::HandlerIgnored)) else { return self.leave(code) };
        let catchable = (0..32).filter(|code| Fault::catchable(*code)).fold(0i64, |mask, code| mask | 1 << code);
        let mask = self.b.ins().iconst(types::I32, catchable);
        let shifted = self.b.ins().ushr(mask, code);
        let caught = self.b.ins().band_imm_u(shifted, 1);
        let next = self.b.create_block();
        self.b.set_cold_block(next);
        self.b.ins().brif(caught, self.blocks[handler.0 as usize], &[], next, &[]);
        self.b.switch_to_block(next);
        self.leave(code);
    }
    /// Returns the code of a fault.
    fn leave(&mut self, code: Value) {
        let mut values = vec![code];
        if let Some(ty) = self.body.result {
            values.push(self.zero(register(ty)));
        }
        self.b.ins().return_(&values);
    }

    /// Calls a function of Rust's; the result, or the status if it has none.
    fn call_host(&mut self, address: usize, args: &[Value], result: Option<Type>) -> Value {
        let target = self.int(address as i64);
        self.call_indirect(target, args, result)
    }
    fn call_indirect(&mut self, target: Value, args: &[Value], result: Option<Type>) -> Value {
        let mut signature = Signature::new(self.host);
        signature.params.extend(args.iter().map(|arg| AbiParam::new(self.b.func.dfg.value_type(*arg))));
        signature.returns.extend(result.map(AbiParam::new));
        let reference = self.signature_ref(signature);
        let call = self.b.ins().call_indirect(reference, target, args);
        self.b.inst_results(call).first().copied().unwrap_or(target)
    }
    /// The signature in this body, imported once.
    fn signature_ref(&mut self, signature: Signature) -> SigRef {
        if let Some((_, reference)) = self.signatures.iter().find(|(known, _)| *known == signature) {
            return *reference;
        }
        let reference = self.b.import_signature(signature.clone());
        self.signatures.push((signature, reference));
        reference
    }
    fn compare(&mut self, cc: IntCC, a: Value, b: Value) -> Value {
        self.b.ins().icmp(cc, a, b)
    }
}
