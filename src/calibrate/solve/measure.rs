//! The solution of an adjusted pair: standard deviations, residuals, vertical misalignment.

use super::bundle::{BundleProblem, LossFunction, MOTION, PosedCamera, PosedView};
use super::solution::{
    self, CameraEstimate, CameraParameters, Corner, Correlation, EpipolarError, Estimated, Fit,
    Solution, ViewFit,
};
use crate::Board;
use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6, Point2, Rotation3, Vector2, Vector3};
use svl_core::stereo::{Intrinsics, StereoCalibration};
use svl_core::{Error, Result};

/// A focal length whose standard deviation exceeds this fraction of it is undetermined.
const MAX_DEVIATION: f64 = 0.03;
/// Correlations beyond this are reported.
const MAX_CORRELATION: f64 = 0.9;
/// Columns and rows of the fields for which coverage is counted.
const FIELDS: (usize, usize) = (8, 6);

pub(super) fn solution(
    board: &Board,
    bundle: BundleProblem,
    refused: Vec<Option<String>>,
) -> Result<Solution> {
    let (squares, numbers) = squared_residuals(&bundle);
    let unknowns = bundle.parameters() + MOTION * bundle.views.len();
    // Unbiased: degrees of freedom are residuals minus unknowns.
    let variance = squares / numbers.saturating_sub(unknowns).max(1) as f64;
    let covariance = bundle
        .normal(LossFunction::Squares)
        .covariance()
        .map(|c| c * variance);
    let covariance = covariance.ok_or_else(|| parallel(&bundle, None))?;
    let deviations: Vec<f64> = covariance.diagonal().iter().map(|v| v.sqrt()).collect();

    check_focal_lengths(&bundle, &deviations)?;

    let [first, second] = [0, 1].map(|i| &bundle.cameras[i]);
    let (begin, intrinsics) = (bundle.begin(1), bundle.intrinsics());
    let from_first = second.from_first;
    let [left, right] = [first.intrinsics, second.intrinsics];
    let calibration = StereoCalibration::new(left, right, from_first, board.unit())?;
    let extrinsics = begin + intrinsics;
    let pair = covariance
        .fixed_view::<MOTION, MOTION>(extrinsics, extrinsics)
        .into_owned();
    let [rotation_deg, translation] = motion(&from_first, &pair);
    let rows = RectifiedRows::new(first, second);
    let view_fit = |(id, refused)| {
        let view = bundle.views.iter().find(|view| view.id == id);
        let fit = view.map(|view| fit(&bundle, &rows, view));
        ViewFit { refused, fit }
    };
    let views: Vec<ViewFit> = refused.into_iter().enumerate().map(view_fit).collect();
    let fits = || views.iter().filter_map(|view| view.fit.as_ref());
    let corners = |side: fn(&Fit) -> &Vec<Corner>| -> Vec<Corner> {
        fits().flat_map(|fit| side(fit).iter().copied()).collect()
    };
    let lens_deviations = |begin: usize| &deviations[begin..][..intrinsics];
    let left = camera(&left, lens_deviations(0), &corners(|fit| &fit.left));
    let right = camera(&right, lens_deviations(begin), &corners(|fit| &fit.right));
    let misalignments: Vec<f64> = fits().flat_map(|fit| rows.misalignments(fit)).collect();
    Ok(Solution {
        board: (board.columns(), board.rows()),
        size: first.intrinsics.size(),
        unit: solution::unit(board.unit()),
        left,
        right,
        rotation_deg,
        translation,
        baseline: baseline(&from_first, &pair),
        rms_px: (squares / (numbers.max(2) / 2) as f64).sqrt(),
        corner_deviation_px: variance.sqrt(),
        epipolar: epipolar_error(&misalignments),
        correlations: correlations(&covariance, &first.intrinsics),
        views,
        calibration,
    })
}

/// The sum of the squared residuals of the corners that are used, and their number, two per corner.
fn squared_residuals(bundle: &BundleProblem) -> (f64, usize) {
    let (mut squares, mut numbers) = (0.0, 0);
    for view in &bundle.views {
        for camera in 0..2 {
            for residual in bundle.used_residuals(view, camera).flatten() {
                squares += residual.x.powi(2) + residual.y.powi(2);
                numbers += 2;
            }
        }
    }
    (squares, numbers)
}

/// Refuses focal lengths that the views leave undetermined.
fn check_focal_lengths(bundle: &BundleProblem, deviations: &[f64]) -> Result<()> {
    for (i, name) in ["left", "right"].into_iter().enumerate() {
        let (fx, fy) = bundle.cameras[i].intrinsics.focal_px();
        let begin = bundle.begin(i);
        for (focal, deviation) in [(fx, deviations[begin]), (fy, deviations[begin + 1])] {
            if deviation.is_nan() || deviation > MAX_DEVIATION * focal {
                return Err(parallel(bundle, Some((name, focal, deviation))));
            }
        }
    }
    Ok(())
}

fn epipolar_error(misalignments: &[f64]) -> EpipolarError {
    let mean = |f: &dyn Fn(f64) -> f64| {
        misalignments.iter().map(|v| f(*v)).sum::<f64>() / misalignments.len().max(1) as f64
    };
    EpipolarError {
        mean_px: mean(&f64::abs),
        rms_px: mean(&|v| v * v).sqrt(),
        worst_px: misalignments
            .iter()
            .copied()
            .map(f64::abs)
            .fold(0.0, f64::max),
    }
}

/// The error for boards tilted too little. `focal`: the uncertain focal length's camera, value and
/// standard deviation.
fn parallel(bundle: &BundleProblem, focal: Option<(&str, f64, f64)>) -> Error {
    let normals: Vec<Vector3<f64>> = bundle
        .views
        .iter()
        .map(|view| view.pose.rotation * Vector3::z())
        .collect();
    let angles = normals
        .iter()
        .flat_map(|a| normals.iter().map(move |b| a.angle(b).to_degrees()));
    let widest = angles.fold(0.0, f64::max);
    let what = focal.map_or_else(
        || "the focal lengths are undetermined".to_owned(),
        |(name, value, deviation)| {
            format!(
                "the {name} focal length is {value:.0} ± {deviation:.0} px, too uncertain to use"
            )
        },
    );
    Error::Invalid(format!(
        "{what}: the board's directions in the {} views differ by {widest:.0}° at most; add views \
         with the board tilted by 20° to 45° to the left, right, up and down",
        bundle.views.len()
    ))
}

fn camera(intrinsics: &Intrinsics, deviations: &[f64], corners: &[Corner]) -> CameraEstimate {
    let values = intrinsics.parameters().into_iter().zip(deviations);
    let estimates = values.map(|(value, deviation)| Estimated {
        value,
        deviation: *deviation,
    });
    let parameters = intrinsics.parameter_names().zip(estimates).collect();
    let (width, height) = intrinsics.size();
    let mut seen = [[false; FIELDS.0]; FIELDS.1];
    for Corner { seen: (x, y), .. } in corners.iter().filter(|corner| corner.used) {
        // The cast saturates at 0.
        let field = |at: f64, side: usize, fields: usize| {
            ((at + 0.5) / side as f64 * fields as f64) as usize
        };
        seen[field(*y, height, FIELDS.1).min(FIELDS.1 - 1)]
            [field(*x, width, FIELDS.0).min(FIELDS.0 - 1)] = true;
    }
    let coverage = seen.as_flattened().iter().filter(|seen| **seen).count() as f64
        / (FIELDS.0 * FIELDS.1) as f64;
    CameraEstimate {
        model: intrinsics.distortion().model().name(),
        parameters: CameraParameters(parameters),
        rms_px: rms(corners),
        coverage,
    }
}

/// Rotation vector in degrees and translation with their deviations, from the covariance of a small
/// motion after them.
fn motion(from_first: &Isometry3<f64>, covariance: &Matrix6<f64>) -> [[Estimated; 3]; 2] {
    let rotation = from_first.rotation.scaled_axis();
    let translation = from_first.translation.vector;
    let mut change = Matrix6::identity();
    change
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&inverse_left_jacobian(&rotation));
    change
        .fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&-translation.cross_matrix());
    // The solution's covariance is of a small motion after the extrinsics; propagate it to R and T.
    let covariance = change * covariance * change.transpose();
    let deviation = |i: usize| covariance[(i, i)].sqrt();
    [
        std::array::from_fn(|i| Estimated {
            value: rotation[i].to_degrees(),
            deviation: deviation(i).to_degrees(),
        }),
        std::array::from_fn(|i| Estimated {
            value: translation[i],
            deviation: deviation(3 + i),
        }),
    ]
}

/// Derivative of a rotation vector by a small rotation after it: the inverse left Jacobian of
/// SO(3).
fn inverse_left_jacobian(rotation: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (rotation.norm(), rotation.cross_matrix());
    // The general form is 0/0 at small angles; its limit is 1/12.
    let second = if angle < 1e-4 {
        1.0 / 12.0
    } else {
        1.0 / angle.powi(2) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    Matrix3::identity() - cross / 2.0 + cross * cross * second
}

/// Length of the translation; a rotation after the motion does not change it.
fn baseline(from_first: &Isometry3<f64>, covariance: &Matrix6<f64>) -> Estimated {
    let shift = from_first.translation.vector;
    let along = shift.normalize();
    let variance = along.dot(&(covariance.fixed_view::<3, 3>(3, 3) * along));
    Estimated {
        value: shift.norm(),
        deviation: variance.sqrt(),
    }
}

fn correlations(covariance: &DMatrix<f64>, camera: &Intrinsics) -> Vec<Correlation> {
    const MOTIONS: [&str; MOTION] = [
        "rotation about x",
        "rotation about y",
        "rotation about z",
        "translation x",
        "translation y",
        "translation z",
    ];
    let named =
        |side: &'static str| (camera.parameter_names()).map(move |name| format!("{side} {name}"));
    let names: Vec<String> = named("left")
        .chain(named("right"))
        .chain(MOTIONS.map(str::to_owned))
        .collect();
    let mut pairs = Vec::new();
    for (j, second) in names.iter().enumerate() {
        for (i, first) in names[..j].iter().enumerate() {
            let correlation = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            if correlation.abs() > MAX_CORRELATION {
                pairs.push(Correlation {
                    first: first.clone(),
                    second: second.clone(),
                    correlation,
                });
            }
        }
    }
    pairs.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    pairs
}

/// Corners of one view in one image with their residuals.
fn corners(bundle: &BundleProblem, view: &PosedView, camera: usize) -> Vec<Corner> {
    let image = &view.images[camera];
    let residuals = bundle
        .residuals(view, camera)
        .zip(image.pixels.iter().zip(&image.used));
    // An outlier may be predicted behind the camera.
    let corner = |(residual, (pixel, used)): (Option<Vector2<f64>>, (&Point2<f64>, &bool))| {
        let residual = residual.unwrap_or(Vector2::repeat(f64::INFINITY));
        Corner {
            seen: (pixel.x, pixel.y),
            residual: (residual.x, residual.y),
            used: *used,
        }
    };
    residuals.map(corner).collect()
}

fn rms(corners: &[Corner]) -> f64 {
    let used: Vec<_> = corners.iter().filter(|corner| corner.used).collect();
    let squares: f64 = used
        .iter()
        .map(|c| c.residual.0.powi(2) + c.residual.1.powi(2))
        .sum();
    (squares / used.len().max(1) as f64).sqrt()
}

fn fit(bundle: &BundleProblem, rows: &RectifiedRows, view: &PosedView) -> Fit {
    let (left, right) = (corners(bundle, view, 0), corners(bundle, view, 1));
    let middle = bundle
        .board
        .iter()
        .fold(Vector3::zeros(), |sum, p| sum + p.coords)
        / bundle.board.len() as f64;
    let normal = view.pose.rotation * Vector3::z();
    let mut fit = Fit {
        rms_left_px: rms(&left),
        rms_right_px: rms(&right),
        epipolar_px: 0.0,
        distance: (view.pose * nalgebra::Point3::from(middle)).coords.norm(),
        tilt_deg: normal.z.abs().min(1.0).acos().to_degrees(),
        left,
        right,
    };
    let misalignments = rows.misalignments(&fit);
    fit.epipolar_px =
        misalignments.iter().map(|v| v.abs()).sum::<f64>() / misalignments.len().max(1) as f64;
    fit
}

/// Rows of the corners in ideally rectified images.
struct RectifiedRows<'a> {
    intrinsics: [&'a Intrinsics; 2],
    rotations: [Rotation3<f64>; 2],
    focal_px: f64,
}

impl<'a> RectifiedRows<'a> {
    /// Bouguet's method: half of the rotation goes to each camera, then both rotate so that the
    /// baseline is along x.
    fn new(left: &'a PosedCamera, right: &'a PosedCamera) -> Self {
        let half = Rotation3::from_scaled_axis(right.from_first.rotation.scaled_axis() / 2.0);
        let baseline = half.inverse() * -right.from_first.translation.vector;
        let level =
            Rotation3::rotation_between(&baseline, &Vector3::x()).unwrap_or(Rotation3::identity());
        let focal = |camera: &PosedCamera| {
            (camera.intrinsics.focal_px().0 + camera.intrinsics.focal_px().1) / 2.0
        };
        Self {
            intrinsics: [&left.intrinsics, &right.intrinsics],
            rotations: [level * half, level * half.inverse()],
            focal_px: (focal(left) + focal(right)) / 2.0,
        }
    }

    /// Left minus right row of every corner of a view that is used in both images, pixels.
    fn misalignments(&self, fit: &Fit) -> Vec<f64> {
        let pairs = fit
            .left
            .iter()
            .zip(&fit.right)
            .filter(|(left, right)| left.used && right.used);
        pairs
            .filter_map(|(left, right)| Some(self.row(0, left)? - self.row(1, right)?))
            .collect()
    }

    fn row(&self, camera: usize, corner: &Corner) -> Option<f64> {
        let direction =
            self.intrinsics[camera].direction(Point2::new(corner.seen.0, corner.seen.1))?;
        let rotated = self.rotations[camera] * direction.push(1.0);
        Some(self.focal_px * rotated.y / rotated.z)
    }
}
