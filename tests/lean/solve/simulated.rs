//! Random camera pairs that see a board in random poses.

use fastrand::Rng;
use nalgebra::{Isometry3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use svl_calibrate::{Board, StereoView};
use svl_core::stereo::{Distortion, DistortionModel, Intrinsics, LengthUnit, StereoCalibration};

pub struct Simulated {
    pub truth: StereoCalibration,
    pub board: Board,
    pub views: Vec<StereoView>,
    /// Corruption of each view, if any.
    pub spoilt: Vec<Option<Spoil>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spoil {
    /// Corners anywhere in one image.
    Garbage,
    /// All corners of one image shifted.
    Shifted,
    /// Corners numbered from the other end in one image.
    Reversed,
    /// Corners numbered one square further in one image.
    Slipped,
    /// Some corners of one image are outliers: they are refused, not the view.
    Corners,
}

pub fn uniform(rng: &mut Rng, from: f64, to: f64) -> f64 {
    from + rng.f64() * (to - from)
}

/// A standard normal number, by the Box-Muller transform.
pub fn normal(rng: &mut Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (std::f64::consts::TAU * rng.f64()).cos()
}

fn turn(x_deg: f64, y_deg: f64, z_deg: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::new(x_deg, y_deg, z_deg).map(f64::to_radians))
}

fn lens(
    rng: &mut Rng,
    model: DistortionModel,
    (width, height): (usize, usize),
    focal: f64,
) -> Intrinsics {
    let (w, h) = (width as f64, height as f64);
    let fx = focal * uniform(rng, 0.98, 1.02);
    let focal_px = (fx, fx * uniform(rng, 0.995, 1.005));
    let off = |rng: &mut Rng, side: f64| (side - 1.0) / 2.0 + side * uniform(rng, -0.03, 0.03);
    let center_px = (off(rng, w), off(rng, h));
    if model == DistortionModel::Equidistant {
        let [k1, k2, k3, k4] = [0.05, 0.02, 0.005, 0.001].map(|most| uniform(rng, -most, most));
        let distortion = Distortion::Equidistant([k1, k2, k3, k4]);
        return Intrinsics::new((width, height), focal_px, center_px, distortion).unwrap();
    }
    let k1 = uniform(rng, -0.35, 0.1);
    let k2 = -k1 * uniform(rng, 0.1, 0.5);
    let tangential = [0, 1].map(|_| uniform(rng, -0.002, 0.002));
    let k3 = uniform(rng, -0.02, 0.02);
    Intrinsics::new(
        (width, height),
        focal_px,
        center_px,
        distortion(rng, model, [k1, k2, tangential[0], tangential[1], k3]),
    )
    .unwrap()
}

/// `plumb_bob`, or these coefficients over a denominator.
fn distortion(rng: &mut Rng, model: DistortionModel, plumb_bob: [f64; 5]) -> Distortion {
    if model == DistortionModel::PlumbBob {
        return plumb_bob.into();
    }
    let below = [0.3, 0.1, 0.02].map(|most| uniform(rng, 0.0, most));
    model
        .with_coefficients(&[&plumb_bob[..], &below].concat())
        .unwrap()
}

impl Simulated {
    /// Fields of view of 35° to 71°, of `equidistant` 115° to 175°. Baselines of 4 to 30 cm,
    /// converging cameras, 10 to 25 views with `noise_px`, `spoilt` of them wrong.
    pub fn new(model: DistortionModel, seed: u64, noise_px: Option<f64>, spoilt: usize) -> Self {
        let rng = &mut Rng::with_seed(seed);
        let noise_px = noise_px.unwrap_or_else(|| uniform(rng, 0.1, 1.0));
        let size = [(640, 480), (752, 480), (1280, 960)][rng.usize(..3)];
        let (least, most) = match model {
            DistortionModel::Equidistant => (0.33, 0.5),
            _ => (0.7, 1.6),
        };
        let focal = uniform(rng, least, most) * size.0 as f64;
        let (left, right) = (lens(rng, model, size, focal), lens(rng, model, size, focal));
        let baseline = uniform(rng, 0.04, 0.30);
        let apart = 3.0 * baseline * focal / size.0 as f64;
        let near = apart.max(0.25);
        let far = near * 2.5;
        // The optical axes cross in the common field of view, or are nearly parallel.
        let toe = (baseline / uniform(rng, near, 4.0 * far))
            .atan()
            .to_degrees();
        let rotation = turn(uniform(rng, -1.5, 1.5), toe, uniform(rng, -1.5, 1.5));
        let centre = Vector3::new(
            baseline,
            uniform(rng, -0.02, 0.02) * baseline,
            uniform(rng, -0.05, 0.05) * baseline,
        );
        let place = Isometry3::from_parts(Translation3::from(rotation * -centre), rotation);
        let truth = StereoCalibration::new(left, right, place, LengthUnit::Metres).unwrap();
        let square = 0.05 * (near + far) / 2.0 * size.0 as f64 / focal;
        let board = Board::new((9, 6), Some(square)).unwrap();
        let wanted = rng.usize(10..=25);
        let mut views = Vec::new();
        for _ in 0..200_000 {
            if views.len() == wanted {
                break;
            }
            views.extend(view(rng, &truth, &board, (near, far), noise_px));
        }
        assert_eq!(
            views.len(),
            wanted,
            "seed {seed}: too few poses are seen by both cameras"
        );
        let mut simulated = Self {
            truth,
            board,
            spoilt: vec![None; wanted],
            views,
        };
        for _ in 0..spoilt {
            simulated.spoil(rng);
        }
        simulated
    }

    /// Corrupts one more view.
    fn spoil(&mut self, rng: &mut Rng) {
        let kinds = [
            Spoil::Garbage,
            Spoil::Shifted,
            Spoil::Reversed,
            Spoil::Slipped,
            Spoil::Corners,
        ];
        let free: Vec<usize> = (0..self.views.len())
            .filter(|i| self.spoilt[*i].is_none())
            .collect();
        let id = free[rng.usize(..free.len())];
        let kind = kinds[rng.usize(..kinds.len())];
        let size = self.truth.left().size();
        let view = &mut self.views[id];
        let corners = if rng.bool() {
            &mut view.left
        } else {
            &mut view.right
        };
        match kind {
            Spoil::Garbage => {
                for corner in corners.iter_mut() {
                    *corner = Point2::new(
                        rng.f64() * (size.0 - 1) as f64,
                        rng.f64() * (size.1 - 1) as f64,
                    );
                }
            }
            Spoil::Shifted => {
                let (angle, far) = (
                    uniform(rng, 0.0, std::f64::consts::TAU),
                    uniform(rng, 8.0, 30.0),
                );
                let middle = corners.iter().fold(0.0, |sum, p| sum + p.x) / corners.len() as f64;
                // Towards the middle, so that the corners stay in the image.
                let sign = if middle < size.0 as f64 / 2.0 {
                    1.0
                } else {
                    -1.0
                };
                corners
                    .iter_mut()
                    .for_each(|p| p.x += sign * far * angle.cos().abs());
                corners
                    .iter_mut()
                    .for_each(|p| p.y = (p.y + far * angle.sin()).clamp(0.0, (size.1 - 1) as f64));
            }
            Spoil::Reversed => corners.reverse(),
            Spoil::Slipped => {
                let columns = self.board.columns();
                for row in corners.chunks_mut(columns) {
                    let last = row[columns - 1] + (row[columns - 1] - row[columns - 2]);
                    row.rotate_left(1);
                    row[columns - 1] = last;
                }
            }
            Spoil::Corners => {
                for _ in 0..4 {
                    let i = rng.usize(..corners.len());
                    corners[i].x =
                        (corners[i].x + uniform(rng, 20.0, 40.0)).min((size.0 - 1) as f64);
                    corners[i].y = (corners[i].y - uniform(rng, 20.0, 40.0)).max(0.0);
                }
            }
        }
        self.spoilt[id] = Some(kind);
    }
}

/// The board in a random pose; `None` unless both cameras see all of it.
fn view(
    rng: &mut Rng,
    truth: &StereoCalibration,
    board: &Board,
    (near, far): (f64, f64),
    noise_px: f64,
) -> Option<StereoView> {
    let (width, height) = truth.left().size();
    let distance = uniform(rng, near, far);
    let seen = truth.left().direction(Point2::new(
        rng.f64() * width as f64,
        rng.f64() * height as f64,
    ))?;
    let tilt = uniform(rng, 0.0, 50.0);
    let axis = uniform(rng, 0.0, std::f64::consts::TAU);
    let rotation =
        turn(tilt * axis.cos(), tilt * axis.sin(), 0.0) * turn(0.0, 0.0, uniform(rng, -30.0, 30.0));
    let centre = board
        .corners()
        .fold(Vector3::zeros(), |sum, p| sum + p.coords)
        / board.corners().count() as f64;
    let pose = match truth.left().distortion() {
        // At the edge of a fisheye, a board is visible only if it faces the camera.
        Distortion::Equidistant(_) => {
            let ray = seen.push(1.0).normalize();
            let facing = UnitQuaternion::rotation_between(&Vector3::z(), &ray)?;
            Isometry3::from_parts(Translation3::from(ray * distance), facing * rotation)
        }
        _ => Isometry3::from_parts(Translation3::from(seen.push(1.0) * distance), rotation),
    };
    let mut image = |camera: &Intrinsics, place: &Isometry3<f64>| {
        let pixel = |point: Point3<f64>| {
            let point = place * (pose * (point - centre));
            let pixel = camera.project(&point)?;
            // Distortion that is not monotonic maps two directions to one pixel.
            let there = camera.direction(pixel)? - point.xy().coords / point.z;
            let noisy = Point2::new(
                pixel.x + noise_px * normal(rng),
                pixel.y + noise_px * normal(rng),
            );
            let inside = |v: f64, side: usize| (5.0..(side - 6) as f64).contains(&v);
            (there.norm() < 1e-6 && inside(noisy.x, width) && inside(noisy.y, height))
                .then_some(noisy)
        };
        board.corners().map(pixel).collect::<Option<Vec<_>>>()
    };
    Some(StereoView {
        left: image(truth.left(), &Isometry3::identity())?,
        right: image(truth.right(), truth.right_from_left())?,
    })
}

/// Rotation vector of a motion, degrees.
pub fn turn_deg(motion: &Isometry3<f64>) -> Vector3<f64> {
    Rotation3::from(motion.rotation)
        .scaled_axis()
        .map(f64::to_degrees)
}
