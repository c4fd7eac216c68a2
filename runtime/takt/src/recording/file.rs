//! The file: a mark, then chunks, each with its kind, its length and a checksum. Recordings and core files are made of the same chunks.
//!
//! A chunk is 16 bytes (kind, length, length unpacked, CRC-32 of these and the content, each a 32-bit number, the lowest byte first) and its content,
//! packed with DEFLATE. What is damaged is refused with the place in the file; a length is never believed before there are so many bytes.

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// First bytes of a file; the last one is the version of the format.
pub const MAGIC: [u8; 8] = *b"TAKTREC\x01";
const HEAD: usize = 16;
/// Bytes of a chunk, packed or not, that are believed at the most.
const LARGEST: u64 = 1 << 30;

/// What a chunk holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// JSON: which program, which machine, how it was run ([`super::header::Header`]).
    Header = 1,
    /// A state of the engine.
    Checkpoint = 2,
    /// What happened ([`super::codec`]).
    Events = 3,
    /// JSON: the texts of the program (core files).
    Sources = 4,
    /// JSON: the fault (core files).
    Fault = 5,
    /// JSON: how the recording ended.
    End = 6,
}

impl Kind {
    const ALL: [Self; 6] = [Self::Header, Self::Checkpoint, Self::Events, Self::Sources, Self::Fault, Self::End];
}

/// A chunk as it stands in the file.
pub fn packed(kind: Kind, content: &[u8]) -> Vec<u8> {
    let mut out = vec![0; HEAD];
    let mut encoder = DeflateEncoder::new(&mut out, Compression::fast());
    // Writing into memory does not fail.
    let _ = encoder.write_all(content);
    let _ = encoder.finish();
    let words = [kind as u32, (out.len() - HEAD) as u32, content.len() as u32];
    for (i, word) in words.into_iter().enumerate() {
        out[i * 4..i * 4 + 4].copy_from_slice(&word.to_le_bytes());
    }
    let sum = checksum(&out[..12], &out[HEAD..]);
    out[12..HEAD].copy_from_slice(&sum.to_le_bytes());
    out
}

fn checksum(head: &[u8], content: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(head);
    hasher.update(content);
    hasher.finalize()
}

/// Why a file cannot be read.
#[derive(Debug)]
pub enum FileError {
    /// The system refused.
    Unreadable(PathBuf, io::Error),
    /// It is no recording.
    Foreign(PathBuf),
    /// It is of another version of the format.
    Version(PathBuf, u8),
    /// A part of it is damaged.
    Damaged {
        /// The file.
        path: PathBuf,
        /// Byte of the file.
        at: u64,
        /// What is wrong.
        message: String,
    },
}

impl std::fmt::Display for FileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unreadable(path, error) => write!(f, "{} cannot be read: {error}", path.display()),
            Self::Foreign(path) => {
                write!(f, "{} is neither a recording (`takt run --record-inputs`) nor a core file of Takt", path.display())
            }
            Self::Version(path, version) => {
                write!(
                    f,
                    "{} has version {version} of the format, this Takt reads {}; use the Takt that wrote it",
                    path.display(),
                    MAGIC[7]
                )
            }
            Self::Damaged { path, at, message } => write!(f, "{}: damaged at byte {at}: {message}", path.display()),
        }
    }
}
impl std::error::Error for FileError {}

/// Where a chunk stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// What it holds.
    pub kind: Kind,
    /// First byte.
    pub at: u64,
    length: u32,
    unpacked: u32,
    sum: u32,
}

/// An open file and where its chunks are.
#[derive(Debug)]
pub struct Chunks {
    path: PathBuf,
    file: File,
    /// In the order of the file.
    pub list: Vec<Place>,
    /// The last chunk is cut: the machine or its recorder ended there.
    pub cut: Option<u64>,
}

impl Chunks {
    /// Opens a file and finds its chunks. A last chunk that is cut is left out.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let unreadable = |error| FileError::Unreadable(path.into(), error);
        let mut file = File::open(path).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if !metadata.is_file() {
            return Err(FileError::Foreign(path.into()));
        }
        let size = metadata.len();
        let mut magic = [0; 8];
        match file.read_exact(&mut magic) {
            Ok(()) if magic == MAGIC => {}
            Ok(()) if magic[..7] == MAGIC[..7] => return Err(FileError::Version(path.into(), magic[7])),
            _ => return Err(FileError::Foreign(path.into())),
        }
        let mut chunks = Self { path: path.into(), file, list: Vec::new(), cut: None };
        let mut at = MAGIC.len() as u64;
        while at < size {
            match chunks.place(at, size)? {
                Some(place) => {
                    at += HEAD as u64 + u64::from(place.length);
                    chunks.list.push(place);
                }
                None => {
                    chunks.cut = Some(at);
                    break;
                }
            }
        }
        Ok(chunks)
    }

    fn damaged(&self, at: u64, message: impl Into<String>) -> FileError {
        FileError::Damaged { path: self.path.clone(), at, message: message.into() }
    }

    /// The file, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn place(&mut self, at: u64, size: u64) -> Result<Option<Place>, FileError> {
        let mut head = [0; HEAD];
        if at + HEAD as u64 > size {
            return Ok(None);
        }
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut head));
        read.map_err(|error| FileError::Unreadable(self.path.clone(), error))?;
        let word = |i: usize| u32::from_le_bytes([head[i], head[i + 1], head[i + 2], head[i + 3]]);
        let kind = Kind::ALL.into_iter().find(|kind| *kind as u32 == word(0));
        let Some(kind) = kind else {
            return Err(self.damaged(at, format!("expected a chunk, found kind {}", word(0))));
        };
        let place = Place { kind, at, length: word(4), unpacked: word(8), sum: word(12) };
        if u64::from(place.unpacked) > LARGEST {
            return Err(self.damaged(at, format!("a chunk says it has {} bytes; at most {LARGEST} are allowed", place.unpacked)));
        }
        Ok((at + HEAD as u64 + u64::from(place.length) <= size).then_some(place))
    }

    /// The content of a chunk, checked.
    pub fn read(&mut self, place: Place) -> Result<Vec<u8>, FileError> {
        let unreadable = |path: &Path, error| FileError::Unreadable(path.into(), error);
        self.file.seek(SeekFrom::Start(place.at)).map_err(|error| unreadable(&self.path, error))?;
        let length = HEAD + place.length as usize;
        let mut bytes = Vec::with_capacity(length);
        (&self.file).take(length as u64).read_to_end(&mut bytes).map_err(|error| unreadable(&self.path, error))?;
        if bytes.len() < length || checksum(&bytes[..12], &bytes[HEAD..]) != place.sum {
            return Err(self.damaged(place.at, "the checksum of the chunk is wrong"));
        }
        let mut content = Vec::new();
        // One byte more than promised shows a lie.
        let unpacked = DeflateDecoder::new(&bytes[HEAD..]).take(u64::from(place.unpacked) + 1).read_to_end(&mut content);
        match unpacked {
            Ok(count) if count == place.unpacked as usize => Ok(content),
            Ok(count) => Err(self.damaged(place.at, format!("the chunk unpacks to {count} bytes or more, expected {}", place.unpacked))),
            Err(error) => Err(self.damaged(place.at, format!("the chunk cannot be unpacked: {error}"))),
        }
    }

    /// The only chunk of a kind, as JSON.
    pub fn json(&mut self, kind: Kind) -> Result<serde_json::Value, FileError> {
        let name = format!("{kind:?}").to_lowercase();
        let Some(place) = self.list.iter().find(|place| place.kind == kind).copied() else {
            let end = self.cut.unwrap_or_else(|| self.list.last().map_or(8, |last| last.at));
            return Err(self.damaged(end, format!("the chunk `{name}` is missing")));
        };
        let content = self.read(place)?;
        serde_json::from_slice(&content).map_err(|error| self.damaged(place.at, format!("the chunk `{name}` is no JSON: {error}")))
    }
}
