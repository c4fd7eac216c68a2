//! Tokens to tree.
//!
//! Recursive descent with one state of failure: the first mistake of a statement or declaration sets `failed`, nothing more is said until the parser
//! has found the next one (`recover_…`), and so a mistake is reported once. Words that are merely missing (`;`, `THEN`, a closing bracket before the
//! next line) are reported and taken as read.
//!
//! **Invariants:** every loop either takes a token or ends; recursion ([`MAX_DEPTH`]) and the height of expressions ([`MAX_HEIGHT`]) are bounded, so that
//! neither parsing nor walking nor dropping a tree can exhaust the stack.

mod configuration;
mod declarations;
mod documentation;
mod expressions;
mod foreign;
mod literals;
mod members;
mod namespaces;
mod recovery;
mod slips;
mod statements;
mod types;
mod units;

use std::cell::OnceCell;

use crate::conditions::{self, Conditions};
use crate::lexer::{self, Kind, Lexed, MAX_DIAGNOSTICS, Token};
use crate::tree::{self, Direct, Home, Name, VarBlock};
use crate::{Code, Diagnostic, FileId, LineIndex, Span};

/// Longest text, in bytes: a million lines. Its tree may need thirty times as much.
pub(crate) const MAX_TEXT: usize = 32 << 20;
/// Deepest nesting of brackets and statements.
const MAX_DEPTH: u32 = 200;
/// Greatest height of an expression's tree.
const MAX_HEIGHT: u32 = 200;
/// Height from which on a row of operators is kept as a chain instead of a tree.
const CHAIN_HEIGHT: u32 = 64;

/// Parses a source file. Never fails: what could not be read is missing or an `Error` node, and has a diagnostic. No expression is higher than 200
/// nodes, and brackets and statements nest at most 200 deep. At most 1000 diagnostics each of the lexer, of
/// pragmas and of the parser are kept, in the order of their places.
///
/// Conditional pragmas see the names that this file declares, and no defines but its own; see [`parse_under`].
pub fn parse(file: FileId, text: &str) -> (tree::File, Vec<Diagnostic>) {
    let mut conditions = Conditions::default();
    if conditions::asks(text) {
        conditions.scan(&crate::Source { name: String::new(), text: text.to_owned() });
    }
    parse_under(file, text, &conditions)
}

/// As [`parse`], for a file of a project, whose `conditions` are those of all its files.
pub fn parse_under(file: FileId, text: &str, conditions: &Conditions) -> (tree::File, Vec<Diagnostic>) {
    let Some(mut parser) = Parser::open(file, text) else { return (tree::File::default(), vec![too_large(file)]) };
    if let Some(diagnostic) = parser.markup() {
        return (tree::File::default(), vec![diagnostic]);
    }
    let suppressed = conditions.apply(&mut parser.lexed, file, text);
    let mut tree = parser.file();
    tree.suppressed = suppressed;
    let mut diagnostics = parser.finish();
    diagnostics.retain(|diagnostic| !tree.suppresses(diagnostic));
    (tree, diagnostics)
}

/// Parses one expression, which is the whole text.
pub fn parse_expression(file: FileId, text: &str) -> (tree::Expr, Vec<Diagnostic>) {
    let Some(mut parser) = Parser::open(file, text) else {
        let span = Span { file, start: 0, end: 0 };
        return (tree::Expr { kind: tree::ExprKind::Error, span }, vec![too_large(file)]);
    };
    let expression = parser.expression();
    if !parser.failed && parser.kind() != Kind::Eof {
        parser.unexpected_here("the end of the expression");
    }
    (expression, parser.finish())
}

fn too_large(file: FileId) -> Diagnostic {
    Diagnostic::new(Code::NotSupported, Span { file, start: 0, end: 0 }, "a source file of more than 32 MiB is not supported")
        .help("divide it into several files")
}

/// A block that waits for its END_.
#[derive(Clone, Copy)]
struct Open {
    /// The keyword that closes it.
    end: Kind,
    /// The keyword that opened it.
    start: Token,
}

struct Parser<'a> {
    file: FileId,
    text: &'a str,
    lexed: Lexed,
    /// Index of the token that is looked at.
    at: usize,
    /// A mistake was reported and the next safe place not yet found.
    failed: bool,
    /// Present depth of recursion.
    depth: u32,
    /// Brackets opened and not closed by the tokens taken so far.
    brackets: i32,
    /// Blocks that are open, the innermost last.
    open: Vec<Open>,
    /// The END_ of a block that was closed by a wrong one; if it follows, it is no second mistake.
    mistaken: Option<Kind>,
    /// The END_ of a block whose first word was missing: the END_ of a block around it may be meant.
    assumed: Option<Kind>,
    /// The next word that begins or ends a block, and whether it is END_VAR.
    end_var_ahead: (usize, bool),
    /// What stands outside of units was complained of; the END_ behind it is no second mistake.
    is_homeless: bool,
    /// VAR sections found among the statements of the present unit.
    late_vars: Vec<VarBlock>,
    /// Where the present unit stands.
    home: Home,
    /// What [`Self::home`] was outside of each open NAMESPACE.
    outer_homes: Vec<Home>,
    /// Direct addresses so far.
    addresses: Vec<Direct>,
    /// Inside of `<…>`, where `>` closes and does not compare.
    is_in_angles: bool,
    diagnostics: Vec<Diagnostic>,
    /// Made when a message first names a line.
    lines: OnceCell<LineIndex>,
}

impl<'a> Parser<'a> {
    fn open(file: FileId, text: &'a str) -> Option<Self> {
        if text.len() > MAX_TEXT {
            return None;
        }
        Some(Self {
            file,
            text,
            lexed: lexer::lex(file, text),
            at: 0,
            failed: false,
            depth: 0,
            brackets: 0,
            open: Vec::new(),
            mistaken: None,
            assumed: None,
            end_var_ahead: (0, false),
            is_homeless: false,
            late_vars: Vec::new(),
            home: Home::default(),
            outer_homes: Vec::new(),
            addresses: Vec::new(),
            is_in_angles: false,
            diagnostics: Vec::new(),
            lines: OnceCell::new(),
        })
    }

    fn finish(mut self) -> Vec<Diagnostic> {
        let mut all = std::mem::take(&mut self.lexed.diagnostics);
        all.append(&mut self.diagnostics);
        all.sort_by_key(|diagnostic| diagnostic.span.start);
        all
    }

    // Looking and taking.

    #[inline]
    fn token(&self) -> Token {
        self.lexed.tokens[self.at]
    }

    #[inline]
    fn kind(&self) -> Kind {
        self.lexed.tokens[self.at].kind
    }

    /// The token `ahead` places further; the end of the file repeats itself.
    #[inline]
    fn peek(&self, ahead: usize) -> Token {
        let tokens = &self.lexed.tokens;
        tokens[(self.at + ahead).min(tokens.len() - 1)]
    }

    /// The token before; at the start of the file an empty place.
    fn previous(&self) -> Token {
        match self.at.checked_sub(1) {
            Some(index) => self.lexed.tokens[index],
            None => Token { kind: Kind::Semi, starts_line: true, start: 0, end: 0 },
        }
    }

    #[inline]
    fn bump(&mut self) -> Token {
        let token = self.token();
        match token.kind {
            Kind::LParen | Kind::LBracket => self.brackets += 1,
            Kind::RParen | Kind::RBracket => self.brackets -= 1,
            Kind::Eof => return token,
            _ => {}
        }
        self.at += 1;
        token
    }

    #[inline]
    fn eat(&mut self, kind: Kind) -> bool {
        let found = self.kind() == kind && !self.failed;
        if found {
            self.bump();
        }
        found
    }

    fn text_of(&self, token: Token) -> &'a str {
        &self.text[token.start as usize..token.end as usize]
    }

    #[inline]
    fn span_of(&self, token: Token) -> Span {
        Span { file: self.file, start: token.start, end: token.end }
    }

    /// From `start` to the end of the last token taken.
    #[inline]
    fn span_from(&self, start: u32) -> Span {
        Span { file: self.file, start, end: self.previous().end.max(start) }
    }

    /// The place behind the last token taken, where something is missing.
    fn gap(&self) -> Span {
        let end = self.previous().end;
        Span { file: self.file, start: end, end }
    }

    // Names.

    fn name_of(&self, token: Token) -> Name {
        Name { text: self.text_of(token).to_owned(), span: self.span_of(token) }
    }

    /// A name, or a message that `what` is missing and an empty name.
    fn name(&mut self, what: &str) -> Name {
        // A word at the start of a line in front of a name is a keyword: the name before it is missing.
        let is_keyword = self.kind().is_contextual() && self.token().starts_line && self.peek(1).kind.is_name();
        if self.kind().is_name() && !is_keyword && !self.failed {
            let token = self.bump();
            return self.name_of(token);
        }
        if self.kind().is_reserved() && !self.failed && !self.token().starts_line {
            let (word, span) = (self.text_of(self.token()), self.span_of(self.token()));
            self.report(Code::UnexpectedToken, span, format!("expected {what}, found the keyword `{word}`"));
        } else {
            self.unexpected_here(what);
        }
        Name { text: String::new(), span: self.gap() }
    }

    /// `A.B.C` as one name.
    fn qualified_name(&mut self, what: &str) -> Name {
        let mut name = self.name(what);
        while self.kind() == Kind::Dot && self.peek(1).kind.is_name() && !self.failed {
            self.bump();
            let part = self.bump();
            name.text.push('.');
            name.text.push_str(self.text_of(part));
            name.span = name.span.to(self.span_of(part));
        }
        name
    }

    fn direct(&mut self) -> Direct {
        let token = self.bump();
        let direct = Direct { text: self.text_of(token).to_ascii_uppercase(), span: self.span_of(token) };
        self.addresses.push(direct.clone());
        direct
    }

    // Messages.

    /// Reports a mistake, unless one of this statement was reported before, and fails.
    fn report(&mut self, code: Code, span: Span, message: impl Into<String>) {
        self.tell(Diagnostic::new(code, span, message));
        self.failed = true;
    }

    /// Reports a mistake after which the parser goes on as if nothing were wrong.
    fn tell(&mut self, diagnostic: Diagnostic) {
        if !self.failed && self.diagnostics.len() < MAX_DIAGNOSTICS {
            self.diagnostics.push(diagnostic);
        }
    }

    /// Whether a complaint about the present place would repeat one of the lexer's.
    fn is_known_trouble(&self) -> bool {
        let at_end = self.kind() == Kind::Eof && self.lexed.truncated;
        at_end || self.kind() == Kind::Bad || self.previous().kind == Kind::Bad
    }

    /// Fails because something else was `expected` here.
    fn unexpected_here(&mut self, expected: &str) {
        if !self.is_known_trouble() {
            let diagnostic = self.unexpected(expected);
            self.tell(diagnostic);
        }
        self.failed = true;
    }

    fn unexpected(&self, expected: &str) -> Diagnostic {
        let token = self.token();
        let span = if token.kind == Kind::Eof { self.gap() } else { self.span_of(token) };
        Diagnostic::new(Code::UnexpectedToken, span, format!("expected {expected}, found {}", self.describe(token)))
    }

    fn describe(&self, token: Token) -> String {
        match token.kind {
            Kind::Eof => "the end of the file".to_owned(),
            _ => format!("`{}`", lexer::shorten(self.text_of(token))),
        }
    }

    /// Takes a token of this kind or fails.
    fn expect(&mut self, kind: Kind) -> bool {
        if self.failed {
            return false;
        }
        if !self.eat(kind) {
            self.unexpected_here(&format!("`{}`", kind.text()));
        }
        !self.failed
    }

    /// Takes a keyword that could only stand here; where it is missing, says so and goes on.
    fn expect_or_assume(&mut self, kind: Kind, help: &str) {
        if self.failed || self.eat(kind) {
            return;
        }
        if !self.is_known_trouble() {
            let message = format!("expected `{}`, found {}", kind.text(), self.describe(self.token()));
            let diagnostic = Diagnostic::new(Code::UnexpectedToken, self.gap(), message).help(help);
            self.tell(diagnostic);
        }
    }

    /// Takes the bracket that closes `open`. Where the line ends before it, it is taken as read.
    /// `true` if it was there.
    fn close(&mut self, kind: Kind, open: Token) -> bool {
        if self.failed || self.eat(kind) {
            return !self.failed;
        }
        let next = self.token();
        let ends = next.starts_line || matches!(next.kind, Kind::Semi | Kind::Eof | Kind::Then | Kind::Do | Kind::Of | Kind::Assign);
        if !self.is_known_trouble() {
            let (what, span) = (if ends { "" } else { "`,` or " }, if ends { self.gap() } else { self.span_of(next) });
            let message = format!("expected {what}`{}`, found {}", kind.text(), self.describe(next));
            let note = format!("this `{}` is not closed", self.text_of(open));
            let diagnostic = Diagnostic::new(Code::UnexpectedToken, span, message).note(self.span_of(open), note);
            self.tell(diagnostic);
        }
        if ends {
            self.brackets -= 1;
        }
        self.failed = !(ends && matches!(next.kind, Kind::Semi | Kind::Then | Kind::Do | Kind::Of));
        false
    }

    // Depth.

    /// Goes one level down, or fails because there are too many. Each `true` needs an [`Self::leave`].
    fn enter(&mut self) -> bool {
        if self.depth >= MAX_DEPTH {
            let span = self.span_of(self.token());
            let message = format!("nested more than {MAX_DEPTH} levels deep");
            self.tell(Diagnostic::new(Code::TooDeep, span, message).help("give parts of it a name of their own"));
            self.failed = true;
            return false;
        }
        self.depth += 1;
        true
    }

    fn leave(&mut self) {
        self.depth -= 1;
    }

    // Blocks.

    fn open_block(&mut self, start: Token, end: Kind) {
        self.open.push(Open { end, start });
    }

    /// Takes the END_ of the innermost block. A wrong END_ that closes nothing else is taken for it; where it is missing, its block is named.
    fn close_block(&mut self) -> Token {
        let Some(open) = self.open.pop() else { return self.token() };
        let token = self.token();
        if token.kind == open.end {
            self.failed = false;
            return self.bump();
        }
        let message = format!("expected `{}`, found {}", open.end.text(), self.describe(token));
        let opener = self.text_of(open.start).to_ascii_uppercase();
        let span = if token.kind == Kind::Eof { self.gap() } else { self.span_of(token) };
        let mut diagnostic = Diagnostic::new(Code::MissingEnd, span, message);
        diagnostic =
            diagnostic.note(self.span_of(open.start), format!("this `{opener}` in line {} is not closed", self.line_of(open.start)));
        if opener == "IF" && self.follows_else(open.start) {
            diagnostic =
                diagnostic.help("`ELSE IF` opens a second IF with an END_IF of its own; a further branch of the same IF is `ELSIF`");
        }
        let is_forgiven = self.assumed == Some(open.end);
        if is_forgiven {
            self.assumed = None;
        }
        if !(is_forgiven || self.is_known_trouble() && token.kind == Kind::Eof) {
            self.failed = false;
            self.tell(diagnostic);
        }
        self.failed = false;
        let same_level = is_statement_end(token.kind) == is_statement_end(open.end);
        if same_level && is_end(token.kind) && !self.open.iter().any(|outer| closes(token.kind, outer.end)) {
            self.bump();
        }
        token
    }

    /// Whether a word belongs to a block that is open.
    fn closes_something(&self, word: Kind) -> bool {
        self.open.iter().any(|open| closes(word, open.end))
    }

    fn follows_else(&self, token: Token) -> bool {
        let index = self.lexed.tokens.partition_point(|other| other.start < token.start);
        index > 0 && self.lexed.tokens[index - 1].kind == Kind::Else && !token.starts_line
    }

    /// Line of a token, from 1: for messages only.
    fn line_of(&self, token: Token) -> u32 {
        self.lines.get_or_init(|| LineIndex::new(self.text)).line(token.start)
    }
}

/// Whether `word` belongs to the block whose END_ is `end`.
fn closes(word: Kind, end: Kind) -> bool {
    match word {
        Kind::Elsif => end == Kind::EndIf,
        Kind::Else => matches!(end, Kind::EndIf | Kind::EndCase),
        Kind::Until => end == Kind::EndRepeat,
        Kind::Catch | Kind::Finally => end == Kind::EndTry,
        _ => word == end,
    }
}

/// Whether a keyword closes a block of statements.
fn is_statement_end(kind: Kind) -> bool {
    matches!(kind, Kind::EndIf | Kind::EndCase | Kind::EndFor | Kind::EndWhile | Kind::EndRepeat | Kind::EndTry)
}

/// Whether a keyword closes anything.
fn is_end(kind: Kind) -> bool {
    is_statement_end(kind)
        || is_unit_end(kind)
        || matches!(kind, Kind::EndVar | Kind::EndStruct | Kind::EndUnion | Kind::EndMethod | Kind::EndProperty | Kind::EndGet)
        || matches!(kind, Kind::EndSet | Kind::EndAction)
}

/// Whether a keyword closes a program unit.
fn is_unit_end(kind: Kind) -> bool {
    use Kind::*;
    matches!(
        kind,
        EndFunction | EndFunctionBlock | EndProgram | EndType | EndConfiguration | EndResource | EndInterface | EndClass | EndNamespace
    )
}

/// Whether a keyword opens a VAR section.
fn is_var(kind: Kind) -> bool {
    use Kind::*;
    matches!(
        kind,
        Var | VarInput | VarOutput | VarInOut | VarTemp | VarStat | VarInst | VarGlobal | VarExternal | VarConfig | VarAccess | VarGeneric
    )
}

#[cfg(test)]
mod tests;
