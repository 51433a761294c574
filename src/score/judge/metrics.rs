//! The metrics of a run: one table for everything that shows or compares a number.
//!
//! Rows, CSV, Parquet, summaries, pages, Rerun's plots, `svl compare` and a scenario's `[[gate]]`
//! read their columns, headings and words from [`METRICS`]. A new metric is computed in the file of
//! its kind (pixels: `disparity.rs`, cells: `cells.rs`) and listed here.

use super::measured::{CaseKind, Cases, Measured, Minimum, counted};
use super::{AreaChoice, CellTallies, CellTally, DisparityScore, FilterTally};
use Better::{Less, More, Neither, Zero};
use FrameValue::{Cells, Fact, Filtered, Near};
use MetricUnit::{Count, M, Ms, Per100M, Px, Share};
use TruthLevel::{Courses, Disparities, Distances, NoTruth};
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
    pub cells: Option<CellTallies>,
    /// The cells that metrics of an area are of.
    pub area: AreaChoice,
    /// Counts for the filters.
    pub filtered: FilterTally,
}

impl FrameFacts<'_> {
    /// The value of a metric; `None` where it has none.
    fn value(&self, value: FrameValue) -> Option<f64> {
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
    fn scored_cells(&self) -> Option<f64> {
        Some(self.cells.as_ref()?.get(AreaChoice::All).scored() as f64)
    }

    /// 1 for a pair with scored cells or pixels, 0 for another; `None` without truth.
    fn scored_pairs(&self) -> Option<f64> {
        let has_pixels = self.pixels.is_some_and(|pixels| pixels.invalid().is_some());
        Some(f64::from(self.scored_cells()? > 0.0 || has_pixels))
    }

    /// Number of the false near obstacles; `None` where any report may be right.
    fn falsely(&self) -> Option<f64> {
        self.rule.far_m()?;
        self.value(Near(|cells| cells.falsely))
    }

    /// Number of the floor obstacles; `None` if the truth does not tell what is floor.
    fn floor(&self) -> Option<f64> {
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

impl TruthLevel {
    /// The kind of a run by the metrics that it has.
    pub fn from_measured(has: impl Fn(&str) -> bool) -> Self {
        if has("finished") {
            return Self::Courses;
        }
        // Numbers of scored pairs and cells may be 0.
        let mut truths = METRICS
            .iter()
            .filter(|m| m.against_truth && m.column().is_some() && m.group != "scored");
        // Only distances tell what is near, or nearer than the range.
        if has("false") || has("missed") || has("blind") || has("close") {
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

type FactValue = fn(&FrameFacts<'_>) -> Option<f64>;

const fn from_frames(column: &'static str, value: FrameValue, total: MetricTotal) -> MetricOrigin {
    MetricOrigin::Frame {
        column,
        value,
        total,
    }
}

/// An entry of [`METRICS`], begun: its name, its words, and the headings of its group and its
/// column. It is against truth, of all cells, and only in the table of all metrics.
const fn metric(
    name: &'static str,
    words: &'static str,
    group: &'static str,
    head: &'static str,
) -> Metric {
    Metric {
        name,
        words,
        group,
        head,
        unit: Share,
        better: Neither,
        against_truth: true,
        by_area: false,
        origin: MetricOrigin::Time,
        cases: CaseKind::Items("pair*"),
        minimum: Minimum::ONE,
        plot: None,
        note: None,
        level: MetricLevel::Detail,
    }
}

impl Metric {
    /// A part of the cases, of all frames.
    const fn part(mut self, column: &'static str, better: Better, value: FrameValue) -> Self {
        self.origin = from_frames(column, value, MetricTotal::Share);
        self.unit(Share, better)
    }

    /// A count that is added up over the frames.
    const fn sum(mut self, column: &'static str, better: Better, value: FrameValue) -> Self {
        self.origin = from_frames(column, value, MetricTotal::Sum);
        self.unit(Count, better)
    }

    /// A share that is averaged over the frames.
    const fn mean(mut self, column: &'static str, better: Better, value: FactValue) -> Self {
        self.origin = from_frames(column, Fact(value), MetricTotal::Mean);
        self.unit(Share, better)
    }

    /// A number of the errors of all cells.
    const fn number(mut self, column: &'static str, number: CellNumber) -> Self {
        self.origin = MetricOrigin::Cells { column, number };
        self
    }

    const fn under(mut self, group: &'static str) -> Self {
        self.group = group;
        self
    }

    const fn origin(mut self, origin: MetricOrigin) -> Self {
        self.origin = origin;
        self
    }

    const fn unit(mut self, unit: MetricUnit, better: Better) -> Self {
        (self.unit, self.better) = (unit, better);
        self
    }

    const fn over(mut self, cases: CaseKind) -> Self {
        self.cases = cases;
        self
    }

    const fn at_least(mut self, cases: u64, share: Option<f64>) -> Self {
        self.minimum = Minimum { cases, share };
        self
    }

    const fn by_area(mut self) -> Self {
        self.by_area = true;
        self
    }

    const fn without_truth(mut self) -> Self {
        self.against_truth = false;
        self
    }

    const fn plotted_at(mut self, path: &'static str) -> Self {
        self.plot = Some(path);
        self
    }

    /// A note whose term is the heading of the column.
    const fn note(self, words: &'static str) -> Self {
        let term = self.head;
        self.note_on(term, words)
    }

    const fn note_on(mut self, term: &'static str, words: &'static str) -> Self {
        self.note = Some(MetricNote::Words(term, words));
        self
    }

    const fn note_by_rule(mut self, term: &'static str, words: fn(CellRule) -> String) -> Self {
        self.note = Some(MetricNote::OfRule(term, words));
        self
    }

    const fn headline(mut self, levels: &'static [TruthLevel]) -> Self {
        self.level = MetricLevel::Headline(levels);
        self
    }
}

const SCORED_CELLS: CaseKind = CaseKind::Sum(&["right", "wrong", "unknown"], "cell*");
const NEAR_OBSTACLES: CaseKind = CaseKind::Sum(&["near"], "near obstacle*");
const BEHIND_FILTERS: CaseKind =
    CaseKind::Sum(&["kept", "lost"], "obstacle* right without filters");
const OUT_OF_RANGE: CaseKind = CaseKind::Sum(&["close", "blind"], "cell* nearer than the range");
const LATE_CELLS: CaseKind = CaseKind::Sum(
    &["right_late", "wrong_late", "unknown_late"],
    "cell* on arrival",
);
const WAY_CELLS: CaseKind = CaseKind::Sum(&["way_cells"], "cell* on the way");
const WAY_M: CaseKind = CaseKind::Sum(&["way_m"], "m on the way");
const ERRORS: CaseKind = CaseKind::Errors("known cell* with a finite truth");
const COMMON: CaseKind = CaseKind::Errors("cell* in common with v5");
const CHANGES: CaseKind = CaseKind::Changes("cell* at rest");
const METRES: CaseKind = CaseKind::Items("m driven");
const COMPARED: CaseKind = CaseKind::Sum(&["same", "changed", "gone"], "cell* known unperturbed");
/// Fewest of the cells that errors and noise are of: those without a finite report are left out.
const MIN_SHARE: Option<f64> = Some(0.95);

/// Group of the metrics of perturbed pairs beside the unperturbed ones.
const PERTURBED: &str = "perturbed, %";

/// Group of the cells of answers when they arrive.
const LATE: &str = "late, %";

/// Group of the reports nearer than what the robot drove through.
const WAY: &str = "way, %";

/// All runs without drives.
const SCORED: &[TruthLevel] = &[Distances, Disparities, NoTruth];

// Entries of groups, begun with what their metrics have in common.

const fn cells(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    let own = metric(name, words, "cells, %", head);
    own.over(SCORED_CELLS).by_area()
}

const fn near(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    metric(name, words, "near obstacles", head).over(SCORED_CELLS)
}

const fn late(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    let own = metric(name, words, LATE, head);
    own.over(LATE_CELLS)
        .by_area()
        .headline(&[Distances, Disparities])
}

const fn way(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    metric(name, words, WAY, head).without_truth()
}

const fn pixels(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    metric(name, words, "pixels, %", head)
}

const fn estimated(
    name: &'static str,
    number: EstimatedNumber,
    words: &'static str,
    head: &'static str,
) -> Metric {
    let own = metric(name, words, "estimated, %", head).without_truth();
    let column = name;
    let own = own.origin(MetricOrigin::Estimated { column, number });
    own.over(COMMON).by_area().headline(&[NoTruth])
}

const fn perturbed(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    let own = metric(name, words, PERTURBED, head);
    own.over(COMPARED).without_truth()
}

const fn filters(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    metric(name, words, "filters", head)
}

const fn error(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    let own = metric(name, words, "distance error", head);
    own.over(ERRORS).at_least(1, MIN_SHARE).by_area()
}

const fn over_time(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    let own = metric(name, words, "over time", head);
    own.over(CHANGES).by_area()
}

const fn drives(name: &'static str, words: &'static str, head: &'static str) -> Metric {
    let own = metric(name, words, "", head).over(CaseKind::Items("course*"));
    own.without_truth().headline(&[Courses])
}

/// All metrics, in the order of tables and comparisons.
pub const METRICS: &[Metric] = &[
    cells("right", "right cells", "right")
        .part("cells_right", More, Cells(|own| own.right))
        .note_by_rule("cells", |rule| {
            let (right, far_px) = (rule.right_words(), rule.far_px());
            format!("those with truth; right: {right}, far up to {far_px} px; unknown is not wrong")
        })
        .headline(&[Distances]),
    cells("wrong", "wrong cells", "wrong")
        .part("cells_wrong", Less, Cells(|own| own.wrong))
        .plotted_at("wrong_cells")
        .headline(&[Distances]),
    cells("unknown", "unknown cells", "unknown")
        .part("cells_unknown", Neither, Cells(|own| own.unknown))
        .headline(&[Distances]),
    metric("known", "known cells", "cells, %", "known")
        .mean("known_share", Neither, |facts| {
            Some(facts.estimate.grid.known_share())
        })
        .without_truth()
        .plotted_at("known_cells")
        .note(
            "cells with a distance or a disparity, right or not: of the cells with truth where \
             there are some, else of all cells, the mean over the pairs",
        )
        .headline(&[NoTruth]),
    cells("right_surface", "right cells, by surface", "right")
        .under("by surface, %")
        .part("cells_right_surface", More, Cells(|own| own.right_surface))
        .note_on(
            "by surface",
            "a cell is right, too, if its report is that of a nearer surface that fills at least \
             a quarter of the cell",
        ),
    cells("wrong_surface", "wrong cells, by surface", "wrong")
        .under("by surface, %")
        .part("cells_wrong_surface", Less, Cells(|own| own.wrong_surface)),
    near("missed", "missed near obstacles", "missed")
        .sum("missed", Less, Near(|own| own.missed))
        .over(NEAR_OBSTACLES)
        .note_by_rule("near obstacles", |rule| {
            let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
            let far_m = rule.far_m().unwrap_or(f64::INFINITY);
            format!(
                "cells of which a quarter is nearer than {obstacle_m} m and not floor, known to be \
                 beyond {clear_m} m (missed); cells reported at most at {clear_m} m, as near or as \
                 too close, of which less than 5 % is nearer than {far_m:.2} m, the farthest truth \
                 of which that is right (false); cells of all areas"
            )
        })
        .headline(&[Distances]),
    near("false", "false near obstacles", "false")
        .sum("false", Less, Fact(|facts| facts.falsely()))
        .headline(&[Distances]),
    near("found", "found near obstacles", "found %")
        .part("found_obstacles", More, Near(|own| own.found))
        .over(NEAR_OBSTACLES)
        .note_by_rule("found", |rule| {
            let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
            format!(
                "cells reported at most at {clear_m} m, as near or as too close, of all of which a \
                 quarter is nearer than {obstacle_m} m and not floor: an unknown one is neither \
                 found nor missed"
            )
        })
        .headline(&[Distances]),
    near("floor", "floor obstacles", "floor")
        .sum("floor_obstacles", Neither, Fact(|facts| facts.floor()))
        .note_by_rule("floor", |rule| {
            let (obstacle_m, clear_m) = rule.obstacle_and_clear_m();
            format!(
                "cells reported nearer than {obstacle_m} m in which only floor is nearer than \
                 {clear_m} m: true distances, so not false, and a robot without a filter stops \
                 for them"
            )
        }),
    near("near", "near obstacles", "all")
        .sum("near", Neither, Near(|own| own.near))
        .note_by_rule("all, unknown", |rule| {
            let (obstacle_m, _) = rule.obstacle_and_clear_m();
            format!(
                "near obstacles: cells of which a quarter is nearer than {obstacle_m} m and not \
                 floor (all), and those of them in which nothing is reported (unknown)"
            )
        }),
    near("near_unknown", "unknown near obstacles", "unknown, %")
        .part("unknown_obstacles", Less, Near(|own| own.near_unknown))
        .over(NEAR_OBSTACLES),
    pixels("coverage", "coverage", "cover")
        .mean("coverage", Neither, |facts| {
            Some(facts.estimate.disparity.coverage())
        })
        .without_truth()
        .plotted_at("coverage")
        .note("pixels with a disparity; fractions of pixels are means over the pairs")
        .headline(&[Disparities]),
    pixels("invalid", "invalid pixels", "invalid")
        .mean("invalid", Neither, |facts| facts.pixels?.invalid())
        .note("pixels without a disparity, of those with truth that both cameras see"),
    pixels("total_bad2", "pixels off > 2 px or invalid", ">2 or none")
        .mean("total_bad2", Less, |facts| facts.pixels?.total_bad2())
        .note(
            "pixels off by more than 2 px or without a disparity, of those with truth that both \
             cameras see: a pixel that is left out is no better than a wrong one",
        )
        .headline(&[Disparities]),
    pixels("bad1", "pixels off > 1 px", ">1 px")
        .mean("bad1", Less, |facts| facts.pixels?.bad1())
        .note_on(
            ">1 px, >2 px",
            "pixels with a larger error, of those with a disparity and with truth that both \
             cameras see",
        ),
    pixels("bad2", "pixels off > 2 px", ">2 px")
        .mean("bad2", Less, |facts| facts.pixels?.bad2())
        .headline(&[Disparities]),
    pixels("row_offset", "vertical misalignment", "vertical")
        .under("misalignment, px")
        .mean("row_offset", Zero, |facts| {
            facts.estimate.disparity.median_row_offset().map(f64::from)
        })
        .unit(Px, Zero)
        .without_truth()
        .plotted_at("row_offset")
        .note(
            "number of rows by which the right image is lower: the median over a pair's pixels, \
             the mean over the pairs; in whole rows, and only within row_tolerance: `svl \
             calibrate check` measures larger ones",
        ),
    late("right_late", "cells right on arrival", "right")
        .part("cells_right_late", More, Fact(|_| None))
        .note_on(
            "late",
            "cells of an answer that arrives --latency after its pair, by the truth at that time: \
             that of the two pairs around it, each by its part; of the cells with both truths",
        ),
    late("wrong_late", "cells wrong on arrival", "wrong").part(
        "cells_wrong_late",
        Less,
        Fact(|_| None),
    ),
    late("unknown_late", "cells unknown on arrival", "unknown").part(
        "cells_unknown_late",
        Neither,
        Fact(|_| None),
    ),
    estimated(
        "estimated_right",
        EstimatedNumber::Right,
        "estimated right cells",
        "right",
    )
    .unit(Share, More)
    .note_on(
        "estimated",
        "errors without truth, by how far a report is from v5's, in tolerances, and how sure \
             v5 is: wrong cells of the known ones, of those that v5 is sure of, and right cells of \
             all; \"at most\" is promised, \"about\" is not: docs/no-truth.md",
    ),
    estimated(
        "estimated_wrong",
        EstimatedNumber::Wrong,
        "estimated wrong cells",
        "wrong",
    )
    .unit(Share, Less),
    estimated(
        "estimated_sure_wrong",
        EstimatedNumber::SureWrong,
        "estimated wrong cells where v5 is sure",
        "sure, wrong",
    )
    .unit(Share, Less),
    way("phantom_way", "way with phantoms", "phantom way")
        .part("phantom_way_m", Less, Fact(|_| None))
        .over(WAY_M)
        .note_on(
            "phantoms",
            "cells reported nearer, by more than the tolerance, than what the body of --robot \
             drove through later (phantoms), of the reports in cells with such a bound; and metres \
             at whose pairs there are some, of those at whose pairs there are bounds (phantom \
             way): docs/no-truth.md",
        )
        .headline(SCORED),
    way("phantoms", "phantoms", "phantoms")
        .part("phantoms", Less, Fact(|_| None))
        .over(WAY_CELLS)
        .headline(SCORED),
    way("phantom_pairs", "pairs with phantoms", "pairs").mean("phantom_pairs", Less, |_| None),
    way("way_cells", "reports in cells with a free way", "cells").sum(
        "way_cells",
        Neither,
        Fact(|_| None),
    ),
    way("way_m", "metres at whose pairs cells have a free way", "m")
        .sum("way_m", Neither, Fact(|_| None))
        .unit(M, Neither),
    way("phantoms_of_v5", "phantoms that truth or v5 has", "v5, too").sum(
        "phantoms_of_v5",
        Neither,
        Fact(|_| None),
    ),
    way(
        "phantoms_of_body",
        "phantoms in cells of the own body",
        "own body",
    )
    .sum("phantoms_of_body", Neither, Fact(|_| None)),
    metric("reach", "reach of the narrowest test piece", "", "reach, m")
        .origin(MetricOrigin::Pieces { column: "reach_m" })
        .unit(M, More)
        .over(CaseKind::Items("run*"))
        .at_least(59, None)
        .note(
            "distance from which 95 % of the approaches to the narrowest test piece always see \
             it, with a confidence of 95 %: docs/reach.md",
        ),
    perturbed("same", "cells as unperturbed", "same")
        .part("cells_same", More, Fact(|_| None))
        .note_on(
            "perturbed",
            "cells that the same algorithm knows in the unperturbed pair: right by that answer in \
             place of a truth (same), wrong by it (changed), or unknown now (gone)",
        ),
    perturbed("changed", "cells other than unperturbed", "changed").part(
        "cells_changed",
        Less,
        Fact(|_| None),
    ),
    perturbed("gone", "cells known unperturbed alone", "gone").part(
        "cells_gone",
        Less,
        Fact(|_| None),
    ),
    filters("kept", "obstacles kept behind filters", "kept")
        .sum("kept_obstacles", More, Filtered(|own| own.kept))
        .over(BEHIND_FILTERS),
    filters("lost", "obstacles lost to filters", "lost %")
        .part("lost_obstacles", Less, Filtered(|own| own.lost))
        .over(BEHIND_FILTERS)
        .note_by_rule("kept, lost", |rule| {
            let (obstacle_m, _) = rule.obstacle_and_clear_m();
            format!(
                "cells with an obstacle nearer than {obstacle_m} m that are right without filters: \
                 right behind the filters, too (kept), or not (lost)"
            )
        }),
    filters(
        "close",
        "cells known to be nearer than the range",
        "close %",
    )
    .part("close_cells", More, Filtered(|own| own.close))
    .over(OUT_OF_RANGE)
    .note_on(
        "close, blind",
        "cells truly nearer than the range of disparities: reported as too close, or right \
             (close), or not (blind)",
    ),
    filters(
        "blind",
        "cells nearer than the range that are not known to be",
        "blind",
    )
    .sum("blind_cells", Less, Filtered(|own| own.blind))
    .over(OUT_OF_RANGE),
    filters(
        "alarms",
        "frames with a false alarm of too close",
        "alarms %",
    )
    .mean("false_alarms", Less, |facts| {
        facts.filtered.alarm.map(f64::from)
    })
    .note_by_rule("alarms", |rule| {
        let (obstacle_m, _) = rule.obstacle_and_clear_m();
        format!(
            "pairs with cells that are too close, none of which has an obstacle nearer than \
                 {obstacle_m} m"
        )
    }),
    error("bias", "bias of distances", "bias m")
        .number("bias_m", CellNumber::Bias)
        .unit(M, Zero)
        .note_on(
            "distance error",
            "of the cells with a reported and a true distance: the mean of reported minus true \
             (bias), the root of the mean square (RMSE), the median of the absolute error, and \
             the mean of absolute error over true distance (AbsRel); accuracy.csv has them by \
             range",
        ),
    error("rmse", "RMSE of distances", "RMSE m")
        .number("rmse_m", CellNumber::Rmse)
        .unit(M, Less),
    error("median_error", "median error of distances", "median m")
        .number("median_error_m", CellNumber::MedianError)
        .unit(M, Less),
    error("abs_rel", "mean relative error of distances", "AbsRel %")
        .number("abs_rel", CellNumber::AbsRel)
        .unit(Share, Less),
    error("error_cells", "cells with an error of distance", "cells")
        .number("error_cells", CellNumber::ErrorCells)
        .unit(Count, Neither)
        .at_least(0, None),
    over_time("noise", "noise of distances over time", "noise m")
        .number("noise_m", CellNumber::Noise)
        .unit(M, Less)
        .at_least(2, MIN_SHARE)
        .note_on(
            "over time",
            "of cells whose true distance changes by at most 1 % from an answer to the next: the \
             standard deviation of the error (noise), and the fraction that changes between known \
             and unknown or by more than the tolerance (flicker)",
        ),
    over_time("flicker", "flickering cells", "flicker %")
        .number("flicker", CellNumber::Flicker)
        .unit(Share, Less)
        .at_least(2, None),
    over_time("resting_cells", "cells at rest", "resting")
        .number("resting_cells", CellNumber::RestingCells)
        .unit(Count, Neither)
        .at_least(0, None),
    metric("scored_pairs", "scored pairs", "scored", "scored pairs")
        .sum("scored_pairs", Neither, Fact(|facts| facts.scored_pairs()))
        .at_least(0, None)
        .note_on(
            "scored",
            "pairs and cells with enough of a truth: all other numbers against truth are of these",
        ),
    metric("scored_cells", "scored cells", "scored", "scored cells")
        .sum("scored_cells", Neither, Fact(|facts| facts.scored_cells()))
        .at_least(0, None),
    metric("passed", "frames passed", "", "passed")
        .origin(MetricOrigin::Checkpoints)
        .unit(Share, More)
        .over(CaseKind::Items("frame*"))
        .without_truth()
        .headline(SCORED),
    metric("time", "median time", "ms per pair", "p50")
        .unit(Ms, Less)
        .without_truth()
        .headline(SCORED),
    drives("finished", "courses finished", "finished")
        .origin(MetricOrigin::Drives(DriveNumber::Finished))
        .unit(Share, More)
        .note("courses whose goal was reached without a collision and without help"),
    // No direction: a late course is one of those that were not finished.
    drives("late", "courses late", "late")
        .origin(MetricOrigin::Drives(DriveNumber::Late))
        .note(
            "courses whose goal was not reached within the scenario's pairs, with help or without",
        ),
    drives("collisions", "collisions", "hits/100 m")
        .origin(MetricOrigin::Drives(DriveNumber::Collisions))
        .unit(Per100M, Less)
        .over(METRES)
        .note("collisions per 100 m driven; after one the robot is set back on the route"),
    drives("near_misses", "near misses", "near/100 m")
        .origin(MetricOrigin::Drives(DriveNumber::NearMisses))
        .unit(Per100M, Less)
        .over(METRES)
        .note("clearances below the scenario's near_miss_m without a collision, per 100 m driven"),
    drives("driven", "metres driven", "driven m")
        .origin(MetricOrigin::Drives(DriveNumber::Driven))
        .unit(M, Neither)
        .note(
            "metres of the route that the robot drove itself, per course; what it drove twice \
             counts once, and where it was carried not at all",
        ),
];

/// Why a name is that of no metric, of none to judge by, or of no choice of metrics.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetricFault {
    /// The name, and a hint at the nearest one.
    #[error("there is no metric '{0}'{1}; `svl columns metrics` lists them")]
    Unknown(String, String),
    /// A heading, and the metrics that share it.
    #[error("'{0}' heads several columns; which of {1}?")]
    Shared(String, String),
    #[error("{0} is measured at each level of a perturbation: the table of --stress alone has it")]
    Perturbed(&'static str),
    #[error("'all' stands alone: it names every column")]
    All,
    #[error("the column {0} is named twice")]
    Twice(String),
}

impl Metric {
    pub fn find(name: &str) -> Option<&'static Self> {
        METRICS.iter().find(|metric| metric.name == name)
    }

    /// The metric, for gates, orders and comparisons.
    ///
    /// # Errors
    /// A metric that is measured at levels of stress alone.
    pub fn to_judge_by(&'static self) -> Result<&'static Self, MetricFault> {
        let is_one = self.group != PERTURBED;
        is_one
            .then_some(self)
            .ok_or(MetricFault::Perturbed(self.name))
    }

    /// The metric of that name, or of that heading in a table, `%` or not.
    ///
    /// # Errors
    /// One line with the nearest name, or those of the metrics that share the heading.
    pub fn named(name: &str) -> Result<&'static Self, MetricFault> {
        let plain = |text: &str| text.trim_end_matches(['%', ',', ' ']).to_owned();
        let is_headed = |metric: &&Self| {
            let has = |head: &str| plain(head) == plain(name);
            // The median time has the percentiles beside it.
            has(metric.head) || metric.name == "time" && has("p99")
        };
        if let Some(found) = Self::find(name) {
            return Ok(found);
        }
        // `unknown, %` is a heading of its own, and `unknown` the name of another metric.
        let mut exact = METRICS.iter().filter(|metric| metric.head == name);
        if let (Some(found), None) = (exact.next(), exact.next()) {
            return Ok(found);
        }
        let headed: Vec<_> = METRICS.iter().filter(is_headed).collect();
        match headed[..] {
            [found] => Ok(found),
            [] => Err(Self::unknown(name)),
            _ => {
                let names: Vec<_> = headed.iter().map(|metric| metric.name).collect();
                Err(MetricFault::Shared(name.to_owned(), names.join(", ")))
            }
        }
    }

    /// The error for a name of no metric.
    pub fn unknown(name: &str) -> MetricFault {
        let hint = did_you_mean(name, METRICS.iter().map(|metric| metric.name));
        MetricFault::Unknown(name.to_owned(), hint)
    }

    /// Column in rows and summary, with the aggregation; `None` if the metric is not per frame.
    pub fn column(&self) -> Option<(&'static str, MetricTotal)> {
        match self.origin {
            MetricOrigin::Frame { column, total, .. } => Some((column, total)),
            _ => None,
        }
    }

    /// Column in summaries; `None` if the metric has a table of its own.
    pub fn summary_column(&self) -> Option<&'static str> {
        match self.origin {
            MetricOrigin::Frame { column, .. }
            | MetricOrigin::Cells { column, .. }
            | MetricOrigin::Estimated { column, .. }
            | MetricOrigin::Pieces { column } => Some(column),
            _ => None,
        }
    }

    /// The number that it estimates without truth, if it does.
    pub fn estimated(&self) -> Option<EstimatedNumber> {
        match self.origin {
            MetricOrigin::Estimated { number, .. } => Some(number),
            _ => None,
        }
    }

    /// True if it may be negative.
    pub fn is_signed(&self) -> bool {
        self.better == Zero
    }

    /// True if the prior has it, and may be better or worse by it.
    pub fn is_of_prior(&self) -> bool {
        let is_of_cells = matches!(self.cases, SCORED_CELLS | NEAR_OBSTACLES);
        is_of_cells && self.against_truth && self.better != Neither
    }

    /// True if it has a value for an area; one of no area has it with the headline's.
    pub fn has_area(&self, area: AreaChoice) -> bool {
        self.by_area || area == AreaChoice::default()
    }

    /// The areas that it has a value for.
    pub fn areas(&self) -> impl Iterator<Item = AreaChoice> {
        AreaChoice::ALL
            .into_iter()
            .filter(|area| self.has_area(*area))
    }

    /// True if any frame of an algorithm can have it, without checkpoints and drives.
    pub fn is_of_frames(&self) -> bool {
        matches!(self.origin, MetricOrigin::Frame { .. } | MetricOrigin::Time)
    }

    pub fn is_of_drives(&self) -> bool {
        matches!(self.origin, MetricOrigin::Drives(_))
    }

    /// True if its column contains whole numbers, not parts of cells.
    pub fn counts(&self) -> bool {
        let share = |(_, total)| total == MetricTotal::Share && !self.is_of_motion();
        self.unit == Count || self.column().is_some_and(share)
    }

    /// True if it is of answers when they arrive, or of what the robot drove through.
    pub fn is_of_motion(&self) -> bool {
        [LATE, WAY].contains(&self.group)
    }

    /// The value of a frame as plotted in Rerun: fractions in per cent.
    pub fn plotted(&self, value: f64) -> f64 {
        match self.unit {
            Share if !self.counts() => 100.0 * value,
            _ => value,
        }
    }

    /// A value with its unit.
    pub fn show(&self, value: f64) -> String {
        match self.unit {
            Share => format!("{:.1} %", 100.0 * value),
            Count => format!("{value:.0}"),
            Px => format!("{value:.2} px"),
            M => format!("{value:.3} m"),
            Ms => format!("{value:.2} ms"),
            Per100M => format!("{value:.1} per 100 m"),
        }
    }

    /// Same as [`Metric::show`], for a time as a multiple of another.
    pub fn show_relative(&self, value: f64) -> String {
        match self.unit {
            Ms => format!("{value:.2}x"),
            _ => self.show(value),
        }
    }
}

impl Metric {
    /// True if a value that rests on these cases counts as measured.
    pub fn is_measured(&self, cases: &Cases, minimum: Minimum) -> bool {
        let has_share = |share: f64| {
            let cells = cases.cells.unwrap_or_default() as f64;
            let possible = cases.possible.unwrap_or_default() as f64;
            cells >= share * possible
        };
        cases.count(self.cases) >= minimum.cases && minimum.share.is_none_or(has_share)
    }

    /// The value, if it counts as measured.
    pub fn value_of(&self, own: Measured) -> Option<f64> {
        self.is_measured(&own.cases, self.minimum)
            .then_some(own.value)
    }

    /// The cases in words.
    pub fn cases_words(&self, cases: &Cases) -> String {
        let cells = cases.cells.unwrap_or_default();
        let possible = cases.possible.filter(|possible| *possible != cells);
        let cells = |words| match possible {
            Some(possible) => format!("{cells} of {}", counted(possible, words)),
            None => counted(cells, words),
        };
        match self.cases {
            CaseKind::Items(words) => counted(cases.items, words),
            CaseKind::Sum(_, words) | CaseKind::Errors(words) => cells(words),
            CaseKind::Changes(words) => {
                format!("{}, {}", counted(cases.items, "frame*"), cells(words))
            }
        }
    }

    /// A minimum in words.
    pub fn minimum_words(&self, minimum: Minimum) -> String {
        let words = match self.cases {
            CaseKind::Changes(_) => "frame*",
            CaseKind::Items(words) | CaseKind::Sum(_, words) | CaseKind::Errors(words) => words,
        };
        let share = minimum.share.map(|share| format!("{:.0} %", 100.0 * share));
        let count = (minimum.cases > 1 || share.is_none()).then(|| counted(minimum.cases, words));
        let parts: Vec<_> = count.into_iter().chain(share).collect();
        parts.join(" and ")
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

/// Number of metrics that have a value for each area.
const BY_AREA: usize = {
    let (mut count, mut i) = (0, 0);
    while i < METRICS.len() {
        count += METRICS[i].by_area as usize;
        i += 1;
    }
    count
};

/// Number of the places of values: the headline's by [`METRICS`], then those over floor, over what
/// is beyond and over all.
pub const PLACES: usize = METRICS.len() + 3 * BY_AREA;
const _: () = assert!(PLACES <= u128::BITS as usize);

/// Values of a frame or a run for the metrics of [`METRICS`] that have a column: those of areas for
/// each area, of which one is selected. Most are absent, and take no memory: a report has a row per
/// pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MetricValues {
    /// A bit per place that has a value.
    known: u128,
    /// The values, by their places.
    values: Vec<f64>,
    selected: AreaChoice,
}

impl MetricValues {
    /// One frame of one algorithm.
    pub fn from_facts(facts: &mut FrameFacts<'_>) -> Self {
        let mut values = Self::default();
        for area in AreaChoice::ALL {
            facts.area = area;
            for metric in METRICS.iter().filter(|metric| metric.has_area(area)) {
                if let MetricOrigin::Frame { value, .. } = metric.origin {
                    values.set_in(metric.name, area, facts.value(value));
                }
            }
        }
        values
    }

    /// The values at all [`PLACES`].
    pub fn from_places(value: impl Fn(usize) -> Option<f64>) -> Self {
        let mut own = Self::default();
        for place in 0..PLACES {
            let value = value(place);
            own.known |= u128::from(value.is_some()) << place;
            own.values.extend(value);
        }
        own
    }

    /// Values of the headline.
    pub fn from_fn(value: impl Fn(&'static Metric) -> Option<f64>) -> Self {
        let mut values = Self::default();
        for metric in METRICS {
            values.set(metric.name, value(metric));
        }
        values
    }

    /// Selects the area of the values that are read.
    pub fn select(&mut self, area: AreaChoice) {
        self.selected = area;
    }

    /// True if there is a value at a place, and its index in the values, or that where it belongs.
    fn find(&self, place: usize) -> (bool, usize) {
        let before = self.known & ((1 << place) - 1);
        (self.known >> place & 1 == 1, before.count_ones() as usize)
    }

    /// Sets the value of the headline.
    pub fn set(&mut self, name: &str, value: Option<f64>) {
        self.set_in(name, AreaChoice::default(), value);
    }

    pub fn set_in(&mut self, name: &str, area: AreaChoice, value: Option<f64>) {
        let place = value_place(name, area);
        let (is_known, index) = self.find(place);
        // A mean of no values is none.
        let value = value.filter(|value| !value.is_nan());
        self.values
            .splice(index..index + usize::from(is_known), value);
        self.known &= !(1 << place);
        self.known |= u128::from(value.is_some()) << place;
    }

    /// Sets the counts of all cells to the sums of the areas', once all values are set.
    pub fn add_up(&mut self) {
        for metric in METRICS.iter().filter(|metric| metric.by_area) {
            if metric.column().is_some() {
                let parts = AreaChoice::PARTS.iter();
                let parts = parts.filter_map(|area| self.get_in(metric.name, *area));
                let sum = parts.reduce(|a, b| a + b);
                self.set_in(metric.name, AreaChoice::All, sum);
            }
        }
        self.values.shrink_to_fit();
    }
}

impl MetricSource for MetricValues {
    fn area(&self) -> AreaChoice {
        self.selected
    }

    fn at(&self, place: usize) -> Option<f64> {
        let (is_known, index) = self.find(place);
        is_known.then(|| self.values[index])
    }
}

/// Values of metrics, wherever they are stored.
pub trait MetricSource {
    /// The area of the values that are read.
    fn area(&self) -> AreaChoice;

    /// The value at one of the [`PLACES`].
    fn at(&self, place: usize) -> Option<f64>;

    /// The value of its column, in the selected area.
    ///
    /// # Panics
    /// If no metric of [`METRICS`] has that name.
    fn get(&self, name: &str) -> Option<f64> {
        self.get_in(name, self.area())
    }

    /// The value of its column in an area; that of a metric of no area in all of them.
    ///
    /// # Panics
    /// Panics as [`Self::get`] does.
    fn get_in(&self, name: &str, area: AreaChoice) -> Option<f64> {
        self.at(value_place(name, area))
    }

    /// The number of the cases of a metric that counts them, in an area; those of a metric of no
    /// area are of all.
    fn whole_in(&self, metric: &Metric, area: AreaChoice) -> Option<f64> {
        let area = if metric.by_area {
            area
        } else {
            AreaChoice::All
        };
        match metric.cases {
            CaseKind::Sum(parts, _) => parts.iter().map(|part| self.get_in(part, area)).sum(),
            _ => None,
        }
    }

    /// The metric: its column, or the fraction it stands for; `None` if the denominator is 0.
    fn value(&self, metric: &Metric) -> Option<f64> {
        self.value_in(metric, self.area())
    }

    /// [`Self::value`] in an area.
    fn value_in(&self, metric: &Metric, area: AreaChoice) -> Option<f64> {
        let value = self.get_in(metric.name, area)?;
        match self.parts_in(metric, area) {
            // A frame with only unknown truths has cells, but none that could be right.
            Some([part, whole]) => (whole > 0.0).then(|| part / whole),
            None if matches!(metric.column(), Some((_, MetricTotal::Share))) => None,
            None => Some(value),
        }
    }

    /// The part and the whole of a share in an area; `None` of other metrics. Known cells are of
    /// the scored ones of the selected area, where cells are scored.
    fn parts_in(&self, metric: &Metric, area: AreaChoice) -> Option<[f64; 2]> {
        if metric.name == "known" {
            let counts = ["right", "wrong", "unknown"].map(|name| self.get(name));
            let [Some(right), Some(wrong), Some(unknown)] = counts else {
                return None;
            };
            return Some([right + wrong, right + wrong + unknown]);
        }
        let part = self.get_in(metric.name, area)?;
        let is_share = matches!(metric.column(), Some((_, MetricTotal::Share)));
        Some([part, self.whole_in(metric, area).filter(|_| is_share)?])
    }
}

/// The place of a metric in [`METRICS`].
fn place(name: &str) -> usize {
    let place = METRICS.iter().position(|metric| metric.name == name);
    place.expect("a metric of METRICS")
}

/// The place of a metric among those that have a value for each area; `None` for the others.
fn area_place(place: usize) -> Option<usize> {
    let before = || METRICS[..place].iter().filter(|metric| metric.by_area);
    METRICS[place].by_area.then(|| before().count())
}

/// The place of a metric's value in an area; that of a metric of no area is the same in all.
fn value_place(name: &str, area: AreaChoice) -> usize {
    let place = place(name);
    match area_place(place).zip((area as usize).checked_sub(1)) {
        Some((own, area)) => METRICS.len() + area * BY_AREA + own,
        None => place,
    }
}

impl<const N: usize> From<[(&str, f64); N]> for MetricValues {
    fn from(values: [(&str, f64); N]) -> Self {
        let mut metrics = Self::default();
        for (name, value) in values {
            metrics.set(name, Some(value));
        }
        metrics.add_up();
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
        for metric in METRICS {
            if let CaseKind::Sum(parts, _) = metric.cases {
                assert!(parts.iter().all(|part| Metric::find(part).is_some()));
            }
            let is_share = |(_, total)| total == MetricTotal::Share;
            assert!(
                !metric.column().is_some_and(is_share) || matches!(metric.cases, CaseKind::Sum(..))
            );
        }
    }

    #[test]
    fn every_heading_names_its_metric() {
        let named = Metric::named;
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
        assert_eq!(named("rigth").unwrap_err().to_string(), unknown);
    }

    #[test]
    fn a_value_of_an_area_is_read_where_the_area_is_selected() {
        let mut values = MetricValues::from([("right", 3.0), ("missed", 1.0)]);
        values.set_in("right", AreaChoice::Floor, Some(5.0));
        values.add_up();
        let selected = |area| {
            let mut values = values.clone();
            values.select(area);
            values
        };
        let right = |area| selected(area).get("right");
        let expected = [Some(3.0), Some(5.0), None, Some(8.0)];
        assert_eq!(AreaChoice::ALL.map(right), expected);
        // Near cells count in any area.
        let missed = |area| selected(area).get("missed");
        assert_eq!(AreaChoice::ALL.map(missed), [Some(1.0); 4]);
        // Nothing is measured where no cell is of the area.
        assert_eq!(values.get_in("wrong", AreaChoice::All), None);
        // A value that is taken away leaves the others.
        for none in [None, Some(f64::NAN)] {
            let mut fewer = values.clone();
            fewer.set("right", none);
            let left = [("right", AreaChoice::Floor), ("right", AreaChoice::All)];
            let left = left.map(|(name, area)| fewer.get_in(name, area));
            assert_eq!(left, [Some(5.0), Some(8.0)]);
            assert_eq!((fewer.get("right"), fewer.get("missed")), (None, Some(1.0)));
        }
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

    fn metric(name: &str) -> &'static Metric {
        Metric::find(name).unwrap()
    }

    #[test]
    fn fewer_cases_than_the_minimum_are_no_measurement() {
        let is_measured = |name: &str, items, cells, possible| {
            let cases = Cases {
                items,
                cells,
                possible,
            };
            metric(name).is_measured(&cases, metric(name).minimum)
        };
        for name in ["missed", "blind", "found", "right", "kept"] {
            assert!(!is_measured(name, 9, Some(0), None), "{name}");
            assert!(is_measured(name, 9, Some(1), None), "{name}");
        }
        for name in ["bias", "rmse", "median_error", "abs_rel"] {
            assert!(!is_measured(name, 9, Some(94), Some(100)), "{name}");
            assert!(is_measured(name, 9, Some(95), Some(100)), "{name}");
            assert!(!is_measured(name, 9, Some(0), Some(0)), "{name}");
        }
        for name in ["noise", "flicker"] {
            assert!(!is_measured(name, 1, Some(50), None), "{name}");
            assert!(is_measured(name, 2, Some(50), None), "{name}");
        }
        assert!(!is_measured("noise", 2, Some(9), Some(10)));
        assert!(!is_measured("coverage", 0, None, None) && is_measured("time", 1, None, None));
    }

    #[test]
    fn cases_have_words() {
        let words = |name: &str, items, cells, possible| {
            metric(name).cases_words(&Cases {
                items,
                cells,
                possible,
            })
        };
        assert_eq!(words("missed", 9, Some(1), None), "1 near obstacle");
        assert_eq!(words("right", 9, Some(20), None), "20 cells");
        assert_eq!(words("time", 9, None, None), "9 pairs");
        let known = "19 of 20 known cells with a finite truth";
        assert_eq!(words("rmse", 9, Some(19), Some(20)), known);
        assert_eq!(
            words("noise", 9, Some(20), Some(20)),
            "9 frames, 20 cells at rest"
        );
        let minimum = |name| metric(name).minimum_words(metric(name).minimum);
        assert_eq!(
            ["missed", "rmse", "flicker", "noise"].map(minimum),
            ["1 near obstacle", "95 %", "2 frames", "2 frames and 95 %"]
        );
    }
}
