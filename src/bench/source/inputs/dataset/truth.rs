//! The true disparities of a scene, and the visibility of its pixels to both cameras.

use super::entry::{Form, Seen};
use super::table::files;
use std::path::{Path, PathBuf};
use svl_core::stereo::{MapDensity, Plane, Truth, TruthKind, Visibility, cross_check};
use svl_core::{Error, Result};
use svl_files::{read_disparity_steps, read_mask, read_pfm};

/// The truth of a scene whose images have this size, if there is one. `file` finds a file of the
/// scene by its name. Visibility comes from the scene's mask, or else from the right truth or the
/// truth of the visible pixels.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for what cannot be read, is of another size, or of an unknown
/// scale.
pub(crate) fn read(
    file: impl Fn(&str) -> Option<PathBuf>,
    size: (usize, usize),
) -> Result<Option<Truth>> {
    let there = files()
        .flat_map(|f| f.truths)
        .filter_map(|truth| Some((file(truth.name)?, truth)));
    let there: Vec<_> = there.collect();
    let Some((path, truth)) = there
        .iter()
        .find(|(_, truth)| truth.form.known(size.1))
        .or(there.first())
    else {
        return Ok(None);
    };
    let read = |path: &Path| truth.form.read(path, size);
    let disparity = read(path)?;
    let mask = files().flat_map(|f| f.masks).find_map(|name| file(name));
    let visibility = match (mask, &truth.seen) {
        (Some(path), _) => Some(same_size(&path, read_mask(&path)?, size)?),
        (None, Seen::RightTruth(name)) => file(name)
            .map(|right| cross_check(&disparity, &read(&right)?))
            .transpose()?,
        (None, Seen::Alone(name)) => file(name)
            .map(|seen| among(&disparity, &read(&seen)?))
            .transpose()?,
        (None, Seen::Unknown) => None,
    };
    Ok(Some(Truth {
        kind: TruthKind {
            density: truth.form.density(),
            ..TruthKind::default()
        },
        ..Truth::exact(disparity, visibility)
    }))
}

impl Form {
    /// True if images of that height have a scale.
    fn known(&self, height: usize) -> bool {
        self.scale(height).is_some()
    }

    fn density(&self) -> MapDensity {
        match self {
            Self::Points { .. } => MapDensity::Sparse,
            Self::Pfm | Self::Scaled { .. } | Self::ScaledBySize(_) => MapDensity::Dense,
        }
    }

    /// Divisor of the file's values, and true if 0 is unknown.
    fn scale(&self, height: usize) -> Option<(f32, bool)> {
        match *self {
            Self::Pfm => Some((1.0, false)),
            Self::Points { scale } => Some((scale, true)),
            Self::Scaled {
                scale,
                zero_unknown,
            } => Some((scale, zero_unknown)),
            Self::ScaledBySize(sizes) => sizes
                .iter()
                .find(|(h, _)| *h == height)
                .map(|&(_, scale)| (scale, true)),
        }
    }

    fn read(&self, path: &Path, size: (usize, usize)) -> Result<Plane<f32>> {
        let disparity = match (self, self.scale(size.1)) {
            (Self::Pfm, _) => read_pfm(path)?,
            (_, Some((scale, zero_unknown))) => read_disparity_steps(path, scale, !zero_unknown)?,
            (_, None) => {
                let what = format!("the scale of disparities {} rows high is unknown", size.1);
                let cure =
                    "unpack the archive as it is, or write them as disp0.pfm, which has no scale";
                return Err(Error::format(path, format!("{what}; {cure}")));
            }
        };
        same_size(path, disparity, size)
    }
}

/// The pixels of `truth` that are in `seen` too.
fn among(truth: &Plane<f32>, seen: &Plane<f32>) -> Result<Plane<Visibility>> {
    Plane::from_fn(truth.width(), truth.height(), |x, y| {
        match (truth.get(x, y), seen.get(x, y)) {
            (t, _) if !t.is_finite() => Visibility::Unknown,
            (_, s) if s.is_finite() => Visibility::Visible,
            _ => Visibility::Occluded,
        }
    })
}

fn same_size<T: Copy>(
    path: &Path,
    plane: Plane<T>,
    (width, height): (usize, usize),
) -> Result<Plane<T>> {
    let (w, h) = plane.size();
    if (w, h) == (width, height) {
        Ok(plane)
    } else {
        Err(Error::format(
            path,
            format!("is {w}x{h}, the left image is {width}x{height}"),
        ))
    }
}
