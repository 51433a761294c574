//! The JSON message of a pair: its stamps, geometry and exposure.

use super::message_error::{MessageError, MessageResult};
use super::wire::Encoded;
use serde::{Deserialize, Serialize};
use svl_core::stereo::{Exposure, Frame, Geometry, TruthKind};

pub(crate) const SCHEMA: &str = "svl.StereoSync";
const DEFINITION: &str = include_str!("sync.schema.json");

/// The message of `/stereo/sync`. Its stamps identify the two images of a pair.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StereoSync {
    /// Number of the pair in its source, from 0.
    pub(crate) sequence: u64,
    /// Name of the pair in its source, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) name: Option<String>,
    /// Middle of the left exposure.
    pub(crate) left_stamp_ns: u64,
    /// Middle of the right exposure.
    pub(crate) right_stamp_ns: u64,
    #[serde(default)]
    pub(crate) geometry: PairGeometry,
    /// Origin and density of the pair's truth, if it has one.
    #[serde(default, skip_serializing_if = "TruthKind::is_default")]
    pub(crate) truth: TruthKind,
    #[serde(flatten)]
    pub(crate) exposure: Exposure,
}

/// Geometry of a pair: raw or rectified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PairGeometry {
    Raw,
    #[default]
    Rectified,
}

impl PairGeometry {
    /// `raw` or `rectified`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Rectified => "rectified",
        }
    }
}

impl From<&Geometry> for PairGeometry {
    fn from(geometry: &Geometry) -> Self {
        match geometry {
            Geometry::Raw => Self::Raw,
            Geometry::Rectified(_) => Self::Rectified,
        }
    }
}

impl StereoSync {
    pub(crate) fn new(frame: &Frame, right_stamp_ns: u64) -> Self {
        let truth = frame.truth.as_ref();
        Self {
            sequence: frame.sequence,
            name: frame.name.clone(),
            left_stamp_ns: frame.stamp_ns,
            right_stamp_ns,
            geometry: (&frame.geometry).into(),
            truth: truth.map(|truth| truth.kind.clone()).unwrap_or_default(),
            exposure: frame.exposure,
        }
    }

    pub(crate) fn encode(&self) -> Encoded {
        Encoded::json(SCHEMA, DEFINITION, self)
    }

    pub(crate) fn decode(schema: &str, data: &[u8]) -> MessageResult<Self> {
        if schema != SCHEMA {
            return Err(MessageError::Schema(schema.to_owned(), SCHEMA.to_owned()));
        }
        Ok(serde_json::from_slice(data)?)
    }
}
