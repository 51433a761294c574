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
    pub fn of(dataset: &Dataset, root: &Path) -> Self {
        let mut found = Self::default();
        let own = root.join(dataset.name);
        if own.is_dir()
            && let Err(error) = found.add(&own, &mut BTreeSet::new())
        {
            found.missing.push(error.to_string());
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

    /// Adds the scenes and files in `folder` and below. `seen`: the folders so far, as links may
    /// lead back.
    fn add(&mut self, folder: &Path, seen: &mut BTreeSet<PathBuf>) -> Result<()> {
        let io = |e| Error::io(folder, e);
        if !seen.insert(folder.canonicalize().map_err(io)?) {
            return Ok(());
        }
        self.scenes += Scene::all_in(folder, "")?.len();
        for entry in std::fs::read_dir(folder).map_err(io)? {
            let path = entry.map_err(io)?.path();
            match path.metadata() {
                Ok(file) if file.is_dir() => self.add(&path, seen)?,
                Ok(file) => self.bytes += file.len(),
                // A link that leads nowhere.
                Err(_) => {}
            }
        }
        Ok(())
    }
}
