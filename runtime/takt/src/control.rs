//! The control socket: status, reading, writing, forcing and the rest, for tools on the same computer. docs/control.md is the protocol.
//!
//! Three parties: clients (processes that connect to the Unix socket), the *server* (a thread of this process that talks JSON with all of them, knows names
//! and keeps the journal), and the *port* (what the thread that runs the scans has of it). Server and port exchange [`job::Job`]s through two rings: the
//! server allocates them with all the room that an answer needs, the port fills them between scans, the server frees them. So the scans see no lock, no
//! allocation, no name and no file, whatever clients do.

#[cfg(unix)]
mod answer;
#[cfg(unix)]
pub mod connect;
#[cfg(unix)]
mod handle;
#[cfg(unix)]
mod hold;
pub mod job;
mod peer;
mod port;
#[cfg(unix)]
mod request;
#[cfg(unix)]
mod server;
#[cfg(unix)]
mod session;
#[cfg(unix)]
mod socket;

pub use port::{Mode, Port};

use crate::journal::{Entry, Event, Poster};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use takt_engine::StopHandle;
use takt_ir::Program;

/// Version of the protocol.
pub const VERSION: u32 = 1;
/// Name of the socket in the state folder.
pub const NAME: &str = "control.sock";

/// Bounds that a client meets; they are told in the answer to `hello`.
pub mod limits {
    /// Clients at the same time.
    pub const CLIENTS: usize = 32;
    /// Bytes of a request.
    pub const LINE: usize = 256 << 10;
    /// Bytes of an answer.
    pub const ANSWER: usize = 4 << 20;
    /// Bytes that may wait for a client that does not read before it is cut off.
    pub const WAITING: usize = 8 << 20;
    /// Requests of a client that may be under way.
    pub const REQUESTS: usize = 64;
    /// Variables of a request.
    pub const VARIABLES: usize = 4096;
    /// Bytes of the variables of a request.
    pub const BYTES: usize = 64 << 10;
    /// Subscriptions of a client.
    pub const SUBSCRIPTIONS: usize = 16;
    /// Subscriptions to every scan, of all clients.
    pub const SAMPLERS: usize = 8;
    /// Milliseconds between two values of a subscription, and of a lease.
    pub const PERIOD_MS: std::ops::RangeInclusive<u64> = 10..=3_600_000;
    /// Characters of a name or a reason.
    pub const NAME: usize = 200;
    /// What variables may be held on a lease by all clients.
    pub const HOLDS: usize = 1024;
}

/// What the server tells of the machine.
#[derive(Debug, Clone)]
pub struct About {
    /// Name of the project.
    pub project: String,
    /// Whether machine time is the wall clock's.
    pub real_time: bool,
    /// The program.
    pub program: Arc<Program>,
}

/// Why there is no socket.
#[derive(Debug)]
pub struct ControlError {
    /// Its path.
    pub path: PathBuf,
    /// Why, and what to do.
    pub message: String,
}

impl std::fmt::Display for ControlError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the control socket {}: {}", self.path.display(), self.message)
    }
}
impl std::error::Error for ControlError {}

/// The server; the socket goes when it is dropped.
#[derive(Debug)]
pub struct Control {
    path: PathBuf,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Control {
    /// Opens the socket and starts the server. When the server panics, which is a defect, the program is stopped as by a fault.
    #[cfg(unix)]
    pub fn open(path: PathBuf, about: About, journal: Option<Poster>, stop: StopHandle) -> Result<(Self, Port), ControlError> {
        let listener = socket::bind(&path).map_err(|message| ControlError { path: path.clone(), message })?;
        let (port, line) = port::pair(about.program.tasks.len());
        let end = Arc::new(AtomicBool::new(false));
        let defect = journal.clone();
        let mut server = server::Server::new(listener, about, line, journal, end.clone());
        let work = move || {
            let served = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| server.run()));
            if served.is_err() {
                stop.stop();
                if let Some(journal) = defect {
                    journal.post(Entry::new(Event::Fault).message("internal defect of Takt in the control server; please report it"));
                }
            }
        };
        let thread = std::thread::Builder::new().name("takt-control".into()).spawn(work);
        let thread = thread.map_err(|error| ControlError { path: path.clone(), message: error.to_string() })?;
        Ok((Self { path, end, thread: Some(thread) }, port))
    }

    /// Other systems have none.
    #[cfg(not(unix))]
    pub fn open(path: PathBuf, _: About, _: Option<Poster>, _: StopHandle) -> Result<(Self, Port), ControlError> {
        Err(ControlError { path, message: "this system has no Unix sockets".into() })
    }

    /// The path of the socket.
    pub fn path(&self) -> &std::path::Path {
        &self.path
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let _ = std::fs::remove_file(&self.path);
    }
}
