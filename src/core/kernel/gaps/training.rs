//! The network in floats, and its gradient. Weights, features and activations are in units of 1.
//!
//! Sums go over one input after the other, and gradients stay apart for each lane, so that every
//! instruction set gives the same bytes.

use super::super::pairs::Group;
use super::{CHOICE, GapTensors, HIDDEN, HYPOTHESES, PIXEL, gap_tensors};
use super::{GAP_TENSORS, HYPOTHESIS_FEATURES, PIXEL_FEATURES};

const LANES: usize = Group::ROWS;
type Lane = [f32; LANES];

/// The inputs of a sample in each lane.
#[derive(Clone, Default)]
pub struct GapSamples {
    pub exists: [Lane; HYPOTHESES],
    pub features: [[Lane; HYPOTHESIS_FEATURES]; HYPOTHESES],
    pub pixel: [Lane; PIXEL_FEATURES],
}

/// The activations of the samples.
#[derive(Clone, Default)]
pub struct GapPass {
    pixel: [Lane; PIXEL],
    hidden: [[Lane; HIDDEN]; HYPOTHESES],
    mean: [Lane; HIDDEN],
    choice: [[Lane; CHOICE]; HYPOTHESES],
    /// Scores of the hypotheses, and of none; log odds.
    pub scores: [Lane; HYPOTHESES + 1],
}

/// Adds the products of a row of weights with their inputs.
#[inline(always)]
fn add(mut sum: Lane, weights: &[f32], inputs: &[Lane]) -> Lane {
    for (weight, input) in weights.iter().zip(inputs) {
        for l in 0..LANES {
            sum[l] += weight * input[l];
        }
    }
    sum
}

#[inline(always)]
fn positive(sum: Lane) -> Lane {
    sum.map(|sum| sum.max(0.0))
}

/// The lanes as they are. Without it the compiler vectorizes over weights instead of lanes, which
/// it has to gather: ten times as slow.
#[inline(always)]
fn apart(lane: &Lane) -> Lane {
    std::hint::black_box(*lane)
}

/// `sum + a·b` of each lane.
#[inline(always)]
fn plus(mut sum: Lane, a: Lane, b: Lane) -> Lane {
    for l in 0..LANES {
        sum[l] += a[l] * b[l];
    }
    sum
}

/// Adds to the gradients of a row of weights: the slope at its output times each input.
#[inline(always)]
fn learn(gradient: &mut [Lane], slope: &Lane, inputs: &[Lane]) {
    for (gradient, input) in gradient.iter_mut().zip(inputs) {
        *gradient = plus(*gradient, apart(slope), *input);
    }
}

/// Adds to the slopes at the inputs: the slope at an output times its weights.
#[inline(always)]
fn back(slopes: &mut [Lane], slope: &Lane, weights: &[f32]) {
    for (out, weight) in slopes.iter_mut().zip(weights) {
        *out = plus(*out, apart(slope), [*weight; LANES]);
    }
}

#[inline(always)]
fn add_to(sum: &mut Lane, slope: &Lane) {
    *sum = plus(*sum, apart(slope), [1.0; LANES]);
}

/// The slopes where the activation is positive.
#[inline(always)]
fn where_positive(slope: &Lane, activation: &Lane) -> Lane {
    std::array::from_fn(|l| if activation[l] > 0.0 { slope[l] } else { 0.0 })
}

/// See [`super::super::score_hypotheses`].
#[inline(always)]
pub(in super::super) fn forward(weights: &[f32], samples: &GapSamples, pass: &mut GapPass) {
    let w = GapTensors::from(gap_tensors(weights));
    let rows = w.pixel.chunks_exact(PIXEL_FEATURES).zip(w.pixel_bias);
    for (out, (row, bias)) in pass.pixel.iter_mut().zip(rows) {
        *out = positive(add([*bias; LANES], row, &samples.pixel));
    }
    let mut pixel_sums = [[0.0; LANES]; HIDDEN];
    let rows = w.hypothesis_pixel.chunks_exact(PIXEL);
    for (out, row) in pixel_sums.iter_mut().zip(rows) {
        *out = add(*out, row, &pass.pixel);
    }
    pass.mean = [[0.0; LANES]; HIDDEN];
    for k in 0..HYPOTHESES {
        let rows = w.hypothesis.chunks_exact(HYPOTHESIS_FEATURES);
        let biases = &w.hypothesis_bias[k * HIDDEN..][..HIDDEN];
        for (i, (row, bias)) in rows.zip(biases).enumerate() {
            let sum = pixel_sums[i].map(|sum| sum + bias);
            pass.hidden[k][i] = positive(add(sum, row, &samples.features[k]));
            for l in 0..LANES {
                pass.mean[i][l] += 0.125 * samples.exists[k][l] * pass.hidden[k][i][l];
            }
        }
    }
    let mut mean_sums = [[0.0; LANES]; CHOICE];
    let rows = w.choice_mean.chunks_exact(HIDDEN).zip(w.choice_bias);
    for (out, (row, bias)) in mean_sums.iter_mut().zip(rows) {
        *out = add([*bias; LANES], row, &pass.mean);
    }
    for k in 0..HYPOTHESES {
        let rows = w.choice.chunks_exact(HIDDEN);
        for (i, row) in rows.enumerate() {
            pass.choice[k][i] = positive(add(mean_sums[i], row, &pass.hidden[k]));
        }
        let score = add([0.0; LANES], w.score, &pass.choice[k]);
        let lanes = pass.scores[k].iter_mut().zip(score).zip(samples.exists[k]);
        lanes.for_each(|((out, score), exists)| *out = if exists > 0.0 { score } else { -1e9 });
    }
    let none = add([w.none_bias[0]; LANES], w.none_mean, &pass.mean);
    pass.scores[HYPOTHESES] = add(none, w.none_pixel, &pass.pixel);
}

/// See [`super::super::add_gap_gradient`].
#[inline(always)]
pub(in super::super) fn backward(
    weights: &[f32],
    samples: &GapSamples,
    pass: &GapPass,
    slopes: &[Lane; HYPOTHESES + 1],
    gradient: &mut [Lane],
) {
    let w = GapTensors::from(gap_tensors(weights));
    let g = GapTensors::from(split_gradient(gradient));
    let none = &slopes[HYPOTHESES];
    learn(g.none_mean, none, &pass.mean);
    learn(g.none_pixel, none, &pass.pixel);
    add_to(&mut g.none_bias[0], none);
    let (mut mean_slopes, mut pixel_slopes) = ([[0.0; LANES]; HIDDEN], [[0.0; LANES]; PIXEL]);
    back(&mut mean_slopes, none, w.none_mean);
    back(&mut pixel_slopes, none, w.none_pixel);

    // Slopes at the sums of the choices, and their sums over the hypotheses.
    let mut choice_slopes = [[[0.0; LANES]; CHOICE]; HYPOTHESES];
    let mut choice_slope_sums = [[0.0; LANES]; CHOICE];
    for (k, slopes_here) in choice_slopes.iter_mut().enumerate() {
        learn(g.score, &slopes[k], &pass.choice[k]);
        for (i, weight) in w.score.iter().enumerate() {
            let slope = slopes[k].map(|slope| weight * slope);
            slopes_here[i] = where_positive(&slope, &pass.choice[k][i]);
            add_to(&mut choice_slope_sums[i], &slopes_here[i]);
        }
    }
    for (i, slope) in choice_slope_sums.iter().enumerate() {
        add_to(&mut g.choice_bias[i], slope);
        learn(
            &mut g.choice_mean[i * HIDDEN..][..HIDDEN],
            slope,
            &pass.mean,
        );
        back(
            &mut mean_slopes,
            slope,
            &w.choice_mean[i * HIDDEN..][..HIDDEN],
        );
    }
    let mut hidden_slope_sums = [[0.0; LANES]; HIDDEN];
    for (k, choice_slopes) in choice_slopes.iter().enumerate() {
        let rows = g.choice.chunks_exact_mut(HIDDEN).zip(choice_slopes);
        rows.for_each(|(row, slope)| learn(row, slope, &pass.hidden[k]));
        let exists = &samples.exists[k];
        let hidden_slopes = hidden_slopes(&mean_slopes, exists, choice_slopes, w.choice);
        for (i, slope) in hidden_slopes.iter().enumerate() {
            let slope = where_positive(slope, &pass.hidden[k][i]);
            add_to(&mut hidden_slope_sums[i], &slope);
            add_to(&mut g.hypothesis_bias[k * HIDDEN + i], &slope);
            let row = &mut g.hypothesis[i * HYPOTHESIS_FEATURES..][..HYPOTHESIS_FEATURES];
            learn(row, &slope, &samples.features[k]);
        }
    }
    for (i, slope) in hidden_slope_sums.iter().enumerate() {
        let row = i * PIXEL;
        learn(&mut g.hypothesis_pixel[row..][..PIXEL], slope, &pass.pixel);
        back(
            &mut pixel_slopes,
            slope,
            &w.hypothesis_pixel[row..][..PIXEL],
        );
    }
    let rows = g.pixel.chunks_exact_mut(PIXEL_FEATURES);
    for (i, (row, slope)) in rows.zip(&pixel_slopes).enumerate() {
        let slope = where_positive(slope, &pass.pixel[i]);
        add_to(&mut g.pixel_bias[i], &slope);
        learn(row, &slope, &samples.pixel);
    }
}

/// The gradient of each tensor.
#[inline(always)]
fn split_gradient(mut gradient: &mut [Lane]) -> [&mut [Lane]; GAP_TENSORS.len()] {
    GAP_TENSORS.map(|(_, [rows, inputs])| {
        let (tensor, rest) = std::mem::take(&mut gradient).split_at_mut(rows * inputs);
        gradient = rest;
        tensor
    })
}

/// The slopes at the activations of a hypothesis: through the mean, if it exists, and through its
/// choices.
#[inline(always)]
fn hidden_slopes(
    mean_slopes: &[Lane; HIDDEN],
    exists: &Lane,
    choice_slopes: &[Lane; CHOICE],
    w_choice: &[f32],
) -> [Lane; HIDDEN] {
    let mut slopes = *mean_slopes;
    for slope in &mut slopes {
        let lanes = slope.iter_mut().zip(exists);
        lanes.for_each(|(slope, exists)| *slope *= 0.125 * exists);
    }
    for (slope, row) in choice_slopes.iter().zip(w_choice.chunks_exact(HIDDEN)) {
        back(&mut slopes, slope, row);
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::super::super::{
        GapCandidates, GapNetwork, GapVotes, Isa, add_gap_gradient, describe_hypotheses,
        score_hypotheses, weigh_hypotheses,
    };
    use super::*;
    use crate::kernel::GAP_WEIGHTS;

    fn weights() -> Vec<f32> {
        let mut random = fastrand::Rng::with_seed(7);
        (0..GAP_WEIGHTS).map(|_| random.f32() - 0.4).collect()
    }

    /// Pixels with random measurements.
    fn candidates() -> GapCandidates {
        let mut random = fastrand::Rng::with_seed(3);
        let mut candidates = GapCandidates::default();
        for k in 0..HYPOTHESES {
            for l in 0..LANES {
                candidates.exists[k][l] = k == 0 || random.f32() < 0.7;
                candidates.bin[k][l] = random.i32(0..600);
                candidates.distance[k][l] = random.i32(0..160);
                candidates.excess[k][l] = random.i32(0..200);
                candidates.right[k][l] = random.i32(-600..600);
                candidates.own[k][l] = random.i32(0..25);
            }
        }
        describe_hypotheses(Isa::BASELINE, &mut candidates);
        candidates
    }

    fn samples(candidates: &GapCandidates) -> GapSamples {
        let mut samples = GapSamples::default();
        for l in 0..LANES {
            for k in 0..HYPOTHESES {
                samples.exists[k][l] = f32::from(u8::from(candidates.exists[k][l]));
                for i in 0..HYPOTHESIS_FEATURES {
                    samples.features[k][i][l] = f32::from(candidates.feature(k, i, l)) / 64.0;
                }
            }
            for i in 0..PIXEL_FEATURES {
                samples.pixel[i][l] = f32::from(candidates.pixel_feature(i, l)) / 64.0;
            }
        }
        samples
    }

    #[test]
    fn votes_are_the_probabilities_in_whole_numbers() {
        // Small, so that no activation reaches its limit.
        let weights: Vec<_> = weights().iter().map(|w| 0.3 * w).collect();
        let mut rounded = Box::new([0; GAP_WEIGHTS]);
        let mut units = Vec::new();
        for (name, [rows, inputs]) in GAP_TENSORS {
            let unit = if name.ends_with("bias") {
                16_384.0
            } else {
                256.0
            };
            units.resize(units.len() + rows * inputs, unit);
        }
        for ((to, weight), unit) in rounded.iter_mut().zip(&weights).zip(units) {
            *to = (weight * unit).round() as i32;
        }
        let network = GapNetwork::new(&rounded).unwrap();
        let (candidates, mut pass) = (candidates(), GapPass::default());
        let mut votes: GapVotes = [[0; LANES]; HYPOTHESES + 1];
        weigh_hypotheses(Isa::BASELINE, &network, &candidates, &mut votes);
        score_hypotheses(Isa::BASELINE, &weights, &samples(&candidates), &mut pass);
        for l in 0..LANES {
            let sum: f32 = pass.scores.iter().map(|scores| scores[l].exp()).sum();
            for (votes, scores) in votes.iter().zip(&pass.scores) {
                let expected = 64.0 * scores[l].exp() / sum;
                assert!(
                    (f32::from(votes[l]) - expected).abs() < 3.0,
                    "{votes:?} {expected}"
                );
            }
        }
    }

    #[test]
    fn gradients_are_those_of_differences_on_every_instruction_set() {
        let (weights, samples) = (weights(), samples(&candidates()));
        let mut random = fastrand::Rng::with_seed(5);
        let slopes = std::array::from_fn(|k| {
            let slope = |l| {
                if k == HYPOTHESES || samples.exists[k][l] > 0.0 {
                    1.0
                } else {
                    0.0
                }
            };
            std::array::from_fn(|l| slope(l) * (random.f32() - 0.5))
        });
        let value = |weights: &[f32]| -> f64 {
            let mut pass = GapPass::default();
            score_hypotheses(Isa::BASELINE, weights, &samples, &mut pass);
            let products = pass.scores.iter().flatten().zip(slopes.iter().flatten());
            products
                .map(|(s, slope)| f64::from(*s) * f64::from(*slope))
                .sum()
        };
        let gradient = |isa| {
            let mut pass = GapPass::default();
            score_hypotheses(isa, &weights, &samples, &mut pass);
            let mut gradient = vec![[0.0; LANES]; GAP_WEIGHTS];
            add_gap_gradient(isa, &weights, &samples, &pass, &slopes, &mut gradient);
            gradient
        };
        let expected = gradient(Isa::BASELINE);
        assert!(Isa::available().all(|isa| gradient(isa) == expected));
        for i in (0..GAP_WEIGHTS).step_by(13) {
            let change = |by: f32| {
                let mut weights = weights.clone();
                weights[i] += by;
                value(&weights)
            };
            let difference = (change(1e-3) - change(-1e-3)) / 2e-3;
            let sum: f32 = expected[i].iter().sum();
            let error = (f64::from(sum) - difference).abs();
            assert!(
                error < 0.02 * (1.0 + difference.abs()),
                "{i}: {sum} {difference}"
            );
        }
    }
}
