//! The file of the journal: lines are appended; when it is large it becomes the youngest of a few old ones.

use super::Entry;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Name of the file in the state folder.
pub const NAME: &str = "journal.jsonl";
/// Bytes after which a new file begins.
const LARGEST: u64 = 4 << 20;
/// Old files that are kept.
pub(super) const KEPT: u32 = 8;

/// The path of an old file: 1 is the youngest; 0 is the one that is written.
pub fn generation(folder: &Path, number: u32) -> PathBuf {
    if number == 0 { folder.join(NAME) } else { folder.join(format!("journal.{number}.jsonl")) }
}

/// The file that is written.
#[derive(Debug)]
pub struct JournalFile {
    folder: PathBuf,
    file: File,
    size: u64,
    largest: u64,
    line: Vec<u8>,
}

impl JournalFile {
    /// Opens it, or makes it. A last line that was cut is ended.
    pub fn open(folder: &Path) -> io::Result<Self> {
        Self::open_with(folder, LARGEST)
    }

    pub(super) fn open_with(folder: &Path, largest: u64) -> io::Result<Self> {
        let mut file = open_file(&generation(folder, 0))?;
        let size = file.seek(SeekFrom::End(0))?;
        let mut journal = Self { folder: folder.into(), file, size, largest, line: Vec::new() };
        let mut last = [b'\n'];
        if size > 0 {
            journal.file.seek(SeekFrom::End(-1))?;
            journal.file.read_exact(&mut last)?;
        }
        if last != [b'\n'] {
            journal.file.write_all(b"\n")?;
            journal.size += 1;
        }
        Ok(journal)
    }

    /// Appends a line, as a whole or not at all.
    pub fn append(&mut self, entry: &Entry) -> io::Result<()> {
        self.line.clear();
        serde_json::to_writer(&mut self.line, entry)?;
        self.line.push(b'\n');
        if self.size > 0 && self.size + self.line.len() as u64 > self.largest {
            self.rotate()?;
        }
        if let Err(error) = self.file.write_all(&self.line) {
            // What was written of the line goes; if that fails too, the next line still begins anew when the journal is opened.
            let _ = self.file.set_len(self.size);
            return Err(error);
        }
        self.size += self.line.len() as u64;
        Ok(())
    }

    /// Waits until the disk has it; a disk that cannot is no reason to stop.
    pub fn sync(&self) {
        let _ = self.file.sync_data();
    }

    fn rotate(&mut self) -> io::Result<()> {
        self.sync();
        for number in (0..KEPT).rev() {
            match std::fs::rename(generation(&self.folder, number), generation(&self.folder, number + 1)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        self.file = open_file(&generation(&self.folder, 0))?;
        self.size = 0;
        Ok(())
    }
}

fn open_file(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).append(true).create(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o640);
    options.open(path)
}
