//! Cells of frames with a truth, as the verdict table sees them.

use crate::score::{Judge, Judged, depth_at, is_right};
use svl_core::matcher::Algorithm;
use svl_core::stereo::{Cell, CellDepth, CellEvidence};
use svl_core::{Error, Result};

/// A cell that could be reported, or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellSample {
    /// The scene, the recording or the seed that it is of: samples of one are never parted.
    pub group: usize,
    /// Absent where nothing was seen.
    pub evidence: Option<CellEvidence>,
    /// Whether the report would be right, by the scenario's rule.
    pub right: bool,
    /// Whether the algorithm reported it.
    pub known: bool,
}

impl CellSample {
    /// Whether there is something to report.
    pub fn is_reportable(&self) -> bool {
        self.evidence.is_some_and(|evidence| evidence.report > 0)
    }
}

/// What of a cell is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CellTarget {
    #[default]
    Median,
    /// Its nearest quarter.
    Near,
}

impl CellTarget {
    /// What the cells of an algorithm are to report.
    ///
    /// # Errors
    /// [`Error::Usage`] for another percentile than a target's; what is wrong with a table's file.
    pub fn of(algorithm: &Algorithm) -> Result<Self> {
        let choice = algorithm.safe_choice()?;
        match choice.map_or(50, |choice| choice.decision.rank) {
            50 => Ok(Self::Median),
            75 => Ok(Self::Near),
            rank => {
                let label = algorithm.label();
                let cure = "leave rank out; target=near asks for the nearest quarter";
                Err(Error::Usage(format!(
                    "{label}: nothing is judged at rank {rank}: {cure}"
                )))
            }
        }
    }

    /// The percentile of the disparities.
    pub fn rank(self) -> i64 {
        match self {
            Self::Median => 50,
            Self::Near => 75,
        }
    }
}

/// The cells of a frame that have a truth, as the first algorithm of the run sees them.
pub fn cell_samples(
    judge: &Judge,
    judged: &Judged,
    target: CellTarget,
    group: usize,
) -> Vec<CellSample> {
    let (Some(truth), Some(scored)) = (&judged.true_cells, judged.estimates.first()) else {
        return Vec::new();
    };
    let (estimate, map) = (&scored.estimate, scored.estimate.disparity.disparity());
    let rig = judged.frame.rig();
    let rule = judge.cells.for_rig(rig.is_some());
    let wanted: Vec<_> = match target {
        CellTarget::Median => truth.grid().iter().map(|(_, cell)| cell.depth).collect(),
        CellTarget::Near => truth.near().collect(),
    };
    let cells = estimate.grid.iter().zip(wanted).enumerate();
    let sample = |(i, ((_, cell), wanted)): (usize, ((_, &Cell), Option<CellDepth>))| {
        let reported = cell.evidence.map(|evidence| {
            let median_px = evidence.report as f32 / svl_core::depth::decision::BINS_PER_PX as f32;
            depth_at(median_px, rig)
        });
        let reported = reported.filter(|depth| depth.median_px > 0.0);
        let reported = reported.map(|depth| truth.at_truth(i, depth, map));
        Some(CellSample {
            group,
            evidence: cell.evidence,
            // Nothing where the rule finds no truth, as at infinity.
            right: is_right(&wanted?, reported.as_ref(), rule)?,
            known: cell.depth.is_some(),
        })
    };
    cells.filter_map(sample).collect()
}
