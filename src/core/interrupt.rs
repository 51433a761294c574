//! The request to end work early, for example by Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Asks all work of this process to end.
pub fn request() {
    REQUESTED.store(true, Ordering::Relaxed);
}

/// True if the work is to end. Long waits poll it: the wait for a matching program.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
