//! Calibration of probabilities: predicted against observed.

use serde::Serialize;
use svl_core::depth::decision::probability;

/// The cells whose probability lies in a range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReliabilityBin {
    pub from: f64,
    pub to: f64,
    pub cells: usize,
    /// Mean probability.
    pub said: f64,
    /// Fraction of them that is right.
    pub right: f64,
}

/// Ends of the ranges of probability.
const ENDS: [f64; 10] = [0.0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.9, 0.95, 0.98, 1.0];

/// Cells, each with its score and true if it is right, by ranges of probability.
pub(super) fn reliability(cells: &[(i64, bool)]) -> Vec<ReliabilityBin> {
    let bin = |ends: &[f64]| {
        let inside = cells.iter().copied().filter(|&(score, _)| {
            let said = probability(score);
            said >= ends[0] && (said < ends[1] || ends[1] == 1.0)
        });
        let inside: Vec<_> = inside.collect();
        let mean = |number: &dyn Fn((i64, bool)) -> f64| {
            inside.iter().map(|&cell| number(cell)).sum::<f64>() / inside.len().max(1) as f64
        };
        ReliabilityBin {
            from: ends[0],
            to: ends[1],
            cells: inside.len(),
            said: mean(&|(score, _)| probability(score)),
            right: mean(&|(_, right)| f64::from(u8::from(right))),
        }
    };
    ENDS.windows(2).map(bin).collect()
}
