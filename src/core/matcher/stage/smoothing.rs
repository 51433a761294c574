//! Vertical smoothing (thesis, section 5.3.1 and figure 5.3): with a Gaussian along each column a
//! match tolerates a small vertical misalignment.
//!
//! Departure from the thesis: fixed point, so that every machine gives the same grey levels.

use super::each_plane_row;
use crate::kernel::{Isa, smooth_row};
use crate::matcher::{Parameter, Parameters, Range};
use crate::stereo::Gray;

/// Convolution of each column with a Gaussian of radius ⌈3σ⌉, edges replicated.
#[derive(Clone, Debug)]
pub struct VerticalSmoothing {
    /// In 65536ths, at distance 0, 1, ...; with both sides counted they sum to 65536.
    weights: Vec<u32>,
}

impl VerticalSmoothing {
    /// σ, as a parameter of the matchers.
    pub const SIGMA: Parameter = Parameter {
        name: "smoothing_sigma",
        unit: "px",
        range: Range::real(1.0, 0.0..=20.0),
        description: "standard deviation of the vertical smoothing of both images, 0 = none",
    };

    /// `sigma_px` 0 leaves images unchanged.
    pub fn new(sigma_px: f64) -> Self {
        let radius = (3.0 * sigma_px).ceil() as usize;
        let gaussian = |k: usize| {
            if k == 0 {
                1.0
            } else {
                (-((k * k) as f64) / (2.0 * sigma_px * sigma_px)).exp()
            }
        };
        let sum = 1.0 + 2.0 * (1..=radius).map(gaussian).sum::<f64>();
        let mut weights: Vec<u32> = (0..=radius)
            .map(|k| (65536.0 * gaussian(k) / sum + 0.5).floor() as u32)
            .collect();
        // The centre absorbs the rounding errors, so that a flat area keeps its grey level.
        weights[0] = 65536 - 2 * weights[1..].iter().sum::<u32>();
        Self { weights }
    }

    /// From the parameters of a matcher.
    pub fn from_parameters(parameters: &Parameters) -> Self {
        Self::new(parameters.real(Self::SIGMA.name))
    }

    /// Smooths `image` into `out`, which holds as many pixels.
    pub fn apply(&self, isa: Isa, image: &Gray, out: &mut Gray) {
        each_plane_row(out, 16, |y, row| self.apply_row(isa, image, y, row));
    }

    /// Smooths row `y` of `image` into `out`.
    pub fn apply_row(&self, isa: Isa, image: &Gray, y: usize, out: &mut [u8]) {
        smooth_row(isa, image, y, &self.weights, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one() {
        for sigma in [0.0, 0.01, 0.3, 1.0, 2.5, 20.0] {
            let weights = VerticalSmoothing::new(sigma).weights;
            assert_eq!(
                weights[0] + 2 * weights[1..].iter().sum::<u32>(),
                65536,
                "σ {sigma}"
            );
        }
        // g(k)/Σg for σ = 1, radius 3, times 65536: 0.39905028, 0.24203623, 0.05400558, 0.00443305.
        assert_eq!(
            VerticalSmoothing::new(1.0).weights,
            [26152, 15862, 3539, 291]
        );
    }

    #[test]
    fn zero_sigma_changes_nothing() {
        let image = Gray::from_fn(5, 4, |x, y| (x * 50 + y) as u8).unwrap();
        let mut out = Gray::filled(5, 4, 0).unwrap();
        VerticalSmoothing::new(0.0).apply(Isa::BASELINE, &image, &mut out);
        assert_eq!(out, image);
    }
}
