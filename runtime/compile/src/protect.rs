//! `__TRY … __CATCH(code) … __FINALLY … __ENDTRY`.

use crate::expression::{Kind, Lowering, Thing};
use takt_abi::Fault;
use takt_ir::{BlockId, Inst, Local, Op, Term, Ty};
use takt_syntax::tree::{Name, Stmt};
use takt_syntax::{Code, Span};

/// Faults that a program may handle, and the numbers that `__SYSTEM.ExceptionCode` gives them.
const EXCEPTIONS: [(Fault, i64); 7] = [
    (Fault::Index { value: 0, low: 0, high: 0 }, 0x101),
    (Fault::DivisionByZero, 0x102),
    (Fault::NullPointer, 0x51),
    (Fault::WildPointer { offset: 0, size: 0 }, 0x51),
    (Fault::Block { error: 0 }, 0x2000),
    (Fault::WrongDelete, 0x56),
    (Fault::NoInstance { offset: 0 }, 0x51),
];

impl<'a> Lowering<'_, 'a> {
    pub(crate) fn try_statement(
        &mut self,
        body: &'a [Stmt],
        catch: Option<&'a (Option<Name>, Vec<Stmt>)>,
        finally: Option<&'a [Stmt]>,
        span: Span,
    ) {
        if catch.is_none() && finally.is_none() {
            self.report(Code::BadStatement, span, "a __TRY needs a __CATCH or a __FINALLY").help =
                Some("write `__CATCH(code)` before `__ENDTRY`".into());
        }
        let depth = self.b.local(Ty::I64);
        self.b.push(Inst::Guard { dst: depth });
        let (handler, last, after) = (self.b.block(), self.b.block(), self.b.block());
        let outer = self.b.guard(None);
        self.protected.push((self.loops.len(), finally.unwrap_or_default()));
        let caught = if catch.is_some() { handler } else { last };
        self.guarded(body, caught, after);
        if let Some((variable, handling)) = catch {
            self.b.go_to(handler);
            let fault = self.b.local(Ty::I64);
            self.b.push(Inst::Catch { dst: fault, depth });
            if let Some(variable) = variable {
                self.tell_exception(variable, fault);
            }
            let passed = if finally.is_some() { Some(last) } else { outer };
            match passed {
                Some(passed) => self.guarded(handling, passed, after),
                None => self.statements(handling),
            }
            self.b.end(Term::Jump(after));
        }
        self.protected.pop();
        self.b.guard(outer);
        if let Some(finally) = finally {
            self.b.go_to(last);
            let fault = self.b.local(Ty::I64);
            self.b.push(Inst::Catch { dst: fault, depth });
            self.statements(finally);
            self.b.end(Term::Rethrow(fault));
        }
        self.b.go_to(after);
        self.statements(finally.unwrap_or_default());
    }

    /// Statements whose faults lead to `handler`; behind them it goes on at `after`.
    fn guarded(&mut self, statements: &'a [Stmt], handler: BlockId, after: BlockId) {
        let outer = self.b.guard(Some(handler));
        let inside = self.b.block();
        self.b.continue_in(inside);
        self.statements(statements);
        self.b.guard(outer);
        self.b.end(Term::Jump(after));
    }

    /// Puts the code of the exception into the variable of __CATCH.
    fn tell_exception(&mut self, variable: &'a Name, fault: Local) {
        let span = variable.span;
        let Thing::Value(target) = self.name(&variable.text, span) else { return };
        let usable = self.scalar(target.ty).is_some_and(crate::types::is_integer);
        let (Kind::Place(place), None, true) = (&target.kind, target.fixed, usable) else {
            if !target.is_error() {
                let found = self.operand_name(&target);
                self.report(Code::TypeMismatch, span, format!("expected a variable of type `__SYSTEM.ExceptionCode`, found {found}"));
            }
            return;
        };
        let site = self.site(span);
        let mut code = self.b.int(0xFFFF_FFFF);
        for (caught, exception) in EXCEPTIONS {
            let (number, exception) = (self.b.int(caught.code().into()), self.b.int(exception));
            let hit = self.b.op(Op::Eq, &[fault, number], site);
            code = self.b.op(Op::Select, &[hit, exception, code], site);
        }
        self.store(&place.clone(), target.ty, code, false, span);
    }

    /// What __FINALLY says where control leaves the protected statements that were entered with more than `loops` loops around them.
    pub(crate) fn leave_protected(&mut self, loops: usize) {
        let left = self.protected.iter().rposition(|(depth, _)| *depth < loops).map_or(0, |i| i + 1);
        let rest = self.protected.split_off(left);
        for (_, finally) in rest.iter().rev() {
            self.statements(finally);
        }
        self.protected.extend(rest);
    }
}
