//! Reads a backup, which may be damaged or hostile.

use super::{ALL_BYTES, BackupError, FILES, FORMAT, LIST, LIST_BYTES, List, Member, PROJECT, STATE, VERSION, hexadecimal, parts};
use crate::state;
use flate2::read::GzDecoder;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// Bytes that may follow the end of an archive.
const REST: u64 = 1 << 20;

/// Restores a backup into a folder: a new or empty one, or with `force` over what is there. All or nothing is written, unless the disk fails at the end.
pub fn restore(file: &Path, folder: &Path, force: bool) -> Result<List, BackupError> {
    let occupied = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if folder.exists() && !folder.is_dir() {
        return Err(BackupError::new(folder, "it is no folder"));
    }
    if occupied && !force {
        return Err(BackupError::new(folder, "it is not empty; name another folder, or write over what is there with --force"));
    }
    // A machine that runs there must not lose its ground.
    let own = folder.join(state::FOLDER);
    let lock = if own.exists() { Some(state::State::open(&own).map_err(|error| BackupError::new(folder, error))?) } else { None };
    let beside = beside(folder);
    let _ = fs::remove_dir_all(&beside);
    let result = unpack(file, &beside).and_then(|list| {
        for member in &list.files {
            check_target(folder, member)?;
        }
        list.files.iter().try_for_each(|member| put(&beside, folder, member))?;
        Ok(list)
    });
    let _ = fs::remove_dir_all(&beside);
    drop(lock);
    result
}

/// A folder next to the one that is restored, on the same disk.
fn beside(folder: &Path) -> PathBuf {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.into());
    let mut name = whole.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".restore-{}", std::process::id()));
    whole.with_file_name(name)
}

/// Where a member belongs.
fn target(folder: &Path, member: &Member) -> Option<PathBuf> {
    let parts = parts(&member.path)?;
    let mut path = if parts[0] == STATE { folder.join(state::FOLDER) } else { folder.to_path_buf() };
    path.extend(&parts[1..]);
    Some(path)
}

/// No part of the path may lead elsewhere.
fn check_target(folder: &Path, member: &Member) -> Result<(), BackupError> {
    let path = target(folder, member).ok_or_else(|| BackupError::new(&member.path, "its path leads outside"))?;
    let inner = path.strip_prefix(folder).unwrap_or(&path);
    let mut here = folder.to_path_buf();
    for part in inner.components() {
        here.push(part);
        match fs::symlink_metadata(&here) {
            Ok(found) if found.file_type().is_symlink() => return Err(BackupError::new(&here, "it is a link; remove it first")),
            Ok(found) if here == path && !found.is_file() => return Err(BackupError::new(&here, "it is no file; remove it first")),
            Ok(found) if here != path && !found.is_dir() => return Err(BackupError::new(&here, "it is no folder; remove it first")),
            _ => {}
        }
    }
    Ok(())
}

fn put(beside: &Path, folder: &Path, member: &Member) -> Result<(), BackupError> {
    let to = target(folder, member).ok_or_else(|| BackupError::new(&member.path, "its path leads outside"))?;
    let refused = |error: io::Error| BackupError::new(&to, error);
    fs::create_dir_all(to.parent().unwrap_or(folder)).map_err(refused)?;
    fs::rename(beside.join(&member.path), &to).map_err(refused)
}

/// Unpacks everything that is right into a folder of its own.
fn unpack(file: &Path, into: &Path) -> Result<List, BackupError> {
    let refused = |error: io::Error| BackupError::new(file, format!("it is no backup, or it is damaged: {error}"));
    let source = File::open(file).map_err(|error| BackupError::new(file, error))?;
    let longest = ALL_BYTES + LIST_BYTES + 1024 * (FILES as u64 + 4);
    let mut archive = tar::Archive::new(GzDecoder::new(BufReader::new(source)).take(longest));
    // Raw: nothing but plain files is understood, so no member can say that another one has a long name or is a link.
    let mut entries = archive.entries().map_err(refused)?.raw(true);
    let mut list: Option<List> = None;
    let mut next = 0;
    for entry in &mut entries {
        let entry = entry.map_err(refused)?;
        let path =
            String::from_utf8(entry.path_bytes().into_owned()).map_err(|_| BackupError::new(file, "a member's name is not UTF-8"))?;
        if entry.header().entry_type() != tar::EntryType::Regular {
            return Err(BackupError::new(file, format!("`{path}` is no plain file; a backup has nothing else")));
        }
        let size = entry.header().entry_size().map_err(refused)?;
        match &list {
            None => list = Some(read_list(file, &path, size, entry)?),
            Some(list) => {
                let Some(member) = list.files.get(next) else {
                    return Err(BackupError::new(file, format!("`{path}` is not in its list")));
                };
                if member.path != path || member.size != size {
                    let expected = format!("`{}` with {} bytes", member.path, member.size);
                    return Err(BackupError::new(file, format!("found `{path}` with {size} bytes where its list has {expected}")));
                }
                write(file, entry, &into.join(&member.path), member)?;
                next += 1;
            }
        }
    }
    let list = list.ok_or_else(|| BackupError::new(file, format!("it is no backup: it has no {LIST}")))?;
    // The rest of the stream is its end and its checksum.
    let rest = io::copy(&mut archive.into_inner().take(REST + 1), &mut io::sink()).map_err(refused)?;
    if rest > REST {
        return Err(BackupError::new(file, "there is more behind its end"));
    }
    match list.files.get(next) {
        Some(missing) => Err(BackupError::new(file, format!("it is cut: `{}` is missing", missing.path))),
        None => Ok(list),
    }
}

fn read_list(file: &Path, path: &str, size: u64, entry: impl Read) -> Result<List, BackupError> {
    if path != LIST {
        return Err(BackupError::new(file, format!("it is no backup: it begins with `{path}`, expected {LIST}")));
    }
    if size > LIST_BYTES {
        return Err(BackupError::new(file, format!("its list has {size} bytes, {LIST_BYTES} at the most")));
    }
    let mut text = Vec::new();
    entry.take(LIST_BYTES).read_to_end(&mut text).map_err(|error| BackupError::new(file, error))?;
    #[derive(serde::Deserialize)]
    struct Head {
        format: String,
        version: u32,
    }
    let wrong = |error: serde_json::Error| BackupError::new(file, format!("its list: {error}"));
    let head: Head = serde_json::from_slice(&text).map_err(wrong)?;
    if head.format != FORMAT || head.version != VERSION {
        let found = format!("{} of version {}", head.format, head.version);
        return Err(BackupError::new(file, format!("found {found}, expected {FORMAT} of version {VERSION}; use the Takt that wrote it")));
    }
    let list: List = serde_json::from_slice(&text).map_err(wrong)?;
    check_list(file, &list)?;
    Ok(list)
}

fn check_list(file: &Path, list: &List) -> Result<(), BackupError> {
    let total = list.files.iter().fold(0u64, |total, member| total.saturating_add(member.size));
    if list.files.len() > FILES || total > ALL_BYTES {
        let found = format!("{} files with {total} bytes", list.files.len());
        return Err(BackupError::new(file, format!("its list has {found}; {FILES} with {ALL_BYTES} are the most")));
    }
    let mut seen = HashSet::new();
    for member in &list.files {
        if parts(&member.path).is_none() {
            return Err(BackupError::new(file, format!("`{}` leads outside of `{PROJECT}/` and `{STATE}/`", member.path)));
        }
        if !seen.insert(member.path.to_lowercase()) {
            return Err(BackupError::new(file, format!("`{}` is in its list twice", member.path)));
        }
    }
    Ok(())
}

fn write(file: &Path, mut entry: impl Read, to: &Path, member: &Member) -> Result<(), BackupError> {
    let refused = |error: io::Error| BackupError::new(to, error);
    fs::create_dir_all(to.parent().unwrap_or(to)).map_err(refused)?;
    let mut out = File::options().write(true).create_new(true).open(to).map_err(refused)?;
    let mut hash = Sha256::new();
    let mut block = vec![0; 64 << 10];
    let mut size = 0;
    loop {
        let read =
            entry.read(&mut block).map_err(|error| BackupError::new(file, format!("it is damaged at `{}`: {error}", member.path)))?;
        if read == 0 {
            break;
        }
        hash.update(&block[..read]);
        size += read as u64;
        out.write_all(&block[..read]).map_err(refused)?;
    }
    if size != member.size || hexadecimal(hash) != member.sha256 {
        return Err(BackupError::new(file, format!("`{}` is damaged: its hash is not the one in the list", member.path)));
    }
    out.sync_all().map_err(refused)
}
