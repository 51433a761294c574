//! False acceptance and rejection, and the receiver operating characteristic.

use serde::Serialize;

/// A fraction of errors with its 95 % interval (Wilson, JASA 1927), as if samples were independent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorRate {
    pub errors: usize,
    pub samples: usize,
    /// 0..=1.
    pub rate: f64,
    pub low: f64,
    pub high: f64,
}

impl ErrorRate {
    pub fn new(errors: usize, samples: usize) -> Self {
        let n = samples.max(1) as f64;
        let rate = errors as f64 / n;
        let z = 1.96;
        let middle = rate + z * z / (2.0 * n);
        let half = z * (rate * (1.0 - rate) / n + z * z / (4.0 * n * n)).sqrt();
        let scale = 1.0 + z * z / n;
        Self {
            errors,
            samples,
            rate,
            low: ((middle - half) / scale).max(0.0),
            high: ((middle + half) / scale).min(1.0),
        }
    }
}

impl std::fmt::Display for ErrorRate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [rate, low, high] = [self.rate, self.low, self.high].map(|share| 100.0 * share);
        let (errors, samples) = (self.errors, self.samples);
        write!(
            f,
            "{rate:.2} % ({low:.2} to {high:.2}; {errors} of {samples})"
        )
    }
}

/// Errors at a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WindowErrors {
    /// Windows that do not show the object but are accepted.
    pub false_acceptance: ErrorRate,
    /// Windows that show the object but are rejected.
    pub false_rejection: ErrorRate,
}

impl WindowErrors {
    /// From scores with their categories: scores above the threshold are accepted.
    pub fn new(scores: &[(f32, bool)], threshold: f32) -> Self {
        let labelled = |is: bool| scores.iter().filter(move |(_, category)| *category == is);
        let accepted = labelled(false).filter(|own| own.0 > threshold);
        let rejected = labelled(true).filter(|own| own.0 <= threshold);
        Self {
            false_acceptance: ErrorRate::new(accepted.count(), labelled(false).count()),
            false_rejection: ErrorRate::new(rejected.count(), labelled(true).count()),
        }
    }
}

/// False acceptance and true acceptance at all thresholds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RocCurve {
    /// From (0, 0) to (1, 1).
    pub points: Vec<(f64, f64)>,
    /// Area under the curve: probability that a window with the object has the higher score.
    pub area: f64,
    /// Threshold of least cost.
    #[serde(skip)]
    pub threshold: f32,
}

impl RocCurve {
    /// From scores with their categories; a false acceptance costs that many false rejections.
    pub fn new(scores: &[(f32, bool)], acceptance_cost: f64) -> Self {
        let mut sorted = scores.to_vec();
        sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
        let positives = scores.iter().filter(|(_, is)| *is).count();
        let totals = [scores.len() - positives, positives].map(|n| n.max(1) as f64);
        let mut curve = Self {
            points: vec![(0.0, 0.0)],
            area: 0.0,
            threshold: f32::INFINITY,
        };
        let (mut counts, mut best) = ([0.0, 0.0], f64::NEG_INFINITY);
        for (i, (score, is)) in sorted.iter().enumerate() {
            counts[usize::from(*is)] += 1.0;
            // Equal scores are one step.
            let next = sorted.get(i + 1).map(|(next, _)| *next);
            if next == Some(*score) {
                continue;
            }
            let point = (counts[0] / totals[0], counts[1] / totals[1]);
            let last = curve.points[curve.points.len() - 1];
            curve.area += 0.5 * (point.0 - last.0) * (point.1 + last.1);
            curve.points.push(point);
            let gain = point.1 - acceptance_cost * point.0;
            if gain > best {
                best = gain;
                // Between this score and the next.
                curve.threshold = 0.5 * (score + next.unwrap_or(score - 1.0));
            }
        }
        curve
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilsons_interval() {
        // Brown, Cai and DasGupta, Statistical Science 2001: 0 of 20 and 10 of 20.
        let none = ErrorRate::new(0, 20);
        assert!(
            none.low == 0.0 && (none.high - 0.1611).abs() < 1e-3,
            "{none}"
        );
        let half = ErrorRate::new(10, 20);
        assert!((half.low - 0.2993).abs() < 1e-3 && (half.high - 0.7007).abs() < 1e-3);
    }

    #[test]
    fn the_curve_of_a_few_scores() {
        let scores = [
            (3.0, true),
            (2.0, true),
            (1.0, false),
            (0.5, true),
            (-1.0, false),
        ];
        let curve = RocCurve::new(&scores, 1.0);
        // Five of the six pairs are in order.
        assert!((curve.area - 5.0 / 6.0).abs() < 1e-9);
        assert_eq!(curve.threshold, 1.5);
        let errors = WindowErrors::new(&scores, curve.threshold);
        assert_eq!(errors.false_acceptance.errors, 0);
        assert_eq!(
            (
                errors.false_rejection.errors,
                errors.false_rejection.samples
            ),
            (1, 3)
        );
        assert_eq!(RocCurve::new(&[(1.0, true), (1.0, false)], 1.0).area, 0.5);
    }
}
