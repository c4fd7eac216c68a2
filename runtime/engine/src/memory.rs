//! The image, and the boundary to executors: what machine code reaches by address.
//!
//! An executor is handed a [`Context`] with raw pointers to image and environment, and calls back into the engine at polls. All of that is here, so that
//! the rest of the engine is safe code. The image is page-aligned and zeroed. There is no guard region behind it: both executors check every access
//! against its end, and this crate maps no memory of its own.
//!
//! **Invariants.** What an executor reaches by address ([`Pinned`]) is allocated once and never moves. While an executor runs, the engine touches the
//! [`Core`] only inside [`poll`], where the executor is suspended and holds no reference to it; there it leaves alone the lanes of tasks under way.

use crate::core::Core;
use crate::executor::Executor;
use std::alloc::{Layout, alloc_zeroed, dealloc};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr::NonNull;
use takt_abi::{Context, Env, Fault};
use takt_ir::{BodyId, Interpreter, Program};

const PAGE: usize = 4096;

/// The memory of a running program, all zero at first.
pub(crate) struct Image {
    start: NonNull<u8>,
    len: usize,
}

impl Image {
    /// `None`: there is not so much memory.
    #[allow(unsafe_code, reason = "page-aligned memory that machine code addresses")]
    pub fn new(len: usize) -> Option<Self> {
        let layout = Self::layout(len)?;
        // SAFETY: the layout's size is not 0.
        NonNull::new(unsafe { alloc_zeroed(layout) }).map(|start| Self { start, len })
    }
    fn layout(len: usize) -> Option<Layout> {
        Layout::from_size_align(len.max(PAGE).checked_next_multiple_of(PAGE)?, PAGE).ok()
    }
    /// All bytes.
    #[allow(unsafe_code, reason = "the allocation of `new`")]
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: `new` allocated at least `len` initialised bytes; executors run only under `&mut Core`, which excludes this borrow.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
    /// All bytes, writable.
    #[allow(unsafe_code, reason = "the allocation of `new`")]
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: as in `bytes`; the borrow is exclusive.
        unsafe { std::slice::from_raw_parts_mut(self.start.as_ptr(), self.len) }
    }
}

impl Drop for Image {
    #[allow(unsafe_code, reason = "the allocation of `new`")]
    fn drop(&mut self) {
        if let Some(layout) = Self::layout(self.len) {
            // SAFETY: allocated in `new` with the same layout.
            unsafe { dealloc(self.start.as_ptr(), layout) }
        }
    }
}

/// A box whose content stays reachable by address while its owner is borrowed or moved.
pub(crate) struct Pinned<T>(NonNull<T>);

impl<T> Pinned<T> {
    pub fn new(value: T) -> Self {
        Self(NonNull::from(Box::leak(Box::new(value))))
    }
    #[allow(unsafe_code, reason = "the box of `new`")]
    pub fn get(&self) -> &T {
        // SAFETY: the box of `new` lives until `drop`; see the module's invariants for executors.
        unsafe { self.0.as_ref() }
    }
    #[allow(unsafe_code, reason = "the box of `new`")]
    pub fn get_mut(&mut self) -> &mut T {
        // SAFETY: as in `get`; the borrow is exclusive.
        unsafe { self.0.as_mut() }
    }
}

impl<T> Drop for Pinned<T> {
    #[allow(unsafe_code, reason = "the box of `new`")]
    fn drop(&mut self) {
        // SAFETY: made from a box in `new`, dropped once.
        drop(unsafe { Box::from_raw(self.0.as_ptr()) });
    }
}

/// What one task needs to run, allocated when the program is loaded.
pub(crate) struct Lane {
    pub ctx: Context,
    pub interpreter: Interpreter,
}

impl Lane {
    /// A lane on an image and environment.
    pub fn new(program: &Program, image: &mut Image, env: &mut Pinned<Env>, depth_limit: u32) -> Self {
        let env_at = env.0.as_ptr();
        let mut ctx = Context::new(image.start.as_ptr(), image.len as u64, env.get_mut(), poll);
        (ctx.depth_limit, ctx.env) = (depth_limit, env_at);
        Self { ctx, interpreter: Interpreter::new(program) }
    }
    /// Ready for a scan.
    pub fn prepare(&mut self, fuel: i64, stack_end: u64) {
        let ctx = &mut self.ctx;
        (ctx.fault_code, ctx.fault_site, ctx.trace_len, ctx.depth) = (0, u32::MAX, 0, 0);
        (ctx.fuel, ctx.stack_end) = (fuel, stack_end);
    }
}

thread_local! {
    /// The engine whose program this thread runs, for [`poll`].
    static RUNNING: Cell<*mut Core> = const { Cell::new(std::ptr::null_mut()) };
}

/// Runs a body in a lane of the core and returns the fault that ended it. Polls come back to [`Core::at_poll`].
///
/// `lane` picks the lane; it must not be one of a task under way.
#[allow(unsafe_code, reason = "the boundary to executors")]
pub(crate) fn execute(
    core: &mut Core,
    lane: fn(&mut Core, usize) -> &mut Pinned<Lane>,
    index: usize,
    executor: &Executor,
    body: BodyId,
    frame: u64,
) -> Option<Fault> {
    let program = core.program.clone();
    let lane = lane(core, index).0;
    let before = RUNNING.replace(core);
    let result = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: the lane is pinned, lives as long as the core, and is used by nobody else (the caller's promise and the module's invariants).
        let lane = unsafe { &mut *lane.as_ptr() };
        match executor {
            Executor::Interpreter => lane.interpreter.run(&program, body, frame, &mut lane.ctx),
            Executor::Jit(code) => code.run(body, frame, &mut lane.ctx),
        }
    }));
    RUNNING.set(before);
    match result {
        Ok(0) => None,
        // SAFETY: as above; the executor has returned.
        Ok(code) => Some(unsafe { lane.as_ref() }.ctx.fault().or(Fault::from_raw(code, [0; 3])).unwrap_or(Fault::Panic)),
        Err(_) => Some(Fault::Panic),
    }
}

/// What a poll calls when its slice of fuel is used up.
#[allow(unsafe_code, reason = "called by executors")]
unsafe extern "C" fn poll(ctx: *mut Context, site: u32) -> u32 {
    let core = RUNNING.get();
    // SAFETY: the executor passes its live context, and does not touch it until we return.
    let ctx = unsafe { &mut *ctx };
    let result = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: set by `execute`, whose borrow of the core is suspended below us on the stack of this thread; null only outside `execute`.
        let core = unsafe { core.as_mut() }?;
        core.at_poll(ctx)
    }));
    match result {
        Ok(None) => 0,
        Ok(Some(fault)) => ctx.fail(fault, site),
        Err(_) => ctx.fail(Fault::Panic, site),
    }
}
