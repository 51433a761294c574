//! Scores and truth of every estimate of a run.

use super::support::{left_right, steady, warped};
use super::{ALGORITHMS, SCORES};
use svl_core::Result;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher, match_right};
use svl_core::stereo::{DepthGrid, RectifiedPair};
use svl_data::score::{CellTally, Correlations, Judge, Judged, agreed_cells, unrivalled_cells};

/// Observation of an algorithm on a pair.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Observation {
    /// Index in [`ALGORITHMS`].
    pub(super) algorithm: usize,
    /// Known cells, in fifteenths of the grid, rounded.
    pub(super) fifteenths: usize,
    pub(super) truth: CellTally,
    /// The fractions of [`SCORES`]: supported cells of all cells, then of known cells, of pixels
    /// with a disparity.
    pub(super) scores: [Option<f64>; SCORES.len()],
}

impl Observation {
    /// Right cells as a fraction of all cells with truth.
    pub(super) fn right(&self) -> f64 {
        self.truth.right as f64 / self.truth.scored() as f64
    }

    /// Wrong cells as a fraction of the known ones; `None` if there are none.
    pub(super) fn wrong(&self) -> Option<f64> {
        let CellTally { right, wrong, .. } = self.truth;
        (right + wrong > 0).then(|| wrong as f64 / (right + wrong) as f64)
    }

    /// Right minus wrong cells.
    pub(super) fn net(&self) -> i64 {
        self.truth.right as i64 - self.truth.wrong as i64
    }
}

/// Scores frames one after the other.
pub(super) struct Observer {
    judge: Judge,
    /// Matchers for the second pass of each algorithm.
    matchers: Vec<Box<dyn Matcher>>,
    output: MatchOutput,
    before: Option<Before>,
}

/// The previous frame.
struct Before {
    sequence: u64,
    stamp_ns: u64,
    grids: Vec<DepthGrid>,
}

impl Observer {
    pub(super) fn new(judge: Judge) -> Result<Self> {
        let build = |name: &&str| name.parse::<Algorithm>()?.build();
        Ok(Self {
            judge,
            matchers: ALGORITHMS.iter().map(build).collect::<Result<_>>()?,
            output: MatchOutput::new()?,
            before: None,
        })
    }

    /// The observations of a frame that all algorithms have matched; empty if no cell has a truth.
    pub(super) fn observe(&mut self, judged: &Judged) -> Result<Vec<Observation>> {
        let frame = &judged.frame;
        let correlations = Correlations::new(&frame.pair);
        let context = MatchContext::of(frame, self.judge.grid, self.judge.cells);
        let grids: Vec<_> = judged.estimates.iter().map(|e| &e.estimate.grid).collect();
        let before = self.before.take();
        // After a gap the previous frame is unknown.
        let before = before.filter(|before| before.sequence + 1 == frame.sequence);
        let mut observations = Vec::new();
        for (algorithm, scored) in judged.estimates.iter().enumerate() {
            let estimate = &scored.estimate;
            let matcher = &mut *self.matchers[algorithm];
            let pair = RectifiedPair::assume(&frame.pair);
            let right = match_right(matcher, pair, &context, &mut self.output)?;
            let steady = before.as_ref().and_then(|before| {
                let seconds = frame.stamp_ns.saturating_sub(before.stamp_ns) as f64 / 1e9;
                let grid = &before.grids[algorithm];
                steady(&estimate.grid, grid, seconds, self.judge.cells)
            });
            let mut others = grids.clone();
            others.remove(algorithm);
            let known = estimate
                .grid
                .iter()
                .filter(|(_, cell)| cell.depth.is_some());
            let known = known.count();
            let cells = estimate.grid.shape().cells();
            let share = |count: usize| Some(count as f64 / cells as f64);
            let truth = CellTally::from_judgements(scored.cells.as_deref().unwrap_or_default());
            if truth.scored() == 0 {
                continue;
            }
            observations.push(Observation {
                algorithm,
                fifteenths: (15 * known + cells / 2) / cells,
                truth,
                scores: [
                    share(warped(estimate, &correlations)),
                    share(unrivalled_cells(estimate, &correlations)),
                    share(left_right(estimate, &right)),
                    steady.and_then(share),
                    share(agreed_cells(&estimate.grid, &others, self.judge.cells)),
                    share(known),
                    Some(estimate.disparity.coverage()),
                ],
            });
        }
        self.before = Some(Before {
            sequence: frame.sequence,
            stamp_ns: frame.stamp_ns,
            grids: grids.into_iter().cloned().collect(),
        });
        Ok(observations)
    }
}
