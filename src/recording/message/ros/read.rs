//! Decodes messages of ROS 2, in CDR, and of ROS 1.

use super::message::{MessageReader, Parsed};
use crate::message::message_error::{FieldError, MessageError, MessageResult};
use crate::stream::channel::{Channel, ROS1};
use crate::stream::unpack::unpack_message;

/// Limit on distortion coefficients: `rational_polynomial` in ROS has up to 14.
const MAX_DISTORTION: usize = 14;

/// An uncompressed image in a message: sensor_msgs/msg/Image, or foxglove.RawImage.
pub(crate) struct RawPixels<'a> {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Stride: bytes from one row to the next.
    pub(crate) step: u32,
    /// A name of sensor_msgs/image_encodings.hpp.
    pub(crate) encoding: &'a str,
    pub(crate) big_endian: bool,
    pub(crate) data: &'a [u8],
}

/// A coded image, or picture of a video.
pub(crate) struct RosCoded<'a> {
    pub(crate) stamp: RosTime,
    pub(crate) format: &'a str,
    pub(crate) data: &'a [u8],
}

/// sensor_msgs/msg/CameraInfo. Size, K and P are those of the whole sensor.
pub(crate) struct CameraInfo {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) model: String,
    pub(crate) distortion: Vec<f64>,
    pub(crate) k: [f64; 9],
    pub(crate) r: [f64; 9],
    pub(crate) p: [f64; 12],
    /// Columns and rows of the sensor per pixel of the image; 0 means 1.
    pub(crate) binning: [u32; 2],
    pub(crate) roi: RegionOfInterest,
}

/// sensor_msgs/msg/RegionOfInterest: the part of the sensor in the image, before binning; a side of
/// 0 means all.
pub(crate) struct RegionOfInterest {
    pub(crate) x: u32,
    pub(crate) y: u32,
    pub(crate) height: u32,
    pub(crate) width: u32,
}

/// builtin_interfaces/msg/Time: in ROS 2 the seconds are signed, and negative ones are refused.
#[derive(Clone, Copy)]
pub(crate) struct RosTime {
    pub(crate) sec: u32,
    pub(crate) nanosec: u32,
}

/// Decodes a message of a channel with `read`.
///
/// # Errors
/// The reason why it cannot be read.
pub(crate) fn read<'a, T>(
    channel: &Channel,
    data: &'a [u8],
    read: impl FnOnce(&mut MessageReader<'a>) -> Parsed<T>,
) -> MessageResult<T> {
    if channel.encoding != ROS1 {
        return read_cdr(data, read);
    }
    read(&mut MessageReader::new(data, false)).map_err(MessageError::Ros1)
}

/// Same as [`read`], for CDR.
pub(crate) fn read_cdr<'a, T>(
    data: &'a [u8],
    read: impl FnOnce(&mut MessageReader<'a>) -> Parsed<T>,
) -> MessageResult<T> {
    // The header's last two bytes are options, which XCDR 1 leaves unspecified.
    let body = match data {
        // Encapsulation 0x0001: little-endian CDR, the native order of x86 and ARM.
        [0, 1, _, _, body @ ..] => body,
        [] => return Err(MessageError::Unsuited("it is empty")),
        _ => {
            unpack_message(data)?;
            return Err(MessageError::Unsuited("it is not little-endian CDR"));
        }
    };
    read(&mut MessageReader::new(body, true)).map_err(MessageError::Cdr)
}

/// The stamp and the pixels of a sensor_msgs/msg/Image.
pub(crate) fn image<'a>(message: &mut MessageReader<'a>) -> Parsed<(RosTime, RawPixels<'a>)> {
    let stamp = header(message)?.stamp;
    let image = RawPixels {
        height: message.u32()?,
        width: message.u32()?,
        encoding: message.str()?,
        big_endian: message.u8()? != 0,
        step: message.u32()?,
        data: message.bytes()?,
    };
    Ok((stamp, image))
}

/// sensor_msgs/msg/CompressedImage.
pub(crate) fn compressed_image<'a>(message: &mut MessageReader<'a>) -> Parsed<RosCoded<'a>> {
    Ok(RosCoded {
        stamp: header(message)?.stamp,
        format: message.str()?,
        data: message.bytes()?,
    })
}

/// foxglove_msgs/msg/CompressedVideo, whose head is laid out as a header.
pub(crate) fn compressed_video<'a>(message: &mut MessageReader<'a>) -> Parsed<RosCoded<'a>> {
    let stamp = header(message)?.stamp;
    let data = message.bytes()?;
    Ok(RosCoded {
        stamp,
        format: message.str()?,
        data,
    })
}

/// ffmpeg_image_transport_msgs/msg/FFMPEGPacket.
pub(crate) fn ffmpeg_packet<'a>(message: &mut MessageReader<'a>) -> Parsed<RosCoded<'a>> {
    let stamp = header(message)?.stamp;
    let (_width, _height) = (message.u32()?, message.u32()?);
    let format = message.str()?;
    let (_pts, _flags, _big_endian) = (message.u64()?, message.u8()?, message.u8()?);
    Ok(RosCoded {
        stamp,
        format,
        data: message.bytes()?,
    })
}

pub(crate) fn camera_info(message: &mut MessageReader<'_>) -> Parsed<CameraInfo> {
    let _stamp = header(message)?;
    let height = message.u32()?;
    let width = message.u32()?;
    let model = message.str()?.to_owned();
    let coefficients = message.length(size_of::<f64>())?;
    let coefficients = limited(coefficients, MAX_DISTORTION, "distortion coefficients")?;
    let distortion = (0..coefficients)
        .map(|_| message.f64())
        .collect::<Parsed<_>>()?;
    Ok(CameraInfo {
        width,
        height,
        model,
        distortion,
        k: floats(message)?,
        r: floats(message)?,
        p: floats(message)?,
        binning: [message.u32()?, message.u32()?],
        roi: RegionOfInterest {
            x: message.u32()?,
            y: message.u32()?,
            height: message.u32()?,
            width: message.u32()?,
        },
    })
}

/// std_msgs/msg/String.
pub(crate) fn string<'a>(message: &mut MessageReader<'a>) -> Parsed<&'a str> {
    message.str()
}

/// std_msgs/msg/Header, the first field of most messages.
pub(crate) struct RosHeader<'a> {
    pub(crate) stamp: RosTime,
    pub(crate) frame_id: &'a str,
}

pub(crate) fn header<'a>(message: &mut MessageReader<'a>) -> Parsed<RosHeader<'a>> {
    if !message.is_cdr {
        let _sequence = message.u32()?;
    }
    let stamp = RosTime {
        sec: message.u32()?,
        nanosec: message.u32()?,
    };
    let frame_id = message.str()?;
    Ok(RosHeader { stamp, frame_id })
}

/// sensor_msgs/msg/PointCloud2.
pub(crate) struct RosCloud<'a> {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Name, offset in bytes and type of each field of a point.
    pub(crate) fields: Vec<(&'a str, u32, u8)>,
    pub(crate) big_endian: bool,
    /// Bytes of a point and of a row.
    pub(crate) point_step: u32,
    pub(crate) row_step: u32,
    pub(crate) data: &'a [u8],
}

/// sensor_msgs/msg/LaserScan: angles in radians, ranges in metres.
pub(crate) struct RosScan {
    pub(crate) angle_min: f64,
    pub(crate) angle_increment: f64,
    pub(crate) range_min: f64,
    pub(crate) range_max: f64,
    pub(crate) ranges: Vec<f64>,
}

/// stereo_msgs/msg/DisparityImage.
pub(crate) struct RosDisparityImage<'a> {
    pub(crate) image: RawPixels<'a>,
    pub(crate) focal_px: f32,
    pub(crate) baseline_m: f32,
    pub(crate) min_disparity: f32,
}

pub(crate) fn disparity_image<'a>(
    message: &mut MessageReader<'a>,
) -> Parsed<RosDisparityImage<'a>> {
    header(message)?;
    let (_, image) = image(message)?;
    let (focal_px, baseline_m) = (message.f32()?, message.f32()?);
    for _side_of_window in 0..4 {
        message.u32()?;
    }
    let _do_rectify = message.u8()?;
    Ok(RosDisparityImage {
        image,
        focal_px,
        baseline_m,
        min_disparity: message.f32()?,
    })
}

/// Limit on fields of a point: lidars have ten.
const MAX_FIELDS: usize = 1000;

pub(crate) fn point_cloud<'a>(message: &mut MessageReader<'a>) -> Parsed<RosCloud<'a>> {
    header(message)?;
    let (height, width) = (message.u32()?, message.u32()?);
    let count = limited(message.length(1)?, MAX_FIELDS, "fields of a point")?;
    let mut fields = Vec::with_capacity(count);
    for _ in 0..count {
        fields.push((message.str()?, message.u32()?, message.u8()?));
        let _count = message.u32()?;
    }
    Ok(RosCloud {
        width,
        height,
        fields,
        big_endian: message.u8()? != 0,
        point_step: message.u32()?,
        row_step: message.u32()?,
        data: message.bytes()?,
    })
}

pub(crate) fn laser_scan(message: &mut MessageReader<'_>) -> Parsed<RosScan> {
    header(message)?;
    let (angle_min, _angle_max) = (message.f32()?, message.f32()?);
    let angle_increment = message.f32()?;
    let (_time_increment, _scan_time) = (message.f32()?, message.f32()?);
    let (range_min, range_max) = (message.f32()?, message.f32()?);
    let count = message.length(size_of::<f32>())?;
    let ranges = (0..count).map(|_| message.f32().map(f64::from));
    Ok(RosScan {
        angle_min: angle_min.into(),
        angle_increment: angle_increment.into(),
        range_min: range_min.into(),
        range_max: range_max.into(),
        ranges: ranges.collect::<Parsed<_>>()?,
    })
}

/// A transform: parent and child frame, translation in metres, rotation as x, y, z, w.
pub(crate) type RosTransform = (String, String, [f64; 3], [f64; 4]);

/// Limit on transforms in a message.
const MAX_TRANSFORMS: usize = 10_000;

/// nav_msgs/msg/Odometry: the pose of the child frame, without its covariance and the twist.
pub(crate) fn odometry(message: &mut MessageReader<'_>) -> Parsed<(RosTime, RosTransform)> {
    let RosHeader { stamp, frame_id } = header(message)?;
    let child = message.str()?.to_owned();
    let pose = (floats(message)?, floats(message)?);
    Ok((stamp, (frame_id.to_owned(), child, pose.0, pose.1)))
}

/// tf2_msgs/msg/TFMessage, each transform with its stamp.
pub(crate) fn transforms(message: &mut MessageReader<'_>) -> Parsed<Vec<(RosTime, RosTransform)>> {
    let count = limited(message.length(1)?, MAX_TRANSFORMS, "transforms")?;
    // geometry_msgs/msg/TransformStamped has the fields with which an odometry begins.
    (0..count).map(|_| odometry(message)).collect()
}

/// Checks a count before memory is allocated for it.
fn limited(count: usize, limit: usize, what: &'static str) -> Parsed<usize> {
    if count > limit {
        return Err(FieldError::Count(count, what, limit));
    }
    Ok(count)
}

fn floats<const N: usize>(message: &mut MessageReader<'_>) -> Parsed<[f64; N]> {
    let mut floats = [0.0; N];
    for float in &mut floats {
        *float = message.f64()?;
    }
    Ok(floats)
}
