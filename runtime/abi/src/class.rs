//! What stands where: the type of each block instance that calls may be dispatched on, kept outside the image so that no program can forge it.

use crate::plain::Plain;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Bytes of the image that one entry of the table is for. Instances of classes begin at multiples of it.
pub const GRANULE: u64 = 16;

/// The class of the instance that begins at each granule of the image: a number from 1, or 0. Written by loading, by entering a body whose frame holds
/// instances, and by `__NEW`; machine code reads it.
#[derive(Debug, Clone, Default)]
pub struct Classes(Arc<[AtomicU32]>);

impl Classes {
    /// A table for an image of that many bytes, without instances.
    pub fn new(image_size: u64) -> Self {
        Self((0..image_size / GRANULE).map(|_| AtomicU32::new(0)).collect())
    }
    /// First entry, for machine code; valid as long as the table lives.
    pub fn start(&self) -> *const AtomicU32 {
        self.0.as_ptr()
    }
    /// The class of the instance that begins at `offset`; 0 where none does.
    pub fn at(&self, offset: u64) -> u32 {
        let entry = offset.is_multiple_of(GRANULE).then(|| self.0.get((offset / GRANULE) as usize)).flatten();
        entry.map_or(0, |class| class.load(Relaxed))
    }
    /// Becomes like another table for an image of the same size.
    pub fn copy(&self, other: &Self) {
        self.0.iter().zip(&*other.0).for_each(|(to, from)| to.store(from.load(Relaxed), Relaxed));
    }
    /// Appends the entries that are not 0, as number of the granule and class, for a checkpoint.
    pub fn save_into(&self, out: &mut Vec<u8>) {
        for (granule, class) in self.0.iter().enumerate() {
            let class = class.load(Relaxed);
            if class != 0 {
                out.extend_from_slice(&(granule as u32).to_le_bytes());
                out.extend_from_slice(&class.to_le_bytes());
            }
        }
    }
    /// Takes what [`Classes::save_into`] wrote, if `fits` says so of each offset and class; false, and unchanged, when the bytes are not that.
    pub fn restore(&self, bytes: &[u8], fits: impl Fn(u64, u32) -> bool) -> bool {
        let entry = |e: &[u8]| (u32::load(e) as usize, u32::load(&e[4..]));
        let entries = || bytes.chunks_exact(8).map(entry);
        let good = |(granule, class)| granule < self.0.len() && fits(granule as u64 * GRANULE, class);
        if !bytes.len().is_multiple_of(8) || !entries().all(good) {
            return false;
        }
        self.0.iter().for_each(|class| class.store(0, Relaxed));
        entries().for_each(|(granule, class)| self.0[granule].store(class, Relaxed));
        true
    }
    /// `count` instances of `class` from `offset` on, one each `stride` bytes. What lies outside the table or between granules is left out.
    pub fn put(&self, offset: u64, class: u32, stride: u64, count: u64) {
        let end = self.0.len() as u64 * GRANULE;
        let places = (0..count).map_while(|i| offset.checked_add(i.checked_mul(stride)?)).take_while(|at| *at < end);
        for at in places.filter(|at| at.is_multiple_of(GRANULE)) {
            self.0[(at / GRANULE) as usize].store(class, Relaxed);
        }
    }
    /// No instance begins in these bytes any more.
    pub fn clear(&self, offset: u64, len: u64) {
        let (from, to) = (offset.div_ceil(GRANULE) as usize, offset.saturating_add(len).div_ceil(GRANULE) as usize);
        let entries = self.0.get(from.min(self.0.len())..to.min(self.0.len())).unwrap_or_default();
        entries.iter().for_each(|entry| entry.store(0, Relaxed));
    }
}

#[cfg(test)]
mod tests {
    use super::Classes;

    #[test]
    fn an_instance_is_found_where_it_begins_and_nowhere_else() {
        let classes = Classes::new(128);
        classes.put(16, 3, 32, 3);
        assert_eq!((0..8).map(|i| classes.at(16 * i)).collect::<Vec<_>>(), [0, 3, 0, 3, 0, 3, 0, 0]);
        assert_eq!([17, 24, 128, u64::MAX].map(|at| classes.at(at)), [0; 4]);
        classes.clear(40, 20);
        assert_eq!([16, 48, 80].map(|at| classes.at(at)), [3, 0, 3]);
    }

    #[test]
    fn what_leaves_the_table_is_left_out() {
        let classes = Classes::new(64);
        classes.put(48, 1, 16, 1 << 40);
        classes.put(u64::MAX - 15, 1, 16, 2);
        classes.put(8, 1, 16, 1);
        assert_eq!([0, 16, 32, 48].map(|at| classes.at(at)), [0, 0, 0, 1]);
        classes.clear(32, u64::MAX);
        assert_eq!(classes.at(48), 0);
    }
}
