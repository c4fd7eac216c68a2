//! Text to tokens.
//!
//! Promises: time linear in the text; every byte is in a token, a comment, a pragma or white space, or was complained of. Signs of other languages
//! (`==`, `&&`, `!=`, full-width `；`) are reported once and become the ST sign that was meant, so that the parser need not know them; what nobody can
//! read becomes a [`Kind::Bad`] token, of which the parser does not complain again.
//! Lacks: the values of literals (`parser/literals.rs`).

mod kind;
mod scan;
mod trivia;

use logos::Logos;

pub(crate) use kind::Kind;
pub(crate) use trivia::{Comment, PlacedPragma, unquote};

use crate::{Code, Diagnostic, FileId, Span};
use scan::{PrefixClass, full_width, prefix_class, run, scan_date, scan_duration, scan_number, text_over_lines, word_end};

/// More messages than this about one file are of no use to anybody.
pub(crate) const MAX_DIAGNOSTICS: usize = 1000;

/// A token; its text is the range of the source.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Token {
    /// What it is.
    pub kind: Kind,
    /// Whether it is the first of its line.
    pub starts_line: bool,
    /// First byte.
    pub start: u32,
    /// Behind the last byte.
    pub end: u32,
}

/// What the lexer makes of a file.
#[derive(Debug, Default)]
pub(crate) struct Lexed {
    /// Tokens, the last one is [`Kind::Eof`].
    pub tokens: Vec<Token>,
    /// Comments in order.
    pub comments: Vec<Comment>,
    /// Pragmas in order.
    pub pragmas: Vec<PlacedPragma>,
    /// What was found wrong, in the order of the places.
    pub diagnostics: Vec<Diagnostic>,
    /// There are pragmas that act before the parser.
    pub has_directives: bool,
    /// A comment or pragma swallowed the rest of the file: what is missing at its end is no second mistake.
    pub truncated: bool,
}

/// Cuts `text` into tokens. The text must be shorter than 4 GiB.
pub(crate) fn lex(file: FileId, text: &str) -> Lexed {
    let mut out = Lexed::default();
    out.tokens.reserve(text.len() / 5 + 1);
    let mut scanner = Scanner { file, text, raw: Raw::lexer(text), out, fresh_line: true };
    scanner.run();
    scanner.out
}

#[derive(Logos, Debug, Clone, Copy, PartialEq)]
#[logos(skip r"[ \t\r\x0B\x0C]+")]
enum Raw {
    #[token("\n")]
    Newline,
    #[regex(r"[A-Za-z_\u{80}-\u{10FFFF}][0-9A-Za-z_\u{80}-\u{10FFFF}]*")]
    Word,
    #[regex(r"[0-9][0-9A-Za-z_]*")]
    Number,
    #[token("'", |_| b'\'')]
    #[token("\"", |_| b'"')]
    Quote(u8),
    #[token("//")]
    LineComment,
    #[token("(*")]
    BlockComment,
    #[token("/*")]
    SlashComment,
    #[token("{")]
    Brace,
    #[token("}")]
    CloseBrace,
    #[token("%")]
    Percent,
    #[token(":=", |_| Kind::Assign)]
    #[token("=>", |_| Kind::Output)]
    #[token("?=", |_| Kind::TryAssign)]
    #[token("=", |_| Kind::Eq)]
    #[token("<>", |_| Kind::Ne)]
    #[token("<", |_| Kind::Lt)]
    #[token("<=", |_| Kind::Le)]
    #[token(">", |_| Kind::Gt)]
    #[token(">=", |_| Kind::Ge)]
    #[token("+", |_| Kind::Plus)]
    #[token("-", |_| Kind::Minus)]
    #[token("*", |_| Kind::Star)]
    #[token("**", |_| Kind::Power)]
    #[token("/", |_| Kind::Slash)]
    #[token("&", |_| Kind::Amp)]
    #[token("^", |_| Kind::Caret)]
    #[token(".", |_| Kind::Dot)]
    #[token("..", |_| Kind::DotDot)]
    #[token(",", |_| Kind::Comma)]
    #[token(";", |_| Kind::Semi)]
    #[token(":", |_| Kind::Colon)]
    #[token("(", |_| Kind::LParen)]
    #[token(")", |_| Kind::RParen)]
    #[token("[", |_| Kind::LBracket)]
    #[token("]", |_| Kind::RBracket)]
    #[token("#", |_| Kind::Hash)]
    Sign(Kind),
    #[token("==", |_| Kind::Eq)]
    #[token("!=", |_| Kind::Ne)]
    #[token("&&", |_| Kind::And)]
    #[token("||", |_| Kind::Or)]
    #[token("!", |_| Kind::Not)]
    #[token("+=", |_| Kind::Assign)]
    #[token("-=", |_| Kind::Assign)]
    #[token("*=", |_| Kind::Assign)]
    #[token("/=", |_| Kind::Assign)]
    #[token("<<=", |_| Kind::Assign)]
    #[token(">>=", |_| Kind::Assign)]
    #[token("%=", |_| Kind::Assign)]
    #[token("|=", |_| Kind::Assign)]
    #[token("<<", |_| Kind::Star)]
    #[token(">>", |_| Kind::Slash)]
    #[token("|", |_| Kind::Or)]
    #[token("~", |_| Kind::Not)]
    #[token("=:", |_| Kind::Assign)]
    #[token("=<", |_| Kind::Le)]
    #[token("->", |_| Kind::Dot)]
    Slip(Kind),
    #[token("*)")]
    StrayCommentEnd,
}

/// What to write instead of a sign of another language.
fn slip_help(sign: &str) -> &'static str {
    match sign {
        "==" => "a comparison is written `=`",
        "!=" => "\"not equal\" is written `<>`",
        "&&" => "\"and\" is written `AND`, or `AND_THEN` to skip the right side",
        "||" => "\"or\" is written `OR`, or `OR_ELSE` to skip the right side",
        "!" => "\"not\" is written `NOT`",
        "+=" => "write `a := a + b;`",
        "-=" => "write `a := a - b;`",
        "*=" => "write `a := a * b;`",
        "/=" => "write `a := a / b;`, or `<>` for \"not equal\"",
        "%=" => "write `a := a MOD b;`",
        "|=" => "write `a := a OR b;`",
        "<<" | "<<=" => "a shift to the left is written `SHL(a, n)`",
        ">>" | ">>=" => "a shift to the right is written `SHR(a, n)`",
        "|" => "\"or\" is written `OR`, of bits too",
        "~" => "\"not\" is written `NOT`, of bits too",
        "=:" => "an assignment is written `:=`",
        "=<" => "\"at most\" is written `<=`",
        _ => "a member is written `p^.member`",
    }
}

struct Scanner<'a> {
    file: FileId,
    text: &'a str,
    raw: logos::Lexer<'a, Raw>,
    out: Lexed,
    fresh_line: bool,
}

impl<'a> Scanner<'a> {
    fn run(&mut self) {
        while let Some(raw) = self.raw.next() {
            let start = self.raw.span().start;
            match raw {
                Ok(Raw::Newline) => self.fresh_line = true,
                Ok(Raw::Sign(kind)) => self.push(kind, start),
                Ok(Raw::Word) => self.word(start),
                Ok(Raw::Number) => self.number(start),
                Ok(Raw::Quote(quote)) => self.string(start, quote),
                Ok(Raw::LineComment) => self.line_comment(start),
                Ok(Raw::BlockComment) => self.block_comment(start, *b"(*", *b"*)"),
                Ok(Raw::SlashComment) => self.block_comment(start, *b"/*", *b"*/"),
                Ok(Raw::Brace) => self.brace(start),
                Ok(Raw::CloseBrace) => {}
                Ok(Raw::Percent) => self.percent(start),
                Ok(Raw::Slip(kind)) => self.slip(kind, start, slip_help(self.raw.slice())),
                Ok(Raw::StrayCommentEnd) => {
                    self.report(Code::UnexpectedToken, start, self.here(), "`*)` closes a comment that was never opened");
                }
                Err(()) => self.unexpected(start),
            }
        }
        let end = self.text.len();
        self.push(Kind::Eof, end);
    }

    /// Where the next token begins to be looked for.
    fn here(&self) -> usize {
        self.raw.span().end
    }

    /// Goes on lexing at byte `at`.
    fn jump(&mut self, at: usize) {
        if at >= self.here() {
            self.raw.bump(at - self.here());
        } else {
            self.raw = Raw::lexer(self.text);
            self.raw.bump(at);
        }
    }

    fn push(&mut self, kind: Kind, start: usize) {
        let end = self.here().max(start);
        self.out.tokens.push(Token { kind, starts_line: self.fresh_line, start: start as u32, end: end as u32 });
        self.fresh_line = false;
    }

    fn span(&self, start: usize, end: usize) -> Span {
        Span { file: self.file, start: start as u32, end: end as u32 }
    }

    fn report(&mut self, code: Code, start: usize, end: usize, message: impl Into<String>) -> Option<&mut Diagnostic> {
        if self.out.diagnostics.len() >= MAX_DIAGNOSTICS {
            return None;
        }
        let span = self.span(start, end);
        self.out.diagnostics.push(Diagnostic::new(code, span, message));
        self.out.diagnostics.last_mut()
    }

    fn report_with_help(&mut self, code: Code, (start, end): (usize, usize), message: impl Into<String>, help: impl Into<String>) {
        if let Some(diagnostic) = self.report(code, start, end, message) {
            diagnostic.help = Some(help.into());
        }
    }

    fn slip(&mut self, kind: Kind, start: usize, help: &str) {
        let end = self.here();
        let message = format!("`{}` is not an ST operator", &self.text[start..end]);
        self.report_with_help(Code::UnexpectedToken, (start, end), message, help);
        self.push(kind, start);
    }

    fn word(&mut self, start: usize) {
        let word = self.raw.slice();
        let bytes = self.text.as_bytes();
        let end = self.here();
        if !word.is_ascii() {
            return self.unicode_word(start, word);
        }
        if bytes.get(end) == Some(&b'#')
            && let Some(class) = prefix_class(word)
        {
            return self.typed_literal(start, end + 1, class);
        }
        self.push(kind::word_kind(word), start);
    }

    /// A word with letters beyond ASCII, which ends at the first character that no name can hold.
    fn unicode_word(&mut self, start: usize, word: &str) {
        let Some((at, stranger)) = word.char_indices().find(|(_, c)| !c.is_alphanumeric() && *c != '_') else {
            return self.push(Kind::Ident, start);
        };
        if at > 0 {
            self.jump(start + at);
            let kind = kind::word_kind(&word[..at]);
            self.push(kind, start);
        }
        let place = start + at;
        self.jump(place + stranger.len_utf8());
        self.stranger(place, stranger);
    }

    /// A character beyond ASCII that is no letter.
    fn stranger(&mut self, start: usize, stranger: char) {
        let is_space = stranger.is_whitespace() || stranger.is_control() || matches!(stranger, '\u{feff}' | '\u{200b}'..='\u{200f}');
        if is_space {
            return;
        }
        if let Some((kind, mut end)) = full_width(stranger).map(|kind| (kind, self.here())) {
            let rest = &self.text[end..];
            let mut kind = kind;
            if kind == Kind::Colon && (rest.starts_with('=') || rest.starts_with('\u{ff1d}')) {
                end += rest.chars().next().map_or(0, char::len_utf8);
                kind = Kind::Assign;
            }
            self.jump(end);
            let message = format!("`{}` is a full-width sign", &self.text[start..end]);
            self.report_with_help(Code::UnexpectedCharacter, (start, end), message, format!("write `{}`", kind.text()));
            return self.push(kind, start);
        }
        if let Some(close) = match stranger {
            '\u{201c}' | '\u{201d}' => Some('\u{201d}'),
            '\u{2018}' | '\u{2019}' => Some('\u{2019}'),
            _ => None,
        } {
            return self.typographic_quote(start, stranger, close);
        }
        self.unexpected(start);
    }

    fn typographic_quote(&mut self, start: usize, open: char, close: char) {
        let from = self.here();
        // A quoted text is short; looking further for its end would take quadratic time on a line of such quotes.
        let mut line = self.text[from..].char_indices().take(400).take_while(|(_, c)| *c != '\n');
        if let Some((length, _)) = line.find(|(_, c)| *c == close) {
            self.jump(from + length + close.len_utf8());
        }
        let help = "a STRING is written 'text', a WSTRING \"text\", both with straight quotes";
        self.report_with_help(
            Code::UnexpectedCharacter,
            (start, start + open.len_utf8()),
            format!("`{open}` is a typographic quote"),
            help,
        );
        self.push(Kind::Bad, start);
    }

    /// Characters that start no token: one message for a run of them.
    fn unexpected(&mut self, start: usize) {
        let mut end = self.here();
        while end < self.text.len() && (self.text.as_bytes()[end].is_ascii_control() || b"\\@$?`".contains(&self.text.as_bytes()[end])) {
            if self.text.as_bytes()[end].is_ascii_whitespace() {
                break;
            }
            end += 1;
        }
        self.jump(end);
        if let Some(last) = self.out.diagnostics.last_mut()
            && last.code == Code::UnexpectedCharacter
            && last.span.end == start as u32
        {
            last.span.end = end as u32;
            return;
        }
        let first = self.text[start..].chars().next().unwrap_or(' ');
        let message = if first.is_control() {
            format!("unexpected control character U+{:04X}", first as u32)
        } else {
            format!("unexpected character `{first}`")
        };
        self.report(Code::UnexpectedCharacter, start, end, message);
        self.push(Kind::Bad, start);
    }

    /// A number: decimal, with a base, or real. A word that begins with a digit is a mistake.
    fn number(&mut self, start: usize) {
        let (end, kind) = scan_number(self.text.as_bytes(), start);
        // What the number did not take belongs to a misspelled word.
        let tail = word_end(self.text, end);
        self.jump(tail);
        if tail == end {
            return self.push(kind, start);
        }
        let text = &self.text[start..tail];
        let lower = text.to_ascii_lowercase();
        let message = format!("`{}` is neither a number nor a name", shorten(text));
        let digits = text.trim_end_matches(|c: char| !c.is_ascii_digit()).len();
        let help = if let Some(hex) = lower.strip_prefix("0x") {
            format!("a hexadecimal number is written `16#{}`", hex.to_uppercase())
        } else if let Some(binary) = lower.strip_prefix("0b") {
            format!("a binary number is written `2#{binary}`")
        } else if matches!(&lower[digits.min(lower.len())..], "ms" | "s" | "us" | "ns" | "m" | "h" | "d") {
            format!("a duration is written `T#{text}`")
        } else {
            "a name begins with a letter or `_`".to_owned()
        };
        self.report_with_help(Code::BadLiteral, (start, tail), message, help);
        self.push(Kind::Bad, start);
    }

    /// `T#1s`, `INT#5`, `STRING#'a'`: `from` is behind the `#`.
    fn typed_literal(&mut self, start: usize, from: usize, class: PrefixClass) {
        let bytes = self.text.as_bytes();
        let end = match class {
            PrefixClass::Duration => scan_duration(bytes, from),
            PrefixClass::Date => scan_date(bytes, from, false),
            PrefixClass::DateTime => scan_date(bytes, from, true),
            PrefixClass::Number => {
                let sign = usize::from(matches!(bytes.get(from), Some(b'+' | b'-')));
                match bytes.get(from + sign) {
                    Some(b'0'..=b'9') => word_end(self.text, scan_number(bytes, from + sign).0),
                    _ => word_end(self.text, from + sign),
                }
            }
            PrefixClass::Text => match bytes.get(from) {
                Some(&quote @ (b'\'' | b'"')) => {
                    self.jump(from + 1);
                    return self.string(start, quote);
                }
                _ => from,
            },
        };
        self.jump(end);
        if end == from {
            let message = format!("`{}` is not followed by a value", &self.text[start..end]);
            self.report(Code::BadLiteral, start, end, message);
            return self.push(Kind::Bad, start);
        }
        self.push(Kind::Literal, start);
    }

    /// A string whose opening quote has been read.
    fn string(&mut self, start: usize, quote: u8) {
        let bytes = self.text.as_bytes();
        let open = self.here() - 1;
        let mut at = self.here();
        while let Some(&byte) = bytes.get(at) {
            match byte {
                _ if byte == quote => {
                    self.jump(at + 1);
                    return self.push(Kind::Literal, start);
                }
                b'\n' => match text_over_lines(bytes, at, quote) {
                    Some(end) => at = end,
                    None => break,
                },
                b'$' if at + 1 < bytes.len() && bytes[at + 1] != b'\n' && bytes[at + 1].is_ascii() => at += 2,
                _ => at += 1,
            }
        }
        let line = self.text[open + 1..at].trim_end_matches([';', ' ', '\t', '\r', ')']);
        let help = if quote == b'\'' && line.ends_with('"') {
            "it opens with `'` and must close with `'`"
        } else if quote == b'"' && line.ends_with('\'') {
            "it opens with `\"` and must close with `\"`"
        } else if quote == b'\'' {
            "close it with `'`; a quote inside a string is written `$'`, a line break `$N`"
        } else {
            "close it with `\"`; a quote inside is written `$\"`, a line break `$N`"
        };
        self.report_with_help(Code::UnterminatedString, (open, open + 1), "this string is not closed on its line", help);
        self.jump(at);
        self.push(Kind::Bad, start);
    }

    /// `%IX0.0`, `%I*`, `%X3`, or the modulo sign of another language.
    fn percent(&mut self, start: usize) {
        let bytes = self.text.as_bytes();
        let at = |index: usize| bytes.get(start + index).map(u8::to_ascii_uppercase);
        let mut end = start + 1;
        let kind = match (at(1), at(2)) {
            (Some(b'I' | b'Q' | b'M'), Some(b'0'..=b'9' | b'*')) => {
                end += 1;
                Kind::Direct
            }
            (Some(b'I' | b'Q' | b'M'), Some(b'X' | b'B' | b'W' | b'D' | b'L')) if matches!(at(3), Some(b'0'..=b'9' | b'*')) => {
                end += 2;
                Kind::Direct
            }
            (Some(b'X' | b'B' | b'W' | b'D'), Some(b'0'..=b'9')) => {
                end += 1;
                Kind::PartAccess
            }
            _ => return self.slip(Kind::Mod, start, "the remainder is written `a MOD b`; a direct address `%IX0.0`"),
        };
        if bytes.get(end) == Some(&b'*') {
            end += 1;
        } else {
            end = run(bytes, end, |byte| byte.is_ascii_digit());
            while kind == Kind::Direct && bytes.get(end) == Some(&b'.') && bytes.get(end + 1).is_some_and(u8::is_ascii_digit) {
                end = run(bytes, end + 1, |byte| byte.is_ascii_digit());
            }
        }
        self.jump(end);
        self.push(kind, start);
    }
}

/// A text for a message, cut to a readable length.
pub(crate) fn shorten(text: &str) -> String {
    let line = text.lines().next().unwrap_or("");
    match line.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line.to_owned(),
    }
}
