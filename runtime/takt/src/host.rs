//! Files for programs: [`takt_abi::Host`] over a service thread, so that no scan waits for a disk.
//!
//! Requests and completions go through bounded channels and buffers come back with the data, so that a scan allocates nothing. A path is confined to
//! `nc/` or `data/` of the project ([`confine`]); only files in `data/` are written.

pub mod confine;
mod list;
mod service;
mod write;

use service::{Done, Job};
use std::any::Any;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use takt_abi::{Chunk, Host, HostError, Request, Ticket};

/// Requests under way at the most.
pub const UNDER_WAY: usize = 16;

/// Files of a project.
#[derive(Debug)]
pub struct Files {
    jobs: Option<SyncSender<Job>>,
    done: Receiver<Done>,
    latched: Vec<Done>,
    /// Completions that a checkpoint waited for; seen at the next latch.
    arrived: Vec<Done>,
    under_way: usize,
    next: u64,
    thread: Option<JoinHandle<()>>,
}

/// Requests and completions of a checkpoint.
struct Saved {
    latched: Vec<Done>,
    arrived: Vec<Done>,
    next: u64,
}

/// Starts the service for the project in `root`. The folders `nc` and `data` need not exist.
pub fn open(root: PathBuf) -> std::io::Result<Files> {
    let (jobs, incoming) = sync_channel(UNDER_WAY);
    let (outgoing, done) = sync_channel(UNDER_WAY);
    let thread = std::thread::Builder::new().name("files".into()).spawn(move || service::serve(&root, &incoming, &outgoing))?;
    Ok(Files {
        jobs: Some(jobs),
        done,
        latched: Vec::with_capacity(UNDER_WAY),
        arrived: Vec::new(),
        under_way: 0,
        next: 1,
        thread: Some(thread),
    })
}

impl Host for Files {
    fn submit(&mut self, request: Request, buffer: &mut Vec<u8>) -> Result<Ticket, HostError> {
        if self.under_way + self.latched.len() + self.arrived.len() >= UNDER_WAY {
            return Err(HostError::Busy);
        }
        let ticket = Ticket(self.next);
        let jobs = self.jobs.as_ref().ok_or(HostError::Absent)?;
        jobs.try_send(Job { ticket, request, buffer: std::mem::take(buffer) }).map_err(|error| {
            let (job, error) = match error {
                TrySendError::Full(job) => (job, HostError::Busy),
                TrySendError::Disconnected(job) => (job, HostError::Absent),
            };
            *buffer = job.buffer;
            error
        })?;
        self.next += 1;
        self.under_way += 1;
        Ok(ticket)
    }

    fn latch(&mut self, wait: bool) {
        self.latched.append(&mut self.arrived);
        while self.under_way > 0 {
            let done = if wait { self.done.recv().ok() } else { self.done.try_recv().ok() };
            let Some(done) = done else { break };
            self.latched.push(done);
            self.under_way -= 1;
        }
    }

    fn take(&mut self, ticket: Ticket) -> Option<Result<Chunk, HostError>> {
        let i = self.latched.iter().position(|done| done.ticket == ticket)?;
        Some(self.latched.swap_remove(i).result)
    }

    fn save(&mut self) -> Option<Box<dyn Any + Send>> {
        while self.under_way > 0 {
            self.arrived.push(self.done.recv().ok()?);
            self.under_way -= 1;
        }
        Some(Box::new(Saved { latched: self.latched.clone(), arrived: self.arrived.clone(), next: self.next }))
    }

    fn restore(&mut self, saved: &dyn Any) -> bool {
        let Some(saved) = saved.downcast_ref::<Saved>() else { return false };
        // What was asked for since is answered, and forgotten.
        self.latch(true);
        self.latched.clone_from(&saved.latched);
        self.arrived.clone_from(&saved.arrived);
        self.next = saved.next;
        true
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        self.jobs = None;
        self.latch(true);
        if let Some(thread) = self.thread.take() {
            // A panic of the service has been printed by its thread; there is nothing left to close.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_abi::{CHUNK, Folder, Str};

    fn read(files: &mut Files, path: &str, offset: u64) -> Result<Chunk, HostError> {
        let ticket = files.submit(Request::Read { folder: Folder::Nc, path: Str::new(path), offset }, &mut Vec::new())?;
        assert!(files.take(ticket).is_none(), "nothing is visible before the next scan");
        files.latch(true);
        files.take(ticket).expect("latched")
    }

    fn project(name: &str) -> PathBuf {
        let root = std::env::temp_dir().join(format!("takt-host-{name}-{}", std::process::id()));
        std::fs::create_dir_all(root.join("nc/sub")).unwrap();
        root
    }

    #[test]
    fn reads_in_chunks_and_says_the_size() {
        let root = project("chunks");
        std::fs::write(root.join("nc/a.cnc"), vec![b'x'; CHUNK + 10]).unwrap();
        let mut files = open(root.clone()).unwrap();
        let first = read(&mut files, "a.cnc", 0).unwrap();
        assert_eq!((first.data.len(), first.file_size), (CHUNK, CHUNK as u64 + 10));
        assert_eq!(read(&mut files, "a.cnc", CHUNK as u64).unwrap().data.len(), 10);
        assert_eq!(read(&mut files, "a.cnc", 1 << 40).unwrap().data.len(), 0);
        drop(files);
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn a_changed_file_is_read_anew() {
        let root = project("changed");
        let mut files = open(root.clone()).unwrap();
        for text in ["G0 X1", "G0 X2 Y3"] {
            std::fs::write(root.join("nc/sub/a.cnc"), text).unwrap();
            assert_eq!(read(&mut files, "sub/a.cnc", 0).unwrap().data, text.as_bytes());
            std::fs::remove_file(root.join("nc/sub/a.cnc")).unwrap();
            assert_eq!(read(&mut files, "sub/a.cnc", 0), Err(HostError::NotFound));
        }
        drop(files);
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn a_folder_is_not_readable_and_a_missing_file_not_found() {
        let root = project("kinds");
        let mut files = open(root.clone()).unwrap();
        assert_eq!(read(&mut files, "sub", 0), Err(HostError::NotReadable));
        assert_eq!(read(&mut files, "none", 0), Err(HostError::NotFound));
        assert_eq!(read(&mut files, "../takt.toml", 0), Err(HostError::Outside));
        drop(files);
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn too_many_requests_are_busy_and_none_is_lost() {
        let root = project("busy");
        std::fs::write(root.join("nc/a"), "1").unwrap();
        let mut files = open(root.clone()).unwrap();
        let request = Request::Read { folder: Folder::Nc, path: Str::new("a"), offset: 0 };
        let tickets: Vec<_> = (0..UNDER_WAY).map(|_| files.submit(request.clone(), &mut Vec::new()).unwrap()).collect();
        let mut refused = vec![1, 2];
        assert_eq!(files.submit(request, &mut refused), Err(HostError::Busy));
        assert_eq!(refused, [1, 2], "what is not accepted is not taken");
        files.latch(true);
        assert!(tickets.into_iter().all(|ticket| files.take(ticket).is_some_and(|result| result.is_ok())));
        drop(files);
        std::fs::remove_dir_all(root).unwrap();
    }
}
