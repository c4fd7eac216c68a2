//! Bodies in the other languages of IEC 61131-3, and what else has a text form but no meaning here: named and refused.

use super::{Parser, is_end};
use crate::lexer::Kind;
use crate::{Code, Diagnostic};

/// First words of bodies in the text exports of CoDeSys 2.3.
const EXPORTED: &[(&str, &str)] =
    &[("_FBD_BODY", "FBD"), ("_LD_BODY", "LD"), ("_LADDER_BODY", "LD"), ("_CFC_BODY", "CFC"), ("_IL_BODY", "IL"), ("_SFC_BODY", "SFC")];

/// Operators of Instruction List that a body may begin with.
const INSTRUCTIONS: &[&str] = &["LD", "LDN", "ST", "STN", "CAL", "CALC", "CALCN", "JMPC", "JMPCN", "ANDN", "ORN"];

impl Parser<'_> {
    /// A file that is XML: one message for all of it.
    pub(super) fn markup(&self) -> Option<Diagnostic> {
        let at = self.text.find(|c: char| !c.is_whitespace() && c != '\u{feff}')?;
        let is_xml = self.text[at..].starts_with("<?xml") || self.text[at..].starts_with("<TcPlcObject");
        let span = crate::Span { file: self.file, start: at as u32, end: at as u32 + 1 };
        let diagnostic = Diagnostic::new(Code::NotSupported, span, "expected Structured Text, found XML");
        is_xml.then(|| diagnostic.help("only the text of declarations and bodies is read, each in its unit"))
    }

    /// Reports a body that is not written in ST, and skips it to the END_ of its unit.
    pub(super) fn foreign_body(&mut self) {
        let Some(language) = self.foreign_language() else { return };
        let message = format!("a body in {language} is not supported");
        let diagnostic = Diagnostic::new(Code::NotSupported, self.span_of(self.token()), message);
        self.tell(diagnostic.help("write it in ST; steps are an enumeration and a `CASE`"));
        let end = self.open.last().map(|open| open.end);
        while Some(self.kind()) != end && !(is_end(self.kind()) && self.closes_something(self.kind())) && self.kind() != Kind::Eof {
            if self.starts_member() || matches!(self.kind(), Kind::Function | Kind::FunctionBlock | Kind::Program | Kind::Type) {
                break;
            }
            self.bump();
        }
        self.brackets = 0;
    }

    fn foreign_language(&self) -> Option<&'static str> {
        let (word, next, behind) = (self.token(), self.peek(1), self.peek(2));
        if word.kind != Kind::Ident {
            return None;
        }
        let text = self.text_of(word);
        if let Some((_, language)) = EXPORTED.iter().find(|(known, _)| known.eq_ignore_ascii_case(text)) {
            return (!matches!(next.kind, Kind::Assign | Kind::LParen)).then_some(language);
        }
        let is_step = ["STEP", "INITIAL_STEP"].iter().any(|known| known.eq_ignore_ascii_case(text));
        let is_transition = text.eq_ignore_ascii_case("TRANSITION");
        if is_step && next.kind.is_name() && behind.kind == Kind::Colon {
            return Some("SFC");
        }
        if is_transition && next.kind.is_name() && !next.starts_line {
            return Some("SFC");
        }
        let is_operand = next.kind.is_name() || matches!(next.kind, Kind::Int | Kind::Literal | Kind::Direct | Kind::True | Kind::False);
        let stands_alone =
            is_operand && !next.starts_line && (behind.starts_line || behind.kind == Kind::Eof || behind.kind == Kind::LParen);
        let is_instruction = INSTRUCTIONS.iter().any(|known| known.eq_ignore_ascii_case(text));
        (stands_alone && is_instruction).then_some("IL")
    }

    /// `a : BOOL R_EDGE`: refused, and read as a plain BOOL.
    pub(super) fn refuse_edge(&mut self) {
        let word = self.token();
        if word.kind == Kind::Ident && !self.failed && (self.is_word(word, "R_EDGE") || self.is_word(word, "F_EDGE")) {
            let message = format!("`{}` is not supported", self.text_of(word));
            let help = "call an R_TRIG or F_TRIG with the input";
            self.tell(Diagnostic::new(Code::NotSupported, self.span_of(word), message).help(help));
            self.bump();
        }
    }

    /// `STRUCT OVERLAP`: refused, and read as a plain structure.
    pub(super) fn refuse_overlap(&mut self) {
        let word = self.token();
        let is_name = matches!(self.peek(1).kind, Kind::Colon | Kind::Comma | Kind::At);
        if word.kind != Kind::Ident || is_name || !self.is_word(word, "OVERLAP") {
            return;
        }
        let diagnostic = Diagnostic::new(Code::NotSupported, self.span_of(word), "`OVERLAP` is not supported");
        self.tell(diagnostic.help("fields that share their memory are those of a UNION"));
        self.bump();
    }
}
