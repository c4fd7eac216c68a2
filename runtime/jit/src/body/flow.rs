//! Blocks, calls, polls and the entry of a body.

use super::{Cold, Lowering, register, signature};
use crate::defect::Defect;
use crate::machine;
use crate::runtime;
use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{
    self, ExtFuncData, ExternalName, FuncRef, InstBuilder, Signature, StackSlotData, StackSlotKind, UserExternalName, Value, types,
};
use cranelift_frontend::Switch;
use std::mem::offset_of;
use takt_abi::Context;
use takt_ir::{BlockId, BodyId, Local, NativeId, SiteId, Term, Ty};

/// From this many labels on, a table of jumps replaces the tree of comparisons where labels are dense.
const TABLE: usize = 64;

const FUEL: i32 = offset_of!(Context, fuel) as i32;
pub(super) const DEPTH: i32 = offset_of!(Context, depth) as i32;
const DEPTH_LIMIT: i32 = offset_of!(Context, depth_limit) as i32;
const STACK_END: i32 = offset_of!(Context, stack_end) as i32;
pub(super) const FAULT_CODE: i32 = offset_of!(Context, fault_code) as i32;
// The atomic load of the flag takes no offset.
const _: () = assert!(offset_of!(Context, flag) == 0);

/// Where a block goes on.
pub(super) fn targets(term: &Term) -> Vec<BlockId> {
    match term {
        Term::Jump(target) => vec![*target],
        Term::Branch { then, other, .. } => vec![*then, *other],
        Term::Switch { cases, default, .. } => cases.iter().map(|(_, target)| *target).chain([*default]).collect(),
        Term::Return(_) | Term::Fault(..) | Term::Rethrow(_) => Vec::new(),
    }
}

impl Lowering<'_, '_> {
    /// Turns to a block.
    pub(super) fn open(&mut self, block: usize, handler: Option<BlockId>) {
        self.handler = handler;
        self.b.switch_to_block(self.blocks[block]);
    }
    /// One more branch to a block is done; after the last one it is sealed, so that constants are seen across blocks.
    pub(super) fn reached(&mut self, block: usize) {
        self.missing[block] -= 1;
        if self.missing[block] == 0 {
            self.b.seal_block(self.blocks[block]);
        }
    }

    /// Ends a block.
    pub(super) fn close(&mut self, term: &Term) {
        match term {
            Term::Jump(target) => {
                self.b.ins().jump(self.blocks[target.0 as usize], &[]);
            }
            Term::Branch { cond, then, other } => {
                let mut cond = self.get(*cond);
                if self.is(Defect::BranchByte) {
                    cond = self.b.ins().ireduce(types::I8, cond);
                }
                self.b.ins().brif(cond, self.blocks[then.0 as usize], &[], self.blocks[other.0 as usize], &[]);
            }
            Term::Switch { value, cases, default } => self.switch(*value, cases, *default),
            Term::Return(result) => self.return_(*result),
            Term::Rethrow(code) => {
                let code = self.get(*code);
                let code = self.call_host(runtime::again as *const u8 as usize, &[self.ctx, code], Some(types::I32));
                self.fail(code, self.handler);
            }
            Term::Fault(fault, site) => {
                let facts = fault.facts().map(|fact| self.int(fact));
                let (site, code) = (i64::from(site.0), i64::from(fault.code()));
                let (site, code) = (self.b.ins().iconst(types::I32, site), self.b.ins().iconst(types::I32, code));
                let args = [self.ctx, site, code, facts[0], facts[1], facts[2]];
                let code = self.call_host(runtime::stated as *const u8 as usize, &args, Some(types::I32));
                self.fail(code, self.handler);
            }
        }
        for target in targets(term) {
            self.reached(target.0 as usize);
        }
    }

    fn return_(&mut self, result: Option<Local>) {
        if self.body.recursive && !self.is(Defect::DepthKept) {
            let depth = self.b.ins().load(types::I32, self.ctx_flags, self.ctx, DEPTH);
            let depth = self.b.ins().iadd_imm_s(depth, -1);
            self.b.ins().store(self.ctx_flags, depth, self.ctx, DEPTH);
        }
        let mut values = vec![self.b.ins().iconst(types::I32, 0)];
        if let Some(ty) = self.body.result {
            values.push(match result {
                Some(local) => self.get(local),
                None => self.zero(register(ty)),
            });
        }
        self.b.ins().return_(&values);
    }

    fn switch(&mut self, value: Local, cases: &[(i64, BlockId)], default: BlockId) {
        let value = self.get(value);
        let mut cases: Vec<(i64, ir::Block)> = cases.iter().map(|(label, block)| (*label, self.blocks[block.0 as usize])).collect();
        if self.is(Defect::SwitchDefault) {
            cases.pop();
        }
        cases.sort_by_key(|(label, _)| *label);
        let default = self.blocks[default.0 as usize];
        if cases.len() < TABLE {
            return self.search(value, &cases, default);
        }
        let mut switch = Switch::new();
        for (label, block) in cases {
            switch.set_entry(u128::from(label as u64), block);
        }
        switch.emit(&mut self.b, value, default);
    }
    /// A tree of comparisons over sorted labels.
    fn search(&mut self, value: Value, cases: &[(i64, ir::Block)], default: ir::Block) {
        if cases.len() <= 3 {
            for (label, block) in cases {
                let hit = self.b.ins().icmp_imm_s(IntCC::Equal, value, *label);
                let next = self.b.create_block();
                self.b.ins().brif(hit, *block, &[], next, &[]);
                self.b.switch_to_block(next);
                self.b.seal_block(next);
            }
            self.b.ins().jump(default, &[]);
            return;
        }
        let (low, high) = cases.split_at(cases.len() / 2);
        let below = self.b.ins().icmp_imm_s(IntCC::SignedLessThan, value, high[0].0);
        let halves = [self.b.create_block(), self.b.create_block()];
        self.b.ins().brif(below, halves[0], &[], halves[1], &[]);
        for (block, half) in halves.into_iter().zip([low, high]) {
            self.b.switch_to_block(block);
            self.b.seal_block(block);
            self.search(value, half, default);
        }
    }

    /// What the IR counts at the entry of a body: frame, depth, fuel.
    pub(super) fn admit(&mut self) {
        let site = self.body.entry_site;
        if self.body.frame_size > 0 {
            let end = self.b.ins().iadd_imm_s(self.frame, i64::from(self.body.frame_size));
            let end = self.b.ins().isub(end, self.image);
            let limit = if self.is(Defect::FrameUnchecked) {
                self.int(i64::from(self.program.image_size))
            } else {
                self.b.ins().load(types::I64, self.ctx_flags, self.ctx, STACK_END)
            };
            let outside = self.compare(IntCC::UnsignedGreaterThan, end, limit);
            self.fault_if(outside, Cold::Overflow, site, &[]);
        }
        if !self.body.recursive {
            return;
        }
        let depth = self.b.ins().load(types::I32, self.ctx_flags, self.ctx, DEPTH);
        let limit = self.b.ins().load(types::I32, self.ctx_flags, self.ctx, DEPTH_LIMIT);
        let late = if self.is(Defect::DepthLate) { IntCC::UnsignedGreaterThan } else { IntCC::UnsignedGreaterThanOrEqual };
        let outside = self.compare(late, depth, limit);
        self.fault_if(outside, Cold::Overflow, site, &[]);
        let depth = self.b.ins().iadd_imm_s(depth, 1);
        self.b.ins().store(self.ctx_flags, depth, self.ctx, DEPTH);
        if !self.is(Defect::EntryFree) {
            self.poll(1, site);
        }
    }

    pub(super) fn poll(&mut self, cost: u32, site: SiteId) {
        let cost = if self.is(Defect::CostIgnored) { 1 } else { cost };
        let fuel = self.b.ins().load(types::I64, self.ctx_flags, self.ctx, FUEL);
        let fuel = self.b.ins().iadd_imm_s(fuel, -i64::from(cost));
        self.b.ins().store(self.ctx_flags, fuel, self.ctx, FUEL);
        let fuel = if self.is(Defect::PollLate) { self.b.ins().iadd_imm_s(fuel, 64) } else { fuel };
        let used_up = self.b.ins().ushr_imm_u(fuel, 63);
        let asks = if self.is(Defect::FlagIgnored) {
            used_up
        } else {
            let flag = self.b.ins().atomic_load(types::I32, self.ctx_flags, self.ctx);
            let flag = self.b.ins().uextend(types::I64, flag);
            self.b.ins().bor(used_up, flag)
        };
        let (slow, next) = (self.b.create_block(), self.b.create_block());
        self.b.set_cold_block(slow);
        self.b.ins().brif(asks, slow, &[], next, &[]);
        self.b.switch_to_block(slow);
        self.b.seal_block(slow);
        let callee = self.slow_poll();
        let place = self.b.ins().iconst(types::I32, i64::from(site.0));
        self.b.ins().call(callee, &[self.ctx, place]);
        let code = self.b.ins().load(types::I32, self.ctx_flags, self.ctx, FAULT_CODE);
        let (cold, args) = self.cold_target(Cold::Stopped, site, &[code]);
        self.b.ins().brif(code, cold, &args, next, &[]);
        self.b.switch_to_block(next);
        self.b.seal_block(next);
    }

    pub(super) fn call(&mut self, body: BodyId, args: &[Local], dst: Option<Local>, site: SiteId) {
        let callee = self.callee(body);
        let frame = self.next_frame();
        let mut values = vec![self.ctx, self.image, frame];
        values.extend(args.iter().map(|arg| self.b.use_var(self.locals[arg.0 as usize])));
        if let (Defect::ArgumentsSwapped, [a, b, ..]) = (self.defect, args)
            && (self.ty(*a), self.ty(*b)) == (Ty::I64, Ty::I64)
        {
            values.swap(3, 4);
        }
        let call = self.b.ins().call(callee, &values);
        self.returned(call, dst, site);
    }
    /// Where the frame of a callee starts.
    pub(super) fn next_frame(&mut self) -> Value {
        let behind = if self.is(Defect::FrameShared) { 0 } else { i64::from(self.body.frame_size) };
        if behind == 0 { self.frame } else { self.b.ins().iadd_imm_s(self.frame, behind) }
    }
    /// Back from a call: the fault goes on outwards, the result into its local.
    pub(super) fn returned(&mut self, call: ir::Inst, dst: Option<Local>, site: SiteId) {
        let results = self.b.inst_results(call).to_vec();
        self.fault_if(results[0], Cold::Caller, site, &results[..1]);
        if let (Some(dst), Some(value)) = (dst, results.get(1))
            && !self.is(Defect::ResultLost)
        {
            self.set(dst, *value);
        }
    }
    fn callee(&mut self, body: BodyId) -> FuncRef {
        let ours = &self.program.bodies[body.0 as usize];
        self.function(body.0, || signature(&ours.locals[..ours.params as usize], ours.result))
    }
    /// The function behind the bodies.
    fn slow_poll(&mut self) -> FuncRef {
        self.function(self.program.bodies.len() as u32, machine::slow_poll_signature)
    }
    /// A function of this program by its number.
    fn function(&mut self, id: u32, signature: impl FnOnce() -> Signature) -> FuncRef {
        if let Some((_, reference)) = self.callees.iter().find(|(known, _)| *known == id) {
            return *reference;
        }
        let signature = self.b.import_signature(signature());
        let name = self.b.func.declare_imported_user_function(UserExternalName::new(0, id));
        let data = ExtFuncData { name: ExternalName::user(name), signature, colocated: true, patchable: false };
        let reference = self.b.import_function(data);
        self.callees.push((id, reference));
        reference
    }

    pub(super) fn native(&mut self, native: NativeId, args: &[Local], dst: Option<Local>, site: SiteId) {
        let bytes = 8 * (args.len() as u32 + 1);
        let slot = match self.words {
            Some(slot) => slot,
            None => self.b.create_sized_stack_slot(StackSlotData::new(StackSlotKind::ExplicitSlot, bytes, 3)),
        };
        self.words = Some(slot);
        let slot_size = &mut self.b.func.sized_stack_slots[slot].size;
        *slot_size = bytes.max(*slot_size);
        for (i, arg) in args.iter().enumerate() {
            let word = self.word(*arg);
            self.b.ins().stack_store(types::I64, word, slot, 8 * i as i32);
        }
        let last = self.int(0);
        self.b.ins().stack_store(types::I64, last, slot, 8 * args.len() as i32);
        let words = self.b.ins().stack_addr(types::I64, slot, 0);
        let target = self.program.natives[native.0 as usize].call as *const u8 as usize;
        let code = self.call_host(target, &[self.ctx, words], Some(types::I32));
        self.fault_if(code, Cold::Stopped, site, &[code]);
        if let Some(dst) = dst.filter(|_| !self.is(Defect::NativeResultLost)) {
            let ty = register(self.ty(dst));
            let value = self.b.ins().stack_load(types::I64, ty, slot, 0);
            self.set(dst, value);
        }
    }
    /// A local as a word: addresses as offsets, floats by their bits, NaN canonical.
    fn word(&mut self, local: Local) -> Value {
        let value = self.get(local);
        match self.ty(local) {
            Ty::I64 => value,
            Ty::Addr(_) => self.b.ins().isub(value, self.image),
            Ty::F64 => self.canonical(value),
            Ty::F32 => {
                let value = self.canonical(value);
                let bits = self.b.ins().bitcast(types::I32, ir::MemFlagsData::new(), value);
                self.b.ins().uextend(types::I64, bits)
            }
        }
    }
}
