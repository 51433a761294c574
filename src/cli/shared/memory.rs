//! How much memory work takes: the system's allocator, counted.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use svl::run::MemoryUse;

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// Bytes allocated now, and at most since this was last set.
static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// Does `work`, during which no other thread should allocate, and says what it allocated.
pub(crate) fn used_by(work: &mut dyn FnMut()) -> MemoryUse {
    let before = NOW.load(Relaxed);
    PEAK.store(before, Relaxed);
    work();
    MemoryUse {
        peak: PEAK.load(Relaxed).saturating_sub(before),
        kept: NOW.load(Relaxed).wrapping_sub(before) as isize,
    }
}

struct Counted;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_counted_at_its_peak_and_after() {
        let mut kept = Vec::new();
        let used = used_by(&mut || {
            let large = vec![1_u8; 50_000_000];
            kept = large[..10_000_000].to_vec();
        });
        // Other tests allocate and free meanwhile, but not as much.
        assert!((55_000_000..70_000_000).contains(&used.peak), "{used:?}");
        assert!((5_000_000..15_000_000).contains(&used.kept), "{used:?}");
        assert_eq!(kept.len(), 10_000_000);
    }
}
