//! The state folder: what a machine keeps between runs (retained variables, journal, recordings) and while it runs (the control socket).
//!
//! It is `.takt` in the project's folder, or what `--state` names. It is made on demand, and one run at a time owns it: a lock on the file `lock` in it,
//! which the system lets go when the process ends, however it ends.

use crate::project::Project;
use std::fmt;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Name of the folder in a project.
pub const FOLDER: &str = ".takt";
/// Name of the lock in it.
const LOCK: &str = "lock";

/// A state folder that this process owns until the value is dropped.
#[derive(Debug)]
pub struct State {
    path: PathBuf,
    /// Holds the lock as long as it is open.
    _lock: File,
}

/// Why a state folder cannot be used.
#[derive(Debug)]
pub enum StateError {
    /// Another run owns it.
    Taken {
        /// The folder.
        path: PathBuf,
        /// Number of the process, if its lock tells.
        process: Option<u32>,
    },
    /// There is something else of this name.
    NotAFolder(PathBuf),
    /// It cannot be made, written or locked.
    Unusable {
        /// Folder or file.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Taken { path, process } => {
                write!(f, "{} belongs to a run that is under way", path.display())?;
                if let Some(process) = process {
                    write!(f, " (process {process})")?;
                }
                write!(f, "; stop that one first, or give this one a folder of its own with `--state DIR`")
            }
            Self::NotAFolder(path) => {
                write!(f, "{} is no folder; move it away, or name another one with `--state DIR`", path.display())
            }
            Self::Unusable { path, error } => {
                write!(
                    f,
                    "{} cannot be used as state folder: {error}; make it writable, or name another one with `--state DIR`",
                    path.display()
                )
            }
        }
    }
}
impl std::error::Error for StateError {}

/// The state folder of a project: what was asked for, or `.takt` in its folder; sources without a manifest have one each in there.
pub fn folder_of(project: &Project, given: Option<&Path>) -> PathBuf {
    match (given, &project.manifest_file) {
        (Some(path), _) => path.into(),
        (None, Some(_)) => project.root.join(FOLDER),
        (None, None) => project.root.join(FOLDER).join(&project.name),
    }
}

impl State {
    /// Makes the folder if there is none, and takes it for this process.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self, StateError> {
        let path = path.into();
        if path.exists() && !path.is_dir() {
            return Err(StateError::NotAFolder(path));
        }
        let unusable = |path: &Path| {
            let path = path.to_path_buf();
            move |error| StateError::Unusable { path, error }
        };
        std::fs::create_dir_all(&path).map_err(unusable(&path))?;
        let file = path.join(LOCK);
        let mut lock = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&file).map_err(unusable(&file))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StateError::Taken { process: process_of(&mut lock), path }),
            Err(TryLockError::Error(error)) => return Err(unusable(&file)(error)),
        }
        let owner = format!("{}\n", std::process::id());
        lock.set_len(0).and_then(|()| lock.write_all(owner.as_bytes())).map_err(unusable(&file))?;
        Ok(Self { path, _lock: lock })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

/// Who wrote its number into the lock.
fn process_of(lock: &mut File) -> Option<u32> {
    let mut text = String::new();
    lock.take(16).read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}

/// The state folder of a run: on the real clock always, in virtual time only where it was asked for, so that tests and simulations are the same run twice.
pub fn of_run(project: &Project, given: Option<&Path>, real: bool) -> Result<Option<State>, StateError> {
    if given.is_none() && !real {
        return Ok(None);
    }
    State::open(folder_of(project, given)).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("takt-state-{name}-{}", std::process::id()))
    }

    #[test]
    fn one_run_at_a_time_owns_the_folder() {
        let path = folder("lock").join("deep/er");
        let first = State::open(&path).unwrap();
        let text = State::open(&path).unwrap_err().to_string();
        assert!(text.contains(&format!("(process {})", std::process::id())) && text.contains("--state DIR"), "{text}");
        assert_eq!(first.file("retain.0"), path.join("retain.0"));
        drop(first);
        assert!(State::open(&path).is_ok(), "a lock goes with its owner");
        std::fs::write(path.join(LOCK), "hostile \u{0} and long: 99999999999999999999").unwrap();
        let _owner = State::open(&path).unwrap();
        std::fs::remove_dir_all(folder("lock")).unwrap();
    }

    #[test]
    fn what_is_no_folder_is_refused_by_name() {
        let path = folder("file");
        std::fs::write(&path, "x").unwrap();
        assert!(matches!(State::open(&path), Err(StateError::NotAFolder(p)) if p == path));
        let text = State::open(path.join("below")).unwrap_err().to_string();
        assert!(text.contains("below cannot be used as state folder"), "{text}");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn simulations_have_none_unless_asked() {
        let path = folder("asked");
        let project = Project { root: path.clone(), name: "pump".into(), ..Project::default() };
        assert!(of_run(&project, None, false).unwrap().is_none() && !path.exists());
        let own = of_run(&project, None, true).unwrap().unwrap();
        assert_eq!(own.path(), path.join(".takt/pump"));
        let asked = of_run(&project, Some(&path.join("here")), false).unwrap().unwrap();
        assert_eq!(asked.path(), path.join("here"));
        std::fs::remove_dir_all(path).unwrap();
    }
}
