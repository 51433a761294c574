//! Scores a frame once: hashes, true grid, cells, checkpoints and metrics, for all sinks.

use super::photometric::Correlations;
use super::support::{agreed_cells, unrivalled_cells};
use super::{
    AreaChoice, CellJudgement, CellSupport, CellTallies, Checkpoint, CheckpointFrame,
    DisparityScore, FilterTally, FrameFacts, FrameOrigin, MetricValues, TrueCells,
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
    /// The run whose frames are scored.
    pub run: FrameOrigin,
    /// True if frames without truth are scored by the images: it takes about as long as a fast
    /// matcher.
    pub photometric: bool,
}

/// A frame with all scores of its estimates. Every sink reads this one.
#[derive(Clone, Debug)]
pub struct Judged {
    pub frame: Frame,
    /// In the order of the run's algorithms, without those that failed on the frame.
    pub estimates: Vec<JudgedEstimate>,
    /// The algorithms that failed on the frame.
    pub failures: Vec<MatchFailure>,
    /// The truth of the cells; absent without truth or without estimates.
    pub true_cells: Option<TrueCells>,
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
        let supports = self.supports(&frame, &estimates);
        let estimates = estimates
            .into_iter()
            .zip(supports)
            .map(|(estimate, support)| {
                self.judge_estimate(&frame, true_cells.as_ref(), estimate, support)
            })
            .collect();
        Judged {
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

    /// The support of each estimate; only frames without truth need it.
    fn supports(&self, frame: &Frame, estimates: &[Estimate]) -> Vec<CellSupport> {
        if frame.truth.is_some() || estimates.is_empty() {
            return vec![CellSupport::default(); estimates.len()];
        }
        let correlations = self.photometric.then(|| Correlations::new(&frame.pair));
        let share = |cells: usize| cells as f64 / self.grid.shape().cells() as f64;
        let support = |(i, estimate): (usize, &Estimate)| {
            let others = estimates.iter().enumerate().filter(|(j, _)| *j != i);
            let others: Vec<_> = others.map(|(_, other)| &other.grid).collect();
            // A median needs at least two.
            let agreed = (others.len() >= 2)
                .then(|| agreed_cells(&estimate.grid, &others, self.rule(frame)));
            CellSupport {
                unrivalled: correlations
                    .as_ref()
                    .map(|correlations| share(unrivalled_cells(estimate, correlations))),
                agreed: agreed.map(share),
            }
        };
        estimates.iter().enumerate().map(support).collect()
    }

    fn judge_estimate(
        &self,
        frame: &Frame,
        true_cells: Option<&TrueCells>,
        estimate: Estimate,
        support: CellSupport,
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
            support,
        };
        JudgedEstimate {
            hash: estimate.hash(),
            metrics: MetricValues::from_facts(&mut facts),
            checkpoints: self.checkpoints_of(frame, &estimate.grid, cells.as_deref()),
            cells,
            estimate,
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::MetricSource as _;
    use svl_core::depth;
    use svl_core::stereo::{DisparityMap, Geometry, Plane, StereoPair, Truth};

    /// Noise with disparity 6.
    fn frame() -> Frame {
        let mut random = fastrand::Rng::with_seed(5);
        let noise = (0..100 * 60).map(|_| random.u8(..)).collect();
        let left = Plane::from_vec(100, 60, noise).unwrap();
        let right = Plane::from_fn(100, 60, |x, y| left.get((x + 6) % 100, y)).unwrap();
        Frame::new(
            StereoPair::new(left, right).unwrap(),
            Geometry::Rectified(None),
        )
    }

    /// That disparity from column 20 on, or no disparity.
    fn estimate(disparity_px: Option<f32>) -> Estimate {
        let mut disparity = DisparityMap::new(100, 60).unwrap();
        for mut row in disparity.rows_mut() {
            disparity_px
                .into_iter()
                .for_each(|d| (20..100).for_each(|x| row.accept(x, d)));
        }
        Estimate {
            algorithm: String::new(),
            grid: depth::grid(disparity.disparity(), GridSettings::default(), None),
            disparity,
            own_grid: false,
            unfiltered: None,
            range_px: None,
            times: None,
        }
    }

    fn scores(judge: &Judge, frame: Frame, disparities: &[Option<f32>]) -> Vec<[Option<f64>; 2]> {
        let estimates = disparities.iter().map(|&d| estimate(d)).collect();
        let judged = judge.judge(frame, estimates);
        let values = judged.estimates.iter().map(|scored| &scored.metrics);
        values
            .map(|metrics| ["unrivalled", "agreed"].map(|name| metrics.get(name)))
            .collect()
    }

    #[test]
    fn without_truth_images_and_other_algorithms_support_cells() {
        let judge = Judge {
            cells: CellRule::Disparity { tolerance_px: 2.0 },
            photometric: true,
            ..Judge::default()
        };
        let run = [Some(6.0), Some(6.0), Some(11.0), None];
        // The first of five columns is unknown. The median of 6, 11 is 6, of 6, 6 too. An empty map
        // has the worst score.
        let [right, wrong, silent] = [0.8, 0.0, 0.0].map(|share| [Some(share); 2]);
        assert_eq!(scores(&judge, frame(), &run), [right, right, wrong, silent]);
        // Two algorithms have no median of others, and the images are compared only on request.
        assert_eq!(scores(&judge, frame(), &run[1..3])[0], [Some(0.8), None]);
        let quick = Judge {
            photometric: false,
            ..judge.clone()
        };
        assert_eq!(scores(&quick, frame(), &run)[0], [None, Some(0.8)]);
        // Without a rig there are no distances, and the default rule scores disparities.
        let distances = Judge {
            cells: CellRule::default(),
            ..judge.clone()
        };
        assert_eq!(
            scores(&distances, frame(), &run),
            scores(&judge, frame(), &run)
        );
        let mut known = frame();
        let truth = Plane::filled(100, 60, 6.0).unwrap();
        known.truth = Some(Truth::exact(truth, None));
        assert_eq!(scores(&judge, known, &run)[0], [None, None]);
    }
}
