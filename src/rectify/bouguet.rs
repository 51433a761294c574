//! Rectification of calibrated cameras by Bouguet's method, as his Camera Calibration Toolbox has
//! it and OpenCV's `stereoRectify` after it (Bradski & Kaehler, Learning OpenCV, chapter 12).

use super::framing::{Framing, Pinhole};
use super::view::View;
use crate::error::{Error, Result};
use crate::stereo::{Rectification, Rig, StereoCalibration};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

/// How `calibration`'s cameras become a rectified pair: each is turned by half of the rotation
/// between them, both then alike so that their rows run along the baseline. Points at infinity have
/// disparity 0.
///
/// The rotations are OpenCV's. Focal length and centre are not: OpenCV puts the centre where the
/// corners of both images lie around it and zooms until the crop is met on its tightest side; here
/// it is the middle of what is met on all sides, so that at `alpha` 0 more of the pictures is kept.
///
/// # Errors
/// [`Error::Rig`] for images of two sizes, cameras that do not stand side by side, or that see
/// nothing in common; [`Error::Invalid`] and [`Error::Dimensions`] for a framing that is none.
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
    let half = motion.rotation.powf(-0.5);
    let apart = half * motion.translation.vector;
    if apart.x.abs() <= apart.y.abs().max(apart.z.abs()) {
        let [x, y, z] = [apart.x, apart.y, apart.z].map(|v| -v);
        let cure = "turn the images of cameras that stand one above the other by 90 degrees and \
                    calibrate these";
        return Err(Error::Rig(format!(
            "the right camera is at ({x:.3}, {y:.3}, {z:.3}), not beside the left: {cure}"
        )));
    }
    // They are neither opposite nor 0, so there is one rotation that is the least.
    let along = UnitQuaternion::rotation_between(&apart, &(Vector3::x() * apart.x.signum()))
        .unwrap_or_default();
    let [left_turn, right_turn] =
        [along * half.inverse(), along * half].map(|q| q.to_rotation_matrix());
    let Pinhole {
        size,
        focal_px,
        center_px,
    } = framing.pinhole(&views(calibration, left_turn, right_turn))?;
    let rig = Rig::new(focal_px, center_px, calibration.baseline(), 0.0)?;
    Ok(Rectification {
        size,
        left: left_turn,
        right: right_turn,
        rig,
    })
}

/// Both cameras turned.
pub(super) fn views(
    calibration: &StereoCalibration,
    left: Rotation3<f64>,
    right: Rotation3<f64>,
) -> [View; 2] {
    [
        View::new(*calibration.left(), left),
        View::new(*calibration.right(), right),
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
            let motion = Isometry3::from_parts(Translation3::from(-(rotation * right_place)), rotation);
            let lens = [-0.28, 0.07, 2e-4, -1e-4, 0.0];
            let [left, right] = [camera((500.0, 505.0), (310.0, 250.0), lens), camera((510.0, 512.0), (330.0, 230.0), lens)];
            let calibration = StereoCalibration::new(left, right, motion, LengthUnit::Metres).unwrap();
            let Ok(rectification) = bouguet(&calibration, &Framing { alpha, size: None }) else {
                // Cameras turned so far from each other that no rectangle is seen by both.
                return Ok(());
            };
            let Rectification { left, right, rig, .. } = &rectification;
            for (x, y, z) in points {
                let point = Point3::new(x * z, y * z, z);
                let (l, r) = (left * point, right * (motion * point));
                let ((lx, ly), (rx, ry)) = ((l.x / l.z, l.y / l.z), (r.x / r.z, r.y / r.z));
                prop_assert!(rig.focal_px() * (ly - ry).abs() < 1e-9, "{ly} {ry}");
                prop_assert!((rig.focal_px() * (lx - rx) - rig.disparity_px(l.z)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn what_cannot_be_rectified_is_told_with_the_cure() {
        let one = camera((500.0, 500.0), (319.5, 239.5), [0.0; 5]);
        let at = |x: f64, y: f64, z: f64, right: Intrinsics| {
            let apart = Isometry3::translation(-x, -y, -z);
            let calibration =
                StereoCalibration::new(one, right, apart, LengthUnit::Metres).unwrap();
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
        let vast =
            Intrinsics::new((1 << 40, 480), (500.0, 500.0), (320.0, 240.0), [0.0; 5]).unwrap();
        let apart = Isometry3::translation(-0.1, 0.0, 0.0);
        let vast = StereoCalibration::new(vast, vast, apart, LengthUnit::Metres).unwrap();
        assert!(
            bouguet(
                &vast,
                &Framing {
                    size: Some((640, 480)),
                    alpha: 0.0
                }
            )
            .is_err()
        );

        let narrow = camera((2000.0, 2000.0), (319.5, 239.5), [0.0; 5]);
        let away = UnitQuaternion::from_euler_angles(0.0, 0.5, 0.0);
        let motion = Isometry3::from_parts(
            Translation3::from(away * Vector3::new(-0.1, 0.0, 0.0)),
            away,
        );
        let calibration =
            StereoCalibration::new(narrow, narrow, motion, LengthUnit::Metres).unwrap();
        let error = bouguet(&calibration, &Framing::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains("seen by both"), "{error}");
        for framing in [
            Framing {
                alpha: 1.1,
                size: None,
            },
            Framing {
                alpha: f64::NAN,
                size: None,
            },
            Framing {
                size: Some((0, 9)),
                alpha: 0.0,
            },
        ] {
            let calibration = StereoCalibration::new(
                one,
                one,
                Isometry3::translation(-0.1, 0.0, 0.0),
                LengthUnit::Metres,
            );
            assert!(bouguet(&calibration.unwrap(), &framing).is_err());
        }
    }
}
