//! KITTI's poses: a line of twelve numbers for each image, the pose of camera 0 in its first frame.

use super::cameras::CALIB;
use super::layout::{Cameras, Layout};
use super::pairs::PairFiles;
use nalgebra::{Matrix3, Translation3, Vector3};
use std::path::Path;
use svl_calibrate::files::read_offset;
use svl_core::stereo::{Pose, motion};
use svl_core::{Error, Result, inputs};
use svl_files::read_text;

/// Limit of the file's size, bytes: a million lines.
const MAX_BYTES: u64 = 1 << 28;

/// The pose of each pair: by `poses.txt` in the folder, or `../../poses/NAME.txt`, as KITTI
/// distributes them, moved to the left camera by its projection in `calib.txt`. None of a pair
/// whose number has no line, and of other cameras than 0 without that file.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for a malformed line or projection.
pub(crate) fn poses(
    folder: &Path,
    layout: Option<&Layout>,
    pairs: &[PairFiles],
) -> Result<Vec<Option<Pose>>> {
    let none = || Ok(vec![None; pairs.len()]);
    let Some(Cameras::Projections([left, _])) = layout.map(|layout| &layout.cameras) else {
        return none();
    };
    let real = folder.canonicalize().map_err(|e| Error::io(folder, e))?;
    let sequence_poses = || {
        let name = format!("{}.txt", real.file_name()?.to_str()?);
        Some(real.parent()?.parent()?.join("poses").join(name))
    };
    let places = [Some(real.join("poses.txt")), sequence_poses()];
    let Some(path) = places
        .into_iter()
        .flatten()
        .find(|path| inputs::is_file(path))
    else {
        return none();
    };
    let calib = folder.join(CALIB);
    let to_left = if inputs::is_file(&calib) {
        read_offset(&calib, left)?
    } else if *left == "P0" {
        Translation3::identity()
    } else {
        tracing::warn!(
            "{}: not used: it has the poses of camera 0, and without {CALIB} the place of the \
             left camera is not known",
            path.display()
        );
        return none();
    };
    let text = read_text(&path, MAX_BYTES)?;
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let line = |(i, line)| {
        pose(line).map_err(|why| Error::format(&path, format!("line {}: {why}", i + 1)))
    };
    let poses = lines.enumerate().map(line).collect::<Result<Vec<_>>>()?;
    let pose = |pair: &PairFiles| {
        let number: usize = std::str::from_utf8(&pair.key).ok()?.parse().ok()?;
        Some(poses.get(number)? * to_left.inverse())
    };
    Ok(pairs.iter().map(pose).collect())
}

/// The pose in a line: row by row the rotation and the translation, x right, y down, z ahead; moved
/// into a world with x right, y ahead, z up.
fn pose(line: &str) -> std::result::Result<Pose, String> {
    let numbers = line.split_whitespace().map(str::parse);
    let numbers = numbers.collect::<std::result::Result<Vec<f64>, _>>();
    let Ok([a, b, c, x, d, e, f, y, g, h, i, z]) = numbers.as_deref() else {
        return Err("expected twelve numbers, a rotation and a translation".to_owned());
    };
    let turn = Matrix3::new(*a, *b, *c, *d, *e, *f, *g, *h, *i);
    let up = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    motion(&(up * turn), up * Vector3::new(*x, *y, *z)).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_in_a_world_with_z_up() {
        // 2 m ahead and 0.5 m up, turned to the right.
        let found = pose("0 0 1 0.0 0 1 0 -5e-1 -1 0 0 2").unwrap();
        let at = found.translation.vector - Vector3::new(0.0, 2.0, 0.5);
        let view = found.rotation * Vector3::z() - Vector3::x();
        assert!(at.norm() < 1e-12 && view.norm() < 1e-12, "{found}");
        for wrong in ["1 0 0 0", "a b c", "2 0 0 0 0 1 0 0 0 0 1 0", ""] {
            assert!(pose(wrong).is_err(), "{wrong}");
        }
    }
}
