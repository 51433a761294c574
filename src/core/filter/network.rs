//! A feed-forward network with one hidden layer of tanh and one output (thesis, section 8.1).

use super::math::tanh;
use crate::error::{Error, Result};
use crate::kernel::{self, Isa, LANES};

/// The weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    inputs: usize,
    /// A row per hidden neuron, padded with zeros after the inputs.
    weights: Vec<f32>,
    bias: Vec<f32>,
    out_weights: Vec<f32>,
    out_bias: f32,
}

/// Most hidden neurons, so that a file cannot demand unlimited memory.
const MAX_HIDDEN: usize = 10_000;

impl Network {
    /// From rows of `inputs` weights, one per hidden neuron, their biases, and the weights and bias
    /// of the output.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a wrong number of weights, and for values that are not finite.
    pub fn new(
        inputs: usize,
        weights: &[f32],
        bias: Vec<f32>,
        out_weights: Vec<f32>,
        out_bias: f32,
    ) -> Result<Self> {
        let hidden = bias.len();
        let wrong = |what: &str| Err(Error::Invalid(format!("network: {what}")));
        if inputs == 0 || !(1..=MAX_HIDDEN).contains(&hidden) {
            return wrong(&format!(
                "{hidden} hidden neurons; expected 1 to {MAX_HIDDEN}"
            ));
        }
        if weights.len() != inputs * hidden || out_weights.len() != hidden {
            return wrong("the number of its weights does not match its inputs and neurons");
        }
        let all = weights.iter().chain(&bias).chain(&out_weights);
        if !all.chain([&out_bias]).all(|weight| weight.is_finite()) {
            return wrong("a weight is not a finite number");
        }
        let stride = inputs.next_multiple_of(LANES);
        let mut padded = vec![0.0; stride * hidden];
        for (to, from) in padded.chunks_mut(stride).zip(weights.chunks(inputs)) {
            to[..inputs].copy_from_slice(from);
        }
        Ok(Self {
            inputs,
            weights: padded,
            bias,
            out_weights,
            out_bias,
        })
    }

    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of hidden neurons.
    pub fn hidden(&self) -> usize {
        self.bias.len()
    }

    /// The weights of the hidden neurons' inputs, a row of [`Network::inputs`] each.
    pub fn rows(&self) -> impl Iterator<Item = &[f32]> {
        let stride = self.inputs.next_multiple_of(LANES);
        self.weights
            .chunks_exact(stride)
            .map(|row| &row[..self.inputs])
    }

    pub fn bias(&self) -> &[f32] {
        &self.bias
    }

    /// Weights and bias of the output.
    pub fn output(&self) -> (&[f32], f32) {
        (&self.out_weights, self.out_bias)
    }

    /// The log odds of each row of `inputs`, whose length is a multiple of [`LANES`]. `hidden` is
    /// scratch memory.
    pub fn scores(&self, isa: Isa, inputs: &[f32], hidden: &mut Vec<f32>, out: &mut [f32]) {
        let stride = self.inputs.next_multiple_of(LANES);
        hidden.resize(out.len() * self.hidden(), 0.0);
        kernel::weighted_sums(isa, inputs, &self.weights, &self.bias, stride, hidden);
        for (out, hidden) in out.iter_mut().zip(hidden.chunks_exact(self.hidden())) {
            let sums = hidden.iter().zip(&self.out_weights);
            *out = sums.fold(self.out_bias, |sum, (h, w)| sum + tanh(*h) * w);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_tanh_of_sums_on_every_instruction_set() {
        let (inputs, hidden, samples) = (37, 5, 6);
        let mut random = fastrand::Rng::with_seed(1);
        let mut some = |n: usize| (0..n).map(|_| random.f32() - 0.5).collect::<Vec<_>>();
        let (weights, bias, out) = (some(inputs * hidden), some(hidden), some(hidden));
        let network = Network::new(inputs, &weights, bias.clone(), out.clone(), 0.25).unwrap();
        let mut rows = vec![0.0; samples * 48];
        for row in rows.chunks_exact_mut(48) {
            row[..inputs].copy_from_slice(&some(inputs));
        }
        let mut all = Vec::new();
        for isa in Isa::available() {
            let mut scores = vec![0.0; samples];
            network.scores(isa, &rows, &mut Vec::new(), &mut scores);
            for (score, row) in scores.iter().zip(rows.chunks(48)) {
                let neuron = |h: usize| {
                    let weights = &weights[h * inputs..][..inputs];
                    let sum: f32 = weights.iter().zip(row).map(|(w, x)| w * x).sum();
                    out[h] * (bias[h] + sum).tanh()
                };
                let expected = 0.25 + (0..hidden).map(neuron).sum::<f32>();
                assert!((score - expected).abs() < 1e-5, "{score} {expected}");
            }
            all.push(scores);
        }
        assert!(all.iter().all(|scores| *scores == all[0]));
    }

    #[test]
    fn other_weights_are_refused() {
        let network = |weights: &[f32], bias: usize| {
            Network::new(2, weights, vec![0.0; bias], vec![0.0; bias], 0.0)
        };
        assert!(network(&[1.0; 4], 2).is_ok());
        assert!(network(&[1.0; 5], 2).is_err() && network(&[], 0).is_err());
        let error = network(&[1.0, f32::NAN], 1).unwrap_err().to_string();
        assert!(error.contains("not a finite number"), "{error}");
    }
}
