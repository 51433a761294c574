//! The default arena, from the thesis (chapter 7): its numbers, its objects, and the path through
//! six stations, counterclockwise from the lower right.
//!
//! The thesis gives the floor's area, the walls' height and the subject of each station, but figure
//! 7.1 has no dimensions: the positions are ours, chosen so that the subject of each station is 0.3
//! m to 0.9 m away.

use super::config::{
    ArenaConfig, Ball, Block, FloorPattern, RigConfig, RobotConfig, SensorConfig, Waypoint,
    WorldConfig,
};

impl Default for ArenaConfig {
    fn default() -> Self {
        Self {
            frames: 280,
            random: None,
            rate_hz: 10.0,
            rig: RigConfig::default(),
            sensor: SensorConfig::default(),
            robot: RobotConfig::default(),
            world: WorldConfig::default(),
            pieces_m: Vec::new(),
        }
    }
}

impl Default for RigConfig {
    fn default() -> Self {
        Self {
            width_px: 320,
            height_px: 240,
            field_of_view_deg: 52.0,
            baseline_m: 0.044,
            above_floor_m: 0.07,
            right_row_offset_px: 0.25,
            right_roll_deg: 0.05,
        }
    }
}

impl Default for SensorConfig {
    fn default() -> Self {
        Self {
            shutter_us: 8_000,
            gain_db: 0.0,
            right_gain_db: 0.15,
            white_e_per_ms: 1_700.0,
            full_scale_e: 9_000.0,
            read_noise_e: 25.0,
            noise: true,
            vignetting: 0.25,
            lens_blur_px: 0.5,
            aperture_mm: 1.9,
            focus_m: 0.7,
        }
    }
}

impl Default for RobotConfig {
    fn default() -> Self {
        Self {
            half_width_m: 0.04,
            sway_hz: 0.6,
            yaw_sway_deg: 2.0,
            roll_sway_deg: 1.5,
            pitch_sway_deg: 0.7,
            deviation_m: 0.01,
            path: path(),
        }
    }
}

impl Default for WorldConfig {
    fn default() -> Self {
        Self {
            width_m: 2.0,
            length_m: 3.0,
            wall_height_m: 0.2,
            room_margin_m: 2.5,
            forest_contrast: 1.0,
            floor_patterns: vec![FloorPattern::Linoleum],
            floor_contrast: 0.02,
            blocks: blocks(),
            balls: balls(),
        }
    }
}

fn blocks() -> Vec<Block> {
    let block = |name: &str, at_m, size_m| Block {
        name: name.into(),
        at_m,
        size_m,
        above_floor_m: 0.0,
        heading_deg: 0.0,
    };
    vec![
        block("opening left", [1.295, 1.175], [0.41, 0.15, 0.2]),
        block("opening right", [1.8325, 1.175], [0.335, 0.15, 0.2]),
        block("close block", [1.66, 1.865], [0.68, 0.17, 0.2]),
        Block {
            heading_deg: -36.87,
            ..block("slanted wall", [0.394, 0.292], [1.0, 0.02, 0.2])
        },
        block("bridge right pillar", [1.31, 0.325], [0.12, 0.18, 0.14]),
        block("bridge left pillar", [1.31, 0.705], [0.12, 0.18, 0.14]),
        Block {
            above_floor_m: 0.14,
            ..block("bridge deck", [1.31, 0.515], [0.12, 0.56, 0.08])
        },
    ]
}

fn balls() -> Vec<Ball> {
    vec![Ball {
        name: "ball".into(),
        at_m: [0.964, 2.41],
        radius_m: 0.06,
        height_m: 0.06,
    }]
}

fn path() -> Vec<Waypoint> {
    let way = [
        (1.60, 0.30, 90.0),
        (1.60, 1.15, 90.0),
        (1.525, 1.395, 120.0),
        (1.485, 1.465, 120.0),
        (1.25, 1.72, 130.0),
        (1.115, 1.925, 105.0),
        (1.085, 2.035, 105.0),
        (0.80, 2.23, 135.0),
        (0.71, 2.32, 135.0),
        (0.49, 2.40, 180.0),
        (0.20, 2.08, 265.0),
        (0.33, 1.50, 275.0),
        (0.33, 1.12, 270.0),
        (0.33, 0.90, 270.0),
        (0.70, 0.50, 360.0),
        (1.62, 0.50, 360.0),
    ];
    way.into_iter()
        .map(|(x, y, heading_deg)| Waypoint {
            at_m: [x, y],
            heading_deg,
        })
        .collect()
}
