//! The floor plane that a recording or an option tells, beside the largest level surface of the
//! truth.

use super::scale::sampled_places;
use nalgebra::{Matrix3, SymmetricEigen, UnitVector3, Vector3};
use std::ops::RangeInclusive;
use svl_core::doubt::{Doubt, Subject, TruthCure};
use svl_core::statistics::upper_median;
use svl_core::stereo::{FloorPlane, Rig, Truth};

/// Pairs whose truth decides, and points of each.
pub const FLOOR_PAIRS: usize = 12;
const POINTS: f64 = 600.0;
/// Fractions of the points: at least that many are on a plane that is seen, with at most that many
/// below it, or that many beside a drop; and at least that many on the largest surface.
const MIN_SEEN: f64 = 0.05;
const MAX_BELOW: f64 = 0.2;
const MIN_SEEN_ABOVE: f64 = 0.2;
const MIN_FITTED: f64 = 0.15;
/// Fraction of the points that are below the largest surface by more than noise.
const MAX_BELOW_FITTED: f64 = 0.05;
/// Distance of a point from the told plane that its distance explains, a fraction of it.
const TOLD_NOISE: f64 = 0.02;
/// Distance of the points of a surface from it, metres, and as a fraction of their distance.
const MIN_NOISE_M: f64 = 0.01;
const NOISE: f64 = 0.015;
/// Planes through three points that are tried; rounds of least squares, and the fraction of the
/// noise within which their points are: feet of walls and boxes are left out.
const TRIES: usize = 400;
const ROUNDS: usize = 3;
const WITHIN: f64 = 0.5;
/// Angle between the normal of a level surface and that of the told plane.
const MAX_TILT_DEG: f64 = 10.0;
/// Angle up to which a camera is level.
const LEVEL_DEG: f64 = 2.0;
const HEIGHTS_M: RangeInclusive<f64> = FloorPlane::HEIGHTS_M;

/// Points of the truth of the first pairs, in the frame of the left camera.
#[derive(Default)]
pub struct FloorPoints {
    points: Vec<Vector3<f64>>,
    pairs: usize,
}

/// The surface that a truth shows in place of a told floor.
#[derive(Clone, Debug, PartialEq)]
pub enum FloorSeen {
    Told,
    /// Neither that one nor another.
    Nothing,
    Another(Box<Doubt>),
}

impl FloorPoints {
    /// Adds the truth of a pair.
    pub fn add(&mut self, truth: &Truth, rig: &Rig) {
        let places = sampled_places(truth.disparity.size(), POINTS);
        self.points.extend(places.filter_map(|(x, y)| {
            let d = Some(truth.disparity.get(x, y)).filter(|d| d.is_finite())?;
            let at = (x as f64, y as f64);
            Some(Vector3::from(rig.point_m(at, rig.depth_m(d.into())?)))
        }));
        self.pairs += 1;
    }

    /// True if no further pair is needed.
    pub fn are_enough(&self) -> bool {
        self.pairs >= FLOOR_PAIRS
    }

    /// The surface that they show in place of a told floor.
    pub fn seen(&self, told: &FloorPlane) -> FloorSeen {
        let limit_m = told.limit_m();
        let noise_m = |point: &Vector3<f64>| limit_m.max(TOLD_NOISE * point.norm());
        let on_told = self.share(|point| told.height_m(point).abs() < limit_m);
        let below = self.share(|point| told.height_m(point) < -noise_m(point));
        if on_told >= MIN_SEEN && below <= MAX_BELOW || on_told >= MIN_SEEN_ABOVE {
            return FloorSeen::Told;
        }
        let Some(fitted) = self.largest(told) else {
            return FloorSeen::Nothing;
        };
        let points = self.points.iter();
        let points = points.filter(|point| is_on(&fitted, point, 1.0));
        let points: Vec<_> = points.copied().collect();
        if (points.len() as f64) < MIN_FITTED * self.points.len() as f64 {
            return FloorSeen::Nothing;
        }
        let are_most = |is_such: &dyn Fn(&Vector3<f64>) -> bool| {
            2 * points.iter().filter(|point| is_such(point)).count() > points.len()
        };
        let is_denied = are_most(&|point| told.height_m(point) >= limit_m)
            || are_most(&|point| told.height_m(point).abs() > noise_m(point));
        let off_m = upper_median(points.iter().map(|point| told.height_m(point).abs()));
        match off_m.filter(|off_m| is_denied && *off_m > limit_m) {
            None => FloorSeen::Told,
            Some(off_m) => {
                let degrees = |up: UnitVector3<f64>| fitted.up().angle(&up).to_degrees();
                let is_told_level = told.up() == -Vector3::y_axis();
                let cure = TruthCure::Floor {
                    told_m: told.camera_height_m(),
                    fitted_m: fitted.camera_height_m(),
                    tilt_deg: degrees(told.up()),
                    is_level: is_told_level && degrees(told.up()) <= LEVEL_DEG,
                };
                FloorSeen::Another(Box::new(cure.doubt(
                    Subject::Floor,
                    "off_m",
                    off_m,
                    [0.0, limit_m],
                )))
            }
        }
    }

    /// The level surface that fits most points best, with next to none below it.
    fn largest(&self, told: &FloorPlane) -> Option<FloorPlane> {
        let up = told.up();
        let lower = self.points.iter().filter(|point| up.dot(point) < 0.0);
        let lower: Vec<_> = lower.collect();
        if lower.len() < 3 {
            return None;
        }
        let mut random = fastrand::Rng::with_seed(1);
        let tried = (0..TRIES).filter_map(|_| {
            let [a, b, c] = [0; 3].map(|_| lower[random.usize(..lower.len())]);
            let normal = UnitVector3::try_new((b - a).cross(&(c - a)), 1e-12)?;
            let plane = self.level(normal, a, up)?;
            let fits = self.points.iter().map(|point| fit(&plane, point));
            Some((fits.sum::<f64>(), plane))
        });
        let (_, mut plane) = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
        for _ in 0..ROUNDS {
            let (normal, middle) = self.least_squares(&plane)?;
            plane = self.level(normal, &middle, up)?;
        }
        Some(plane)
    }

    /// The plane through a point, if it is level, below the camera, and the lowest.
    fn level(
        &self,
        normal: UnitVector3<f64>,
        point: &Vector3<f64>,
        up: UnitVector3<f64>,
    ) -> Option<FloorPlane> {
        let normal = if normal.dot(&up) < 0.0 {
            -normal
        } else {
            normal
        };
        let plane = FloorPlane::new(normal, -normal.dot(point));
        let is_level = normal.angle(&up).to_degrees() <= MAX_TILT_DEG;
        let is_below = HEIGHTS_M.contains(&plane.camera_height_m());
        let below = |point: &Vector3<f64>| plane.height_m(point) < -noise_m(point);
        (is_level && is_below && self.share(below) <= MAX_BELOW_FITTED).then_some(plane)
    }

    /// The normal and a point of the plane closest to the points on another.
    fn least_squares(&self, plane: &FloorPlane) -> Option<(UnitVector3<f64>, Vector3<f64>)> {
        let points = self.points.iter();
        let points = points.filter(|point| is_on(plane, point, WITHIN));
        let points: Vec<_> = points.map(|point| (1.0 / noise_m(point), point)).collect();
        let weights: f64 = points.iter().map(|(weight, _)| weight).sum();
        let middle: Vector3<f64> = points.iter().map(|(weight, point)| *weight * **point).sum();
        let middle = middle / weights;
        let spreads = points.iter().map(|(weight, point)| {
            let off = **point - middle;
            *weight * off * off.transpose()
        });
        let eigen = SymmetricEigen::new(spreads.sum::<Matrix3<f64>>());
        let normal = eigen
            .eigenvectors
            .column(eigen.eigenvalues.imin())
            .into_owned();
        Some((UnitVector3::try_new(normal, 1e-12)?, middle))
    }

    fn share(&self, is_such: impl Fn(&Vector3<f64>) -> bool) -> f64 {
        let such = self.points.iter().filter(|point| is_such(point));
        such.count() as f64 / self.points.len().max(1) as f64
    }
}

/// Distance of a point from a surface that its distance explains, metres.
fn noise_m(point: &Vector3<f64>) -> f64 {
    MIN_NOISE_M.max(NOISE * point.norm())
}

/// 1 for a point on a plane, and 0 for one off by its noise or more (MSAC: Torr and Zisserman,
/// CVIU 2000).
fn fit(plane: &FloorPlane, point: &Vector3<f64>) -> f64 {
    (1.0 - (plane.height_m(point) / noise_m(point)).powi(2)).max(0.0)
}

fn is_on(plane: &FloorPlane, point: &Vector3<f64>, within: f64) -> bool {
    plane.height_m(point).abs() <= within * noise_m(point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Plane;

    const SIZE: (usize, usize) = (120, 90);

    /// Points of a room: a floor below the camera, tilted by an angle, and a wall.
    fn room(height_m: f64, tilt_deg: f64, wall_m: f64) -> FloorPoints {
        let rig = Rig::new(100.0, (60.0, 45.0), 0.1, 0.0).unwrap();
        let (sin, cos) = tilt_deg.to_radians().sin_cos();
        let disparity = Plane::from_fn(SIZE.0, SIZE.1, |_, y| {
            let slope = (y as f64 - 45.0) / 100.0;
            let falls = slope * cos + sin;
            let floor_m = if falls > 0.0 {
                height_m / falls
            } else {
                f64::MAX
            };
            rig.disparity_px(floor_m.min(wall_m)) as f32
        });
        let mut points = FloorPoints::default();
        points.add(&Truth::exact(disparity.unwrap(), None), &rig);
        points
    }

    fn another(points: &FloorPoints, told: &FloorPlane) -> Option<(f64, f64, bool)> {
        let FloorSeen::Another(doubt) = points.seen(told) else {
            return None;
        };
        assert!(doubt.is_unusual(), "{doubt:?}");
        match doubt.cure {
            svl_core::doubt::Cure::Truth(TruthCure::Floor {
                fitted_m,
                tilt_deg,
                is_level,
                ..
            }) => Some((fitted_m, tilt_deg, is_level)),
            cure => panic!("{cure}"),
        }
    }

    #[test]
    fn the_told_floor_is_seen_within_its_limits() {
        for (height_m, tilt_deg, told_m) in [
            (0.5, 0.0, 0.5),
            (0.5, 0.0, 0.53),
            (0.5, 1.0, 0.5),
            (0.07, 0.0, 0.08),
            (1.65, 0.5, 1.65),
        ] {
            let seen = room(height_m, tilt_deg, 6.0).seen(&FloorPlane::level(told_m));
            assert_eq!(seen, FloorSeen::Told, "{height_m} {tilt_deg} {told_m}");
        }
    }

    #[test]
    fn another_floor_is_named_with_its_height_and_tilt() {
        for (height_m, told_m) in [(0.5, 1.0), (0.5, 0.25), (0.07, 0.14), (0.07, 0.035)] {
            let room = room(height_m, 0.0, 6.0);
            let (fitted_m, tilt_deg, is_level) = another(&room, &FloorPlane::level(told_m))
                .unwrap_or_else(|| panic!("{height_m} {told_m}"));
            assert!((fitted_m / height_m - 1.0).abs() < 0.01, "{fitted_m}");
            assert!(tilt_deg < 0.2 && is_level, "{tilt_deg}");
        }
        for tilt in [5.0, -4.0] {
            let room = room(0.5, tilt, 4.0);
            let (fitted_m, tilt_deg, is_level) = another(&room, &FloorPlane::level(0.5)).unwrap();
            assert!((fitted_m / 0.5 - 1.0).abs() < 0.02, "{fitted_m}");
            assert!(
                (tilt_deg - tilt.abs()).abs() < 0.5 && !is_level,
                "{tilt_deg}"
            );
        }
    }

    #[test]
    fn a_floor_beside_a_drop_is_seen() {
        let mut points = room(0.5, 0.0, 20.0);
        points.points.extend(room(1.0, 0.0, 20.0).points);
        let below = points.share(|point| FloorPlane::level(0.5).height_m(point) < -0.2);
        assert!(below > MAX_BELOW, "{below}");
        assert_eq!(points.seen(&FloorPlane::level(0.5)), FloorSeen::Told);
    }

    #[test]
    fn a_floor_that_is_not_to_be_seen_is_not_denied() {
        let wall = room(0.5, 0.0, 0.9);
        assert_eq!(wall.seen(&FloorPlane::level(0.5)), FloorSeen::Nothing);
        let none = FloorPoints::default();
        assert_eq!(none.seen(&FloorPlane::level(0.5)), FloorSeen::Nothing);
    }
}
