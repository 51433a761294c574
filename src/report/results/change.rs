//! The one test: the change of each metric from some rows to others of the same pairs, its
//! interval, and which of those that decide are real.

use crate::rows::held::RowRef;
use crate::rows::samples::{self, runs, sample_in};
use crate::subjects::accuracy::{PairErrors, RangeErrors};
use serde::Serialize;
use svl_score::bootstrap::{Interval, RunLengths, Sample};
use svl_score::holm;
use svl_score::judge::{
    AreaChoice, Better, Cases, ColumnChoice, METRICS, Measured, Metric, MetricOrigin,
    MetricSource as _, MetricUnit, TruthLevel,
};

/// A number in both reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<CheckpointName>,
    pub metric: &'static Metric,
    pub base: f64,
    pub other: f64,
    /// `other - base`; of times `other / base`; of a metric that is best at 0 the change of its
    /// magnitude.
    pub difference: f64,
    /// 95 % interval of the difference; absent for too few pairs or frames.
    pub interval: Option<Interval>,
    /// The probability of a difference as large by chance, where there is an interval or a test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p: Option<f64>,
    /// The cases that the two numbers rest on.
    pub cases: Option<[Cases; 2]>,
    /// The number of the exact distances, where it need not be perfect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exact: Option<f64>,
    pub judgement: Judgement,
}

/// A metric with too few cases in a report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotMeasured {
    pub metric: &'static Metric,
    /// The cases in the two reports; `None` without a value.
    pub cases: [Option<Cases>; 2],
}

/// The checkpoint of a change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckpointName {
    pub checkpoint: u32,
    pub name: String,
}

/// Significance of a difference, and its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judgement {
    /// The results are equal.
    Equal,
    /// The interval contains 0.
    Unclear,
    /// There is no interval: too few independent pairs, or frames of a checkpoint, have a value.
    TooFew,
    Better,
    Worse,
    /// The interval excludes 0, but neither direction is better.
    Differs,
    /// Times, which vary with the machine, and metrics of reports that were scored differently.
    Unjudged,
}

/// The changes of metrics from rows to other rows of the same pairs, one to one, those of a run
/// beside each other.
pub fn changes(
    base: &[RowRef<'_>],
    other: &[RowRef<'_>],
    metrics: impl IntoIterator<Item = &'static Metric>,
) -> Vec<Change> {
    let area = base.first().map(|row| row.metrics().area());
    let runs = runs(base);
    let area = area.unwrap_or_default();
    Changes::over([base, other], None, area, &runs, metrics).measured
}

/// The changes of numbers of all pairs together, of which no test tells if they are chance: errors
/// that are estimated, the reach of test pieces. `measured`: a metric's value of either side.
pub fn untested_changes(
    measured: impl Fn(&'static Metric, usize) -> Option<Measured>,
) -> Vec<Change> {
    let change = |metric: &'static Metric| {
        let [base, other] = [measured(metric, 0)?, measured(metric, 1)?];
        let values = [metric.value_of(base)?, metric.value_of(other)?];
        Some(Change {
            cases: Some([base.cases, other.cases]),
            judgement: Judgement::Unjudged,
            ..Change::new(metric, values, values[1] - values[0], None)
        })
    };
    METRICS.iter().filter_map(change).collect()
}

/// The verdict between two algorithms over the same pairs: the [`changes`] of the metrics that
/// decide, tested at once.
pub(crate) fn verdict(base: &[RowRef<'_>], other: &[RowRef<'_>]) -> Vec<Change> {
    let mut changes = changes(base, other, METRICS.iter().filter(|own| is_ranked(own)));
    let metrics = deciding(&changes);
    changes.retain(|change| metrics.contains(&change.metric));
    if base
        .iter()
        .zip(other)
        .any(|(a, b)| a.result_hash() != b.result_hash())
    {
        changes.iter_mut().for_each(Change::doubt_equality);
    }
    decide(changes.iter_mut());
    changes
}

/// The metrics that decide: those of the headline with a better direction, but checkpoints and
/// times.
pub(crate) fn deciding(changes: &[Change]) -> Vec<&'static Metric> {
    let has = |name: &str| changes.iter().any(|change| change.metric.name == name);
    let mut metrics = ColumnChoice::Headline.metrics(TruthLevel::from_measured(has));
    metrics.retain(|metric| is_ranked(metric));
    metrics
}

/// Judges changes that decide, all at once, with Holm's correction; returns the number of tests.
pub(crate) fn decide<'a>(changes: impl Iterator<Item = &'a mut Change>) -> usize {
    let has_test = |own: &Change| ![Judgement::Equal, Judgement::TooFew].contains(&own.judgement);
    let tests = changes.filter(|change| has_test(change));
    let (p, tests): (Vec<_>, Vec<_>) = tests.filter_map(|own| Some((own.p?, own))).unzip();
    for (change, is_real) in tests.into_iter().zip(holm::are_real(&p)) {
        let is_more = change.difference > 0.0;
        change.judgement = Judgement::new(change.metric.better, Some(is_real), is_more);
    }
    p.len()
}

/// Largest difference of two equal sums in another order, of the sums.
const MAX_ROUNDING: f64 = 1e-12;

/// The changes of the metrics in an area, and the metrics that one of the two does not measure.
#[derive(Default)]
pub(crate) struct Changes {
    pub(crate) measured: Vec<Change>,
    pub(crate) not_measured: Vec<NotMeasured>,
}

impl Changes {
    /// `errors`: those of distances in the pairs of both, if both have cells.
    pub(crate) fn over(
        rows: [&[RowRef<'_>]; 2],
        errors: Option<&[Vec<PairErrors>; 2]>,
        area: AreaChoice,
        runs: &RunLengths,
        metrics: impl IntoIterator<Item = &'static Metric>,
    ) -> Self {
        let totals = rows.map(samples::totals);
        let accuracy = errors.map(|both| both.each_ref().map(|own| RangeErrors::row_of(own, area)));
        let mut changes = Self::default();
        for metric in metrics {
            let number = match metric.origin {
                MetricOrigin::Cells { number, .. } => Some(number),
                _ => None,
            };
            let measured = [0, 1].map(|side| match number {
                Some(number) => accuracy.as_ref()?[side].measured(number),
                None => totals[side].measured(metric, area),
            });
            let values = measured.map(|own| metric.value_of(own?));
            let cases = measured.map(|own| own.map(|own| own.cases));
            let ([Some(base), Some(other)], [Some(a), Some(b)]) = (values, cases) else {
                if cases != [None; 2] {
                    changes.not_measured.push(NotMeasured { metric, cases });
                }
                continue;
            };
            let samples = match number {
                Some(number) => {
                    let sample = |own: &Vec<_>| Some(RangeErrors::sample(number, own, area));
                    errors.map_or([None, None], |both| both.each_ref().map(sample))
                }
                None => rows.map(|rows| sample_in(metric, rows, area)),
            };
            if let [Some(before), Some(after)] = &samples {
                let change = Change::from_samples(metric, [base, other], [before, after], runs);
                let cases = Some([a, b]);
                changes.measured.push(Change { cases, ..change });
            }
        }
        changes
    }
}

impl Change {
    /// The name of the metric, or of the checkpoint.
    pub fn name(&self) -> String {
        match &self.checkpoint {
            Some(own) => format!("checkpoint {} {}", own.checkpoint, own.name),
            None => self.metric.words.to_owned(),
        }
    }

    pub(crate) fn from_samples(
        metric: &'static Metric,
        values: [f64; 2],
        [base, other]: [&Sample; 2],
        runs: &RunLengths,
    ) -> Self {
        let [a, b] = values;
        // The change, and its derivatives.
        let (change, slopes) = match (metric.unit, metric.better) {
            // Times scale with the machine, so their change is a factor.
            (MetricUnit::Ms, _) => (b / a, [-b / a.powi(2), a.recip()]),
            (_, Better::Zero) => (b.abs() - a.abs(), [-a.signum(), b.signum()]),
            _ => (b - a, [-1.0, 1.0]),
        };
        let own = Sample::uncertainty_between([base, other], slopes, runs);
        let p = own.map(|own| own.p_value(change));
        Self {
            p: p.filter(|_| metric.unit != MetricUnit::Ms),
            ..Self::new(metric, values, change, own.map(|own| own.interval(change)))
        }
    }

    /// Equal numbers of unequal results are a coincidence, as wide as the interval.
    pub(crate) fn doubt_equality(&mut self) {
        if self.judgement == Judgement::Equal {
            let unclear = self.interval.map(|_| Judgement::Unclear);
            self.judgement = unclear.unwrap_or(Judgement::TooFew);
        }
    }

    pub(crate) fn new(
        metric: &'static Metric,
        [base, other]: [f64; 2],
        difference: f64,
        interval: Option<Interval>,
    ) -> Self {
        let judgement = match interval.map(|(low, high)| low > 0.0 || high < 0.0) {
            // Equal on these pairs, but for rounding: the interval is empty and proves nothing.
            _ if (base - other).abs() <= MAX_ROUNDING * base.abs() => Judgement::Equal,
            // All pairs of a run are of one moment: their spread does not include how the machine
            // varies between runs.
            _ if metric.unit == MetricUnit::Ms => Judgement::Unjudged,
            is_real => Judgement::new(metric.better, is_real, difference > 0.0),
        };
        Self {
            checkpoint: None,
            metric,
            base,
            other,
            difference,
            interval,
            p: None,
            cases: None,
            exact: None,
            judgement,
        }
    }

    /// The difference as a multiple of its interval's width; 0 without one.
    pub(crate) fn sureness(&self) -> f64 {
        self.interval.map_or(0.0, |(low, high)| {
            self.difference.abs() / (high - low).max(f64::MIN_POSITIVE)
        })
    }

    /// True if the second value is the worse one, whether that is real or not.
    pub(crate) fn is_for_the_worse(&self) -> bool {
        let is_more = self.difference > 0.0;
        self.difference != 0.0
            && Judgement::new(self.metric.better, Some(true), is_more) == Judgement::Worse
    }
}

/// True for a metric that decides where it is in the headline: it has a better direction, and is of
/// the pairs that are resampled.
pub(crate) fn is_ranked(metric: &Metric) -> bool {
    let is_of_checkpoints = matches!(metric.origin, MetricOrigin::Checkpoints);
    let is_of_pieces = matches!(metric.origin, MetricOrigin::Pieces { .. });
    let is_other = metric.estimated().is_some() || metric.is_of_motion() || is_of_pieces;
    metric.better != Better::Neither
        && metric.unit != MetricUnit::Ms
        && !is_of_checkpoints
        && !is_other
}

impl Judgement {
    /// `is_real`: that the difference is no chance, if that can be told.
    pub(crate) fn new(better: Better, is_real: Option<bool>, is_more: bool) -> Self {
        match (is_real, better, is_more) {
            (None, ..) => Self::TooFew,
            (Some(false), ..) => Self::Unclear,
            (_, Better::Neither, _) => Self::Differs,
            (_, Better::More, true) | (_, Better::Less | Better::Zero, false) => Self::Better,
            _ => Self::Worse,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_no_change() {
        let metric = Metric::find("rmse").unwrap();
        let judged = |by: f64| {
            let change = Change::new(metric, [0.02, 0.02 + by], by, Some((by, by)));
            change.judgement
        };
        assert_eq!(
            [0.0, 1e-17, 1e-3].map(judged),
            [Judgement::Equal, Judgement::Equal, Judgement::Worse]
        );
    }
}
