//! Calls by the class of an instance, questions about it, and handlers of faults.

use super::flow::{DEPTH, FAULT_CODE};
use super::{Cold, Lowering, signature};
use crate::defect::Defect;
use crate::runtime;
use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{InstBuilder, MemFlagsData, Value, types};
use std::mem::offset_of;
use takt_abi::{Context, GRANULE};
use takt_ir::{Local, SiteId, Ty};

const CLASSES: i32 = offset_of!(Context, classes) as i32;
const TRACE_LEN: i32 = offset_of!(Context, trace_len) as i32;

impl Lowering<'_, '_> {
    pub(super) fn call_virtual(&mut self, method: u32, this: Local, args: &[Local], dst: Option<Local>, site: SiteId) {
        let pointer = self.get(this);
        let target = self.target(method, pointer, site);
        let callee = &self.program.dispatch[method as usize];
        let params: Vec<Ty> = std::iter::once(Ty::Addr(0)).chain(callee.params.iter().copied()).collect();
        let signature = self.signature_ref(signature(&params, callee.result));
        let frame = self.next_frame();
        let instance = self.b.ins().iadd(self.image, pointer);
        let mut values = vec![self.ctx, self.image, frame, instance];
        values.extend(args.iter().map(|arg| self.b.use_var(self.locals[arg.0 as usize])));
        let call = self.b.ins().call_indirect(signature, target, &values);
        self.returned(call, dst, site);
    }

    /// The address of the body that the method has for the instance at `pointer`.
    fn target(&mut self, method: u32, pointer: Value, site: SiteId) -> Value {
        let callee = &self.program.dispatch[method as usize];
        let (low, count) = (i64::from(callee.low), callee.targets.len() as i64);
        let row = self.tables.rows + 8 * self.tables.starts[method as usize];
        let flags = MemFlagsData::trusted().with_readonly();
        // Rotated: an offset between granules becomes huge.
        let granule = self.b.ins().rotr_imm_u(pointer, i64::from(GRANULE.ilog2()));
        let granules = self.int(i64::from(self.program.image_size) / GRANULE as i64);
        let outside = self.compare(IntCC::UnsignedGreaterThanOrEqual, granule, granules);
        self.fault_if(outside, Cold::Instance, site, &[pointer]);
        let table = self.b.ins().load(types::I64, flags, self.ctx, CLASSES);
        let behind = self.b.ins().ishl_imm_u(granule, 2);
        let entry = self.b.ins().iadd(table, behind);
        let class = self.b.ins().uload32(MemFlagsData::trusted(), entry, 0);
        let class = self.b.ins().iadd_imm_s(class, -low);
        let classes = self.int(count);
        let foreign = self.compare(IntCC::UnsignedGreaterThanOrEqual, class, classes);
        self.fault_if(foreign, Cold::Instance, site, &[pointer]);
        let behind = self.b.ins().ishl_imm_u(class, 3);
        let row = self.int(row as i64);
        let place = self.b.ins().iadd(row, behind);
        let target = self.b.ins().load(types::I64, flags, place, 0);
        self.fault_unless(target, Cold::Instance, site, &[pointer]);
        target
    }

    pub(super) fn is_a(&mut self, dst: Local, pointer: Local, family: u32) {
        let pointer = self.get(pointer);
        let family = self.tables.families + family as usize * size_of::<takt_ir::Family>();
        let family = self.int(family as i64);
        let value = self.call_host(runtime::is_a as *const u8 as usize, &[self.ctx, pointer, family], Some(types::I64));
        let value = if self.is(Defect::FamilyAlways) { self.int(1) } else { value };
        self.set(dst, value);
    }

    pub(super) fn put_instances(&mut self, offset: u32, class: u32, count: u32) {
        let start = self.b.ins().isub(self.frame, self.image);
        let start = self.b.ins().iadd_imm_s(start, i64::from(offset));
        let stride = self.program.class(class).map_or(GRANULE, |class| class.size.into());
        let (stride, count) = (self.int(stride as i64), self.int(i64::from(count)));
        let class = self.b.ins().iconst(types::I32, i64::from(class));
        self.call_host(runtime::put_instances as *const u8 as usize, &[self.ctx, start, class, stride, count], None);
    }

    pub(super) fn guard(&mut self, dst: Local) {
        let depth = self.b.ins().load(types::I32, self.ctx_flags, self.ctx, DEPTH);
        let depth = self.b.ins().uextend(types::I64, depth);
        self.set(dst, depth);
    }

    pub(super) fn catch(&mut self, dst: Local, depth: Local) {
        let code = self.b.ins().load(types::I32, self.ctx_flags, self.ctx, FAULT_CODE);
        let code = self.b.ins().uextend(types::I64, code);
        let code = if self.is(Defect::CodeLost) { self.int(0) } else { code };
        self.set(dst, code);
        let zero = self.b.ins().iconst(types::I32, 0);
        self.b.ins().store(self.ctx_flags, zero, self.ctx, FAULT_CODE);
        self.b.ins().store(self.ctx_flags, zero, self.ctx, TRACE_LEN);
        if !self.is(Defect::DepthLeft) {
            let depth = self.get(depth);
            let depth = self.b.ins().ireduce(types::I32, depth);
            self.b.ins().store(self.ctx_flags, depth, self.ctx, DEPTH);
        }
    }
}
