//! Decodes image messages of ROS 2 and Foxglove.

use super::pixels::{self, RawPixels};
use super::{bayer, json};
use crate::files;
use crate::recording::messages::Channel;
use crate::recording::{decode_protobuf, ros};
use crate::stereo::Gray;
use foxglove::messages::{CompressedImage, RawImage};

/// Schemas of image messages.
pub(super) const SCHEMAS: [&str; 4] = [
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
    "foxglove.RawImage",
    "foxglove.CompressedImage",
];

/// The stamp in a message, if any, and its image, or why that cannot be read.
pub(super) type Stamped = (Option<u64>, Result<Gray, String>);

/// # Errors
/// Why the message cannot be read.
pub(super) fn decode(channel: &Channel, data: &[u8]) -> Result<Stamped, String> {
    match (channel.schema.as_str(), channel.encoding.as_str()) {
        ("sensor_msgs/msg/Image", "cdr") => {
            let ros::RosImage {
                stamp,
                height,
                width,
                encoding,
                big_endian,
                step,
                data,
            } = ros::read(data, ros::image)?;
            let image = pixels::grey(&RawPixels {
                width,
                height,
                step,
                encoding,
                big_endian,
                data,
            });
            Ok((ros_stamp(stamp)?, image))
        }
        ("sensor_msgs/msg/CompressedImage", "cdr") => {
            let message = ros::read(data, ros::compressed_image)?;
            Ok((
                ros_stamp(message.stamp)?,
                decompress(message.data, message.format),
            ))
        }
        ("foxglove.RawImage", "protobuf") => {
            let RawImage {
                timestamp,
                width,
                height,
                encoding,
                step,
                data,
                ..
            } = decode_protobuf(data)?;
            let raw = RawPixels {
                width,
                height,
                step,
                encoding: &encoding,
                big_endian: false,
                data: &data,
            };
            Ok((
                stamp(timestamp.map(|t| (t.sec(), t.nsec()))),
                pixels::grey(&raw),
            ))
        }
        ("foxglove.CompressedImage", "protobuf") => {
            let CompressedImage {
                timestamp,
                data,
                format,
                ..
            } = decode_protobuf(data)?;
            Ok((
                stamp(timestamp.map(|t| (t.sec(), t.nsec()))),
                decompress(&data, &format),
            ))
        }
        ("foxglove.RawImage", "json") => {
            let json::JsonRawImage {
                timestamp,
                width,
                height,
                encoding,
                step,
                data,
            } = json::read(data)?;
            let raw = RawPixels {
                width,
                height,
                step,
                encoding: &encoding,
                big_endian: false,
                data: &data,
            };
            Ok((
                stamp(Some((timestamp.sec, timestamp.nsec))),
                pixels::grey(&raw),
            ))
        }
        ("foxglove.CompressedImage", "json") => {
            let json::JsonCompressedImage {
                timestamp,
                data,
                format,
            } = json::read(data)?;
            Ok((
                stamp(Some((timestamp.sec, timestamp.nsec))),
                decompress(&data, &format),
            ))
        }
        (schema, encoding) => Err(format!(
            "its {schema} is in '{encoding}', svl reads cdr, protobuf and json"
        )),
    }
}

/// Decodes a PNG or JPEG. The encoding before compression comes first in `format`, as
/// image_transport writes it: `bayer_rggb8; png compressed `.
fn decompress(data: &[u8], format: &str) -> Result<Gray, String> {
    let image = files::decode_bytes(data).map_err(|e| {
        format!("its image, compressed as '{format}', cannot be read as PNG or JPEG: {e}")
    })?;
    let mosaic = format
        .split(';')
        .next()
        .and_then(|encoding| bayer::tile(encoding.trim()));
    match mosaic {
        // One channel is the mosaic of the sensor; more channels were demosaiced before
        // compression.
        // `bayer_*; png compressed`: the PNG holds the mosaic, not its colours.
        Some((tile, _)) if image.color().channel_count() == 1 => {
            files::gray(image).and_then(|samples| bayer::grey(&samples, tile))
        }
        _ => files::gray(image),
    }
    .map_err(|e| e.to_string())
}

fn ros_stamp(ros::RosTime { sec, nanosec }: ros::RosTime) -> Result<Option<u64>, String> {
    let sec = u32::try_from(sec).map_err(|_| format!("its stamp of {sec} s is before 1970"))?;
    Ok(stamp(Some((sec, nanosec))))
}

/// Nanoseconds; a stamp of 0 was never set.
fn stamp(parts: Option<(u32, u32)>) -> Option<u64> {
    let (seconds, nanoseconds) = parts?;
    Some(u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds)).filter(|&ns| ns > 0)
}
