//! The bundle adjustment problem: observed corners, and the unknowns: intrinsics, extrinsics, and
//! the board's pose in every view.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix2x3, Matrix3, Matrix6, Point2, Point3, Rotation3, SMatrix,
    SVector, Vector2, Vector3, Vector6,
};
use svl_core::stereo::Intrinsics;

/// Number of parameters of a rigid motion: rotation vector, then translation.
pub(super) const MOTION: usize = 6;
/// Limit on the parameters of a camera's intrinsics, and of these and its motion.
const MAX_INTRINSICS: usize = 12;
const MAX_CAMERA: usize = MAX_INTRINSICS + MOTION;

/// The corners of one view in one image. Those that are not `used` are outliers.
#[derive(Clone, Debug)]
pub(super) struct ImageCorners {
    pub pixels: Vec<Point2<f64>>,
    pub used: Vec<bool>,
}

impl ImageCorners {
    pub fn new(pixels: &[Point2<f64>]) -> Self {
        Self {
            pixels: pixels.to_vec(),
            used: vec![true; pixels.len()],
        }
    }
}

/// One view in the images of all cameras.
#[derive(Clone, Debug)]
pub(super) struct PosedView {
    /// Index among the given views.
    pub id: usize,
    pub images: Vec<ImageCorners>,
    /// `X_first_camera = pose · X_board`.
    pub pose: Isometry3<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct PosedCamera {
    pub intrinsics: Intrinsics,
    /// `X_camera = from_first · X_first_camera`.
    pub from_first: Isometry3<f64>,
}

/// One or more cameras that see the same board. The first one is the origin, so its pose is fixed.
#[derive(Clone, Debug)]
pub(super) struct BundleProblem {
    pub board: Vec<Point3<f64>>,
    pub cameras: Vec<PosedCamera>,
    pub views: Vec<PosedView>,
}

/// Cost of a squared residual.
#[derive(Clone, Copy, Debug)]
pub(super) enum LossFunction {
    Squares,
    /// Cauchy's loss: residuals far above this many pixels hardly count.
    Robust(f64),
}

impl LossFunction {
    fn cost(self, squared: f64) -> f64 {
        match self {
            Self::Squares => squared,
            Self::Robust(scale) => scale * scale * (squared / (scale * scale)).ln_1p(),
        }
    }

    /// Derivative of the cost.
    fn weight(self, squared: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Robust(scale) => 1.0 / (1.0 + squared / (scale * scale)),
        }
    }
}

/// Gauss-Newton normal equations, one row of blocks per pose: no residual depends on two poses.
pub(super) struct NormalEquations {
    pub cameras: DMatrix<f64>,
    pub cameras_right: DVector<f64>,
    pub poses: Vec<PoseBlock>,
}

pub(super) struct PoseBlock {
    /// Rows: parameters of all cameras. Columns: this pose.
    pub mixed: DMatrix<f64>,
    pub pose: Matrix6<f64>,
    pub right: Vector6<f64>,
}

impl BundleProblem {
    /// Number of parameters of each camera's intrinsics. All cameras have one distortion model.
    pub fn intrinsics(&self) -> usize {
        self.cameras[0].intrinsics.parameter_names().count()
    }

    /// Number of parameters of all cameras: intrinsics of the first, then intrinsics and motion of
    /// each other.
    pub fn parameters(&self) -> usize {
        self.begin(self.cameras.len())
    }

    /// Index of a camera's first parameter.
    pub fn begin(&self, camera: usize) -> usize {
        camera * self.intrinsics() + camera.saturating_sub(1) * MOTION
    }

    /// Observed minus predicted pixel of every corner, used or not; `None` if the prediction is
    /// behind the camera.
    pub fn residuals(
        &self,
        view: &PosedView,
        camera: usize,
    ) -> impl Iterator<Item = Option<Vector2<f64>>> {
        let seen_by = &self.cameras[camera];
        let pose = seen_by.from_first * view.pose;
        let corners = self.board.iter().zip(&view.images[camera].pixels);
        corners
            .map(move |(point, pixel)| Some(pixel - seen_by.intrinsics.project(&(pose * point))?))
    }

    /// [`Self::residuals`] of only the used corners.
    pub fn used_residuals(
        &self,
        view: &PosedView,
        camera: usize,
    ) -> impl Iterator<Item = Option<Vector2<f64>>> {
        let used = &view.images[camera].used;
        let residuals = self.residuals(view, camera).zip(used);
        residuals.filter_map(|(residual, used)| used.then_some(residual))
    }

    /// Sum over the used corners; `None` if the prediction of one of them is behind a camera.
    pub fn cost(&self, loss: LossFunction) -> Option<f64> {
        let mut sum = 0.0;
        for view in &self.views {
            for camera in 0..view.images.len() {
                for residual in self.used_residuals(view, camera) {
                    sum += loss.cost(residual?.norm_squared());
                }
            }
        }
        sum.is_finite().then_some(sum)
    }

    pub fn normal(&self, loss: LossFunction) -> NormalEquations {
        let (n, intrinsics) = (self.parameters(), self.intrinsics());
        let (mut cameras, mut cameras_right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let block = |view: &PosedView| {
            let mut block = PoseBlock {
                mixed: DMatrix::zeros(n, MOTION),
                pose: Matrix6::zeros(),
                right: Vector6::zeros(),
            };
            for camera in 0..self.cameras.len() {
                let (a, b) = self.image(view, camera, loss);
                // The pose is relative to the first camera. A small motion there is its adjoint in
                // the frame of this camera: the chain rule from this camera's frame to the pose.
                let by_pose = adjoint(&self.cameras[camera].from_first);
                // The first camera is the origin: only its intrinsics are unknown.
                let own = intrinsics + if camera == 0 { 0 } else { MOTION };
                let begin = self.begin(camera);
                let mut target = cameras.view_mut((begin, begin), (own, own));
                target += a.view((0, 0), (own, own));
                let mut target = cameras_right.rows_mut(begin, own);
                target += b.rows(0, own);
                let right = b.fixed_rows::<MOTION>(intrinsics);
                let mixed = a.fixed_columns::<MOTION>(intrinsics) * by_pose;
                let mut target = block.mixed.rows_mut(begin, own);
                target += mixed.rows(0, own);
                block.pose += by_pose.transpose() * mixed.fixed_rows::<MOTION>(intrinsics);
                block.right += by_pose.transpose() * right;
            }
            block
        };
        let poses = self.views.iter().map(block).collect();
        NormalEquations {
            cameras,
            cameras_right,
            poses,
        }
    }

    /// Normal equations of one image, by its intrinsics and by the board's motion in front of this
    /// camera.
    fn image(
        &self,
        view: &PosedView,
        camera: usize,
        loss: LossFunction,
    ) -> (
        SMatrix<f64, MAX_CAMERA, MAX_CAMERA>,
        SVector<f64, MAX_CAMERA>,
    ) {
        let seen_by = &self.cameras[camera];
        let pose = seen_by.from_first * view.pose;
        let (mut a, mut b) = (SMatrix::zeros(), SVector::zeros());
        let ImageCorners { pixels, used } = &view.images[camera];
        let corners = self.board.iter().zip(pixels).zip(used);
        for ((point, pixel), _) in corners.filter(|(_, used)| **used) {
            let (predicted, derivative) = linearize(&seen_by.intrinsics, &(pose * point));
            let residual = pixel - predicted;
            // Iteratively reweighted least squares: a robust loss only scales the residual.
            let weight = loss.weight(residual.norm_squared());
            let weighted = derivative.transpose() * weight;
            a += weighted * derivative;
            b += weighted * residual;
        }
        (a, b)
    }

    /// The problem after a step of the cameras' parameters and of each pose; `None` for invalid
    /// intrinsics.
    pub fn moved(&self, cameras: &DVector<f64>, poses: &[Vector6<f64>]) -> Option<Self> {
        let (mut next, intrinsics) = (self.clone(), self.intrinsics());
        for (i, camera) in next.cameras.iter_mut().enumerate() {
            let begin = self.begin(i);
            let mut parameters = camera.intrinsics.parameters();
            parameters
                .iter_mut()
                .zip(cameras.rows(begin, intrinsics).iter())
                .for_each(|(p, step)| *p += step);
            camera.intrinsics = camera.intrinsics.with_parameters(&parameters).ok()?;
            if i > 0 {
                camera.from_first = motion(
                    cameras
                        .fixed_rows::<MOTION>(begin + intrinsics)
                        .into_owned(),
                ) * camera.from_first;
            }
        }
        for (view, step) in next.views.iter_mut().zip(poses) {
            view.pose = motion(*step) * view.pose;
        }
        Some(next)
    }
}

/// The pixel of a point in the camera frame, with its derivatives by the intrinsics and by a small
/// motion of the point, one a column; the rest of the columns are 0.
fn linearize(
    intrinsics: &Intrinsics,
    point: &Point3<f64>,
) -> (Point2<f64>, SMatrix<f64, 2, MAX_CAMERA>) {
    let count = intrinsics.parameter_names().count();
    let (x, y) = (point.x / point.z, point.y / point.z);
    let (pixel, by_direction, by_intrinsics) = intrinsics.linearize(Vector2::new(x, y));
    // ∂(X/Z, Y/Z) by a rotation and a translation of the point after the motion.
    let by_rotation = Matrix2x3::new(-x * y, 1.0 + x * x, -y, -(1.0 + y * y), x * y, x);
    let by_translation = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / point.z;
    let mut derivative = SMatrix::<f64, 2, MAX_CAMERA>::zeros();
    derivative
        .fixed_columns_mut::<MAX_INTRINSICS>(0)
        .copy_from(&by_intrinsics);
    derivative
        .fixed_columns_mut::<3>(count)
        .copy_from(&(by_direction * by_rotation));
    derivative
        .fixed_columns_mut::<3>(count + 3)
        .copy_from(&(by_direction * by_translation));
    (pixel, derivative)
}

/// The rigid motion of a rotation vector and a translation.
fn motion(step: Vector6<f64>) -> Isometry3<f64> {
    let rotation = Vector3::new(step[0], step[1], step[2]);
    let translation = Vector3::new(step[3], step[4], step[5]);
    Isometry3::new(translation, rotation)
}

/// The adjoint of SE(3): turns a small motion in one frame into the same motion in the other.
fn adjoint(change: &Isometry3<f64>) -> Matrix6<f64> {
    let rotation: Rotation3<f64> = change.rotation.to_rotation_matrix();
    let mut adjoint = Matrix6::zeros();
    adjoint
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(rotation.matrix());
    adjoint
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(rotation.matrix());
    let crossed: Matrix3<f64> = change.translation.vector.cross_matrix() * rotation.matrix();
    adjoint.fixed_view_mut::<3, 3>(3, 0).copy_from(&crossed);
    adjoint
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    fn intrinsics(f: f64, k1: f64) -> Intrinsics {
        let distortion = [k1, 0.1, 0.001, -0.002, 0.01];
        Intrinsics::new((640, 480), (f, f + 3.0), (322.0, 236.0), distortion).unwrap()
    }

    /// Two cameras, one of them rotated, and their views of a board in three poses, with errors of
    /// a few pixels.
    pub fn pair() -> BundleProblem {
        let from_first = Isometry3::new(
            Vector3::new(-0.12, 0.01, 0.02),
            Vector3::new(0.02, 0.1, -0.03),
        );
        let cameras = vec![
            PosedCamera {
                intrinsics: intrinsics(500.0, -0.2),
                from_first: Isometry3::identity(),
            },
            PosedCamera {
                intrinsics: intrinsics(520.0, 0.1),
                from_first,
            },
        ];
        let board: Vec<_> = (0..12)
            .map(|i| Point3::new(f64::from(i % 4) * 0.04, f64::from(i / 4) * 0.04, 0.0))
            .collect();
        let turns = [
            Vector3::new(0.5, 0.0, 0.1),
            Vector3::new(-0.3, 0.4, 0.0),
            Vector3::new(0.1, -0.5, -0.2),
        ];
        let view = |(id, turn): (usize, &Vector3<f64>)| {
            let pose = Isometry3::new(Vector3::new(-0.05, -0.04, 0.6), *turn);
            let image = |camera: &PosedCamera| {
                let off = |k: usize| {
                    Vector2::new(
                        ((k * 7 + id) % 5) as f64 - 2.0,
                        ((k * 3 + id) % 4) as f64 - 1.5,
                    )
                };
                let seen = board.iter().map(|p| {
                    camera
                        .intrinsics
                        .project(&(camera.from_first * pose * p))
                        .unwrap()
                });
                let pixels: Vec<_> = seen.enumerate().map(|(k, pixel)| pixel + off(k)).collect();
                let used = (0..pixels.len()).map(|k| k != 5).collect();
                ImageCorners { pixels, used }
            };
            PosedView {
                id,
                images: cameras.iter().map(image).collect(),
                pose,
            }
        };
        let views = turns.iter().enumerate().map(view).collect();
        BundleProblem {
            board,
            cameras,
            views,
        }
    }

    #[test]
    fn the_right_hand_side_is_the_gradient_of_the_cost() {
        let bundle = pair();
        for loss in [LossFunction::Squares, LossFunction::Robust(1.5)] {
            let normal = bundle.normal(loss);
            let none = vec![Vector6::zeros(); bundle.views.len()];
            let slope = |step: &dyn Fn(f64) -> BundleProblem, h: f64| {
                (step(h).cost(loss).unwrap() - step(-h).cost(loss).unwrap()) / (2.0 * h)
            };
            for i in 0..bundle.parameters() {
                let step = |h: f64| {
                    let mut cameras = DVector::zeros(bundle.parameters());
                    cameras[i] = h;
                    bundle.moved(&cameras, &none).unwrap()
                };
                let (slope, expected) = (slope(&step, 1e-6), -2.0 * normal.cameras_right[i]);
                assert!(
                    (slope - expected).abs() < 1e-4 * expected.abs().max(1.0),
                    "{i}: {slope} {expected}"
                );
            }
            for i in 0..MOTION {
                let step = |h: f64| {
                    let mut poses = none.clone();
                    poses[1][i] = h;
                    bundle
                        .moved(&DVector::zeros(bundle.parameters()), &poses)
                        .unwrap()
                };
                let (slope, expected) = (slope(&step, 1e-6), -2.0 * normal.poses[1].right[i]);
                assert!(
                    (slope - expected).abs() < 1e-4 * expected.abs().max(1.0),
                    "pose {i}: {slope} {expected}"
                );
            }
        }
    }

    #[test]
    fn corners_behind_the_camera_have_no_cost() {
        let mut bundle = pair();
        bundle.views[0].pose.translation.vector.z = -1.0;
        assert_eq!(bundle.cost(LossFunction::Squares), None);
    }
}
