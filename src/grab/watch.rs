//! What a camera is at, and when it has been silent or damaging its images for too long.

use super::camera::Side;
use crate::counted;
use crate::error::{Error, Result};

/// A camera that let pass its time so often in a row is given up.
pub(super) const PATIENCE: u32 = 3;
/// Images in a row that are damaged, however slow the camera: two may be chance.
const DAMAGED: u64 = 5;

/// Where a camera stands.
pub(super) struct CameraState {
    pub(super) name: String,
    side: Side,
    pub(super) phase: Phase,
    pub(super) since_ns: u64,
    /// Number of its latest order: both cameras get the same settings with the same number.
    pub(super) turn: u64,
    /// Images that it gave.
    images: u64,
    /// Times that it let pass since the last of them, and how long they were.
    misses: u32,
    silent_ns: u64,
    /// Damaged images since the last whole one, and when the first of them came.
    damaged: u64,
    damaged_since_ns: u64,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Phase {
    Arming,
    Armed,
    /// A pulse was sent.
    Exposing,
}

impl CameraState {
    pub(super) fn new(side: Side, name: String) -> Self {
        Self {
            name,
            side,
            phase: Phase::Arming,
            since_ns: 0,
            turn: 0,
            images: 0,
            misses: 0,
            silent_ns: 0,
            damaged: 0,
            damaged_since_ns: 0,
        }
    }

    pub(super) fn enter(&mut self, phase: Phase, now_ns: u64) {
        (self.phase, self.since_ns) = (phase, now_ns);
    }

    /// An image came that was ordered.
    pub(super) fn gave_image(&mut self) {
        self.images += 1;
        (self.misses, self.silent_ns, self.damaged) = (0, 0, 0);
    }

    /// An image came that is of no use, and the camera goes on.
    pub(super) fn gave_unready(&mut self, now_ns: u64) {
        self.images += 1;
        (self.misses, self.silent_ns, self.since_ns) = (0, 0, now_ns);
    }

    /// An image came that nothing fired.
    pub(super) fn gave_stray(&mut self) {
        self.images += 1;
    }

    /// A damaged image came.
    ///
    /// # Errors
    /// [`Error::Camera`] when all have been for long: else it would be recorded from for ever.
    pub(super) fn gave_damaged(&mut self, now_ns: u64, timeout_ns: u64) -> Result<()> {
        if self.damaged == 0 {
            self.damaged_since_ns = now_ns;
        }
        self.images += 1;
        self.damaged += 1;
        (self.misses, self.silent_ns) = (0, 0);
        let damaged_ns = now_ns.saturating_sub(self.damaged_since_ns);
        if self.damaged < DAMAGED || damaged_ns < timeout_ns.saturating_mul(PATIENCE.into()) {
            return Ok(());
        }
        let reason = format!(
            "all its images came damaged for {:.1} s; check its cable",
            damaged_ns as f64 / 1e9
        );
        Err(self.error(reason))
    }

    /// It let pass its time, which was `patience_ns`.
    ///
    /// # Errors
    /// [`Error::Camera`] when it did so too often.
    pub(super) fn missed(&mut self, patience_ns: u64) -> Result<()> {
        self.misses += 1;
        self.silent_ns = self.silent_ns.saturating_add(patience_ns);
        if self.misses < PATIENCE {
            return Ok(());
        }
        let silent_s = self.silent_ns as f64 / 1e9;
        let images = counted(self.images, "image");
        let cures =
            "check its power, its cable and its trigger line, or give it a longer --timeout";
        Err(self.error(format!(
            "silent for {silent_s:.1} s after {images}; {cures}"
        )))
    }

    fn error(&self, reason: String) -> Error {
        self.side.blame(Error::camera(&self.name, reason))
    }
}
