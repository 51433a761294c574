//! What v1 and v2 have in common: smoothing, block matching with a filter on its costs, and the symmetric check.

use super::stage::{
    BACK_CHECK, Blocks, CostFilter, CostSearch, DeviationTexture, DisparityRange, SUBPIXEL, SymmetricCheck,
    VerticalSmoothing, back_check, refine,
};
use super::{Matcher, Parameters};
use crate::error::Result;
use crate::kernel::Isa;
use crate::stereo::{DisparityMap, Gray, Plane, StereoPair};
use crate::timing::{Clock, Stage};

/// A matcher that matches both ways.
pub(super) struct Symmetric<F> {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    /// Without one every pixel is matched.
    texture: Option<DeviationTexture>,
    filter: F,
    tolerance_px: i32,
    subpixel: bool,
    back_check: bool,
    scratch: Option<Scratch<F>>,
}

/// Memory for pairs of one size.
struct Scratch<F> {
    left: Gray,
    right: Gray,
    textured: Plane<bool>,
    left_blocks: Blocks,
    right_blocks: Blocks,
    band_rows: usize,
    /// One per band, as `checks`.
    searches: Vec<CostSearch<F>>,
    checks: Vec<SymmetricCheck>,
}

impl<F: CostFilter + Copy> Symmetric<F> {
    /// # Errors
    /// What [`DisparityRange::new`] says.
    pub(super) fn new(parameters: &Parameters, isa: Isa, texture: Option<DeviationTexture>, filter: F) -> Result<Self> {
        let range = DisparityRange::of(parameters)?;
        Ok(Self {
            isa,
            range,
            smoothing: VerticalSmoothing::new(parameters.real(VerticalSmoothing::SIGMA.name)),
            texture,
            filter,
            tolerance_px: parameters.int(SymmetricCheck::TOLERANCE.name),
            subpixel: parameters.flag(SUBPIXEL.name),
            back_check: parameters.flag(BACK_CHECK.name),
            scratch: None,
        })
    }

    fn scratch(&self, (width, height): (usize, usize)) -> Result<Scratch<F>> {
        let (bands, band_rows) = Blocks::bands(height);
        Ok(Scratch {
            left: Gray::filled(width, height, 0)?,
            right: Gray::filled(width, height, 0)?,
            textured: Plane::filled(width, height, true)?,
            left_blocks: Blocks::new(width, height),
            right_blocks: Blocks::new(width, height),
            band_rows,
            searches: (0..bands).map(|_| CostSearch::new(self.filter, width, self.range)).collect(),
            checks: (0..bands).map(|_| SymmetricCheck::new(self.tolerance_px, width, self.range)).collect(),
        })
    }
}

impl<F: CostFilter + Copy + Send> Matcher for Symmetric<F> {
    fn compute(&mut self, pair: &StereoPair, map: &mut DisparityMap, clock: &mut Clock) -> Result<()> {
        let (isa, size) = (self.isa, pair.size());
        map.resize(size.0, size.1)?;
        let fitting = self.scratch.take().filter(|scratch| scratch.left.size() == size);
        let scratch = fitting.map_or_else(|| self.scratch(size), Ok)?;
        let Scratch { left, right, textured, left_blocks, right_blocks, band_rows, searches, checks } =
            self.scratch.insert(scratch);

        self.smoothing.apply(isa, pair.left(), left);
        self.smoothing.apply(isa, pair.right(), right);
        clock.lap(Stage::Smoothing);

        if let Some(texture) = self.texture {
            texture.apply(isa, left, textured);
        }
        clock.lap(Stage::Texture);

        left_blocks.load(isa, left);
        right_blocks.load(isa, right);
        map.each_band_mut(*band_rows, searches, |top, band, search| {
            for (y, mut row) in (top..).zip(band.into_rows()) {
                let lane = y % Blocks::ROWS;
                if lane == 0 {
                    search.search(isa, left_blocks.around(y), right_blocks.around(y), Blocks::ROWS.min(size.1 - y));
                }
                search.write_row(lane, [left.row(y), right.row(y)], textured.row(y), &mut row);
            }
        });
        clock.lap(Stage::Matching);

        map.each_band_mut(*band_rows, checks, |top, band, check| {
            for (y, mut row) in (top..).zip(band.into_rows()) {
                let lane = y % Blocks::ROWS;
                if lane == 0 {
                    check.search(isa, left_blocks.around(y), right_blocks.around(y), Blocks::ROWS.min(size.1 - y));
                }
                check.check_row(lane, &mut row);
                if self.subpixel {
                    refine(self.range, left.row(y), |_| right.row(y), &mut row);
                }
                if self.back_check {
                    back_check(&mut row);
                }
            }
        });
        clock.lap(Stage::Checks);
        Ok(())
    }
}
