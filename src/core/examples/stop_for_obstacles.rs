//! A robot that stops for obstacles: a pair in, the distance of the nearest cell out.
//!
//! `cargo run --release --example stop_for_obstacles`
//!
//! A simulated camera replaces a real one: a textured wall approaches by 0.2 m per pair.

use svl_core::ranger::{Ranger, RangerOptions};
use svl_core::stereo::{CellState, Gray, Rig};

const SIZE: (usize, usize) = (320, 240);
/// Below this distance, in metres, the robot stops.
const STOP_M: f64 = 0.5;

/// A pair that shows a wall at `distance_m`, parallel to the image plane.
fn pair(rig: &Rig, distance_m: f64) -> svl_core::Result<[Gray; 2]> {
    let disparity = (rig.focal_px() * rig.baseline_m() / distance_m).round() as usize;
    let texture = |x: usize, y: usize| {
        let mixed = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
        (mixed.wrapping_mul(0xC2B2_AE35) >> 24) as u8
    };
    // The left pixel x corresponds to the right pixel x - disparity.
    let left = Gray::from_fn(SIZE.0, SIZE.1, texture)?;
    let right = Gray::from_fn(SIZE.0, SIZE.1, |x, y| texture(x + disparity, y))?;
    Ok([left, right])
}

fn main() -> svl_core::Result<()> {
    // Focal length and principal point in pixels, baseline in metres, offset of the principal
    // points in pixels. Package svl-calibrate reads a calibration of raw images from its file.
    let rig = Rig::new(328.0, (160.0, 120.0), 0.044, 0.0)?;
    let mut ranger = Ranger::open("v5:max_disparity=64", rig, &RangerOptions::default())?;
    for step in 0..6 {
        let [left, right] = pair(&rig, 1.5 - 0.2 * step as f64)?;
        // The stamp says which pairs follow each other: v5 uses the cells of earlier ones.
        let cells = ranger.cells_at(&left, &right, 100_000_000 * step)?;
        let distances_m = cells.iter().map(|cell| match cell.state {
            // Something is nearer than 0.5 m, and has no distance.
            CellState::Near => 0.0,
            _ => cell.distance_m.unwrap_or(f64::INFINITY),
        });
        let nearest_m = distances_m.fold(f64::INFINITY, f64::min);
        let action = if nearest_m < STOP_M { "stop" } else { "go on" };
        println!("nearest cell {nearest_m:.2} m: {action}");
    }
    Ok(())
}
