//! ETH3D's two-view benchmark (T. Schöps et al., *A multi-view stereo benchmark with
//! high-resolution images and multi-camera videos*, CVPR 2017), as scored by its program
//! `two-view-evaluation`.
//!
//! Quirks: a disparity beyond the image's width in either direction is invalid; all numbers
//! except coverage are over the estimated pixels; without any, all of them are bad and the errors
//! infinite (`None` here).

use super::errors::Errors;
use super::numbers::{Numbers, percent};
use super::{ProtocolImage, scored_pixels};
use svl_core::Result;

pub(super) fn numbers(image: &ProtocolImage) -> Result<Numbers> {
    let errors = Errors::collect(
        scored_pixels(image.truth, image.mask).map(|(x, y, truth)| (truth, estimate(image, x, y))),
    )?;
    // Without estimates the program counts all pixels as bad.
    let bad = |t| percent(errors.over(t), errors.estimated()).or(Some(100.0));
    // The program multiplies in single precision, which differs from some hundred thousand pixels
    // on.
    let rank = |q| (errors.estimated() as f32 * (f32::from(q) / 100.0)).floor() as usize;
    Ok(errors.table(bad, rank))
}

/// The estimate, `+∞` for none.
pub(super) fn estimate(image: &ProtocolImage, x: usize, y: usize) -> f32 {
    let d = image.estimate.get(x, y);
    if d.abs() <= image.truth.width() as f32 {
        d
    } else {
        f32::INFINITY
    }
}
