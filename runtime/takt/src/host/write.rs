//! Writing: everything that changes the folder `data` of a project.

use super::confine;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use takt_abi::{HostError, Request};

/// Does what a request asks, in the folder `data`; the size of the file afterwards.
pub(super) fn serve(data: &Path, request: Request, bytes: &[u8]) -> Result<u64, HostError> {
    match request {
        Request::Read { .. } | Request::Next { .. } => Err(HostError::NotReadable),
        Request::Write { path, offset } => write(data, &path.to_text(), offset, bytes),
        Request::Create { path, keep } => create(data, &path.to_text(), keep),
        Request::CreateFolder { path, parents } => create_folder(data, &path.to_text(), parents),
        Request::Size { path } => size(&confine::open(&confine::resolve(data, &path.to_text())?)?),
        Request::Sync { path } => {
            let file = existing(data, &path.to_text())?;
            file.sync_all().map_err(refused)?;
            size(&file)
        }
        Request::Delete { path } => {
            let place = confine::resolve(data, &path.to_text())?;
            confine::open(&place)?;
            std::fs::remove_file(place).map_err(refused).map(|()| 0)
        }
        Request::Rename { path } => rename(data, &path.to_text(), &String::from_utf8_lossy(bytes)),
    }
}

fn existing(data: &Path, path: &str) -> Result<File, HostError> {
    confine::open_as(&confine::resolve(data, path)?, File::options().write(true)).map_err(not_writable)
}

fn write(data: &Path, path: &str, offset: Option<u64>, bytes: &[u8]) -> Result<u64, HostError> {
    let mut file = existing(data, path)?;
    file.seek(offset.map_or(SeekFrom::End(0), SeekFrom::Start)).map_err(refused)?;
    file.write_all(bytes).map_err(refused)?;
    size(&file)
}

/// Makes `data` itself, before anything is put into it.
fn prepare(data: &Path) -> Result<(), HostError> {
    if data.exists() { Ok(()) } else { std::fs::create_dir(data).map_err(refused) }
}

fn create_folder(data: &Path, path: &str, parents: bool) -> Result<u64, HostError> {
    prepare(data)?;
    if parents {
        for (end, _) in path.match_indices('/') {
            let folder = confine::resolve_new(data, &path[..end])?;
            if !folder.exists() {
                std::fs::create_dir(folder).map_err(refused)?;
            }
        }
    }
    let folder = confine::resolve_new(data, path)?;
    if folder.exists() {
        return Err(HostError::Exists);
    }
    std::fs::create_dir(folder).map_err(refused).map(|()| 0)
}

fn create(data: &Path, path: &str, keep: bool) -> Result<u64, HostError> {
    prepare(data)?;
    let place = confine::resolve_new(data, path)?;
    let file = confine::open_as(&place, File::options().write(true).create(true)).map_err(not_writable)?;
    if !keep {
        file.set_len(0).map_err(refused)?;
    }
    size(&file)
}

fn rename(data: &Path, path: &str, to: &str) -> Result<u64, HostError> {
    let from = confine::resolve(data, path)?;
    let file = confine::open(&from)?;
    let to = confine::resolve_new(data, to)?;
    if to.exists() {
        return Err(HostError::Exists);
    }
    std::fs::rename(from, to).map_err(refused)?;
    size(&file)
}

fn size(file: &File) -> Result<u64, HostError> {
    Ok(file.metadata().map_err(confine::error)?.len())
}

/// The error of something that was to be changed.
fn refused(error: std::io::Error) -> HostError {
    not_writable(confine::error(error))
}

fn not_writable(error: HostError) -> HostError {
    if error == HostError::NotReadable { HostError::NotWritable } else { error }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_abi::Str;

    struct Folder(std::path::PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let root = std::env::temp_dir().join(format!("takt-write-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&root).unwrap();
            Self(root)
        }
        fn ask(&self, request: Request, bytes: &[u8]) -> Result<u64, HostError> {
            serve(&self.0.join("data"), request, bytes)
        }
        fn text(&self, name: &str) -> String {
            std::fs::read_to_string(self.0.join("data").join(name)).unwrap()
        }
    }
    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_file_is_made_written_appended_and_overwritten() {
        let folder = Folder::new("made");
        let path = Str::new("log.txt");
        assert_eq!(folder.ask(Request::Write { path, offset: None }, b"x"), Err(HostError::NotFound));
        assert_eq!(folder.ask(Request::Create { path, keep: false }, b""), Ok(0));
        assert_eq!(folder.ask(Request::Write { path, offset: Some(0) }, b"hello"), Ok(5));
        assert_eq!(folder.ask(Request::Write { path, offset: None }, b" world"), Ok(11));
        assert_eq!(folder.ask(Request::Write { path, offset: Some(1) }, b"a"), Ok(11));
        assert_eq!(folder.text("log.txt"), "hallo world");
        assert_eq!(folder.ask(Request::Create { path, keep: true }, b""), Ok(11));
        assert_eq!(folder.ask(Request::Sync { path }, b""), Ok(11));
        assert_eq!(folder.ask(Request::Create { path, keep: false }, b""), Ok(0));
        assert_eq!(folder.ask(Request::Size { path }, b""), Ok(0));
    }

    #[test]
    fn a_file_is_renamed_and_deleted_but_never_over_another() {
        let folder = Folder::new("renamed");
        let [a, b, c] = ["a", "b", "c"].map(Str::new);
        for path in [a, b] {
            folder.ask(Request::Create { path, keep: false }, b"").unwrap();
        }
        assert_eq!(folder.ask(Request::Rename { path: a }, b"b"), Err(HostError::Exists));
        assert_eq!(folder.ask(Request::Rename { path: a }, b"c"), Ok(0));
        assert_eq!(folder.ask(Request::Delete { path: a }, b""), Err(HostError::NotFound));
        assert_eq!(folder.ask(Request::Delete { path: c }, b""), Ok(0));
        assert_eq!(folder.ask(Request::Size { path: c }, b""), Err(HostError::NotFound));
    }

    #[test]
    fn folders_are_made_inside_and_only_once() {
        let folder = Folder::new("folders");
        let make = |name: &str, parents| folder.ask(Request::CreateFolder { path: Str::new(name), parents }, b"");
        assert_eq!(make("a/b", false), Err(HostError::NotFound));
        assert_eq!(make("a/b/c", true), Ok(0));
        assert_eq!(make("a/b", false), Err(HostError::Exists));
        assert_eq!(make("a/b/d", false), Ok(0));
        assert_eq!(folder.ask(Request::Create { path: Str::new("a/b/c/log"), keep: false }, b""), Ok(0));
        assert_eq!(make("a/b/c/log/x", true), Err(HostError::NotFound));
        for name in ["../x", "a/../../x", "/x", "a//b", ""] {
            for parents in [false, true] {
                assert!(matches!(make(name, parents), Err(HostError::Outside | HostError::Exists)), "{name}");
            }
        }
        assert!(!folder.0.join("x").exists());
    }

    #[test]
    fn nothing_outside_of_the_folder_is_written() {
        let folder = Folder::new("outside");
        std::fs::create_dir_all(folder.0.join("data/sub")).unwrap();
        std::fs::write(folder.0.join("secret"), "s").unwrap();
        std::fs::write(folder.0.join("data/own"), "o").unwrap();
        for name in ["../secret", "/x", "sub/../../secret", "", "a\\b"] {
            let path = Str::new(name);
            assert_eq!(folder.ask(Request::Create { path, keep: false }, b""), Err(HostError::Outside), "{name}");
            assert_eq!(folder.ask(Request::Write { path, offset: None }, b"x"), Err(HostError::Outside), "{name}");
            assert_eq!(folder.ask(Request::Delete { path }, b""), Err(HostError::Outside), "{name}");
            assert_eq!(folder.ask(Request::Rename { path: Str::new("own") }, name.as_bytes()), Err(HostError::Outside), "{name}");
        }
        assert_eq!(folder.ask(Request::Create { path: Str::new("sub"), keep: false }, b""), Err(HostError::NotWritable));
        assert_eq!(std::fs::read_to_string(folder.0.join("secret")).unwrap(), "s");
    }

    #[cfg(unix)]
    #[test]
    fn no_link_is_followed_out_of_the_folder() {
        use std::os::unix::fs::symlink;
        let folder = Folder::new("links");
        std::fs::create_dir_all(folder.0.join("data")).unwrap();
        std::fs::write(folder.0.join("secret"), "s").unwrap();
        symlink("../secret", folder.0.join("data/out")).unwrap();
        symlink("../fresh", folder.0.join("data/dangling")).unwrap();
        for name in ["out", "dangling"] {
            assert_eq!(folder.ask(Request::Create { path: Str::new(name), keep: false }, b""), Err(HostError::Outside), "{name}");
        }
        assert_eq!(std::fs::read_to_string(folder.0.join("secret")).unwrap(), "s");
        assert!(!folder.0.join("fresh").exists());
    }
}
