//! Subpixel refinement of a match: the shift that makes two patches most similar (Lucas & Kanade
//! 1981, inverse compositional).

use crate::stereo::Gray;
use nalgebra::{Matrix2, Point2, Vector2};

/// Half of a patch's side, pixels.
const REACH: usize = 7;
const SIDE: usize = 2 * REACH + 1;
const PIXELS: usize = SIDE * SIDE;
const STEPS: usize = 20;
const CLOSE_PX: f64 = 0.005;
/// Least correlation of the patches after the fit.
const MIN_CORRELATION: f64 = 0.95;

/// The position in `right`, near `near`, of the patch around `at` in `left`; `None` if the fit does
/// not converge or the patches differ.
pub(super) fn fit(
    left: &Gray,
    at: (usize, usize),
    right: &Gray,
    near: Point2<f64>,
) -> Option<Point2<f64>> {
    let (x, y) = at;
    let grey = |dx: usize, dy: usize| f64::from(left.get(x + dx - REACH, y + dy - REACH));
    if x <= REACH || y <= REACH || x + REACH + 1 >= left.width() || y + REACH + 1 >= left.height() {
        return None;
    }
    let mut patch = [0.0; PIXELS];
    let mut slopes = [Vector2::zeros(); PIXELS];
    let mut normal = Matrix2::zeros();
    for (i, (grey_here, slope)) in patch.iter_mut().zip(&mut slopes).enumerate() {
        let (dx, dy) = (i % SIDE, i / SIDE);
        *grey_here = grey(dx, dy);
        let (u, v) = (x + dx - REACH, y + dy - REACH);
        let slope_of = |after: u8, before: u8| (f64::from(after) - f64::from(before)) / 2.0;
        *slope = Vector2::new(
            slope_of(left.get(u + 1, v), left.get(u - 1, v)),
            slope_of(left.get(u, v + 1), left.get(u, v - 1)),
        );
        normal += *slope * slope.transpose();
    }
    // The gradients of the left patch are fixed, so the normal matrix is inverted once.
    let inverse = normal.try_inverse()?;
    let (mean, spread) = moments(&patch);
    let mut place = near;
    for _ in 0..STEPS {
        let seen = sample(right, place)?;
        let (seen_mean, seen_spread) = moments(&seen);
        if seen_spread == 0.0 {
            return None;
        }
        // Gain and offset of the two cameras may differ.
        let gain = spread / seen_spread;
        let mut off = Vector2::zeros();
        let mut product = 0.0;
        for ((&grey, &seen), slope) in patch.iter().zip(&seen).zip(&slopes) {
            off += *slope * ((seen - seen_mean) * gain - (grey - mean));
            product += (seen - seen_mean) * (grey - mean);
        }
        let step = inverse * off;
        place -= step;
        if step.norm() < CLOSE_PX {
            return (product / (spread * seen_spread) >= MIN_CORRELATION).then_some(place);
        }
    }
    None
}

/// Mean, and norm of the deviations from it.
fn moments(patch: &[f64; PIXELS]) -> (f64, f64) {
    let mean = patch.iter().sum::<f64>() / PIXELS as f64;
    (
        mean,
        patch
            .iter()
            .map(|grey| (grey - mean) * (grey - mean))
            .sum::<f64>()
            .sqrt(),
    )
}

/// The patch around a subpixel position, bilinear; `None` beyond the border.
fn sample(image: &Gray, place: Point2<f64>) -> Option<[f64; PIXELS]> {
    let (left, top) = (place.x - REACH as f64, place.y - REACH as f64);
    let inside = left >= 0.0 && top >= 0.0;
    let fits = |from: f64, count: usize| from + (SIDE as f64) < count as f64;
    if !(inside && fits(left, image.width()) && fits(top, image.height())) {
        return None;
    }
    let (x, y) = (left as usize, top as usize);
    let (right, below) = (left.fract(), top.fract());
    let mut patch = [0.0; PIXELS];
    for (dy, row) in patch.chunks_exact_mut(SIDE).enumerate() {
        let upper = &image.row(y + dy)[x..=x + SIDE];
        let lower = &image.row(y + dy + 1)[x..=x + SIDE];
        for (dx, out) in row.iter_mut().enumerate() {
            let along =
                |row: &[u8]| f64::from(row[dx]) * (1.0 - right) + f64::from(row[dx + 1]) * right;
            *out = along(upper) * (1.0 - below) + along(lower) * below;
        }
    }
    Some(patch)
}
