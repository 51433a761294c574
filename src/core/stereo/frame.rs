//! Frames and estimates: the data that flow from a source through the matchers into the sinks.

use super::{
    DepthGrid, DisparityMap, FloorPlane, PairId, Plane, RectifiedPair, Rgb, Rig, StereoCalibration,
    StereoPair, Surface,
};
use crate::error::{Error, Result};
use crate::timing::StageTimes;
use std::sync::Arc;

/// Pose of the left camera's optical frame (x right, y down, z forward) in the world (z up),
/// metres.
pub type Pose = nalgebra::Isometry3<f64>;

/// A synchronized pair with geometry, pose, ground truth and exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the pair in its source, from 0.
    pub sequence: u64,
    /// Middle of the left exposure, nanoseconds since the source's epoch.
    pub stamp_ns: u64,
    /// Name of a data-set scene; frames of a stream have none.
    pub name: Option<String>,
    pub pair: StereoPair,
    pub geometry: Geometry,
    /// The cameras before rectification: of a raw pair, what would rectify it, if its source says
    /// so; of one that was rectified since, what it was rectified by.
    pub calibration: Option<Arc<StereoCalibration>>,
    pub pose: Option<Pose>,
    /// Pose of the robot's base (x ahead, z up) in the same world, if transforms tell it.
    pub base: Option<Pose>,
    pub truth: Option<Truth>,
    /// The floor below the camera, if something tells it.
    pub floor: Option<FloorPlane>,
    /// Disparity maps that its source has besides the images, for the algorithms that report them.
    pub maps: Vec<RecordedMap>,
    /// Left and right in colour, of the pair's size, if the source has it. For display only:
    /// matchers use the pair, which is its luma ([`super::Gray::from_color`]).
    pub color: Option<[Rgb; 2]>,
    pub exposure: Exposure,
    /// Identity of the recorded pair, where the pixels are others by now ([`Frame::keep_id`]).
    pub recorded: Option<PairId>,
}

impl Frame {
    /// The first frame of a source, at 0 ns, with nothing but its geometry known.
    pub fn new(pair: StereoPair, geometry: Geometry) -> Self {
        Self {
            sequence: 0,
            stamp_ns: 0,
            name: None,
            pair,
            geometry,
            calibration: None,
            pose: None,
            base: None,
            truth: None,
            floor: None,
            maps: Vec::new(),
            color: None,
            exposure: Exposure::default(),
            recorded: None,
        }
    }

    /// Identity of the pair as it was recorded.
    pub fn id(&self) -> PairId {
        let new = || PairId::new(&self.pair, self.stamp_ns, self.exposure.skew_ns);
        self.recorded.unwrap_or_else(new)
    }

    /// Keeps the identity of the pair, before its pixels are changed.
    pub fn keep_id(&mut self) {
        self.recorded = Some(self.id());
    }

    /// Approximate memory use in bytes: two images, also in colour if present; four bytes per
    /// disparity, one each per visibility and surface.
    pub fn memory_bytes(&self) -> usize {
        let (width, height) = self.pair.size();
        let color = self.color.as_ref().map_or(0, |_| 6);
        let maps = 4 * self.maps.len();
        let per_pixel = 2 + color + maps + self.truth.as_ref().map_or(0, |_| 6);
        width * height * per_pixel
    }

    /// The rig of a rectified pair, if it is calibrated.
    pub fn rig(&self) -> Option<&Rig> {
        self.geometry.rig()
    }

    /// Hash of all inputs of the frame's scores: the pixels, as `pair`, the pair's hash; the stamp,
    /// by which algorithms know the pairs before; the geometry; and the truth as used.
    pub fn input_hash(&self, pair: u128) -> u128 {
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        hasher.update(&pair.to_le_bytes());
        hasher.update(&self.stamp_ns.to_le_bytes());
        let rig = match &self.geometry {
            Geometry::Raw => vec![f64::NEG_INFINITY],
            Geometry::Rectified(None) => vec![f64::INFINITY],
            Geometry::Rectified(Some(rig)) => {
                let (cx_px, cy_px) = rig.center_px();
                vec![
                    rig.focal_px(),
                    cx_px,
                    cy_px,
                    rig.baseline_m(),
                    rig.doffs_px(),
                ]
            }
        };
        rig.iter()
            .for_each(|number| hasher.update(&number.to_le_bytes()));
        if let Some(truth) = &self.truth {
            hasher.update(&truth.whole_hash().to_le_bytes());
        }
        hasher.digest128()
    }

    /// The pair, for a matcher.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a raw pair.
    pub fn rectified(&self) -> Result<RectifiedPair<'_>> {
        match self.geometry {
            Geometry::Rectified(_) => Ok(RectifiedPair::assume(&self.pair)),
            Geometry::Raw => Err(Error::Invalid(format!(
                "pair {} is raw: rectify it with --calib FILE, or treat it as rectified with \
                 --calib none",
                self.sequence
            ))),
        }
    }
}

/// Geometry of a pair: raw or rectified.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Geometry {
    /// Images with lens distortion and vertical misalignment: epipolar lines are not rows.
    Raw,
    /// Epipolar lines are rows. With a rig disparities give distances; without one the scale is
    /// unknown.
    Rectified(Option<Rig>),
}

impl Geometry {
    /// The rig of a rectified pair, if it is calibrated.
    pub fn rig(&self) -> Option<&Rig> {
        match self {
            Self::Raw => None,
            Self::Rectified(rig) => rig.as_ref(),
        }
    }
}

/// Exposure of a pair: trigger, settings and losses so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Exposure {
    /// Number of the trigger pulse that triggered both cameras.
    pub trigger_id: u64,
    /// Right stamp minus left stamp, nanoseconds; `None` if the source does not report it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skew_ns: Option<i64>,
    /// Exposure time, microseconds; 0 when unknown.
    pub shutter_us: u32,
    /// Sensor gain in thousandths of a decibel.
    pub gain_mdb: i32,
    /// Images dropped or unpaired since the recording began.
    pub drops: u64,
}

/// The true disparities of the left image.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Disparity in pixels, `+∞` where unknown.
    pub disparity: Plane<f32>,
    /// Visibility of the pixel's point in the right camera; `None` if unknown.
    pub visibility: Option<Plane<Visibility>>,
    /// Surface that the pixel shows; only simulations know it.
    pub surface: Option<Plane<Surface>>,
    pub kind: TruthKind,
}

/// A disparity map of the left image that others computed: in the recording, or in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedMap {
    /// Origin of the map, as [`crate::matcher::MapRequest::source`] names it.
    pub source: String,
    /// Disparity in pixels, `+∞` where unknown.
    pub disparity: Plane<f32>,
    pub density: MapDensity,
}

/// Origin and density of a truth; exact and dense by default.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct TruthKind {
    pub density: MapDensity,
    pub origin: TruthOrigin,
}

impl TruthKind {
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Truth {
    /// Hash of its disparities, the same on every machine.
    pub fn hash(&self) -> u128 {
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        for row in self.disparity.rows() {
            let bytes: Vec<_> = row.iter().map(|d| d.to_le_bytes()).collect();
            hasher.update(bytes.as_flattened());
        }
        hasher.digest128()
    }

    /// Hash of everything that scores depend on: disparities, visibility, surfaces and kind.
    fn whole_hash(&self) -> u128 {
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        hasher.update(&self.hash().to_le_bytes());
        for row in self.visibility.iter().flat_map(Plane::rows) {
            let bytes: Vec<_> = row.iter().map(|&visibility| visibility as u8).collect();
            hasher.update(&bytes);
        }
        for row in self.surface.iter().flat_map(Plane::rows) {
            let bytes: Vec<_> = row.iter().map(|&surface| surface as u8).collect();
            hasher.update(&bytes);
        }
        hasher.update(format!("{:?}", self.kind).as_bytes());
        hasher.digest128()
    }

    /// A truth that was measured.
    pub fn measured(disparity: Plane<f32>, density: MapDensity, origin: TruthOrigin) -> Self {
        Self {
            kind: TruthKind { density, origin },
            ..Self::exact(disparity, None)
        }
    }

    /// A dense truth from a simulation or a data set.
    pub fn exact(disparity: Plane<f32>, visibility: Option<Plane<Visibility>>) -> Self {
        Self {
            disparity,
            visibility,
            surface: None,
            kind: TruthKind::default(),
        }
    }
}

/// Density of a map from a sensor, which decides how it is shrunk along with a pair, how a truth's
/// cells are scored and how many pixels make a cell of a recorded map known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MapDensity {
    /// A measurement for every pixel, with holes.
    #[default]
    Dense,
    /// Points of a sensor with another viewpoint or resolution.
    Sparse,
}

/// Origin of the true disparities. Written as `exact`, `sensor TOPIC` or `board 9x6`.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum TruthOrigin {
    /// A simulation, or the authors of a data set.
    #[default]
    Exact,
    /// Another sensor: its topic.
    Sensor(String),
    /// A printed board in view: its inner corners along both sides.
    Board(String),
}

impl TruthOrigin {
    /// Caution that belongs next to every number from this truth; `None` for an exact truth.
    pub fn caution(&self) -> Option<String> {
        match self {
            Self::Exact => None,
            Self::Sensor(topic) => Some(format!("against the sensor {topic}")),
            Self::Board(size) => Some(format!("against a board of {size} corners, on it alone")),
        }
    }
}

impl std::fmt::Display for TruthOrigin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Exact => f.write_str("exact"),
            Self::Sensor(topic) => write!(f, "sensor {topic}"),
            Self::Board(size) => write!(f, "board {size}"),
        }
    }
}

impl From<TruthOrigin> for String {
    fn from(origin: TruthOrigin) -> Self {
        origin.to_string()
    }
}

impl TryFrom<String> for TruthOrigin {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        match text.split_once(' ') {
            None if text == "exact" => Ok(Self::Exact),
            Some(("sensor", topic)) => Ok(Self::Sensor(topic.to_owned())),
            Some(("board", size)) => Ok(Self::Board(size.to_owned())),
            _ => Err(format!("'{text}' is not an origin of a truth")),
        }
    }
}

/// Visibility of a left pixel's point in the right camera, with the codes of Middlebury's
/// `mask0nocc.png`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Visibility {
    /// No truth there.
    Unknown = 0,
    /// Occluded in the right camera or outside its image.
    Occluded = 128,
    /// Seen by both.
    Visible = 255,
}

impl Visibility {
    /// From a mask's grey value; any value other than 128 and 255 is unknown.
    #[inline]
    pub fn from_code(code: u8) -> Self {
        match code {
            255 => Self::Visible,
            128 => Self::Occluded,
            _ => Self::Unknown,
        }
    }
}

/// Output of one algorithm for one frame.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The algorithm as the user wrote it, e.g. `v3` or `v3:max_disparity=64`.
    pub algorithm: String,
    pub disparity: DisparityMap,
    pub grid: DepthGrid,
    /// True if the algorithm computed the grid itself, rather than [`crate::depth::grid`].
    pub own_grid: bool,
    /// The grid before filters, if the algorithm is followed by any.
    pub unfiltered: Option<DepthGrid>,
    /// The greatest disparity searched, pixels, if known.
    pub range_px: Option<f64>,
    /// Absent if nothing was matched: a map that others computed.
    pub times: Option<StageTimes>,
}

impl Estimate {
    /// Hash of the disparities, and of the grid if it is the algorithm's own.
    pub fn hash(&self) -> u128 {
        if self.own_grid {
            self.grid.hash(self.disparity.hash())
        } else {
            self.disparity.hash()
        }
    }
}
