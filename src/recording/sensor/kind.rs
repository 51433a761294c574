//! The kinds of messages that measure distances, with their readers.

use super::{depth_image, points};
use crate::decode::encoding;
use crate::decode::head::head;
use crate::message::wire::{decode_protobuf, topic};
use crate::message::{MessageError, MessageResult, ros};
use crate::pairs::truth;
use crate::stream::channel::{Channel, ROS1};
use foxglove::messages;
use nalgebra::Point3;
use svl_core::joined;
use svl_core::stereo::Plane;

/// Measurement in a message.
pub(crate) enum Measured {
    /// Depths along the optical axis, metres; `+∞` at infinity, NaN for invalid pixels.
    Depth(Plane<f32>),
    /// Points in the sensor's frame, metres.
    Points(Vec<Point3<f64>>),
    /// Disparities of the left image as svl matched it, pixels; `+∞` for invalid pixels.
    Disparity(Plane<f32>),
}

impl Measured {
    /// Scales depths that were read as millimetres to the camera's own unit, in metres per step.
    pub(crate) fn in_unit(mut self, unit_m: Option<f32>) -> Self {
        if let (Self::Depth(depth), Some(unit_m)) = (&mut self, unit_m) {
            let scale = unit_m / 0.001;
            *depth = depth.map(|z| z * scale);
        }
        self
    }

    /// Memory use in bytes.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Depth(map) | Self::Disparity(map) => {
                size_of::<f32>() * map.width() * map.height()
            }
            Self::Points(points) => size_of::<Point3<f64>>() * points.len(),
        }
    }
}

/// Reads a message of a channel.
type Read<T> = fn(&Channel, &[u8]) -> MessageResult<T>;

/// A type of message that measures distances.
pub(crate) struct MeasuredKind {
    schema: &'static str,
    encoding: &'static str,
    decode: Decode,
}

#[derive(Clone, Copy)]
enum Decode {
    Depth(Read<Plane<f32>>),
    Points(Read<Vec<Point3<f64>>>),
    /// Disparities in pixels instead of depths in metres.
    Disparity(Read<Plane<f32>>),
}

/// All kinds. A new one is its function and a line here.
const KINDS: &[MeasuredKind] = &[
    depth("sensor_msgs/msg/Image", "cdr", depth_image::ros_image),
    depth(
        "sensor_msgs/msg/CompressedImage",
        "cdr",
        depth_image::ros_compressed,
    ),
    depth(
        "stereo_msgs/msg/DisparityImage",
        "cdr",
        depth_image::disparity_image,
    ),
    depth("foxglove.RawImage", "protobuf", depth_image::foxglove_image),
    depth(
        "foxglove.CompressedImage",
        "protobuf",
        depth_image::foxglove_compressed,
    ),
    cloud("sensor_msgs/msg/PointCloud2", "cdr", points::ros_cloud),
    cloud("sensor_msgs/msg/LaserScan", "cdr", points::ros_scan),
    cloud("foxglove.PointCloud", "protobuf", points::foxglove_cloud),
    cloud("foxglove.LaserScan", "protobuf", points::foxglove_scan),
];

/// The disparities in a result of svl's.
const OWN_RESULT: MeasuredKind = MeasuredKind {
    schema: "sensor_msgs/msg/Image",
    encoding: "cdr",
    decode: Decode::Disparity(encoding::floats),
};

/// The surfaces in the truth of a bag that svl wrote: their codes, as disparities.
const SURFACES: MeasuredKind = MeasuredKind {
    schema: "sensor_msgs/msg/Image",
    encoding: "cdr",
    decode: Decode::Disparity(depth_image::codes),
};

/// The kind of a channel's messages, if they are the surfaces of a truth.
pub(crate) fn surfaces(channel: &Channel) -> Option<&'static MeasuredKind> {
    let is_own = channel.topic == topic::SURFACE;
    (is_own && channel.schema == SURFACES.schema).then_some(&SURFACES)
}

const fn depth(
    schema: &'static str,
    encoding: &'static str,
    decode: Read<Plane<f32>>,
) -> MeasuredKind {
    let decode = Decode::Depth(decode);
    MeasuredKind {
        schema,
        encoding,
        decode,
    }
}

const fn cloud(
    schema: &'static str,
    encoding: &'static str,
    decode: Read<Vec<Point3<f64>>>,
) -> MeasuredKind {
    let decode = Decode::Points(decode);
    MeasuredKind {
        schema,
        encoding,
        decode,
    }
}

/// The kind of a channel's messages.
///
/// # Errors
/// The type of the messages, if it is none that measures distances.
pub(crate) fn find(channel: &Channel) -> MessageResult<&'static MeasuredKind> {
    if is_bare_disparity(channel) {
        let is_own = is_own_result(channel) && channel.schema == OWN_RESULT.schema;
        return is_own.then_some(&OWN_RESULT).ok_or(MessageError::Unsuited(
            "its images are disparities, by their name, and do not say of which scale and camera: \
             name depth images, or publish stereo_msgs/msg/DisparityImage",
        ));
    }
    let kind = KINDS.iter().find(|kind| kind.schema == channel.schema);
    let kind = kind.ok_or_else(|| {
        let known = joined(KINDS.iter().map(|kind| kind.schema));
        MessageError::NoDistances(channel.schema.clone(), known)
    })?;
    let is_ros1 = channel.encoding == ROS1 && kind.encoding == "cdr";
    if kind.encoding == channel.encoding || is_ros1 {
        Ok(kind)
    } else {
        let known = format!(", svl reads {} there", kind.encoding);
        Err(MessageError::encoding(channel, &known))
    }
}

/// True for a topic of images that are disparities by their name: their pixels have the format of
/// depths.
fn is_bare_disparity(channel: &Channel) -> bool {
    let name = channel.topic.to_lowercase();
    name.contains("disparity")
        && !name.contains("depth")
        && channel.schema.ends_with("Image")
        && !channel.schema.ends_with("DisparityImage")
}

/// True for a result in a recording of svl's.
pub(crate) fn is_own_result(channel: &Channel) -> bool {
    channel.topic.starts_with("/algo/")
}

/// True for an image in mono16, whose samples may be depths or brightness.
pub(crate) fn is_mono16(channel: &Channel, data: &[u8]) -> bool {
    let is_it = |encoding: &str| encoding.eq_ignore_ascii_case("mono16");
    match (channel.schema.as_str(), channel.encoding.as_str()) {
        ("sensor_msgs/msg/Image", _) => {
            let image = ros::read(channel, data, ros::image);
            image.is_ok_and(|(_, image)| is_it(image.encoding))
        }
        ("foxglove.RawImage", "protobuf") => {
            let image: Result<messages::RawImage, _> = decode_protobuf(data);
            image.is_ok_and(|image| is_it(&image.encoding))
        }
        _ => false,
    }
}

impl MeasuredKind {
    pub(crate) fn is_depth(&self) -> bool {
        matches!(self.decode, Decode::Depth(_))
    }

    /// True for disparities of the left image as svl matched it: its messages name no frame.
    pub(crate) fn is_own(&self) -> bool {
        matches!(self.decode, Decode::Disparity(_))
    }

    /// True for disparities, which are those of a rectified camera by definition.
    pub(crate) fn is_disparity(&self) -> bool {
        self.schema.ends_with("DisparityImage")
    }

    /// The stamp of a message and its measurement.
    ///
    /// # Errors
    /// The reason why it cannot be read.
    pub(crate) fn read(
        &self,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
    ) -> MessageResult<(u64, Measured)> {
        let stamp = head(channel, data)?.0.unwrap_or(log_time);
        let measured = match self.decode {
            Decode::Depth(decode) => Measured::Depth(decode(channel, data)?),
            Decode::Points(decode) => Measured::Points(decode(channel, data)?),
            Decode::Disparity(decode) => {
                Measured::Disparity(truth::from_file(&decode(channel, data)?))
            }
        };
        Ok((stamp, measured))
    }
}

/// Topic of the measurements, the largest time difference of one, and their use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SensorSelection {
    pub topic: String,
    /// Largest difference between the stamps of a pair and its measurement.
    pub max_skew_ns: u64,
    pub role: SensorRole,
}

/// Use of the measurements of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorRole {
    /// The truth: points between which nothing is known stay points.
    Truth,
    /// The map of an algorithm: the samples of a depth image cover the pixels that they see, and a
    /// measurement is that of one pair.
    Map,
}

impl SensorRole {
    /// Depths as they are used: infinity is an answer, and no truth. Negative ones of a truth make
    /// it doubtful.
    pub fn depths(self, depth: &Plane<f32>) -> Plane<f32> {
        let is_used = |z: f32| match self {
            Self::Map => z > 0.0,
            Self::Truth => z.is_finite(),
        };
        depth.map(|z| if is_used(z) { z } else { f32::NAN })
    }
}

impl SensorSelection {
    /// At 1 m/s a robot moves 2 cm in that time, a fifth of a cell's distance tolerance.
    pub const MAX_SKEW_NS: u64 = 20_000_000;

    /// The option, as the user wrote it.
    pub(crate) fn asked(&self) -> String {
        match self.role {
            SensorRole::Truth => format!("--truth {}", self.topic),
            SensorRole::Map => format!("topic:{}", self.topic),
        }
    }
}
