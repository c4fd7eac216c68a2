//! A driver whose inputs come some cycles late.

use std::any::Any;
use takt_abi::Time;
use takt_engine::{BusSize, IoDriver, IoFault, ProcessImage};

/// Wraps a driver: what it brings arrives `cycles` exchanges later; until then the inputs are 0.
pub struct Delayed {
    inner: Box<dyn IoDriver>,
    line: Vec<ProcessImage>,
    next: usize,
}

impl Delayed {
    /// A delay of `cycles` exchanges; 0 changes nothing.
    pub fn new(inner: Box<dyn IoDriver>, cycles: usize) -> Self {
        let line = (0..cycles).map(|_| ProcessImage::new(inner.size())).collect();
        Self { inner, line, next: 0 }
    }
}

/// The inputs of `a` and `b` change places.
fn swap_inputs(a: &mut ProcessImage, b: &mut ProcessImage) {
    a.drives_in.swap_with_slice(&mut b.drives_in);
    a.bits_in.swap_with_slice(&mut b.bits_in);
    a.analog_in.swap_with_slice(&mut b.analog_in);
}

impl IoDriver for Delayed {
    fn size(&self) -> BusSize {
        self.inner.size()
    }
    fn exchange(&mut self, now: Time, io: &mut ProcessImage) -> Result<(), IoFault> {
        self.inner.exchange(now, io)?;
        if let Some(slot) = self.line.get_mut(self.next) {
            swap_inputs(slot, io);
            self.next = (self.next + 1) % self.line.len();
        }
        Ok(())
    }
    fn save(&self) -> Option<Box<dyn Any + Send>> {
        Some(Box::new((self.line.clone(), self.next, self.inner.save())))
    }
    fn restore(&mut self, saved: &dyn Any) -> bool {
        let Some((line, next, inner)) = saved.downcast_ref::<(Vec<ProcessImage>, usize, Option<Box<dyn Any + Send>>)>() else {
            return false;
        };
        self.line.clone_from(line);
        self.next = *next;
        inner.as_ref().is_none_or(|inner| self.inner.restore(inner.as_ref()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Counter(u8);
    impl IoDriver for Counter {
        fn size(&self) -> BusSize {
            BusSize { bits_in: 1, ..BusSize::default() }
        }
        fn exchange(&mut self, _: Time, io: &mut ProcessImage) -> Result<(), IoFault> {
            self.0 += 1;
            io.bits_in[0] = self.0;
            Ok(())
        }
    }

    #[test]
    fn inputs_come_late() {
        let mut late = Delayed::new(Box::new(Counter(0)), 2);
        let mut io = ProcessImage::new(late.size());
        let seen: Vec<_> = (0..5)
            .map(|_| {
                late.exchange(Time(0), &mut io).unwrap();
                io.bits_in[0]
            })
            .collect();
        assert_eq!(seen, [0, 0, 1, 2, 3]);
    }
}
