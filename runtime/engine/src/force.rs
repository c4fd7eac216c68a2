//! Variables that are held at values. Room for them is there from the start: to force allocates nothing.

use crate::command::{AccessError, writable};
use crate::pack::Pack;
use takt_ir::{Place, Program, TypeId};

/// Variables that may be forced at the same time.
pub const FORCES: usize = 1024;
/// Bytes of their values, and as many again for what was there before.
pub const FORCED_BYTES: usize = 1 << 16;

/// A variable that is held at a value.
#[derive(Debug, Clone, Copy)]
struct Force {
    place: Place,
    /// Bits of the first byte that are held.
    mask: u8,
    len: u32,
}

/// A forced variable as others see it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Forced<'a> {
    /// The variable.
    pub place: Place,
    /// What it is held at.
    pub bytes: &'a [u8],
    /// What it was before it was forced for the first time.
    pub before: &'a [u8],
}

/// The forces, in the order they were made.
#[derive(Debug)]
pub(crate) struct Forces {
    list: Vec<Force>,
    /// Values, one behind the other.
    values: Vec<u8>,
    /// In the same places what was there before.
    before: Vec<u8>,
}

impl Default for Forces {
    fn default() -> Self {
        Self { list: Vec::with_capacity(FORCES), values: Vec::with_capacity(FORCED_BYTES), before: Vec::with_capacity(FORCED_BYTES) }
    }
}

/// Writes a value; of its first byte only the bits of `mask`.
pub(crate) fn put(target: &mut [u8], bytes: &[u8], mask: u8) {
    let first = target.first().map_or(0, |byte| byte & !mask);
    target.copy_from_slice(bytes);
    if let Some(byte) = target.first_mut() {
        *byte = *byte & mask | first;
    }
}

impl Forces {
    /// How many.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// The forces and where their bytes begin.
    fn spans(&self) -> impl Iterator<Item = (Force, std::ops::Range<usize>)> {
        self.list.iter().scan(0, |end, force| {
            let start = *end;
            *end += force.len as usize;
            Some((*force, start..*end))
        })
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = Forced<'_>> {
        self.spans().map(|(force, span)| Forced { place: force.place, bytes: &self.values[span.clone()], before: &self.before[span] })
    }

    /// One by its number.
    pub fn get(&self, index: usize) -> Option<Forced<'_>> {
        self.iter().nth(index)
    }

    /// Holds a place at a value; what is there now is remembered unless it is forced already.
    pub fn add(&mut self, place: Place, mask: u8, bytes: &[u8], now: &[u8]) -> Result<(), AccessError> {
        let held = self.spans().find(|(force, _)| force.place == place);
        if let Some((_, span)) = held {
            self.values[span].copy_from_slice(bytes);
            return Ok(());
        }
        if self.list.len() == FORCES || self.values.len() + bytes.len() > FORCED_BYTES {
            return Err(AccessError::TooManyForces { most: FORCES, bytes: FORCED_BYTES });
        }
        self.list.push(Force { place, mask, len: bytes.len() as u32 });
        self.values.extend_from_slice(bytes);
        self.before.extend_from_slice(now);
        Ok(())
    }

    /// Lets the last force go, or the one on a place; what was there before goes back into the image if it is to be restored. False if there is none.
    pub fn release(&mut self, place: Option<Place>, image: &mut [u8], restore: bool) -> bool {
        let wanted = |(_, (force, _)): &(usize, (Force, _))| place.is_none_or(|place| force.place == place);
        let found = self.spans().enumerate().filter(wanted).last();
        let Some((index, (force, span))) = found else { return false };
        if restore && let Some(target) = image.get_mut(force.place.offset as usize..force.place.offset as usize + span.len()) {
            put(target, &self.before[span.clone()], force.mask);
        }
        self.values.drain(span.clone());
        self.before.drain(span);
        self.list.remove(index);
        true
    }

    /// All of them, for a checkpoint.
    pub fn save(&self, out: &mut Vec<u8>) {
        self.list.len().pack(out);
        for forced in self.iter() {
            (forced.place.offset, forced.place.ty.0).pack(out);
            out.extend_from_slice(forced.bytes);
            out.extend_from_slice(forced.before);
        }
    }

    /// What was saved, if each of them may be forced in this program.
    pub fn restored(program: &Program, from: &mut &[u8]) -> Option<Self> {
        let mut forces = Self::default();
        for _ in 0..usize::unpack(from)? {
            let (offset, ty) = Pack::unpack(from)?;
            let place = Place { offset, ty: TypeId(ty) };
            let (range, mask) = writable(program, place).ok()?;
            let (bytes, rest) = from.split_at_checked(range.len())?;
            let (before, rest) = rest.split_at_checked(range.len())?;
            *from = rest;
            forces.add(place, mask, bytes, before).ok()?;
        }
        Some(forces)
    }

    /// Writes the values into the image.
    pub fn apply(&self, image: &mut [u8]) {
        for (force, span) in self.spans() {
            let start = force.place.offset as usize;
            if let Some(target) = image.get_mut(start..start + span.len()) {
                put(target, &self.values[span], force.mask);
            }
        }
    }
}
