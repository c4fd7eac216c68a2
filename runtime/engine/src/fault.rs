//! The record of a fault: what happened, where, in which task, and who called whom.

use takt_abi::{Context, Fault, Time};
use takt_ir::{Program, Site};

/// A place in the source, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Source file as shown to people.
    pub file: String,
    /// From 1; 0 if unknown.
    pub line: u32,
    /// In characters, from 1; 0 if unknown.
    pub column: u32,
    /// The body (function, block, program) it stands in.
    pub body: String,
}

/// A fault that stopped the application.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FaultRecord {
    /// What happened, with its facts. Name: [`Fault::name`], message: its `Display`.
    pub fault: Fault,
    /// Where.
    pub place: Frame,
    /// Name of the task; empty for a fault in the initial values.
    pub task: String,
    /// Call sites from the place outwards.
    pub stack: Vec<Frame>,
    /// Start of the scan.
    pub time: Time,
    /// Number of the task's scan, from 1.
    pub cycle: u64,
}

impl std::fmt::Display for FaultRecord {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Frame { file, line, column, body } = &self.place;
        write!(f, "{} at {file}:{line}:{column} in {body}", self.fault)?;
        if !self.task.is_empty() {
            write!(f, ", task {}, scan {}", self.task, self.cycle)?;
        }
        for frame in &self.stack {
            write!(f, "\n  called from {}:{}:{} in {}", frame.file, frame.line, frame.column, frame.body)?;
        }
        Ok(())
    }
}
impl std::error::Error for FaultRecord {}

/// A fault as the scan leaves it: numbers only, so that recording one allocates nothing.
#[derive(Debug, Clone)]
pub(crate) struct RawFault {
    pub fault: Fault,
    pub site: u32,
    pub trace: [u32; takt_abi::TRACE_DEPTH],
    pub trace_len: usize,
    /// `None`: the initial values.
    pub task: Option<usize>,
    pub time: Time,
    pub cycle: u64,
}

impl RawFault {
    pub fn of(ctx: &Context, fault: Fault, task: Option<usize>, time: Time, cycle: u64) -> Self {
        let trace_len = (ctx.trace_len as usize).min(ctx.trace.len());
        Self { fault, site: ctx.fault_site, trace: ctx.trace, trace_len, task, time, cycle }
    }
    /// Of a scan that was ended from outside; it has no place.
    pub fn outside(fault: Fault, task: usize, time: Time, cycle: u64) -> Self {
        Self { fault, site: u32::MAX, trace: [0; takt_abi::TRACE_DEPTH], trace_len: 0, task: Some(task), time, cycle }
    }
    pub fn record(&self, program: &Program) -> FaultRecord {
        FaultRecord {
            fault: self.fault,
            place: frame(program, self.site),
            task: self.task.and_then(|t| program.tasks.get(t)).map_or_else(String::new, |t| t.name.clone()),
            stack: self.trace[..self.trace_len].iter().map(|s| frame(program, *s)).collect(),
            time: self.time,
            cycle: self.cycle,
        }
    }
}

fn frame(program: &Program, site: u32) -> Frame {
    let Some(Site { file, line, column, body }) = program.sites.get(site as usize).copied() else {
        return Frame { file: "?".into(), line: 0, column: 0, body: "?".into() };
    };
    Frame {
        file: program.files.get(file as usize).cloned().unwrap_or_else(|| "?".into()),
        line,
        column,
        body: program.bodies.get(body.0 as usize).map_or_else(|| "?".into(), |b| b.name.clone()),
    }
}
