//! Rectification without a calibration, from matches alone (Fusiello & Irsara, Quasi-Euclidean
//! epipolar rectification of uncalibrated images, 2011).
//!
//! Both cameras are modelled as pinholes of one focal length and rotated so that all matches lie on
//! equal rows. The homographies are those of rotated cameras, with little shear; those that send
//! the epipole to infinity in one step (Hartley 1999) have much. Departures: the cost is the
//! vertical misalignment instead of the Sampson error, and if the matches do not determine the
//! parameters, priors prefer small rotations and a typical focal length.

use super::features::PointMatch;
use super::framing::{Framing, Pinhole};
use super::rotated_camera::RotatedCamera;
use crate::error::{Error, Result};
use crate::stereo::Intrinsics;
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector};

/// The rectifying homography of each image, from raw to rectified pixels. There is no rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Homographies {
    /// Width and height of the rectified images.
    pub size: (usize, usize),
    pub left: Matrix3<f64>,
    pub right: Matrix3<f64>,
}

/// Rotation of the left camera about y, z; of the right one about x, y, z; logarithm of the focal
/// length relative to [`typical_focal_px`].
type Guess = SVector<f64, 6>;

/// Standard deviations of the priors: rotations of a few degrees, focal lengths within a factor of
/// e^0.4; then that of a row.
const PRIOR: [f64; 6] = [0.1, 0.1, 0.1, 0.1, 0.1, 0.4];
const NOISE_PX: f64 = 0.5;
const STEPS: usize = 50;
/// Fewest matches for a result.
const LEAST: usize = 16;

/// The homographies of images of `size` from `matches` that are mostly inliers: see
/// [`super::EpipolarGeometry`].
///
/// # Errors
/// [`Error::Invalid`] for too few matches or an invalid framing.
pub fn uncalibrated(
    matches: &[PointMatch],
    size: (usize, usize),
    framing: &Framing,
) -> Result<Homographies> {
    if matches.len() < LEAST {
        return Err(Error::Invalid(format!(
            "{} points found in both images, at least {LEAST} are needed: show something \
             textured, or calibrate",
            matches.len()
        )));
    }
    let mut guess = Guess::zeros();
    let mut residuals = residuals(&guess, matches, size);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let slopes: Vec<_> = slopes(&guess, matches, size);
        let mut normal = SMatrix::<f64, 6, 6>::zeros();
        let mut off = Guess::zeros();
        for (i, (slope, residual)) in slopes.iter().zip(&residuals).enumerate() {
            // Cauchy weights for the matches; the priors are never outliers.
            let weight = if i < matches.len() {
                1.0 / (1.0 + residual * residual)
            } else {
                1.0
            };
            normal += slope * slope.transpose() * weight;
            off += slope * (*residual * weight);
        }
        let damped = normal + SMatrix::from_diagonal(&(normal.diagonal() * damping));
        let Some(step) = damped.cholesky().map(|cholesky| cholesky.solve(&off)) else {
            break;
        };
        let next = guess - step;
        let then = self::residuals(&next, matches, size);
        let better = cost(&then, matches.len()) < cost(&residuals, matches.len());
        damping = if better {
            damping / 10.0
        } else {
            damping * 10.0
        };
        if better {
            (guess, residuals) = (next, then);
        }
        if step.norm() < 1e-9 || damping > 1e12 {
            break;
        }
    }
    let views = views(&guess, size)?;
    let Pinhole {
        size: framed,
        focal_px,
        center_px: (cx, cy),
    } = framing.pinhole(&views)?;
    let rectified = Matrix3::new(focal_px, 0.0, cx, 0.0, focal_px, cy, 0.0, 0.0, 1.0);
    let [left, right] =
        rotations(&guess).map(|rotation| rotation.matrix() * inverse_intrinsics(&guess, size));
    Ok(Homographies {
        size: framed,
        left: rectified * left,
        right: rectified * right,
    })
}

fn typical_focal_px((width, height): (usize, usize)) -> f64 {
    // A field of view of 58 degrees along the longer side.
    0.9 * width.max(height) as f64
}

fn focal_px(guess: &Guess, size: (usize, usize)) -> f64 {
    typical_focal_px(size) * guess[5].exp()
}

fn rotations(guess: &Guess) -> [Rotation3<f64>; 2] {
    [
        // A common rotation about x moves all rows equally, so the left camera's is fixed to 0.
        Rotation3::from_euler_angles(0.0, guess[0], guess[1]),
        Rotation3::from_euler_angles(guess[2], guess[3], guess[4]),
    ]
}

fn center((width, height): (usize, usize)) -> (f64, f64) {
    ((width - 1) as f64 / 2.0, (height - 1) as f64 / 2.0)
}

fn inverse_intrinsics(guess: &Guess, size: (usize, usize)) -> Matrix3<f64> {
    let (f, (cx, cy)) = (focal_px(guess, size), center(size));
    Matrix3::new(1.0 / f, 0.0, -cx / f, 0.0, 1.0 / f, -cy / f, 0.0, 0.0, 1.0)
}

fn views(guess: &Guess, size: (usize, usize)) -> Result<[RotatedCamera; 2]> {
    let f = focal_px(guess, size);
    let camera = Intrinsics::new(size, (f, f), center(size), [0.0; 5])?;
    Ok(rotations(guess).map(|rotation| RotatedCamera::new(camera, rotation)))
}

/// Vertical misalignment of every match, then the distance of the guess from the priors; both in
/// standard deviations.
fn residuals(guess: &Guess, matches: &[PointMatch], size: (usize, usize)) -> Vec<f64> {
    let inverse = inverse_intrinsics(guess, size);
    let [left, right] = rotations(guess).map(|rotation| rotation.matrix() * inverse);
    let row = |h: &Matrix3<f64>, point: &nalgebra::Point2<f64>| {
        let seen = h * point.to_homogeneous();
        seen.y / seen.z
    };
    let scale = focal_px(guess, size) / NOISE_PX;
    let misalignments = matches
        .iter()
        .map(|m| scale * (row(&right, &m.right) - row(&left, &m.left)));
    misalignments
        .chain(
            guess
                .iter()
                .zip(PRIOR)
                .map(|(value, deviation)| value / deviation),
        )
        .collect()
}

/// Derivatives of the residuals by central differences.
fn slopes(guess: &Guess, matches: &[PointMatch], size: (usize, usize)) -> Vec<Guess> {
    const STEP: f64 = 1e-6;
    let beside = |axis: usize, step: f64| {
        let mut guess = *guess;
        guess[axis] += step;
        residuals(&guess, matches, size)
    };
    let mut slopes = vec![Guess::zeros(); matches.len() + PRIOR.len()];
    for axis in 0..PRIOR.len() {
        let (after, before) = (beside(axis, STEP), beside(axis, -STEP));
        slopes
            .iter_mut()
            .zip(after.iter().zip(&before))
            .for_each(|(slope, (a, b))| slope[axis] = (a - b) / (2.0 * STEP));
    }
    slopes
}

/// Large misalignments, from distortion and wrong matches, have little weight (Cauchy loss); the
/// priors have full weight.
fn cost(residuals: &[f64], matches: usize) -> f64 {
    let (misalignments, priors) = residuals.split_at(matches);
    misalignments
        .iter()
        .map(|r| (1.0 + r * r).ln())
        .sum::<f64>()
        + priors.iter().map(|r| r * r).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion};

    #[test]
    fn rows_agree_and_images_keep_their_shape() {
        let size = (640, 480);
        let rotation = UnitQuaternion::from_euler_angles(0.03, -0.02, 0.04);
        let motion = Isometry3::from_parts([-0.12, 0.006, 0.004].into(), rotation);
        let pixel =
            |p: Point3<f64>| Point2::new(600.0 * p.x / p.z + 319.5, 600.0 * p.y / p.z + 239.5);
        let points = (0..400).map(|i| {
            let z = 1.0 + (i % 7) as f64;
            Point3::new(
                ((i * 37 % 101) as f64 / 101.0 - 0.5) * z,
                ((i * 53 % 97) as f64 / 97.0 - 0.5) * 0.75 * z,
                z,
            )
        });
        let matches: Vec<_> = points
            .map(|p| PointMatch {
                left: pixel(p),
                right: pixel(motion * p),
            })
            .collect();
        let raw = matches
            .iter()
            .map(|m| (m.left.y - m.right.y).abs())
            .fold(0.0, f64::max);
        assert!(raw > 15.0);
        let Homographies {
            size: made,
            left,
            right,
        } = uncalibrated(&matches, size, &Framing::default()).unwrap();
        assert_eq!(made, size);
        let onto = |h: &Matrix3<f64>, p: Point2<f64>| {
            Point2::from_homogeneous(h * p.to_homogeneous()).unwrap()
        };
        for m in &matches {
            let (l, r) = (onto(&left, m.left), onto(&right, m.right));
            assert!((l.y - r.y).abs() < 0.05, "{l} {r}");
        }
        for h in [left, right] {
            // The sides of a square around the centre stay perpendicular and equal.
            let at = |x, y| onto(&h, Point2::new(319.5 + x, 239.5 + y));
            let (across, down) = (
                at(50.0, 0.0) - at(-50.0, 0.0),
                at(0.0, 50.0) - at(0.0, -50.0),
            );
            assert!(
                across.dot(&down).abs() / (across.norm() * down.norm()) < 0.02,
                "sheared: {h}"
            );
            assert!(
                (across.norm() / down.norm() - 1.0).abs() < 0.02,
                "stretched: {h}"
            );
        }
    }

    #[test]
    fn too_few_matches_are_an_error() {
        let error = uncalibrated(&[], (640, 480), &Framing::default())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("0 points") && error.contains("calibrate"),
            "{error}"
        );
    }
}
