//! The files of a data set that are in a user's folder, and those that are missing.

use super::entry::Dataset;
use super::scene::Scene;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result, counted};

/// The files of a data set in a folder.
#[derive(Debug, Default, Serialize)]
pub struct Inventory {
    /// Number of pairs, with or without truth.
    pub scenes: usize,
    /// Size of all files.
    pub bytes: u64,
    /// A phrase for each kind of files that its scenario needs and that is missing or unreadable.
    pub missing: Vec<String>,
}

impl Inventory {
    /// Looks for `dataset` below `root`, the folder of the data sets.
    pub fn read(dataset: &Dataset, root: &Path) -> Self {
        let mut found = Self::default();
        let mut folders = vec![root.join(dataset.name)];
        folders.retain(|own| own.is_dir());
        // Links may lead back.
        let mut seen = BTreeSet::new();
        while let Some(folder) = folders.pop() {
            if !seen.insert(folder.canonicalize().ok()) {
                continue;
            }
            let added = found
                .add_files(&folder, &mut folders)
                .and_then(|()| found.add_scenes(&folder));
            if let Err(error) = added {
                found.missing.push(error.to_string());
            }
        }
        // An error was reported above.
        let scored = Scene::all_in(&root.join(dataset.folder), "").unwrap_or_default();
        let mut lack = |count: usize, what: &str| {
            if count > 0 {
                let scenes = counted(count as u64, "scene");
                let words = format!("{what}{scenes} in {}", dataset.folder);
                found.missing.push(words);
            }
        };
        lack(dataset.scenes.saturating_sub(scored.len()), "");
        let count = |lacks: fn(&Scene) -> bool| scored.iter().filter(|scene| lacks(scene)).count();
        lack(count(|scene| !scene.has_truth()), "truth of ");
        lack(count(Scene::lacks_calibration), "calibration of ");
        found
    }

    /// Adds the files in `folder`, and the folders in it to `below`.
    fn add_files(&mut self, folder: &Path, below: &mut Vec<PathBuf>) -> Result<()> {
        let io = |e| Error::io(folder, e);
        for entry in folder.read_dir().map_err(io)? {
            let path = entry.map_err(io)?.path();
            match path.metadata() {
                Ok(file) if file.is_dir() => below.push(path),
                Ok(file) => self.bytes += file.len(),
                // A link that leads nowhere.
                Err(_) => {}
            }
        }
        Ok(())
    }

    fn add_scenes(&mut self, folder: &Path) -> Result<()> {
        self.scenes += Scene::all_in(folder, "")?.len();
        Ok(())
    }
}
