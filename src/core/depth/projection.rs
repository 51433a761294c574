//! Points in space as disparities of the left image: a z-buffer that removes occluded points.

use crate::stereo::{Plane, Rig};
use nalgebra::Point3;

/// Least fraction by which a nearer point's depth is less: half of a cell's distance tolerance.
const MIN_NEARER: f32 = 0.1;
/// Largest radius of the search for points that occlude another, pixels.
const MAX_RADIUS: usize = 16;

/// The disparities of `points`, metres in the rectified left camera's frame (x right, y down, z
/// forward), as seen in the left image of `size`: `+∞` in pixels without a point. If several points
/// fall into one pixel, the nearest wins; on one surface, the one nearest to the pixel's centre.
///
/// Between the points of a near surface, another sensor sees points behind it that the camera does
/// not. So a point is dropped as occluded if points that are nearer by a tenth surround it within
/// one and a half times the points' spacing: if no line through it has all of them on one side.
/// That is the screen-space visibility of Pintus, Gobbetti and Agus (Real-time rendering of massive
/// unstructured raw point clouds using screen-space operators, VAST 2011) with that test instead of
/// their solid angle. A floor, a slanted wall and points next to an edge have nearer neighbours on
/// only one side and are kept.
pub fn project(
    points: impl IntoIterator<Item = Point3<f64>>,
    rig: &Rig,
    size: (usize, usize),
) -> Plane<f32> {
    // The image has this size, so a plane can.
    let mut nearest = Plane::filled(size.0, size.1, f32::INFINITY).expect("the size of an image");
    let (focal, (cx, cy)) = (rig.focal_px(), rig.center_px());
    let doffs = rig.doffs_px() as f32;
    // Squared distance of each pixel's point from the pixel's centre.
    let mut off_center = Plane::filled(size.0, size.1, f32::INFINITY).expect("as above");
    for point in points {
        // False for NaN too.
        if !(point.z > 0.0 && point.z.is_finite()) {
            continue;
        }
        let at = [
            focal * point.x / point.z + cx,
            focal * point.y / point.z + cy,
        ];
        let [u, v] = at.map(f64::round);
        let disparity = rig.disparity_px(point.z) as f32;
        let inside = u >= 0.0 && v >= 0.0 && u < size.0 as f64 && v < size.1 as f64;
        if !inside || !disparity.is_finite() {
            continue;
        }
        let (x, y) = (u as usize, v as usize);
        let off = ((at[0] - u).powi(2) + (at[1] - v).powi(2)) as f32;
        let known = nearest.get(x, y);
        // On one surface the central point wins: the nearest one would belong to its near rim.
        let wins = !known.is_finite()
            || is_nearer(disparity, known, doffs)
            || !is_nearer(known, disparity, doffs) && off < off_center.get(x, y);
        if wins {
            nearest.set(x, y, disparity);
            off_center.set(x, y, off);
        }
    }
    without_hidden(&nearest, doffs)
}

/// The disparities of the samples of a depth image, as seen in the left image of `size`: `+∞` in
/// pixels without a sample. Each is a point, metres in the rectified left camera's frame, and the
/// side of the square that its pixel covers there, metres: it fills the left pixels whose centres
/// lie in the square. The nearest sample of a pixel wins, so what is behind it is hidden.
pub fn render(
    samples: impl IntoIterator<Item = (Point3<f64>, f64)>,
    rig: &Rig,
    size: (usize, usize),
) -> Plane<f32> {
    // The image has this size, so a plane can.
    let mut nearest = Plane::filled(size.0, size.1, f32::INFINITY).expect("the size of an image");
    let (focal, (cx, cy)) = (rig.focal_px(), rig.center_px());
    for (point, side) in samples {
        // False for NaN too.
        if !(point.z > 0.0 && point.z.is_finite()) {
            continue;
        }
        let disparity = rig.disparity_px(point.z) as f32;
        let half = focal * side / point.z / 2.0;
        let covered = |at: f64, pixels: usize| {
            let [from, to] = [at - half, at + half].map(|edge| edge.ceil().max(0.0));
            // Casts saturate.
            from as usize..(to as usize).min(pixels)
        };
        let columns = covered(focal * point.x / point.z + cx, size.0);
        for y in covered(focal * point.y / point.z + cy, size.1) {
            if columns.is_empty() {
                break;
            }
            for known in &mut nearest.row_mut(y)[columns.clone()] {
                if !known.is_finite() || disparity > *known {
                    *known = disparity;
                }
            }
        }
    }
    nearest
}

/// True if the first disparity belongs to a point that is nearer by a tenth.
fn is_nearer(disparity: f32, other: f32, doffs: f32) -> bool {
    // Inverse depths: f·B/z is d + doffs.
    (disparity + doffs) * (1.0 - MIN_NEARER) > other + doffs
}

fn without_hidden(nearest: &Plane<f32>, doffs: f32) -> Plane<f32> {
    let (width, height) = nearest.size();
    let samples: Vec<_> = nearest
        .rows()
        .enumerate()
        .flat_map(|(y, row)| {
            let known = row.iter().enumerate().filter(|(_, d)| d.is_finite());
            known.map(move |(x, &d)| (x, y, d))
        })
        .collect();
    let radius = radius(&samples);
    let mut seen = nearest.clone();
    for &(x, y, d) in &samples {
        let mut nearer = Fan::default();
        for v in y.saturating_sub(radius)..(y + radius + 1).min(height) {
            let first = x.saturating_sub(radius);
            let window = &nearest.row(v)[first..(x + radius + 1).min(width)];
            for (u, &other) in (first..).zip(window) {
                if other.is_finite() && is_nearer(other, d, doffs) {
                    nearer.add((u as i32 - x as i32, v as i32 - y as i32));
                }
            }
        }
        if nearer.is_round {
            seen.set(x, y, f32::INFINITY);
        }
    }
    seen
}

/// The directions between two that span less than half a turn, or all directions.
#[derive(Default)]
struct Fan {
    ends: Option<[(i32, i32); 2]>,
    is_round: bool,
}

impl Fan {
    fn add(&mut self, direction: (i32, i32)) {
        let cross = |a: (i32, i32), b: (i32, i32)| a.0 * b.1 - a.1 * b.0;
        let Some([first, last]) = &mut self.ends else {
            self.ends = Some([direction; 2]);
            return;
        };
        let (from_first, from_last) = (cross(*first, direction), cross(*last, direction));
        let is_ahead = first.0 * direction.0 + first.1 * direction.1 > 0;
        match (from_first, from_last) {
            // If the fan is a single direction: the same direction, not its opposite.
            (0, 0) => self.is_round |= !is_ahead,
            (0.., ..=0) => {}
            (1.., 1..) => *last = direction,
            (..=-1, ..=-1) => *first = direction,
            _ => self.is_round = true,
        }
    }
}

/// One and a half times the mean spacing of the samples over the area they cover.
fn radius(samples: &[(usize, usize, f32)]) -> usize {
    let range = |coordinate: fn(&(usize, usize, f32)) -> usize| {
        let (least, most) = samples
            .iter()
            .map(coordinate)
            .fold((usize::MAX, 0), |(a, b), v| (a.min(v), b.max(v)));
        (most + 1).saturating_sub(least)
    };
    let area = range(|s| s.0) * range(|s| s.1);
    let spacing = (area as f64 / samples.len().max(1) as f64).sqrt();
    ((1.5 * spacing).ceil() as usize).clamp(2, MAX_RADIUS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn rig() -> Rig {
        Rig::new(100.0, (20.0, 15.0), 0.1, 0.0).unwrap()
    }

    /// The point viewed by pixel (x, y) at that depth.
    fn at(x: usize, y: usize, z: f64) -> Point3<f64> {
        Point3::new(
            (x as f64 - 20.0) * z / 100.0,
            (y as f64 - 15.0) * z / 100.0,
            z,
        )
    }

    #[test]
    fn a_pixel_has_the_nearest_of_its_points() {
        let points = [at(3, 4, 2.0), at(3, 4, 1.0), at(3, 4, 5.0), at(30, 20, 4.0)];
        let seen = project(points, &rig(), (41, 31));
        assert_eq!((seen.get(3, 4), seen.get(30, 20)), (10.0, 2.5));
        assert_eq!(seen.pixels().filter(|d| d.is_finite()).count(), 2);
    }

    #[test]
    fn samples_fill_the_pixels_that_they_cover_nearest_first() {
        // A depth image of half the resolution: a wall at 2 m, its right half at 1 m.
        let samples = (0..8).flat_map(|y| (0..8).map(move |x| (2 * x, 2 * y)));
        let samples = samples.map(|(x, y)| {
            let z = if x < 8 { 2.0 } else { 1.0 };
            // The centre of the sample is between two pixels.
            let shift = Vector3::new(0.5, 0.5, 0.0) * z / 100.0;
            (at(x, y, z) + shift, 2.0 * z / 100.0)
        });
        let seen = render(samples.chain([(at(3, 3, f64::NAN), 1.0)]), &rig(), (41, 31));
        for (x, y) in (0..31).flat_map(|y| (0..41).map(move |x| (x, y))) {
            let expected = match (x, y) {
                (0..8, 0..16) => 5.0,
                (8..16, 0..16) => 10.0,
                _ => f32::INFINITY,
            };
            assert_eq!(seen.get(x, y), expected, "({x}, {y})");
        }
        let both = [
            (at(3, 4, 2.0), 0.02),
            (at(3, 4, 1.0), 0.01),
            (at(3, 4, 3.0), 0.03),
        ];
        assert_eq!(render(both, &rig(), (41, 31)).get(3, 4), 10.0);
    }

    #[test]
    fn points_behind_the_camera_outside_or_not_finite_are_left_out() {
        let points = [
            Point3::new(0.0, 0.0, -1.0),
            Point3::new(0.0, 0.0, 0.0),
            Point3::new(f64::NAN, 0.0, 1.0),
            Point3::new(0.0, 0.0, f64::NAN),
            Point3::new(0.0, 0.0, f64::INFINITY),
            Point3::new(9.0, 0.0, 1.0),
            Point3::new(0.0, -9.0, 1.0),
        ];
        let seen = project(points, &rig(), (41, 31));
        assert!(seen.pixels().all(|d| d == f32::INFINITY));
    }

    #[test]
    fn points_between_those_of_a_nearer_surface_are_hidden() {
        // Every other pixel of a board at 1 m, columns 10 to 30, and a wall at 3 m in the others.
        let grid = || (0..31).flat_map(|y| (0..41).map(move |x| (x, y)));
        let is_board = |x: usize| (10..=30).contains(&x);
        let points = grid().map(|(x, y)| {
            if (x + y) % 2 == 0 && is_board(x) {
                at(x, y, 1.0)
            } else {
                at(x, y, 3.0)
            }
        });
        let seen = project(points, &rig(), (41, 31));
        for (x, y) in grid() {
            let expected = match (is_board(x), (x + y) % 2 == 0) {
                (true, true) => 10.0,
                (true, false) => f32::INFINITY,
                (false, _) => (10.0f64 / 3.0) as f32,
            };
            // At the board's edge a point has the board on only one side.
            let is_edge = x.abs_diff(10) < 2 || x.abs_diff(30) < 2;
            assert!(is_edge || seen.get(x, y) == expected, "({x}, {y})");
        }
    }

    #[test]
    fn a_floor_that_rises_to_the_horizon_stays() {
        // 0.1 m below the camera, every second row.
        let rows = (17..31).step_by(2);
        let points =
            rows.flat_map(|y| (0..41).map(move |x| at(x, y, 0.1 * 100.0 / (y as f64 - 15.0))));
        let seen = project(points, &rig(), (41, 31));
        assert_eq!(seen.pixels().filter(|d| d.is_finite()).count(), 7 * 41);
    }
}
