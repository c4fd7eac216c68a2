//! The socket in the file system: made with its rights before anybody can reach it, and reachable however long the path is.

use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

/// Bytes of a path that the system takes for a socket.
const LONGEST: usize = 107;

/// Calls `work` with a path of the file that is short enough: where it is not, the folder is opened and named by its number.
fn with_short_path<T>(path: &Path, work: impl Fn(&Path) -> std::io::Result<T>) -> std::io::Result<T> {
    if path.as_os_str().len() <= LONGEST {
        return work(path);
    }
    let (folder, name) = (path.parent().unwrap_or(Path::new(".")), path.file_name().unwrap_or_default());
    let folder = fs::File::open(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })?;
    let number = std::os::fd::AsRawFd::as_raw_fd(&folder);
    work(&PathBuf::from(format!("/proc/self/fd/{number}")).join(name))
}

/// Connects to a socket.
pub(super) fn connect(path: &Path) -> std::io::Result<UnixStream> {
    with_short_path(path, |path| UnixStream::connect(path))
}

/// Listens at a path. The group may connect if it may write the folder; others may not.
pub(super) fn bind(path: &Path) -> Result<UnixListener, String> {
    make_way(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let group = fs::metadata(folder).map_err(|error| format!("its folder: {error}"))?.mode() & 0o020 != 0;
    // Nobody else can look into this folder, so nobody connects before the socket has its rights and its name.
    let private = folder.join(format!(".control-{}", std::process::id()));
    let _ = fs::remove_dir_all(&private);
    fs::DirBuilder::new().mode(0o700).create(&private).map_err(|error| format!("its folder cannot be written: {error}"))?;
    let made = bind_in(&private, path, if group { 0o660 } else { 0o600 });
    let _ = fs::remove_dir_all(&private);
    made.map_err(|error| error.to_string())
}

fn bind_in(private: &Path, path: &Path, mode: u32) -> std::io::Result<UnixListener> {
    let first = private.join("s");
    let listener = with_short_path(&first, |path| UnixListener::bind(path))?;
    fs::set_permissions(&first, fs::Permissions::from_mode(mode))?;
    listener.set_nonblocking(true)?;
    fs::rename(&first, path)?;
    Ok(listener)
}

/// A socket that nobody serves any more is in the way of nobody; anything else is.
fn make_way(path: &Path) -> Result<(), String> {
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error.to_string()),
        Ok(found) if !found.file_type().is_socket() => Err("there is a file of this name, which is no socket; name another path".into()),
        Ok(_) => match connect(path) {
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => Ok(()),
            Err(error) => Err(error.to_string()),
            Ok(_) => Err("another run serves it; stop that one first, or name another path".into()),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("takt-socket-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        path
    }

    #[test]
    fn the_rights_follow_the_folder() {
        let folder = folder("rights");
        for (of_folder, expected) in [(0o755, 0o600), (0o770, 0o660), (0o777, 0o660)] {
            fs::set_permissions(&folder, fs::Permissions::from_mode(of_folder)).unwrap();
            let path = folder.join(format!("s{of_folder}"));
            let _listener = bind(&path).unwrap();
            assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, expected, "{of_folder:o}");
            connect(&path).unwrap();
        }
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 3, "nothing else is left");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_long_path_is_served_and_reached() {
        let folder = folder("long");
        let deep = folder.join("x".repeat(90)).join("y".repeat(90));
        fs::create_dir_all(&deep).unwrap();
        let path = deep.join("control.sock");
        let listener = bind(&path).unwrap();
        connect(&path).unwrap();
        assert!(listener.accept().is_ok());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_stale_socket_makes_way_and_a_living_one_does_not() {
        let folder = folder("stale");
        let path = folder.join("s");
        let first = bind(&path).unwrap();
        assert!(bind(&path).unwrap_err().contains("another run serves it"));
        drop(first);
        let _second = bind(&path).unwrap();
        let file = folder.join("file");
        fs::write(&file, "x").unwrap();
        assert!(bind(&file).unwrap_err().contains("no socket"));
        assert_eq!(fs::read_to_string(&file).unwrap(), "x");
        fs::remove_dir_all(folder).unwrap();
    }
}
