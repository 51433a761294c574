//! The matching at one size: images, path sums, and the map of the winners.

use super::census::{HalfImage, StepCosts};
use super::half_map::HalfMap;
use super::sums::StripSums;
use crate::error::Result;
use crate::kernel::{Isa, STEPS, WinnerTest};
use crate::matcher::stage::both;

/// Memory for the matching at one size.
pub(super) struct MatchLevel {
    pub(super) images: [HalfImage; 2],
    steps: StepCosts,
    pub(super) sums: StripSums,
    pub(super) map: HalfMap,
}

impl MatchLevel {
    /// The arguments of [`HalfMap::new`].
    pub(super) fn new(size: (usize, usize), count: usize, keeps_winners: bool) -> Result<Self> {
        let images = [HalfImage::new(size, 0)?, HalfImage::new(size, count - 1)?];
        Ok(Self {
            steps: StepCosts::new(size)?,
            sums: StripSums::new(size, count, images[1].margin)?,
            map: HalfMap::new(size, count, keeps_winners)?,
            images,
        })
    }

    /// Loads both images by those functions, and the penalties of steps.
    pub(super) fn load(
        &mut self,
        isa: Isa,
        jumps: &[u8; STEPS],
        load_left: impl FnOnce(&mut HalfImage) + Send,
        load_right: impl FnOnce(&mut HalfImage) + Send,
    ) {
        let (steps, [left, right]) = (&mut self.steps, &mut self.images);
        both(
            || {
                load_left(left);
                steps.load(isa, left, jumps);
            },
            || load_right(right),
        );
    }

    /// Chooses the winners and tests them.
    pub(super) fn choose(&mut self, isa: Isa, test: &WinnerTest, out_and_small: [u8; 2]) {
        let sums = &mut self.sums;
        sums.follow(isa, &self.images, &self.steps, out_and_small);
        self.map.choose(isa, sums, &self.images, test);
    }
}
