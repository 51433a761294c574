//! A data set as data: its origin, and the layout of its scenes on disk.

use serde::Serialize;

/// A public data set.
#[derive(Debug, Serialize)]
pub struct Dataset {
    /// Name on the command line, and of the folder in that of the data sets.
    pub name: &'static str,
    pub title: &'static str,
    /// Page where its authors describe it.
    pub home: &'static str,
    /// Terms of use, in short; the home page is authoritative.
    pub licence: &'static str,
    /// Folder of the scenes that its scenario scores, in that of the data sets.
    pub folder: &'static str,
    /// Number of scenes in `folder`; all have truth.
    pub scenes: usize,
    #[serde(skip)]
    pub(crate) files: FileNames,
}

/// The names that files have. In each, `*` is the scene's number if one folder has many scenes,
/// `{}` the name of the scene's own folder if it has one; a name without an extension matches any
/// image.
#[derive(Debug)]
pub(crate) struct FileNames {
    pub pairs: &'static [PairFiles],
    pub truths: &'static [TruthFile],
    /// Masks of the pixels that both cameras see, Middlebury's codes.
    pub masks: &'static [&'static str],
}

/// The images of a scene.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct PairFiles {
    pub left: &'static str,
    pub right: &'static str,
    pub calib: CalibFile,
}

/// File that describes a scene's camera.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum CalibFile {
    /// `calib.txt` beside the images, if there is one.
    Middlebury,
    /// A file of named 3 x 4 projection matrices, with the names of the left and the right one.
    Projections {
        file: &'static str,
        left: &'static str,
        right: &'static str,
    },
}

/// The true disparities of the left image.
#[derive(Debug)]
pub(crate) struct TruthFile {
    pub name: &'static str,
    pub form: Form,
    pub seen: Seen,
}

/// Format in which a file holds disparities.
#[derive(Debug)]
pub(crate) enum Form {
    Pfm,
    /// Value divided by `scale`; 0 is unknown where the data set says so.
    Scaled {
        scale: f32,
        zero_unknown: bool,
    },
    /// Value divided by a scale that goes with the image's height; 0 is unknown.
    ScaledBySize(&'static [(usize, f32)]),
    /// Points of a laser scanner: value divided by `scale`, 0 where there is none.
    Points {
        scale: f32,
    },
}

/// Source of the visibility to both cameras, without a mask.
#[derive(Debug)]
pub(crate) enum Seen {
    /// The visibility is unknown.
    Unknown,
    /// The truth of the right image, in the same form: visible pixels are those where the two
    /// agree.
    RightTruth(&'static str),
    /// A second truth, of the visible pixels alone.
    Alone(&'static str),
}

impl PairFiles {
    pub(crate) const fn beside(left: &'static str, right: &'static str) -> Self {
        Self {
            left,
            right,
            calib: CalibFile::Middlebury,
        }
    }

    /// True if one folder holds many such pairs.
    pub(crate) fn numbered(&self) -> bool {
        self.left.contains('*')
    }
}
