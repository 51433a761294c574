//! Calibration files of other programs, read and written.
//!
//! [`FORMATS`] is the table of formats; a new one is one file here and one line there.
//!
//! Principal points assume pixel centres at integers, as in OpenCV. Lengths become metres, or stay
//! in squares of the board; a file without a unit is rejected unless the user names one
//! ([`Hints::unit`]).

mod document;
mod euroc;
mod format;
mod geometry;
mod kalibr;
mod kitti;
mod markup;
mod middlebury;
mod numbers;
mod opencv;
mod ros;
mod thesis;
mod unit;

pub use format::{CalibrationFormat, Hints, LoadedCalibration};
pub use kitti::{read_offset, read_projections, read_scanner};
pub use middlebury::read_calib;
pub use unit::FileUnit;

use document::Document;
use format::{GeometryFault, Written};
use std::path::{Path, PathBuf};
use svl_core::stereo::StereoCalibration;
use svl_core::{Error, Result, did_you_mean, inputs, joined};

/// All formats, in the order in which a file is tested for them.
pub const FORMATS: &[CalibrationFormat] = &[
    thesis::FORMAT,
    opencv::FORMAT,
    ros::FORMAT,
    euroc::FORMAT,
    kalibr::FORMAT,
    middlebury::FORMAT,
    kitti::FORMAT,
    kitti::RAW_FORMAT,
];

/// Reads a calibration: a file, two files separated by a comma, a folder with two, or two cameras
/// of a chain as `FILE:cam2,cam3`.
///
/// # Errors
/// The errors of [`read_with`].
pub fn read(path: &Path) -> Result<StereoCalibration> {
    read_with(path, &Hints::default()).map(|found| found.calibration)
}

/// Same as [`read`], with hints for what the file lacks.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] with the file, the key and the remedy.
pub fn read_with(path: &Path, hints: &Hints) -> Result<LoadedCalibration> {
    let paths = inputs(path)?;
    let texts = paths.iter().map(|path| document::text(path));
    let texts = texts.collect::<Result<Vec<_>>>()?;
    parse_files(path, &paths, &texts, hints)
}

/// Same as [`read_with`], of the text of a file, or of the two files of a pair. In errors the text
/// is called `calibration`.
///
/// # Errors
/// The errors of [`read_with`].
pub fn parse(texts: &[&str], hints: &Hints) -> Result<LoadedCalibration> {
    let names: &[&str] = match texts.len() {
        1 => &["calibration"],
        2 => &["left calibration", "right calibration"],
        count => {
            let words = format!("{count} texts of a calibration: expected 1 or 2");
            return Err(Error::Invalid(words));
        }
    };
    let paths: Vec<_> = names.iter().map(PathBuf::from).collect();
    let texts: Vec<_> = texts.iter().map(|text| (*text).to_owned()).collect();
    parse_files(Path::new("calibration"), &paths, &texts, hints)
}

/// The calibration in the texts of one or two files, which the user names as `path`.
fn parse_files(
    path: &Path,
    paths: &[PathBuf],
    texts: &[String],
    hints: &Hints,
) -> Result<LoadedCalibration> {
    let known = || {
        FORMATS
            .iter()
            .find(|format| format.marks.iter().any(|mark| texts[0].contains(mark)))
    };
    let Some(format) = hints.format.or_else(known) else {
        if texts[0].contains("\"cameraData\"") {
            return Err(Error::format(
                &paths[0],
                "is DepthAI's calibration of an OAK: Python's depthai.CalibrationHandler(FILE) \
                 reads it; write its intrinsics and extrinsics as OpenCV's K1 D1 K2 D2 R T",
            ));
        }
        let names = joined(FORMATS.iter().map(|f| f.name));
        return Err(Error::format(
            &paths[0],
            format!("is not a calibration that svl knows: {names}"),
        ));
    };
    // One file instead of two, or two instead of one: checked here, where the message can name
    // both.
    match (paths.len(), format.single, format.pairs) {
        (1, false, [[left, right], ..]) => {
            let cure = format!("name both, `{left},{right}`, or their folder");
            return Err(Error::format(
                path,
                format!("is {}, one camera of two; {cure}", format.title),
            ));
        }
        (2, _, []) => {
            return Err(Error::format(
                path,
                format!(
                    "is {}, whose single file contains both cameras",
                    format.title
                ),
            ));
        }
        _ => {}
    }
    let parse =
        |(path, text): (_, &String)| Document::parse(path, text, format.syntax, format.title);
    let documents = paths
        .iter()
        .map(AsRef::as_ref)
        .zip(texts)
        .map(parse)
        .collect::<Result<_>>()?;
    let named = selected(path).map(|(_, cameras)| cameras);
    if named.is_some() && format.name != kalibr::FORMAT.name {
        let words = format!("is {}, which has no chain of cameras", format.title);
        return Err(Error::format(path, words));
    }
    let hints = &Hints {
        cameras: hints.cameras.or(named),
        ..*hints
    };
    let found = (format.read)(documents, hints)?;
    let lens = found.calibration.left().distortion().model();
    match hints.model {
        Some(named) if named != lens => {
            let words = format!("its distortion is {lens}, not {named}; omit --model");
            Err(Error::format(path, words))
        }
        _ => Ok(found),
    }
}

/// Writes a calibration in the format of the file name extension. Returns the parts that the format
/// cannot represent, a line each.
///
/// # Errors
/// The errors of [`write_as`].
pub fn write(path: &Path, calibration: &StereoCalibration) -> Result<Vec<&'static str>> {
    write_as(path, written_as(path)?, calibration, Path::to_owned)
}

/// The default format for writing a file of that name.
///
/// # Errors
/// [`Error::Format`] for an unknown extension, and for one shared by several formats without a
/// default.
pub fn written_as(path: &Path) -> Result<&'static CalibrationFormat> {
    if two_of(path).is_some() || path.is_dir() {
        return Ok(&ros::FORMAT);
    }
    let ending = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    let fits: Vec<_> = FORMATS
        .iter()
        .filter(|f| f.endings.contains(&ending) && f.write.is_some())
        .collect();
    match (&fits[..], ending) {
        ([], _) => Err(Error::format(
            path,
            "must end in .xml, .yaml, .yml or .txt, or be two files, `left.yaml,right.yaml`",
        )),
        // Middlebury and KITTI share .txt; neither is more common than the other.
        ([_, _, ..], "txt") => {
            let names = joined(fits.iter().map(|f| f.name));
            Err(Error::format(
                path,
                format!("could be of several formats; choose one with --to: {names}"),
            ))
        }
        ([first, ..], _) => Ok(first),
    }
}

/// Same as [`write()`], in the given format. `place`: where each file is written.
///
/// # Errors
/// [`Error::Format`] if the format cannot represent the calibration; [`Error::Io`].
pub fn write_as(
    path: &Path,
    format: &CalibrationFormat,
    calibration: &StereoCalibration,
    place: impl Fn(&Path) -> PathBuf,
) -> Result<Vec<&'static str>> {
    let write = format.write.ok_or(GeometryFault::ReadOnly);
    let written = write.and_then(|write| write(calibration));
    let cannot = |fault| Error::format(path, format!("{}: {fault}", format.title));
    let Written { texts, left_out } = written.map_err(cannot)?;
    let paths = outputs(path, format)?;
    for (path, text) in paths.iter().zip(texts) {
        std::fs::write(place(path), text).map_err(|e| Error::io(path, e))?;
    }
    Ok(left_out)
}

/// The format of that name.
///
/// # Errors
/// [`Error::Invalid`] with the nearest name and the list of all.
pub fn format(name: &str) -> Result<&'static CalibrationFormat> {
    FORMATS.iter().find(|f| f.name == name).ok_or_else(|| {
        let hint = did_you_mean(name, FORMATS.iter().map(|f| f.name));
        let names = joined(FORMATS.iter().map(|f| f.name));
        Error::Invalid(format!("unknown format '{name}'{hint}; there are {names}"))
    })
}

/// Both files of `left.yaml,right.yaml`, unless a file has that name.
fn two_of(path: &Path) -> Option<[PathBuf; 2]> {
    let (first, second) = path.to_str()?.split_once(',')?;
    // A file may have a comma in its name.
    (!path.exists() && selected(path).is_none()).then(|| [first.into(), second.into()])
}

/// The file and the numbers of both cameras of `FILE:cam2,cam3`.
fn selected(path: &Path) -> Option<(PathBuf, [usize; 2])> {
    let (file, cameras) = path.to_str()?.rsplit_once(':')?;
    let (left, right) = cameras.split_once(',')?;
    let number = |name: &str| name.strip_prefix("cam")?.parse().ok();
    Some((file.into(), [number(left)?, number(right)?]))
}

/// The files to read: one or two.
///
/// # Errors
/// [`Error::Format`] for a folder without a known pair of files.
pub fn inputs(path: &Path) -> Result<Vec<PathBuf>> {
    if let Some(both) = two_of(path) {
        return Ok(both.into());
    }
    // A recording keeps a file under the name with its cameras.
    if let Some((file, _)) = selected(path).filter(|_| !path.exists()) {
        return Ok(vec![file]);
    }
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let pairs = || FORMATS.iter().flat_map(|format| format.pairs);
    let found = pairs()
        .map(|pair| pair.map(|name| path.join(name)))
        .find(|both| both.iter().all(|p| inputs::is_file(p)));
    found.map(Vec::from).ok_or_else(|| {
        let names = pairs()
            .map(|[left, right]| format!("{left} and {right}"))
            .collect::<Vec<_>>()
            .join("; ");
        Error::format(
            path,
            format!("is a folder without a calibration's two files: {names}; name the file itself"),
        )
    })
}

/// The files written for `path` in that format.
///
/// # Errors
/// [`Error::Format`] if the format needs two files and one is named, or the reverse.
pub fn outputs(path: &Path, format: &CalibrationFormat) -> Result<Vec<PathBuf>> {
    let title = format.title;
    match (two_of(path), format.single) {
        (Some(both), false) => Ok(both.into()),
        (None, true) if !path.is_dir() => {
            let ending = path
                .extension()
                .and_then(|e| e.to_str())
                .unwrap_or_default();
            if !format.endings.contains(&ending) {
                let endings = format.endings.join(" or .");
                let reason = format!("{title} is written as .{endings}");
                return Err(Error::format(path, reason));
            }
            Ok(vec![path.to_owned()])
        }
        (None, false) if path.is_dir() => Ok(format
            .pairs
            .iter()
            .take(1)
            .flatten()
            .map(|name| path.join(name))
            .collect()),
        (_, true) => Err(Error::format(path, format!("{title} is one file; name it"))),
        (_, false) => {
            let cure = "is two files; name both, `left.yaml,right.yaml`, or a folder";
            Err(Error::format(path, format!("{title} {cure}")))
        }
    }
}
