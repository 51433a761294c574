//! Metrics by their names, and their values in words.

use super::super::AreaChoice;
use super::super::measured::{CaseKind, Cases, Measured, Minimum, counted};
use super::kinds::Better::{Neither, Zero};
use super::kinds::MetricUnit::{Count, M, Ms, Per100M, Px, Share};
use super::kinds::{EstimatedNumber, Metric, MetricOrigin, MetricTotal, TruthLevel};
use super::table::{LATE, METRICS, NEAR_OBSTACLES, PERTURBED, SCORED_CELLS, WAY};
use serde::{Serialize, Serializer};
use svl_core::did_you_mean;

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
