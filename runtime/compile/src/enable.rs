//! EN and ENO: a call that is made only if a condition says so (IEC 61131-3, 6.6.1.5).

use crate::expression::{Kind, Lowering, Operand};
use crate::place::Place;
use crate::scope::key;
use takt_abi::Section;
use takt_ir::{Base, BlockId, Const, Inst, Local, Term, Ty};
use takt_syntax::tree::Arg;

/// A call under EN, while it is being lowered.
pub(crate) struct Enable<'a> {
    condition: Local,
    skip: BlockId,
    end: BlockId,
    eno: Option<&'a Arg>,
}

/// Whether an argument is EN or ENO and the callee does not declare it.
pub(crate) fn is_enable(arg: &Arg, names: &[(&str, Section)]) -> bool {
    let Some(name) = arg.name.as_ref().map(|n| key(&n.text)) else { return false };
    matches!(name.as_str(), "EN" | "ENO") && !names.iter().any(|(n, section)| key(n) == name && *section != Section::State)
}

impl<'a> Lowering<'_, 'a> {
    /// Begins a call; `None` if neither EN nor ENO is among its arguments.
    pub(crate) fn enable(&mut self, names: &[(&str, Section)], args: &'a [Arg]) -> Option<Enable<'a>> {
        let find = |wanted: &str| args.iter().find(|a| is_enable(a, names) && a.name.as_ref().is_some_and(|n| key(&n.text) == wanted));
        let (en, eno) = (find("EN"), find("ENO"));
        if en.is_none() && eno.is_none() {
            return None;
        }
        let condition = self.b.local(Ty::I64);
        let src = match en.and_then(|arg| arg.value.as_ref()) {
            Some(e) => self.condition(e),
            None => self.b.int(1),
        };
        self.b.push(Inst::Copy { dst: condition, src });
        let (then, skip, end) = (self.b.block(), self.b.block(), self.b.block());
        self.b.end(Term::Branch { cond: condition, then, other: skip });
        self.b.go_to(then);
        Some(Enable { condition, skip, end, eno })
    }

    /// Ends a call; its result is 0 where it was not made.
    pub(crate) fn end_enable(&mut self, enable: Option<Enable<'a>>, result: Operand) -> Operand {
        let Some(Enable { condition, skip, end, eno }) = enable else { return result };
        let mut result = result;
        match result.kind.clone() {
            Kind::Temp(local) => {
                let ty = self.b.ty(local);
                let dst = self.b.local(ty);
                self.b.push(Inst::Copy { dst, src: local });
                self.b.end(Term::Jump(end));
                self.b.go_to(skip);
                let value = match ty {
                    Ty::F32 => Const::F32(0),
                    Ty::F64 => Const::F64(0),
                    _ => Const::I64(0),
                };
                self.b.push(Inst::Const { dst, value });
                result.kind = Kind::Temp(dst);
            }
            Kind::Place(Place::Memory { base: Base::Frame, offset }) => {
                self.b.end(Term::Jump(end));
                self.b.go_to(skip);
                let len = self.c.types.size(result.ty);
                let data = self.pool(&vec![0; len as usize]);
                self.b.push(Inst::Data { dst: Base::Frame, offset, data, len });
            }
            _ => {
                self.b.end(Term::Jump(end));
                self.b.go_to(skip);
            }
        }
        self.b.continue_in(end);
        if let Some(target) = eno.and_then(|arg| arg.value.as_ref()) {
            let ty = self.bool_type();
            let value = self.exact(condition, ty, target.span);
            let target = self.target(target);
            self.assign(target, value);
        }
        result
    }
}
