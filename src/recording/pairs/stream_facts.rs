//! Facts of a stream of pairs.

use serde::Serialize;
use std::collections::BTreeMap;
use svl_core::doubt::{CalibrationCheck, Doubt};
use svl_core::stereo::StereoCalibration;
use svl_files::{BitDepth, SideBySide};

/// Facts of the pairs of a recording, or of live topics, so far. The counts are final at the end.
#[derive(Clone, Debug, Default)]
pub struct StreamFacts {
    /// Topics of the left and the right images.
    pub topics: [String; 2],
    /// Number of readable pairs.
    pub pairs: u64,
    /// Stamps of the images without a partner, while both cameras had images.
    pub unpaired_ns: Vec<u64>,
    /// Number of the unpaired images whose partner could not be read: those are reported.
    pub partners_of_unreadable: u64,
    /// Images before the other camera's first or after its last.
    pub outside: u64,
    /// Images that arrived after those of their time had been dropped for lack of memory: the file
    /// is not ordered by stamp.
    pub late: u64,
    /// Unreadable messages other than images, by topic: truth, calibration, colours, pose. Their
    /// pairs are used without them.
    pub broken: BTreeMap<String, u64>,
    /// Number of bits that the 16-bit images use.
    pub bits: Option<u8>,
    /// The conversion of 16-bit values to grey levels, with the reason.
    pub grey: Option<String>,
    /// Doubts about the images.
    pub doubts: Vec<Doubt>,
    /// Note on the images that is not a warning.
    pub note: Option<String>,
    /// Warnings about the pairs, a line each.
    pub remarks: Vec<String>,
    /// The reason why there was no pair.
    pub why_none: String,
    /// The calibration that rectifies raw pairs. If it is incomplete, a remark gives the reason.
    pub calibration: Option<StereoCalibration>,
    pub camera: CameraFacts,
    /// The coordinate frame of the left images, if they name one.
    pub frame_id: Option<String>,
}

impl StreamFacts {
    /// Facts of images by their values and, if both are halves of one, by their `places` and their
    /// `size`.
    pub fn from_images(depth: &BitDepth, places: Option<SideBySide>, size: (usize, usize)) -> Self {
        let halves = places.and_then(|places| places.doubt(size));
        Self {
            bits: depth.bits,
            grey: depth.grey_words(),
            note: depth.note(),
            doubts: depth.doubts.iter().cloned().chain(halves).collect(),
            ..Self::default()
        }
    }
}

/// Facts of the cameras in a recording that svl did not write, or in a folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CameraFacts {
    /// Focal lengths of the left camera along x and y, pixels: of raw images before rectification.
    pub focal_px: Option<(f64, f64)>,
    /// Distortion model of the left camera, as ROS names it, if its images are distorted.
    pub distortion_model: Option<String>,
    /// The reason why a calibration gives no distances; `None` if it does, and without any.
    pub calibration_fault: Option<String>,
    /// Numbers of the calibrations beside their usual values.
    #[serde(skip)]
    pub checks: Vec<CalibrationCheck>,
}
