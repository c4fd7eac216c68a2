//! Where text that was made from another file comes from.
//!
//! The parser reads ST; people edit the file that they exported. A message about the ST is shown at its place in that file.

use crate::places::Places;
use std::ops::Range;
use std::sync::OnceLock;
use takt_syntax::Source;

/// A stretch of the made text and what it stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Segment {
    /// First byte in the made text.
    pub at: usize,
    /// Bytes there.
    pub length: usize,
    /// Index of the file.
    pub file: usize,
    /// First byte in the file.
    pub from: usize,
    /// Behind the last byte in the file.
    pub to: usize,
}

impl Segment {
    /// Byte for byte the same.
    fn is_copy(&self) -> bool {
        self.length == self.to - self.from
    }
}

/// The files that a text was made of.
#[derive(Debug, Clone, Default)]
pub struct Origin {
    /// At least one.
    pub(super) files: Vec<Source>,
    /// Lines of the first file, once they were asked for.
    places: OnceLock<Places>,
    /// In the order of the made text.
    pub(super) segments: Vec<Segment>,
}

impl Origin {
    /// The file and the bytes in it that a range of the made text stands for.
    pub fn place(&self, range: Range<usize>) -> (&Source, Range<usize>) {
        let Some(first) = self.segment(range.start) else {
            return (&self.files[0], 0..0);
        };
        let inside = range.start.saturating_sub(first.at);
        let start = match first.is_copy() {
            true => (first.from + inside).min(first.to),
            false if inside >= first.length => first.to,
            false => first.from,
        };
        let last = self.segment(range.end.saturating_sub(1).max(range.start)).unwrap_or(first);
        let end = match last.is_copy() {
            true => (last.from + range.end.saturating_sub(last.at)).min(last.to),
            false => last.to,
        };
        let is_forward = last.file == first.file && end >= start && range.end > range.start;
        (&self.files[first.file], start..if is_forward { end } else { start })
    }

    /// For files of this text.
    pub(super) fn new(file: Source) -> Self {
        Self { files: vec![file], segments: Vec::new(), places: OnceLock::new() }
    }

    /// Lines of a file that [`Origin::place`] returned, if it is the first one: the others are small.
    pub fn places(&self, file: &Source) -> Option<&Places> {
        std::ptr::eq(file, self.files.first()?).then(|| self.places.get_or_init(|| Places::new(&file.text)))
    }

    /// Ready to answer for lines and columns of the made text.
    pub fn lines<'a>(&'a self, made: &'a str) -> Lines<'a> {
        let starts = std::iter::once(0).chain(made.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Lines { origin: self, made, starts, files: self.files.iter().map(|file| Places::new(&file.text)).collect() }
    }

    /// The last segment that begins at or before a byte; the first one for what stands before all.
    fn segment(&self, at: usize) -> Option<&Segment> {
        let behind = self.segments.partition_point(|segment| segment.at <= at);
        self.segments.get(behind.saturating_sub(1))
    }
}

/// Lines and columns of a made text.
#[derive(Debug)]
pub struct Lines<'a> {
    origin: &'a Origin,
    made: &'a str,
    starts: Vec<usize>,
    files: Vec<Places>,
}

impl Lines<'_> {
    /// File, line and column of a line and a column in the made text; all in characters, from 1.
    pub fn place(&self, line: u32, column: u32) -> Option<(&str, u32, u32)> {
        let start = *self.starts.get((line as usize).checked_sub(1)?)?;
        let inside = self.made[start..].char_indices().nth(column.saturating_sub(1) as usize).map_or(self.made.len() - start, |(at, _)| at);
        let segment = self.origin.segment(start + inside)?;
        let (file, range) = self.origin.place(start + inside..start + inside);
        let (line, column) = self.files[segment.file].position(&file.text, range.start);
        Some((&file.name, line, column))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_before_the_first_segment_is_shown_at_its_beginning() {
        let mut origin = Origin::new(Source { name: "A.TcPOU".into(), text: "<ST>x</ST>".into() });
        origin.segments.push(Segment { at: 7, length: 1, file: 0, from: 4, to: 5 });
        assert_eq!(origin.place(0..0).1, 4..4);
        assert_eq!(origin.place(7..8).1, 4..5);
    }
}
