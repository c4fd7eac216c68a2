//! The journal: what happened on a machine, and who did it. One JSON object per line in the state folder, written by a thread of its own.
//!
//! The thread that runs the scans posts [`Notice`]s into a ring that never waits ([`ScanPoster`]); everybody else posts [`Entry`]s ([`Poster`]). Both are
//! bounded: what does not fit is counted, and the count is written when there is room again. A disk that is full or slow never stops a machine.

mod entry;
mod file;
mod monitor;
pub mod read;

pub(crate) use entry::clean;
pub use entry::{Entry, Event, Notice};
pub use file::{JournalFile, NAME, generation};
pub use monitor::Monitor;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

/// Entries that may wait to be written.
const QUEUE: usize = 1024;
/// How often the ring of the scans is looked into.
const PERIOD: Duration = Duration::from_millis(20);

/// What is counted where there is no room.
#[derive(Debug, Default)]
struct Shared {
    lost: AtomicU64,
    failing: AtomicBool,
}

/// Posts entries from any thread but the one that runs the scans.
#[derive(Debug, Clone)]
pub struct Poster {
    sender: SyncSender<Entry>,
    shared: Arc<Shared>,
}

impl Poster {
    /// Posts an entry; its time is now.
    pub fn post(&self, entry: Entry) {
        if self.sender.try_send(entry.timed(SystemTime::now())).is_err() {
            self.shared.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Whether lines are being lost because they cannot be written.
    pub fn is_failing(&self) -> bool {
        self.shared.failing.load(Ordering::Relaxed)
    }
}

/// Posts notices from the thread that runs the scans: no lock, no wait, and nothing allocated.
#[derive(Debug)]
pub struct ScanPoster {
    ring: rtrb::Producer<(SystemTime, Notice)>,
    shared: Arc<Shared>,
}

impl ScanPoster {
    /// Posts a notice; its time is now.
    pub fn post(&mut self, notice: Notice) {
        if self.ring.push((SystemTime::now(), notice)).is_err() {
            self.shared.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The journal of a run. When it is dropped everything that was posted is written.
#[derive(Debug)]
pub struct Journal {
    poster: Option<Poster>,
    thread: Option<JoinHandle<()>>,
}

impl Journal {
    /// Opens the journal in a state folder, and starts its thread. `tasks` are the names behind the indices of notices.
    pub fn open(folder: &Path, tasks: Vec<String>) -> std::io::Result<(Self, ScanPoster)> {
        let file = JournalFile::open(folder)?;
        let (sender, receiver) = sync_channel(QUEUE);
        let (ring, notices) = rtrb::RingBuffer::new(QUEUE);
        let shared = Arc::new(Shared::default());
        let mut writer = Writer { file, notices, tasks, shared: shared.clone() };
        let thread = std::thread::Builder::new().name("takt-journal".into()).spawn(move || writer.run(&receiver))?;
        let poster = Poster { sender, shared: shared.clone() };
        Ok((Self { poster: Some(poster), thread: Some(thread) }, ScanPoster { ring, shared }))
    }

    /// For other threads.
    pub fn poster(&self) -> Option<Poster> {
        self.poster.clone()
    }

    /// Posts an entry.
    pub fn post(&self, entry: Entry) {
        if let Some(poster) = &self.poster {
            poster.post(entry);
        }
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        if let Some(poster) = self.poster.take() {
            // Waits for room: the run is over. The entry says that nothing follows.
            let _ = poster.sender.send(Entry::new(Event::End));
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Writer {
    file: JournalFile,
    notices: rtrb::Consumer<(SystemTime, Notice)>,
    tasks: Vec<String>,
    shared: Arc<Shared>,
}

impl Writer {
    fn run(&mut self, receiver: &Receiver<Entry>) {
        loop {
            match receiver.recv_timeout(PERIOD) {
                Ok(entry) if entry.event == Event::End => break,
                Ok(entry) => self.write(&entry),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.drain();
        }
        self.drain();
        while let Ok(entry) = receiver.try_recv() {
            self.write(&entry);
        }
        self.confess();
        self.file.sync();
    }

    fn drain(&mut self) {
        while let Ok((time, notice)) = self.notices.pop() {
            let entry = notice.entry(&self.tasks).timed(time);
            self.write(&entry);
        }
    }

    fn confess(&mut self) {
        let lost = self.shared.lost.load(Ordering::Relaxed);
        if lost > 0 && self.file.append(&Entry::lost(lost).timed(SystemTime::now())).is_ok() {
            self.shared.lost.fetch_sub(lost, Ordering::Relaxed);
        }
    }

    fn write(&mut self, entry: &Entry) {
        self.confess();
        let failed = self.file.append(entry).is_err();
        self.shared.failing.store(failed, Ordering::Relaxed);
        if failed {
            self.shared.lost.fetch_add(1, Ordering::Relaxed);
        } else if entry.event.is_grave() {
            self.file.sync();
        }
    }
}

#[cfg(test)]
mod tests;
