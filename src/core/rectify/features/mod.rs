//! Point matches between the images of a pair, without knowledge of their geometry.
//!
//! Corners are matched by the correlation of the patches around them (Zhang, Deriche, Faugeras &
//! Luong, A robust technique for matching two uncalibrated images, 1995), then refined to subpixels
//! by least squares (Lucas & Kanade 1981).

mod corners;
mod fit;
mod patch;

use crate::stereo::{Gray, StereoPair};
use corners::corners;
use nalgebra::Point2;
use patch::{Patch, candidates};

/// A point matched between both images, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMatch {
    pub left: Point2<f64>,
    pub right: Point2<f64>,
}

/// Corners sought per image.
const CORNERS: usize = 1500;
/// Least correlation of two patches; and the uniqueness ratio: the best candidate's `1 −
/// correlation` must be less than this fraction of the next best one's.
const MIN_CORRELATION: f64 = 0.85;
const UNIQUENESS: f64 = 0.7;
/// Largest vertical distance of a match, as a fraction of the image's height.
const ROWS: f64 = 0.2;
/// Matches that move farther than this in the refinement are rejected.
const NEAR_PX: f64 = 2.0;

/// Columns above which images are shrunk: the corners of photographs are wider than a patch.
const MAX_COLUMNS: usize = 1600;

/// A pair of the means of squares of pixels; `None` without a whole square.
fn shrunk(pair: &StereoPair, factor: usize) -> Option<StereoPair> {
    let (width, height) = pair.size();
    let small = |image: &Gray| {
        let mean = |x: usize, y: usize| {
            let rows = (y * factor..(y + 1) * factor).map(|y| &image.row(y)[x * factor..]);
            let greys = rows
                .flat_map(|row| &row[..factor])
                .map(|&grey| usize::from(grey));
            (greys.sum::<usize>() / (factor * factor)) as u8
        };
        Gray::from_fn(width / factor, height / factor, mean)
    };
    StereoPair::new(small(pair.left()).ok()?, small(pair.right()).ok()?).ok()
}

/// Matches of a pair, accurate to about a tenth of a pixel; empty without texture.
///
/// Each point is the other's best candidate (left-right consistency). Most are right, but not all:
/// [`super::epipolar::inliers`] finds them.
pub(super) fn matches(pair: &StereoPair) -> Vec<PointMatch> {
    let factor = pair.size().0.div_ceil(MAX_COLUMNS);
    if factor > 1
        && let Some(small) = shrunk(pair, factor)
    {
        let place = |at: Point2<f64>| at.map(|px| (px + 0.5) * factor as f64 - 0.5);
        let whole = |m: PointMatch| PointMatch {
            left: place(m.left),
            right: place(m.right),
        };
        return matches(&small).into_iter().map(whole).collect();
    }
    let [left, right] = [described(pair.left()), described(pair.right())];
    let reach = pair.size().1 as f64 * ROWS;
    let found = |patches: &[Patch], others: &[Patch]| {
        candidates(patches, others, reach, MIN_CORRELATION, UNIQUENESS)
    };
    let (there, back) = (found(&left, &right), found(&right, &left));
    // Left-right consistency: a match must be the best candidate in both directions.
    let mutual = there
        .iter()
        .enumerate()
        .filter_map(|(l, r)| r.filter(|&r| back[r] == Some(l)).map(|r| (l, r)));
    let mutual: Vec<_> = mutual.map(|(l, r)| (left[l].at, right[r].at)).collect();
    let fitted = |&(l, r): &((usize, usize), (usize, usize))| {
        let near = Point2::new(r.0 as f64, r.1 as f64);
        let right = fit::fit(pair.left(), l, pair.right(), near)?;
        let left = Point2::new(l.0 as f64, l.1 as f64);
        ((right - near).norm() < NEAR_PX).then_some(PointMatch { left, right })
    };
    mutual.iter().filter_map(fitted).collect()
}

fn described(image: &Gray) -> Vec<Patch> {
    corners(image, CORNERS)
        .into_iter()
        .filter_map(|at| Patch::new(image, at))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blobs of all sizes, as a function of position.
    fn scene(x: f64, y: f64) -> f64 {
        let wave = |a: f64, b: f64, c: f64| (a * x + b * y + c).sin();
        128.0
            + 40.0 * wave(0.31, 0.07, 0.0) * wave(-0.05, 0.27, 1.0)
            + 30.0 * wave(0.11, 0.19, 2.0)
            + 30.0 * wave(0.171, -0.133, 3.0) * wave(0.023, 0.037, 0.5)
            + 20.0 * wave(0.45, 0.39, 0.2) * wave(0.013, -0.029, 0.7)
    }

    fn pair(dx: f64, dy: f64) -> StereoPair {
        let image = |dx: f64, dy: f64| {
            Gray::from_fn(320, 240, |x, y| scene(x as f64 + dx, y as f64 + dy) as u8).unwrap()
        };
        StereoPair::new(image(0.0, 0.0), image(dx, dy)).unwrap()
    }

    #[test]
    fn points_are_found_to_a_tenth_of_a_pixel() {
        for (dx, dy) in [(0.0, 0.0), (7.3, -0.4), (20.6, 9.7)] {
            let found = matches(&pair(dx, dy));
            assert!(found.len() > 60, "{} at {dx}, {dy}", found.len());
            let off = |m: &&PointMatch| {
                (m.left.x - m.right.x - dx).abs() > 0.1 || (m.left.y - m.right.y - dy).abs() > 0.1
            };
            let wrong = found.iter().filter(off).count();
            assert!(
                wrong * 20 <= found.len(),
                "{wrong} of {} at {dx}, {dy}",
                found.len()
            );
        }
    }

    #[test]
    fn photographs_are_shrunk() {
        let image = |dx: f64, dy: f64| {
            let grey = |x, y| scene(x as f64 / 2.0 + dx, y as f64 / 2.0 + dy) as u8;
            Gray::from_fn(1920, 480, grey).unwrap()
        };
        let found = matches(&StereoPair::new(image(0.0, 0.0), image(5.0, -0.75)).unwrap());
        assert!(found.len() > 60, "{}", found.len());
        let off = |m: &&PointMatch| {
            (m.left.x - m.right.x - 10.0).abs() > 0.4 || (m.left.y - m.right.y + 1.5).abs() > 0.4
        };
        let wrong = found.iter().filter(off).count();
        assert!(wrong * 10 <= found.len(), "{wrong} of {}", found.len());
    }

    #[test]
    fn without_texture_there_are_no_matches() {
        let flat = Gray::filled(320, 240, 90).unwrap();
        assert_eq!(matches(&StereoPair::new(flat.clone(), flat).unwrap()), []);
        let tiny = Gray::from_fn(9, 5, |x, y| (x * y) as u8).unwrap();
        assert_eq!(matches(&StereoPair::new(tiny.clone(), tiny).unwrap()), []);
        let thin = Gray::from_fn(4000, 1, |x, _| x as u8).unwrap();
        assert_eq!(matches(&StereoPair::new(thin.clone(), thin).unwrap()), []);
        // Stripes: all positions along them look the same.
        let stripes = Gray::from_fn(320, 240, |x, _| {
            (128.0 + 100.0 * (x as f64 * 0.4).sin()) as u8
        })
        .unwrap();
        assert_eq!(
            matches(&StereoPair::new(stripes.clone(), stripes).unwrap()),
            []
        );
    }
}
