//! Words of ST, found without a parser: comments, pragmas and texts are no words.

/// Words and where they begin.
pub(super) fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    Words { text, at: 0 }
}

struct Words<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Iterator for Words<'a> {
    type Item = (usize, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let rest = &self.text[self.at..];
            let first = rest.chars().next()?;
            if is_word(first) {
                let start = self.at;
                self.at += rest.find(|c| !is_word(c)).unwrap_or(rest.len());
                return Some((start, &self.text[start..self.at]));
            }
            self.at += skipped(rest, first);
        }
    }
}

fn is_word(c: char) -> bool {
    c == '_' || c.is_alphanumeric()
}

/// Bytes of what is no word at the start of `rest`: a comment, pragma or text as a whole.
fn skipped(rest: &str, first: char) -> usize {
    let until = |from: usize, end: &str| rest[from..].find(end).map_or(rest.len(), |length| from + length + end.len());
    match first {
        '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
        '/' if rest.starts_with("/*") => nested(rest, "/*", "*/"),
        '(' if rest.starts_with("(*") => nested(rest, "(*", "*)"),
        '{' => until(1, "}"),
        '\'' => text_end(rest, '\''),
        '"' => text_end(rest, '"'),
        other => other.len_utf8(),
    }
}

/// Bytes of a comment that holds comments.
fn nested(rest: &str, open: &str, close: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    while let Some(c) = rest[at..].chars().next() {
        if rest[at..].starts_with(open) {
            depth += 1;
            at += open.len();
        } else if rest[at..].starts_with(close) {
            depth -= 1;
            at += close.len();
            if depth == 0 {
                return at;
            }
        } else {
            at += c.len_utf8();
        }
    }
    rest.len()
}

/// Bytes of a text in quotes, which `$` escapes and the end of the line ends.
fn text_end(rest: &str, quote: char) -> usize {
    let mut characters = rest.char_indices().skip(1);
    while let Some((at, c)) = characters.next() {
        match c {
            '$' => {
                characters.next();
            }
            '\n' => return at,
            c if c == quote => return at + 1,
            _ => {}
        }
    }
    rest.len()
}

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn comments_pragmas_and_texts_are_no_words() {
        let text = "(* a (* b *) c *) {attribute 'x'} // d\nFUNCTION_BLOCK 泵_1 /* e */ s := 'it$'s // f' + \"g\"; END";
        let found: Vec<&str> = words(text).map(|(_, word)| word).collect();
        assert_eq!(found, ["FUNCTION_BLOCK", "泵_1", "s", "END"]);
        assert_eq!(words("(* open").count(), 0);
        assert_eq!(words("{ open").count() + words("'open").count() + words("").count(), 0);
    }
}
