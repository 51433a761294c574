//! Values of a map as its file has them, for all readers of depths and disparities.

use super::{DecodedImage, has_ending, npz, pfm, read_image, rvl};
use std::path::Path;
use svl_core::stereo::{MAX_SIDE, Plane};
use svl_core::{Error, Result};
use zip::result::ZipError;

/// Fault in a file of numbers.
#[derive(Debug, thiserror::Error)]
pub enum MapFault {
    #[error("{0}")]
    Malformed(&'static str),
    /// What it has, and what a map has.
    #[error("{0}, expected {1}")]
    Unsupported(String, &'static str),
    #[error("the header has no '{0}'")]
    NoEntry(&'static str),
    #[error("the header is {0} bytes long, more than the {max} it may be", max = npz::MAX_HEADER)]
    Header(usize),
    #[error("{0} in 1..={MAX_SIDE}")]
    Sides(&'static str),
    #[error("the scale is {0}, its sign should give the byte order")]
    Scale(f32),
    /// Width, height, the bytes that they need, and what is wrong with these.
    #[error("{0}x{1} needs {2} bytes{3}")]
    Bytes(usize, usize, usize, String),
    #[error("it is of {0}x{1}, at most {max} pixels expected", max = rvl::MAX_PIXELS)]
    Large(usize, usize),
    /// Zeros and others of a run, and the pixels left for it.
    #[error("a run is of {0} and {1} pixels, {2} are left")]
    Run(usize, usize, usize),
    #[error("it has more than its {0}x{1} pixels")]
    Surplus(usize, usize),
    #[error(transparent)]
    Archive(#[from] ZipError),
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Other(#[from] Error),
}

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
        let (values, form) = match read_image(path)? {
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
