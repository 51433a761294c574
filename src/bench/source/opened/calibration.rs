//! The calibration that rectifies the pairs of a source, and its files.

use std::convert::Infallible;
use std::ffi::OsStr;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use svl_calibrate::files::{self, Hints};
use svl_core::rectify::{Framing, bouguet};
use svl_core::stereo::StereoCalibration;
use svl_core::{Error, Result, inputs};
use svl_recording::{CALIBRATION, Recording, warn_of};

/// The calibration that rectifies the pairs of a source.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Calib {
    /// The calibration in a recording of raw images; other pairs stay as they are.
    #[default]
    Own,
    /// A calibration: a file, two with a comma between, the folder of the two, or a recording that
    /// keeps it.
    File(PathBuf),
    /// Nothing: the pairs are taken as rectified, with the projections of their calibration.
    None,
    /// Nothing: the pairs stay raw, to rectify them later, or to calibrate cameras with.
    Raw,
}

impl FromStr for Calib {
    type Err = Infallible;

    /// `own`, `none`, `raw`, or a path.
    fn from_str(text: &str) -> std::result::Result<Self, Infallible> {
        Ok(match text {
            "own" => Self::Own,
            "none" => Self::None,
            "raw" => Self::Raw,
            path => Self::File(path.into()),
        })
    }
}

/// Names and contents of calibration files.
pub type CalibrationFiles = Vec<(String, Vec<u8>)>;

/// Reads a calibration and its files. `topics`: those of the images, which choose the cameras of a
/// chain; the name of its file keeps the choice.
pub(crate) fn read(
    path: &Path,
    topics: [&str; 2],
) -> Result<(StereoCalibration, CalibrationFiles)> {
    if path.extension() != Some(OsStr::new("mcap")) {
        let hints = Hints {
            topics,
            ..Hints::default()
        };
        let found = files::read_with(path, &hints)?;
        for note in found.notes() {
            tracing::warn!("{}: {note}", path.display());
        }
        let name = path.display().to_string();
        found.doubts().for_each(|doubt| warn_of(&name, &doubt));
        let mut kept = contents(&files::inputs(path)?)?;
        if let ([(name, _)], Some([left, right])) = (&mut kept[..], found.cameras) {
            *name += &format!(":cam{left},cam{right}");
        }
        return Ok((found.calibration, kept));
    }
    let kept = Recording::open(path)?.calibration_files()?;
    if kept.is_empty() {
        let what = format!("keeps no calibration (attachments {CALIBRATION}…)");
        let cure = "`svl info` lists what it keeps";
        return Err(Error::format(path, format!("{what}; {cure}")));
    }
    let folder = folder()?;
    let mut paths = Vec::new();
    for (name, bytes) in &kept {
        // The last part alone: a recording must not choose where its files go.
        let name = Path::new(name)
            .file_name()
            .ok_or_else(|| Error::format(path, format!("has a file named '{name}'")))?;
        let to = folder.path().join(name);
        std::fs::write(&to, bytes).map_err(|e| Error::io(&to, e))?;
        paths.push(to.display().to_string());
    }
    let read = files::read(Path::new(&paths.join(",")));
    let calibration = read.map_err(|e| Error::format(path, e.to_string()))?;
    Ok((calibration, kept))
}

/// The files of a calibration that is not in a file yet.
pub(crate) fn written(calibration: &StereoCalibration) -> Result<CalibrationFiles> {
    let folder = folder()?;
    // ROS's files have no cameras without their rectification.
    let alpha = calibration.rectification().is_none().then_some(0.0);
    let calibration = framed(calibration.clone(), alpha)?;
    files::write(folder.path(), &calibration)?;
    contents(&files::inputs(folder.path())?)
}

/// Rectifies with the fraction `alpha` of the raw images, if it is given.
pub(crate) fn framed(
    calibration: StereoCalibration,
    alpha: Option<f64>,
) -> Result<StereoCalibration> {
    let Some(alpha) = alpha else {
        return Ok(calibration);
    };
    let framing = Framing {
        alpha,
        ..Framing::default()
    };
    let rectification = bouguet(&calibration, &framing)?;
    Ok(calibration.with_rectification(rectification))
}

fn folder() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), e))
}

/// Names and contents of files. Two of one name get their folder's name as a prefix.
fn contents(paths: &[PathBuf]) -> Result<CalibrationFiles> {
    let text = |name: Option<&OsStr>| name.unwrap_or_default().to_string_lossy().into_owned();
    let alike = |path: &Path| {
        let name = path.file_name();
        paths
            .iter()
            .filter(|other| other.file_name() == name)
            .count()
            > 1
    };
    let content = |path: &PathBuf| {
        let folder = path.parent().filter(|_| alike(path));
        let prefix = folder.map_or(String::new(), |folder| text(folder.file_name()) + "-");
        let mut bytes = Vec::new();
        let read = inputs::open(path).and_then(|mut file| file.read_to_end(&mut bytes));
        read.map_err(|e| Error::io(path, e))?;
        Ok((prefix + &text(path.file_name()), bytes))
    };
    paths.iter().map(content).collect()
}
