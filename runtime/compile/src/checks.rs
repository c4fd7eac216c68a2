//! Implicit checks that a program brings itself: CheckBounds, CheckDiv…, CheckRange…, CheckPointer with CODESYS' signatures. They are called and their
//! results used; the checks of the IR stand behind them.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand};
use crate::object::Target;
use crate::operator::Class;
use crate::scope::{Item, PouKind, key};
use takt_abi::Elem;
use takt_ir::{Type, TypeId};
use takt_syntax::Span;

impl Lowering<'_, '_> {
    /// The user's function for a check, if there is one of these names and it is to be called here.
    fn user_check(&self, names: &[&str]) -> Option<usize> {
        let found = names.iter().find_map(|name| match self.c.names.get(*name) {
            Some(Item::Pou(unit)) if self.c.pous[*unit].tree.kind == PouKind::Function => Some(*unit),
            _ => None,
        })?;
        let own = self.pou?;
        let tree = self.c.pous[own].tree;
        let exempt = key(&tree.name.text).starts_with("CHECK") && tree.kind == PouKind::Function;
        let unchecked = self.levels.iter().any(|l| self.c.pous[l.pou].tree.pragmas.iter().any(|p| p.name == "no_check"));
        (!exempt && !unchecked && !self.c.pous[own].library && !self.scratch).then_some(found)
    }

    fn call_check(&mut self, unit: usize, args: Vec<Operand>, span: Span) -> Option<Operand> {
        self.c.resolve_pou(unit, span);
        let types: Vec<TypeId> = self.c.pous[unit].vars.iter().filter(|v| self.c.passing(v).is_some()).map(|v| v.ty).collect();
        let preset: Vec<(usize, Operand)> = args.into_iter().zip(types).map(|(arg, ty)| self.explicit(arg, ty)).enumerate().collect();
        let result = self.call_unit(unit, Target::Plain, preset, &[], span);
        (!result.is_error()).then_some(result)
    }

    fn whole(&mut self, value: i128, span: Span) -> Operand {
        let ty = self.c.elem(Elem::Lint);
        self.constant(Value::Int(value), ty, span)
    }

    /// `CheckBounds(index, lower, upper)`.
    pub(crate) fn check_bounds(&mut self, index: Operand, low: i64, high: i64) -> Operand {
        let Some(unit) = self.user_check(&["CHECKBOUNDS"]) else { return index };
        let span = index.span;
        let (low, high) = (self.whole(low.into(), span), self.whole(high.into(), span));
        self.call_check(unit, vec![index.clone(), low, high], span).unwrap_or(index)
    }

    /// `CheckDivInt(divisor)` and its like.
    pub(crate) fn check_divisor(&mut self, divisor: Operand) -> Operand {
        let names: &[&str] = match self.class(divisor.ty) {
            _ if matches!(divisor.kind, Kind::Const(_)) => return divisor,
            Class::Int(e) if takt_ir::elem_size(e) == 8 => &["CHECKDIVLINT"],
            Class::Int(_) => &["CHECKDIVINT", "CHECKDIVDINT"],
            Class::Real(Elem::Real) => &["CHECKDIVREAL"],
            Class::Real(_) => &["CHECKDIVLREAL"],
            _ => return divisor,
        };
        let Some(unit) = self.user_check(names) else { return divisor };
        let (span, ty) = (divisor.span, divisor.ty);
        match self.call_check(unit, vec![divisor.clone()], span) {
            Some(checked) => self.explicit(checked, ty),
            None => divisor,
        }
    }

    /// `CheckRangeSigned(value, lower, upper)` and its like, where a value meets a place with a range.
    pub(crate) fn check_range(&mut self, value: &Operand, to: TypeId) -> Option<Operand> {
        let Type::Subrange { base, low, high } = *self.c.types.get(to) else { return None };
        if matches!(value.kind, Kind::Const(_)) || !matches!(self.class(value.ty), Class::Int(_)) {
            return None;
        }
        let (signed, wide) = (matches!(base, Elem::Sint | Elem::Int | Elem::Dint | Elem::Lint), takt_ir::elem_size(base) == 8);
        let name = match (signed, wide) {
            (true, false) => "CHECKRANGESIGNED",
            (false, false) => "CHECKRANGEUNSIGNED",
            (true, true) => "CHECKLRANGESIGNED",
            (false, true) => "CHECKLRANGEUNSIGNED",
        };
        let unit = self.user_check(&[name])?;
        let span = value.span;
        let (low, high) = (self.whole(low, span), self.whole(high, span));
        self.call_check(unit, vec![value.clone(), low, high], span)
    }

    /// `CheckPointer(ptToTest, iSize, iGran, bWrite)`.
    pub(crate) fn check_pointer(&mut self, pointer: Operand, to: TypeId) -> Operand {
        let Some(unit) = self.user_check(&["CHECKPOINTER"]) else { return pointer };
        let (span, ty) = (pointer.span, pointer.ty);
        let (size, align) = self.c.types.layout(to);
        let (size, align) = (self.whole(size.into(), span), self.whole(align.into(), span));
        let bool_type = self.bool_type();
        let write = self.constant(Value::Int(i128::from(self.writes)), bool_type, span);
        match self.call_check(unit, vec![pointer.clone(), size, align, write], span) {
            Some(checked) => Operand { ty, ..checked },
            None => pointer,
        }
    }
}
