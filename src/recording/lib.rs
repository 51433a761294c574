//! Recordings: stereo pairs in MCAP files, readable by Rerun, Foxglove and every MCAP library
//! without svl.
//!
//! | topic | message | written when |
//! |---|---|---|
//! | `/stereo/{left,right}/image` | foxglove.RawImage mono8, or CompressedImage png | always |
//! | `/stereo/{left,right}/color` | RawImage rgb8, or CompressedImage png | source in colour |
//! | `/stereo/{left,right}/calibration` | foxglove.CameraCalibration: K, R = I, P | rig known |
//! | `/rig/baseline` | foxglove.FrameTransform, left camera → right camera | rig known |
//! | `/rig/pose` | foxglove.FrameTransform, world → left camera | pose known |
//! | `/truth/depth` | sensor_msgs/msg/Image 32FC1, metres | truth and rig known |
//! | `/truth/disparity` | sensor_msgs/msg/Image 32FC1, pixels | truth beyond infinity, or no rig |
//! | `/truth/visibility` | foxglove.RawImage mono8: [`Visibility`] | truth known |
//! | `/truth/surface` | foxglove.RawImage mono8: [`Surface`] | truth of the arena |
//! | `/stereo/sync` | JSON with schema (sync.schema.json) | always, last of the pair |
//! | `/algo/<name>/disparity` | sensor_msgs/msg/Image 32FC1, pixels | a result of a replay |
//! | `/algo/<name>/cells` | JSON with schema (cells.schema.json) | a result of a replay |
//! | `/algo/<name>/result` | JSON with schema (result.schema.json): hash | a result of a replay |
//!
//! log_time and publish_time are the exposure stamp; those of the right camera use the right stamp.
//! Calibration and baseline are repeated with every pair (200 bytes after compression), so that a
//! truncated recording still contains them. Pixels without depth or disparity are NaN in float
//! images (REP 118), and a point at infinity has depth +∞. The metadata record `svl` is the
//! [`Header`], `grabber` contains the counts of a synchronized grabber; scenario, calibration files
//! and the manifest of the run that wrote the recording are attachments.
//!
//! [`Dialect::Ros2`] contains the same in ROS 2 messages only.
//!
//! ROS 2 bags, in MCAP and SQLite, ROS 1 bags, and recordings of Foxglove and RealSense are read
//! alike: image topics are found by their types, and images are paired by their stamps; see
//! [`Selection`]. In svl's own, `/stereo/sync` names the two images of a pair instead. A bag may be
//! the folder of its files.
//!
//! [`Visibility`]: svl_core::stereo::Visibility
//! [`Surface`]: svl_core::stereo::Surface

mod bags;
mod cameras;
mod clocks;
mod decode;
mod mcap;
mod message;
mod pairs;
mod poses;
mod read;
mod results;
mod sensor;
mod stream;
mod write;

/// The Rust example of the README, as a doctest.
#[cfg(doctest)]
#[doc = include_str!("README.md")]
mod readme {}

#[doc(hidden)]
pub use crate::mcap::messages::warn_once;
pub use crate::mcap::records::DamagedPart;
pub use bags::bag::{files, is_bag, only_file};
pub use bags::container::is_recording;
pub use bags::header::{Header, StampOrigin};
pub use bags::opened::Recording;
pub use cameras::topics::Selection;
pub use clocks::faults::ClockFault;
pub use clocks::measure::{ClockOffset, TopicClock};
pub use clocks::scan::ClockRole;
pub use clocks::table::ClockTable;
pub use decode::video::topic::VideoSummary;
pub use message::images::ImageFormat;
pub use message::ros::CDR_LE;
pub use message::ros::result_message::{ResultMessage, ResultOptions};
pub use message::sync::PairGeometry;
pub use pairs::skew::{SkewBin, SkewSummary};
pub use pairs::stamp_pairing::UnpairedImages;
pub use pairs::stream_facts::{CameraFacts, StreamFacts};
pub use pairs::truth::disparities;
pub use poses::motion::PoseStep;
pub use poses::pose_summary::{FramePoses, PoseSummary};
pub use read::reader::Reader;
pub use read::summary::{ClockJump, Gap, Misalignment, RecordingSummary, Topic};
pub use read::topic_pairs::{LiveTopic, TopicPairs};
pub use results::cells::{AlgorithmCells, CellReport};
pub use results::result::{AlgorithmResult, PairResult, StoredResults};
pub use results::ros_messages::{diagnostics, result_messages};
pub use results::scan::static_transforms;
pub use sensor::measurements::TopicLatency;
pub use sensor::topic::{SensorRole, SensorSelection, SensorTopic, truth_topics};
pub use sensor::view::RawCamera;
pub use stream::stamp_rule::StampUnit;
pub use write::dialect::{Dialect, RecordingFormat};
pub use write::recovery::Recovery;
pub use write::topic_file::TopicFile;
pub use write::writer::Writer;

use std::borrow::Cow;
use svl_core::stereo::Side;
use svl_core::{Error, Result};

/// Name of the attachment with the scenario file.
pub const SCENARIO: &str = "scenario.toml";

/// Topic of the true depths in a recording of svl's.
pub const TRUTH_DEPTH: &str = "/truth/depth";

/// Prefix of the names of attached calibration files, with which the pairs were rectified or, if
/// raw, can be.
pub const CALIBRATION: &str = "calibration/";

/// Name of the attachment with the manifest of the run that wrote the recording.
pub const MANIFEST: &str = "manifest.json";

/// Name of the metadata record with the counts of a synchronized grabber.
pub const GRABBER: &str = "grabber";

/// The MCAP profile of svl's own recordings.
const PROFILE: &str = "svl";

/// The library named in MCAP files that svl writes.
const LIBRARY: &str = concat!("svl ", env!("CARGO_PKG_VERSION"));

/// The left camera's optical frame, unless a source names another.
pub const LEFT_FRAME: &str = "stereo_left";

/// The camera's optical frame. Two frames, because Rerun ties an image plane to each.
fn frame_id(side: Side) -> &'static str {
    match side {
        Side::Left => LEFT_FRAME,
        Side::Right => "stereo_right",
    }
}

/// Topics of svl's own recordings; of a camera see [`topic::camera`].
mod topic {
    use svl_core::stereo::Side;

    pub(super) const BASELINE: &str = "/rig/baseline";
    pub(super) const POSE: &str = "/rig/pose";
    pub(super) const DEPTH: &str = super::TRUTH_DEPTH;
    pub(super) const DISPARITY: &str = "/truth/disparity";
    pub(super) const VISIBILITY: &str = "/truth/visibility";
    pub(super) const SURFACE: &str = "/truth/surface";
    pub(super) const SYNC: &str = "/stereo/sync";

    /// `image`, `color` or `calibration` of a camera.
    pub(super) fn camera(side: Side, name: &str) -> String {
        format!("/stereo/{}/{name}", side.name())
    }
}

/// An encoded message and its schema.
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
        // Encoding fails only if the buffer is too small, and a vector grows.
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

    /// A value whose keys are strings and whose numbers are finite, which always serialises.
    fn json<T: serde::Serialize>(
        schema: &'static str,
        definition: &'static str,
        value: &T,
    ) -> Self {
        Self {
            schema,
            schema_encoding: "jsonschema",
            definition: Cow::Borrowed(definition.as_bytes()),
            encoding: "json",
            data: serde_json::to_vec(value).expect("plain data"),
        }
    }
}

fn decode_protobuf<T: foxglove::Decode>(data: &[u8]) -> std::result::Result<T, String> {
    T::decode(data).map_err(|e| e.to_string())
}

/// A stamp that fits into ROS 2 messages, whose seconds are signed 32-bit: up to January 2038.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct RosStamp(u64);

impl RosStamp {
    const SECOND_NS: u64 = 1_000_000_000;
    const MAX_NS: u64 = i32::MAX as u64 * Self::SECOND_NS;

    fn new(ns: u64) -> Result<Self> {
        // Rejected on writing: a bag that ROS cannot read would be noticed too late.
        if ns <= Self::MAX_NS {
            Ok(Self(ns))
        } else {
            Err(Error::Invalid(format!(
                "stamp {ns} ns is above {} ns, the last that ROS 2 messages can represent",
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
