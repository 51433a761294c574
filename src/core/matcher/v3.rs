//! Stereoscopic Machine Vision Algo v.3 (thesis, section 5.3.3), the thesis's final result.
//!
//! Vertical smoothing, a texture filter by differences of Gaussians, block matching of the textured
//! pixels with a one-dimensional window of nine pixels, and the self check instead of a left/right
//! check.
//!
//! Departures from the thesis: all in integers; windows near the left edge try the disparities that
//! stay inside the right image; the back check sends negative disparities to 0.

use super::block_matching::BlockMatching;
use super::method::matcher;
use super::stage::{
    BACK_CHECK, BlockSearch, DisparityRange, DogTexture, SUBPIXEL, SelfCheck, VerticalSmoothing,
};
use super::{MatcherKind, MatcherSpec};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v3",
    kind: MatcherKind::Images,
    aliases: &[],
    summary: "block matching on textured pixels with a self check: fast and robust, made for \
              obstacle avoidance",
    about: "texture_delta is at a cliff: over the arena's seeds 1 to 3 31 % of the cells are \
            wrong and 41 % right at 3, 6.4 and 37.6 % at 3.35, 1.3 and 30 % at 4 (`svl score \
            arena --seeds 1..3 --algo v3:texture_delta=3/3.35/4`). `svl tune RECORDING --algo v3` \
            shows where it is in your own pictures.",
    paper: "Palme, Stereo Vision Library for Obstacle Avoidance Applications, Fribourg and EPFL \
            2007, section 5.3.3",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        VerticalSmoothing::SIGMA,
        DogTexture::SIGMA,
        DogTexture::DELTA,
        SUBPIXEL,
        BACK_CHECK,
    ],
    cells: None,
    build: |parameters, isa| {
        let texture = Some(Box::new(DogTexture::from_parameters(parameters)) as _);
        // The self check uses only the left image. Without a second matching, v3 is the fastest.
        let matching = BlockMatching::new(parameters, isa, texture, |width, range| {
            (BlockSearch::new(width, range), SelfCheck::new(width, range))
        })?;
        Ok(matcher(matching))
    },
};
