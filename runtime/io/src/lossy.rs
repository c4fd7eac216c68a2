//! A driver whose exchanges fail now and then, by seed.

use std::any::Any;
use takt_abi::Time;
use takt_engine::{BusSize, IoDriver, IoFault, ProcessImage};

/// How often exchanges fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Losses {
    /// The same seed gives the same losses.
    pub seed: u64,
    /// Failing exchanges in a million.
    pub per_million: u32,
    /// How many in a row fail each time, at least 1.
    pub length: u32,
}

/// Wraps a driver: a failed exchange reaches nobody; the inputs keep their values.
pub struct Lossy {
    inner: Box<dyn IoDriver>,
    losses: Losses,
    state: u64,
    left: u32,
}

impl Lossy {
    /// Fails as `losses` says.
    pub fn new(inner: Box<dyn IoDriver>, losses: Losses) -> Self {
        Self { inner, losses, state: losses.seed, left: 0 }
    }
    /// SplitMix64 (Steele, Lea, Flood 2014).
    fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.state ^ self.state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }
}

impl IoDriver for Lossy {
    fn size(&self) -> BusSize {
        self.inner.size()
    }
    fn exchange(&mut self, now: Time, io: &mut ProcessImage) -> Result<(), IoFault> {
        if self.left == 0 && self.random() % 1_000_000 < self.losses.per_million.into() {
            self.left = self.losses.length.max(1);
        }
        if self.left > 0 {
            self.left -= 1;
            return Err(IoFault::Lost);
        }
        self.inner.exchange(now, io)
    }
    fn save(&self) -> Option<Box<dyn Any + Send>> {
        Some(Box::new((self.state, self.left, self.inner.save())))
    }
    fn restore(&mut self, saved: &dyn Any) -> bool {
        let Some((state, left, inner)) = saved.downcast_ref::<(u64, u32, Option<Box<dyn Any + Send>>)>() else { return false };
        (self.state, self.left) = (*state, *left);
        inner.as_ref().is_none_or(|inner| self.inner.restore(inner.as_ref()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_engine::NoBus;

    #[test]
    fn losses_come_as_often_as_asked_and_the_same_each_time() {
        let run = || {
            let mut bus = Lossy::new(Box::new(NoBus), Losses { seed: 7, per_million: 10_000, length: 3 });
            let mut io = ProcessImage::default();
            (0..100_000).map(|_| bus.exchange(Time(0), &mut io).is_err()).collect::<Vec<_>>()
        };
        let first = run();
        let lost = first.iter().filter(|l| **l).count();
        assert!((2400..3600).contains(&lost), "{lost}");
        assert_eq!(first, run());
    }
}
