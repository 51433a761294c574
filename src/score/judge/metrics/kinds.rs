//! What a metric is: its unit, its direction, and where its value comes from.

use super::super::measured::{CaseKind, Minimum};
use super::super::{AreaChoice, CellTallies, CellTally, DisparityScore, FilterTally};
use FrameValue::{Cells, Fact, Filtered, Near};
use MetricUnit::{Count, M, Ms, Per100M, Px, Share};
use svl_core::stereo::{CellRule, Estimate, Frame};

/// Inputs of a frame's metrics.
pub struct FrameFacts<'a> {
    pub frame: &'a Frame,
    pub estimate: &'a Estimate,
    /// Rule by which cells are scored.
    pub rule: CellRule,
    /// The disparities against the truth; `None` without truth.
    pub pixels: Option<DisparityScore>,
    /// The cells against the truth; `None` without truth.
    pub cells: Option<CellTallies>,
    /// The cells that metrics of an area are of.
    pub area: AreaChoice,
    /// Counts for the filters.
    pub filtered: FilterTally,
}

impl FrameFacts<'_> {
    /// The value of a metric; `None` where it has none.
    pub(super) fn value(&self, value: FrameValue) -> Option<f64> {
        let tally = |area| Some(self.cells.as_ref()?.get(area));
        let count = match value {
            Fact(value) => return value(self),
            Cells(count) => tally(self.area)
                .filter(|cells| cells.scored() > 0)
                .map(count),
            Near(count) => {
                let has_near = |cells: &&CellTally| cells.quarters > 0 && self.has_distances();
                tally(AreaChoice::All).filter(has_near).map(count)
            }
            Filtered(count) => count(&self.filtered),
        };
        count.map(|count| count as f64)
    }

    /// Number of scored cells; `None` without truth.
    pub(super) fn scored_cells(&self) -> Option<f64> {
        Some(self.cells.as_ref()?.get(AreaChoice::All).scored() as f64)
    }

    /// 1 for a pair with scored cells or pixels, 0 for another; `None` without truth.
    pub(super) fn scored_pairs(&self) -> Option<f64> {
        let has_pixels = self.pixels.is_some_and(|pixels| pixels.invalid().is_some());
        Some(f64::from(self.scored_cells()? > 0.0 || has_pixels))
    }

    /// Number of the false near obstacles; `None` where any report may be right.
    pub(super) fn falsely(&self) -> Option<f64> {
        self.rule.far_m()?;
        self.value(Near(|cells| cells.falsely))
    }

    /// Number of the floor obstacles; `None` if the truth does not tell what is floor.
    pub(super) fn floor(&self) -> Option<f64> {
        self.frame.truth.as_ref()?.surface.as_ref()?;
        self.value(Near(|cells| cells.floor))
    }

    fn has_distances(&self) -> bool {
        matches!(self.rule, CellRule::Distance { .. }) && self.frame.rig().is_some()
    }
}

/// The note below a table: term and text.
#[derive(Clone, Copy)]
pub enum MetricNote {
    Words(&'static str, &'static str),
    OfRule(&'static str, fn(CellRule) -> String),
}

impl MetricNote {
    /// Term and text, for cells scored by that rule.
    pub fn text(self, rule: CellRule) -> (&'static str, String) {
        match self {
            Self::Words(term, words) => (term, words.to_owned()),
            Self::OfRule(term, note) => (term, note(rule)),
        }
    }
}

/// A metric of an algorithm.
#[derive(Clone, Copy)]
pub struct Metric {
    /// Key in a scenario's gate and in the JSON of a comparison.
    pub name: &'static str,
    pub words: &'static str,
    /// Heading above its column and its neighbours in the same group.
    pub group: &'static str,
    pub head: &'static str,
    pub unit: MetricUnit,
    pub better: Better,
    /// True if it compares with true distances or disparities.
    pub against_truth: bool,
    /// True if it has a value for each area: it is of scored cells. Others are of all cells.
    pub by_area: bool,
    pub origin: MetricOrigin,
    /// The cases that its value rests on, and the fewest of them.
    pub cases: CaseKind,
    pub minimum: Minimum,
    /// Path of its plot per frame in Rerun, below the algorithm.
    pub plot: Option<&'static str>,
    /// Term and meaning, on demand.
    pub note: Option<MetricNote>,
    pub level: MetricLevel,
}

/// Tables that show a metric unless columns are named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetricLevel {
    /// The headline table of runs of these kinds.
    Headline(&'static [TruthLevel]),
    /// Only the table of all metrics.
    Detail,
}

/// Kind of a run by its ground truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TruthLevel {
    /// True distances in metres.
    Distances,
    /// Only true disparities in pixels.
    Disparities,
    /// Courses driven by the algorithms.
    Courses,
    NoTruth,
}

/// Unit of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetricUnit {
    /// 0..=1, shown in per cent.
    Share,
    Count,
    Px,
    /// Metres.
    M,
    /// Limited and compared as a ratio, as machines differ.
    Ms,
    /// Number per 100 m driven.
    Per100M,
}

impl MetricUnit {
    /// The unit as columns show it; counts have none.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Share => Some("%"),
            Count => None,
            Px => Some("px"),
            M => Some("m"),
            Ms => Some("ms"),
            Per100M => Some("1/100 m"),
        }
    }
}

/// Direction in which a metric improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    More,
    Less,
    /// The nearer to 0, from either side.
    Zero,
    /// Neither: an unknown is not an error.
    Neither,
}

/// Origin of a metric's value.
#[derive(Clone, Copy)]
pub enum MetricOrigin {
    /// One frame of one algorithm.
    Frame {
        /// Column in the rows, and that of the total in the summary.
        column: &'static str,
        value: FrameValue,
        total: MetricTotal,
    },
    /// The cells of all pairs of an algorithm.
    Cells {
        /// Column in the summary.
        column: &'static str,
        number: CellNumber,
    },
    /// The cells of all pairs of an algorithm beside those of the witness.
    Estimated {
        /// Column in the summary.
        column: &'static str,
        number: EstimatedNumber,
    },
    /// The time per pair; over frames, the median by nearest rank.
    Time,
    /// The frames that show a checkpoint; the fraction in which it passes.
    Checkpoints,
    /// The drives through courses.
    Drives(DriveNumber),
    /// The approaches to the narrowest test piece.
    Pieces {
        /// Column in the summary.
        column: &'static str,
    },
}

/// A number of the errors of an algorithm's distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellNumber {
    Bias,
    Rmse,
    MedianError,
    AbsRel,
    Noise,
    Flicker,
    /// Number of cells with a reported and a true distance.
    ErrorCells,
    /// Number of cells at rest.
    RestingCells,
}

/// A number of errors that are estimated without truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EstimatedNumber {
    Wrong,
    /// Wrong ones among the cells that the witness is sure of.
    SureWrong,
    Right,
}

impl EstimatedNumber {
    /// True if its low end is promised, and not its high end.
    pub fn is_of_right(self) -> bool {
        self == Self::Right
    }
}

/// A metric of an algorithm's drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveNumber {
    /// Fraction of the courses whose goal was reached without a collision and without help.
    Finished,
    Collisions,
    NearMisses,
    /// Metres of the route that the robot drove itself.
    Driven,
    /// Fraction of the courses whose goal was not reached before the pairs ended.
    Late,
}

/// Aggregation over frames; frames without a value are skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetricTotal {
    Mean,
    Sum,
    /// The sum, divided by the number of its cases.
    Share,
}

/// The value of a frame.
#[derive(Clone, Copy)]
pub enum FrameValue {
    Fact(FactValue),
    /// A count of the cells of the area; `None` if none of them is scored: not measured, which is
    /// not 0.
    Cells(fn(&CellTally) -> usize),
    /// A count of all cells by what is near, whatever their area; `None` if no nearest quarter is
    /// known, or no distance: otherwise no obstacle can be missed, and 0 would be misleading.
    Near(fn(&CellTally) -> usize),
    Filtered(fn(&FilterTally) -> Option<usize>),
}

pub(super) type FactValue = fn(&FrameFacts<'_>) -> Option<f64>;
