//! Scores a frame once: hashes, true grid, cells, checkpoints and metrics, for all sinks.

use super::{
    AreaChoice, CellJudgement, CellTallies, Checkpoint, CheckpointFrame, DisparityScore,
    FilterTally, FrameFacts, FrameOrigin, MetricValues, PieceConfig, PieceSight, PieceView,
    TestPiece, TrueCells,
};
use std::sync::OnceLock;
use svl_core::depth::GridSettings;
use svl_core::stereo::{CellRule, DepthGrid, Estimate, Frame};

/// Rules of a scenario by which frames are scored.
#[derive(Clone, Debug, Default)]
pub struct Judge {
    /// Shape of the depth grid, and the rule for a known cell.
    pub grid: GridSettings,
    /// Rule for a right cell, if the frame has a calibration ([`CellRule::for_rig`]).
    pub cells: CellRule,
    pub checkpoints: Vec<Checkpoint>,
    /// The test pieces that runs approach.
    pub pieces: Option<PieceConfig>,
    /// The run whose frames are scored.
    pub run: FrameOrigin,
}

/// A frame with all scores of its estimates. Every sink reads this one.
#[derive(Clone, Debug)]
pub struct Judged {
    pub frame: Frame,
    /// In the order of the run's algorithms, without those that failed on the frame.
    pub estimates: Vec<JudgedEstimate>,
    /// The estimate of the witness, which no table shows.
    pub witness: Option<JudgedEstimate>,
    /// The algorithms that failed on the frame.
    pub failures: Vec<MatchFailure>,
    /// The truth of the cells; absent without truth or without estimates.
    pub true_cells: Option<TrueCells>,
    /// The test piece of the run in its cells; absent without one, or without truth.
    pub piece: Option<PieceView>,
    pair_hash: OnceLock<u128>,
    input_hash: OnceLock<u128>,
}

impl Judged {
    /// Hash of the pair's pixels, computed on first use: recording cameras does not need it.
    pub fn pair_hash(&self) -> u128 {
        *self.pair_hash.get_or_init(|| self.frame.pair.hash())
    }

    /// Hash of all inputs of the scores: pixels, geometry and truth.
    pub fn input_hash(&self) -> u128 {
        let pair = self.pair_hash();
        *self.input_hash.get_or_init(|| self.frame.input_hash(pair))
    }
}

/// An algorithm without an estimate of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MatchFailure {
    pub algorithm: String,
    pub reason: String,
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
    /// The test piece as the estimate shows it; absent without one.
    pub sight: Option<PieceSight>,
    /// The checkpoints that the frame shows, as indices of [`Judge::checkpoints`].
    pub checkpoints: Vec<(usize, CheckpointFrame)>,
}

impl Judge {
    /// Scores the estimates of a frame.
    pub fn judge(&self, frame: Frame, estimates: Vec<Estimate>) -> Judged {
        // A recording without algorithms needs no grid of the truth, which costs a median per cell.
        let true_cells = if estimates.is_empty() {
            None
        } else {
            self.true_cells(&frame)
        };
        let shape = self.grid.shape();
        let piece = self.piece().filter(|_| !estimates.is_empty());
        let piece = piece.map(|own| own.view(&frame, shape, self.cells).unwrap_or_default());
        let judged = |estimate| {
            let judged = self.judge_estimate(&frame, true_cells.as_ref(), estimate);
            let grid = &judged.estimate.grid;
            let sight = piece
                .as_ref()
                .map(|own| own.sight(grid, true_cells.as_ref(), self.cells));
            JudgedEstimate { sight, ..judged }
        };
        let estimates = estimates.into_iter().map(judged).collect();
        Judged {
            piece,
            witness: None,
            failures: Vec::new(),
            frame,
            estimates,
            true_cells,
            pair_hash: OnceLock::new(),
            input_hash: OnceLock::new(),
        }
    }

    fn true_cells(&self, frame: &Frame) -> Option<TrueCells> {
        TrueCells::new(frame, self.grid.shape(), self.rule(frame))
    }

    fn judge_estimate(
        &self,
        frame: &Frame,
        true_cells: Option<&TrueCells>,
        estimate: Estimate,
    ) -> JudgedEstimate {
        let map = &estimate.disparity;
        let rule = self.rule(frame);
        let cells = true_cells.map(|truth| truth.judge(frame, &estimate.grid));
        let filtered = true_cells
            .zip(cells.as_deref())
            .map(|(truth, cells)| FilterTally::new(frame, truth, &estimate, cells, rule));
        let truth = frame.truth.as_ref();
        // Collected once: every metric reads the same scores.
        let mut facts = FrameFacts {
            frame,
            estimate: &estimate,
            rule,
            pixels: truth.map(|truth| DisparityScore::new(map, truth)),
            cells: cells.as_deref().map(CellTallies::new),
            area: AreaChoice::default(),
            filtered: filtered.unwrap_or_default(),
        };
        JudgedEstimate {
            hash: estimate.hash(),
            metrics: MetricValues::from_facts(&mut facts),
            checkpoints: self.checkpoints_of(frame, &estimate.grid, cells.as_deref()),
            cells,
            sight: None,
            estimate,
        }
    }

    /// The test piece of the run.
    pub fn piece(&self) -> Option<TestPiece> {
        let pieces = self.pieces.as_ref()?;
        Some(pieces.piece(self.run.seed, self.cells))
    }

    /// Rejects the frame of a checkpoint that a person labelled on another pair.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the checkpoint and the remedy.
    pub fn check_pair(&self, judged: &Judged) -> svl_core::Result<()> {
        self.checkpoints.iter().try_for_each(|checkpoint| {
            checkpoint.check_pair(&judged.frame, &self.run, || judged.pair_hash())
        })
    }

    fn rule(&self, frame: &Frame) -> CellRule {
        self.cells.for_rig(frame.rig().is_some())
    }

    fn checkpoints_of(
        &self,
        frame: &Frame,
        grid: &DepthGrid,
        cells: Option<&[CellJudgement]>,
    ) -> Vec<(usize, CheckpointFrame)> {
        self.shown(frame)
            .map(|(i, checkpoint)| (i, checkpoint.judge(grid, cells, self.rule(frame))))
            .collect()
    }

    /// True if the frame shows a checkpoint.
    pub fn shows_checkpoint(&self, frame: &Frame) -> bool {
        self.shown(frame).next().is_some()
    }

    fn shown(&self, frame: &Frame) -> impl Iterator<Item = (usize, &Checkpoint)> {
        let has_truth = frame.truth.is_some();
        let checkpoints = self.checkpoints.iter().enumerate();
        checkpoints
            // Checkpoints that need truth are skipped without it: no frame shows them.
            .filter(move |(_, checkpoint)| has_truth || !checkpoint.needs_truth())
            .filter(move |(_, checkpoint)| checkpoint.covers(frame, &self.run))
    }
}
