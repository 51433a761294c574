//! The rig as two foxglove.CameraCalibration, and rig and pose as foxglove.FrameTransform.

use super::{Camera, Encoded, Stamp, decode_protobuf};
use crate::stereo::{Pose, Rig};
use foxglove::messages::{CameraCalibration, FrameTransform, Quaternion, Vector3};
use nalgebra::{Translation3, UnitQuaternion};

const CALIBRATION: &str = "foxglove.CameraCalibration";
const TRANSFORM: &str = "foxglove.FrameTransform";
/// The frame that poses are given in.
pub(super) const WORLD: &str = "world";

/// The numbers of one camera's rectified calibration that a [`Rig`] is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Projection {
    focal_px: f64,
    cx_px: f64,
    cy_px: f64,
    /// `P[0][3]`: -f·B of the right camera.
    shift: f64,
}

pub(super) fn encode_calibration(
    rig: &Rig,
    (width, height): (usize, usize),
    camera: Camera,
    stamp: Stamp,
) -> Encoded {
    let right = camera == Camera::Right;
    let message = CameraCalibration {
        timestamp: stamp.foxglove(),
        frame_id: camera.frame_id().to_owned(),
        width: width as u32,
        height: height as u32,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        // Row-major, where nalgebra stands column by column.
        k: rig.intrinsics(right).transpose().as_slice().to_vec(),
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: rig.projection(right).transpose().as_slice().to_vec(),
    };
    Encoded::protobuf(CALIBRATION, &message)
}

pub(super) fn decode_calibration(schema: &str, data: &[u8]) -> Result<Projection, String> {
    check_schema(schema, CALIBRATION)?;
    let CameraCalibration { p, .. } = decode_protobuf(data)?;
    let [focal_px, _, cx_px, shift, _, _, cy_px, ..] = p[..] else {
        return Err(format!(
            "its P has {} numbers, 12 make a projection matrix",
            p.len()
        ));
    };
    Ok(Projection {
        focal_px,
        cx_px,
        cy_px,
        shift,
    })
}

/// The rig whose projection matrices are these, bit by bit.
pub(super) fn rig(left: &Projection, right: &Projection) -> Result<Rig, String> {
    if (left.focal_px, left.cy_px) != (right.focal_px, right.cy_px) {
        return Err(format!(
            "the cameras are not rectified to each other: focal lengths {} and {} px, rows of the \
             centres {} and {} px",
            left.focal_px, right.focal_px, left.cy_px, right.cy_px
        ));
    }
    let (focal, center) = (left.focal_px, left.cx_px);
    let baseline_m = plainest(-right.shift / focal, |baseline_m| {
        -focal * baseline_m == right.shift
    });
    let doffs_px = plainest(right.cx_px - center, |doffs_px| {
        center + doffs_px == right.cx_px
    });
    Rig::new(focal, (center, left.cy_px), baseline_m, doffs_px).map_err(|e| e.to_string())
}

/// The decimal number with the fewest digits near `value` that `fits`: several doubles give the
/// same product, and the one that a person or a calibration file wrote down is the shortest.
fn plainest(value: f64, fits: impl Fn(f64) -> bool) -> f64 {
    (0..17)
        .filter_map(|digits| format!("{value:.digits$e}").parse().ok())
        .find(|&v| fits(v))
        .unwrap_or(value)
}

/// The pose of the second frame in the first.
pub(super) fn encode_transform(pose: &Pose, [parent, child]: [&str; 2], stamp: Stamp) -> Encoded {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    let message = FrameTransform {
        timestamp: stamp.foxglove(),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(Vector3 {
            x: t.x,
            y: t.y,
            z: t.z,
        }),
        rotation: Some(Quaternion {
            x: q.x,
            y: q.y,
            z: q.z,
            w: q.w,
        }),
    };
    Encoded::protobuf(TRANSFORM, &message)
}

pub(super) fn decode_pose(schema: &str, data: &[u8]) -> Result<Pose, String> {
    check_schema(schema, TRANSFORM)?;
    let FrameTransform {
        translation: Some(t),
        rotation: Some(q),
        ..
    } = decode_protobuf(data)?
    else {
        return Err("it lacks translation or rotation".to_owned());
    };
    let rotation = nalgebra::Quaternion::new(q.w, q.x, q.y, q.z);
    if (rotation.norm() - 1.0).abs() < 1e-6 && [t.x, t.y, t.z].iter().all(|v| v.is_finite()) {
        // Not normalised again: it is a unit already, and stays as it was written.
        Ok(Pose::from_parts(
            Translation3::new(t.x, t.y, t.z),
            UnitQuaternion::new_unchecked(rotation),
        ))
    } else {
        Err(format!(
            "translation {t:?} and rotation {q:?} are not a pose"
        ))
    }
}

fn check_schema(schema: &str, expected: &str) -> Result<(), String> {
    if schema == expected {
        Ok(())
    } else {
        Err(format!("it is a {schema}, svl reads {expected}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn back(rig: &Rig) -> Rig {
        let projection = |camera| {
            let message = encode_calibration(rig, (640, 480), camera, Stamp(0));
            decode_calibration(message.schema, &message.data).unwrap()
        };
        super::rig(&projection(Camera::Left), &projection(Camera::Right)).unwrap()
    }

    #[test]
    fn rigs_come_back_as_they_were_written() {
        for (focal, center, baseline, doffs) in [
            (328.0, (159.5, 119.5), 0.044, 0.0),
            (3979.911, (1244.772, 1019.507), 0.193001, 124.343),
            (721.5377, (609.5593, 172.854), 0.53271, -0.1),
        ] {
            let rig = Rig::new(focal, center, baseline, doffs).unwrap();
            assert_eq!(back(&rig), rig);
        }
    }

    #[test]
    fn any_rig_keeps_its_projection() {
        for i in 1..1000 {
            let x = f64::from(i).sqrt();
            let rig = Rig::new(300.0 * x, (100.0 * x, 50.0 * x), 0.1 / x, 7.0 / x).unwrap();
            assert_eq!(back(&rig).projection(true), rig.projection(true));
        }
    }

    #[test]
    fn cameras_that_are_not_a_pair_are_refused() {
        let left = Projection {
            focal_px: 300.0,
            cx_px: 160.0,
            cy_px: 120.0,
            shift: 0.0,
        };
        assert!(
            rig(
                &left,
                &Projection {
                    focal_px: 301.0,
                    shift: -30.0,
                    ..left
                }
            )
            .is_err()
        );
        assert!(rig(&left, &left).is_err(), "no baseline");
    }
}
