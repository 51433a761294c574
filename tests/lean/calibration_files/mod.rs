//! Calibration files of other programs.

mod bad_input;
mod known;
mod lenses;
mod round_trip;

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};
use svl_calibrate::files::{self, Hints, LoadedCalibration};
use svl_core::stereo::{
    Distortion, DistortionModel, Intrinsics, LengthUnit, Rectification, Rig, Side,
    StereoCalibration,
};

/// A pair of raw cameras with their rectification.
fn raw() -> StereoCalibration {
    let (left, right) = (
        [-0.283, 0.074, 0.0002, 1.8e-5, 0.001],
        [-0.284, 0.075, -0.0001, -3.6e-5, -0.002],
    );
    let left = Intrinsics::new((752, 480), (458.7, 457.3), (367.2, 248.4), left).unwrap();
    let right = Intrinsics::new((752, 480), (457.6, 456.1), (380.0, 255.2), right).unwrap();
    calibration(
        left,
        right,
        [0.01, -0.02, 0.003, -0.012, 0.008, 0.004],
        0.11,
        LengthUnit::Metres,
    )
}

/// [`raw`] as a format can hold it: Kalibr's has no k3.
fn sample(format: &str) -> StereoCalibration {
    let c = raw();
    if format != "kalibr" {
        return c;
    }
    let [left, right] = [c.left(), c.right()].map(|camera| {
        let first = &camera.distortion().coefficients()[..4];
        let lens = DistortionModel::PlumbBob.with_coefficients(first).unwrap();
        Intrinsics::new(camera.size(), camera.focal_px(), camera.center_px(), lens).unwrap()
    });
    let calibration = StereoCalibration::new(left, right, *c.right_from_left(), c.unit()).unwrap();
    match c.rectification() {
        Some(by) => calibration.with_rectification(by.clone()),
        None => calibration,
    }
}

/// Two cameras rotated by these Euler angles against their rectification.
fn calibration(
    left: Intrinsics,
    right: Intrinsics,
    [a, b, c, d, e, f]: [f64; 6],
    baseline: f64,
    unit: LengthUnit,
) -> StereoCalibration {
    let (turn_left, turn_right) = (
        Rotation3::from_euler_angles(a, b, c),
        Rotation3::from_euler_angles(d, e, f),
    );
    let back = turn_right.inverse();
    let translation = Translation3::from(back * Vector3::new(-baseline, 0.0, 0.0));
    let motion = Isometry3::from_parts(
        translation,
        UnitQuaternion::from_rotation_matrix(&(back * turn_left)),
    );
    let rig = Rig::new(430.0, (360.5, 240.25), baseline, 3.5).unwrap();
    let rectification = Rectification {
        size: left.size(),
        left: turn_left,
        right: turn_right,
        rig,
    };
    StereoCalibration::new(left, right, motion, unit)
        .unwrap()
        .with_rectification(rectification)
}

/// The same cameras without their rectification.
fn unrectified(c: &StereoCalibration) -> StereoCalibration {
    StereoCalibration::new(*c.left(), *c.right(), *c.right_from_left(), c.unit()).unwrap()
}

/// The calibration of the rectified cameras.
fn rectified(c: &StereoCalibration) -> StereoCalibration {
    let Rectification { size, rig, .. } = *c.rectification().unwrap();
    let camera = |side| {
        let k = rig.intrinsics(side);
        Intrinsics::new(
            size,
            (k[(0, 0)], k[(1, 1)]),
            (k[(0, 2)], k[(1, 2)]),
            [0.0; 5],
        )
        .unwrap()
    };
    let apart = Isometry3::translation(-rig.baseline_m(), 0.0, 0.0);
    let turn = Rotation3::identity();
    StereoCalibration::new(camera(Side::Left), camera(Side::Right), apart, c.unit())
        .unwrap()
        .with_rectification(Rectification {
            size,
            left: turn,
            right: turn,
            rig,
        })
}

/// Asserts that two calibrations agree up to rounding.
#[track_caller]
fn assert_same(a: &StereoCalibration, b: &StereoCalibration) {
    assert_eq!(a.unit(), b.unit());
    for (a, b) in [(a.left(), b.left()), (a.right(), b.right())] {
        assert!((a.matrix() - b.matrix()).amax() < 1e-9, "{a:?} {b:?}");
        assert_eq!((a.size(), a.distortion()), (b.size(), b.distortion()));
    }
    let (ma, mb) = (a.right_from_left(), b.right_from_left());
    assert!(ma.rotation.angle_to(&mb.rotation) < 1e-9, "{ma} {mb}");
    assert!(
        (ma.translation.vector - mb.translation.vector).norm() < 1e-9 * a.baseline(),
        "{ma} {mb}"
    );
    assert_eq!(a.rectification().is_some(), b.rectification().is_some());
    if let (Some(ra), Some(rb)) = (a.rectification(), b.rectification()) {
        assert_eq!(ra.size, rb.size);
        assert!(
            (ra.left.matrix() - rb.left.matrix()).amax() < 1e-9
                && (ra.right.matrix() - rb.right.matrix()).amax() < 1e-9
        );
        let numbers = |rig: &Rig| {
            [
                rig.focal_px(),
                rig.center_px().0,
                rig.center_px().1,
                rig.doffs_px(),
                1e3 * rig.baseline_m(),
            ]
        };
        let off = numbers(&ra.rig)
            .into_iter()
            .zip(numbers(&rb.rig))
            .map(|(x, y)| (x - y).abs());
        assert!(off.fold(0.0, f64::max) < 1e-8, "{:?} {:?}", ra.rig, rb.rig);
    }
}

/// Names of the formats that svl writes and of a file of each.
const FILES: [(&str, &str); 6] = [
    ("xml", "c.xml"),
    ("opencv", "c.yml"),
    ("ros", "left.yaml,right.yaml"),
    ("kalibr", "camchain.yaml"),
    ("middlebury", "calib.txt"),
    ("kitti", "kitti.txt"),
];

/// The same of KITTI's raw data, which is read only.
const KITTI_RAW: (&str, &str) = ("kitti-raw", "kitti-raw.txt");

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// `name`: one file, or two separated by a comma.
    fn path(&self, name: &str) -> PathBuf {
        let names: Vec<_> = name
            .split(',')
            .map(|name| self.0.path().join(name).display().to_string())
            .collect();
        names.join(",").into()
    }

    fn write(
        &self,
        format: &str,
        calibration: &StereoCalibration,
    ) -> svl_core::Result<Vec<&'static str>> {
        files::write_as(
            &self.path(file_of(format)),
            files::format(format).unwrap(),
            calibration,
            Path::to_owned,
        )
    }

    /// Writes the file of a format for the tests of its reader.
    fn write_sample(&self, format: &str) {
        if format == KITTI_RAW.0 {
            std::fs::write(self.path(KITTI_RAW.1), include_str!("kitti_raw.txt")).unwrap();
        } else {
            self.write(format, &sample(format)).unwrap();
        }
    }

    fn read(&self, format: &str, hints: &Hints) -> svl_core::Result<LoadedCalibration> {
        files::read_with(&self.path(file_of(format)), hints)
    }

    /// A calibration written and read back.
    fn through(&self, format: &str, calibration: &StereoCalibration) -> StereoCalibration {
        self.write(format, calibration).unwrap();
        let size = calibration.rectification().map(|r| r.size);
        let hints = Hints {
            size: size.filter(|_| format == "kitti"),
            ..Hints::default()
        };
        let found = self.read(format, &hints).unwrap();
        assert_eq!(found.format.name, format);
        found.calibration
    }
}

fn file_of(format: &str) -> &'static str {
    let mut files = FILES.into_iter().chain([KITTI_RAW]);
    files.find(|(name, _)| *name == format).unwrap().1
}
