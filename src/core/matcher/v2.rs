//! Stereoscopic Machine Vision Algo v.2 (thesis, section 5.3.2).
//!
//! Same as v1, but windows of low contrast are dropped before the matching, and a match is
//! ambiguous by the spread of all costs instead of the two best.
//!
//! Departures from the thesis: those of v1; the weight of a disparity in the spread, which the
//! thesis leaves open. The spread is in floating point, decided in single precision if that is
//! certain, else in double, so that it too is the same on every machine.

use super::block_matching::BlockMatching;
use super::method::matcher;
use super::stage::{
    BACK_CHECK, CostFilter, CostSearch, DeviationTexture, DisparityRange, SUBPIXEL, SymmetricCheck,
    VerticalSmoothing,
};
use super::{MatcherKind, MatcherSpec, Parameter, Range};
use crate::kernel::{FilterDecision, Isa, Lanes, Match, SsdSearch, matches_and_spread};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v2",
    kind: MatcherKind::Images,
    aliases: &[],
    summary: "block matching of high-contrast pixels with a spread filter and a symmetric check: \
              sparse and careful",
    about: "",
    paper: "Palme, Stereo Vision Library for Obstacle Avoidance Applications, Fribourg and EPFL \
            2007, section 5.3.2",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        VerticalSmoothing::SIGMA,
        DeviationTexture::THRESHOLD,
        SpreadFilter::THRESHOLD,
        SymmetricCheck::TOLERANCE,
        SUBPIXEL,
        BACK_CHECK,
    ],
    cells: None,
    build: |parameters, isa| {
        let texture = DeviationTexture::new(parameters.real(DeviationTexture::THRESHOLD.name));
        let filter = SpreadFilter {
            threshold_px: parameters.real(SpreadFilter::THRESHOLD.name),
        };
        let tolerance_px = parameters.int(SymmetricCheck::TOLERANCE.name);
        let steps = move |width, range| {
            let check = SymmetricCheck::new(tolerance_px, width, range);
            (CostSearch::new(filter, width, range), check)
        };
        let texture = Some(Box::new(texture) as _);
        Ok(matcher(BlockMatching::new(
            parameters, isa, texture, steps,
        )?))
    },
};

/// The spread filter ("Mismatch Error Filtering"): good costs must lie close together.
///
/// The disparities, each with the weight `((least cost + 25) / (cost + 25))²`, have a standard
/// deviation; a match is ambiguous if it reaches the threshold. The thesis leaves the weight open.
#[derive(Clone, Copy)]
struct SpreadFilter {
    threshold_px: f64,
}

impl SpreadFilter {
    const THRESHOLD: Parameter = Parameter {
        name: "spread_threshold",
        unit: "px",
        range: Range::real(8.0, 0.0..=2048.0),
        description: "standard deviation of the disparities of low cost from which a match is \
                      ambiguous",
    };
}

impl CostFilter for SpreadFilter {
    fn search(
        &self,
        isa: Isa,
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        matches: &mut [Match],
        doubts: &mut [FilterDecision],
    ) {
        let threshold_px = self.threshold_px as f32;
        matches_and_spread(isa, left, right, search, threshold_px, matches, doubts);
    }

    fn settle(&self, least: u32, costs: impl Iterator<Item = (i32, u32)>) -> bool {
        let (mut zeroth, mut first, mut second) = (0.0, 0.0, 0.0);
        for (disparity, cost) in costs {
            let weight = ((f64::from(least) + 25.0) / (f64::from(cost) + 25.0)).powi(2);
            let d = f64::from(disparity);
            zeroth += weight;
            first += weight * d;
            second += weight * (d * d);
        }
        let mean = first / zeroth;
        // Rounding can leave the variance of equal disparities a little below 0.
        (second / zeroth - mean * mean).max(0.0).sqrt() >= self.threshold_px
    }
}
