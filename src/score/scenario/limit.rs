//! A limit of a run's metrics: an entry of `[[gate]]`.

use crate::judge::{AreaChoice, METRICS, Metric, MetricOrigin, MetricUnit};
use serde::{Deserialize, Deserializer, Serialize};
use svl_core::{Error, Result};

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
    /// The algorithm whose median time is the unit; or [`PRIOR`], whose value is subtracted.
    pub relative_to: Option<String>,
    /// Lower limit; fractions are 0..=1.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
    /// Line of the scenario file.
    #[serde(skip)]
    pub line: usize,
}

/// The name of what looks at nothing, in limits, tables and comparisons.
pub const PRIOR: &str = "prior";

/// Parses the name of a metric.
fn metric<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<&'static Metric, D::Error> {
    let name = String::deserialize(deserializer)?;
    Metric::find(&name).ok_or_else(|| serde::de::Error::custom(Metric::unknown(&name)))
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

    /// True if its numbers may be negative: a bias, or the difference to the prior.
    fn is_signed(&self) -> bool {
        self.metric.is_signed() || self.relative_to.as_deref() == Some(PRIOR)
    }

    /// # Errors
    /// [`Error::Invalid`] for contradictions, with the line.
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
                .any(|bound| !bound.is_finite() || *bound < 0.0 && !self.is_signed()) =>
            {
                wrong("min and max are numbers, 0 or more")
            }
            _ if self.metric.unit == MetricUnit::Share
                && bounds.iter().flatten().any(|bound| *bound > 1.0) =>
            {
                wrong("a fraction is 0..=1, so 5 % is 0.05")
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
                wrong("time is limited as a ratio: name another algorithm with relative_to")
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
                relative_to: Some(other),
                ..
            } if metric.unit != MetricUnit::Ms && other != PRIOR => wrong(
                "relative_to belongs to metric = \"time\"; quality has absolute limits, or is \
                 relative to \"prior\"",
            ),
            Self {
                metric,
                relative_to: Some(other),
                ..
            } if other == PRIOR && !metric.against_truth => {
                wrong("the prior has only metrics against truth")
            }
            Self {
                metric,
                area: Some(_),
                ..
            } if !metric.by_area => {
                let own = METRICS.iter().filter(|metric| metric.by_area);
                let own: Vec<_> = own.map(|metric| metric.name).collect();
                wrong(&format!("area belongs to {}", own.join(", ")))
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
}
