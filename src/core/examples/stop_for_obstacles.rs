//! A robot that stops for obstacles: a pair in, the distance of the nearest cell out.
//!
//! `cargo run --release --example stop_for_obstacles`
//!
//! A simulated camera replaces a real one: a textured wall approaches by 0.2 m per pair.

use svl_core::depth::GridSettings;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput};
use svl_core::stereo::{Gray, RectifiedPair, Rig, StereoPair};

const SIZE: (usize, usize) = (320, 240);
/// Below this distance, in metres, the robot stops.
const STOP_M: f64 = 0.5;

/// A pair that shows a wall at `distance_m`, parallel to the image plane.
fn pair(rig: &Rig, distance_m: f64) -> svl_core::Result<StereoPair> {
    let disparity = (rig.focal_px() * rig.baseline_m() / distance_m).round() as usize;
    let texture = |x: usize, y: usize| {
        let mixed = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
        (mixed.wrapping_mul(0xC2B2_AE35) >> 24) as u8
    };
    // The left pixel x corresponds to the right pixel x - disparity.
    let left = Gray::from_fn(SIZE.0, SIZE.1, texture)?;
    let right = Gray::from_fn(SIZE.0, SIZE.1, |x, y| texture(x + disparity, y))?;
    StereoPair::new(left, right)
}

fn main() -> svl_core::Result<()> {
    // Focal length and principal point in pixels, baseline in metres, offset of the principal
    // points in pixels. Package svl-calibrate reads them from a calibration file.
    let rig = Rig::new(328.0, (160.0, 120.0), 0.044, 0.0)?;
    let mut matcher = Algorithm::default().build()?;
    let mut output = MatchOutput::new()?;
    for step in 0..6 {
        let pair = pair(&rig, 1.5 - 0.2 * step as f64)?;
        output.begin();
        // The stamp says which pairs follow each other: v5 uses the cells of earlier ones.
        let context = MatchContext {
            sequence: step,
            stamp_ns: Some(100_000_000 * step),
            rig: Some(rig),
            ..MatchContext::default()
        };
        // No allocation after the first pair.
        matcher.compute(RectifiedPair::assume(&pair), &context, &mut output)?;
        // Algorithms that decide on no cells get the median of each.
        output.decide(GridSettings::default(), Some(&rig));
        let cells = output.grid.iter().flat_map(|grid| grid.iter());
        let nearest_m = cells.fold(f64::INFINITY, |nearest_m, (_, cell)| {
            // Something near that has no distance.
            let flagged_m = cell.near.map(|_| STOP_M / 2.0);
            let distance_m = cell.depth.and_then(|depth| depth.distance_m).or(flagged_m);
            nearest_m.min(distance_m.unwrap_or(f64::INFINITY))
        });
        let action = if nearest_m < STOP_M { "stop" } else { "go on" };
        println!("nearest cell {nearest_m:.2} m: {action}");
    }
    Ok(())
}
