//! Middlebury's and ETH3D's `calib.txt`.

use super::document::{Document, Syntax, text};
use super::format::{CalibrationFormat, Hints, LoadedCalibration, Writing, Written, one};
use super::geometry::{beyond_rectified, image_size, only_rectified, rectified};
use super::numbers::{number, rows, spaced};
use super::unit::FileUnit;
use nalgebra::Matrix3x4;
use std::path::Path;
use svl_core::Result;
use svl_core::stereo::{LengthUnit, Rig, Side, StereoCalibration, check_doffs};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "middlebury",
    title: "Middlebury's calib.txt",
    conventions: "rectified cameras only: cam0, cam1 = K, doffs = cx1 - cx0, baseline in \
                  millimetres; Z = f B / (d + doffs)",
    endings: &["txt"],
    pairs: &[],
    single: true,
    syntax: Syntax::Lines('='),
    marks: &["cam0=", "cam0 ="],
    read,
    write: Some(write),
};

/// Reads only the rig, for images of a size, which older files do not contain.
///
/// # Errors
/// [`svl_core::Error::Io`]; [`svl_core::Error::Format`] with the missing or malformed entry, and
/// for a file of images of another size.
pub fn read_calib(path: &Path, size: (usize, usize)) -> Result<Rig> {
    let document = Document::parse(path, &text(path)?, FORMAT.syntax, FORMAT.title)?;
    let hints = Hints {
        size: Some(size),
        ..Hints::default()
    };
    image_size(&document, stated_size(&document)?, &hints)?;
    rig(&document)
}

/// The size that the file states; older files do not.
fn stated_size(document: &Document) -> Result<Option<(usize, usize)>> {
    let has_size = document.has("width") && document.has("height");
    let size = has_size.then(|| document.size("width", "height"));
    size.transpose()
}

/// Largest differences of two rectified cameras: fraction of the focal length, and rows of the
/// principal points.
const FOCAL_TOLERANCE: f64 = 1e-3;
const ROW_TOLERANCE_PX: f64 = 0.5;

fn rig(document: &Document) -> Result<Rig> {
    let left = document.array::<9>("cam0")?;
    let (baseline, doffs) = (document.number("baseline")?, document.number("doffs")?);
    let (focal, center, baseline_m) = (left[0], (left[2], left[5]), baseline / 1000.0);
    let mut right = left;
    if document.has("cam1") {
        right = document.array::<9>("cam1")?;
        check_doffs(doffs, center.0, right[2]).map_err(|e| document.error(e))?;
    }
    let projection = |[fx, _, cx, _, fy, cy, ..]: [f64; 9], tx: f64| {
        Matrix3x4::new(fx, 0.0, cx, tx, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0)
    };
    let left = projection(left, 0.0);
    let right = projection(right, -focal * baseline_m);
    let (focal_part, rows_px) = (FOCAL_TOLERANCE, ROW_TOLERANCE_PX);
    Rig::from_projections(&left, &right, focal_part, rows_px, LengthUnit::Metres)
        .and_then(|_| Rig::new(focal, center, baseline_m, doffs))
        .map_err(|e| document.error(e))
}

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let document = one(documents)?;
    FileUnit::MILLIMETRE.fixed(&document, hints.unit)?;
    let size = image_size(&document, stated_size(&document)?, hints)?;
    let cameras = rectified(&document, size, rig(&document)?)?;
    // The rig is already in metres.
    cameras.loaded(&FORMAT, &document, FileUnit::METRE, Vec::new())
}

fn write(calibration: &StereoCalibration) -> Writing {
    let rectification = only_rectified(calibration)?;
    let (rig, (width, height)) = (rectification.rig, rectification.size);
    let camera = |side| {
        let k: Vec<_> = rows(&rig.intrinsics(side)).chunks(3).map(spaced).collect();
        k.join("; ")
    };
    let text = format!(
        "cam0=[{}]\ncam1=[{}]\ndoffs={}\nbaseline={}\nwidth={width}\nheight={height}\n",
        camera(Side::Left),
        camera(Side::Right),
        number(rig.doffs_px()),
        number(rig.baseline_m() * 1000.0)
    );
    Ok(Written {
        texts: vec![text],
        left_out: beyond_rectified(calibration),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> std::result::Result<Rig, String> {
        rig(&Document::parse(Path::new("calib.txt"), text, FORMAT.syntax, FORMAT.title).unwrap())
            .map_err(|e| e.to_string())
    }

    #[test]
    fn middlebury_form() {
        let text = "cam0=[ 1038.018 0 322.037 ; 0 1038.018 243.393 ; 0 0 1 ] \n doffs= 53.271 \
                    \nbaseline= 176.252\n";
        let rig = parse(text).unwrap();
        assert_eq!((rig.focal_px(), rig.doffs_px()), (1038.018, 53.271));
        assert!((rig.baseline_m() - 0.176252).abs() < 1e-12);
    }

    #[test]
    fn missing_entries_are_named() {
        let fails = |text: &str, word: &str| {
            let error = parse(text).unwrap_err();
            assert!(
                error.starts_with("calib.txt: ") && error.contains(word),
                "{error}"
            );
        };
        fails("cam0=[1 0 2; 0 1 3; 0 0 1]\ndoffs=0", "no 'baseline'");
        fails(
            "cam0=[1 0]\nbaseline=1\ndoffs=0",
            "'cam0' has 2 numbers, expected 9",
        );
        fails("cam0=[x]\nbaseline=1\ndoffs=0", "'cam0' is 'x'");
        fails(
            "cam0=[1 0 2; 0 1 3; 0 0 1]\nbaseline=0\ndoffs=0",
            "baseline 0 m",
        );
    }

    #[test]
    fn cameras_that_are_not_rectified_to_each_other_are_refused() {
        let with = |left: [f64; 2], right: [f64; 2], row: f64| {
            let text = format!(
                "cam0=[{} 0 320; 0 {} 240; 0 0 1]\ncam1=[{} 0 320; 0 {} {row}; 0 0 1]\ndoffs=0\n\
                 baseline=176\n",
                left[0], left[1], right[0], right[1]
            );
            parse(&text).err().unwrap_or_default()
        };
        assert_eq!(with([500.0; 2], [500.1, 500.0], 240.2), "");
        for (left, right, row, words) in [
            ([500.0; 2], [700.0; 2], 240.0, "500.000 and 700.000 px"),
            ([500.0; 2], [500.0; 2], 250.0, "rows 240.000 and 250.000"),
            ([500.0, 250.0], [500.0, 250.0], 240.0, "pixels are square"),
            ([500.0; 2], [500.0, 250.0], 240.0, "pixels are square"),
        ] {
            let reason = with(left, right, row);
            assert!(reason.contains(words), "{reason}");
        }
    }
}
