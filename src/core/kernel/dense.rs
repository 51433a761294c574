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

/// See [`super::add_scaled`].
#[inline(always)]
pub(super) fn add(rows: &[f32], factors: &[f32], out: &mut [f32]) {
    let length = out.len();
    // Four at once: `out` is read once for them.
    for (rows, factors) in rows.chunks(4 * length).zip(factors.chunks(4)) {
        if let &[a, b, c, d] = factors {
            let (rows, last) = rows.split_at(3 * length);
            let (first, third) = rows.split_at(2 * length);
            let (first, second) = first.split_at(length);
            let rows = first.iter().zip(second).zip(third).zip(last);
            for (out, (((i, j), k), l)) in out.iter_mut().zip(rows) {
                *out = *out + a * i + b * j + c * k + d * l;
            }
        } else {
            for (row, factor) in rows.chunks_exact(length).zip(factors) {
                for (out, value) in out.iter_mut().zip(row) {
                    *out += factor * value;
                }
            }
        }
    }
}

/// A step of Adam (Kingma and Ba, ICLR 2015).
#[derive(Clone, Copy, Debug)]
pub struct AdamStep {
    /// Learning rate, corrected for the bias of the first steps.
    pub rate: f32,
    /// Weight of the L2 penalty.
    pub decay: f32,
}

/// See [`super::adam`].
#[inline(always)]
pub(super) fn adam(
    step: AdamStep,
    gradient: &[f32],
    mean: &mut [f32],
    square: &mut [f32],
    weights: &mut [f32],
) {
    let values = mean.iter_mut().zip(square).zip(weights);
    for (gradient, ((mean, square), weight)) in gradient.iter().zip(values) {
        let gradient = gradient + step.decay * *weight;
        *mean = 0.9 * *mean + 0.1 * gradient;
        *square = 0.999 * *square + 0.001 * (gradient * gradient);
        *weight -= step.rate * *mean / (square.sqrt() + 1e-8);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Isa, adam as adam_on, add_scaled, weighted_sums};
    use super::*;

    fn some(n: usize, seed: u64) -> Vec<f32> {
        let mut random = fastrand::Rng::with_seed(seed);
        (0..n).map(|_| random.f32() - 0.5).collect()
    }

    /// In double precision, one product after the other.
    fn dot(a: &[f32], b: &[f32]) -> f64 {
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

    #[test]
    fn steps_of_training_are_the_same_on_every_instruction_set() {
        let (length, rows) = (37, 7);
        let (values, factors) = (some(rows * length, 4), some(rows, 5));
        let step = AdamStep {
            rate: 0.01,
            decay: 0.1,
        };
        let trained = |isa| {
            let mut gradient = some(length, 6);
            add_scaled(isa, &values, &factors, &mut gradient);
            let [mut mean, mut square, mut weights] = [7, 8, 9].map(|seed| some(length, seed));
            square.iter_mut().for_each(|value| *value = value.abs());
            adam_on(isa, step, &gradient, &mut mean, &mut square, &mut weights);
            (gradient, weights)
        };
        let (gradient, weights) = trained(Isa::BASELINE);
        for (i, value) in gradient.iter().enumerate() {
            let column: Vec<_> = (0..rows).map(|row| values[row * length + i]).collect();
            let definition = f64::from(some(length, 6)[i]) + dot(&column, &factors);
            assert!((f64::from(*value) - definition).abs() < 1e-5);
        }
        let (mean, square) = (some(length, 7)[0], some(length, 8)[0].abs());
        let slope = gradient[0] + step.decay * some(length, 9)[0];
        let change = (0.9 * mean + 0.1 * slope) / (0.999 * square + 0.001 * slope * slope).sqrt();
        assert!((weights[0] - (some(length, 9)[0] - step.rate * change)).abs() < 1e-5);
        assert!(Isa::available().all(|isa| trained(isa) == (gradient.clone(), weights.clone())));
    }
}
