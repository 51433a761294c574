//! A limit of a run's metrics: an entry of `[[gate]]`.

use super::DistanceRange;
use crate::judge::{AreaChoice, METRICS, Metric, MetricOrigin, MetricUnit, Minimum};
use serde::{Deserialize, Deserializer, Serialize};
use svl_core::matcher::Algorithm;
use svl_core::{Error, Result, joined};

/// A limit of a metric: an entry of a scenario's `[[gate]]`.
///
/// Quality has absolute limits. Time is limited as a ratio to another algorithm of the same run
/// (`relative_to`), as absolute times depend on the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// Label of an algorithm of the run, or only its name for any parameters.
    pub algorithm: String,
    #[serde(deserialize_with = "metric")]
    pub metric: &'static Metric,
    /// Number of a checkpoint; `passed` without it covers all.
    pub checkpoint: Option<u32>,
    /// The cells that a metric of scored cells is of, in place of the headline's.
    pub area: Option<AreaChoice>,
    /// The true distances that errors and shares of cells are of, in place of all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<DistanceRange>,
    /// The algorithm whose median time is the unit; or [`PRIOR`], whose value is subtracted.
    pub relative_to: Option<String>,
    /// Lower limit; fractions are 0..=1.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
    /// Upper limit of the magnitude, of a metric that may be negative.
    pub max_magnitude: Option<f64>,
    /// The fewest cases, in place of the metric's.
    pub min_cases: Option<u64>,
    /// The smallest share of the cells that could have had a value, in place of the metric's.
    pub min_share: Option<f64>,
    /// Line of the scenario file.
    #[serde(skip)]
    pub line: usize,
}

/// The name of what looks at nothing, in limits, tables and comparisons.
pub const PRIOR: &str = "prior";
/// The name of the distances by which cells are scored, likewise.
pub const EXACT: &str = "exact";
/// The name of the algorithm by which errors are estimated where there is no truth: it is in no
/// table.
pub const WITNESS: &str = "witness";

/// The witness: v5, asked in every cell.
///
/// # Panics
/// Never: svl has v5.
pub fn witness() -> Algorithm {
    let witness: Algorithm = "v5:confidence=0.001".parse().expect("svl has v5");
    witness.called(WITNESS.to_owned())
}

/// True for an algorithm of that name that the witness cannot judge: it is the same matcher.
pub fn is_of_witness(name: &str) -> bool {
    witness().spec().name == name
}

/// Parses the name of a metric.
fn metric<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<&'static Metric, D::Error> {
    let name = String::deserialize(deserializer)?;
    let metric = Metric::find(&name).ok_or_else(|| Metric::unknown(&name));
    let metric = metric.and_then(Metric::to_judge_by);
    metric.map_err(serde::de::Error::custom)
}

/// The names of the metrics of which that is true.
fn names(has: impl Fn(&Metric) -> bool) -> String {
    let own = METRICS.iter().filter(|metric| has(metric));
    joined(own.map(|metric| metric.name))
}

/// True for a metric that is known by range of the true distance.
fn has_ranges(metric: &Metric) -> bool {
    let shares = ["right", "wrong", "unknown", "known"];
    matches!(metric.origin, MetricOrigin::Cells { .. }) || shares.contains(&metric.name)
}

impl Limit {
    /// The limit with its algorithms renamed.
    pub(super) fn renamed(self, name: &dyn Fn(&str) -> String) -> Self {
        Self {
            algorithm: name(&self.algorithm),
            relative_to: self.relative_to.as_deref().map(name),
            ..self
        }
    }

    /// The lower and the upper limit.
    pub fn bounds(&self) -> [Option<f64>; 2] {
        match self.max_magnitude {
            Some(most) => [Some(-most), Some(most)],
            None => [self.min, self.max],
        }
    }

    /// The fewest cases; with fewer the metric is not measured.
    pub fn minimum(&self) -> Minimum {
        let Minimum { cases, share } = self.metric.minimum;
        Minimum {
            cases: self.min_cases.unwrap_or(cases),
            share: self.min_share.or(share),
        }
    }

    /// The least and the largest number that is possible.
    fn range(&self) -> [f64; 2] {
        let most = match self.metric.unit {
            MetricUnit::Share => 1.0,
            _ => f64::INFINITY,
        };
        let is_signed = self.metric.is_signed() || self.relative_to.as_deref() == Some(PRIOR);
        [if is_signed { -most } else { 0.0 }, most]
    }

    /// The fault of a bound that means nothing: one outside the range, or one that cannot fail.
    fn fault(&self) -> Option<String> {
        let [least, most] = self.range();
        let is_share = self.metric.unit == MetricUnit::Share;
        let range = if is_share {
            format!("a share, {least} to {most}")
        } else if least == 0.0 {
            "a number, 0 or more".to_owned()
        } else {
            "a number".to_owned()
        };
        let [min, max] = [("min", self.min), ("max", self.max)];
        let magnitude = ("max_magnitude", self.max_magnitude);
        let kept = [(min, least), (max, most), (magnitude, most)];
        kept.into_iter().find_map(|((key, bound), end)| {
            let bound = bound?;
            let is_outside = !bound.is_finite() || bound < least || bound > most;
            let percent = if !is_share {
                String::new()
            } else if is_outside {
                ", so 5 % is 0.05".to_owned()
            } else {
                ", 1 % is 0.01".to_owned()
            };
            if key == magnitude.0 && bound <= 0.0 {
                Some(format!("{key} = {bound}: expected a number above 0"))
            } else if is_outside {
                Some(format!("{key} = {bound}: expected {range}{percent}"))
            } else {
                let words = format!("{key} = {bound}: {range}: {bound} is always kept{percent}");
                (bound == end).then_some(words)
            }
        })
    }

    /// The fault of a minimum of cases that means nothing.
    fn minimum_fault(&self) -> Option<String> {
        let is_share = |share: f64| share > 0.0 && share <= 1.0;
        // The largest whole number of TOML.
        if self.min_cases.is_some_and(|cases| cases > i64::MAX as u64) {
            Some(format!("min_cases: expected 1 to {}", i64::MAX))
        } else if self.min_cases == Some(0) {
            Some("min_cases = 0: expected 1 or more, or nothing is measured and passes".to_owned())
        } else if let Some(share) = self.min_share.filter(|share| !is_share(*share)) {
            Some(format!(
                "min_share = {share}: expected a share, above 0 and up to 1"
            ))
        } else if self.min_share.is_some() && self.metric.minimum.share.is_none() {
            let own = names(|metric| metric.minimum.share.is_some());
            Some(format!("min_share belongs to {own}; here give min_cases"))
        } else {
            None
        }
    }

    /// The fault of keys that contradict each other, or that the metric has no use for.
    fn contradiction(&self) -> Option<String> {
        let (metric, other) = (self.metric, self.relative_to.as_deref());
        let is_time = metric.unit == MetricUnit::Ms;
        let has_magnitude = self.max_magnitude.is_some();
        let needs_both = metric.is_signed() && other.is_none() && !has_magnitude;
        let is_reversed = self.min.zip(self.max).is_some_and(|(min, max)| min > max);
        let fault: &str = if self.bounds() == [None, None] {
            "needs min or max"
        } else if has_magnitude && !metric.is_signed() {
            let own = names(Metric::is_signed);
            &format!("max_magnitude belongs to {own}; here give max")
        } else if has_magnitude && self.min.or(self.max).is_some() {
            "max_magnitude stands alone: leave min and max out"
        } else if needs_both && self.min.is_none() {
            "max alone: give min too, or max_magnitude"
        } else if needs_both && self.max.is_none() {
            "min alone: give max too, or max_magnitude"
        } else if is_reversed {
            "min is above max"
        } else if is_time && other.is_none() {
            "time is limited as a ratio: name another algorithm with relative_to"
        } else if other == Some(self.algorithm.as_str()) {
            "relative_to names the algorithm itself: name another"
        } else if !is_time && other.is_some_and(|other| other != PRIOR) {
            "relative_to belongs to metric = \"time\"; quality has absolute limits, or is relative \
             to \"prior\""
        } else if other == Some(PRIOR) && !metric.is_of_prior() {
            let own = names(Metric::is_of_prior);
            &format!("relative_to = \"prior\" belongs to {own}")
        } else if let Some(end) = self.unpromised() {
            end
        } else if self.area.is_some() && !metric.by_area {
            &format!("area belongs to {}", names(|metric| metric.by_area))
        } else if self.range.is_some() && !has_ranges(metric) {
            &format!("range belongs to {}", names(has_ranges))
        } else if self.checkpoint.is_some() && !matches!(metric.origin, MetricOrigin::Checkpoints) {
            "checkpoint belongs to metric = \"passed\""
        } else {
            return None;
        };
        Some(fault.to_owned())
    }

    /// The fault of a limit on the end of an estimate that is not promised.
    fn unpromised(&self) -> Option<&'static str> {
        if self.metric.estimated()?.is_of_right() {
            let fault = "estimated_right is promised at its low end alone: give min, not max";
            self.max.map(|_| fault)
        } else {
            let fault = "wrong cells are promised at their high end alone: give max, not min";
            self.min.map(|_| fault)
        }
    }

    /// # Errors
    /// [`Error::Invalid`] for contradictions, with the line.
    pub fn validate(&self) -> Result<()> {
        let fault = self.fault().or_else(|| self.minimum_fault());
        let line = self.line;
        match fault.or_else(|| self.contradiction()) {
            Some(fault) => Err(Error::Invalid(format!("gate in line {line}: {fault}"))),
            None => Ok(()),
        }
    }
}
