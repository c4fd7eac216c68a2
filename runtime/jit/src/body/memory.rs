//! Loads, stores, addresses, checks and copies.

use super::{Cold, Lowering};
use crate::defect::Defect;
use crate::runtime;
use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::immediates::{Ieee32, Ieee64};
use cranelift_codegen::ir::{InstBuilder, Opcode, Type, Value, types};
use takt_ir::{Base, Local, Mem, NULL_ZONE, SiteId, Ty};

/// Copies up to this many bytes are done in registers.
const SMALL: u32 = 64;

impl Lowering<'_, '_> {
    /// A base and an offset as an address in a register and an immediate.
    fn place(&mut self, base: Base, offset: u32) -> (Value, i32) {
        let start = match base {
            Base::Image => self.image,
            Base::Frame => self.frame,
            Base::Local(local) => self.get(local),
        };
        match i32::try_from(offset) {
            // Wide accesses in pieces add up to SMALL.
            Ok(offset) if offset <= i32::MAX - SMALL as i32 => (start, offset),
            _ => (self.b.ins().iadd_imm_s(start, i64::from(offset)), 0),
        }
    }
    pub(super) fn address(&mut self, base: Base, offset: u32) -> Value {
        let (start, offset) = self.place(base, offset);
        if offset == 0 { start } else { self.b.ins().iadd_imm_s(start, i64::from(offset)) }
    }

    pub(super) fn load(&mut self, mem: Mem, base: Base, offset: u32) -> Value {
        let (start, offset) = self.place(base, offset);
        let (flags, wide) = (self.image_flags, types::I64);
        let ins = self.b.ins();
        match mem {
            Mem::Bool => {
                if self.is(Defect::BoolRaw) {
                    return self.b.ins().uload8(wide, flags, start, offset);
                }
                let byte = self.b.ins().load(types::I8, flags, start, offset);
                let set = self.b.ins().icmp_imm_s(IntCC::NotEqual, byte, 0);
                self.b.ins().uextend(wide, set)
            }
            Mem::I8 => ins.sload8(wide, flags, start, offset),
            Mem::U8 if self.defect == Defect::SignGained => self.b.ins().sload8(wide, flags, start, offset),
            Mem::U8 => ins.uload8(wide, flags, start, offset),
            Mem::I16 if self.defect == Defect::SignLost => self.b.ins().uload16(wide, flags, start, offset),
            Mem::I16 => ins.sload16(wide, flags, start, offset),
            Mem::U16 => ins.uload16(wide, flags, start, offset),
            Mem::I32 => ins.sload32(flags, start, offset),
            Mem::U32 => ins.uload32(flags, start, offset),
            Mem::I64 => ins.load(wide, flags, start, offset),
            Mem::F32 => ins.load(types::F32, flags, start, offset),
            Mem::F64 => ins.load(types::F64, flags, start, offset),
        }
    }

    pub(super) fn store(&mut self, mem: Mem, value: Value, base: Base, offset: u32) {
        let (start, offset) = self.place(base, offset);
        let flags = self.image_flags;
        match mem {
            Mem::Bool | Mem::I8 | Mem::U8 => self.b.ins().istore8(flags, value, start, offset),
            Mem::I16 | Mem::U16 if self.is(Defect::StoreSkipped) => return,
            Mem::I32 | Mem::U32 if self.is(Defect::StoreNarrow) => self.b.ins().istore16(flags, value, start, offset),
            Mem::I16 | Mem::U16 => self.b.ins().istore16(flags, value, start, offset),
            Mem::I32 | Mem::U32 => self.b.ins().istore32(flags, value, start, offset),
            Mem::I64 => self.b.ins().store(flags, value, start, offset),
            Mem::F32 | Mem::F64 => {
                let kept = if mem == Mem::F64 { Defect::NanKept } else { Defect::NanKeptF32 };
                let value = if self.is(kept) { value } else { self.canonical(value) };
                self.b.ins().store(flags, value, start, offset)
            }
        };
    }

    /// A float with any NaN made the canonical one.
    pub(super) fn canonical(&mut self, value: Value) -> Value {
        let opcode = self.b.func.dfg.value_def(value).inst().map(|inst| self.b.func.dfg.insts[inst].opcode());
        if matches!(opcode, Some(Opcode::FcvtFromSint | Opcode::FcvtFromUint)) {
            return value;
        }
        let ty = self.b.func.dfg.value_type(value);
        let unordered = self.b.ins().fcmp(FloatCC::Unordered, value, value);
        let (cold, next) = (self.b.create_block(), self.b.create_block());
        self.b.set_cold_block(cold);
        let result = self.b.append_block_param(next, ty);
        self.b.ins().brif(unordered, cold, &[], next, &[value.into()]);
        self.b.switch_to_block(cold);
        self.b.seal_block(cold);
        let nan = match ty {
            types::F32 => self.b.ins().f32const(Ieee32::with_bits(0x7FC0_0000)),
            _ => self.b.ins().f64const(Ieee64::with_bits(0x7FF8_0000_0000_0000)),
        };
        self.b.ins().jump(next, &[nan.into()]);
        self.b.switch_to_block(next);
        self.b.seal_block(next);
        result
    }

    /// The index, if it lies between constant bounds; otherwise a fault.
    pub(super) fn bounded(&mut self, index: Value, low: i64, high: i64, site: SiteId) -> Value {
        if self.constant(index).is_some_and(|index| (low..=high).contains(&index)) && self.is(Defect::None) {
            return index;
        }
        let behind = self.b.ins().iadd_imm_s(index, low.wrapping_neg());
        let mut last = high.wrapping_sub(low) as u64;
        match self.defect {
            Defect::IndexUnchecked => return self.clamped(index, low, high),
            Defect::IndexLoose => last = last.saturating_add(1),
            Defect::IndexTight if last > 0 => last -= 1,
            _ => {}
        }
        let last = self.int(last as i64);
        let inside = self.compare(IntCC::UnsignedLessThanOrEqual, behind, last);
        let (first, second) = if self.is(Defect::FactsSwapped) { (high, low) } else { (low, high) };
        let bounds = [self.int(first), self.int(second)];
        self.fault_unless(inside, Cold::Index, site, &[index, bounds[0], bounds[1]]);
        if self.is(Defect::IndexLoose) { self.clamped(index, low, high) } else { index }
    }
    fn clamped(&mut self, index: Value, low: i64, high: i64) -> Value {
        let (low, high) = (self.int(low), self.int(high));
        let index = self.b.ins().smax(index, low);
        self.b.ins().smin(index, high)
    }
    /// The address of an element.
    pub(super) fn element(&mut self, base: Base, offset: u32, index: Value, low: i64, stride: u32) -> Value {
        let start = self.address(base, 0);
        let behind = self.b.ins().imul_imm_s(index, i64::from(stride));
        let address = self.b.ins().iadd(start, behind);
        let rest = i64::from(offset).wrapping_sub(low.wrapping_mul(i64::from(stride)));
        if rest == 0 { address } else { self.b.ins().iadd_imm_s(address, rest) }
    }
    /// Checks an index against bounds in locals.
    pub(super) fn check(&mut self, [index, low, high]: [Local; 3], site: SiteId) {
        if self.is(Defect::CheckDropped) {
            return;
        }
        let [index, low, high] = [index, low, high].map(|local| self.get(local));
        let below = self.compare(IntCC::SignedLessThan, index, low);
        let above = self.compare(IntCC::SignedGreaterThan, index, high);
        let outside = self.b.ins().bor(below, above);
        let (first, second) = if self.is(Defect::FactsSwapped) { (high, low) } else { (low, high) };
        self.fault_if(outside, Cold::Index, site, &[index, first, second]);
    }
    /// The address that a pointer of the program names, checked for the extent of `dst`.
    pub(super) fn deref(&mut self, dst: Local, pointer: Local, site: SiteId) -> Value {
        let mut pointer = self.get(pointer);
        let extent = if let Ty::Addr(extent) = self.ty(dst) { extent } else { 0 };
        let size = self.int(i64::from(extent));
        let (zone, end) = (i64::from(NULL_ZONE), i64::from(self.program.image_size) - i64::from(extent));
        if self.is(Defect::NullUnchecked) {
            let (null, start) = (self.b.ins().icmp_imm_s(IntCC::Equal, pointer, 0), self.int(zone));
            pointer = self.b.ins().select(null, start, pointer);
        }
        let open = if self.is(Defect::NullZoneOpen) { 1 } else { zone };
        let behind = self.b.ins().iadd_imm_s(pointer, -open);
        let inside = if end < open {
            self.b.ins().iconst(types::I8, 0)
        } else {
            let last = self.int(end - open);
            self.compare(IntCC::UnsignedLessThanOrEqual, behind, last)
        };
        if self.is(Defect::WildUnchecked) {
            let (null, first) = (self.b.ins().icmp_imm_s(IntCC::Equal, pointer, 0), self.int(zone));
            self.fault_if(null, Cold::Pointer, site, &[pointer, size]);
            pointer = self.b.ins().select(inside, pointer, first);
        } else {
            self.fault_unless(inside, Cold::Pointer, site, &[pointer, size]);
        }
        self.b.ins().iadd(self.image, pointer)
    }

    pub(super) fn move_bytes(&mut self, dst: (Base, u32), src: (Base, u32), len: u32) {
        let len = if self.is(Defect::MoveShort) { len.saturating_sub(1) } else { len };
        if len > SMALL || self.is(Defect::MoveForward) {
            let (dst, src) = (self.address(dst.0, dst.1), self.address(src.0, src.1));
            return self.move_long(dst, src, len);
        }
        // All loads first: the ranges may overlap.
        let (from, to) = (self.place(src.0, src.1), self.place(dst.0, dst.1));
        let flags = self.image_flags;
        let pieces: Vec<(Value, i32)> = pieces(len).map(|(ty, at)| (self.b.ins().load(ty, flags, from.0, from.1 + at), at)).collect();
        for (value, at) in pieces {
            self.b.ins().store(flags, value, to.0, to.1 + at);
        }
    }
    fn move_long(&mut self, dst: Value, src: Value, len: u32) {
        let target = if self.is(Defect::MoveForward) { runtime::move_forward as *const u8 } else { runtime::move_bytes as *const u8 };
        let len = self.int(i64::from(len));
        self.call_host(target as usize, &[dst, src, len], None);
    }
    /// Copies constant bytes.
    pub(super) fn data(&mut self, dst: (Base, u32), data: u32, len: u32) {
        let len = if self.is(Defect::DataShort) { len.saturating_sub(1) } else { len };
        if len > SMALL {
            let dst = self.address(dst.0, dst.1);
            let src = self.int(self.tables.pool.wrapping_add(data as usize) as i64);
            return self.move_long(dst, src, len);
        }
        let (start, offset) = self.place(dst.0, dst.1);
        for (ty, at) in pieces(len) {
            let first = data as usize + at as usize;
            let mut word = [0; 8];
            let bytes = &self.program.data[first..first + ty.bytes() as usize];
            word[..bytes.len()].copy_from_slice(bytes);
            let value = self.b.ins().iconst(ty, narrow(i64::from_le_bytes(word), ty));
            self.b.ins().store(self.image_flags, value, start, offset + at);
        }
    }
}

/// A constant as an immediate of a narrow type: zero-extended.
fn narrow(value: i64, ty: Type) -> i64 {
    if ty.bits() == 64 { value } else { value & ((1 << ty.bits()) - 1) }
}

/// `len` bytes as accesses of 8, 4, 2 and 1 bytes with their offsets.
fn pieces(len: u32) -> impl Iterator<Item = (Type, i32)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let ty = match len - at {
            0 => return None,
            1 => types::I8,
            2..=3 => types::I16,
            4..=7 => types::I32,
            _ => types::I64,
        };
        let piece = (ty, at as i32);
        at += ty.bytes();
        Some(piece)
    })
}
