//! Mistakes that people make who come from other languages, and what to tell them.

use super::Parser;
use crate::lexer::Kind;
use crate::{Code, Diagnostic};

/// Spellings of keywords in other dialects and languages.
const RESPELLED: &[(&str, Kind)] = &[
    ("ENDIF", Kind::EndIf),
    ("ENDFOR", Kind::EndFor),
    ("ENDWHILE", Kind::EndWhile),
    ("ENDCASE", Kind::EndCase),
    ("ENDREPEAT", Kind::EndRepeat),
    ("ELSEIF", Kind::Elsif),
    ("ELIF", Kind::Elsif),
    ("ELSE_IF", Kind::Elsif),
    ("END_ELSE", Kind::EndIf),
    ("ENDVAR", Kind::EndVar),
    ("BREAK", Kind::Exit),
    ("ENDPROGRAM", Kind::EndProgram),
    ("ENDFUNCTION", Kind::EndFunction),
];

/// Names of types by which a declaration among statements is known.
const ELEMENTARY: &[&str] = &[
    "BOOL", "BYTE", "WORD", "DWORD", "LWORD", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT", "REAL", "LREAL", "TIME",
    "LTIME", "STRING", "WSTRING", "DATE", "TOD", "DT", "TON", "TOF", "TP", "R_TRIG", "F_TRIG",
];

/// Whether `name` is that of an integer type, which may be followed by a range.
pub(super) fn is_integer_type(name: &str) -> bool {
    const NAMES: &[&str] = &["BYTE", "WORD", "DWORD", "LWORD", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT"];
    NAMES.iter().any(|known| known.eq_ignore_ascii_case(name))
}

impl Parser<'_> {
    /// Corrects a keyword that is spelled as elsewhere (`ENDIF`), when it cannot be a name.
    pub(super) fn respell(&mut self) {
        let token = self.token();
        let next = self.peek(1);
        let first = self.text.as_bytes()[token.start as usize];
        let as_name =
            matches!(next.kind, Kind::Assign | Kind::LParen | Kind::Dot | Kind::LBracket | Kind::Caret | Kind::Colon | Kind::Comma);
        if !matches!(first, b'E' | b'e' | b'B' | b'b') || as_name && !self.is_condition_ahead(token.start) {
            return;
        }
        let text = self.text_of(token);
        let Some((_, kind)) = RESPELLED.iter().find(|(known, _)| known.eq_ignore_ascii_case(text)) else { return };
        let message = format!("`{text}` is written `{}` in ST", kind.text());
        self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(token), message));
        let at = self.at;
        self.lexed.tokens[at].kind = *kind;
    }

    /// Corrects `END IF` and the like, and takes the `BEGIN` and `END` of other languages for nothing. `true` if it took something.
    pub(super) fn respell_end(&mut self) -> bool {
        let (word, next) = (self.token(), self.peek(1));
        let is_end = self.is_word(word, "END");
        if word.kind != Kind::Ident || !(is_end || self.is_word(word, "BEGIN")) {
            return false;
        }
        let text = self.text_of(word);
        if next.starts_line && word.starts_line {
            let message = format!("`{text}` is no word of ST");
            let help = "a body begins behind END_VAR and ends with END_PROGRAM, END_FUNCTION or END_FUNCTION_BLOCK";
            self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(word), message).help(help));
            self.bump();
            return true;
        }
        let Some(kind) = end_of(next.kind).filter(|_| is_end && !next.starts_line) else { return false };
        let message = format!("`{text} {}` is written `{}`", self.text_of(next), kind.text());
        let span = self.span_of(word).to(self.span_of(next));
        self.tell(Diagnostic::new(Code::UnexpectedToken, span, message));
        self.bump();
        let at = self.at;
        self.lexed.tokens[at].kind = kind;
        true
    }

    /// A keyword in front of `:=` or, in declarations, of `:`: somebody's name for a variable.
    pub(super) fn keyword_as_name(&mut self) {
        let word = self.token();
        let message = format!("expected the name of a variable, found the keyword `{}`", self.text_of(word));
        self.report(Code::UnexpectedToken, self.span_of(word), message);
        self.bump();
    }

    /// `FOR (i = 0; i < 5; i++)`: skipped, as if it were a head of ST.
    pub(super) fn head_of_c(&mut self) {
        let open = self.token();
        let help = "a loop is written `FOR i := 0 TO 4 DO … END_FOR`";
        let message = "expected the control variable of `FOR`, found `(`";
        self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(open), message).help(help));
        let mut depth = 0_usize;
        loop {
            match self.bump().kind {
                Kind::LParen => depth += 1,
                Kind::RParen => depth -= 1,
                _ => {}
            }
            if depth == 0 || self.token().starts_line || self.kind() == Kind::Eof {
                break;
            }
        }
        self.eat(Kind::Do);
    }

    /// Whether a misspelled ELSIF is followed by a bracketed condition: `THEN` ends its line.
    fn is_condition_ahead(&self, start: u32) -> bool {
        let is_elsif = self.text.as_bytes()[start as usize..].get(..2).is_some_and(|head| head.eq_ignore_ascii_case(b"el"));
        is_elsif && (1..64).map(|ahead| self.peek(ahead)).take_while(|token| !token.starts_line).any(|token| token.kind == Kind::Then)
    }

    /// `=` where `:=` was meant; the lexer has spoken of `==` already.
    pub(super) fn slip_equal(&mut self, help: &str) {
        let token = self.token();
        if self.text_of(token) != "==" {
            self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(token), "expected `:=`, found `=`").help(help));
        }
    }

    /// `:=` in a condition: takes it.
    pub(super) fn slip_assign(&mut self) {
        let token = self.bump();
        let diagnostic = Diagnostic::new(Code::UnexpectedToken, self.span_of(token), "expected a comparison, found `:=`");
        self.tell(diagnostic.help("a comparison is written `=`; an assignment in a condition stands in brackets: `(a := b)`"));
    }

    /// `i++` and `i--` as statements.
    pub(super) fn is_increment(&mut self) -> bool {
        let (first, second, third) = (self.token(), self.peek(1), self.peek(2));
        if first.kind != second.kind || !(third.kind == Kind::Semi || third.starts_line) {
            return false;
        }
        let (sign, place) = (self.text_of(first), self.text_of(self.previous()));
        let span = self.span_of(first).to(self.span_of(second));
        let message = format!("`{sign}{sign}` is not an ST operator");
        self.tell(Diagnostic::new(Code::UnexpectedToken, span, message).help(format!("write `{place} := {place} {sign} 1;`")));
        self.failed = true;
        true
    }

    /// Whether `name : INT` stands among statements.
    pub(super) fn is_declaration_slip(&self) -> bool {
        let ty = self.peek(1);
        match ty.kind {
            Kind::Array => true,
            Kind::Pointer | Kind::Reference => self.peek(2).kind == Kind::To,
            Kind::Ident if !ty.starts_line => {
                let known = ELEMENTARY.iter().any(|known| known.eq_ignore_ascii_case(self.text_of(ty)));
                known || self.peek(2).kind == Kind::Semi
            }
            _ => false,
        }
    }

    /// Whether the present token touches the string before it, as in `'it's'`.
    pub(super) fn follows_string(&self) -> bool {
        let (string, next) = (self.previous(), self.token());
        string.end == next.start && string.kind == Kind::Literal && self.text_of(string).ends_with(['\'', '"'])
    }

    /// Takes back the lexer's message about the last quote of such a line: it is the same mistake.
    pub(super) fn forget_open_string(&mut self) {
        let start = self.token().start;
        let length = self.text[start as usize..].find('\n').unwrap_or(self.text.len() - start as usize);
        let line = start..start + length as u32;
        self.lexed.diagnostics.retain(|d| d.code != Code::UnterminatedString || !line.contains(&d.span.start));
    }

    /// A statement that begins with something that begins none.
    pub(super) fn misplaced_start(&mut self) {
        let mut diagnostic = self.unexpected("a statement");
        diagnostic.help = match self.kind() {
            Kind::Then | Kind::Do | Kind::Of => Some("the head of the block before it has been closed already".to_owned()),
            Kind::RParen | Kind::RBracket => Some("no bracket is open here".to_owned()),
            Kind::Colon if self.previous().kind == Kind::Else => Some("`ELSE` has no `:`".to_owned()),
            _ => None,
        };
        if !self.is_known_trouble() {
            self.tell(diagnostic);
        }
        self.failed = true;
        self.bump();
    }

    /// Takes the `THEN`, `DO` or `OF` behind the head of a statement, or finds where its body begins.
    pub(super) fn head_word(&mut self, word: Kind, brackets: i32) {
        if self.eat(word) {
            return;
        }
        let next = self.token();
        if !self.failed && self.has_lexer_spoken() {
            return;
        }
        if !self.failed && !self.is_known_trouble() {
            let message = format!("expected `{}`, found {}", word.text(), self.describe(next));
            if matches!(next.kind, Kind::Then | Kind::Do | Kind::Of) {
                self.tell(Diagnostic::new(Code::UnexpectedToken, self.span_of(next), message));
                self.bump();
                return;
            }
            if next.kind.is_reserved() || next.starts_line || self.starts_statement() || matches!(next.kind, Kind::Semi | Kind::Eof) {
                let help = format!("write `{}` behind the head of the block", word.text());
                self.tell(Diagnostic::new(Code::UnexpectedToken, self.gap(), message).help(help));
                self.eat(Kind::Semi);
                return;
            }
            let is_bracket = matches!(next.kind, Kind::RParen | Kind::RBracket);
            let mut diagnostic = self.unexpected(&format!("an operator or `{}`", word.text()));
            diagnostic.help = is_bracket.then(|| "no bracket is open here".to_owned());
            self.tell(diagnostic);
        }
        self.recover_head(word, brackets);
    }

    /// Whether the lexer complained of something between the last token and this one: a brace in the manner of C.
    fn has_lexer_spoken(&self) -> bool {
        let (from, to) = (self.previous().end, self.token().start);
        let index = self.lexed.diagnostics.partition_point(|d| d.span.start < from);
        self.lexed.diagnostics.get(index).is_some_and(|d| d.span.start < to)
    }

    fn ends_head(&self) -> bool {
        let kind = self.kind();
        matches!(kind, Kind::Semi | Kind::Eof) || kind.is_reserved() && !is_inside_head(kind)
    }

    /// Skips the rest of a head to its `word`; if a statement ends or begins first, to the next line.
    fn recover_head(&mut self, word: Kind, brackets: i32) {
        let from = self.at;
        loop {
            if self.kind() == word || self.ends_head() {
                break;
            }
            self.bump();
        }
        if self.kind() == word {
            self.bump();
        } else {
            self.at = from;
            while !self.token().starts_line && !self.ends_head() {
                self.at += 1;
            }
            self.failed = false;
            self.eat(Kind::Semi);
        }
        self.brackets = brackets;
        self.failed = false;
    }
}

fn is_inside_head(kind: Kind) -> bool {
    use Kind::*;
    matches!(kind, To | By | And | Or | Xor | Not | Mod | AndThen | OrElse | True | False | Array)
}

/// The END_ of the block that a word begins.
fn end_of(word: Kind) -> Option<Kind> {
    Some(match word {
        Kind::If => Kind::EndIf,
        Kind::Case => Kind::EndCase,
        Kind::For => Kind::EndFor,
        Kind::While => Kind::EndWhile,
        Kind::Repeat => Kind::EndRepeat,
        Kind::Var => Kind::EndVar,
        Kind::Struct => Kind::EndStruct,
        Kind::Type => Kind::EndType,
        Kind::Function => Kind::EndFunction,
        Kind::FunctionBlock => Kind::EndFunctionBlock,
        Kind::Program => Kind::EndProgram,
        Kind::Method => Kind::EndMethod,
        Kind::Property => Kind::EndProperty,
        Kind::Action => Kind::EndAction,
        _ => return None,
    })
}
