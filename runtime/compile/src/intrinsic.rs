//! The overloaded functions of IEC 61131-3 that the compiler knows itself: they follow the types of their arguments.

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand, Thing};
use crate::operator::{Class, common_int, is_unsigned_64};
use crate::scope::{Item, key};
use crate::types::elementary;
use takt_abi::Elem;
use takt_ir::{Op, Ty, Type, TypeId};
use takt_syntax::tree::{Arg, BinaryOp, Expr, ExprKind, UnaryOp};
use takt_syntax::{Code, Span};

/// Functions of one REAL or LREAL: name, REAL operator, LREAL operator.
const REAL_FUNCTIONS: &[(&str, Op, Op)] = &[
    ("SQRT", Op::SqrtF32, Op::SqrtF64),
    ("LN", Op::LnF32, Op::LnF64),
    ("LOG", Op::LogF32, Op::LogF64),
    ("EXP", Op::ExpF32, Op::ExpF64),
    ("SIN", Op::SinF32, Op::SinF64),
    ("COS", Op::CosF32, Op::CosF64),
    ("TAN", Op::TanF32, Op::TanF64),
    ("ASIN", Op::AsinF32, Op::AsinF64),
    ("ACOS", Op::AcosF32, Op::AcosF64),
    ("ATAN", Op::AtanF32, Op::AtanF64),
    ("FLOOR", Op::FloorF32, Op::FloorF64),
    ("CEIL", Op::CeilF32, Op::CeilF64),
];

/// Operators in functional form.
const OPERATOR_FUNCTIONS: &[(&str, BinaryOp)] = &[
    ("ADD", BinaryOp::Add),
    ("SUB", BinaryOp::Sub),
    ("MUL", BinaryOp::Mul),
    ("DIV", BinaryOp::Div),
    ("MOD", BinaryOp::Mod),
    ("AND", BinaryOp::And),
    ("OR", BinaryOp::Or),
    ("XOR", BinaryOp::Xor),
    ("GT", BinaryOp::Gt),
    ("GE", BinaryOp::Ge),
    ("EQ", BinaryOp::Eq),
    ("LE", BinaryOp::Le),
    ("LT", BinaryOp::Lt),
    ("NE", BinaryOp::Ne),
];

/// The rest of them, without the conversions.
const OTHERS: &[&str] = &[
    "ABS",
    "EXPT",
    "MIN",
    "MAX",
    "LIMIT",
    "SEL",
    "MUX",
    "MOVE",
    "NOT",
    "SHL",
    "SHR",
    "ROL",
    "ROR",
    "ATAN2",
    "TRUNC",
    "TRUNC_INT",
    "ROUND",
];

/// Names of the parameters, where arguments may be named.
fn parameters(name: &str) -> &'static [&'static str] {
    match name {
        "LIMIT" => &["MN", "IN", "MX"],
        "SEL" => &["G", "IN0", "IN1"],
        "SHL" | "SHR" | "ROL" | "ROR" => &["IN", "N"],
        "ATAN2" => &["Y", "X"],
        "EXPT" | "SUB" | "DIV" | "MOD" => &["IN1", "IN2"],
        _ => &["IN"],
    }
}

impl<'a> Lowering<'_, 'a> {
    /// Calls the overloaded function of that name, or reports that there is none.
    pub(crate) fn intrinsic(&mut self, name: &str, at: Span, args: &'a [Arg], span: Span) -> Operand {
        let upper = key(name);
        match upper.as_str() {
            "ADR" => return self.adr(args, span),
            "SIZEOF" | "XSIZEOF" => return self.size_of(args, span),
            "LOWER_BOUND" | "UPPER_BOUND" => return self.bound(&upper, args, span),
            _ => {}
        }
        let known = self.is_intrinsic(&upper);
        if !known {
            self.check_arguments(args);
            let help = near_function(&upper).or_else(|| self.c.suggest(name, false));
            self.report(Code::UnknownName, at, format!("there is no function `{name}`")).help = help;
            return self.error(span);
        }
        let Some(operands) = self.arguments(&upper, args, span) else { return self.error(span) };
        self.apply(&upper, operands, span)
    }

    fn is_intrinsic(&self, name: &str) -> bool {
        OTHERS.contains(&name)
            || REAL_FUNCTIONS.iter().any(|(n, ..)| *n == name)
            || OPERATOR_FUNCTIONS.iter().any(|(n, _)| *n == name)
            || conversion(name).is_some()
    }

    /// The arguments in order of the parameters.
    fn arguments(&mut self, name: &str, args: &'a [Arg], span: Span) -> Option<Vec<Operand>> {
        let names = parameters(name);
        let mut operands: Vec<(usize, Operand)> = Vec::new();
        let mut failed = false;
        for (i, arg) in args.iter().enumerate() {
            let Some(value) = &arg.value else { continue };
            let operand = self.expr(value);
            let later = args[i + 1..].iter().filter_map(|arg| arg.value.as_ref());
            let operand = later.fold(operand, |operand, next| self.settled(operand, next));
            failed |= operand.is_error();
            let place = match &arg.name {
                None => i,
                Some(n) => match names.iter().position(|p| *p == key(&n.text)) {
                    Some(p) => p,
                    None if key(&n.text).starts_with("IN") || key(&n.text) == "K" => i,
                    None => {
                        self.report(Code::BadArgument, n.span, format!("`{name}` has no parameter `{}`", n.text));
                        failed = true;
                        i
                    }
                },
            };
            if matches!(operand.kind, Kind::Void) {
                self.report(Code::TypeMismatch, operand.span, "a call without result is no argument");
                failed = true;
            }
            operands.push((place, operand));
        }
        operands.sort_by_key(|(place, _)| *place);
        let (least, most) = counts(name);
        if !failed && !(least..=most).contains(&operands.len()) {
            let wanted = if least == most { least.to_string() } else { format!("at least {least}") };
            self.report(Code::BadArgument, span, format!("`{name}` takes {wanted} argument(s), found {}", operands.len()));
            failed = true;
        }
        (!failed).then(|| operands.into_iter().map(|(_, o)| o).collect())
    }

    fn apply(&mut self, name: &str, mut operands: Vec<Operand>, span: Span) -> Operand {
        if let Some((from, to)) = conversion(name) {
            return self.named_conversion(from, to, operands.remove(0), span);
        }
        if let Some((_, single, double)) = REAL_FUNCTIONS.iter().find(|(n, ..)| *n == name) {
            return self.real_function(name, *single, *double, operands.remove(0), span);
        }
        if let Some((_, op)) = OPERATOR_FUNCTIONS.iter().find(|(n, _)| *n == name) {
            let mut rest = operands.into_iter();
            let Some(first) = rest.next() else { return self.error(span) };
            return rest.fold(first, |a, b| self.binary(*op, a, b, span));
        }
        match name {
            "EXPT" => {
                let exponent = operands.remove(1);
                self.expt(operands.remove(0), exponent, span)
            }
            "ABS" => self.abs(operands.remove(0), span),
            "NOT" => self.unary(UnaryOp::Not, operands.remove(0), span),
            "MOVE" => operands.remove(0),
            "MIN" | "MAX" => self.extreme(name, operands, span),
            "LIMIT" => {
                let mut three = operands.into_iter();
                let (Some(low), Some(value), Some(high)) = (three.next(), three.next(), three.next()) else { return self.error(span) };
                let capped = self.extreme("MIN", vec![value, high], span);
                self.extreme("MAX", vec![low, capped], span)
            }
            "SEL" => {
                let selector = operands.remove(0);
                self.select(selector, operands, span)
            }
            "MUX" => {
                let selector = operands.remove(0);
                self.multiplex(selector, operands, span)
            }
            "SHL" | "SHR" | "ROL" | "ROR" => self.shift(name, operands, span),
            "ATAN2" => self.atan2(operands, span),
            "TRUNC" | "TRUNC_INT" => self.trunc(name, operands.remove(0), span),
            _ => self.round(operands.remove(0), span),
        }
    }

    fn refuse(&mut self, name: &str, operand: &Operand, span: Span) -> Operand {
        let found = self.operand_name(operand);
        self.report(Code::BadOperand, operand.span, format!("`{name}` does not accept {found}"));
        self.error(span)
    }

    fn real_function(&mut self, name: &str, single: Op, double: Op, a: Operand, span: Span) -> Operand {
        let real = match self.class(a.ty) {
            Class::Real(Elem::Real) => Elem::Real,
            Class::Real(_) | Class::Int(_) => Elem::Lreal,
            _ => return self.refuse(name, &a, span),
        };
        let ty = self.c.elem(real);
        let a = self.as_real(a, ty);
        let result = self.fold_or_emit(if real == Elem::Real { single } else { double }, &[&a], ty, span);
        Operand { exact: true, ..result }
    }

    fn atan2(&mut self, mut operands: Vec<Operand>, span: Span) -> Operand {
        let (y, x) = (operands.remove(0), operands.remove(0));
        for operand in [&y, &x] {
            if !matches!(self.class(operand.ty), Class::Real(_) | Class::Int(_)) {
                return self.refuse("ATAN2", operand, span);
            }
        }
        let single = self.class(y.ty) == Class::Real(Elem::Real) && self.class(x.ty) == Class::Real(Elem::Real);
        let ty = self.c.elem(if single { Elem::Real } else { Elem::Lreal });
        let (y, x) = (self.as_real(y, ty), self.as_real(x, ty));
        let result = self.fold_or_emit(if single { Op::Atan2F32 } else { Op::Atan2F64 }, &[&y, &x], ty, span);
        Operand { exact: true, ..result }
    }

    fn abs(&mut self, a: Operand, span: Span) -> Operand {
        match self.class(a.ty) {
            Class::Int(e) if is_unsigned_64(e) => a,
            Class::Int(_) => {
                let flex = a.flex;
                let result = self.fold_or_emit(Op::Abs, &[&a], a.ty, span);
                let result = Operand { flex, ..result };
                self.computed(result)
            }
            Class::Real(e) => {
                let result = self.fold_or_emit(if e == Elem::Real { Op::AbsF32 } else { Op::AbsF64 }, &[&a], a.ty, span);
                Operand { exact: true, ..result }
            }
            _ => self.refuse("ABS", &a, span),
        }
    }

    /// The type that all operands of a selection share.
    fn common(&mut self, name: &str, operands: &[Operand], span: Span) -> Option<TypeId> {
        let mut ty = operands.first()?.ty;
        let mut flex = operands.first()?.flex;
        for operand in &operands[1..] {
            ty = match (self.class(ty), self.class(operand.ty)) {
                _ if ty == operand.ty => ty,
                (Class::Int(_), Class::Int(_)) if flex => operand.ty,
                (Class::Int(_), Class::Int(_)) if operand.flex => ty,
                (Class::Int(a), Class::Int(b)) => self.c.elem(common_int(a, b)),
                (Class::Real(_), Class::Int(e)) if operand.flex || takt_ir::elem_size(e) < 8 => ty,
                (Class::Int(e), Class::Real(_)) if flex || takt_ir::elem_size(e) < 8 => operand.ty,
                (Class::Real(_), Class::Int(_)) | (Class::Int(_), Class::Real(_)) => self.c.elem(Elem::Lreal),
                (Class::Real(_), Class::Real(_)) if flex => operand.ty,
                (Class::Real(_), Class::Real(_)) if operand.flex => ty,
                (Class::Real(_), Class::Real(_)) => self.c.elem(Elem::Lreal),
                (Class::Duration(_), Class::Duration(_)) => self.c.elem(Elem::Ltime),
                (Class::Text, Class::Text) => {
                    if self.capacity(ty) >= self.capacity(operand.ty) {
                        ty
                    } else {
                        operand.ty
                    }
                }
                _ => {
                    let (wanted, found) = (self.type_name(ty), self.operand_name(operand));
                    self.report(Code::TypeMismatch, operand.span, format!("`{name}` expected `{wanted}`, found {found}"));
                    return None;
                }
            };
            flex &= operand.flex;
        }
        let _ = span;
        Some(ty)
    }

    fn extreme(&mut self, name: &str, operands: Vec<Operand>, span: Span) -> Operand {
        if operands.iter().any(Operand::is_error) {
            return self.error(span);
        }
        let Some(ty) = self.common(name, &operands, span) else { return self.error(span) };
        if matches!(self.class(ty), Class::Bool | Class::Other | Class::Text | Class::Wide | Class::Pointer) {
            return self.refuse(name, &operands[0], span);
        }
        let flex = operands.iter().all(|o| o.flex);
        let mut best: Option<Operand> = None;
        for operand in operands {
            let operand = self.convert_operand(operand, ty);
            best = Some(match best {
                None => operand,
                Some(best) => {
                    let op = if name == "MIN" { BinaryOp::Le } else { BinaryOp::Ge };
                    let takes = self.binary(op, best.clone(), operand.clone(), span);
                    self.choose(takes, best, operand, ty, span)
                }
            });
        }
        let best = best.unwrap_or_else(|| self.error(span));
        Operand { flex: flex && matches!(best.kind, Kind::Const(_)), ..best }
    }

    /// `a` if `cond`, else `b`; both of type `ty`.
    fn choose(&mut self, cond: Operand, a: Operand, b: Operand, ty: TypeId, span: Span) -> Operand {
        if cond.is_error() || a.is_error() || b.is_error() {
            return self.error(span);
        }
        let op = match self.class_of(ty) {
            Ty::F32 => Op::SelectF32,
            Ty::F64 => Op::SelectF64,
            _ => Op::Select,
        };
        let exact = a.exact && b.exact;
        let result = self.fold_or_emit(op, &[&cond, &a, &b], ty, span);
        Operand { exact, ..result }
    }

    fn select(&mut self, selector: Operand, operands: Vec<Operand>, span: Span) -> Operand {
        let selector = self.condition_operand(selector);
        let Some(ty) = self.common("SEL", &operands, span) else { return self.error(span) };
        if selector.is_error() {
            return selector;
        }
        if self.c.register(ty).is_none() {
            let cond = self.value(&selector);
            let zero = self.b.int(0);
            return self.pick(&[(cond, operands[1].clone()), (zero, operands[0].clone())], &operands[0].clone(), ty, span);
        }
        let mut converted: Vec<Operand> = operands.into_iter().map(|o| self.convert_operand(o, ty)).collect();
        let (no, yes) = (converted.remove(0), converted.remove(0));
        self.choose(selector, yes, no, ty, span)
    }

    fn multiplex(&mut self, selector: Operand, operands: Vec<Operand>, span: Span) -> Operand {
        if !matches!(self.class(selector.ty), Class::Int(_)) {
            return self.refuse("MUX", &selector, span);
        }
        let Some(ty) = self.common("MUX", &operands, span) else { return self.error(span) };
        let word = self.exact_value(&selector);
        let site = self.site(span);
        let last = operands.last().cloned().unwrap_or_else(|| self.error(span));
        let mut choices = Vec::new();
        for (i, operand) in operands.into_iter().enumerate() {
            let number = self.b.int(i as i64);
            choices.push((self.b.op(Op::Eq, &[word, number], site), operand));
        }
        if self.c.register(ty).is_none() {
            return self.pick(&choices, &last, ty, span);
        }
        let bool_type = self.bool_type();
        let mut result = self.convert_operand(last, ty);
        for (cond, operand) in choices.into_iter().rev() {
            let operand = self.convert_operand(operand, ty);
            let cond = self.exact(cond, bool_type, span);
            result = self.choose(cond, operand, result, ty, span);
        }
        result
    }

    /// The first value whose condition is not 0, copied to a slot: for strings and structures.
    fn pick(&mut self, choices: &[(takt_ir::Local, Operand)], otherwise: &Operand, ty: TypeId, span: Span) -> Operand {
        let (size, align) = self.c.types.layout(ty);
        let slot = self.b.slot(size, align);
        let place = crate::place::Place::Memory { base: takt_ir::Base::Frame, offset: slot };
        let end = self.b.block();
        for (cond, operand) in choices {
            let (then, other) = (self.b.block(), self.b.block());
            self.b.end(takt_ir::Term::Branch { cond: *cond, then, other });
            self.b.go_to(then);
            self.assign_place(&place, ty, operand.clone(), span);
            self.b.end(takt_ir::Term::Jump(end));
            self.b.go_to(other);
        }
        self.assign_place(&place, ty, otherwise.clone(), span);
        self.b.continue_in(end);
        let mut value = self.at(place, ty, span);
        value.fixed = Some("a result");
        value
    }

    fn shift(&mut self, name: &str, mut operands: Vec<Operand>, span: Span) -> Operand {
        let (value, count) = (operands.remove(0), operands.remove(0));
        let Class::Int(e) = self.class(value.ty) else { return self.refuse(name, &value, span) };
        if !matches!(self.class(count.ty), Class::Int(_)) {
            return self.refuse(name, &count, span);
        }
        let (flex, e) = (value.flex, shifted_as(name, &value).unwrap_or(e));
        let value = if flex { Operand { ty: self.c.elem(e), ..value } } else { value };
        let lint = self.c.elem(Elem::Lint);
        let width = self.constant(Value::Int((takt_ir::elem_size(e) * 8).into()), lint, span);
        let ty = value.ty;
        let value = self.own_range(value);
        let signed = matches!(e, Elem::Sint | Elem::Int | Elem::Dint | Elem::Lint);
        let result = match name {
            "SHL" => self.fold_or_emit(Op::Shl, &[&value, &count], ty, span),
            "SHR" if signed => self.fold_or_emit(Op::ShrS, &[&value, &count, &width], ty, span),
            "SHR" => self.fold_or_emit(Op::ShrU, &[&value, &count], ty, span),
            "ROL" => self.fold_or_emit(Op::Rol, &[&value, &count, &width], ty, span),
            _ => self.fold_or_emit(Op::Ror, &[&value, &count, &width], ty, span),
        };
        if let Kind::Const(Value::Int(v)) = result.kind {
            return Operand { flex, ..self.constant(Value::Int(crate::constant::cut(v, e)), ty, span) };
        }
        let local = self.value(&result);
        let local = self.cut(local, e, span);
        Operand { flex, ..self.exact(local, ty, span) }
    }

    fn trunc(&mut self, name: &str, a: Operand, span: Span) -> Operand {
        let Class::Real(e) = self.class(a.ty) else { return self.refuse(name, &a, span) };
        let into = if name == "TRUNC" { Elem::Dint } else { Elem::Int };
        let ty = self.c.elem(into);
        let whole = self.fold_or_emit(if e == Elem::Real { Op::CutF32 } else { Op::CutF64 }, &[&a], ty, span);
        match whole.kind {
            Kind::Const(Value::Int(v)) => self.constant(Value::Int(crate::constant::cut(v, into)), ty, span),
            _ => {
                let local = self.value(&whole);
                let local = self.cut(local, into, span);
                self.exact(local, ty, span)
            }
        }
    }

    fn round(&mut self, a: Operand, span: Span) -> Operand {
        if !matches!(self.class(a.ty), Class::Real(_)) {
            return self.refuse("ROUND", &a, span);
        }
        let lint = self.c.elem(Elem::Lint);
        self.explicit(a, lint)
    }

    /// `X_TO_Y(a)` and `TO_Y(a)`.
    fn named_conversion(&mut self, from: Option<Target>, to: Target, a: Operand, span: Span) -> Operand {
        let a = match from {
            Some(Target::Elem(e)) => {
                let ty = self.c.elem(e);
                let scalar = self.scalar(a.ty).is_some();
                if scalar && a.ty != ty && !a.flex {
                    self.convert(a, ty)
                } else if a.flex {
                    self.flex_as(a, ty)
                } else {
                    a
                }
            }
            _ => a,
        };
        if a.is_error() {
            return a;
        }
        let a = Operand { span, ..a };
        match (self.class(a.ty), to) {
            (Class::Text, Target::Text) | (Class::Wide, Target::Wide) => a,
            (Class::Text | Class::Wide, _) if self.class(a.ty) == Class::Wide || to == Target::Wide => {
                self.report(Code::NotSupported, span, "conversion to and from WSTRING is not supported yet");
                self.error(span)
            }
            (Class::Text, Target::Elem(e)) => self.number_of(a, e, span),
            (Class::Other, _) => self.refuse("a conversion", &a, span),
            (_, Target::Elem(e)) => {
                let ty = self.c.elem(e);
                let a = self.own_range(Operand { flex: false, ..a });
                let result = self.explicit(a, ty);
                Operand { flex: false, ty, ..result }
            }
            (_, Target::Text) => self.text_of(a, span),
            (_, Target::Wide) => {
                self.report(Code::NotSupported, span, "conversion to WSTRING is not supported yet");
                self.error(span)
            }
        }
    }

    /// A literal given to `X_TO_Y` becomes an `X` if it can.
    fn flex_as(&mut self, a: Operand, ty: TypeId) -> Operand {
        match (self.class(a.ty), self.class(ty)) {
            (Class::Int(_) | Class::Real(_), Class::Int(_) | Class::Real(_)) => self.convert(a, ty),
            _ => self.explicit(a, ty),
        }
    }

    fn text_of(&mut self, a: Operand, span: Span) -> Operand {
        let (name, elem) = match self.class(a.ty) {
            Class::Bool => ("BOOL_TO_STRING", Elem::Bool),
            Class::Int(e) if crate::operator::is_unsigned_64(e) => ("ULINT_TO_STRING", Elem::Ulint),
            Class::Int(_) | Class::Char(_) => ("LINT_TO_STRING", Elem::Lint),
            Class::Pointer => ("ULINT_TO_STRING", Elem::Ulint),
            Class::Real(Elem::Real) => ("REAL_TO_STRING", Elem::Real),
            Class::Real(_) => ("LREAL_TO_STRING", Elem::Lreal),
            Class::Duration(Elem::Time) => ("TIME_TO_STRING", Elem::Time),
            Class::Duration(_) => ("LTIME_TO_STRING", Elem::Ltime),
            Class::Moment(Elem::Date) => ("DATE_TO_STRING", Elem::Date),
            Class::Moment(Elem::Tod) => ("TOD_TO_STRING", Elem::Tod),
            Class::Moment(_) => ("DT_TO_STRING", Elem::Dt),
            _ => return self.refuse("conversion to STRING", &a, span),
        };
        let ty = self.c.elem(elem);
        let a = self.explicit(a, ty);
        self.library_function(name, a, span)
    }

    fn number_of(&mut self, a: Operand, e: Elem, span: Span) -> Operand {
        let name = match e {
            Elem::Real | Elem::Lreal => "STRING_TO_LREAL",
            Elem::Bool => "STRING_TO_BOOL",
            Elem::Time | Elem::Ltime => "STRING_TO_LTIME",
            _ => "STRING_TO_LINT",
        };
        let result = self.library_function(name, a, span);
        let ty = self.c.elem(e);
        self.explicit(result, ty)
    }

    fn library_function(&mut self, name: &str, a: Operand, span: Span) -> Operand {
        match self.c.library_names.get(name).copied() {
            Some(Item::NativeFunction(desc)) => self.native_with(desc, vec![a], span),
            _ => {
                self.report(Code::UnknownName, span, format!("no library of this project has `{name}`"));
                self.error(span)
            }
        }
    }

    fn adr(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(value), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "`ADR` takes one variable");
            return self.error(span);
        };
        let operand = self.expr(value);
        self.address_of(operand, span)
    }

    fn size_of(&mut self, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(value), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "`SIZEOF` takes one variable or type");
            return self.error(span);
        };
        let ty = match &value.kind {
            ExprKind::Name(_) | ExprKind::Member(..) => match self.thing(value) {
                Thing::Type(ty) => ty,
                Thing::Value(operand) if !operand.is_error() => operand.ty,
                Thing::Value(_) | Thing::Error => return self.error(span),
                _ => {
                    self.report(Code::BadArgument, value.span, "`SIZEOF` takes one variable or type");
                    return self.error(span);
                }
            },
            _ => {
                let operand = self.expr(value);
                if operand.is_error() {
                    return operand;
                }
                operand.ty
            }
        };
        let size = self.c.types.size(ty);
        let udint = self.c.elem(Elem::Udint);
        Operand { flex: true, ..self.constant(Value::Int(size.into()), udint, span) }
    }

    fn bound(&mut self, name: &str, args: &'a [Arg], span: Span) -> Operand {
        let [Arg { value: Some(array), .. }, Arg { value: Some(dimension), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, format!("`{name}` takes an array and the number of a dimension"));
            return self.error(span);
        };
        let array = self.expr(array);
        let dimension = self.dimension(dimension);
        let (Some(d), false) = (dimension, array.is_error()) else { return self.error(span) };
        let lower = name == "LOWER_BOUND";
        let dint = self.c.elem(Elem::Dint);
        match (self.c.types.get(array.ty), &array.kind) {
            (Type::Array { dims, .. }, _) if d <= dims.len() => {
                let (low, high) = dims[d - 1];
                self.constant(Value::Int(if lower { low } else { high }.into()), dint, span)
            }
            (_, Kind::Place(crate::place::Place::Open { bounds, .. })) if d <= bounds.len() => {
                let (low, high) = bounds[d - 1];
                self.temp(if lower { low } else { high }, dint, span)
            }
            _ => {
                let found = self.operand_name(&array);
                self.report(Code::NotIndexable, span, format!("{found} has no dimension {d}"));
                self.error(span)
            }
        }
    }

    fn dimension(&mut self, e: &'a Expr) -> Option<usize> {
        let operand = self.expr(e);
        match operand.kind {
            Kind::Const(Value::Int(d)) if (1..=100).contains(&d) => Some(d as usize),
            Kind::Error => None,
            _ => {
                self.report(Code::NotConstant, e.span, "the number of a dimension is a constant from 1");
                None
            }
        }
    }
}

/// The overloaded function that may have been meant, as help.
fn near_function(name: &str) -> Option<String> {
    let real = REAL_FUNCTIONS.iter().map(|(n, ..)| *n);
    let all = real.chain(OPERATOR_FUNCTIONS.iter().map(|(n, _)| *n)).chain(OTHERS.iter().copied());
    crate::types::nearest(name, all.map(String::from)).map(|n| format!("did you mean `{n}`?"))
}

/// How many arguments a function takes: least and most.
fn counts(name: &str) -> (usize, usize) {
    match name {
        "MIN" | "MAX" | "ADD" | "MUL" | "AND" | "OR" | "XOR" => (2, usize::MAX),
        "MUX" => (2, usize::MAX),
        "LIMIT" | "SEL" => (3, 3),
        "SHL" | "SHR" | "ROL" | "ROR" | "ATAN2" | "EXPT" => (2, 2),
        _ if OPERATOR_FUNCTIONS.iter().any(|(n, _)| *n == name) => (2, 2),
        _ => (1, 1),
    }
}

/// The type that a literal is shifted as: in 64 bits, so that `SHL(1, 20)` is what it looks like; rotated, the smallest bit string that holds it.
fn shifted_as(name: &str, value: &Operand) -> Option<Elem> {
    let Kind::Const(Value::Int(v)) = value.kind else { return None };
    let rotated = matches!(name, "ROL" | "ROR");
    match v {
        _ if !value.flex => None,
        ..0 => Some(Elem::Lint),
        0..=0xFF if rotated => Some(Elem::Byte),
        0x100..=0xFFFF if rotated => Some(Elem::Word),
        0x1_0000..=0xFFFF_FFFF if rotated => Some(Elem::Dword),
        _ => Some(Elem::Lword),
    }
}

/// A side of a conversion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Target {
    Elem(Elem),
    Text,
    Wide,
}

fn target(name: &str) -> Option<Target> {
    match name {
        "STRING" => Some(Target::Text),
        "WSTRING" => Some(Target::Wide),
        _ => elementary(name).map(Target::Elem),
    }
}

/// `INT_TO_REAL`, `TO_REAL`: the types named.
fn conversion(name: &str) -> Option<(Option<Target>, Target)> {
    if let Some(to) = name.strip_prefix("TO_") {
        return Some((None, target(to)?));
    }
    let (from, to) = name.split_once("_TO_")?;
    Some((Some(target(from)?), target(to)?))
}
