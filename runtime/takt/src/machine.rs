//! A machine that runs: compiled program, engine, simulated bus and the operator's script.
//!
//! [`Machine::new`] binds a project; [`Machine::step`] runs what is due next. Nothing here asks what time it is: machine time goes from release to release,
//! so a run is the same run every time. Pacing it to the wall clock is the command's business.

mod binding;
mod bus;
mod error;
mod limits;
mod operator;
mod taped;
pub mod variable;

pub use binding::{PlotPlaces, Shown, View};
pub use bus::Bus;
pub use error::{BuildError, End, VariableError};
pub(crate) use taped::fault_json;

use crate::host;
use crate::manifest::{Located, ManifestError};
use crate::program::{Compiled, Condition};
use crate::project::Project;
use crate::recording::host::Told;
use crate::{retain, values};
use operator::Operator;
use std::sync::Arc;
use takt_abi::{Host, Time};
use takt_engine::{Clock, Command, CommandError, Engine, ExecutorKind, FaultRecord, IoDriver, LoadError};
use takt_ir::{BodyId, Place, Program, Trigger};

/// Bytes of native stack that the tool's thread keeps for compiled code.
pub const NATIVE_STACK: usize = 240 << 20;

/// How a machine is to be run.
#[derive(Debug, Clone, Default)]
pub struct Setup {
    /// Machine code or interpreter.
    pub executor: ExecutorKind,
    /// Virtual, or the machine's.
    pub clock: Clock,
    /// Nanoseconds of some clock, for the statistics of execution times.
    pub stopwatch: Option<fn() -> u64>,
    /// The calling thread is woken within a scan when a higher task is due or a watchdog strikes, under [`crate::clock::machine_time`]. Without it
    /// scans look at the clock now and then.
    pub alarm: bool,
    /// Retained values to start from; with it, snapshots of them come out of the engine.
    pub retained: Option<retain::Source>,
    /// An ST condition that ends the run.
    pub until: Option<String>,
    /// Where tasks are interrupted in virtual time (tests).
    pub preempt: Vec<takt_engine::Preemption>,
    /// Bytes of native stack that the calling thread keeps for compiled code. `None`: what an ordinary thread has.
    pub native_stack: Option<usize>,
}

/// A condition with its text.
#[derive(Debug, Clone)]
pub(crate) struct Watch {
    text: String,
    body: BodyId,
}

/// A machine.
#[derive(Debug)]
pub struct Machine {
    engine: Engine,
    program: Arc<Program>,
    bus: Bus,
    view: View,
    operator: Operator,
    done: Option<Watch>,
    timeout: Option<Time>,
    plotted: Option<Watch>,
    until: Option<Watch>,
    fastest: usize,
    /// Time of the first scan.
    started: Option<Time>,
    compiled: Compiled,
    executor: ExecutorKind,
    taped: taped::Taped,
    /// What came of the retained values.
    migration: Option<retain::Migration>,
}

impl Machine {
    /// Compiles and binds a project.
    pub fn new(project: &Project, setup: Setup) -> Result<Self, BuildError> {
        Self::wrapped(project, setup, |driver, host| (driver, host))
    }

    /// The same with another bus and host in the place of, or around, its own.
    pub fn wrapped(
        project: &Project,
        setup: Setup,
        wrap: impl FnOnce(Box<dyn IoDriver>, Box<dyn Host>) -> (Box<dyn IoDriver>, Box<dyn Host>),
    ) -> Result<Self, BuildError> {
        let mut conditions = Conditions::default();
        let simulation = project.manifest.simulation.as_ref();
        let done = conditions.add(simulation.and_then(|s| s.done.as_ref()));
        let steps = simulation.map_or(&[][..], |s| &s.operator);
        let waits: Vec<_> = steps.iter().map(|step| conditions.add(step.when.as_ref())).collect();
        let plotted = conditions.add(project.manifest.plot.as_ref().and_then(|plot| plot.only.as_ref()));
        let until = setup.until.map(|text| conditions.push(Condition { text, span: None }));
        let mut compiled = crate::program::compile(project, &conditions.list);
        let Some(program) = compiled.program.take() else { return Err(BuildError::Program(Box::new(compiled))) };
        let watch = |index: Option<usize>| index.map(|i| Watch { text: conditions.list[i].text.clone(), body: compiled.conditions[i] });

        let bus = bus::open(&project.manifest, bus_period(project, &program))
            .map_err(|error| BuildError::Manifest(project.errors(vec![error])))?;
        let bound = binding::bind(project, &program, &bus.channels).map_err(BuildError::Manifest)?;
        let operator = Operator::new(bound.steps, waits.into_iter().map(watch).collect());
        let migration = setup.retained.as_ref().and_then(|source| retain::migrate::migrate(&program, source));
        let lenient = setup.retained.as_ref().is_some_and(|source| source.lenient);
        if let Some(migration) = migration.as_ref().filter(|m| !m.refused.is_empty() && !lenient) {
            return Err(BuildError::Retain(migration.refused.clone()));
        }
        let interval = project.manifest.retain_interval.unwrap_or(retain::INTERVAL);
        let ordinary = takt_engine::Options::default();
        let (driver, bus) = bus.split();
        let (driver, host) = wrap(driver, Box::new(host::open(project.root.clone()).map_err(BuildError::Files)?));
        let taped = taped::Taped::default();
        let options = takt_engine::Options {
            executor: setup.executor,
            native_stack: setup.native_stack.unwrap_or(ordinary.native_stack),
            bus_task: project.manifest.bus_task.as_ref().map(|task| task.value.clone()),
            host: Box::new(Told::new(host, taped.stream.clone(), taped.calls.clone())),
            axes: bound.axes,
            wires: bound.wires,
            restore: migration.as_ref().map(|migration| migration.restore.clone()),
            retain_interval: setup.retained.is_some().then_some(interval),
            clock: setup.clock,
            stopwatch: setup.stopwatch,
            preempt: setup.preempt,
            task_limits: limits::limits(&project.manifest, &program),
            alarm: setup.alarm.then(crate::clock::alarm).flatten(),
            ..ordinary
        };
        let mut engine = takt_engine::load(program.clone(), options, driver).map_err(|error| load_error(project, error))?;
        compiled.conditions.iter().for_each(|body| engine.prepare(*body));
        let fastest = fastest_task(&program).unwrap_or(engine.bus_task());
        Ok(Self {
            fastest,
            started: None,
            done: watch(done),
            timeout: simulation.and_then(|s| s.timeout),
            plotted: watch(plotted),
            until: watch(until),
            engine,
            program,
            bus,
            view: bound.view,
            operator,
            compiled,
            executor: setup.executor,
            taped,
            migration,
        })
    }

    /// Lets the operator act, then runs what is due next; false if the fastest task was not. Under a real clock pass its time.
    pub fn step_at(&mut self, now: Time) -> bool {
        self.started.get_or_insert(now);
        self.operator.act(&mut self.engine, &mut self.bus, now);
        let before = self.cycles();
        self.before_step();
        self.engine.step(now);
        self.after_step();
        self.cycles() > before
    }

    /// The same in machine time, from release to release.
    pub fn step(&mut self) -> bool {
        self.step_at(self.engine.next_release())
    }

    /// Whether the run is over by itself: fault, `--until`, end of the demonstration, or its time-out.
    pub fn ended(&mut self) -> Option<End> {
        if self.engine.fault().is_some() {
            return Some(End::Fault);
        }
        for (watch, end) in [(&self.until, End::Until), (&self.done, End::Done)] {
            let Some(watch) = watch else { continue };
            match self.engine.evaluate(watch.body) {
                Ok(0) => {}
                Ok(_) => return Some(end),
                Err(fault) => return Some(End::Condition { text: watch.text.clone(), fault }),
            }
        }
        if let Some((text, fault)) = self.operator.failed() {
            return Some(End::Condition { text: text.into(), fault });
        }
        let late = self.timeout.is_some_and(|timeout| self.elapsed() >= timeout);
        let waiting_for = || self.operator.waiting_for().or(self.done.as_ref().map(|done| done.text.as_str())).unwrap_or("?").to_string();
        late.then(|| End::TimedOut { waiting_for: waiting_for() })
    }

    /// Steps until the run is over by itself or `limit` of machine time has passed; `seen` looks at the machine after each scan of the fastest task.
    pub fn run(&mut self, limit: Time, mut seen: impl FnMut(&mut Self)) -> Option<End> {
        while self.elapsed() < limit {
            if self.step() {
                seen(self);
            }
            if let Some(end) = self.ended() {
                return Some(end);
            }
        }
        None
    }

    /// Steps until `condition` holds, at most for `limit` of machine time; whether it did.
    pub fn run_until(&mut self, limit: Time, mut condition: impl FnMut(&mut Self) -> bool) -> bool {
        let end = Time(self.elapsed().0.saturating_add(limit.0));
        while self.elapsed() < end {
            self.step();
            if condition(self) {
                return true;
            }
        }
        false
    }

    /// Takes the script away: whoever drives the machine is the operator.
    pub fn dismiss_operator(&mut self) {
        self.operator = Operator::default();
        (self.done, self.timeout) = (None, None);
    }

    /// Machine time that has passed: the scans so far and the rest of their periods.
    pub fn elapsed(&self) -> Time {
        self.since_start(self.engine.next_release())
    }

    /// Start of the last scan; the first one is at 0.
    pub fn now(&self) -> Time {
        self.since_start(self.engine.now())
    }

    fn since_start(&self, time: Time) -> Time {
        self.started.map_or(Time(0), |started| Time(time.0 - started.0))
    }

    /// Scans of the fastest task.
    pub fn cycles(&self) -> u64 {
        self.engine.statistics(self.fastest).cycles
    }

    /// Execution times of the fastest task.
    pub fn statistics(&self) -> &takt_engine::TaskStatistics {
        self.engine.statistics(self.fastest)
    }

    /// How many variables are forced.
    pub fn forces(&self) -> usize {
        self.engine.force_count()
    }

    /// The faults that stopped isolated tasks alone.
    pub fn task_faults(&self) -> impl Iterator<Item = &FaultRecord> {
        (0..self.program.tasks.len()).filter_map(|task| self.engine.task_fault(task))
    }

    /// The fault that stopped the program.
    pub fn fault(&self) -> Option<&FaultRecord> {
        self.engine.fault()
    }

    /// Clears a fault and starts the program again, with the values that this kind of restart keeps.
    pub fn reset(&mut self, kind: takt_engine::Reset) -> Result<(), Box<FaultRecord>> {
        self.engine.reset(kind)
    }

    /// The engine.
    pub fn engine(&mut self) -> &mut Engine {
        &mut self.engine
    }

    /// What came of the retained values that were there.
    pub fn migration(&self) -> Option<&retain::Migration> {
        self.migration.as_ref()
    }

    /// The simulated bus: inputs, drives that fail, switches that stick.
    pub fn bus(&mut self) -> &mut Bus {
        &mut self.bus
    }

    /// The program.
    pub fn program(&self) -> &Arc<Program> {
        &self.program
    }

    /// What the compiler said (warnings, when there is a machine).
    pub fn compiled(&self) -> &Compiled {
        &self.compiled
    }

    /// What the manifest wants shown.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Whether the manifest says when the demonstration is over.
    pub fn is_demonstration(&self) -> bool {
        self.done.is_some()
    }

    /// The fastest task (index into [`Program::tasks`]).
    pub fn fastest(&self) -> usize {
        self.fastest
    }

    /// The condition of [`Machine::is_plotted`].
    pub fn plot_condition(&self) -> Option<BodyId> {
        self.plotted.as_ref().map(|watch| watch.body)
    }

    /// Whether this scan belongs to the plot.
    pub fn is_plotted(&mut self) -> bool {
        let Some(watch) = &self.plotted else { return true };
        self.engine.evaluate(watch.body).is_ok_and(|value| value != 0)
    }

    /// The place of a variable.
    pub fn place(&self, path: &str) -> Result<Place, VariableError> {
        takt_ir::resolve(&self.program, path).map_err(VariableError::Name)
    }

    /// The bytes of a variable.
    pub fn bytes(&self, place: Place) -> &[u8] {
        self.engine.read(place)
    }

    /// A number, BOOL as 0 or 1; NaN if it is none.
    pub fn number_at(&self, place: Place) -> f64 {
        values::to_number(&self.program.types, place.ty, self.bytes(place)).unwrap_or(f64::NAN)
    }

    /// A variable as a number, BOOL as 0 or 1.
    pub fn number(&self, path: &str) -> Result<f64, VariableError> {
        let place = self.place(path)?;
        values::to_number(&self.program.types, place.ty, self.bytes(place)).ok_or_else(|| self.kind(path, place, "a number"))
    }

    /// A BOOL.
    pub fn boolean(&self, path: &str) -> Result<bool, VariableError> {
        Ok(self.number(path)? != 0.0)
    }

    /// A STRING, without quotes.
    pub fn string(&self, path: &str) -> Result<String, VariableError> {
        let place = self.place(path)?;
        match takt_ir::read_scalar(&self.program.types, place.ty, self.bytes(place)) {
            Some(takt_ir::Scalar::Text(text)) => Ok(text),
            _ => Err(self.kind(path, place, "a STRING")),
        }
    }

    fn kind(&self, path: &str, place: Place, expected: &'static str) -> VariableError {
        VariableError::Kind { path: path.into(), found: self.program.types.name(place.ty), expected }
    }

    /// A variable as an ST literal.
    pub fn literal(&self, path: &str) -> Result<String, VariableError> {
        let place = self.place(path)?;
        Ok(takt_ir::format_value(&self.program.types, place.ty, self.bytes(place)))
    }

    /// Writes a variable once, between scans; `value` is an ST literal.
    pub fn set(&mut self, path: &str, value: &str) -> Result<(), VariableError> {
        let (place, bytes) = variable::assignment(&self.program, path, value)?;
        match self.engine.command(&Command::Write { place, bytes }) {
            Err(CommandError::Access(error)) => Err(VariableError::Access { path: path.into(), error }),
            _ => Ok(()),
        }
    }
}

#[derive(Default)]
struct Conditions {
    list: Vec<Condition>,
}

impl Conditions {
    fn push(&mut self, condition: Condition) -> usize {
        self.list.push(condition);
        self.list.len() - 1
    }
    fn add(&mut self, text: Option<&Located<String>>) -> Option<usize> {
        text.map(|text| self.push(Condition::of_manifest(text)))
    }
}

/// Period of the task that owns the bus; 10 ms if it has none.
fn bus_period(project: &Project, program: &Program) -> Time {
    let named = project
        .manifest
        .bus_task
        .as_ref()
        .and_then(|name| program.tasks.iter().position(|task| task.name.eq_ignore_ascii_case(&name.value)));
    match named.or_else(|| fastest_task(program)).map(|i| program.tasks[i].trigger) {
        Some(Trigger::Cyclic(period)) => Time(period),
        _ => Time::from_millis(10),
    }
}

fn fastest_task(program: &Program) -> Option<usize> {
    let cyclic = program.tasks.iter().enumerate().filter_map(|(i, task)| match task.trigger {
        Trigger::Cyclic(period) => Some((period, i)),
        _ => None,
    });
    cyclic.min().map(|(_, i)| i)
}

/// A refusal of the engine, shown at the place in the manifest that it is about.
fn load_error(project: &Project, error: LoadError) -> BuildError {
    let manifest = &project.manifest;
    let (span, message) = match &error {
        LoadError::BusTask { .. } => (manifest.bus_task.as_ref().map(|task| task.span.clone()), error.to_string()),
        LoadError::TaskLimits { name, .. } => {
            let task = manifest.tasks.iter().find(|task| task.name.value == *name);
            (task.map(|task| task.name.span.clone()), error.to_string())
        }
        LoadError::Axis { name, problem } => {
            (manifest.axes.iter().find(|axis| axis.name.value == *name).map(|axis| axis.name.span.clone()), problem.to_string())
        }
        LoadError::Wire { name, problem } => {
            (manifest.wires.iter().find(|wire| wire.variable.value == *name).map(|wire| wire.variable.span.clone()), problem.to_string())
        }
        _ => (None, String::new()),
    };
    match span {
        Some(span) => BuildError::Manifest(project.errors(vec![ManifestError { span, message, help: String::new() }])),
        None => BuildError::Load(error),
    }
}

#[cfg(test)]
mod tests;
