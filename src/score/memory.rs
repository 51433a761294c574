//! Memory that code allocates: the system's allocator, with counters.
//!
//! A program that wants to measure the memory of its runs installs [`CountingAllocator`] as its
//! global allocator.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Memory allocated by some work, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryUse {
    /// Peak, beyond the memory allocated before.
    pub peak: usize,
    /// Increase after the work was done; negative if it freed more.
    pub kept: isize,
}

/// Bytes allocated now, and their peak since it was last reset.
static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// Runs `work`, during which no other thread should allocate, and returns its memory use; `None` in
/// a program with another allocator.
pub fn used_by(work: impl FnOnce()) -> Option<MemoryUse> {
    let before = NOW.load(Relaxed);
    PEAK.store(before, Relaxed);
    work();
    // A program with the counter has always allocated something before it measures.
    (before > 0).then(|| MemoryUse {
        peak: PEAK.load(Relaxed).saturating_sub(before),
        kept: NOW.load(Relaxed).wrapping_sub(before) as isize,
    })
}

/// The system's allocator with counters: the `#[global_allocator]` of a program.
pub struct CountingAllocator;

fn count(added: usize, freed: usize) {
    // Wraps around if more is freed than added, as the subtraction needs.
    let change = added.wrapping_sub(freed);
    let now = NOW.fetch_add(change, Relaxed).wrapping_add(change);
    if added > freed {
        PEAK.fetch_max(now, Relaxed);
    }
}

// SAFETY: everything is forwarded to the system's allocator, whose contract the callers keep;
// counting allocates nothing.
unsafe impl GlobalAlloc for CountingAllocator {
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
