//! A right camera whose pose differs from the calibration.

use super::chance::{Chance, grey};
use svl_core::stereo::Gray;

pub(super) fn row_offset([_, right]: &mut [Gray; 2], rows: f64, _: &mut Chance) {
    *right = resampled(right, |x, y| (x, y - rows as f32));
}

pub(super) fn roll([_, right]: &mut [Gray; 2], degrees: f64, _: &mut Chance) {
    let (width, height) = right.size();
    let (cx, cy) = (0.5 * (width - 1) as f32, 0.5 * (height - 1) as f32);
    let (sin, cos) = (degrees.to_radians() as f32).sin_cos();
    *right = resampled(right, |x, y| {
        let (dx, dy) = (x - cx, y - cy);
        (cx + cos * dx + sin * dy, cy + cos * dy - sin * dx)
    });
}

/// The image resampled: each pixel has the grey value at `from(x, y)`, bilinear, border replicated.
fn resampled(image: &Gray, from: impl Fn(f32, f32) -> (f32, f32)) -> Gray {
    let (width, height) = image.size();
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    let mut moved = image.clone();
    for y in 0..height {
        for (x, pixel) in moved.row_mut(y).iter_mut().enumerate() {
            let (u, v) = from(x as f32, y as f32);
            let (u, v) = (u.clamp(0.0, right), v.clamp(0.0, bottom));
            let (x0, y0) = (u as usize, v as usize);
            let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
            let (fu, fv) = (u - x0 as f32, v - y0 as f32);
            let at = |x: usize, y: usize| f32::from(image.get(x, y));
            let low = at(x0, y0) + fu * (at(x1, y0) - at(x0, y0));
            let high = at(x0, y1) + fu * (at(x1, y1) - at(x0, y1));
            *pixel = grey(low + fv * (high - low));
        }
    }
    moved
}
