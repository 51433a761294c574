//! Values with the cases that they rest on: one rule for what is not measured, for metrics, gates and
//! comparisons.

use super::Metric;
use serde::Serialize;

/// The cases of a metric; `*` in their words is the plural.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CaseKind {
    /// Pairs, frames of a checkpoint, or courses that have a value.
    Items(&'static str),
    /// The sum of these metrics, over the cells of the metric's area or of all.
    Sum(&'static [&'static str], &'static str),
    /// Cells with an error of distance, of those that are known and have a finite true distance.
    Errors(&'static str),
    /// Frames that follow another one, with the changes of their cells at rest.
    Changes(&'static str),
}

/// The fewest cases of a value; with fewer it is not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Minimum {
    /// Number of cases; of changes that of the frames.
    pub cases: u64,
    /// Share of the cells that could have had a value, of metrics that leave some of them out.
    pub share: Option<f64>,
}

impl Minimum {
    pub const ONE: Self = Self {
        cases: 1,
        share: None,
    };
}

/// The cases that a value rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cases {
    /// Pairs, frames or courses with a value.
    pub items: u64,
    /// Cells or obstacles; absent of metrics whose cases are the items.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<u64>,
    /// The cells that could have had a value, of metrics that leave some of them out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<u64>,
}

/// A value, and the cases that it rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub cases: Cases,
}

impl Cases {
    pub fn items(items: u64) -> Self {
        Self {
            items,
            ..Self::default()
        }
    }

    /// Those of a metric without a value.
    pub fn none() -> Self {
        Self {
            cells: Some(0),
            ..Self::default()
        }
    }

    /// The number that a minimum limits.
    fn count(&self, kind: CaseKind) -> u64 {
        match kind {
            CaseKind::Items(_) | CaseKind::Changes(_) => self.items,
            CaseKind::Sum(..) | CaseKind::Errors(_) => self.cells.unwrap_or_default(),
        }
    }
}

impl Metric {
    /// True if a value that rests on these cases counts as measured.
    pub fn is_measured(&self, cases: &Cases, minimum: Minimum) -> bool {
        let has_share = |share: f64| {
            let cells = cases.cells.unwrap_or_default() as f64;
            cases.of.is_none_or(|of| cells >= share * of as f64)
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
        let of = cases.of.filter(|of| *of != cells);
        let cells = |words| match of {
            Some(of) => format!("{cells} of {}", counted(of, words)),
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

fn counted(count: u64, words: &str) -> String {
    format!(
        "{count} {}",
        words.replace('*', if count == 1 { "" } else { "s" })
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn metric(name: &str) -> &'static Metric {
        Metric::find(name).unwrap()
    }

    #[test]
    fn fewer_cases_than_the_minimum_are_no_measurement() {
        let is_measured = |name: &str, items, cells, of| {
            let cases = Cases { items, cells, of };
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
        let words =
            |name: &str, items, cells, of| metric(name).cases_words(&Cases { items, cells, of });
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
