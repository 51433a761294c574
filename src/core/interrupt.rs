//! The request to end work early, as by Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Asks all work of this process to end; says whether it was asked before.
pub fn request() -> bool {
    REQUESTED.swap(true, Ordering::Relaxed)
}

/// Whether the work is to end. What may wait for long looks here: a program that matches pairs.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
