//! Disparity maps as files: PFM, npz and KITTI's 16-bit PNG.

use super::image::encode;
use super::map::{NumberForm, StoredMap};
use super::{known, write_pfm, write_png};
use image::ExtendedColorType;
use std::path::Path;
use svl_core::stereo::{DisparityMap, Plane};
use svl_core::{Error, Result};

/// KITTI's 16-bit images contain 256 times the disparity.
const KITTI_SCALE: f32 = 256.0;

/// Multiples of the disparity that integers are.
#[derive(Clone, Copy, Debug, Default)]
pub struct MapScale {
    /// Multiple in images of 16 bits [default: KITTI's 256], and in NumPy's integers.
    pub of_16_bits: Option<f32>,
    /// Multiple in images of 8 bits.
    pub of_8_bits: Option<f32>,
}

impl MapScale {
    /// One scale for all integers.
    pub fn same(scale: Option<f32>) -> Self {
        Self {
            of_16_bits: scale,
            of_8_bits: scale,
        }
    }
}

/// Reads disparities, `+∞` where there is none: finite values of `.pfm`, `.npy` and `.npz`, or a
/// grey image whose values are a multiple of the disparity and 0 is none.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`]; the latter also for integers whose scale is unknown, and for a
/// colour image.
pub fn read_disparities(path: &Path, scale: MapScale) -> Result<Plane<f32>> {
    let stored = StoredMap::read(path)?;
    let scale = match stored.form {
        NumberForm::Floats => return Ok(known(&stored.values)),
        NumberForm::Integers => scale.of_16_bits,
        NumberForm::Image16 => scale.of_16_bits.or(Some(KITTI_SCALE)),
        NumberForm::Image8 => scale.of_8_bits,
    };
    let scale = scale.ok_or_else(|| Error::format(path, NO_SCALE))?;
    Ok(steps(&stored, scale, false))
}

/// Disparities, `+∞` for none, from the same files, whose values of any form are `scale` times the
/// disparity. `has_zeros`: false where 0 is none.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for other files.
pub fn read_disparity_steps(path: &Path, scale: f32, has_zeros: bool) -> Result<Plane<f32>> {
    Ok(steps(&StoredMap::read(path)?, scale, has_zeros))
}

fn steps(stored: &StoredMap, scale: f32, has_zeros: bool) -> Plane<f32> {
    stored.values.map(|value| {
        if (value == 0.0 && !has_zeros) || !value.is_finite() {
            f32::INFINITY
        } else {
            value / scale
        }
    })
}

const NO_SCALE: &str = "has integers, a multiple of the disparity that is not known: give it with \
                        --disparity-scale or --estimate-scale (Middlebury 2001: 8, tsukuba: 16, \
                        2003: 4, 2006: 3; OpenCV's matchers: 16)";

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
            let cure = "a 16-bit PNG stores only disparities in 0..256; write .pfm instead";
            let values: Option<Vec<u16>> = map.disparity().pixels().map(kitti).collect();
            let values = values.ok_or_else(|| Error::format(path, cure))?;
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

    #[test]
    fn kitti_codes() {
        assert_eq!(kitti(f32::INFINITY), Some(0));
        assert_eq!(kitti(0.0), Some(1));
        assert_eq!(kitti(1.5), Some(384));
        assert_eq!(kitti(255.99), Some(65533));
        assert_eq!((kitti(256.0), kitti(-1.0)), (None, None));
    }

    #[test]
    fn maps_are_read_by_their_form() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let read = |name: &str, bytes: &[u8], scale| {
            let plane = read_disparities(&file(name, bytes), MapScale::same(scale));
            plane.map(|plane| plane.row(0).to_vec())
        };
        let far = f32::INFINITY;
        let wide = b"P5\n2 1\n65535\n\0\0\x03\0";
        let commented = b"P5 # 9 9 9\n2 1 # 9\n# 9\n 40000 \0\0\x03\0";
        for (name, bytes, scale, expected) in [
            ("16.pgm", &wide[..], None, &[far, 3.0][..]),
            ("16.pgm", wide, Some(128.0), &[far, 6.0]),
            ("other.pgm", b"P5\n2 1\n1023\n\0\0\x03\0", None, &[far, 3.0]),
            ("other.pgm", commented, None, &[far, 3.0]),
            ("text.pgm", b"P2\n2 1\n1000\n0 768\n", None, &[far, 3.0]),
            // Values are as they are, whatever the largest may be.
            ("64.pgm", b"P5\n2 1\n255\n\0\x06", Some(2.0), &[far, 3.0]),
            ("64.pgm", b"P5\n2 1\n64\n\0\x06", Some(2.0), &[far, 3.0]),
            ("64.pgm", b"P5\n2 1\n6\n\0\x06", Some(2.0), &[far, 3.0]),
            ("8.pgm", b"P5\n2 1\n255\n\0\x06", Some(4.0), &[far, 1.5]),
            ("grey.ppm", b"P6\n1 1\n255\n\x02\x02\x02", Some(4.0), &[0.5]),
        ] {
            assert_eq!(read(name, bytes, scale).unwrap(), expected, "{name}");
        }
        let colour = b"P6\n1 1\n255\n\x01\x01\x02";
        let pointer = b"version https://git-lfs.github.com/spec/v1\noid";
        for (name, bytes, scale, words) in [
            ("cut.pgm", &b"P5\n2 1\n1023"[..], None, "not a readable"),
            (
                "8.pgm",
                b"P5\n2 1\n255\n\0\x06",
                None,
                "8.pgm: has integers",
            ),
            ("colour.ppm", colour, Some(4.0), "colour picture"),
            (
                "page.pfm",
                b"<!DOCTYPE html>\n<html>",
                None,
                "page.pfm: is a web page",
            ),
            ("p.png", pointer, None, "git lfs pull"),
            ("e.pfm", b"", None, "is empty"),
        ] {
            let error = read(name, bytes, scale).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn values_of_a_pfm_that_are_not_finite_are_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.pfm");
        for value in [f32::NAN, f32::NEG_INFINITY] {
            let plane = Plane::from_vec(2, 1, vec![4.0, value]).unwrap();
            write_pfm(&path, &plane).unwrap();
            let read = read_disparities(&path, MapScale::default()).unwrap();
            assert_eq!(read.row(0), [4.0, f32::INFINITY]);
        }
    }

    #[test]
    fn endings_in_capitals() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("D.PFM");
        write_pfm(&path, &Plane::filled(2, 1, 3.5).unwrap()).unwrap();
        let read = read_disparities(&path, MapScale::default()).unwrap();
        assert_eq!(read.row(0), [3.5, 3.5]);
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
