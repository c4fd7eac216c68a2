//! One line of G-code as words.
//!
//! [`Words::read`] finds words, comments and skipped blocks and refuses everything else. It knows letters and numbers, not what they command.
//! Comments may hold any bytes (UTF-8, GBK, Latin-1): no byte of a multi-byte character in them looks like their end.

use super::number;
use super::trouble::{Kind, Name, Trouble};

/// The letters of the dialect besides G.
const LETTERS: &[u8] = b"NXYZABCPQUVWIJKRFETM";
/// Word FF.
pub const FF: u8 = 26;
/// Word E with a negative number: deceleration.
pub const E_DOWN: u8 = 27;
/// Word EF.
pub const EF: u8 = 28;
/// Word EF with a negative number.
pub const EF_DOWN: u8 = 29;
const SLOTS: usize = 30;

/// A G code of a block.
#[derive(Debug, Clone, Copy, Default)]
pub struct GCode {
    /// Ten times its number: 12 is G1.2.
    pub tenths: u32,
    /// Column, from 1.
    pub column: u32,
}

/// The words of a block.
#[derive(Debug, Clone)]
pub struct Words {
    present: u32,
    values: [f64; SLOTS],
    columns: [u32; SLOTS],
    g: [GCode; 8],
    g_count: usize,
}

/// How a file writes comments, and whether one is open.
#[derive(Debug, Clone, Copy)]
pub struct Comments {
    /// `( )` is a comment.
    pub parentheses: bool,
    /// A `(* *)` of an earlier line is still open.
    pub open: bool,
}

/// The slot of a letter.
pub const fn slot(letter: u8) -> u8 {
    letter - b'A'
}

/// The name of the word in a slot.
pub fn name(slot: u8) -> Name {
    match slot {
        FF => Name(*b"FF"),
        EF | EF_DOWN => Name(*b"EF"),
        E_DOWN => Name([b'E', 0]),
        letter => Name([letter.wrapping_add(b'A'), 0]),
    }
}

impl Default for Words {
    fn default() -> Self {
        Self { present: 0, values: [0.0; SLOTS], columns: [0; SLOTS], g: [GCode::default(); 8], g_count: 0 }
    }
}

impl Words {
    /// Reads a line (without its end). Errors have the column, the line number is the caller's.
    pub fn read(&mut self, line: &[u8], comments: &mut Comments) -> Result<(), Trouble> {
        (self.present, self.g_count) = (0, 0);
        let mut i = 0;
        if comments.open {
            i = match find(line, 0, b"*)") {
                Some(end) => end + 2,
                None => return Ok(()),
            };
            comments.open = false;
        }
        let mut first = true;
        while let Some(&byte) = line.get(i) {
            match byte {
                b' ' | b'\t' | b'\r' | 0x1A => i += 1,
                b';' => break,
                b'/' if line.get(i + 1) == Some(&b'/') => break,
                b'/' | b'%' if first => break,
                b'(' => i = comment(line, i, comments)?,
                b'a'..=b'z' | b'A'..=b'Z' => {
                    i = self.word(line, i)?;
                    first = false;
                }
                _ => return Err(unexpected(byte).at(0, column(i))),
            }
        }
        Ok(())
    }

    fn word(&mut self, line: &[u8], at: usize) -> Result<usize, Trouble> {
        let letter = line[at].to_ascii_uppercase();
        let fail = |kind: Kind| kind.at(0, column(at));
        let rapid = matches!(letter, b'F' | b'E') && line.get(at + 1).is_some_and(|b| b.eq_ignore_ascii_case(&b'F'));
        if letter != b'G' && !LETTERS.contains(&letter) {
            return Err(fail(Kind::UnknownWord(letter)));
        }
        let mut start = at + 1 + usize::from(rapid);
        while matches!(line.get(start), Some(b' ' | b'\t')) {
            start += 1;
        }
        let (value, end) = number::read(line, start).map_err(|kind| match kind {
            Kind::NumberMissing => match line.get(start) {
                Some(&b @ (b'$' | b'#' | b'{' | b'[')) => Kind::Expression(b).at(0, column(start)),
                _ => fail(Kind::WordWithoutNumber(letter)),
            },
            other => other.at(0, column(start)),
        })?;
        if letter == b'G' {
            self.push_g(value, column(at))?;
            return Ok(end);
        }
        let down = value < 0.0 || line.get(start) == Some(&b'-');
        let slot = match (letter, rapid, down) {
            (b'F', true, _) => FF,
            (b'E', true, false) => EF,
            (b'E', true, true) => EF_DOWN,
            (b'E', false, true) => E_DOWN,
            _ => slot(letter),
        };
        if self.present & (1 << slot) != 0 {
            return Err(fail(Kind::WordTwice(name(slot))));
        }
        self.present |= 1 << slot;
        self.values[slot as usize] = value;
        self.columns[slot as usize] = column(at);
        Ok(end)
    }

    fn push_g(&mut self, value: f64, column: u32) -> Result<(), Trouble> {
        let tenths = value * 10.0;
        if !(0.0..1e5).contains(&tenths) || (tenths - tenths.round()).abs() > 1e-6 {
            return Err(Kind::NotWhole(b'G').at(0, column));
        }
        let place = self.g.get_mut(self.g_count).ok_or(Kind::TooManyG.at(0, column))?;
        *place = GCode { tenths: tenths.round() as u32, column };
        self.g_count += 1;
        Ok(())
    }

    /// The G codes in their order.
    pub fn g(&self) -> &[GCode] {
        &self.g[..self.g_count]
    }
    /// Whether the block has no word at all.
    pub fn is_empty(&self) -> bool {
        self.present == 0 && self.g_count == 0
    }
    /// The value of a word.
    #[inline]
    pub fn get(&self, slot: u8) -> Option<f64> {
        (self.present & (1 << slot) != 0).then(|| self.values[slot as usize])
    }
    /// The column of a word that is there.
    pub fn column(&self, slot: u8) -> u32 {
        self.columns[slot as usize]
    }
    /// A bit per slot of the words that are there.
    pub fn mask(&self) -> u32 {
        self.present
    }
    /// A word that must be whole and lie in 0..=`most`.
    pub fn whole(&self, slot: u8, most: f64) -> Result<Option<f64>, Trouble> {
        match self.get(slot) {
            Some(v) if !(0.0..=most).contains(&v) || v.fract() != 0.0 => Err(Kind::NotWhole(slot + b'A').at(0, self.column(slot))),
            other => Ok(other),
        }
    }
}

fn column(i: usize) -> u32 {
    i as u32 + 1
}

fn unexpected(byte: u8) -> Kind {
    match byte {
        0 => Kind::NotText,
        b'$' | b'#' | b'{' | b'}' | b'=' | b'[' | b']' => Kind::Expression(byte),
        _ => Kind::Unexpected(byte),
    }
}

fn find(line: &[u8], from: usize, what: &[u8]) -> Option<usize> {
    line.get(from..)?.windows(what.len()).position(|w| w == what).map(|i| i + from)
}

/// The index behind the comment that starts at `at`.
fn comment(line: &[u8], at: usize, comments: &mut Comments) -> Result<usize, Trouble> {
    let starred = line.get(at + 1) == Some(&b'*');
    if starred && let Some(end) = find(line, at + 2, b"*)") {
        return Ok(end + 2);
    }
    if comments.parentheses
        && let Some(end) = find(line, at, b")")
    {
        return Ok(end + 1);
    }
    if starred {
        comments.open = true;
        return Ok(line.len());
    }
    Err(if comments.parentheses { Kind::CommentOpen } else { Kind::Expression(b'(') }.at(0, column(at)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &[u8]) -> Result<Words, Trouble> {
        let mut words = Words::default();
        words.read(line, &mut Comments { parentheses: true, open: false })?;
        Ok(words)
    }

    fn check(line: &str, expected: &[(u8, f64)]) {
        let words = read(line.as_bytes()).unwrap_or_else(|e| panic!("{line}: {e:?}"));
        for (slot, value) in expected {
            assert_eq!(words.get(*slot), Some(*value), "{line}");
        }
        assert_eq!(words.mask().count_ones() as usize, expected.len(), "{line}");
    }

    #[test]
    fn a_block_is_words_in_any_case_with_any_spaces() {
        check("N10 G01 X1.5 Y-2 Z 3", &[(slot(b'N'), 10.0), (slot(b'X'), 1.5), (slot(b'Y'), -2.0), (slot(b'Z'), 3.0)]);
        check("n10g1x1.5f20", &[(slot(b'N'), 10.0), (slot(b'X'), 1.5), (slot(b'F'), 20.0)]);
        check(
            "G0 X1 FF1000 EF10000 EF-20000 E100 E-200\r",
            &[(slot(b'X'), 1.0), (FF, 1000.0), (EF, 10000.0), (EF_DOWN, -20000.0), (slot(b'E'), 100.0), (E_DOWN, -200.0)],
        );
        let words = read(b"G90 G01 G68.2").expect("three G codes");
        assert_eq!(words.g().iter().map(|g| (g.tenths, g.column)).collect::<Vec<_>>(), [(900, 1), (10, 5), (682, 9)]);
    }

    #[test]
    fn comments_of_all_kinds_are_passed_over() {
        check("(head) X1 (mid ; // %) Y2 ; tail X9", &[(slot(b'X'), 1.0), (slot(b'Y'), 2.0)]);
        check("X1 // Y2", &[(slot(b'X'), 1.0)]);
        check("X1 (* a ) b *) Y2", &[(slot(b'X'), 1.0), (slot(b'Y'), 2.0)]);
        check("% name X1", &[]);
        check("/N10 X1", &[]);
        let gbk = read(b"X1 (\xB5\xE3\xBD\xBA \x81\x5C\x81\x7B) Y2").expect("GBK");
        assert_eq!(gbk.get(slot(b'Y')), Some(2.0));
        let mut comments = Comments { parentheses: true, open: false };
        let mut words = Words::default();
        words.read(b"X1 (* opens", &mut comments).expect("opens");
        assert!(comments.open && words.get(slot(b'X')).is_some());
        words.read(b"Y2", &mut comments).expect("inside");
        assert!(comments.open && words.is_empty());
        words.read(b"closes *) Z3", &mut comments).expect("closes");
        assert!(!comments.open && words.get(slot(b'Z')) == Some(3.0));
    }

    #[test]
    fn mistakes_have_a_kind_and_a_column() {
        for (line, kind, column) in [
            ("X1 H5", Kind::UnknownWord(b'H'), 4),
            ("X Y1", Kind::WordWithoutNumber(b'X'), 1),
            ("G1 X1 Y", Kind::WordWithoutNumber(b'Y'), 7),
            ("X1 XNaN", Kind::NumberInvalid, 5),
            ("X1e308", Kind::OutOfRange, 2),
            ("X1 Y2 X3", Kind::WordTwice(Name(*b"X\0")), 7),
            ("G1 (open", Kind::CommentOpen, 4),
            ("X$a$", Kind::Expression(b'$'), 2),
            ("X1 *", Kind::Unexpected(b'*'), 4),
            ("G-1", Kind::NotWhole(b'G'), 1),
            ("G1.25", Kind::NotWhole(b'G'), 1),
            ("X1 \0", Kind::NotText, 4),
            ("\u{e4}", Kind::Unexpected(0xC3), 1),
        ] {
            let error = read(line.as_bytes()).map(|_| ()).expect_err(line);
            assert_eq!((error.kind, error.column), (kind, column), "{line}");
        }
    }
}
