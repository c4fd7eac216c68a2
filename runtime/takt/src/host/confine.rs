//! Paths confined to a folder: no program can name a file outside it.
//!
//! A path is walked component by component. A link is followed only if its target is relative and stays inside; `..`, absolute paths
//! and backslashes are refused in what a program writes.

use std::fs::{File, OpenOptions};
use std::path::{Component, Path, PathBuf};
use takt_abi::HostError;

/// Links followed in one path.
const LINKS: u32 = 16;

/// The file that `path` names inside `folder`, free of links. It need not be a file. A `./` before it means nothing.
pub fn resolve(folder: &Path, path: &str) -> Result<PathBuf, HostError> {
    let path = path.strip_prefix("./").unwrap_or(path);
    let plain = !path.is_empty() && !path.contains(['\\', '\0']);
    let normal = Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
    if !plain || !normal {
        return Err(HostError::Outside);
    }
    let root = folder.canonicalize().map_err(error)?;
    let mut walk = Walk { root: &root, at: root.clone(), links: 0 };
    walk.follow(Path::new(path))?;
    Ok(walk.at)
}

/// The same for a name that nothing need have yet; its folder must exist.
pub fn resolve_new(folder: &Path, path: &str) -> Result<PathBuf, HostError> {
    let path = path.strip_prefix("./").unwrap_or(path);
    match resolve(folder, path) {
        Err(HostError::NotFound) => {}
        known => return known,
    }
    let parent = match path.rsplit_once('/') {
        Some((parent, _)) => resolve(folder, parent)?,
        None => folder.canonicalize().map_err(error)?,
    };
    let name = Path::new(path).file_name().ok_or(HostError::Outside)?;
    let place = parent.join(name);
    // A link that leads nowhere is not a new name: what it names may lie outside.
    if std::fs::symlink_metadata(&place).is_ok() || !parent.is_dir() { Err(HostError::NotFound) } else { Ok(place) }
}

struct Walk<'a> {
    root: &'a Path,
    at: PathBuf,
    links: u32,
}

impl Walk<'_> {
    fn follow(&mut self, path: &Path) -> Result<(), HostError> {
        for part in path.components() {
            match part {
                Component::CurDir => {}
                Component::ParentDir if self.at == self.root => return Err(HostError::Outside),
                Component::ParentDir => {
                    self.at.pop();
                }
                Component::Normal(name) => self.enter(name)?,
                Component::RootDir | Component::Prefix(_) => return Err(HostError::Outside),
            }
        }
        Ok(())
    }
    fn enter(&mut self, name: &std::ffi::OsStr) -> Result<(), HostError> {
        let next = self.at.join(name);
        let meta = std::fs::symlink_metadata(&next).map_err(error)?;
        if !meta.is_symlink() {
            self.at = next;
            return Ok(());
        }
        self.links += 1;
        if self.links > LINKS {
            return Err(HostError::NotReadable);
        }
        let target = std::fs::read_link(&next).map_err(error)?;
        self.follow(&target)
    }
}

/// Opens a plain file for reading; a folder, pipe or device is refused, a link too.
pub fn open(path: &Path) -> Result<File, HostError> {
    open_as(path, File::options().read(true))
}

/// The same, as the options say.
pub fn open_as(path: &Path, options: &mut OpenOptions) -> Result<File, HostError> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK | libc::O_CLOEXEC);
    }
    let file = options.open(path).map_err(error)?;
    if file.metadata().map_err(error)?.is_file() { Ok(file) } else { Err(HostError::NotReadable) }
}

/// The system's error as a host error.
pub fn error(error: std::io::Error) -> HostError {
    use std::io::ErrorKind::{IsADirectory, NotADirectory, NotFound, PermissionDenied};
    match (error.kind(), error.raw_os_error()) {
        (NotFound | NotADirectory, _) => HostError::NotFound,
        (PermissionDenied | IsADirectory, _) => HostError::NotReadable,
        (_, Some(number)) => HostError::Os(number),
        _ => HostError::NotReadable,
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    struct Tree(PathBuf);

    impl Tree {
        fn new(name: &str) -> Self {
            let root = std::env::temp_dir().join(format!("takt-confine-{name}-{}", std::process::id()));
            std::fs::create_dir_all(root.join("nc/sub")).unwrap();
            std::fs::write(root.join("secret"), "s").unwrap();
            std::fs::write(root.join("nc/a"), "a").unwrap();
            Self(root)
        }
        fn link(&self, name: &str, target: &str) -> &Self {
            symlink(target, self.0.join("nc").join(name)).unwrap();
            self
        }
        #[track_caller]
        fn check(&self, path: &str, expected: Result<&str, HostError>) -> &Self {
            let root = self.0.join("nc").canonicalize().unwrap();
            assert_eq!(resolve(&self.0.join("nc"), path), expected.map(|inside| root.join(inside)), "{path}");
            self
        }
    }
    impl Drop for Tree {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn names_that_leave_are_refused() {
        let tree = Tree::new("names");
        for path in ["", "../secret", "sub/../../secret", "/etc/passwd", "sub/..", "..", "C:\\x", "sub\\a", "./../secret"] {
            tree.check(path, Err(HostError::Outside));
        }
        tree.check("./a", Ok("a")).check("././a", Err(HostError::Outside));
        tree.check("a", Ok("a")).check("sub", Ok("sub")).check("none", Err(HostError::NotFound));
    }

    #[test]
    fn links_that_leave_are_refused_and_those_that_stay_are_followed() {
        let tree = Tree::new("links");
        tree.link("out", "../secret").link("far", "/etc/passwd").link("sub/up", "../a").link("sub/out", "../../secret");
        tree.link("folder", "..").link("chain", "out").link("round", "round").link("ok", "sub/up");
        for path in ["out", "far", "sub/out", "folder/secret", "folder", "chain"] {
            tree.check(path, Err(HostError::Outside));
        }
        tree.check("round", Err(HostError::NotReadable)).check("sub/up", Ok("a")).check("ok", Ok("a"));
    }

    #[test]
    fn a_new_name_stays_inside() {
        let tree = Tree::new("new");
        tree.link("dangling", "../new").link("folder", "..").link("inner", "sub");
        let root = tree.0.join("nc").canonicalize().unwrap();
        let new = |path: &str| resolve_new(&tree.0.join("nc"), path).map(|p| p.strip_prefix(&root).unwrap().to_path_buf());
        assert_eq!(new("fresh"), Ok(PathBuf::from("fresh")));
        assert_eq!(new("inner/fresh"), Ok(PathBuf::from("sub/fresh")));
        assert_eq!(new("a"), Ok(PathBuf::from("a")));
        for (path, error) in [
            ("dangling", HostError::Outside),
            ("folder/fresh", HostError::Outside),
            ("../fresh", HostError::Outside),
            ("/fresh", HostError::Outside),
            ("none/fresh", HostError::NotFound),
            ("a/fresh", HostError::NotFound),
        ] {
            assert_eq!(new(path), Err(error), "{path}");
        }
    }

    #[test]
    fn only_plain_files_are_opened() {
        let tree = Tree::new("kinds");
        assert!(open(&tree.0.join("nc/a")).is_ok());
        assert_eq!(open(&tree.0.join("nc/sub")).unwrap_err(), HostError::NotReadable);
        assert_eq!(open(Path::new("/dev/null")).unwrap_err(), HostError::NotReadable);
        tree.link("l", "a");
        assert!(open(&tree.0.join("nc/l")).is_err());
    }
}
