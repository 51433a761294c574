//! Names, topics, frames and stamps of svl's own recordings, and their encoded messages.

use super::message_error::{MessageError, MessageResult, ProtobufError};
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
pub(crate) const PROFILE: &str = "svl";

/// The library named in MCAP files that svl writes.
pub(crate) const LIBRARY: &str = concat!("svl ", env!("CARGO_PKG_VERSION"));

/// The left camera's optical frame, unless a source names another.
pub const LEFT_FRAME: &str = "stereo_left";

/// The camera's optical frame. Two frames, because Rerun ties an image plane to each.
pub(crate) fn frame_id(side: Side) -> &'static str {
    match side {
        Side::Left => LEFT_FRAME,
        Side::Right => "stereo_right",
    }
}

/// Topics of svl's own recordings; of a camera see [`topic::camera`].
pub(crate) mod topic {
    use svl_core::stereo::Side;

    pub(crate) const BASELINE: &str = "/rig/baseline";
    pub(crate) const POSE: &str = "/rig/pose";
    pub(crate) const DEPTH: &str = super::TRUTH_DEPTH;
    pub(crate) const DISPARITY: &str = "/truth/disparity";
    pub(crate) const VISIBILITY: &str = "/truth/visibility";
    pub(crate) const SURFACE: &str = "/truth/surface";
    pub(crate) const SYNC: &str = "/stereo/sync";

    /// `image`, `color` or `calibration` of a camera.
    pub(crate) fn camera(side: Side, name: &str) -> String {
        format!("/stereo/{}/{name}", side.name())
    }
}

/// An encoded message and its schema.
pub(crate) struct Encoded {
    pub(crate) schema: &'static str,
    pub(crate) schema_encoding: &'static str,
    pub(crate) definition: Cow<'static, [u8]>,
    pub(crate) encoding: &'static str,
    pub(crate) data: Vec<u8>,
}

impl Encoded {
    pub(crate) fn protobuf<T: foxglove::Encode>(schema: &'static str, message: &T) -> Self {
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
    pub(crate) fn json<T: serde::Serialize>(
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

pub(crate) fn decode_protobuf<T>(data: &[u8]) -> MessageResult<T>
where
    T: foxglove::Decode<Error = ProtobufError>,
{
    T::decode(data).map_err(MessageError::Protobuf)
}

/// A stamp that fits into ROS 2 messages, whose seconds are signed 32-bit: up to January 2038.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RosStamp(pub(crate) u64);

impl RosStamp {
    const SECOND_NS: u64 = 1_000_000_000;
    const MAX_NS: u64 = i32::MAX as u64 * Self::SECOND_NS;

    pub(crate) fn new(ns: u64) -> Result<Self> {
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

    pub(crate) fn ns(self) -> u64 {
        self.0
    }

    /// Whole seconds, and the nanoseconds above them; both fit by construction.
    pub(crate) fn parts(self) -> (u32, u32) {
        (
            (self.0 / Self::SECOND_NS) as u32,
            (self.0 % Self::SECOND_NS) as u32,
        )
    }

    pub(crate) fn foxglove(self) -> Option<foxglove::messages::Timestamp> {
        let (seconds, nanoseconds) = self.parts();
        foxglove::messages::Timestamp::new_checked(seconds, nanoseconds)
    }
}

/// The frame on the floor below a robot (REP 120).
pub(crate) const FLOOR_FRAME: &str = "base_footprint";
