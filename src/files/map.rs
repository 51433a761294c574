//! Values of a map as its file has them, for all readers of depths and disparities.

use super::image::read_steps;
use super::{DecodedImage, has_ending, npz, pfm};
use std::path::Path;
use svl_core::stereo::Plane;
use svl_core::{Error, Result};

/// The form of the numbers in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NumberForm {
    Floats,
    /// Integers of NumPy's arrays.
    Integers,
    Image8,
    Image16,
}

/// Values without their scale.
pub(super) struct StoredMap {
    pub(super) values: Plane<f32>,
    pub(super) form: NumberForm,
}

impl StoredMap {
    /// Reads `.pfm`, `.npy`, `.npz` or a grey image. Palette and RGB files with equal channels are
    /// grey.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`], also for a colour picture.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let array = |(values, is_integer)| {
            let form = if is_integer {
                NumberForm::Integers
            } else {
                NumberForm::Floats
            };
            Self { values, form }
        };
        if has_ending(path, "npy") {
            return npz::alone(path).map(array);
        }
        if has_ending(path, "npz") {
            return npz::archived(path).map(array);
        }
        if has_ending(path, "pfm") {
            return pfm::values(path).map(|values| array((values, false)));
        }
        let (values, form) = match read_steps(path)? {
            DecodedImage::Gray(steps) => (steps.map(f32::from), NumberForm::Image8),
            DecodedImage::Gray16(steps) => (steps.map(f32::from), NumberForm::Image16),
            DecodedImage::Color(_) | DecodedImage::Color16(_) => {
                let why = "is a colour picture; maps are grey images, .pfm, .npy and .npz";
                return Err(Error::format(path, why));
            }
        };
        Ok(Self { values, form })
    }
}
