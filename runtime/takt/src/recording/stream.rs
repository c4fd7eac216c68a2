//! What happens, on its way from the thread that steps the engine to the one that writes.
//!
//! Items go into a block; a block that is full enough goes to the writer through a bounded queue, and an empty one comes back. All of them are there from
//! the start: recording allocates nothing. When the writer is so late that no empty block is left, the recording ends there, and says so; the machine does
//! not wait.

use super::codec::Encoder;
use super::header::Calls;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError};
use takt_abi::{CHUNK, Chunk, HostError, Time};
use takt_engine::{BusSize, Checkpoint, Command, Engine, Event, IoFault, ProcessImage, Recorder};

/// Bytes after which a block goes to the writer.
const FULL: usize = 48 << 10;
/// Bytes of the largest item: a whole answer of the host.
const ITEM: usize = CHUNK + 4096;
/// Bytes that a block has room for.
pub(super) const BLOCK: usize = FULL + ITEM;
/// Blocks there are.
pub(super) const BLOCKS: usize = 24;
/// Machine time after which a block goes to the writer though it is not full.
const PATIENCE: i64 = 1_000_000_000;

/// What goes to the writer.
#[derive(Debug)]
pub(super) enum Message {
    /// Items.
    Events(Vec<u8>),
    /// A state; what was sent before lies before it.
    Checkpoint(Box<Snapshot>),
    /// The application was stopped; the text is the fault as JSON.
    Fault(String),
    /// No block was left.
    Overflow(Time),
    /// The end; the text is JSON.
    End(String),
}

/// A state with all that decoding from there needs.
#[derive(Debug, Default)]
pub(super) struct Snapshot {
    pub engine: Checkpoint,
    pub calls: Calls,
    pub now: Time,
}

/// One side of the queue.
#[derive(Debug)]
pub struct Stream {
    encoder: Encoder,
    block: Vec<u8>,
    spare: Receiver<Vec<u8>>,
    snapshots: Receiver<Box<Snapshot>>,
    out: SyncSender<Message>,
    /// A state is sent after so much machine time.
    every: Option<i64>,
    marked: Option<Time>,
    sent: Time,
    now: Time,
    calls: Rc<RefCell<Calls>>,
    /// Nothing is recorded any more, until the next state.
    overflow: bool,
    /// When that happened, if the writer does not know.
    unsaid: Option<Time>,
    /// Not even then: a file must have no gap.
    gapless: bool,
    fault: bool,
}

impl Stream {
    pub(super) fn new(
        size: BusSize,
        spare: Receiver<Vec<u8>>,
        snapshots: Receiver<Box<Snapshot>>,
        out: SyncSender<Message>,
        calls: Rc<RefCell<Calls>>,
        every: Option<Time>,
        gapless: bool,
    ) -> Self {
        let block = Vec::with_capacity(BLOCK);
        Self {
            encoder: Encoder::new(size),
            block,
            spare,
            snapshots,
            out,
            every: every.map(|time| time.0),
            marked: None,
            sent: Time(0),
            now: Time(0),
            calls,
            overflow: false,
            unsaid: None,
            gapless,
            fault: false,
        }
    }

    /// Sends a state if one is due. Between steps.
    pub fn between(&mut self, engine: &Engine) {
        let due = match (self.marked, self.every) {
            (None, _) => true,
            // After a gap a core file starts anew at once; a file ends.
            (Some(_), _) if self.overflow => !self.gapless,
            (Some(marked), Some(every)) => self.now.0 - marked.0 >= every,
            (Some(_), None) => false,
        };
        if !due {
            return;
        }
        let Ok(mut snapshot) = self.snapshots.try_recv() else { return };
        engine.checkpoint_into(&mut snapshot.engine);
        (snapshot.calls, snapshot.now) = (*self.calls.borrow(), engine.now());
        self.flush();
        match self.out.try_send(Message::Checkpoint(snapshot)) {
            Ok(()) => {
                (self.marked, self.overflow) = (Some(self.now), false);
                self.encoder.mark(&mut self.block);
            }
            Err(_) => self.overflow = true,
        }
    }

    /// Whether the application was stopped and the writer has not been told.
    pub fn take_fault(&mut self, faulted: bool) -> bool {
        let new = faulted && !self.fault;
        self.fault = faulted;
        new
    }

    /// Tells the writer of a fault. The axes still brake: a writer that is too busy is not waited for.
    pub(super) fn faulted(&mut self, json: String) {
        self.flush();
        let _ = self.out.try_send(Message::Fault(json));
    }

    /// The end.
    pub(super) fn end(&mut self, json: String) {
        self.flush();
        if let Some(at) = self.unsaid {
            let _ = self.out.send(Message::Overflow(at));
        }
        let _ = self.out.send(Message::End(json));
    }

    fn flush(&mut self) {
        self.sent = self.now;
        if self.block.is_empty() {
            return;
        }
        let Ok(empty) = self.spare.try_recv() else { return self.overflow() };
        let full = std::mem::replace(&mut self.block, empty);
        match self.out.try_send(Message::Events(full)) {
            Ok(()) => {}
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => self.overflow(),
        }
    }

    fn overflow(&mut self) {
        if !self.overflow {
            self.overflow = true;
            if self.out.try_send(Message::Overflow(self.now)).is_err() {
                self.unsaid = Some(self.now);
            }
        }
        self.block.clear();
    }

    /// Writes an item.
    fn item(&mut self, write: impl FnOnce(&mut Encoder, &mut Vec<u8>)) {
        if self.overflow || self.marked.is_none() {
            return;
        }
        if self.block.len() >= FULL {
            self.flush();
        }
        if !self.overflow {
            write(&mut self.encoder, &mut self.block);
        }
    }

    /// The host answered a call of `take`.
    pub fn take(&mut self, call: u64, result: &Result<Chunk, HostError>) {
        self.item(|encoder, out| encoder.take(out, call, result));
    }

    /// The host refused a call of `submit`.
    pub fn refused(&mut self, call: u64, error: HostError) {
        self.item(|encoder, out| encoder.refused(out, call, error));
    }
}

/// What the engine tells goes to a stream.
#[derive(Debug)]
pub struct Ear(pub Rc<RefCell<Option<Stream>>>);

impl Ear {
    fn with(&mut self, act: impl FnOnce(&mut Stream)) {
        if let Some(stream) = self.0.borrow_mut().as_mut() {
            act(stream);
        }
    }
}

impl Recorder for Ear {
    fn step(&mut self, now: Time) {
        self.with(|stream| {
            stream.now = now;
            if now.0 - stream.sent.0 >= PATIENCE {
                stream.flush();
            }
            stream.item(|encoder, out| encoder.step(out, now));
        });
    }
    fn event(&mut self, event: &Event) {
        self.with(|stream| stream.item(|encoder, out| encoder.event(out, event)));
    }
    fn exchange(&mut self, result: Result<(), IoFault>, io: &ProcessImage) {
        self.with(|stream| stream.item(|encoder, out| encoder.exchange(out, result, io)));
    }
    fn command(&mut self, command: &Command) {
        self.with(|stream| stream.item(|encoder, out| encoder.command(out, command)));
    }
}
