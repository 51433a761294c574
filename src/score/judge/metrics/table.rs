//! The table of metrics.

use super::super::measured::{CaseKind, Minimum};
use super::kinds::Better::{Less, More, Neither, Zero};
use super::kinds::FrameValue::{Cells, Fact, Filtered, Near};
use super::kinds::MetricUnit::{Count, M, Ms, Per100M, Px, Share};
use super::kinds::TruthLevel::{Courses, Disparities, Distances, NoTruth};
use super::kinds::{
    Better, CellNumber, DriveNumber, EstimatedNumber, FactValue, FrameValue, Metric, MetricLevel,
    MetricNote, MetricOrigin, MetricTotal, MetricUnit, TruthLevel,
};
use svl_core::stereo::CellRule;

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

pub(super) const SCORED_CELLS: CaseKind = CaseKind::Sum(&["right", "wrong", "unknown"], "cell*");
pub(super) const NEAR_OBSTACLES: CaseKind = CaseKind::Sum(&["near"], "near obstacle*");
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
pub(super) const PERTURBED: &str = "perturbed, %";

/// Group of the cells of answers when they arrive.
pub(super) const LATE: &str = "late, %";

/// Group of the reports nearer than what the robot drove through.
pub(super) const WAY: &str = "way, %";

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
