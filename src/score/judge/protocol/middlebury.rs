//! The two Middlebury protocols.
//!
//! Version 3 (D. Scharstein et al., *High-resolution stereo datasets with subpixel-accurate ground
//! truth*, GCPR 2014), as scored by `evaldisp` of the MiddEval3-SDK.
//!
//! Quirks: an estimate of half or a quarter of the truth's size is repeated, nearest, times the
//! factor; estimates are clipped to 0 ..= the largest disparity, invalid ones are neither filled
//! nor bad, and `bad` is a fraction of all scored pixels while `avgerr` and `rms` are means over
//! the estimated ones. For A50 … A99, which the web page shows but `evaldisp` does not compute,
//! ETH3D's rule is used.
//!
//! Version 2 (D. Scharstein and R. Szeliski, *A taxonomy and evaluation of dense two-frame stereo
//! correspondence algorithms*, IJCV 47, 2002), the table of tsukuba, venus, teddy and cones: bad1.0
//! under each of the masks nonocc, all and disc. Its quirk: a pixel without estimate is bad.

use super::errors::Errors;
use super::numbers::{Numbers, percent};
use super::{ProtocolImage, scored_pixels};
use svl_core::{Error, Result};

pub(super) fn v3(image: &ProtocolImage) -> Result<Numbers> {
    let scale = scale(image)?;
    let judged = scored_pixels(image.truth, image.mask);
    let errors =
        Errors::collect(judged.map(|(x, y, truth)| (truth, estimate(image, scale, x, y))))?;
    Ok(errors.table(
        |t| percent(errors.over(t), errors.pixels()),
        |q| errors.rank(q),
    ))
}

pub(super) fn v2(image: &ProtocolImage) -> Result<Numbers> {
    let judged = scored_pixels(image.truth, image.mask);
    let errors = Errors::collect(judged.map(|(x, y, truth)| (truth, image.estimate.get(x, y))))?;
    Ok(errors.table(
        |t| percent(errors.over(t) + errors.invalid(), errors.pixels()),
        |q| errors.rank(q),
    ))
}

/// The training scenes of version 3. Five of them count half in the averages of its tables (web
/// page "New features", 2015).
pub(super) const TRAINING: &[(&str, f64)] = &[
    ("Adirondack", 1.0),
    ("ArtL", 1.0),
    ("Jadeplant", 1.0),
    ("Motorcycle", 1.0),
    ("MotorcycleE", 1.0),
    ("Piano", 1.0),
    ("PianoL", 0.5),
    ("Pipes", 1.0),
    ("Playroom", 0.5),
    ("Playtable", 0.5),
    ("PlaytableP", 1.0),
    ("Recycle", 1.0),
    ("Shelves", 0.5),
    ("Teddy", 1.0),
    ("Vintage", 0.5),
];

/// Ratio of the truth's size to the estimate's: 1, 2 or 4.
pub(super) fn scale(image: &ProtocolImage) -> Result<usize> {
    let ((w, h), (width, height)) = (image.estimate.size(), image.truth.size());
    let fits = |scale: &usize| (w * scale, h * scale) == (width, height);
    [1, 2, 4].into_iter().find(fits).ok_or_else(|| {
        let rule = "the truth must be exactly 1, 2 or 4 times as large";
        Error::Invalid(format!(
            "the estimate is {w}x{h}, the truth {width}x{height}: {rule}"
        ))
    })
}

/// The estimate for the truth's pixel, clipped; `+∞` for none.
pub(super) fn estimate(image: &ProtocolImage, scale: usize, x: usize, y: usize) -> f32 {
    // A disparity in pixels scales with the image.
    let d = scale as f32 * image.estimate.get(x / scale, y / scale);
    match image.max_disparity {
        _ if !d.is_finite() => f32::INFINITY,
        Some(max) => d.min(scale as f32 * max).max(0.0),
        None => d.max(0.0),
    }
}
