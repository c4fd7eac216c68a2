//! A machine that is recorded, and one that plays a recording back.

use super::Machine;
use crate::project::Project;
use crate::recording::header::{Calls, Header, Identity, name_in, state_hash};
use crate::recording::stream::{Ear, Stream};
use crate::recording::writer::{Plan, Recording, Summary};
use serde_json::json;
use std::cell::RefCell;
use std::io;
use std::path::PathBuf;
use std::rc::Rc;
use takt_abi::Time;
use takt_engine::{BusSize, Checkpoint, Event, ExecutorKind, FaultRecord, Frame, Strayed};

/// What a machine has for a recording of itself.
#[derive(Debug, Default)]
pub(crate) struct Taped {
    pub(super) stream: Rc<RefCell<Option<Stream>>>,
    pub(super) calls: Rc<RefCell<Calls>>,
    recording: Option<Recording>,
}

impl Machine {
    /// Starts to record: into a file, or the last minutes for core files in a folder, or both. Before the first step.
    pub fn record(&mut self, project: &Project, file: Option<PathBuf>, cores: Option<PathBuf>) -> io::Result<()> {
        let size = self.bus_size();
        let header = Header {
            kind: "recording".into(),
            project: project.name.clone(),
            identity: Identity::of(project, &self.compiled, &self.program, size),
            engine: match self.executor {
                ExecutorKind::Jit => "jit".into(),
                ExecutorKind::Portable => "portable".into(),
                ExecutorKind::Interpreter => "interp".into(),
            },
        };
        let plan = Plan { file, cores, header, sources: sources(project) };
        let mut room = Checkpoint::default();
        self.engine.checkpoint_into(&mut room);
        let recording = Recording::start(plan, size, &room, self.taped.stream.clone(), self.taped.calls.clone())?;
        self.taped.recording = Some(recording);
        self.engine.record(Some(Box::new(Ear(self.taped.stream.clone()))));
        Ok(())
    }

    /// Before a step: a state goes to the recorder if one is due.
    pub(super) fn before_step(&mut self) {
        if let Some(stream) = self.taped.stream.borrow_mut().as_mut() {
            stream.between(&self.engine);
        }
    }

    /// After a step: a new fault goes to the recorder.
    pub(super) fn after_step(&mut self) {
        let Some(recording) = &self.taped.recording else { return };
        let faulted = self.engine.fault().is_some();
        let new = self.taped.stream.borrow_mut().as_mut().is_some_and(|stream| stream.take_fault(faulted));
        if new && let Some(record) = self.engine.fault().filter(|record| record.fault != takt_abi::Fault::Stopped) {
            recording.faulted(fault_json(record).to_string());
        }
    }

    /// Ends the recording and waits until it is written. `None`: there was none.
    pub fn finish_recording(&mut self) -> Option<Summary> {
        let recording = self.taped.recording.take()?;
        self.engine.record(None);
        let hash = format!("{:016x}", state_hash(&self.engine));
        let end = json!({ "cycles": self.cycles(), "time_ns": self.engine.now().0, "hash": hash });
        Some(recording.finish(end.to_string()))
    }

    fn bus_size(&self) -> BusSize {
        let io = self.engine.process_image();
        BusSize {
            drives: io.drives_in.len(),
            bits_in: io.bits_in.len(),
            bits_out: io.bits_out.len(),
            analog_in: io.analog_in.len(),
            analog_out: io.analog_out.len(),
        }
    }

    /// A step as it was recorded.
    pub(crate) fn replay(&mut self, now: Time, events: &[Event]) -> Result<(), Strayed> {
        self.started.get_or_insert(now);
        self.engine.replay(now, events)
    }

    /// Whether the condition of `--until` holds; without one it does not.
    pub fn until_holds(&mut self) -> Result<bool, takt_abi::Fault> {
        match &self.until {
            Some(watch) => self.engine.evaluate(watch.body).map(|value| value != 0),
            None => Ok(false),
        }
    }
}

/// A fault for tools.
pub(crate) fn fault_json(record: &FaultRecord) -> serde_json::Value {
    let frame = |frame: &Frame| json!({ "file": frame.file, "line": frame.line, "column": frame.column, "body": frame.body });
    json!({
        "code": record.fault.name(),
        "message": record.fault.to_string(),
        "file": record.place.file,
        "line": record.place.line,
        "task": record.task,
        "cycle": record.cycle,
        "time_ns": record.time.0,
        "stack": std::iter::once(&record.place).chain(&record.stack).map(frame).collect::<Vec<_>>(),
    })
}

/// The texts of a project.
fn sources(project: &Project) -> String {
    let list: Vec<_> =
        project.sources.list.iter().map(|source| json!({ "name": name_in(project, &source.name), "text": source.text })).collect();
    let manifest = project.manifest_file.as_ref().map(|(_, text)| text);
    json!({ "name": project.name, "sources": list, "manifest": manifest }).to_string()
}
