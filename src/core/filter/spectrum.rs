//! Amplitude spectrum of a square window: the input of the networks (thesis, section 8.1).

use super::math;
use crate::kernel;
use crate::stereo::Gray;
use realfft::{RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Features of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Features {
    /// Side of the square window, pixels; even.
    pub window: usize,
    pub scaling: Scaling,
}

/// Scaling of amplitudes, for grey values 0..=255 and a window of side N.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scaling {
    /// Amplitude / N².
    Amplitude,
    /// ln(1 + amplitude).
    Log,
}

impl Scaling {
    pub const ALL: [Self; 2] = [Self::Amplitude, Self::Log];

    pub fn name(self) -> &'static str {
        match self {
            Self::Amplitude => "amplitude",
            Self::Log => "log",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scaling| scaling.name() == name)
    }
}

impl Features {
    /// Number of features: the first N²/2 + 1 amplitudes of the full spectrum, row by row. A window
    /// of 128 has 8193, one of 64 has 2049, as in the thesis.
    pub fn count(&self) -> usize {
        self.window * self.window / 2 + 1
    }

    /// Number of features with zeros appended up to a multiple of [`kernel::LANES`].
    pub fn stride(&self) -> usize {
        self.count().next_multiple_of(kernel::LANES)
    }
}

/// Plans and memory for the spectra of windows of a size.
pub struct Spectrum {
    side: usize,
    column_transform: Arc<dyn RealToComplex<f32>>,
    row_transform: Arc<dyn Fft<f32>>,
    column: Vec<f32>,
    column_spectrum: Vec<Complex<f32>>,
    /// Rows of vertical frequencies 0 to N/2.
    rows: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

impl Spectrum {
    /// For windows of that side, which must be even.
    pub fn new(side: usize) -> Self {
        let column_transform = RealFftPlanner::new().plan_fft_forward(side);
        let row_transform = FftPlanner::new().plan_fft_forward(side);
        let zero = Complex::default();
        let scratch = column_transform
            .get_scratch_len()
            .max(row_transform.get_inplace_scratch_len());
        Self {
            side,
            column: column_transform.make_input_vec(),
            column_spectrum: column_transform.make_output_vec(),
            rows: vec![zero; (side / 2 + 1) * side],
            scratch: vec![zero; scratch],
            column_transform,
            row_transform,
        }
    }

    /// The amplitudes of the window of `image` from (x, y) on: the first N²/2 + 1 of the N x N
    /// values of the transform, by rows of vertical frequencies. The window must lie in the image.
    pub fn amplitudes(&mut self, image: &Gray, [x, y]: [usize; 2], out: &mut [f32]) {
        let n = self.side;
        for column in 0..n {
            for (row, value) in self.column.iter_mut().enumerate() {
                *value = f32::from(image.get(x + column, y + row));
            }
            let (input, output) = (&mut self.column, &mut self.column_spectrum);
            let scratch = &mut self.scratch[..self.column_transform.get_scratch_len()];
            // Fails only for other lengths.
            let done = self
                .column_transform
                .process_with_scratch(input, output, scratch);
            done.expect("lengths as planned");
            for (row, value) in output.iter().enumerate() {
                self.rows[row * n + column] = *value;
            }
        }
        let (upper, middle) = self.rows.split_at_mut(n / 2 * n);
        let scratch = &mut self.scratch[..self.row_transform.get_inplace_scratch_len()];
        self.row_transform.process_with_scratch(upper, scratch);
        for (out, value) in out.iter_mut().zip(&*upper) {
            *out = (value.re * value.re + value.im * value.im).sqrt();
        }
        // Only the mean of row N/2.
        let sum: Complex<f32> = middle.iter().sum();
        out[n / 2 * n] = (sum.re * sum.re + sum.im * sum.im).sqrt();
    }

    /// The features of a window, padded with zeros up to their stride.
    pub fn features(&mut self, features: Features, image: &Gray, at: [usize; 2], out: &mut [f32]) {
        let count = features.count();
        self.amplitudes(image, at, out);
        let (values, padding) = out.split_at_mut(count);
        match features.scaling {
            Scaling::Amplitude => {
                let scale = 1.0 / (features.window * features.window) as f32;
                values.iter_mut().for_each(|value| *value *= scale);
            }
            Scaling::Log => values
                .iter_mut()
                .for_each(|value| *value = math::ln_1p(*value)),
        }
        padding.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(width: usize, height: usize) -> Gray {
        let mut random = fastrand::Rng::with_seed(3);
        let noise = (0..width * height).map(|_| random.u8(..)).collect();
        Gray::from_vec(width, height, noise).unwrap()
    }

    /// The definition, term by term.
    fn by_definition(image: &Gray, [x, y]: [usize; 2], n: usize) -> Vec<f64> {
        let value = |i: usize| {
            let (v, u) = (i / n, i % n);
            let (mut re, mut im) = (0.0, 0.0);
            for row in 0..n {
                for column in 0..n {
                    let turn = ((u * column + v * row) % n) as f64 / n as f64;
                    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
                    let grey = f64::from(image.get(x + column, y + row));
                    re += grey * cos;
                    im -= grey * sin;
                }
            }
            re.hypot(im)
        };
        (0..=n * n / 2).map(value).collect()
    }

    #[test]
    fn amplitudes_are_those_of_the_definition() {
        let (image, at, n) = (noise(40, 30), [7, 3], 16);
        let mut amplitudes = vec![0.0; n * n / 2 + 1];
        Spectrum::new(n).amplitudes(&image, at, &mut amplitudes);
        let expected = by_definition(&image, at, n);
        let largest = expected.iter().copied().fold(0.0, f64::max);
        for (a, e) in amplitudes.iter().zip(&expected) {
            assert!((f64::from(*a) - e).abs() < 1e-6 * largest, "{a} {e}");
        }
    }

    #[test]
    fn features_are_scaled_and_padded() {
        let image = noise(16, 16);
        let scaled = |scaling| {
            let features = Features {
                window: 16,
                scaling,
            };
            let mut out = vec![9.0; features.stride()];
            Spectrum::new(16).features(features, &image, [0, 0], &mut out);
            assert_eq!(
                (out.len(), out[features.count()..].iter().sum()),
                (144, 0.0)
            );
            out
        };
        let (plain, log) = (scaled(Scaling::Amplitude), scaled(Scaling::Log));
        let mean = image.pixels().map(f32::from).sum::<f32>() / 256.0;
        assert!((plain[0] - mean).abs() < 1e-3);
        assert!((log[5] - (256.0 * plain[5]).ln_1p()).abs() < 1e-4);
    }
}
