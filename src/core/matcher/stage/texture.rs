//! Texture filters: by differences of Gaussians (thesis, section 5.3.3, figures 5.4 and 5.5,
//! annexes C and D) and by the standard deviation of a window (section 5.3.2).
//!
//! **Differences of Gaussians.** Along the row the image is convolved with two differences of
//! Gaussians, of σ and σ+Δ and of σ+Δ and σ+2Δ. If the fine one responds at least as strongly as
//! the coarse one, the pixel has texture.
//!
//! **Why 24 taps and not 25.** The thesis's filter covers −12 ..= +11, one tap short of
//! symmetry, and depends on it: its kernels do not sum to zero. With 24 taps they sum to 0.0865
//! (fine) and 0.0901 (coarse), so in a flat area the coarse scale wins and the area is dropped, by
//! a margin proportional to its brightness. With −12 ..= +12 the coarse sum is 0.0772, the fine one
//! is larger, and every flat area passes.
//!
//! Departure from the thesis: fixed point, and rows are replicated at their ends instead of
//! skipping 12 pixels.
//!
//! **Standard deviation.** The thesis itself names its weakness: it depends on the light. A darker
//! room has a lower deviation everywhere, and the threshold must follow. Departure from the thesis:
//! squares instead of roots, so that the test is exact in integers.

use super::each_plane_row;
use crate::kernel::{DogTaps, Isa, WINDOW, deviating_row, textured_row};
use crate::matcher::{Parameter, Parameters, Range};
use crate::stereo::{Gray, Plane};

/// Finds the pixels on texture.
pub trait TextureFilter: Send + Sync {
    /// Marks in `textured`, which has as many elements, the pixels of `row` with texture.
    fn apply_row(&self, isa: Isa, row: &[u8], textured: &mut [bool]);

    /// Marks in `textured`, which has its size, the pixels of `image` with texture.
    fn apply(&self, isa: Isa, image: &Gray, textured: &mut Plane<bool>) {
        each_plane_row(textured, 16, |y, row| {
            self.apply_row(isa, image.row(y), row)
        });
    }
}

/// Marks the pixels where the fine difference of Gaussians responds at least as strongly as the
/// coarse one.
#[derive(Clone, Debug)]
pub struct DogTexture {
    taps: DogTaps,
}

impl DogTexture {
    /// σ of the finest Gaussian, as a parameter of the matchers.
    pub const SIGMA: Parameter = Parameter {
        name: "texture_sigma",
        unit: "px",
        range: Range::real(0.4, 0.1..=12.0),
        description: "finest Gaussian of the texture filter",
    };
    /// Δ between the three Gaussians, as a parameter of the matchers.
    pub const DELTA: Parameter = Parameter {
        name: "texture_delta",
        unit: "px",
        range: Range::real(3.35, 0.1..=12.0),
        description: "step between the three Gaussians of the texture filter",
    };

    /// With those σ and Δ, both positive.
    pub fn new(sigma_px: f64, delta_px: f64) -> Self {
        let gaussian = |sigma: f64, t: f64| (-t * t / (2.0 * sigma * sigma)).exp() / sigma;
        let taps = |a: f64, b: f64| {
            std::array::from_fn(|t| {
                let g = (gaussian(a, t as f64) - gaussian(b, t as f64))
                    / (2.0 * std::f64::consts::PI).sqrt();
                // Halves round up also below zero, while `round` would round away from it.
                (65536.0 * g + 0.5).floor() as i32
            })
        };
        let [fine, middle, coarse] = [0.0, 1.0, 2.0].map(|k| sigma_px + k * delta_px);
        Self {
            taps: DogTaps {
                fine: taps(fine, middle),
                coarse: taps(middle, coarse),
            },
        }
    }

    /// From the parameters of a matcher.
    pub fn from_parameters(parameters: &Parameters) -> Self {
        Self::new(
            parameters.real(Self::SIGMA.name),
            parameters.real(Self::DELTA.name),
        )
    }
}

impl TextureFilter for DogTexture {
    fn apply_row(&self, isa: Isa, row: &[u8], textured: &mut [bool]) {
        textured_row(isa, row, &self.taps, textured);
    }
}

/// Marks the pixels whose window of nine has a standard deviation of at least a threshold.
#[derive(Clone, Copy, Debug)]
pub struct DeviationTexture {
    /// Least `9·ΣI² − (ΣI)²`, 81 times the variance.
    least: u32,
}

impl DeviationTexture {
    /// The threshold, as a parameter of the matchers.
    pub const THRESHOLD: Parameter = Parameter {
        name: "texture_threshold",
        unit: "grey levels",
        range: Range::real(4.0, 0.0..=128.0),
        description: "least standard deviation of a window's pixels",
    };

    /// With that threshold, in grey levels.
    pub fn new(threshold: f64) -> Self {
        Self {
            // The least integer that meets the real bound.
            least: (WINDOW as f64 * threshold).powi(2).ceil() as u32,
        }
    }
}

impl TextureFilter for DeviationTexture {
    fn apply_row(&self, isa: Isa, row: &[u8], textured: &mut [bool]) {
        deviating_row(isa, row, self.least, textured);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_that_drop_flat_areas() {
        let DogTaps { fine, coarse } = DogTexture::new(0.4, 3.35).taps;
        let sum = |taps: [i32; 13]| {
            f64::from(taps[0] + 2 * taps[1..12].iter().sum::<i32>() + taps[12]) / 65536.0
        };
        let full = |taps: [i32; 13]| sum(taps) + f64::from(taps[12]) / 65536.0;
        let near = |a: f64, b: f64| (a - b).abs() < 2e-4;
        assert!(
            near(sum(fine), 0.0865) && near(sum(coarse), 0.0901),
            "{} {}",
            sum(fine),
            sum(coarse)
        );
        assert!(
            near(full(coarse), 0.0772) && full(fine) > full(coarse),
            "{} {}",
            full(fine),
            full(coarse)
        );
    }

    #[test]
    fn a_flat_area_is_dropped_and_a_line_is_not() {
        let image = Gray::from_fn(64, 1, |x, _| if x == 32 { 220 } else { 100 }).unwrap();
        let mut textured = Plane::filled(64, 1, false).unwrap();
        DogTexture::new(0.4, 3.35).apply(Isa::BASELINE, &image, &mut textured);
        assert!(textured.get(32, 0));
        assert!(!textured.get(5, 0) && !textured.get(60, 0));
    }
}
