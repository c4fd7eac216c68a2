//! Statements.

use super::{Parser, closes, is_end, is_statement_end, is_unit_end, is_var};
use crate::lexer::{Kind, Token};
use crate::tree::{AssignOp, BinaryOp, CaseLabel, Expr, ExprKind, Stmt, StmtKind};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    /// Statements up to a word that ends or continues an open block, or that begins a declaration.
    pub(super) fn statements(&mut self) -> Vec<Stmt> {
        self.statement_list(false)
    }

    fn statement_list(&mut self, in_case: bool) -> Vec<Stmt> {
        let mut list = Vec::new();
        loop {
            let kind = self.kind();
            if kind == Kind::Ident {
                self.respell();
            }
            if self.ends_statements() {
                if !self.skip_stray() {
                    return list;
                }
            } else if is_var(kind) {
                self.late_declarations();
            } else if in_case && self.is_case_label() {
                return list;
            } else {
                let before = self.at;
                list.push(self.statement());
                if self.at == before {
                    self.bump();
                }
            }
        }
    }

    /// Whether the present word cannot belong to a list of statements.
    fn ends_statements(&self) -> bool {
        use Kind::*;
        let kind = self.kind();
        match kind {
            Eof | Function | FunctionBlock | Program | Type | Configuration | VarGlobal | VarConfig => true,
            Else | Elsif | Until | Catch | Finally => true,
            _ if kind.is_contextual() => self.starts_member() || self.starts_soft_unit(),
            _ => is_end(kind),
        }
    }

    /// METHOD, PROPERTY or ACTION, in front of a name.
    pub(super) fn starts_member(&self) -> bool {
        matches!(self.kind(), Kind::Method | Kind::Property | Kind::Action) && self.peek(1).kind.is_name() && !self.peek(1).starts_line
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
            && !matches!(kind, Kind::EndStruct | Kind::EndUnion)
            && !is_statement_end(kind);
        if belongs_here || self.open.iter().any(|open| closes(kind, open.end)) {
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
        }
        self.eat(Kind::Semi);
        true
    }

    /// VAR among the statements.
    fn late_declarations(&mut self) {
        let token = self.token();
        let message = format!("`{}` stands behind statements", self.text_of(token));
        let help = "declarations stand before the first statement; a missing `;` or END_VAR may have ended them too early";
        self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(token), message).help(help));
        if let Some(block) = self.var_block() {
            self.late_vars.push(block);
        }
    }

    fn statement(&mut self) -> Stmt {
        let start = self.token();
        let brackets = self.brackets;
        if !self.enter() {
            self.skip_nested();
            return Stmt { kind: StmtKind::Error, span: self.span_of(start) };
        }
        let is_structured = matches!(start.kind, Kind::If | Kind::Case | Kind::For | Kind::While | Kind::Repeat | Kind::Try);
        let kind = self.statement_kind(start);
        self.leave();
        let span = self.span_from(start.start);
        if is_structured {
            self.eat(Kind::Semi);
            return Stmt { kind, span };
        }
        let failed = self.failed;
        if !matches!(kind, StmtKind::Label(_)) || failed {
            self.end_statement(brackets);
        }
        Stmt { kind: if failed { StmtKind::Error } else { kind }, span }
    }

    fn statement_kind(&mut self, start: Token) -> StmtKind {
        match start.kind {
            Kind::Semi => StmtKind::Empty,
            Kind::If => self.if_statement(),
            Kind::Case => self.case_statement(),
            Kind::For => self.for_statement(),
            Kind::While => self.while_statement(),
            Kind::Repeat => self.repeat_statement(),
            Kind::Try => self.try_statement(),
            Kind::Exit => self.word(StmtKind::Exit),
            Kind::Continue if matches!(self.peek(1).kind, Kind::Semi | Kind::Eof) || self.peek(1).kind.is_reserved() => self.word(StmtKind::Continue),
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
        if next.kind == Kind::LParen || (next.kind.is_name() || matches!(next.kind, Kind::Int | Kind::Literal | Kind::True | Kind::False)) && !next.starts_line {
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

    fn if_statement(&mut self) -> StmtKind {
        let start = self.bump();
        self.open_block(start, Kind::EndIf);
        let cond = self.condition(Kind::Then);
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
        let (mut arms, mut otherwise) = (Vec::new(), None::<Vec<Stmt>>);
        loop {
            if self.is_case_label() {
                if otherwise.is_some() {
                    let message = "a label behind the `ELSE` of its `CASE`";
                    self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(self.token()), message));
                }
                let labels = self.case_labels();
                arms.push((labels, self.statement_list(true)));
            } else if self.eat(Kind::Else) {
                let body = self.statement_list(true);
                otherwise.get_or_insert_default().extend(body);
            } else if self.ends_statements() {
                break;
            } else {
                self.tell(self.unexpected("a label such as `1:` or `END_CASE`"));
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
            Kind::Int | Kind::Literal | Kind::True | Kind::False | Kind::Minus | Kind::Plus | Kind::LParen | Kind::Not => return true,
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

    fn for_statement(&mut self) -> StmtKind {
        let start = self.bump();
        let brackets = self.brackets;
        self.open_block(start, Kind::EndFor);
        let var = self.place();
        if self.kind() == Kind::Eq && !self.failed {
            self.slip_equal("the first value of FOR is assigned with `:=`");
            self.bump();
        } else {
            self.expect(Kind::Assign);
        }
        let from = self.expression();
        self.expect(Kind::To);
        let to = self.expression();
        let by = if self.eat(Kind::By) { Some(self.expression()) } else { None };
        self.head_word(Kind::Do, brackets);
        let body = self.statements();
        self.close_block();
        StmtKind::For { var, from, to, by, body }
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
            until = self.expression();
            if self.kind() == Kind::Assign && !self.failed {
                self.slip_assign();
                self.expression();
            }
            if self.failed {
                self.recover_statement(brackets);
            }
            self.eat(Kind::Semi);
        } else if self.kind() == Kind::EndRepeat {
            let help = "write `UNTIL condition` before `END_REPEAT`";
            self.expect_or_assume(Kind::Until, help);
        }
        self.close_block();
        StmtKind::Repeat { body, until }
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

    // Ends and recovery.

    /// Takes the `;`. Where it is merely missing, says so behind the last word and takes it as read; otherwise looks for the next statement.
    fn end_statement(&mut self, brackets: i32) {
        if !self.failed && !self.eat(Kind::Semi) && !self.is_known_trouble() {
            let next = self.token();
            let begins = next.starts_line || next.kind == Kind::Eof || next.kind.is_reserved() || self.starts_statement();
            if begins && self.can_start_statement() {
                let message = format!("expected `;`, found {}", self.describe(next));
                self.tell(Diagnostic::new(Code::UnexpectedToken, self.gap(), message));
                return;
            }
            self.junk_behind_statement();
        } else if self.previous().kind == Kind::Semi && !self.failed {
            return;
        }
        self.recover_statement(brackets);
    }

    fn junk_behind_statement(&mut self) {
        let next = self.token();
        let mut diagnostic = self.unexpected(if next.kind.is_name() { "an operator or `;`" } else { "`;`" });
        if matches!(next.kind, Kind::RParen | Kind::RBracket) {
            diagnostic.help = Some("no bracket is open here".to_owned());
        }
        self.tell(diagnostic);
        self.failed = true;
    }

    /// Whether the present token can be the first of a statement or of what follows the statements.
    fn can_start_statement(&self) -> bool {
        let kind = self.kind();
        kind.is_name() || matches!(kind, Kind::Eof | Kind::Direct) || kind.is_reserved() && !is_inner_word(kind)
    }

    /// Whether a statement certainly starts here: a keyword of one, or a place in front of `:=`. Looks a few tokens ahead.
    pub(super) fn starts_statement(&self) -> bool {
        let kind = self.kind();
        if !kind.is_name() {
            return kind.is_reserved() && !is_inner_word(kind);
        }
        let mut depth = 0;
        for ahead in 1..24 {
            let token = self.peek(ahead);
            match token.kind {
                Kind::Assign | Kind::TryAssign if depth == 0 => return true,
                Kind::LBracket => depth += 1,
                Kind::RBracket => depth -= 1,
                Kind::Dot | Kind::Caret | Kind::Int => {}
                kind if kind.is_name() && (depth > 0 || self.peek(ahead - 1).kind == Kind::Dot) => {}
                _ if depth > 0 => {}
                _ => return false,
            }
        }
        false
    }

    /// Skips to the next statement: behind a `;`, to a keyword, or to a name that begins a line outside of brackets.
    pub(super) fn recover_statement(&mut self, brackets: i32) {
        loop {
            let token = self.token();
            match token.kind {
                Kind::Eof => break,
                Kind::Semi => {
                    self.bump();
                    break;
                }
                kind if kind.is_reserved() && !is_inner_word(kind) => break,
                kind if token.starts_line && kind.is_name() && self.brackets <= brackets => break,
                _ => {
                    self.bump();
                }
            }
        }
        self.brackets = brackets;
        self.failed = false;
    }

    fn recover_to_colon(&mut self, brackets: i32) {
        while !matches!(self.kind(), Kind::Colon | Kind::Semi | Kind::Eof) && !self.token().starts_line && !self.ends_statements() {
            self.bump();
        }
        self.failed = false;
        self.brackets = brackets;
        self.eat(Kind::Colon);
    }

    /// Skips a statement that is nested too deeply, with all that is in it.
    fn skip_nested(&mut self) {
        let brackets = self.brackets;
        let mut depth = 0_usize;
        loop {
            let kind = self.kind();
            match kind {
                Kind::If | Kind::Case | Kind::For | Kind::While | Kind::Repeat | Kind::Try => depth += 1,
                Kind::Eof | Kind::Function | Kind::FunctionBlock | Kind::Program | Kind::Type | Kind::Configuration => break,
                _ if is_unit_end(kind) => break,
                _ if depth == 0 => {
                    self.recover_statement(brackets);
                    break;
                }
                _ if is_statement_end(kind) => depth -= 1,
                _ => {}
            }
            self.bump();
            if depth == 0 {
                self.failed = false;
                self.eat(Kind::Semi);
                break;
            }
        }
        self.brackets = brackets;
        self.failed = false;
    }
}

/// Whether a reserved word stands inside statements and expressions only.
fn is_inner_word(kind: Kind) -> bool {
    use Kind::*;
    matches!(
        kind,
        Then | Of | To | By | Do | And | Or | Xor | Not | Mod | AndThen | OrElse | True | False | Array | At | Struct
    )
}
