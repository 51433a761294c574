//! Rectification without a calibration, from matches alone (Fusiello & Irsara, Quasi-Euclidean
//! epipolar rectification of uncalibrated images, 2011).
//!
//! Both cameras are taken for pinholes of one focal length and turned so that the rows of all
//! matches agree: the homographies are those of turned cameras, which shear little, where those
//! that send the epipole to infinity in one step (Hartley 1999) shear much. Departures: what is
//! made small is the distance of the rows, and where the matches say nothing, small turns and a
//! usual focal length are preferred.

use super::features::Match;
use super::framing::{Framing, Pinhole};
use super::view::View;
use crate::error::{Error, Result};
use crate::stereo::Intrinsics;
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector};

/// What makes rows agree: one homography per image, from raw to rectified pixels. No rig is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Homographies {
    /// Width and height of the rectified images.
    pub size: (usize, usize),
    pub left: Matrix3<f64>,
    pub right: Matrix3<f64>,
}

/// Left turned about y, z; right about x, y, z; logarithm of the focal length, 0 for that of
/// [`usual_focal_px`].
type Guess = SVector<f64, 6>;

/// What is not known better: turns within some degrees, focal lengths within a factor of e^0.4,
/// rows within half a pixel.
const USUAL: [f64; 6] = [0.1, 0.1, 0.1, 0.1, 0.1, 0.4];
const NOISE_PX: f64 = 0.5;
const STEPS: usize = 50;
/// Fewest matches that say more than chance does.
const LEAST: usize = 16;

/// The homographies of images of `size` in which `matches` were found, most of them right: see
/// [`super::Epipolar`].
///
/// # Errors
/// [`Error::Invalid`] for too few matches and a framing that is none.
pub fn uncalibrated(
    matches: &[Match],
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
    let [left, right] = turns(&guess).map(|turn| turn.matrix() * inverse_intrinsics(&guess, size));
    Ok(Homographies {
        size: framed,
        left: rectified * left,
        right: rectified * right,
    })
}

fn usual_focal_px((width, height): (usize, usize)) -> f64 {
    // That of a field of view of 55 to 60 degrees along the longer side.
    0.9 * width.max(height) as f64
}

fn focal_px(guess: &Guess, size: (usize, usize)) -> f64 {
    usual_focal_px(size) * guess[5].exp()
}

fn turns(guess: &Guess) -> [Rotation3<f64>; 2] {
    [
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

fn views(guess: &Guess, size: (usize, usize)) -> Result<[View; 2]> {
    let f = focal_px(guess, size);
    let camera = Intrinsics::new(size, (f, f), center(size), [0.0; 5])?;
    Ok(turns(guess).map(|turn| View::new(camera, turn)))
}

/// How far the rows are apart, in units of what is to be expected; then how far the guess is from
/// the usual.
fn residuals(guess: &Guess, matches: &[Match], size: (usize, usize)) -> Vec<f64> {
    let inverse = inverse_intrinsics(guess, size);
    let [left, right] = turns(guess).map(|turn| turn.matrix() * inverse);
    let row = |h: &Matrix3<f64>, point: &nalgebra::Point2<f64>| {
        let seen = h * point.to_homogeneous();
        seen.y / seen.z
    };
    let scale = focal_px(guess, size) / NOISE_PX;
    let apart = matches
        .iter()
        .map(|m| scale * (row(&right, &m.right) - row(&left, &m.left)));
    apart
        .chain(guess.iter().zip(USUAL).map(|(value, usual)| value / usual))
        .collect()
}

fn slopes(guess: &Guess, matches: &[Match], size: (usize, usize)) -> Vec<Guess> {
    const STEP: f64 = 1e-6;
    let beside = |axis: usize, step: f64| {
        let mut guess = *guess;
        guess[axis] += step;
        residuals(&guess, matches, size)
    };
    let mut slopes = vec![Guess::zeros(); matches.len() + USUAL.len()];
    for axis in 0..USUAL.len() {
        let (after, before) = (beside(axis, STEP), beside(axis, -STEP));
        slopes
            .iter_mut()
            .zip(after.iter().zip(&before))
            .for_each(|(slope, (a, b))| slope[axis] = (a - b) / (2.0 * STEP));
    }
    slopes
}

/// Rows far apart, which lenses and wrong matches make, count little (Cauchy); the guess in full.
fn cost(residuals: &[f64], matches: usize) -> f64 {
    let (apart, unusual) = residuals.split_at(matches);
    apart.iter().map(|r| (1.0 + r * r).ln()).sum::<f64>()
        + unusual.iter().map(|r| r * r).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion};

    #[test]
    fn rows_agree_and_pictures_keep_their_shape() {
        let size = (640, 480);
        let turn = UnitQuaternion::from_euler_angles(0.03, -0.02, 0.04);
        let motion = Isometry3::from_parts([-0.12, 0.006, 0.004].into(), turn);
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
            .map(|p| Match {
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
            // The sides of a square around the middle stay at right angles and equal.
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
    fn too_few_matches_are_told() {
        let error = uncalibrated(&[], (640, 480), &Framing::default())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("0 points") && error.contains("calibrate"),
            "{error}"
        );
    }
}
