//! One scene of a data set: a pair with its truth and its camera, if known.

use super::entry::{CalibFile, PairFiles};
use super::table::{DATASETS, files};
use super::truth;
use crate::source::frames::{Source, warn_of_rig};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use svl_calibrate::files::{read_calib, read_projections};
use svl_core::stereo::{Exposure, Frame, Geometry, Rig};
use svl_core::{Error, Result, inputs};
use svl_files::{BitDepth, DecodedImage, GreyLevels, IMAGE_ENDINGS, read_image};
use svl_recording::StampOrigin;

/// A left and a right image, and if they exist, truth, mask and calibration: a folder of its own,
/// or one of many numbered scenes that share a folder, as in KITTI.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scene {
    name: String,
    /// The folder of its files, and of the truth beside them.
    folder: PathBuf,
    number: Option<String>,
    pair: &'static PairFiles,
    left: PathBuf,
    right: PathBuf,
}

impl Scene {
    /// The scene in `folder`, called `name`; none if the folder has no pair by a name svl knows.
    pub fn find(folder: &Path, name: &str) -> Option<Self> {
        let image = |name| image(folder, name, "");
        files()
            .flat_map(|f| f.pairs)
            .filter(|pair| !pair.numbered())
            .filter(|pair| pair.left != "im0" || !is_of_one_camera(folder))
            .find_map(|pair| {
                let (left, right) = (image(pair.left)?, image(pair.right)?);
                Some(Self {
                    name: name.to_owned(),
                    folder: folder.to_owned(),
                    number: None,
                    pair,
                    left,
                    right,
                })
            })
    }

    /// Name of the scene.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All scenes in `folder`, each called `prefix` and its own name: the numbered ones that share
    /// it, or those in its subfolders, in the order of their names; none when it holds neither.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a numbered image without a partner.
    pub fn all_in(folder: &Path, prefix: &str) -> Result<Vec<Self>> {
        for pair in files().flat_map(|f| f.pairs).filter(|pair| pair.numbered()) {
            let numbers = numbers(folder, pair.left)?;
            let scene = |number: String| Self::numbered(folder, pair, prefix, number);
            if !numbers.is_empty() {
                return numbers.into_iter().map(scene).collect();
            }
        }
        let names = names(folder)?
            .into_iter()
            .filter(|name| folder.join(name).is_dir());
        Ok(names
            .filter_map(|name| Self::find(&folder.join(&name), &format!("{prefix}{name}")))
            .collect())
    }

    fn numbered(
        folder: &Path,
        pair: &'static PairFiles,
        prefix: &str,
        number: String,
    ) -> Result<Self> {
        let image = |name: &str| {
            let missing = || {
                Error::format(
                    folder.join(name.replace('*', &number)),
                    "no such image; its partner exists",
                )
            };
            image(folder, name, &number).ok_or_else(missing)
        };
        let (left, right) = (image(pair.left)?, image(pair.right)?);
        Ok(Self {
            name: format!("{prefix}{number}"),
            folder: folder.to_owned(),
            number: Some(number),
            pair,
            left,
            right,
        })
    }

    /// Scenes `names` below `root`: `cones`, a folder; `kitti2015/training/000000`, a numbered
    /// scene; `kitti2015/training/*`, all scenes in that folder.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] naming the folder that is missing or has no pair.
    pub fn find_all(root: &Path, names: &[String]) -> Result<Vec<Self>> {
        let mut scenes = Vec::new();
        for name in names {
            let found = match name.rsplit_once('/').unwrap_or(("", name)) {
                (folder, "*") => {
                    let below = root.join(folder);
                    if below.is_dir() {
                        Self::all_in(&below, &prefix(folder))?
                    } else {
                        Vec::new()
                    }
                }
                (folder, own) => Self::find(&root.join(name), name).map_or_else(
                    || Self::by_number(&root.join(folder), &prefix(folder), own),
                    |scene| Ok(vec![scene]),
                )?,
            };
            if found.is_empty() {
                return Err(nothing(root, name));
            }
            // A scene counts once, however often it is named.
            scenes.extend(
                found
                    .into_iter()
                    .filter(|scene| !scenes.contains(scene))
                    .collect::<Vec<_>>(),
            );
        }
        Ok(scenes)
    }

    /// A scene by its number, or by its frame's name as KITTI's results have it, `000000_10`.
    fn by_number(folder: &Path, prefix: &str, name: &str) -> Result<Vec<Self>> {
        let numbers = [Some(name), name.strip_suffix("_10")].into_iter().flatten();
        let pairs = files().flat_map(|f| f.pairs).filter(|pair| pair.numbered());
        let mut named = pairs.flat_map(|pair| numbers.clone().map(move |number| (pair, number)));
        let found = named.find(|(pair, number)| image(folder, pair.left, number).is_some());
        found
            .map(|(pair, number)| Self::numbered(folder, pair, prefix, number.to_owned()))
            .into_iter()
            .collect()
    }

    /// The file of the scene by the data set's name for it, if it exists.
    pub(crate) fn file(&self, name: &str) -> Option<PathBuf> {
        let own = self
            .folder
            .file_name()
            .and_then(|n| n.to_str())
            .unwrap_or(&self.name);
        let name = match &self.number {
            Some(number) => name.replace('*', number),
            None => name.replace("{}", own),
        };
        Some(self.folder.join(name)).filter(|p| inputs::is_file(p))
    }

    /// True if a file with its truth exists.
    pub(crate) fn has_truth(&self) -> bool {
        let mut truths = files().flat_map(|f| f.truths);
        truths.any(|truth| self.file(truth.name).is_some())
    }

    /// True if its data set has a calibration for each scene, and this one has none.
    pub(crate) fn lacks_calibration(&self) -> bool {
        match self.pair.calib {
            CalibFile::Projections { file, .. } => self.file(file).is_none(),
            CalibFile::Middlebury => false,
        }
    }

    fn images(&self) -> Result<[DecodedImage; 2]> {
        Ok([read_image(&self.left)?, read_image(&self.right)?])
    }

    /// Reads it as frame number `sequence`; of 16 bits the upper 8 remain.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`], [`Error::PairSize`], each naming the file.
    pub fn read(&self, sequence: u64) -> Result<Frame> {
        self.read_with(sequence, &mut BitDepth::FULL.clone())
    }

    fn read_with(&self, sequence: u64, depth: &mut BitDepth) -> Result<Frame> {
        let (pair, color) = depth
            .pair(self.images()?)
            .map_err(|e| Error::format(&self.left, e.to_string()))?;
        let geometry = Geometry::Rectified(self.rig(pair.size())?);
        Ok(Frame {
            sequence,
            stamp_ns: StampOrigin::UNKNOWN.stamp_ns(sequence),
            name: Some(self.name.clone()),
            truth: truth::read(|name| self.file(name), pair.size())?,
            color,
            exposure: Exposure {
                trigger_id: sequence,
                ..Exposure::default()
            },
            ..Frame::new(pair, geometry)
        })
    }

    fn rig(&self, size: (usize, usize)) -> Result<Option<Rig>> {
        match self.pair.calib {
            CalibFile::Middlebury => self
                .file("calib.txt")
                .map(|path| read_calib(&path, size))
                .transpose(),
            CalibFile::Projections { file, left, right } => self
                .file(file)
                .map(|path| read_projections(&path, left, right))
                .transpose(),
        }
    }
}

/// True if a folder has the images of one camera, as `camera_00` beside `camera_02` in Booster's
/// scenes.
pub fn is_of_one_camera(folder: &Path) -> bool {
    let is_camera = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| name.starts_with("camera_")) && path.is_dir()
    };
    // The folder's own name, also of `.`.
    let Ok(folder) = folder.canonicalize() else {
        return false;
    };
    let beside = folder.parent().and_then(|above| inputs::list(above).ok());
    let mut beside = beside.into_iter().flatten();
    is_camera(&folder) && beside.any(|other| other != folder && is_camera(&other))
}

/// Prefix of the names of a folder's scenes.
fn prefix(folder: &str) -> String {
    if folder.is_empty() {
        String::new()
    } else {
        format!("{folder}/")
    }
}

/// The image of that name, whatever its format.
fn image(folder: &Path, name: &str, number: &str) -> Option<PathBuf> {
    let name = name.replace('*', number);
    IMAGE_ENDINGS
        .iter()
        .map(|ending| folder.join(format!("{name}.{ending}")))
        .find(|p| inputs::is_file(p))
}

/// The text that stands for `*` in the images that `pattern` names, in order.
fn numbers(folder: &Path, pattern: &str) -> Result<BTreeSet<String>> {
    let Some((subfolder, (before, after))) = pattern
        .rsplit_once('/')
        .and_then(|(folder, name)| Some((folder, name.split_once('*')?)))
    else {
        return Ok(BTreeSet::new());
    };
    let subfolder = folder.join(subfolder);
    if !subfolder.is_dir() {
        return Ok(BTreeSet::new());
    }
    let number = |name: String| {
        let (stem, ending) = name.rsplit_once('.')?;
        let number = stem.strip_prefix(before)?.strip_suffix(after)?;
        (IMAGE_ENDINGS.contains(&ending) && !number.is_empty()).then(|| number.to_owned())
    };
    Ok(names(&subfolder)?.into_iter().filter_map(number).collect())
}

/// The names in a folder, in order; names that are not UTF-8 belong to no data set.
fn names(folder: &Path) -> Result<BTreeSet<String>> {
    let paths = inputs::list(folder).map_err(|e| Error::io(folder, e))?;
    let name = |path: &PathBuf| Some(path.file_name()?.to_str()?.to_owned());
    Ok(paths.iter().filter_map(name).collect())
}

/// Error that there is no scene `name` below `root`, with the cure.
fn nothing(root: &Path, name: &str) -> Error {
    let path = root.join(name);
    let shown = root.display();
    if path.is_dir() && Scene::all_in(&path, "").is_ok_and(|scenes| !scenes.is_empty()) {
        let words = format!("is a folder of scenes; '{name}/*' names all of them");
        return Error::format(path, words);
    }
    let what = if path.is_dir() || name.ends_with('*') && path.parent().is_some_and(Path::is_dir) {
        "has no stereo pair (im0.png and im1.png, say)"
    } else {
        "no such scene"
    };
    let first = name.split('/').next();
    let cure = match DATASETS.iter().find(|d| Some(d.name) == first) {
        Some(dataset) => format!(
            "get it from {} as docs/data-sets.md says; `svl datasets --data {shown}` lists what is \
             missing",
            dataset.home
        ),
        None => format!("is '{shown}' the folder of the data sets?"),
    };
    Error::format(path, format!("{what}; {cure}"))
}

/// Scenes, one frame each.
///
/// The time at which they were taken is unknown, so they are stamped two seconds apart: farther
/// than any algorithm takes for one run.
pub struct SceneSource {
    scenes: Vec<Scene>,
    pub(in crate::source) depth: BitDepth,
    next: usize,
}

impl SceneSource {
    pub fn new(scenes: Vec<Scene>) -> Self {
        Self::with_bits(scenes, None).expect("only requested bits can be wrong")
    }

    /// `bits`: number of the 16 that are used [default: decided by the first pairs].
    ///
    /// # Errors
    /// [`Error::Usage`] for `bits` of 8-bit images.
    pub fn with_bits(scenes: Vec<Scene>, bits: Option<u8>) -> Result<Self> {
        // One that cannot be read is reported in its turn.
        let readable = scenes.iter().filter_map(|scene| scene.images().ok());
        let depth = BitDepth::decide(bits, &GreyLevels::from_pairs(readable))?;
        Ok(Self {
            scenes,
            depth,
            next: 0,
        })
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
        let Some(scene) = self.scenes.get(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        let sequence = self.next as u64 - 1;
        let frame = scene.read_with(sequence, &mut self.depth)?;
        warn_of_rig(&scene.name, &frame);
        Ok(Some(frame))
    }

    fn pairs(&self) -> Option<u64> {
        Some(self.scenes.len() as u64)
    }

    fn numbers(&self) -> Option<RangeInclusive<u64>> {
        None
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        self.next = (index as usize).min(self.scenes.len());
        Ok(true)
    }
}
