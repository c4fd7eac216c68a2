//! A client that is connected: what came from it, what goes to it, what it may do.

use super::answer::{Named, Problem, bad};
use super::job::{Job, Span};
use super::limits;
use super::peer::Peer;
use serde_json::Value;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Bytes that are read at once, so that no client keeps the others waiting.
const BLOCK: usize = 64 << 10;
/// Bytes waiting for a client above which it gets no more values and nothing is read from it.
const BUSY: usize = 1 << 20;

/// Who may change things, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Armed {
    pub name: String,
    pub reason: String,
}

/// Values that come by themselves.
#[derive(Debug)]
pub(super) struct Subscription {
    pub id: u64,
    pub names: Arc<[Named]>,
    pub spans: Arc<[Span]>,
    pub kind: Rhythm,
    /// Values that did not get through.
    pub missed: u64,
}

/// When they come.
#[derive(Debug)]
pub(super) enum Rhythm {
    /// Every so often; the job is here unless it is under way.
    Period { period: Duration, next: Instant, job: Option<Box<Job>> },
    /// After scans, by the port.
    Scans,
}

/// A connected client.
#[derive(Debug)]
pub(super) struct Session {
    pub stream: UnixStream,
    pub peer: Peer,
    /// What it calls itself.
    pub program: String,
    inbox: Vec<u8>,
    /// Bytes of the inbox that have been searched for the end of a line.
    searched: usize,
    outbox: Vec<u8>,
    sent: usize,
    pub greeted: bool,
    pub armed: Option<Armed>,
    /// Requests under way.
    pub open: usize,
    pub subscriptions: Vec<Subscription>,
    /// It sends no more.
    pub ended: bool,
    /// It is to be cut off.
    pub dead: bool,
    pub since: Instant,
}

impl Session {
    pub fn new(stream: UnixStream) -> Self {
        let peer = Peer::of(&stream);
        Self {
            stream,
            peer,
            program: String::new(),
            inbox: Vec::new(),
            searched: 0,
            outbox: Vec::new(),
            sent: 0,
            greeted: false,
            armed: None,
            open: 0,
            subscriptions: Vec::new(),
            ended: false,
            dead: false,
            since: Instant::now(),
        }
    }

    /// Who it is, for the journal: the name given when arming, else the user.
    pub fn who(&self) -> String {
        match &self.armed {
            Some(armed) => armed.name.clone(),
            None => self.peer.user_name().or(self.peer.user.map(|user| user.to_string())).unwrap_or_default(),
        }
    }

    /// Why it does what it does.
    pub fn reason(&self) -> &str {
        self.armed.as_ref().map_or("", |armed| &armed.reason)
    }

    /// Where it is.
    pub fn from(&self) -> String {
        if self.program.is_empty() { self.peer.to_string() } else { format!("{}, {}", self.peer, self.program) }
    }

    fn waiting(&self) -> usize {
        self.outbox.len() - self.sent
    }

    /// Whether values that it has subscribed to are sent to it now.
    pub fn keeps_up(&self) -> bool {
        self.waiting() < BUSY
    }

    /// Whether more may be read from it.
    pub fn listens(&self) -> bool {
        !self.ended && !self.dead && self.keeps_up() && self.open < limits::REQUESTS
    }

    pub fn has_output(&self) -> bool {
        self.waiting() > 0
    }

    /// Whether nothing more comes from it or goes to it.
    pub fn is_done(&self) -> bool {
        self.dead || self.ended && self.open == 0 && !self.has_output()
    }

    /// Reads what is there, one block at the most.
    pub fn receive(&mut self) {
        let before = self.inbox.len();
        self.inbox.resize(before + BLOCK, 0);
        let read = self.stream.read(&mut self.inbox[before..]);
        self.inbox.truncate(before + read.as_ref().map_or(0, |read| *read));
        match read {
            Ok(0) => self.ended = true,
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => self.dead = true,
        }
    }

    /// The next whole line, if there is one. A line that is too long ends the connection.
    pub fn line(&mut self) -> Option<Vec<u8>> {
        if self.dead || self.open >= limits::REQUESTS || !self.keeps_up() {
            return None;
        }
        let end = self.inbox[self.searched..].iter().position(|byte| *byte == b'\n').map(|at| at + self.searched);
        let long = end.unwrap_or(self.inbox.len()) > limits::LINE;
        if long {
            let problem = Problem::new("too-large", format!("a request has at the most {} bytes", limits::LINE));
            self.send(&bad(&Value::Null, &problem));
            self.finish();
            return None;
        }
        let Some(end) = end else {
            self.searched = self.inbox.len();
            return None;
        };
        let mut line: Vec<u8> = self.inbox.drain(..=end).collect();
        self.searched = 0;
        line.pop();
        Some(line)
    }

    /// Nothing more is read; what waits is still sent.
    pub fn finish(&mut self) {
        self.ended = true;
        self.inbox = Vec::new();
        self.searched = 0;
    }

    /// A line for the client. One that does not read is cut off.
    pub fn send(&mut self, line: &str) {
        if self.waiting() + line.len() > limits::WAITING {
            self.dead = true;
        }
        if self.dead {
            return;
        }
        self.outbox.extend_from_slice(line.as_bytes());
        self.outbox.push(b'\n');
    }

    /// Sends what the client takes now.
    pub fn flush(&mut self) {
        while self.waiting() > 0 && !self.dead {
            match self.stream.write(&self.outbox[self.sent..]) {
                Ok(0) => self.dead = true,
                Ok(written) => self.sent += written,
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => self.dead = true,
            }
        }
        if self.waiting() == 0 {
            self.outbox.clear();
            self.outbox.shrink_to(BLOCK);
            self.sent = 0;
        } else if self.sent > BUSY {
            self.outbox.drain(..self.sent);
            self.sent = 0;
        }
    }

    /// Whether there may be another whole line.
    pub fn has_input(&self) -> bool {
        self.inbox.len() > self.searched
    }
}
