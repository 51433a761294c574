//! Subpixel position of a corner.
//!
//! Least squares fit of two crossing soft edges to all pixels around it,
//! `I(d) = b + g·d + a tanh(s1/w1) tanh(s2/w2)`, with `s` the distances from the edges. This is the
//! maximum likelihood estimate in white noise, and the widths `w` measure the blur across each
//! edge.

use super::candidate::CornerCandidate;
use nalgebra::{Point2, SMatrix, SVector, Vector2};
use svl_core::stereo::Gray;

/// A corner after the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fitted {
    pub corner: CornerCandidate,
    /// Half the difference between dark and bright, grey levels.
    pub contrast: f64,
    /// RMS residual of the fit, grey levels.
    pub residual: f64,
    /// Standard deviation of the blur across the blurrier of the two edges, pixels.
    pub blur_px: f64,
}

/// Position (2), angles (2), logarithms of the widths (2), then the linear ones: b, g (2), a.
const UNKNOWNS: usize = 10;
type Unknowns = SVector<f64, UNKNOWNS>;

/// At least the size of a square, and small enough that distortion bends no edge within it.
const RADIUS_PX: std::ops::RangeInclusive<f64> = 2.5..=9.0;
const STEPS: usize = 20;
const CLOSE_PX: f64 = 1e-4;
/// Standard deviation, in units of w, of the Gaussian blur whose edge is as steep as tanh(s/w).
const GAUSS: f64 = 0.80;
const WIDTH_PX: std::ops::RangeInclusive<f64> = 0.3..=8.0;

/// Fits the corner near `start`, in a circle clear of the next edges, which are `clearance_px`
/// away. `None` if the circle leaves the image, or there is no corner.
pub(super) fn refine(image: &Gray, start: &CornerCandidate, clearance_px: f64) -> Option<Fitted> {
    let radius = (0.85 * clearance_px - 1.0).clamp(*RADIUS_PX.start(), *RADIUS_PX.end());
    let fitted = fit(image, start, radius)?;
    // The circle is centred on a pixel near the start; it is recentred on a corner that moved far.
    let moved_far = (fitted.corner.at - start.at).amax() > 0.6;
    if moved_far {
        fit(image, &fitted.corner, radius)
    } else {
        Some(fitted)
    }
}

fn fit(image: &Gray, start: &CornerCandidate, radius: f64) -> Option<Fitted> {
    let centre = Point2::new(start.at.x.round(), start.at.y.round());
    let pixels = circle(image, centre, radius)?;
    let angle = |axis: &Vector2<f64>| axis.y.atan2(axis.x);
    let mean = pixels.iter().map(|p| p.value).sum::<f64>() / pixels.len() as f64;
    let spread = pixels.iter().map(|p| (p.value - mean).powi(2)).sum::<f64>() / pixels.len() as f64;
    let from = start.at - centre;
    let mut x = Unknowns::zeros();
    let [first, second] = start.axes.map(|axis| angle(&axis));
    // Widths start at one pixel (ln w = 0), the contrast at the standard deviation of the patch.
    x.as_mut_slice().copy_from_slice(&[
        from.x,
        from.y,
        first,
        second,
        0.0,
        0.0,
        mean,
        0.0,
        0.0,
        spread.sqrt(),
    ]);

    let (mut normal, mut cost) = equations(&pixels, &x);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let (mut matrix, gradient) = normal;
        (0..UNKNOWNS).for_each(|i| matrix[(i, i)] *= 1.0 + damping);
        let step = matrix.cholesky()?.solve(&gradient);
        let mut next = x + step;
        // Without bounds a perfectly sharp or an empty patch drives the widths to 0 or infinity.
        (4..6).for_each(|i| next[i] = next[i].clamp(WIDTH_PX.start().ln(), WIDTH_PX.end().ln()));
        let (next_normal, next_cost) = equations(&pixels, &next);
        if next_cost <= cost {
            (x, normal, cost, damping) = (next, next_normal, next_cost, damping * 0.2);
            if step.fixed_rows::<2>(0).norm() < CLOSE_PX {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    let moved = (Vector2::new(x[0], x[1]) - from).norm();
    let axes = [x[2], x[3]].map(|angle| Vector2::new(angle.cos(), angle.sin()));
    let crossing = axes[0].perp(&axes[1]).abs();
    // NaN fails too.
    let there =
        moved < 0.5 * radius && x[9] > 1.0 && crossing > 0.2 && x.iter().all(|v| v.is_finite());
    there.then(|| Fitted {
        corner: CornerCandidate {
            at: centre + Vector2::new(x[0], x[1]),
            axes,
        },
        contrast: x[9],
        residual: (cost / pixels.len() as f64).sqrt(),
        blur_px: GAUSS * x[4].max(x[5]).exp(),
    })
}

struct Pixel {
    /// Relative to the centre of the circle.
    at: Vector2<f64>,
    value: f64,
}

fn circle(image: &Gray, centre: Point2<f64>, radius: f64) -> Option<Vec<Pixel>> {
    let reach = radius.floor() as isize;
    let (cx, cy) = (centre.x as isize, centre.y as isize);
    let inside = |c: isize, side: usize| c >= reach && c + reach < side as isize;
    if !(inside(cx, image.width()) && inside(cy, image.height())) {
        return None;
    }
    let square = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
    let round = square.filter(|&(dx, dy)| ((dx * dx + dy * dy) as f64) <= radius * radius);
    let pixel = |(dx, dy): (isize, isize)| Pixel {
        at: Vector2::new(dx as f64, dy as f64),
        value: f64::from(image.get((cx + dx) as usize, (cy + dy) as usize)),
    };
    Some(round.map(pixel).collect())
}

type CornerEquations = (SMatrix<f64, UNKNOWNS, UNKNOWNS>, Unknowns);

/// Gauss-Newton normal equations at `x`, and the sum of squared residuals.
fn equations(pixels: &[Pixel], x: &Unknowns) -> (CornerEquations, f64) {
    let mut matrix = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    let mut gradient = Unknowns::zeros();
    let mut cost = 0.0;
    let along = [x[2], x[3]].map(|angle| Vector2::new(angle.cos(), angle.sin()));
    let across = along.map(|e| Vector2::new(-e.y, e.x));
    let steep = [(-x[4]).exp(), (-x[5]).exp()];
    for Pixel { at, value } in pixels {
        let d = at - Vector2::new(x[0], x[1]);
        let scaled = [0, 1].map(|i| across[i].dot(&d) * steep[i]);
        let edge = scaled.map(f64::tanh);
        // ∂I/∂(s/w) of each edge: a tanh(other) (1 − tanh²).
        let slope = [0, 1].map(|i| x[9] * edge[1 - i] * (1.0 - edge[i] * edge[i]));
        let model = x[6] + x[7] * d.x + x[8] * d.y + x[9] * edge[0] * edge[1];
        let residual = value - model;
        // Moving the corner moves both edges against the pixel; rotating an edge moves it in
        // proportion to the distance along it; ln w scales s/w.
        let by_position = -(across[0] * (slope[0] * steep[0]) + across[1] * (slope[1] * steep[1]));
        let by_angle = [0, 1].map(|i| -slope[i] * steep[i] * along[i].dot(&d));
        let by_width = [0, 1].map(|i| -slope[i] * scaled[i]);
        let row = Unknowns::from([
            by_position.x - x[7],
            by_position.y - x[8],
            by_angle[0],
            by_angle[1],
            by_width[0],
            by_width[1],
            1.0,
            d.x,
            d.y,
            edge[0] * edge[1],
        ]);
        matrix.ger(1.0, &row, &row, 1.0);
        gradient += row * residual;
        cost += residual * residual;
    }
    ((matrix, gradient), cost)
}
