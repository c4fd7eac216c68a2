//! The text between a reader and an interpreter: a file as a stream of lines, in bounded memory.
//!
//! A [`NcSource`] belongs to a ReadNCFile. [`NcSource::pump`] moves chunks from the host (the next one is under way while the present one is handed
//! out); [`NcSource::next_line`] hands out lines. Two chunks and one line are all that is kept, whatever the size of the file.

mod save;

use super::trouble::{Kind, Trouble};
use takt_abi::{CHUNK, Chunk, Folder, Host, HostError, Request, Resource, Str, Ticket};

/// Bytes of the longest line, without its end.
pub const LINE_MAX: usize = 4096;
/// Bytes that one call of the reader looks through for what is no text.
const WATCH: usize = 64 * 1024;

/// How a file is to be read, from the inputs of its reader.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Velocity, acceleration, deceleration of feed moves before the first F and E, per second.
    pub feed: [f64; 3],
    /// The same for rapids (FF, EF); 0: as feed.
    pub rapid: [f64; 3],
    /// `( )` is a comment.
    pub parentheses: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { feed: [0.0; 3], rapid: [0.0; 3], parentheses: true }
    }
}

/// Where the reading of a file stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Phase {
    /// No file.
    Idle,
    /// Chunks are still to come.
    Reading,
    /// The whole file has been read; lines may be left.
    Read,
    /// It ended with an error.
    Failed(Trouble),
}

/// What [`NcSource::next_line`] has.
#[derive(Debug, PartialEq)]
pub enum Next<'a> {
    /// A line with its number, from 1, without its end.
    Line(u32, &'a [u8]),
    /// Nothing yet.
    Wait,
    /// Nothing any more.
    End,
    /// An error of the file.
    Failed(Trouble),
}

/// A request that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Awaited {
    ticket: Ticket,
    /// It was for a file that is no longer wanted.
    stale: bool,
}

/// The file of a reader.
#[derive(Debug)]
pub struct NcSource {
    path: Str<256>,
    settings: Settings,
    phase: Phase,
    /// The file that follows this one (bAppend).
    queued: Option<(Str<256>, Settings)>,
    /// The chunk that is handed out, and how far.
    front: Vec<u8>,
    at: usize,
    /// How far `front` is known to have no NUL.
    watched: usize,
    /// The chunk after it.
    back: Option<Vec<u8>>,
    /// Buffers that wait for use.
    spare: [Option<Vec<u8>>; 2],
    awaited: Option<Awaited>,
    /// The start of a line that goes on in the next chunk; when `handed`, a line that has been handed out from here.
    carry: Vec<u8>,
    handed: bool,
    line: u32,
    received: u64,
    file_size: Option<u64>,
}

impl Default for NcSource {
    fn default() -> Self {
        let buffer = || Vec::with_capacity(CHUNK);
        Self {
            path: Str::EMPTY,
            settings: Settings::default(),
            phase: Phase::Idle,
            queued: None,
            front: Vec::new(),
            at: 0,
            watched: 0,
            back: None,
            spare: [Some(buffer()), Some(buffer())],
            awaited: None,
            carry: Vec::with_capacity(LINE_MAX + 1),
            handed: false,
            line: 0,
            received: 0,
            file_size: None,
        }
    }
}

impl NcSource {
    /// Starts a file, or with `append` puts it behind the one that is being read.
    pub fn start(&mut self, path: Str<256>, settings: Settings, append: bool) {
        if append && matches!(self.phase, Phase::Reading | Phase::Read) && !self.is_handed_out() {
            self.queued = Some((path, settings));
        } else {
            self.abort();
            self.open(path, settings);
        }
    }

    fn open(&mut self, path: Str<256>, settings: Settings) {
        (self.path, self.settings) = (path, settings);
        (self.line, self.received, self.file_size) = (0, 0, None);
        self.phase = Phase::Reading;
        if path.bytes().is_empty() {
            self.fail(Kind::NoName.at(0, 0));
        }
    }

    /// Forgets the file and what is left of it.
    pub fn abort(&mut self) {
        let front = std::mem::take(&mut self.front);
        self.recycle(front);
        if let Some(back) = self.back.take() {
            self.recycle(back);
        }
        if let Some(awaited) = &mut self.awaited {
            awaited.stale = true;
        }
        (self.at, self.watched, self.handed, self.queued) = (0, 0, false, None);
        self.carry.clear();
        self.phase = Phase::Idle;
    }

    /// Where the reading stands.
    pub fn phase(&self) -> Phase {
        self.phase
    }
    /// The file's name as it was asked for.
    pub fn path(&self) -> &Str<256> {
        &self.path
    }
    /// How the file is to be read.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
    /// Number of the line that was handed out last.
    pub fn line(&self) -> u32 {
        self.line
    }
    /// Size of the file in bytes, and how much of it has been read.
    pub fn progress(&self) -> (u64, u64) {
        (self.file_size.unwrap_or(0), self.received)
    }
    /// Ends the file with an error.
    pub fn fail(&mut self, trouble: Trouble) {
        self.phase = Phase::Failed(trouble);
    }

    fn is_handed_out(&self) -> bool {
        self.phase == Phase::Read && self.at >= self.front.len() && self.back.is_none() && (self.carry.is_empty() || self.handed)
    }

    fn recycle(&mut self, mut buffer: Vec<u8>) {
        buffer.clear();
        if buffer.capacity() >= CHUNK
            && let Some(place) = self.spare.iter_mut().find(|s| s.is_none())
        {
            *place = Some(buffer);
        }
    }

    /// Takes what the host has brought and asks for more; once per scan. Allocates only where the host lost a buffer.
    pub fn pump(&mut self, host: &mut dyn Host) {
        if let Some(awaited) = self.awaited
            && let Some(result) = host.take(awaited.ticket)
        {
            self.awaited = None;
            match result {
                Ok(chunk) if awaited.stale => self.recycle(chunk.data),
                Ok(chunk) => self.receive(chunk),
                Err(HostError::Busy) => {}
                Err(error) if !awaited.stale => self.fail(Kind::from(error).at(0, 0)),
                Err(_) => {}
            }
        }
        if self.is_handed_out()
            && let Some((path, settings)) = self.queued.take()
        {
            self.open(path, settings);
        }
        self.watch();
        if self.phase == Phase::Reading && self.awaited.is_none() && self.back.is_none() {
            let mut buffer = self.spare.iter_mut().find_map(Option::take).unwrap_or_else(|| Vec::with_capacity(CHUNK));
            match host.submit(Request::Read { folder: Folder::Nc, path: self.path, offset: self.received }, &mut buffer) {
                Ok(ticket) => self.awaited = Some(Awaited { ticket, stale: false }),
                Err(HostError::Busy) => self.recycle(buffer),
                Err(error) => self.fail(Kind::from(error).at(0, 0)),
            }
        }
    }

    fn receive(&mut self, chunk: Chunk) {
        let size = *self.file_size.get_or_insert(chunk.file_size);
        let received = self.received.saturating_add(chunk.data.len() as u64);
        let short = chunk.data.len() < CHUNK && received < size;
        if size == 0 {
            return self.fail(Kind::Empty.at(0, 0));
        }
        if chunk.file_size != size || received > size || short || chunk.data.is_empty() {
            return self.fail(Kind::Changed.at(0, 0));
        }
        let first = self.received == 0;
        self.received = received;
        if received == size {
            self.phase = Phase::Read;
        }
        if first && chunk.data.len() > LINE_MAX && !chunk.data[..=LINE_MAX].contains(&b'\n') {
            let kind = if chunk.data[..=LINE_MAX].contains(&0) { Kind::NotText } else { Kind::LineTooLong };
            return self.fail(kind.at(1, 0));
        }
        self.back = Some(chunk.data);
        if self.at >= self.front.len() {
            self.flip();
        }
    }

    /// Goes on with the next chunk.
    fn flip(&mut self) {
        if let Some(back) = self.back.take() {
            let front = std::mem::replace(&mut self.front, back);
            self.recycle(front);
            (self.at, self.watched) = (0, 0);
        }
    }

    /// Looks ahead for bytes that no text has, so that a binary file is refused before it is decoded.
    fn watch(&mut self) {
        if !matches!(self.phase, Phase::Reading | Phase::Read) {
            return;
        }
        let end = self.front.len().min(self.watched + WATCH);
        let fresh = &self.front[self.watched..end];
        if fresh.contains(&0) {
            let nul = self.watched + fresh.iter().position(|b| *b == 0).unwrap_or(0);
            let passed = self.front.get(self.at..nul).unwrap_or(&[]);
            let breaks = passed.iter().filter(|b| **b == b'\n').count() as u32;
            self.fail(Kind::NotText.at(self.line.saturating_add(1).saturating_add(breaks), 0));
        }
        self.watched = end;
    }

    /// The next line.
    pub fn next_line(&mut self) -> Next<'_> {
        if self.handed {
            self.handed = false;
            self.carry.clear();
        }
        loop {
            match self.phase {
                Phase::Idle => return Next::Wait,
                Phase::Failed(trouble) => return Next::Failed(trouble),
                Phase::Reading | Phase::Read => {}
            }
            if self.at < self.front.len() {
                let rest = &self.front[self.at..];
                let reach = rest.len().min(LINE_MAX + 1 - self.carry.len().min(LINE_MAX));
                let Some(length) = rest[..reach].iter().position(|b| *b == b'\n') else {
                    if reach < rest.len() || self.carry.len() + reach > LINE_MAX {
                        self.fail(Kind::LineTooLong.at(self.line.saturating_add(1), 0));
                        continue;
                    }
                    self.carry.extend_from_slice(rest);
                    self.at = self.front.len();
                    continue;
                };
                let start = self.at;
                self.at += length + 1;
                if self.carry.is_empty() {
                    self.line = self.line.saturating_add(1);
                    return Next::Line(self.line, without_mark(self.line, &self.front[start..start + length]));
                }
                self.carry.extend_from_slice(&self.front[start..start + length]);
                return self.carried();
            }
            if self.back.is_some() {
                self.flip();
            } else if self.phase == Phase::Reading {
                return Next::Wait;
            } else if !self.carry.is_empty() {
                return self.carried();
            } else if self.queued.is_some() {
                return Next::Wait;
            } else {
                return Next::End;
            }
        }
    }

    fn carried(&mut self) -> Next<'_> {
        self.handed = true;
        self.line = self.line.saturating_add(1);
        Next::Line(self.line, without_mark(self.line, &self.carry))
    }
}

/// The first line without the byte order mark of UTF-8.
fn without_mark(line: u32, text: &[u8]) -> &[u8] {
    if line == 1 { text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text) } else { text }
}

impl Resource for NcSource {
    fn save(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        save::save(self, &mut bytes);
        bytes
    }
    fn save_into(&self, out: &mut Vec<u8>) {
        save::save(self, out);
    }
    fn restore(&mut self, bytes: &[u8]) -> bool {
        let restored = save::restore(bytes);
        let good = restored.is_some();
        *self = restored.unwrap_or_default();
        good
    }
    fn as_any(&mut self) -> &mut dyn std::any::Any {
        self
    }
}
