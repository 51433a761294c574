//! The choice of metrics that tables show.

use super::{METRICS, Metric, MetricFault, MetricLevel, TruthLevel};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// Columns of the tables of algorithms; written `all`, or as names of metrics.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub enum ColumnChoice {
    /// The headline metrics of the kind of run.
    #[default]
    Headline,
    All,
    /// In this order.
    Named(Vec<&'static Metric>),
}

impl ColumnChoice {
    /// The metrics of a run of that kind, in the order of their columns.
    pub fn metrics(&self, kind: TruthLevel) -> Vec<&'static Metric> {
        let is_headline = |metric: &&Metric| match metric.level {
            MetricLevel::Headline(kinds) => kinds.contains(&kind),
            MetricLevel::Detail => false,
        };
        match self {
            Self::Headline => METRICS.iter().filter(is_headline).collect(),
            // Groups with a headline metric first; groups remain whole.
            Self::All => {
                let has_headline =
                    |group| METRICS.iter().any(|m| m.group == group && is_headline(&m));
                let mut metrics: Vec<_> = METRICS.iter().collect();
                metrics.sort_by_key(|metric| !has_headline(metric.group));
                metrics
            }
            Self::Named(metrics) => metrics.clone(),
        }
    }

    fn from_names(names: &[&str]) -> Result<Self, MetricFault> {
        if names == ["all"] {
            return Ok(Self::All);
        }
        if names.contains(&"all") {
            return Err(MetricFault::All);
        }
        let metrics = names.iter().map(|name| Metric::named(name));
        let metrics = metrics.collect::<Result<Vec<_>, _>>()?;
        let is_repeated = |i: usize| metrics[..i].contains(&metrics[i]);
        if let Some(i) = (0..metrics.len()).find(|&i| is_repeated(i)) {
            return Err(MetricFault::Twice(names[i].to_owned()));
        }
        if metrics.is_empty() {
            return Ok(Self::Headline);
        }
        Ok(Self::Named(metrics))
    }
}

impl FromStr for ColumnChoice {
    type Err = MetricFault;

    fn from_str(text: &str) -> Result<Self, MetricFault> {
        let names: Vec<_> = text.split(',').map(str::trim).collect();
        Self::from_names(&names)
    }
}

impl TryFrom<Vec<String>> for ColumnChoice {
    type Error = MetricFault;

    fn try_from(names: Vec<String>) -> Result<Self, MetricFault> {
        let names: Vec<_> = names.iter().map(String::as_str).collect();
        Self::from_names(&names)
    }
}

impl From<ColumnChoice> for Vec<String> {
    fn from(choice: ColumnChoice) -> Self {
        match choice {
            ColumnChoice::Headline => Vec::new(),
            ColumnChoice::All => vec!["all".to_owned()],
            ColumnChoice::Named(metrics) => metrics.iter().map(|m| m.name.to_owned()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_read_as_they_are_written() {
        for text in ["all", "right", "time,missed"] {
            let choice: ColumnChoice = text.parse().unwrap();
            assert_eq!(Vec::<String>::from(choice.clone()).join(","), text);
            assert_eq!(
                ColumnChoice::try_from(Vec::from(choice.clone())),
                Ok(choice)
            );
        }
        for text in ["", "right,right", "rigth", "all,right"] {
            assert!(text.parse::<ColumnChoice>().is_err(), "{text}");
        }
    }

    #[test]
    fn every_kind_of_run_has_headline_metrics() {
        use TruthLevel::{Courses, Disparities, Distances, NoTruth};
        let names = |kind| {
            ColumnChoice::Headline
                .metrics(kind)
                .iter()
                .map(|m| m.name)
                .collect()
        };
        let expect = |kind, expected: &[&str]| {
            let found: Vec<_> = names(kind);
            assert_eq!(found, expected, "{kind:?}");
        };
        let distances = [
            "right",
            "wrong",
            "unknown",
            "missed",
            "false",
            "found",
            "right_late",
            "wrong_late",
            "unknown_late",
            "phantom_way",
            "phantoms",
            "passed",
            "time",
        ];
        expect(Distances, &distances);
        expect(
            Disparities,
            &[
                "coverage",
                "total_bad2",
                "bad2",
                "right_late",
                "wrong_late",
                "unknown_late",
                "phantom_way",
                "phantoms",
                "passed",
                "time",
            ],
        );
        expect(
            Courses,
            &["finished", "late", "collisions", "near_misses", "driven"],
        );
        expect(
            NoTruth,
            &[
                "known",
                "estimated_right",
                "estimated_wrong",
                "estimated_sure_wrong",
                "phantom_way",
                "phantoms",
                "passed",
                "time",
            ],
        );
    }
}
