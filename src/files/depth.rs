//! Measurements of another sensor in files: depth images, and points of KITTI's laser scanner.

use super::map::{NumberForm, StoredMap};
use super::{MAX_BYTES, read_bounded};
use nalgebra::Point3;
use std::path::Path;
use svl_core::doubt::are_most;
use svl_core::stereo::Plane;
use svl_core::{Error, Result};

/// Bytes of a point: x, y, z in metres and the reflectance, as 32-bit floats.
const POINT: usize = 16;
/// The unit of integers, metres.
const MILLIMETRE: f32 = 0.001;

/// Depths in metres, `+∞` at infinity and NaN for none, from an image of 16 bits, or from NumPy's
/// `.npy` or `.npz`, or `.pfm`. `unit_m`: metres per step [default: 0.001 of integers, 1 of
/// floats].
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for other files.
pub fn read_depth(path: &Path, unit_m: Option<f32>) -> Result<Plane<f32>> {
    let stored = StoredMap::read(path)?;
    if stored.form == NumberForm::Image8 {
        let why = "is not an image of one channel of 16 bits, as depths are";
        return Err(Error::format(path, why));
    }
    let is_integer = stored.form != NumberForm::Floats;
    Ok(known_depths(&stored.values.map(|value| {
        // Integers are millimetres by default, as in messages.
        if is_integer {
            value / 1000.0 * unit_m.map_or(1.0, |unit_m| unit_m / MILLIMETRE)
        } else {
            value * unit_m.unwrap_or(1.0)
        }
    })))
}

/// Depths, with NaN for those that are 0 or less. If most are negative, as those of a wrong sign
/// are, they are kept, so that the truth is doubted.
pub fn known_depths(depths: &Plane<f32>) -> Plane<f32> {
    let are_negative = are_most(depths, |z| z < 0.0);
    let is_known = |z: f32| z > 0.0 || are_negative && z < 0.0;
    depths.map(|z| if is_known(z) { z } else { f32::NAN })
}

/// Depths of programs that write a number where there is none, metres: the largest of 16 bits and
/// of half floats, in millimetres or metres, and limits of sensors.
const NO_DEPTHS: [f32; 9] = [
    65.535, 65.534, 65.504, 32.767, 10.0, 20.0, 40.0, 100.0, 65504.0,
];
/// Fraction of the pixels from which on such a depth, if it is the largest, stands for none.
const MIN_NO_DEPTHS: f64 = 0.01;

/// The largest depth of an image in words, if it likely stands for no depth.
pub fn no_depth(depths: &Plane<f32>) -> Option<String> {
    let known = || depths.pixels().filter(|depth| depth.is_finite());
    let most = known().fold(0.0, f32::max);
    // A depth in metres went through a division.
    let is_near = |other: f32| (most - other).abs() <= 1e-6 * other;
    if !NO_DEPTHS.into_iter().any(is_near) {
        return None;
    }
    let count = known().filter(|depth| *depth == most).count();
    let (width, height) = depths.size();
    let part = count as f64 / (width * height) as f64;
    (part > MIN_NO_DEPTHS).then(|| {
        format!(
            "more than 1 % of the pixels of a depth image have the largest depth, {most} m, which \
             likely stands for none: write 0 where there is no depth (REP 118)"
        )
    })
}

/// The points of KITTI's velodyne `.bin`, metres in the scanner's frame; one at its origin is none.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for a file that does not consist of whole points.
pub fn read_points(path: &Path) -> Result<Vec<Point3<f64>>> {
    let bytes = read_bounded(path, MAX_BYTES)?;
    if bytes.is_empty() || bytes.len() % POINT != 0 {
        let length = bytes.len();
        let why = format!("has {length} bytes, not points of {POINT}: x, y, z, reflectance");
        return Err(Error::format(path, why));
    }
    let points = bytes.chunks_exact(POINT).map(|point| {
        let number = |at: usize| {
            let bytes = point[at..].first_chunk();
            bytes.map_or(f32::NAN, |b| f32::from_le_bytes(*b))
        };
        Point3::from([0, 4, 8].map(|at| f64::from(number(at))))
    });
    let is_measured = |point: &Point3<f64>| *point != Point3::origin();
    Ok(points.filter(is_measured).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cmp::Ordering;

    #[test]
    fn points_are_whole_and_depths_have_a_unit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        let numbers = [1.5f32, -2.0, 0.25, 9.0].map(f32::to_le_bytes).concat();
        std::fs::write(&path, &numbers).unwrap();
        assert_eq!(read_points(&path).unwrap(), [Point3::new(1.5, -2.0, 0.25)]);
        std::fs::write(&path, [vec![0; 16], numbers.clone()].concat()).unwrap();
        assert_eq!(read_points(&path).unwrap().len(), 1, "zeros are no point");
        for cut in [0, 15] {
            std::fs::write(&path, &numbers[..cut]).unwrap();
            assert!(read_points(&path).is_err(), "{cut}");
        }
        let array = |kind: &str, bytes: &[u8]| {
            let path = folder.path().join("a.npy");
            let header =
                format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (1, 2)}}\n");
            let length = (header.len() as u16).to_le_bytes();
            let file = [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), bytes].concat();
            std::fs::write(&path, file).unwrap();
            path
        };
        let depths = |path: &Path, unit_m| -> Vec<f32> {
            read_depth(path, unit_m).unwrap().pixels().collect()
        };
        let steps = array("<u2", &[0xE8, 3, 0xD0, 7]);
        assert_eq!(depths(&steps, None), [1.0, 2.0]);
        assert_eq!(depths(&steps, Some(0.002)), [2.0, 4.0]);
        for (depth, found) in [(-1.0, f32::NAN), (f32::INFINITY, f32::INFINITY)] {
            let metres = array("<f4", &[1.5f32, depth].map(f32::to_le_bytes).concat());
            assert_eq!(depths(&metres, None)[0], 1.5);
            assert_eq!(depths(&metres, None)[1].total_cmp(&found), Ordering::Equal);
        }
        // Depths of a wrong sign, and a code for none.
        for (depths_m, known) in [([-1.5f32, -2.0], true), ([-1.0, -1.0], false)] {
            let metres = array("<f4", &depths_m.map(f32::to_le_bytes).concat());
            assert!(depths(&metres, None).iter().all(|z| (*z < 0.0) == known));
        }
        let metres = array("<f4", &[1.5f32, -1.0].map(f32::to_le_bytes).concat());
        let scaled = array("<u2", &[0, 0, 0, 3]);
        let disparities = crate::read_disparity_steps(&scaled, 256.0, false).unwrap();
        assert_eq!(disparities.row(0), [f32::INFINITY, 3.0]);
        std::fs::write(&metres, b"\x93NUMPY").unwrap();
        assert!(read_depth(&metres, None).is_err());
    }
}
