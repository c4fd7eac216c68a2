//! The server: a thread that talks with all clients, and with the port.

use super::answer::{self, Named, Problem, bad, good};
use super::hold::{Hold, Holds, Way};
use super::job::{Change, Job, Work};
use super::port::Line;
use super::session::{Rhythm, Session};
use super::{About, limits};
use crate::journal::{Entry, Event, Poster};
use rustix::event::{PollFd, PollFlags, Timespec};
use serde_json::{Value, json};
use std::collections::{HashMap, VecDeque};
use std::io::Write;
use std::os::unix::net::UnixListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use takt_ir::Place;

/// How long the server sleeps when nothing is to be done, and while it waits for the port.
const IDLE: Duration = Duration::from_millis(50);
const WAIT: Duration = Duration::from_millis(1);
/// Time that a client has to say hello.
const GREETING: Duration = Duration::from_secs(10);
/// Lines of a client that are handled before the next one's turn.
const LINES: usize = 16;

/// Who asked for something.
#[derive(Debug, Clone, Default)]
pub(super) struct Who {
    pub name: String,
    pub from: String,
    pub reason: String,
}

/// A variable that a command is about.
#[derive(Debug, Clone)]
pub(super) struct Target {
    pub name: String,
    pub place: Place,
}

/// What an answer of the port is for.
#[derive(Debug)]
pub(super) enum Kind {
    Read(Vec<Named>),
    Parameters(Vec<Named>),
    Status,
    Tasks,
    Forces,
    Statistics,
    Commands {
        event: Event,
        targets: Vec<Target>,
        lease: Option<Duration>,
        client: u64,
    },
    Run(Change),
    /// Values for a subscription.
    Update {
        subscription: u64,
    },
    /// Nobody waits for it.
    Nothing,
}

/// A request that waits for the port.
#[derive(Debug)]
pub(super) struct Pending {
    pub client: Option<u64>,
    pub id: Value,
    pub kind: Kind,
    pub who: Who,
}

/// Who forced a variable, and when.
#[derive(Debug, Clone)]
pub(super) struct Note {
    pub name: String,
    pub who: Who,
    pub since: std::time::SystemTime,
}

pub(super) struct Server {
    listener: UnixListener,
    pub about: About,
    line: Line,
    journal: Option<Poster>,
    end: Arc<AtomicBool>,
    pub sessions: HashMap<u64, Session>,
    pub pending: HashMap<u64, Pending>,
    /// Jobs that wait for room.
    backlog: VecDeque<Box<Job>>,
    pub holds: Holds,
    pub notes: HashMap<(u32, u32), Note>,
    /// Subscriptions after scans: of which client.
    pub samplers: HashMap<u64, u64>,
    next: u64,
}

impl Server {
    pub fn new(listener: UnixListener, about: About, line: Line, journal: Option<Poster>, end: Arc<AtomicBool>) -> Self {
        Self {
            listener,
            about,
            line,
            journal,
            end,
            sessions: HashMap::new(),
            pending: HashMap::new(),
            backlog: VecDeque::new(),
            holds: Holds::default(),
            notes: HashMap::new(),
            samplers: HashMap::new(),
            next: 1,
        }
    }

    /// Serves until the run is over.
    pub fn run(&mut self) {
        while !self.end.load(Ordering::Relaxed) {
            let busy = self.sessions.values().any(|session| session.listens() && session.has_input());
            if self.wait(if busy { Duration::ZERO } else { self.sleep() }) {
                self.accept();
            }
            self.receive();
            self.finish_jobs();
            self.update(Instant::now());
            for hold in self.holds.expired(Instant::now()) {
                self.let_go(&hold, "its lease ran out");
            }
            self.sessions.values_mut().for_each(Session::flush);
            self.bury();
            self.submit();
        }
        self.finish_jobs();
        self.sessions.values_mut().for_each(Session::flush);
    }

    pub fn number(&mut self) -> u64 {
        self.next += 1;
        self.next
    }

    pub fn post(&self, entry: Entry) {
        if let Some(journal) = &self.journal {
            journal.post(entry);
        }
    }

    pub fn journal_failing(&self) -> bool {
        self.journal.as_ref().is_some_and(Poster::is_failing)
    }

    /// How long nothing is to be done unless somebody says something.
    fn sleep(&self) -> Duration {
        if !self.pending.is_empty() || !self.backlog.is_empty() || !self.samplers.is_empty() {
            return WAIT;
        }
        let due = self.sessions.values().flat_map(|session| &session.subscriptions).filter_map(|subscription| match &subscription.kind {
            Rhythm::Period { next, .. } => Some(*next),
            Rhythm::Scans => None,
        });
        let next = due.chain(self.holds.next()).min();
        next.map_or(IDLE, |next| next.saturating_duration_since(Instant::now()).min(IDLE))
    }

    /// Sleeps until a client or the time says so; whether somebody wants to connect.
    fn wait(&mut self, time: Duration) -> bool {
        let mut fds = vec![PollFd::new(&self.listener, PollFlags::IN)];
        for session in self.sessions.values() {
            let input = if session.listens() { PollFlags::IN } else { PollFlags::empty() };
            let output = if session.has_output() { PollFlags::OUT } else { PollFlags::empty() };
            fds.push(PollFd::new(&session.stream, input | output));
        }
        let time = Timespec { tv_sec: time.as_secs() as i64, tv_nsec: i64::from(time.subsec_nanos()) };
        if rustix::event::poll(&mut fds, Some(&time)).is_err() {
            return false;
        }
        let connecting = !fds[0].revents().is_empty();
        let gone: Vec<bool> = fds[1..].iter().map(|fd| fd.revents().intersects(PollFlags::HUP | PollFlags::ERR)).collect();
        for (session, gone) in self.sessions.values_mut().zip(gone) {
            // What it sent before it went is still read.
            if gone && (session.ended || !session.listens()) {
                session.dead = true;
            }
        }
        connecting
    }

    fn accept(&mut self) {
        for _ in 0..LINES {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => return,
                Err(_) => {
                    // No descriptors are left: better slow than busy.
                    std::thread::sleep(IDLE);
                    return;
                }
            };
            if stream.set_nonblocking(true).is_err() {
                continue;
            }
            if self.sessions.len() >= limits::CLIENTS {
                let problem =
                    Problem::new("too-many-clients", format!("{} clients are connected", limits::CLIENTS)).expected("try again later");
                let _ = (&stream).write_all(format!("{}\n", bad(&Value::Null, &problem)).as_bytes());
                continue;
            }
            let number = self.number();
            self.sessions.insert(number, Session::new(stream));
        }
    }

    fn receive(&mut self) {
        let clients: Vec<u64> = self.sessions.keys().copied().collect();
        for client in clients {
            if let Some(session) = self.sessions.get_mut(&client).filter(|session| session.listens()) {
                session.receive();
            }
            for _ in 0..LINES {
                let Some(line) = self.sessions.get_mut(&client).and_then(Session::line) else { break };
                self.handle(client, &line);
            }
        }
    }

    /// Sends an answer to a client that is still there.
    pub fn send(&mut self, client: Option<u64>, line: &str) {
        if let Some(session) = client.and_then(|client| self.sessions.get_mut(&client)) {
            if line.len() > limits::ANSWER {
                let problem =
                    Problem::new("too-large", format!("the answer has more than {} bytes", limits::ANSWER)).expected("fewer variables");
                session.send(&bad(&Value::Null, &problem));
            } else {
                session.send(line);
            }
        }
    }

    /// Hands a job to the port, and remembers what for.
    pub fn ask(&mut self, work: Work, pending: Pending) {
        let ticket = self.number();
        if let Some(session) = pending.client.and_then(|client| self.sessions.get_mut(&client)) {
            session.open += 1;
        }
        self.pending.insert(ticket, pending);
        self.backlog.push_back(Box::new(Job::new(ticket, work)));
        self.submit();
    }

    pub fn push(&mut self, job: Box<Job>) {
        self.backlog.push_back(job);
    }

    fn submit(&mut self) {
        while let Some(job) = self.backlog.pop_front() {
            if let Err(rtrb::PushError::Full(job)) = self.line.jobs.push(job) {
                self.backlog.push_front(job);
                return;
            }
        }
    }

    fn finish_jobs(&mut self) {
        while let Ok(job) = self.line.done.pop() {
            let ticket = job.ticket;
            if matches!(job.work, Work::Batch(_)) {
                self.batch(job);
                continue;
            }
            let Some(pending) = self.pending.remove(&ticket) else { continue };
            if let Some(session) = pending.client.and_then(|client| self.sessions.get_mut(&client)) {
                session.open = session.open.saturating_sub(1);
            }
            self.finished(pending, *job);
        }
    }

    /// Values that clients have subscribed to.
    fn update(&mut self, now: Instant) {
        let mut jobs = Vec::new();
        for (client, session) in &mut self.sessions {
            let keeps_up = session.keeps_up();
            for subscription in &mut session.subscriptions {
                let Rhythm::Period { period, next, job } = &mut subscription.kind else { continue };
                if now < *next {
                    continue;
                }
                // Late is late: no burst to catch up.
                *next = (*next + *period).max(now);
                match job.take() {
                    Some(ready) if keeps_up => jobs.push((*client, subscription.id, ready)),
                    ready => {
                        *job = ready;
                        subscription.missed += 1;
                    }
                }
            }
        }
        for (client, subscription, mut job) in jobs {
            job.ticket = self.number();
            let kind = Kind::Update { subscription };
            self.pending.insert(job.ticket, Pending { client: Some(client), id: Value::Null, kind, who: Who::default() });
            if let Some(session) = self.sessions.get_mut(&client) {
                session.open += 1;
            }
            self.backlog.push_back(job);
        }
    }

    /// Gives back what is held, and says why.
    pub fn let_go(&mut self, hold: &Hold, why: &str) {
        let event = if hold.way == Way::Force { Event::Release } else { Event::Write };
        let client = self.sessions.get(&hold.client);
        let who = Who {
            name: client.map_or_else(|| "takt".into(), Session::who),
            from: client.map_or_else(String::new, Session::from),
            reason: why.into(),
        };
        let target = Target { name: hold.name.clone(), place: hold.place };
        let work = self.commands(vec![hold.end()]);
        let kind = Kind::Commands { event, targets: vec![target], lease: None, client: hold.client };
        self.ask(work, Pending { client: None, id: Value::Null, kind, who });
    }

    /// Takes leave of clients that are gone.
    fn bury(&mut self) {
        for session in self.sessions.values_mut() {
            session.dead |= !session.greeted && session.since.elapsed() > GREETING;
        }
        let gone: Vec<u64> = self.sessions.iter().filter(|(_, session)| session.is_done()).map(|(client, _)| *client).collect();
        let silent: Vec<u64> = self.sessions.iter().filter(|(_, session)| session.ended).map(|(client, _)| *client).collect();
        for client in gone.iter().chain(&silent) {
            for hold in self.holds.of_client(*client) {
                self.let_go(&hold, "its client has gone");
            }
            self.end_samplers(*client);
        }
        for client in gone {
            if let Some(session) = self.sessions.remove(&client)
                && let Some(armed) = &session.armed
            {
                self.post(Entry::new(Event::Disarm).by(&armed.name, &session.from(), "its client has gone"));
            }
        }
    }

    fn end_samplers(&mut self, client: u64) {
        let own: Vec<u64> = self.samplers.iter().filter(|(_, of)| **of == client).map(|(ticket, _)| *ticket).collect();
        for ticket in own {
            self.end_sampler(ticket);
        }
        if let Some(session) = self.sessions.get_mut(&client) {
            session.subscriptions.clear();
        }
    }

    pub fn end_sampler(&mut self, ticket: u64) {
        if self.samplers.remove(&ticket).is_some() {
            self.pending.insert(ticket, Pending { client: None, id: Value::Null, kind: Kind::Nothing, who: Who::default() });
            self.push(Box::new(Job::new(ticket, Work::EndSample(None))));
        }
    }

    /// Rows of a subscription after scans.
    fn batch(&mut self, mut job: Box<Job>) {
        let ticket = job.ticket;
        let client = self.samplers.get(&ticket).copied();
        let session = client.and_then(|client| self.sessions.get_mut(&client));
        if let (Some(session), Some(batch)) = (session, job.batch()) {
            let keeps_up = session.keeps_up();
            let found = session.subscriptions.iter_mut().find(|subscription| subscription.id == ticket);
            if let Some(subscription) = found {
                subscription.missed += batch.missed;
                let row = super::job::length(&subscription.spans);
                let mut lines = Vec::new();
                let names = subscription.names.clone();
                if keeps_up {
                    for (index, (cycle, time)) in batch.stamps.iter().enumerate() {
                        let bytes = batch.bytes.get(index * row..(index + 1) * row).unwrap_or_default();
                        let values = answer::values(&self.about.program, &names, bytes);
                        let missed = std::mem::take(&mut subscription.missed);
                        lines.push(update_line(ticket, *cycle, time.0, missed, values));
                    }
                } else {
                    subscription.missed += batch.stamps.len() as u64;
                }
                lines.iter().for_each(|line| session.send(line));
            }
            // Its room goes back.
            self.push(job);
        }
    }
}

/// A line with values that were subscribed to.
pub(super) fn update_line(subscription: u64, cycle: u64, time_ns: i64, missed: u64, values: Value) -> String {
    let mut line = json!({ "subscription": subscription, "cycle": cycle, "time_ns": time_ns, "values": values });
    if missed > 0 {
        line["missed"] = missed.into();
    }
    line.to_string()
}

/// An empty result.
pub(super) fn done(id: &Value) -> String {
    good(id, json!({}))
}
