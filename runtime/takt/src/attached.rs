//! What is attached to a machine while it runs: its journal and its control socket.

use crate::clock;
use crate::control::{self, About, Control, Port};
use crate::journal::{Entry, Event, Journal, Monitor};
use crate::machine::Machine;
use crate::project::Project;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// How long a machine that stands still sleeps between two looks.
const LOOK: Duration = Duration::from_millis(1);

/// Journal and control socket; either may be absent. Fields are dropped in order: the socket goes before the journal.
#[derive(Debug, Default)]
pub struct Attached {
    control: Option<Control>,
    port: Option<Port>,
    monitor: Option<Monitor>,
    journal: Option<Journal>,
    faulted: bool,
    forces: Arc<AtomicUsize>,
}

/// Where they are.
#[derive(Debug, Clone, Default)]
pub struct Places {
    /// The state folder, for the journal.
    pub state: Option<PathBuf>,
    /// The socket.
    pub socket: Option<PathBuf>,
}

impl Places {
    /// Both in the state folder, if there is one, unless the socket is to be elsewhere.
    pub fn of(state: Option<&Path>, socket: Option<&Path>) -> Self {
        let own = state.map(|folder| folder.join(control::NAME));
        Self { state: state.map(Into::into), socket: socket.map(Into::into).or(own) }
    }
}

impl Attached {
    /// Opens what there is a place for. The journal begins with the start of the run.
    pub fn open(places: &Places, project: &Project, machine: &mut Machine, real_time: bool) -> Result<Self, String> {
        let mut attached = Self::default();
        let program = machine.program().clone();
        if let Some(folder) = &places.state {
            let tasks = program.tasks.iter().map(|task| task.name.clone()).collect();
            let (journal, scans) = Journal::open(folder, tasks).map_err(|error| format!("the journal in {}: {error}", folder.display()))?;
            attached.monitor = Some(Monitor::new(scans, machine.engine()));
            journal.post(Entry::new(Event::Start).variable(&project.name).message(format!(
                "takt {}, process {}, {}",
                env!("CARGO_PKG_VERSION"),
                std::process::id(),
                if real_time { "real time" } else { "virtual time" }
            )));
            let (files, size) = (project.sources.list.len(), program.image_size);
            journal.post(Entry::new(Event::Load).variable(&project.name).message(format!("{files} source files, {size} bytes of memory")));
            attached.journal = Some(journal);
        }
        if let Some(socket) = &places.socket {
            let about = About { project: project.name.clone(), real_time, program };
            let poster = attached.journal.as_ref().and_then(Journal::poster);
            let stop = machine.engine().stop_handle();
            let (control, port) = Control::open(socket.clone(), about, poster, stop).map_err(|error| error.to_string())?;
            (attached.control, attached.port) = (Some(control), Some(port));
        }
        Ok(attached)
    }

    /// Whether somebody can reset a program that has faulted.
    pub fn is_reachable(&self) -> bool {
        self.port.is_some()
    }

    /// The path of the socket.
    pub fn socket(&self) -> Option<&Path> {
        self.control.as_ref().map(Control::path)
    }

    /// A line of the journal.
    pub fn post(&self, entry: Entry) {
        if let Some(journal) = &self.journal {
            journal.post(entry);
        }
    }

    /// After a step; `scanned`: with a scan of the fastest task.
    pub fn stepped(&mut self, machine: &mut Machine, scanned: bool) {
        if let (Some(port), true) = (&mut self.port, scanned) {
            port.stepped();
        }
        self.look(machine);
    }

    /// How many variables are forced, for the live line.
    pub fn force_count(&self) -> Arc<AtomicUsize> {
        self.forces.clone()
    }

    fn look(&mut self, machine: &mut Machine) {
        self.forces.store(machine.forces(), Ordering::Relaxed);
        if let Some(port) = &mut self.port {
            port.serve(machine.engine());
        }
        if let Some(monitor) = &mut self.monitor {
            monitor.look(machine.engine());
        }
    }

    /// Whether the scans stand still or go one by one.
    pub fn is_held(&self) -> bool {
        self.port.as_ref().is_some_and(|port| port.mode() != control::Mode::Running)
    }

    /// Stands still until the machine shall go on, for a scan or for good, or `stop`. No machine time passes meanwhile.
    pub fn stand_still(&mut self, machine: &mut Machine, stop: impl Fn() -> bool) {
        while self.port.as_ref().is_some_and(Port::is_paused) && !stop() && !self.end_requested() {
            std::thread::sleep(LOOK);
            self.look(machine);
        }
        clock::go_on_from(machine.engine().next_release());
    }

    /// Whether somebody wants the run to end.
    pub fn end_requested(&self) -> bool {
        self.port.as_ref().is_some_and(Port::end_requested)
    }

    /// Whether the program has faulted since this was asked last, and the run goes on so that it can be reset.
    pub fn newly_faulted(&mut self, faulted: bool) -> bool {
        let before = std::mem::replace(&mut self.faulted, faulted);
        faulted && !before
    }
}
