//! A simulated segment in memory: servo drives, digital and analogue terminals, a valve.
//!
//! Every exchange takes the outputs, lets the machine go on for one bus period and brings the inputs. No wall clock, no chance: the same commands give the
//! same machine, bit for bit. [`SimControl`] is the hand of a test or an operator: it sets terminals, breaks drives and looks at the mechanics.

mod drive;
mod homing;
mod plant;
mod valve;

pub use drive::{DriveConfig, Index, Switch, Switches};
pub use homing::{METHODS, Method};
pub use valve::ValveConfig;

use drive::Drive;
use std::any::Any;
use std::cell::RefCell;
use std::rc::Rc;
use takt_abi::Time;
use takt_engine::{BusSize, Channel, IoDriver, IoFault, ProcessImage};
use valve::Valve;

/// Bus periods that are made up for at the most when exchanges were missed.
const CATCH_UP: i64 = 100;

/// The segment.
#[derive(Debug, Clone, PartialEq)]
pub struct SimConfig {
    /// Bus period.
    pub period: Time,
    /// Drives, in the order of their indices.
    pub drives: Vec<DriveConfig>,
    /// Digital inputs and what they are at power-up.
    pub inputs: Vec<(String, bool)>,
    /// Analogue inputs and what they are at power-up, physical units.
    pub analog: Vec<(String, f64)>,
    /// Digital outputs.
    pub outputs: Vec<String>,
    /// Analogue outputs.
    pub analog_outputs: Vec<String>,
    /// A valve on the digital output `valve`, with inputs `valve-open` and `pressure` (bar).
    pub valve: Option<ValveConfig>,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self {
            period: Time::from_millis(1),
            drives: Vec::new(),
            inputs: Vec::new(),
            analog: Vec::new(),
            outputs: Vec::new(),
            analog_outputs: Vec::new(),
            valve: None,
        }
    }
}

/// Why a segment cannot be opened.
#[derive(Debug, Clone, PartialEq)]
pub enum OpenError {
    /// The bus period is not positive.
    Period,
    /// Two channels have this name.
    Twice {
        /// The name.
        name: String,
    },
    /// The valve's air is no digital input.
    NoInput {
        /// The name.
        name: String,
    },
    /// A value outside its range.
    Range {
        /// Name of the drive, or `valve`.
        of: String,
        /// Which value.
        key: &'static str,
        /// What it is.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// A homing method that the drive does not have.
    Method {
        /// Name of the drive.
        of: String,
        /// Number asked for.
        method: i8,
    },
    /// A homing method without the switch it needs.
    NoSwitch {
        /// Name of the drive.
        of: String,
        /// Method.
        method: i8,
        /// What it needs.
        needs: &'static str,
    },
}

impl std::fmt::Display for OpenError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Period => write!(f, "the bus period must be more than 0"),
            Self::Twice { name } => write!(f, "two channels are called `{name}`"),
            Self::NoInput { name } => write!(f, "the valve's air `{name}` is no digital input of the simulation"),
            Self::Range { of, key, value, expected } => write!(f, "`{of}`: `{key}` is {value}, expected {expected}"),
            Self::Method { of, method } => write!(f, "`{of}`: homing method {method} is not simulated; there are {METHODS:?}"),
            Self::NoSwitch { of, method, needs } => write!(f, "`{of}`: homing method {method} needs {needs}"),
        }
    }
}
impl std::error::Error for OpenError {}

/// No terminal or drive has this name or index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unknown;

impl std::fmt::Display for Unknown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the simulation has nothing of this name")
    }
}
impl std::error::Error for Unknown {}

/// Opens the segment: the driver for the engine, and the control for whoever plays operator.
pub fn open(config: &SimConfig) -> Result<(Box<dyn IoDriver>, SimControl), OpenError> {
    let machine = Rc::new(RefCell::new(Machine::new(config)?));
    Ok((Box::new(Sim { machine: machine.clone() }), SimControl { machine }))
}

/// What there is at the far end of the wire.
#[derive(Clone)]
struct Machine {
    period: Time,
    last: Option<Time>,
    drives: Vec<Drive>,
    inputs: Terminals<u8>,
    analog: Terminals<f64>,
    outputs: Terminals<u8>,
    analog_outputs: Terminals<f64>,
    valve: Option<Valve>,
}

/// Terminals of one kind.
#[derive(Clone)]
struct Terminals<T> {
    names: Vec<String>,
    values: Vec<T>,
}

impl<T: Copy> Terminals<T> {
    fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }
    fn add(&mut self, name: &str, value: T) -> usize {
        self.names.push(name.into());
        self.values.push(value);
        self.names.len() - 1
    }
    fn get(&self, name: &str) -> Option<T> {
        self.find(name).map(|i| self.values[i])
    }
    fn set(&mut self, name: &str, value: T) -> Result<(), Unknown> {
        let i = self.find(name).ok_or(Unknown)?;
        self.values[i] = value;
        Ok(())
    }
}

impl<T> FromIterator<(String, T)> for Terminals<T> {
    fn from_iter<I: IntoIterator<Item = (String, T)>>(all: I) -> Self {
        let (names, values) = all.into_iter().unzip();
        Self { names, values }
    }
}

impl Machine {
    fn new(config: &SimConfig) -> Result<Self, OpenError> {
        if config.period.0 <= 0 {
            return Err(OpenError::Period);
        }
        let dt = config.period.seconds();
        let drives = config.drives.iter().map(|d| Drive::new(d, dt)).collect::<Result<_, _>>()?;
        let mut inputs: Terminals<u8> = config.inputs.iter().map(|(n, v)| (n.clone(), u8::from(*v))).collect();
        let mut analog: Terminals<f64> = config.analog.iter().cloned().collect();
        let mut outputs: Terminals<u8> = config.outputs.iter().map(|n| (n.clone(), 0)).collect();
        let analog_outputs: Terminals<f64> = config.analog_outputs.iter().map(|n| (n.clone(), 0.0)).collect();
        let valve = match &config.valve {
            None => None,
            Some(valve) => {
                let air = match &valve.air {
                    None => None,
                    Some(name) => Some(inputs.find(name).ok_or_else(|| OpenError::NoInput { name: name.clone() })?),
                };
                let command = outputs.find("valve").unwrap_or_else(|| outputs.add("valve", 0));
                let (open, pressure) = (inputs.add("valve-open", 0), analog.add("pressure", 0.0));
                Some(Valve::new(valve, config.period, valve::Terminals { air, command, open, pressure })?)
            }
        };
        let machine = Self { period: config.period, last: None, drives, inputs, analog, outputs, analog_outputs, valve };
        match machine.duplicate() {
            Some(name) => Err(OpenError::Twice { name }),
            None => Ok(machine),
        }
    }

    fn names(&self) -> impl Iterator<Item = (&String, Channel)> {
        let bits_in = self.inputs.names.iter().enumerate().map(|(i, n)| (n, Channel::BitIn(i)));
        let bits_out = self.outputs.names.iter().enumerate().map(|(i, n)| (n, Channel::BitOut(i)));
        let analog_in = self.analog.names.iter().enumerate().map(|(i, n)| (n, Channel::AnalogIn(i)));
        let analog_out = self.analog_outputs.names.iter().enumerate().map(|(i, n)| (n, Channel::AnalogOut(i)));
        bits_in.chain(bits_out).chain(analog_in).chain(analog_out)
    }

    fn duplicate(&self) -> Option<String> {
        let mut names: Vec<_> = self.names().map(|(n, _)| n).collect();
        names.sort();
        names.windows(2).find(|w| w[0] == w[1]).map(|w| w[0].clone())
    }

    /// Whole bus periods since the last exchange, at least one.
    fn periods(&mut self, now: Time) -> i64 {
        let last = self.last.replace(now).unwrap_or(now);
        ((now.0 - last.0 + self.period.0 / 2) / self.period.0).clamp(1, CATCH_UP)
    }

    fn exchange(&mut self, now: Time, io: &mut ProcessImage) {
        self.outputs.values.copy_from_slice(&io.bits_out);
        self.analog_outputs.values.copy_from_slice(&io.analog_out);
        for _ in 0..self.periods(now) {
            for (drive, out) in self.drives.iter_mut().zip(&io.drives_out) {
                drive.advance(out);
            }
            if let Some(valve) = &mut self.valve {
                valve.advance(&mut self.inputs.values, &mut self.analog.values, &self.outputs.values);
            }
        }
        for (drive, report) in self.drives.iter().zip(&mut io.drives_in) {
            *report = drive.report();
        }
        io.bits_in.copy_from_slice(&self.inputs.values);
        io.analog_in.copy_from_slice(&self.analog.values);
    }
}

struct Sim {
    machine: Rc<RefCell<Machine>>,
}

impl IoDriver for Sim {
    fn size(&self) -> BusSize {
        let m = self.machine.borrow();
        BusSize {
            drives: m.drives.len(),
            bits_in: m.inputs.values.len(),
            bits_out: m.outputs.values.len(),
            analog_in: m.analog.values.len(),
            analog_out: m.analog_outputs.values.len(),
        }
    }
    fn exchange(&mut self, now: Time, io: &mut ProcessImage) -> Result<(), IoFault> {
        self.machine.borrow_mut().exchange(now, io);
        Ok(())
    }
    fn save(&self) -> Option<Box<dyn Any + Send>> {
        Some(Box::new(self.machine.borrow().clone()))
    }
    fn restore(&mut self, saved: &dyn Any) -> bool {
        let Some(machine) = saved.downcast_ref::<Machine>() else { return false };
        self.machine.borrow_mut().clone_from(machine);
        true
    }
}

/// The hand of a test or an operator on the simulated machine. Clones move the same machine. To be used between steps of the engine.
#[derive(Clone)]
pub struct SimControl {
    machine: Rc<RefCell<Machine>>,
}

impl std::fmt::Debug for SimControl {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SimControl({} drives)", self.machine.borrow().drives.len())
    }
}

impl SimControl {
    /// The channel of a terminal.
    pub fn channel(&self, name: &str) -> Option<Channel> {
        self.machine.borrow().names().find(|(n, _)| *n == name).map(|(_, c)| c)
    }
    /// All terminals: digital inputs and outputs, analogue inputs and outputs.
    pub fn channels(&self) -> Vec<(String, Channel)> {
        self.machine.borrow().names().map(|(n, c)| (n.clone(), c)).collect()
    }
    /// The index of a drive.
    pub fn drive(&self, name: &str) -> Option<usize> {
        self.machine.borrow().drives.iter().position(|d| d.name() == name)
    }
    /// Sets a digital input.
    pub fn set_input(&self, name: &str, value: bool) -> Result<(), Unknown> {
        self.machine.borrow_mut().inputs.set(name, value.into())
    }
    /// Sets an analogue input, physical units.
    pub fn set_analog(&self, name: &str, value: f64) -> Result<(), Unknown> {
        self.machine.borrow_mut().analog.set(name, value)
    }
    /// A digital input or output.
    pub fn bit(&self, name: &str) -> Option<bool> {
        let m = self.machine.borrow();
        m.inputs.get(name).or_else(|| m.outputs.get(name)).map(|v| v != 0)
    }
    /// An analogue input or output, physical units.
    pub fn analog(&self, name: &str) -> Option<f64> {
        let m = self.machine.borrow();
        m.analog.get(name).or_else(|| m.analog_outputs.get(name))
    }
    fn with<R>(&self, drive: usize, act: impl FnOnce(&mut Drive) -> R) -> Result<R, Unknown> {
        self.machine.borrow_mut().drives.get_mut(drive).map(act).ok_or(Unknown)
    }
    /// A drive goes to fault with an error code (603F); it can be reset.
    pub fn fail_drive(&self, drive: usize, code: u16) -> Result<(), Unknown> {
        self.with(drive, |d| d.fail(code))
    }
    /// A drive's supply fails (undervoltage, 3220) until [`SimControl::restore_power`].
    pub fn lose_power(&self, drive: usize) -> Result<(), Unknown> {
        self.with(drive, |d| d.set_power(false))
    }
    /// The supply is back; the fault must still be reset.
    pub fn restore_power(&self, drive: usize) -> Result<(), Unknown> {
        self.with(drive, |d| d.set_power(true))
    }
    /// Whether a drive answers on the bus.
    pub fn set_online(&self, drive: usize, online: bool) -> Result<(), Unknown> {
        self.with(drive, |d| d.set_online(online))
    }
    /// A switch of a drive shows this value whatever the axis does; `None`: it works again.
    pub fn stick(&self, drive: usize, switch: Switch, value: Option<bool>) -> Result<(), Unknown> {
        self.with(drive, |d| d.stick(switch, value))
    }
    /// The reference of a drive's homing method (switch or index pulse) never comes; `false`: it works again.
    pub fn stick_home_switch(&self, drive: usize, stuck: bool) -> Result<(), Unknown> {
        self.with(drive, |d| d.stick_reference(stuck))
    }
    /// Moves an axis by hand, technical units; only while its drive is off.
    pub fn drag(&self, drive: usize, by: f64) -> Result<bool, Unknown> {
        self.with(drive, |d| d.drag(by))
    }
    /// Blocks an axis mechanically, or frees it.
    pub fn block(&self, drive: usize, blocked: bool) -> Result<(), Unknown> {
        self.with(drive, |d| d.block(blocked))
    }
    /// Where an axis really is, technical units from the machine's zero, and how fast it moves.
    pub fn mechanics(&self, drive: usize) -> Result<(f64, f64), Unknown> {
        self.with(drive, |d| d.mechanics())
    }
    /// How often the valve has opened.
    pub fn valve_openings(&self) -> u64 {
        self.machine.borrow().valve.as_ref().map_or(0, Valve::openings)
    }
}

#[cfg(test)]
mod tests;
