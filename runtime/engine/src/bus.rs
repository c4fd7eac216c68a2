//! The seam to a bus: what an [`IoDriver`] exchanges with the engine once per bus cycle.
//!
//! A [`ProcessImage`] is plain numbers: drives in increments and CiA 402 words, terminals as bits and physical values. The engine sizes it once from
//! [`IoDriver::size`]; nothing in it ever grows, so an exchange allocates nothing. Names of channels are the driver's own business; the engine knows
//! indices only.

use std::any::Any;
use takt_abi::Time;
use takt_ir::Place;

/// How many drives and terminals a driver serves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BusSize {
    /// Drives.
    pub drives: usize,
    /// Digital inputs.
    pub bits_in: usize,
    /// Digital outputs.
    pub bits_out: usize,
    /// Analogue inputs.
    pub analog_in: usize,
    /// Analogue outputs.
    pub analog_out: usize,
}

/// What a drive reports (CiA 402, IEC 61800-7-201).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DriveIn {
    /// Process data from this drive arrived in the last exchange.
    pub online: bool,
    /// Statusword, 6041.
    pub status_word: u16,
    /// Mode of operation display, 6061.
    pub mode_display: i8,
    /// Position actual value, 6064, increments; the driver has unrolled the wraps of a 32-bit counter.
    pub position: i64,
    /// Velocity actual value, 606C, increments/s.
    pub velocity: i32,
    /// Torque actual value, 6077, thousandths of the rated torque.
    pub torque: i16,
    /// Error code, 603F.
    pub error_code: u16,
    /// Following error actual value, 60F4, increments.
    pub following_error: i32,
    /// Digital inputs, 60FD: bit 0 negative limit switch, bit 1 positive limit switch, bit 2 home switch.
    pub digital_inputs: u32,
}

/// What a drive is told (CiA 402).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DriveOut {
    /// Controlword, 6040.
    pub control_word: u16,
    /// Mode of operation, 6060: 8 cyclic synchronous position, 9 cyclic synchronous velocity, 6 homing.
    pub mode: i8,
    /// Target position, 607A, increments; the driver cuts it to the drive's 32 bits.
    pub position: i64,
    /// Target velocity, 60FF (mode 9), increments/s.
    pub velocity: i32,
    /// Velocity offset, 60B1 (feed-forward in mode 8), increments/s.
    pub velocity_offset: i32,
}

/// Inputs and outputs of the whole bus.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProcessImage {
    /// From the drives.
    pub drives_in: Vec<DriveIn>,
    /// To the drives.
    pub drives_out: Vec<DriveOut>,
    /// Digital inputs, 0 or 1.
    pub bits_in: Vec<u8>,
    /// Digital outputs, 0 or 1.
    pub bits_out: Vec<u8>,
    /// Analogue inputs, physical units.
    pub analog_in: Vec<f64>,
    /// Analogue outputs, physical units.
    pub analog_out: Vec<f64>,
}

impl ProcessImage {
    /// All zero.
    pub fn new(size: BusSize) -> Self {
        Self {
            drives_in: vec![DriveIn::default(); size.drives],
            drives_out: vec![DriveOut::default(); size.drives],
            bits_in: vec![0; size.bits_in],
            bits_out: vec![0; size.bits_out],
            analog_in: vec![0.0; size.analog_in],
            analog_out: vec![0.0; size.analog_out],
        }
    }
}

/// Why an exchange failed. Inputs keep their last values; a drive that stays away is an error of its axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IoFault {
    /// The bus did not answer before the deadline.
    Late {
        /// How late.
        by: Time,
    },
    /// A station answered with the wrong working counter.
    Station {
        /// Its address.
        address: u16,
        /// Counter expected.
        expected: u16,
        /// Counter found.
        found: u16,
    },
    /// Nothing came back (cable, link, power).
    Lost,
    /// The driver panicked; a defect of Takt.
    Panic,
}

impl std::fmt::Display for IoFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Late { by } => write!(f, "the bus answered {} µs too late", by.0 / 1000),
            Self::Station { address, expected, found } => write!(f, "station {address}: working counter {found} instead of {expected}"),
            Self::Lost => write!(f, "the bus does not answer"),
            Self::Panic => write!(f, "internal defect of Takt in a bus driver; please report it"),
        }
    }
}
impl std::error::Error for IoFault {}

/// Moves one process image between the engine and a bus.
pub trait IoDriver {
    /// What the bus has; constant after the driver was opened.
    fn size(&self) -> BusSize;
    /// Sends the outputs and receives the inputs. `now` is the start of the bus cycle. Must not allocate, lock or panic.
    fn exchange(&mut self, now: Time, io: &mut ProcessImage) -> Result<(), IoFault>;
    /// What is behind the bus, for a checkpoint in the same process. `None`: it cannot be put back (a real machine), or there is nothing.
    fn save(&self) -> Option<Box<dyn Any + Send>> {
        None
    }
    /// Puts back what [`IoDriver::save`] gave; false, and unchanged, when it is not that.
    fn restore(&mut self, _: &dyn Any) -> bool {
        false
    }
}

/// A bus with nothing on it.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoBus;

impl IoDriver for NoBus {
    fn size(&self) -> BusSize {
        BusSize::default()
    }
    fn exchange(&mut self, _: Time, _: &mut ProcessImage) -> Result<(), IoFault> {
        Ok(())
    }
}

/// One terminal of the process image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Channel {
    /// Index into [`ProcessImage::bits_in`].
    BitIn(usize),
    /// Index into [`ProcessImage::bits_out`].
    BitOut(usize),
    /// Index into [`ProcessImage::analog_in`].
    AnalogIn(usize),
    /// Index into [`ProcessImage::analog_out`].
    AnalogOut(usize),
}

impl Channel {
    /// Whether the channel brings values into the program.
    pub fn is_input(self) -> bool {
        matches!(self, Self::BitIn(_) | Self::AnalogIn(_))
    }
}

/// The value of a terminal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Signal {
    /// A digital terminal.
    Bit(bool),
    /// An analogue terminal, physical units.
    Analog(f64),
}

/// Connects a variable with a terminal.
#[derive(Debug, Clone, PartialEq)]
pub struct Wire {
    /// Path of the variable, for messages.
    pub name: String,
    /// The variable: BOOL on a digital channel; REAL or LREAL on an analogue one.
    pub place: Place,
    /// The terminal.
    pub channel: Channel,
    /// What an output has after a fault. `None`: FALSE or 0. Of no effect on inputs.
    pub safe: Option<Signal>,
}
