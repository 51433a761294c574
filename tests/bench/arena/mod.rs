//! The simulated arena: its truth against closed forms, its images against its truth, its
//! checkpoints against both.

mod areas;
mod config;
mod lenses;
mod perturbed;
mod pictures;
mod scenario;
mod sparse;
mod truth;
mod v5;

use nalgebra::Vector3;
use svl::arena::{ArenaConfig, Ball, Waypoint};
use svl::stereo::{Frame, Pose, Rig};

/// Only floor, walls and room; a straight, steady path from (1, 0.5) to (1, 1.5).
fn empty() -> ArenaConfig {
    let mut config = ArenaConfig {
        frames: 11,
        ..ArenaConfig::default()
    };
    config.world.blocks.clear();
    config.world.balls.clear();
    let point = |y: f64| Waypoint {
        at_m: [1.0, y],
        heading_deg: 90.0,
    };
    config.robot.path = vec![point(0.5), point(1.5)];
    (config.robot.deviation_m, config.robot.yaw_sway_deg) = (0.0, 0.0);
    (config.robot.roll_sway_deg, config.robot.pitch_sway_deg) = (0.0, 0.0);
    config
}

/// `empty` without noise and with equal, aligned cameras.
fn clean() -> ArenaConfig {
    let mut config = empty();
    config.sensor.noise = false;
    config.sensor.right_gain_db = 0.0;
    (config.rig.right_row_offset_px, config.rig.right_roll_deg) = (0.0, 0.0);
    config
}

fn ball() -> Ball {
    Ball {
        name: "ball".into(),
        at_m: [1.02, 1.2],
        radius_m: 0.08,
        height_m: 0.09,
    }
}

/// Direction of a left pixel in the world, of depth 1.
fn ray(rig: &Rig, pose: &Pose, x: usize, y: usize) -> Vector3<f64> {
    let (cx, cy) = rig.center_px();
    pose.rotation
        * Vector3::new(
            (x as f64 - cx) / rig.focal_px(),
            (y as f64 - cy) / rig.focal_px(),
            1.0,
        )
}

/// Depth and world point at the left pixel (`x`, `y`), from the truth.
fn seen(frame: &Frame, x: usize, y: usize) -> (f64, Vector3<f64>) {
    let (rig, pose) = (frame.rig().unwrap(), frame.pose.unwrap());
    let disparity = frame.truth.as_ref().unwrap().disparity.get(x, y);
    let depth = rig.depth_m(f64::from(disparity)).unwrap();
    (
        depth,
        pose.translation.vector + ray(rig, &pose, x, y) * depth,
    )
}
