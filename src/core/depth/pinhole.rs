//! Robust fit of the pinhole distance curve: a target at distance `Z` has the disparity
//! `d = a/Z − b`, hence `Z = a/(d + b)`, where `a` is `f·B` and `b` the difference of the principal
//! points (`doffs`).
//!
//! This is a straight line in `1/Z`. A priori, disparities are rounded to whole pixels and
//! distances have a standard deviation of half a centimetre, which is a pixel or more for a near
//! target; the residuals scale both. The fit starts with the line of median slope (Theil 1950, Sen
//! 1968), which tolerates nearly a third of outliers, and continues with Tukey's biweight (Beaton
//! and Tukey 1974).

use crate::error::{Error, Result};
use crate::statistics::midpoint_median;
use nalgebra::{Matrix2, Vector2};

/// Fewest measurements: two parameters and one degree of freedom for the residuals.
const MIN_MEASUREMENTS: usize = 3;

/// Tukey's constant: 95 % of the efficiency of least squares if all errors are normal.
const BIWEIGHT: f64 = 4.685;

/// Limit of iterations; the fit converges after about ten.
const STEPS: usize = 50;

/// Standard deviation of disparities that are rounded to whole pixels: `1/√12`.
const DISPARITY_PX: f64 = 0.29;

/// Standard deviation of a distance measured with a ruler.
const DISTANCE_CM: f64 = 0.5;

/// Floor of the scale of both deviations: a few measurements may agree by chance.
const BEST: f64 = 0.03;

/// Checks that the pairs may be fitted to.
fn check(pairs: &[(f64, f64)]) -> Result<()> {
    if pairs
        .iter()
        .any(|(cm, px)| !(cm.is_finite() && *cm > 0.0 && px.is_finite()))
    {
        return Err(Error::Invalid(
            "a distance curve needs positive distances and finite disparities".into(),
        ));
    }
    if pairs.len() < MIN_MEASUREMENTS {
        return Err(Error::Invalid(format!(
            "a distance curve needs {MIN_MEASUREMENTS} measurements, got {}",
            pairs.len()
        )));
    }
    Ok(())
}

/// A line of least squares with the weights of its measurements.
struct WeightedLine {
    line: Vector2<f64>,
    rows: Vec<Row>,
    /// Matrix of the normal equations.
    normal: Matrix2<f64>,
}

impl WeightedLine {
    /// The line of Tukey's biweight, from a line near it.
    fn fit(pairs: &[(f64, f64)], start: Vector2<f64>) -> Self {
        let (mut line, mut rows, mut normal) = (start, Vec::new(), Matrix2::zeros());
        for _ in 0..STEPS {
            rows = pairs
                .iter()
                .map(|&pair| Row::new(pair, &line))
                .collect::<Vec<_>>();
            let off = rows.iter().map(|row| row.residual(&line).abs());
            let scale = 1.4826 * midpoint_median(off).unwrap_or_default();
            for row in &mut rows {
                row.weight = biweight(row.residual(&line) / (BIWEIGHT * scale.max(1.0)));
            }
            normal = rows
                .iter()
                .map(|row| row.x * row.x.transpose() * row.weight)
                .sum();
            let right = rows
                .iter()
                .map(|row| row.x * (row.weight * row.y))
                .sum::<Vector2<f64>>();
            let Some(inverse) = normal.try_inverse() else {
                break;
            };
            let moved = inverse * right;
            let still = (moved - line).norm() <= 1e-12 * line.norm();
            line = moved;
            if still {
                break;
            }
        }
        Self { line, rows, normal }
    }
}

/// Distance as `a/(d + b)`, with the covariance of `a` and `b`.
#[derive(Clone, Debug, PartialEq)]
pub struct PinholeFit {
    /// `a`, which is f·B, in centimetres times pixels.
    pub a_cm_px: f64,
    pub b_px: f64,
    covariance: Matrix2<f64>,
    /// Standard deviation of one measured disparity.
    pub noise_px: f64,
    /// Weight of each measurement, 0 (outlier) ..= 1, in the order of the pairs.
    pub weights: Vec<f64>,
}

impl PinholeFit {
    /// The robust least-squares line through `(distance_cm, disparity_px)` pairs.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than three pairs, a single distance, numbers that are not
    /// finite, distances that are not positive, and disparities that do not grow as the target
    /// comes nearer.
    pub fn fit(pairs: &[(f64, f64)]) -> Result<Self> {
        check(pairs)?;
        let start = median_line(pairs).ok_or_else(|| {
            Error::Invalid("a distance curve needs measurements at different distances".into())
        })?;
        let WeightedLine { line, rows, normal } = WeightedLine::fit(pairs, start);
        let kept: f64 = rows.iter().map(|row| row.weight).sum();
        let squares: f64 = rows
            .iter()
            .map(|row| row.weight * row.residual(&line).powi(2))
            .sum();
        // Whole disparities are known no better than that, however well they fit.
        let best = if pairs.iter().all(|(_, px)| px.fract() == 0.0) {
            1.0
        } else {
            BEST
        };
        let scale = (squares / (kept - 2.0).max(1.0)).sqrt().max(best);
        let noise_px = scale * DISPARITY_PX;
        let weights = rows.iter().map(|row| row.weight).collect();
        let covariance = normal
            .try_inverse()
            .map(|inverse| inverse * (scale * scale));
        match covariance {
            Some(covariance)
                if line.x > 0.0 && line.iter().chain(covariance.iter()).all(|v| v.is_finite()) =>
            {
                Ok(Self {
                    a_cm_px: line.x,
                    b_px: line.y,
                    covariance,
                    noise_px,
                    weights,
                })
            }
            _ => Err(Error::Invalid(
                "disparities must grow as the target comes nearer; are distances and disparities \
                 in their columns?"
                    .into(),
            )),
        }
    }

    /// Standard deviations of `a` and `b`.
    pub fn standard_deviations(&self) -> (f64, f64) {
        (
            self.covariance[(0, 0)].sqrt(),
            self.covariance[(1, 1)].sqrt(),
        )
    }

    /// Distance in centimetres; `None` at or beyond infinity.
    pub fn distance_cm(&self, disparity_px: f64) -> Option<f64> {
        let shift = disparity_px + self.b_px;
        (shift > 0.0).then(|| self.a_cm_px / shift)
    }

    /// Disparity of a target at that distance.
    pub fn disparity_px(&self, distance_cm: f64) -> f64 {
        self.a_cm_px / distance_cm - self.b_px
    }

    /// Standard deviation of the distance from one measured disparity, relative to the distance,
    /// from those of `a` and `b` and of the measurement. `None` at or beyond infinity.
    pub fn relative_deviation(&self, disparity_px: f64) -> Option<f64> {
        let shift = disparity_px + self.b_px;
        let gradient = Vector2::new(1.0 / self.a_cm_px, -1.0 / shift);
        let variance =
            gradient.dot(&(self.covariance * gradient)) + (self.noise_px / shift).powi(2);
        (shift > 0.0).then(|| variance.max(0.0).sqrt())
    }

    /// The farthest distance that is known to within the fraction `share` in 95 of 100 cases;
    /// `None` if no distance is.
    ///
    /// The variance of a distance is quadratic in the distance, so there is one.
    pub fn farthest_cm(&self, share: f64) -> Option<f64> {
        let [aa, ab, bb] = [(0, 0), (0, 1), (1, 1)].map(|at| self.covariance[at]);
        let a = self.a_cm_px;
        // Variance of Z: (aa − 2 ab Z + (bb + noise²) Z²) / a² = (share / 2)².
        let (square, linear) = (bb + self.noise_px.powi(2), -2.0 * ab);
        let constant = aa - (0.5 * share * a).powi(2);
        let root = linear * linear - 4.0 * square * constant;
        (root >= 0.0)
            .then(|| (-linear + root.sqrt()) / (2.0 * square))
            .filter(|cm| *cm > 0.0)
    }
}

fn biweight(u: f64) -> f64 {
    if u.abs() < 1.0 {
        (1.0 - u * u).powi(2)
    } else {
        0.0
    }
}

/// One measurement as a row of the equations, in units of its own standard deviation.
struct Row {
    x: Vector2<f64>,
    y: f64,
    weight: f64,
}

impl Row {
    fn new((cm, px): (f64, f64), line: &Vector2<f64>) -> Self {
        let deviation = DISPARITY_PX.hypot(line.x * DISTANCE_CM / (cm * cm));
        Self {
            x: Vector2::new(1.0 / cm, -1.0) / deviation,
            y: px / deviation,
            weight: 1.0,
        }
    }

    fn residual(&self, line: &Vector2<f64>) -> f64 {
        self.y - self.x.dot(line)
    }
}

/// `a` and `b` of the median slope over all pairs of measurements, and the median intercept; `None`
/// if all distances are equal.
fn median_line(pairs: &[(f64, f64)]) -> Option<Vector2<f64>> {
    let points: Vec<(f64, f64)> = pairs.iter().map(|&(cm, px)| (1.0 / cm, px)).collect();
    let slope = |(i, p): (usize, &(f64, f64))| {
        let p = *p;
        points[..i]
            .iter()
            .filter(move |q| q.0 != p.0)
            .map(move |q| (p.1 - q.1) / (p.0 - q.0))
            .collect::<Vec<_>>()
    };
    let slopes = points.iter().enumerate().flat_map(slope);
    let a = midpoint_median(slopes)?;
    let b = midpoint_median(points.iter().map(|(x, px)| a * x - px))?;
    Some(Vector2::new(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(a: f64, b: f64) -> Vec<(f64, f64)> {
        (2..=13)
            .map(|i| f64::from(i) * 10.0)
            .map(|cm| (cm, a / cm - b))
            .collect()
    }

    #[test]
    fn an_exact_pair_of_cameras_is_recovered() {
        let fit = PinholeFit::fit(&target(1300.0, 2.0)).unwrap();
        assert!((fit.a_cm_px - 1300.0).abs() < 1e-6 && (fit.b_px - 2.0).abs() < 1e-8);
        assert!((fit.distance_cm(11.0).unwrap() - 100.0).abs() < 1e-8);
        assert!((fit.disparity_px(100.0) - 11.0).abs() < 1e-8);
        assert_eq!(fit.distance_cm(-2.1), None);
    }

    #[test]
    fn a_quarter_of_wrong_measurements_moves_nothing() {
        let mut pairs = target(1300.0, -1.5);
        pairs[0].1 = 5.0;
        pairs[4].1 += 20.0;
        pairs[9].1 -= 4.0;
        let fit = PinholeFit::fit(&pairs).unwrap();
        assert!((fit.a_cm_px - 1300.0).abs() < 1e-3, "{fit:?}");
        assert_eq!([0, 4, 9].map(|i| fit.weights[i]), [0.0; 3]);
        assert!(fit.weights[1] > 0.9);
    }

    #[test]
    fn deviations_are_those_of_many_repetitions() {
        // A small generator of normal noise: the sum of twelve uniform numbers.
        let mut state = 1u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut inside = [0; 3];
        for _ in 0..400 {
            let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            let noisy = |(cm, px): (f64, f64)| (cm + 0.5 * normal(), px + 0.3 * normal());
            let pairs: Vec<_> = target(1300.0, 1.0).into_iter().map(noisy).collect();
            let fit = PinholeFit::fit(&pairs).unwrap();
            let (a_deviation, b_deviation) = fit.standard_deviations();
            inside[0] += usize::from((fit.a_cm_px - 1300.0).abs() < 2.0 * a_deviation);
            inside[1] += usize::from((fit.b_px - 1.0).abs() < 2.0 * b_deviation);
            // A new measurement at 2 m, beyond all fitted ones.
            let measured =
                1300.0 / 200.0 - 1.0 + 0.3 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
            let told = fit.distance_cm(measured).unwrap();
            let deviation = fit.relative_deviation(measured).unwrap();
            inside[2] += usize::from((told / 200.0 - 1.0).abs() < 2.0 * deviation);
        }
        // Two deviations contain 95 %; the biweight and the few measurements lower that a little.
        assert!(inside.iter().all(|n| (340..=396).contains(n)), "{inside:?}");
    }

    #[test]
    fn the_farthest_distance_is_where_the_deviation_says() {
        let pairs: Vec<_> = target(1300.0, 1.0)
            .into_iter()
            .enumerate()
            .map(|(i, (cm, px))| (cm, px + [0.2, -0.2][i % 2]))
            .collect();
        let fit = PinholeFit::fit(&pairs).unwrap();
        let farthest = fit.farthest_cm(0.1).unwrap();
        let deviation = fit.relative_deviation(fit.disparity_px(farthest)).unwrap();
        assert!(
            (2.0 * deviation - 0.1).abs() < 1e-9,
            "{farthest} {deviation}"
        );
        assert!(fit.farthest_cm(0.2).unwrap() > farthest);
        assert_eq!(fit.farthest_cm(1e-9), None);
    }

    #[test]
    fn whole_disparities_are_good_to_their_rounding() {
        let pairs: Vec<_> = [1.0, 2.0, 4.0, 5.0, 10.0, 20.0]
            .map(|px| (1000.0 / px, px))
            .into();
        assert_eq!(PinholeFit::fit(&pairs).unwrap().noise_px, DISPARITY_PX);
        let pairs: Vec<_> = pairs.iter().map(|(cm, px)| (*cm, px + 0.25)).collect();
        assert!(PinholeFit::fit(&pairs).unwrap().noise_px < 0.1 * DISPARITY_PX);
    }

    #[test]
    fn measurements_of_no_target_are_refused() {
        for (pairs, word) in [
            (
                vec![(10.0, 1.0), (20.0, 2.0)],
                "needs 3 measurements, got 2",
            ),
            (vec![(10.0, 1.0), (20.0, 2.0), (30.0, 3.0)], "must grow"),
            (vec![(10.0, 1.0); 4], "different distances"),
            (vec![(10.0, f64::NAN), (20.0, 2.0), (30.0, 3.0)], "finite"),
            (vec![(-10.0, 1.0), (20.0, 2.0), (30.0, 3.0)], "positive"),
        ] {
            let error = PinholeFit::fit(&pairs).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
