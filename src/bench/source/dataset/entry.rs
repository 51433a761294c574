//! A data set as data: its origin, and the layout of its scenes on disk.

use serde::Serialize;
use serde::ser::{SerializeStruct, Serializer};
use svl_core::joined;

/// A public data set.
#[derive(Debug, Serialize)]
pub struct Dataset {
    /// Its name on the command line, and of the folder it is fetched into.
    pub name: &'static str,
    pub title: &'static str,
    /// Page where its authors describe it.
    pub home: &'static str,
    /// Terms of use, in short; the home page is authoritative.
    pub licence: &'static str,
    /// Paper that its authors ask to be cited.
    pub citation: &'static str,
    /// Parts that can be fetched, the usual ones and the others.
    pub parts: &'static [Part],
    #[serde(skip)]
    pub(super) files: FileNames,
}

/// A part of a data set that is fetched whole.
#[derive(Debug)]
pub struct Part {
    pub name: &'static str,
    /// True if it is fetched where no part is named.
    pub usual: bool,
    /// Approximate size of the download.
    pub megabytes: u32,
    /// Beginning of the addresses of `files`, up to a slash.
    pub base: &'static str,
    /// Archives and single files below `base`.
    pub files: &'static [&'static str],
    /// Folder for them below the data set's; empty for that itself.
    pub folder: &'static str,
}

impl Serialize for Part {
    /// With the addresses of its files.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let urls = self.files.iter().map(|file| format!("{}{file}", self.base));
        let mut part = serializer.serialize_struct("Part", 4)?;
        part.serialize_field("name", self.name)?;
        part.serialize_field("usual", &self.usual)?;
        part.serialize_field("megabytes", &self.megabytes)?;
        part.serialize_field("urls", &urls.collect::<Vec<_>>())?;
        part.end()
    }
}

/// The names that files have. In each, `*` is the scene's number if one folder has many scenes,
/// `{}` the name of the scene's own folder if it has one; a name without an extension matches any
/// image.
#[derive(Debug)]
pub(super) struct FileNames {
    pub pairs: &'static [PairFiles],
    pub truths: &'static [TruthFile],
    /// Masks of the pixels that both cameras see, Middlebury's codes.
    pub masks: &'static [&'static str],
}

/// The images of a scene.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct PairFiles {
    pub left: &'static str,
    pub right: &'static str,
    pub calib: CalibFile,
}

/// File that describes a scene's camera.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum CalibFile {
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
pub(super) struct TruthFile {
    pub name: &'static str,
    pub form: Form,
    pub seen: Seen,
}

/// Format in which a file holds disparities.
#[derive(Debug)]
pub(super) enum Form {
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
pub(super) enum Seen {
    /// The visibility is unknown.
    Unknown,
    /// The truth of the right image, in the same form: visible pixels are those where the two
    /// agree.
    RightTruth(&'static str),
    /// A second truth, of the visible pixels alone.
    Alone(&'static str),
}

impl Dataset {
    /// The parts named `names`, or the usual ones.
    ///
    /// # Errors
    /// The unknown name, with the known ones.
    pub fn parts(&self, names: &[String]) -> Result<Vec<&'static Part>, String> {
        if names.is_empty() {
            return Ok(self.parts.iter().filter(|p| p.usual).collect());
        }
        let known = || joined(self.parts.iter().map(|p| p.name));
        let part = |name: &String| {
            let unknown = || format!("{} has no part '{name}'; it has {}", self.name, known());
            self.parts
                .iter()
                .find(|p| p.name.eq_ignore_ascii_case(name))
                .ok_or_else(unknown)
        };
        names.iter().map(part).collect()
    }
}

impl PairFiles {
    pub(super) const fn beside(left: &'static str, right: &'static str) -> Self {
        Self {
            left,
            right,
            calib: CalibFile::Middlebury,
        }
    }

    /// True if one folder holds many such pairs.
    pub(super) fn numbered(&self) -> bool {
        self.left.contains('*')
    }
}
