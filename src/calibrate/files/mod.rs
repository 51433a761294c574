//! Calibrations in the files of other programs, read and written.
//!
//! [`FORMATS`] says all there is to say of a format; one more is one more file here and one more
//! line there.
//!
//! What a file says is taken as it stands: principal points with pixel centres at integers, as
//! OpenCV has them. Its lengths become metres, or stay in squares of the board; a file that does
//! not say what they are in is refused until the user does ([`Hints::unit`]).

mod boofcv;
mod document;
mod euroc;
mod geometry;
mod kitti;
mod lines;
mod markup;
mod middlebury;
mod opencv;
mod place;
mod ros;
mod thesis;
mod unit;
mod words;

pub use kitti::read_projections;
pub use middlebury::read_calib;
pub use place::{inputs, outputs};
pub use unit::Unit;

use crate::error::{Error, Result, did_you_mean, nearest};
use crate::stereo::StereoCalibration;
use document::{Document, Syntax};
use std::path::Path;

/// The form in which a program keeps calibrations.
#[derive(Debug)]
pub struct Format {
    pub name: &'static str,
    /// Whose it is.
    pub title: &'static str,
    /// What its files hold and in which conventions.
    pub conventions: &'static str,
    /// Endings of its files; the first format of an ending is the one that is written without being
    /// named.
    pub endings: &'static [&'static str],
    /// The two files of a calibration in a folder, where there are two.
    pub pairs: &'static [[&'static str; 2]],
    /// Whether one file may hold a whole calibration.
    single: bool,
    syntax: Syntax,
    /// Words by which its files are known.
    marks: &'static [&'static str],
    read: fn(Vec<Document>, &Hints) -> Result<Found>,
    write: Option<fn(&StereoCalibration) -> Writing>,
}

/// Every format, in the order in which they are looked for.
pub const FORMATS: &[Format] = &[
    thesis::FORMAT,
    opencv::FORMAT,
    ros::FORMAT,
    boofcv::FORMAT,
    euroc::FORMAT,
    middlebury::FORMAT,
    kitti::FORMAT,
    kitti::RAW_FORMAT,
];

/// What the user knows of a file and the file may not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hints {
    pub format: Option<&'static Format>,
    pub unit: Option<Unit>,
    /// Width and height of the images, pixels.
    pub size: Option<(usize, usize)>,
}

/// What was read.
#[derive(Debug)]
pub struct Found {
    pub format: &'static Format,
    pub calibration: StereoCalibration,
    /// What of the file is not in the calibration, or was taken otherwise than it stands, a line
    /// each.
    pub remarks: Vec<String>,
}

/// Texts to write, and what of the calibration is not in them.
struct Written {
    texts: Vec<String>,
    left_out: Vec<&'static str>,
}

/// Texts, or why the format cannot hold the calibration.
type Writing = std::result::Result<Written, String>;

/// Reads a calibration: a file, two files with a comma between, or a folder that holds two.
///
/// # Errors
/// Those of [`read_with`].
pub fn read(path: &Path) -> Result<StereoCalibration> {
    read_with(path, &Hints::default()).map(|found| found.calibration)
}

/// As [`read`], of a file that does not say all.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the file, the key and what to do.
pub fn read_with(path: &Path, hints: &Hints) -> Result<Found> {
    let paths = inputs(path)?;
    let texts = paths
        .iter()
        .map(|path| document::text(path))
        .collect::<Result<Vec<_>>>()?;
    let known = || {
        FORMATS
            .iter()
            .find(|format| format.marks.iter().any(|mark| texts[0].contains(mark)))
    };
    let Some(format) = hints.format.or_else(known) else {
        let names = FORMATS
            .iter()
            .map(|f| f.name)
            .collect::<Vec<_>>()
            .join(", ");
        return Err(Error::format(
            &paths[0],
            format!("is no calibration that svl knows: {names}"),
        ));
    };
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
                format!("is {}, whose one file holds both cameras", format.title),
            ));
        }
        _ => {}
    }
    let parse = |(path, text): (_, &String)| Document::parse(path, text, format);
    let documents = paths
        .iter()
        .map(AsRef::as_ref)
        .zip(&texts)
        .map(parse)
        .collect::<Result<_>>()?;
    (format.read)(documents, hints)
}

/// Writes a calibration in the format of the name's ending; what of it that format cannot hold, a
/// line each.
///
/// # Errors
/// Those of [`write_as`].
pub fn write(path: &Path, calibration: &StereoCalibration) -> Result<Vec<&'static str>> {
    write_as(path, written_as(path)?, calibration)
}

/// The format in which a file of that name is written.
///
/// # Errors
/// [`Error::Format`] for an ending of none, and of several of which none is usual.
pub fn written_as(path: &Path) -> Result<&'static Format> {
    if place::two_of(path).is_some() || path.is_dir() {
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
        ([_, _, ..], "txt") => {
            let names = fits.iter().map(|f| f.name).collect::<Vec<_>>().join(", ");
            Err(Error::format(
                path,
                format!("could be of several formats; choose one with --to: {names}"),
            ))
        }
        ([first, ..], _) => Ok(first),
    }
}

/// As [`write()`], in the format that is named.
///
/// # Errors
/// [`Error::Format`] when the format cannot hold the calibration; [`Error::Io`].
pub fn write_as(
    path: &Path,
    format: &Format,
    calibration: &StereoCalibration,
) -> Result<Vec<&'static str>> {
    let cannot = |reason: String| Error::format(path, format!("{}: {reason}", format.title));
    let write = format
        .write
        .ok_or_else(|| cannot("is read only; choose another with --to".into()))?;
    let Written { texts, left_out } = write(calibration).map_err(cannot)?;
    let paths = outputs(path, format)?;
    for (path, text) in paths.iter().zip(texts) {
        std::fs::write(path, text).map_err(|e| Error::io(path, e))?;
    }
    Ok(left_out)
}

/// The format of that name.
///
/// # Errors
/// [`Error::Invalid`] that suggests the nearest name and lists all.
pub fn format(name: &str) -> Result<&'static Format> {
    FORMATS.iter().find(|f| f.name == name).ok_or_else(|| {
        let hint = did_you_mean(&nearest(name, FORMATS.iter().map(|f| f.name)));
        let names = FORMATS
            .iter()
            .map(|f| f.name)
            .collect::<Vec<_>>()
            .join(", ");
        Error::Invalid(format!("unknown format '{name}'{hint}; there are {names}"))
    })
}

impl Format {
    /// Whether svl writes it too.
    pub fn is_written(&self) -> bool {
        self.write.is_some()
    }
}

/// The document of a format of one file.
fn one(documents: Vec<Document>) -> Result<Document> {
    <[Document; 1]>::try_from(documents)
        .map(|[one]| one)
        .map_err(|_| Error::Invalid("expected one file".into()))
}

/// The documents of a format of two files.
fn both(documents: Vec<Document>) -> Result<[Document; 2]> {
    documents
        .try_into()
        .map_err(|_| Error::Invalid("expected two files".into()))
}
