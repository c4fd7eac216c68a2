//! Ends of statements, and the way to the next one behind a mistake.

use super::{Parser, is_statement_end, is_unit_end};
use crate::lexer::{Kind, Token};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    /// Takes the `;`. Where it is merely missing, says so behind the last word and takes it as read; otherwise looks for the next statement.
    pub(super) fn end_statement(&mut self, brackets: i32) {
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
        if self.follows_string() {
            diagnostic.help = Some("a quote inside a string is written `$'`".to_owned());
            self.forget_open_string();
        }
        self.tell(diagnostic);
        self.failed = true;
    }

    /// Whether the present token can be the first of a statement or of what follows the statements.
    pub(super) fn can_start_statement(&self) -> bool {
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
                kind if is_statement_end(kind) && !token.starts_line && !self.closes_something(kind) => {
                    self.bump();
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

    /// The tokens from `ahead` on to the end of the line or statement, as far as a person would look: no line of errors takes more than linear time.
    pub(super) fn rest_of_line(&self, ahead: usize) -> &[Token] {
        let rest = self.lexed.tokens.get(self.at + ahead..).unwrap_or_default();
        let line = rest.iter().take(200).take_while(|token| !token.starts_line && token.kind != Kind::Semi);
        &rest[..line.count()]
    }

    /// Skips a label that cannot be read, if its `:` stands on this line.
    pub(super) fn skip_to_colon(&mut self) {
        let line = self.rest_of_line(1).iter();
        if let Some(distance) = line.map(|token| token.kind).position(|kind| kind == Kind::Colon) {
            self.at += distance + 2;
        }
    }

    pub(super) fn recover_to_colon(&mut self, brackets: i32) {
        while !matches!(self.kind(), Kind::Colon | Kind::Semi | Kind::Eof) && !self.token().starts_line && !self.ends_statements() {
            self.bump();
        }
        self.failed = false;
        self.brackets = brackets;
        self.eat(Kind::Colon);
    }

    /// Skips a statement that is nested too deeply, with all that is in it.
    pub(super) fn skip_nested(&mut self) {
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
    matches!(kind, Then | Of | To | By | Do | And | Or | Xor | Not | Mod | AndThen | OrElse | True | False | Array | At | Struct)
}
