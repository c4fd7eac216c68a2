//! Backups: a machine's project and what it keeps between runs, in one file with a list of its contents and their hashes.
//!
//! The file is an ordinary `.tar.gz`. Its first member is the list ([`List`]); the others lie in `project/` and `state/`. A restore believes nothing: only
//! plain files that the list names, of the length and the hash that it says, with paths that stay inside, are written; first all of them beside the
//! folder, and only when everything is right into it.

mod restore;
mod save;

pub use restore::restore;
pub use save::save;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// Name of the list in the file.
const LIST: &str = "takt-backup.json";
/// What the list calls itself.
const FORMAT: &str = "takt-backup";
/// Version of the format.
const VERSION: u32 = 1;
/// Folders in the file.
const PROJECT: &str = "project";
const STATE: &str = "state";
/// Bytes of the list, of all files together, and how many files.
const LIST_BYTES: u64 = 32 << 20;
const ALL_BYTES: u64 = 16 << 30;
const FILES: usize = 100_000;

/// What is in a backup.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct List {
    format: String,
    version: u32,
    /// The version of Takt that wrote it.
    pub takt: String,
    /// Name of the project.
    pub project: String,
    /// When, UTC.
    pub time: String,
    /// The files, in their order.
    pub files: Vec<Member>,
}

/// A file of a backup.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Member {
    /// `project/…` or `state/…`.
    pub path: String,
    /// Bytes.
    pub size: u64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
}

/// Why there is no backup, or why it cannot be restored.
#[derive(Debug)]
pub struct BackupError {
    /// The file or folder.
    pub path: PathBuf,
    /// Why, and what to do.
    pub message: String,
}

impl BackupError {
    fn new(path: impl Into<PathBuf>, message: impl fmt::Display) -> Self {
        Self { path: path.into(), message: message.to_string() }
    }
}
impl fmt::Display for BackupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.message)
    }
}
impl std::error::Error for BackupError {}

fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The parts of a member's path, if it stays inside.
fn parts(path: &str) -> Option<Vec<&str>> {
    let inside = Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
    let parts: Vec<&str> = path.split('/').collect();
    let good = |part: &&str| !part.is_empty() && *part != "." && *part != ".." && !part.contains(['\\', '\0', ':']);
    (inside && parts.len() >= 2 && matches!(parts[0], PROJECT | STATE) && parts.iter().all(good)).then_some(parts)
}

#[cfg(test)]
mod tests;
