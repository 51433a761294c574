//! The ground as a plane of disparities.
//!
//! Its line in the v-disparity image (Labayrade, Aubert and Tarel, "Real Time Obstacle Detection in
//! Stereovision on Non Flat Road Geometry through V-disparity Representation", IV 2002) is the one
//! that most disparities of the middle columns lie on. A plane is then fitted to all columns, as
//! a head that rolls sees the ground slanted.

use crate::stereo::Plane;
use nalgebra::{Matrix3, Vector3};

/// Disparities of the ground: `base_px + per_column · x + per_row · y`, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPlane {
    pub base_px: f32,
    pub per_column: f32,
    pub per_row: f32,
}

/// Range of the horizon, fractions of the height, and the number of horizons tried.
const HORIZON: (f32, f32) = (-0.1, 0.8);
const HORIZONS: usize = 46;
/// Disparities of the bottom row that are tried, pixels: up to the first limit, or to the greatest
/// measured one below the second.
const BOTTOM_PX: usize = 4;
const MAX_BOTTOM_PX: (usize, usize) = (256, 2048);
/// A line exists if this fraction of the disparities below its horizon, in the lower half of the
/// image, lies on it.
const MIN_ON_LINE: f32 = 0.2;
/// Distances from the plane of the disparities that it is fitted to, pixels, step by step.
const FIT_PX: [f32; 4] = [3.0, 3.0, 2.0, 1.5];
/// The fewest measurements of a plane.
const MIN_FITTED: usize = 50;

impl GroundPlane {
    /// The ground of a plane of measured disparities, infinite where there is none.
    pub(super) fn fit(measured: &Plane<f32>) -> Option<Self> {
        let (width, height) = measured.size();
        let mut plane = line(measured)?;
        for (step, limit_px) in FIT_PX.into_iter().enumerate() {
            // The line is that of the middle columns: a rolling head is seen from there outwards.
            let columns = match step {
                0 => width / 4..(3 * width).div_ceil(4),
                _ => 0..width,
            };
            let (mut normal, mut right, mut count) = (Matrix3::zeros(), Vector3::zeros(), 0);
            for y in 0..height {
                for x in columns.clone() {
                    let (d, expected) = (measured.get(x, y), plane.at(x as f32, y as f32));
                    if expected > 0.0 && (d - expected).abs() < limit_px {
                        let at = Vector3::new(1.0, x as f64, y as f64);
                        normal += at * at.transpose();
                        right += at * f64::from(d);
                        count += 1;
                    }
                }
            }
            if count < MIN_FITTED {
                return None;
            }
            let fitted = normal.cholesky()?.solve(&right);
            plane = Self {
                base_px: fitted.x as f32,
                per_column: fitted.y as f32,
                per_row: fitted.z as f32,
            };
        }
        // It comes nearer towards the robot, and its horizon is still about where it was tried: a
        // wall in front of the robot has none.
        let horizon = -plane.at(0.5 * (width - 1) as f32, 0.0) / plane.per_row;
        let last = (height - 1) as f32;
        let is_seen = horizon > 2.0 * HORIZON.0 * last && horizon < last;
        (plane.per_row > 0.0 && is_seen).then_some(plane)
    }

    /// The disparity at a pixel; 0 and below is above the horizon.
    pub fn at(&self, x: f32, y: f32) -> f32 {
        self.base_px + self.per_column * x + self.per_row * y
    }

    /// The same plane at the pixels of an image, from that of its blocks of `block` pixels.
    pub(super) fn for_pixels(self, block: (usize, usize)) -> Self {
        let [per_column, per_row] = [
            self.per_column / block.0 as f32,
            self.per_row / block.1 as f32,
        ];
        // The middle of the first block is at this pixel.
        let [x, y] = [block.0, block.1].map(|side| 0.5 * (side - 1) as f32);
        Self {
            base_px: self.base_px - per_column * x - per_row * y,
            per_column,
            per_row,
        }
    }
}

/// The line of the v-disparity image with the most disparities, as a plane.
fn line(measured: &Plane<f32>) -> Option<GroundPlane> {
    let (width, height) = measured.size();
    let greatest = measured
        .pixels()
        .filter(|d| d.is_finite())
        .fold(0.0, f32::max);
    let most = (greatest as usize).clamp(MAX_BOTTOM_PX.0, MAX_BOTTOM_PX.1);
    let bins = most + 2;
    let mut counts = vec![0_u32; height * bins];
    let mut below = vec![0_u32; height + 1];
    for y in 0..height {
        let row = &measured.row(y)[width / 4..(3 * width).div_ceil(4)];
        for &d in row.iter().filter(|d| d.is_finite() && **d >= 0.0) {
            let bin = d.round() as usize;
            if bin + 1 < bins {
                // Within a pixel and a half of the line.
                for near in bin.saturating_sub(1)..=bin + 1 {
                    counts[y * bins + near] += 1;
                }
            }
        }
        below[y] = row.iter().filter(|d| d.is_finite()).count() as u32;
    }
    // Number of measurements from a row to the bottom.
    for y in (0..height).rev() {
        below[y] += below[y + 1];
    }
    let last = (height - 1) as f32;
    let mut best: Option<(u32, f32, f32)> = None;
    for i in 0..HORIZONS {
        let share = i as f32 / (HORIZONS - 1) as f32;
        let horizon = last * (HORIZON.0 + share * (HORIZON.1 - HORIZON.0));
        // A wall above the middle is no ground.
        let first = ((horizon + 1.0) as usize).max(height / 2);
        let least = MIN_ON_LINE * below[first] as f32;
        for bottom in BOTTOM_PX..=most {
            let per_row = bottom as f32 / (last - horizon);
            let on_line = (first..height).map(|y| {
                let bin = (per_row * (y as f32 - horizon)).round() as usize;
                counts[y * bins + bin.min(bins - 1)]
            });
            let votes = on_line.sum::<u32>();
            let is_better = best.is_none_or(|(most, ..)| votes > most);
            if is_better && votes > 0 && votes as f32 >= least {
                best = Some((votes, horizon, per_row));
            }
        }
    }
    best.map(|(_, horizon, per_row)| GroundPlane {
        base_px: -per_row * horizon,
        per_column: 0.0,
        per_row,
    })
}
