//! The goal of a search: a metric as large or as small as possible, others within bounds.

use super::values::TrialValues;
use std::cmp::Ordering;
use std::str::FromStr;
use svl_core::{Error, Result};
use svl_score::judge::{Better, Metric, MetricUnit};

/// An objective with constraints.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    pub objective: &'static Metric,
    pub is_maximized: bool,
    pub constraints: Vec<Constraint>,
}

/// A bound of a metric, as `wrong<=3%`, `right>=0.7`, `bad2<=2%` or `time<=1.2x`.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    pub metric: &'static Metric,
    /// At most the bound; otherwise at least.
    pub is_upper: bool,
    pub bound: Bound,
    /// As it was written.
    pub text: String,
}

/// Limit of a metric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// In the unit of the metric; fractions are 0..=1.
    Value(f64),
    /// A multiple of what the reference setting has.
    Times(f64),
}

/// A metric of frames, or the time.
///
/// # Errors
/// [`Error::Usage`] with the nearest name.
pub(super) fn metric(name: &str) -> Result<&'static Metric> {
    // Agreement with others depends on the algorithms of the run.
    let can = |metric: &&Metric| metric.is_of_frames() && metric.name != "agreed";
    let Some(metric) = Metric::find(name) else {
        return Err(Error::Usage(Metric::unknown(name)));
    };
    Some(metric).filter(can).ok_or_else(|| {
        Error::Usage(format!(
            "'{name}' is not a metric to search by: it is not of single pairs and one algorithm"
        ))
    })
}

impl FromStr for Constraint {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = |why: &str| {
            Error::Usage(format!(
                "'{text}': {why}; write a bound as 'wrong<=3%', 'right>=0.7' or 'time<=1.2x'"
            ))
        };
        let split = |sign| text.split_once(sign);
        let (name, is_upper, bound) = match (split("<="), split(">=")) {
            (Some((name, bound)), _) => (name, true, bound),
            (None, Some((name, bound))) => (name, false, bound),
            (None, None) => return Err(wrong("has neither <= nor >=")),
        };
        let metric = metric(name.trim())?;
        let bound = bound.trim();
        let number = |text: &str| {
            let number = text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            number
                .filter(|v| *v >= 0.0)
                .ok_or_else(|| wrong("its bound is not a number"))
        };
        let bound = if let Some(times) = bound.strip_suffix('x') {
            Bound::Times(number(times)?)
        } else if let Some(percent) = bound.strip_suffix('%') {
            match metric.unit {
                MetricUnit::Share => Bound::Value(number(percent)? / 100.0),
                _ => return Err(wrong("only fractions are in per cent")),
            }
        } else {
            let bound = number(bound.trim_end_matches("ms").trim_end_matches("px"))?;
            if metric.unit == MetricUnit::Share && bound > 1.0 {
                return Err(wrong("a fraction is at most 1, or in per cent"));
            }
            Bound::Value(bound)
        };
        Ok(Self {
            metric,
            is_upper,
            bound,
            text: text.to_owned(),
        })
    }
}

impl Constraint {
    /// Amount by which the values exceed the bound, relative to it; 0 if they keep it. A metric
    /// that is not measured exceeds it.
    fn broken_by(&self, values: &TrialValues, reference: &TrialValues) -> f64 {
        let bound = match self.bound {
            Bound::Value(bound) => Some(bound),
            // Times are already of one run.
            Bound::Times(times) if self.metric.unit == MetricUnit::Ms => {
                reference.get(self.metric).map(|time| time * times)
            }
            Bound::Times(times) => reference.get(self.metric).map(|value| value * times),
        };
        let (Some(value), Some(bound)) = (values.get(self.metric), bound) else {
            return 1.0;
        };
        let over = if self.is_upper {
            value - bound
        } else {
            bound - value
        };
        // Equal to the bound up to the last digits is within it.
        if over > 1e-9 * bound.abs() {
            over / bound.abs().max(0.01)
        } else {
            0.0
        }
    }
}

impl Goal {
    /// # Errors
    /// As [`Constraint::from_str`], for the name of a metric that has a better direction.
    pub fn new(objective: &str, is_maximized: bool, constraints: Vec<Constraint>) -> Result<Self> {
        Ok(Self {
            objective: metric(objective)?,
            is_maximized,
            constraints,
        })
    }

    /// The default goal: most right cells if there is a truth, otherwise most cells that the images
    /// support, in at most one and a half times the time of the reference. With a truth, no more
    /// wrong cells, missed obstacles and cells nearer than the range of disparities: a smaller
    /// range is not better.
    ///
    /// # Errors
    /// None.
    pub fn by_default(has_truth: bool) -> Result<Self> {
        let (objective, bounds) = if has_truth {
            (
                "right",
                &[
                    "wrong<=1x",
                    "missed<=1x",
                    "found>=1x",
                    "blind<=1x",
                    "time<=1.5x",
                ][..],
            )
        } else {
            ("unrivalled", &["time<=1.5x"][..])
        };
        let constraints = bounds.iter().map(|bound| bound.parse());
        Self::new(objective, true, constraints.collect::<Result<_>>()?)
    }

    /// The metrics that the goal needs.
    pub fn metrics(&self) -> impl Iterator<Item = &'static Metric> {
        let constrained = self.constraints.iter().map(|constraint| constraint.metric);
        std::iter::once(self.objective).chain(constrained)
    }

    /// Sum of the amounts by which the constraints are exceeded; 0 if all are kept.
    pub fn violation(&self, values: &TrialValues, reference: &TrialValues) -> f64 {
        let constraints = self.constraints.iter();
        constraints.map(|c| c.broken_by(values, reference)).sum()
    }

    /// The better one first: by what breaks the constraints, then by the objective.
    pub fn compare(&self, a: &TrialValues, b: &TrialValues, reference: &TrialValues) -> Ordering {
        let broken = [a, b].map(|values| self.violation(values, reference));
        let values = [a, b].map(|values| {
            let value = values.get(self.objective);
            value.map(|value| if self.is_maximized { -value } else { value })
        });
        let by_objective = match values {
            [Some(a), Some(b)] => a.total_cmp(&b),
            [a, b] => b.is_some().cmp(&a.is_some()),
        };
        broken[0].total_cmp(&broken[1]).then(by_objective)
    }

    /// The goal in words.
    pub fn words(&self) -> String {
        let way = if self.is_maximized { "most" } else { "least" };
        let mut words = format!("{way} {}", self.objective.words);
        for (i, constraint) in self.constraints.iter().enumerate() {
            words += if i == 0 { " with " } else { ", " };
            words += &constraint.text;
        }
        words
    }

    /// True if the objective is optimized in the direction in which it is better.
    pub fn is_sensible(&self) -> bool {
        match self.objective.better {
            Better::More => self.is_maximized,
            Better::Less => !self.is_maximized,
            Better::Zero | Better::Neither => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(pairs: &[(&str, f64)]) -> TrialValues {
        let mut values = TrialValues::default();
        pairs
            .iter()
            .for_each(|(name, value)| values.set(name, Some(*value)));
        values
    }

    fn refused(text: &str) -> String {
        text.parse::<Constraint>().unwrap_err().to_string()
    }

    #[test]
    fn bounds_are_read_and_nonsense_is_named() {
        let bound = |text: &str| text.parse::<Constraint>().unwrap().bound;
        assert_eq!(bound("wrong<=3%"), Bound::Value(0.03));
        assert_eq!(bound("right >= 0.7"), Bound::Value(0.7));
        assert_eq!(bound("time<=1.2x"), Bound::Times(1.2));
        assert_eq!(bound("time<=4ms"), Bound::Value(4.0));
        assert_eq!(bound("missed<=0"), Bound::Value(0.0));
        assert!(refused("wrong=3%").contains("neither <= nor >="));
        assert!(refused("wrnog<=3%").contains("did you mean 'wrong'"));
        assert!(refused("wrong<=3").contains("at most 1, or in per cent"));
        assert!(refused("time<=3%").contains("only fractions"));
        assert!(refused("wrong<=much").contains("not a number"));
        assert!(refused("passed>=1").contains("not a metric to search by"));
    }

    #[test]
    fn constraints_come_before_the_objective() {
        let bounds = ["wrong<=5%", "time<=1.2x"].map(|bound| bound.parse().unwrap());
        let goal = Goal::new("right", true, bounds.to_vec()).unwrap();
        let reference = values(&[("right", 0.5), ("wrong", 0.04), ("time", 10.0)]);
        let better = values(&[("right", 0.6), ("wrong", 0.05), ("time", 12.0)]);
        let slow = values(&[("right", 0.9), ("wrong", 0.04), ("time", 12.1)]);
        let wrong = values(&[("right", 0.9), ("wrong", 0.50), ("time", 1.0)]);
        assert_eq!(goal.violation(&better, &reference), 0.0);
        let mut all = [&wrong, &slow, &reference, &better];
        all.sort_by(|a, b| goal.compare(a, b, &reference));
        assert!(std::ptr::eq(all[0], &better) && std::ptr::eq(all[1], &reference));
        assert!(std::ptr::eq(all[2], &slow) && std::ptr::eq(all[3], &wrong));
        // A metric that is not measured keeps no constraint.
        assert!(goal.violation(&values(&[("right", 1.0)]), &reference) > 1.0);
        assert_eq!(goal.words(), "most right cells with wrong<=5%, time<=1.2x");
    }
}
