//! The numbers of an adjusted pair: standard deviations, residuals, epipolar error.

use super::scene::{Camera as SceneCamera, LENS, Loss, MOTION, Scene, Shot};
use super::solution::{
    self, Camera, Corner, Correlation, Epipolar, Estimate, Fit, Solution, ViewFit,
};
use crate::calibrate::Board;
use crate::error::{Error, Result};
use crate::stereo::{Intrinsics, StereoCalibration};
use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6, Point2, Rotation3, Vector2, Vector3};

/// A focal length less sure than this share of it is none.
const UNSURE: f64 = 0.03;
/// Correlations beyond this are told.
const STRONG: f64 = 0.9;
/// Columns and rows of fields of which the coverage speaks.
const FIELDS: (usize, usize) = (8, 6);

pub(super) fn solution(
    board: &Board,
    scene: Scene,
    refused: Vec<Option<String>>,
) -> Result<Solution> {
    let (mut squares, mut numbers) = (0.0, 0_usize);
    for residual in scene
        .shots
        .iter()
        .flat_map(|shot| (0..2).flat_map(|camera| corners(&scene, shot, camera)))
    {
        if residual.used {
            squares += residual.residual.0.powi(2) + residual.residual.1.powi(2);
            numbers += 2;
        }
    }
    let unknowns = scene.parameters() + MOTION * scene.shots.len();
    let variance = squares / numbers.saturating_sub(unknowns).max(1) as f64;
    let covariance = scene
        .normal(Loss::Squares)
        .covariance()
        .map(|c| c * variance);
    let covariance = covariance.ok_or_else(|| parallel(&scene, None))?;
    let deviations: Vec<f64> = covariance.diagonal().iter().map(|v| v.sqrt()).collect();

    let [first, second] = [0, 1].map(|i| &scene.cameras[i]);
    for (name, camera, begin) in [("left", first, 0), ("right", second, Scene::begin(1))] {
        let (fx, fy) = camera.lens.focal_px();
        for (focal, deviation) in [(fx, deviations[begin]), (fy, deviations[begin + 1])] {
            if deviation.is_nan() || deviation > UNSURE * focal {
                return Err(parallel(&scene, Some((name, focal, deviation))));
            }
        }
    }
    let place = second.place;
    let calibration = StereoCalibration::new(first.lens, second.lens, place, board.unit())?;
    let pair = covariance
        .fixed_view::<MOTION, MOTION>(Scene::begin(1) + LENS, Scene::begin(1) + LENS)
        .into_owned();
    let [rotation_deg, translation] = motion(&place, &pair);
    let rows = Rows::new(first, second);
    let views: Vec<ViewFit> = refused
        .into_iter()
        .enumerate()
        .map(|(id, refused)| {
            let shot = scene.shots.iter().find(|shot| shot.id == id);
            ViewFit {
                refused,
                fit: shot.map(|shot| fit(&scene, &rows, shot)),
            }
        })
        .collect();
    let fits = || views.iter().filter_map(|view| view.fit.as_ref());
    let camera = |lens: &Intrinsics, begin: usize, corners: &dyn Fn(&Fit) -> &Vec<Corner>| {
        let all: Vec<Corner> = fits()
            .flat_map(|fit| corners(fit).iter().copied())
            .collect();
        camera(lens, &deviations[begin..begin + LENS], &all)
    };
    let (left, right) = (
        camera(&first.lens, 0, &|fit| &fit.left),
        camera(&second.lens, Scene::begin(1), &|fit| &fit.right),
    );
    let apart: Vec<f64> = fits().flat_map(|fit| rows.apart(fit)).collect();
    let mean = |f: &dyn Fn(f64) -> f64| {
        apart.iter().map(|v| f(*v)).sum::<f64>() / apart.len().max(1) as f64
    };
    Ok(Solution {
        board: (board.columns(), board.rows()),
        size: first.lens.size(),
        unit: solution::unit(board.unit()),
        left,
        right,
        rotation_deg,
        translation,
        baseline: baseline(&place, &pair),
        rms_px: (squares / (numbers.max(2) / 2) as f64).sqrt(),
        corner_deviation_px: variance.sqrt(),
        epipolar: Epipolar {
            mean_px: mean(&f64::abs),
            rms_px: mean(&|v| v * v).sqrt(),
            worst_px: apart.iter().copied().map(f64::abs).fold(0.0, f64::max),
        },
        correlations: correlations(&covariance),
        views,
        calibration,
    })
}

/// Too little tilt, told by how sure a focal length is: its camera, value and standard deviation.
fn parallel(scene: &Scene, focal: Option<(&str, f64, f64)>) -> Error {
    let normals: Vec<Vector3<f64>> = scene
        .shots
        .iter()
        .map(|shot| shot.pose.rotation * Vector3::z())
        .collect();
    let angles = normals
        .iter()
        .flat_map(|a| normals.iter().map(move |b| a.angle(b).to_degrees()));
    let widest = angles.fold(0.0, f64::max);
    let what = focal.map_or_else(
        || "the focal lengths cannot be told".to_owned(),
        |(name, value, deviation)| {
            format!("the {name} focal length is {value:.0} ± {deviation:.0} px, too unsure to use")
        },
    );
    Error::Invalid(format!(
        "{what}: the board's directions in the {} views differ by {widest:.0}° at most; add views \
         with the board tilted by 20° to 45° to the left, right, up and down",
        scene.shots.len()
    ))
}

fn camera(lens: &Intrinsics, deviations: &[f64], corners: &[Corner]) -> Camera {
    let values = lens.parameters();
    let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = std::array::from_fn(|i| Estimate {
        value: values[i],
        deviation: deviations[i],
    });
    let (width, height) = lens.size();
    let mut seen = [[false; FIELDS.0]; FIELDS.1];
    for Corner { seen: (x, y), .. } in corners.iter().filter(|corner| corner.used) {
        // A float becomes 0 below it.
        let field = |at: f64, side: usize, fields: usize| {
            ((at + 0.5) / side as f64 * fields as f64) as usize
        };
        seen[field(*y, height, FIELDS.1).min(FIELDS.1 - 1)]
            [field(*x, width, FIELDS.0).min(FIELDS.0 - 1)] = true;
    }
    let coverage = seen.as_flattened().iter().filter(|seen| **seen).count() as f64
        / (FIELDS.0 * FIELDS.1) as f64;
    Camera {
        fx,
        fy,
        cx,
        cy,
        k1,
        k2,
        p1,
        p2,
        k3,
        rms_px: rms(corners),
        coverage,
    }
}

/// Rotation vector in degrees and translation with their deviations, from the covariance of a small
/// motion after them.
fn motion(place: &Isometry3<f64>, covariance: &Matrix6<f64>) -> [[Estimate; 3]; 2] {
    let (turn, shift) = (place.rotation.scaled_axis(), place.translation.vector);
    let mut change = Matrix6::identity();
    change
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&by_turn(&turn));
    change
        .fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&-shift.cross_matrix());
    let covariance = change * covariance * change.transpose();
    let deviation = |i: usize| covariance[(i, i)].sqrt();
    [
        std::array::from_fn(|i| Estimate {
            value: turn[i].to_degrees(),
            deviation: deviation(i).to_degrees(),
        }),
        std::array::from_fn(|i| Estimate {
            value: shift[i],
            deviation: deviation(3 + i),
        }),
    ]
}

/// How a rotation vector changes with a small rotation after it (the inverse left Jacobian of
/// SO(3)).
fn by_turn(turn: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (turn.norm(), turn.cross_matrix());
    let second = if angle < 1e-4 {
        1.0 / 12.0
    } else {
        1.0 / angle.powi(2) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    Matrix3::identity() - cross / 2.0 + cross * cross * second
}

/// A turn after it does not change the distance.
fn baseline(place: &Isometry3<f64>, covariance: &Matrix6<f64>) -> Estimate {
    let shift = place.translation.vector;
    let along = shift.normalize();
    let variance = along.dot(&(covariance.fixed_view::<3, 3>(3, 3) * along));
    Estimate {
        value: shift.norm(),
        deviation: variance.sqrt(),
    }
}

fn correlations(covariance: &DMatrix<f64>) -> Vec<Correlation> {
    const LENSES: [&str; LENS] = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"];
    const MOTIONS: [&str; MOTION] = [
        "rotation about x",
        "rotation about y",
        "rotation about z",
        "translation x",
        "translation y",
        "translation z",
    ];
    let lens = |side: &'static str| LENSES.iter().map(move |name| format!("{side} {name}"));
    let names: Vec<String> = lens("left")
        .chain(lens("right"))
        .chain(MOTIONS.map(str::to_owned))
        .collect();
    let mut pairs = Vec::new();
    for (j, second) in names.iter().enumerate() {
        for (i, first) in names[..j].iter().enumerate() {
            let correlation = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            if correlation.abs() > STRONG {
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
fn corners(scene: &Scene, shot: &Shot, camera: usize) -> Vec<Corner> {
    let image = &shot.images[camera];
    let residuals = scene
        .residuals(shot, camera)
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

fn fit(scene: &Scene, rows: &Rows, shot: &Shot) -> Fit {
    let (left, right) = (corners(scene, shot, 0), corners(scene, shot, 1));
    let middle = scene
        .board
        .iter()
        .fold(Vector3::zeros(), |sum, p| sum + p.coords)
        / scene.board.len() as f64;
    let normal = shot.pose.rotation * Vector3::z();
    let mut fit = Fit {
        rms_left_px: rms(&left),
        rms_right_px: rms(&right),
        epipolar_px: 0.0,
        distance: (shot.pose * nalgebra::Point3::from(middle)).coords.norm(),
        tilt_deg: normal.z.abs().min(1.0).acos().to_degrees(),
        left,
        right,
    };
    let apart = rows.apart(&fit);
    fit.epipolar_px = apart.iter().map(|v| v.abs()).sum::<f64>() / apart.len().max(1) as f64;
    fit
}

/// The rows of rectified images.
struct Rows<'a> {
    lenses: [&'a Intrinsics; 2],
    turns: [Rotation3<f64>; 2],
    focal_px: f64,
}

impl<'a> Rows<'a> {
    /// The rotation is split between the cameras, then the baseline turned to x (Bouguet's way).
    fn new(left: &'a SceneCamera, right: &'a SceneCamera) -> Self {
        let half = Rotation3::from_scaled_axis(right.place.rotation.scaled_axis() / 2.0);
        let baseline = half.inverse() * -right.place.translation.vector;
        let level =
            Rotation3::rotation_between(&baseline, &Vector3::x()).unwrap_or(Rotation3::identity());
        let focal =
            |camera: &SceneCamera| (camera.lens.focal_px().0 + camera.lens.focal_px().1) / 2.0;
        Self {
            lenses: [&left.lens, &right.lens],
            turns: [level * half, level * half.inverse()],
            focal_px: (focal(left) + focal(right)) / 2.0,
        }
    }

    /// Left minus right row of every corner of a view that is used in both images, pixels.
    fn apart(&self, fit: &Fit) -> Vec<f64> {
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
        let direction = self.lenses[camera].direction(Point2::new(corner.seen.0, corner.seen.1))?;
        let turned = self.turns[camera] * direction.push(1.0);
        Some(self.focal_px * turned.y / turned.z)
    }
}
