//! Stereoscopic Machine Vision Algo v.3 (thesis, section 5.3.3), the thesis's final result.
//!
//! Vertical smoothing, a texture filter by differences of Gaussians, block matching of the textured pixels with a
//! one-dimensional window of nine pixels, and the self check instead of a left/right check.
//!
//! Departures from the thesis: all in integers; windows near the left edge try the disparities that stay inside the
//! right image; the back check sends negative disparities to 0.

use super::stage::{
    BACK_CHECK, BlockSearch, Blocks, DisparityRange, DogTexture, SUBPIXEL, SelfCheck, VerticalSmoothing,
};
use super::stage::{back_check, refine};
use super::{Matcher, MatcherSpec, Parameters};
use crate::error::Result;
use crate::kernel::Isa;
use crate::stereo::{DisparityMap, Gray, Plane, StereoPair};
use crate::timing::{Clock, Stage};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v3",
    aliases: &[],
    summary: "block matching on textured pixels with a self check: fast and robust, made for obstacle avoidance",
    paper: "Palme, Stereo Vision Library for Obstacle Avoidance Applications, Fribourg and EPFL 2007, section 5.3.3",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        VerticalSmoothing::SIGMA,
        DogTexture::SIGMA,
        DogTexture::DELTA,
        SUBPIXEL,
        BACK_CHECK,
    ],
    build: |parameters, isa| Ok(Box::new(V3::new(parameters, isa)?)),
};

struct V3 {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    texture: DogTexture,
    subpixel: bool,
    back_check: bool,
    scratch: Option<Scratch>,
}

/// Memory for pairs of one size.
struct Scratch {
    left: Gray,
    right: Gray,
    textured: Plane<bool>,
    left_blocks: Blocks,
    right_blocks: Blocks,
    band_rows: usize,
    /// One per band, as `checks`.
    searches: Vec<BlockSearch>,
    checks: Vec<SelfCheck>,
}

impl V3 {
    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        Ok(Self {
            isa,
            range: DisparityRange::of(parameters)?,
            smoothing: VerticalSmoothing::new(parameters.real("smoothing_sigma")),
            texture: DogTexture::new(parameters.real("texture_sigma"), parameters.real("texture_delta")),
            subpixel: parameters.flag(SUBPIXEL.name),
            back_check: parameters.flag(BACK_CHECK.name),
            scratch: None,
        })
    }
}

impl Scratch {
    fn new((width, height): (usize, usize), range: DisparityRange) -> Result<Self> {
        let (bands, band_rows) = Blocks::bands(height);
        Ok(Self {
            left: Gray::filled(width, height, 0)?,
            right: Gray::filled(width, height, 0)?,
            textured: Plane::filled(width, height, false)?,
            left_blocks: Blocks::new(width, height),
            right_blocks: Blocks::new(width, height),
            band_rows,
            searches: (0..bands).map(|_| BlockSearch::new(width, range)).collect(),
            checks: (0..bands).map(|_| SelfCheck::new(width, range)).collect(),
        })
    }
}

impl Matcher for V3 {
    fn compute(&mut self, pair: &StereoPair, map: &mut DisparityMap, clock: &mut Clock) -> Result<()> {
        let (isa, size) = (self.isa, pair.size());
        map.resize(size.0, size.1)?;
        if self.scratch.as_ref().is_none_or(|scratch| scratch.left.size() != size) {
            self.scratch = None;
        }
        let Scratch { left, right, textured, left_blocks, right_blocks, band_rows, searches, checks } =
            match &mut self.scratch {
                Some(scratch) => scratch,
                none => none.insert(Scratch::new(size, self.range)?),
            };

        self.smoothing.apply(isa, pair.left(), left);
        self.smoothing.apply(isa, pair.right(), right);
        clock.lap(Stage::Smoothing);

        self.texture.apply(isa, left, textured);
        clock.lap(Stage::Texture);

        left_blocks.load(isa, left);
        right_blocks.load(isa, right);
        map.each_band_mut(*band_rows, searches, |top, band, search| {
            for (y, mut row) in (top..).zip(band.into_rows()) {
                let lane = y % Blocks::ROWS;
                if lane == 0 {
                    search.search(isa, left_blocks.around(y), right_blocks.around(y), Blocks::ROWS.min(size.1 - y));
                }
                search.write_row(isa, lane, textured.row(y), &mut row);
            }
        });
        clock.lap(Stage::Matching);

        map.each_band_mut(*band_rows, checks, |top, band, check| {
            for (y, mut row) in (top..).zip(band.into_rows()) {
                let lane = y % Blocks::ROWS;
                if lane == 0 {
                    check.search(isa, left_blocks.around(y));
                }
                check.check_row(isa, lane, left.row(y), &mut row);
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
