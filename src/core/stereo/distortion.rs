//! Lens distortion models: those of OpenCV, ROS and Kalibr.
//!
//! | model | coefficients | source |
//! |---|---|---|
//! | `plumb_bob` | k1 k2 p1 p2 k3 | Brown, Close-range camera calibration, 1971 |
//! | `rational_polynomial` | k1 k2 p1 p2 k3 k4 k5 k6, s1 s2 s3 s4, τx τy | OpenCV's `calib3d` |
//! | `equidistant` | k1 k2 k3 k4 | Kannala and Brandt, PAMI 2006; OpenCV's `fisheye` |

use crate::error::{Error, Result, did_you_mean};
use crate::words::joined;
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};
use std::f64::consts::FRAC_PI_2;
use std::fmt::{Display, Formatter};
use std::str::FromStr;

/// A distortion model, without its coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DistortionModel {
    #[default]
    PlumbBob,
    RationalPolynomial,
    Equidistant,
}

impl DistortionModel {
    pub const ALL: [Self; 3] = [Self::PlumbBob, Self::RationalPolynomial, Self::Equidistant];

    /// ROS's name.
    pub const fn name(self) -> &'static str {
        self.names()[0]
    }

    /// ROS's name first, then those of Kalibr, EuRoC and Foxglove.
    const fn names(self) -> &'static [&'static str] {
        match self {
            Self::PlumbBob => &["plumb_bob", "radtan", "radial_tangential"],
            Self::RationalPolynomial => &["rational_polynomial"],
            Self::Equidistant => &[
                "equidistant",
                "equi",
                "fisheye",
                "kannala_brandt",
                "kannala_brandt4",
            ],
        }
    }

    /// The coefficients that a calibration estimates.
    pub const fn coefficient_names(self) -> &'static [&'static str] {
        match self {
            Self::PlumbBob => &["k1", "k2", "p1", "p2", "k3"],
            Self::RationalPolynomial => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
            Self::Equidistant => &["k1", "k2", "k3", "k4"],
        }
    }

    /// The numbers of coefficients that files have.
    const fn counts(self) -> &'static [usize] {
        match self {
            // OpenCV and ROS write four, with k3 = 0.
            Self::PlumbBob => &[4, 5],
            Self::RationalPolynomial => &[8, 12, 14],
            Self::Equidistant => &[4],
        }
    }

    /// The distortion with these coefficients. An empty list is a lens without distortion. More
    /// coefficients than the model has are accepted if they are 0, as ROS 1 drivers write them.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of coefficients.
    pub fn with_coefficients(self, coefficients: &[f64]) -> Result<Distortion> {
        let counts = self.counts();
        let max = counts.iter().copied().max().unwrap_or_default();
        let (used, rest) = coefficients.split_at(coefficients.len().min(max));
        let is_padded = coefficients.len() > max && rest.iter().all(|v| *v == 0.0);
        if !(used.is_empty() || is_padded || counts.contains(&coefficients.len())) {
            // OpenCV reads more than five coefficients of `plumb_bob` as those of the rational
            // model, and fewer of the rational model as `plumb_bob`.
            let other = match self {
                Self::PlumbBob => Self::RationalPolynomial,
                _ => Self::PlumbBob,
            };
            if self != Self::Equidistant && other.counts().contains(&coefficients.len()) {
                return other.with_coefficients(coefficients);
            }
            let counts: Vec<_> = counts.iter().map(ToString::to_string).collect();
            let counts = counts.join(" or ");
            return Err(Error::Invalid(format!(
                "{} coefficients of distortion; {self} has {counts}",
                coefficients.len()
            )));
        }
        Ok(match self {
            Self::PlumbBob => Distortion::PlumbBob(filled(used)),
            Self::RationalPolynomial => Distortion::RationalPolynomial(filled(used)),
            Self::Equidistant => Distortion::Equidistant(filled(used)),
        })
    }
}

fn filled<const N: usize>(first: &[f64]) -> [f64; N] {
    let mut all = [0.0; N];
    all[..first.len()].copy_from_slice(first);
    all
}

impl FromStr for DistortionModel {
    type Err = Error;

    /// # Errors
    /// [`Error::Invalid`] for an unknown name, with the nearest.
    fn from_str(name: &str) -> Result<Self> {
        let plain = name.to_lowercase().replace(['-', ' '], "_");
        let found = Self::ALL
            .into_iter()
            .find(|model| model.names().contains(&plain.as_str()));
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            let hint = did_you_mean(name, names);
            let names = joined(names);
            Error::Invalid(format!(
                "the distortion model '{name}' is not supported{hint}; svl has {names}"
            ))
        })
    }
}

impl Display for DistortionModel {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// Lens distortion: a map from directions `(x, y) = (X/Z, Y/Z)` to distorted image coordinates in
/// units of the focal length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// k1, k2, p1, p2, k3: `x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)`,
    /// `y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y`, with `r² = x² + y²`.
    PlumbBob([f64; 5]),
    /// k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, τx, τy: as [`Distortion::PlumbBob`] with the
    /// radial factor divided by `1 + k4 r² + k5 r⁴ + k6 r⁶`; then the thin prism, `s1 r² + s2 r⁴`
    /// in x and `s3 r² + s4 r⁴` in y; then a sensor tilted by τx and τy, radians.
    RationalPolynomial([f64; 14]),
    /// k1, k2, k3, k4: the distorted radius is `θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`, with the
    /// angle `θ = atan r` from the optical axis.
    Equidistant([f64; 4]),
}

impl From<[f64; 5]> for Distortion {
    fn from(plumb_bob: [f64; 5]) -> Self {
        Self::PlumbBob(plumb_bob)
    }
}

/// Convergence threshold in units of the focal length: far below a thousandth of a pixel.
const CONVERGENCE: f64 = 1e-10;
const MAX_STEPS: usize = 50;
/// Directions farther from the axis (87°) are of no use on a plane.
pub(crate) const MAX_RADIUS: f64 = 20.0;
/// Number of the [`radii`].
const RADII: u32 = 10_000;

/// The radii at which a model is searched for its fold: a grid is exact enough for a bound.
fn radii() -> impl Iterator<Item = f64> {
    (0..=RADII).map(|step| f64::from(step) * MAX_RADIUS / f64::from(RADII))
}

impl Distortion {
    /// A lens without distortion.
    pub const NONE: Self = Self::PlumbBob([0.0; 5]);

    pub fn model(&self) -> DistortionModel {
        match self {
            Self::PlumbBob(_) => DistortionModel::PlumbBob,
            Self::RationalPolynomial(_) => DistortionModel::RationalPolynomial,
            Self::Equidistant(_) => DistortionModel::Equidistant,
        }
    }

    /// The coefficients as files have them: 5, 8, 12, 14 or 4, the fewest that hold all that are
    /// not 0.
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::PlumbBob(all) => all,
            Self::Equidistant(all) => all,
            Self::RationalPolynomial(all) => {
                let used = all.iter().rposition(|v| *v != 0.0).map_or(0, |i| i + 1);
                let counts = DistortionModel::RationalPolynomial.counts();
                &all[..counts.iter().copied().find(|n| *n >= used).unwrap_or(14)]
            }
        }
    }

    /// True if the image of every direction is the direction itself.
    pub fn is_none(&self) -> bool {
        !matches!(self, Self::Equidistant(_)) && self.coefficients().iter().all(|v| *v == 0.0)
    }

    /// The same model with other values of the first coefficients, those of
    /// [`DistortionModel::coefficient_names`].
    ///
    /// # Panics
    /// If there are more than the model has.
    #[must_use]
    pub fn with_first(mut self, first: &[f64]) -> Self {
        let all = match &mut self {
            Self::PlumbBob(all) => &mut all[..],
            Self::RationalPolynomial(all) => &mut all[..],
            Self::Equidistant(all) => &mut all[..],
        };
        all[..first.len()].copy_from_slice(first);
        self
    }

    /// The distorted image of a direction.
    pub fn distort(&self, direction: Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (direction.x, direction.y);
        match self {
            Self::PlumbBob([k1, k2, p1, p2, k3]) => {
                let r2 = x * x + y * y;
                let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                tangential((x, y), r2, radial, (*p1, *p2))
            }
            Self::RationalPolynomial(all) => {
                let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, ..] = all;
                let r2 = x * x + y * y;
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let lens = tangential((x, y), r2, above / below, (*p1, *p2));
                let prism = Vector2::new(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4));
                match tilt(all) {
                    None => lens + prism,
                    Some(tilt) => {
                        let tilted = tilt * (lens + prism).push(1.0);
                        tilted.xy() / tilted.z
                    }
                }
            }
            Self::Equidistant(k) => direction * image_scale(k, direction.norm()),
        }
    }

    /// [`Distortion::distort`] with its derivatives: by the direction, and by the coefficients of
    /// [`DistortionModel::coefficient_names`], one a column; the rest of the columns are 0.
    pub fn linearize(
        &self,
        direction: Vector2<f64>,
    ) -> (Vector2<f64>, Matrix2<f64>, SMatrix<f64, 2, 8>) {
        let (x, y) = (direction.x, direction.y);
        let (r2, xy) = (x * x + y * y, 2.0 * x * y);
        let (r4, r6) = (r2 * r2, r2 * r2 * r2);
        let tangents = [[xy, r2 + 2.0 * x * x], [r2 + 2.0 * y * y, xy]];
        let mut by_coefficients = SMatrix::<f64, 2, 8>::zeros();
        match self {
            Self::PlumbBob(_) => {
                for (row, (axis, [p1, p2])) in [x, y].into_iter().zip(tangents).enumerate() {
                    let values = [axis * r2, axis * r4, p1, p2, axis * r6];
                    let mut row = by_coefficients.fixed_view_mut::<1, 5>(row, 0);
                    row.copy_from_slice(&values);
                }
            }
            Self::RationalPolynomial(all) => {
                let [k1, k2, _, _, k3, k4, k5, k6, ..] = all;
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                for (row, (axis, [p1, p2])) in [x, y].into_iter().zip(tangents).enumerate() {
                    let (up, down) = (axis / below, -axis * above / (below * below));
                    let [k1, k2, k3] = [up * r2, up * r4, up * r6];
                    let values = [k1, k2, p1, p2, k3, down * r2, down * r4, down * r6];
                    let mut row = by_coefficients.fixed_view_mut::<1, 8>(row, 0);
                    row.copy_from_slice(&values);
                }
                if let Some(tilt) = tilt(all) {
                    let untilted = self.without_tilt().distort(direction);
                    by_coefficients = tilt_derivative(&tilt, untilted) * by_coefficients;
                }
            }
            Self::Equidistant(_) => {
                let theta = r2.sqrt().atan();
                let unit = direction.try_normalize(0.0).unwrap_or_default();
                for (column, power) in [3, 5, 7, 9].into_iter().enumerate() {
                    by_coefficients.set_column(column, &(unit * theta.powi(power)));
                }
            }
        }
        (
            self.distort(direction),
            self.jacobian(direction),
            by_coefficients,
        )
    }

    /// Derivative of [`Distortion::distort`] by the direction.
    pub fn jacobian(&self, at: Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (at.x, at.y);
        let r2 = x * x + y * y;
        match self {
            Self::PlumbBob([k1, k2, p1, p2, k3]) => {
                let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                // Twice the derivative of `radial` by r².
                let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
                tangential_jacobian((x, y), radial, slope, (*p1, *p2))
            }
            Self::RationalPolynomial(all) => {
                let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, ..] = all;
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let above_slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
                let below_slope = 2.0 * (k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6));
                let slope = (above_slope - above / below * below_slope) / below;
                let lens = tangential_jacobian((x, y), above / below, slope, (*p1, *p2));
                let prism = Vector2::new(s1 + 2.0 * r2 * s2, s3 + 2.0 * r2 * s4) * 2.0;
                let lens = lens + prism * at.transpose();
                match tilt(all) {
                    None => lens,
                    Some(tilt) => tilt_derivative(&tilt, self.without_tilt().distort(at)) * lens,
                }
            }
            Self::Equidistant(k) => {
                let r = r2.sqrt();
                // Along the radius, and across it.
                let along = image_slope(k, r.atan()) / (1.0 + r2);
                let across = image_scale(k, r);
                let unit = at.try_normalize(0.0).unwrap_or_default();
                Matrix2::identity() * across + unit * unit.transpose() * (along - across)
            }
        }
    }

    /// The direction of a distorted point; `None` where no direction leads to the point, or the
    /// model folds back there. For `equidistant`, `None` at 90° from the axis and beyond.
    pub fn undistort(&self, target: Vector2<f64>) -> Option<Vector2<f64>> {
        if let Self::Equidistant(k) = self {
            let theta = angle(k, target.norm(), FRAC_PI_2)?;
            // On the axis the target itself is 0.
            let unit = target.try_normalize(0.0).unwrap_or_default();
            return (theta < FRAC_PI_2).then_some(unit * theta.tan());
        }
        let mut direction = target;
        for _ in 0..MAX_STEPS {
            let off = self.distort(direction) - target;
            if off.norm() < CONVERGENCE {
                // Beyond a fold the radius shrinks, or the image is upside down.
                let slope = self.jacobian(direction);
                return (slope.determinant() > 0.0 && slope.trace() > 0.0).then_some(direction);
            }
            direction -= self.jacobian(direction).try_inverse()? * off;
        }
        None
    }

    /// The angle from the optical axis at which the lens sees a distorted point, radians; up to π
    /// for `equidistant`. `None` as for [`Distortion::undistort`].
    pub fn angle(&self, target: Vector2<f64>) -> Option<f64> {
        match self {
            Self::Equidistant(k) => angle(k, target.norm(), 2.0 * FRAC_PI_2),
            _ => Some(self.undistort(target)?.norm().atan()),
        }
    }

    /// The radius of a direction, at most 20, up to which the distorted radius grows. Beyond it,
    /// the model folds back onto image points that it already covered. Tangential terms, the thin
    /// prism and the tilt are left out: they are small.
    pub fn max_radius(&self) -> f64 {
        radii().find(|r| !self.grows(*r)).unwrap_or(MAX_RADIUS)
    }

    /// The distorted radius at which the model folds; `None` if it reaches `limit` before.
    pub fn fold(&self, limit: f64) -> Option<f64> {
        let seen = self.undistort(Vector2::new(limit, 0.0));
        let end = seen.map_or(MAX_RADIUS, |direction| direction.norm());
        let fold = radii()
            .take_while(|r| *r <= end)
            .find(|r| !self.grows(*r))?;
        Some(self.distort(Vector2::new(fold, 0.0)).norm())
    }

    /// True if the distorted radius grows at a radius.
    fn grows(&self, r: f64) -> bool {
        let r2 = r * r;
        match self {
            Self::PlumbBob([k1, k2, _, _, k3]) => {
                1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) > 0.0
            }
            Self::RationalPolynomial([k1, k2, _, _, k3, k4, k5, k6, ..]) => {
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let above_slope = 2.0 * r2 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
                let below_slope = 2.0 * r2 * (k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6));
                below > 0.0 && (above + above_slope) * below > above * below_slope
            }
            Self::Equidistant(k) => image_slope(k, r.atan()) > 0.0,
        }
    }

    fn without_tilt(&self) -> Self {
        match *self {
            Self::RationalPolynomial(mut all) => {
                all[12..].fill(0.0);
                Self::RationalPolynomial(all)
            }
            other => other,
        }
    }
}

/// A radial factor and the tangential terms.
fn tangential((x, y): (f64, f64), r2: f64, radial: f64, (p1, p2): (f64, f64)) -> Vector2<f64> {
    Vector2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

/// Derivative of [`tangential`]. `slope`: twice the derivative of the radial factor by r².
fn tangential_jacobian(
    (x, y): (f64, f64),
    radial: f64,
    slope: f64,
    (p1, p2): (f64, f64),
) -> Matrix2<f64> {
    let mixed = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
    Matrix2::new(
        radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        mixed,
        mixed,
        radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    )
}

/// The homography of a tilted sensor (Louhichi et al., A semi-analytical approach, 2007; OpenCV's
/// `computeTiltProjectionMatrix`); `None` without a tilt.
fn tilt([.., tau_x, tau_y]: &[f64; 14]) -> Option<Matrix3<f64>> {
    if (*tau_x, *tau_y) == (0.0, 0.0) {
        return None;
    }
    let ((sx, cx), (sy, cy)) = (tau_x.sin_cos(), tau_y.sin_cos());
    let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, sx, 0.0, -sx, cx);
    let about_y = Matrix3::new(cy, 0.0, -sy, 0.0, 1.0, 0.0, sy, 0.0, cy);
    let turn = about_y * about_x;
    let (x, y, z) = (turn[(0, 2)], turn[(1, 2)], turn[(2, 2)]);
    Some(Matrix3::new(z, 0.0, -x, 0.0, z, -y, 0.0, 0.0, 1.0) * turn)
}

/// Derivative of the homography at a point.
fn tilt_derivative(tilt: &Matrix3<f64>, at: Vector2<f64>) -> Matrix2<f64> {
    let tilted: Vector3<f64> = tilt * at.push(1.0);
    let point = tilted.xy() / tilted.z;
    (tilt.fixed_view::<2, 2>(0, 0) - point * tilt.fixed_view::<1, 2>(2, 0)) / tilted.z
}

/// Distorted radius of `equidistant` at an angle.
fn image_radius([k1, k2, k3, k4]: &[f64; 4], theta: f64) -> f64 {
    let t2 = theta * theta;
    theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
}

/// Distorted radius over the radius `r` of a direction; its limit 1 on the axis.
fn image_scale(k: &[f64; 4], r: f64) -> f64 {
    if r == 0.0 {
        1.0
    } else {
        image_radius(k, r.atan()) / r
    }
}

/// Derivative of [`image_radius`].
fn image_slope([k1, k2, k3, k4]: &[f64; 4], theta: f64) -> f64 {
    let t2 = theta * theta;
    1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
}

/// The angle up to `max` whose [`image_radius`] is `radius`: Newton's method between bounds.
fn angle(k: &[f64; 4], radius: f64, max: f64) -> Option<f64> {
    let (mut least, mut most) = (0.0, max);
    let mut theta = radius.min(max);
    for _ in 0..MAX_STEPS {
        let off = image_radius(k, theta) - radius;
        if off.abs() < CONVERGENCE * 1e-3 {
            return Some(theta);
        }
        if off > 0.0 {
            most = theta;
        } else {
            least = theta;
        }
        let newton = theta - off / image_slope(k, theta);
        // A step out of the bounds, or NaN, is replaced by a bisection.
        theta = if newton > least && newton < most {
            newton
        } else {
            (least + most) / 2.0
        };
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each model, with all coefficients in use.
    fn lenses() -> Vec<Distortion> {
        let rational = [
            0.3, 0.1, 2e-4, -1e-4, 0.01, 0.4, 0.1, 0.02, 1e-3, -2e-4, -5e-4, 1e-4, 0.02, -0.03,
        ];
        vec![
            Distortion::PlumbBob([-0.283, 0.074, 2e-4, 2e-5, 0.001]),
            Distortion::RationalPolynomial(filled(&rational[..8])),
            Distortion::RationalPolynomial(rational),
            Distortion::Equidistant([-0.01, 0.02, -0.005, 0.001]),
        ]
    }

    #[test]
    fn every_direction_comes_back() {
        for lens in lenses() {
            for (x, y) in [(0.0, 0.0), (1e-9, 0.0), (0.3, -0.2), (-0.1, 1.2)] {
                let direction = Vector2::new(x, y);
                let back = lens.undistort(lens.distort(direction)).unwrap();
                assert!((back - direction).norm() < 1e-9, "{lens:?} {direction}");
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_lens() {
        let step = 1e-6;
        for (lens, at) in lenses().into_iter().flat_map(|lens| {
            [Vector2::new(0.3, -0.2), Vector2::zeros()].map(|direction| (lens, direction))
        }) {
            let (distorted, by_direction, by_coefficients) = lens.linearize(at);
            assert_eq!(distorted, lens.distort(at));
            for (axis, unit) in [Vector2::x(), Vector2::y()].into_iter().enumerate() {
                let both = [1.0, -1.0].map(|sign| lens.distort(at + unit * (sign * step)));
                let difference = (both[0] - both[1]) / (2.0 * step);
                let column = by_direction.column(axis);
                assert!((column - difference).norm() < 1e-8, "{lens:?} {axis}");
            }
            let count = lens.model().coefficient_names().len();
            for i in 0..8 {
                let moved = |step: f64| {
                    let mut first = lens.coefficients()[..count].to_vec();
                    first[i] += step;
                    lens.with_first(&first).distort(at)
                };
                let difference = if i < count {
                    (moved(step) - moved(-step)) / (2.0 * step)
                } else {
                    Vector2::zeros()
                };
                let column = by_coefficients.column(i);
                assert!((column - difference).norm() < 1e-8, "{lens:?} {i}");
            }
        }
    }

    #[test]
    fn a_fisheye_sees_beyond_the_plane() {
        let lens = Distortion::Equidistant([0.0; 4]);
        assert_eq!(lens.max_radius(), MAX_RADIUS);
        assert!(lens.undistort(Vector2::new(1.5, 0.0)).is_some());
        for radius in [FRAC_PI_2, 1.7] {
            assert_eq!(lens.undistort(Vector2::new(0.0, radius)), None);
            let angle = lens.angle(Vector2::new(0.0, radius)).unwrap();
            assert!((angle - radius).abs() < 1e-12);
        }
        assert_eq!(lens.angle(Vector2::new(4.0, 0.0)), None, "beyond 180°");
    }

    #[test]
    fn a_model_ends_where_it_folds() {
        let k1 = |k1| Distortion::PlumbBob([k1, 0.0, 0.0, 0.0, 0.0]);
        // 1 − 0.9 r² is 0 at r = 1.054.
        assert!((k1(-0.3).max_radius() - 1.054).abs() < 0.003);
        assert_eq!(k1(0.3).max_radius(), MAX_RADIUS);
        // There, the distorted radius is 0.703.
        assert!((k1(-0.3).fold(1.0).unwrap() - 0.703).abs() < 1e-3);
        assert_eq!((k1(-0.3).fold(0.6), k1(0.3).fold(f64::MAX)), (None, None));
        // A pole of the denominator at r = 2.
        let pole = DistortionModel::RationalPolynomial
            .with_coefficients(&[0.0, 0.0, 0.0, 0.0, 0.0, -0.25, 0.0, 0.0])
            .unwrap();
        assert!((pole.max_radius() - 2.0).abs() < 0.003);
        // 1 − 0.6 θ² is 0 at θ = 1.29, r = 3.48.
        let fisheye = Distortion::Equidistant([-0.2, 0.0, 0.0, 0.0]);
        assert!((fisheye.max_radius() - 3.48).abs() < 0.01);
        for lens in [k1(-0.3), fisheye] {
            assert_eq!(lens.undistort(Vector2::new(0.0, 1.5)), None);
        }
    }

    #[test]
    fn models_have_their_numbers_of_coefficients() {
        let with = |model: &str, count: usize| {
            let all: Vec<_> = (1..=count).map(|i| i as f64).collect();
            let lens = model.parse::<DistortionModel>().unwrap();
            lens.with_coefficients(&all).map_err(|e| e.to_string())
        };
        for (model, count, found) in [
            ("plumb_bob", 0, "plumb_bob"),
            ("radtan", 4, "plumb_bob"),
            ("plumb_bob", 5, "plumb_bob"),
            // Drivers that keep the name with OpenCV's coefficients, and the reverse.
            ("plumb_bob", 8, "rational_polynomial"),
            ("rational_polynomial", 5, "plumb_bob"),
            ("rational_polynomial", 12, "rational_polynomial"),
            ("rational_polynomial", 14, "rational_polynomial"),
            ("fisheye", 4, "equidistant"),
        ] {
            let lens = with(model, count).unwrap();
            assert_eq!(lens.model().name(), found);
            let read = lens.coefficients().iter().filter(|v| **v != 0.0).count();
            assert_eq!(read, count);
        }
        for (model, count) in [
            ("plumb_bob", 6),
            ("rational_polynomial", 13),
            ("equidistant", 5),
        ] {
            let error = with(model, count).unwrap_err();
            assert!(error.contains(&format!("{count} coefficients")), "{error}");
        }
        let zeros = DistortionModel::PlumbBob
            .with_coefficients(&[0.0; 8])
            .unwrap();
        assert!(zeros.is_none() && zeros == Distortion::NONE);
        let error = "fish_eye"
            .parse::<DistortionModel>()
            .unwrap_err()
            .to_string();
        assert!(error.contains("equidistant"), "{error}");
    }
}
