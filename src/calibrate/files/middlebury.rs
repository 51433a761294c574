//! Middlebury's and ETH3D's `calib.txt`.

use super::document::{Document, Syntax, text};
use super::format::{CalibrationFormat, Hints, LoadedCalibration, Writing, Written, one};
use super::geometry::{beyond_rectified, image_size, only_rectified, rectified};
use super::numbers::{number, rows, spaced};
use super::unit::FileUnit;
use std::path::Path;
use svl_core::Result;
use svl_core::stereo::{Rig, Side, StereoCalibration, check_doffs};

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

fn rig(document: &Document) -> Result<Rig> {
    let [focal, _, cx, _, _, cy, ..] = document.array::<9>("cam0")?;
    let (baseline, doffs) = (document.number("baseline")?, document.number("doffs")?);
    if document.has("cam1") {
        let right = document.array::<9>("cam1")?;
        check_doffs(doffs, cx, right[2]).map_err(|e| document.error(e))?;
    }
    Rig::new(focal, (cx, cy), baseline / 1000.0, doffs).map_err(|e| document.error(e))
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
}
