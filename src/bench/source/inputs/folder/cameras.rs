//! The cameras of a folder of pairs.

use super::layout::{Cameras, Layout};
use std::path::{Path, PathBuf};
use svl_calibrate::files::{self, read_calib, read_projections};
use svl_core::stereo::{Geometry, StereoCalibration};
use svl_core::{Result, inputs};
use svl_files::read_text;

pub(crate) const CALIB: &str = "calib.txt";
/// KITTI's, of a whole day.
pub(crate) const CAM_TO_CAM: &str = "calib_cam_to_cam.txt";
/// Limit of its size in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Geometry of the pairs, and the calibration or the reason why it cannot be read.
pub(crate) struct FolderCameras {
    pub geometry: Geometry,
    pub calibration: std::result::Result<Option<StereoCalibration>, String>,
}

/// # Errors
/// [`svl_core::Error::Io`]; [`svl_core::Error::Format`] for a malformed file of rectified cameras,
/// and for one of another image size than `size`.
pub(crate) fn cameras(
    folder: &Path,
    layout: Option<&Layout>,
    size: (usize, usize),
) -> Result<FolderCameras> {
    let rectified = |rig| FolderCameras {
        geometry: Geometry::Rectified(rig),
        calibration: Ok(None),
    };
    let cameras = layout.map_or(&Cameras::Rectified, |layout| &layout.cameras);
    let calib = folder.join(CALIB);
    if inputs::is_file(&calib) {
        if let Cameras::Projections([left, right]) = cameras
            && read_text(&calib, MAX_BYTES)?.contains(&format!("{left}:"))
        {
            return read_projections(&calib, left, right).map(|rig| rectified(Some(rig)));
        }
        return read_calib(&calib, size).map(|rig| rectified(Some(rig)));
    }
    let raw = |calibration| FolderCameras {
        geometry: Geometry::Raw,
        calibration,
    };
    let sensors = |folders: &[&str; 2]| {
        let both = folders.map(|camera| folder.join(camera).join("sensor.yaml"));
        both.iter().all(|file| inputs::is_file(file)).then(|| {
            let read = files::read(folder).map_err(|e| e.to_string());
            raw(read.map(Some))
        })
    };
    let of_the_day = || file_of_the_day(&folder.canonicalize().ok()?, CAM_TO_CAM);
    Ok(match cameras {
        Cameras::Rectified | Cameras::Projections(_) => rectified(None),
        Cameras::Sensors(folders) => sensors(folders).unwrap_or_else(|| rectified(None)),
        Cameras::RawSensors(folders) => sensors(folders).unwrap_or_else(|| raw(Ok(None))),
        Cameras::CamToCam(projections) => match of_the_day() {
            Some(path) => {
                let [left, right] = projections;
                let rig = read_projections(&path, left, right)?;
                // Some data sets have only the rectified cameras.
                if !read_text(&path, MAX_BYTES)?.contains("K_00:") {
                    return Ok(rectified(Some(rig)));
                }
                let calibration = files::read(&path)?;
                if calibration.rectification().is_none_or(|by| by.size == size) {
                    rectified(Some(rig))
                } else {
                    // Recorded, not yet rectified; of another size it is refused with the pairs.
                    raw(Ok(Some(calibration)))
                }
            }
            None => rectified(None),
        },
    })
}

/// A file of KITTI's day, in the folder or in one of the two above it.
pub(crate) fn file_of_the_day(real_folder: &Path, name: &str) -> Option<PathBuf> {
    let mut files = real_folder.ancestors().take(3).map(|own| own.join(name));
    files.find(|file| inputs::is_file(file))
}

/// Reason why a pair does not fit the rig of earlier pairs.
pub(crate) fn size_mismatch(first: (usize, usize), own: (usize, usize)) -> String {
    format!(
        "has {}x{} pixels, the calibration is for images of {}x{}",
        own.0, own.1, first.0, first.1
    )
}
