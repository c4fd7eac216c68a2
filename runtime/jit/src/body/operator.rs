//! Operators: the simple ones as instructions, the others as calls of their meaning ([`Op::address`]).

use super::{Cold, Lowering, register};
use crate::defect::Defect;
use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{InstBuilder, Type, Value, types};
use takt_ir::{Op, SiteId};

impl Lowering<'_, '_> {
    /// The value of an operator.
    pub(super) fn operator(&mut self, op: Op, args: &[Value], site: SiteId) -> Value {
        match *args {
            [a] => self.unary(op, a),
            [a, b] => self.binary(op, a, b, site),
            [a, b, c] => self.ternary(op, a, b, c),
            _ => self.meaning(op, args),
        }
    }

    /// Calls the operator's meaning.
    fn meaning(&mut self, op: Op, args: &[Value]) -> Value {
        self.call_host(op.address() as usize, args, Some(register(op.result())))
    }

    fn unary(&mut self, op: Op, a: Value) -> Value {
        let ins = self.b.ins();
        match op {
            Op::Neg => ins.ineg(a),
            Op::Abs => ins.iabs(a),
            Op::Not => ins.bnot(a),
            Op::SExt8 => self.cut(a, types::I8, true),
            Op::SExt16 => self.cut(a, types::I16, true),
            Op::SExt32 => self.cut(a, types::I32, self.defect != Defect::CutUnsigned),
            Op::ZExt8 => self.cut(a, types::I8, false),
            Op::ZExt16 => self.cut(a, types::I16, false),
            Op::ZExt32 => self.cut(a, types::I32, false),
            Op::NegF64 | Op::NegF32 => ins.fneg(a),
            Op::AbsF64 | Op::AbsF32 => ins.fabs(a),
            Op::SqrtF64 | Op::SqrtF32 => ins.sqrt(a),
            Op::FloorF64 | Op::FloorF32 => ins.floor(a),
            Op::CeilF64 | Op::CeilF32 => ins.ceil(a),
            Op::TruncF64 | Op::TruncF32 => ins.trunc(a),
            Op::I64ToF64 => ins.fcvt_from_sint(types::F64, a),
            Op::U64ToF64 if self.defect == Defect::UnsignedAsSigned => self.b.ins().fcvt_from_sint(types::F64, a),
            Op::U64ToF64 => ins.fcvt_from_uint(types::F64, a),
            Op::I64ToF32 => ins.fcvt_from_sint(types::F32, a),
            Op::U64ToF32 => ins.fcvt_from_uint(types::F32, a),
            Op::F32ToF64 => ins.fpromote(types::F64, a),
            Op::F64ToF32 => ins.fdemote(types::F32, a),
            Op::RoundF64 | Op::RoundF32 => self.round(op, a),
            Op::CutF64 | Op::CutF32 => ins.fcvt_to_sint_sat(types::I64, a),
            _ => self.meaning(op, &[a]),
        }
    }

    /// The low bits, extended again.
    fn cut(&mut self, a: Value, ty: Type, signed: bool) -> Value {
        let low = self.b.ins().ireduce(ty, a);
        if signed { self.b.ins().sextend(types::I64, low) } else { self.b.ins().uextend(types::I64, low) }
    }

    /// Half away from zero: the truncated sum with the number before one half, of the same sign.
    fn round(&mut self, op: Op, a: Value) -> Value {
        let almost_half =
            if op == Op::RoundF64 { self.b.ins().f64const(0.499_999_999_999_999_94) } else { self.b.ins().f32const(0.499_999_97) };
        if self.is(Defect::RoundEven) {
            let even = self.b.ins().nearest(a);
            return self.b.ins().fcvt_to_sint_sat(types::I64, even);
        }
        let step = self.b.ins().fcopysign(almost_half, a);
        let sum = self.b.ins().fadd(a, step);
        self.b.ins().fcvt_to_sint_sat(types::I64, sum)
    }

    fn binary(&mut self, op: Op, a: Value, b: Value, site: SiteId) -> Value {
        if let Some(cc) = self.condition(op) {
            let truth = self.compare(cc, a, b);
            return self.b.ins().uextend(types::I64, truth);
        }
        if let Some(cc) = self.float_condition(op) {
            let truth = self.b.ins().fcmp(cc, a, b);
            return self.b.ins().uextend(types::I64, truth);
        }
        let ins = self.b.ins();
        match op {
            Op::Add => ins.iadd(a, b),
            Op::Sub if self.defect == Defect::SubSwapped => self.b.ins().isub(b, a),
            Op::Sub => ins.isub(a, b),
            Op::Mul => ins.imul(a, b),
            Op::Div | Op::DivU => self.divide(op, a, b, site),
            Op::Rem | Op::RemU => self.remainder(op, a, b),
            Op::And => ins.band(a, b),
            Op::Or => ins.bor(a, b),
            Op::Xor => ins.bxor(a, b),
            Op::Shl => {
                let shifted = ins.ishl(a, b);
                self.below(b, 64, shifted)
            }
            Op::ShrU => {
                let shifted = ins.ushr(a, b);
                self.below(b, 64, shifted)
            }
            Op::AddF64 | Op::AddF32 => ins.fadd(a, b),
            Op::SubF64 | Op::SubF32 => ins.fsub(a, b),
            Op::MulF64 | Op::MulF32 => ins.fmul(a, b),
            Op::DivF64 | Op::DivF32 => ins.fdiv(a, b),
            _ => self.meaning(op, &[a, b]),
        }
    }

    fn condition(&self, op: Op) -> Option<IntCC> {
        Some(match op {
            Op::Eq => IntCC::Equal,
            Op::Ne => IntCC::NotEqual,
            Op::Lt if self.is(Defect::LessUnsigned) => IntCC::UnsignedLessThan,
            Op::Lt => IntCC::SignedLessThan,
            Op::Le => IntCC::SignedLessThanOrEqual,
            Op::Gt => IntCC::SignedGreaterThan,
            Op::Ge => IntCC::SignedGreaterThanOrEqual,
            Op::LtU => IntCC::UnsignedLessThan,
            Op::LeU => IntCC::UnsignedLessThanOrEqual,
            Op::GtU => IntCC::UnsignedGreaterThan,
            Op::GeU => IntCC::UnsignedGreaterThanOrEqual,
            _ => return None,
        })
    }
    fn float_condition(&self, op: Op) -> Option<FloatCC> {
        Some(match op {
            Op::EqF64 | Op::EqF32 => FloatCC::Equal,
            Op::NeF64 if self.is(Defect::NotEqualOrdered) => FloatCC::OrderedNotEqual,
            Op::NeF64 | Op::NeF32 => FloatCC::NotEqual,
            Op::LtF64 | Op::LtF32 => FloatCC::LessThan,
            Op::LeF64 | Op::LeF32 => FloatCC::LessThanOrEqual,
            Op::GtF64 | Op::GtF32 => FloatCC::GreaterThan,
            Op::GeF64 | Op::GeF32 => FloatCC::GreaterThanOrEqual,
            _ => return None,
        })
    }

    /// `value` if the distance is below the width, else 0.
    fn below(&mut self, distance: Value, width: i64, value: Value) -> Value {
        if self.is(Defect::ShiftMasked) {
            return value;
        }
        match self.constant(distance) {
            Some(n) if (n as u64) < width as u64 => return value,
            Some(_) => return self.int(0),
            None => {}
        }
        let inside = self.b.ins().icmp_imm_s(IntCC::UnsignedLessThan, distance, width);
        let zero = self.int(0);
        self.b.ins().select(inside, value, zero)
    }

    /// Division: a divisor of 0 is a fault, MIN / -1 wraps. The processor would stop the process in both cases.
    fn divide(&mut self, op: Op, a: Value, b: Value, site: SiteId) -> Value {
        let known = self.constant(b).filter(|b| *b != 0 && self.is(Defect::None));
        if self.is(Defect::DivisionUnchecked) {
            return self.meaning(op, &[a, b]);
        }
        if known.is_none() {
            let site = if self.is(Defect::SiteWrong) { self.body.entry_site } else { site };
            self.fault_unless(b, Cold::Division, site, &[]);
        }
        if op == Op::DivU {
            return self.b.ins().udiv(a, b);
        }
        match known {
            Some(-1) => return self.b.ins().ineg(a),
            Some(_) => return self.b.ins().sdiv(a, b),
            None => {}
        }
        let (minus, one) = (self.b.ins().icmp_imm_s(IntCC::Equal, b, -1), self.int(1));
        let divisor = self.b.ins().select(minus, one, b);
        let quotient = self.b.ins().sdiv(a, divisor);
        let mut negated = self.b.ins().ineg(a);
        if self.is(Defect::DivisionOfMin) {
            negated = self.b.ins().smax(negated, one);
        }
        self.b.ins().select(minus, negated, quotient)
    }

    /// Remainder: 0 for divisors of 0, and of -1, by dividing by 1 instead.
    fn remainder(&mut self, op: Op, a: Value, b: Value) -> Value {
        let signed = op == Op::Rem;
        match self.constant(b) {
            Some(0) | None => {}
            Some(-1) if signed => return self.int(0),
            Some(_) if signed => return self.b.ins().srem(a, b),
            Some(_) => return self.b.ins().urem(a, b),
        }
        let one = self.int(1);
        let special = if signed {
            // 0 and -1 in one comparison.
            let next = self.b.ins().iadd_imm_s(b, 1);
            self.compare(IntCC::UnsignedLessThanOrEqual, next, one)
        } else {
            self.b.ins().icmp_imm_s(IntCC::Equal, b, 0)
        };
        let divisor = self.b.ins().select(special, one, b);
        let rest = if signed { self.b.ins().srem(a, divisor) } else { self.b.ins().urem(a, divisor) };
        if self.is(Defect::RemainderOfZero) {
            let zero = self.b.ins().icmp_imm_s(IntCC::Equal, b, 0);
            return self.b.ins().select(zero, a, rest);
        }
        rest
    }

    fn ternary(&mut self, op: Op, a: Value, b: Value, c: Value) -> Value {
        match op {
            Op::Select | Op::SelectF32 | Op::SelectF64 if self.is(Defect::SelectSwapped) => self.b.ins().select(a, c, b),
            Op::Select | Op::SelectF32 | Op::SelectF64 => self.b.ins().select(a, b, c),
            Op::ShrS => {
                let shifted = self.b.ins().sshr(a, b);
                let inside = self.below(b, 64, shifted);
                if self.is(Defect::ShiftWidthIgnored) {
                    return inside;
                }
                let zero = self.int(0);
                let narrow = self.compare(IntCC::UnsignedLessThan, b, c);
                self.b.ins().select(narrow, inside, zero)
            }
            Op::Rol | Op::Ror => self.rotate(op, a, b, c),
            _ => self.meaning(op, &[a, b, c]),
        }
    }

    /// Rotation by a constant width; the processor takes the distance modulo the width.
    fn rotate(&mut self, op: Op, a: Value, distance: Value, width: Value) -> Value {
        let ty = match self.constant(width) {
            _ if self.is(Defect::RotateWide) => types::I64,
            Some(8) => types::I8,
            Some(16) => types::I16,
            Some(32) => types::I32,
            Some(_) => types::I64,
            None => return self.meaning(op, &[a, distance, width]),
        };
        let narrow = if ty == types::I64 { a } else { self.b.ins().ireduce(ty, a) };
        let turned = if op == Op::Rol { self.b.ins().rotl(narrow, distance) } else { self.b.ins().rotr(narrow, distance) };
        if ty == types::I64 { turned } else { self.b.ins().uextend(types::I64, turned) }
    }
}
