//! Point clouds of disparities, and PLY, which MeshLab, CloudCompare, Open3D and PCL open.

use std::path::Path;
use svl_core::stereo::{Gray, Plane, Rig};
use svl_core::{Error, Result};

/// x, y, z in metres, in the left camera's optical frame, and the grey value of each pixel of the
/// left image that has a distance.
pub fn pixel_points(disparity: &Plane<f32>, left: &Gray, rig: &Rig) -> Vec<[f32; 4]> {
    let rows = disparity.rows().zip(left.rows()).enumerate();
    let pixels = rows.flat_map(|(y, (row, greys))| {
        let pixels = row.iter().zip(greys).enumerate();
        pixels.map(move |(x, (d, grey))| ((x as f64, y as f64), *d, *grey))
    });
    let point = |(pixel, d, grey): ((f64, f64), f32, u8)| {
        let depth = rig.depth_m(d.is_finite().then_some(d.into())?)?;
        let [x, y, z] = rig.point_m(pixel, depth).map(|value| value as f32);
        Some([x, y, z, grey.into()])
    };
    pixels.filter_map(point).collect()
}

/// Writes the [`pixel_points`] as a binary little-endian PLY, with the grey value as colour.
///
/// # Errors
/// [`Error::Io`].
pub fn write_ply(path: &Path, disparity: &Plane<f32>, left: &Gray, rig: &Rig) -> Result<()> {
    let points = pixel_points(disparity, left, rig);
    let header = format!(
        "ply\nformat binary_little_endian 1.0\n\
         comment metres: x to the right, y down, z forward from the left camera\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        points.len()
    );
    let mut bytes = header.into_bytes();
    for [x, y, z, grey] in points {
        let place = [x, y, z].into_iter().flat_map(f32::to_le_bytes);
        bytes.extend(place.chain([grey as u8; 3]));
    }
    std::fs::write(path, bytes).map_err(|e| Error::io(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pixels_with_a_distance_are_points() {
        // At infinity, invalid, and twice the baseline away.
        let map = Plane::from_vec(3, 1, vec![-2.0, f32::INFINITY, 48.0]).unwrap();
        let left = Gray::from_vec(3, 1, vec![1, 2, 3]).unwrap();
        let rig = Rig::new(100.0, (1.0, 0.5), 0.5, 2.0).unwrap();
        assert_eq!(pixel_points(&map, &left, &rig), [[0.01, -0.005, 1.0, 3.0]]);
    }
}
