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
pub use message::message_error::{FieldError, MessageError};
pub use message::ros::message::CDR_LE;
pub use message::ros::result_message::{ResultMessage, ResultOptions};
pub use message::sync::PairGeometry;
pub use message::wire::{CALIBRATION, GRABBER, LEFT_FRAME, MANIFEST, SCENARIO, TRUTH_DEPTH};
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
pub use results::ros_messages::{DIAGNOSTICS, RESULT_TOPICS, diagnostics, result_messages};
pub use results::scan::static_transforms;
pub use sensor::kind::{SensorRole, SensorSelection};
pub use sensor::measurements::TopicLatency;
pub use sensor::topic::{SensorTopic, truth_topics};
pub use sensor::view::RawCamera;
#[doc(hidden)]
pub use stream::channel::{warn_of, warn_once};
pub use stream::stamp_rule::StampUnit;
pub use stream::unpack::UnpackError;
pub use write::dialect::{Dialect, RecordingFormat};
pub use write::recovery::Recovery;
pub use write::topic_file::TopicFile;
pub use write::writer::Writer;
