//! Stereoscopic Machine Vision Algo v.3 (thesis, section 5.3.3), the thesis's final result.
//!
//! Vertical smoothing, a texture filter by differences of Gaussians, block matching of the textured pixels with a
//! one-dimensional window of nine pixels, and the self check instead of a left/right check.
//!
//! Departures from the thesis: all in integers; windows near the left edge try the disparities that stay inside the
//! right image; the back check sends negative disparities to 0.

use super::stage::{BlockSearch, DisparityRange, DogTexture, SelfCheck, VerticalSmoothing, back_check};
use super::{Matcher, MatcherSpec, Parameter, Parameters, Range};
use crate::error::Result;
use crate::kernel::Isa;
use crate::stereo::{DisparityMap, Gray, Plane, StereoPair};
use crate::timing::{Clock, Stage};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v3",
    summary: "block matching on textured pixels with a self check: fast and robust, made for obstacle avoidance",
    paper: "Palme, Stereo Vision Library for Obstacle Avoidance Applications, Fribourg and EPFL 2007, section 5.3.3",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        VerticalSmoothing::SIGMA,
        DogTexture::SIGMA,
        DogTexture::DELTA,
        Parameter {
            name: "back_check",
            unit: "",
            range: Range::Flag { default: false },
            description: "write negative disparities as 0, the farthest that can be measured",
        },
    ],
    build: |parameters, isa| Ok(Box::new(V3::new(parameters, isa)?)),
};

struct V3 {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    texture: DogTexture,
    back_check: bool,
    scratch: Option<Scratch>,
}

/// Memory for pairs of one size.
struct Scratch {
    left: Gray,
    right: Gray,
    textured: Plane<bool>,
    /// One per band of rows.
    searches: Vec<BlockSearch>,
    checks: Vec<SelfCheck>,
}

impl V3 {
    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        Ok(Self {
            isa,
            range: DisparityRange::new(parameters.int("min_disparity"), parameters.int("max_disparity"))?,
            smoothing: VerticalSmoothing::new(parameters.real("smoothing_sigma")),
            texture: DogTexture::new(parameters.real("texture_sigma"), parameters.real("texture_delta")),
            back_check: parameters.flag("back_check"),
            scratch: None,
        })
    }
}

impl Scratch {
    fn new((width, height): (usize, usize), range: DisparityRange) -> Result<Self> {
        let bands = super::stage::bands(height);
        Ok(Self {
            left: Gray::filled(width, height, 0)?,
            right: Gray::filled(width, height, 0)?,
            textured: Plane::filled(width, height, false)?,
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
        let Scratch { left, right, textured, searches, checks } = match &mut self.scratch {
            Some(scratch) => scratch,
            none => none.insert(Scratch::new(size, self.range)?),
        };

        self.smoothing.apply(isa, pair.left(), left);
        self.smoothing.apply(isa, pair.right(), right);
        clock.lap(Stage::Smoothing);

        self.texture.apply(isa, left, textured);
        clock.lap(Stage::Texture);

        map.each_row_mut(searches, |y, mut row, search| {
            search.match_row(isa, left.row(y), right.row(y), textured.row(y), &mut row);
        });
        clock.lap(Stage::Matching);

        map.each_row_mut(checks, |y, mut row, check| {
            check.check_row(isa, left.row(y), &mut row);
            if self.back_check {
                back_check(&mut row);
            }
        });
        clock.lap(Stage::Checks);
        Ok(())
    }
}
