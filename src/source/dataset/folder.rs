//! A folder of many pairs: `left/` and `right/` subfolders, or `left*` and `right*` files side by
//! side.

use super::scene::ENDINGS;
use crate::calibrate::files::read_calib;
use crate::error::{Error, Result};
use crate::files::read_gray;
use crate::source::Source;
use crate::stereo::{Exposure, Frame, Geometry, Losses, StereoPair};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names of the subfolders, of the files' beginnings: plain, KITTI 2015's, KITTI 2012's, KITTI
/// odometry's, EuRoC's.
const SIDES: &[(&str, &str)] = &[
    ("left", "right"),
    ("image_2", "image_3"),
    ("colored_0", "colored_1"),
    ("image_0", "image_1"),
    (EUROC, "cam1/data"),
];

/// The layout whose cameras have a `sensor.yaml` with distortion beside their images.
const EUROC: &str = "cam0/data";

/// Pairs of equally named images, in the order of their names. They count as rectified, as no file
/// says otherwise, but for those of EuRoC.
pub struct FolderSource {
    folder: PathBuf,
    pairs: Vec<(String, PathBuf, PathBuf)>,
    unpaired: usize,
    period_ns: u64,
    geometry: Geometry,
    next: usize,
}

impl FolderSource {
    /// The pairs in `folder`, `rate_hz` a second; `calib.txt` beside them gives the rig.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] when it holds no pair.
    pub fn new(folder: &Path, rate_hz: f64) -> Result<Self> {
        let (left, right) = sides(folder)?;
        let unpaired = left.keys().filter(|k| !right.contains_key(*k)).count()
            + right.keys().filter(|k| !left.contains_key(*k)).count();
        let pairs: Vec<_> = left
            .into_iter()
            .filter_map(|(k, l)| right.get(&k).map(|r| (k, l, r.clone())))
            .collect();
        if pairs.is_empty() {
            let cure = "expected im0.png and im1.png, or left/ and right/ with equally named \
                        images, or left01.png, right01.png, ...";
            return Err(Error::format(
                folder,
                format!("holds no stereo pair: {cure}"),
            ));
        }
        let calib = folder.join("calib.txt");
        let rig = calib.is_file().then(|| read_calib(&calib)).transpose()?;
        let geometry = match folder.join(EUROC).is_dir() && rig.is_none() {
            true => Geometry::Raw,
            false => Geometry::Rectified(rig),
        };
        Ok(Self {
            folder: folder.to_owned(),
            pairs,
            unpaired,
            period_ns: (1e9 / rate_hz) as u64,
            geometry,
            next: 0,
        })
    }
}

type Images = BTreeMap<String, PathBuf>;

fn sides(folder: &Path) -> Result<(Images, Images)> {
    for (left, right) in SIDES {
        let (left, right) = (folder.join(left), folder.join(right));
        if left.is_dir() && right.is_dir() {
            return Ok((images(&left, "")?, images(&right, "")?));
        }
    }
    Ok((images(folder, "left")?, images(folder, "right")?))
}

/// The images of `folder` whose names begin with `prefix`, by the rest of the name.
fn images(folder: &Path, prefix: &str) -> Result<Images> {
    let mut images = Images::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        let ending = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or("")
            .to_ascii_lowercase();
        let key = path
            .file_stem()
            .and_then(|s| s.to_str())
            .and_then(|s| s.strip_prefix(prefix));
        let key = key.filter(|_| ENDINGS.contains(&ending.as_str()));
        if let Some(other) = key.and_then(|key| images.insert(key.to_owned(), path.clone())) {
            let both = format!("and {} have one name; leave one of them", other.display());
            return Err(Error::format(path, both));
        }
    }
    Ok(images)
}

impl Source for FolderSource {
    fn name(&self) -> String {
        self.folder.display().to_string()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let Some((name, left, right)) = self.pairs.get(self.next) else {
            return Ok(None);
        };
        let sequence = self.next as u64;
        self.next += 1;
        let pair = StereoPair::new(read_gray(left)?, read_gray(right)?)
            .map_err(|e| Error::format(left, e.to_string()))?;
        Ok(Some(Frame {
            sequence,
            stamp_ns: sequence * self.period_ns,
            name: Some(name.clone()),
            pair,
            geometry: self.geometry,
            pose: None,
            truth: None,
            exposure: Exposure {
                trigger_id: sequence,
                drops: self.unpaired as u64,
                ..Exposure::default()
            },
        }))
    }

    fn pairs(&self) -> Option<u64> {
        Some(self.pairs.len() as u64)
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        self.next = (index as usize).min(self.pairs.len());
        Ok(true)
    }

    fn finish(&mut self, _: u64) -> Losses {
        Losses {
            unpaired: self.unpaired as u64,
            ..Losses::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::encode_png;

    #[test]
    fn euroc_s_folders_are_raw_and_others_count_as_rectified() {
        let png = encode_png(2, 1, &[0, 255]).unwrap();
        let layouts = [
            (["cam0/data", "cam1/data"], Geometry::Raw),
            (["left", "right"], Geometry::Rectified(None)),
        ];
        for (sides, geometry) in layouts {
            let folder = tempfile::tempdir().unwrap();
            for side in sides {
                std::fs::create_dir_all(folder.path().join(side)).unwrap();
                std::fs::write(folder.path().join(side).join("1.png"), &png).unwrap();
            }
            let mut source = FolderSource::new(folder.path(), 10.0).unwrap();
            assert_eq!(
                source.next().unwrap().unwrap().geometry,
                geometry,
                "{sides:?}"
            );
        }
    }
}
