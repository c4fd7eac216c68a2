//! ST written out of another file, every stretch with its place.
//!
//! For the compiler ([`Style::Places`]) there is one text, and every line of ST stands on the line of the file that it comes from, in its column, as
//! far as that is possible; [`Origin`] knows the exact place in any case. For people ([`Style::Clean`]) there is a text per unit, without gaps.

use super::origin::{Origin, Segment};
use super::xml::Piece;
use std::ops::Range;
use takt_syntax::{Code, Diagnostic, FileId, LineIndex, Source, Span};

/// Columns are not kept in lines longer than this.
const LONG_LINE: usize = 4096;

/// Mistakes of a file that are told; more say nothing new.
const FINDINGS: usize = 100;

/// Things left behind that are listed.
const LISTED: usize = 1000;

/// What a text is written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    /// The compiler: lines and columns of the file.
    Places,
    /// People: a text per unit.
    Clean,
}

/// A text that was made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Unit {
    /// What it is called, without extension.
    pub name: String,
    /// ST.
    pub text: String,
}

/// Something that ST cannot say and that was left behind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Left {
    /// The file.
    pub file: String,
    /// From 1.
    pub line: u32,
    /// In characters, from 1.
    pub column: u32,
    /// What.
    pub what: String,
    /// Why.
    pub reason: String,
}

/// What came of a file.
#[derive(Debug)]
pub(super) struct Written {
    /// One with [`Style::Places`], one per unit with [`Style::Clean`].
    pub units: Vec<Unit>,
    /// Where the text comes from; of use with [`Style::Places`] only.
    pub origin: Origin,
    /// Spans are in the made text of [`Style::Places`].
    pub findings: Vec<Diagnostic>,
    /// What was left behind.
    pub left: Vec<Left>,
}

/// Writes ST.
#[derive(Debug)]
pub(super) struct Writer {
    style: Style,
    origin: Origin,
    index: LineIndex,
    /// Where the lines of the first file begin.
    starts: Vec<usize>,
    /// Which file is being read.
    file: usize,
    units: Vec<Unit>,
    out: String,
    line: usize,
    line_start: usize,
    /// What was written last may end in a comment that the end of the line closes.
    is_open: bool,
    findings: Vec<Diagnostic>,
    left: Vec<Left>,
}

impl Writer {
    /// For a file.
    pub fn new(style: Style, file: Source) -> Self {
        Self {
            style,
            index: LineIndex::new(&file.text),
            starts: std::iter::once(0).chain(file.text.match_indices('\n').map(|(at, _)| at + 1)).collect(),
            origin: Origin::new(file),
            file: 0,
            units: Vec::new(),
            out: String::new(),
            line: 1,
            line_start: 0,
            is_open: false,
            findings: Vec::new(),
            left: Vec::new(),
        }
    }

    /// One more file that the text is made of; places in it are known, but its lines cannot agree.
    pub fn add_file(&mut self, file: Source) -> usize {
        self.origin.files.push(file);
        self.origin.files.len() - 1
    }

    /// Goes on with a file.
    pub fn select(&mut self, file: usize) {
        self.file = file;
    }

    /// Whether a list of that name must say so: the compiler calls a list as its file is called.
    pub fn needs_name(&self, name: &str, stem: &str) -> bool {
        match self.style {
            Style::Clean => super::file_name(name) != name,
            Style::Places => !name.eq_ignore_ascii_case(stem),
        }
    }

    /// Begins a unit; for people, in a text of its own.
    pub fn unit(&mut self, name: &str) {
        if self.style == Style::Clean {
            self.close_unit();
            self.units.push(Unit { name: name.into(), text: String::new() });
        }
    }

    fn close_unit(&mut self) {
        if let Some(unit) = self.units.last_mut() {
            unit.text = std::mem::take(&mut self.out);
            if !unit.text.is_empty() && !unit.text.ends_with('\n') {
                unit.text.push('\n');
            }
        }
        self.out.clear();
        (self.line, self.line_start, self.is_open) = (1, 0, false);
    }

    /// Begins a line, the one of the file's byte where that is possible.
    pub fn line(&mut self, at: usize) {
        if self.style == Style::Clean || self.file > 0 {
            return self.fresh_line();
        }
        let target = self.index.line(at as u32) as usize;
        if std::mem::take(&mut self.is_open) && target <= self.line {
            self.newline();
        }
        while self.line < target {
            self.newline();
        }
        if self.line == target {
            self.indent(at);
        }
        if !self.out.is_empty() && !self.out.ends_with([' ', '\n']) {
            self.out.push(' ');
        }
    }

    /// Blanks up to the column of the file's byte. Lines that no person wrote are left alone.
    fn indent(&mut self, at: usize) {
        let text = &self.origin.files[0].text;
        let start = self.starts[self.line - 1];
        if at - start > LONG_LINE || self.out.len() - self.line_start > LONG_LINE {
            return;
        }
        let column = text[start..at].chars().count();
        let written = self.out[self.line_start..].chars().count();
        self.out.extend(std::iter::repeat_n(' ', column.saturating_sub(written)));
    }

    fn newline(&mut self) {
        self.out.push('\n');
        self.line += 1;
        self.line_start = self.out.len();
    }

    fn fresh_line(&mut self) {
        if self.out.len() > self.line_start {
            self.newline();
        }
        self.is_open = false;
    }

    /// Writes what does not stand in the file as it is written; messages about it point at `at`.
    pub fn put(&mut self, text: &str, at: Range<usize>) {
        self.push(text, at);
        self.is_open = false;
    }

    /// Writes on a line of its own what stands for something in the file.
    pub fn put_line(&mut self, text: &str, at: Range<usize>) {
        self.line(at.start);
        self.put(text, at);
        self.end_line();
    }

    /// An empty line where people read it.
    pub fn gap(&mut self) {
        if self.style == Style::Clean && !self.out.is_empty() {
            self.fresh_line();
            self.newline();
        }
    }

    /// Ends a line where people read it.
    pub fn end_line(&mut self) {
        if self.style == Style::Clean {
            self.newline();
        }
    }

    /// The same, a step to the right where people read it.
    pub fn put_indented(&mut self, text: &str, at: Range<usize>) {
        self.line(at.start);
        let step = if self.style == Style::Clean { "    " } else { "" };
        self.put(&format!("{step}{text}"), at);
    }

    /// Writes a type, an initial value if there is one, and `;`.
    pub fn finish_declaration(&mut self, ty: &str, at: Range<usize>, initial: Option<(String, Range<usize>)>) {
        self.put(ty, at.clone());
        let mut last = at;
        if let Some((text, at)) = initial {
            self.put(" := ", at.clone());
            self.put(&text, at.clone());
            last = at;
        }
        self.put(";", last.end..last.end);
    }

    /// Writes text of the file.
    pub fn copy(&mut self, pieces: &[Piece<'_>]) {
        for piece in pieces {
            self.push(&piece.text, piece.at.clone());
        }
        self.is_open = true;
    }

    /// Writes text of the file that begins on a line of its own, without the blank lines around it.
    pub fn copy_lines(&mut self, pieces: &[Piece<'_>]) {
        let Some(pieces) = trimmed(pieces) else { return };
        self.line(pieces[0].at.start);
        self.copy(&pieces);
    }

    fn push(&mut self, text: &str, at: Range<usize>) {
        let begins = self.out.len();
        let is_copy = text.len() == at.len();
        let segment = Segment { at: begins, length: text.len(), file: self.file, from: at.start, to: at.end };
        match self.origin.segments.last_mut() {
            Some(last) if is_copy && last.at + last.length == begins && last.to == at.start && last.file == self.file && copies(last) => {
                last.length += text.len();
                last.to = at.end;
            }
            _ => self.origin.segments.push(segment),
        }
        // A line of the file may end in CR LF or, in old files, in CR alone; ST ends a comment at LF.
        self.out.push_str(text);
        self.line += text.matches('\n').count();
        if let Some(last) = text.rfind('\n') {
            self.line_start = begins + last + 1;
        }
    }

    /// Says that something is wrong; a comment stands in its place.
    pub fn refuse(&mut self, code: Code, at: Range<usize>, message: String, help: &str) {
        match self.findings.len() {
            FINDINGS.. => {}
            count if count == FINDINGS - 1 => self.tell(code, at, format!("{message}; what follows is not listed"), help),
            _ => self.tell(code, at, message, help),
        }
    }

    fn tell(&mut self, code: Code, at: Range<usize>, message: String, help: &str) {
        self.line(at.start);
        let start = self.out.len() as u32;
        self.put(&format!("(* {} *)", comment(&message)), at.clone());
        let span = Span { file: FileId(0), start, end: self.out.len() as u32 };
        self.left(&at, &message, help);
        self.findings.push(Diagnostic::new(code, span, message).help(help));
    }

    /// Says what is left behind.
    pub fn left(&mut self, at: &Range<usize>, what: &str, reason: &str) {
        let reason = match self.left.len() {
            LISTED.. => return,
            count if count == LISTED - 1 => "the list is full: what else is left behind is not told",
            _ => reason,
        };
        let file = &self.origin.files[self.file];
        let (line, column) = match self.file {
            0 => self.index.position(&file.text, at.start as u32),
            _ => LineIndex::new(&file.text).position(&file.text, at.start as u32),
        };
        self.left.push(Left { file: file.name.clone(), line, column, what: what.into(), reason: reason.into() });
    }

    /// The result.
    pub fn finish(mut self, name: &str) -> Written {
        self.left.sort_by_key(|left| (left.line, left.column));
        match self.style {
            Style::Clean => self.close_unit(),
            Style::Places => self.units.push(Unit { name: name.into(), text: self.out }),
        }
        Written { units: self.units, origin: self.origin, findings: self.findings, left: self.left }
    }
}

fn copies(segment: &Segment) -> bool {
    segment.length == segment.to - segment.from
}

/// Text that may stand in a comment.
pub(super) fn comment(text: &str) -> String {
    let text = text.replace("(*", "( *").replace("*)", "* )");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Pieces without the blank lines at their beginning and the blanks at their end; `None` if nothing is left.
fn trimmed<'a>(pieces: &[Piece<'a>]) -> Option<Vec<Piece<'a>>> {
    let first = pieces.iter().position(|piece| !piece.text.trim().is_empty())?;
    let last = pieces.iter().rposition(|piece| !piece.text.trim().is_empty())?;
    let mut kept = pieces[first..=last].to_vec();
    let length = kept[0].text.len();
    let blanks = &kept[0].text[..length - kept[0].text.trim_start().len()];
    let from = blanks.rfind('\n').map_or(0, |at| at + 1);
    cut(&mut kept[0], from..length);
    let end = kept.len() - 1;
    let length = kept[end].text.trim_end().len();
    cut(&mut kept[end], 0..length);
    Some(kept)
}

/// Keeps a part of a piece.
pub(super) fn cut(piece: &mut Piece<'_>, part: Range<usize>) {
    let is_copy = piece.text.len() == piece.at.len();
    let text = piece.text[part.clone()].to_string();
    if is_copy {
        piece.at = piece.at.start + part.start..piece.at.start + part.end;
    }
    piece.text = text.into();
}

#[cfg(test)]
mod tests;
