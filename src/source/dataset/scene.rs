//! One scene of a data set: a pair, and what is known of its truth and its camera.

use super::read_calib;
use crate::error::{Error, Result};
use crate::files::{read_gray, read_mask, read_pfm, read_scaled_disparity};
use crate::source::Source;
use crate::stereo::{Exposure, Frame, Plane, StereoPair, Truth};
use std::path::{Path, PathBuf};

/// Names that left and right images have in the data sets svl knows, the usual one first.
const PAIRS: &[(&str, &str)] = &[("im0", "im1"), ("left", "right"), ("im2", "im6"), ("view1", "view5"), ("imL", "imR")];

/// Image formats, the usual one first.
pub(super) const ENDINGS: &[&str] = &["png", "ppm", "pgm", "jpg", "jpeg"];

/// How a data set stores the truth of the left image.
enum TruthForm {
    Pfm,
    /// Value divided by `scale`; 0 is unknown where the data set says so.
    Scaled {
        scale: f32,
        zero_unknown: bool,
    },
}

/// File name and form of the truths svl knows, by the conventions of Middlebury 2001 (scale 8; tsukuba 16), 2003
/// (quarter size, 4), 2005/2006 (third size, 3), 2014 and MiddEval3, ETH3D, and KITTI.
const TRUTHS: &[(&str, TruthForm)] = &[
    ("disp0GT.pfm", TruthForm::Pfm),
    ("disp0.pfm", TruthForm::Pfm),
    ("disp2.png", TruthForm::Scaled { scale: 4.0, zero_unknown: true }),
    ("disp2.pgm", TruthForm::Scaled { scale: 8.0, zero_unknown: false }),
    ("disp1.png", TruthForm::Scaled { scale: 3.0, zero_unknown: true }),
    ("truedisp.pgm", TruthForm::Scaled { scale: 16.0, zero_unknown: true }),
    ("disp_occ.png", TruthForm::Scaled { scale: 256.0, zero_unknown: true }),
];

/// Masks of the pixels that both cameras see, Middlebury's codes.
const MASKS: &[&str] = &["mask0nocc.png", "mask_nonocc.png"];

/// A scene folder: a left and a right image, and beside them, where they exist, truth, mask and `calib.txt`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scene {
    name: String,
    folder: PathBuf,
    left: PathBuf,
    right: PathBuf,
}

impl Scene {
    /// The scene in `folder`, called `name`; nothing when the folder holds no pair by a name svl knows.
    pub fn find(folder: &Path, name: &str) -> Option<Self> {
        let image = |stem: &str| ENDINGS.iter().map(|e| folder.join(format!("{stem}.{e}"))).find(|p| p.is_file());
        PAIRS.iter().find_map(|(left, right)| {
            let (left, right) = (image(left)?, image(right)?);
            Some(Self { name: name.to_owned(), folder: folder.to_owned(), left, right })
        })
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Scenes `names` below `root`.
    ///
    /// # Errors
    /// [`Error::Format`] naming the folder that is missing or holds no pair.
    pub fn find_all(root: &Path, names: &[String]) -> Result<Vec<Self>> {
        let find = |name: &String| {
            let folder = root.join(name);
            let nothing = || {
                let what =
                    if folder.is_dir() { "holds no stereo pair (im0.png and im1.png, say)" } else { "no such scene" };
                Error::format(&folder, format!("{what}; is '{}' the folder of the data sets?", root.display()))
            };
            Self::find(&folder, name).ok_or_else(nothing)
        };
        names.iter().map(find).collect()
    }

    /// Reads it as frame number `sequence`.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`], [`Error::PairSize`], each naming the file.
    pub fn read(&self, sequence: u64) -> Result<Frame> {
        let pair = StereoPair::new(read_gray(&self.left)?, read_gray(&self.right)?)
            .map_err(|e| Error::format(&self.folder, e.to_string()))?;
        let calib = self.folder.join("calib.txt");
        let rig = calib.is_file().then(|| read_calib(&calib)).transpose()?;
        Ok(Frame {
            sequence,
            stamp_ns: sequence * 1_000_000_000,
            name: Some(self.name.clone()),
            truth: self.truth(pair.size())?,
            pair,
            rig,
            pose: None,
            exposure: Exposure { trigger_id: sequence, ..Exposure::default() },
        })
    }

    fn truth(&self, size: (usize, usize)) -> Result<Option<Truth>> {
        let file = |name: &str| Some(self.folder.join(name)).filter(|p| p.is_file());
        let Some((path, form)) = TRUTHS.iter().find_map(|(name, form)| Some((file(name)?, form))) else {
            return Ok(None);
        };
        let disparity = match *form {
            TruthForm::Pfm => read_pfm(&path)?,
            TruthForm::Scaled { scale, zero_unknown } => read_scaled_disparity(&path, scale, zero_unknown)?,
        };
        same_size(&path, &disparity, size)?;
        let mask = MASKS.iter().find_map(|name| file(name));
        let visibility = mask.map(|path| read_mask(&path).and_then(|m| same_size(&path, &m, size).map(|()| m)));
        Ok(Some(Truth { disparity, visibility: visibility.transpose()? }))
    }
}

fn same_size<T: Copy>(path: &Path, plane: &Plane<T>, (width, height): (usize, usize)) -> Result<()> {
    let (w, h) = plane.size();
    if (w, h) == (width, height) {
        Ok(())
    } else {
        Err(Error::format(path, format!("is {w}x{h}, the left image is {width}x{height}")))
    }
}

/// Scenes, one frame each.
pub struct SceneSource {
    scenes: Vec<Scene>,
    next: usize,
}

impl SceneSource {
    pub fn new(scenes: Vec<Scene>) -> Self {
        Self { scenes, next: 0 }
    }
}

impl Source for SceneSource {
    fn name(&self) -> String {
        match &self.scenes[..] {
            [scene] => scene.name.clone(),
            scenes => format!("{} scenes", scenes.len()),
        }
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let Some(scene) = self.scenes.get(self.next) else { return Ok(None) };
        self.next += 1;
        scene.read(self.next as u64 - 1).map(Some)
    }

    fn pairs(&self) -> Option<u64> {
        Some(self.scenes.len() as u64)
    }
}
