//! KITTI's calibrations: the projections of the object and stereo benchmarks, and the raw data's
//! `calib_cam_to_cam.txt`.

use super::document::{Document, Syntax, text};
use super::format::{CalibrationFormat, Hints, LoadedCalibration, Writing, Written, one};
use super::geometry::{
    self, StereoParameters, beyond_rectified, camera, extrinsics, image_size, only_rectified,
    read_distortion, rectified,
};
use super::numbers::{rows, spaced};
use super::unit::FileUnit;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::path::Path;
use svl_core::Result;
use svl_core::doubt::CalibrationCheck;
use svl_core::stereo::{DistortionModel, LengthUnit, Rectification, Rig, Side, StereoCalibration};

pub(super) const FORMAT: CalibrationFormat = CalibrationFormat {
    name: "kitti",
    title: "KITTI's calib.txt",
    conventions: "rectified cameras only: projections P0 P1 (grey) and P2 P3 (colour), row by \
                  row, metres; the grey pair is read if present, and both are written \
                  identically; no image size",
    endings: &["txt"],
    pairs: &[],
    single: true,
    syntax: Syntax::Lines(':'),
    marks: &["P0:", "P2:"],
    read,
    write: Some(write),
};

pub(super) const RAW_FORMAT: CalibrationFormat = CalibrationFormat {
    name: "kitti-raw",
    title: "KITTI's calib_cam_to_cam.txt",
    conventions: "cameras 00 and 01 (grey): S K D before and S_rect R_rect P_rect after \
                  rectification, D = k1 k2 p1 p2 k3, x_01 = R_01 x_00 + T_01, metres",
    endings: &["txt"],
    pairs: &[],
    single: true,
    syntax: Syntax::Lines(':'),
    marks: &["K_00:"],
    read: read_raw,
    write: None,
};

/// Reads the rig of two cameras; `left` and `right` are the names of their 3 x 4 projection
/// matrices.
///
/// Both matrices are relative to camera 0, whose fourth column is 0: the baseline is
/// `(P_left(0,3) − P_right(0,3)) / f` metres (KITTI development kit, readme).
///
/// # Errors
/// [`svl_core::Error::Io`]; [`svl_core::Error::Format`] with the missing or malformed matrix.
pub fn read_projections(path: &Path, left: &str, right: &str) -> Result<Rig> {
    projections(
        &Document::parse(path, &text(path)?, FORMAT.syntax, FORMAT.title)?,
        left,
        right,
    )
}

/// The pose of KITTI's laser scanner in the rectified camera with that projection: by `R` and `T`
/// of `calib_velo_to_cam.txt`, or `Tr` of a sequence's `calib.txt`. `cameras` has the projection.
///
/// # Errors
/// [`svl_core::Error::Io`]; [`svl_core::Error::Format`] with the missing or malformed matrix.
pub fn read_scanner(scanner: &Path, cameras: &Path, projection: &str) -> Result<Isometry3<f64>> {
    let open = |path| Document::parse(path, &text(path)?, FORMAT.syntax, FORMAT.title);
    let (scanner, cameras) = (open(scanner)?, open(cameras)?);
    let into_camera = if scanner.has("R") {
        extrinsics(&scanner, "R", "T")?
    } else {
        let tr = scanner.projection("Tr")?;
        let turn = tr.fixed_columns::<3>(0).into_owned();
        let motion = svl_core::stereo::motion(&turn, tr.column(3).into_owned());
        scanner.keyed("Tr", motion)?
    };
    let rectified = if cameras.has("R_rect_00") {
        cameras.rotation("R_rect_00")?
    } else {
        nalgebra::Rotation3::identity()
    };
    let offset = offset(&cameras, projection)?;
    Ok(offset * UnitQuaternion::from_rotation_matrix(&rectified) * into_camera)
}

/// Moves points from KITTI's camera 0, whose poses its files have, to the rectified camera with
/// that projection.
///
/// # Errors
/// [`svl_core::Error::Io`]; [`svl_core::Error::Format`] with the missing or malformed projection.
pub fn read_offset(cameras: &Path, projection: &str) -> Result<Translation3<f64>> {
    let document = Document::parse(cameras, &text(cameras)?, FORMAT.syntax, FORMAT.title)?;
    offset(&document, projection)
}

fn offset(cameras: &Document, projection: &str) -> Result<Translation3<f64>> {
    let p = cameras.projection(projection)?;
    // P = K [I | t].
    let k = p.fixed_columns::<3>(0).try_inverse();
    let k = k.ok_or_else(|| cameras.error(format!("'{projection}' has no inverse")))?;
    Ok(Translation3::from(k * p.column(3)))
}

fn projections(document: &Document, left: &str, right: &str) -> Result<Rig> {
    let (p, q) = (document.projection(left)?, document.projection(right)?);
    let rig = geometry::rig(&p, &q, LengthUnit::Metres);
    document.keyed(&format!("{left}' and '{right}"), rig)
}

fn read(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let document = one(documents)?;
    let unit = FileUnit::METRE.fixed(&document, hints.unit)?;
    let (left, right) = if document.has("P0") {
        ("P0", "P1")
    } else {
        ("P2", "P3")
    };
    let rig = projections(&document, left, right)?;
    let size = image_size(&document, None, hints)?;
    let cameras = rectified(&document, size, rig)?;
    let others = ["P0", "P2"].map(|key| document.projection(key).ok());
    let offsets =
        CalibrationCheck::offsets(&document.projection(left)?, &document.projection(right)?);
    let mut remarks = Vec::new();
    if matches!(others, [Some(grey), Some(colour)] if grey != colour) {
        remarks.push("cameras 0 and 1 were used; 2 and 3 were dropped".to_owned());
    }
    Ok(LoadedCalibration {
        offsets: offsets.doubt(),
        ..cameras.loaded(&FORMAT, &document, unit, remarks)?
    })
}

fn write(calibration: &StereoCalibration) -> Writing {
    let rig = only_rectified(calibration)?.rig;
    // Readers expect four projections; svl has one pair, so the colour pair repeats the grey one.
    let line = |i: usize| {
        format!(
            "P{i}: {}\n",
            spaced(&rows(&rig.projection(Side::BOTH[i % 2])))
        )
    };
    Ok(Written {
        texts: vec![(0..4).map(line).collect()],
        left_out: beyond_rectified(calibration),
    })
}

fn read_raw(documents: Vec<Document>, hints: &Hints) -> Result<LoadedCalibration> {
    let document = one(documents)?;
    let unit = FileUnit::METRE.fixed(&document, hints.unit)?;
    let one = |key: &str, s: &str, d: &str| {
        camera(
            &document,
            key,
            document.size_of(s)?,
            read_distortion(&document, d, DistortionModel::PlumbBob)?,
        )
    };
    let rectification = Rectification {
        size: document.size_of("S_rect_00")?,
        left: document.rotation("R_rect_00")?,
        right: document.rotation("R_rect_01")?,
        rig: projections(&document, "P_rect_00", "P_rect_01")?,
    };
    let cameras = StereoParameters {
        left: one("K_00", "S_00", "D_00")?,
        right: one("K_01", "S_01", "D_01")?,
        right_from_left: Some(extrinsics(&document, "R_01", "T_01")?),
        rectification: Some(rectification),
    };
    let remarks = if document.has("K_02") {
        vec!["cameras 02 and 03 were dropped".to_owned()]
    } else {
        Vec::new()
    };
    cameras.loaded(&RAW_FORMAT, &document, unit, remarks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projections_are_relative_to_camera_0() {
        let text = "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP2: 7e2 0 600 35 0 7e2 180 0 0 0 1 \
                    0\nP3: 700 0 602 -350 0 700 180 0 0 0 1 0\n";
        let rig = |text: &str, left, right| {
            let document =
                Document::parse(Path::new("calib.txt"), text, FORMAT.syntax, FORMAT.title).unwrap();
            projections(&document, left, right).map_err(|e| e.to_string())
        };
        let found = rig(text, "P2", "P3").unwrap();
        assert_eq!(
            (found.focal_px(), found.center_px(), found.doffs_px()),
            (700.0, (600.0, 180.0), 2.0)
        );
        assert!((found.baseline_m() - 0.55).abs() < 1e-12);
        assert!(rig(text, "P0", "P1").unwrap_err().contains("no 'P1'"));
        assert!(
            rig("P0: 1 2\nP1: 3", "P0", "P1")
                .unwrap_err()
                .contains("'P0' has 2 numbers, expected 12")
        );
        assert!(rig("P0: x", "P0", "P1").unwrap_err().contains("'x'"));
        // Left and right swapped: a negative baseline.
        assert!(rig(text, "P3", "P2").is_err());
    }
}
