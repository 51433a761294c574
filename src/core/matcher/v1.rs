//! Stereoscopic Machine Vision Algo v.1 (thesis, section 5.3.1), the first draft.
//!
//! Vertical smoothing, block matching of every pixel with a one-dimensional window of nine, the
//! error filter after Hirschmüller, and the symmetric check.
//!
//! Departures from the thesis: all in integers; windows near the left edge try the disparities that
//! stay inside the right image; the error filter ignores disparities next to the winner.

use super::block_matching::BlockMatching;
use super::method::matcher;
use super::stage::{
    BACK_CHECK, CostFilter, CostSearch, DisparityRange, SUBPIXEL, SymmetricCheck, VerticalSmoothing,
};
use super::{MatcherKind, MatcherSpec, Parameter, Parameters, Range};
use crate::error::{Error, Result};
use crate::kernel::{FilterDecision, Isa, Lanes, Match, SsdSearch, matches_and_rivals};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v1",
    kind: MatcherKind::Images,
    aliases: &[],
    summary: "block matching of every pixel with an error filter and a symmetric check: dense, \
              and wrong in textureless areas",
    about: "",
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
    cells: None,
    build: |parameters, isa| {
        let filter = ErrorFilter::from_parameters(parameters)?;
        let tolerance_px = parameters.int(SymmetricCheck::TOLERANCE.name);
        let matching = BlockMatching::new(parameters, isa, None, move |width, range| {
            let check = SymmetricCheck::new(tolerance_px, width, range);
            (CostSearch::new(filter, width, range), check)
        })?;
        Ok(matcher(matching))
    },
};

/// The error filter (after Hirschmüller): the second least cost must be clearly above the least.
///
/// Departure from the thesis: disparities next to the winner are ignored. The thesis mentions in
/// its remarks, as a weakness, that its filter ignores the distance between the two minima.
#[derive(Clone, Copy)]
struct ErrorFilter {
    thousandths: u32,
}

impl ErrorFilter {
    const UNIQUENESS: Parameter = Parameter {
        name: "uniqueness",
        unit: "%",
        range: Range::real(10.0, 0.0..=1000.0),
        description: "by how much every other disparity not beside the winner must be worse",
    };

    /// # Errors
    /// [`Error::Invalid`] for a fraction, the unit of earlier versions.
    fn from_parameters(parameters: &Parameters) -> Result<Self> {
        let percent = parameters.real(Self::UNIQUENESS.name);
        if percent > 0.0 && percent < 1.0 {
            // Rounded, as 100 · 0.07 is not 7.
            let written = (1e6 * percent).round() / 1e4;
            return Err(Error::Invalid(format!(
                "v1: uniqueness is per cent: write {written} for {percent}"
            )));
        }
        Ok(Self {
            thousandths: (10.0 * percent).round() as u32,
        })
    }
}

impl CostFilter for ErrorFilter {
    fn search(
        &self,
        isa: Isa,
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        matches: &mut [Match],
        doubts: &mut [FilterDecision],
    ) {
        matches_and_rivals(isa, left, right, search, self.thousandths, matches, doubts);
    }
}
