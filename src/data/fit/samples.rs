//! Cells of frames with a truth, as samples for the verdict table.

use crate::score::{Judged, depth_at, is_right};
use svl_core::depth::decision::SafeChoice;
use svl_core::stereo::{Cell, CellDepth, CellEvidence};
use svl_core::{Error, Result};

/// A cell, reportable or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellSample {
    /// Its scene, recording or seed: samples of one are never split.
    pub group: usize,
    /// `None` if nothing was seen.
    pub evidence: Option<CellEvidence>,
    /// True if the report would be right, by the scenario's rule.
    pub right: bool,
    /// True if the algorithm reported it.
    pub known: bool,
}

impl CellSample {
    /// True if there is something to report.
    pub fn is_reportable(&self) -> bool {
        self.evidence.is_some_and(|evidence| evidence.report > 0)
    }
}

/// Part of a cell to report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CellTarget {
    #[default]
    Median,
    /// Its nearest quarter.
    Near,
}

impl CellTarget {
    /// Target of a decision on cells.
    ///
    /// # Errors
    /// [`Error::Usage`] for a percentile that is not a target's.
    pub fn of(choice: &SafeChoice) -> Result<Self> {
        match choice.decision.rank {
            50 => Ok(Self::Median),
            75 => Ok(Self::Near),
            rank => {
                let cure = "leave rank out; target=near asks for the nearest quarter";
                let message = format!("nothing is scored at rank {rank}: {cure}");
                Err(Error::Usage(message))
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

/// The cells of a frame with truth, as samples of the run's first algorithm.
pub fn cell_samples(judged: &Judged, target: CellTarget, group: usize) -> Vec<CellSample> {
    let (Some(truth), Some(scored)) = (&judged.true_cells, judged.estimates.first()) else {
        return Vec::new();
    };
    let rig = judged.frame.rig();
    let wanted: Vec<_> = match target {
        CellTarget::Median => truth.grid().iter().map(|(_, cell)| cell.depth).collect(),
        CellTarget::Near => truth.near().collect(),
    };
    let cells = scored.estimate.grid.iter().zip(wanted).enumerate();
    let sample = |(i, ((_, cell), wanted)): (usize, ((_, &Cell), Option<CellDepth>))| {
        let wanted = wanted?;
        let reported = cell.evidence.map(|evidence| {
            let median_px = evidence.report as f32 / svl_core::depth::decision::BINS_PER_PX as f32;
            depth_at(median_px, rig)
        });
        let reported = reported.filter(|depth| depth.median_px > 0.0);
        Some(CellSample {
            group,
            evidence: cell.evidence,
            // `None` if the rule finds no truth, such as at infinity.
            right: is_right(&wanted, reported.as_ref(), truth.rule(i, &wanted))?,
            known: cell.depth.is_some(),
        })
    };
    cells.filter_map(sample).collect()
}
