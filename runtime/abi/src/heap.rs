//! The heap of `__NEW`: a region of the image, its bookkeeping outside of it.
//!
//! A buddy allocator: blocks are 16 · 2ⁿ bytes. Giving and taking back cost at most one step per size (28 at the most), whatever the program did before.
//! A program can overwrite what lies in the heap, never what is known about it.

use crate::fault::Fault;
use crate::plain::Plain;

/// Marks a block that was given away, in a saved heap.
const USED: u32 = 1 << 31;

/// The smallest block, bytes.
const LEAST: u32 = 16;

/// What is known of the block that begins at a granule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum State {
    /// Inside of a block.
    #[default]
    Inside,
    /// Free, of this order.
    Free(u8),
    /// Given away, of this order.
    Used(u8),
}

#[derive(Debug, Clone, Copy, Default)]
struct Granule {
    state: State,
    /// Neighbours in the list of free blocks of the same order; the own number if there is none.
    next: u32,
    before: u32,
}

/// A heap. The default one is empty: it never has room.
#[derive(Debug, Clone, Default)]
pub struct Heap {
    start: u32,
    granules: Vec<Granule>,
    /// First free block per order.
    free: Vec<Option<u32>>,
}

impl Heap {
    /// A heap over `len` bytes of the image from `start`. `len` is 16 · 2ⁿ; what is more than that is not used.
    pub fn new(start: u32, len: u32) -> Self {
        let count = len / LEAST;
        if count == 0 {
            return Self::default();
        }
        let order = count.ilog2();
        let mut heap = Self { start, granules: vec![Granule::default(); 1 << order], free: vec![None; order as usize + 1] };
        heap.add(0, order as u8);
        heap
    }

    /// At least `size` bytes, at an offset that is a multiple of 16; `None` if there is no room.
    pub fn give(&mut self, size: u64) -> Option<u64> {
        let wanted = size.max(1).div_ceil(LEAST.into()).checked_next_power_of_two()?.ilog2() as usize;
        let found = (wanted..self.free.len()).find(|order| self.free[*order].is_some())?;
        let block = self.free[found]?;
        self.remove(block, found as u8);
        for order in (wanted..found).rev() {
            self.add(block + (1 << order), order as u8);
        }
        self.granules[block as usize].state = State::Used(wanted as u8);
        Some(u64::from(self.start) + u64::from(block) * u64::from(LEAST))
    }

    /// Takes back what [`Heap::give`] gave, and says how many bytes that were.
    ///
    /// # Errors
    /// [`Fault::WrongDelete`] for any other offset, and for one that was taken back before.
    pub fn take(&mut self, offset: u64) -> Result<u64, Fault> {
        let behind = offset.checked_sub(self.start.into()).filter(|o| o.is_multiple_of(LEAST.into())).ok_or(Fault::WrongDelete)?;
        let mut block = u32::try_from(behind / u64::from(LEAST)).map_err(|_| Fault::WrongDelete)?;
        let Some(Granule { state: State::Used(given), .. }) = self.granules.get(block as usize).copied() else {
            return Err(Fault::WrongDelete);
        };
        let mut order = given;
        self.granules[block as usize].state = State::Inside;
        while usize::from(order) + 1 < self.free.len() {
            let other = block ^ (1 << order);
            if self.granules[other as usize].state != State::Free(order) {
                break;
            }
            self.remove(other, order);
            (block, order) = (block.min(other), order + 1);
        }
        self.add(block, order);
        Ok(u64::from(LEAST) << given)
    }

    /// Appends what is known of each block, for a checkpoint.
    pub fn save_into(&self, out: &mut Vec<u8>) {
        let heads = self.free.iter().map(|first| first.unwrap_or(u32::MAX));
        heads.for_each(|first| out.extend_from_slice(&first.to_le_bytes()));
        for (block, granule) in self.granules.iter().enumerate() {
            let state = match granule.state {
                State::Inside => continue,
                State::Free(order) => u32::from(order),
                State::Used(order) => USED | u32::from(order),
            };
            [block as u32, state, granule.next, granule.before].iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
        }
    }

    /// A heap over the same region with the blocks that [`Heap::save_into`] wrote; `None` when the bytes are not that.
    pub fn restored(&self, bytes: &[u8]) -> Option<Self> {
        let word = |bytes: &[u8], i: usize| u32::load(&bytes[i * 4..]);
        let (heads, blocks) = bytes.split_at_checked(self.free.len() * 4).filter(|(_, blocks)| blocks.len().is_multiple_of(16))?;
        let count = self.granules.len();
        let mut heap = Self { granules: vec![Granule::default(); count], free: vec![None; self.free.len()], ..*self };
        let mut end = 0;
        for block in blocks.chunks_exact(16) {
            let [at, state, next, before] = std::array::from_fn(|i| word(block, i));
            let order = u8::try_from(state & !USED).ok().filter(|order| usize::from(*order) < heap.free.len())?;
            // The blocks lie one behind the other, without a gap.
            if at != end || !at.is_multiple_of(1 << order) || (next as usize) >= count || (before as usize) >= count {
                return None;
            }
            end = at.checked_add(1 << order).filter(|end| *end as usize <= count)?;
            let state = if state & USED == 0 { State::Free(order) } else { State::Used(order) };
            heap.granules[at as usize] = Granule { state, next, before };
        }
        for order in 0..heap.free.len() {
            let first = word(heads, order);
            heap.free[order] = (first != u32::MAX).then_some(first);
        }
        (end as usize == count && heap.lists_are_whole()).then_some(heap)
    }

    /// Every free block is in the list of its order, once, and nothing else is.
    fn lists_are_whole(&self) -> bool {
        let mut listed = 0;
        for (order, first) in self.free.iter().enumerate() {
            let (mut before, mut next) = (None, *first);
            while let Some(block) = next {
                let Some(granule) = self.granules.get(block as usize) else { return false };
                if granule.state != State::Free(order as u8) || granule.before != before.unwrap_or(block) || listed == self.granules.len() {
                    return false;
                }
                listed += 1;
                (before, next) = (Some(block), (granule.next != block).then_some(granule.next));
            }
        }
        listed == self.granules.iter().filter(|granule| matches!(granule.state, State::Free(_))).count()
    }

    fn add(&mut self, block: u32, order: u8) {
        let first = self.free[usize::from(order)].replace(block);
        self.granules[block as usize] = Granule { state: State::Free(order), next: first.unwrap_or(block), before: block };
        if let Some(first) = first {
            self.granules[first as usize].before = block;
        }
    }
    fn remove(&mut self, block: u32, order: u8) {
        let Granule { next, before, .. } = self.granules[block as usize];
        let (next, before) = ((next != block).then_some(next), (before != block).then_some(before));
        if let Some(next) = next {
            self.granules[next as usize].before = before.unwrap_or(next);
        }
        match before {
            Some(before) => self.granules[before as usize].next = next.unwrap_or(before),
            None => self.free[usize::from(order)] = next,
        }
        self.granules[block as usize].state = State::Inside;
    }
}

#[cfg(test)]
mod tests {
    use super::Heap;
    use crate::Fault;

    #[test]
    fn blocks_do_not_overlap_and_everything_comes_back() {
        let mut heap = Heap::new(1024, 1 << 16);
        let mut seed = 1u32;
        let mut live: Vec<(u64, u64)> = Vec::new();
        for _ in 0..20_000 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let size = u64::from(seed >> 8) % 700 + 1;
            if seed >> 31 == 0 {
                if let Some(at) = heap.give(size) {
                    assert!(at % 16 == 0 && at >= 1024 && at + size <= 1024 + (1 << 16));
                    assert!(live.iter().all(|(a, s)| at + size <= *a || a + s <= at), "{at} overlaps");
                    live.push((at, size));
                }
            } else if !live.is_empty() {
                let (at, size) = live.swap_remove(seed as usize % live.len());
                assert!(heap.take(at).unwrap() >= size);
            }
        }
        live.drain(..).for_each(|(at, _)| assert!(heap.take(at).is_ok()));
        assert_eq!(heap.give(1 << 16), Some(1024));
        assert_eq!(heap.give(1), None);
    }

    #[test]
    fn a_saved_heap_comes_back_and_goes_on_alike_and_no_other_bytes_do() {
        let mut heap = Heap::new(64, 1 << 12);
        let given: Vec<u64> = (1..20).filter_map(|n| heap.give(n * 13)).collect();
        given.iter().step_by(3).for_each(|at| assert!(heap.take(*at).is_ok()));
        let mut saved = Vec::new();
        heap.save_into(&mut saved);
        let mut back = Heap::new(64, 1 << 12).restored(&saved).unwrap();
        let go_on = |heap: &mut Heap| {
            let mut all: Vec<_> = (1..30).map(|n| heap.give(n * 7)).collect();
            all.extend(given.iter().map(|at| heap.take(*at).ok()));
            all
        };
        assert_eq!(go_on(&mut heap), go_on(&mut back));
        assert!((0..saved.len()).all(|cut| Heap::new(64, 1 << 12).restored(&saved[..cut]).is_none()));
        for at in 0..saved.len() {
            for value in [0, 1, 3, 0x80, 0xFF] {
                let mut wrong = saved.clone();
                wrong[at] = value;
                // Refused, or a heap that holds what it promises.
                if let Some(mut heap) = Heap::new(64, 1 << 12).restored(&wrong) {
                    go_on(&mut heap);
                }
            }
        }
        assert_eq!(Heap::default().restored(&[]).map(|mut heap| heap.give(1)), Some(None));
    }

    #[test]
    fn only_what_was_given_is_taken_back_and_only_once() {
        let mut heap = Heap::new(64, 256);
        let at = heap.give(40).unwrap();
        for wrong in [0, 63, at + 16, at + 1, 64 + 256, u64::MAX] {
            assert_eq!(heap.take(wrong), Err(Fault::WrongDelete), "{wrong}");
        }
        assert_eq!(heap.take(at), Ok(64));
        assert_eq!(heap.take(at), Err(Fault::WrongDelete));
        assert_eq!((heap.give(257), heap.give(u64::MAX), Heap::default().give(1)), (None, None, None));
    }
}
