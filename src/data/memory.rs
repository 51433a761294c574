//! How much memory work takes: the system's allocator, counted.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Bytes allocated now, and at most since this was last set.
static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// Memory that some work allocated, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryUse {
    /// At most, beyond what was allocated before.
    pub peak: usize,
    /// More than before once the work was done; negative where it freed more.
    pub kept: isize,
}

/// Does `work`, during which no other thread should allocate, and says what it allocated.
pub fn used_by(work: &mut dyn FnMut()) -> MemoryUse {
    let before = NOW.load(Relaxed);
    PEAK.store(before, Relaxed);
    work();
    MemoryUse {
        peak: PEAK.load(Relaxed).saturating_sub(before),
        kept: NOW.load(Relaxed).wrapping_sub(before) as isize,
    }
}

/// The system's allocator, counted: what the program has as its global allocator.
pub struct Counted;

fn count(added: usize, freed: usize) {
    // Wraps around where more is freed than added, which is what subtraction needs.
    let change = added.wrapping_sub(freed);
    let now = NOW.fetch_add(change, Relaxed).wrapping_add(change);
    if added > freed {
        PEAK.fetch_max(now, Relaxed);
    }
}

// SAFETY: all is the system's allocator's, whose contract the callers keep; counting allocates
// nothing.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller keeps the contract of `GlobalAlloc`, which is that of `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller keeps the contract of `GlobalAlloc`, which is that of `System`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: the caller keeps the contract of `GlobalAlloc`, which is that of `System`.
        unsafe { System.dealloc(place, layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size, layout.size());
        // SAFETY: the caller keeps the contract of `GlobalAlloc`, which is that of `System`.
        unsafe { System.realloc(place, layout, size) }
    }
}
