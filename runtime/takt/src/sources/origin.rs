//! Where text that was made from another file comes from.
//!
//! The parser reads ST; people edit the file that they exported. A message about the ST is shown at its place in that file.

use std::ops::Range;
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
    /// In the order of the made text.
    pub(super) segments: Vec<Segment>,
}

impl Origin {
    /// The file and the bytes in it that a range of the made text stands for.
    pub fn place(&self, range: Range<usize>) -> (&Source, Range<usize>) {
        let Some(first) = self.segment(range.start) else {
            return (&self.files[0], 0..0);
        };
        let inside = range.start - first.at;
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

/// Bytes between two counts of characters.
const BLOCK: usize = 4096;

/// Lines and columns of a text, in no time for lines of any length: exports may be one line.
#[derive(Debug)]
struct Places {
    starts: Vec<usize>,
    /// Characters in front of each block.
    counts: Vec<usize>,
}

impl Places {
    fn new(text: &str) -> Self {
        let mut counts = vec![0];
        for block in text.as_bytes().chunks(BLOCK) {
            counts.push(counts[counts.len() - 1] + characters(block));
        }
        Self { starts: std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect(), counts }
    }

    /// Characters in front of a byte.
    fn characters(&self, text: &str, at: usize) -> usize {
        let at = at.min(text.len());
        self.counts[at / BLOCK] + characters(&text.as_bytes()[at - at % BLOCK..at])
    }

    /// Line, and column in characters, from 1.
    fn position(&self, text: &str, at: usize) -> (u32, u32) {
        let line = self.starts.partition_point(|start| *start <= at);
        let column = self.characters(text, at) - self.characters(text, self.starts[line - 1]) + 1;
        (line as u32, column as u32)
    }
}

/// Bytes that begin a character.
fn characters(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| (**byte as i8) >= -0x40).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_agree_with_the_index_of_lines() {
        let text: String = (0..3000).map(|i| if i % 700 == 699 { "点\n" } else { "点a ä" }).collect();
        let (places, index) = (Places::new(&text), takt_syntax::LineIndex::new(&text));
        for (at, _) in text.char_indices().step_by(7) {
            assert_eq!(places.position(&text, at), index.position(&text, at as u32), "{at}");
        }
        assert_eq!(places.position(&text, text.len()), index.position(&text, text.len() as u32));
        assert_eq!(Places::new("").position("", 0), (1, 1));
    }
}
