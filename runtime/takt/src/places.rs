//! Lines and columns of a text, in no time wherever they are: exports may be one line, and a large file may hold many mistakes.

use std::ops::Range;

/// Bytes between two counts of characters.
const BLOCK: usize = 4096;

/// Lines and columns of a text, in no time for lines of any length: exports may be one line.
#[derive(Debug, Clone)]
pub struct Places {
    starts: Vec<usize>,
    /// Characters in front of each block.
    counts: Vec<usize>,
}

impl Places {
    /// Reads a text once.
    pub fn new(text: &str) -> Self {
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

    /// The bytes of the whole lines that a range of bytes touches, without the end of the last, and the number of the first.
    pub fn lines(&self, text: &str, range: &Range<usize>) -> (Range<usize>, u32) {
        let first = self.starts.partition_point(|start| *start <= range.start);
        let last = self.starts.partition_point(|start| *start <= range.end.max(range.start));
        let end = self.starts.get(last).map_or(text.len(), |next| next - 1);
        (self.starts[first - 1]..end, first as u32)
    }

    /// Line, and column in characters, both from 1, of a byte of the `text` that this was made of.
    pub fn position(&self, text: &str, at: usize) -> (u32, u32) {
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
        let text = "a\nbc\r\n\nd";
        let lines = |range: Range<usize>| Places::new(text).lines(text, &range);
        assert_eq!((lines(3..4), lines(0..3), lines(6..6), lines(7..8)), ((2..5, 2), (0..5, 1), (6..6, 3), (7..8, 4)));
    }
}
