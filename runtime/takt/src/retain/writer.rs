//! The thread that writes. It takes snapshots out of the engine's queue; the scan never waits for it.

use super::layout::Description;
use super::pack;
use super::slot::{Loaded, Store};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use takt_engine::{RetainLayout, SnapshotReader};
use takt_ir::Program;

/// How often the thread looks for a snapshot.
const LOOK: Duration = Duration::from_millis(5);

/// A running thread.
#[derive(Debug)]
pub struct Writer {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Work>,
}

#[derive(Debug)]
struct Work {
    program: Arc<Program>,
    layout: RetainLayout,
    store: Store,
    /// What was written last.
    last: Option<Vec<u8>>,
    packed: Vec<u8>,
    failed: Option<std::io::Error>,
}

/// Seconds since 1970.
pub fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

impl Work {
    /// Writes what has changed since the last time.
    fn keep(&mut self, bytes: &[u8]) {
        pack(&self.program, &self.layout, bytes, &mut self.packed);
        if self.last.as_ref() == Some(&self.packed) {
            return;
        }
        match self.store.write(&self.packed, now()) {
            Ok(()) => {
                self.failed = None;
                self.last.get_or_insert_default().clone_from(&self.packed);
            }
            // The next snapshot tries again.
            Err(error) => self.failed = Some(error),
        }
    }

    fn run(mut self, mut reader: SnapshotReader, stop: &AtomicBool, tell: fn(&std::io::Error)) -> Self {
        let mut told = false;
        loop {
            let last = stop.load(Ordering::Acquire);
            if let Some(snapshot) = reader.newest() {
                self.keep(&snapshot.bytes);
                reader.give_back(snapshot);
                if let (Some(error), false) = (&self.failed, told) {
                    told = true;
                    tell(error);
                }
            }
            if last {
                return self;
            }
            std::thread::park_timeout(LOOK);
        }
    }
}

impl Writer {
    /// Starts the thread. `tell` is called in it, once, when a write fails; it goes on trying.
    pub fn start(
        folder: &Path,
        name: &str,
        program: Arc<Program>,
        loaded: &Loaded,
        reader: SnapshotReader,
        tell: fn(&std::io::Error),
    ) -> std::io::Result<Self> {
        let store = Store::new(folder, &Description::of(name, &program), loaded);
        let work = Work { layout: RetainLayout::new(&program), program, store, last: None, packed: Vec::new(), failed: None };
        let stop = Arc::new(AtomicBool::new(false));
        let asked = stop.clone();
        let thread = std::thread::Builder::new().name("retain".into()).spawn(move || work.run(reader, &asked, tell))?;
        Ok(Self { stop, thread })
    }

    /// Ends the thread and writes the last state, where there is a whole one. The number of the last generation.
    pub fn finish(self, state: Option<Vec<u8>>) -> std::io::Result<u64> {
        self.stop.store(true, Ordering::Release);
        self.thread.thread().unpark();
        let mut work = self.thread.join().map_err(|_| std::io::Error::other("the thread that writes retained values has ended"))?;
        if let Some(bytes) = state {
            work.keep(&bytes);
        }
        work.failed.map_or(Ok(work.store.number()), Err)
    }
}
