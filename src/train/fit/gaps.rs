//! Trains the network of v5's gaps: back-propagation in batches with Adam (Kingma and Ba, ICLR
//! 2015), its rate falling along a cosine.
//!
//! The loss of a pixel is `−ln(Σ pᵢ·exp(−|dᵢ − t| / τ) + 0.03·p_none)` with its disparities `dᵢ`
//! and the truth `t` in bins of 1/8 pixel, and `τ = 6 + 4 % of t`: weights are probabilities.
//! Batches are divided in the same way on any number of threads, so the result is the same.

use rayon::prelude::*;
use svl_core::filter::exp;
use svl_core::kernel::{
    AdamStep, GAP_TENSORS, GAP_WEIGHTS, GapPass, GapSamples, Group, HYPOTHESES,
    HYPOTHESIS_FEATURES, Isa, PIXEL_FEATURES, adam, add_gap_gradient, score_hypotheses,
};
use svl_core::matcher::GapSampler;
use svl_core::stereo::Frame;
use svl_core::{Error, Result};

const LANES: usize = Group::ROWS;

/// Samples of a batch, and of a part that one thread computes at a time.
const BATCH: usize = 1024;
const PART: usize = 128;

/// The rate begins at this, and falls to a hundredth; the first steps lead up to it.
const RATE: f64 = 3e-3;
const FIRST_STEPS: f64 = 50.0;
/// Greatest norm of a gradient.
const STEEPEST: f32 = 1.0;

/// Value of *none* in the loss.
const NONE: f32 = 0.03;
/// Greatest true disparity, bins.
const MAX_BINS: f32 = 4000.0;
/// Disparities this close to the truth are right in the figures, bins: 2 pixels.
const NEAR: i16 = 16;

/// A pixel of a gap, or a doubtful one, with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct GapSample {
    features: [[i8; HYPOTHESIS_FEATURES]; HYPOTHESES],
    pixel: [i8; PIXEL_FEATURES],
    /// −1 for hypotheses that do not exist.
    bins: [i16; HYPOTHESES],
    /// Filled along the row.
    filled: i16,
    truth: i16,
}

/// About `most` samples of a frame with truth, evenly spread.
///
/// # Errors
/// [`Error::Invalid`] for a frame that is not rectified.
pub fn gap_samples(sampler: &mut GapSampler, frame: &Frame, most: usize) -> Result<Vec<GapSample>> {
    let Some(truth) = &frame.truth else {
        return Ok(Vec::new());
    };
    let mut samples = Vec::new();
    sampler.sample(frame.rectified()?, &mut |candidates, places| {
        for (lane, &[x, y]) in places.iter().enumerate() {
            let bin = (8.0 * truth.disparity.row(2 * y)[2 * x] + 0.5).floor();
            if !(0.0..=MAX_BINS).contains(&bin) {
                continue;
            }
            let feature = |k: usize| std::array::from_fn(|i| candidates.feature(k, i, lane));
            samples.push(GapSample {
                features: std::array::from_fn(feature),
                pixel: std::array::from_fn(|i| candidates.pixel_feature(i, lane)),
                bins: std::array::from_fn(|k| {
                    if candidates.exists[k][lane] {
                        candidates.bin[k][lane] as i16
                    } else {
                        -1
                    }
                }),
                filled: candidates.filled[lane] as i16,
                truth: bin as i16,
            });
        }
    })?;
    let step = samples.len().div_ceil(most.max(1)).max(1);
    Ok(samples.into_iter().step_by(step).collect())
}

/// Settings of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GapSettings {
    /// Seed of the initial weights and of the order of the samples.
    pub seed: u64,
    pub epochs: usize,
}

/// Figures after an epoch.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct GapEpoch {
    /// Mean losses.
    pub training: f64,
    pub held_out: f64,
    /// Fraction of the held-out pixels whose likeliest disparity is within 2 px of the truth.
    pub held_out_right: f64,
}

/// A trained network.
#[derive(Clone, Debug)]
pub struct GapFit {
    /// In the order of [`GAP_TENSORS`].
    pub weights: Box<[f32; GAP_WEIGHTS]>,
    pub epochs: Vec<GapEpoch>,
    /// Fraction of the held-out pixels that the fill along the row has right.
    pub filled_right: f64,
    pub interrupted: bool,
}

/// Memory of a part of a batch, and its sums.
struct BatchPart {
    inputs: GapSamples,
    pass: GapPass,
    slopes: [[f32; LANES]; HYPOTHESES + 1],
    gradient: Vec<[f32; LANES]>,
    loss: f64,
    right: usize,
}

/// Trains on samples; the others are held out.
///
/// `progress` is called after every epoch with its number and figures; if it returns false, the
/// training ends with the network so far.
///
/// # Errors
/// [`Error::Invalid`] without samples.
pub fn fit_gaps(
    training: &[GapSample],
    held_out: &[GapSample],
    settings: GapSettings,
    isa: Isa,
    progress: &mut dyn FnMut(usize, GapEpoch) -> bool,
) -> Result<GapFit> {
    if training.is_empty() || held_out.is_empty() {
        let cure = "frames need a truth, and two runs or more";
        return Err(Error::Invalid(format!("no gaps to learn from: {cure}")));
    }
    let mut random = fastrand::Rng::with_seed(settings.seed);
    let mut weights = first_weights(&mut random);
    let mut moments = [vec![0.0; GAP_WEIGHTS], vec![0.0; GAP_WEIGHTS]];
    let mut gradient = vec![0.0; GAP_WEIGHTS];
    let mut parts: Vec<_> = (0..BATCH / PART).map(|_| BatchPart::new()).collect();
    let mut order: Vec<_> = (0..training.len() as u32).collect();
    let steps = (settings.epochs * order.len().div_ceil(BATCH)) as f64;
    let (mut step, mut epochs, mut interrupted) = (0, Vec::new(), false);
    while epochs.len() < settings.epochs && !interrupted {
        random.shuffle(&mut order);
        let mut loss = 0.0;
        for batch in order.chunks(BATCH) {
            let share = 1.0 / batch.len() as f32;
            let used = &mut parts[..batch.len().div_ceil(PART)];
            used.par_iter_mut()
                .zip(batch.par_chunks(PART))
                .for_each(|(part, indices)| {
                    part.gradient.fill([0.0; LANES]);
                    part.compute(training, indices, &weights[..], isa, Some(share));
                });
            loss += used.iter().map(|part| part.loss).sum::<f64>();
            add_up(used, &mut gradient);
            step += 1;
            let [mean, square] = &mut moments;
            let adam_step = adam_step(step, steps);
            adam(isa, adam_step, &gradient, mean, square, &mut weights[..]);
        }
        let [held_out_loss, held_out_right] = figures(held_out, &mut parts, &weights[..], isa);
        let epoch = GapEpoch {
            training: loss / training.len() as f64,
            held_out: held_out_loss,
            held_out_right,
        };
        epochs.push(epoch);
        interrupted = !progress(epochs.len(), epoch);
    }
    let filled = held_out
        .iter()
        .filter(|sample| sample.filled.abs_diff(sample.truth) <= NEAR as u16);
    Ok(GapFit {
        weights,
        epochs,
        filled_right: filled.count() as f64 / held_out.len() as f64,
        interrupted,
    })
}

/// Adds the gradients of the parts up to that of the batch, which is limited in its norm.
fn add_up(parts: &[BatchPart], gradient: &mut [f32]) {
    let mut square = 0.0;
    for (i, gradient) in gradient.iter_mut().enumerate() {
        let lanes = parts
            .iter()
            .map(|part| part.gradient[i].iter().sum::<f32>());
        *gradient = lanes.sum();
        square += *gradient * *gradient;
    }
    let scale = STEEPEST / square.sqrt().max(STEEPEST);
    gradient.iter_mut().for_each(|gradient| *gradient *= scale);
}

/// A step, from 1, of `steps`.
fn adam_step(step: i32, steps: f64) -> AdamStep {
    let done = f64::from(step) / steps;
    let cosine = 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
    let rate = RATE * (f64::from(step) / FIRST_STEPS).min(1.0) * cosine.max(0.01);
    let corrected = (1.0 - 0.999_f64.powi(step)).sqrt() / (1.0 - 0.9_f64.powi(step));
    AdamStep {
        rate: (rate * corrected) as f32,
        decay: 0.0,
    }
}

/// Mean loss of samples, and the fraction that is right.
fn figures(samples: &[GapSample], parts: &mut [BatchPart], weights: &[f32], isa: Isa) -> [f64; 2] {
    let indices: Vec<_> = (0..samples.len() as u32).collect();
    let (mut loss, mut right) = (0.0, 0);
    for batch in indices.chunks(BATCH) {
        let used = &mut parts[..batch.len().div_ceil(PART)];
        used.par_iter_mut()
            .zip(batch.par_chunks(PART))
            .for_each(|(part, indices)| part.compute(samples, indices, weights, isa, None));
        loss += used.iter().map(|part| part.loss).sum::<f64>();
        right += used.iter().map(|part| part.right).sum::<usize>();
    }
    [loss, right as f64].map(|sum| sum / samples.len() as f64)
}

/// Weights uniform in ±√(6 / inputs) (He et al., ICCV 2015), less where two layers add up or a
/// score is made; no biases.
fn first_weights(random: &mut fastrand::Rng) -> Box<[f32; GAP_WEIGHTS]> {
    let mut weights = Box::new([0.0; GAP_WEIGHTS]);
    let mut rest = &mut weights[..];
    for (name, [rows, inputs]) in GAP_TENSORS {
        let (tensor, others) = rest.split_at_mut(rows * inputs);
        rest = others;
        let part = match name {
            "pixel.weight" | "hypothesis.weight" | "hypothesis.pixel" | "choice.weight" => 1.0,
            "choice.mean" | "score.weight" | "none.mean" | "none.pixel" => 0.3,
            _ => 0.0,
        };
        let bound = part * (6.0 / inputs as f32).sqrt();
        tensor
            .iter_mut()
            .for_each(|w| *w = bound * (2.0 * random.f32() - 1.0));
    }
    weights
}

impl BatchPart {
    fn new() -> Self {
        Self {
            inputs: GapSamples::default(),
            pass: GapPass::default(),
            slopes: [[0.0; LANES]; HYPOTHESES + 1],
            gradient: vec![[0.0; LANES]; GAP_WEIGHTS],
            loss: 0.0,
            right: 0,
        }
    }

    /// Computes the loss of some samples, and adds its gradient times `share`, if there is one.
    fn compute(
        &mut self,
        samples: &[GapSample],
        indices: &[u32],
        weights: &[f32],
        isa: Isa,
        share: Option<f32>,
    ) {
        (self.loss, self.right) = (0.0, 0);
        for lanes in indices.chunks(LANES) {
            for (lane, &i) in lanes.iter().enumerate() {
                self.load(lane, &samples[i as usize]);
            }
            score_hypotheses(isa, weights, &self.inputs, &mut self.pass);
            // Lanes without a sample have no slope.
            self.slopes = [[0.0; LANES]; HYPOTHESES + 1];
            for (lane, &i) in lanes.iter().enumerate() {
                self.lose(lane, &samples[i as usize], share.unwrap_or(0.0));
            }
            if share.is_some() {
                let (inputs, pass) = (&self.inputs, &self.pass);
                add_gap_gradient(isa, weights, inputs, pass, &self.slopes, &mut self.gradient);
            }
        }
    }

    fn load(&mut self, lane: usize, sample: &GapSample) {
        let scaled = |value: i8| f32::from(value) / 64.0;
        for (k, features) in sample.features.iter().enumerate() {
            self.inputs.exists[k][lane] = f32::from(u8::from(sample.bins[k] >= 0));
            for (to, feature) in self.inputs.features[k].iter_mut().zip(features) {
                to[lane] = scaled(*feature);
            }
        }
        for (to, feature) in self.inputs.pixel.iter_mut().zip(&sample.pixel) {
            to[lane] = scaled(*feature);
        }
    }

    /// Adds the loss of a sample, and computes the slopes of its scores.
    fn lose(&mut self, lane: usize, sample: &GapSample, share: f32) {
        let scores = self.pass.scores.map(|lanes| lanes[lane]);
        let most = scores.iter().copied().fold(f32::MIN, f32::max);
        // Smaller ones only make numbers that are slow to compute with.
        let weights = scores.map(|score| {
            if score > most - 20.0 {
                exp(score - most)
            } else {
                0.0
            }
        });
        let sum: f32 = weights.iter().sum();
        let (truth, tau) = (sample.truth, 6.0 + 0.04 * f32::from(sample.truth));
        let value = |k: usize| match sample.bins.get(k) {
            None => NONE,
            Some(-1) => 0.0,
            Some(bin) => exp(-f32::from(bin.abs_diff(truth)) / tau),
        };
        let values: [f32; HYPOTHESES + 1] = std::array::from_fn(value);
        let good: f32 = weights.iter().zip(&values).map(|(w, v)| w * v).sum();
        let good = good.max(f32::MIN_POSITIVE);
        self.loss -= f64::from(good / sum).ln();
        for k in 0..=HYPOTHESES {
            self.slopes[k][lane] = share * weights[k] * (1.0 / sum - values[k] / good);
        }
        let mut best = 0;
        for k in 1..HYPOTHESES {
            if scores[k] > scores[best] {
                best = k;
            }
        }
        self.right += usize::from(sample.bins[best].abs_diff(truth) <= NEAR as u16);
    }
}
