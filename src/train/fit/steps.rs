//! Logistic regression on steps, chosen forward.
//!
//! A step adds a score to all samples whose feature exceeds its value. The step that explains most
//! of the remaining loss is added, and all scores are refitted by Newton's method (iteratively
//! reweighted least squares, with a small ridge).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use svl_core::depth::decision::Steps;

/// Number of values of a feature between which steps are tried.
const CANDIDATES: usize = 48;

/// Weight of the ridge (L2) penalty on each score.
const RIDGE: f64 = 1.0;

/// Direction of the scores along a feature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StepSide {
    Rises,
    Falls,
    Either,
}

impl StepSide {
    fn sign(self) -> f64 {
        match self {
            Self::Rises => 1.0,
            Self::Falls => -1.0,
            Self::Either => 0.0,
        }
    }
}

/// A candidate: its feature, and its index among the feature's values.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    feature: usize,
    place: usize,
}

/// Steps with their scores in log odds.
#[derive(Clone, Debug, Default)]
pub(super) struct StepModel {
    base: f64,
    steps: Vec<(Step, f64)>,
    /// Steps that would have the wrong sign.
    refused: Vec<Step>,
}

/// Samples with their features as indices of candidate values.
pub(super) struct StepData<const N: usize> {
    values: [Vec<i64>; N],
    places: Vec<[u8; N]>,
    right: Vec<bool>,
    weights: Vec<f64>,
    sides: [StepSide; N],
    /// Log odds that each sample has already; the base of the steps is 0 then.
    given: Option<Vec<f64>>,
}

impl<const N: usize> StepData<N> {
    /// Samples with their features, whether each is right, and its weight.
    pub(super) fn new(
        features: Vec<[i64; N]>,
        right: Vec<bool>,
        weights: Vec<f64>,
        sides: [StepSide; N],
    ) -> Self {
        let values = std::array::from_fn(|f| candidates(features.iter().map(|row| row[f])));
        let place = |features: &[i64; N]| {
            std::array::from_fn(|f| {
                let values: &Vec<i64> = &values[f];
                values.partition_point(|value| features[f] > *value) as u8
            })
        };
        Self {
            places: features.iter().map(place).collect(),
            right,
            weights,
            values,
            sides,
            given: None,
        }
    }

    /// The same samples with log odds that each has already.
    pub(super) fn given(self, scores: Vec<f64>) -> Self {
        Self {
            given: Some(scores),
            ..self
        }
    }

    fn reaches(&self, step: Step, i: usize) -> bool {
        usize::from(self.places[i][step.feature]) > step.place
    }

    fn score(&self, model: &StepModel, i: usize) -> f64 {
        let steps = model.steps.iter();
        let reached = steps.filter(|(step, _)| self.reaches(*step, i));
        let given = self.given.as_ref().map_or(0.0, |given| given[i]);
        given + model.base + reached.map(|(_, score)| score).sum::<f64>()
    }

    /// Sum of the weighted logistic losses of the samples with these indices.
    pub(super) fn loss(&self, model: &StepModel, indices: &[usize]) -> f64 {
        let loss = |&i: &usize| {
            let score = self.score(model, i);
            let signed = if self.right[i] { -score } else { score };
            // ln(1 + e^x) without overflow.
            self.weights[i] * (signed.max(0.0) + (-signed.abs()).exp().ln_1p())
        };
        indices.iter().map(loss).sum()
    }

    /// Models of the samples with these indices, with 0 steps, 1, and so on up to `most`.
    pub(super) fn path(&self, indices: &[usize], most: usize) -> Vec<StepModel> {
        let mut model = StepModel::default();
        self.refit(indices, &mut model);
        let mut path = vec![model.clone()];
        while model.steps.len() < most {
            let Some(step) = self.next_step(indices, &model) else {
                break;
            };
            model.steps.push((step, 0.0));
            self.refit(indices, &mut model);
            // Others may change sign when one is added.
            let is_wrong =
                |(step, score): &(Step, f64)| score * self.sides[step.feature].sign() < 0.0;
            while let Some(wrong) = model.steps.iter().position(is_wrong) {
                let (wrong, _) = model.steps.remove(wrong);
                model.refused.push(wrong);
                self.refit(indices, &mut model);
            }
            path.truncate(model.steps.len());
            path.push(model.clone());
        }
        path
    }

    /// The step that lowers the loss most with a single Newton step.
    fn next_step(&self, indices: &[usize], model: &StepModel) -> Option<Step> {
        // Slopes and curvatures of the loss by feature index.
        let mut sums: [Vec<[f64; 2]>; N] =
            std::array::from_fn(|f| vec![[0.0; 2]; self.values[f].len() + 1]);
        for &i in indices {
            let [slope, curvature] = self.slope(model, i);
            for (f, sums) in sums.iter_mut().enumerate() {
                let sums = &mut sums[usize::from(self.places[i][f])];
                sums[0] += slope;
                sums[1] += curvature;
            }
        }
        let mut best = None;
        for (feature, sums) in sums.iter().enumerate() {
            let (mut slope, mut curvature) = (0.0, 0.0);
            let all: f64 = sums.iter().map(|sum| sum[1]).sum();
            for place in (0..self.values[feature].len()).rev() {
                slope += sums[place + 1][0];
                curvature += sums[place + 1][1];
                let step = Step { feature, place };
                let taken = model.steps.iter().any(|(taken, _)| *taken == step);
                if taken
                    || model.refused.contains(&step)
                    || slope * self.sides[feature].sign() < 0.0
                {
                    continue;
                }
                // Skips steps that split off only a handful of samples.
                if curvature.min(all - curvature) < 2.0 * RIDGE {
                    continue;
                }
                let gain = slope * slope / (curvature + RIDGE);
                if best.is_none_or(|(most, _)| gain > most) {
                    best = Some((gain, step));
                }
            }
        }
        best.map(|(_, step)| step)
    }

    /// Slope and curvature of the negative loss by the score.
    fn slope(&self, model: &StepModel, i: usize) -> [f64; 2] {
        let probability = 1.0 / (1.0 + (-self.score(model, i)).exp());
        let target = f64::from(u8::from(self.right[i]));
        [
            self.weights[i] * (target - probability),
            self.weights[i] * probability * (1.0 - probability),
        ]
    }

    /// Newton's method on the base and all scores.
    fn refit(&self, indices: &[usize], model: &mut StepModel) {
        let n = model.steps.len() + 1;
        for _ in 0..8 {
            let mut slopes = DVector::<f64>::zeros(n);
            let mut curvatures = DMatrix::<f64>::identity(n, n) * RIDGE;
            // The base, which has no penalty, or is 0.
            curvatures[(0, 0)] = if self.given.is_some() { 1e18 } else { 1e-9 };
            for (k, (_, score)) in model.steps.iter().enumerate() {
                slopes[k + 1] = -RIDGE * score;
            }
            let mut reached = Vec::with_capacity(n);
            for &i in indices {
                let [slope, curvature] = self.slope(model, i);
                reached.clear();
                reached.push(0);
                let steps = model.steps.iter().enumerate();
                reached.extend(
                    steps
                        .filter(|(_, (step, _))| self.reaches(*step, i))
                        .map(|(k, _)| k + 1),
                );
                for (at, &a) in reached.iter().enumerate() {
                    slopes[a] += slope;
                    for &b in &reached[..=at] {
                        curvatures[(a, b)] += curvature;
                    }
                }
            }
            curvatures.fill_upper_triangle_with_lower_triangle();
            let Some(change) = curvatures.cholesky().map(|c| c.solve(&slopes)) else {
                return;
            };
            // Steps of more than four in log odds overshoot.
            let largest = change.amax();
            let change = change * (4.0 / largest.max(4.0));
            model.base += change[0];
            for (k, (_, score)) in model.steps.iter_mut().enumerate() {
                *score += change[k + 1];
            }
            if largest < 1e-4 {
                return;
            }
        }
    }

    /// The base and the steps of a model, in thousandths.
    pub(super) fn steps(&self, model: &StepModel) -> (i64, [Steps; N]) {
        let thousandths = |score: f64| (1000.0 * score).round() as i64;
        let steps = std::array::from_fn(|feature| {
            let own = model.steps.iter().filter(|own| own.0.feature == feature);
            let own = own.map(|(step, score)| (self.values[step.feature][step.place], *score));
            let mut steps: Vec<_> = own.collect();
            steps.sort_by_key(|(above, _)| *above);
            let mut sum = 0.0;
            let steps = steps.into_iter().map(|(above, score)| {
                sum += score;
                (above, thousandths(sum))
            });
            Steps(steps.collect())
        });
        (thousandths(model.base), steps)
    }
}

/// A feature that a sample does not have: it exceeds no step.
pub(super) const ABSENT: i64 = i64::MIN;

/// Values that divide the given ones into parts as equal as possible; where some are [`ABSENT`],
/// also one that all others exceed.
fn candidates(values: impl Iterator<Item = i64>) -> Vec<i64> {
    let mut values: Vec<_> = values.collect();
    values.sort_unstable();
    let absent = values.partition_point(|value| *value == ABSENT);
    let values = &values[absent..];
    let Some(last) = values.last().copied() else {
        return Vec::new();
    };
    let at = |k: usize| values[k * values.len() / (CANDIDATES + 1)];
    let below_all = (absent > 0).then(|| values[0] - 1);
    let parts = below_all.into_iter().chain((1..=CANDIDATES).map(at));
    let mut parts: Vec<_> = parts.collect();
    parts.dedup();
    parts.retain(|value| *value < last);
    parts
}

/// Models fitted with parts of the samples held out.
pub(super) struct HeldOut {
    /// Per part the models with 0 steps, 1, and so on, and its samples.
    pub(super) parts: Vec<(Vec<StepModel>, Vec<usize>)>,
}

impl<const N: usize> StepData<N> {
    /// Fits models of up to `most` steps to the samples with these indices, without each of `parts`
    /// in turn. `None` if `progress` returns false.
    pub(super) fn hold_out(
        &self,
        indices: &[usize],
        most: usize,
        parts: usize,
        part: &(dyn Fn(usize) -> usize + Sync),
        progress: &(dyn Fn() -> bool + Sync),
    ) -> Option<HeldOut> {
        let fit = |held_out| {
            let (test, train): (Vec<_>, Vec<_>) =
                indices.iter().copied().partition(|i| part(*i) == held_out);
            let path = if train.is_empty() || test.is_empty() {
                vec![StepModel::default(); most + 1]
            } else {
                self.path(&train, most)
            };
            progress().then_some((path, test))
        };
        let parts: Option<Vec<_>> = (0..parts).into_par_iter().map(fit).collect();
        parts.map(|parts| HeldOut { parts })
    }

    /// Mean loss of the held-out samples by the number of steps, from 0 to `most`.
    pub(super) fn losses(&self, held_out: &HeldOut, most: usize) -> Vec<f64> {
        let all: f64 = self.weights.iter().sum();
        let loss = |steps: usize| {
            let parts = held_out.parts.iter();
            let losses = parts.map(|(path, test)| self.loss(at(path, steps), test));
            losses.sum::<f64>() / all
        };
        (0..=most).map(loss).collect()
    }
}

/// The model of a path with that number of steps, or the longest.
pub(super) fn at(path: &[StepModel], steps: usize) -> &StepModel {
    &path[steps.min(path.len() - 1)]
}

/// The fewest steps whose loss is within a thousandth of the least one.
pub(super) fn fewest(losses: &[f64]) -> usize {
    let best = losses.iter().copied().fold(f64::INFINITY, f64::min);
    let steps = losses.iter().position(|loss| *loss <= 1.001 * best);
    steps.unwrap_or_default()
}
