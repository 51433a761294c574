//! Renders a board as seen by a camera with lens distortion.

use crate::Board;
use nalgebra::{Isometry3, Matrix3, Point2};
use rayon::prelude::*;
use svl_core::Result;
use svl_core::stereo::{Gray, Intrinsics};

/// Samples per pixel along each side.
const SAMPLES: usize = 2;

/// Grey levels of the squares, and of the background.
const DARK: f32 = 40.0;
const BRIGHT: f32 = 200.0;
const BEHIND: f32 = 110.0;
/// Width of the white border, in squares.
const MARGIN: f32 = 0.6;

/// Directions of a camera's samples, computed once for all images: undistortion is iterative and
/// slow.
pub struct Rays {
    size: (usize, usize),
    /// `X/Z, Y/Z` of the samples, row by row.
    directions: Vec<[f32; 2]>,
}

impl Rays {
    pub fn new(camera: &Intrinsics) -> Self {
        let (width, height) = camera.size();
        let place = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
        let direction = |x, y| {
            let seen = camera.direction(Point2::new(place(x), place(y)));
            seen.map_or([f32::NAN; 2], |direction| {
                [direction.x as f32, direction.y as f32]
            })
        };
        let rows = (0..height * SAMPLES).into_par_iter();
        let directions = rows
            .flat_map_iter(|y| (0..width * SAMPLES).map(move |x| direction(x, y)))
            .collect();
        Self {
            size: (width, height),
            directions,
        }
    }

    /// Direction of a sample, and its differences to the next in its row and in its column.
    fn at(&self, column: usize, line: usize) -> [[f32; 2]; 3] {
        let (wide, high) = (self.size.0 * SAMPLES, self.size.1 * SAMPLES);
        let at = |column: usize, line: usize| self.directions[line * wide + column];
        let here = at(column, line);
        // At the border the step from the previous one; its sign does not matter.
        let next = |i: usize, count: usize| if i + 1 < count { i + 1 } else { i - 1 };
        let beside = at(next(column, wide), line);
        let below = at(column, next(line, high));
        let step = |to: [f32; 2]| [to[0] - here[0], to[1] - here[1]];
        [here, step(beside), step(below)]
    }
}

/// Image quality.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Standard deviation of the blur beyond that of the pixel size, pixels.
    pub blur_px: f64,
    /// Standard deviation of the noise, grey levels.
    pub noise: f64,
    /// Vignetting: fraction of light missing at the right edge of the image.
    pub shade: f64,
}

/// The image of a board that was at `poses` (`X_camera = pose · X_board`) for equal parts of the
/// exposure.
///
/// # Errors
/// [`svl_core::Error::Dimensions`] for an invalid image size.
pub fn render(
    rays: &Rays,
    board: &Board,
    poses: &[Isometry3<f64>],
    look: &Look,
    seed: u64,
) -> Result<Gray> {
    let (width, height) = rays.size;
    let mut light = vec![0f32; width * height];
    for pose in poses {
        let to_squares = to_squares(board, pose);
        light
            .par_chunks_exact_mut(width)
            .enumerate()
            .for_each(|(y, row)| {
                for (x, light) in row.iter_mut().enumerate() {
                    let samples = (0..SAMPLES * SAMPLES).map(|i| {
                        let (column, line) = (x * SAMPLES + i % SAMPLES, y * SAMPLES + i / SAMPLES);
                        let [here, across, down] = rays.at(column, line);
                        albedo(board, &to_squares, here, across, down)
                    });
                    *light += samples.sum::<f32>() / (SAMPLES * SAMPLES * poses.len()) as f32;
                }
            });
    }
    let light = blurred(light, width, look.blur_px);
    let mut grey = vec![0u8; width * height];
    grey.par_chunks_exact_mut(width)
        .enumerate()
        .for_each(|(y, row)| {
            // One generator per row, so that the noise does not depend on the number of threads.
            let mut random =
                fastrand::Rng::with_seed(seed ^ (y as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15));
            for (x, grey) in row.iter_mut().enumerate() {
                let shade = 1.0 - look.shade * x as f64 / width as f64;
                let value =
                    f64::from(light[y * width + x]) * shade + look.noise * gaussian(&mut random);
                *grey = (value + 0.5) as u8;
            }
        });
    Gray::from_vec(width, height, grey)
}

/// The homography from directions to the plane of the board, in squares from its first corner.
fn to_squares(board: &Board, pose: &Isometry3<f64>) -> Matrix3<f32> {
    let side = board.side();
    let rotation = pose.rotation.to_rotation_matrix();
    let along = rotation * nalgebra::Vector3::x() * side;
    let down = rotation * nalgebra::Vector3::y() * side;
    let from_squares = Matrix3::from_columns(&[along, down, pose.translation.vector]);
    // A board seen edge-on has no inverse and is invisible: NaN compares as outside.
    from_squares
        .try_inverse()
        .unwrap_or_else(|| Matrix3::from_element(f64::NAN))
        .cast()
}

/// Grey level of a sample in `direction`; `across` and `down`: differences to its neighbours.
///
/// Edges are antialiased over the width of a sample; hard ones would be accurate only to a sample.
fn albedo(
    board: &Board,
    to_squares: &Matrix3<f32>,
    direction: [f32; 2],
    across: [f32; 2],
    down: [f32; 2],
) -> f32 {
    let row = |row: usize, [x, y]: [f32; 2], one: f32| {
        to_squares[(row, 0)] * x + to_squares[(row, 1)] * y + to_squares[(row, 2)] * one
    };
    let depth = row(2, direction, 1.0);
    let i = row(0, direction, 1.0) / depth;
    let j = row(1, direction, 1.0) / depth;
    let beside = |v: f32, count: usize| (-1.0 - v).max(v - count as f32);
    let beyond = beside(i, board.columns()).max(beside(j, board.rows()));
    if !(depth > 0.0 && beyond < MARGIN) {
        return BEHIND;
    }
    if beyond > 0.0 {
        return BRIGHT;
    }
    let soft = |axis: usize, at: f32| {
        let change =
            |step: [f32; 2]| ((row(axis, step, 0.0) - at * row(2, step, 0.0)) / depth).abs();
        let nearest = at.round();
        let side = if nearest as i32 % 2 == 0 { 1.0 } else { -1.0 };
        side * (2.0 * (at - nearest) / (change(across) + change(down))).clamp(-1.0, 1.0)
    };
    // The square outside the first corner is dark.
    0.5 * (BRIGHT + DARK) - 0.5 * (BRIGHT - DARK) * soft(0, i) * soft(1, j)
}

/// The image blurred by a separable Gaussian.
fn blurred(image: Vec<f32>, width: usize, sigma: f64) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    if reach == 0 {
        return image;
    }
    let weights: Vec<_> = (-(reach as isize)..=reach as isize)
        .map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp() as f32)
        .collect();
    let height = image.len() / width;
    let mut across = vec![0.0; image.len()];
    let rows = across.par_chunks_exact_mut(width);
    rows.zip(image.par_chunks_exact(width))
        .for_each(|(means, row)| {
            let [left, right] = [row[0], row[width - 1]].map(|end| vec![end; reach]);
            let padded = [&left[..], row, &right].concat();
            weigh(means, &weights, |tap| &padded[tap..]);
        });
    let mut both = vec![0.0; image.len()];
    let rows = both.par_chunks_exact_mut(width).enumerate();
    rows.for_each(|(y, means)| {
        let line = |tap: usize| (y + tap).saturating_sub(reach).min(height - 1);
        weigh(means, &weights, |tap| &across[line(tap) * width..]);
    });
    both
}

/// The weighted means of the taps' rows, a row at a time, which the compiler vectorizes.
fn weigh<'a>(means: &mut [f32], weights: &[f32], row: impl Fn(usize) -> &'a [f32]) {
    for (tap, weight) in weights.iter().enumerate() {
        let values = means.iter_mut().zip(row(tap));
        values.for_each(|(mean, value)| *mean += weight * value);
    }
    let sum: f32 = weights.iter().sum();
    means.iter_mut().for_each(|mean| *mean /= sum);
}

/// A standard normal number, by the Box-Muller transform.
fn gaussian(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}
