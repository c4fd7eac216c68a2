//! What cannot be plain: open files, growing queues. It lives beside the image, in a table that the engine owns.
//!
//! A resource belongs to one block instance (by offset) and is made when the program is loaded, so that a scan allocates nothing and no program can
//! forge an owner. A [`Handle`] may travel through the image; it is checked against the generation at each use.

use crate::desc::{Elem, FieldType};
use crate::plain::Plain;
use std::any::Any;

/// State of a block that is not plain.
pub trait Resource: Any + Send {
    /// Its content, for a checkpoint.
    fn save(&self) -> Vec<u8>;
    /// Appends what [`Resource::save`] gives. Where checkpoints are taken while a machine runs, `out` has room: override it if `save` allocates.
    fn save_into(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.save());
    }
    /// Takes a saved content; returns false (and is as new) when the bytes are not one.
    fn restore(&mut self, bytes: &[u8]) -> bool;
    /// For downcasts.
    fn as_any(&mut self) -> &mut dyn Any;
}

/// Names a resource in the image: index and generation. 0 names nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(transparent)]
pub struct Handle(pub u64);

impl Plain for Handle {
    const TYPE: FieldType = FieldType::Elem(Elem::Lword);
    const INIT: Self = Self(0);
    fn load(bytes: &[u8]) -> Self {
        Self(u64::load(bytes))
    }
    fn store(&self, bytes: &mut [u8]) {
        self.0.store(bytes);
    }
}

struct Slot {
    owner: u64,
    generation: u32,
    resource: Option<Box<dyn Resource>>,
}

/// All resources of a running program.
#[derive(Default)]
pub struct Resources {
    slots: Vec<Slot>,
    generation: u32,
}

impl Resources {
    /// Gives the instance at `owner` its resource. Owners must be added in rising order.
    pub fn add(&mut self, owner: u64, resource: Box<dyn Resource>) {
        assert!(self.slots.last().is_none_or(|s| s.owner < owner), "owners rise");
        self.generation += 1;
        self.slots.push(Slot { owner, generation: self.generation, resource: Some(resource) });
    }
    /// The handle of the resource that belongs to the instance at `owner`.
    pub fn of(&self, owner: u64) -> Option<Handle> {
        let i = self.slots.binary_search_by_key(&owner, |s| s.owner).ok()?;
        Some(Handle((i as u64 + 1) << 32 | u64::from(self.slots[i].generation)))
    }
    fn slot(&mut self, handle: Handle) -> Option<&mut Slot> {
        let i = (handle.0 >> 32).checked_sub(1)?;
        self.slots.get_mut(i as usize).filter(|s| s.generation == handle.0 as u32)
    }
    /// Takes the resource out while a block works with it; [`Resources::put`] brings it back. `None`: a stale handle, or it is out already.
    pub fn take(&mut self, handle: Handle) -> Option<Box<dyn Resource>> {
        self.slot(handle)?.resource.take()
    }
    /// Brings a taken resource back.
    pub fn put(&mut self, handle: Handle, resource: Box<dyn Resource>) {
        if let Some(slot) = self.slot(handle) {
            slot.resource = Some(resource);
        }
    }
    /// The resource as `T`, if the handle is good and it is one.
    pub fn get<T: Resource>(&mut self, handle: Handle) -> Option<&mut T> {
        self.slot(handle)?.resource.as_mut()?.as_any().downcast_mut()
    }
    /// Appends owner, length and content of each resource, for a checkpoint. A resource that is out at the moment is left out.
    pub fn save_into(&self, out: &mut Vec<u8>) {
        for (owner, resource) in self.slots.iter().filter_map(|s| Some((s.owner, s.resource.as_ref()?))) {
            out.extend_from_slice(&owner.to_le_bytes());
            let start = out.len();
            out.extend_from_slice(&[0; 8]);
            resource.save_into(out);
            let length = (out.len() - start - 8) as u64;
            out[start..start + 8].copy_from_slice(&length.to_le_bytes());
        }
    }
    /// Gives the resource of an owner the content that it saved; false if there is no such resource or the bytes are not one.
    pub fn restore(&mut self, owner: u64, content: &[u8]) -> bool {
        let Ok(i) = self.slots.binary_search_by_key(&owner, |s| s.owner) else { return false };
        self.slots[i].resource.as_mut().is_some_and(|resource| resource.restore(content))
    }
    /// How many there are.
    pub fn len(&self) -> usize {
        self.slots.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }
    /// Owners and saved contents, for a checkpoint.
    pub fn save(&self) -> Vec<(u64, Vec<u8>)> {
        self.slots.iter().filter_map(|s| Some((s.owner, s.resource.as_ref()?.save()))).collect()
    }
}

impl std::fmt::Debug for Resources {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Resources({})", self.slots.len())
    }
}
