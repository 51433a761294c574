//! Trains a [`Network`]: back-propagation in mini-batches, early stopping on a validation set.
//!
//! Features are standardized to mean 0 and deviation 1 over the training set, which is folded into
//! the weights. The loss is the cross-entropy of the output's probability; the steps are Adam's
//! (Kingma and Ba, ICLR 2015). Each hidden neuron is trained by one thread, and batches are
//! sequential, so that the result is the same on any number of threads.

use super::{SamplePart, WindowSamples};
use rayon::prelude::*;
use svl_core::Result;
use svl_core::filter::{Network, logistic, tanh};
use svl_core::kernel::{self, AdamStep, Isa};

/// Settings of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    pub hidden: usize,
    /// Seed of the initial weights and the order of the samples.
    pub seed: u64,
    pub most_epochs: usize,
}

/// Samples whose gradients are summed before a step.
const BATCH: usize = 64;
const RATE: f32 = 5e-4;
/// Epochs without a better validation loss after which the training ends.
const PATIENCE: usize = 6;
/// Neurons that a thread trains at a time.
const NEURONS: usize = 4;

/// Errors after an epoch: mean squares of probability minus category, 0..=1.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct EpochError {
    pub training: f64,
    pub validation: f64,
}

/// A trained network.
#[derive(Clone, Debug)]
pub struct FittedNetwork {
    /// The network of the epoch with the least validation loss, for standardized features.
    standardized: Network,
    pub epochs: Vec<EpochError>,
    /// Number of the best epoch, from 1.
    pub best_epoch: usize,
    pub interrupted: bool,
}

/// Means and inverse deviations of the features.
#[derive(Clone, Debug)]
pub struct Standard {
    mean: Vec<f32>,
    scale: Vec<f32>,
}

impl Standard {
    /// Standardizes the features of all samples in place by those of the training set.
    pub fn apply(samples: &mut WindowSamples) -> Self {
        let (count, stride) = (samples.features.count(), samples.features.stride());
        let training: Vec<_> = samples.indices(SamplePart::Training).collect();
        let mut mean = vec![0.0f64; count];
        let mut square = vec![0.0f64; count];
        for &i in &training {
            let row = &samples.inputs[i * stride..][..count];
            for ((mean, square), value) in mean.iter_mut().zip(&mut square).zip(row) {
                *mean += f64::from(*value);
                *square += f64::from(*value) * f64::from(*value);
            }
        }
        let n = training.len().max(1) as f64;
        let deviation = |(mean, square): (&f64, &f64)| {
            let variance = square / n - (mean / n) * (mean / n);
            // A constant feature carries no information.
            let least = 1e-12 * (1.0 + (mean / n) * (mean / n));
            if variance > least {
                (1.0 / variance.sqrt()) as f32
            } else {
                0.0
            }
        };
        let scale: Vec<_> = mean.iter().zip(&square).map(deviation).collect();
        let mean: Vec<_> = mean.iter().map(|sum| (sum / n) as f32).collect();
        samples.inputs.par_chunks_exact_mut(stride).for_each(|row| {
            for ((value, mean), scale) in row.iter_mut().zip(&mean).zip(&scale) {
                *value = (*value - mean) * scale;
            }
        });
        Self { mean, scale }
    }
}

/// Hidden neurons with the state of their steps.
struct Neurons {
    weights: Vec<f32>,
    means: Vec<f32>,
    squares: Vec<f32>,
    gradient: Vec<f32>,
    bias: Vec<f32>,
    /// Weights of the output.
    out: Vec<f32>,
    /// Means and squares of the steps of biases and of the output's weights.
    small: [Vec<f32>; 4],
    /// Activations for the batch's samples, a row of neurons each.
    activations: Vec<f32>,
}

struct Trained {
    neurons: Vec<Neurons>,
    out_bias: f32,
    out_steps: [f32; 2],
    steps: i32,
}

/// Trains on standardized samples ([`Standard::apply`]).
///
/// `progress` is called after every epoch with its number and errors; if it returns false, the
/// training ends with the best network so far.
///
/// # Errors
/// None: trained weights are finite.
pub fn fit_network(
    samples: &WindowSamples,
    settings: FitSettings,
    isa: Isa,
    progress: &mut dyn FnMut(usize, EpochError) -> bool,
) -> Result<FittedNetwork> {
    let (count, stride) = (samples.features.count(), samples.features.stride());
    let mut random = fastrand::Rng::with_seed(settings.seed);
    let mut trained = Trained::new(settings.hidden, count, stride, &mut random);
    let mut order: Vec<_> = samples.indices(SamplePart::Training).collect();
    let validation: Vec<_> = samples.indices(SamplePart::Validation).collect();
    let mut batch = vec![0.0; BATCH * stride];
    let mut best = (f64::INFINITY, 0, trained.network(count)?);
    let mut epochs = Vec::new();
    let mut interrupted = false;
    while epochs.len() < settings.most_epochs && epochs.len() < best.1 + PATIENCE {
        random.shuffle(&mut order);
        let mut squares = 0.0;
        for indices in order.chunks(BATCH) {
            let rows = samples.gather(indices, &mut batch);
            let scores = trained.forward(rows, stride, isa);
            let errors: Vec<_> = (indices.iter().zip(&scores))
                .map(|(&i, &score)| logistic(score) - f32::from(u8::from(samples.samples[i].is)))
                .collect();
            squares += errors.iter().map(|e| f64::from(e * e)).sum::<f64>();
            trained.step(rows, &errors, samples.kind.spec().decay, isa);
        }
        let (mut loss, mut wrong) = (0.0, 0.0);
        for indices in validation.chunks(BATCH) {
            let rows = samples.gather(indices, &mut batch);
            for (&i, score) in indices.iter().zip(trained.forward(rows, stride, isa)) {
                let is = samples.samples[i].is;
                let signed = f64::from(if is { -score } else { score });
                // ln(1 + e^x) without overflow.
                loss += signed.max(0.0) + (-signed.abs()).exp().ln_1p();
                let error = logistic(score) - f32::from(u8::from(is));
                wrong += f64::from(error * error);
            }
        }
        let epoch = EpochError {
            training: squares / order.len().max(1) as f64,
            validation: wrong / validation.len().max(1) as f64,
        };
        epochs.push(epoch);
        if loss < best.0 {
            best = (loss, epochs.len(), trained.network(count)?);
        }
        if !progress(epochs.len(), epoch) {
            interrupted = true;
            break;
        }
    }
    Ok(FittedNetwork {
        standardized: best.2,
        epochs,
        best_epoch: best.1,
        interrupted,
    })
}

impl Neurons {
    /// One step of each neuron by the errors of the samples. `steps`: of the weights, and of biases
    /// and the output.
    fn step(&mut self, rows: &[f32], errors: &[f32], steps: [AdamStep; 2], isa: Isa) {
        let [decaying, plain] = steps;
        let share = 1.0 / errors.len() as f32;
        let n = self.bias.len();
        let [bias_mean, bias_square, out_mean, out_square] = &mut self.small;
        let stride = self.gradient.len();
        let mut slopes = vec![0.0; errors.len()];
        for neuron in 0..n {
            let activations = self.activations[neuron..].iter().step_by(n);
            let (mut bias_gradient, mut out_gradient) = (0.0, 0.0);
            for ((slope, error), activation) in slopes.iter_mut().zip(errors).zip(activations) {
                out_gradient += share * error * activation;
                *slope = share * error * self.out[neuron] * (1.0 - activation * activation);
                bias_gradient += *slope;
            }
            self.gradient.fill(0.0);
            kernel::add_scaled(isa, rows, &slopes, &mut self.gradient);
            let row = neuron * stride..(neuron + 1) * stride;
            let means = &mut self.means[row.clone()];
            let squares = &mut self.squares[row.clone()];
            let weights = &mut self.weights[row];
            kernel::adam(isa, decaying, &self.gradient, means, squares, weights);
            let one = neuron..neuron + 1;
            let (mean, square) = (&mut bias_mean[one.clone()], &mut bias_square[one.clone()]);
            let bias = &mut self.bias[one.clone()];
            kernel::adam(isa, plain, &[bias_gradient], mean, square, bias);
            let (mean, square) = (&mut out_mean[one.clone()], &mut out_square[one.clone()]);
            let out = &mut self.out[one];
            kernel::adam(isa, plain, &[out_gradient], mean, square, out);
        }
    }
}

impl Trained {
    /// Weights uniform in ±√(6 / (inputs + outputs)) (Glorot and Bengio, AISTATS 2010).
    fn new(hidden: usize, count: usize, stride: usize, random: &mut fastrand::Rng) -> Self {
        let mut between = |bound: f32| bound * (2.0 * random.f32() - 1.0);
        let bound = (6.0 / (count + hidden) as f32).sqrt();
        let out_bound = (6.0 / (hidden + 1) as f32).sqrt();
        let mut left = hidden;
        let mut neurons = Vec::new();
        while left > 0 {
            let n = left.min(NEURONS);
            left -= n;
            let mut weights = vec![0.0; n * stride];
            for row in weights.chunks_exact_mut(stride) {
                row[..count].iter_mut().for_each(|w| *w = between(bound));
            }
            neurons.push(Neurons {
                means: vec![0.0; weights.len()],
                squares: vec![0.0; weights.len()],
                gradient: vec![0.0; stride],
                weights,
                bias: vec![0.0; n],
                out: (0..n).map(|_| between(out_bound)).collect(),
                small: std::array::from_fn(|_| vec![0.0; n]),
                activations: Vec::new(),
            });
        }
        Self {
            neurons,
            out_bias: 0.0,
            out_steps: [0.0; 2],
            steps: 0,
        }
    }

    /// The log odds of rows of inputs.
    fn forward(&mut self, rows: &[f32], stride: usize, isa: Isa) -> Vec<f32> {
        let count = rows.len() / stride;
        self.neurons.par_iter_mut().for_each(|group| {
            group.activations.resize(count * group.bias.len(), 0.0);
            let out = &mut group.activations;
            kernel::weighted_sums(isa, rows, &group.weights, &group.bias, stride, out);
            out.iter_mut().for_each(|value| *value = tanh(*value));
        });
        let mut scores = vec![self.out_bias; count];
        for group in &self.neurons {
            let rows = group.activations.chunks_exact(group.out.len());
            for (score, row) in scores.iter_mut().zip(rows) {
                *score = row
                    .iter()
                    .zip(&group.out)
                    .fold(*score, |sum, (a, w)| sum + a * w);
            }
        }
        scores
    }

    /// One step by the errors of the samples of the last [`Trained::forward`].
    fn step(&mut self, rows: &[f32], errors: &[f32], decay: f32, isa: Isa) {
        self.steps += 1;
        let corrected = |beta: f64| 1.0 - beta.powi(self.steps);
        let rate = f64::from(RATE) * corrected(0.999).sqrt() / corrected(0.9);
        let plain = AdamStep {
            rate: rate as f32,
            decay: 0.0,
        };
        let decaying = AdamStep { decay, ..plain };
        let steps = [decaying, plain];
        let groups = self.neurons.par_iter_mut();
        groups.for_each(|group| group.step(rows, errors, steps, isa));
        let share = 1.0 / errors.len() as f32;
        let gradient = share * errors.iter().sum::<f32>();
        let [mean, square] = &mut self.out_steps;
        let (mean, square) = (std::slice::from_mut(mean), std::slice::from_mut(square));
        let bias = std::slice::from_mut(&mut self.out_bias);
        kernel::adam(isa, plain, &[gradient], mean, square, bias);
    }

    fn network(&self, count: usize) -> Result<Network> {
        let (mut weights, mut biases, mut out) = (Vec::new(), Vec::new(), Vec::new());
        for group in &self.neurons {
            let rows = group.weights.chunks_exact(group.gradient.len());
            weights.extend(rows.flat_map(|row| &row[..count]));
            biases.extend(&group.bias);
            out.extend(&group.out);
        }
        Network::new(count, &weights, biases, out, self.out_bias)
    }
}

impl FittedNetwork {
    /// The log odds of a part's standardized samples.
    pub fn scores(&self, samples: &WindowSamples, part: SamplePart, isa: Isa) -> Vec<f32> {
        let indices: Vec<_> = samples.indices(part).collect();
        let mut batch = vec![0.0; BATCH * samples.features.stride()];
        let (mut hidden, mut scores) = (Vec::new(), vec![0.0; indices.len()]);
        for (indices, scores) in indices.chunks(BATCH).zip(scores.chunks_mut(BATCH)) {
            let rows = samples.gather(indices, &mut batch);
            self.standardized.scores(isa, rows, &mut hidden, scores);
        }
        scores
    }

    /// Adds an offset to all scores.
    pub fn shift(&mut self, by: f32) -> Result<()> {
        let network = &self.standardized;
        let weights: Vec<_> = network.rows().flatten().copied().collect();
        let (out, out_bias) = network.output();
        let (bias, out) = (network.bias().to_vec(), out.to_vec());
        self.standardized = Network::new(network.inputs(), &weights, bias, out, out_bias + by)?;
        Ok(())
    }

    /// The network for features that are not standardized.
    pub fn network(&self, standard: &Standard) -> Result<Network> {
        let network = &self.standardized;
        let (mut weights, mut biases) = (Vec::new(), Vec::new());
        for (row, bias) in network.rows().zip(network.bias()) {
            let first = weights.len();
            weights.extend(row.iter().zip(&standard.scale).map(|(w, s)| w * s));
            let shift = weights[first..].iter().zip(&standard.mean);
            let shift: f64 = shift.map(|(w, m)| f64::from(*w) * f64::from(*m)).sum();
            biases.push((f64::from(*bias) - shift) as f32);
        }
        let (out, out_bias) = network.output();
        Network::new(network.inputs(), &weights, biases, out.to_vec(), out_bias)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::filter::WindowSample;
    use svl_core::filter::{Features, FilterKind, Scaling};

    /// Samples decided by the sum of two features, of the training and the validation set.
    fn samples(count: usize) -> WindowSamples {
        let features = Features {
            window: 4,
            scaling: Scaling::Amplitude,
        };
        let parts = vec![SamplePart::Training, SamplePart::Validation];
        let mut samples = WindowSamples::new(FilterKind::Floor, features, parts);
        let mut random = fastrand::Rng::with_seed(7);
        for i in 0..count {
            let mut row: Vec<_> = (0..9).map(|_| 100.0 + 10.0 * random.f32()).collect();
            // A feature without information.
            row[4] = 5.0;
            let is = row[2] + row[6] > 210.0;
            row.resize(features.stride(), 0.0);
            samples.inputs.extend(row);
            samples.samples.push(WindowSample {
                group: i % 2,
                sequence: 0,
                window: 0,
                is,
                pixels: Vec::new(),
            });
        }
        samples
    }

    fn settings() -> FitSettings {
        FitSettings {
            hidden: 6,
            seed: 3,
            most_epochs: 500,
        }
    }

    #[test]
    fn it_learns_the_same_on_any_number_of_threads() {
        let plain = samples(1200);
        let mut standardized = plain.clone();
        let standard = Standard::apply(&mut standardized);
        let fit = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let fit =
                || fit_network(&standardized, settings(), Isa::BASELINE, &mut |_, _| true).unwrap();
            pool.build().unwrap().install(fit)
        };
        let fitted = fit(1);
        assert!(
            fitted.epochs[fitted.best_epoch - 1].validation < 0.05,
            "{:?}",
            fitted.epochs
        );
        let network = fitted.network(&standard).unwrap();
        assert_eq!(fit(3).network(&standard).unwrap(), network);
        // On raw features it gives the same scores.
        let stride = plain.features.stride();
        let mut scores = vec![0.0; 1200];
        network.scores(Isa::BASELINE, &plain.inputs, &mut Vec::new(), &mut scores);
        let own = fitted.scores(&standardized, SamplePart::Training, Isa::BASELINE);
        for (a, b) in scores.iter().step_by(2).zip(own) {
            assert!((a - b).abs() < 2e-2, "{a} {b}");
        }
        assert_eq!(plain.inputs.len(), 1200 * stride);
    }

    #[test]
    fn an_interrupted_training_keeps_the_best_network() {
        let mut data = samples(400);
        Standard::apply(&mut data);
        let fit = |most: usize| {
            let mut until = |epoch: usize, _: EpochError| epoch < most;
            fit_network(&data, settings(), Isa::BASELINE, &mut until).unwrap()
        };
        let (two, three) = (fit(2), fit(3));
        assert_eq!((two.epochs.len(), two.interrupted), (2, true));
        assert_eq!(two.epochs[..], three.epochs[..2]);
    }
}
