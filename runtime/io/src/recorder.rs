//! A driver that keeps what went over the bus last.

use std::any::Any;
use std::cell::RefCell;
use std::rc::Rc;
use takt_abi::Time;
use takt_engine::{BusSize, IoDriver, IoFault, ProcessImage};

/// One exchange: outputs as they left, inputs as they came.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Start of the bus cycle.
    pub time: Time,
    /// How it ended.
    pub result: Result<(), IoFault>,
    /// Outputs and inputs.
    pub io: ProcessImage,
}

/// A ring of exchanges, allocated beforehand.
#[derive(Debug)]
struct Ring {
    records: Vec<Record>,
    next: usize,
    full: bool,
}

/// Wraps a driver and keeps the last exchanges.
pub struct Recorder {
    inner: Box<dyn IoDriver>,
    ring: Rc<RefCell<Ring>>,
}

/// Reads what a [`Recorder`] has kept.
#[derive(Debug, Clone)]
pub struct Recording(Rc<RefCell<Ring>>);

impl Recorder {
    /// Keeps the last `capacity` exchanges (at least one).
    pub fn new(inner: Box<dyn IoDriver>, capacity: usize) -> (Self, Recording) {
        let empty = Record { time: Time(0), result: Ok(()), io: ProcessImage::new(inner.size()) };
        let ring = Rc::new(RefCell::new(Ring { records: vec![empty; capacity.max(1)], next: 0, full: false }));
        (Self { inner, ring: ring.clone() }, Recording(ring))
    }
}

impl Recording {
    /// The exchanges, the oldest first.
    pub fn records(&self) -> Vec<Record> {
        let ring = self.0.borrow();
        let (new, old) = ring.records.split_at(ring.next);
        if ring.full { old.iter().chain(new).cloned().collect() } else { new.to_vec() }
    }
}

/// Copies without allocating: both have the size of the bus.
fn copy(from: &ProcessImage, to: &mut ProcessImage) {
    to.drives_in.copy_from_slice(&from.drives_in);
    to.drives_out.copy_from_slice(&from.drives_out);
    to.bits_in.copy_from_slice(&from.bits_in);
    to.bits_out.copy_from_slice(&from.bits_out);
    to.analog_in.copy_from_slice(&from.analog_in);
    to.analog_out.copy_from_slice(&from.analog_out);
}

impl IoDriver for Recorder {
    fn size(&self) -> BusSize {
        self.inner.size()
    }
    fn exchange(&mut self, now: Time, io: &mut ProcessImage) -> Result<(), IoFault> {
        let result = self.inner.exchange(now, io);
        let mut ring = self.ring.borrow_mut();
        let next = ring.next;
        let record = &mut ring.records[next];
        (record.time, record.result) = (now, result);
        copy(io, &mut record.io);
        ring.next = (next + 1) % ring.records.len();
        ring.full |= ring.next == 0;
        result
    }
    fn save(&self) -> Option<Box<dyn Any + Send>> {
        self.inner.save()
    }
    fn restore(&mut self, saved: &dyn Any) -> bool {
        self.inner.restore(saved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_engine::NoBus;

    #[test]
    fn the_last_exchanges_are_kept_in_order() {
        let (mut bus, recording) = Recorder::new(Box::new(NoBus), 3);
        let mut io = ProcessImage::default();
        let times = || recording.records().iter().map(|r| r.time.0).collect::<Vec<_>>();
        assert!(times().is_empty());
        for t in 0..5 {
            bus.exchange(Time(t), &mut io).unwrap();
        }
        assert_eq!(times(), [2, 3, 4]);
    }
}
