//! Two cameras that give images and no pairs.

use super::camera::Side;
use super::pairing::Unpaired;
use super::watch::PATIENCE;
use crate::counted;
use crate::error::{Error, Result};

/// Images of each camera, at least: at a low rate time alone says little.
const IMAGES: u64 = 10;
/// Where there have been pairs, they may come back: it is told at first, and given up after so many
/// times as long.
const LONGER: u64 = 10;

type Counts = [u64; Unpaired::ALL.len()];

/// What has come since the last pair.
#[derive(Default)]
pub(super) struct Pairless {
    since_ns: Option<u64>,
    images: [u64; 2],
    /// Of all images without a partner, those from before.
    before: Counts,
    had_pairs: bool,
    told: bool,
}

impl Pairless {
    pub(super) fn pair(&mut self, unpaired: Counts) {
        *self = Self {
            before: unpaired,
            had_pairs: true,
            ..Self::default()
        };
    }

    /// An image came; `unpaired` are all without a partner so far.
    ///
    /// # Errors
    /// [`Error::Camera`] when there has been no pair for too long, with the most frequent reason
    /// and its cure.
    pub(super) fn image(
        &mut self,
        side: Side,
        now_ns: u64,
        timeout_ns: u64,
        unpaired: Counts,
    ) -> Result<()> {
        self.images[side as usize] += 1;
        let lasted_ns = now_ns.saturating_sub(*self.since_ns.get_or_insert(now_ns));
        let long_ns = timeout_ns.saturating_mul(PATIENCE.into());
        if lasted_ns < long_ns || self.images.iter().any(|&images| images < IMAGES) {
            return Ok(());
        }
        let since = |reason: Unpaired| unpaired[reason as usize] - self.before[reason as usize];
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
        if !self.had_pairs || lasted_ns >= long_ns.saturating_mul(LONGER) {
            return Err(Error::camera("the cameras", text));
        }
        if !std::mem::replace(&mut self.told, true) {
            tracing::warn!("the cameras: {text}");
        }
        Ok(())
    }
}
