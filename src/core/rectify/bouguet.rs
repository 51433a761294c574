//! Rectification of calibrated cameras by Bouguet's method, as in his Camera Calibration Toolbox
//! and in OpenCV's `stereoRectify` (Bradski & Kaehler, Learning OpenCV, chapter 12).

use super::framing::Framing;
use super::rotated_camera::RotatedCamera;
use crate::error::{Error, Result};
use crate::stereo::{Rectification, Rig, StereoCalibration, check_upright};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

/// Computes the rectification of `calibration`: each camera is rotated by half of the rotation
/// between them, then both equally, so that their rows are parallel to the baseline. Points at
/// infinity have disparity 0.
///
/// The rotations are OpenCV's. Focal length and centre are not: OpenCV centres the images on their
/// undistorted corners and zooms until the tightest side is valid; here the centre is the middle of
/// the valid rectangle, so that more of the images is kept at `alpha` 0.
///
/// # Errors
/// [`Error::Rig`] for images of different sizes, and for cameras that are not side by side or have
/// no common field of view; [`Error::Invalid`] and [`Error::Dimensions`] for an invalid framing.
pub fn bouguet(calibration: &StereoCalibration, framing: &Framing) -> Result<Rectification> {
    let (left, right) = (calibration.left(), calibration.right());
    if left.size() != right.size() {
        let ((a, b), (c, d)) = (left.size(), right.size());
        let why = format!("the left camera's images are {a}x{b}, the right one's {c}x{d}");
        return Err(Error::Rig(format!(
            "{why}; set both cameras to one size and calibrate them again"
        )));
    }
    let motion = calibration.right_from_left();
    check_upright(motion)?;
    let half = motion.rotation.powf(-0.5);
    let baseline = half * motion.translation.vector;
    if baseline.x.abs() <= baseline.y.abs().max(baseline.z.abs()) {
        let [x, y, z] = [baseline.x, baseline.y, baseline.z].map(|v| -v);
        let cure = "rotate the images of cameras mounted one above the other by 90 degrees and \
                    calibrate these";
        return Err(Error::Rig(format!(
            "the right camera is at ({x:.3}, {y:.3}, {z:.3}), not beside the left: {cure}"
        )));
    }
    // The vectors are neither opposite nor 0, so the shortest rotation is unique.
    let along = UnitQuaternion::rotation_between(&baseline, &(Vector3::x() * baseline.x.signum()))
        .unwrap_or_default();
    let [left_rotation, right_rotation] =
        [along * half.inverse(), along * half].map(|q| q.to_rotation_matrix());
    let pinhole = framing.pinhole(&views(calibration, left_rotation, right_rotation))?;
    let (baseline, unit) = (calibration.baseline(), calibration.unit());
    let rig = Rig::in_unit(pinhole.focal_px, pinhole.center_px, baseline, 0.0, unit)?;
    Ok(Rectification {
        size: pinhole.size,
        left: left_rotation,
        right: right_rotation,
        rig,
    })
}

/// Both cameras with their rectifying rotations.
pub(super) fn views(
    calibration: &StereoCalibration,
    left: Rotation3<f64>,
    right: Rotation3<f64>,
) -> [RotatedCamera; 2] {
    [
        RotatedCamera::new(*calibration.left(), left),
        RotatedCamera::new(*calibration.right(), right),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Intrinsics, LengthUnit};
    use nalgebra::{Isometry3, Point3, Translation3};
    use proptest::prelude::*;

    fn camera(focal: (f64, f64), center: (f64, f64), distortion: [f64; 5]) -> Intrinsics {
        Intrinsics::new((640, 480), focal, center, distortion).unwrap()
    }

    proptest! {
        #[test]
        fn rows_agree(
            turn in prop::array::uniform3(-0.2f64..0.2),
            place in (0.02f64..1.0, -0.5f64..0.5, -0.5f64..0.5),
            points in prop::collection::vec((-1.0f64..1.0, -0.7f64..0.7, 1.0f64..50.0), 20),
            alpha in 0.0f64..=1.0,
        ) {
            let right_place = Vector3::new(place.0, place.1 * place.0, place.2 * place.0);
            let rotation = UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2]);
            let translation = Translation3::from(-(rotation * right_place));
            let motion = Isometry3::from_parts(translation, rotation);
            let distortion = [-0.28, 0.07, 2e-4, -1e-4, 0.0];
            let left = camera((500.0, 505.0), (310.0, 250.0), distortion);
            let right = camera((510.0, 512.0), (330.0, 230.0), distortion);
            let unit = LengthUnit::Metres;
            let calibration = StereoCalibration::new(left, right, motion, unit).unwrap();
            let Ok(rectification) = bouguet(&calibration, &Framing { alpha, size: None }) else {
                // The cameras diverge so far that no rectangle is visible in both.
                return Ok(());
            };
            let Rectification { left, right, rig, .. } = &rectification;
            for (x, y, z) in points {
                let point = Point3::new(x * z, y * z, z);
                let (l, r) = (left * point, right * (motion * point));
                let ((lx, ly), (rx, ry)) = ((l.x / l.z, l.y / l.z), (r.x / r.z, r.y / r.z));
                // Focal lengths grow without limit as the rectangle shrinks.
                prop_assert!((ly - ry).abs() < 1e-11, "{ly} {ry}");
                let focal = rig.focal_px();
                prop_assert!((focal * (lx - rx) - rig.disparity_px(l.z)).abs() < 1e-9 * focal);
            }
        }
    }

    fn beside(left: Intrinsics, right: Intrinsics, apart: Isometry3<f64>) -> StereoCalibration {
        StereoCalibration::new(left, right, apart, LengthUnit::Metres).unwrap()
    }

    #[test]
    fn errors_say_what_to_do() {
        let one = camera((500.0, 500.0), (319.5, 239.5), [0.0; 5]);
        let at = |x: f64, y: f64, z: f64, right: Intrinsics| {
            let calibration = beside(one, right, Isometry3::translation(-x, -y, -z));
            bouguet(&calibration, &Framing::default())
        };
        assert!(at(0.1, 0.0, 0.0, one).is_ok());
        assert!(
            at(0.01, 0.1, 0.0, one)
                .unwrap_err()
                .to_string()
                .contains("by 90 degrees")
        );
        let small = Intrinsics::new((320, 240), (250.0, 250.0), (160.0, 120.0), [0.0; 5]).unwrap();
        let error = at(0.1, 0.0, 0.0, small).unwrap_err().to_string();
        assert!(
            error.contains("640x480") && error.contains("320x240"),
            "{error}"
        );

        let turned = UnitQuaternion::from_euler_angles(0.1, 0.0, 3.1);
        for at in [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]] {
            let motion = Isometry3::from_parts(Translation3::from(at), turned);
            let unit = LengthUnit::Metres;
            let rectified = StereoCalibration::new(one, one, motion, unit)
                .and_then(|calibration| bouguet(&calibration, &Framing::default()));
            let error = rectified.unwrap_err().to_string();
            assert!(error.contains("upside down"), "{error}");
        }

        let narrow = camera((2000.0, 2000.0), (319.5, 239.5), [0.0; 5]);
        let away = UnitQuaternion::from_euler_angles(0.0, 0.5, 0.0);
        let shift = Translation3::from(away * Vector3::new(-0.1, 0.0, 0.0));
        let calibration = beside(narrow, narrow, Isometry3::from_parts(shift, away));
        let error = bouguet(&calibration, &Framing::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains("seen by both"), "{error}");
    }

    #[test]
    fn impossible_framings_are_refused() {
        let framing = |alpha, size| Framing { alpha, size };
        let apart = Isometry3::translation(-0.1, 0.0, 0.0);
        let vast =
            Intrinsics::new((1 << 40, 480), (500.0, 500.0), (320.0, 240.0), [0.0; 5]).unwrap();
        let vast = beside(vast, vast, apart);
        assert!(bouguet(&vast, &framing(0.0, Some((640, 480)))).is_err());
        let one = camera((500.0, 500.0), (319.5, 239.5), [0.0; 5]);
        let calibration = beside(one, one, apart);
        for framing in [
            framing(1.1, None),
            framing(f64::NAN, None),
            framing(0.0, Some((0, 9))),
        ] {
            assert!(bouguet(&calibration, &framing).is_err());
        }
    }
}
