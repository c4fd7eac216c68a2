//! Loading: everything that can be refused is refused here, and everything a scan needs is allocated here.

use crate::axis::AxisProblem;
use crate::axis::stage::Stage;
use crate::bus::{Channel, IoDriver, ProcessImage, Signal, Wire};
use crate::core::Core;
use crate::engine::Engine;
use crate::executor::Executor;
use crate::fault::FaultRecord;
use crate::latch::Latches;
use crate::limits::Limits;
use crate::mapping::Mapping;
use crate::memory::{Image, Lane, Pinned};
use crate::options::{Clock, ExecutorKind, Options};
use crate::retain::Keeper;
use crate::schedule::{TaskState, default_bus_task};
use crate::system::SystemInfo;
use std::cell::OnceCell;
use std::rc::Rc;
use std::sync::Arc;
use takt_abi::{Elem, Env, Plain, Time};
use takt_ir::{Program, Type, VerifyError, verify};
use takt_jit::JitError;

/// Why a program cannot be loaded.
#[derive(Debug, Clone, PartialEq)]
pub enum LoadError {
    /// The program breaks a rule of the IR (a defect of the compiler).
    Verify(VerifyError),
    /// The program cannot be compiled to machine code (a defect of Takt).
    Jit(JitError),
    /// There is no task.
    NoTask,
    /// No task has this name.
    BusTask {
        /// The name.
        name: String,
        /// Those that exist.
        known: Vec<String>,
    },
    /// Limits are given for a task that does not exist.
    TaskLimits {
        /// The name.
        name: String,
        /// Those that exist.
        known: Vec<String>,
    },
    /// The task that owns the bus is isolated: without it there is no application.
    IsolatedBus {
        /// Its name.
        name: String,
    },
    /// The image does not fit in memory.
    Memory {
        /// Bytes asked for.
        size: u32,
    },
    /// The deepest calls of the program may need more native stack than the thread has.
    NativeStack {
        /// Bytes needed at the most.
        needed: usize,
        /// Bytes given ([`Options::native_stack`]).
        given: usize,
    },
    /// An axis is configured wrongly.
    Axis {
        /// Path of its variable.
        name: String,
        /// What is wrong.
        problem: AxisProblem,
    },
    /// A variable is wired wrongly.
    Wire {
        /// Path of the variable.
        name: String,
        /// What is wrong.
        problem: WireProblem,
    },
    /// Retained values that are not those of a variable of the program.
    Restore {
        /// Number of the part.
        part: usize,
    },
    /// The initial values ended in a fault.
    Initial(Box<FaultRecord>),
}

/// What is wrong with a wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum WireProblem {
    /// The bus has no such channel.
    NoChannel {
        /// Index asked for.
        index: usize,
        /// How many there are of its kind.
        count: usize,
    },
    /// The variable's type does not go with the channel.
    Type {
        /// Type of the variable.
        found: String,
        /// What the channel takes.
        expected: &'static str,
    },
    /// The variable lies outside the image.
    Outside,
    /// The safe value has the wrong kind (TRUE/FALSE on analogue, a number on digital), or is not finite.
    Safe,
    /// Two variables drive this output, or two inputs write this variable.
    Twice {
        /// The other variable.
        with: String,
    },
}

impl std::fmt::Display for WireProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoChannel { index, count } => write!(f, "there is no channel {index}: the bus has {count} of its kind"),
            Self::Type { found, expected } => write!(f, "the variable is `{found}`, the channel takes {expected}"),
            Self::Outside => write!(f, "the variable lies outside the program's memory"),
            Self::Safe => write!(f, "the safe value does not go with the channel"),
            Self::Twice { with } => write!(f, "it collides with `{with}`"),
        }
    }
}

impl std::fmt::Display for LoadError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Verify(error) => write!(f, "the program is not sound (a defect of Takt; please report it): {error}"),
            Self::Jit(error) => write!(f, "the program cannot be compiled to machine code: {error}"),
            Self::NoTask => write!(f, "the program has no task"),
            Self::BusTask { name, known } | Self::TaskLimits { name, known } => {
                write!(f, "there is no task `{name}`; there are: {}", known.join(", "))
            }
            Self::IsolatedBus { name } => {
                write!(f, "the task `{name}` owns the bus, so its faults stop the application: take its {{attribute 'isolated'}} away")
            }
            Self::Memory { size } => write!(f, "no memory for an image of {size} bytes"),
            Self::NativeStack { needed, given } => write!(
                f,
                "the deepest calls of the program may need {} MiB of stack and there are {} MiB: make the functions that call themselves smaller, or move their large variables out of them",
                needed >> 20,
                given >> 20
            ),
            Self::Axis { name, problem } => write!(f, "axis `{name}`: {problem}"),
            Self::Wire { name, problem } => write!(f, "wire `{name}`: {problem}"),
            Self::Restore { part } => write!(f, "part {part} of the retained values does not go with the program"),
            Self::Initial(record) => write!(f, "the initial values ended in a fault: {record}"),
        }
    }
}
impl std::error::Error for LoadError {}

/// Prepares a program for its first scan: verifies it, compiles it if asked to, checks axes and wires against `driver`, makes the resources and runs the
/// initial values.
pub fn load(program: Arc<Program>, options: Options, driver: Box<dyn IoDriver>) -> Result<Engine, LoadError> {
    verify(&program).map_err(LoadError::Verify)?;
    let bus = bus_task(&program, options.bus_task.as_deref())?;
    if program.tasks[bus].isolated {
        return Err(LoadError::IsolatedBus { name: program.tasks[bus].name.clone() });
    }
    check_axes(&program, &options, driver.size().drives)?;
    let links = links(&program, &options.wires, driver.as_ref())?;
    let executor = match options.executor {
        ExecutorKind::Interpreter => Executor::Interpreter,
        ExecutorKind::Jit => Executor::Jit(Rc::new(takt_jit::compile(&program).map_err(LoadError::Jit)?)),
        ExecutorKind::Portable => {
            Executor::Jit(Rc::new(takt_jit::compile_for(&program, takt_jit::Processor::Common).map_err(LoadError::Jit)?))
        }
    };
    let mut image = Image::new(program.image_size as usize).ok_or(LoadError::Memory { size: program.image_size })?;
    let mut env = Pinned::new(Env {
        task: bus as u32,
        bus_task: bus as u32,
        classes: program.instances(),
        heap: program.heap(),
        ..Env::new(Time(0), options.host)
    });
    let mut lane = || Lane::new(&program, &mut image, &mut env, options.depth_limit);
    let mut tasks: Vec<_> = (0..program.tasks.len()).map(|i| TaskState::new(&program, i, lane())).collect();
    limit(&program, &mut tasks, options.limits, &options.task_limits)?;
    let spare = Pinned::new(lane());
    let period = tasks[bus].period;
    let system = SystemInfo::new(&program, &tasks);
    env.get_mut().bus_period = period;
    if let Some(part) = options.restore.as_ref().and_then(|restore| restore.defect(&program)) {
        return Err(LoadError::Restore { part });
    }
    let axes: Vec<u32> = options.axes.iter().map(|axis| axis.place.offset).collect();
    let latches = Latches::new(&program, bus, |start, len| written_by_bus(&program, &axes, &links, start, len));
    let keeper = options.retain_interval.filter(|_| !program.retained.is_empty()).map(|interval| Keeper::new(&program, interval));
    let mut preempt = options.preempt;
    preempt.sort_by_key(|p| (p.task, p.cycle, p.at_fuel));
    let recorded = Vec::with_capacity(if matches!(options.clock, Clock::Real(_)) { 1 << 16 } else { 0 });
    let mut core = Box::new(Core {
        executor,
        image,
        env,
        tasks,
        spare,
        bus,
        stage: Stage::new(options.axes, period.seconds()),
        links,
        system,
        mappings: program.mapped.iter().map(|mapped| Mapping::new(&program, *mapped)).collect(),
        io: ProcessImage::new(driver.size()),
        driver,
        io_fault: None,
        io_faults: 0,
        forces: crate::force::Forces::default(),
        latches,
        keeper,
        depth_limit: options.depth_limit,
        fuel_limit: options.fuel_limit.min(i64::MAX as u64 / 2),
        clock: options.clock,
        alarm: options.alarm,
        observer: None,
        stopwatch: options.stopwatch,
        preempt,
        recorded,
        recorder: None,
        script: None,
        stop: Arc::default(),
        fault: None,
        record: OnceCell::new(),
        now: Time(0),
        steps: 0,
        current: None,
        inner_ns: 0,
        inner_time: Time(0),
        scan_started: Time(0),
        program,
    });
    let needed = core.native_stack();
    if needed > options.native_stack {
        return Err(LoadError::NativeStack { needed, given: options.native_stack });
    }
    core.initialise(options.restore.as_ref()).map_err(LoadError::Initial)?;
    Ok(Engine::new(core))
}

/// Whether the bus writes into a stretch of the image: inputs, axes, variables with addresses from VAR_CONFIG.
fn written_by_bus(program: &Program, axes: &[u32], links: &[Link], start: u32, len: u32) -> bool {
    let meets = |offset: u32, bytes: u32| {
        u64::from(offset) < u64::from(start) + u64::from(len) && u64::from(start) < u64::from(offset) + u64::from(bytes)
    };
    axes.iter().any(|offset| meets(*offset, size_of::<takt_abi::AxisRef>() as u32))
        || links.iter().any(|link| link.channel.is_input() && meets(link.offset as u32, 8))
        || program.mapped.iter().any(|mapped| meets(mapped.offset, program.types.size(mapped.ty)))
}

fn bus_task(program: &Program, name: Option<&str>) -> Result<usize, LoadError> {
    if program.tasks.is_empty() {
        return Err(LoadError::NoTask);
    }
    let Some(name) = name else {
        return Ok(default_bus_task(program));
    };
    program
        .tasks
        .iter()
        .position(|t| t.name.eq_ignore_ascii_case(name))
        .ok_or_else(|| LoadError::BusTask { name: name.into(), known: program.tasks.iter().map(|t| t.name.clone()).collect() })
}

/// Gives each task its limits.
fn limit(program: &Program, tasks: &mut [TaskState], all: Limits, single: &[(String, Limits)]) -> Result<(), LoadError> {
    tasks.iter_mut().for_each(|task| task.watched.limits = all);
    for (name, limits) in single {
        let index = program.tasks.iter().position(|t| t.name.eq_ignore_ascii_case(name));
        let known = || program.tasks.iter().map(|t| t.name.clone()).collect();
        let index = index.ok_or_else(|| LoadError::TaskLimits { name: name.clone(), known: known() })?;
        tasks[index].watched.limits = *limits;
    }
    Ok(())
}

fn check_axes(program: &Program, options: &Options, drives: usize) -> Result<(), LoadError> {
    for (i, axis) in options.axes.iter().enumerate() {
        let fail = |problem| LoadError::Axis { name: axis.name.clone(), problem };
        axis.check(program, drives).map_err(fail)?;
        let size = size_of::<takt_abi::AxisRef>() as u64;
        let overlap = |a: u32, b: u32| u64::from(a) < u64::from(b) + size && u64::from(b) < u64::from(a) + size;
        if let Some(other) = options.axes[..i].iter().find(|o| o.drive == axis.drive || overlap(o.place.offset, axis.place.offset)) {
            return Err(fail(AxisProblem::Taken { by: other.name.clone() }));
        }
    }
    Ok(())
}

fn links(program: &Program, wires: &[Wire], driver: &dyn IoDriver) -> Result<Vec<Link>, LoadError> {
    let mut links = Vec::with_capacity(wires.len());
    for (i, wire) in wires.iter().enumerate() {
        let fail = |problem| LoadError::Wire { name: wire.name.clone(), problem };
        links.push(Link::new(program, wire, driver).map_err(fail)?);
        let collides = |other: &&Wire| {
            if wire.channel.is_input() { other.channel.is_input() && other.place == wire.place } else { other.channel == wire.channel }
        };
        if let Some(other) = wires[..i].iter().find(collides) {
            return Err(fail(WireProblem::Twice { with: other.name.clone() }));
        }
    }
    Ok(links)
}

/// How a wired variable lies in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Bool,
    /// A bit of a byte.
    Bit(u8),
    Real,
    Lreal,
}

/// A checked wire.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link {
    offset: usize,
    kind: Kind,
    channel: Channel,
    safe: f64,
}

impl Link {
    fn new(program: &Program, wire: &Wire, driver: &dyn IoDriver) -> Result<Self, WireProblem> {
        let size = driver.size();
        let (index, count) = match wire.channel {
            Channel::BitIn(i) => (i, size.bits_in),
            Channel::BitOut(i) => (i, size.bits_out),
            Channel::AnalogIn(i) => (i, size.analog_in),
            Channel::AnalogOut(i) => (i, size.analog_out),
        };
        if index >= count {
            return Err(WireProblem::NoChannel { index, count });
        }
        let digital = matches!(wire.channel, Channel::BitIn(_) | Channel::BitOut(_));
        let kind = match program.types.all().get(wire.place.ty.0 as usize) {
            Some(Type::Elem(Elem::Bool)) if digital => Kind::Bool,
            Some(Type::Bit(bit)) if digital => Kind::Bit(*bit),
            Some(Type::Elem(Elem::Real)) if !digital => Kind::Real,
            Some(Type::Elem(Elem::Lreal)) if !digital => Kind::Lreal,
            other => {
                let found = other.map_or_else(|| "?".into(), |_| program.types.name(wire.place.ty));
                return Err(WireProblem::Type { found, expected: if digital { "a BOOL" } else { "a REAL or LREAL" } });
            }
        };
        let bytes = match kind {
            Kind::Bool | Kind::Bit(_) => 1,
            Kind::Real => 4,
            Kind::Lreal => 8,
        };
        if u64::from(wire.place.offset) + bytes > u64::from(program.image_size) {
            return Err(WireProblem::Outside);
        }
        let safe = match (wire.safe, digital) {
            (None, _) => 0.0,
            (Some(Signal::Bit(b)), true) => f64::from(u8::from(b)),
            (Some(Signal::Analog(v)), false) if v.is_finite() => v,
            _ => return Err(WireProblem::Safe),
        };
        Ok(Self { offset: wire.place.offset as usize, kind, channel: wire.channel, safe })
    }

    /// Input to variable.
    pub fn latch(&self, image: &mut [u8], io: &ProcessImage) {
        let place = &mut image[self.offset..];
        match (self.channel, self.kind) {
            (Channel::BitIn(i), Kind::Bit(bit)) => place[0] = place[0] & !(1 << bit) | u8::from(io.bits_in[i] != 0) << bit,
            (Channel::BitIn(i), _) => place[0] = u8::from(io.bits_in[i] != 0),
            (Channel::AnalogIn(i), Kind::Real) => (io.analog_in[i] as f32).store(place),
            (Channel::AnalogIn(i), _) => io.analog_in[i].store(place),
            _ => {}
        }
    }

    /// Variable to output; the safe value after a fault, and in place of a number that is none.
    pub fn publish(&self, image: &[u8], io: &mut ProcessImage, faulted: bool) {
        let place = &image[self.offset..];
        match (self.channel, self.kind) {
            (Channel::BitOut(i), kind) => {
                let mask = if let Kind::Bit(bit) = kind { 1 << bit } else { u8::MAX };
                io.bits_out[i] = u8::from(if faulted { self.safe != 0.0 } else { place[0] & mask != 0 });
            }
            (Channel::AnalogOut(i), kind) => {
                let value = if kind == Kind::Real { f64::from(f32::load(place)) } else { f64::load(place) };
                io.analog_out[i] = if faulted || !value.is_finite() { self.safe } else { value };
            }
            _ => {}
        }
    }
}
