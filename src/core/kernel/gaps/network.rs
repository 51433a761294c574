//! The network in integers: 16-bit weights in 256ths, activations in 64ths, sums of 32 bits.

use super::super::pairs::{Group, Pairs};
use super::features::{GapCandidates, HYPOTHESIS_PAIRS, Inputs, PIXEL_PAIRS};
use super::{CHOICE, GAP_TENSORS, GAP_WEIGHTS, GapTensors, HIDDEN, HYPOTHESES, PIXEL, gap_tensors};

/// Weights of an output in pairs.
type PairRow<const N: usize> = [[i16; 2]; N];

const LANES: usize = Group::ROWS;

/// Greatest activation: 16 in 64ths.
const MAX_ACTIVATION: i32 = 1023;
/// The sum over the hypotheses is divided by 8.
const MEAN: i32 = 3;
/// From 64ths of 256ths to 64ths, and to 256ths.
const TO_ACTIVATION: i32 = 8;
const TO_SCORE: i32 = 6;

/// Scores that are this much below the greatest have no weight, 256ths.
const MAX_BELOW: usize = 2560;

/// The weights as the kernel reads them.
#[derive(Clone, Debug)]
pub struct GapNetwork {
    pixel: [PairRow<PIXEL_PAIRS>; PIXEL],
    pixel_bias: [i32; PIXEL],
    hypothesis: [PairRow<HYPOTHESIS_PAIRS>; HIDDEN],
    hypothesis_pixel: [PairRow<{ PIXEL / 2 }>; HIDDEN],
    hypothesis_bias: [[i32; HIDDEN]; HYPOTHESES],
    choice: [PairRow<{ HIDDEN / 2 }>; CHOICE],
    choice_mean: [PairRow<{ HIDDEN / 2 }>; CHOICE],
    choice_bias: [i32; CHOICE],
    score: PairRow<{ CHOICE / 2 }>,
    none_mean: PairRow<{ HIDDEN / 2 }>,
    none_pixel: PairRow<{ PIXEL / 2 }>,
    none_bias: i32,
    /// `65535·exp(−i/256)`, rounded.
    exp: Box<[u16; MAX_BELOW]>,
}

/// Votes of the pixels: of each hypothesis, and of none; about 64 for each pixel.
pub type GapVotes = [[u8; LANES]; HYPOTHESES + 1];

fn rows<const N: usize, const ROWS: usize>(weights: &[i32]) -> [PairRow<N>; ROWS] {
    let inputs = weights.len() / ROWS;
    let at = |row: usize, i: usize| {
        if i < inputs {
            weights[row * inputs + i] as i16
        } else {
            0
        }
    };
    std::array::from_fn(|row| std::array::from_fn(|i| [at(row, 2 * i), at(row, 2 * i + 1)]))
}

/// Weights that no [`GapNetwork`] can have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GapFault {
    #[error("a weight is not a finite number")]
    NotFinite,
    #[error("'{0}' has a weight beyond 16 bits")]
    Wide(&'static str),
    #[error("the sums of '{0}' could overflow")]
    Overflow(&'static str),
}

/// True if the greatest sums of a layer fit: inputs at their limits, all of one sign.
fn fits(bias: &[i32], outputs: usize, parts: &[(&[i32], i64)]) -> bool {
    (0..outputs).all(|output| {
        let max_part = |(weights, most): &(&[i32], i64)| {
            let inputs = weights.len() / outputs;
            let row = &weights[output * inputs..][..inputs];
            most * row.iter().map(|w| i64::from(w.abs())).sum::<i64>()
        };
        let max_bias = bias[output..].iter().step_by(outputs);
        let max_bias = max_bias.map(|b| i64::from(*b).abs()).max().unwrap_or(0);
        // Half a unit is added for rounding.
        parts.iter().map(max_part).sum::<i64>() + max_bias + 128 <= i32::MAX.into()
    })
}

/// Checks that no layer's sums can overflow.
fn check_sums(tensors: &GapTensors<&[i32]>) -> Result<(), GapFault> {
    let most = i64::from(MAX_ACTIVATION);
    let mean = (HYPOTHESES as i64 * most) >> MEAN;
    let check = |name, fits: bool| fits.then_some(()).ok_or(GapFault::Overflow(name));
    let parts = [(tensors.pixel, 127)];
    check("pixel", fits(tensors.pixel_bias, PIXEL, &parts))?;
    let parts = [(tensors.hypothesis, 127), (tensors.hypothesis_pixel, most)];
    check("hypothesis", fits(tensors.hypothesis_bias, HIDDEN, &parts))?;
    let parts = [(tensors.choice, most), (tensors.choice_mean, mean)];
    check("choice", fits(tensors.choice_bias, CHOICE, &parts))?;
    let parts = [(tensors.none_mean, mean), (tensors.none_pixel, most)];
    check("none", fits(tensors.none_bias, 1, &parts))
}

impl GapNetwork {
    /// From the weights in the order of [`GAP_TENSORS`]: 256ths, biases 16384ths.
    ///
    /// # Errors
    /// A weight beyond 16 bits, and weights whose sums could overflow 32 bits.
    pub fn new(weights: &[i32; GAP_WEIGHTS]) -> Result<Self, GapFault> {
        let tensors = gap_tensors(&weights[..]);
        let mut named = tensors.iter().zip(&GAP_TENSORS);
        let is_wide = |weight: &i32| i16::try_from(*weight).is_err();
        let wide =
            named.find(|(tensor, (name, _))| !name.ends_with("bias") && tensor.iter().any(is_wide));
        if let Some((_, (name, _))) = wide {
            return Err(GapFault::Wide(name));
        }
        let tensors = GapTensors::from(tensors);
        check_sums(&tensors)?;
        let rounded = |bias: i32, shift: i32| bias + (1 << (shift - 1));
        let [score] = rows(tensors.score);
        let ([none_mean], [none_pixel]) = (rows(tensors.none_mean), rows(tensors.none_pixel));
        // By products, as the exponentials of systems differ: this is e^(-1/256).
        let factor = 0.9961013694701175;
        let mut power = 65_535.5;
        let mut exp = Box::new([0; MAX_BELOW]);
        for value in exp.iter_mut() {
            *value = power as u16;
            power = (power - 0.5) * factor + 0.5;
        }
        Ok(Self {
            pixel: rows(tensors.pixel),
            pixel_bias: std::array::from_fn(|i| rounded(tensors.pixel_bias[i], TO_ACTIVATION)),
            hypothesis: rows(tensors.hypothesis),
            hypothesis_pixel: rows(tensors.hypothesis_pixel),
            hypothesis_bias: std::array::from_fn(|k| {
                std::array::from_fn(|i| {
                    rounded(tensors.hypothesis_bias[k * HIDDEN + i], TO_ACTIVATION)
                })
            }),
            choice: rows(tensors.choice),
            choice_mean: rows(tensors.choice_mean),
            choice_bias: std::array::from_fn(|i| rounded(tensors.choice_bias[i], TO_ACTIVATION)),
            score,
            none_mean,
            none_pixel,
            none_bias: rounded(tensors.none_bias[0], TO_SCORE),
            exp,
        })
    }
}

/// `bias + Σ inputs·weights` of each lane.
#[inline(always)]
fn add<const N: usize>(
    pairs: &impl Pairs,
    mut sum: Group<u32>,
    inputs: &Inputs<N>,
    weights: &PairRow<N>,
) -> Group<u32> {
    for (input, weights) in inputs.iter().zip(weights) {
        sum = pairs.add_products(sum, [*input, Group::splat(*weights)]);
    }
    sum
}

/// The activations of two outputs.
#[inline(always)]
fn activate(sums: [Group<u32>; 2]) -> Group<[i16; 2]> {
    let at = |sum: &Group<u32>, l: usize| {
        (sum.0[l] as i32 >> TO_ACTIVATION).clamp(0, MAX_ACTIVATION) as i16
    };
    let mut out = Group::splat([0; 2]);
    for l in 0..LANES {
        out.0[l] = [at(&sums[0], l), at(&sums[1], l)];
    }
    out
}

/// Computes a layer of `2·N` outputs in pairs; `sum` is the sum of an output. It writes to memory
/// that was cleared once: a result of its own would be cleared in each call.
#[inline(always)]
fn layer<const N: usize>(out: &mut Inputs<N>, sum: impl Fn(usize) -> Group<u32>) {
    for (i, out) in out.iter_mut().enumerate() {
        *out = activate([sum(2 * i), sum(2 * i + 1)]);
    }
}

#[inline(always)]
fn bias(value: i32) -> Group<u32> {
    Group::splat(value as u32)
}

/// See [`super::super::weigh_hypotheses`].
#[inline(always)]
pub(in super::super) fn weigh(
    pairs: impl Pairs,
    network: &GapNetwork,
    candidates: &GapCandidates,
    votes: &mut GapVotes,
) {
    let GapCandidates {
        inputs,
        pixel_inputs: pixel,
        exists,
        ..
    } = candidates;
    let pairs = &pairs;
    let mut z = [Group::splat([0; 2]); PIXEL / 2];
    layer(&mut z, |i| {
        add(pairs, bias(network.pixel_bias[i]), pixel, &network.pixel[i])
    });
    // The pixel's part of each hypothesis.
    let mut pixel_sums = [bias(0); HIDDEN];
    for (out, weights) in pixel_sums.iter_mut().zip(&network.hypothesis_pixel) {
        *out = add(pairs, bias(0), &z, weights);
    }
    let mut hidden = [[Group::splat([0; 2]); HIDDEN / 2]; HYPOTHESES];
    let mut mean = [Group::splat([0_i16; 2]); HIDDEN / 2];
    for (k, hidden) in hidden.iter_mut().enumerate() {
        layer(hidden, |i| {
            let mut sum = pixel_sums[i];
            for l in 0..LANES {
                sum.0[l] = sum.0[l].wrapping_add_signed(network.hypothesis_bias[k][i]);
            }
            add(pairs, sum, &inputs[k], &network.hypothesis[i])
        });
        add_existing(&mut mean, hidden, &exists[k]);
    }
    for mean in &mut mean {
        for l in 0..LANES {
            mean.0[l] = mean.0[l].map(|sum| sum >> MEAN);
        }
    }
    let mut scores = [[i32::MIN; LANES]; HYPOTHESES + 1];
    score_choices(pairs, network, (&z, &mean, &hidden), exists, &mut scores);
    vote(network, &scores, votes);
}

/// The scores of the hypotheses, and of none, from the activations of the pixel, their mean and
/// those of the hypotheses.
#[inline(always)]
fn score_choices(
    pairs: &impl Pairs,
    network: &GapNetwork,
    (z, mean, hidden): (
        &Inputs<{ PIXEL / 2 }>,
        &Inputs<{ HIDDEN / 2 }>,
        &[Inputs<{ HIDDEN / 2 }>; HYPOTHESES],
    ),
    exists: &[[bool; LANES]; HYPOTHESES],
    scores: &mut [[i32; LANES]; HYPOTHESES + 1],
) {
    let mut mean_sums = [bias(0); CHOICE];
    for (i, out) in mean_sums.iter_mut().enumerate() {
        *out = add(
            pairs,
            bias(network.choice_bias[i]),
            mean,
            &network.choice_mean[i],
        );
    }
    let score = |sum: Group<u32>| sum.0.map(|sum| sum as i32 >> TO_SCORE);
    let none = add(pairs, bias(network.none_bias), mean, &network.none_mean);
    scores[HYPOTHESES] = score(add(pairs, none, z, &network.none_pixel));
    let mut choice = [Group::splat([0; 2]); CHOICE / 2];
    for k in 0..HYPOTHESES {
        layer(&mut choice, |i| {
            add(pairs, mean_sums[i], &hidden[k], &network.choice[i])
        });
        let hypothesis_scores = score(add(
            pairs,
            bias(1 << (TO_SCORE - 1)),
            &choice,
            &network.score,
        ));
        let lanes = scores[k].iter_mut().zip(hypothesis_scores).zip(exists[k]);
        lanes.for_each(|((out, score), exists)| *out = if exists { score } else { i32::MIN });
    }
}

/// Adds the activations of a hypothesis in the lanes in which it exists.
#[inline(always)]
fn add_existing<const N: usize>(
    sums: &mut Inputs<N>,
    activations: &Inputs<N>,
    exists: &[bool; LANES],
) {
    for (sums, activations) in sums.iter_mut().zip(activations) {
        let lanes = sums.0.iter_mut().zip(&activations.0).zip(exists);
        for ((sums, [a, b]), exists) in lanes {
            let is = i16::from(*exists).wrapping_neg();
            *sums = [sums[0] + (a & is), sums[1] + (b & is)];
        }
    }
}

/// The softmax of the scores in votes: `(64·x + ⌊Σ/2⌋) / Σ` of the table's values.
#[inline(always)]
fn vote(network: &GapNetwork, scores: &[[i32; LANES]; HYPOTHESES + 1], votes: &mut GapVotes) {
    let mut most = [i32::MIN; LANES];
    for score in scores {
        for l in 0..LANES {
            most[l] = most[l].max(score[l]);
        }
    }
    let (mut weights, mut sum) = ([[0_u32; LANES]; HYPOTHESES + 1], [0_u32; LANES]);
    for (weights, score) in weights.iter_mut().zip(scores) {
        for l in 0..LANES {
            let below = most[l].wrapping_sub(score[l]) as u32;
            let weight = network.exp.get(below as usize).copied().unwrap_or(0);
            weights[l] = weight.into();
            sum[l] += weights[l];
        }
    }
    for (votes, weights) in votes.iter_mut().zip(&weights) {
        for l in 0..LANES {
            // Floats hold these numbers, and their quotient is not rounded up to a whole number: it
            // is below 65, and the sum below 2^20.
            let quotient = (64 * weights[l] + sum[l] / 2) as f32 / sum[l] as f32;
            // SAFETY: as above; the greatest score alone makes the sum positive.
            votes[l] = unsafe { quotient.to_int_unchecked::<i32>() } as u8;
        }
    }
}
