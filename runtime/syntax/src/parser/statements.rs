//! Statements.

use super::{Parser, is_end, is_statement_end, is_var};
use crate::lexer::{Kind, Token};
use crate::tree::{AssignOp, BinaryOp, CaseLabel, Expr, ExprKind, Stmt, StmtKind, VarBlock, VarKind};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    /// Statements up to a word that ends or continues an open block, or that begins a declaration.
    pub(super) fn statements(&mut self) -> Vec<Stmt> {
        self.statement_list(false)
    }

    fn statement_list(&mut self, in_case: bool) -> Vec<Stmt> {
        let mut list = Vec::new();
        let mut has_statements = false;
        loop {
            let kind = self.kind();
            if kind == Kind::Ident {
                self.respell();
                if self.respell_end() {
                    continue;
                }
            }
            if self.ends_statements() {
                if !self.skip_stray() {
                    list.shrink_to_fit();
                    return list;
                }
            } else if is_var(kind) {
                if has_statements {
                    self.late_section();
                }
                self.late_declarations();
            } else if self.is_headless_section() {
                self.headless_section();
            } else if in_case && self.is_case_label() {
                list.shrink_to_fit();
                return list;
            } else {
                let before = self.at;
                let statement = self.statement();
                has_statements |= !matches!(statement.kind, StmtKind::Error);
                list.push(statement);
                if self.at == before {
                    self.bump();
                }
            }
        }
    }

    /// Whether the present word cannot belong to a list of statements.
    pub(super) fn ends_statements(&self) -> bool {
        use Kind::*;
        let kind = self.kind();
        match kind {
            Eof | Function | FunctionBlock | Program | Type | Configuration | VarGlobal | VarConfig => true,
            Else | Elsif | Until | Catch | Finally => true,
            _ if kind.is_contextual() => self.starts_member() || self.starts_soft_unit(),
            _ => is_end(kind),
        }
    }

    /// METHOD, PROPERTY or ACTION, in front of a name; or at the start of a line where the name is missing.
    pub(super) fn starts_member(&self) -> bool {
        if !matches!(self.kind(), Kind::Method | Kind::Property | Kind::Action) {
            return false;
        }
        let next = self.peek(1);
        let is_nameless =
            self.token().starts_line && next.starts_line && (is_var(next.kind) || is_end(next.kind) && !is_statement_end(next.kind));
        next.kind.is_name() && !next.starts_line || is_nameless
    }

    /// INTERFACE, CLASS, NAMESPACE, USING, in front of a name.
    pub(super) fn starts_soft_unit(&self) -> bool {
        matches!(self.kind(), Kind::Interface | Kind::Class | Kind::Namespace | Kind::Using)
            && self.peek(1).kind.is_name()
            && !self.peek(1).starts_line
    }

    /// Complains of a word that ends or continues a block which is not open, and skips it. `false` if its block is open.
    fn skip_stray(&mut self) -> bool {
        let token = self.token();
        let kind = token.kind;
        let belongs_here = !matches!(kind, Kind::Else | Kind::Elsif | Kind::Until | Kind::Catch | Kind::Finally | Kind::EndVar)
            && !matches!(kind, Kind::EndStruct | Kind::EndUnion | Kind::EndMethod | Kind::EndAction | Kind::EndProperty)
            && !is_statement_end(kind);
        if belongs_here || self.closes_something(kind) {
            return false;
        }
        // A wrong END_ for the innermost block of statements.
        if is_statement_end(kind) && self.open.last().is_some_and(|open| is_statement_end(open.end)) {
            self.mistaken = self.open.last().map(|open| open.end);
            return false;
        }
        self.bump();
        if self.mistaken.take() != Some(kind) {
            let message = format!("`{}` belongs to no open block", self.text_of(token));
            self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(token), message));
        }
        if kind == Kind::Elsif {
            self.condition(Kind::Then);
        } else if kind == Kind::Until {
            self.mistaken = Some(Kind::EndRepeat);
            let brackets = self.brackets;
            self.until(brackets);
        }
        self.eat(Kind::Semi);
        true
    }

    /// VAR among the statements.
    fn late_section(&mut self) {
        let token = self.token();
        let message = format!("`{}` stands behind statements", self.text_of(token));
        let help = "declarations stand before the first statement; a missing `;` or END_VAR may have ended them too early";
        self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(token), message).help(help));
    }

    fn late_declarations(&mut self) {
        if let Some(block) = self.var_block() {
            self.late_vars.push(block);
        }
    }

    /// Whether declarations stand here whose VAR is missing: an END_VAR follows.
    fn is_headless_section(&mut self) -> bool {
        let declares = self.kind().is_name() && matches!(self.peek(1).kind, Kind::Colon | Kind::Comma | Kind::At);
        declares && self.is_end_var_ahead()
    }

    fn headless_section(&mut self) {
        let token = self.token();
        let message = format!("expected `VAR`, found {}", self.describe(token));
        let help = "declarations stand between `VAR` and `END_VAR`";
        self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(token), message).help(help));
        self.open_block(token, Kind::EndVar);
        let vars = self.declarations();
        self.close_block();
        let span = self.span_from(token.start);
        self.late_vars.push(VarBlock { kind: VarKind::Var, constant: false, retain: false, persistent: false, vars, span });
    }

    /// Whether the next word that begins or ends a block is END_VAR. Remembers the place, so that the way is gone once.
    fn is_end_var_ahead(&mut self) -> bool {
        if self.at >= self.end_var_ahead.0 {
            let rest = &self.lexed.tokens[self.at..];
            let is_boundary =
                |kind: Kind| is_var(kind) || is_end(kind) || matches!(kind, Kind::Eof | Kind::If | Kind::For | Kind::Case | Kind::Program);
            let distance = rest.iter().position(|token| is_boundary(token.kind)).unwrap_or(rest.len() - 1);
            self.end_var_ahead = (self.at + distance, rest[distance].kind == Kind::EndVar);
        }
        self.end_var_ahead.1
    }

    fn statement(&mut self) -> Stmt {
        let start = self.token();
        let brackets = self.brackets;
        if !self.enter() {
            self.skip_nested();
            return Stmt { kind: StmtKind::Error, span: self.span_of(start) };
        }
        let is_structured = self.peek(1).kind != Kind::Assign
            && matches!(start.kind, Kind::If | Kind::Case | Kind::For | Kind::While | Kind::Repeat | Kind::Try);
        let kind = self.statement_kind(start);
        self.leave();
        let span = self.span_from(start.start);
        if is_structured {
            self.eat(Kind::Semi);
            return Stmt { kind, span };
        }
        let failed = self.failed;
        if !matches!(kind, StmtKind::Label(_)) || failed {
            if let Some(kind) = self.headless_block(start, brackets) {
                return Stmt { kind, span: self.span_from(start.start) };
            }
            self.end_statement(brackets);
        }
        Stmt { kind: if failed { StmtKind::Error } else { kind }, span }
    }

    fn statement_kind(&mut self, start: Token) -> StmtKind {
        match start.kind {
            Kind::Semi => StmtKind::Empty,
            kind if kind.is_reserved() && self.peek(1).kind == Kind::Assign => {
                self.keyword_as_name();
                StmtKind::Error
            }
            Kind::If => self.if_statement(),
            Kind::Case => self.case_statement(),
            Kind::For => self.for_statement(),
            Kind::While => self.while_statement(),
            Kind::Repeat => self.repeat_statement(),
            Kind::Try => self.try_statement(),
            Kind::Exit => self.word(StmtKind::Exit),
            Kind::Continue if matches!(self.peek(1).kind, Kind::Semi | Kind::Eof) || self.peek(1).kind.is_reserved() => {
                self.word(StmtKind::Continue)
            }
            Kind::Return => self.return_statement(),
            Kind::Jmp => {
                self.bump();
                StmtKind::Jump(self.name("the name of a label"))
            }
            Kind::Dot | Kind::Direct | Kind::Bad | Kind::LParen | Kind::And | Kind::Or | Kind::Xor | Kind::Mod => self.simple_statement(),
            kind if kind.is_name() => self.simple_statement(),
            _ => {
                self.misplaced_start();
                StmtKind::Error
            }
        }
    }

    fn word(&mut self, kind: StmtKind) -> StmtKind {
        self.bump();
        kind
    }

    fn return_statement(&mut self) -> StmtKind {
        self.bump();
        let next = self.token();
        if next.kind == Kind::LParen
            || (next.kind.is_name() || matches!(next.kind, Kind::Int | Kind::Literal | Kind::True | Kind::False)) && !next.starts_line
        {
            let message = format!("expected `;` behind `RETURN`, found {}", self.describe(next));
            let help = "a result is assigned to the name of its function or method: `f := 1; RETURN;`";
            self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(next), message).help(help));
            self.failed = true;
        }
        StmtKind::Return
    }

    /// An assignment, a call or a label.
    fn simple_statement(&mut self) -> StmtKind {
        let place = self.postfix();
        if self.failed {
            return StmtKind::Error;
        }
        match self.kind() {
            Kind::Colon if matches!(place.expr.kind, ExprKind::Name(_)) => return self.label(place.expr),
            Kind::Plus | Kind::Minus if self.is_increment() => return StmtKind::Error,
            _ => {}
        }
        let mut targets = Vec::new();
        let mut value = self.operators_behind(place);
        while let Some(op) = self.assign_op() {
            targets.push((value, op));
            value = self.assigned_value();
            if self.failed {
                return StmtKind::Error;
            }
        }
        if targets.is_empty() { StmtKind::Expr(value) } else { StmtKind::Assign { targets, value } }
    }

    /// What stands right of `:=`. A new statement on the next line is not it.
    fn assigned_value(&mut self) -> Expr {
        let sign = self.previous();
        if self.token().starts_line && self.starts_statement() {
            let message = format!("expected a value behind `{}`, found {}", self.text_of(sign), self.describe(self.token()));
            self.report(Code::UnexpectedToken, self.gap(), message);
        }
        self.expression()
    }

    /// Takes an operator of assignment; `=` in its place is a slip.
    fn assign_op(&mut self) -> Option<AssignOp> {
        let op = match self.kind() {
            _ if self.failed => return None,
            Kind::Assign => AssignOp::Assign,
            Kind::TryAssign => AssignOp::Try,
            Kind::Eq => {
                self.slip_equal("an assignment is written `:=`; `=` compares");
                AssignOp::Assign
            }
            Kind::Ident if self.is_letter_sign(0, "S") => AssignOp::Set,
            Kind::Ident if self.is_letter_sign(0, "R") => AssignOp::Reset,
            Kind::Ident if self.is_ref_sign(0) => AssignOp::Ref,
            _ => return None,
        };
        if self.kind() == Kind::Ident {
            self.bump();
        }
        self.bump();
        Some(op)
    }

    fn label(&mut self, place: Expr) -> StmtKind {
        let colon = self.token();
        if self.peek(1).kind == Kind::Eq {
            let span = self.span_of(colon).to(self.span_of(self.peek(1)));
            self.tell(Diagnostic::new(Code::UnexpectedToken, span, "expected `:=`, found `: =`").help("write `:=` without a space"));
            self.bump();
            self.bump();
            let value = self.expression();
            return StmtKind::Assign { targets: vec![(place, AssignOp::Assign)], value };
        }
        if self.is_declaration_slip() {
            let message = format!("a declaration stands among the statements: found `:` behind {}", self.describe(self.previous()));
            let help = "declare variables in VAR … END_VAR before the first statement";
            self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(colon), message).help(help));
            self.failed = true;
            return StmtKind::Error;
        }
        self.bump();
        let ExprKind::Name(text) = place.kind else { return StmtKind::Error };
        StmtKind::Label(crate::tree::Name { text, span: place.span })
    }

    // Blocks.

    /// The condition of IF, ELSIF, WHILE or the selector of CASE, with the `word` behind it.
    fn condition(&mut self, word: Kind) -> Expr {
        let brackets = self.brackets;
        let mut expr = self.expression();
        if self.kind() == Kind::Assign && !self.failed {
            self.slip_assign();
            let value = self.expression();
            let span = expr.span.to(value.span);
            expr = Expr { kind: ExprKind::Binary(BinaryOp::Eq, Box::new(expr), Box::new(value)), span };
        }
        self.head_word(word, brackets);
        expr
    }

    /// A block whose first word is missing or misspelled: the line has its THEN, DO or OF.
    fn headless_block(&mut self, start: Token, brackets: i32) -> Option<StmtKind> {
        if self.kind() == Kind::Semi || self.token().starts_line {
            return None;
        }
        let line = self.rest_of_line(0).iter();
        let distance = line.clone().position(|token| matches!(token.kind, Kind::Then | Kind::Do | Kind::Of))?;
        let counts = line.clone().take(distance).any(|token| token.kind == Kind::To);
        let word = self.peek(distance).kind;
        let (first, end) = match word {
            Kind::Then => ("IF", Kind::EndIf),
            Kind::Of => ("CASE", Kind::EndCase),
            _ if counts => ("FOR", Kind::EndFor),
            _ => ("WHILE", Kind::EndWhile),
        };
        let message = format!("expected `{first}` before {}, as `{}` follows", self.describe(start), word.text());
        self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(start), message));
        while self.kind() != word {
            self.bump();
        }
        self.bump();
        self.brackets = brackets;
        self.failed = false;
        if !self.enter() {
            self.skip_nested();
            return Some(StmtKind::Error);
        }
        self.open_block(start, end);
        self.assumed = Some(end);
        let cond = Expr { kind: ExprKind::Error, span: self.span_of(start) };
        let kind = match word {
            Kind::Then => self.if_rest(cond),
            Kind::Of => self.case_rest(cond),
            _ => {
                let body = self.statements();
                self.close_block();
                StmtKind::While { cond, body }
            }
        };
        self.leave();
        self.eat(Kind::Semi);
        Some(kind)
    }

    fn if_statement(&mut self) -> StmtKind {
        let start = self.bump();
        self.open_block(start, Kind::EndIf);
        let cond = self.condition(Kind::Then);
        self.if_rest(cond)
    }

    fn if_rest(&mut self, cond: Expr) -> StmtKind {
        let mut arms = vec![(cond, self.statements())];
        let mut otherwise: Option<Vec<Stmt>> = None;
        loop {
            if matches!(self.kind(), Kind::Elsif | Kind::Else) && otherwise.is_some() {
                let message = format!("{} behind the `ELSE` of the same `IF`", self.describe(self.token()));
                self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(self.token()), message));
            }
            if self.kind() == Kind::Elsif {
                self.bump();
                let cond = self.condition(Kind::Then);
                arms.push((cond, self.statements()));
            } else if self.eat(Kind::Else) {
                let body = self.statements();
                otherwise.get_or_insert_default().extend(body);
            } else {
                break;
            }
        }
        self.close_block();
        StmtKind::If { arms, otherwise }
    }

    fn case_statement(&mut self) -> StmtKind {
        let start = self.bump();
        self.open_block(start, Kind::EndCase);
        let value = self.condition(Kind::Of);
        self.case_rest(value)
    }

    fn case_rest(&mut self, value: Expr) -> StmtKind {
        let (mut arms, mut otherwise) = (Vec::new(), None::<Vec<Stmt>>);
        loop {
            if self.is_case_label() {
                if otherwise.is_some() {
                    let message = "a label behind the `ELSE` of its `CASE`";
                    self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(self.token()), message));
                }
                let before = self.at;
                let labels = self.case_labels();
                if self.at == before {
                    self.bump();
                }
                arms.push((labels, self.statement_list(true)));
            } else if self.eat(Kind::Else) {
                let body = self.statement_list(true);
                otherwise.get_or_insert_default().extend(body);
            } else if self.ends_statements() {
                break;
            } else {
                if !self.is_known_trouble() {
                    self.tell(self.unexpected("a label such as `1:` or `END_CASE`"));
                }
                self.skip_to_colon();
                let before = self.at;
                self.statement_list(true);
                if self.at == before {
                    break;
                }
            }
        }
        self.close_block();
        StmtKind::Case { value, arms, otherwise }
    }

    /// `1, 3..5:`.
    fn case_labels(&mut self) -> Vec<CaseLabel> {
        let brackets = self.brackets;
        let mut labels = Vec::new();
        loop {
            let low = self.expression();
            labels.push(if self.eat(Kind::DotDot) { CaseLabel::Range(low, self.expression()) } else { CaseLabel::Value(low) });
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.expect_or_assume(Kind::Colon, "a label of CASE ends with `:`");
        if self.failed {
            self.recover_to_colon(brackets);
        }
        labels
    }

    /// Whether a label of CASE stands here: a literal, or a name that is followed by `:`, `,` or `..`.
    fn is_case_label(&self) -> bool {
        match self.kind() {
            Kind::Int | Kind::Literal | Kind::True | Kind::False | Kind::Minus | Kind::Plus | Kind::Not => return true,
            Kind::LParen => return self.has_colon_ahead(),
            kind if kind.is_name() => {}
            _ => return false,
        }
        let mut ahead = 1;
        while matches!(self.peek(ahead).kind, Kind::Dot | Kind::Hash) && self.peek(ahead + 1).kind.is_name() {
            ahead += 2;
        }
        while matches!(self.peek(ahead).kind, Kind::Plus | Kind::Minus | Kind::Star)
            && (self.peek(ahead + 1).kind == Kind::Int || self.peek(ahead + 1).kind.is_name())
        {
            ahead += 2;
        }
        match self.peek(ahead).kind {
            // `a : = 5` is a slip of an assignment, `a : INT` one of a declaration.
            Kind::Colon => self.peek(ahead + 1).kind != Kind::Eq,
            Kind::Comma | Kind::DotDot => true,
            _ => false,
        }
    }

    fn has_colon_ahead(&self) -> bool {
        let line = (1..32).map(|ahead| self.peek(ahead)).take_while(|token| !token.starts_line && token.kind != Kind::Semi);
        line.map(|token| token.kind).any(|kind| kind == Kind::Colon)
    }

    fn for_statement(&mut self) -> StmtKind {
        let start = self.bump();
        let brackets = self.brackets;
        self.open_block(start, Kind::EndFor);
        if self.kind() == Kind::LParen {
            return self.loop_of_c();
        }
        let var = Box::new(self.place());
        if self.kind() == Kind::Eq && !self.failed {
            self.slip_equal("the first value of FOR is assigned with `:=`");
            self.bump();
        } else {
            self.expect(Kind::Assign);
        }
        let from = Box::new(self.expression());
        self.expect(Kind::To);
        let to = Box::new(self.expression());
        let by = if self.eat(Kind::By) { Some(self.expression()) } else { None };
        self.head_word(Kind::Do, brackets);
        let body = self.statements();
        self.close_block();
        StmtKind::For { var, from, to, by, body }
    }

    fn loop_of_c(&mut self) -> StmtKind {
        let cond = Expr { kind: ExprKind::Error, span: self.span_of(self.token()) };
        self.head_of_c();
        let body = self.statements();
        self.close_block();
        StmtKind::While { cond, body }
    }

    fn while_statement(&mut self) -> StmtKind {
        let start = self.bump();
        self.open_block(start, Kind::EndWhile);
        let cond = self.condition(Kind::Do);
        let body = self.statements();
        self.close_block();
        StmtKind::While { cond, body }
    }

    fn repeat_statement(&mut self) -> StmtKind {
        let start = self.bump();
        self.open_block(start, Kind::EndRepeat);
        let body = self.statements();
        let mut until = Expr { kind: ExprKind::Error, span: self.gap() };
        if self.kind() == Kind::Until {
            let brackets = self.brackets;
            self.bump();
            until = self.until(brackets);
        } else if self.kind() == Kind::EndRepeat {
            let help = "write `UNTIL condition` before `END_REPEAT`";
            self.expect_or_assume(Kind::Until, help);
        }
        self.close_block();
        StmtKind::Repeat { body, until }
    }

    /// The condition behind UNTIL, with or without `;`.
    fn until(&mut self, brackets: i32) -> Expr {
        let cond = self.expression();
        if self.kind() == Kind::Assign && !self.failed {
            self.slip_assign();
            self.expression();
        }
        let next = self.token();
        if !self.failed && next.kind != Kind::Semi && !next.starts_line && !next.kind.is_reserved() {
            self.unexpected_here("an operator or `END_REPEAT`");
        }
        if self.failed {
            self.recover_statement(brackets);
        }
        self.eat(Kind::Semi);
        cond
    }

    fn try_statement(&mut self) -> StmtKind {
        let start = self.bump();
        self.open_block(start, Kind::EndTry);
        let body = self.statements();
        let mut catch = None;
        if self.eat(Kind::Catch) {
            let open = self.token();
            let name = if self.eat(Kind::LParen) {
                let name = (self.kind() != Kind::RParen).then(|| self.name("the name of a variable"));
                self.close(Kind::RParen, open);
                name
            } else {
                None
            };
            self.failed = false;
            catch = Some((name, self.statements()));
        }
        let finally = if self.eat(Kind::Finally) { Some(self.statements()) } else { None };
        self.close_block();
        StmtKind::Try { body, catch, finally }
    }
}
