//! Recordings of the RealSense SDK (`.db3`, since 2.58): calibrations, extrinsics and options are
//! strings of `key=value;…` beside the images of a stream.
//!
//! | topic | string |
//! |---|---|
//! | `/device_0/sensor_0/Infrared_1/camera_info` | `width=…;height=…;fx=…;ppx=…;…;coeffs=…` |
//! | `/device_0/sensor_0/Infrared_1/tf/ref_0` | `rotation=` by columns, `translation=`, metres |
//! | `/device_0/sensor_0/option/Depth_Units/value` | metres per step of the depth images |
//!
//! The extrinsics map points of the frame `ref_0` into the stream's. Messages name the frame of a
//! stream after it: `Infrared1`, `Depth`.

use crate::message::{MessageError, MessageResult, ros};
use crate::stream::channel::Channel;
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion};
use svl_core::stereo::rotation;

/// True if the messages of a channel are calibrations of a stream.
pub(crate) fn is_calibration(channel: &Channel) -> bool {
    is_string(channel) && channel.topic.ends_with("/camera_info")
}

/// True if the messages of a channel are extrinsics of a stream.
pub(crate) fn is_transform(channel: &Channel) -> bool {
    is_string(channel) && stream_and_reference(&channel.topic).is_some()
}

/// True if the topic `unit` has the unit of the depth images of `topic`.
pub(crate) fn is_unit_topic(unit: &str, topic: &str) -> bool {
    let image = topic.strip_suffix("/compressedDepth").unwrap_or(topic);
    let stream = image.strip_suffix("/image/data");
    let sensor = stream.and_then(|stream| stream.rsplit_once('/'));
    let option = sensor.and_then(|(sensor, _)| unit.strip_prefix(sensor));
    // With a space in the ROS 1 bags of the SDK before 2.58.
    option.is_some_and(|option| {
        ["/option/Depth_Units/value", "/option/Depth Units/value"].contains(&option)
    })
}

fn is_string(channel: &Channel) -> bool {
    channel.schema == "std_msgs/msg/String" && channel.topic.starts_with("/device_")
}

/// The stream and the reference frame of `/device_0/sensor_0/STREAM/tf/ref_0`.
fn stream_and_reference(topic: &str) -> Option<(&str, &str)> {
    let (stream, reference) = topic.split_once("/tf/")?;
    let stream = stream.rsplit('/').next()?;
    reference.starts_with("ref_").then_some((stream, reference))
}

/// The camera of a stream.
pub(crate) struct StreamCamera {
    pub(crate) size: (u32, u32),
    pub(crate) model: String,
    pub(crate) focal_px: (f64, f64),
    pub(crate) center_px: (f64, f64),
    pub(crate) distortion: [f64; 5],
}

/// The calibration of a stream. Its images are rectified by the camera, so P is K; the baseline is
/// in the extrinsics.
pub(crate) fn calibration(text: &str) -> MessageResult<StreamCamera> {
    let number = |key: &str| numbers::<1>(text, key).map(|[number]| number);
    let side = |key: &str| {
        let side = number(key)?;
        if (0.0..1e5).contains(&side) {
            Ok(side as u32)
        } else {
            Err(MessageError::Key(format!("its {key} is {side}")))
        }
    };
    let [fx, fy, cx, cy] = [number("fx")?, number("fy")?, number("ppx")?, number("ppy")?];
    let d = numbers::<5>(text, "coeffs")?;
    // A model without coefficients is that of no distortion.
    let model = match value(text, "model")? {
        "Brown Conrady" => "plumb_bob",
        _ if d == [0.0; 5] => "plumb_bob",
        other => other,
    };
    Ok(StreamCamera {
        size: (side("width")?, side("height")?),
        model: model.to_owned(),
        focal_px: (fx, fy),
        center_px: (cx, cy),
        distortion: d,
    })
}

/// The pose of a stream's frame in its reference frame.
pub(crate) fn transform(
    topic: &str,
    text: &str,
) -> MessageResult<(String, (String, Isometry3<f64>))> {
    let (stream, reference) =
        stream_and_reference(topic).ok_or(MessageError::Unsuited("its topic names no stream"))?;
    let turn = Matrix3::from_column_slice(&numbers::<9>(text, "rotation")?);
    let turn = rotation(&turn)?;
    let [x, y, z] = numbers::<3>(text, "translation")?;
    let into_stream = Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_rotation_matrix(&turn),
    );
    let (name, index) = stream.rsplit_once('_').unwrap_or((stream, ""));
    let index = if name == "Infrared" { index } else { "" };
    let frame = format!("{}{index}", name.replace('_', " "));
    Ok((frame, (reference.to_owned(), into_stream.inverse())))
}

/// The unit of depth images in a message, metres per step: a text, or in ROS 1 a number.
pub(crate) fn unit_m(channel: &Channel, data: &[u8]) -> Option<f32> {
    let unit = match channel.schema.as_str() {
        "std_msgs/msg/Float32" => data.last_chunk().map(|bytes| f32::from_le_bytes(*bytes)),
        _ => ros::read(channel, data, ros::string)
            .ok()?
            .trim()
            .parse()
            .ok(),
    };
    unit.filter(|unit| (1e-6..1.0).contains(unit))
}

/// The value of `key` in `key=value;…`.
fn value<'a>(text: &'a str, key: &str) -> MessageResult<&'a str> {
    let mut pairs = text.split(';').filter_map(|pair| pair.split_once('='));
    let found = pairs.find_map(|(name, value)| (name.trim() == key).then_some(value.trim()));
    found.ok_or_else(|| MessageError::Key(format!("it has no '{key}'")))
}

fn numbers<const N: usize>(text: &str, key: &str) -> MessageResult<[f64; N]> {
    let value = value(text, key)?;
    let wrong = || MessageError::Key(format!("its '{key}' has to be {N} finite numbers"));
    let numbers = value.split(',').map(|number| number.trim().parse::<f64>());
    let numbers: Vec<_> = numbers.collect::<Result<_, _>>().map_err(|_| wrong())?;
    let is_finite = numbers.iter().all(|number| number.is_finite());
    let numbers = numbers.try_into().ok().filter(|_| is_finite);
    numbers.ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INFO: &str = "width=848;height=480;fx=424.5;ppx=421.25;fy=424.5;ppy=239.5;\
                        model=Inverse Brown Conrady;coeffs=0,0,0,0,0";

    #[test]
    fn strings_are_calibrations() {
        let found = calibration(INFO).unwrap();
        assert_eq!(found.size, (848, 480));
        assert_eq!(found.focal_px, (424.5, 424.5));
        assert_eq!(found.center_px, (421.25, 239.5));
        // No distortion, whatever its model.
        assert_eq!(found.model, "plumb_bob");
        let other = INFO.replace("=0,0,", "=0.1,0,");
        assert_eq!(calibration(&other).unwrap().model, "Inverse Brown Conrady");
        for (from, to) in [
            ("width=848", "width=-1"),
            ("fx=424.5;", ""),
            ("ppx=421.25", "ppx=nan"),
            ("coeffs=0,0,0,0,0", "coeffs=0,0"),
            ("=424.5", "=4,5"),
        ] {
            assert!(calibration(&INFO.replace(from, to)).is_err(), "{to}");
        }
        assert!(calibration("").is_err());
    }

    #[test]
    fn extrinsics_are_poses() {
        // A quarter turn about z, column-major: x of the reference is y of the stream.
        let text = "rotation=0,1,0,-1,0,0,0,0,1;translation=0,-0.05,0";
        let topic = "/device_0/sensor_0/Infrared_2/tf/ref_0";
        let (frame, (parent, pose)) = transform(topic, text).unwrap();
        assert_eq!((frame.as_str(), parent.as_str()), ("Infrared2", "ref_0"));
        let origin = pose.translation.vector;
        assert!((origin - nalgebra::Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-12);
        let depth = transform(&topic.replace("Infrared_2", "Depth_0"), text).unwrap();
        assert_eq!(depth.0, "Depth");
        assert!(transform(topic, "rotation=0,1,0,-1,0,0,0,0,9;translation=0,0,0").is_err());
        assert!(transform("/tf_static", text).is_err());
        let depth = "/device_0/sensor_0/Depth_0/image/data";
        for unit in ["Depth_Units", "Depth Units"] {
            let unit = format!("/device_0/sensor_0/option/{unit}/value");
            assert!(is_unit_topic(&unit, depth));
            assert!(!is_unit_topic(&unit, "/camera/depth/image_rect_raw"));
        }
        let other = "/device_0/sensor_1/option/Depth_Units/value";
        assert!(!is_unit_topic(other, depth));
    }
}
