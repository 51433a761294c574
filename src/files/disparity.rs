//! Disparity maps as files: PFM, KITTI's 16-bit PNG, and data sets' scaled grey images.

use super::image::{decode, encode};
use super::{write_pfm, write_png};
use crate::error::{Error, Result};
use crate::stereo::{DisparityMap, Plane};
use image::{DynamicImage, ExtendedColorType};
use std::path::Path;

/// Reads a grey image, 8 or 16 bits, whose value is `scale` times the disparity and 0 means unknown where
/// `zero_unknown`; unknown becomes `+∞`. Palette images are read by their grey, not by their index.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`].
pub fn read_scaled_disparity(path: &Path, scale: f32, zero_unknown: bool) -> Result<Plane<f32>> {
    let image = decode(path)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let disparity = |v: f32| if v == 0.0 && zero_unknown { f32::INFINITY } else { v / scale };
    let values = match image {
        DynamicImage::ImageLuma16(grey) => grey.into_raw().into_iter().map(|v| disparity(f32::from(v))).collect(),
        other => other.into_luma8().into_raw().into_iter().map(|v| disparity(f32::from(v))).collect(),
    };
    Plane::from_vec(width, height, values)
}

/// Writes the disparities by the file's ending: `.pfm` with `+∞` for none, or `.png`, 16-bit in KITTI's form: 256·d,
/// 0 = none, a true 0 written as 1.
///
/// # Errors
/// [`Error::Invalid`] for another ending, or for disparities a KITTI PNG cannot hold (negative, 256 and more).
pub fn write_disparity(path: &Path, map: &DisparityMap) -> Result<()> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("pfm") => write_pfm(path, map.disparity()),
        Some("png") => {
            let (width, height) = map.size();
            let values = map.disparity().pixels().map(kitti).collect::<Option<Vec<u16>>>().ok_or_else(|| {
                Error::format(path, "a 16-bit PNG holds disparities in 0..256 only; write .pfm instead")
            })?;
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
            let png = encode(width, height, &bytes, ExtendedColorType::L16)?;
            std::fs::write(path, png).map_err(|e| Error::io(path, e))
        }
        _ => Err(Error::format(path, "disparities are written as .pfm or .png")),
    }
}

/// KITTI's 16-bit code of a disparity.
fn kitti(disparity: f32) -> Option<u16> {
    if !disparity.is_finite() {
        return Some(0);
    }
    let code = (disparity * 256.0).round();
    (0.0..=65535.0).contains(&code).then(|| (code as u16).max(1))
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
    fn png_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        let mut map = DisparityMap::new(3, 1).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        row.accept(1, 12.25, 0);
        row.accept(2, 80.0, 0);
        write_disparity(&path, &map).unwrap();
        let back = read_scaled_disparity(&path, 256.0, true).unwrap();
        assert_eq!(back.row(0), [f32::INFINITY, 12.25, 80.0]);
    }
}
