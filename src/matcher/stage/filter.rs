//! Filters that look at all costs of a window and reject a winner that others come close to.

use crate::kernel::{Doubt, Isa, Lanes, Match, SsdSearch, matches_and_rivals, matches_and_spread};
use crate::matcher::{Parameter, Range};

/// A filter on the costs of a window, run along with the search for the winner.
pub trait CostFilter: Sync {
    /// Finds the matches of rows of two blocks, and what the filter says of each.
    fn search(
        &self,
        isa: Isa,
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        matches: &mut [Match],
        doubts: &mut [Doubt],
    );

    /// Whether a window is ambiguous that [`CostFilter::search`] left open, by its least cost and
    /// all its costs, as pairs with their disparities. A filter that leaves nothing open need not
    /// say.
    fn settle(&self, _least: u32, _costs: impl Iterator<Item = (i32, u32)>) -> bool {
        false
    }
}

/// The error filter (thesis, section 5.3.1, after Hirschmüller): the second least cost must lie
/// clearly above the least.
///
/// Departure from the thesis: disparities beside the winner are no rivals. That its filter ignores
/// how far apart the two minima are is a weakness the thesis names in its remarks.
#[derive(Clone, Copy, Debug)]
pub struct ErrorFilter {
    thousandths: u32,
}

impl ErrorFilter {
    /// The margin, as the matchers' tables have it.
    pub const UNIQUENESS: Parameter = Parameter {
        name: "uniqueness",
        unit: "",
        range: Range::Real {
            default: 0.10,
            min: 0.0,
            max: 10.0,
        },
        description: "share by which the next cost, not beside the winner's, must exceed the \
                      winner's",
    };

    /// A `uniqueness` of 0.10 asks for 10 %; it is taken to thousandths.
    pub fn new(uniqueness: f64) -> Self {
        Self {
            thousandths: (1000.0 * uniqueness).round() as u32,
        }
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
        doubts: &mut [Doubt],
    ) {
        matches_and_rivals(isa, left, right, search, self.thousandths, matches, doubts);
    }
}

/// The spread filter (thesis, section 5.3.2, "Mismatch Error Filtering"): good costs must lie close
/// together.
///
/// The disparities, each with the weight `((least cost + 25) / (cost + 25))²`, have a standard
/// deviation; a match is ambiguous when it reaches the threshold. The thesis leaves the weight
/// open.
#[derive(Clone, Copy, Debug)]
pub struct SpreadFilter {
    threshold_px: f64,
}

impl SpreadFilter {
    /// The threshold, as the matchers' tables have it.
    pub const THRESHOLD: Parameter = Parameter {
        name: "spread_threshold",
        unit: "px",
        range: Range::Real {
            default: 8.0,
            min: 0.0,
            max: 2048.0,
        },
        description: "standard deviation of the disparities of low cost from which a match is \
                      ambiguous",
    };

    /// With that threshold.
    pub fn new(threshold_px: f64) -> Self {
        Self { threshold_px }
    }
}

impl CostFilter for SpreadFilter {
    fn search(
        &self,
        isa: Isa,
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        matches: &mut [Match],
        doubts: &mut [Doubt],
    ) {
        matches_and_spread(
            isa,
            left,
            right,
            search,
            self.threshold_px as f32,
            matches,
            doubts,
        );
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
        (second / zeroth - mean * mean).max(0.0).sqrt() >= self.threshold_px
    }
}
