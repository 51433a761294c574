//! Messages that hold a coded picture of a video each.

use crate::decode::{image, json};
use crate::message::wire::decode_protobuf;
use crate::message::{MessageError, ros};
use crate::stream::channel::Channel;
use foxglove::messages::CompressedVideo;
use std::borrow::Cow;
use std::sync::Arc;

/// Schemas of messages with a coded picture.
const SCHEMAS: [&str; 3] = [
    "foxglove.CompressedVideo",
    "foxglove_msgs/msg/CompressedVideo",
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket",
];

/// True if the messages of a channel are pictures of a video.
pub(crate) fn is_video(channel: &Channel) -> bool {
    SCHEMAS.contains(&channel.schema.as_str())
}

/// True if a message is a picture of a video: also a CompressedImage whose format is a codec, as
/// Isaac ROS's encoder writes it.
pub(crate) fn is_picture(channel: &Channel, data: &[u8]) -> bool {
    let is_coded = || {
        let image = ros::read(channel, data, ros::compressed_image);
        image.is_ok_and(|image| Codec::from_format(image.format).is_ok())
    };
    is_video(channel) || (channel.schema == COMPRESSED_IMAGE && is_coded())
}

const COMPRESSED_IMAGE: &str = "sensor_msgs/msg/CompressedImage";

/// Coding of a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Codec {
    H264,
    H265,
}

impl Codec {
    /// ffmpeg's name of its decoder.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::H264 => "h264",
            Self::H265 => "hevc",
        }
    }

    /// From the format of a message, which may be an encoder's name, and more after a semicolon:
    /// `hevc_nvenc`, `h264;yuv420p;mono8;mono8`.
    fn from_format(format: &str) -> CodedResult<Self> {
        let name = format.split(';').next().unwrap_or_default().to_lowercase();
        let is_one_of = |names: [&str; 2]| names.iter().any(|known| name.contains(known));
        if is_one_of(["264", "avc"]) {
            Ok(Self::H264)
        } else if is_one_of(["265", "hevc"]) {
            Ok(Self::H265)
        } else {
            Err(MessageError::Codec(name).into())
        }
    }
}

/// A coded picture as it is read; the pictures behind it may share the error.
pub(crate) type CodedResult<T> = Result<T, Arc<MessageError>>;

/// A coded picture.
pub(crate) struct Packet<'a> {
    pub(crate) stamp: Option<u64>,
    /// An error if it is of a codec that svl does not read.
    pub(crate) codec: CodedResult<Codec>,
    pub(crate) data: Cow<'a, [u8]>,
}

/// # Errors
/// The reason why the message cannot be read.
pub(crate) fn packet<'a>(channel: &Channel, data: &'a [u8]) -> CodedResult<Packet<'a>> {
    let of_ros = |picture: ros::RosCoded<'a>| {
        Ok(Packet {
            stamp: image::ros_stamp(channel, picture.stamp)?,
            codec: Codec::from_format(picture.format),
            data: picture.data.into(),
        })
    };
    match (channel.schema.as_str(), channel.encoding.as_str()) {
        ("foxglove.CompressedVideo", "protobuf") => {
            let m: CompressedVideo = decode_protobuf(data)?;
            Ok(Packet {
                stamp: image::stamp(channel, m.timestamp.map(|t| (t.sec(), t.nsec()))),
                codec: Codec::from_format(&m.format),
                data: m.data.to_vec().into(),
            })
        }
        ("foxglove.CompressedVideo", "json") => {
            let m: json::JsonCompressedImage = json::read(data)?;
            Ok(Packet {
                stamp: image::stamp(channel, Some((m.timestamp.sec, m.timestamp.nsec))),
                codec: Codec::from_format(&m.format),
                data: m.data.into(),
            })
        }
        ("foxglove_msgs/msg/CompressedVideo", "cdr") => {
            of_ros(ros::read(channel, data, ros::compressed_video)?)
        }
        ("ffmpeg_image_transport_msgs/msg/FFMPEGPacket", "cdr" | "ros1") => {
            of_ros(ros::read(channel, data, ros::ffmpeg_packet)?)
        }
        (COMPRESSED_IMAGE, "cdr" | "ros1") => {
            of_ros(ros::read(channel, data, ros::compressed_image)?)
        }
        _ => Err(MessageError::encoding(channel, "").into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use super::{Codec, Codec::H264, Codec::H265};

    #[test]
    fn a_compressed_image_is_a_picture_by_its_format() {
        let channel = Channel::cdr("/left/image_compressed", COMPRESSED_IMAGE);
        // An empty header and no data.
        let message = |format: &str| {
            let mut data = vec![0, 1, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
            data.extend((format.len() as u32 + 1).to_le_bytes());
            data.extend(format.as_bytes());
            data.push(0);
            data.resize(data.len().next_multiple_of(4), 0);
            data.extend([0; 4]);
            data
        };
        let is_it = |format: &str| is_picture(&channel, &message(format));
        assert!(is_it("h264") && is_it("h265"));
        assert!(!is_it("jpeg") && !is_it("mono8; png compressed ") && !is_it(""));
        assert!(!is_picture(&channel, &[0, 1, 0, 0]));
        let data = message("h264");
        let packet = packet(&channel, &data).unwrap();
        assert_eq!(
            (packet.stamp, packet.codec),
            (Some(7_000_000_000), Ok(H264))
        );
    }

    #[test]
    fn the_codec_is_in_the_name_of_the_encoder() {
        let formats = ["h264", "libx264", "h265", "hevc_nvenc", "HEVC;yuv420p;x264"];
        let codecs = formats.map(|format| Codec::from_format(format).unwrap());
        assert_eq!(codecs, [H264, H264, H265, H265, H265]);
        let refused = Codec::from_format("av1;yuv420p").unwrap_err();
        assert!(refused.to_string().contains("'av1'"), "{refused}");
    }
}
