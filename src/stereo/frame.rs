//! What flows from a source through the matchers into the sinks.

use super::{DepthGrid, DisparityMap, Plane, Rig, StereoPair};
use crate::timing::StageTimes;

/// Pose of the left camera's optical frame (x right, y down, z forward) in the world (z up),
/// metres.
pub type Pose = nalgebra::Isometry3<f64>;

/// One synchronized pair and what is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the pair in its source, from 0.
    pub sequence: u64,
    /// Middle of the left exposure, nanoseconds since the source's epoch.
    pub stamp_ns: u64,
    /// What the source calls it, where it has a name of its own (a data set's scene).
    pub name: Option<String>,
    pub pair: StereoPair,
    pub rig: Option<Rig>,
    pub pose: Option<Pose>,
    pub truth: Option<Truth>,
    pub exposure: Exposure,
}

/// How and when a pair was exposed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Exposure {
    /// Number of the trigger pulse that fired both cameras.
    pub trigger_id: u64,
    /// Right stamp minus left stamp.
    pub skew_ns: i64,
    /// Exposure time, 0 when unknown.
    pub shutter_us: u32,
    /// Sensor gain in thousandths of a decibel.
    pub gain_mdb: i32,
    /// Images that are not in the recording since it began: without a partner, or dropped with it.
    pub drops: u64,
}

/// The true disparities of the left image.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Disparity in pixels, `+∞` where unknown.
    pub disparity: Plane<f32>,
    /// Whether the right camera sees the pixel's point; absent where nobody knows.
    pub visibility: Option<Plane<Visibility>>,
}

/// Whether a left pixel's point is seen by the right camera, with the codes of Middlebury's
/// `mask0nocc.png`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Visibility {
    /// No truth there.
    Unknown = 0,
    /// Hidden from the right camera or outside its image.
    Occluded = 128,
    /// Seen by both.
    Visible = 255,
}

impl Visibility {
    /// From a mask's grey value; anything but 128 and 255 is unknown.
    pub fn from_code(code: u8) -> Self {
        match code {
            255 => Self::Visible,
            128 => Self::Occluded,
            _ => Self::Unknown,
        }
    }
}

/// One algorithm's answer to one frame.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The algorithm as it was asked for, e.g. `v3` or `v3:max_disparity=64`.
    pub algorithm: String,
    pub disparity: DisparityMap,
    pub grid: DepthGrid,
    pub times: StageTimes,
}
