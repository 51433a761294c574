//! Scores a frame once: hashes, true grid, cells, checkpoints and metrics, for every sink alike.

use super::{
    CellJudgement, CellTally, Checkpoint, CheckpointFrame, DisparityScore, FrameFacts,
    MetricValues, RunPart, judge_cells, true_grid,
};
use crate::depth::GridSettings;
use crate::stereo::{CellRule, DepthGrid, Estimate, Frame};
use std::sync::OnceLock;

/// What a scenario expects of the frames.
#[derive(Clone, Debug, Default)]
pub struct Judge {
    /// Shape of the depth grid, and when a cell is known.
    pub grid: GridSettings,
    /// When a reported cell counts as right.
    pub cells: CellRule,
    pub checkpoints: Vec<Checkpoint>,
    /// The run whose frames are scored.
    pub run: RunPart,
}

/// A frame with all that is known of its estimates. Every sink reads this one.
#[derive(Clone, Debug)]
pub struct Judged {
    pub frame: Frame,
    /// In the order of the run's algorithms. An algorithm that failed on the frame is missing.
    pub estimates: Vec<JudgedEstimate>,
    /// The depth grid of the truth; absent without truth or without estimates.
    pub true_grid: Option<DepthGrid>,
    pair_hash: OnceLock<u128>,
}

impl Judged {
    /// Hash of the pair's pixels, computed when it is first read: recording cameras needs none.
    pub fn pair_hash(&self) -> u128 {
        *self.pair_hash.get_or_init(|| self.frame.pair.hash())
    }
}

/// One algorithm's estimate with its score.
#[derive(Clone, Debug)]
pub struct JudgedEstimate {
    pub estimate: Estimate,
    /// Hash of the disparity map.
    pub hash: u128,
    pub metrics: MetricValues,
    /// The cells in raster order; absent without truth.
    pub cells: Option<Vec<CellJudgement>>,
    /// The checkpoints that the frame shows, as indices of [`Judge::checkpoints`].
    pub checkpoints: Vec<(usize, CheckpointFrame)>,
}

impl Judge {
    /// Scores the estimates of a frame.
    pub fn judge(&self, frame: Frame, estimates: Vec<Estimate>) -> Judged {
        // A recording without algorithms needs no truth grid, which costs a median per cell.
        let true_grid = match estimates.is_empty() {
            true => None,
            false => true_grid(&frame, self.grid.shape()),
        };
        let estimates = estimates
            .into_iter()
            .map(|estimate| self.judge_estimate(&frame, true_grid.as_ref(), estimate))
            .collect();
        Judged {
            frame,
            estimates,
            true_grid,
            pair_hash: OnceLock::new(),
        }
    }

    fn judge_estimate(
        &self,
        frame: &Frame,
        true_grid: Option<&DepthGrid>,
        estimate: Estimate,
    ) -> JudgedEstimate {
        let map = &estimate.disparity;
        let cells = true_grid.map(|truth| judge_cells(truth, &estimate.grid, self.cells));
        let truth = frame.truth.as_ref();
        // Collected once: every metric reads the same scores.
        let facts = FrameFacts {
            frame,
            estimate: &estimate,
            rule: self.cells,
            pixels: truth.map(|truth| DisparityScore::new(map, truth)),
            cells: cells.as_deref().map(CellTally::from_judgements),
        };
        JudgedEstimate {
            hash: map.hash(),
            metrics: MetricValues::of_frame(&facts),
            checkpoints: self.checkpoints_of(frame, &estimate.grid, cells.as_deref()),
            cells,
            estimate,
        }
    }

    fn checkpoints_of(
        &self,
        frame: &Frame,
        grid: &DepthGrid,
        cells: Option<&[CellJudgement]>,
    ) -> Vec<(usize, CheckpointFrame)> {
        let shown = self.checkpoints.iter().enumerate();
        shown
            // Without truth nothing that needs it passes: no frame shows it.
            .filter(|(_, checkpoint)| cells.is_some() || !checkpoint.needs_truth())
            .filter(|(_, checkpoint)| checkpoint.covers(frame, &self.run))
            .map(|(i, checkpoint)| (i, checkpoint.judge(grid, cells, self.cells)))
            .collect()
    }
}
