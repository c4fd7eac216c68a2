//! A request of a block to the host, over many scans.

use takt_abi::{Chunk, Host, HostError, Request, Resource, Ticket};

/// One request at a time. An abandoned one is waited for before the next, because its answer takes a place in the host.
#[derive(Debug)]
pub struct Job {
    ticket: Option<Ticket>,
    stale: bool,
    /// A buffer that waits for its use.
    spare: Vec<u8>,
}

impl Default for Job {
    /// With room for a path.
    fn default() -> Self {
        Self::with_buffer(256)
    }
}

impl Job {
    /// With a buffer of its own, so that no request allocates.
    pub fn with_buffer(size: usize) -> Self {
        Self { ticket: None, stale: false, spare: Vec::with_capacity(size) }
    }

    /// Whether the next [`Job::run`] asks.
    pub fn is_idle(&self) -> bool {
        self.ticket.is_none()
    }

    /// The empty buffer, to be filled with what the next request sends and given back.
    pub fn buffer(&mut self) -> Vec<u8> {
        let mut buffer = std::mem::take(&mut self.spare);
        buffer.clear();
        buffer
    }

    /// Asks what `request` says, with the buffer, until there is an answer.
    pub fn run(&mut self, host: &mut dyn Host, request: impl FnOnce() -> Request) -> Option<Result<Chunk, HostError>> {
        if self.stale {
            self.drain(host);
            return None;
        }
        let Some(ticket) = self.ticket else {
            return match host.submit(request(), &mut self.spare) {
                Ok(ticket) => {
                    self.ticket = Some(ticket);
                    None
                }
                Err(HostError::Busy) => None,
                Err(error) => Some(Err(error)),
            };
        };
        let answer = host.take(ticket)?;
        self.ticket = None;
        Some(answer)
    }

    /// Takes the answer to the abandoned request, if it has come. The next request is asked in the next call, with a buffer of its own.
    fn drain(&mut self, host: &mut dyn Host) {
        let Some(answer) = self.ticket.and_then(|ticket| host.take(ticket)) else { return };
        (self.ticket, self.stale) = (None, false);
        if let Ok(chunk) = answer {
            self.give_back(chunk.data);
        }
    }

    /// Keeps the buffer of an answer for the next request.
    pub fn give_back(&mut self, buffer: Vec<u8>) {
        self.spare = buffer;
    }

    /// Forgets the request under way; what it does to the file it does.
    pub fn abandon(&mut self) {
        self.stale = self.ticket.is_some();
    }
}

impl Resource for Job {
    fn save(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.save_into(&mut bytes);
        bytes
    }
    fn save_into(&self, out: &mut Vec<u8>) {
        out.push(u8::from(self.stale));
        out.extend_from_slice(&self.ticket.map_or(0, |t| t.0).to_le_bytes());
    }
    fn restore(&mut self, bytes: &[u8]) -> bool {
        (self.ticket, self.stale) = (None, false);
        let Some((stale, ticket)) = bytes.split_first().and_then(|(s, t)| Some((*s != 0, u64::from_le_bytes(t.try_into().ok()?)))) else {
            return false;
        };
        self.ticket = (ticket != 0).then_some(Ticket(ticket));
        self.stale = stale && self.ticket.is_some();
        true
    }
    fn as_any(&mut self) -> &mut dyn std::any::Any {
        self
    }
}

/// A job that moves data, with its buffer.
#[derive(Debug)]
pub struct Transfer(pub Job);

impl Default for Transfer {
    fn default() -> Self {
        Self(Job::with_buffer(takt_abi::CHUNK))
    }
}

impl Resource for Transfer {
    fn save(&self) -> Vec<u8> {
        self.0.save()
    }
    fn save_into(&self, out: &mut Vec<u8>) {
        self.0.save_into(out);
    }
    fn restore(&mut self, bytes: &[u8]) -> bool {
        self.0.restore(bytes)
    }
    fn as_any(&mut self) -> &mut dyn std::any::Any {
        self
    }
}
