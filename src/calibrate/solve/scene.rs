//! What was seen, and what is sought: cameras, their places, and the board's pose in every view.

use crate::stereo::Intrinsics;
use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix2x3, Matrix3, Matrix6, Point2, Point3, Rotation3, SMatrix,
    SVector, Translation3, Vector2, Vector3, Vector6,
};

/// Parameters of a lens, and of a motion: rotation vector, then translation.
pub(super) const LENS: usize = 9;
pub(super) const MOTION: usize = 6;

/// The corners of one view in one image. What is not `used` is an outlier.
#[derive(Clone, Debug)]
pub(super) struct Image {
    pub pixels: Vec<Point2<f64>>,
    pub used: Vec<bool>,
}

impl Image {
    pub fn new(pixels: &[Point2<f64>]) -> Self {
        Self {
            pixels: pixels.to_vec(),
            used: vec![true; pixels.len()],
        }
    }
}

/// One view in every image.
#[derive(Clone, Debug)]
pub(super) struct Shot {
    /// Its place among the views that were given.
    pub id: usize,
    pub images: Vec<Image>,
    /// Board to first camera.
    pub pose: Isometry3<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct Camera {
    pub lens: Intrinsics,
    /// First camera to this one.
    pub place: Isometry3<f64>,
}

/// One camera or several that see the same board. The first one's place is the origin and fixed.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    pub board: Vec<Point3<f64>>,
    pub cameras: Vec<Camera>,
    pub shots: Vec<Shot>,
}

/// How a residual counts.
#[derive(Clone, Copy, Debug)]
pub(super) enum Loss {
    Squares,
    /// Cauchy's: residuals far above this many pixels hardly count.
    Robust(f64),
}

impl Loss {
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

/// Gauss and Newton's normal equations, one row of blocks per pose: poses meet each other nowhere.
pub(super) struct Normal {
    pub cameras: DMatrix<f64>,
    pub cameras_right: DVector<f64>,
    pub poses: Vec<PoseBlock>,
}

pub(super) struct PoseBlock {
    /// Cameras by pose.
    pub mixed: DMatrix<f64>,
    pub pose: Matrix6<f64>,
    pub right: Vector6<f64>,
}

impl Scene {
    /// Parameters of all cameras: 9 of the first, then 9 and 6 of each other.
    pub fn parameters(&self) -> usize {
        LENS + (self.cameras.len() - 1) * (LENS + MOTION)
    }

    /// Where the parameters of a camera begin.
    pub fn begin(camera: usize) -> usize {
        camera * LENS + camera.saturating_sub(1) * MOTION
    }

    /// Seen minus predicted of every corner, used or not; nothing for what would be behind the
    /// camera.
    pub fn residuals(
        &self,
        shot: &Shot,
        camera: usize,
    ) -> impl Iterator<Item = Option<Vector2<f64>>> {
        let Camera { lens, place } = &self.cameras[camera];
        let pose = place * shot.pose;
        let pixels = &shot.images[camera].pixels;
        self.board
            .iter()
            .zip(pixels)
            .map(move |(point, pixel)| Some(pixel - lens.project(&(pose * point))?))
    }

    /// Sum over the used corners; nothing when one of them is behind a camera or nowhere.
    pub fn cost(&self, loss: Loss) -> Option<f64> {
        let mut sum = 0.0;
        for shot in &self.shots {
            for (camera, image) in shot.images.iter().enumerate() {
                for (residual, _) in self
                    .residuals(shot, camera)
                    .zip(&image.used)
                    .filter(|(_, used)| **used)
                {
                    sum += loss.cost(residual?.norm_squared());
                }
            }
        }
        sum.is_finite().then_some(sum)
    }

    pub fn normal(&self, loss: Loss) -> Normal {
        let n = self.parameters();
        let (mut cameras, mut cameras_right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let block = |shot: &Shot| {
            let mut block = PoseBlock {
                mixed: DMatrix::zeros(n, MOTION),
                pose: Matrix6::zeros(),
                right: Vector6::zeros(),
            };
            for camera in 0..self.cameras.len() {
                let (a, b) = self.image(shot, camera, loss);
                // A motion of the board before the first camera is one before this camera.
                let by_pose = adjoint(&self.cameras[camera].place);
                let (begin, own) = (
                    Self::begin(camera),
                    LENS + if camera == 0 { 0 } else { MOTION },
                );
                let mut target = cameras.view_mut((begin, begin), (own, own));
                target += a.view((0, 0), (own, own));
                let mut target = cameras_right.rows_mut(begin, own);
                target += b.rows(0, own);
                let (moving, right) = (
                    a.fixed_columns::<MOTION>(LENS),
                    b.fixed_rows::<MOTION>(LENS),
                );
                let mixed = moving * by_pose;
                let mut target = block.mixed.rows_mut(begin, own);
                target += mixed.rows(0, own);
                block.pose += by_pose.transpose() * mixed.fixed_rows::<MOTION>(LENS);
                block.right += by_pose.transpose() * right;
            }
            block
        };
        let poses = self.shots.iter().map(block).collect();
        Normal {
            cameras,
            cameras_right,
            poses,
        }
    }

    /// Normal equations of one image, by its lens and by the board's motion before this camera.
    fn image(
        &self,
        shot: &Shot,
        camera: usize,
        loss: Loss,
    ) -> (SMatrix<f64, 15, 15>, SVector<f64, 15>) {
        let Camera { lens, place } = &self.cameras[camera];
        let pose = place * shot.pose;
        let (mut a, mut b) = (SMatrix::zeros(), SVector::zeros());
        let Image { pixels, used } = &shot.images[camera];
        for ((point, pixel), _) in self
            .board
            .iter()
            .zip(pixels)
            .zip(used)
            .filter(|(_, used)| **used)
        {
            let (predicted, derivative) = linearize(lens, &(pose * point));
            let residual = pixel - predicted;
            let weight = loss.weight(residual.norm_squared());
            let weighted = derivative.transpose() * weight;
            a += weighted * derivative;
            b += weighted * residual;
        }
        (a, b)
    }

    /// The scene after a step: of the cameras' parameters, and of each pose.
    pub fn moved(&self, cameras: &DVector<f64>, poses: &[Vector6<f64>]) -> Option<Self> {
        let mut next = self.clone();
        for (i, camera) in next.cameras.iter_mut().enumerate() {
            let begin = Self::begin(i);
            let mut parameters = camera.lens.parameters();
            parameters
                .iter_mut()
                .zip(cameras.rows(begin, LENS).iter())
                .for_each(|(p, step)| *p += step);
            camera.lens = camera.lens.with_parameters(parameters).ok()?;
            if i > 0 {
                camera.place =
                    motion(cameras.fixed_rows::<MOTION>(begin + LENS).into_owned()) * camera.place;
            }
        }
        for (shot, step) in next.shots.iter_mut().zip(poses) {
            shot.pose = motion(*step) * shot.pose;
        }
        Some(next)
    }
}

/// The pixel of a point in the camera frame, with its derivatives by the lens and by a small motion
/// of the point.
fn linearize(lens: &Intrinsics, point: &Point3<f64>) -> (Point2<f64>, SMatrix<f64, 2, 15>) {
    let (x, y) = (point.x / point.z, point.y / point.z);
    let (pixel, by_direction, by_lens) = lens.linearize(Vector2::new(x, y));
    let turned = Matrix2x3::new(-x * y, 1.0 + x * x, -y, -(1.0 + y * y), x * y, x);
    let shifted = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / point.z;
    let mut derivative = SMatrix::<f64, 2, 15>::zeros();
    derivative.fixed_columns_mut::<LENS>(0).copy_from(&by_lens);
    derivative
        .fixed_columns_mut::<3>(LENS)
        .copy_from(&(by_direction * turned));
    derivative
        .fixed_columns_mut::<3>(LENS + 3)
        .copy_from(&(by_direction * shifted));
    (pixel, derivative)
}

/// A small rotation vector and translation as a motion.
fn motion(step: Vector6<f64>) -> Isometry3<f64> {
    let (turn, shift) = (
        Vector3::new(step[0], step[1], step[2]),
        Vector3::new(step[3], step[4], step[5]),
    );
    Isometry3::from_parts(
        Translation3::from(shift),
        nalgebra::UnitQuaternion::from_scaled_axis(turn),
    )
}

/// What a small motion before a change of frames is after it.
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

/// Whether all corners of a board are before a camera.
pub(super) fn in_front(board: &[Point3<f64>], pose: &Isometry3<f64>) -> bool {
    board.iter().all(|point| (pose * point).z > 0.0)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Two cameras of which one is turned, and what they see of a board in three poses, off by some
    /// pixels.
    pub fn pair() -> Scene {
        let lens = |f: f64, k1: f64| {
            Intrinsics::new(
                (640, 480),
                (f, f + 3.0),
                (322.0, 236.0),
                [k1, 0.1, 0.001, -0.002, 0.01],
            )
            .unwrap()
        };
        let place = Isometry3::new(
            Vector3::new(-0.12, 0.01, 0.02),
            Vector3::new(0.02, 0.1, -0.03),
        );
        let cameras = vec![
            Camera {
                lens: lens(500.0, -0.2),
                place: Isometry3::identity(),
            },
            Camera {
                lens: lens(520.0, 0.1),
                place,
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
        let shot = |(id, turn): (usize, &Vector3<f64>)| {
            let pose = Isometry3::new(Vector3::new(-0.05, -0.04, 0.6), *turn);
            let image = |camera: &Camera| {
                let off = |k: usize| {
                    Vector2::new(
                        ((k * 7 + id) % 5) as f64 - 2.0,
                        ((k * 3 + id) % 4) as f64 - 1.5,
                    )
                };
                let seen = board
                    .iter()
                    .map(|p| camera.lens.project(&(camera.place * pose * p)).unwrap());
                let pixels: Vec<_> = seen.enumerate().map(|(k, pixel)| pixel + off(k)).collect();
                let used = (0..pixels.len()).map(|k| k != 5).collect();
                Image { pixels, used }
            };
            Shot {
                id,
                images: cameras.iter().map(image).collect(),
                pose,
            }
        };
        let shots = turns.iter().enumerate().map(shot).collect();
        Scene {
            board,
            cameras,
            shots,
        }
    }

    #[test]
    fn the_right_hand_side_is_the_slope_of_the_cost() {
        let scene = pair();
        for loss in [Loss::Squares, Loss::Robust(1.5)] {
            let normal = scene.normal(loss);
            let none = vec![Vector6::zeros(); scene.shots.len()];
            let slope = |step: &dyn Fn(f64) -> Scene, h: f64| {
                (step(h).cost(loss).unwrap() - step(-h).cost(loss).unwrap()) / (2.0 * h)
            };
            for i in 0..scene.parameters() {
                let step = |h: f64| {
                    let mut cameras = DVector::zeros(scene.parameters());
                    cameras[i] = h;
                    scene.moved(&cameras, &none).unwrap()
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
                    scene
                        .moved(&DVector::zeros(scene.parameters()), &poses)
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
    fn what_is_behind_has_no_cost() {
        let mut scene = pair();
        scene.shots[0].pose.translation.vector.z = -1.0;
        assert_eq!(scene.cost(Loss::Squares), None);
    }
}
