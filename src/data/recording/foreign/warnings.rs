//! Warnings that are given once.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

/// Limit on different warnings.
const MAX_WARNINGS: usize = 100;

/// Warns once in a process: pairs, truth and places read the poses of a recording each.
pub(super) fn warn_once(warning: String) {
    static WARNED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut warned = WARNED.lock().unwrap_or_else(PoisonError::into_inner);
    if warned.len() < MAX_WARNINGS && !warned.contains(&warning) {
        tracing::warn!("{warning}");
        warned.insert(warning);
    }
}
