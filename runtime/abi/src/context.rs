//! What a running scan carries: [`Context`] for compiled code, [`Env`] for the engine, [`Cx`] for native blocks.

use crate::class::Classes;
use crate::fault::Fault;
use crate::heap::Heap;
use crate::host::Host;
use crate::plain::{OpenArray, Plain, Ptr};
use crate::resource::Resources;
use crate::system::Messages;
use crate::{Handle, Time};
use std::sync::atomic::AtomicU32;

/// Call-stack entries that are kept of a fault.
pub const TRACE_DEPTH: usize = 64;

/// Called at a poll when fuel or the flag asks for it: 0 to go on, else the code of a fault (already in the context).
///
/// # Safety
/// `ctx` must be the live context.
pub type PollFn = unsafe extern "C" fn(ctx: *mut Context, site: u32) -> u32;

/// Shared with machine code; the offsets are part of the contract (`offset_of!`).
#[repr(C)]
#[derive(Debug)]
pub struct Context {
    /// Not 0: the next poll looks closer (stop, preemption, deadline). At offset 0, read by `atomic_load`.
    pub flag: AtomicU32,
    /// Code of the fault that ended the scan, 0 if none.
    pub fault_code: u32,
    /// What is left of the slice of fuel; a poll that makes it negative calls `poll`.
    pub fuel: i64,
    /// Site of the fault (index into the program's table).
    pub fault_site: u32,
    /// Entries in `trace`.
    pub trace_len: u32,
    /// Facts of the fault.
    pub fault_facts: [i64; 3],
    /// Calls under way in recursive cycles.
    pub depth: u32,
    /// `depth` must stay below.
    pub depth_limit: u32,
    /// First byte of the image.
    pub image: *mut u8,
    /// Size of the image in bytes.
    pub image_size: u64,
    /// Offset behind the stack region of the running task.
    pub stack_end: u64,
    /// Slow path of a poll.
    pub poll: PollFn,
    /// Call sites from the fault outwards, appended by each caller as it returns.
    pub trace: [u32; TRACE_DEPTH],
    /// The engine's side.
    pub env: *mut Env,
    /// First entry of the table of instances ([`Classes::start`]); it has one for each granule of the image if the program has classes.
    pub classes: *const AtomicU32,
}

impl Context {
    /// A context on an image, with no fuel, no stack region and no recursion yet.
    pub fn new(image: *mut u8, image_size: u64, env: &mut Env, poll: PollFn) -> Self {
        Self {
            flag: 0.into(),
            fault_code: 0,
            fuel: 0,
            fault_site: u32::MAX,
            trace_len: 0,
            fault_facts: [0; 3],
            depth: 0,
            depth_limit: 0,
            image,
            image_size,
            stack_end: 0,
            poll,
            trace: [0; TRACE_DEPTH],
            classes: env.classes.start(),
            env,
        }
    }
    /// Records a fault at a site and returns its code.
    pub fn fail(&mut self, fault: Fault, site: u32) -> u32 {
        self.fault_code = fault.code();
        self.fault_facts = fault.facts();
        self.fault_site = site;
        self.trace_len = 0;
        self.fault_code
    }
    /// Takes up the fault with that number again, whose facts and site are still here, and returns its code.
    pub fn again(&mut self, code: u64) -> u32 {
        let known = u32::try_from(code).ok().and_then(|code| Fault::from_raw(code, self.fault_facts)).unwrap_or(Fault::Panic);
        self.fault_code = known.code();
        self.trace_len = 0;
        self.fault_code
    }
    /// Appends a caller's site to the trace.
    pub fn push_trace(&mut self, site: u32) {
        if let Some(entry) = self.trace.get_mut(self.trace_len as usize) {
            *entry = site;
            self.trace_len += 1;
        }
    }
    /// The fault that ended the scan.
    pub fn fault(&self) -> Option<Fault> {
        Fault::from_raw(self.fault_code, self.fault_facts)
    }
}

/// The engine's side of a scan: what native blocks reach through [`Cx`].
pub struct Env {
    /// Start of the scan; constant during it.
    pub now: Time,
    /// Period of the running task.
    pub period: Time,
    /// Number of the running task.
    pub task: u32,
    /// Scans this task has started.
    pub cycle: u64,
    /// Number of the task that owns the bus (blocks on axes belong there).
    pub bus_task: u32,
    /// Period of the bus task.
    pub bus_period: Time,
    /// Non-plain state of blocks.
    pub resources: Resources,
    /// Files.
    pub host: Box<dyn Host>,
    /// What instances stand where.
    pub classes: Classes,
    /// What `__NEW` gives.
    pub heap: Heap,
    /// What the program says to people.
    pub messages: Messages,
}

impl Env {
    /// An environment at time 0 for task 0, which owns the bus, without resources, instances and heap.
    pub fn new(period: Time, host: Box<dyn Host>) -> Self {
        Self {
            now: Time(0),
            period,
            task: 0,
            cycle: 0,
            bus_task: 0,
            bus_period: period,
            resources: Resources::default(),
            host,
            classes: Classes::default(),
            heap: Heap::default(),
            messages: Messages::default(),
        }
    }
}

impl std::fmt::Debug for Env {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Env").field("now", &self.now).field("task", &self.task).finish_non_exhaustive()
    }
}

/// What the body of a native block is handed.
pub struct Cx<'a> {
    /// Start of the scan.
    pub now: Time,
    /// Period of the running task.
    pub period: Time,
    /// Offset of the running instance (0 in functions).
    pub this: u64,
    /// Fuel that is left; long work takes some.
    pub fuel: &'a mut i64,
    /// Engine services.
    pub env: &'a mut Env,
    mem: &'a mut [u8],
}

impl<'a> Cx<'a> {
    /// A context over an image, for executors and for unit tests of blocks.
    pub fn new(mem: &'a mut [u8], env: &'a mut Env, fuel: &'a mut i64, this: u64) -> Self {
        Self { now: env.now, period: env.period, this, fuel, env, mem }
    }
    /// Whether the running task owns the bus.
    pub fn in_bus_task(&self) -> bool {
        self.env.task == self.env.bus_task
    }
    /// `size` bytes of the image at `offset`.
    pub fn bytes(&self, offset: u64, size: usize) -> Result<&[u8], Fault> {
        let range = self.range(offset, size)?;
        Ok(&self.mem[range])
    }
    /// The same, writable.
    pub fn bytes_mut(&mut self, offset: u64, size: usize) -> Result<&mut [u8], Fault> {
        let range = self.range(offset, size)?;
        Ok(&mut self.mem[range])
    }
    fn range(&self, offset: u64, size: usize) -> Result<std::ops::Range<usize>, Fault> {
        if offset == 0 {
            return Err(Fault::NullPointer);
        }
        let end = offset.checked_add(size as u64).filter(|end| *end <= self.mem.len() as u64);
        let end = end.ok_or(Fault::WildPointer { offset, size: size as u64 })?;
        Ok(offset as usize..end as usize)
    }
    /// Loads a value at an offset.
    pub fn load<T: Plain>(&self, offset: u64) -> Result<T, Fault> {
        Ok(T::load(self.bytes(offset, size_of::<T>())?))
    }
    /// Stores a value at an offset.
    pub fn store<T: Plain>(&mut self, offset: u64, value: &T) -> Result<(), Fault> {
        value.store(self.bytes_mut(offset, size_of::<T>())?);
        Ok(())
    }
    /// Loads what a VAR_IN_OUT refers to.
    pub fn get<T: Plain>(&self, place: crate::InOut<T>) -> Result<T, Fault> {
        self.load(place.0)
    }
    /// Stores into what a VAR_IN_OUT refers to.
    pub fn set<T: Plain>(&mut self, place: crate::InOut<T>, value: &T) -> Result<(), Fault> {
        self.store(place.0, value)
    }
    /// Loads through a pointer.
    pub fn deref<T: Plain>(&self, pointer: Ptr<T>) -> Result<T, Fault> {
        self.load(pointer.0)
    }
    /// Loads element `i` (counted from 0) of an `ARRAY[*]`.
    pub fn element<T: Plain>(&self, array: OpenArray<T>, i: usize) -> Result<T, Fault> {
        self.load(self.element_offset(array, i)?)
    }
    /// Stores element `i` (counted from 0) of an `ARRAY[*]`.
    pub fn set_element<T: Plain>(&mut self, array: OpenArray<T>, i: usize, value: &T) -> Result<(), Fault> {
        let offset = self.element_offset(array, i)?;
        self.store(offset, value)
    }
    fn element_offset<T: Plain>(&self, array: OpenArray<T>, i: usize) -> Result<u64, Fault> {
        if array.offset == 0 {
            return Err(Fault::NullPointer);
        }
        if i >= array.len() {
            let value = array.low.saturating_add_unsigned(i as u64);
            return Err(Fault::Index { value, low: array.low, high: array.high });
        }
        let size = size_of::<T>() as u64;
        (i as u64).checked_mul(size).and_then(|o| o.checked_add(array.offset)).ok_or(Fault::WildPointer { offset: array.offset, size })
    }
    /// The handle of the running instance's own resource. A copied instance owns nothing.
    pub fn own(&self) -> Option<Handle> {
        self.env.resources.of(self.this)
    }
}
