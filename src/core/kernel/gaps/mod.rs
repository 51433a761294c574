//! The network of v5's gaps (docs/v5.md, *Learned gaps*): for each pixel it weighs a few
//! disparities that the scene may have there, and *none* of them.
//!
//! Lanes are pixels. [`features`] and [`network`] are integers alone; [`training`] has the same
//! network in floats.

pub(super) mod features;
pub(super) mod network;
#[cfg(feature = "internal")]
pub(super) mod training;

pub use features::GapCandidates;
pub use network::{GapFault, GapNetwork, GapVotes};
#[cfg(feature = "internal")]
pub use training::{GapPass, GapSamples};

/// Disparities of a pixel: its own winner; the nearest seen to the left, right, above, below; the
/// next seen in each direction that is another surface; interpolated along row and column; the
/// winner at quarter size.
pub const HYPOTHESES: usize = 12;

/// Numbers that describe a hypothesis, and a pixel, in 64ths.
pub const HYPOTHESIS_FEATURES: usize = 15;
pub const PIXEL_FEATURES: usize = 17;

/// Outputs of the layers: of the pixel, of a hypothesis, of a hypothesis beside all others.
pub(super) const PIXEL: usize = 16;
pub(super) const HIDDEN: usize = 24;
pub(super) const CHOICE: usize = 16;

/// Names and sizes of the weights, in the order in which they lie one after the other: rows, one
/// per output, and inputs.
pub const GAP_TENSORS: [(&str, [usize; 2]); 12] = [
    ("pixel.weight", [PIXEL, PIXEL_FEATURES]),
    ("pixel.bias", [1, PIXEL]),
    ("hypothesis.weight", [HIDDEN, HYPOTHESIS_FEATURES]),
    ("hypothesis.pixel", [HIDDEN, PIXEL]),
    ("hypothesis.bias", [HYPOTHESES, HIDDEN]),
    ("choice.weight", [CHOICE, HIDDEN]),
    ("choice.mean", [CHOICE, HIDDEN]),
    ("choice.bias", [1, CHOICE]),
    ("score.weight", [1, CHOICE]),
    ("none.mean", [1, HIDDEN]),
    ("none.pixel", [1, PIXEL]),
    ("none.bias", [1, 1]),
];

/// The weights of each tensor, or what else it has.
pub(super) struct GapTensors<T> {
    pub(super) pixel: T,
    pub(super) pixel_bias: T,
    pub(super) hypothesis: T,
    pub(super) hypothesis_pixel: T,
    pub(super) hypothesis_bias: T,
    pub(super) choice: T,
    pub(super) choice_mean: T,
    pub(super) choice_bias: T,
    pub(super) score: T,
    pub(super) none_mean: T,
    pub(super) none_pixel: T,
    pub(super) none_bias: T,
}

impl<T> From<[T; GAP_TENSORS.len()]> for GapTensors<T> {
    fn from(tensors: [T; GAP_TENSORS.len()]) -> Self {
        let mut tensors = tensors.into_iter();
        let mut next = || tensors.next().expect("one for each field");
        Self {
            pixel: next(),
            pixel_bias: next(),
            hypothesis: next(),
            hypothesis_pixel: next(),
            hypothesis_bias: next(),
            choice: next(),
            choice_mean: next(),
            choice_bias: next(),
            score: next(),
            none_mean: next(),
            none_pixel: next(),
            none_bias: next(),
        }
    }
}

/// Number of weights.
pub const GAP_WEIGHTS: usize = {
    let (mut sum, mut i) = (0, 0);
    while i < GAP_TENSORS.len() {
        sum += GAP_TENSORS[i].1[0] * GAP_TENSORS[i].1[1];
        i += 1;
    }
    sum
};

/// The weights of each tensor.
fn gap_tensors<T>(mut weights: &[T]) -> [&[T]; GAP_TENSORS.len()] {
    GAP_TENSORS.map(|(_, [rows, inputs])| {
        let (tensor, rest) = weights.split_at(rows * inputs);
        weights = rest;
        tensor
    })
}
