//! The thread that reads and writes files.

use super::{confine, list, write};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender};
use takt_abi::{CHUNK, Chunk, Folder, HostError, Request, Ticket};

/// Files kept open.
const OPEN: usize = 4;

/// A request under way.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) ticket: Ticket,
    pub(super) request: Request,
    pub(super) buffer: Vec<u8>,
}

/// A request that is over.
#[derive(Debug, Clone)]
pub(super) struct Done {
    pub(super) ticket: Ticket,
    pub(super) result: Result<Chunk, HostError>,
}

/// Serves until the other side hangs up.
pub(super) fn serve(root: &Path, jobs: &Receiver<Job>, done: &SyncSender<Done>) {
    let mut cache = Cache { open: Vec::with_capacity(OPEN) };
    while let Ok(Job { ticket, request, buffer }) = jobs.recv() {
        let result = match request {
            Request::Read { folder, path, offset } => read(root, &mut cache, folder, &path.to_text(), offset, buffer),
            Request::Next { path } => list::next(&root.join("data"), &path.to_text(), buffer),
            other => write::serve(&root.join("data"), other, &buffer).map(|file_size| Chunk { data: buffer, file_size }),
        };
        if done.send(Done { ticket, result }).is_err() {
            return;
        }
    }
}

/// The file at `path`, if it still is the one at that place; a changed file is opened anew.
struct Cache {
    open: Vec<(PathBuf, File)>,
}

impl Cache {
    fn file(&mut self, path: &Path) -> Result<&mut File, HostError> {
        if let Some(i) = self.open.iter().position(|(known, _)| known == path) {
            let entry = self.open.remove(i);
            if same(&entry.1, path) {
                self.open.push(entry);
                return Ok(&mut self.open.last_mut().expect("just pushed").1);
            }
        }
        let file = confine::open(path)?;
        if self.open.len() == OPEN {
            self.open.remove(0);
        }
        self.open.push((path.into(), file));
        Ok(&mut self.open.last_mut().expect("just pushed").1)
    }
}

#[cfg(unix)]
fn same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (Ok(open), Ok(now)) = (file.metadata(), std::fs::symlink_metadata(path)) else { return false };
    (open.dev(), open.ino()) == (now.dev(), now.ino())
}

#[cfg(not(unix))]
fn same(_: &File, _: &Path) -> bool {
    false
}

fn read(root: &Path, cache: &mut Cache, folder: Folder, path: &str, offset: u64, mut buffer: Vec<u8>) -> Result<Chunk, HostError> {
    let folder = root.join(match folder {
        Folder::Nc => "nc",
        Folder::Data => "data",
    });
    let path = confine::resolve(&folder, path)?;
    let file = cache.file(&path)?;
    let file_size = file.metadata().map_err(confine::error)?.len();
    file.seek(SeekFrom::Start(offset)).map_err(confine::error)?;
    buffer.resize(CHUNK, 0);
    let mut filled = 0;
    while filled < CHUNK {
        match file.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(confine::error(error)),
        }
    }
    buffer.truncate(filled);
    Ok(Chunk { data: buffer, file_size })
}
