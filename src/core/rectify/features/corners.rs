//! Corner detection by the smaller eigenvalue of the structure tensor (Shi & Tomasi, Good features
//! to track, 1994).

use crate::stereo::Gray;

/// Half of the window over which the tensor is summed.
const REACH: usize = 3;
/// Least distance of a corner from the border, so that its patch is inside the image.
pub(super) const MARGIN: usize = 10;
/// Least RMS gradient in the weaker direction, grey levels per pixel: above camera noise.
const MIN_GRADIENT: f64 = 3.0;
/// Corners kept per cell of the image: the strongest.
const PER_CELL: usize = 2;

/// About `count` corners, spread over the image, as (x, y).
pub(super) fn corners(image: &Gray, count: usize) -> Vec<(usize, usize)> {
    let (width, height) = image.size();
    if width <= 2 * MARGIN || height <= 2 * MARGIN {
        return Vec::new();
    }
    let strengths = strengths(image);
    let strength = |x: usize, y: usize| strengths[y * width + x];
    // Cells sized so that `PER_CELL` corners in each give about `count` in all.
    let cell = (((width * height * PER_CELL) as f64 / count as f64)
        .sqrt()
        .ceil() as usize)
        .max(4);
    let mut found = Vec::new();
    let mut best = Vec::new();
    for top in (MARGIN..height - MARGIN).step_by(cell) {
        for left in (MARGIN..width - MARGIN).step_by(cell) {
            best.clear();
            for y in top..(top + cell).min(height - MARGIN) {
                for x in left..(left + cell).min(width - MARGIN) {
                    let own = strength(x, y);
                    if own < MIN_GRADIENT as f32 {
                        continue;
                    }
                    let around = (y - 2..=y + 2).flat_map(|v| (x - 2..=x + 2).map(move |u| (u, v)));
                    // Among equal neighbours the first in raster order.
                    let is_peak = |(u, v): (usize, usize)| {
                        let other = strength(u, v);
                        own > other || own == other && (v, u) >= (y, x)
                    };
                    if around.into_iter().all(is_peak) {
                        best.push((own, x, y));
                    }
                }
            }
            best.sort_by(|a, b| b.0.total_cmp(&a.0));
            found.extend(best.iter().take(PER_CELL).map(|&(_, x, y)| (x, y)));
        }
    }
    found
}

/// RMS gradient in its weaker direction, grey levels per pixel: the root of the tensor's smaller
/// eigenvalue. 0 near the border.
fn strengths(image: &Gray) -> Vec<f32> {
    let (width, height) = image.size();
    let mut strengths = vec![0.0; width * height];
    // Box filter by column sums that slide down: per column xx, xy, yy of the gradient over the
    // rows of the window. Central differences, so gradients are twice the grey levels per pixel.
    let mut columns = vec![[0i32; 3]; width];
    let add = |columns: &mut [[i32; 3]], y: usize, sign: i32| {
        let (above, row, below) = (image.row(y - 1), image.row(y), image.row(y + 1));
        for x in 1..width - 1 {
            let gx = i32::from(row[x + 1]) - i32::from(row[x - 1]);
            let gy = i32::from(below[x]) - i32::from(above[x]);
            for (sum, product) in columns[x].iter_mut().zip([gx * gx, gx * gy, gy * gy]) {
                *sum += sign * product;
            }
        }
    };
    (1..2 * REACH + 1).for_each(|y| add(&mut columns, y, 1));
    let pixels = ((2 * REACH + 1) * (2 * REACH + 1)) as f32;
    for y in REACH + 1..height - REACH - 1 {
        add(&mut columns, y + REACH, 1);
        let mut window = [0i32; 3];
        let slide = |window: &mut [i32; 3], x: usize, sign: i32| {
            window
                .iter_mut()
                .zip(columns[x])
                .for_each(|(sum, column)| *sum += sign * column);
        };
        (1..2 * REACH + 1).for_each(|x| slide(&mut window, x, 1));
        for x in REACH + 1..width - REACH - 1 {
            slide(&mut window, x + REACH, 1);
            let [xx, xy, yy] = window.map(|sum| sum as f32 / (4.0 * pixels));
            // Smaller eigenvalue of the symmetric 2x2 tensor, in closed form.
            let least = (xx + yy) / 2.0 - (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt();
            strengths[y * width + x] = least.max(0.0).sqrt();
            slide(&mut window, x - REACH, -1);
        }
        add(&mut columns, y - REACH, -1);
    }
    strengths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_where_edges_meet() {
        let square = |x: usize, y: usize| {
            if (40..80).contains(&x) && (30..60).contains(&y) {
                200
            } else {
                50
            }
        };
        let found = corners(&Gray::from_fn(120, 90, square).unwrap(), 1000);
        assert_eq!(found.len(), 4, "{found:?}");
        for (x, y) in [(40usize, 30usize), (80, 30), (40, 60), (80, 60)] {
            assert!(
                found
                    .iter()
                    .any(|&(u, v)| x.abs_diff(u) <= REACH && y.abs_diff(v) <= REACH),
                "{found:?}"
            );
        }
    }
}
