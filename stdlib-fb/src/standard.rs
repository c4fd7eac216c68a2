//! Functions and blocks of IEC 61131-3 that have one signature each, in Rust: the clock, strings, values as text, dates, memory, typed counters.
//!
//! The compiler calls some of them for its overloaded functions: `LEN` of a WSTRING is `WLEN`, `INT_TO_STRING` is `LINT_TO_STRING`.

pub mod arguments;
pub mod clock;
pub mod counters;
pub mod date;
pub mod decimal;
pub mod format;
pub mod memory;
pub mod number;
pub mod parse;
pub mod report;
pub mod text;

use takt_abi::{Str, WStr};

/// STRING(255).
pub(crate) type Text = Str<256>;
/// WSTRING(255).
pub(crate) type Wide = WStr<256>;

/// The first 255 units, with the NUL behind them.
fn filled<T: Copy + Default>(units: impl IntoIterator<Item = T>) -> [T; 256] {
    let mut result = [T::default(); 256];
    for (place, unit) in result[..255].iter_mut().zip(units) {
        *place = unit;
    }
    result
}

/// A STRING(255) that is written to; what does not fit is cut.
#[derive(Debug)]
struct Line {
    bytes: [u8; 256],
    length: usize,
}

impl Line {
    fn new() -> Self {
        Self { bytes: [0; 256], length: 0 }
    }
    fn bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
    fn push(&mut self, bytes: &[u8]) {
        let fits = bytes.len().min(255 - self.length);
        self.bytes[self.length..self.length + fits].copy_from_slice(&bytes[..fits]);
        self.length += fits;
    }
}

impl std::fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.push(text.as_bytes());
        Ok(())
    }
}

/// What is written, as STRING(255).
fn written(arguments: std::fmt::Arguments<'_>) -> Text {
    let mut line = Line::new();
    // A line cuts, it does not fail.
    let _ = std::fmt::Write::write_fmt(&mut line, arguments);
    Str(line.bytes)
}
