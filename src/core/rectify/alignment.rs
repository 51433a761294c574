//! Vertical misalignment of pairs, measured from images alone.

use super::epipolar::inliers;
use super::features::{PointMatch, matches};
use crate::doubt::{AlignmentCure, Doubt, Misfit, PairCure, Subject, Turn};
use crate::statistics::{lower_median, nearest_rank};
use crate::stereo::{Gray, GridShape, Rig, StereoPair};
use nalgebra::{Matrix3, Vector3};
use std::ops::RangeInclusive;

/// Measures the vertical misalignment of point matches over pairs of one size.
#[derive(Clone, Debug, Default)]
pub struct AlignmentMeter {
    size: (usize, usize),
    /// The matches collected so far.
    pub matches: Vec<PointMatch>,
    pairs: usize,
    /// Matches of pairs without any, once the right image is turned back by each of [`Turn::ALL`].
    turned: [usize; 2],
}

/// Measures the vertical misalignment of pairs before and after their rectification.
#[derive(Clone, Debug, Default)]
pub struct RectificationMeter {
    before: AlignmentMeter,
    after: AlignmentMeter,
}

impl RectificationMeter {
    /// Pairs after which no further one is measured.
    const MAX_PAIRS: usize = 5;

    /// Adds a pair before and after its rectification. True if that was the last that is needed.
    pub fn add(&mut self, before: &StereoPair, after: &StereoPair) -> bool {
        self.before.add(before);
        self.after.add(after);
        self.is_done()
    }

    /// True if no further pair is needed.
    pub fn is_done(&self) -> bool {
        self.before.pairs >= Self::MAX_PAIRS || self.before.is_sure() && self.after.is_sure()
    }

    /// The misalignment before rectification; `None` with too few matches.
    pub fn before(&self) -> Option<Alignment> {
        self.before.alignment()
    }

    /// The doubt, if rectification misaligns pairs that were aligned: they are rectified already,
    /// or the calibration is not theirs.
    pub fn doubt(&self) -> Option<Doubt> {
        let (before, after) = (self.before.alignment()?, self.after.alignment()?);
        let is_worse = self.after.is_sure()
            && self.before.is_better_than(&self.after)
            && after.median_abs_px > Alignment::TOLERABLE_PX;
        is_worse.then(|| {
            let cure = PairCure::Misaligned {
                before_px: before.median_abs_px,
                after_px: after.median_abs_px,
                points: [before.matches, after.matches],
                pairs: before.pairs,
            };
            let usual = [0.0, Alignment::TOLERABLE_PX];
            cure.doubt(Subject::Calibration, ROWS, after.median_abs_px, usual)
        })
    }
}

/// Vertical misalignment: Δy of matched points, positive if the point is lower in the right image.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Alignment {
    /// Number of pairs measured.
    pub pairs: usize,
    /// Number of points matched between both images.
    pub matches: usize,
    /// Median of |Δy|, pixels.
    pub median_abs_px: f64,
    /// 90th percentile of |Δy|, pixels.
    pub p90_abs_px: f64,
    /// Median of Δy: a vertical shift of one image.
    pub median_px: f64,
    /// The simplest model that explains the misalignment.
    pub misfit: Misfit,
    /// Median of Δy in 3 x 3 parts of the left image, row by row; `None` if too few points were
    /// matched.
    pub parts_px: [[Option<f64>; 3]; 3],
}

impl Alignment {
    /// A larger misalignment costs matchers more than a few matches.
    pub const TOLERABLE_PX: f64 = 0.5;

    /// True if the misalignment is too large for matchers.
    pub fn is_off(&self) -> bool {
        self.median_abs_px > Self::TOLERABLE_PX
    }

    /// The doubt about pairs that are misaligned, with that cure.
    pub fn doubt(&self, cure: AlignmentCure) -> Option<Doubt> {
        let subject = match cure {
            AlignmentCure::Calibrate => Subject::Calibration,
            AlignmentCure::Rectify | AlignmentCure::PairApart { .. } => Subject::Pairs,
        };
        let cure = PairCure::Vertical {
            median_abs_px: self.median_abs_px,
            median_px: self.median_px,
            points: self.matches,
            pairs: self.pairs,
            misfit: self.misfit,
            cure,
        };
        let usual = [0.0, Self::TOLERABLE_PX];
        let doubt = || cure.doubt(subject, ROWS, self.median_abs_px, usual);
        self.is_off().then(doubt)
    }
}

/// Name of the quantity of a doubt.
const ROWS: &str = "vertical_misalignment_px";
/// Largest distance of an inlier from the epipolar geometry: lens distortion moves points farther
/// than noise does.
const TOLERANCE_PX: f64 = 2.0;
/// Fewest matches for a result: in all, and in a part of the image.
const MIN_MATCHES: usize = 50;
const MIN_MATCHES_OF_PART: usize = 8;
/// Negative disparities of smaller magnitude may belong to points far away.
const BEYOND_PX: f64 = 1.0;
/// Greatest distance of points of one picture, changed by noise or light, and the fraction of such
/// points from which they decide.
const SAME_PX: f64 = 0.25;
const MIN_SAME: f64 = 0.95;
/// Fraction of points beyond the range of a search above which they decide, of those that the
/// range has to cover, and the multiple of pixels that is named to cover them.
const MIN_SHARE: f64 = 0.8;
const COVERED: f64 = 0.9;
const STEP_PX: f64 = 8.0;
/// Iterations of the robust plane fit.
const STEPS: usize = 10;

impl AlignmentMeter {
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the matches of one more pair; a pair of another size than the first is ignored.
    pub fn add(&mut self, pair: &StereoPair) {
        if self.pairs == 0 {
            self.size = pair.size();
        } else if self.size != pair.size() {
            return;
        }
        self.pairs += 1;
        // Pair by pair, as pairs of several scenes need not share one epipolar geometry.
        let found = inliers(&matches(pair), TOLERANCE_PX);
        if found.is_empty() {
            let size = pair.size();
            for (turn, count) in Turn::ALL.iter().zip(&mut self.turned) {
                let pixel = |x, y| {
                    let (x, y) = turn.place((x, y), size);
                    pair.right().get(x, y)
                };
                let right = Gray::from_fn(size.0, size.1, pixel);
                let turned = right.and_then(|right| StereoPair::new(pair.left().clone(), right));
                *count += turned.map_or(0, |turned| inliers(&matches(&turned), TOLERANCE_PX).len());
            }
        }
        self.matches.extend(found);
    }

    /// Pairs that decide, with enough matches.
    const SURE_PAIRS: usize = 3;
    /// Greatest misalignment of aligned images: pixels, and as a fraction of that of others.
    const MAX_ALIGNED_PX: f64 = 1.0;
    const MAX_FRACTION: f64 = 0.5;

    /// True if there are enough points for a result.
    pub fn is_enough(&self) -> bool {
        self.matches.len() >= MIN_MATCHES
    }

    fn is_sure(&self) -> bool {
        self.pairs >= Self::SURE_PAIRS && self.is_enough()
    }

    /// True if these pairs are aligned and the others, of the same cameras, are not, or hardly any
    /// of their points match.
    pub fn is_better_than(&self, others: &Self) -> bool {
        let is_aligned =
            |own: &Alignment| self.is_sure() && own.median_abs_px < Self::MAX_ALIGNED_PX;
        let is_worse = |own: Alignment| {
            let others = others.alignment();
            others.is_none_or(|o| own.median_abs_px < Self::MAX_FRACTION * o.median_abs_px)
        };
        self.alignment().filter(is_aligned).is_some_and(is_worse)
    }

    /// Images that are no pair of a left and a right one, or that no algorithm can match: one
    /// camera's are turned, both are exchanged or converge, both are one picture, or their
    /// disparities are beyond those that are searched, `range`. `rig`: that of the calibrations,
    /// which follow the names of their topics and are not exchanged.
    pub fn doubt(&self, rig: Option<&Rig>, range: RangeInclusive<i32>) -> Option<Doubt> {
        let points = self.matches.len();
        let turned = self.turned.into_iter().zip(Turn::ALL);
        let (if_turned, turn) = turned.max_by_key(|(count, _)| *count)?;
        if if_turned >= MIN_MATCHES && if_turned > 4 * points {
            let cure = PairCure::Turned {
                turn,
                if_turned,
                points,
            };
            let usual = [0.0, 4.0 * points as f64];
            let name = "points_if_turned";
            return Some(cure.doubt(Subject::Pairs, name, if_turned as f64, usual));
        }
        if points < MIN_MATCHES {
            return None;
        }
        let is_same = |m: &&PointMatch| (m.left - m.right).norm() <= SAME_PX;
        let share = self.share(self.matches.iter().filter(is_same).count());
        if share > MIN_SAME {
            let cure = PairCure::OnePicture {
                share,
                points,
                within_px: SAME_PX,
                nearest_m: rig.and_then(|rig| rig.depth_m(SAME_PX)),
            };
            let usual = [0.0, MIN_SAME];
            return Some(cure.doubt(Subject::Pairs, "equal_places", share, usual));
        }
        self.exchanged(rig.is_some(), *range.start())
            .or_else(|| self.too_near(*range.end()))
    }

    fn share(&self, points: usize) -> f64 {
        points as f64 / self.matches.len() as f64
    }

    /// The disparities beyond a limit, farthest first, in the direction of a sign; `None` unless
    /// most are, and where a search to `searched_px` covers them.
    fn beyond(&self, sign: f64, limit_px: f64, searched_px: f64) -> Option<(f64, f64)> {
        let sizes = self.matches.iter().map(|m| sign * (m.left.x - m.right.x));
        let mut sizes: Vec<_> = sizes.filter(|px| *px > limit_px).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let reach_px = nearest_rank(&sizes, 0.98)?;
        let share = self.share(sizes.len());
        let covered = sizes.iter().filter(|px| **px <= searched_px).count() as f64;
        let is_covered = covered >= COVERED * sizes.len() as f64;
        (share > MIN_SHARE && !is_covered)
            .then_some((100.0 * share, (reach_px / STEP_PX).ceil() * STEP_PX))
    }

    /// Points that are farther right in the right image, unless they are searched.
    fn exchanged(&self, is_calibrated: bool, lowest_px: i32) -> Option<Doubt> {
        let (share, reach_px) = self.beyond(-1.0, BEYOND_PX, -f64::from(lowest_px))?;
        let cure = PairCure::Exchanged {
            share,
            points: self.matches.len(),
            reach_px,
            is_calibrated,
        };
        let usual = [lowest_px.into(), f64::MAX];
        Some(cure.doubt(Subject::Pairs, "disparity_px", -reach_px, usual))
    }

    /// Points that are nearer than those that are searched.
    fn too_near(&self, highest_px: i32) -> Option<Doubt> {
        let highest_px = f64::from(highest_px);
        let (share, reach_px) = self.beyond(1.0, highest_px, highest_px)?;
        let scale = (100.0 * highest_px / reach_px).floor() / 100.0;
        let cure = PairCure::BeyondRange {
            share,
            points: self.matches.len(),
            highest_px,
            reach_px,
            scale: Some(scale).filter(|scale| *scale > 0.0),
        };
        let usual = [-f64::MAX, highest_px];
        Some(cure.doubt(Subject::Pairs, "disparity_px", reach_px, usual))
    }

    /// The misalignment; `None` with too few matches.
    pub fn alignment(&self) -> Option<Alignment> {
        if self.matches.len() < MIN_MATCHES {
            return None;
        }
        let offset = |m: &PointMatch| m.right.y - m.left.y;
        let offsets: Vec<_> = self.matches.iter().map(offset).collect();
        let mut sizes: Vec<_> = offsets.iter().map(|offset| offset.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let shape = GridShape {
            columns: 3,
            rows: 3,
        };
        let part = |column, row| {
            let (x, y) = shape.pixels((column, row), self.size);
            let inside = |m: &&PointMatch| {
                x.contains(&(m.left.x as usize)) && y.contains(&(m.left.y as usize))
            };
            let offsets: Vec<_> = self.matches.iter().filter(inside).map(offset).collect();
            lower_median(offsets.iter().copied()).filter(|_| offsets.len() >= MIN_MATCHES_OF_PART)
        };
        Some(Alignment {
            pairs: self.pairs,
            matches: self.matches.len(),
            median_abs_px: nearest_rank(&sizes, 0.5)?,
            p90_abs_px: nearest_rank(&sizes, 0.9)?,
            median_px: lower_median(offsets)?,
            misfit: self.misfit(),
            parts_px: std::array::from_fn(|row| std::array::from_fn(|column| part(column, row))),
        })
    }

    fn misfit(&self) -> Misfit {
        let offset = |m: &PointMatch| m.right.y - m.left.y;
        let typical = |residual: &dyn Fn(&PointMatch) -> f64| {
            lower_median(self.matches.iter().map(|m| residual(m).abs())).unwrap_or_default()
        };
        let shift = lower_median(self.matches.iter().map(offset)).unwrap_or_default();
        let explained = (typical(&offset) / 4.0).max(Alignment::TOLERABLE_PX / 2.0);
        if typical(&|m| offset(m) - shift) <= explained {
            return Misfit::Shift;
        }
        let (width, height) = self.size;
        let terms = |m: &PointMatch| {
            Vector3::new(
                1.0,
                m.left.x / width as f64 - 0.5,
                m.left.y / height as f64 - 0.5,
            )
        };
        let mut plane = Vector3::new(shift, 0.0, 0.0);
        for _ in 0..STEPS {
            let mut normal = Matrix3::zeros();
            let mut sums = Vector3::zeros();
            for m in &self.matches {
                // Cauchy weights: outliers count little.
                let weight = 1.0 / (1.0 + (offset(m) - plane.dot(&terms(m))).powi(2));
                normal += terms(m) * terms(m).transpose() * weight;
                sums += terms(m) * offset(m) * weight;
            }
            let Some(cholesky) = normal.cholesky() else {
                return Misfit::Distortion;
            };
            plane = cholesky.solve(&sums);
        }
        if typical(&|m| offset(m) - plane.dot(&terms(m))) > explained {
            return Misfit::Distortion;
        }
        Misfit::Rotation {
            degrees: (plane.y / width as f64).atan().to_degrees(),
            scale: 1.0 + plane.z / height as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A textured pair whose right image is lower by that many rows, and more so to the right.
    fn pair(lower: f64, turned: f64) -> StereoPair {
        let blob = |x: f64, y: f64| {
            let wave = |a: f64, b: f64, c: f64| (a * x + b * y + c).sin();
            128.0
                + 60.0 * wave(0.31, 0.07, 0.0) * wave(-0.05, 0.27, 1.0)
                + 50.0 * wave(0.171, -0.133, 3.0) * wave(0.023, 0.037, 0.5)
        };
        let left = Gray::from_fn(320, 240, |x, y| blob(x as f64, y as f64) as u8).unwrap();
        let right = |x: usize, y: usize| {
            blob(
                x as f64 + 8.0,
                y as f64 - lower - turned * (x as f64 - 160.0),
            ) as u8
        };
        StereoPair::new(left, Gray::from_fn(320, 240, right).unwrap()).unwrap()
    }

    fn alignment(pair: &StereoPair) -> Option<Alignment> {
        let mut meter = AlignmentMeter::new();
        meter.add(pair);
        meter.alignment()
    }

    #[test]
    fn a_shift_is_measured_to_a_tenth_of_a_pixel() {
        for lower in [0.0, 0.3, -0.7, 12.9] {
            let found = alignment(&pair(lower, 0.0)).unwrap();
            assert!((found.median_px - lower).abs() < 0.1, "{lower}: {found:?}");
            assert!(
                (found.median_abs_px - lower.abs()).abs() < 0.1,
                "{lower}: {found:?}"
            );
            assert_eq!(found.is_off(), lower.abs() > 0.5, "{lower}");
            assert_eq!(found.misfit, Misfit::Shift);
            let doubt = found.doubt(AlignmentCure::Rectify);
            assert_eq!(doubt.is_some(), found.is_off());
            assert!(doubt.iter().all(Doubt::is_unusual), "{doubt:?}");
        }
    }

    #[test]
    fn a_rotation_shows_in_the_parts() {
        let found = alignment(&pair(0.0, 0.01)).unwrap();
        let Misfit::Rotation { degrees, scale } = found.misfit else {
            panic!("{found:?}")
        };
        assert!(
            (degrees - 0.573).abs() < 0.1 && (scale - 1.0).abs() < 1e-3,
            "{degrees} {scale}"
        );
        for row in found.parts_px {
            let [left, middle, right] = row.map(|part| part.unwrap());
            // A part's middle is 107 columns from the next one's.
            assert!(
                (right - left - 2.1).abs() < 0.4 && middle.abs() < 0.3,
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_rectification_that_misaligns_is_named() {
        let doubt = |before: f64, after: f64, pairs: usize| {
            let mut meter = RectificationMeter::default();
            let last = (0..pairs).map(|_| meter.add(&pair(before, 0.0), &pair(after, 0.0)));
            assert_eq!(last.last(), Some(pairs >= 3));
            meter.doubt().map(|doubt| doubt.to_string())
        };
        let named = doubt(0.3, 4.0, 3).unwrap();
        assert!(named.contains("without rectification and 4.0"), "{named}");
        for (before, after, pairs) in [(0.3, 4.0, 2), (1.3, 4.0, 3), (0.3, 0.3, 3), (6.0, 0.2, 3)] {
            assert_eq!(doubt(before, after, pairs), None, "{before} {after}");
        }
    }

    #[test]
    fn images_that_are_no_pair_are_named() {
        // Squares of any grey: waves look alike in many places.
        let square = |x: usize, y: usize| {
            let number = (x / 7 * 7919 + y / 7 * 104_729) as u64;
            let mixed = number.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as u8
        };
        let image = |d: usize| Gray::from_fn(320, 240, |x, y| square(x + d, y)).unwrap();
        let (left, right) = (&image(0), &image(8));
        let doubt = |left: &Gray, right: &Gray, range: RangeInclusive<i32>| {
            let mut meter = AlignmentMeter::new();
            meter.add(&StereoPair::new(left.clone(), right.clone()).unwrap());
            let doubt = meter.doubt(None, range);
            assert!(doubt.iter().all(Doubt::is_unusual), "{doubt:?}");
            doubt.map(|doubt| doubt.to_string())
        };
        let turned = Turn::ALL.map(|turn| {
            Gray::from_fn(320, 240, |x, y| {
                let (x, y) = turn.place((x, y), (320, 240));
                right.get(x, y)
            })
            .unwrap()
        });
        assert_eq!(doubt(left, right, 0..=80), None);
        // A range that covers the points, or does not.
        for range in [-16..=80, -8..=0] {
            assert_eq!(doubt(right, left, range.clone()), None, "{range:?}");
        }
        let near = doubt(left, right, 0..=5).unwrap();
        assert!(
            near.contains("`max_disparity=8`") && near.contains("--scale 0.62"),
            "{near}"
        );
        // No scale makes a range of nothing cover anything.
        let none = doubt(left, right, -8..=0).unwrap();
        assert!(none.ends_with("`max_disparity=8` covers them"), "{none}");
        let rig = Rig::new(100.0, (160.0, 120.0), 0.1, 0.0).unwrap();
        let mut meter = AlignmentMeter::new();
        meter.add(&StereoPair::new(left.clone(), left.clone()).unwrap());
        let same = meter.doubt(Some(&rig), 0..=80).unwrap().to_string();
        assert!(same.contains("or nothing is nearer than 40.0 m"), "{same}");
        for ((left, right), words) in [
            ((left, &turned[0]), "look upside down"),
            ((left, &turned[1]), "look mirrored"),
            ((right, left), "or the cameras converge: 100 %"),
            ((right, left), "`min_disparity=-8`"),
            ((left, left), "one picture twice, or nothing is near: 100 %"),
        ] {
            let doubt = doubt(left, right, 0..=80).unwrap_or_default();
            assert!(doubt.contains(words), "{words}: {doubt}");
        }
    }

    #[test]
    fn without_texture_there_is_no_result() {
        let flat = Gray::filled(320, 240, 90).unwrap();
        assert_eq!(
            alignment(&StereoPair::new(flat.clone(), flat).unwrap()),
            None
        );
    }
}
