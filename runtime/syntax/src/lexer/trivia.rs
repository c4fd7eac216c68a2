//! What stands between tokens: comments and pragmas.
//!
//! Both remember the token that follows them, so that the parser can give them to what they describe.

use super::{Scanner, shorten};
use crate::Code;
use crate::tree::Pragma;

/// A comment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Comment {
    /// First byte of its opening sign.
    pub start: u32,
    /// Behind its last byte.
    pub end: u32,
    /// Index of the token that follows.
    pub before: u32,
}

/// A pragma.
#[derive(Debug, Clone)]
pub(crate) struct PlacedPragma {
    /// What it says.
    pub pragma: Pragma,
    /// `{attribute …}`, whose name may be that of a directive.
    pub is_attribute: bool,
    /// Index of the token that follows.
    pub before: u32,
}

impl PlacedPragma {
    /// Whether it acts before the parser and is not for it to see.
    pub(crate) fn is_directive(&self) -> bool {
        !self.is_attribute && DIRECTIVES.contains(&self.pragma.name.as_str())
    }
}

/// Pragmas that act before the parser.
const DIRECTIVES: &[&str] = &["if", "elsif", "else", "end_if", "define", "undefine", "error", "warning", "info", "text"];

/// Words that a pragma may begin with. Braces with other contents may be blocks in the manner of C.
const PRAGMA_WORDS: &[&str] = &[
    "attribute",
    "region",
    "endregion",
    "warning",
    "info",
    "error",
    "text",
    "if",
    "elsif",
    "else",
    "end_if",
    "define",
    "undefine",
    "flag",
    "link",
    "library",
    "analysis",
    "implicit",
    "p_open",
    "external",
    "inline",
    "section",
];

impl Scanner<'_> {
    fn next_index(&self) -> u32 {
        self.out.tokens.len() as u32
    }

    pub(super) fn line_comment(&mut self, start: usize) {
        let rest = &self.text[self.here()..];
        let end = rest.find('\n').map_or(self.text.len(), |length| self.here() + length);
        self.jump(end);
        let before = self.next_index();
        self.out.comments.push(Comment { start: start as u32, end: end as u32, before });
    }

    pub(super) fn block_comment(&mut self, start: usize, open: [u8; 2], close: [u8; 2]) {
        let bytes = self.text.as_bytes();
        let mut at = self.here();
        let mut depth = 1_usize;
        while depth > 0 && at < bytes.len() {
            let pair = bytes.get(at..at + 2);
            if pair == Some(&close) {
                depth -= 1;
                at += 2;
            } else if pair == Some(&open) {
                depth += 1;
                at += 2;
            } else {
                self.fresh_line |= bytes[at] == b'\n';
                at += 1;
            }
        }
        if depth > 0 {
            let close = String::from_utf8_lossy(&close).into_owned();
            let message = format!("this comment is not closed by `{close}`");
            let help = if depth > 1 {
                format!("comments nest: {depth} are open at the end of the file")
            } else {
                format!("write `{close}` behind its last word")
            };
            self.report_with_help(Code::UnterminatedComment, (start, start + 2), message, help);
            self.out.truncated = true;
        }
        self.jump(at);
        let before = self.next_index();
        self.out.comments.push(Comment { start: start as u32, end: at as u32, before });
    }

    /// `{`: a pragma, or a block in the manner of C.
    pub(super) fn brace(&mut self, start: usize) {
        let from = self.here();
        let rest = self.text[from..].trim_start();
        let word = rest.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or("");
        let known = PRAGMA_WORDS.iter().any(|known| known.eq_ignore_ascii_case(word));
        let bytes = &self.text.as_bytes()[from..];
        let spans_lines = word.eq_ignore_ascii_case("attribute").then(|| quote_over_lines(bytes)).flatten();
        let close = spans_lines.or_else(|| closing_brace(bytes, known)).map(|length| from + length);
        match close {
            Some(close) => {
                self.jump(close + 1);
                self.pragma(start, close);
            }
            None if known => {
                self.report(Code::UnterminatedComment, start, start + 1, "this pragma is not closed by `}`");
                self.jump(self.text[from..].find('\n').map_or(self.text.len(), |length| from + length));
            }
            None => {
                let help = "blocks are written with words: `IF a THEN … END_IF`, `FOR i := 1 TO 10 DO … END_FOR`";
                self.report_with_help(Code::UnexpectedToken, (start, start + 1), "braces do not make a block in ST", help);
            }
        }
    }

    fn pragma(&mut self, start: usize, close: usize) {
        let text = self.text[start + 1..close].trim();
        let (word, rest) = text.split_at(text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len()));
        let mut name = word.to_ascii_lowercase();
        let rest = rest.trim();
        let mut value = Some(rest.to_owned()).filter(|rest| !rest.is_empty());
        let is_attribute = name == "attribute";
        if matches!(name.as_str(), "region" | "endregion") {
            return;
        }
        if is_attribute {
            let (attribute, assigned) = rest.split_once(":=").unwrap_or((rest, ""));
            name = unquote(attribute).to_ascii_lowercase();
            value = Some(unquote(assigned).to_owned()).filter(|_| !assigned.trim().is_empty());
        } else if !PRAGMA_WORDS.contains(&name.as_str()) {
            let message = format!("the pragma `{{{}}}` is not known and has no effect", shorten(text));
            self.report(Code::NoEffect, start, close + 1, message);
        }
        let before = self.next_index();
        let span = self.span(start, close + 1);
        let placed = PlacedPragma { pragma: Pragma { name, value, span }, is_attribute, before };
        self.out.has_directives |= placed.is_directive();
        self.out.pragmas.push(placed);
    }
}

/// Length of a pragma's contents. Unless the pragma's word is known, a `;` or line break says that it is none.
fn closing_brace(bytes: &[u8], known: bool) -> Option<usize> {
    let mut quote = None;
    for (at, &byte) in bytes.iter().enumerate() {
        match (quote, byte) {
            (None, b'}') => return Some(at),
            (None, b';' | b'\n') if !known => return None,
            // An attribute stands on one line or a few; a forgotten brace must not swallow the program.
            (None, b'{') => return None,
            (None, b'\'' | b'"') => quote = Some(byte),
            (Some(open), _) if byte == open || byte == b'\n' => quote = None,
            _ => {}
        }
    }
    None
}

/// Length of an attribute's contents whose value is one text of several lines, as TwinCAT allows: `{attribute 'a' := '` … `'}`.
fn quote_over_lines(bytes: &[u8]) -> Option<usize> {
    let ends = bytes.iter().position(|&byte| byte == b'\n')?;
    let assigned = bytes[..ends].windows(2).position(|pair| pair == b":=")? + 2;
    let skipped = assigned + bytes[assigned..ends].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    let quote = *bytes.get(skipped).filter(|byte| matches!(byte, b'\'' | b'"'))?;
    if bytes[skipped + 1..ends].contains(&quote) {
        return None;
    }
    let mut quoted = false;
    for (at, &byte) in bytes.iter().enumerate().skip(ends) {
        match byte {
            b'}' if quoted => return Some(at),
            // Another pragma: the quote was forgotten, and must not swallow the program.
            b'{' => return None,
            _ if byte == quote => quoted = true,
            _ => quoted &= byte.is_ascii_whitespace(),
        }
    }
    None
}

/// A text without the quotes around it.
pub(crate) fn unquote(text: &str) -> &str {
    text.trim().trim_matches(['\'', '"'])
}

#[cfg(test)]
mod tests {
    use super::super::{Kind, lex};
    use crate::FileId;

    fn kinds(text: &str) -> Vec<Kind> {
        lex(FileId(0), text).tokens.iter().map(|token| token.kind).collect()
    }

    fn codes(text: &str) -> Vec<(&'static str, u32)> {
        lex(FileId(0), text).diagnostics.iter().map(|d| (d.code.text(), d.span.start)).collect()
    }

    #[test]
    fn comments_nest_and_end() {
        assert_eq!(kinds("a (* b (* c *) d *) /* x /* y */ z */ // end\ne"), [Kind::Ident, Kind::Ident, Kind::Eof]);
        assert_eq!(codes("a (* b (* c *) d"), [("E0102", 2)]);
        assert_eq!(codes(&"(*".repeat(100_000)), [("E0102", 0)]);
    }

    #[test]
    fn pragmas_are_read() {
        let lexed = lex(FileId(0), "{attribute 'Pack_Mode' := '1'} {region \"x\"} {warning 'w'} {attribute 'a'} b {IF defined(x)}");
        let read: Vec<_> = lexed.pragmas.iter().map(|p| (p.pragma.name.as_str(), p.pragma.value.as_deref(), p.before)).collect();
        assert_eq!(read, [("pack_mode", Some("1"), 0), ("warning", Some("'w'"), 0), ("a", None, 0), ("if", Some("defined(x)"), 1)]);
        assert_eq!(lexed.diagnostics, []);
        assert_eq!(codes("{attribute 'a' := '} {'} {nonsense 1} x"), [("W0101", 25)]);
    }

    #[test]
    fn the_text_of_an_attribute_may_have_lines() {
        let lexed = lex(FileId(0), "{attribute 'pytmc' := '\n pv: Bob's; x := 1\n io: i\n' } a {attribute 'b'}");
        let read: Vec<_> = lexed.pragmas.iter().map(|p| (p.pragma.name.as_str(), p.pragma.value.as_deref())).collect();
        assert_eq!(read, [("pytmc", Some("\n pv: Bob's; x := 1\n io: i\n")), ("b", None)]);
        assert_eq!(lexed.diagnostics, []);
        // A quote that was forgotten does not swallow what follows.
        assert_eq!(kinds("{attribute 'a' := 'x\n} b {attribute 'c' := 'y'}\n'}"), kinds("b '}"));
    }

    #[test]
    fn braces_of_c_are_one_mistake() {
        assert_eq!(codes("IF a THEN { b := 1; }"), [("E0105", 10)]);
        assert_eq!(kinds("{ b; }"), [Kind::Ident, Kind::Semi, Kind::Eof]);
    }
}
