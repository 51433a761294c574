//! Calibration formats, and the results of reading and writing one.

use super::document::{Document, Syntax};
use super::unit::FileUnit;
use svl_core::doubt::Doubt;
use svl_core::rectify::hidden_views;
use svl_core::stereo::{DistortionModel, StereoCalibration};
use svl_core::{Error, Result};

/// File format in which a program stores calibrations.
#[derive(Debug)]
pub struct CalibrationFormat {
    pub name: &'static str,
    /// The program and its format, as in "OpenCV's FileStorage".
    pub title: &'static str,
    /// Contents and conventions of its files.
    pub conventions: &'static str,
    /// File name extensions. The first format with an extension is the default for writing.
    pub endings: &'static [&'static str],
    /// Names of the two files in a folder, for formats with one file per camera.
    pub pairs: &'static [[&'static str; 2]],
    /// True if one file may contain a complete calibration.
    pub(super) single: bool,
    pub(super) syntax: Syntax,
    /// Words that identify its files.
    pub(super) marks: &'static [&'static str],
    pub(super) read: fn(Vec<Document>, &Hints) -> Result<LoadedCalibration>,
    pub(super) write: Option<fn(&StereoCalibration) -> Writing>,
}

/// The user's knowledge about a file that the file may lack.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hints<'a> {
    pub format: Option<&'static CalibrationFormat>,
    pub unit: Option<FileUnit>,
    /// Width and height of the images, pixels.
    pub size: Option<(usize, usize)>,
    /// Distortion model, for files that do not state it.
    pub model: Option<DistortionModel>,
    /// Topics of the left and the right images, by which a chain of cameras is searched.
    pub topics: [&'a str; 2],
    /// Numbers of the left and the right camera in a chain.
    pub cameras: Option<[usize; 2]>,
}

/// A calibration read from a file.
#[derive(Debug)]
pub struct LoadedCalibration {
    pub format: &'static CalibrationFormat,
    pub calibration: StereoCalibration,
    /// Entries that were ignored or interpreted differently than the file states, a line each.
    pub remarks: Vec<String>,
    /// The doubt about the two projections of a file, which the calibration no longer has.
    pub(super) offsets: Option<Doubt>,
    /// Numbers of both cameras, if they were chosen in a chain.
    pub cameras: Option<[usize; 2]>,
}

impl LoadedCalibration {
    /// The remarks, and the views that rectification hides.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        let hidden = hidden_views(&self.calibration);
        self.remarks.iter().cloned().chain(hidden)
    }

    /// Unusual numbers of the calibration.
    pub fn doubts(&self) -> impl Iterator<Item = Doubt> {
        let checks = self.calibration.checks().into_iter();
        let checks = checks.filter_map(|check| check.doubt());
        self.offsets.clone().into_iter().chain(checks)
    }
}

/// Texts to write, and the parts of the calibration that the format cannot represent.
pub(super) struct Written {
    pub(super) texts: Vec<String>,
    pub(super) left_out: Vec<&'static str>,
}

impl Written {
    /// One text with the complete calibration.
    pub(super) fn complete(text: String) -> Self {
        Self {
            texts: vec![text],
            left_out: Vec::new(),
        }
    }
}

/// Cameras that svl or the format of a file cannot have.
#[derive(Debug, thiserror::Error)]
pub(super) enum GeometryFault {
    #[error("a skew of {0}, which svl's cameras do not have; calibrate without")]
    Skew(f64),
    #[error("is not a camera matrix: expected fx 0 cx, 0 fy cy, 0 0 1")]
    NoMatrix,
    #[error("the cameras are mounted one above the other; svl matches those side by side")]
    Vertical,
    #[error("rectified cameras have one focal length, along x and along y")]
    Focals,
    #[error(
        "contains only rectified cameras, and this calibration has no rectification; compute one \
         with `svl calibrate convert --rectify`"
    )]
    NotRectified,
    #[error(
        "contains extrinsics only as a rectification, and this calibration has none; compute one \
         with `svl calibrate convert --rectify`"
    )]
    NoExtrinsics,
    #[error(
        "contains one image size, and this calibration has others before and after rectification"
    )]
    Sizes,
    #[error(
        "is in metres and this calibration in squares of its board; give their size with --unit \
         squares=SIDE_IN_METRES"
    )]
    Squares,
    /// A camera, its distortion model and the number of coefficients.
    #[error(
        "has radtan k1 k2 p1 p2 and equidistant, and {0} has {1} with {2} coefficients; choose \
         opencv with --to"
    )]
    Distortion(String, DistortionModel, usize),
    #[error("has a camera whose matrix cannot be inverted")]
    Singular,
    #[error("is read only; choose another with --to")]
    ReadOnly,
    #[error(transparent)]
    Other(#[from] Error),
}

/// The texts, or the reason why the format cannot represent the calibration.
pub(super) type Writing = Result<Written, GeometryFault>;

impl CalibrationFormat {
    /// True if svl can write it; it reads all formats.
    pub fn is_written(&self) -> bool {
        self.write.is_some()
    }
}

/// The document of a format with one file.
pub(super) fn one(documents: Vec<Document>) -> Result<Document> {
    <[Document; 1]>::try_from(documents)
        .map(|[one]| one)
        .map_err(|_| Error::Invalid("expected one file".into()))
}

/// The documents of a format with two files.
pub(super) fn both(documents: Vec<Document>) -> Result<[Document; 2]> {
    documents
        .try_into()
        .map_err(|_| Error::Invalid("expected two files".into()))
}
