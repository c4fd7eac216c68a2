//! Retained variables: snapshots go out at the end of a step, values come in at the start.
//!
//! A snapshot is taken where no task is in the middle of a scan and the bus task has run, so that it is one state of the program. Its buffer goes through a
//! bounded queue to whoever keeps it and comes back through another one; there are three, so that one can be filled while one waits and one is being
//! written. If all are with the keeper, the next step tries again.

use rtrb::{Consumer, Producer, RingBuffer};
use takt_abi::Time;
use takt_ir::retain::{Span, restored};
use takt_ir::{Program, RetainKind};

/// Buffers of snapshots.
const BUFFERS: usize = 3;
/// Bytes between two retained variables that are copied along rather than left out.
const GAP: u32 = 64;

/// What a restart keeps, as in CODESYS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reset {
    /// RETAIN and PERSISTENT variables keep their values.
    Warm,
    /// PERSISTENT variables do.
    Cold,
    /// None does.
    Origin,
}

impl Reset {
    /// Whether a variable keeps its value.
    pub fn keeps(self, kind: RetainKind) -> bool {
        match self {
            Self::Warm => true,
            Self::Cold => kind == RetainKind::Persistent,
            Self::Origin => false,
        }
    }
}

/// Values that are put back before a program starts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Restore {
    /// What kind of start it is; `Origin` puts nothing back.
    pub kind: Reset,
    /// Places in the image, each part of a retained variable, and their bytes in [`Restore::data`], one behind the other.
    pub parts: Vec<Span>,
    /// The bytes.
    pub data: Vec<u8>,
    /// All of what this kind of start keeps has a value here. Where it is not so, what is missing is initialised first.
    pub complete: bool,
}

impl Restore {
    /// Nothing yet.
    pub fn new(kind: Reset) -> Self {
        Self { kind, parts: Vec::new(), data: Vec::new(), complete: true }
    }
    /// One more part; as many bytes as it is long.
    pub fn push(&mut self, span: Span, bytes: &[u8]) {
        self.parts.push(span);
        self.data.extend_from_slice(bytes);
    }
    /// The values of an image.
    pub(crate) fn of_image(program: &Program, kind: Reset, image: &[u8]) -> Self {
        let mut restore = Self::new(kind);
        for retained in program.retained.iter().filter(|r| kind.keeps(r.kind)) {
            restored(program, retained.ty, retained.offset, &mut |span| {
                let start = span.offset as usize;
                if let Some(bytes) = image.get(start..start + span.len as usize) {
                    restore.push(span, bytes);
                }
            });
        }
        restore
    }
    /// Puts the values into an image.
    pub(crate) fn apply(&self, image: &mut [u8]) {
        let mut at = 0;
        for span in &self.parts {
            let start = span.offset as usize;
            let bytes = self.data.get(at..at + span.len as usize);
            if let (Some(target), Some(bytes)) = (image.get_mut(start..start + span.len as usize), bytes) {
                crate::force::put(target, bytes, span.mask);
            }
            at += span.len as usize;
        }
    }
    /// The number of the first part that is not within a retained variable, or whose bytes are missing.
    pub fn defect(&self, program: &Program) -> Option<usize> {
        let mut places: Vec<(u64, u64)> =
            program.retained.iter().map(|r| (r.offset.into(), u64::from(r.offset) + u64::from(program.types.size(r.ty)))).collect();
        places.sort_unstable();
        let mut reach = Vec::with_capacity(places.len());
        let mut furthest = 0;
        for (start, end) in &places {
            furthest = furthest.max(*end);
            reach.push((*start, furthest));
        }
        let inside = |span: &Span| {
            let behind = reach.partition_point(|(start, _)| *start <= u64::from(span.offset));
            let end = u64::from(span.offset) + u64::from(span.len);
            end <= program.image_size.into() && behind.checked_sub(1).is_some_and(|i| end <= reach[i].1)
        };
        let total: u64 = self.parts.iter().map(|s| u64::from(s.len)).sum();
        let wrong = self.parts.iter().position(|span| !inside(span));
        wrong.or((total != self.data.len() as u64).then_some(self.parts.len()))
    }
}

/// What a snapshot copies: stretches of the image, one behind the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RetainLayout {
    /// Offset into the image, offset into the snapshot, bytes.
    copies: Vec<(u32, u32, u32)>,
    /// Where each of [`Program::retained`] begins in the snapshot.
    at: Vec<u32>,
    len: u32,
}

impl RetainLayout {
    /// The layout of a program's snapshots.
    pub fn new(program: &Program) -> Self {
        let range = |i: usize| {
            let r = &program.retained[i];
            (r.offset, r.offset.saturating_add(program.types.size(r.ty)))
        };
        let mut order: Vec<usize> = (0..program.retained.len()).collect();
        order.sort_by_key(|i| range(*i));
        let mut copies: Vec<(u32, u32, u32)> = Vec::new();
        let (mut at, mut len) = (vec![0; order.len()], 0u32);
        for i in order {
            let (start, end) = range(i);
            match copies.last_mut() {
                Some((first, _, bytes)) if start <= first.saturating_add(*bytes).saturating_add(GAP) => {
                    let longer = (end - *first).max(*bytes);
                    len += longer - *bytes;
                    *bytes = longer;
                }
                _ => {
                    copies.push((start, len, end - start));
                    len += end - start;
                }
            }
            if let Some((first, place, _)) = copies.last() {
                at[i] = place + (start - first);
            }
        }
        Self { copies, at, len }
    }
    /// Bytes of a snapshot.
    pub fn len(&self) -> usize {
        self.len as usize
    }
    /// Whether the program retains nothing.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
    /// Where the variable of that number in [`Program::retained`] begins in a snapshot.
    pub fn place(&self, number: usize) -> usize {
        self.at.get(number).map_or(0, |at| *at as usize)
    }
    /// Copies out of an image.
    pub fn copy(&self, image: &[u8], bytes: &mut [u8]) {
        for (from, to, len) in &self.copies {
            let (from, to, len) = (*from as usize, *to as usize, *len as usize);
            bytes[to..to + len].copy_from_slice(&image[from..from + len]);
        }
    }
}

/// The retained variables as they were at one moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Snapshot {
    /// Machine time of the step it was taken behind.
    pub time: Time,
    /// How many were taken before it.
    pub number: u64,
    /// Bytes; see [`RetainLayout`].
    pub bytes: Vec<u8>,
}

/// Takes snapshots out; for one other thread.
#[derive(Debug)]
pub struct SnapshotReader {
    full: Consumer<Box<Snapshot>>,
    empty: Producer<Box<Snapshot>>,
}

impl SnapshotReader {
    /// The newest one that was taken since the last call; hand it back when it is no longer needed.
    pub fn newest(&mut self) -> Option<Box<Snapshot>> {
        let mut newest = self.full.pop().ok()?;
        while let Ok(newer) = self.full.pop() {
            self.give_back(std::mem::replace(&mut newest, newer));
        }
        Some(newest)
    }
    /// Lets its buffer be filled again.
    pub fn give_back(&mut self, snapshot: Box<Snapshot>) {
        // There is room for all buffers; one that is not the queue's is dropped here.
        let _ = self.empty.push(snapshot);
    }
}

/// Takes the snapshots of a running program.
pub(crate) struct Keeper {
    layout: RetainLayout,
    interval: Time,
    /// When the next one is due.
    due: Option<Time>,
    number: u64,
    full: Producer<Box<Snapshot>>,
    empty: Consumer<Box<Snapshot>>,
    reader: Option<SnapshotReader>,
    /// The state at which the program was halted, once it was.
    last: Vec<u8>,
    halted: bool,
}

impl Keeper {
    pub fn new(program: &Program, interval: Time) -> Self {
        let layout = RetainLayout::new(program);
        let ((full, taken), (mut back, empty)) = (RingBuffer::new(BUFFERS), RingBuffer::new(BUFFERS));
        for _ in 0..BUFFERS {
            let _ = back.push(Box::new(Snapshot { time: Time(0), number: 0, bytes: vec![0; layout.len()] }));
        }
        let reader = Some(SnapshotReader { full: taken, empty: back });
        let last = vec![0; layout.len()];
        Self { layout, interval, due: None, number: 0, full, empty, reader, last, halted: false }
    }
    pub fn reader(&mut self) -> Option<SnapshotReader> {
        self.reader.take()
    }
    /// At the end of a step in which the bus task ran, no task in the middle of a scan.
    pub fn at_boundary(&mut self, now: Time, image: &[u8]) {
        if self.due.is_some_and(|due| now < due) {
            return;
        }
        if self.take(now, image) {
            self.due = Some(Time(now.0.saturating_add(self.interval.0)));
        }
    }
    /// The program is halted between two steps.
    pub fn halt(&mut self, image: &[u8]) {
        self.layout.copy(image, &mut self.last);
        self.halted = true;
    }
    /// It starts again.
    pub fn start(&mut self) {
        (self.halted, self.due) = (false, None);
    }
    /// The state at the end of a run: as it is now, or as it was when the program was halted. `None` after a fault in the middle of a scan.
    pub fn last(&self, image: &[u8], faulted: bool) -> Option<Vec<u8>> {
        let mut bytes = self.last.clone();
        if !self.halted && !faulted {
            self.layout.copy(image, &mut bytes);
        }
        (self.halted || !faulted).then_some(bytes)
    }
    fn take(&mut self, now: Time, image: &[u8]) -> bool {
        let Ok(mut snapshot) = self.empty.pop() else { return false };
        self.layout.copy(image, &mut snapshot.bytes);
        (snapshot.time, snapshot.number) = (now, self.number);
        self.number += 1;
        self.full.push(snapshot).is_ok()
    }
}
