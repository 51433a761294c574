//! Texture filter by the standard deviation of a window (thesis, section 5.3.2, "Texture Quality
//! Filter").
//!
//! The thesis itself names its weakness: it follows the light. A darker room has a lower deviation
//! everywhere, and the threshold must follow. v3 replaces it by differences of Gaussians.
//!
//! Departure from the thesis: squares instead of roots, so that the test is exact in integers.

use crate::kernel::{Isa, deviating_row};
use crate::matcher::{Parameter, Range};

/// Marks the pixels whose window of nine has a standard deviation of at least a threshold.
#[derive(Clone, Copy, Debug)]
pub struct DeviationTexture {
    /// Least `9·ΣI² − (ΣI)²`, 81 times the variance.
    least: u32,
}

impl DeviationTexture {
    /// The threshold, as the matchers' tables have it.
    pub const THRESHOLD: Parameter = Parameter {
        name: "texture_threshold",
        unit: "grey levels",
        range: Range::Real {
            default: 4.0,
            min: 0.0,
            max: 128.0,
        },
        description: "least standard deviation of a window's pixels",
    };

    /// With that threshold, in grey levels.
    pub fn new(threshold: f64) -> Self {
        Self {
            least: (9.0 * threshold).powi(2).ceil() as u32,
        }
    }

    /// Marks in `textured` where `row` has texture; nowhere where no window fits.
    pub fn apply_row(&self, isa: Isa, row: &[u8], textured: &mut [bool]) {
        deviating_row(isa, row, self.least, textured);
    }
}
