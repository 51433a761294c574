//! Why a message, or what is made of it, cannot be used.

use crate::stream::channel::Channel;
use crate::stream::unpack::UnpackError;
use std::sync::Arc;

/// The cure of exchanged cameras.
const NAMES: &str = "--left and --right name their topics";

/// A message that was read, or a thing made of messages.
pub(crate) type MessageResult<T> = Result<T, MessageError>;

/// The error of Foxglove's messages in protobuf.
pub(crate) type ProtobufError = <foxglove::messages::FrameTransform as foxglove::Decode>::Error;

/// Why the fields of a ROS message cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// Bytes of a field, its place, and the bytes that are there.
    #[error("{0} bytes expected at byte {1}, there are {2}")]
    Cut(usize, usize, usize),
    /// Elements of a sequence, and those that there are bytes for.
    #[error("a sequence of {0} elements, there are bytes for {1}")]
    Sequence(usize, usize),
    /// A count, what is counted, and the limit.
    #[error("{0} {1}, at most {2} expected")]
    Count(usize, &'static str, usize),
    #[error("a text is not UTF-8")]
    Text(#[from] std::str::Utf8Error),
}

/// Width and height, pixels.
type Size = (usize, usize);

/// Why a message, or what is made of it, cannot be used. `Display` says it of the message, whose
/// place the caller adds.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
#[non_exhaustive]
pub enum MessageError {
    Protobuf(#[source] ProtobufError),
    /// JSON of svl's own messages.
    OwnJson(#[from] serde_json::Error),
    /// JSON of Foxglove's messages.
    #[error("its JSON cannot be read: {0}")]
    Json(#[source] serde_json::Error),
    #[error("its CDR cannot be read: {0}")]
    Cdr(#[source] FieldError),
    #[error("its ROS 1 message cannot be read: {0}")]
    Ros1(#[source] FieldError),
    Packed(#[from] UnpackError),
    /// Sizes, geometry or images that svl refuses, from whatever source.
    Refused(#[from] svl_core::Error),
    /// A message of another type, and those that are read.
    #[error("it is a {0}, svl reads {1}")]
    Schema(String, String),
    #[error("has messages of {0}; distances are read from {1}")]
    NoDistances(String, String),
    /// A type, its encoding, and those that are read, in words.
    #[error("its {0} is in '{1}'{2}")]
    Encoding(String, String, String),
    /// A part that its use needs.
    Missing(&'static str),
    /// A part that is of another kind than svl reads.
    Unsuited(&'static str),
    /// Stamps that are no time, of another clock, or shared.
    Stamps(String),
    /// Pixels in an encoding that is not read there.
    Pixels(String),
    #[error("a {0}x{1} {2} image without a pixel")]
    NoPixel(usize, usize, String),
    #[error("its sides of {0}x{1} are odd, which {2} cannot have: crop it to even ones")]
    OddSides(usize, usize, String),
    /// The image that the data should be, and their bytes.
    #[error("{0} does not fit its {1} bytes")]
    Length(String, usize),
    #[error("{0} is shorter than its {1} bytes: its encoding or size is wrong")]
    Surplus(String, usize),
    #[error("truth is {}x{}, the images are {}x{}", .0.0, .0.1, .1.0, .1.1)]
    TruthSize(Size, Size),
    #[error("it has {}x{} pixels, the video began with {}x{}", .0.0, .0.1, .1.0, .1.1)]
    VideoSize(Size, Size),
    #[error("its maps are {}x{}, the left images {}x{}", .0.0, .0.1, .1.0, .1.1)]
    MapSize(Size, Size),
    #[error("a depth image is {}x{}, the first was {}x{}", .0.0, .0.1, .1.0, .1.1)]
    DepthSize(Size, Size),
    /// The format of an image, and the decoder's reason.
    #[error("its image, compressed as '{0}', cannot be read as PNG or JPEG: {1}")]
    CodedImage(String, #[source] svl_files::ImageFault),
    /// Compressed depths.
    CodedDepths(String),
    #[error("its points have no field '{0}'")]
    NoField(&'static str),
    #[error("the field '{0}' of its points is of type {1}, svl reads float32 (7) and float64 (8)")]
    FieldType(&'static str, i32),
    #[error("the fields of its points do not fit their {0} bytes")]
    FieldPlaces(usize),
    #[error("its cells are not those of a {0}x{1} grid")]
    Grid(usize, usize),
    /// A transform that is not a rigid motion.
    Transform(String),
    /// The frames of sensor and camera do not lead to each other.
    Frames(String),
    /// A key of RealSense's texts.
    Key(String),
    /// Name of the codec.
    #[error("its video is '{0}', svl reads h264 and h265: record one of them")]
    Codec(String),
    /// A picture that cannot be decoded, or whose order is unknown.
    Video(&'static str),
    #[error("its size changes from {0}x{1} without a keyframe")]
    SizeChange(usize, usize),
    #[error(
        "it has {0} slices, those before {1}: one may be missing; record with a fixed number of \
         slices"
    )]
    Slices(usize, usize),
    #[error("before it a keyframe is missing: {0}")]
    Keyframe(#[source] Arc<MessageError>),
    Picture(#[from] Arc<MessageError>),
    /// The cameras have no calibrations that are used.
    Calibration(&'static str),
    /// Topics of calibrations.
    #[error(
        "the names of {0} do not say which are those of the two cameras: --left-info TOPIC and \
         --right-info TOPIC do"
    )]
    Infos(String),
    /// A matrix, its count of numbers, and the right one.
    #[error("its {0} has {1} numbers, {2}")]
    Matrix(char, usize, &'static str),
    /// Why the static transforms give none either.
    #[error("the calibrations have no baseline (fourth column of P), and {0}")]
    NoBaseline(String),
    /// The frames of the cameras, and their distance.
    #[error("by the static transforms '{1}' is {2:.3} m to the left of '{0}': {NAMES}")]
    Exchanged(String, String, f64),
    /// Two calibrations that are not of a rig.
    #[error("{0}; --calib FILE replaces it")]
    NoRig(#[source] svl_core::Error),
    /// The topic of a message.
    #[error("{0}: {1}")]
    On(String, #[source] Box<MessageError>),
    /// Stamp of a pair's left image.
    #[error("the pair at {0} ns: {1}")]
    Pair(u64, #[source] Box<MessageError>),
}

impl MessageError {
    /// A channel of another type. `known`: those that are read.
    pub(crate) fn schema(channel: &Channel, known: &str) -> Self {
        Self::Schema(channel.schema.clone(), known.to_owned())
    }

    /// An encoding of a channel that is not read. `known`: those that are, in words.
    pub(crate) fn encoding(channel: &Channel, known: &str) -> Self {
        let (schema, encoding) = (channel.schema.clone(), channel.encoding.clone());
        Self::Encoding(schema, encoding, known.to_owned())
    }

    /// The same with the place of the message.
    pub(crate) fn on(self, place: &str) -> Self {
        Self::On(place.to_owned(), Box::new(self))
    }
}

/// For assertions: equal words.
#[cfg(test)]
impl PartialEq for MessageError {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}
