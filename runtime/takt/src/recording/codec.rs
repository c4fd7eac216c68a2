//! What happens, as bytes: numbers as differences from what was expected, so that a machine at rest costs next to nothing.
//!
//! Each item is one byte that says what it is, and its fields. Numbers have seven bits a byte, the lowest first, the highest bit says that more follow;
//! signed ones have their sign in the lowest bit. A [`Mark`](Item::Mark) sets all expectations back; decoding can start there.

use takt_abi::{Chunk, Fault, HostError, Time};
use takt_engine::{BusSize, Command, DriveIn, Event, IoFault, ProcessImage, Reset};
use takt_ir::{Place, TypeId};

/// The largest data of one answer of the host that is believed.
const DATA_MAX: u64 = 64 << 20;
/// The most bytes of one command's value that are believed.
const VALUE_MAX: u64 = 1 << 20;

/// What a recording consists of.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// Expectations start anew.
    Mark,
    /// A step starts.
    Step(Time),
    /// Something happened in it.
    Event(Event),
    /// The bus was exchanged; the inputs are in [`Decoder::io`].
    Exchange(Result<(), IoFault>),
    /// A command between steps.
    Command(Command),
    /// The host answered at this call of `take`.
    Take(u64, Result<Chunk, HostError>),
    /// The host refused at this call of `submit`.
    Refused(u64, HostError),
}

const MARK: u8 = 1;
const STEP: u8 = 2;
const SCAN: u8 = 3;
const CUT: u8 = 4;
const STOP: u8 = 5;
const EXCHANGE: u8 = 6;
const LOST: u8 = 7;
const COMMAND: u8 = 8;
const TAKE: u8 = 9;
const REFUSED: u8 = 10;
/// An exchange whose inputs are as expected.
const EXPECTED: u8 = 11;

/// What is known of what came before.
#[derive(Debug, Clone)]
struct Known {
    now: i64,
    period: i64,
    io: ProcessImage,
    /// Change of each drive's position in the exchange before.
    rates: Vec<i64>,
}

impl Known {
    fn new(size: BusSize) -> Self {
        Self { now: 0, period: 0, io: ProcessImage::new(size), rates: vec![0; size.drives] }
    }
    fn forget(&mut self) {
        (self.now, self.period) = (0, 0);
        self.io.drives_in.fill(DriveIn::default());
        self.io.bits_in.fill(0);
        self.io.analog_in.fill(0.0);
        self.rates.fill(0);
    }
}

fn put(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn put_signed(out: &mut Vec<u8>, value: i64) {
    put(out, (value << 1 ^ value >> 63) as u64);
}

/// Writes items. Allocates nothing where `out` has room.
#[derive(Debug, Clone)]
pub struct Encoder {
    known: Known,
}

impl Encoder {
    /// For a bus.
    pub fn new(size: BusSize) -> Self {
        Self { known: Known::new(size) }
    }
    /// Expectations start anew.
    pub fn mark(&mut self, out: &mut Vec<u8>) {
        self.known.forget();
        out.push(MARK);
    }
    /// A step starts.
    pub fn step(&mut self, out: &mut Vec<u8>, now: Time) {
        out.push(STEP);
        let period = now.0.wrapping_sub(self.known.now);
        put_signed(out, period.wrapping_sub(self.known.period));
        (self.known.now, self.known.period) = (now.0, period);
    }
    /// Something happened in it.
    pub fn event(&mut self, out: &mut Vec<u8>, event: &Event) {
        match *event {
            Event::Scan { task, now, depth, at } => {
                out.push(SCAN);
                put(out, task as u64);
                put_signed(out, now.0.wrapping_sub(self.known.now));
                put(out, depth.into());
                if depth > 0 {
                    put(out, at);
                }
            }
            Event::Cut { depth, at, fault } => {
                out.push(CUT);
                put(out, depth.into());
                put(out, at);
                put_fault(out, fault);
            }
            Event::Stop { depth, entry, fault } => {
                out.push(STOP);
                put(out, depth.into());
                out.push(entry.into());
                put_fault(out, fault);
            }
        }
    }
    /// The bus was exchanged.
    pub fn exchange(&mut self, out: &mut Vec<u8>, result: Result<(), IoFault>, io: &ProcessImage) {
        match result {
            Ok(()) => out.push(EXCHANGE),
            Err(fault) => {
                out.push(LOST);
                put_io_fault(out, fault);
            }
        }
        let start = out.len();
        let known = &mut self.known;
        let mut as_expected = result.is_ok();
        for ((old, new), rate) in known.io.drives_in.iter_mut().zip(&io.drives_in).zip(&mut known.rates) {
            as_expected &= put_drive(out, old, new, rate);
        }
        let changed = |(old, new): (&u8, &u8)| old != new;
        put(out, known.io.bits_in.iter().zip(&io.bits_in).filter(|pair| changed(*pair)).count() as u64);
        for (i, (old, new)) in known.io.bits_in.iter_mut().zip(&io.bits_in).enumerate() {
            if old != new {
                put(out, i as u64);
                out.push(*new);
                (*old, as_expected) = (*new, false);
            }
        }
        let differs = |(old, new): (&f64, &f64)| old.to_bits() != new.to_bits();
        put(out, known.io.analog_in.iter().zip(&io.analog_in).filter(|pair| differs(*pair)).count() as u64);
        for (i, (old, new)) in known.io.analog_in.iter_mut().zip(&io.analog_in).enumerate() {
            if old.to_bits() != new.to_bits() {
                put(out, i as u64);
                put(out, old.to_bits() ^ new.to_bits());
                (*old, as_expected) = (*new, false);
            }
        }
        if as_expected {
            out.truncate(start - 1);
            out.push(EXPECTED);
        }
    }
    /// A command between steps.
    pub fn command(&mut self, out: &mut Vec<u8>, command: &Command) {
        out.push(COMMAND);
        match command {
            Command::Write { place, bytes } => put_value(out, 0, *place, bytes),
            Command::Force { place, bytes } => put_value(out, 1, *place, bytes),
            Command::Release { place, restore } => {
                out.push(2);
                put_place(out, *place);
                out.push((*restore).into());
            }
            Command::ReleaseAll { restore } => out.extend_from_slice(&[3, (*restore).into()]),
            Command::Reset(kind) => out.extend_from_slice(&[4, reset_number(*kind)]),
            Command::Halt => out.push(5),
            Command::ResetTask(task) => {
                out.push(6);
                put(out, (*task).into());
            }
        }
    }
    /// The host answered.
    pub fn take(&mut self, out: &mut Vec<u8>, call: u64, result: &Result<Chunk, HostError>) {
        out.push(TAKE);
        put(out, call);
        match result {
            Ok(chunk) => {
                out.push(0);
                put(out, chunk.file_size);
                put(out, chunk.data.len() as u64);
                out.extend_from_slice(&chunk.data);
            }
            Err(error) => put_host_error(out, *error),
        }
    }
    /// The host refused.
    pub fn refused(&mut self, out: &mut Vec<u8>, call: u64, error: HostError) {
        out.push(REFUSED);
        put(out, call);
        put_host_error(out, error);
    }
}

fn put_place(out: &mut Vec<u8>, place: Place) {
    put(out, place.offset.into());
    put(out, place.ty.0.into());
}

fn put_value(out: &mut Vec<u8>, kind: u8, place: Place, bytes: &[u8]) {
    out.push(kind);
    put_place(out, place);
    put(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

fn reset_number(kind: Reset) -> u8 {
    match kind {
        Reset::Warm => 0,
        Reset::Cold => 1,
        Reset::Origin => 2,
    }
}

fn put_fault(out: &mut Vec<u8>, fault: Fault) {
    put(out, fault.code().into());
    fault.facts().iter().for_each(|fact| put_signed(out, *fact));
}

fn put_io_fault(out: &mut Vec<u8>, fault: IoFault) {
    match fault {
        IoFault::Late { by } => {
            out.push(0);
            put_signed(out, by.0);
        }
        IoFault::Station { address, expected, found } => {
            out.push(1);
            [address, expected, found].iter().for_each(|word| put(out, (*word).into()));
        }
        IoFault::Lost => out.push(2),
        IoFault::Panic => out.push(3),
    }
}

fn put_host_error(out: &mut Vec<u8>, error: HostError) {
    let (number, code) = match error {
        HostError::NotFound => (1, 0),
        HostError::Outside => (2, 0),
        HostError::NotReadable => (3, 0),
        HostError::NotWritable => (4, 0),
        HostError::Exists => (5, 0),
        HostError::Os(code) => (6, code),
        HostError::Busy => (7, 0),
        HostError::Absent => (8, 0),
    };
    out.push(number);
    if number == 6 {
        put_signed(out, code.into());
    }
}

/// The residuals of a drive; whether there were none.
fn put_drive(out: &mut Vec<u8>, old: &mut DriveIn, new: &DriveIn, rate: &mut i64) -> bool {
    let step = new.position.wrapping_sub(old.position);
    let residuals = [
        step.wrapping_sub(*rate),
        i64::from(new.velocity) - i64::from(old.velocity),
        i64::from(new.torque) - i64::from(old.torque),
        i64::from(new.following_error) - i64::from(old.following_error),
        i64::from(new.status_word) - i64::from(old.status_word),
        (i64::from(new.mode_display) << 1 | i64::from(new.online)) - (i64::from(old.mode_display) << 1 | i64::from(old.online)),
        i64::from(new.error_code) - i64::from(old.error_code),
        i64::from(new.digital_inputs) - i64::from(old.digital_inputs),
    ];
    let at = out.len();
    out.push(0);
    for (i, residual) in residuals.into_iter().enumerate() {
        if residual != 0 {
            out[at] |= 1 << i;
            put_signed(out, residual);
        }
    }
    (*rate, *old) = (step, *new);
    out[at] == 0
}

/// Why bytes are no recording, and where.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Damaged {
    /// Byte of the chunk.
    pub at: usize,
    /// What was expected there.
    pub expected: &'static str,
}

impl std::fmt::Display for Damaged {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "expected {} at byte {} of the chunk", self.expected, self.at)
    }
}
impl std::error::Error for Damaged {}

/// Reads items.
#[derive(Debug, Clone)]
pub struct Decoder {
    known: Known,
    result: Result<(), IoFault>,
}

/// Bytes being read.
struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

type Read<T> = Result<T, Damaged>;

impl<'a> Reader<'a> {
    fn fail<T>(&self, expected: &'static str) -> Read<T> {
        Err(Damaged { at: self.at, expected })
    }
    fn byte(&mut self, expected: &'static str) -> Read<u8> {
        let Some(byte) = self.bytes.get(self.at).copied() else { return self.fail(expected) };
        self.at += 1;
        Ok(byte)
    }
    fn number(&mut self, expected: &'static str) -> Read<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte(expected)?;
            let part = u64::from(byte & 0x7F);
            if shift == 63 && part > 1 {
                return self.fail(expected);
            }
            value |= part << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        self.fail(expected)
    }
    fn signed(&mut self, expected: &'static str) -> Read<i64> {
        let value = self.number(expected)?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }
    fn small<T: TryFrom<u64>>(&mut self, expected: &'static str) -> Read<T> {
        let at = self.at;
        T::try_from(self.number(expected)?).map_err(|_| Damaged { at, expected })
    }
    fn flag(&mut self, expected: &'static str) -> Read<bool> {
        match self.byte(expected)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => self.fail(expected),
        }
    }
    fn data(&mut self, most: u64, expected: &'static str) -> Read<&'a [u8]> {
        let length = self.number(expected)?;
        let left = (self.bytes.len() - self.at) as u64;
        if length > most || length > left {
            return self.fail(expected);
        }
        let start = self.at;
        self.at += length as usize;
        Ok(&self.bytes[start..self.at])
    }
    fn fault(&mut self) -> Read<Fault> {
        let code = self.small("the number of a fault")?;
        let facts = [self.signed("a fact")?, self.signed("a fact")?, self.signed("a fact")?];
        match Fault::from_raw(code, facts).filter(|fault| fault.code() == code) {
            Some(fault) => Ok(fault),
            None => self.fail("a fault that this version knows"),
        }
    }
    fn io_fault(&mut self) -> Read<IoFault> {
        Ok(match self.byte("a bus fault")? {
            0 => IoFault::Late { by: Time(self.signed("a time")?) },
            1 => IoFault::Station {
                address: self.small("an address")?,
                expected: self.small("a working counter")?,
                found: self.small("a working counter")?,
            },
            2 => IoFault::Lost,
            3 => IoFault::Panic,
            _ => return self.fail("a bus fault that this version knows"),
        })
    }
    fn host_error(&mut self, number: u8) -> Read<HostError> {
        Ok(match number {
            1 => HostError::NotFound,
            2 => HostError::Outside,
            3 => HostError::NotReadable,
            4 => HostError::NotWritable,
            5 => HostError::Exists,
            6 => HostError::Os(i32::try_from(self.signed("an error number")?).unwrap_or(0)),
            7 => HostError::Busy,
            8 => HostError::Absent,
            _ => return self.fail("an answer of the host"),
        })
    }
    fn reset(&mut self) -> Read<Reset> {
        Ok(match self.byte("a kind of reset")? {
            0 => Reset::Warm,
            1 => Reset::Cold,
            2 => Reset::Origin,
            _ => return self.fail("warm, cold or origin"),
        })
    }
    fn place(&mut self) -> Read<Place> {
        Ok(Place { offset: self.small("an offset")?, ty: TypeId(self.small("a type")?) })
    }
    fn value(&mut self) -> Read<(Place, Box<[u8]>)> {
        Ok((self.place()?, self.data(VALUE_MAX, "a value")?.into()))
    }
    fn command(&mut self) -> Read<Command> {
        Ok(match self.byte("a command")? {
            0 => {
                let (place, bytes) = self.value()?;
                Command::Write { place, bytes }
            }
            1 => {
                let (place, bytes) = self.value()?;
                Command::Force { place, bytes }
            }
            2 => Command::Release { place: self.place()?, restore: self.flag("0 or 1")? },
            3 => Command::ReleaseAll { restore: self.flag("0 or 1")? },
            4 => Command::Reset(self.reset()?),
            5 => Command::Halt,
            6 => Command::ResetTask(self.small("a task")?),
            _ => return self.fail("a command that this version knows"),
        })
    }
}

impl Decoder {
    /// For a bus.
    pub fn new(size: BusSize) -> Self {
        Self { known: Known::new(size), result: Ok(()) }
    }
    /// The inputs of the last exchange.
    pub fn io(&self) -> &ProcessImage {
        &self.known.io
    }
    /// The item at `at` of a chunk, which is moved behind it; `None` at the end.
    pub fn next(&mut self, chunk: &[u8], at: &mut usize) -> Result<Option<Item>, Damaged> {
        if *at >= chunk.len() {
            return Ok(None);
        }
        let mut reader = Reader { bytes: chunk, at: *at };
        let item = self.item(&mut reader)?;
        *at = reader.at;
        Ok(Some(item))
    }

    fn item(&mut self, r: &mut Reader<'_>) -> Read<Item> {
        let kind = r.byte("an item")?;
        Ok(match kind {
            MARK => {
                self.known.forget();
                Item::Mark
            }
            STEP => {
                let period = self.known.period.wrapping_add(r.signed("a time")?);
                (self.known.now, self.known.period) = (self.known.now.wrapping_add(period), period);
                Item::Step(Time(self.known.now))
            }
            SCAN => {
                let task = r.small("a task")?;
                let now = Time(self.known.now.wrapping_add(r.signed("a time")?));
                let depth = r.small("a depth")?;
                let at = if depth > 0 { r.number("an amount of fuel")? } else { 0 };
                Item::Event(Event::Scan { task, now, depth, at })
            }
            CUT => Item::Event(Event::Cut { depth: r.small("a depth")?, at: r.number("an amount of fuel")?, fault: r.fault()? }),
            STOP => Item::Event(Event::Stop { depth: r.small("a depth")?, entry: r.flag("0 or 1")?, fault: r.fault()? }),
            EXPECTED => {
                for (drive, rate) in self.known.io.drives_in.iter_mut().zip(&self.known.rates) {
                    drive.position = drive.position.wrapping_add(*rate);
                }
                Item::Exchange(Ok(()))
            }
            EXCHANGE | LOST => {
                self.result = if kind == LOST { Err(r.io_fault()?) } else { Ok(()) };
                self.inputs(r)?;
                Item::Exchange(self.result)
            }
            COMMAND => Item::Command(r.command()?),
            TAKE => {
                let call = r.number("the number of a call")?;
                match r.byte("an answer of the host")? {
                    0 => {
                        let file_size = r.number("a size")?;
                        Item::Take(call, Ok(Chunk { data: r.data(DATA_MAX, "data of a file")?.into(), file_size }))
                    }
                    number => Item::Take(call, Err(r.host_error(number)?)),
                }
            }
            REFUSED => {
                let call = r.number("the number of a call")?;
                let number = r.byte("an answer of the host")?;
                Item::Refused(call, r.host_error(number)?)
            }
            _ => {
                r.at -= 1;
                return r.fail("an item that this version knows");
            }
        })
    }

    fn inputs(&mut self, r: &mut Reader<'_>) -> Read<()> {
        let known = &mut self.known;
        for (drive, rate) in known.io.drives_in.iter_mut().zip(&mut known.rates) {
            take_drive(r, drive, rate)?;
        }
        for _ in 0..r.number("a count of inputs")? {
            let index: usize = r.small("an input")?;
            let value = r.byte("a bit")?;
            match known.io.bits_in.get_mut(index) {
                Some(bit) => *bit = value,
                None => return r.fail("an input that the bus has"),
            }
        }
        for _ in 0..r.number("a count of inputs")? {
            let index: usize = r.small("an input")?;
            let change = r.number("a value")?;
            match known.io.analog_in.get_mut(index) {
                Some(value) => *value = f64::from_bits(value.to_bits() ^ change),
                None => return r.fail("an input that the bus has"),
            }
        }
        Ok(())
    }
}

fn take_drive(r: &mut Reader<'_>, drive: &mut DriveIn, rate: &mut i64) -> Read<()> {
    let present = r.byte("a drive")?;
    let mut residuals = [0; 8];
    for (i, residual) in residuals.iter_mut().enumerate() {
        if present & 1 << i != 0 {
            *residual = r.signed("a value of a drive")?;
        }
    }
    let step = rate.wrapping_add(residuals[0]);
    let mode = (i64::from(drive.mode_display) << 1 | i64::from(drive.online)).wrapping_add(residuals[5]);
    let sum = |old: i64, i: usize| old.wrapping_add(residuals[i]);
    *drive = DriveIn {
        online: mode & 1 != 0,
        status_word: sum(drive.status_word.into(), 4) as u16,
        mode_display: (mode >> 1) as i8,
        position: drive.position.wrapping_add(step),
        velocity: sum(drive.velocity.into(), 1) as i32,
        torque: sum(drive.torque.into(), 2) as i16,
        error_code: sum(drive.error_code.into(), 6) as u16,
        following_error: sum(drive.following_error.into(), 3) as i32,
        digital_inputs: sum(drive.digital_inputs.into(), 7) as u32,
    };
    *rate = step;
    Ok(())
}

#[cfg(test)]
mod tests;
