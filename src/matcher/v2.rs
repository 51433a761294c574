//! Stereoscopic Machine Vision Algo v.2 (thesis, section 5.3.2).
//!
//! As v1, but windows of little contrast are dropped before the matching, and instead of the two
//! best costs the spread of all of them tells whether a match is ambiguous.
//!
//! Departures from the thesis: those of v1; the weight of a disparity in the spread, which the
//! thesis leaves open. The spread is in floating point, decided in single precision where that is
//! sure and in double where it is not, so that it too is the same on every machine.

use super::MatcherSpec;
use super::stage::{
    BACK_CHECK, DeviationTexture, DisparityRange, SUBPIXEL, SpreadFilter, SymmetricCheck,
    VerticalSmoothing,
};
use super::symmetric::Symmetric;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v2",
    aliases: &[],
    summary: "block matching of contrasty pixels with a spread filter and a symmetric check: \
              sparse and careful",
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
    build: |parameters, isa| {
        let texture = DeviationTexture::new(parameters.real(DeviationTexture::THRESHOLD.name));
        let filter = SpreadFilter::new(parameters.real(SpreadFilter::THRESHOLD.name));
        Ok(Box::new(Symmetric::new(
            parameters,
            isa,
            Some(texture),
            filter,
        )?))
    },
};
