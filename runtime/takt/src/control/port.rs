//! What the thread that runs the scans has of the control socket. Nothing here allocates, frees, locks or waits.

pub use super::job::Mode;
use super::job::{Batch, Change, Item, Job, Sampler, Span, Status, Work};
use super::limits;
use std::sync::Arc;
use takt_abi::Time;
use takt_engine::{Command, Engine, FaultRecord};

/// Jobs that may be under way.
pub(super) const JOBS: usize = 256;
/// Jobs that are done after one scan at the most.
const PER_SCAN: usize = 16;
/// Bytes that are copied after one scan, about.
const COPIED: usize = 128 << 10;
/// Time after which rows are sent although there is room for more.
const AGE: i64 = 50_000_000;

/// The end of the scans.
#[derive(Debug)]
pub struct Port {
    jobs: rtrb::Consumer<Box<Job>>,
    done: rtrb::Producer<Box<Job>>,
    mode: Mode,
    end: bool,
    /// Kept so that telling of a fault allocates nothing.
    fault: Option<Arc<FaultRecord>>,
    /// The same of tasks that were stopped alone.
    stopped: Vec<Option<Arc<FaultRecord>>>,
    #[allow(clippy::vec_box, reason = "the boxes come from the server, which frees them; unpacking one here would free it")]
    samplers: Vec<Box<Sampler>>,
}

/// The server's end.
#[derive(Debug)]
pub(super) struct Line {
    pub jobs: rtrb::Producer<Box<Job>>,
    pub done: rtrb::Consumer<Box<Job>>,
}

/// Both ends.
pub(super) fn pair(tasks: usize) -> (Port, Line) {
    let (jobs, to_port) = rtrb::RingBuffer::new(JOBS);
    let (from_port, done) = rtrb::RingBuffer::new(2 * JOBS);
    let port = Port {
        jobs: to_port,
        done: from_port,
        mode: Mode::Running,
        end: false,
        fault: None,
        stopped: vec![None; tasks],
        samplers: Vec::with_capacity(limits::SAMPLERS),
    };
    (port, Line { jobs, done })
}

impl Port {
    /// How the machine shall run.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Whether the run shall end.
    pub fn end_requested(&self) -> bool {
        self.end
    }

    /// Whether it stands still.
    pub fn is_paused(&self) -> bool {
        self.mode == Mode::Paused
    }

    /// A scan of the fastest task has been done.
    pub fn stepped(&mut self) {
        if let Mode::Stepping(left) = self.mode {
            self.mode = if left <= 1 { Mode::Paused } else { Mode::Stepping(left - 1) };
        }
    }

    /// Does what the server asks for. To be called between scans.
    pub fn serve(&mut self, engine: &mut Engine) {
        self.keep_fault(engine);
        let mut copied = self.sample(engine);
        for _ in 0..PER_SCAN {
            if copied > COPIED || self.done.is_full() {
                return;
            }
            let Ok(mut job) = self.jobs.pop() else { return };
            copied += self.work(&mut job, engine);
            (job.cycle, job.time) = (engine.cycles(), engine.now());
            if matches!(job.work, Work::Batch(_)) {
                self.refill(job);
            } else {
                drop_to(&mut self.done, job);
            }
        }
    }

    fn keep_fault(&mut self, engine: &Engine) {
        match (engine.fault(), &self.fault) {
            (None, Some(_)) => self.fault = None,
            (Some(record), None) => self.fault = Some(Arc::new(record.clone())),
            _ => {}
        }
        for (task, kept) in self.stopped.iter_mut().enumerate() {
            match (engine.task_fault(task), &kept) {
                (None, Some(_)) => *kept = None,
                (Some(record), None) => *kept = Some(Arc::new(record.clone())),
                _ => {}
            }
        }
    }

    fn work(&mut self, job: &mut Job, engine: &mut Engine) -> usize {
        match &mut job.work {
            Work::Read { spans, bytes } => {
                copy(engine.image(), spans, bytes);
                return bytes.len();
            }
            Work::Commands { list, refused, done, forces } => {
                for item in list {
                    if let Err(error) = act(item, engine) {
                        *refused = Some(error);
                        break;
                    }
                    *done += 1;
                }
                *forces = engine.force_count();
            }
            Work::Status(status) => self.status(status, engine),
            Work::ResetStatistics => engine.reset_statistics(),
            Work::Run { change, before } => {
                *before = self.mode;
                match *change {
                    Change::Pause => self.mode = Mode::Paused,
                    Change::Step(scans) => self.mode = Mode::Stepping(scans),
                    Change::Continue => self.mode = Mode::Running,
                    Change::Stop => self.end = true,
                }
            }
            Work::Sample(_) | Work::EndSample(_) | Work::Batch(_) => self.samplers_changed(job, engine.cycles()),
        }
        0
    }

    fn status(&self, status: &mut Status, engine: &Engine) {
        for (task, statistics) in status.tasks.iter_mut().enumerate() {
            statistics.clone_from(engine.statistics(task));
        }
        status.mode = self.mode;
        status.fault.clone_from(&self.fault);
        status.stopped.clone_from_slice(&self.stopped);
        (status.io_fault, status.io_faults) = engine.io_faults();
        status.at_rest = engine.at_rest();
        for force in engine.forces() {
            if status.forces.len() < status.forces.capacity() && status.bytes.len() + 2 * force.bytes.len() <= status.bytes.capacity() {
                status.forces.push(force.place);
                status.bytes.extend_from_slice(force.bytes);
                status.bytes.extend_from_slice(force.before);
            }
        }
    }

    fn samplers_changed(&mut self, job: &mut Job, cycle: u64) {
        let ticket = job.ticket;
        match std::mem::replace(&mut job.work, Work::EndSample(None)) {
            Work::Sample(mut sampler) if self.samplers.len() < self.samplers.capacity() => {
                sampler.next = cycle + 1;
                self.samplers.push(sampler);
            }
            Work::Sample(sampler) => job.work = Work::Sample(sampler),
            Work::Batch(batch) => job.work = Work::Batch(batch),
            _ => {
                if let Some(index) = self.samplers.iter().position(|sampler| sampler.ticket == ticket) {
                    job.work = Work::EndSample(Some(self.samplers.swap_remove(index)));
                }
            }
        }
    }

    /// A batch that was sent comes back: it serves again.
    fn refill(&mut self, mut job: Box<Job>) {
        let sampler = self.samplers.iter_mut().find(|sampler| sampler.ticket == job.ticket);
        match (sampler, job.batch()) {
            (Some(sampler), Some(batch)) if sampler.spare.len() < sampler.spare.capacity() => {
                batch.stamps.clear();
                batch.bytes.clear();
                sampler.spare.push(job);
            }
            // Of a sampler that is no more: the server frees it. There is room: it was looked for.
            _ => drop_to(&mut self.done, job),
        }
    }

    /// Copies what samplers want of this scan; how many bytes.
    fn sample(&mut self, engine: &Engine) -> usize {
        let (cycle, time, mut copied) = (engine.cycles(), engine.now(), 0);
        for sampler in &mut self.samplers {
            if cycle >= sampler.next {
                sampler.next = cycle + sampler.every;
                copied += row(sampler, engine.image(), cycle, time);
            }
            let full = |batch: &mut Batch| {
                batch.stamps.len() == batch.rows || batch.stamps.first().is_some_and(|(_, first)| time.0 - first.0 > AGE)
            };
            if !self.done.is_full()
                && sampler.filling.as_mut().and_then(|job| job.batch()).is_some_and(full)
                && let Some(job) = sampler.filling.take()
            {
                drop_to(&mut self.done, job);
            }
        }
        copied
    }
}

/// Hands a job to the server. Where there is no room, which was looked for, it is better lost than freed here.
fn drop_to(done: &mut rtrb::Producer<Box<Job>>, job: Box<Job>) {
    if let Err(rtrb::PushError::Full(job)) = done.push(job) {
        std::mem::forget(job);
    }
}

/// Copies one row; how many bytes.
fn row(sampler: &mut Sampler, image: &[u8], cycle: u64, time: Time) -> usize {
    if sampler.filling.is_none() {
        sampler.filling = sampler.spare.pop();
        if let Some(batch) = sampler.filling.as_mut().and_then(|job| job.batch()) {
            batch.missed = std::mem::take(&mut sampler.missed);
        }
    }
    match sampler.filling.as_mut().and_then(|job| job.batch()) {
        Some(batch) if batch.stamps.len() < batch.rows => {
            batch.stamps.push((cycle, time));
            let before = batch.bytes.len();
            for span in sampler.spans.iter() {
                batch.bytes.extend_from_slice(part(image, *span));
            }
            batch.bytes.len() - before
        }
        _ => {
            sampler.missed += 1;
            0
        }
    }
}

/// Does a command and keeps what the variable was.
fn act(item: &mut Item, engine: &mut Engine) -> Result<(), takt_engine::CommandError> {
    if let Command::Write { place, .. } | Command::Force { place, .. } | Command::Release { place, .. } = &item.command {
        let now = engine.read(*place);
        if now.len() == item.old.len() {
            item.old.copy_from_slice(now);
        }
    }
    engine.command(&item.command)?;
    if let Command::Write { place, .. } | Command::Force { place, .. } | Command::Release { place, .. } = &item.command {
        let now = engine.read(*place);
        if now.len() == item.new.len() {
            item.new.copy_from_slice(now);
        }
    }
    Ok(())
}

fn part(image: &[u8], span: Span) -> &[u8] {
    image.get(span.start as usize..span.start as usize + span.len as usize).unwrap_or_default()
}

fn copy(image: &[u8], spans: &[Span], bytes: &mut [u8]) {
    let mut rest = bytes;
    for span in spans {
        let from = part(image, *span);
        let Some((target, behind)) = rest.split_at_mut_checked(from.len()) else { return };
        target.copy_from_slice(from);
        rest = behind;
    }
}
