//! Texture filter by differences of Gaussians (thesis, section 5.3.3, figures 5.4 and 5.5, annexes
//! C and D).
//!
//! Along the row the image is convolved with two differences of Gaussians, of σ and σ+Δ and of σ+Δ
//! and σ+2Δ. Where the fine one answers at least as strongly as the coarse one, the pixel lies on
//! texture.
//!
//! **Why 24 taps and not 25.** The thesis's filter stands at −12 ..= +11, one tap short of
//! symmetry, and lives by it: its kernels do not sum to zero. With 24 taps they sum to 0.0865
//! (fine) and 0.0901 (coarse), so a flat area falls to the coarse scale and is dropped, by a margin
//! proportional to its brightness. With −12 ..= +12 the coarse sum is 0.0772, the fine one is
//! larger, and every flat area passes.
//!
//! Departure from the thesis: fixed point, and rows are replicated at their ends instead of
//! skipping 12 pixels.

use super::each_row;
use crate::kernel::{DogTaps, Isa, textured_row};
use crate::matcher::{Parameter, Range};
use crate::stereo::{Gray, Plane};

/// Marks the pixels on texture.
#[derive(Clone, Debug)]
pub struct DogTexture {
    taps: DogTaps,
}

impl DogTexture {
    /// σ of the finest Gaussian, as the matchers' tables have it.
    pub const SIGMA: Parameter = Parameter {
        name: "texture_sigma",
        unit: "px",
        range: Range::Real {
            default: 0.4,
            min: 0.1,
            max: 12.0,
        },
        description: "finest Gaussian of the texture filter",
    };
    /// Δ between the three Gaussians, as the matchers' tables have it.
    pub const DELTA: Parameter = Parameter {
        name: "texture_delta",
        unit: "px",
        range: Range::Real {
            default: 3.35,
            min: 0.1,
            max: 12.0,
        },
        description: "step between the three Gaussians of the texture filter",
    };

    /// With those σ and Δ, both positive.
    pub fn new(sigma_px: f64, delta_px: f64) -> Self {
        let gaussian = |sigma: f64, t: f64| (-t * t / (2.0 * sigma * sigma)).exp() / sigma;
        let taps = |a: f64, b: f64| {
            std::array::from_fn(|t| {
                let g = (gaussian(a, t as f64) - gaussian(b, t as f64))
                    / (2.0 * std::f64::consts::PI).sqrt();
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

    /// Marks in `textured`, which holds as many pixels, where `image` has texture.
    pub fn apply(&self, isa: Isa, image: &Gray, textured: &mut Plane<bool>) {
        let width = image.width();
        // Scratch planes are made by `Plane::filled`, so their rows have no gaps.
        each_row(
            textured.as_mut_slice().expect("gapless"),
            width,
            16,
            |y, row| {
                self.apply_row(isa, image.row(y), row);
            },
        );
    }

    /// Marks in `textured` where `row` has texture.
    pub fn apply_row(&self, isa: Isa, row: &[u8], textured: &mut [bool]) {
        textured_row(isa, row, &self.taps, textured);
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
        DogTexture::new(0.4, 3.35).apply(Isa::PORTABLE, &image, &mut textured);
        assert!(textured.get(32, 0));
        assert!(!textured.get(5, 0) && !textured.get(60, 0));
    }
}
