//! A simulated board moved in front of two cameras with exactly known intrinsics, distortion and
//! extrinsics.
//!
//! Not simulated: gloss, shadows and occlusion by hands; paper that is not flat; saturated pixels.

mod picture;

pub use picture::{Look, Rays, render};

use super::{Board, StereoView};
use nalgebra::{Isometry3, Point2, Translation3, UnitQuaternion, Vector3};
use svl_core::Result;
use svl_core::stereo::{Distortion, Intrinsics, LengthUnit, StereoCalibration, StereoPair};

/// Pairs per second.
pub const RATE_HZ: f64 = 10.0;

/// Number of poses in which the board is held still; pairs in each, and on the way to the next.
const POSES: usize = 24;
const HELD: u64 = 3;
const MOVING: u64 = 5;
/// Exposure time as a fraction of the time between two pairs, and the number of moments rendered in
/// it: motion blur.
const SHUTTER: f64 = 0.1;
const MOMENTS: usize = 3;
/// Least distance of the corners from the edges of both images.
const MARGIN_PX: f64 = 14.0;

const SIDE_M: f64 = 0.03;
const LOOK: Look = Look {
    blur_px: 0.7,
    noise: 2.0,
    shade: 0.25,
};

/// The cameras, the board, and its poses.
pub struct MovingBoard {
    pub board: Board,
    /// The true calibration of the cameras.
    pub truth: StereoCalibration,
    rays: [Rays; 2],
    poses: Vec<Isometry3<f64>>,
    seed: u64,
}

impl MovingBoard {
    /// A board of 9x6 corners 0.03 m apart in front of two cameras of 640x480 pixels 0.12 m apart.
    /// The seed sets the poses and the noise.
    ///
    /// # Errors
    /// None; those of the constructors.
    pub fn new(seed: u64) -> Result<Self> {
        Self::before(truth()?, seed)
    }

    /// The same board in front of other cameras.
    ///
    /// # Errors
    /// None; those of the constructors.
    pub fn before(truth: StereoCalibration, seed: u64) -> Result<Self> {
        let board = Board::new((9, 6), Some(SIDE_M))?;
        let rays = [Rays::new(truth.left()), Rays::new(truth.right())];
        let mut random = fastrand::Rng::with_seed(seed);
        let poses = (0..POSES)
            .map(|_| pose(&board, &truth, &mut random))
            .collect();
        Ok(Self {
            board,
            truth,
            rays,
            poses,
            seed,
        })
    }

    /// Number of pairs.
    pub fn pairs(&self) -> u64 {
        POSES as u64 * HELD + (POSES as u64 - 1) * MOVING
    }

    /// Pair `index`, at [`RATE_HZ`] per second.
    ///
    /// # Errors
    /// None; those of the images' constructors.
    pub fn pair(&self, index: u64) -> Result<StereoPair> {
        let moment = |i| index as f64 + SHUTTER * i as f64 / (MOMENTS - 1) as f64;
        let mut poses: Vec<_> = (0..MOMENTS).map(|i| self.pose(moment(i))).collect();
        // A board held still is rendered once instead of once per moment.
        poses.dedup();
        let image = |side: usize| {
            let motions = [Isometry3::identity(), *self.truth.right_from_left()];
            let poses: Vec<_> = poses.iter().map(|pose| motions[side] * pose).collect();
            // Every image has its own noise.
            let seed = self
                .seed
                .wrapping_mul(1_000_003)
                .wrapping_add(2 * index + side as u64);
            render(&self.rays[side], &self.board, &poses, &LOOK, seed)
        };
        StereoPair::new(image(0)?, image(1)?)
    }

    /// True corners in pair `index`; `None` unless the board is complete in both images.
    pub fn view(&self, index: u64) -> Option<StereoView> {
        view(&self.board, &self.truth, &self.pose(index as f64), 0.0)
    }

    /// `X_left = pose · X_board` at a time in units of pairs.
    fn pose(&self, at: f64) -> Isometry3<f64> {
        let cycle = (HELD + MOVING) as f64;
        let step = ((at / cycle) as usize).min(POSES - 1);
        let on_the_way =
            ((at - step as f64 * cycle - HELD as f64 + 1.0) / (MOVING + 1) as f64).clamp(0.0, 1.0);
        // Smoothstep: the board starts and stops gently.
        let smooth = on_the_way * on_the_way * (3.0 - 2.0 * on_the_way);
        let next = self.poses[(step + 1).min(POSES - 1)];
        self.poses[step].lerp_slerp(&next, smooth)
    }
}

fn truth() -> Result<StereoCalibration> {
    let left = Intrinsics::new(
        (640, 480),
        (521.3, 522.1),
        (324.6, 236.8),
        [-0.283, 0.094, 0.0007, -0.0004, 0.012],
    )?;
    let right = Intrinsics::new(
        (640, 480),
        (518.9, 519.4),
        (317.2, 243.1),
        [-0.276, 0.087, -0.0005, 0.0006, 0.015],
    )?;
    let rotation = UnitQuaternion::from_euler_angles(0.008, -0.015, 0.004);
    let right_from_left =
        Isometry3::from_parts(Translation3::new(-0.12, 0.0012, -0.0021), rotation);
    StereoCalibration::new(left, right, right_from_left, LengthUnit::Metres)
}

/// A pose in which both cameras see the complete board.
fn pose(board: &Board, truth: &StereoCalibration, random: &mut fastrand::Rng) -> Isometry3<f64> {
    let middle =
        Vector3::new((board.columns() - 1) as f64, (board.rows() - 1) as f64, 0.0) * (0.5 * SIDE_M);
    // Rejection sampling: draw until both cameras see the complete board.
    loop {
        let mut within = |low: f64, high: f64| low + (high - low) * random.f64();
        let rotation = UnitQuaternion::from_euler_angles(
            within(-0.7, 0.7),
            within(-0.7, 0.7),
            within(-0.5, 0.5),
        );
        let is_fisheye = matches!(truth.left().distortion(), Distortion::Equidistant(_));
        let (rotation, position) = if is_fisheye {
            let ray = Vector3::new(within(-2.0, 2.2), within(-1.5, 1.5), 1.0).normalize();
            // At the edge, a board is visible only if it faces the cameras.
            let facing = UnitQuaternion::rotation_between(&Vector3::z(), &ray).unwrap_or_default();
            (facing * rotation, ray * within(0.2, 0.5))
        } else {
            let depth = within(0.35, 0.75);
            let aside = Vector3::new(within(-0.5, 0.6) * depth, within(-0.4, 0.4) * depth, depth);
            (rotation, aside)
        };
        let pose =
            Isometry3::from_parts(Translation3::from(position - rotation * middle), rotation);
        if view(board, truth, &pose, MARGIN_PX).is_some() {
            return pose;
        }
    }
}

/// True corners in both images; `None` unless all are at least `margin_px` inside both.
fn view(
    board: &Board,
    truth: &StereoCalibration,
    pose: &Isometry3<f64>,
    margin_px: f64,
) -> Option<StereoView> {
    let seen = |camera: &Intrinsics, pose: Isometry3<f64>| {
        let (width, height) = camera.size();
        let inside = |pixel: &Point2<f64>| {
            let within = |v: f64, side: usize| v >= margin_px && v <= side as f64 - 1.0 - margin_px;
            within(pixel.x, width) && within(pixel.y, height)
        };
        let corners = board
            .corners()
            .map(|corner| camera.project(&(pose * corner)).filter(inside));
        corners.collect::<Option<Vec<_>>>()
    };
    Some(StereoView {
        left: seen(truth.left(), *pose)?,
        right: seen(truth.right(), truth.right_from_left() * pose)?,
    })
}
