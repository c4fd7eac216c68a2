//! Variables that VAR_CONFIG gives addresses: copied from inputs before the programs of the bus task run, to outputs behind them.

use takt_ir::{Area, Mapped, Program};

/// A variable and its address.
#[derive(Debug)]
pub(crate) struct Mapping {
    at: Mapped,
    /// The value that was taken from `%M`: what has changed since goes back.
    taken: Vec<u8>,
}

impl Mapping {
    /// The program is verified.
    pub(crate) fn new(program: &Program, at: Mapped) -> Self {
        Self { at, taken: vec![0; program.types.size(at.ty) as usize] }
    }

    /// What was taken, for a checkpoint.
    pub(crate) fn taken(&self) -> &[u8] {
        &self.taken
    }

    /// Puts it back.
    pub(crate) fn set_taken(&mut self, taken: Vec<u8>) {
        self.taken = taken;
    }

    /// Before the programs: inputs and memory to the variable.
    pub(crate) fn latch(&mut self, image: &mut [u8]) {
        if self.at.area == Area::Output {
            return;
        }
        let (from, to, len) = (self.at.address as usize, self.at.offset as usize, self.taken.len());
        match self.at.bit {
            Some(bit) => image[to] = image[from] >> bit & 1,
            None => image.copy_within(from..from + len, to),
        }
        self.taken.copy_from_slice(&image[to..to + len]);
    }

    /// Behind the programs: the variable to outputs, and to memory if the program wrote it.
    pub(crate) fn publish(&mut self, image: &mut [u8]) {
        let (from, to, len) = (self.at.offset as usize, self.at.address as usize, self.taken.len());
        let changed = match self.at.area {
            Area::Input => false,
            Area::Output => true,
            Area::Memory => image[from..from + len] != self.taken[..],
        };
        match (changed, self.at.bit) {
            (false, _) => {}
            (true, Some(bit)) => image[to] = image[to] & !(1 << bit) | u8::from(image[from] != 0) << bit,
            (true, None) => image.copy_within(from..from + len, to),
        }
    }
}
