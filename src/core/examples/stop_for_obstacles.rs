//! A robot that stops for obstacles: a pair in, the distance of the nearest cell out.
//!
//! `cargo run --release --example stop_for_obstacles`
//!
//! A made-up camera replaces a real one: a textured wall comes nearer by 0.2 m per pair.

use svl_core::ranger::{Ranger, RangerOptions};
use svl_core::stereo::{CellState, Gray, Rig};

const SIZE: (usize, usize) = (320, 240);

/// The pairs of the camera, each with its time, ns.
fn camera() -> impl Iterator<Item = svl_core::Result<(Gray, Gray, u64)>> {
    let texture = |x: usize, y: usize| {
        let mixed = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
        (mixed.wrapping_mul(0xC2B2_AE35) >> 24) as u8
    };
    (0..6_u32).map(move |step| {
        let distance_m = 1.5 - 0.2 * f64::from(step);
        let disparity = (328.0 * 0.044 / distance_m).round() as usize;
        // The left pixel x corresponds to the right pixel x - disparity.
        let left = Gray::from_fn(SIZE.0, SIZE.1, texture)?;
        let right = Gray::from_fn(SIZE.0, SIZE.1, |x, y| texture(x + disparity, y))?;
        Ok((left, right, 100_000_000 * u64::from(step + 1)))
    })
}

pub fn main() -> svl_core::Result<()> {
    let rig = Rig::new(328.0, (160.0, 120.0), 0.044, 0.0)?;
    let mut ranger = Ranger::open("v5:max_disparity=64", rig, &RangerOptions::default())?;
    for pair in camera() {
        let (left, right, stamp_ns) = pair?;
        let cells = ranger.cells_at(&left, &right, stamp_ns)?;
        let distances_m = cells.iter().map(|cell| match cell.state {
            CellState::Near => 0.0,
            _ => cell.distance_m.unwrap_or(f64::INFINITY),
        });
        let nearest_m = distances_m.fold(f64::INFINITY, f64::min);
        let action = if nearest_m < 0.5 { "stop" } else { "go on" };
        println!("nearest {nearest_m:.2} m: {action}");
    }
    Ok(())
}
