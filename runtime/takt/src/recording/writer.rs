//! The thread that writes: blocks become chunks of a file, and the last minutes of them are kept for a core file.

use super::file::{Kind, MAGIC, packed};
use super::header::{Calls, Header};
use super::stream::{BLOCK, BLOCKS, Message, Snapshot, Stream};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use takt_abi::Time;
use takt_engine::{BusSize, Checkpoint};

/// Machine time between the states that a core file can start at.
const STRETCH: Time = Time(20_000_000_000);
/// Machine time that a core file reaches back at least, if that much was recorded.
const MINUTES: i64 = 120_000_000_000;
/// Bytes, packed, of what is kept for a core file; the newest stretch is always kept.
const KEPT: usize = 64 << 20;
/// Core files in a folder; of more the oldest go.
const CORES: usize = 20;

/// What is to be recorded.
#[derive(Debug, Clone)]
pub struct Plan {
    /// A file for the whole run.
    pub file: Option<PathBuf>,
    /// A folder for core files.
    pub cores: Option<PathBuf>,
    /// Which program on which machine.
    pub header: Header,
    /// The texts of the program, as JSON, for core files.
    pub sources: String,
}

/// What became of it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Summary {
    /// Bytes of the file.
    pub bytes: u64,
    /// Why the file is not whole.
    pub incomplete: Option<String>,
    /// Core files that were written.
    pub cores: Vec<PathBuf>,
    /// Core files that could not be written, and why.
    pub failed: Vec<String>,
}

/// A recording under way.
#[derive(Debug)]
pub struct Recording {
    stream: Rc<RefCell<Option<Stream>>>,
    thread: Option<JoinHandle<Summary>>,
}

impl Recording {
    /// Opens the file and starts the thread. What happens goes into `stream`.
    pub fn start(
        plan: Plan,
        size: BusSize,
        room: &Checkpoint,
        stream: Rc<RefCell<Option<Stream>>>,
        calls: Rc<RefCell<Calls>>,
    ) -> io::Result<Self> {
        let file = match &plan.file {
            Some(path) => Some(start_file(path, &plan.header)?),
            None => None,
        };
        let (out, incoming) = sync_channel(BLOCKS * 2);
        let (give_block, spare) = sync_channel(BLOCKS);
        let (give_snapshot, snapshots) = sync_channel(2);
        for _ in 0..BLOCKS {
            let _ = give_block.try_send(Vec::with_capacity(BLOCK));
        }
        for _ in 0..2 {
            let _ = give_snapshot.try_send(Box::new(Snapshot { engine: room_like(room), ..Snapshot::default() }));
        }
        let every = plan.cores.is_some().then_some(STRETCH);
        let gapless = plan.file.is_some();
        *stream.borrow_mut() = Some(Stream::new(size, spare, snapshots, out, calls, every, gapless));
        let cores =
            plan.cores.map(|folder| Ring { folder, header: plan.header, sources: plan.sources, stretches: VecDeque::new(), bytes: 0 });
        let writer =
            Writer { file, path: plan.file, ring: cores, summary: Summary::default(), blocks: give_block, snapshots: give_snapshot };
        let thread = std::thread::Builder::new().name("recorder".into()).spawn(move || writer.serve(&incoming))?;
        Ok(Self { stream, thread: Some(thread) })
    }

    /// Writes what is left and waits for it. `end` is JSON.
    pub fn finish(mut self, end: String) -> Summary {
        if let Some(mut stream) = self.stream.borrow_mut().take() {
            stream.end(end);
        }
        let joined = self.thread.take().map(JoinHandle::join);
        match joined {
            Some(Ok(summary)) => summary,
            _ => Summary { incomplete: Some("the recorder panicked (a defect of Takt; please report it)".into()), ..Summary::default() },
        }
    }

    /// Tells the writer of a fault, as JSON: a core file is written.
    pub fn faulted(&self, json: String) {
        if let Some(stream) = self.stream.borrow_mut().as_mut() {
            stream.faulted(json);
        }
    }
}

/// A checkpoint with as much room, and some more for the resources.
fn room_like(room: &Checkpoint) -> Checkpoint {
    let mut state = Vec::with_capacity(room.state().len() * 2 + (1 << 20));
    state.extend_from_slice(room.state());
    Checkpoint::from_parts(room.image().to_vec(), state)
}

fn start_file(path: &Path, header: &Header) -> io::Result<BufWriter<File>> {
    let mut file = BufWriter::new(File::create(path)?);
    file.write_all(&MAGIC)?;
    file.write_all(&packed(Kind::Header, &to_json(header)))?;
    Ok(file)
}

fn to_json(header: &Header) -> Vec<u8> {
    // Strings and maps with keys of text always are JSON.
    serde_json::to_vec(header).unwrap_or_default()
}

/// A state as the content of its chunk: calls of the host, time, length of the image, image, the rest.
pub(super) fn snapshot_bytes(snapshot: &Snapshot) -> Vec<u8> {
    let Snapshot { engine, calls, now } = snapshot;
    let mut out = Vec::with_capacity(engine.image().len() + engine.state().len() + 40);
    let words = [calls.takes, calls.submits, calls.accepted, now.0 as u64, engine.image().len() as u64];
    words.iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
    out.extend_from_slice(engine.image());
    out.extend_from_slice(engine.state());
    out
}

/// The state of a chunk; `None`: it is none.
pub(super) fn snapshot_of_bytes(bytes: &[u8]) -> Option<Snapshot> {
    let (head, rest) = bytes.split_first_chunk::<40>()?;
    let word = |i: usize| u64::from_le_bytes(std::array::from_fn(|n| head[i * 8 + n]));
    let (image, state) = rest.split_at_checked(usize::try_from(word(4)).ok()?)?;
    let calls = Calls { takes: word(0), submits: word(1), accepted: word(2) };
    Some(Snapshot { engine: Checkpoint::from_parts(image.to_vec(), state.to_vec()), calls, now: Time(word(3) as i64) })
}

/// A state and what followed it, as chunks.
#[derive(Debug)]
struct Stretch {
    now: Time,
    chunks: Vec<Vec<u8>>,
    bytes: usize,
}

/// The last minutes.
#[derive(Debug)]
struct Ring {
    folder: PathBuf,
    header: Header,
    sources: String,
    stretches: VecDeque<Stretch>,
    bytes: usize,
}

impl Ring {
    fn start(&mut self, now: Time, chunk: Vec<u8>) {
        self.bytes += chunk.len();
        self.stretches.push_back(Stretch { now, bytes: chunk.len(), chunks: vec![chunk] });
        while self.stretches.len() > 1 && (self.bytes > KEPT || now.0 - self.stretches[1].now.0 >= MINUTES) {
            self.bytes -= self.stretches.pop_front().map_or(0, |old| old.bytes);
        }
    }
    fn add(&mut self, chunk: &[u8]) {
        if let Some(last) = self.stretches.back_mut() {
            self.bytes += chunk.len();
            last.bytes += chunk.len();
            last.chunks.push(chunk.to_vec());
        }
        while self.stretches.len() > 1 && self.bytes > KEPT {
            self.bytes -= self.stretches.pop_front().map_or(0, |old| old.bytes);
        }
    }
    /// Nothing before the next state can be played.
    fn forget(&mut self) {
        self.stretches.clear();
        self.bytes = 0;
    }
    fn write(&self, fault: &str) -> io::Result<PathBuf> {
        fs::create_dir_all(&self.folder)?;
        let path = free_name(&self.folder);
        let part = path.with_extension("part");
        let mut file = BufWriter::new(File::create(&part)?);
        file.write_all(&MAGIC)?;
        let header = Header { kind: "core".into(), ..self.header.clone() };
        file.write_all(&packed(Kind::Header, &to_json(&header)))?;
        file.write_all(&packed(Kind::Sources, self.sources.as_bytes()))?;
        file.write_all(&packed(Kind::Fault, fault.as_bytes()))?;
        for chunk in self.stretches.iter().flat_map(|stretch| &stretch.chunks) {
            file.write_all(chunk)?;
        }
        file.write_all(&packed(Kind::End, b"{}"))?;
        file.into_inner()?.sync_all()?;
        fs::rename(&part, &path)?;
        keep_the_newest(&self.folder);
        Ok(path)
    }
}

/// A name that says when (UTC): `2026-11-21_21-46-17-123.core`, with a number behind it where there is one already.
fn free_name(folder: &Path) -> PathBuf {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let (seconds, thousandths) = (since.as_secs(), since.subsec_millis());
    let (days, rest) = ((seconds / 86_400) as i64, seconds % 86_400);
    let (year, month, day) = date(days);
    let stem = format!("{year:04}-{month:02}-{day:02}_{:02}-{:02}-{:02}-{thousandths:03}", rest / 3600, rest / 60 % 60, rest % 60);
    let name = |number: u32| if number == 0 { format!("{stem}.core") } else { format!("{stem}_{number:03}.core") };
    (0..1000).map(|number| folder.join(name(number))).find(|path| !path.exists()).unwrap_or_else(|| folder.join(name(999)))
}

/// Year, month and day of a day since 1970-01-01 (Hinnant's civil_from_days).
fn date(days: i64) -> (i64, i64, i64) {
    let z = days + 719_468;
    let era = z.div_euclid(146_097);
    let doe = z.rem_euclid(146_097);
    let yoe = (doe - doe / 1460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let month = if mp < 10 { mp + 3 } else { mp - 9 };
    (yoe + era * 400 + i64::from(month <= 2), month, doy - (153 * mp + 2) / 5 + 1)
}

/// Deletes all core files but the newest.
fn keep_the_newest(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut cores: Vec<_> =
        entries.flatten().map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|e| e == "core")).collect();
    cores.sort();
    let old = cores.len().saturating_sub(CORES);
    // One that cannot be deleted is tried again with the next.
    cores[..old].iter().for_each(|path| drop(fs::remove_file(path)));
}

/// The thread's side.
struct Writer {
    file: Option<BufWriter<File>>,
    path: Option<PathBuf>,
    ring: Option<Ring>,
    summary: Summary,
    blocks: SyncSender<Vec<u8>>,
    snapshots: SyncSender<Box<Snapshot>>,
}

impl Writer {
    fn serve(mut self, incoming: &Receiver<Message>) -> Summary {
        let mut started = false;
        while let Ok(message) = incoming.recv() {
            match message {
                Message::Events(mut block) => {
                    let chunk = packed(Kind::Events, &block);
                    block.clear();
                    let _ = self.blocks.try_send(block);
                    self.append(&chunk);
                    if let Some(ring) = &mut self.ring {
                        ring.add(&chunk);
                    }
                }
                Message::Checkpoint(snapshot) => {
                    let chunk = packed(Kind::Checkpoint, &snapshot_bytes(&snapshot));
                    let now = snapshot.now;
                    let _ = self.snapshots.try_send(snapshot);
                    if !started {
                        self.append(&chunk);
                        started = true;
                    }
                    if let Some(ring) = &mut self.ring {
                        ring.start(now, chunk);
                    }
                }
                Message::Overflow(now) => {
                    self.incomplete(format!("the disk was too slow: it ends at {:.3} s", now.seconds()));
                    if let Some(ring) = &mut self.ring {
                        ring.forget();
                    }
                }
                Message::Fault(json) => self.core(&json),
                Message::End(json) => {
                    if self.summary.incomplete.is_none() {
                        self.append(&packed(Kind::End, json.as_bytes()));
                    }
                    break;
                }
            }
        }
        self.close();
        self.summary
    }

    fn incomplete(&mut self, why: String) {
        if self.file.is_some() {
            self.summary.incomplete.get_or_insert(why);
        }
    }

    fn append(&mut self, chunk: &[u8]) {
        let Some(file) = &mut self.file else { return };
        if self.summary.incomplete.is_some() {
            return;
        }
        // What is written can be played after a crash.
        match file.write_all(chunk).and_then(|()| file.flush()) {
            Ok(()) => self.summary.bytes += chunk.len() as u64,
            Err(error) => self.incomplete(format!("it cannot be written: {error}")),
        }
    }

    fn core(&mut self, json: &str) {
        let Some(ring) = &self.ring else { return };
        match ring.write(json) {
            Ok(path) => self.summary.cores.push(path),
            Err(error) => self.summary.failed.push(format!("{}: {error}", ring.folder.display())),
        }
    }

    fn close(&mut self) {
        let Some(file) = self.file.take() else { return };
        let closed = file.into_inner().map_err(io::IntoInnerError::into_error).and_then(|file| file.sync_all());
        if let (Err(error), Some(path)) = (closed, &self.path) {
            self.summary.incomplete.get_or_insert(format!("{} cannot be written: {error}", path.display()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_dates() {
        assert_eq!([0, 59, 11_016, 20_778].map(date), [(1970, 1, 1), (1970, 3, 1), (2000, 2, 29), (2026, 11, 21)]);
    }
}
