//! Steps of gradient descent, for the training of networks.

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
    use super::super::dense::tests::{dot, some};
    use super::super::{AdamStep, Isa, adam, add_scaled};

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
            adam(isa, step, &gradient, &mut mean, &mut square, &mut weights);
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
