//! The arena's configuration: a scenario's `[arena]` table.

use serde::{Deserialize, Serialize};

/// An arena, its robot and the robot's cameras. The default is the thesis's (chapter 7).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArenaConfig {
    /// Pairs in one run, evenly spread over the robot's path.
    pub frames: u64,
    /// Scenes drawn by each seed, of which this table has only `frames`, `rate_hz`,
    /// `rig.width_px` and `rig.height_px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub random: Option<RandomScenes>,
    /// Pairs per second. Path length x rate / frames is the robot's speed, hence the motion blur.
    pub rate_hz: f64,
    pub rig: RigConfig,
    pub sensor: SensorConfig,
    pub robot: RobotConfig,
    pub world: WorldConfig,
    /// Width and height of test pieces, of which each seed places one: `[piece]` of a scenario.
    #[serde(skip_deserializing, skip_serializing_if = "Vec::is_empty")]
    pub pieces_m: Vec<[f64; 2]>,
}

/// Scenes other than the thesis's, drawn by a run's seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RandomScenes {
    /// A room with objects, a head and a path through it.
    Worlds,
    /// Layers of shapes, new ones in every frame; the head does not move.
    Shapes,
    /// Boards of squares, 0.2 to 1 m away, in front of a wall; as shapes in all else.
    Boards,
}

impl RandomScenes {
    /// True for scenes that are new in every frame, without a world that the head is in.
    pub fn are_layers(self) -> bool {
        matches!(self, Self::Shapes | Self::Boards)
    }
}

/// The stereo head (thesis, sections 6.1 and 6.2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigConfig {
    pub width_px: usize,
    pub height_px: usize,
    /// Angle of view across the width.
    pub field_of_view_deg: f64,
    pub baseline_m: f64,
    /// Height of both cameras above the floor.
    pub above_floor_m: f64,
    /// Residual misalignment after rectification: the right image is this much too low
    pub right_row_offset_px: f64,
    /// and is rotated clockwise by this much about its centre. The truth ignores both.
    pub right_roll_deg: f64,
}

/// The cameras: approximately two Firefly MV with 3.8 mm lenses (thesis, section 6.2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    pub shutter_us: u32,
    pub gain_db: f64,
    /// Excess gain of the right camera.
    pub right_gain_db: f64,
    /// Photoelectrons per millisecond from a white surface that faces the light.
    pub white_e_per_ms: f64,
    /// Photoelectrons that give 255 at 0 dB.
    pub full_scale_e: f64,
    /// Standard deviation of the read noise.
    pub read_noise_e: f64,
    /// False turns shot and read noise off.
    pub noise: bool,
    /// Fraction of light missing in the image's corners.
    pub vignetting: f64,
    /// Standard deviation of the lens's blur at focus, at most 0.7.
    pub lens_blur_px: f64,
    /// Diameter of the lens's pupil; 0 is a pinhole, sharp at every distance.
    pub aperture_mm: f64,
    /// Distance at which the lens is in focus.
    pub focus_m: f64,
}

/// Motion of the robot. All runs follow one path to within `deviation_m`; the seed sets the phases
/// of the gait.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotConfig {
    /// Half the width of the robot: it keeps at least this distance from everything.
    pub half_width_m: f64,
    /// The gait's frequency. Yaw and roll follow it, pitch twice that.
    pub sway_hz: f64,
    /// Amplitudes of the gait.
    pub yaw_sway_deg: f64,
    pub roll_sway_deg: f64,
    pub pitch_sway_deg: f64,
    /// Largest sideways deviation from the path.
    pub deviation_m: f64,
    /// Points that the centre of the stereo head passes, in order.
    pub path: Vec<Waypoint>,
}

/// A point of the path and the direction of travel there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    pub at_m: [f64; 2],
    /// `atan2(y, x)` of the direction of travel.
    pub heading_deg: f64,
}

/// A rectangular floor with walls around it, from the origin to (`width_m`, `length_m`), and the
/// objects on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorldConfig {
    /// Extent along x.
    pub width_m: f64,
    /// Extent along y.
    pub length_m: f64,
    pub wall_height_m: f64,
    /// Distance from the arena's walls to those of the laboratory, which are seen above them.
    pub room_margin_m: f64,
    /// Contrast of the forest pictures, 1 as printed.
    pub forest_contrast: f64,
    /// Patterns of the floor; the seed chooses one of them and all its dimensions.
    pub floor_patterns: Vec<FloorPattern>,
    /// Standard deviation of the albedo of linoleum's speckles; other patterns have their own.
    pub floor_contrast: f64,
    pub blocks: Vec<Block>,
    pub balls: Vec<Ball>,
}

/// Covering of a floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FloorPattern {
    /// Grey, speckled, with scuffs: that of the thesis, nearly without texture.
    Linoleum,
    /// Grains of several sizes, like concrete or asphalt.
    Noise,
    /// Square tiles with joints.
    Tiles,
    /// A weave of loops.
    Carpet,
    /// Boards of wood with grain and joints.
    Planks,
}

/// A box with vertical sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    pub name: String,
    /// Centre of its base.
    pub at_m: [f64; 2],
    /// Length, width and height.
    pub size_m: [f64; 3],
    /// Height of its base above the floor.
    #[serde(default)]
    pub above_floor_m: f64,
    /// Direction of its length, `atan2(y, x)`.
    #[serde(default)]
    pub heading_deg: f64,
}

/// A sphere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ball {
    pub name: String,
    pub at_m: [f64; 2],
    pub radius_m: f64,
    /// Height of its centre; on the floor if it equals the radius.
    pub height_m: f64,
}
