//! Limits that a run has to keep: what `svl score --gate` and a CI trust.

use super::summary::{AlgorithmSummary, Summary};
use crate::error::{Error, Result};
use crate::manifest::{Contestant, Manifest};
use crate::score::{METRICS, Metric, MetricOrigin, MetricUnit};
use serde::{Deserialize, Deserializer, Serialize};

/// A limit, as a scenario's `[[gate]]` says it.
///
/// Quality is limited absolutely. Time is limited as a ratio to another algorithm of the same run
/// (`relative_to`), as nobody knows the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// An algorithm as the run names it, or a bare name for it with any parameters.
    pub algorithm: String,
    #[serde(deserialize_with = "metric")]
    pub metric: &'static Metric,
    /// Of one checkpoint, by its number; `passed` without it is of all.
    pub checkpoint: Option<u32>,
    /// The algorithm whose median time is the unit.
    pub relative_to: Option<String>,
    /// At least; shares are 0..=1.
    pub min: Option<f64>,
    /// At most.
    pub max: Option<f64>,
    /// Line of the scenario file.
    #[serde(skip_deserializing)]
    pub line: usize,
}

/// The metric of that name.
fn metric<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<&'static Metric, D::Error> {
    let name = String::deserialize(deserializer)?;
    Metric::find(&name).ok_or_else(|| {
        let names: Vec<_> = METRICS.iter().map(|metric| metric.name).collect();
        let names = names.join(", ");
        serde::de::Error::custom(format!("unknown metric '{name}': expected one of {names}"))
    })
}

/// What a limit says of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GateResult {
    pub limit: Limit,
    /// The algorithm that was judged; nothing when none that it is for took part.
    pub algorithm: Option<String>,
    /// Nothing where the run does not measure it.
    pub value: Option<f64>,
    /// Nothing when it could not be judged because an algorithm did not take part.
    pub kept: Option<bool>,
}

impl Limit {
    /// # Errors
    /// [`Error::Invalid`] with what contradicts itself.
    pub fn validate(&self) -> Result<()> {
        let wrong = |what: &str| {
            Err(Error::Invalid(format!(
                "gate in line {}: {what}",
                self.line
            )))
        };
        let bounds = [self.min, self.max];
        match self {
            _ if bounds == [None, None] => wrong("needs min or max"),
            _ if bounds
                .iter()
                .flatten()
                .any(|bound| !bound.is_finite() || *bound < 0.0) =>
            {
                wrong("min and max are numbers, 0 or more")
            }
            _ if self.metric.unit == MetricUnit::Share
                && bounds.iter().flatten().any(|bound| *bound > 1.0) =>
            {
                wrong("a share is 0..=1, so 5 % is 0.05")
            }
            Self {
                min: Some(min),
                max: Some(max),
                ..
            } if min > max => wrong("min is above max"),
            Self {
                metric,
                relative_to: None,
                ..
            } if metric.unit == MetricUnit::Ms => {
                wrong("time is judged as a ratio: name another algorithm with relative_to")
            }
            Self {
                algorithm,
                relative_to: Some(other),
                ..
            } if algorithm == other => {
                wrong("relative_to names the algorithm itself: name another")
            }
            Self {
                metric,
                relative_to: Some(_),
                ..
            } if metric.unit != MetricUnit::Ms => {
                wrong("relative_to belongs to metric = \"time\"; quality has absolute limits")
            }
            Self {
                metric,
                checkpoint: Some(_),
                ..
            } if !matches!(metric.origin, MetricOrigin::Checkpoints) => {
                wrong("checkpoint belongs to metric = \"passed\"")
            }
            _ => Ok(()),
        }
    }

    /// Judges a run; one result for every algorithm that the limit is for.
    pub fn judge(&self, summary: &Summary, manifest: &Manifest) -> Vec<GateResult> {
        let is = |a: &&Contestant, name: &str| a.label == name || a.name == name;
        let unit = self
            .relative_to
            .as_deref()
            .map(|name| manifest.algorithms.iter().find(|a| is(a, name)));
        let result = |contestant: &Contestant| {
            let found = |contestant: &Contestant| {
                summary
                    .algorithms
                    .iter()
                    .find(|a| a.algorithm == contestant.label)
            };
            let value = match unit {
                None => found(contestant).and_then(|of| self.value(of, summary)),
                Some(None) => None,
                Some(Some(unit)) => found(contestant)
                    .zip(found(unit))
                    .map(|(of, unit)| of.p50_ms / unit.p50_ms),
            };
            let keeps =
                |v: f64| self.min.is_none_or(|min| v >= min) && self.max.is_none_or(|max| v <= max);
            let absent = matches!(unit, Some(None));
            let kept = (!absent).then(|| value.is_some_and(keeps));
            GateResult {
                limit: self.clone(),
                algorithm: Some(contestant.label.clone()),
                value,
                kept,
            }
        };
        let results: Vec<_> = manifest
            .algorithms
            .iter()
            .filter(|a| is(a, &self.algorithm))
            .map(result)
            .collect();
        let nobody = || {
            vec![GateResult {
                limit: self.clone(),
                algorithm: None,
                value: None,
                kept: None,
            }]
        };
        if results.is_empty() {
            nobody()
        } else {
            results
        }
    }

    fn value(&self, of: &AlgorithmSummary, summary: &Summary) -> Option<f64> {
        if !matches!(self.metric.origin, MetricOrigin::Checkpoints) {
            return of.value(self.metric);
        }
        let visited = summary
            .checkpoints
            .iter()
            .filter(|c| c.algorithm == of.algorithm);
        let visited =
            visited.filter(|c| self.checkpoint.is_none_or(|number| c.checkpoint == number));
        let (frames, passed) = visited.fold((0, 0), |(frames, passed), c| {
            (frames + c.frames, passed + c.passed)
        });
        (frames > 0).then(|| passed as f64 / frames as f64)
    }
}

impl std::fmt::Display for GateResult {
    /// One line: who, what, how much, and what is allowed.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Limit {
            algorithm,
            metric,
            checkpoint,
            relative_to,
            min,
            max,
            line,
        } = &self.limit;
        write!(
            f,
            "{}: {}",
            self.algorithm.as_ref().unwrap_or(algorithm),
            metric.words
        )?;
        if let Some(number) = checkpoint {
            write!(f, " at checkpoint {number}")?;
        }
        if let Some(other) = relative_to {
            write!(f, " in units of {other}'s")?;
        }
        match (self.kept, self.value) {
            (None, _) => f.write_str(" is not judged, as not all of its algorithms took part")?,
            (_, None) => f.write_str(" is not measured in this run")?,
            (_, Some(value)) => {
                // Rounded to the bound itself it would not be seen to break it.
                let hidden = [min, max].into_iter().flatten().any(|b| {
                    *b != value && metric.show_relative(*b) == metric.show_relative(value)
                });
                match (hidden, metric.unit == MetricUnit::Share) {
                    (true, true) => write!(f, " {:.4} %", 100.0 * value)?,
                    _ => write!(f, " {}", metric.show_relative(value))?,
                }
            }
        }
        let bounds = [("at least", min), ("at most", max)]
            .map(|(words, bound)| bound.map(|b| (words, metric.show_relative(b))));
        for (i, (words, bound)) in bounds.into_iter().flatten().enumerate() {
            write!(f, "{} {words} {bound}", if i == 0 { "," } else { " and" })?;
        }
        write!(f, " (line {line})")
    }
}
