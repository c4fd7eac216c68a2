//! The two files that take turns, and what is in one.
//!
//! A file is a head of 64 bytes, a description of the variables, and their values, all numbers little endian:
//!
//! | byte | |
//! |---|---|
//! | 0 | `TAKTKEEP` |
//! | 8 | version of the format, 1 |
//! | 12 | CRC-32 of the description |
//! | 16 | CRC-32 of the values |
//! | 20 | CRC-32 of the head with 0 here |
//! | 24 | number of the generation |
//! | 32 | bytes of the description |
//! | 40 | bytes of the values |
//! | 48 | hash of the description (FNV-1a, 64 bits) |
//! | 56 | when it was written: seconds since 1970 |
//!
//! A generation goes into the file that does not hold the newest one, so whatever instant the power goes, one of the two is whole.

use super::layout::{Decoded, Description, LARGEST};
use std::fmt;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Names of the files in the state folder.
pub const FILES: [&str; 2] = ["retain.0", "retain.1"];
/// Bytes of the head.
pub const HEAD: usize = 64;
const MAGIC: &[u8; 8] = b"TAKTKEEP";
const VERSION: u32 = 1;
/// Bytes that a description may have.
const LARGEST_DESCRIPTION: u64 = 1 << 28;

/// A whole generation.
#[derive(Debug, Clone)]
pub struct Generation {
    /// Its number.
    pub number: u64,
    /// When it was written: seconds since 1970.
    pub saved: u64,
    /// What the values are.
    pub description: Description,
    /// The same with its layout.
    pub decoded: Decoded,
    /// The values.
    pub data: Vec<u8>,
}

impl Generation {
    /// The value of a variable.
    pub fn value(&self, number: usize) -> &[u8] {
        let start = self.decoded.offsets.get(number).copied().unwrap_or_default();
        let end = self.decoded.offsets.get(number + 1).copied().unwrap_or(self.data.len());
        self.data.get(start..end).unwrap_or_default()
    }
}

/// What is wrong with one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Defect {
    /// It ends before it should.
    Short {
        /// Bytes it should have.
        expected: u64,
        /// Bytes it has.
        found: u64,
    },
    /// It does not begin as a file with retained values does.
    Foreign,
    /// Another version of the format.
    Version(u32),
    /// This part does not have its checksum.
    Checksum(&'static str),
    /// A length that is impossible.
    Length(u64),
    /// The description makes no sense.
    Description(String),
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short { expected, found } => write!(f, "it has {found} bytes and should have {expected}"),
            Self::Foreign => write!(f, "it is no file with retained values"),
            Self::Version(found) => write!(f, "its format has version {found}, this Takt reads version {VERSION}"),
            Self::Checksum(part) => write!(f, "its {part} does not have the right checksum"),
            Self::Length(found) => write!(f, "a length of {found} bytes in its head is impossible"),
            Self::Description(why) => write!(f, "its description of the variables is wrong: {why}"),
        }
    }
}

/// FNV-1a.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// The head of a generation.
pub fn head(number: u64, saved: u64, description: &[u8], data: &[u8]) -> [u8; HEAD] {
    let mut head = [0; HEAD];
    head[..8].copy_from_slice(MAGIC);
    head[8..12].copy_from_slice(&VERSION.to_le_bytes());
    head[12..16].copy_from_slice(&crc32fast::hash(description).to_le_bytes());
    head[16..20].copy_from_slice(&crc32fast::hash(data).to_le_bytes());
    let words = [number, description.len() as u64, data.len() as u64, hash(description), saved];
    for (i, word) in words.into_iter().enumerate() {
        head[24 + 8 * i..32 + 8 * i].copy_from_slice(&word.to_le_bytes());
    }
    let sum = crc32fast::hash(&head);
    head[20..24].copy_from_slice(&sum.to_le_bytes());
    head
}

/// Reads a file's bytes.
pub fn read(bytes: &[u8]) -> Result<Generation, Defect> {
    let found = bytes.len() as u64;
    let Some((head, rest)) = bytes.split_first_chunk::<HEAD>() else {
        let foreign = !MAGIC.starts_with(&bytes[..bytes.len().min(8)]) && !bytes.starts_with(MAGIC);
        return Err(if foreign { Defect::Foreign } else { Defect::Short { expected: HEAD as u64, found } });
    };
    let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
    if &head[..8] != MAGIC {
        return Err(Defect::Foreign);
    }
    let mut plain = *head;
    plain[20..24].fill(0);
    if crc32fast::hash(&plain) != word(20) {
        return Err(Defect::Checksum("head"));
    }
    if word(8) != VERSION {
        return Err(Defect::Version(word(8)));
    }
    let (described, values) = (long(32), long(40));
    for (len, most) in [(described, LARGEST_DESCRIPTION), (values, LARGEST)] {
        if len > most {
            return Err(Defect::Length(len));
        }
    }
    let expected = HEAD as u64 + described + values;
    if found < expected {
        return Err(Defect::Short { expected, found });
    }
    let (description, rest) = rest.split_at(described as usize);
    let data = &rest[..values as usize];
    if crc32fast::hash(description) != word(12) || hash(description) != long(48) {
        return Err(Defect::Checksum("description"));
    }
    if crc32fast::hash(data) != word(16) {
        return Err(Defect::Checksum("values"));
    }
    let (description, decoded) = Description::from_bytes(description).map_err(Defect::Description)?;
    if decoded.len != data.len() {
        return Err(Defect::Description(format!("its variables have {} bytes, its values {}", decoded.len, data.len())));
    }
    Ok(Generation { number: long(24), saved: long(56), description, decoded, data: data.to_vec() })
}

/// What the state folder holds.
#[derive(Debug, Clone, Default)]
pub struct Loaded {
    /// The newest whole generation, and in which of the files it is.
    pub newest: Option<(Generation, usize)>,
    /// A file that is not whole although the other is: a write was cut off. Its name, and what is wrong with it.
    pub torn: Option<(PathBuf, Defect)>,
}

/// Why retained values cannot be read. Nothing is loaded then, and nothing overwritten.
#[derive(Debug)]
pub enum LoadError {
    /// A file cannot be read.
    Unreadable(PathBuf, std::io::Error),
    /// A file is of another version, or no file is whole.
    Damaged(Vec<(PathBuf, Defect)>),
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable(path, error) => write!(f, "{} cannot be read: {error}", path.display()),
            Self::Damaged(files) => {
                write!(f, "the retained values cannot be read")?;
                files.iter().try_for_each(|(path, defect)| write!(f, "; {}: {defect}", path.display()))?;
                write!(f, ". Put back a copy of the folder, or move these files away and start with initial values")
            }
        }
    }
}
impl std::error::Error for LoadError {}

/// Reads the newest whole generation of a state folder, if there is one.
pub fn load(folder: &Path) -> Result<Loaded, LoadError> {
    let mut whole: Vec<(Generation, usize)> = Vec::new();
    let mut broken: Vec<(PathBuf, Defect)> = Vec::new();
    for (i, name) in FILES.into_iter().enumerate() {
        let path = folder.join(name);
        match read_file(&path) {
            Ok(None) => {}
            Ok(Some(Ok(generation))) => whole.push((generation, i)),
            Ok(Some(Err(defect))) => broken.push((path, defect)),
            Err(error) => return Err(LoadError::Unreadable(path, error)),
        }
    }
    let other_version = broken.iter().any(|(_, defect)| matches!(defect, Defect::Version(_)));
    let newest = whole.into_iter().max_by_key(|(generation, _)| generation.number);
    if other_version || newest.is_none() && !broken.is_empty() {
        return Err(LoadError::Damaged(broken));
    }
    Ok(Loaded { newest, torn: broken.pop() })
}

/// Renames the files, so that a run starts without any.
pub fn set_aside(folder: &Path) -> std::io::Result<Loaded> {
    for name in FILES {
        let path = folder.join(name);
        if path.exists() {
            std::fs::rename(&path, folder.join(format!("{name}.unreadable")))?;
        }
    }
    Ok(Loaded::default())
}

type Parsed = Result<Generation, Defect>;

fn read_file(path: &Path) -> std::io::Result<Option<Parsed>> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    let most = HEAD as u64 + LARGEST_DESCRIPTION + LARGEST;
    let len = file.metadata()?.len();
    if len > most {
        return Ok(Some(Err(Defect::Length(len))));
    }
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes)?;
    Ok(Some(read(&bytes)))
}

/// What is written where, in this order, for a generation to stand in a file: all of it, or, where the description stands there already, head and values.
pub fn writes<'a>(head: &'a [u8], description: &'a [u8], data: &'a [u8], described: bool) -> Vec<(u64, &'a [u8])> {
    let values = (HEAD + description.len()) as u64;
    match described {
        true => vec![(0, head), (values, data)],
        false => vec![(0, head), (HEAD as u64, description), (values, data)],
    }
}

/// The files, as one run writes them.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    description: Vec<u8>,
    number: u64,
    /// The file that is written next.
    next: usize,
    /// Whether a file holds the description of this program.
    described: [bool; 2],
    files: [Option<File>; 2],
}

impl Store {
    /// For a folder whose newest generation is known.
    pub fn new(folder: &Path, description: &Description, loaded: &Loaded) -> Self {
        let description = description.to_bytes();
        let (number, next) = loaded.newest.as_ref().map_or((0, 0), |(generation, file)| (generation.number, 1 - file));
        Self { folder: folder.into(), description, number, next, described: [false; 2], files: [None, None] }
    }

    /// The number of the last generation.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Writes a generation and waits until it is on the disk. On an error the other file stays the newest whole one.
    pub fn write(&mut self, data: &[u8], saved: u64) -> std::io::Result<()> {
        let head = head(self.number + 1, saved, &self.description, data);
        let path = self.folder.join(FILES[self.next]);
        if !self.described[self.next] && !path.exists() {
            self.create(&path, &head, data)?;
        } else {
            self.overwrite(&path, &head, data)?;
        }
        self.described[self.next] = true;
        self.number += 1;
        self.next = 1 - self.next;
        Ok(())
    }

    /// A file appears whole or not at all.
    fn create(&mut self, path: &Path, head: &[u8], data: &[u8]) -> std::io::Result<()> {
        let new = path.with_extension("new");
        let mut file = File::create(&new)?;
        for (_, bytes) in writes(head, &self.description, data, false) {
            file.write_all(bytes)?;
        }
        file.sync_all()?;
        std::fs::rename(&new, path)?;
        sync_folder(&self.folder)?;
        self.files[self.next] = Some(file);
        Ok(())
    }

    fn overwrite(&mut self, path: &Path, head: &[u8], data: &[u8]) -> std::io::Result<()> {
        let described = std::mem::take(&mut self.described[self.next]);
        if self.files[self.next].is_none() {
            self.files[self.next] = Some(File::options().write(true).open(path)?);
        }
        let Some(file) = &mut self.files[self.next] else { return Ok(()) };
        for (at, bytes) in writes(head, &self.description, data, described) {
            file.seek(SeekFrom::Start(at))?;
            file.write_all(bytes)?;
        }
        if !described {
            file.set_len((HEAD + self.description.len() + data.len()) as u64)?;
        }
        file.sync_data()
    }
}

/// So that a new name is there after a power cut.
#[cfg(unix)]
fn sync_folder(folder: &Path) -> std::io::Result<()> {
    File::open(folder)?.sync_all()
}

/// Other systems have no such call.
#[cfg(not(unix))]
fn sync_folder(_: &Path) -> std::io::Result<()> {
    Ok(())
}
