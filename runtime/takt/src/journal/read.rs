//! Reads a journal: the last lines, and what comes after them while it is written and while files change their names.

use super::file::{KEPT, generation};
use super::{Entry, Event};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes of a line; what is longer was not written by a journal.
const LONGEST: usize = 64 << 10;
/// Bytes that are read at once.
const BLOCK: usize = 64 << 10;

/// A line as it was read: an entry, or why it is none.
pub type Line = Result<Entry, String>;

/// Reads lines as they come.
#[derive(Debug)]
pub struct Follower {
    folder: PathBuf,
    file: Option<File>,
    partial: Vec<u8>,
    /// Rest of a line that is too long.
    skipping: bool,
}

/// The last `count` lines of a journal (all of them if `None`), the oldest first, and what reads on behind them.
pub fn last(folder: &Path, count: Option<usize>) -> io::Result<(Vec<Line>, Follower)> {
    let mut follower = Follower { folder: folder.into(), file: None, partial: Vec::new(), skipping: false };
    let mut lines = Vec::new();
    // The present file is opened first: when it is renamed meanwhile, it is still the same file.
    let mut files = Vec::new();
    for number in 0..=KEPT {
        match File::open(generation(folder, number)) {
            Ok(file) => files.push(file),
            Err(error) if error.kind() == io::ErrorKind::NotFound && number > 0 => break,
            Err(error) => return Err(error),
        }
    }
    let present = files[0].try_clone()?;
    for (age, mut file) in files.into_iter().enumerate() {
        let mut older = Vec::new();
        let mut reader = Follower { folder: PathBuf::new(), file: None, partial: Vec::new(), skipping: false };
        reader.drain(&mut file, &mut older)?;
        if age == 0 {
            (follower.partial, follower.skipping) = (reader.partial, reader.skipping);
        }
        older.append(&mut lines);
        lines = older;
        if count.is_some_and(|count| lines.len() >= count) {
            break;
        }
    }
    let skip = count.map_or(0, |count| lines.len().saturating_sub(count));
    lines.drain(..skip);
    follower.file = Some(present);
    Ok((lines, follower))
}

impl Follower {
    /// What was written since the last time.
    pub fn more(&mut self) -> io::Result<Vec<Line>> {
        let mut lines = Vec::new();
        if let Some(mut file) = self.file.take() {
            self.drain(&mut file, &mut lines)?;
            if self.is_present(&file) {
                self.file = Some(file);
                return Ok(lines);
            }
            // Nothing is written to an old file any more; what came between is read before it is left.
            self.drain(&mut file, &mut lines)?;
            self.partial.clear();
            self.skipping = false;
        }
        match File::open(generation(&self.folder, 0)) {
            Ok(mut file) => {
                self.drain(&mut file, &mut lines)?;
                self.file = Some(file);
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
        Ok(lines)
    }

    /// Whether the file still has the journal's name, and has not been cut.
    fn is_present(&self, file: &File) -> bool {
        let present = std::fs::metadata(generation(&self.folder, 0));
        let (Ok(present), Ok(own)) = (present, file.metadata()) else { return false };
        let mut handle = file;
        let position = handle.stream_position().unwrap_or(0);
        same_file(&present, &own) && own.len() >= position
    }

    fn drain(&mut self, file: &mut File, lines: &mut Vec<Line>) -> io::Result<()> {
        let mut block = vec![0; BLOCK];
        loop {
            let read = file.read(&mut block)?;
            if read == 0 {
                return Ok(());
            }
            for piece in block[..read].split_inclusive(|byte| *byte == b'\n') {
                self.piece(piece, lines);
            }
        }
    }

    fn piece(&mut self, piece: &[u8], lines: &mut Vec<Line>) {
        let ended = piece.last() == Some(&b'\n');
        if !self.skipping {
            self.partial.extend_from_slice(piece);
            if self.partial.len() > LONGEST {
                self.skipping = true;
                self.partial.clear();
                lines.push(Err(format!("a line is longer than {LONGEST} bytes")));
            } else if ended {
                let line = std::mem::take(&mut self.partial);
                if !line.trim_ascii().is_empty() {
                    lines.push(entry(line.trim_ascii()));
                }
            }
        }
        if ended {
            self.skipping = false;
        }
    }

    /// Goes to the end without showing anything.
    pub fn skip_to_end(&mut self) -> io::Result<()> {
        self.file.as_mut().map_or(Ok(0), |file| file.seek(SeekFrom::End(0))).map(|_| ())
    }
}

fn entry(line: &[u8]) -> Line {
    serde_json::from_slice(line).map_err(|error| format!("a line is no entry of a journal: {error}"))
}

#[cfg(unix)]
fn same_file(a: &std::fs::Metadata, b: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Other systems do not rename open files.
#[cfg(not(unix))]
fn same_file(_: &std::fs::Metadata, _: &std::fs::Metadata) -> bool {
    true
}

/// An entry for people: local in nothing, so that logs of two machines can be laid side by side.
pub fn for_people(entry: &Entry) -> String {
    use super::entry::clean;
    let time = entry.time.replace('T', " ");
    let mut text = format!("{}  {:<8}", clean(time.trim_end_matches('Z')), entry.event.name());
    let mut add = |part: String| {
        text.push(' ');
        text.push_str(&part);
    };
    if let Some(variable) = &entry.variable {
        add(clean(variable));
    }
    match (&entry.old, &entry.new) {
        (Some(old), Some(new)) => add(format!("{} → {}", clean(old), clean(new))),
        (None, Some(new)) => add(format!("→ {}", clean(new))),
        (Some(old), None) => add(format!("was {}", clean(old))),
        (None, None) => {}
    }
    if let Some(message) = &entry.message {
        add(clean(message));
    }
    if let Some(who) = &entry.who {
        add(format!("by {}", clean(who)));
    }
    if let Some(from) = &entry.from {
        add(format!("({})", clean(from)));
    }
    if let Some(reason) = &entry.reason {
        add(format!("“{}”", clean(reason)));
    }
    text
}

/// Whether a line is about something bad.
pub fn is_bad(entry: &Entry) -> bool {
    matches!(entry.event, Event::Fault | Event::IoFault | Event::Overrun | Event::Warning | Event::Lost)
}
