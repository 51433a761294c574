//! Disparity maps as files: PFM, npz and KITTI's 16-bit PNG.

use super::image::{decode, encode};
use super::{known, npz, pfm, write_pfm, write_png};
use image::{DynamicImage, ExtendedColorType};
use std::path::Path;
use svl_core::stereo::{DisparityMap, Plane};
use svl_core::{Error, Result};

/// KITTI's 16-bit images contain 256 times the disparity.
const KITTI_SCALE: f32 = 256.0;

/// Reads true disparities, `+∞` if unknown, by the file extension: `.pfm`, `.npz`, or a grey image
/// whose values are `scale` times the disparity and 0 is unknown. For 16-bit images the default
/// scale is KITTI's 256.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`]; the latter also for an 8-bit image without a scale, and for a
/// colour image.
pub fn read_truth(path: &Path, scale: Option<f32>) -> Result<Plane<f32>> {
    Ok(known(&values(path, scale.unwrap_or(KITTI_SCALE), scale)?))
}

/// Same as [`read_truth`], for estimates to be scored: a pixel without disparity is `+∞`. In a PFM
/// any value that is not finite is no estimate, as in ETH3D's kit. 16-bit images always have
/// KITTI's scale.
///
/// # Errors
/// Also [`Error::Format`] for NaN and `-∞` in NumPy's files.
pub fn read_estimate(path: &Path, scale: Option<f32>) -> Result<Plane<f32>> {
    if has_ending(path, "pfm") {
        return pfm::read_pfm(path);
    }
    let values = values(path, KITTI_SCALE, scale)?;
    let wrong = values
        .pixels()
        .position(|d| d.is_nan() || d == f32::NEG_INFINITY);
    if let Some(at) = wrong {
        let (x, y) = (at % values.width(), at / values.width());
        let what = values.get(x, y);
        return Err(Error::format(
            path,
            format!("contains {what} at ({x}, {y}); a pixel without disparity is +inf"),
        ));
    }
    Ok(values)
}

/// The values in a file; those of images are divided by the scale, 0 is `+∞`.
fn values(path: &Path, scale_16: f32, scale_8: Option<f32>) -> Result<Plane<f32>> {
    if has_ending(path, "pfm") {
        return pfm::values(path);
    }
    if has_ending(path, "npz") {
        return npz::values(path);
    }
    let image = decode(path)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let disparity = |value: u16, scale: f32| {
        if value == 0 {
            f32::INFINITY
        } else {
            f32::from(value) / scale
        }
    };
    let values = match image {
        DynamicImage::ImageLuma16(grey) => grey
            .into_raw()
            .into_iter()
            .map(|v| disparity(v, scale_16))
            .collect(),
        DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
            return Err(Error::format(path, COLOUR));
        }
        other => {
            let rgb = other.into_rgb8();
            // Palette and RGB files with equal channels are grey.
            if rgb.pixels().any(|p| p[0] != p[1] || p[1] != p[2]) {
                return Err(Error::format(path, COLOUR));
            }
            let scale = scale_8.ok_or_else(|| Error::format(path, NO_SCALE))?;
            rgb.pixels()
                .map(|p| disparity(p[0].into(), scale))
                .collect()
        }
    };
    Plane::from_vec(width, height, values)
}

/// True if a file has this extension, in lower or upper case.
pub fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

const COLOUR: &str = "is a colour picture; disparities are read from grey images, .pfm and .npz";

const NO_SCALE: &str = "has 8 bits, which store a multiple of the disparity: give it with \
                        --disparity-scale (Middlebury 2001: 8, tsukuba: 16, 2003: 4, 2006: 3)";

/// Writes the disparities by the file extension: `.pfm` with `+∞` for invalid pixels, or `.png`,
/// 16-bit in KITTI's form: 256·d, 0 = invalid, a true 0 written as 1.
///
/// # Errors
/// [`Error::Invalid`] for another extension, or for disparities that a KITTI PNG cannot represent
/// (negative, or 256 and more).
pub fn write_disparity(path: &Path, map: &DisparityMap) -> Result<()> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("pfm") => write_pfm(path, map.disparity()),
        Some("png") => {
            let (width, height) = map.size();
            let values = map
                .disparity()
                .pixels()
                .map(kitti)
                .collect::<Option<Vec<u16>>>()
                .ok_or_else(|| {
                    Error::format(
                        path,
                        "a 16-bit PNG stores only disparities in 0..256; write .pfm instead",
                    )
                })?;
            // The encoder of `image` expects native byte order and writes big-endian.
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
            let png = encode(width, height, &bytes, ExtendedColorType::L16)?;
            std::fs::write(path, png).map_err(|e| Error::io(path, e))
        }
        _ => Err(Error::format(
            path,
            "disparities are written as .pfm or .png",
        )),
    }
}

/// KITTI's 16-bit code of a disparity.
fn kitti(disparity: f32) -> Option<u16> {
    if !disparity.is_finite() {
        return Some(0);
    }
    let code = (disparity * 256.0).round();
    (0.0..=65535.0)
        .contains(&code)
        // 0 is reserved for no disparity.
        .then(|| (code as u16).max(1))
}

/// Writes the reason codes as an 8-bit PNG.
///
/// # Errors
/// [`Error::Io`].
pub fn write_why(path: &Path, map: &DisparityMap) -> Result<()> {
    let (width, height) = map.size();
    let codes: Vec<u8> = map.why().pixels().map(|w| w as u8).collect();
    write_png(path, width, height, &codes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_disparity_steps;

    #[test]
    fn kitti_codes() {
        assert_eq!(kitti(f32::INFINITY), Some(0));
        assert_eq!(kitti(0.0), Some(1));
        assert_eq!(kitti(1.5), Some(384));
        assert_eq!(kitti(255.99), Some(65533));
        assert_eq!((kitti(256.0), kitti(-1.0)), (None, None));
    }

    #[test]
    fn images_are_read_by_their_form() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let row = |plane: Result<Plane<f32>>| plane.unwrap().row(0).to_vec();
        let wide = file("16.pgm", b"P5\n2 1\n65535\n\0\0\x03\0");
        assert_eq!(row(read_truth(&wide, None)), [f32::INFINITY, 3.0]);
        assert_eq!(row(read_truth(&wide, Some(128.0))), [f32::INFINITY, 6.0]);
        assert_eq!(row(read_estimate(&wide, Some(128.0))), [f32::INFINITY, 3.0]);
        let narrow = file("8.pgm", b"P5\n2 1\n255\n\0\x06");
        assert_eq!(row(read_truth(&narrow, Some(4.0))), [f32::INFINITY, 1.5]);
        let message = |plane: Result<Plane<f32>>| plane.unwrap_err().to_string();
        assert!(message(read_truth(&narrow, None)).contains("8.pgm: has 8 bits"));
        let colour = file("colour.ppm", b"P6\n1 1\n255\n\x01\x01\x02");
        assert!(message(read_truth(&colour, Some(4.0))).contains("colour picture"));
        let grey = file("grey.ppm", b"P6\n1 1\n255\n\x02\x02\x02");
        assert_eq!(row(read_truth(&grey, Some(4.0))), [0.5]);
    }

    #[test]
    fn values_of_a_pfm_that_are_not_finite_are_no_estimate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.pfm");
        for value in [f32::NAN, f32::NEG_INFINITY] {
            let plane = Plane::from_vec(2, 1, vec![4.0, value]).unwrap();
            write_pfm(&path, &plane).unwrap();
            for read in [read_estimate, read_truth] {
                assert_eq!(read(&path, None).unwrap().row(0), [4.0, f32::INFINITY]);
            }
        }
    }

    #[test]
    fn endings_in_capitals() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("D.PFM");
        write_pfm(&path, &Plane::filled(2, 1, 3.5).unwrap()).unwrap();
        assert_eq!(read_estimate(&path, None).unwrap().row(0), [3.5, 3.5]);
    }

    #[test]
    fn png_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        let mut map = DisparityMap::new(3, 1).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        row.accept(1, 12.25);
        row.accept(2, 80.0);
        write_disparity(&path, &map).unwrap();
        let back = read_disparity_steps(&path, 256.0, false).unwrap();
        assert_eq!(back.row(0), [f32::INFINITY, 12.25, 80.0]);
    }
}
