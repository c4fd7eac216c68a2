//! Comments and pragmas of declarations.
//!
//! The comment at the end of a declaration's line describes it, or else the one directly before it. A comment that ends the line of the declaration
//! before belongs to that one; an empty line separates a comment from what follows.

use super::Parser;
use crate::lexer::Comment;
use crate::tree::Pragma;

impl Parser<'_> {
    /// Pragmas in front of the token with this index.
    pub(super) fn pragmas(&self, index: usize) -> Vec<Pragma> {
        let all = &self.lexed.pragmas;
        let from = all.partition_point(|placed| (placed.before as usize) < index);
        all[from..].iter().take_while(|placed| placed.before as usize == index).map(|placed| placed.pragma.clone()).collect()
    }

    /// The comment directly before the token with this index.
    pub(super) fn doc_before(&self, index: usize) -> Option<String> {
        let comments = self.comments_before(index);
        if comments.is_empty() {
            return None;
        }
        let floor = index.checked_sub(1).map_or(0, |before| self.lexed.tokens[before].end);
        let mut below = self.lexed.tokens[index].start;
        let mut first = comments.len();
        while let Some(comment) = first.checked_sub(1).map(|at| comments[at]) {
            let shares_line = self.breaks(floor, comment.start) == 0 && floor > 0;
            if shares_line || self.empty_line_between(comment.end, below) {
                break;
            }
            below = comment.start;
            first -= 1;
        }
        join(comments[first..].iter().map(|comment| self.words(comment)))
    }

    /// The comment on the line on which the last token taken ends.
    pub(super) fn doc_behind(&self) -> Option<String> {
        let end = self.previous().end;
        let comments = self.comments_before(self.at);
        let comment = comments.first().filter(|comment| self.breaks(end, comment.start) == 0)?;
        // A comment in front of another declaration on the same line describes that one.
        if self.breaks(comment.start, self.token().start) == 0 && self.token().start as usize != self.text.len() {
            return None;
        }
        join(std::iter::once(self.words(comment)))
    }

    fn comments_before(&self, index: usize) -> &[Comment] {
        let all = &self.lexed.comments;
        let from = all.partition_point(|comment| (comment.before as usize) < index);
        let count = all[from..].iter().take_while(|comment| comment.before as usize == index).count();
        &all[from..from + count]
    }

    /// Line breaks between two places, counted up to two.
    fn breaks(&self, from: u32, to: u32) -> usize {
        self.text.as_bytes()[from as usize..to as usize].iter().filter(|&&byte| byte == b'\n').take(2).count()
    }

    /// Whether an empty line lies between two places; pragmas and their lines do not count.
    fn empty_line_between(&self, from: u32, to: u32) -> bool {
        let mut lines = self.text[from as usize..to as usize].split('\n').skip(1).peekable();
        while let Some(line) = lines.next() {
            if lines.peek().is_some() && line.trim().is_empty() {
                return true;
            }
        }
        false
    }

    /// A comment without its signs.
    fn words(&self, comment: &Comment) -> String {
        let text = &self.text[comment.start as usize..comment.end as usize];
        if let Some(line) = text.strip_prefix("//") {
            return line.trim_start_matches('/').trim().to_owned();
        }
        let body = text.get(2..text.len() - 2).unwrap_or("");
        let lines = body.lines().map(|line| line.trim().trim_start_matches('*').trim_end_matches('*').trim());
        lines.collect::<Vec<_>>().join("\n").trim().to_owned()
    }
}

fn join(parts: impl Iterator<Item = String>) -> Option<String> {
    let text = parts.collect::<Vec<_>>().join("\n");
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}
