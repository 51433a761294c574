//! The matching at one size: images, path sums, and the map of the winners.

use super::census::{HalfImage, StepCosts};
use super::half_map::HalfMap;
use super::sums::StripSums;
use crate::error::Result;
use crate::kernel::{Isa, STEPS, WinnerTest};
use crate::matcher::stage::both;

/// Parameters of the matching at all sizes.
pub(super) struct MatchSettings {
    pub(super) isa: Isa,
    /// Cost of a disparity that leads out of the right image, and of a change by one.
    pub(super) out_and_small: [u8; 2],
    /// Penalty for a jump of disparity, by the difference of the pixels.
    pub(super) jumps: [u8; STEPS],
    pub(super) test: WinnerTest,
    /// Ends of a gap whose disparities differ by more belong to two surfaces, bins.
    pub(super) jump: i32,
}

/// Memory for the matching at one size.
pub(super) struct MatchLevel {
    pub(super) images: [HalfImage; 2],
    steps: StepCosts,
    pub(super) sums: StripSums,
    pub(super) map: HalfMap,
}

impl MatchLevel {
    /// For half images of `size` and `count` disparities.
    pub(super) fn new(size: (usize, usize), count: usize) -> Result<Self> {
        let images = [HalfImage::new(size, 0)?, HalfImage::new(size, count - 1)?];
        Ok(Self {
            steps: StepCosts::new(size)?,
            sums: StripSums::new(size, count, images[1].margin)?,
            map: HalfMap::new(size, count)?,
            images,
        })
    }

    /// Loads the left and the right image, 0 and 1, by that function, and the penalties of steps.
    pub(super) fn load(
        &mut self,
        settings: &MatchSettings,
        halve: impl Fn(&mut HalfImage, usize) + Sync,
    ) {
        let isa = settings.isa;
        let (steps, [left, right]) = (&mut self.steps, &mut self.images);
        both(
            || {
                halve(left, 0);
                left.describe(isa);
                steps.load(isa, left, &settings.jumps);
            },
            || {
                halve(right, 1);
                right.describe(isa);
            },
        );
    }

    /// Chooses the winners and tests them.
    pub(super) fn choose(&mut self, settings: &MatchSettings) {
        let (isa, sums) = (settings.isa, &mut self.sums);
        sums.follow(isa, &self.images, &self.steps, settings.out_and_small);
        self.map.choose(isa, sums, &self.images, &settings.test);
    }
}
