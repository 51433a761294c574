//! The rig as two foxglove.CameraCalibration, and rig and pose as foxglove.FrameTransform.

use super::message_error::{MessageError, MessageResult};
use super::wire::{Encoded, RosStamp, decode_protobuf, frame_id};
use crate::stream::channel::Channel;
use crate::stream::stamp_rule::StampRule;
use foxglove::messages::{CameraCalibration, FrameTransform, Quaternion, Vector3};
use nalgebra::{Matrix3x4, Translation3, UnitQuaternion};
use svl_core::stereo::{LengthUnit, Pose, Rig, Side};

const CALIBRATION: &str = "foxglove.CameraCalibration";
const TRANSFORM: &str = "foxglove.FrameTransform";
/// Parent frame of poses.
pub(crate) const WORLD: &str = "world";

pub(crate) fn encode_calibration(
    rig: &Rig,
    (width, height): (usize, usize),
    camera: Side,
    stamp: RosStamp,
) -> Encoded {
    let message = CameraCalibration {
        timestamp: stamp.foxglove(),
        frame_id: frame_id(camera).to_owned(),
        width: width as u32,
        height: height as u32,
        distortion_model: "plumb_bob".to_owned(),
        // Foxglove requires all five coefficients of plumb_bob.
        d: vec![0.0; 5],
        // Row-major in the message, column-major in nalgebra.
        k: rig.intrinsics(camera).transpose().as_slice().to_vec(),
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: rig.projection(camera).transpose().as_slice().to_vec(),
    };
    Encoded::protobuf(CALIBRATION, &message)
}

/// The rig with exactly these projection matrices, so that rigs survive the round trip.
pub(crate) fn rig(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> svl_core::Result<Rig> {
    let rig = Rig::from_projections(left, right, 0.0, 0.0, LengthUnit::Metres)?;
    let (focal, center) = (rig.focal_px(), rig.center_px());
    let (shift, cx) = (right[(0, 3)], right[(0, 2)]);
    let baseline_m = plainest(rig.baseline_m(), |b| -focal * b == shift);
    let doffs_px = plainest(rig.doffs_px(), |doffs| center.0 + doffs == cx);
    Rig::new(focal, center, baseline_m, doffs_px)
}

/// The decimal number with the fewest digits near `value` for which `fits` is true: several doubles
/// give the same product, and the one in the calibration file is the shortest.
fn plainest(value: f64, fits: impl Fn(f64) -> bool) -> f64 {
    (0..17)
        .filter_map(|digits| format!("{value:.digits$e}").parse().ok())
        .find(|&v| fits(v))
        .unwrap_or(value)
}

/// The pose of the second frame in the first.
pub(crate) fn encode_transform(
    pose: &Pose,
    [parent, child]: [&str; 2],
    stamp: RosStamp,
) -> Encoded {
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

/// The stamp of a pose, if it has one, and the pose.
pub(crate) fn decode_pose(channel: &Channel, data: &[u8]) -> MessageResult<(Option<u64>, Pose)> {
    if channel.schema != TRANSFORM {
        return Err(MessageError::schema(channel, TRANSFORM));
    }
    let FrameTransform {
        timestamp,
        translation: Some(t),
        rotation: Some(q),
        ..
    } = decode_protobuf(data)?
    else {
        let why = "it has no translation or no rotation";
        return Err(MessageError::Missing(why));
    };
    let rotation = nalgebra::Quaternion::new(q.w, q.x, q.y, q.z);
    // A corrupt quaternion is rejected; a unit one is kept bit by bit.
    if (rotation.norm() - 1.0).abs() < 1e-6 && [t.x, t.y, t.z].iter().all(|v| v.is_finite()) {
        // Not normalized again, which would change its last bits.
        let pose = Pose::from_parts(
            Translation3::new(t.x, t.y, t.z),
            UnitQuaternion::new_unchecked(rotation),
        );
        let parts = timestamp.map(|t| (t.sec(), t.nsec()));
        let stamp = parts.and_then(|parts| StampRule::default().stamp(parts));
        Ok((stamp, pose))
    } else {
        Err(MessageError::Transform(format!(
            "translation {t:?} and rotation {q:?} are not a pose"
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn back(rig: &Rig) -> Rig {
        let projection = |camera| {
            let message = encode_calibration(rig, (640, 480), camera, RosStamp::new(0).unwrap());
            let CameraCalibration { p, .. } = decode_protobuf(&message.data).unwrap();
            Matrix3x4::from_row_slice(&p)
        };
        super::rig(&projection(Side::Left), &projection(Side::Right)).unwrap()
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
            let [read, written] = [back(&rig), rig].map(|rig| rig.projection(Side::Right));
            assert_eq!(read, written);
        }
    }

    #[test]
    fn cameras_that_are_not_a_pair_are_refused() {
        let good = Rig::new(300.0, (160.0, 120.0), 0.1, 0.0).unwrap();
        let (left, mut right) = (good.projection(Side::Left), good.projection(Side::Right));
        assert_eq!(rig(&left, &right).unwrap(), good);
        right[(0, 0)] = 301.0;
        assert!(rig(&left, &right).is_err());
        assert!(rig(&left, &left).is_err(), "no baseline");
    }
}
