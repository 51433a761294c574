//! A layer of a neural network: weighted sums of inputs.
//!
//! Floats are added in [`LANES`] partial sums, whatever the instruction set, so that every variant
//! gives the same bytes.

/// Partial sums; the length of a row of inputs or weights is a multiple of it.
pub const LANES: usize = 16;

/// Samples whose sums with one row of weights are computed together: each weight is read once for
/// them.
const TOGETHER: usize = 5;

/// See [`super::weighted_sums`].
#[inline(always)]
pub(super) fn sums(inputs: &[f32], weights: &[f32], bias: &[f32], stride: usize, out: &mut [f32]) {
    let neurons = bias.len();
    let blocks = inputs.chunks(TOGETHER * stride);
    for (inputs, out) in blocks.zip(out.chunks_mut(TOGETHER * neurons)) {
        match inputs.len() / stride {
            1 => block::<1>(inputs, weights, bias, stride, out),
            2 => block::<2>(inputs, weights, bias, stride, out),
            3 => block::<3>(inputs, weights, bias, stride, out),
            4 => block::<4>(inputs, weights, bias, stride, out),
            _ => block::<TOGETHER>(inputs, weights, bias, stride, out),
        }
    }
}

/// The sums of `N` samples.
#[inline(always)]
fn block<const N: usize>(
    inputs: &[f32],
    weights: &[f32],
    bias: &[f32],
    stride: usize,
    out: &mut [f32],
) {
    let neurons = bias.len();
    for (neuron, (weights, bias)) in weights.chunks_exact(stride).zip(bias).enumerate() {
        let sums = dots::<N>(inputs, weights, stride);
        for (sample, sum) in sums.into_iter().enumerate() {
            out[sample * neurons + neuron] = bias + sum;
        }
    }
}

#[inline(always)]
fn dots<const N: usize>(inputs: &[f32], weights: &[f32], stride: usize) -> [f32; N] {
    let weights = weights.as_chunks::<LANES>().0;
    let rows: [&[[f32; LANES]]; N] = std::array::from_fn(|sample| {
        let row = &inputs[sample * stride..(sample + 1) * stride];
        &row.as_chunks().0[..weights.len()]
    });
    let mut sums = [PartialSums([0.0; LANES]); N];
    for (at, weights) in weights.iter().enumerate() {
        for (sums, row) in sums.iter_mut().zip(rows) {
            *sums = sums.with_products(weights, &row[at]);
        }
    }
    std::array::from_fn(|sample| sums[sample].total())
}

/// By value, so that the compiler keeps them in registers.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct PartialSums([f32; LANES]);

impl PartialSums {
    #[inline(always)]
    fn with_products(self, a: &[f32; LANES], b: &[f32; LANES]) -> Self {
        let mut sums = self.0;
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
        Self(sums)
    }

    #[inline(always)]
    fn total(self) -> f32 {
        let mut lanes = self.0;
        let mut half = LANES / 2;
        while half > 0 {
            for lane in 0..half {
                lanes[lane] += lanes[lane + half];
            }
            half /= 2;
        }
        lanes[0]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Isa, weighted_sums};
    use super::*;

    pub(in super::super) fn some(n: usize, seed: u64) -> Vec<f32> {
        let mut random = fastrand::Rng::with_seed(seed);
        (0..n).map(|_| random.f32() - 0.5).collect()
    }

    /// In double precision, one product after the other.
    pub(in super::super) fn dot(a: &[f32], b: &[f32]) -> f64 {
        a.iter()
            .zip(b)
            .map(|(a, b)| f64::from(*a) * f64::from(*b))
            .sum()
    }

    #[test]
    fn sums_are_those_of_the_definition_on_every_instruction_set() {
        let (stride, neurons) = (5 * LANES, 3);
        // Blocks of all sizes.
        for samples in 1..=12 {
            let (inputs, weights) = (some(samples * stride, 1), some(neurons * stride, 2));
            let bias = some(neurons, 3);
            let sums = |isa| {
                let mut out = vec![0.0; samples * neurons];
                weighted_sums(isa, &inputs, &weights, &bias, stride, &mut out);
                out
            };
            let expected = sums(Isa::BASELINE);
            for (i, sum) in expected.iter().enumerate() {
                let (sample, neuron) = (i / neurons, i % neurons);
                let row = |rows: &[f32], i: usize| rows[i * stride..][..stride].to_vec();
                let definition =
                    f64::from(bias[neuron]) + dot(&row(&inputs, sample), &row(&weights, neuron));
                assert!((f64::from(*sum) - definition).abs() < 1e-5);
            }
            assert!(Isa::available().all(|isa| sums(isa) == expected));
        }
    }
}
