//! Stereoscopic Machine Vision Algo v.1 (thesis, section 5.3.1), the first draft.
//!
//! Vertical smoothing, block matching of every pixel with a one-dimensional window of nine, the
//! error filter after Hirschmüller, and the symmetric check.
//!
//! Departures from the thesis: all in integers; windows near the left edge try the disparities that
//! stay inside the right image; the error filter takes no disparity beside the winner for a rival.

use super::MatcherSpec;
use super::stage::{
    BACK_CHECK, DisparityRange, ErrorFilter, SUBPIXEL, SymmetricCheck, VerticalSmoothing,
};
use super::symmetric::Symmetric;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v1",
    aliases: &[],
    summary: "block matching of every pixel with an error filter and a symmetric check: dense, \
              and wrong where flat",
    paper: "Palme, Stereo Vision Library for Obstacle Avoidance Applications, Fribourg and EPFL \
            2007, section 5.3.1",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        VerticalSmoothing::SIGMA,
        ErrorFilter::UNIQUENESS,
        SymmetricCheck::TOLERANCE,
        SUBPIXEL,
        BACK_CHECK,
    ],
    build: |parameters, isa| {
        let filter = ErrorFilter::new(parameters.real(ErrorFilter::UNIQUENESS.name));
        Ok(Box::new(Symmetric::new(parameters, isa, None, filter)?))
    },
};
