//! Watchdogs: the state of each camera and its duration, and the time without a pair. A camera that
//! is silent, delivers damaged images or yields no pairs for too long ends the run with a remedy.

use super::pairing::{Unpaired, UnpairedCounts};
use crate::camera::on_side;
use crate::camera_error;
use svl_core::stereo::Side;
use svl_core::{Error, Result, counted};

/// Timeouts in a row after which a camera has failed.
pub(super) const MAX_MISSES: u32 = 3;
/// Damaged images in a row after which it may have failed, however slow it is: two may be chance.
const MAX_DAMAGED: u64 = 5;
/// Images of each camera without a pair: at a low rate time alone is inconclusive.
const MIN_IMAGES: u64 = 10;
/// If there have been pairs, they may come back: after the first warning the run continues for this
/// many times as long.
const HAD_PAIRS_FACTOR: u64 = 10;

/// The state of a camera.
pub(super) struct CameraState {
    pub(super) name: String,
    side: Side,
    pub(super) phase: Phase,
    pub(super) since_ns: u64,
    /// Number of its latest order: orders with the same number have the same settings.
    pub(super) order: u64,
    /// Images that it delivered.
    images: u64,
    /// Timeouts since the last of them, and their sum.
    misses: u32,
    silent_ns: u64,
    /// Damaged images since the last intact one, and the time of the first of them.
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
            order: 0,
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

    /// The ordered image arrived.
    pub(super) fn on_image(&mut self) {
        self.images += 1;
        (self.misses, self.silent_ns, self.damaged) = (0, 0, 0);
    }

    /// An image from before the settings took effect arrived; the ordered one is still to come.
    pub(super) fn on_unready(&mut self, now_ns: u64) {
        self.images += 1;
        // The camera is alive, and the timeout for its ordered image restarts.
        (self.misses, self.silent_ns, self.since_ns) = (0, 0, now_ns);
    }

    /// An image of no pulse arrived. It resets no watchdog: a camera that only sends these is as
    /// good as silent.
    pub(super) fn on_stray(&mut self) {
        self.images += 1;
    }

    /// A damaged image arrived.
    ///
    /// # Errors
    /// [`crate::CameraError`] if all images have been damaged for too long, or recording would run
    /// forever without a pair.
    pub(super) fn on_damaged(&mut self, now_ns: u64, timeout_ns: u64) -> Result<()> {
        if self.damaged == 0 {
            self.damaged_since_ns = now_ns;
        }
        self.images += 1;
        self.damaged += 1;
        (self.misses, self.silent_ns) = (0, 0);
        let damaged_ns = now_ns.saturating_sub(self.damaged_since_ns);
        if self.damaged < MAX_DAMAGED || damaged_ns < timeout_ns.saturating_mul(MAX_MISSES.into()) {
            return Ok(());
        }
        let reason = format!(
            "all its images arrived damaged for {:.1} s; check its cable",
            damaged_ns as f64 / 1e9
        );
        Err(self.error(reason))
    }

    /// It timed out after `timeout_ns`.
    ///
    /// # Errors
    /// [`crate::CameraError`] if it did so too often.
    pub(super) fn on_timeout(&mut self, timeout_ns: u64) -> Result<()> {
        self.misses += 1;
        self.silent_ns = self.silent_ns.saturating_add(timeout_ns);
        if self.misses < MAX_MISSES {
            return Ok(());
        }
        let silent_s = self.silent_ns as f64 / 1e9;
        let images = counted(self.images, "image");
        let cures = "check its power, its cable and its trigger line, or set a longer --timeout";
        Err(self.error(format!(
            "silent for {silent_s:.1} s after {images}; {cures}"
        )))
    }

    fn error(&self, reason: String) -> Error {
        on_side(self.side, camera_error(&self.name, reason))
    }
}

/// Detects that two cameras deliver images but no pairs.
#[derive(Default)]
pub(super) struct PairWatchdog {
    /// Since the last pair: time of the first image, images of each camera, and the unpaired images
    /// of the whole run before it.
    since_ns: Option<u64>,
    images: [u64; 2],
    unpaired_before: UnpairedCounts,
    had_pairs: bool,
    warned: bool,
}

impl PairWatchdog {
    pub(super) fn on_pair(&mut self, unpaired: UnpairedCounts) {
        *self = Self {
            unpaired_before: unpaired,
            had_pairs: true,
            ..Self::default()
        };
    }

    /// An image arrived; `unpaired` counts all unpaired images of the run.
    ///
    /// # Errors
    /// [`crate::CameraError`] if there has been no pair for too long, with the most frequent
    /// reason and its remedy.
    pub(super) fn on_image(
        &mut self,
        side: Side,
        now_ns: u64,
        timeout_ns: u64,
        unpaired: UnpairedCounts,
    ) -> Result<()> {
        self.images[side as usize] += 1;
        // Starts with the first image, as some cameras take seconds to deliver one.
        let lasted_ns = now_ns.saturating_sub(*self.since_ns.get_or_insert(now_ns));
        let limit_ns = timeout_ns.saturating_mul(MAX_MISSES.into());
        if lasted_ns < limit_ns || self.images.iter().any(|&images| images < MIN_IMAGES) {
            return Ok(());
        }
        let since =
            |reason: Unpaired| unpaired[reason as usize] - self.unpaired_before[reason as usize];
        let Some(reason) = Unpaired::ALL
            .into_iter()
            .max_by_key(|&reason| since(reason))
        else {
            return Ok(());
        };
        let [left, right] = self.images;
        let text = format!(
            "no pair for {:.1} s of {left} left and {}, {} {}; {}",
            lasted_ns as f64 / 1e9,
            counted(right, "right image"),
            since(reason),
            reason.words(),
            reason.cure()
        );
        // Cameras that never paired are set up wrongly. Those that did may recover, as when a cable
        // is plugged in again.
        if !self.had_pairs || lasted_ns >= limit_ns.saturating_mul(HAD_PAIRS_FACTOR) {
            return Err(camera_error("the cameras", text));
        }
        if !std::mem::replace(&mut self.warned, true) {
            tracing::warn!("the cameras: {text}");
        }
        Ok(())
    }
}
