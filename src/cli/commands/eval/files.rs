//! The files of each image.

use super::Args;
use crate::cli::shared::usage;
use anyhow::{Context, bail};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::files::{has_ending, read_text};

/// Extensions of the files that folders are searched for.
const ENDINGS: &[&str] = &["pfm", "npy", "npz", "png", "pgm", "ppm"];
/// The truth of a scene in the folders of Middlebury v3 and ETH3D.
const SCENE_TRUTH: &str = "disp0GT.pfm";
/// Bytes that Middlebury's calib.txt may have.
const MAX_CALIB: u64 = 1 << 16;

/// The files of one image.
pub(super) struct ImageFiles {
    /// Their names in folders, without the extension.
    pub(super) name: String,
    pub(super) disparity: PathBuf,
    pub(super) truth: PathBuf,
    pub(super) masks: Vec<PathBuf>,
    pub(super) right_truth: Option<PathBuf>,
    pub(super) object_map: Option<PathBuf>,
    /// Weight in the average.
    pub(super) weight: f64,
    /// `ndisp` of the scene's calib.txt.
    pub(super) ndisp: Option<f64>,
}

impl ImageFiles {
    /// The one image, or one per file of the folder of truths.
    pub(super) fn find(args: &Args) -> anyhow::Result<Vec<Self>> {
        let (disparity, truth) = (&args.disparity, &args.ground_truth);
        if disparity.is_dir() != truth.is_dir() {
            let (folder, file) = if disparity.is_dir() {
                (disparity, truth)
            } else {
                (truth, disparity)
            };
            let (folder, file) = (folder.display(), file.display());
            bail!("{folder}: is a folder, {file} is not; name two files or two folders");
        }
        if !truth.is_dir() {
            let name = disparity.display().to_string();
            return Ok(vec![Self {
                name,
                disparity: disparity.clone(),
                truth: truth.clone(),
                masks: args.mask.clone(),
                right_truth: args.right_truth.clone(),
                object_map: args.object_map.clone(),
                weight: 1.0,
                ndisp: None,
            }]);
        }
        let scenes = scenes(truth)?;
        if scenes.is_empty() {
            Self::in_folders(args)
        } else {
            Self::in_scenes(args, &scenes)
        }
    }

    /// One image per folder of a scene that has an estimate: `SCENE/disp0GT.pfm` and
    /// `SCENE/disp0NAME.pfm`, or `disp0NAME.png`.
    fn in_scenes(args: &Args, scenes: &[String]) -> anyhow::Result<Vec<Self>> {
        if !args.mask.is_empty() || args.right_truth.is_some() || args.object_map.is_some() {
            let why = "--mask, --right-truth and --object-map are for files; the folders of scenes \
                       have mask0nocc.png";
            return Err(usage::wrong(why));
        }
        let known = args.protocol.scenes();
        let (mut images, mut missing) = (Vec::new(), Vec::new());
        for scene in scenes {
            let Some(disparity) = estimate(&args.disparity.join(scene))? else {
                missing.push(scene.as_str());
                continue;
            };
            let truth = args.ground_truth.join(scene);
            let mask = truth.join("mask0nocc.png");
            let weight = known.iter().find(|(name, _)| name == scene);
            images.push(Self {
                name: scene.clone(),
                disparity,
                truth: truth.join(SCENE_TRUTH),
                masks: mask.is_file().then_some(mask).into_iter().collect(),
                right_truth: None,
                object_map: None,
                weight: weight.map_or(1.0, |(_, weight)| *weight),
                ndisp: ndisp(&truth.join("calib.txt"))?,
            });
        }
        let names = known.iter().map(|(name, _)| *name);
        missing.extend(names.filter(|name| scenes.iter().all(|scene| scene != name)));
        if images.is_empty() {
            let (folder, truths) = (args.disparity.display(), args.ground_truth.display());
            bail!("{folder}: has no SCENE/disp0NAME.pfm for a scene of {truths}");
        }
        // Some with a mask and some without would be a mean of two kinds.
        let has_mask = |files: &&Self| !files.masks.is_empty();
        if let (Some(with), Some(without)) = (
            images.iter().find(has_mask),
            images.iter().find(|files| !has_mask(files)),
        ) {
            bail!(
                "{} has mask0nocc.png and {} has none; give it to all scenes, or to none",
                with.name,
                without.name
            );
        }
        if !missing.is_empty() {
            let missing = missing.join(", ");
            tracing::warn!("the average is not that of the benchmark: it lacks {missing}");
        }
        Ok(images)
    }

    /// One image per file of the folder of truths.
    fn in_folders(args: &Args) -> anyhow::Result<Vec<Self>> {
        let truths = Folder::read(&args.ground_truth)?;
        let disparities = Folder::read(&args.disparity)?;
        let masks = args.mask.iter().map(|path| Folder::read(path));
        let masks = masks.collect::<anyhow::Result<Vec<_>>>()?;
        let right_truths = args.right_truth.as_deref().map(Folder::read).transpose()?;
        let object_maps = args.object_map.as_deref().map(Folder::read).transpose()?;
        let optional = |folder: &Option<Folder>, name: &str| {
            folder.as_ref().map(|folder| folder.file(name)).transpose()
        };
        let image = |(name, truth): (&String, &PathBuf)| {
            let masks = masks.iter().map(|folder| folder.file(name));
            Ok(Self {
                name: name.clone(),
                disparity: disparities.file(name)?,
                truth: truth.clone(),
                masks: masks.collect::<anyhow::Result<_>>()?,
                right_truth: optional(&right_truths, name)?,
                object_map: optional(&object_maps, name)?,
                weight: 1.0,
                ndisp: None,
            })
        };
        let images = truths.files.iter().map(image);
        let images = images.collect::<anyhow::Result<_>>()?;
        for (name, file) in &disparities.files {
            if !truths.files.contains_key(name) {
                let (file, truths) = (file.display(), args.ground_truth.display());
                tracing::warn!("{file}: has no truth in {truths}; skipped");
            }
        }
        Ok(images)
    }

    /// True if the truth, or the estimate, may have a scale: only floats have none.
    pub(super) fn may_have_scales(&self) -> [bool; 2] {
        [&self.truth, &self.disparity].map(|path| !has_ending(path, "pfm"))
    }

    /// All files of the image.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        let own = [&self.disparity, &self.truth].into_iter();
        let optional = [&self.right_truth, &self.object_map].into_iter();
        let all = own.chain(&self.masks).chain(optional.flatten());
        all.map(PathBuf::as_path)
    }

    /// An error with the names of the files it is about.
    pub(super) fn explain(&self, error: &svl::Error) -> anyhow::Error {
        let (disparity, truth) = (self.disparity.display(), self.truth.display());
        anyhow::anyhow!("{disparity} and {truth}: {error}")
    }
}

/// The names of the folders of scenes, sorted.
fn scenes(folder: &Path) -> anyhow::Result<Vec<String>> {
    let mut scenes = Vec::new();
    for path in entries(folder)? {
        if path.join(SCENE_TRUTH).is_file() {
            scenes.extend(path.file_name().map(|n| n.to_string_lossy().into_owned()));
        }
    }
    scenes.sort_unstable();
    Ok(scenes)
}

/// The estimate in the folder of a scene, if it has one.
fn estimate(scene: &Path) -> anyhow::Result<Option<PathBuf>> {
    if !scene.is_dir() {
        return Ok(None);
    }
    let is_estimate = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_map = ENDINGS.iter().any(|ending| has_ending(path, ending));
        is_map && name.starts_with("disp0") && name != SCENE_TRUTH
    };
    let mut estimates = entries(scene)?;
    estimates.retain(is_estimate);
    estimates.sort_unstable();
    if let [one, other, ..] = estimates.as_slice() {
        let (one, other) = (one.display(), other.display());
        bail!("{one} and {other}: belong to the same scene; keep one");
    }
    Ok(estimates.pop())
}

/// The number of disparities in Middlebury's calib.txt, if there is one.
fn ndisp(calib: &Path) -> anyhow::Result<Option<f64>> {
    if !calib.is_file() {
        return Ok(None);
    }
    let text = read_text(calib, MAX_CALIB)?;
    let mut lines = text.lines();
    let value = lines.find_map(|line| line.trim().strip_prefix("ndisp="));
    let number = value.map(|value| {
        let number = value.trim().parse().ok().filter(|n| *n > 0.0);
        number.with_context(|| format!("{}: ndisp is not a number above 0", calib.display()))
    });
    number.transpose()
}

/// Everything in a folder but hidden files: macOS has a `._a.png` beside each a.png.
fn entries(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let shown = folder.display();
    let mut paths = std::fs::read_dir(folder)
        .with_context(|| format!("{shown}: is not a folder that can be read"))?
        .map(|entry| Ok(entry.with_context(|| shown.to_string())?.path()))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_owned();
    paths.retain(|path| !name(path).as_encoded_bytes().starts_with(b"."));
    Ok(paths)
}

/// The images and maps of a folder by name without extension.
struct Folder<'a> {
    path: &'a Path,
    files: BTreeMap<String, PathBuf>,
}

impl<'a> Folder<'a> {
    fn read(path: &'a Path) -> anyhow::Result<Self> {
        let shown = path.display();
        let mut files = BTreeMap::new();
        for file in entries(path)? {
            let ours = ENDINGS.iter().any(|ending| has_ending(&file, ending)) && file.is_file();
            let stem = file.file_stem().filter(|_| ours);
            let Some(stem) = stem else { continue };
            let name = stem.to_string_lossy().into_owned();
            if let Some(other) = files.insert(name, file.clone()) {
                let (other, file) = (other.display(), file.display());
                bail!("{other} and {file}: belong to the same image; keep one");
            }
        }
        if files.is_empty() {
            bail!("{shown}: holds no .{}", ENDINGS.join(", ."));
        }
        Ok(Self { path, files })
    }

    fn file(&self, name: &str) -> anyhow::Result<PathBuf> {
        let missing = || {
            let other = entries(self.path).ok().and_then(|mut entries| {
                entries.retain(|path| path.is_file() && path.file_stem() == Some(name.as_ref()));
                let (other, endings) = (entries.pop()?, ENDINGS.join(", ."));
                let other = other.display();
                Some(format!(
                    "; {other} is not read: convert it to one of .{endings}"
                ))
            });
            let (shown, other) = (self.path.display(), other.unwrap_or_default());
            format!("{shown}: has no file named {name}, which has a truth{other}")
        };
        self.files.get(name).cloned().with_context(missing)
    }
}
