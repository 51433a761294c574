//! The metrics of a run: one table for everything that shows or compares a number.
//!
//! Rows, CSV, Parquet, summaries, pages, Rerun's plots, `svl compare` and a scenario's `[[gate]]`
//! read their columns, headings and words from [`METRICS`]. A new metric is computed in the file of
//! its kind (pixels: `disparity.rs`, cells: `cells.rs`) and listed here.

use super::{CellTally, DisparityScore, FilterTally, SurfaceTally};
use serde::{Serialize, Serializer};
use svl_core::did_you_mean;
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
    pub cells: Option<CellTally>,
    /// The cells against the nearest quarters of the truth; `None` without truth.
    pub surfaces: Option<SurfaceTally>,
    /// Counts for the filters.
    pub filtered: FilterTally,
    /// Scores without truth, for frames that have none.
    pub support: CellSupport,
}

/// Fractions of all cells of the grid that are known and supported; `None` if not computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellSupport {
    /// By the images.
    pub unrivalled: Option<f64>,
    /// By the other algorithms of the run.
    pub agreed: Option<f64>,
}

impl FrameFacts<'_> {
    /// `None` if no cell is scored: not measured, which is not 0.
    fn cells(&self, count: fn(&CellTally) -> usize) -> Option<f64> {
        let scored = self.cells.as_ref().filter(|cells| cells.scored() > 0);
        scored.map(|cells| count(cells) as f64)
    }

    /// Same as `cells`, if distances are known: otherwise no obstacle can be missed, and 0 would be
    /// misleading.
    fn obstacles(&self, count: fn(&CellTally) -> usize) -> Option<f64> {
        self.cells(count).filter(|_| self.has_distances())
    }

    /// Number of scored cells; `None` without truth.
    fn scored(&self) -> Option<usize> {
        self.cells.as_ref().map(CellTally::scored)
    }

    fn has_scored_pixels(&self) -> bool {
        self.pixels.is_some_and(|pixels| pixels.invalid().is_some())
    }

    fn surfaces(&self, count: fn(&SurfaceTally) -> usize) -> Option<f64> {
        let is_scored = self.cells.as_ref().is_some_and(|cells| cells.scored() > 0);
        let surfaces = self.surfaces.as_ref().filter(|_| is_scored);
        surfaces.map(|cells| count(cells) as f64)
    }

    /// `None` if no nearest quarter is known.
    fn quarters(&self, count: fn(&SurfaceTally) -> usize) -> Option<f64> {
        let scored = self.surfaces.as_ref().filter(|cells| cells.quarters > 0);
        scored.map(|cells| count(cells) as f64)
    }

    /// Same as `quarters`, if distances are known.
    fn near_obstacles(&self, count: fn(&SurfaceTally) -> usize) -> Option<f64> {
        self.quarters(count).filter(|_| self.has_distances())
    }

    fn filtered(&self, count: fn(&FilterTally) -> Option<usize>) -> Option<f64> {
        count(&self.filtered).map(|count| count as f64)
    }

    fn has_distances(&self) -> bool {
        matches!(self.rule, CellRule::Distance { .. }) && self.frame.rig().is_some()
    }
}

/// The note below a table, depending on the cell rule: term and text.
pub type MetricNote = fn(CellRule) -> (&'static str, String);

/// A metric of an algorithm.
#[derive(Clone, Copy)]
pub struct Metric {
    /// Its key in a scenario's gate and in the JSON of a comparison.
    pub name: &'static str,
    pub words: &'static str,
    /// Heading above its column and its neighbours in the same group.
    pub group: &'static str,
    pub head: &'static str,
    pub unit: MetricUnit,
    pub better: Better,
    /// True if it compares with true distances or disparities.
    pub against_truth: bool,
    pub origin: MetricOrigin,
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
    Headline(&'static [RunKind]),
    /// Only the table of all metrics.
    Detail,
}

/// Kind of a run by its ground truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunKind {
    /// True distances in metres.
    Distances,
    /// Only true disparities in pixels.
    Disparities,
    /// Courses driven by the algorithms.
    Courses,
    NoTruth,
}

impl RunKind {
    /// The kind of a run by the metrics that it has.
    pub fn from_measured(has: impl Fn(&str) -> bool) -> Self {
        if has("finished") {
            return Self::Courses;
        }
        // Numbers of scored pairs and cells may be 0.
        let mut truths = METRICS
            .iter()
            .filter(|m| m.against_truth && m.column().is_some() && m.group != "scored");
        if has("missed") || has("missed_median") {
            Self::Distances
        } else if truths.any(|metric| has(metric.name)) {
            Self::Disparities
        } else {
            Self::NoTruth
        }
    }
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
        /// Its column in the rows, and that of its total in the summary.
        column: &'static str,
        value: FrameValue,
        total: MetricTotal,
    },
    /// The cells of all pairs of an algorithm.
    Cells {
        /// Its column in the summary.
        column: &'static str,
        number: CellNumber,
    },
    /// The time per pair; over frames, the median by nearest rank.
    Time,
    /// The frames that show a checkpoint; the fraction in which it passes.
    Checkpoints,
    /// The drives through courses.
    Drives(DriveNumber),
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
}

/// Aggregation over frames; frames without a value are skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetricTotal {
    Mean,
    Sum,
    /// The sum, divided by the sum of these metrics.
    ShareOf(&'static [&'static str]),
}

const SCORED_CELLS: &[&str] = &["right", "wrong", "unknown"];

/// The value of a frame.
type FrameValue = fn(&FrameFacts<'_>) -> Option<f64>;

/// A metric of frames whose values are averaged.
const fn mean(column: &'static str, value: FrameValue) -> MetricOrigin {
    let total = MetricTotal::Mean;
    MetricOrigin::Frame {
        column,
        value,
        total,
    }
}

/// A metric of frames whose values are added up.
const fn sum(column: &'static str, value: FrameValue) -> MetricOrigin {
    let total = MetricTotal::Sum;
    MetricOrigin::Frame {
        column,
        value,
        total,
    }
}

/// A metric of frames whose sum is a part of the sums of others.
const fn part(
    whole: &'static [&'static str],
    column: &'static str,
    value: FrameValue,
) -> MetricOrigin {
    let total = MetricTotal::ShareOf(whole);
    MetricOrigin::Frame {
        column,
        value,
        total,
    }
}

/// A metric against truth that only the table of all metrics shows.
const DETAIL: Metric = Metric {
    name: "",
    words: "",
    group: "",
    head: "",
    unit: MetricUnit::Share,
    better: Better::Neither,
    against_truth: true,
    origin: MetricOrigin::Time,
    plot: None,
    note: None,
    level: MetricLevel::Detail,
};

/// All metrics, in the order of tables and comparisons.
pub const METRICS: &[Metric] = &[
    Metric {
        name: "right",
        words: "right cells",
        group: "cells, %",
        head: "right",
        unit: MetricUnit::Share,
        better: Better::More,
        origin: part(SCORED_CELLS, "cells_right", |facts| {
            facts.cells(|cells| cells.right)
        }),
        note: Some(|rule| {
            let right = rule.right_words();
            let words =
                format!("fractions of the cells with truth; right: {right}; unknown is not wrong");
            ("cells", words)
        }),
        level: MetricLevel::Headline(&[RunKind::Distances]),
        ..DETAIL
    },
    Metric {
        name: "wrong",
        words: "wrong cells",
        group: "cells, %",
        head: "wrong",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: part(SCORED_CELLS, "cells_wrong", |facts| {
            facts.cells(|cells| cells.wrong)
        }),
        plot: Some("wrong_cells"),
        level: MetricLevel::Headline(&[RunKind::Distances]),
        ..DETAIL
    },
    Metric {
        name: "unknown",
        words: "unknown cells",
        group: "cells, %",
        head: "unknown",
        unit: MetricUnit::Share,
        better: Better::Neither,
        origin: part(SCORED_CELLS, "cells_unknown", |facts| {
            facts.cells(|cells| cells.unknown)
        }),
        level: MetricLevel::Headline(&[RunKind::Distances]),
        ..DETAIL
    },
    Metric {
        name: "known",
        words: "known cells",
        group: "cells, %",
        head: "known",
        unit: MetricUnit::Share,
        better: Better::Neither,
        against_truth: false,
        origin: mean("known_share", |facts| {
            Some(facts.estimate.grid.known_share())
        }),
        plot: Some("known_cells"),
        note: Some(|_| {
            let words = "cells with a distance or a disparity, right or not, of all cells; the \
                         mean over the pairs";
            ("known", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::NoTruth]),
    },
    Metric {
        name: "missed_median",
        words: "missed obstacles, by median",
        group: "by median",
        head: "missed",
        unit: MetricUnit::Count,
        better: Better::Less,
        origin: sum("missed_median", |facts| {
            facts.obstacles(|cells| cells.missed_median)
        }),
        note: Some(|rule| {
            let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
            let words = format!(
                "obstacles by the thesis's rule: cells whose true median is nearer than \
                 {obstacle_m} m reported beyond {clear_m} m (missed), and the reverse (false)"
            );
            ("by median", words)
        }),
        ..DETAIL
    },
    Metric {
        name: "false_median",
        words: "false obstacles, by median",
        group: "by median",
        head: "false",
        unit: MetricUnit::Count,
        better: Better::Less,
        origin: sum("false_median", |facts| {
            facts.obstacles(|cells| cells.false_median)
        }),
        ..DETAIL
    },
    Metric {
        name: "right_surface",
        words: "right cells, by surface",
        group: "by surface, %",
        head: "right",
        unit: MetricUnit::Share,
        better: Better::More,
        origin: part(SCORED_CELLS, "cells_right_surface", |facts| {
            facts.surfaces(|cells| cells.right)
        }),
        note: Some(|_| {
            let words = "a cell is right, too, if its report is that of a nearer surface that \
                         fills at least a quarter of the cell";
            ("by surface", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "wrong_surface",
        words: "wrong cells, by surface",
        group: "by surface, %",
        head: "wrong",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: part(SCORED_CELLS, "cells_wrong_surface", |facts| {
            facts.surfaces(|cells| cells.wrong)
        }),
        ..DETAIL
    },
    Metric {
        name: "right_near",
        words: "right cells, by the nearest quarter",
        group: "nearest quarter, %",
        head: "right",
        unit: MetricUnit::Share,
        better: Better::More,
        origin: part(&["scored_quarters"], "cells_right_near", |facts| {
            facts.quarters(|cells| cells.near_right)
        }),
        note: Some(|_| {
            let words = "scored by the nearest quarter of a cell instead of its median, of the \
                         cells in which it is known";
            ("nearest quarter", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "wrong_near",
        words: "wrong cells, by the nearest quarter",
        group: "nearest quarter, %",
        head: "wrong",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: part(&["scored_quarters"], "cells_wrong_near", |facts| {
            facts.quarters(|cells| cells.near_wrong)
        }),
        ..DETAIL
    },
    Metric {
        name: "missed",
        words: "missed near obstacles",
        group: "near obstacles",
        head: "missed",
        unit: MetricUnit::Count,
        better: Better::Less,
        origin: sum("missed", |facts| facts.near_obstacles(|cells| cells.missed)),
        note: Some(|rule| {
            let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
            let words = format!(
                "cells whose nearest quarter is nearer than {obstacle_m} m reported beyond \
                 {clear_m} m (missed), and cells reported nearer than {obstacle_m} m of which less \
                 than 5 % is nearer than {clear_m} m (false)"
            );
            ("near obstacles", words)
        }),
        level: MetricLevel::Headline(&[RunKind::Distances]),
        ..DETAIL
    },
    Metric {
        name: "false",
        words: "false near obstacles",
        group: "near obstacles",
        head: "false",
        unit: MetricUnit::Count,
        better: Better::Less,
        origin: sum("false", |facts| facts.near_obstacles(|cells| cells.falsely)),
        level: MetricLevel::Headline(&[RunKind::Distances]),
        ..DETAIL
    },
    Metric {
        name: "found",
        words: "found near obstacles",
        group: "near obstacles",
        head: "found %",
        unit: MetricUnit::Share,
        better: Better::More,
        origin: part(&["near"], "found", |facts| {
            facts.near_obstacles(|cells| cells.found)
        }),
        note: Some(|rule| {
            let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
            let words = format!(
                "cells reported at most at {clear_m} m, as near or as too close, of all whose \
                 nearest quarter is nearer than {obstacle_m} m: an unknown one is neither found \
                 nor missed"
            );
            ("found", words)
        }),
        level: MetricLevel::Headline(&[RunKind::Distances]),
        ..DETAIL
    },
    Metric {
        name: "floor",
        words: "floor obstacles",
        group: "near obstacles",
        head: "floor",
        unit: MetricUnit::Count,
        better: Better::Less,
        origin: sum("floor_obstacles", |facts| {
            facts.filtered(|cells| cells.floor)
        }),
        note: Some(|rule| {
            let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
            let words = format!(
                "cells reported nearer than {obstacle_m} m in which only floor is nearer than \
                 {clear_m} m: true distances, so not false, and a robot without a filter \
                 stops for them"
            );
            ("floor", words)
        }),
        level: MetricLevel::Headline(&[RunKind::Distances]),
        ..DETAIL
    },
    Metric {
        name: "near",
        words: "near obstacles",
        group: "near obstacles",
        head: "all",
        unit: MetricUnit::Count,
        origin: sum("near", |facts| facts.near_obstacles(|cells| cells.near)),
        note: Some(|rule| {
            let (obstacle_m, _) = rule.obstacle_and_clear_m();
            let words = format!(
                "near obstacles: cells whose nearest quarter is nearer than {obstacle_m} m (all), \
                 and the fraction of them in which nothing is reported (unknown)"
            );
            ("all, unknown", words)
        }),
        ..DETAIL
    },
    Metric {
        name: "near_unknown",
        words: "unknown near obstacles",
        group: "near obstacles",
        head: "unknown, %",
        origin: part(&["near"], "near_unknown", |facts| {
            facts.near_obstacles(|cells| cells.near_unknown)
        }),
        better: Better::Less,
        ..DETAIL
    },
    Metric {
        name: "coverage",
        words: "coverage",
        group: "pixels, %",
        head: "cover",
        unit: MetricUnit::Share,
        better: Better::Neither,
        against_truth: false,
        origin: mean("coverage", |facts| {
            Some(facts.estimate.disparity.coverage())
        }),
        plot: Some("coverage"),
        note: Some(|_| {
            let words = "pixels with a disparity; fractions of pixels are means over the pairs";
            ("cover", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::Disparities]),
    },
    Metric {
        name: "invalid",
        words: "invalid pixels",
        group: "pixels, %",
        head: "invalid",
        unit: MetricUnit::Share,
        better: Better::Neither,
        origin: mean("invalid", |facts| facts.pixels?.invalid()),
        note: Some(|_| {
            let words = "pixels without a disparity, of those with truth that both cameras see";
            ("invalid", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "bad1",
        words: "pixels off > 1 px",
        group: "pixels, %",
        head: ">1 px",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: mean("bad1", |facts| facts.pixels?.bad1()),
        note: Some(|_| {
            let words = "pixels with a larger error, of those with a disparity and with truth that \
                         both cameras see";
            (">1 px, >2 px", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "bad2",
        words: "pixels off > 2 px",
        group: "pixels, %",
        head: ">2 px",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: mean("bad2", |facts| facts.pixels?.bad2()),
        level: MetricLevel::Headline(&[RunKind::Disparities]),
        ..DETAIL
    },
    Metric {
        name: "row_offset",
        words: "vertical misalignment",
        group: "misalignment, px",
        head: "vertical",
        unit: MetricUnit::Px,
        better: Better::Neither,
        against_truth: false,
        origin: mean("row_offset", |facts| {
            facts.estimate.disparity.median_row_offset().map(f64::from)
        }),
        plot: Some("row_offset"),
        note: Some(|_| {
            let words = "number of rows by which the right image is lower: the median over a \
                         pair's pixels, the mean over the pairs; in whole rows, and only within \
                         row_tolerance: `svl calibrate check` measures larger ones";
            ("vertical", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "unrivalled",
        words: "unrivalled cells",
        group: "no truth, %",
        head: "unrivalled",
        unit: MetricUnit::Share,
        better: Better::More,
        against_truth: false,
        origin: mean("unrivalled", |facts| facts.support.unrivalled),
        note: Some(|_| {
            let words = "known cells for which no other disparity matches better, of all cells; \
                         needs no truth: docs/method.md";
            ("unrivalled", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::NoTruth]),
        ..DETAIL
    },
    Metric {
        name: "agreed",
        words: "agreed cells",
        group: "no truth, %",
        head: "agreed",
        unit: MetricUnit::Share,
        better: Better::More,
        against_truth: false,
        origin: mean("agreed", |facts| facts.support.agreed),
        plot: Some("agreed_cells"),
        note: Some(|_| {
            let words = "known cells that the median of the run's other algorithms confirms, of \
                         all cells; needs no truth; compare only runs with the same algorithms";
            ("agreed", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::NoTruth]),
    },
    Metric {
        name: "kept",
        words: "obstacles kept behind filters",
        group: "filters",
        head: "kept",
        unit: MetricUnit::Count,
        better: Better::More,
        origin: sum("kept_obstacles", |facts| facts.filtered(|cells| cells.kept)),
        ..DETAIL
    },
    Metric {
        name: "lost",
        words: "obstacles lost to filters",
        group: "filters",
        head: "lost %",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: part(&["kept", "lost"], "lost_obstacles", |facts| {
            facts.filtered(|cells| cells.lost)
        }),
        note: Some(|rule| {
            let (obstacle_m, _) = rule.obstacle_and_clear_m();
            let words = format!(
                "cells with an obstacle nearer than {obstacle_m} m that are right without filters: \
                 right behind the filters, too (kept), or not (lost)"
            );
            ("kept, lost", words)
        }),
        ..DETAIL
    },
    Metric {
        name: "close",
        words: "cells known to be nearer than the range",
        group: "filters",
        head: "close %",
        unit: MetricUnit::Share,
        better: Better::More,
        origin: part(&["close", "blind"], "close_cells", |facts| {
            facts.filtered(|cells| cells.close)
        }),
        note: Some(|_| {
            let words = "cells truly nearer than the range of disparities: reported as too close, \
                         or right (close), or not (blind)";
            ("close, blind", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "blind",
        words: "cells nearer than the range that are not known to be",
        group: "filters",
        head: "blind",
        unit: MetricUnit::Count,
        better: Better::Less,
        origin: sum("blind_cells", |facts| facts.filtered(|cells| cells.blind)),
        ..DETAIL
    },
    Metric {
        name: "alarms",
        words: "frames with a false alarm of too close",
        group: "filters",
        head: "alarms %",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: mean("false_alarms", |facts| {
            facts.filtered.alarm.map(|is| f64::from(u8::from(is)))
        }),
        note: Some(|rule| {
            let (obstacle_m, _) = rule.obstacle_and_clear_m();
            let words = format!(
                "pairs with cells that are too close, none of which has an obstacle nearer than \
                 {obstacle_m} m"
            );
            ("alarms", words)
        }),
        ..DETAIL
    },
    Metric {
        name: "bias",
        words: "bias of distances",
        group: "distance error",
        head: "bias m",
        unit: MetricUnit::M,
        better: Better::Zero,
        origin: MetricOrigin::Cells {
            column: "bias_m",
            number: CellNumber::Bias,
        },
        note: Some(|_| {
            let words = "of the cells with a reported and a true distance: the mean of reported \
                         minus true (bias), the root of the mean square (RMSE), the median of the \
                         absolute error, and the mean of absolute error over true distance \
                         (AbsRel); accuracy.csv has them by range";
            ("distance error", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "rmse",
        words: "RMSE of distances",
        group: "distance error",
        head: "RMSE m",
        unit: MetricUnit::M,
        better: Better::Less,
        origin: MetricOrigin::Cells {
            column: "rmse_m",
            number: CellNumber::Rmse,
        },
        ..DETAIL
    },
    Metric {
        name: "median_error",
        words: "median error of distances",
        group: "distance error",
        head: "median m",
        unit: MetricUnit::M,
        better: Better::Less,
        origin: MetricOrigin::Cells {
            column: "median_error_m",
            number: CellNumber::MedianError,
        },
        ..DETAIL
    },
    Metric {
        name: "abs_rel",
        words: "mean relative error of distances",
        group: "distance error",
        head: "AbsRel %",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: MetricOrigin::Cells {
            column: "abs_rel",
            number: CellNumber::AbsRel,
        },
        ..DETAIL
    },
    Metric {
        name: "noise",
        words: "noise of distances over time",
        group: "over time",
        head: "noise m",
        unit: MetricUnit::M,
        better: Better::Less,
        origin: MetricOrigin::Cells {
            column: "noise_m",
            number: CellNumber::Noise,
        },
        note: Some(|_| {
            let words = "of cells whose true distance changes by at most 1 % from an answer to the \
                         next: the standard deviation of the error (noise), and the fraction that \
                         changes between known and unknown or by more than the tolerance (flicker)";
            ("over time", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "flicker",
        words: "flickering cells",
        group: "over time",
        head: "flicker %",
        unit: MetricUnit::Share,
        better: Better::Less,
        origin: MetricOrigin::Cells {
            column: "flicker",
            number: CellNumber::Flicker,
        },
        ..DETAIL
    },
    Metric {
        name: "scored_pairs",
        words: "scored pairs",
        group: "scored",
        head: "scored pairs",
        unit: MetricUnit::Count,
        origin: sum("scored_pairs", |facts| {
            Some(f64::from(u8::from(
                facts.scored()? > 0 || facts.has_scored_pixels(),
            )))
        }),
        note: Some(|_| {
            let words = "pairs and cells with enough of a truth: all other numbers against truth \
                         are of these";
            ("scored", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "scored_cells",
        words: "scored cells",
        group: "scored",
        head: "scored cells",
        unit: MetricUnit::Count,
        origin: sum("scored_cells", |facts| {
            facts.scored().map(|cells| cells as f64)
        }),
        ..DETAIL
    },
    Metric {
        name: "scored_quarters",
        words: "cells scored by their nearest quarter",
        group: "scored",
        head: "scored quarters",
        unit: MetricUnit::Count,
        origin: sum("scored_quarters", |facts| {
            facts.surfaces.map(|cells| cells.quarters as f64)
        }),
        note: Some(|_| {
            let words = "cells whose nearest quarter is known: as many as scored cells, but for \
                         sparse truth; near obstacles are of these";
            ("scored quarters", words.into())
        }),
        ..DETAIL
    },
    Metric {
        name: "passed",
        words: "frames passed",
        head: "passed",
        unit: MetricUnit::Share,
        better: Better::More,
        against_truth: false,
        origin: MetricOrigin::Checkpoints,
        level: MetricLevel::Headline(&[RunKind::Distances, RunKind::Disparities, RunKind::NoTruth]),
        ..DETAIL
    },
    Metric {
        name: "time",
        words: "median time",
        group: "ms per pair",
        head: "p50",
        unit: MetricUnit::Ms,
        better: Better::Less,
        against_truth: false,
        origin: MetricOrigin::Time,
        level: MetricLevel::Headline(&[RunKind::Distances, RunKind::Disparities, RunKind::NoTruth]),
        ..DETAIL
    },
    Metric {
        name: "finished",
        words: "courses finished",
        head: "finished",
        unit: MetricUnit::Share,
        better: Better::More,
        against_truth: false,
        origin: MetricOrigin::Drives(DriveNumber::Finished),
        note: Some(|_| {
            let words = "courses whose goal was reached without a collision and without help";
            ("finished", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::Courses]),
        ..DETAIL
    },
    Metric {
        name: "collisions",
        words: "collisions",
        head: "hits/100 m",
        unit: MetricUnit::Per100M,
        better: Better::Less,
        against_truth: false,
        origin: MetricOrigin::Drives(DriveNumber::Collisions),
        note: Some(|_| {
            let words = "collisions per 100 m driven; after one the robot is set back on the route";
            ("hits/100 m", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::Courses]),
        ..DETAIL
    },
    Metric {
        name: "near_misses",
        words: "near misses",
        head: "near/100 m",
        unit: MetricUnit::Per100M,
        better: Better::Less,
        against_truth: false,
        origin: MetricOrigin::Drives(DriveNumber::NearMisses),
        note: Some(|_| {
            let words =
                "clearances below the scenario's near_miss_m without a collision, per 100 m driven";
            ("near/100 m", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::Courses]),
        ..DETAIL
    },
    Metric {
        name: "driven",
        words: "metres driven",
        head: "driven m",
        unit: MetricUnit::M,
        against_truth: false,
        origin: MetricOrigin::Drives(DriveNumber::Driven),
        note: Some(|_| {
            let words = "metres of the route that the robot drove itself, per course; what it \
                         drove twice counts once, and where it was carried not at all";
            ("driven m", words.into())
        }),
        level: MetricLevel::Headline(&[RunKind::Courses]),
        ..DETAIL
    },
];

impl Metric {
    pub fn find(name: &str) -> Option<&'static Self> {
        METRICS.iter().find(|metric| metric.name == name)
    }

    /// The metric of that name, or of that heading in a table, `%` or not, for which `fits` is
    /// true.
    ///
    /// # Errors
    /// One line with the nearest name, or those of the metrics that share the heading.
    pub fn named(name: &str, fits: impl Fn(&Self) -> bool) -> Result<&'static Self, String> {
        let plain = |text: &str| text.trim_end_matches(['%', ',', ' ']).to_owned();
        let is_headed = |metric: &&Self| {
            let has = |head: &str| plain(head) == plain(name);
            // The median time has the percentiles beside it.
            has(metric.head) || metric.name == "time" && has("p99")
        };
        let names = |metrics: &[&Self]| {
            let names: Vec<_> = metrics.iter().map(|metric| metric.name).collect();
            names.join(", ")
        };
        let all: Vec<_> = METRICS.iter().filter(|metric| fits(metric)).collect();
        if let Some(found) = all.iter().find(|metric| metric.name == name) {
            return Ok(found);
        }
        // `unknown, %` is a heading of its own, and `unknown` the name of another metric.
        let mut exact = all.iter().filter(|metric| metric.head == name);
        if let (Some(found), None) = (exact.next(), exact.next()) {
            return Ok(found);
        }
        let headed: Vec<_> = all.iter().copied().filter(is_headed).collect();
        match headed[..] {
            [found] => Ok(found),
            [] if Self::find(name).is_some() => Err(format!(
                "'{name}' is not measured per pair; name a metric that is"
            )),
            [] => Err(Self::unknown(name)),
            _ => Err(format!(
                "'{name}' heads several columns; which of {}?",
                names(&headed)
            )),
        }
    }

    /// The error for a name of no metric.
    pub fn unknown(name: &str) -> String {
        let hint = did_you_mean(name, METRICS.iter().map(|metric| metric.name));
        format!("there is no metric '{name}'{hint}; `svl columns metrics` lists them")
    }

    /// Its column in rows and summary, with the aggregation; `None` if it is not per frame.
    pub fn column(&self) -> Option<(&'static str, MetricTotal)> {
        match self.origin {
            MetricOrigin::Frame { column, total, .. } => Some((column, total)),
            _ => None,
        }
    }

    /// Its column in summaries; `None` if it has a table of its own.
    pub fn summary_column(&self) -> Option<&'static str> {
        match self.origin {
            MetricOrigin::Frame { column, .. } | MetricOrigin::Cells { column, .. } => Some(column),
            _ => None,
        }
    }

    /// True if it may be negative.
    pub fn is_signed(&self) -> bool {
        self.better == Better::Zero
    }

    /// True if any frame of an algorithm can have it, without checkpoints and drives.
    pub fn is_of_frames(&self) -> bool {
        matches!(self.origin, MetricOrigin::Frame { .. } | MetricOrigin::Time)
    }

    /// True if its column contains whole numbers.
    pub fn counts(&self) -> bool {
        let share = |(_, total)| matches!(total, MetricTotal::ShareOf(_));
        self.unit == MetricUnit::Count || self.column().is_some_and(share)
    }

    /// The value of a frame as plotted in Rerun: fractions in per cent.
    pub fn plotted(&self, value: f64) -> f64 {
        match self.unit {
            MetricUnit::Share if !self.counts() => 100.0 * value,
            _ => value,
        }
    }

    /// A value with its unit.
    pub fn show(&self, value: f64) -> String {
        match self.unit {
            MetricUnit::Share => format!("{:.1} %", 100.0 * value),
            MetricUnit::Count => format!("{value:.0}"),
            MetricUnit::Px => format!("{value:.2} px"),
            MetricUnit::M => format!("{value:.3} m"),
            MetricUnit::Ms => format!("{value:.2} ms"),
            MetricUnit::Per100M => format!("{value:.1} per 100 m"),
        }
    }

    /// Same as [`Metric::show`], for a time as a multiple of another.
    pub fn show_relative(&self, value: f64) -> String {
        match self.unit {
            MetricUnit::Ms => format!("{value:.2}x"),
            _ => self.show(value),
        }
    }
}

impl PartialEq for Metric {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for Metric {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl Serialize for Metric {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

/// Values of a frame or a run for the metrics of [`METRICS`] that have a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetricValues([Option<f64>; METRICS.len()]);

impl Default for MetricValues {
    fn default() -> Self {
        Self([None; METRICS.len()])
    }
}

impl MetricValues {
    /// One frame of one algorithm.
    pub fn from_facts(facts: &FrameFacts<'_>) -> Self {
        Self::from_fn(|metric| match metric.origin {
            MetricOrigin::Frame { value, .. } => value(facts),
            _ => None,
        })
    }

    pub fn from_fn(value: impl Fn(&'static Metric) -> Option<f64>) -> Self {
        Self(std::array::from_fn(|i| value(&METRICS[i])))
    }

    /// The value of its column.
    ///
    /// # Panics
    /// If no metric of [`METRICS`] has that name.
    pub fn get(&self, name: &str) -> Option<f64> {
        let place = METRICS.iter().position(|metric| metric.name == name);
        self.0[place.expect("a metric of METRICS")]
    }

    pub fn set(&mut self, name: &str, value: Option<f64>) {
        let place = METRICS.iter().position(|metric| metric.name == name);
        self.0[place.expect("a metric of METRICS")] = value;
    }

    /// The denominator of a metric that is a fraction of others.
    pub fn whole(&self, metric: &Metric) -> Option<f64> {
        match metric.column()?.1 {
            MetricTotal::ShareOf(parts) => parts.iter().map(|part| self.get(part)).sum(),
            _ => None,
        }
    }

    /// The metric: its column, or the fraction it stands for; `None` if the denominator is 0.
    pub fn value(&self, metric: &Metric) -> Option<f64> {
        let value = self.get(metric.name)?;
        match metric.column()?.1 {
            MetricTotal::ShareOf(_) => {
                // A frame with only unknown truths has cells, but none that could be right.
                Some(value / self.whole(metric).filter(|whole| *whole > 0.0)?)
            }
            _ => Some(value),
        }
    }
}

impl<const N: usize> From<[(&str, f64); N]> for MetricValues {
    fn from(values: [(&str, f64); N]) -> Self {
        let mut metrics = Self::default();
        for (name, value) in values {
            metrics.set(name, Some(value));
        }
        metrics
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_and_columns_stand_once_and_shares_are_of_metrics() {
        let columns: Vec<_> = METRICS.iter().filter_map(Metric::column).collect();
        let distinct: BTreeSet<_> = columns.iter().map(|(column, _)| column).collect();
        assert_eq!(distinct.len(), columns.len());
        let names: BTreeSet<_> = METRICS.iter().map(|metric| metric.name).collect();
        assert_eq!(names.len(), METRICS.len());
        for (_, total) in columns {
            if let MetricTotal::ShareOf(parts) = total {
                assert!(parts.iter().all(|part| Metric::find(part).is_some()));
            }
        }
    }

    #[test]
    fn every_heading_names_its_metric() {
        let named = |text: &str| Metric::named(text, |_| true);
        for metric in METRICS {
            assert_eq!(named(metric.name), Ok(metric));
            let alike = METRICS.iter().filter(|other| other.head == metric.head);
            if alike.count() == 1 && Metric::find(metric.head).is_none() {
                assert_eq!(named(metric.head), Ok(metric), "{}", metric.head);
            }
        }
        let found = [
            "p50",
            "p99",
            "cover",
            ">2 px",
            "found",
            "found %",
            "hits/100 m",
        ]
        .map(named);
        let expected = [
            "time",
            "time",
            "coverage",
            "bad2",
            "found",
            "found",
            "collisions",
        ];
        assert_eq!(found.map(|metric| metric.unwrap().name), expected);
        let unknown = "there is no metric 'rigth' (did you mean 'right'?); `svl columns metrics` \
                       lists them";
        assert_eq!(named("rigth"), Err(unknown.to_owned()));
        let unfit = Metric::named("collisions", Metric::is_of_frames);
        assert!(unfit.unwrap_err().contains("is not measured per pair"));
        // Without the one of that name, the heading is that of two.
        let others = Metric::named("right", |metric| metric.name != "right");
        let expected = "'right' heads several columns; which of right_surface, right_near?";
        assert_eq!(others, Err(expected.to_owned()));
    }

    #[test]
    fn a_share_is_of_the_whole_and_of_nothing_absent() {
        let metric = |name| Metric::find(name).unwrap();
        let values = MetricValues::from([("right", 3.0), ("wrong", 1.0), ("unknown", 4.0)]);
        assert_eq!(values.value(metric("right")), Some(0.375));
        assert_eq!(
            (values.get("right"), values.value(metric("bad1"))),
            (Some(3.0), None)
        );
        let none = MetricValues::from([("right", 0.0), ("wrong", 0.0), ("unknown", 0.0)]);
        assert_eq!(none.value(metric("right")), None);
    }
}
