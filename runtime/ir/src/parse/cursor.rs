//! Words of the text form, one after the other.

use super::ParseError;
use std::str::FromStr;

/// A piece of text and where it starts.
#[derive(Debug, Clone, Copy)]
struct Token<'a> {
    /// A word, one sign of punctuation, `->`, or a quoted text with its quotes.
    text: &'a str,
    line: u32,
    column: u32,
}

/// Reads tokens in order. The end is an empty token.
pub(super) struct Cursor<'a> {
    tokens: Vec<Token<'a>>,
    next: usize,
}

const PUNCTUATION: &[char] = &['(', ')', ',', '=', '[', ']', ':', '+', '{', '}', '@'];

impl<'a> Cursor<'a> {
    pub(super) fn new(text: &'a str) -> Result<Self, ParseError> {
        let mut tokens = vec![];
        let (mut line, mut column) = (1, 1);
        let mut rest = text;
        while let Some(first) = rest.chars().next() {
            let len = match first {
                ';' => rest.find('\n').unwrap_or(rest.len()),
                '"' => quoted_len(rest).ok_or(ParseError { line, column, message: "the text has no closing `\"`".into() })?,
                _ if rest.starts_with("->") => 2,
                _ if first.is_whitespace() || PUNCTUATION.contains(&first) => first.len_utf8(),
                _ => rest.find(|c: char| c.is_whitespace() || c == ';' || c == '"' || PUNCTUATION.contains(&c)).unwrap_or(rest.len()),
            };
            let (piece, tail) = rest.split_at(len);
            if first != ';' && !first.is_whitespace() {
                tokens.push(Token { text: piece, line, column });
            }
            for c in piece.chars() {
                (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
            }
            rest = tail;
        }
        tokens.push(Token { text: "", line, column });
        Ok(Self { tokens, next: 0 })
    }

    fn token(&self) -> Token<'a> {
        self.tokens[self.next.min(self.tokens.len() - 1)]
    }
    pub(super) fn at_end(&self) -> bool {
        self.token().text.is_empty()
    }
    /// The next token, without taking it.
    pub(super) fn peek(&self) -> &'a str {
        self.token().text
    }
    /// The token behind the next one.
    pub(super) fn peek_second(&self) -> &'a str {
        self.tokens.get(self.next + 1).map_or("", |t| t.text)
    }
    fn take(&mut self) -> &'a str {
        let text = self.token().text;
        self.next += 1;
        text
    }
    /// A mistake at the next token.
    pub(super) fn wrong(&self, message: &str) -> ParseError {
        let Token { line, column, .. } = self.token();
        ParseError { line, column, message: message.into() }
    }
    /// A mistake at the token taken last.
    pub(super) fn wrong_last(&self, message: &str) -> ParseError {
        let Token { line, column, .. } = self.tokens[self.next.saturating_sub(1).min(self.tokens.len() - 1)];
        ParseError { line, column, message: message.into() }
    }
    fn wrong_token(&self, expected: &str) -> ParseError {
        let found = if self.at_end() { "the end" } else { self.peek() };
        self.wrong(&format!("expected {expected}, found `{found}`"))
    }

    /// Takes the token if it is this one.
    pub(super) fn accept(&mut self, text: &str) -> bool {
        let is = self.peek() == text;
        self.next += usize::from(is);
        is
    }
    pub(super) fn expect(&mut self, text: &str) -> Result<(), ParseError> {
        if self.accept(text) { Ok(()) } else { Err(self.wrong_token(&format!("`{text}`"))) }
    }
    /// A word.
    pub(super) fn word(&mut self) -> Result<&'a str, ParseError> {
        let text = self.peek();
        if text.is_empty() || text == "->" || text.starts_with(PUNCTUATION) || text.starts_with('"') {
            return Err(self.wrong_token("a word"));
        }
        Ok(self.take())
    }
    pub(super) fn number<T: FromStr>(&mut self) -> Result<T, ParseError> {
        let number = self.peek().parse().map_err(|_| self.wrong_token("a number"))?;
        self.next += 1;
        Ok(number)
    }
    /// A word of a letter and a number: `v3`, `b0`.
    pub(super) fn numbered(&mut self, letter: char) -> Result<u32, ParseError> {
        let number = number_behind(self.peek(), letter).ok_or_else(|| self.wrong_token(&format!("`{letter}` and a number")))?;
        self.next += 1;
        Ok(number)
    }
    /// `low..high`, each read by `part`.
    pub(super) fn range<T>(&mut self, part: impl Fn(&str) -> Option<T>) -> Result<(T, T), ParseError> {
        let parts = self.peek().split_once("..").and_then(|(low, high)| part(low).zip(part(high)));
        let parts = parts.ok_or_else(|| self.wrong_token("bounds `0..9`"))?;
        self.next += 1;
        Ok(parts)
    }
    /// A quoted text.
    pub(super) fn text(&mut self) -> Result<String, ParseError> {
        let Some(inner) = self.peek().strip_prefix('"').and_then(|t| t.strip_suffix('"')) else {
            return Err(self.wrong_token("a text in `\"`"));
        };
        self.next += 1;
        let mut text = String::new();
        let mut chars = inner.chars();
        while let Some(c) = chars.next() {
            text.push(match c {
                '\\' => match chars.next() {
                    Some('n') => '\n',
                    Some(other) => other,
                    None => '\\',
                },
                _ => c,
            });
        }
        Ok(text)
    }
    /// Bytes as hexadecimal digits in quotes.
    pub(super) fn hex(&mut self) -> Result<Vec<u8>, ParseError> {
        let digits: Vec<u8> = self.text()?.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        let value = |digit: u8| char::from(digit).to_digit(16).map(|v| v as u8);
        let bytes = digits.chunks(2).map(|pair| if let [a, b] = pair { Some(value(*a)? << 4 | value(*b)?) } else { None });
        bytes.collect::<Option<_>>().ok_or_else(|| self.wrong_last("expected pairs of hexadecimal digits"))
    }
    /// `doc "…"`, or nothing.
    pub(super) fn doc(&mut self) -> Result<String, ParseError> {
        if self.accept("doc") { self.text() } else { Ok(String::new()) }
    }
    /// Items with commas between them, up to a closing sign.
    pub(super) fn list<T>(&mut self, close: &str, mut item: impl FnMut(&mut Self) -> Result<T, ParseError>) -> Result<Vec<T>, ParseError> {
        let mut items = vec![];
        while !self.accept(close) {
            if !items.is_empty() {
                self.expect(",")?;
            }
            items.push(item(self)?);
        }
        Ok(items)
    }
}

/// The number in `v3`.
pub(super) fn number_behind(word: &str, letter: char) -> Option<u32> {
    word.strip_prefix(letter)?.parse().ok()
}

fn quoted_len(rest: &str) -> Option<usize> {
    let mut escaped = false;
    for (i, c) in rest.char_indices().skip(1) {
        match c {
            '"' if !escaped => return Some(i + 1),
            _ => escaped = c == '\\' && !escaped,
        }
    }
    None
}
