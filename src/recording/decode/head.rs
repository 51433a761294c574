//! The stamp and the frame of a message of any kind.

use super::{image, json};
use crate::message::wire::decode_protobuf;
use crate::message::{MessageError, MessageResult, ros};
use crate::stream::channel::Channel;
use foxglove::messages;

/// The stamp of a message, if any, and the name of its frame.
pub(crate) fn head(channel: &Channel, data: &[u8]) -> MessageResult<(Option<u64>, String)> {
    macro_rules! foxglove {
        ($kind:ident) => {{
            let message: messages::$kind = decode_protobuf(data)?;
            let stamp = image::stamp(channel, message.timestamp.map(|t| (t.sec(), t.nsec())));
            Ok((stamp, message.frame_id))
        }};
    }
    match (channel.schema.as_str(), channel.encoding.as_str()) {
        (_, "cdr" | "ros1") => {
            let head = ros::read(channel, data, ros::header)?;
            Ok((
                image::ros_stamp(channel, head.stamp)?,
                head.frame_id.to_owned(),
            ))
        }
        (_, "json") => {
            let head: json::JsonHead = json::read(data)?;
            let stamp = Some((head.timestamp.sec, head.timestamp.nsec));
            Ok((image::stamp(channel, stamp), head.frame_id))
        }
        ("foxglove.RawImage", _) => foxglove!(RawImage),
        ("foxglove.CameraCalibration", _) => foxglove!(CameraCalibration),
        ("foxglove.CompressedImage", _) => foxglove!(CompressedImage),
        ("foxglove.CompressedVideo", _) => foxglove!(CompressedVideo),
        ("foxglove.PointCloud", _) => foxglove!(PointCloud),
        ("foxglove.LaserScan", _) => foxglove!(LaserScan),
        _ => Err(MessageError::encoding(channel, "")),
    }
}
