//! Agreement of disparity maps: left with right, and of several algorithms.

use svl_core::stereo::{Gray, Plane};

/// Largest difference between the left and the right disparity of a point, and between those of two
/// references, pixels.
const CONSISTENT_PX: f32 = 1.0;
/// A pixel is textured if the squared horizontal gradient, averaged over 3x3 pixels, is at least
/// this: the default of Scharstein and Szeliski (A taxonomy and evaluation of dense two-frame
/// stereo correspondence algorithms, IJCV 2002, section 5.1).
const TEXTURED: u32 = 4;

/// The left disparities confirmed by the right ones.
pub fn consistent(left: &Plane<f32>, right: &Plane<f32>) -> Plane<f32> {
    let mut sure = left.clone();
    for y in 0..left.height() {
        let right = right.row(y);
        for (x, d) in sure.row_mut(y).iter_mut().enumerate() {
            let at = x as f32 - d.round();
            // False for an infinite disparity.
            let inside = at >= 0.0 && at < right.len() as f32;
            let confirmed = inside && (right[at as usize] - *d).abs() <= CONSISTENT_PX;
            if !confirmed {
                *d = f32::INFINITY;
            }
        }
    }
    sure
}

/// The disparities of the first that the second confirms.
pub fn both(first: &Plane<f32>, second: &Plane<f32>) -> Plane<f32> {
    let mut both = first.clone();
    for y in 0..first.height() {
        let pixels = both.row_mut(y).iter_mut().zip(second.row(y));
        for (d, other) in pixels {
            // Infinity minus infinity is NaN, which confirms nothing.
            let confirmed = (*d - other).abs() <= CONSISTENT_PX;
            if !confirmed {
                *d = f32::INFINITY;
            }
        }
    }
    both
}

/// The disparities of textured pixels.
pub fn textured(image: &Gray, mut disparity: Plane<f32>) -> Plane<f32> {
    let (width, height) = image.size();
    let squared = |x: usize, y: usize| {
        let difference = image
            .get((x + 1).min(width - 1), y)
            .abs_diff(image.get(x, y));
        u32::from(difference).pow(2)
    };
    for y in 0..height {
        for x in 0..width {
            let (columns, rows) = (
                x.max(1) - 1..=(x + 1).min(width - 1),
                y.max(1) - 1..=(y + 1).min(height - 1),
            );
            let (mut sum, mut count) = (0, 0);
            for v in rows {
                for u in columns.clone() {
                    sum += squared(u, v);
                    count += 1;
                }
            }
            if sum < TEXTURED * count {
                disparity.set(x, y, f32::INFINITY);
            }
        }
    }
    disparity
}
