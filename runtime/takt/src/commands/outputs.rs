//! What a run writes while it runs: trace, plot and live line.
//!
//! In virtual time they look at the machine after each scan. Under the real clock they live on a thread of their own ([`Writer`]), and the resource
//! thread only copies bytes into a ring.

use super::run::{places, usage};
use super::{Exit, RunArgs, live::Live};
use crate::console;
use crate::language::{self, Word};
use crate::machine::Machine;
use crate::plot::Recording;
use crate::realtime::samples::{self, Look, Receiver};
use crate::trace::{self, Trace};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;
use takt_ir::Place;

/// How often the writer looks for samples.
const LOOK: Duration = Duration::from_millis(5);

/// Trace, plot and live line.
pub(super) struct Outputs {
    trace: Option<(Trace, Vec<Place>)>,
    plot: Option<(Recording, File)>,
    live: Live,
    failed: Option<std::io::Error>,
}

impl Outputs {
    pub(super) fn open(args: &RunArgs, machine: &Machine) -> Result<Self, Exit> {
        let trace = match &args.trace {
            Some(path) => {
                let places = places(machine, &args.record, "--record")?;
                let file = trace::create(path, &args.record).map_err(|error| cannot_write(path, &error))?;
                Some((file, places.into_iter().map(|(_, place)| place).collect()))
            }
            None => None,
        };
        let plot = match (&args.plot, &machine.view().plot) {
            (None, _) => None,
            (Some(path), Some(places)) => Some((Recording::new(places), File::create(path).map_err(|error| cannot_write(path, &error))?)),
            (Some(_), None) => return Err(usage("--plot: the manifest has no [plot]; docs/manifest.md shows one")),
        };
        Ok(Self { trace, plot, live: Live::new(!args.json, &machine.view().live), failed: None })
    }

    /// Where the live line finds how many variables are forced.
    pub(super) fn show_forces(&mut self, forces: std::sync::Arc<std::sync::atomic::AtomicUsize>) {
        self.live.show_forces(forces);
    }

    /// The variables that are looked at.
    fn places(&self) -> Vec<Place> {
        let trace = self.trace.iter().flat_map(|(_, places)| places.iter().copied());
        let plot = self.plot.iter().flat_map(|(recording, _)| recording.places());
        trace.chain(plot).chain(self.live.places()).collect()
    }

    /// Whether there is anything to write.
    fn is_needed(&self) -> bool {
        self.trace.is_some() || self.plot.is_some() || self.live.is_on()
    }

    /// After a scan of the fastest task.
    fn scanned(&mut self, machine: &impl Look, plotted: bool) {
        if let Some((trace, places)) = &mut self.trace {
            let values = places.iter().map(|place| machine.literal(*place));
            if let Err(error) = trace.row(machine.time(), values) {
                self.failed.get_or_insert(error);
            }
        }
        if let Some((plot, _)) = &mut self.plot
            && plotted
        {
            plot.add(machine);
        }
        self.live.show(machine);
    }

    fn finish(&mut self, args: &RunArgs) -> Result<(), Exit> {
        self.live.clear();
        let language = language::of_environment();
        if let (Some((trace, _)), Some(path)) = (self.trace.take(), &args.trace) {
            let failed = self.failed.take().map_or_else(|| trace.finish(), Err);
            failed.map_err(|error| cannot_write(path, &error))?;
            console::tell(format_args!("{}: {}", Word::TraceWritten.text(language), path.display()));
        }
        if let (Some((plot, mut file)), Some(path)) = (self.plot.take(), &args.plot) {
            file.write_all(plot.draw().as_bytes()).map_err(|error| cannot_write(path, &error))?;
            console::tell(format_args!("{}: {}", Word::PlotWritten.text(language), path.display()));
        }
        Ok(())
    }
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Exit {
    usage(&format!("{} cannot be written: {error}", path.display()))
}

/// Where the outputs are.
pub(super) enum Writer {
    /// With the machine: virtual time.
    Here(Box<Outputs>),
    /// On their own thread: real time.
    There(JoinHandle<(Outputs, u64)>),
    /// There is nothing to write.
    Nowhere,
}

impl Writer {
    /// Starts the thread if the machine runs on the real clock.
    pub(super) fn start(outputs: Outputs, machine: &mut Machine, real: bool) -> Result<Self, Exit> {
        if !outputs.is_needed() {
            return Ok(Self::Nowhere);
        }
        if !real {
            return Ok(Self::Here(Box::new(outputs)));
        }
        let condition = outputs.plot.as_ref().and_then(|_| machine.plot_condition());
        let (sender, receiver) = samples::ring(machine.program(), machine.fastest(), outputs.places(), condition);
        machine.engine().observe(Some(Box::new(sender)));
        let thread = std::thread::Builder::new().name("outputs".into()).spawn(move || write(outputs, receiver));
        let thread = thread.map_err(|error| usage(&format!("there is no thread for trace, plot and live line: {error}")))?;
        Ok(Self::There(thread))
    }

    /// After a step with a scan of the fastest task.
    pub(super) fn scanned(&mut self, machine: &mut Machine) {
        if let Self::Here(outputs) = self {
            let plotted = outputs.plot.is_some() && machine.is_plotted();
            outputs.scanned(machine, plotted);
        }
    }

    /// Writes what is left; how many samples were lost.
    pub(super) fn finish(self, machine: &mut Machine, args: &RunArgs) -> Result<u64, Exit> {
        match self {
            Self::Nowhere => Ok(0),
            Self::Here(mut outputs) => outputs.finish(args).map(|()| 0),
            Self::There(thread) => {
                machine.engine().observe(None);
                let (mut outputs, lost) = thread.join().map_err(|_| usage("the thread of trace, plot and live line has ended early"))?;
                outputs.finish(args)?;
                if lost > 0 {
                    console::tell(format_args!("{}: {lost} {}", warning(), Word::SamplesLost.text(language::of_environment())));
                }
                Ok(lost)
            }
        }
    }
}

pub(super) fn warning() -> &'static str {
    Word::Warning.text(language::of_environment())
}

/// The thread: until the sender has gone and everything it sent is written.
fn write(mut outputs: Outputs, mut receiver: Receiver) -> (Outputs, u64) {
    loop {
        let over = receiver.is_over();
        while receiver.receive() {
            let plotted = receiver.flag();
            outputs.scanned(&receiver, plotted);
        }
        if over {
            return (outputs, receiver.lost());
        }
        std::thread::sleep(LOOK);
    }
}
