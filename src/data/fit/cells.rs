//! Fits a [`VerdictTable`] to samples: a logistic regression on steps, chosen forward.
//!
//! A step adds a score to all cells whose feature exceeds its value. The step that explains most of
//! the remaining loss is added, and all scores are refitted by Newton's method (iteratively
//! reweighted least squares, with a small ridge), up to [`MOST_STEPS`]. The number of steps is
//! chosen by cross-validation: whole groups are held out, never single cells, as the cells of a run
//! are similar to each other.

use super::CellSample;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::borrow::Cow;
use svl_core::depth::decision::{Feature, VerdictTable};
use svl_core::stereo::{CellEvidence, FittedTo};

/// A fitted table, with its figures on the samples.
#[derive(Clone, Debug)]
pub struct CellFit {
    pub table: VerdictTable,
    /// Per sample, in order, the log odds in thousandths from a table fitted without the sample's
    /// fold; the least number if there is nothing to report.
    pub held_out: Vec<i64>,
    /// Per kind a table fitted without it; empty if there is only one.
    pub without_kind: Vec<VerdictTable>,
    /// Mean logistic loss of held-out samples by the number of steps, from 0 on.
    pub losses: Vec<f64>,
}

/// Largest number of steps in a table.
pub const MOST_STEPS: usize = 32;

/// Folds into which the groups are divided for the cross-validation.
pub const FOLDS: usize = 5;

/// Number of values of a feature between which steps are tried.
const CANDIDATES: usize = 48;

/// Weight of the ridge (L2) penalty on each score.
const RIDGE: f64 = 1.0;

/// A candidate: its feature, and its index among the feature's values.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    feature: usize,
    place: usize,
}

/// Steps with their scores in log odds.
#[derive(Clone, Debug, Default)]
struct Model {
    base: f64,
    steps: Vec<(Step, f64)>,
    /// Steps that would have the wrong sign ([`direction`]).
    refused: Vec<Step>,
}

/// The samples with their features as indices of candidate values.
struct Data {
    values: [Vec<i64>; CellEvidence::FEATURES],
    places: Vec<[u8; CellEvidence::FEATURES]>,
    right: Vec<bool>,
    weights: Vec<f64>,
}

/// Fits a table for reports of the `rank`th percentile to samples of those kinds with those
/// weights. Samples with nothing to report are ignored.
///
/// The result depends only on the samples and their order.
///
/// `progress` is called after each of the [`FOLDS`], each of several kinds, and the final fit; if
/// it returns false, the result is `None`.
pub fn fit_cells(
    samples: &[CellSample],
    kinds: &[usize],
    weights: &[f64],
    rank: i64,
    progress: impl Fn() -> bool + Sync,
) -> Option<CellFit> {
    let data = Data::new(samples, weights);
    let reportable: Vec<_> = (0..samples.len())
        .filter(|&i| samples[i].is_reportable())
        .collect();
    // Per fold, the models fitted without it and its samples.
    let cross = |folds: usize, most: usize, fold: &(dyn Fn(usize) -> usize + Sync)| {
        let fit = |held_out| {
            let part = |held| {
                let is_held = |i: &usize| (fold(*i) == held_out) == held;
                reportable
                    .iter()
                    .copied()
                    .filter(is_held)
                    .collect::<Vec<_>>()
            };
            let (train, test) = (part(false), part(true));
            let path = if train.is_empty() || test.is_empty() {
                vec![Model::default(); most + 1]
            } else {
                data.path(&train, most)
            };
            progress().then_some((path, test))
        };
        let folds = (0..folds).into_par_iter().map(fit);
        folds.collect::<Option<Vec<(Vec<Model>, Vec<usize>)>>>()
    };
    let folds = cross(FOLDS, MOST_STEPS, &|i| samples[i].group % FOLDS)?;
    let loss = |steps: usize| {
        let of_fold = |(path, test): &(Vec<Model>, Vec<usize>)| {
            let model = &path[steps.min(path.len() - 1)];
            let losses = test.iter().map(|&i| data.weights[i] * data.loss(model, i));
            losses.sum::<f64>()
        };
        folds.iter().map(of_fold).sum::<f64>() / data.weights.iter().sum::<f64>()
    };
    let losses: Vec<_> = (0..=MOST_STEPS).map(loss).collect();
    let best = losses.iter().copied().fold(f64::INFINITY, f64::min);
    // The fewest steps whose loss is within a thousandth of the best.
    let steps = losses.iter().position(|loss| *loss <= 1.001 * best);
    let steps = steps.unwrap_or_default();
    let table = |path: &[Model]| data.table(&path[steps.min(path.len() - 1)], rank);
    let mut held_out = vec![i64::MIN; samples.len()];
    for (path, test) in &folds {
        let table = table(path);
        for &i in test {
            held_out[i] = table.score(&samples[i].evidence.unwrap_or_default());
        }
    }
    let without_kind = match kinds.iter().max() {
        None | Some(0) => Vec::new(),
        Some(last) => {
            let folds = cross(last + 1, steps, &|i| kinds[i])?;
            folds.iter().map(|(path, _)| table(path)).collect()
        }
    };
    let path = data.path(&reportable, steps);
    progress().then(|| CellFit {
        table: data.table(&path[path.len() - 1], rank),
        held_out,
        without_kind,
        losses,
    })
}

impl Data {
    fn new(samples: &[CellSample], weights: &[f64]) -> Self {
        let features = samples.iter().map(|sample| {
            let evidence = sample.evidence.unwrap_or_default();
            evidence.features
        });
        let features: Vec<_> = features.collect();
        let values = std::array::from_fn(|f| candidates(features.iter().map(|of| of[f])));
        let place = |of: &[i64; CellEvidence::FEATURES]| {
            std::array::from_fn(|f| {
                let values: &Vec<i64> = &values[f];
                values.partition_point(|value| of[f] > *value) as u8
            })
        };
        Self {
            places: features.iter().map(place).collect(),
            right: samples.iter().map(|sample| sample.right).collect(),
            weights: weights.to_vec(),
            values,
        }
    }

    fn reaches(&self, step: Step, i: usize) -> bool {
        usize::from(self.places[i][step.feature]) > step.place
    }

    fn score(&self, model: &Model, i: usize) -> f64 {
        let reached = model
            .steps
            .iter()
            .filter(|(step, _)| self.reaches(*step, i));
        model.base + reached.map(|(_, score)| score).sum::<f64>()
    }

    fn loss(&self, model: &Model, i: usize) -> f64 {
        let score = self.score(model, i);
        let signed = if self.right[i] { -score } else { score };
        // ln(1 + e^x) without overflow.
        signed.max(0.0) + (-signed.abs()).exp().ln_1p()
    }

    /// Models of the samples `of` with 0 steps, 1, and so on up to `most`.
    fn path(&self, of: &[usize], most: usize) -> Vec<Model> {
        let mut model = Model::default();
        self.refit(of, &mut model);
        let mut path = vec![model.clone()];
        while model.steps.len() < most {
            let Some(step) = self.next_step(of, &model) else {
                break;
            };
            model.steps.push((step, 0.0));
            self.refit(of, &mut model);
            // Others may change sign when one is added.
            while let Some(wrong) = model
                .steps
                .iter()
                .position(|(step, score)| score * direction(step.feature) < 0.0)
            {
                let (wrong, _) = model.steps.remove(wrong);
                model.refused.push(wrong);
                self.refit(of, &mut model);
            }
            path.truncate(model.steps.len());
            path.push(model.clone());
        }
        path
    }

    /// The step that lowers the loss most with a single Newton step.
    fn next_step(&self, of: &[usize], model: &Model) -> Option<Step> {
        // Slopes and curvatures of the loss by feature index.
        let mut sums: [Vec<[f64; 2]>; CellEvidence::FEATURES] =
            std::array::from_fn(|f| vec![[0.0; 2]; self.values[f].len() + 1]);
        for &i in of {
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
                if taken || model.refused.contains(&step) || slope * direction(feature) < 0.0 {
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
    fn slope(&self, model: &Model, i: usize) -> [f64; 2] {
        let probability = 1.0 / (1.0 + (-self.score(model, i)).exp());
        let target = f64::from(u8::from(self.right[i]));
        [
            self.weights[i] * (target - probability),
            self.weights[i] * probability * (1.0 - probability),
        ]
    }

    /// Newton's method on the base and all scores.
    fn refit(&self, of: &[usize], model: &mut Model) {
        let n = model.steps.len() + 1;
        for _ in 0..8 {
            let mut slopes = DVector::<f64>::zeros(n);
            let mut curvatures = DMatrix::<f64>::identity(n, n) * RIDGE;
            curvatures[(0, 0)] = 1e-9;
            for (k, (_, score)) in model.steps.iter().enumerate() {
                slopes[k + 1] = -RIDGE * score;
            }
            let mut reached = Vec::with_capacity(n);
            for &i in of {
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

    /// The model as a table, in thousandths.
    fn table(&self, model: &Model, rank: i64) -> VerdictTable {
        let thousandths = |score: f64| (1000.0 * score).round() as i64;
        let steps = Feature::ALL.map(|feature| {
            let of_feature = model
                .steps
                .iter()
                .filter(|(step, _)| step.feature == feature as usize);
            let mut steps: Vec<_> = of_feature
                .map(|(step, score)| (self.values[step.feature][step.place], *score))
                .collect();
            steps.sort_by_key(|(above, _)| *above);
            let mut sum = 0.0;
            let steps = steps.into_iter().map(|(above, score)| {
                sum += score;
                (above, thousandths(sum))
            });
            Cow::Owned(steps.collect::<Vec<_>>())
        });
        VerdictTable {
            rank,
            base: thousandths(model.base),
            network: None,
            fitted: FittedTo::default(),
            steps,
        }
    }
}

/// Sign allowed for a feature: more margin, support, seen pixels and votes never make a report less
/// probable, nor do a greater shift and cost make it more so. So a fit contains less that holds
/// only for its samples.
fn direction(feature: usize) -> f64 {
    match Feature::ALL[feature] {
        Feature::Margin | Feature::Support | Feature::Seen | Feature::Voted | Feature::Agreed => {
            1.0
        }
        Feature::Shift | Feature::Cost => -1.0,
        Feature::Texture | Feature::Span => 0.0,
    }
}

/// Values that divide the given ones into parts as equal as possible.
fn candidates(values: impl Iterator<Item = i64>) -> Vec<i64> {
    let mut values: Vec<_> = values.collect();
    values.sort_unstable();
    let Some(last) = values.last().copied() else {
        return Vec::new();
    };
    let at = |k: usize| values[k * values.len() / (CANDIDATES + 1)];
    let mut parts: Vec<_> = (1..=CANDIDATES).map(at).collect();
    parts.dedup();
    parts.retain(|value| *value < last);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells decided by margin and cost, with that many groups.
    fn samples(count: usize, groups: usize) -> Vec<CellSample> {
        let mut random = fastrand::Rng::with_seed(7);
        let sample = |i: usize| {
            let mut features = [0; CellEvidence::FEATURES];
            features.fill_with(|| random.i64(0..1000));
            let odds = -1.0 + 3.0 * f64::from(features[Feature::Margin as usize] > 400)
                - 2.0 * f64::from(features[Feature::Cost as usize] > 700);
            CellSample {
                group: i % groups,
                evidence: Some(CellEvidence {
                    report: 40,
                    target: 40,
                    features,
                }),
                right: random.f64() < 1.0 / (1.0 + (-odds).exp()),
                known: false,
            }
        };
        (0..count).map(sample).collect()
    }

    #[test]
    fn known_steps_are_found() {
        let samples = samples(20_000, 10);
        let kinds: Vec<_> = (0..samples.len()).map(|i| i % 3).collect();
        let fit = fit_cells(&samples, &kinds, &vec![1.0; samples.len()], 50, || true).unwrap();
        let steps = |feature: Feature| &fit.table.steps[feature as usize];
        let score_at = |feature, value: i64| {
            let reached = steps(feature)
                .iter()
                .rev()
                .find(|(above, _)| value > *above);
            reached.map_or(0, |(_, score)| *score)
        };
        let difference = score_at(Feature::Margin, 600) - score_at(Feature::Margin, 200);
        assert!((2700..3300).contains(&difference), "{:?}", fit.table);
        let difference = score_at(Feature::Cost, 900) - score_at(Feature::Cost, 500);
        assert!((-2300..-1700).contains(&difference), "{:?}", fit.table);
        // A feature without influence has almost no steps.
        assert!(score_at(Feature::Shift, 999).abs() < 200, "{:?}", fit.table);
        assert!(fit.losses[2] < 0.9 * fit.losses[0]);
        // Kinds that do not differ are predicted by each other.
        let [run, kind] = losses_of_the_last_kind(&fit, &samples, &kinds);
        assert!((kind / run - 1.0).abs() < 0.01, "{run} {kind}");
        // One whose cells contradict the others' is not.
        let mut opposed = samples.clone();
        let own = opposed
            .iter_mut()
            .zip(&kinds)
            .filter(|(_, kind)| **kind == 2);
        own.for_each(|(sample, _)| sample.right = !sample.right);
        let fit = fit_cells(&opposed, &kinds, &vec![1.0; samples.len()], 50, || true).unwrap();
        let [run, kind] = losses_of_the_last_kind(&fit, &opposed, &kinds);
        assert!(kind > 1.1 * run, "{run} {kind}");
    }

    /// Log loss of the cells of the last kind, with its runs held out and with the kind held out.
    fn losses_of_the_last_kind(fit: &CellFit, samples: &[CellSample], kinds: &[usize]) -> [f64; 2] {
        let without = |i: usize| fit.without_kind[2].score(&samples[i].evidence.unwrap());
        let scores: [&dyn Fn(usize) -> i64; 2] = [&|i| fit.held_out[i], &without];
        scores.map(|score| {
            let of_kind = (0..samples.len()).filter(|&i| kinds[i] == 2);
            let losses = of_kind.map(|i| {
                let sign = if samples[i].right { -1000.0 } else { 1000.0 };
                (score(i) as f64 / sign).exp().ln_1p()
            });
            losses.sum()
        })
    }

    #[test]
    fn it_is_repeatable_and_can_be_ended() {
        let samples = samples(2000, 3);
        let weights = vec![1.0; samples.len()];
        let one_kind = vec![0; samples.len()];
        let fit = || fit_cells(&samples, &one_kind, &weights, 75, || true).unwrap();
        assert!(fit().without_kind.is_empty());
        let (one, two) = (fit(), fit());
        assert_eq!((one.table, one.held_out), (two.table, two.held_out));
        assert!(fit_cells(&samples, &one_kind, &weights, 75, || false).is_none());
    }
}
