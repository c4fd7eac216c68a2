//! Expressions, by the table of precedence of IEC 61131-3 (table 71).
//!
//! Brackets, calls and `^` bind tightest, then the signs `-`, `+`, `NOT`, then `**`, `* / MOD`, `+ -`, comparisons, `= <>`, `AND`, `XOR`, `OR`;
//! operators of one rank associate to the left. So `-a ** 2` is `(-a) ** 2`. Operators are kept on a stack of our own: only brackets recurse.

use super::{CHAIN_HEIGHT, MAX_HEIGHT, Parser};
use crate::lexer::{Kind, Token};
use crate::tree::{Arg, ArgKind, BinaryOp, Expr, ExprKind, Link, Part, UnaryOp};
use crate::{Code, Diagnostic, Span};

/// An expression and the height of its tree.
pub(super) struct Tall {
    pub(super) expr: Expr,
    pub(super) height: u32,
    /// It stood in brackets, so that what follows is not part of its row.
    pub(super) is_bracketed: bool,
}

impl Tall {
    fn leaf(kind: ExprKind, span: Span) -> Self {
        Self { expr: Expr { kind, span }, height: 1, is_bracketed: false }
    }
}

/// An operand waiting for its right neighbour.
struct Waiting {
    left: Tall,
    op: BinaryOp,
    rank: u8,
}

impl Parser<'_> {
    /// An expression. On failure the part that could be read, or an `Error` node.
    pub(super) fn expression(&mut self) -> Expr {
        self.tall_expression().expr
    }

    fn tall_expression(&mut self) -> Tall {
        let first = self.operand();
        self.binary(first)
    }

    /// The rest of an expression whose first operand has been read.
    fn binary(&mut self, first: Tall) -> Tall {
        let mut right = first;
        if self.failed || binary_op(self.kind()).is_none() {
            return right;
        }
        let mut waiting: Vec<Waiting> = Vec::new();
        while let Some((op, rank)) = binary_op(self.kind()) {
            if self.failed || self.is_in_angles && op == BinaryOp::Gt {
                break;
            }
            let sign = self.bump();
            while waiting.last().is_some_and(|last| last.rank >= rank) {
                right = self.join(waiting.pop(), right);
            }
            waiting.push(Waiting { left: right, op, rank });
            right = self.right_operand(sign);
        }
        while !waiting.is_empty() {
            right = self.join(waiting.pop(), right);
        }
        right
    }

    fn join(&mut self, waiting: Option<Waiting>, right: Tall) -> Tall {
        let Some(Waiting { mut left, op, .. }) = waiting else { return right };
        let span = left.expr.span.to(right.expr.span);
        let is_bracketed = left.is_bracketed;
        match &mut left.expr.kind {
            ExprKind::Chain(_, links) if !is_bracketed && right.height < MAX_HEIGHT => {
                links.push(Link { op, right: right.expr, span });
                left.expr.span = span;
                Tall { height: left.height.max(right.height + 1), ..left }
            }
            _ if left.height >= CHAIN_HEIGHT => {
                let height = left.height.max(right.height) + 1;
                let links = vec![Link { op, right: right.expr, span }];
                self.tower(height, span, || ExprKind::Chain(Box::new(left.expr), links))
            }
            _ => {
                let height = left.height.max(right.height) + 1;
                self.tower(height, span, || ExprKind::Binary(op, Box::new(left.expr), Box::new(right.expr)))
            }
        }
    }

    /// A node of the tree, unless the tree would become too high.
    fn tower(&mut self, height: u32, span: Span, kind: impl FnOnce() -> ExprKind) -> Tall {
        if height <= MAX_HEIGHT {
            return Tall { expr: Expr { kind: kind(), span }, height, is_bracketed: false };
        }
        let message = format!("an expression of more than {MAX_HEIGHT} nested parts");
        self.tell(Diagnostic::new(Code::TooDeep, self.gap(), message).help("compute it in several statements"));
        self.failed = true;
        Tall::leaf(ExprKind::Error, span)
    }

    /// What stands behind an operator. A statement on the next line is none.
    fn right_operand(&mut self, operator: Token) -> Tall {
        if self.token().starts_line && self.starts_statement() {
            let message = format!("expected an operand behind `{}`, found {}", self.text_of(operator), self.describe(self.token()));
            self.report(Code::UnexpectedToken, self.gap(), message);
            return Tall::leaf(ExprKind::Error, self.gap());
        }
        self.operand()
    }

    /// Signs and what they stand before.
    fn operand(&mut self) -> Tall {
        if unary_op(self.kind()).is_none() || self.kind() == Kind::Not && self.peek(1).kind == Kind::Output {
            return self.postfix();
        }
        let mut signs = Vec::new();
        while let Some(op) = unary_op(self.kind()) {
            let token = self.bump();
            signs.push((op, token.start));
        }
        let mut operand = self.postfix();
        while let Some((op, start)) = signs.pop() {
            let span = Span { start, ..operand.expr.span };
            operand = self.tower(operand.height + 1, span, || ExprKind::Unary(op, Box::new(operand.expr)));
            if matches!(operand.expr.kind, ExprKind::Error) {
                break;
            }
        }
        operand
    }

    /// The expression that begins with a place already read.
    pub(super) fn operators_behind(&mut self, place: Tall) -> Expr {
        match self.kind() {
            // A statement's `=` is a slip of `:=`.
            Kind::Eq => place.expr,
            _ => self.binary(place).expr,
        }
    }

    /// A place: what may stand left of `:=` or be called. As [`Self::expression`] without operators.
    pub(super) fn place(&mut self) -> Expr {
        self.postfix().expr
    }

    pub(super) fn postfix(&mut self) -> Tall {
        let mut base = self.primary();
        while !self.failed {
            base = match self.kind() {
                Kind::Dot => self.member(base),
                Kind::Caret => {
                    self.bump();
                    let span = self.span_from(base.expr.span.start);
                    self.tower(base.height + 1, span, || ExprKind::Deref(Box::new(base.expr)))
                }
                Kind::LBracket => self.index(base),
                Kind::LParen if is_callable(&base.expr.kind) => self.call(base),
                _ => return base,
            };
        }
        base
    }

    fn member(&mut self, base: Tall) -> Tall {
        self.bump();
        let token = self.token();
        let (start, height) = (base.expr.span.start, base.height + 1);
        match token.kind {
            Kind::Int => {
                self.bump();
                let Ok(bit) = self.text_of(token).parse() else {
                    let message = format!("`{}` is no number of a bit", self.text_of(token));
                    self.report(Code::BadLiteral, self.span_of(token), message);
                    return base;
                };
                let span = self.span_from(start);
                self.tower(height, span, || ExprKind::Part(Box::new(base.expr), Part::Bit(bit)))
            }
            Kind::PartAccess => {
                self.bump();
                let Some(part) = part_access(self.text_of(token)) else {
                    let message = format!("`{}` is no part of a number", self.text_of(token));
                    self.report(Code::BadLiteral, self.span_of(token), message);
                    return base;
                };
                let span = self.span_from(start);
                self.tower(height, span, || ExprKind::Part(Box::new(base.expr), part))
            }
            // A word on the next line is the next statement's, unless a chain of calls is broken before its names.
            kind if kind.is_name() && !(token.starts_line && self.starts_statement()) => {
                self.bump();
                let name = self.name_of(token);
                let span = self.span_from(start);
                self.tower(height, span, || ExprKind::Member(Box::new(base.expr), name))
            }
            // Members and methods may be called like a keyword (`fb.Type`, `axis.Exit`).
            kind if kind.is_reserved() && !token.starts_line && token.start == self.previous().end => {
                self.bump();
                let name = self.name_of(token);
                let span = self.span_from(start);
                self.tower(height, span, || ExprKind::Member(Box::new(base.expr), name))
            }
            _ => {
                self.missing_part("the name of a member behind `.`");
                base
            }
        }
    }

    fn index(&mut self, base: Tall) -> Tall {
        let open = self.bump();
        if !self.enter() {
            return base;
        }
        let mut indices = Vec::new();
        let mut height = base.height;
        loop {
            let index = self.tall_expression();
            height = height.max(index.height);
            indices.push(index.expr);
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.leave();
        self.close(Kind::RBracket, open);
        let span = self.span_from(base.expr.span.start);
        self.tower(height + 1, span, || ExprKind::Index(Box::new(base.expr), indices))
    }

    fn call(&mut self, base: Tall) -> Tall {
        let (args, height) = self.arguments();
        let span = self.span_from(base.expr.span.start);
        self.tower(height.max(base.height) + 1, span, || ExprKind::Call(Box::new(base.expr), args))
    }

    /// `(a, IN := b, Q => c)` and the height of its highest expression.
    pub(super) fn arguments(&mut self) -> (Vec<Arg>, u32) {
        let open = self.bump();
        let (mut args, mut height) = (Vec::new(), 0);
        if self.eat(Kind::RParen) || !self.enter() {
            return (args, height);
        }
        loop {
            let named = matches!(self.peek(1).kind, Kind::Assign | Kind::Output);
            if let Some((arg, tall)) = self.argument() {
                height = height.max(tall);
                args.push(arg);
            }
            // TwinCAT takes a comma behind the last named argument, as it writes it for outputs: `Done => , )`.
            if !self.eat(Kind::Comma) || named && self.kind() == Kind::RParen {
                break;
            }
        }
        self.leave();
        self.close(Kind::RParen, open);
        (args, height)
    }

    /// One argument; an input that is named and left open (`IN := ,`) is none.
    pub(super) fn argument(&mut self) -> Option<(Arg, u32)> {
        let start = self.token();
        let negated = start.kind == Kind::Not && self.peek(1).kind.is_name() && self.peek(2).kind == Kind::Output;
        if negated {
            self.bump();
        }
        let (kind, signs) = match (self.peek(1).kind, self.kind().is_name()) {
            (Kind::Assign, true) => (ArgKind::In, 1),
            (Kind::Output, true) if negated => (ArgKind::NotOut, 1),
            (Kind::Output, true) => (ArgKind::Out, 1),
            (Kind::Ident, true) if self.is_ref_sign(1) => (ArgKind::Ref, 2),
            _ => return self.positional(start),
        };
        let token = self.bump();
        let name = self.name_of(token);
        for _ in 0..signs {
            self.bump();
        }
        if matches!(self.kind(), Kind::Comma | Kind::RParen) {
            let span = self.span_from(start.start);
            let is_output = matches!(kind, ArgKind::Out | ArgKind::NotOut);
            return is_output.then_some((Arg { name: Some(name), kind, value: None, span }, 0));
        }
        let value = self.tall_expression();
        let span = self.span_from(start.start);
        Some((Arg { name: Some(name), kind, value: Some(value.expr), span }, value.height))
    }

    fn positional(&mut self, start: Token) -> Option<(Arg, u32)> {
        let value = self.tall_expression();
        if self.kind() == Kind::Eq && !self.failed {
            self.report(Code::UnexpectedToken, self.span_of(self.token()), "expected `,` or `)`, found `=`");
        }
        let span = self.span_from(start.start);
        Some((Arg { name: None, kind: ArgKind::In, value: Some(value.expr), span }, value.height))
    }

    /// Whether the tokens `ahead` are `REF` and `=` without a space.
    pub(super) fn is_ref_sign(&self, ahead: usize) -> bool {
        self.is_letter_sign(ahead, "REF")
    }

    /// Whether the tokens `ahead` are `word` and `=` without a space.
    pub(super) fn is_letter_sign(&self, ahead: usize, word: &str) -> bool {
        let (letters, sign) = (self.peek(ahead), self.peek(ahead + 1));
        letters.kind == Kind::Ident
            && sign.kind == Kind::Eq
            && letters.end == sign.start
            && self.text_of(letters).eq_ignore_ascii_case(word)
    }

    fn primary(&mut self) -> Tall {
        let token = self.token();
        let span = self.span_of(token);
        if self.failed {
            return Tall::leaf(ExprKind::Error, self.gap());
        }
        match token.kind {
            Kind::Ident if self.peek(1).kind != Kind::Hash => {
                self.bump();
                Tall::leaf(ExprKind::Name(self.text_of(token).to_owned()), span)
            }
            Kind::Int | Kind::Literal | Kind::True | Kind::False => {
                self.bump();
                self.literal(token)
            }
            Kind::LParen => self.brackets(token),
            Kind::This | Kind::Super => {
                self.bump();
                Tall::leaf(if token.kind == Kind::This { ExprKind::This } else { ExprKind::Super }, span)
            }
            Kind::Direct => Tall::leaf(ExprKind::Direct(self.direct()), span),
            Kind::Dot if self.peek(1).kind.is_name() => {
                self.bump();
                let token = self.bump();
                Tall::leaf(ExprKind::Global(self.name_of(token)), self.span_from(span.start))
            }
            // The standard functions of the same name: `AND(a, b)`.
            Kind::And | Kind::Or | Kind::Xor | Kind::Mod if self.peek(1).kind == Kind::LParen => {
                self.bump();
                Tall::leaf(ExprKind::Name(self.text_of(token).to_owned()), span)
            }
            Kind::Bad => {
                self.bump();
                Tall::leaf(ExprKind::Error, span)
            }
            kind if kind.is_name() => self.typed_name(),
            kind if kind.is_reserved() && !token.starts_line && self.is_lone_keyword() => {
                let message = format!("expected an expression, found the keyword `{}`", self.text_of(token));
                self.report(Code::UnexpectedToken, span, message);
                self.bump();
                Tall::leaf(ExprKind::Error, span)
            }
            _ => {
                self.missing_part("an expression");
                Tall::leaf(ExprKind::Error, self.gap())
            }
        }
    }

    /// Whether a keyword stands where a value ends: it was meant as one.
    fn is_lone_keyword(&self) -> bool {
        let is_statement = matches!(self.kind(), Kind::Then | Kind::Do | Kind::Of | Kind::To | Kind::By);
        let next = self.peek(1).kind;
        !is_statement
            && !super::is_end(self.kind())
            && (matches!(next, Kind::Semi | Kind::RParen | Kind::Comma) || binary_op(next).is_some())
    }

    /// `E_COLOR#red`, or a name that is a word in other places.
    fn typed_name(&mut self) -> Tall {
        let token = self.bump();
        if self.kind() != Kind::Hash {
            return Tall::leaf(ExprKind::Name(self.text_of(token).to_owned()), self.span_of(token));
        }
        self.bump();
        let ty = self.name_of(token);
        let member = self.name("the name of an enumerator behind `#`");
        Tall::leaf(ExprKind::Typed(ty, member), self.span_from(token.start))
    }

    /// `(a)` and `(a := b)`.
    fn brackets(&mut self, open: Token) -> Tall {
        self.bump();
        if !self.enter() {
            return Tall::leaf(ExprKind::Error, self.span_of(open));
        }
        let mut inner = self.tall_expression();
        if self.eat(Kind::Assign) {
            let value = self.tall_expression();
            let span = inner.expr.span.to(value.expr.span);
            let height = inner.height.max(value.height) + 1;
            inner = self.tower(height, span, || ExprKind::Assign(Box::new(inner.expr), Box::new(value.expr)));
        }
        self.leave();
        self.close(Kind::RParen, open);
        if !self.failed {
            inner.expr.span = self.span_from(open.start);
            inner.is_bracketed = true;
        }
        inner
    }

    /// Fails for want of something that belongs to the line of the last token, if the present one begins another.
    fn missing_part(&mut self, what: &str) {
        let token = self.token();
        if !self.is_known_trouble() {
            let mut diagnostic = self.unexpected(what);
            if token.starts_line || matches!(token.kind, Kind::Semi | Kind::Eof) {
                diagnostic.span = self.gap();
            }
            if token.kind == Kind::LBracket {
                diagnostic.help = Some("lists `[…]` stand only behind the `:=` of a declaration".to_owned());
            }
            self.tell(diagnostic);
        }
        self.failed = true;
    }
}

fn is_callable(kind: &ExprKind) -> bool {
    use ExprKind::*;
    matches!(kind, Name(_) | Global(_) | Member(..) | Deref(_) | Index(..) | Call(..) | This | Super)
}

fn unary_op(kind: Kind) -> Option<UnaryOp> {
    match kind {
        Kind::Minus => Some(UnaryOp::Neg),
        Kind::Not => Some(UnaryOp::Not),
        Kind::Plus => Some(UnaryOp::Plus),
        _ => None,
    }
}

/// Operator and rank; a higher rank binds tighter.
fn binary_op(kind: Kind) -> Option<(BinaryOp, u8)> {
    Some(match kind {
        Kind::Power => (BinaryOp::Power, 8),
        Kind::Star => (BinaryOp::Mul, 7),
        Kind::Slash => (BinaryOp::Div, 7),
        Kind::Mod => (BinaryOp::Mod, 7),
        Kind::Plus => (BinaryOp::Add, 6),
        Kind::Minus => (BinaryOp::Sub, 6),
        Kind::Lt => (BinaryOp::Lt, 5),
        Kind::Le => (BinaryOp::Le, 5),
        Kind::Gt => (BinaryOp::Gt, 5),
        Kind::Ge => (BinaryOp::Ge, 5),
        Kind::Eq => (BinaryOp::Eq, 4),
        Kind::Ne => (BinaryOp::Ne, 4),
        Kind::And | Kind::Amp => (BinaryOp::And, 3),
        Kind::AndThen => (BinaryOp::AndThen, 3),
        Kind::Xor => (BinaryOp::Xor, 2),
        Kind::Or => (BinaryOp::Or, 1),
        Kind::OrElse => (BinaryOp::OrElse, 1),
        _ => return None,
    })
}

/// `%X3`, `%B1`.
fn part_access(text: &str) -> Option<Part> {
    let number = text.get(2..)?.parse().ok()?;
    Some(match text.as_bytes().get(1)?.to_ascii_uppercase() {
        b'X' => Part::Bit(number),
        b'B' => Part::Byte(number),
        b'W' => Part::Word(number),
        _ => Part::Dword(number),
    })
}
