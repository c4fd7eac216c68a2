//! A trace: recorded variables once per scan of the fastest task, as CSV.
//!
//! The first line names the columns: `time_s`, then the variables as they were asked for. Values are ST literals without quotes around numbers;
//! a text with a comma, quote or line end is quoted as RFC 4180 says. The numbers are the shortest that read back to the same bits.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use takt_abi::Time;

/// A file being written.
#[derive(Debug)]
pub struct Trace<W: Write = BufWriter<File>> {
    out: W,
}

/// Creates the file and writes its header.
pub fn create(path: &Path, variables: &[String]) -> io::Result<Trace> {
    Trace::new(BufWriter::new(File::create(path)?), variables)
}

impl<W: Write> Trace<W> {
    /// Writes the header.
    pub fn new(mut out: W, variables: &[String]) -> io::Result<Self> {
        write!(out, "time_s")?;
        for variable in variables {
            write!(out, ",{}", quoted(variable))?;
        }
        writeln!(out)?;
        Ok(Self { out })
    }
    /// Writes one line.
    pub fn row(&mut self, now: Time, values: impl IntoIterator<Item = String>) -> io::Result<()> {
        write!(self.out, "{}", seconds(now))?;
        for value in values {
            write!(self.out, ",{}", quoted(&value))?;
        }
        writeln!(self.out)
    }
    /// Writes what is left.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Seconds, exact to the nanosecond, without an exponent: `0.001`, `12`.
pub fn seconds(time: Time) -> String {
    let (sign, ns) = (if time.0 < 0 { "-" } else { "" }, time.0.unsigned_abs());
    let text = format!("{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000);
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

fn quoted(value: &str) -> std::borrow::Cow<'_, str> {
    if value.contains([',', '"', '\n', '\r']) { format!("\"{}\"", value.replace('"', "\"\"")).into() } else { value.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trace_is_a_table() {
        let mut out = Vec::new();
        let mut trace = Trace::new(&mut out, &["a".into(), "b[1,2]".into()]).unwrap();
        trace.row(Time::from_millis(1), ["1.5".to_string(), "'x,\"y\"'".to_string()]).unwrap();
        trace.row(Time(12_000_000_000), ["TRUE".to_string(), "''".to_string()]).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "time_s,a,\"b[1,2]\"\n0.001,1.5,\"'x,\"\"y\"\"'\"\n12,TRUE,''\n");
    }
}
