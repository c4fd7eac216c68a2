//! Counts what the resource thread asks of the allocator, which should be nothing.
//!
//! The tool's process uses [`Counting`] as its allocator; it hands every request on to the system's. While a thread is watched its requests are counted.
#![allow(unsafe_code, reason = "an allocator is unsafe by its trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

static REQUESTS: AtomicU64 = AtomicU64::new(0);
thread_local!(static WATCHED: Cell<bool> = const { Cell::new(false) });

/// The system's allocator, counting.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counting;

fn note() {
    // A thread that is ending has no such variable any more, and is not watched.
    if WATCHED.try_with(Cell::get).unwrap_or(false) {
        REQUESTS.fetch_add(1, Ordering::Relaxed);
    }
}

// SAFETY: every request goes to the system's allocator unchanged; counting touches a number only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note();
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        note();
        // SAFETY: the caller's promise.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, start: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note();
        // SAFETY: the caller's promise.
        unsafe { System.realloc(start, layout, size) }
    }
    unsafe fn dealloc(&self, start: *mut u8, layout: Layout) {
        note();
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(start, layout) }
    }
}

/// From now on the requests of the calling thread are counted, or no longer.
pub fn watch(on: bool) {
    WATCHED.set(on);
}

/// Requests of watched threads so far; always 0 in a process with another allocator.
pub fn requests() -> u64 {
    REQUESTS.load(Ordering::Relaxed)
}
