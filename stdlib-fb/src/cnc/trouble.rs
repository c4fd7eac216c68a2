//! What can be wrong with a G-code file, and how people are told.
//!
//! A [`Trouble`] is small and `Copy`; its text is made only when it is shown, into a STRING of fixed size.

use std::fmt::Write;
use takt_abi::{HostError, SmcError, Str};

/// An error in a file, with its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trouble {
    /// Line, from 1; 0: the file as a whole.
    pub line: u32,
    /// Column in bytes, from 1; 0: the line as a whole.
    pub column: u32,
    /// What is wrong.
    pub kind: Kind,
}

/// What is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// No name was given.
    NoName,
    /// No such file.
    NotFound,
    /// The path leaves the folder.
    Outside,
    /// A folder, or no right to read it, or an error of the system.
    NotReadable(i32),
    /// There is nothing in it.
    Empty,
    /// NUL bytes.
    NotText,
    /// A line of more bytes than [`super::source::LINE_MAX`].
    LineTooLong,
    /// The file changed while it was read.
    Changed,
    /// A letter that this dialect does not know, or not yet.
    UnknownWord(u8),
    /// A letter without a number.
    NumberMissing,
    /// A letter (its name) without a number.
    WordWithoutNumber(u8),
    /// Not a number: NaN, two points, two signs.
    NumberInvalid,
    /// A number with an exponent: or is it the E word?
    Exponent,
    /// Beyond 1e9.
    OutOfRange,
    /// A number that must be whole and not negative, of this word.
    NotWhole(u8),
    /// A G code that this dialect does not know, or not yet; in tenths.
    UnknownG(u32),
    /// The same word twice.
    WordTwice(Name),
    /// Two commands that cannot share a block; in tenths.
    TwoCommands(u32, u32),
    /// The ends of an arc have different distances from its centre: mm.
    ArcOpen(f64, f64),
    /// R is shorter than half the way: R and the least, mm.
    ArcRadius(f64, f64),
    /// R cannot say where a full circle lies.
    ArcFullByRadius,
    /// The centre is the start.
    ArcNoRadius,
    /// Unequal scales make an ellipse of it.
    ArcScaled,
    /// Both R and a centre.
    ArcOverdetermined,
    /// A travel command needs a feed.
    FeedZero,
    /// A rapid needs a velocity.
    RapidZero,
    /// A command (tenths) lacks a word.
    WordMissing(u32, Needs),
    /// Axis words, and no travel command before.
    NoTravel,
    /// A word that the block's command does not use.
    NotAllowed(Name),
    /// A word that must be greater than zero.
    NotPositive(Name),
    /// A scale of zero.
    ScaleZero,
    /// A comment that does not end.
    CommentOpen,
    /// A character that starts no word.
    Unexpected(u8),
    /// Variables and expressions.
    Expression(u8),
    /// More G codes in a block than are kept.
    TooManyG,
    /// The queue's buffer holds fewer than five elements.
    QueueTooSmall,
    /// The input `sentences` names no reader.
    NoReader,
    /// A start tool length, which nothing uses yet.
    ToolLength,
    /// Known only by its number (after a restored checkpoint).
    Known(SmcError),
}

/// What a command lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    /// An axis word.
    Axis,
    /// I, J, K or R.
    Centre,
    /// T.
    Time,
}

/// The name of a word: one letter, or FF and EF.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Name(pub [u8; 2]);

impl std::fmt::Display for Name {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().filter(|b| **b != 0).try_for_each(|b| f.write_char(*b as char))
    }
}

impl From<HostError> for Kind {
    fn from(error: HostError) -> Self {
        match error {
            HostError::NotFound => Self::NotFound,
            HostError::Outside => Self::Outside,
            HostError::Os(code) => Self::NotReadable(code),
            HostError::NotReadable | HostError::NotWritable | HostError::Exists | HostError::Busy | HostError::Absent => {
                Self::NotReadable(0)
            }
        }
    }
}

impl Kind {
    /// The error at a place.
    pub fn at(self, line: u32, column: u32) -> Trouble {
        Trouble { line, column, kind: self }
    }
    /// Its number.
    pub fn error(self) -> SmcError {
        match self {
            Self::NoName => SmcError::SMC_FILE_NO_NAME,
            Self::NotFound => SmcError::SMC_FILE_DOESNT_EXIST,
            Self::Outside => SmcError::SMC_FILE_OUTSIDE_FOLDER,
            Self::NotReadable(_) => SmcError::SMC_FILE_NOT_READABLE,
            Self::Empty => SmcError::SMC_FILE_EMPTY,
            Self::NotText => SmcError::SMC_FILE_NOT_TEXT,
            Self::LineTooLong => SmcError::SMC_FILE_LINE_TOO_LONG,
            Self::Changed => SmcError::SMC_FILE_CHANGED,
            Self::UnknownWord(_) => SmcError::SMC_NC_UNKNOWN_WORD,
            Self::NumberMissing | Self::WordWithoutNumber(_) => SmcError::SMC_NC_WORD_WITHOUT_NUMBER,
            Self::NumberInvalid | Self::Exponent | Self::NotWhole(_) => SmcError::SMC_NC_NUMBER_INVALID,
            Self::OutOfRange | Self::NotPositive(_) | Self::ScaleZero => SmcError::SMC_NC_NUMBER_OUT_OF_RANGE,
            Self::UnknownG(_) => SmcError::SMC_NC_UNKNOWN_G_CODE,
            Self::WordTwice(_) => SmcError::SMC_NC_WORD_TWICE,
            Self::TwoCommands(..) | Self::TooManyG => SmcError::SMC_NC_TWO_TRAVEL_COMMANDS,
            Self::ArcOpen(..)
            | Self::ArcRadius(..)
            | Self::ArcFullByRadius
            | Self::ArcNoRadius
            | Self::ArcScaled
            | Self::ArcOverdetermined => SmcError::SMC_NC_ARC_INVALID,
            Self::FeedZero | Self::RapidZero => SmcError::SMC_NC_FEED_ZERO,
            Self::WordMissing(..) | Self::NoTravel => SmcError::SMC_NC_WORD_MISSING,
            Self::NotAllowed(_) | Self::ToolLength => SmcError::SMC_NC_WORD_NOT_ALLOWED,
            Self::CommentOpen => SmcError::SMC_NC_COMMENT_OPEN,
            Self::Unexpected(_) | Self::Expression(_) => SmcError::SMC_NC_UNEXPECTED_CHARACTER,
            Self::QueueTooSmall => SmcError::SMC_DEC_BUFFER_TOO_SMALL,
            Self::NoReader => SmcError::SMC_DEC_QUEUE_INVALID,
            Self::Known(error) => error,
        }
    }
}

/// A G code in tenths as people write it: `G1`, `G68.2`.
struct Code(u32);

impl std::fmt::Display for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 % 10 {
            0 => write!(f, "G{}", self.0 / 10),
            sub => write!(f, "G{}.{sub}", self.0 / 10),
        }
    }
}

/// A byte as people can read it.
struct Shown(u8);

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.is_ascii_graphic() { write!(f, "`{}`", self.0 as char) } else { write!(f, "byte 16#{:02X}", self.0) }
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::NoName => write!(f, "no file name: set `sFileName` to a file of the folder `nc`"),
            Self::NotFound => write!(f, "no such file in the project's folder `nc`: check the name, upper and lower case too"),
            Self::Outside => write!(f, "the path leaves the project's folder `nc`: copy the file into it and give its plain name"),
            Self::NotReadable(0) => write!(f, "cannot be read: it must be a plain file that this user may read"),
            Self::NotReadable(code) => write!(f, "cannot be read (system error {code}): it must be a plain file that this user may read"),
            Self::Empty => write!(f, "the file is empty: expected G-code"),
            Self::NotText => write!(f, "not a text file (it has NUL bytes): expected G-code as UTF-8, GBK or Latin-1 text"),
            Self::LineTooLong => write!(f, "the line has more than {} bytes: is this a G-code file?", super::source::LINE_MAX),
            Self::Changed => write!(f, "the file changed while it was read: load it again"),
            Self::UnknownWord(w) => write!(
                f,
                "unknown word `{}`: expected N G X Y Z A B C P Q U V W I J K R F FF E EF T or M; take it out or set the right dialect",
                w as char
            ),
            Self::NumberMissing => write!(f, "a word without a number"),
            Self::WordWithoutNumber(w) => write!(f, "word `{0}` without a number: expected for example `{0}12.5`", w as char),
            Self::NumberInvalid => write!(f, "not a number: expected for example `12.5` or `-3`"),
            Self::Exponent => write!(f, "a number with an exponent: write it out, or put a space before the word `E`"),
            Self::OutOfRange => write!(f, "the number is out of range: expected at most 1000000000"),
            Self::NotWhole(w) => write!(f, "word `{}` needs a whole number that is not negative", w as char),
            Self::UnknownG(g) => write!(
                f,
                "unknown G code `{}`: expected G0-G4, G17-G19, G53-G56, G90-G92, G98 or G99; take it out or set the right dialect",
                Code(g)
            ),
            Self::WordTwice(name) => write!(f, "word `{name}` twice in one block: put the second into a block of its own"),
            Self::TwoCommands(a, b) => write!(f, "`{}` and `{}` in one block: put the second into a block of its own", Code(a), Code(b)),
            Self::TooManyG => write!(f, "too many G codes in one block: expected at most 8"),
            Self::ArcOpen(a, b) => {
                write!(f, "the arc does not close: its ends are {a:.4} mm and {b:.4} mm from the centre; check I, J, K and G98 or G99")
            }
            Self::ArcRadius(r, least) => {
                write!(f, "the arc does not close: `R` is {r:.4} mm, expected at least {least:.4} mm (half the way)")
            }
            Self::ArcFullByRadius => write!(f, "an arc with `R` that ends where it starts: give the centre of a full circle with I, J, K"),
            Self::ArcNoRadius => write!(f, "an arc whose centre is its start: check I, J, K and G98 or G99"),
            Self::ArcScaled => write!(f, "an arc in a plane with unequal scales is an ellipse: use equal scales"),
            Self::ArcOverdetermined => write!(f, "an arc with both `R` and a centre: give one of them"),
            Self::FeedZero => write!(f, "a move with a feed of zero: expected `F` greater than 0 here or before"),
            Self::RapidZero => write!(f, "a rapid with a velocity of zero: expected `FF` or `F` here or before, or `fDefaultVelFF`"),
            Self::WordMissing(g, Needs::Axis) => write!(f, "`{}` without an axis word: expected X Y Z A B C P Q U V or W", Code(g)),
            Self::WordMissing(g, Needs::Centre) => write!(f, "`{}` without its centre: expected I, J, K or R", Code(g)),
            Self::WordMissing(g, Needs::Time) => write!(f, "`{}` without its time: expected `T` with seconds", Code(g)),
            Self::NoTravel => write!(f, "axis words without a travel command: expected G0, G1, G2 or G3 here or before"),
            Self::NotAllowed(name) => write!(f, "word `{name}` has no meaning in this block: take it out"),
            Self::NotPositive(name) => write!(f, "word `{name}` must not be negative"),
            Self::ScaleZero => write!(f, "a scale of zero: expected I, J, K other than 0"),
            Self::CommentOpen => write!(f, "the comment does not end: expected `)` or `*)`"),
            Self::Unexpected(b) => write!(f, "unexpected {}: expected a word, a comment or the end of the line", Shown(b)),
            Self::Expression(b) => write!(f, "unexpected {}: variables and expressions are not read yet", Shown(b)),
            Self::QueueTooSmall => write!(f, "the out queue is too small: `nSizeOutQueue` must hold at least 5 SMC_GEOINFO"),
            Self::NoReader => write!(f, "`sentences` names no reader: pass the output `sentences` of a ReadNCFile"),
            Self::ToolLength => write!(f, "`vStartToolLength` must be 0: tool lengths are not read yet"),
            Self::Known(error) => write!(f, "error {}", error.0),
        }
    }
}

impl Trouble {
    /// `file:line:column: message`, cut at 255 bytes.
    pub fn text(&self, file: &Str<256>) -> Str<256> {
        let mut out = Fixed::default();
        let _ = write!(out, "{}", file.to_text());
        if self.line != 0 {
            let _ = write!(out, ":{}", self.line);
        }
        if self.column != 0 {
            let _ = write!(out, ":{}", self.column);
        }
        let _ = write!(out, ": {}", self.kind);
        Str(out.bytes)
    }
}

/// A STRING(255) to write into; what does not fit is dropped at a character's start.
struct Fixed {
    bytes: [u8; 256],
    len: usize,
}

impl Default for Fixed {
    fn default() -> Self {
        Self { bytes: [0; 256], len: 0 }
    }
}

impl Write for Fixed {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let mut n = text.len().min(255 - self.len);
        while !text.is_char_boundary(n) {
            n -= 1;
        }
        self.bytes[self.len..self.len + n].copy_from_slice(&text.as_bytes()[..n]);
        self.len += n;
        if n == text.len() { Ok(()) } else { Err(std::fmt::Error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_names_file_line_and_column() {
        let text = Kind::UnknownWord(b'H').at(12, 5).text(&Str::new("phone.cnc"));
        assert!(text.to_text().starts_with("phone.cnc:12:5: unknown word `H`: expected N G X"), "{text:?}");
        assert_eq!(Kind::UnknownG(682).at(1, 1).text(&Str::new("a")).to_text().split(':').nth(3), Some(" unknown G code `G68.2`"));
        let whole = Kind::NotFound.at(0, 0).text(&Str::new("x.cnc"));
        assert!(whole.to_text().starts_with("x.cnc: no such file"), "{whole:?}");
    }

    #[test]
    fn a_long_message_is_cut_at_a_character() {
        let text = Kind::NotFound.at(0, 0).text(&Str::new(&"件".repeat(84)));
        assert!(text.as_str().is_some() && text.bytes().len() <= 255);
    }
}
