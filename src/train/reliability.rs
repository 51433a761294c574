//! Calibration of probabilities: predicted against observed.

use svl_core::depth::decision::probability;
use svl_report::{ReliabilityBin, ReliabilityTally};

/// Ends of the ranges of probability.
const ENDS: [f64; 10] = [0.0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.9, 0.95, 0.98, 1.0];

/// Cells, each with its score and true if it is right, by ranges of probability.
pub(super) fn reliability(cells: &[(i64, bool)]) -> Vec<ReliabilityBin> {
    let mut tally = ReliabilityTally::new(&ENDS);
    for &(score, is_right) in cells {
        tally.add(probability(score), is_right);
    }
    tally.bins()
}
