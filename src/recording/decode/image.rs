//! Decodes image messages of ROS 2 and Foxglove.

use super::encoding::PixelEncoding;
use super::pixels::MessageImage;
use super::{encoding, json, pixels};
use crate::message::ros::read::RawPixels;
use crate::message::wire::decode_protobuf;
use crate::message::{MessageError, MessageResult, ros};
use crate::stream::channel::{Channel, ROS1};
use foxglove::messages::{CompressedImage, RawImage, Timestamp};
use svl_files::{self as files, DecodedImage};

/// Schemas of image messages.
pub(crate) const SCHEMAS: [&str; 4] = [
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
    "foxglove.RawImage",
    "foxglove.CompressedImage",
];

/// The encodings that are read, in words.
pub(crate) const ENCODINGS: &str = ", svl reads cdr, ros1, protobuf and json";

/// The stamp in a message, if any, and its image, or the reason why that cannot be read.
pub(crate) type Stamped = (Option<u64>, MessageResult<MessageImage>);

/// # Errors
/// The reason why the message cannot be read.
pub(crate) fn decode(channel: &Channel, data: &[u8]) -> MessageResult<Stamped> {
    let raw = |(width, height, step), encoding: &str, data: &[u8]| {
        pixels::decode(&RawPixels {
            width,
            height,
            step,
            encoding,
            big_endian: false,
            data,
        })
    };
    let of_protobuf = |time: Option<Timestamp>| stamp(channel, time.map(|t| (t.sec(), t.nsec())));
    let of_json = |time: json::JsonTime| stamp(channel, Some((time.sec, time.nsec)));
    match (channel.schema.as_str(), channel.encoding.as_str()) {
        ("sensor_msgs/msg/Image", "cdr" | "ros1") => {
            let (stamp, image) = ros::read(channel, data, ros::image)?;
            Ok((ros_stamp(channel, stamp)?, pixels::decode(&image)))
        }
        ("sensor_msgs/msg/CompressedImage", "cdr" | "ros1") => {
            let m = ros::read(channel, data, ros::compressed_image)?;
            Ok((ros_stamp(channel, m.stamp)?, decompress(m.data, m.format)))
        }
        ("foxglove.RawImage", "protobuf") => {
            let m: RawImage = decode_protobuf(data)?;
            let image = raw((m.width, m.height, m.step), &m.encoding, &m.data);
            Ok((of_protobuf(m.timestamp), image))
        }
        ("foxglove.CompressedImage", "protobuf") => {
            let m: CompressedImage = decode_protobuf(data)?;
            let image = decompress(&m.data, &m.format);
            Ok((of_protobuf(m.timestamp), image))
        }
        ("foxglove.RawImage", "json") => {
            let m: json::JsonRawImage = json::read(data)?;
            let image = raw((m.width, m.height, m.step), &m.encoding, &m.data);
            Ok((of_json(m.timestamp), image))
        }
        ("foxglove.CompressedImage", "json") => {
            let m: json::JsonCompressedImage = json::read(data)?;
            let image = decompress(&m.data, &m.format);
            Ok((of_json(m.timestamp), image))
        }
        _ => Err(MessageError::encoding(channel, ENCODINGS)),
    }
}

/// Decodes a PNG or JPEG. The encoding before compression comes first in `format`, as
/// image_transport writes it: `bayer_rggb8; png compressed `.
fn decompress(data: &[u8], format: &str) -> MessageResult<MessageImage> {
    let image = files::decode_bytes(data)
        .map_err(|reason| MessageError::CodedImage(format.to_owned(), reason))?;
    // One channel is the mosaic of the sensor; more channels were demosaiced before compression.
    // `bayer_*; png compressed`: the PNG contains the mosaic, not its colours.
    let encoding = format.split(';').next().unwrap_or_default().trim();
    let mosaic = encoding::named(encoding).and_then(PixelEncoding::mosaic);
    let mosaic = mosaic.filter(|_| image.color().channel_count() == 1);
    Ok(MessageImage {
        image: DecodedImage::new(image)?,
        mosaic,
    })
}

pub(crate) fn ros_stamp(
    channel: &Channel,
    ros::RosTime { sec, nanosec }: ros::RosTime,
) -> MessageResult<Option<u64>> {
    let signed = sec.cast_signed();
    // ROS 1's seconds are unsigned.
    if signed < 0 && channel.encoding != ROS1 {
        return Err(MessageError::Stamps(format!(
            "its stamp of {signed} s is before 1970"
        )));
    }
    Ok(stamp(channel, Some((sec, nanosec))))
}

/// Nanoseconds by the rule of the topic; `None` if the stamp was never set.
pub(crate) fn stamp(channel: &Channel, parts: Option<(u32, u32)>) -> Option<u64> {
    channel.stamps.stamp(parts?)
}
