//! Samples on their way from the resource thread to the thread that writes traces, draws plots and shows the live line.
//!
//! After each scan of the fastest task the bytes of the variables that are needed go into a ring whose memory is there from the start. A full ring loses the sample, which is
//! counted; the scan never waits. In virtual time nobody needs the ring: the machine itself is looked at ([`Look`]).

use crate::machine::Machine;
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use takt_abi::Time;
use takt_engine::{Observer, Scanned};
use takt_ir::{BodyId, Place, Program, Types};

/// Bytes of the ring at the most, and samples at the least.
const BYTES: usize = 16 << 20;
const SAMPLES: usize = 64;
/// Samples at the most.
const ENOUGH: usize = 16 << 10;
/// Time and flag in front of the values.
const HEAD: usize = 9;

/// What outputs see of a machine.
pub trait Look {
    /// Time of the scan; the first is at 0.
    fn time(&self) -> Time;
    /// The types of the program.
    fn types(&self) -> &Types;
    /// The bytes of a variable.
    fn look(&self, place: Place) -> &[u8];
    /// A variable as a number, BOOL as 0 or 1; NaN if it is none.
    fn number(&self, place: Place) -> f64 {
        crate::values::to_number(self.types(), place.ty, self.look(place)).unwrap_or(f64::NAN)
    }
    /// A variable as an ST literal.
    fn literal(&self, place: Place) -> String {
        takt_ir::format_value(self.types(), place.ty, self.look(place))
    }
}

impl Look for Machine {
    fn time(&self) -> Time {
        self.now()
    }
    fn types(&self) -> &Types {
        &self.program().types
    }
    fn look(&self, place: Place) -> &[u8] {
        self.bytes(place)
    }
}

/// The resource thread's end: looks after each scan of one task, those within slower scans too.
#[derive(Debug)]
pub struct Sender {
    task: usize,
    places: Vec<Place>,
    /// A condition that goes along with each sample.
    flag: Option<BodyId>,
    ring: Producer<u8>,
    record: Vec<u8>,
    start: Option<Time>,
    lost: Arc<AtomicU64>,
}

/// The other end: the sample that was received last.
#[derive(Debug)]
pub struct Receiver {
    program: Arc<Program>,
    /// Where the bytes of a place start in the record, and how many they are.
    at: HashMap<Place, (usize, usize)>,
    ring: Consumer<u8>,
    record: Vec<u8>,
    lost: Arc<AtomicU64>,
}

/// A ring for samples of these variables, taken after each scan of `task`, with the value of a condition (TRUE without one).
pub fn ring(program: &Arc<Program>, task: usize, mut places: Vec<Place>, flag: Option<BodyId>) -> (Sender, Receiver) {
    places.sort_by_key(|place| (place.offset, place.ty.0));
    places.dedup();
    let mut size = HEAD;
    let mut at = HashMap::new();
    for place in &places {
        let bytes = program.types.size(place.ty) as usize;
        at.insert(*place, (size, bytes));
        size += bytes;
    }
    let samples = (BYTES / size).clamp(SAMPLES, ENOUGH);
    let (producer, consumer) = RingBuffer::new(samples * size);
    let lost = Arc::new(AtomicU64::new(0));
    let sender = Sender { task, places, flag, ring: producer, record: Vec::with_capacity(size), start: None, lost: lost.clone() };
    (sender, Receiver { program: program.clone(), at, ring: consumer, record: vec![0; size], lost })
}

impl Observer for Sender {
    fn scanned(&mut self, scan: &mut Scanned<'_>) {
        if scan.task() != self.task {
            return;
        }
        let start = *self.start.get_or_insert(scan.now());
        let held = self.flag.map_or(Some(Ok(1)), |condition| scan.evaluate(condition));
        // A condition that cannot be evaluated in the middle of things does not hold anything back.
        let flag = held.is_none_or(|value| value.is_ok_and(|value| value != 0));
        self.record.clear();
        self.record.extend_from_slice(&(scan.now().0 - start.0).to_le_bytes());
        self.record.push(flag.into());
        self.places.iter().for_each(|place| self.record.extend_from_slice(scan.read(*place)));
        if self.ring.push_entire_slice(&self.record).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Receiver {
    /// Takes the next sample; whether there was one.
    pub fn receive(&mut self) -> bool {
        self.ring.pop_entire_slice(&mut self.record).is_ok()
    }
    /// Whether the sender has gone. What it sent before is still to be received.
    pub fn is_over(&self) -> bool {
        self.ring.is_abandoned()
    }
    /// Samples so far that found the ring full.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
    /// The condition's value at the sample.
    pub fn flag(&self) -> bool {
        self.record[HEAD - 1] != 0
    }
}

impl Look for Receiver {
    fn time(&self) -> Time {
        let mut time = [0; 8];
        time.copy_from_slice(&self.record[..8]);
        Time(i64::from_le_bytes(time))
    }
    fn types(&self) -> &Types {
        &self.program.types
    }
    fn look(&self, place: Place) -> &[u8] {
        self.at.get(&place).map_or(&[], |(start, bytes)| &self.record[*start..*start + *bytes])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Setup;
    use crate::project::Project;
    use crate::sources::Sources;
    use takt_syntax::Source;

    fn machine() -> Machine {
        let text = "PROGRAM p VAR x : INT; s : STRING(5) := 'ab'; END_VAR x := x + 2; END_PROGRAM";
        let sources = Sources { list: vec![Source { name: "main.st".into(), text: text.into() }], ..Sources::default() };
        let project = Project { root: std::env::temp_dir(), sources, ..Project::default() };
        Machine::new(&project, Setup::default()).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn samples_arrive_in_order_and_a_full_ring_loses_and_counts() {
        let mut machine = machine();
        let (x, s) = (machine.place("p.x").unwrap(), machine.place("p.s").unwrap());
        let (sender, mut receiver) = ring(&machine.program().clone(), 0, vec![x, s, x], None);
        machine.engine().observe(Some(Box::new(sender)));
        for _ in 0..ENOUGH + 10 {
            machine.step();
        }
        assert_eq!(receiver.lost(), 10);
        for n in 1..=ENOUGH as i64 {
            assert!(receiver.receive());
            assert_eq!((receiver.time(), receiver.literal(s).as_str()), (Time((n - 1) * 10_000_000), "'ab'"));
            assert_eq!(receiver.number(x), f64::from((2 * n) as i16));
        }
        assert!(!receiver.receive() && !receiver.is_over());
        machine.step();
        machine.engine().observe(None);
        assert!(receiver.is_over() && receiver.receive() && !receiver.receive());
    }
}
