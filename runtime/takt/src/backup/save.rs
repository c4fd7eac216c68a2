//! Writes a backup.

use super::{ALL_BYTES, BackupError, FILES, FORMAT, LIST, List, Member, PROJECT, STATE, VERSION, hexadecimal, parts};
use flate2::{Compression, write::GzEncoder};
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Files of the state folder that are of one run only.
const OF_A_RUN: [&str; 2] = [crate::control::NAME, "lock"];
/// How often files of the state folder are read until they are the same twice.
const TRIES: u32 = 200;
const BETWEEN: Duration = Duration::from_millis(3);
/// Folders of a project that are none of it.
const BESIDE: [&str; 1] = ["target"];

/// A file that is to be saved, with its bytes if they were read already.
struct Found {
    member: Member,
    path: PathBuf,
    bytes: Option<Vec<u8>>,
}

/// Saves a project's folder and its state folder. Returns the list, and what was left out.
pub fn save(name: &str, root: &Path, state: &Path, file: &Path) -> Result<(List, Vec<PathBuf>), BackupError> {
    let mut left_out = Vec::new();
    let mut found = Vec::new();
    for (path, inner) in files(root, file, &mut left_out)? {
        let (size, sha256) = hash(&path).map_err(|error| BackupError::new(&path, error))?;
        found.push(Found { member: member(PROJECT, &path, &inner, size, sha256)?, path, bytes: None });
    }
    for (inner, bytes) in steady(state)? {
        let path = state.join(&inner);
        let mut hash = Sha256::new();
        hash.update(&bytes);
        let member = member(STATE, &path, &inner, bytes.len() as u64, hexadecimal(hash))?;
        found.push(Found { member, path, bytes: Some(bytes) });
    }
    let total: u64 = found.iter().map(|found| found.member.size).sum();
    if found.len() > FILES || total > ALL_BYTES {
        return Err(BackupError::new(
            root,
            format!("{} files with {total} bytes are too many: {FILES} with {ALL_BYTES} at the most", found.len()),
        ));
    }
    let list = List {
        format: FORMAT.into(),
        version: VERSION,
        takt: env!("CARGO_PKG_VERSION").into(),
        project: name.into(),
        time: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
        files: found.iter().map(|found| found.member.clone()).collect(),
    };
    write(&list, &found, file)?;
    Ok((list, left_out))
}

fn member(folder: &str, path: &Path, inner: &Path, size: u64, sha256: String) -> Result<Member, BackupError> {
    let text = inner.to_str().map(|text| format!("{folder}/{}", text.replace(std::path::MAIN_SEPARATOR, "/")));
    match text.filter(|text| parts(text).is_some()) {
        Some(path) => Ok(Member { path, size, sha256 }),
        None => Err(BackupError::new(path, "its name cannot be kept in a backup; rename it")),
    }
}

/// The plain files of a folder, in order, with their paths inside. Hidden ones and links are left out.
fn files(root: &Path, own: &Path, left_out: &mut Vec<PathBuf>) -> Result<Vec<(PathBuf, PathBuf)>, BackupError> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    let own = own.canonicalize().ok();
    while let Some(folder) = folders.pop() {
        let entries = fs::read_dir(&folder).map_err(|error| BackupError::new(&folder, error))?;
        for entry in entries {
            let path = entry.map_err(|error| BackupError::new(&folder, error))?.path();
            let kind = fs::symlink_metadata(&path).map_err(|error| BackupError::new(&path, error))?.file_type();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with('.') || own.is_some() && path.canonicalize().ok() == own {
                continue;
            }
            if kind.is_dir() && !(folder == root && BESIDE.contains(&name.as_str())) {
                folders.push(path);
            } else if kind.is_file() {
                let inner = path.strip_prefix(root).unwrap_or(&path).to_path_buf();
                found.push((path, inner));
            } else if !kind.is_dir() {
                left_out.push(path);
            }
            if found.len() > FILES {
                return Err(BackupError::new(root, format!("more than {FILES} files")));
            }
        }
    }
    found.sort();
    Ok(found)
}

/// The files of the state folder, as they were at one moment although a machine may be writing them: they are read until they are the same twice.
fn steady(state: &Path) -> Result<Vec<(PathBuf, Vec<u8>)>, BackupError> {
    if !state.is_dir() {
        return Ok(Vec::new());
    }
    let mut before = read_all(state).map_err(|error| BackupError::new(state, error))?;
    for _ in 0..TRIES {
        std::thread::sleep(BETWEEN);
        let now = read_all(state).map_err(|error| BackupError::new(state, error))?;
        if now == before {
            return Ok(now);
        }
        before = now;
    }
    Err(BackupError::new(state, "the machine writes it all the time; pause it (`takt ctl pause`) while the backup is made"))
}

fn read_all(state: &Path) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(state)? {
        let entry = entry?;
        let name = PathBuf::from(entry.file_name());
        let text = name.to_string_lossy();
        let kept = entry.file_type()?.is_file() && !OF_A_RUN.contains(&text.as_ref()) && !text.starts_with('.');
        // Recordings and core files may be large, and are of no use to another machine.
        if kept
            && entry.metadata()?.len() <= 64 << 20
            && (text.starts_with("retain") || text.starts_with("journal") || text.starts_with("param"))
        {
            found.push((name.clone(), fs::read(entry.path())?));
        }
    }
    found.sort();
    Ok(found)
}

fn hash(path: &Path) -> io::Result<(u64, String)> {
    let mut file = File::open(path)?;
    let mut hash = Sha256::new();
    let mut block = vec![0; 64 << 10];
    let mut size = 0;
    loop {
        let read = file.read(&mut block)?;
        if read == 0 {
            return Ok((size, hexadecimal(hash)));
        }
        hash.update(&block[..read]);
        size += read as u64;
    }
}

/// Writes beside the file and gives it its name in the end, so that a backup is whole or is not there.
fn write(list: &List, found: &[Found], file: &Path) -> Result<(), BackupError> {
    let mut name = file.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}", std::process::id()));
    let temporary = file.with_file_name(name);
    let written = write_to(list, found, &temporary);
    let named = written.and_then(|()| fs::rename(&temporary, file).map_err(|error| BackupError::new(file, error)));
    if named.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    named
}

fn write_to(list: &List, found: &[Found], temporary: &Path) -> Result<(), BackupError> {
    let refused = |error: io::Error| BackupError::new(temporary, error);
    let out = File::options().write(true).create_new(true).open(temporary).map_err(refused)?;
    let mut archive = tar::Builder::new(GzEncoder::new(io::BufWriter::new(out), Compression::default()));
    let text = serde_json::to_vec_pretty(list).map_err(|error| BackupError::new(temporary, error))?;
    append(&mut archive, LIST, text.len() as u64, &text[..]).map_err(refused)?;
    for Found { member, path, bytes } in found {
        let appended = match bytes {
            Some(bytes) => append(&mut archive, &member.path, member.size, &bytes[..]),
            None => append_file(&mut archive, member, path)?,
        };
        appended.map_err(|error| BackupError::new(path, error))?;
    }
    let encoder = archive.into_inner().map_err(refused)?;
    let mut buffer = encoder.finish().map_err(refused)?;
    buffer.flush().map_err(refused)?;
    buffer.get_ref().sync_all().map_err(refused)
}

/// A file that may be large: it must still be what was hashed.
fn append_file(archive: &mut tar::Builder<impl Write>, member: &Member, path: &Path) -> Result<io::Result<()>, BackupError> {
    let file = File::open(path).map_err(|error| BackupError::new(path, error))?;
    let mut reader = Hashed { inner: file.take(member.size), hash: Sha256::new(), size: 0 };
    let appended = append(archive, &member.path, member.size, &mut reader);
    let changed = reader.size != member.size || hexadecimal(reader.hash) != member.sha256;
    if changed {
        return Err(BackupError::new(path, "it changed while it was saved; try again"));
    }
    Ok(appended)
}

fn append(archive: &mut tar::Builder<impl Write>, path: &str, size: u64, bytes: impl Read) -> io::Result<()> {
    let mut header = tar::Header::new_ustar();
    header.set_path(path).map_err(|error| io::Error::new(error.kind(), format!("its path is too long for a backup: {error}")))?;
    header.set_size(size);
    header.set_mode(0o644);
    header.set_mtime(0);
    header.set_entry_type(tar::EntryType::Regular);
    header.set_cksum();
    archive.append(&header, bytes)
}

struct Hashed<R> {
    inner: R,
    hash: Sha256,
    size: u64,
}
impl<R: Read> Read for Hashed<R> {
    fn read(&mut self, block: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(block)?;
        self.hash.update(&block[..read]);
        self.size += read as u64;
        Ok(read)
    }
}
