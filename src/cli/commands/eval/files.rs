//! The files of each image.

use super::Args;
use anyhow::{Context, bail};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::files::has_ending;

/// Extensions of the files that folders are searched for.
const ENDINGS: &[&str] = &["pfm", "npz", "png", "pgm", "ppm"];

/// The files of one image.
pub(super) struct ImageFiles {
    /// Their names in folders, without the extension.
    pub(super) name: String,
    pub(super) disparity: PathBuf,
    pub(super) truth: PathBuf,
    pub(super) masks: Vec<PathBuf>,
    pub(super) right_truth: Option<PathBuf>,
    pub(super) object_map: Option<PathBuf>,
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
            bail!(
                "{}: is a folder, {} is not; name two files or two folders",
                folder.display(),
                file.display()
            );
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
            }]);
        }
        Self::in_folders(args)
    }

    /// One image per file of the folder of truths.
    fn in_folders(args: &Args) -> anyhow::Result<Vec<Self>> {
        let truths = Folder::read(&args.ground_truth)?;
        let disparities = Folder::read(&args.disparity)?;
        let masks = args
            .mask
            .iter()
            .map(|path| Folder::read(path))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let right_truths = args.right_truth.as_deref().map(Folder::read).transpose()?;
        let object_maps = args.object_map.as_deref().map(Folder::read).transpose()?;
        let optional = |folder: &Option<Folder>, name: &str| {
            folder.as_ref().map(|folder| folder.file(name)).transpose()
        };
        let image = |(name, truth): (&String, &PathBuf)| {
            Ok(Self {
                name: name.clone(),
                disparity: disparities.file(name)?,
                truth: truth.clone(),
                masks: masks
                    .iter()
                    .map(|folder| folder.file(name))
                    .collect::<anyhow::Result<_>>()?,
                right_truth: optional(&right_truths, name)?,
                object_map: optional(&object_maps, name)?,
            })
        };
        let images = truths
            .files
            .iter()
            .map(image)
            .collect::<anyhow::Result<_>>()?;
        for (_, file) in disparities
            .files
            .iter()
            .filter(|(name, _)| !truths.files.contains_key(*name))
        {
            tracing::warn!(
                "{}: has no truth in {}; skipped",
                file.display(),
                args.ground_truth.display()
            );
        }
        Ok(images)
    }

    /// True if a disparity map among them is an image, which has a scale.
    pub(super) fn has_images(&self) -> bool {
        let floats = |path: &Path| has_ending(path, "pfm") || has_ending(path, "npz");
        !(floats(&self.disparity) && floats(&self.truth))
    }

    /// All files of the image.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        let (one, more) = (
            [&self.disparity, &self.truth],
            [&self.right_truth, &self.object_map],
        );
        one.into_iter()
            .chain(&self.masks)
            .chain(more.into_iter().flatten())
            .map(PathBuf::as_path)
    }

    /// An error with the names of the files it is about.
    pub(super) fn explain(&self, error: &svl::Error) -> anyhow::Error {
        anyhow::anyhow!(
            "{} and {}: {error}",
            self.disparity.display(),
            self.truth.display()
        )
    }
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
        for entry in std::fs::read_dir(path)
            .with_context(|| format!("{shown}: is not a folder that can be read"))?
        {
            let file = entry.with_context(|| shown.to_string())?.path();
            let ours = ENDINGS.iter().any(|ending| has_ending(&file, ending)) && file.is_file();
            let name = file
                .file_stem()
                .map(|stem| stem.to_string_lossy().into_owned())
                .filter(|_| ours);
            let Some(name) = name else { continue };
            if let Some(other) = files.insert(name, file.clone()) {
                bail!(
                    "{} and {}: belong to the same image; keep one",
                    other.display(),
                    file.display()
                );
            }
        }
        if files.is_empty() {
            bail!("{shown}: holds no .{}", ENDINGS.join(", ."));
        }
        Ok(Self { path, files })
    }

    fn file(&self, name: &str) -> anyhow::Result<PathBuf> {
        let missing = || {
            format!(
                "{}: has no file named {name}, which has a truth",
                self.path.display()
            )
        };
        self.files.get(name).cloned().with_context(missing)
    }
}
