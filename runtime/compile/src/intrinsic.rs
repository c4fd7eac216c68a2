//! The overloaded functions of IEC 61131-3 that the compiler knows itself: they follow the types of their arguments.

mod conversion;
mod number;
mod query;
mod selection;
mod text;
mod time;

use crate::expression::{Kind, Lowering, Operand};
use crate::scope::key;
use conversion::conversion;
use number::Decimal;
use takt_ir::Op;
use takt_syntax::tree::{Arg, BinaryOp, UnaryOp};
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

/// Those that ask where a variable is or how large, and do not read it.
const OF_PLACES: &[&str] = &["BITADR", "ADR", "REF", "SIZEOF", "XSIZEOF", "LOWER_BOUND", "UPPER_BOUND"];

/// The others.
const OTHERS: &[&str] = &["ABS", "EXPT", "MIN", "MAX", "LIMIT", "SEL", "MUX", "MOVE", "NOT", "SHL", "SHR", "ROL", "ROR", "ATAN2", "ROUND"];

/// Changes of the byte order: whether bytes are swapped (the image is little endian).
const BYTE_ORDERS: &[(&str, bool)] =
    &[("TO_BIG_ENDIAN", true), ("BIG_ENDIAN_TO", true), ("TO_LITTLE_ENDIAN", false), ("LITTLE_ENDIAN_TO", false)];

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

/// How many arguments a function takes: least and most.
fn counts(name: &str) -> (usize, usize) {
    match name {
        "MIN" | "MAX" | "MUX" | "ADD" | "MUL" | "AND" | "OR" | "XOR" | "GT" | "GE" | "EQ" | "LE" | "LT" => (2, usize::MAX),
        "LIMIT" | "SEL" => (3, 3),
        "SHL" | "SHR" | "ROL" | "ROR" | "ATAN2" | "EXPT" => (2, 2),
        _ if OPERATOR_FUNCTIONS.iter().any(|(n, _)| *n == name) || time::find(name).is_some() => (2, 2),
        _ => (1, 1),
    }
}

/// The parameter that an argument's name means, if the function has one of that name.
fn parameter(name: &str, argument: &str, position: usize) -> Option<usize> {
    let named = parameters(name).iter().position(|p| *p == argument);
    // MUX begins to count its inputs behind the selector K, the others at IN1.
    let numbered = || match (name, argument) {
        ("LIMIT" | "SEL" | "SHL" | "SHR" | "ROL" | "ROR" | "ATAN2", _) => None,
        ("MUX", "K") => Some(0),
        ("MUX", _) => argument.strip_prefix("IN")?.parse::<usize>().ok()?.checked_add(1),
        _ => argument.strip_prefix("IN")?.parse::<usize>().ok()?.checked_sub(1),
    };
    let paired = || (time::find(name).is_some() && argument.starts_with("IN")).then_some(position);
    named.or_else(numbered).or_else(paired)
}

impl<'a> Lowering<'_, 'a> {
    /// Calls the overloaded function of that name, or reports that there is none.
    pub(crate) fn intrinsic(&mut self, name: &str, at: Span, args: &'a [Arg], span: Span) -> Operand {
        let upper = key(name);
        if OF_PLACES.contains(&upper.as_str()) {
            return match upper.as_str() {
                "BITADR" => self.bit_address(args, span),
                "ADR" | "REF" => self.adr(args, span),
                "SIZEOF" | "XSIZEOF" => self.size_of(args, span),
                _ => self.bound(&upper, args, span),
            };
        }
        if !is_intrinsic(&upper) {
            self.check_arguments(args);
            if self.is_in_orphan() {
                return self.error(span);
            }
            let help = near_function(&upper).or_else(|| self.c.suggest(name, false));
            self.report(Code::UnknownName, at, format!("there is no function `{name}`")).help = help;
            return self.error(span);
        }
        let named = |argument: &str, position| parameter(&upper, argument, position);
        let Some(operands) = self.arguments(&upper, args, counts(&upper), &named, span) else { return self.error(span) };
        self.apply(&upper, operands, span)
    }

    /// The arguments in order of the parameters; `named` gives the parameter of a named one.
    fn arguments(
        &mut self,
        name: &str,
        args: &'a [Arg],
        (least, most): (usize, usize),
        named: &dyn Fn(&str, usize) -> Option<usize>,
        span: Span,
    ) -> Option<Vec<Operand>> {
        let mut operands: Vec<(usize, Operand)> = Vec::new();
        let mut failed = false;
        for (i, arg) in args.iter().enumerate() {
            let Some(value) = &arg.value else { continue };
            let operand = self.expr(value);
            let later = args[i + 1..].iter().filter_map(|arg| arg.value.as_ref());
            let operand = later.fold(operand, |operand, next| self.settled(operand, next));
            failed |= operand.is_error();
            let place = match &arg.name {
                None => Some(i),
                Some(n) => named(&key(&n.text), i),
            };
            if let (None, Some(n)) = (place, &arg.name) {
                self.report(Code::BadArgument, n.span, format!("`{name}` has no parameter `{}`", n.text));
                failed = true;
            }
            let place = place.unwrap_or(i);
            if operands.iter().any(|(p, _)| *p == place) {
                self.report(Code::BadArgument, arg.span, format!("this parameter of `{name}` is given twice"));
                failed = true;
            }
            if matches!(operand.kind, Kind::Void) {
                self.report(Code::TypeMismatch, operand.span, "a call without result is no argument");
                failed = true;
            }
            operands.push((place, operand));
        }
        operands.sort_by_key(|(place, _)| *place);
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
        if let Some(decimal) = Decimal::find(name) {
            return self.decimal(name, decimal, operands.remove(0), span);
        }
        if let Some((from, into)) = number::truncation(name) {
            return self.trunc(name, from, into, operands.remove(0), span);
        }
        if let Some(form) = time::find(name) {
            return self.time_function(form, operands, span);
        }
        if let Some((_, swaps)) = BYTE_ORDERS.iter().find(|(n, _)| *n == name) {
            return self.byte_order(name, *swaps, operands.remove(0), span);
        }
        if let Some((_, single, double)) = REAL_FUNCTIONS.iter().find(|(n, ..)| *n == name) {
            return self.real_function(name, *single, *double, operands.remove(0), span);
        }
        if let Some((_, op)) = OPERATOR_FUNCTIONS.iter().find(|(n, _)| *n == name) {
            return self.operator_function(*op, operands, span);
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
            "LIMIT" => self.limit(operands, span),
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
            _ => self.round(operands.remove(0), span),
        }
    }

    /// `ADD(a, b, c)` is `a + b + c`; `GT(a, b, c)` is `a > b AND b > c`.
    fn operator_function(&mut self, op: BinaryOp, operands: Vec<Operand>, span: Span) -> Operand {
        use BinaryOp::{Eq, Ge, Gt, Le, Lt, Ne};
        if matches!(op, Eq | Ge | Gt | Le | Lt | Ne) {
            let mut pairs: Vec<Operand> = operands.windows(2).map(|p| self.binary(op, p[0].clone(), p[1].clone(), span)).collect();
            let first = pairs.remove(0);
            return pairs.into_iter().fold(first, |a, b| self.binary(BinaryOp::And, a, b, span));
        }
        let mut rest = operands.into_iter();
        let Some(first) = rest.next() else { return self.error(span) };
        rest.fold(first, |a, b| self.binary(op, a, b, span))
    }

    fn refuse(&mut self, name: &str, operand: &Operand, span: Span) -> Operand {
        let found = self.operand_name(operand);
        self.report(Code::BadOperand, operand.span, format!("`{name}` does not accept {found}"));
        self.error(span)
    }
}

/// Whether the compiler knows a function of that name (upper case) itself.
pub(crate) fn is_known(name: &str) -> bool {
    OF_PLACES.contains(&name) || is_intrinsic(name)
}

fn is_intrinsic(name: &str) -> bool {
    OTHERS.contains(&name)
        || REAL_FUNCTIONS.iter().any(|(n, ..)| *n == name)
        || OPERATOR_FUNCTIONS.iter().any(|(n, _)| *n == name)
        || BYTE_ORDERS.iter().any(|(n, _)| *n == name)
        || conversion(name).is_some()
        || Decimal::find(name).is_some()
        || number::truncation(name).is_some()
        || time::find(name).is_some()
}

/// The overloaded function that may have been meant, as help.
fn near_function(name: &str) -> Option<String> {
    let real = REAL_FUNCTIONS.iter().map(|(n, ..)| *n);
    let all = real.chain(OPERATOR_FUNCTIONS.iter().map(|(n, _)| *n)).chain(OTHERS.iter().copied());
    crate::near::nearest(name, all).map(|n| format!("did you mean `{n}`?"))
}
