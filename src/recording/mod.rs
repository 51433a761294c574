//! Recordings: stereo pairs in MCAP files that Rerun, Foxglove and every MCAP library open without
//! svl.
//!
//! | topic | message | written when |
//! |---|---|---|
//! | `/stereo/left/image`, `/stereo/right/image` | foxglove.RawImage mono8, or CompressedImage png | always |
//! | `/stereo/left/calibration`, `/stereo/right/calibration` | foxglove.CameraCalibration: rectified K, R = I, P | the rig is known |
//! | `/rig/baseline` | foxglove.FrameTransform, left camera → right camera | the rig is known |
//! | `/rig/pose` | foxglove.FrameTransform, world → left camera | the pose is known |
//! | `/truth/depth` | sensor_msgs/msg/Image 32FC1, metres | truth and rig are known |
//! | `/truth/disparity` | sensor_msgs/msg/Image 32FC1, pixels | depth cannot say the truth |
//! | `/truth/visibility` | foxglove.RawImage mono8, codes of [`crate::stereo::Visibility`] | known |
//! | `/stereo/sync` | JSON with schema (sync.schema.json) | always, last of the pair |
//! | `/algo/<name>/disparity` | sensor_msgs/msg/Image 32FC1, pixels | a result of a replay |
//! | `/algo/<name>/result` | JSON with schema (result.schema.json): its hash | a result of a replay |
//!
//! log_time and publish_time are the exposure stamp; the right camera's messages carry the right
//! stamp. Calibration and baseline stand with every pair (200 bytes after compression), so that a
//! recording cut anywhere still has them. Where there is no depth or disparity, float images are
//! NaN (REP 118), and a point at infinity has depth +∞. The metadata record `svl` is the
//! [`Header`], `grabber` counts what came from cameras and why some is not here; the manifest of
//! the run that wrote it, scenario and calibration files are attachments.
//!
//! [`Dialect::Ros2`] is the same in ROS 2's messages alone.
//!
//! What svl did not write, ROS 2 bags and Foxglove recordings, is read too: topics of images are
//! found by their types, and two images are a pair when their stamps are near enough; see
//! [`Selection`]. A bag may be the folder of its files.

mod append;
mod bag;
mod chunk;
mod dialect;
mod file;
mod float_image;
mod foreign;
mod geometry;
mod gray_image;
mod header;
mod index;
mod layout;
mod loss;
mod messages;
mod opened;
mod pairing;
mod reader;
mod records;
mod recovery;
mod result;
mod ros;
mod salvage;
mod search;
mod skew;
mod steady;
mod summary;
mod sync;
mod truth;
mod writer;

pub use bag::{files, is_bag, only_file};
pub use dialect::{Dialect, Format};
pub use foreign::Selection;
pub use gray_image::ImageFormat;
pub use header::Header;
pub use loss::Loss;
pub use opened::Recording;
pub use reader::Reader;
pub use recovery::Recovery;
pub use result::AlgorithmResult;
pub use skew::{Skew, SkewBin};
pub use summary::{Gap, Summary, Topic};
pub use writer::Writer;

use crate::error::{Error, Result};
use crate::stereo::Side;
use std::borrow::Cow;

/// Name of the attachment that is the scenario file.
pub const SCENARIO: &str = "scenario.toml";

/// What the names of attachments begin with that are files of the calibration by which the pairs
/// were rectified, or, of raw ones, can be.
pub const CALIBRATION: &str = "calibration/";

/// Name of the attachment that is the manifest of the run which wrote the recording.
pub const MANIFEST: &str = "manifest.json";

/// Name of the metadata record that says what became of the images of the cameras.
pub const GRABBER: &str = "grabber";

/// MCAP's profile of svl's own recordings.
const PROFILE: &str = "svl";

/// What MCAP files of svl name as their writer.
const LIBRARY: &str = concat!("svl ", env!("CARGO_PKG_VERSION"));

/// The camera's optical frame. Two frames, because Rerun ties an image plane to each.
fn frame_id(side: Side) -> &'static str {
    match side {
        Side::Left => "stereo_left",
        Side::Right => "stereo_right",
    }
}

/// What a topic holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Image(Side),
    Calibration(Side),
    Baseline,
    Pose,
    Depth,
    Disparity,
    Visibility,
    Sync,
}

impl Kind {
    const ALL: [Kind; 10] = [
        Kind::Image(Side::Left),
        Kind::Image(Side::Right),
        Kind::Calibration(Side::Left),
        Kind::Calibration(Side::Right),
        Kind::Baseline,
        Kind::Pose,
        Kind::Depth,
        Kind::Disparity,
        Kind::Visibility,
        Kind::Sync,
    ];

    fn topic(self) -> &'static str {
        match self {
            Kind::Image(Side::Left) => "/stereo/left/image",
            Kind::Image(Side::Right) => "/stereo/right/image",
            Kind::Calibration(Side::Left) => "/stereo/left/calibration",
            Kind::Calibration(Side::Right) => "/stereo/right/calibration",
            Kind::Baseline => "/rig/baseline",
            Kind::Pose => "/rig/pose",
            Kind::Depth => "/truth/depth",
            Kind::Disparity => "/truth/disparity",
            Kind::Visibility => "/truth/visibility",
            Kind::Sync => "/stereo/sync",
        }
    }

    fn of(topic: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.topic() == topic)
    }
}

/// A message ready to be written, with the schema that says how to read it.
struct Encoded {
    schema: &'static str,
    schema_encoding: &'static str,
    definition: Cow<'static, [u8]>,
    encoding: &'static str,
    data: Vec<u8>,
}

impl Encoded {
    fn protobuf<T: foxglove::Encode>(schema: &'static str, message: &T) -> Self {
        let mut data = Vec::with_capacity(message.encoded_len().unwrap_or(0));
        // A message fails to encode only for want of room, and a vector grows.
        let _ = message.encode(&mut data);
        let definition = T::get_schema().map(|s| s.data).unwrap_or_default();
        Self {
            schema,
            schema_encoding: "protobuf",
            definition,
            encoding: "protobuf",
            data,
        }
    }
}

fn decode_protobuf<T: foxglove::Decode>(data: &[u8]) -> std::result::Result<T, String> {
    T::decode(data).map_err(|e| e.to_string())
}

/// A time that ROS 2 messages can say: up to January 2038.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stamp(u64);

impl Stamp {
    const SECOND_NS: u64 = 1_000_000_000;
    const MAX_NS: u64 = i32::MAX as u64 * Self::SECOND_NS;

    fn new(ns: u64) -> Result<Self> {
        if ns <= Self::MAX_NS {
            Ok(Self(ns))
        } else {
            Err(Error::Invalid(format!(
                "stamp {ns} ns is above {} ns, the last that ROS 2 messages can say",
                Self::MAX_NS
            )))
        }
    }

    fn ns(self) -> u64 {
        self.0
    }

    /// Whole seconds, and the nanoseconds above them; both fit by construction.
    fn parts(self) -> (u32, u32) {
        (
            (self.0 / Self::SECOND_NS) as u32,
            (self.0 % Self::SECOND_NS) as u32,
        )
    }

    fn foxglove(self) -> Option<foxglove::messages::Timestamp> {
        let (seconds, nanoseconds) = self.parts();
        foxglove::messages::Timestamp::new_checked(seconds, nanoseconds)
    }
}
