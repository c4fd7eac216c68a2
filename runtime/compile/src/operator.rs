//! Operators: which types they take, which IR operator they become, folding of constants.

mod order;
mod time;

use crate::constant::{Value, cut, range};
use crate::expression::{Kind, Lowering, Operand};
use crate::types::is_integer;
use takt_abi::Elem;
use takt_ir::{Inst, Local, Op, Term, Ty, Type, TypeId};
use takt_syntax::tree::{BinaryOp, Expr, Link, UnaryOp};
use takt_syntax::{Code, Span};

/// What an operator sees in a type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    Bool,
    /// Integers, bit strings, enumerations.
    Int(Elem),
    Real(Elem),
    /// TIME, LTIME.
    Duration(Elem),
    /// DATE, TOD, DT and their long forms.
    Moment(Elem),
    Char(Elem),
    Text,
    Wide,
    Pointer,
    Other,
}

/// The sign of an operator in messages.
fn sign(op: BinaryOp) -> &'static str {
    use BinaryOp::*;
    match op {
        Add => "+",
        Sub => "-",
        Mul => "*",
        Div => "/",
        Mod => "MOD",
        Power => "**",
        Eq => "=",
        Ne => "<>",
        Lt => "<",
        Le => "<=",
        Gt => ">",
        Ge => ">=",
        And => "AND",
        Or => "OR",
        Xor => "XOR",
        AndThen => "AND_THEN",
        OrElse => "OR_ELSE",
    }
}

fn is_comparison(op: BinaryOp) -> bool {
    use BinaryOp::*;
    matches!(op, Eq | Ne | Lt | Le | Gt | Ge)
}

/// The 64-bit types that compare and divide without sign.
pub(crate) fn is_unsigned_64(e: Elem) -> bool {
    matches!(e, Elem::Lword | Elem::Ulint | Elem::Ldate | Elem::Ltod | Elem::Ldt)
}

/// The type that both integers fit, as far as there is one.
pub(crate) fn common_int(a: Elem, b: Elem) -> Elem {
    if a == b {
        return a;
    }
    let ((al, ah), (bl, bh)) = (range(a), range(b));
    if al <= bl && ah >= bh {
        return a;
    }
    if bl <= al && bh >= ah {
        return b;
    }
    let (low, high) = (al.min(bl), ah.max(bh));
    [Elem::Int, Elem::Dint, Elem::Lint].into_iter().find(|e| range(*e).0 <= low && range(*e).1 >= high).unwrap_or(Elem::Ulint)
}

impl<'a> Lowering<'_, 'a> {
    pub(crate) fn class(&self, ty: TypeId) -> Class {
        match self.c.types.get(ty) {
            Type::Elem(e) | Type::Subrange { base: e, .. } => match e {
                Elem::Bool => Class::Bool,
                Elem::Real | Elem::Lreal => Class::Real(*e),
                Elem::Time | Elem::Ltime => Class::Duration(*e),
                Elem::Char | Elem::Wchar => Class::Char(*e),
                e if is_integer(*e) => Class::Int(*e),
                e => Class::Moment(*e),
            },
            Type::Enum(e) => Class::Int(e.base),
            Type::String(_) => Class::Text,
            Type::WString(_) => Class::Wide,
            Type::Pointer(_) | Type::Interface(_) => Class::Pointer,
            _ => Class::Other,
        }
    }

    pub(crate) fn unary(&mut self, op: UnaryOp, a: Operand, span: Span) -> Operand {
        if a.is_error() {
            return a;
        }
        let site = self.site(span);
        match (op, self.class(a.ty)) {
            (UnaryOp::Plus, Class::Int(_) | Class::Real(_) | Class::Duration(_)) => Operand { span, ..a },
            (UnaryOp::Neg, Class::Int(_) | Class::Duration(_)) => {
                if let (Kind::Const(Value::Int(v)), true) = (&a.kind, a.flex) {
                    return self.literal_result(-*v, span);
                }
                let result = self.fold_or_emit(Op::Neg, &[&a], a.ty, span);
                self.computed(result)
            }
            (UnaryOp::Neg, Class::Real(e)) => {
                if let Kind::Const(Value::Real(v)) = a.kind {
                    return Operand { flex: a.flex, ..self.constant(Value::Real(-v), a.ty, span) };
                }
                let v = self.value(&a);
                let v = self.b.op(if e == Elem::Real { Op::NegF32 } else { Op::NegF64 }, &[v], site);
                self.exact(v, a.ty, span)
            }
            (UnaryOp::Not, Class::Bool) => {
                if let Kind::Const(Value::Int(v)) = a.kind {
                    return self.constant(Value::Int(i128::from(v == 0)), a.ty, span);
                }
                let v = self.value(&a);
                let zero = self.b.int(0);
                let v = self.b.op(Op::Eq, &[v, zero], site);
                self.exact(v, a.ty, span)
            }
            (UnaryOp::Not, Class::Int(e)) => {
                if let Kind::Const(Value::Int(v)) = a.kind {
                    return self.constant(Value::Int(cut(!v, e)), a.ty, span);
                }
                let v = self.value(&a);
                let v = self.b.op(Op::Not, &[v], site);
                let v = self.cut(v, e, span);
                self.exact(v, a.ty, span)
            }
            _ => {
                let (name, sign) = (
                    self.type_name(a.ty),
                    match op {
                        UnaryOp::Neg => "-",
                        UnaryOp::Not => "NOT",
                        UnaryOp::Plus => "+",
                    },
                );
                self.report(Code::BadOperand, span, format!("`{sign}` does not accept `{name}`"));
                self.error(span)
            }
        }
    }

    fn literal_type(&mut self, v: i128) -> TypeId {
        let e = [Elem::Int, Elem::Dint, Elem::Lint].into_iter().find(|e| (range(*e).0..=range(*e).1).contains(&v)).unwrap_or(Elem::Ulint);
        self.c.elem(e)
    }

    /// An integer result: cut at once in IEC arithmetic, else when it is used.
    pub(crate) fn computed(&mut self, result: Operand) -> Operand {
        let result = Operand { exact: false, ..result };
        if self.c.options.iec_arithmetic { self.own_range(result) } else { result }
    }

    /// An integer computed of literals: exact, of the smallest type that holds it.
    fn literal_result(&mut self, v: i128, span: Span) -> Operand {
        let (low, high) = (range(Elem::Lint).0, range(Elem::Ulint).1);
        if !(low..=high).contains(&v) {
            self.report(Code::OutOfRange, span, format!("{v} does not fit any integer type ({low}..{high})")).help =
                Some("write a REAL literal, `1.0`".into());
            return self.error(span);
        }
        let ty = self.literal_type(v);
        Operand { flex: true, ..self.constant(Value::Int(v), ty, span) }
    }

    pub(crate) fn binary_expr(&mut self, op: BinaryOp, a: &'a Expr, b: &'a Expr, span: Span) -> Operand {
        let left = self.expr(a);
        self.applied(op, left, b, span)
    }

    /// A row of operators, from the left.
    pub(crate) fn chain(&mut self, first: &'a Expr, links: &'a [Link]) -> Operand {
        let first = self.expr(first);
        links.iter().fold(first, |left, link| self.applied(link.op, left, &link.right, link.span))
    }

    fn applied(&mut self, op: BinaryOp, left: Operand, b: &'a Expr, span: Span) -> Operand {
        if matches!(op, BinaryOp::AndThen | BinaryOp::OrElse) {
            return self.short_circuit(op, left, b, span);
        }
        let left = self.settled(left, b);
        let right = self.expr(b);
        self.binary(op, left, right, span)
    }

    fn short_circuit(&mut self, op: BinaryOp, left: Operand, right: &'a Expr, span: Span) -> Operand {
        let bool_type = self.bool_type();
        let left = self.condition_operand(left);
        let result = self.b.local(Ty::I64);
        let value = self.value(&left);
        self.b.push(Inst::Copy { dst: result, src: value });
        let (more, end) = (self.b.block(), self.b.block());
        let (then, other) = if op == BinaryOp::AndThen { (more, end) } else { (end, more) };
        self.b.end(Term::Branch { cond: value, then, other });
        self.b.go_to(more);
        let right = self.expr(right);
        let right = self.condition_operand(right);
        let value = self.value(&right);
        self.b.push(Inst::Copy { dst: result, src: value });
        self.b.continue_in(end);
        if left.is_error() || right.is_error() {
            return self.error(span);
        }
        self.exact(result, bool_type, span)
    }

    /// The operand if it is BOOL; else reported.
    pub(crate) fn condition_operand(&mut self, operand: Operand) -> Operand {
        let operand = self.truth(operand);
        if operand.is_error() || self.class(operand.ty) == Class::Bool && !matches!(operand.kind, Kind::Void) {
            return operand;
        }
        let (name, span) = (self.operand_name(&operand), operand.span);
        self.report(Code::TypeMismatch, span, format!("expected `BOOL`, found {name}"));
        self.error(span)
    }

    /// The literals 0 and 1 are FALSE and TRUE where a BOOL is needed.
    fn truth(&mut self, operand: Operand) -> Operand {
        if !operand.is_bit() {
            return operand;
        }
        Operand { ty: self.bool_type(), flex: false, ..operand }
    }

    /// The operand's type for messages.
    pub(crate) fn operand_name(&self, operand: &Operand) -> String {
        match operand.kind {
            Kind::Void => "a call without result".into(),
            _ => format!("`{}`", self.type_name(operand.ty)),
        }
    }

    pub(crate) fn binary(&mut self, op: BinaryOp, a: Operand, b: Operand, span: Span) -> Operand {
        if a.is_error() || b.is_error() {
            return self.error(span);
        }
        use BinaryOp::*;
        let b = if op == Div { self.check_divisor(b) } else { b };
        let (a, b) = match (self.class(a.ty), self.class(b.ty)) {
            (Class::Bool, Class::Int(_)) => (a, self.truth(b)),
            (Class::Int(_), Class::Bool) => (self.truth(a), b),
            (Class::Char(_), Class::Text | Class::Wide) => {
                let b = self.character(b, a.ty);
                (a, b)
            }
            (Class::Text | Class::Wide, Class::Char(_)) => (self.character(a, b.ty), b),
            _ => (a, b),
        };
        let (ca, cb) = (self.class(a.ty), self.class(b.ty));
        if is_comparison(op) {
            self.lint_equality(op, &a, &b, span);
            self.lint_range(op, &a, &b, span);
        }
        match (op, ca, cb) {
            (And | Or | Xor | Eq | Ne | Lt | Le | Gt | Ge, Class::Bool, Class::Bool) => {
                let ty = self.bool_type();
                let result = self.fold_or_emit(int_op(op, Elem::Bool), &[&a, &b], ty, span);
                Operand { exact: true, ..result }
            }
            (Power, Class::Int(_) | Class::Real(_), Class::Int(_) | Class::Real(_)) => self.power(a, b, span),
            (_, Class::Int(_) | Class::Real(_), Class::Real(_)) | (_, Class::Real(_), Class::Int(_)) => self.real_binary(op, a, b, span),
            (_, Class::Int(x), Class::Int(y)) => self.int_binary(op, (a, x), (b, y), span),
            (_, Class::Duration(_) | Class::Moment(_), _) | (_, _, Class::Duration(_)) => self.time_binary(op, a, b, span),
            (_, Class::Text, Class::Text) | (_, Class::Wide, Class::Wide) if is_comparison(op) => self.text_comparison(op, a, b, span),
            (Add | Sub | Eq | Ne | Lt | Le | Gt | Ge, Class::Pointer, Class::Pointer | Class::Int(_))
            | (Eq | Ne, Class::Int(_), Class::Pointer) => self.pointer_binary(op, a, b, span),
            (_, Class::Char(x), Class::Char(y)) if is_comparison(op) => {
                let ty = self.bool_type();
                let result = self.fold_or_emit(int_op(op, common_int(x, y)), &[&a, &b], ty, span);
                Operand { exact: true, ..result }
            }
            _ => self.bad_operands(op, &a, &b, span),
        }
    }

    fn bad_operands(&mut self, op: BinaryOp, a: &Operand, b: &Operand, span: Span) -> Operand {
        let (x, y) = (self.operand_name(a), self.operand_name(b));
        self.report(Code::BadOperand, span, format!("`{}` does not accept {x} and {y}", sign(op)));
        self.error(span)
    }

    fn int_binary(&mut self, op: BinaryOp, (a, x): (Operand, Elem), (b, y): (Operand, Elem), span: Span) -> Operand {
        let fits = |operand: &Operand, e: Elem| match operand.kind {
            Kind::Const(Value::Int(v)) if operand.flex => (range(e).0..=range(e).1).contains(&v),
            _ => shifted(operand),
        };
        let (e, ty) = match (a.flex, b.flex) {
            (false, true) if fits(&b, x) => (x, a.ty),
            (true, false) if fits(&a, y) => (y, b.ty),
            _ if a.ty == b.ty => (x, a.ty),
            _ => {
                let e = common_int(x, y);
                (e, self.c.elem(e))
            }
        };
        let ty = match self.c.types.get(ty) {
            Type::Subrange { base, .. } => self.c.elem(*base),
            Type::Enum(_) if !is_comparison(op) => self.c.elem(e),
            _ => ty,
        };
        if let (BinaryOp::Div, Kind::Const(Value::Int(0))) = (op, &b.kind) {
            return self.constant_zero(&b, span);
        }
        if let (Kind::Const(Value::Int(x)), Kind::Const(Value::Int(y)), true, true) = (&a.kind, &b.kind, a.flex, b.flex)
            && let Some(v) = of_literals(op, *x, *y)
        {
            return self.literal_result(v, span);
        }
        let comparison = is_comparison(op);
        let result_type = if comparison { self.bool_type() } else { ty };
        let result = self.fold_or_emit(int_op(op, e), &[&a, &b], result_type, span);
        let flex = a.flex && b.flex;
        match op {
            _ if comparison => Operand { exact: true, ..result },
            BinaryOp::And | BinaryOp::Or | BinaryOp::Xor if !shifted(&a) && !shifted(&b) => {
                Operand { exact: a.exact && b.exact, flex, ..result }
            }
            _ => Operand { flex, ..self.computed(result) },
        }
    }

    fn constant_zero(&mut self, zero: &Operand, span: Span) -> Operand {
        self.report(Code::DivisionByZero, zero.span, "division by zero");
        self.error(span)
    }

    fn real_binary(&mut self, op: BinaryOp, a: Operand, b: Operand, span: Span) -> Operand {
        use BinaryOp::*;
        if matches!(op, Mod | And | Or | Xor | AndThen | OrElse) {
            return self.bad_operands(op, &a, &b, span);
        }
        let flex = a.flex && b.flex;
        let single = self.is_single(&a, &b);
        let ty = self.c.elem(if single { Elem::Real } else { Elem::Lreal });
        let (a, b) = (self.as_real(a, ty), self.as_real(b, ty));
        let result = if is_comparison(op) { self.bool_type() } else { ty };
        let operand = self.fold_or_emit(real_op(op, single), &[&a, &b], result, span);
        Operand { exact: true, flex: flex && matches!(operand.kind, Kind::Const(_)) && !is_comparison(op), ..operand }
    }

    /// Whether REAL is enough for both: no LREAL that is not a literal within its range, no 64-bit integer.
    fn is_single(&self, a: &Operand, b: &Operand) -> bool {
        let wide = |o: &Operand| match self.class(o.ty) {
            Class::Real(Elem::Lreal) => !o.flex || o.exceeds_real(),
            Class::Int(e) => !o.flex && takt_ir::elem_size(e) == 8,
            _ => false,
        };
        let single = |o: &Operand| self.class(o.ty) == Class::Real(Elem::Real);
        (single(a) || single(b)) && !wide(a) && !wide(b)
    }

    /// The operand as the REAL type, without complaint.
    pub(crate) fn as_real(&mut self, a: Operand, ty: TypeId) -> Operand {
        if a.ty == ty { a } else { self.explicit(a, ty) }
    }

    fn power(&mut self, a: Operand, b: Operand, span: Span) -> Operand {
        if let (Class::Int(x), Class::Int(_)) = (self.class(a.ty), self.class(b.ty)) {
            let ty = if a.flex { self.c.elem(Elem::Lint) } else { self.c.elem(x) };
            let flex = a.flex && b.flex;
            let result = self.fold_or_emit(Op::Expt, &[&a, &b], ty, span);
            let result = Operand { flex: flex && matches!(result.kind, Kind::Const(_)), ..result };
            return self.computed(result);
        }
        let single = self.is_single(&a, &b);
        let ty = self.c.elem(if single { Elem::Real } else { Elem::Lreal });
        let (a, b) = (self.as_real(a, ty), self.as_real(b, ty));
        let result = self.fold_or_emit(if single { Op::PowF32 } else { Op::PowF64 }, &[&a, &b], ty, span);
        Operand { exact: true, ..result }
    }

    /// `EXPT(a, b)`: LREAL for operands of any numeric type, so that `EXPT(10, -2)` is 0.01.
    pub(crate) fn expt(&mut self, a: Operand, b: Operand, span: Span) -> Operand {
        if a.is_error() || b.is_error() {
            return self.error(span);
        }
        let numeric = |class| matches!(class, Class::Int(_) | Class::Real(_));
        if !numeric(self.class(a.ty)) || !numeric(self.class(b.ty)) {
            return self.bad_operands(BinaryOp::Power, &a, &b, span);
        }
        let flex = a.flex && b.flex;
        let ty = self.c.elem(Elem::Lreal);
        let (a, b) = (self.as_real(a, ty), self.as_real(b, ty));
        let result = self.fold_or_emit(Op::PowF64, &[&a, &b], ty, span);
        Operand { exact: true, flex: flex && matches!(result.kind, Kind::Const(_)), ..result }
    }

    fn pointer_binary(&mut self, op: BinaryOp, a: Operand, b: Operand, span: Span) -> Operand {
        let ty = match op {
            _ if is_comparison(op) => self.bool_type(),
            BinaryOp::Sub if self.class(b.ty) == Class::Pointer => self.c.elem(Elem::Lint),
            BinaryOp::Add if self.class(b.ty) == Class::Pointer => return self.bad_operands(op, &a, &b, span),
            _ => a.ty,
        };
        let result = self.fold_or_emit(int_op(op, Elem::Lword), &[&a, &b], ty, span);
        Operand { exact: true, ..result }
    }

    /// Applies an IR operator: at once if all operands are constant, else as an instruction.
    pub(crate) fn fold_or_emit(&mut self, op: Op, operands: &[&Operand], ty: TypeId, span: Span) -> Operand {
        let words: Option<Vec<u64>> = operands
            .iter()
            .zip(op.args())
            .map(|(o, ty)| match (&o.kind, ty) {
                (Kind::Const(Value::Int(v)), Ty::I64) => Some(*v as u64),
                (Kind::Const(Value::Real(v)), Ty::F64) => Some(v.to_bits()),
                (Kind::Const(Value::Real(v)), Ty::F32) => Some((*v as f32).to_bits().into()),
                _ => None,
            })
            .collect();
        if let Some(words) = words
            && !(op.faults() && words[1] == 0)
        {
            let mut three = [0; 3];
            three[..words.len()].copy_from_slice(&words);
            let word = op.eval(three);
            let value = match op.result() {
                Ty::F32 => Value::Real(f32::from_bits(word as u32).into()),
                Ty::F64 => Value::Real(f64::from_bits(word)),
                _ if self.scalar(ty).is_some_and(is_unsigned_64) => Value::Int(word.into()),
                _ => Value::Int((word as i64).into()),
            };
            return self.constant(value, ty, span);
        }
        let locals: Vec<Local> = operands.iter().map(|o| self.value(o)).collect();
        let site = self.site(span);
        let local = self.b.op(op, &locals, site);
        self.temp(local, ty, span)
    }
}

/// The IR operator for integers that are held as `e`.
pub(crate) fn int_op(op: BinaryOp, e: Elem) -> Op {
    let unsigned = is_unsigned_64(e);
    match (op, unsigned) {
        (BinaryOp::Add, _) => Op::Add,
        (BinaryOp::Sub, _) => Op::Sub,
        (BinaryOp::Mul, _) => Op::Mul,
        (BinaryOp::Div, false) => Op::Div,
        (BinaryOp::Div, true) => Op::DivU,
        (BinaryOp::Mod, false) => Op::Rem,
        (BinaryOp::Mod, true) => Op::RemU,
        (BinaryOp::Power, _) => Op::Expt,
        (BinaryOp::Eq, _) => Op::Eq,
        (BinaryOp::Ne, _) => Op::Ne,
        (BinaryOp::Lt, false) => Op::Lt,
        (BinaryOp::Lt, true) => Op::LtU,
        (BinaryOp::Le, false) => Op::Le,
        (BinaryOp::Le, true) => Op::LeU,
        (BinaryOp::Gt, false) => Op::Gt,
        (BinaryOp::Gt, true) => Op::GtU,
        (BinaryOp::Ge, false) => Op::Ge,
        (BinaryOp::Ge, true) => Op::GeU,
        (BinaryOp::And | BinaryOp::AndThen, _) => Op::And,
        (BinaryOp::Or | BinaryOp::OrElse, _) => Op::Or,
        (BinaryOp::Xor, _) => Op::Xor,
    }
}

/// Whether this is a literal shifted by a variable: its value may exceed any type it is needed in.
fn shifted(operand: &Operand) -> bool {
    operand.flex && !matches!(operand.kind, Kind::Const(_))
}

/// What arithmetic of two literals come to, without a limit of width; `None` for the others.
fn of_literals(op: BinaryOp, x: i128, y: i128) -> Option<i128> {
    match op {
        BinaryOp::Add => Some(x + y),
        BinaryOp::Sub => Some(x - y),
        BinaryOp::Mul => x.checked_mul(y),
        BinaryOp::Div => x.checked_div(y),
        BinaryOp::Mod => Some(x.checked_rem(y).unwrap_or(0)),
        _ => None,
    }
}

fn real_op(op: BinaryOp, single: bool) -> Op {
    use BinaryOp::*;
    match (op, single) {
        (Add, true) => Op::AddF32,
        (Add, false) => Op::AddF64,
        (Sub, true) => Op::SubF32,
        (Sub, false) => Op::SubF64,
        (Mul, true) => Op::MulF32,
        (Mul, false) => Op::MulF64,
        (Div, true) => Op::DivF32,
        (Div, false) => Op::DivF64,
        (Eq, true) => Op::EqF32,
        (Eq, false) => Op::EqF64,
        (Ne, true) => Op::NeF32,
        (Ne, false) => Op::NeF64,
        (Lt, true) => Op::LtF32,
        (Lt, false) => Op::LtF64,
        (Le, true) => Op::LeF32,
        (Le, false) => Op::LeF64,
        (Gt, true) => Op::GtF32,
        (Gt, false) => Op::GtF64,
        (_, true) => Op::GeF32,
        (_, false) => Op::GeF64,
    }
}
