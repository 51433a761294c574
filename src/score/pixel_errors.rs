//! Errors of distances of pixels, by narrow ranges of the true distance: exact sums for any range
//! whose ends are theirs, kept in few numbers.

use crate::plausibility::sampled_places;
use crate::scenario::DistanceRange;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;
use svl_core::stereo::{CellRule, Estimate, Frame, Rig, Visibility};

/// Pixels of a pair that are compared, about.
const PIXELS: f64 = 4800.0;
/// Distances of two digits that count, metres, ascending: each begins a narrow range.
static ENDS_M: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let scales = [1000.0, 100.0, 10.0, 1.0, 0.1];
    let ends = scales.map(|scale| (10..100).map(move |digits| f64::from(digits) / scale));
    [0.0]
        .into_iter()
        .chain(ends.into_iter().flatten())
        .collect()
});
/// Bits of a single-precision number by which sizes of errors are not told apart: 8 sizes per
/// factor of two.
const SIZE_BITS: u32 = 20;
/// The other bits of 1/1024 m: smaller errors are of one size.
const MIN_SIZE: u32 = (1.0 / 1024.0_f32).to_bits() >> SIZE_BITS;

/// The number of the narrow range of a distance, in their order.
pub fn narrow_range(true_m: f64) -> usize {
    ENDS_M.partition_point(|end_m| *end_m <= true_m).max(1) - 1
}

/// The least distance of a narrow range, metres.
pub fn narrow_from_m(number: usize) -> f64 {
    ENDS_M[number]
}

/// The pixels of a frame that are compared: those with a true distance that both cameras see.
#[derive(Debug, Default)]
pub struct TruePixels {
    rig: Option<Rig>,
    pixels: Vec<TruePixel>,
}

#[derive(Debug)]
struct TruePixel {
    place: (usize, usize),
    /// The number of its narrow range.
    range: usize,
    true_m: f64,
    /// The tolerance of a right cell at that distance.
    tolerance_m: f64,
    /// True at infinity, where distances differ by little more than a disparity's error.
    is_far: bool,
}

impl TruePixels {
    /// The pixels of a frame; none if its cells are not scored by distances.
    pub fn new(frame: &Frame, rule: &CellRule) -> Self {
        let (Some(truth), Some(rig)) = (&frame.truth, frame.rig()) else {
            return Self::default();
        };
        if !matches!(rule, CellRule::Distance { .. }) {
            return Self::default();
        }
        let is_seen = |(x, y): &(usize, usize)| {
            let seen = truth.visibility.as_ref();
            seen.is_none_or(|seen| seen.get(*x, *y) == Visibility::Visible)
        };
        let pixel = |place: (usize, usize)| {
            let true_px = truth.disparity.get(place.0, place.1);
            let true_m = rig.depth_m(true_px.into());
            true_m
                .filter(|_| true_px.is_finite())
                .map(|true_m| TruePixel {
                    place,
                    range: narrow_range(true_m),
                    true_m,
                    tolerance_m: rule.tolerance_at_m(true_m),
                    is_far: f64::from(true_px - rig.infinity_px()) <= rule.far_px(),
                })
        };
        let places = sampled_places(truth.disparity.size(), PIXELS).filter(is_seen);
        let mut pixels = Vec::new();
        // Faster than to collect them.
        places.for_each(|place| pixels.extend(pixel(place)));
        Self {
            rig: Some(*rig),
            pixels,
        }
    }
}

/// The errors of an algorithm's pixels by narrow ranges: by their numbers, none before the first
/// pixel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<(usize, RangePixels)>", into = "Vec<(usize, RangePixels)>")]
pub struct PixelErrors(Vec<RangePixels>);

/// Sums over the pixels of a range.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RangePixels {
    /// Pixels with a true distance that both cameras see, those of them with a disparity, and those
    /// of these that are off by more than the tolerance of a right cell.
    pub scored: u64,
    pub known: u64,
    pub wrong: u64,
    /// Sums of true distances, of errors, of their squares, and of their sizes over the true
    /// distances.
    pub true_m: f64,
    pub errors_m: f64,
    pub squares_m2: f64,
    pub relative: f64,
    /// The number of errors of each size, ascending.
    sizes: Vec<u64>,
}

impl PixelErrors {
    /// Adds an estimate of the frame that these are the pixels of.
    pub fn add(&mut self, truth: &TruePixels, estimate: &Estimate) {
        let Some(rig) = &truth.rig else {
            return;
        };
        self.0.resize(ENDS_M.len(), RangePixels::default());
        let map = estimate.disparity.disparity();
        for pixel in &truth.pixels {
            let sums = &mut self.0[pixel.range];
            let reported_px = map.get(pixel.place.0, pixel.place.1);
            sums.scored += 1;
            sums.true_m += pixel.true_m;
            if !reported_px.is_finite() {
                continue;
            }
            sums.known += 1;
            let error_m = rig.depth_m(reported_px.into()).map(|m| m - pixel.true_m);
            let is_wrong = error_m.map_or(!pixel.is_far, |m| m.abs() > pixel.tolerance_m);
            sums.wrong += u64::from(is_wrong);
            if let Some(error_m) = error_m {
                sums.errors_m += error_m;
                sums.squares_m2 += error_m * error_m;
                sums.relative += error_m.abs() / pixel.true_m;
                sums.add_size(error_m.abs());
            }
        }
    }

    /// Adds those of other pairs.
    pub fn merge(&mut self, other: &Self) {
        self.0
            .resize(self.0.len().max(other.0.len()), RangePixels::default());
        for (own, other) in self.0.iter_mut().zip(&other.0) {
            own.merge(other);
        }
    }

    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|sums| sums.scored == 0)
    }

    /// The sums over a range of distances; a narrow range in which it ends belongs to one side of
    /// that by its beginning.
    pub fn sums(&self, range: DistanceRange) -> RangePixels {
        let mut all = RangePixels::default();
        let inside = self.0.iter().zip(ENDS_M.iter());
        let inside = inside.filter(|(_, from_m)| range.has(**from_m));
        inside.for_each(|(sums, _)| all.merge(sums));
        all
    }
}

impl From<Vec<(usize, RangePixels)>> for PixelErrors {
    fn from(filled: Vec<(usize, RangePixels)>) -> Self {
        let mut ranges = vec![RangePixels::default(); ENDS_M.len()];
        for (number, sums) in filled {
            if let Some(own) = ranges.get_mut(number) {
                *own = sums;
            }
        }
        Self(ranges)
    }
}

impl From<PixelErrors> for Vec<(usize, RangePixels)> {
    fn from(errors: PixelErrors) -> Self {
        let filled = errors.0.into_iter().enumerate();
        filled.filter(|(_, sums)| sums.scored > 0).collect()
    }
}

impl RangePixels {
    fn merge(&mut self, other: &Self) {
        self.scored += other.scored;
        self.known += other.known;
        self.wrong += other.wrong;
        self.true_m += other.true_m;
        self.errors_m += other.errors_m;
        self.squares_m2 += other.squares_m2;
        self.relative += other.relative;
        self.extend_to(other.sizes.len());
        for (own, errors) in self.sizes.iter_mut().zip(&other.sizes) {
            *own += errors;
        }
    }

    fn add_size(&mut self, error_m: f64) {
        let size = (error_m as f32).to_bits() >> SIZE_BITS;
        let size = (size + 1).saturating_sub(MIN_SIZE) as usize;
        self.extend_to(size + 1);
        self.sizes[size] += 1;
    }

    /// Makes it have at least that number of sizes.
    fn extend_to(&mut self, sizes: usize) {
        self.sizes.resize(self.sizes.len().max(sizes), 0);
    }

    /// Number of pixels with a distance.
    pub fn errors(&self) -> u64 {
        self.sizes.iter().sum()
    }

    /// The median size of an error, metres, to about a twentieth; 0 below a millimetre.
    pub fn median_m(&self) -> Option<f64> {
        let middle = self.errors().div_ceil(2);
        let mut seen = 0;
        let size = self.sizes.iter().position(|errors| {
            seen += errors;
            *errors > 0 && seen >= middle
        })?;
        let edge_m = |size: u32| f64::from(f32::from_bits((MIN_SIZE + size) << SIZE_BITS));
        let least = (size as u32).checked_sub(1);
        Some(least.map_or(0.0, |least| (edge_m(least) + edge_m(least + 1)) / 2.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::{self, GridSettings};
    use svl_core::stereo::{DisparityMap, Geometry, Plane, StereoPair, Truth};

    #[test]
    fn sizes_are_told_apart_to_a_twentieth() {
        for error_m in [0.001, 0.03, 0.3, 0.5, 4.0, 90_000.0] {
            let mut sums = RangePixels::default();
            [0.0, error_m, 1e9].iter().for_each(|m| sums.add_size(*m));
            let median_m = sums.median_m().unwrap();
            assert!(
                (median_m / error_m - 1.0).abs() < 0.07,
                "{error_m}: {median_m}"
            );
            let again = serde_json::to_string(&sums).unwrap();
            assert_eq!(serde_json::from_str::<RangePixels>(&again).unwrap(), sums);
        }
        let mut sums = RangePixels::default();
        assert_eq!(sums.median_m(), None);
        sums.add_size(0.0009);
        assert_eq!(sums.median_m(), Some(0.0));
    }

    #[test]
    fn sums_are_those_of_the_pixels_of_a_range() {
        // 40 m·px, 1200 pixels: from 1 m on in steps of 1 cm; every fifth is unknown, every
        // seventh of the others 20 cm too far and so wrong up to 1 m.
        let rig = Rig::new(400.0, (20.0, 15.0), 0.1, 0.0).unwrap();
        let true_m = |i: usize| 1.0 + i as f64 / 100.0;
        let reported_m = |i: usize| match (i % 5, i % 7) {
            (0, _) => None,
            (_, 0) => Some(true_m(i) * 1.3),
            _ => Some(true_m(i)),
        };
        let mut map = DisparityMap::new(40, 30).unwrap();
        for (y, mut row) in map.rows_mut().enumerate() {
            for x in 0..40 {
                if let Some(m) = reported_m(y * 40 + x) {
                    row.accept(x, (40.0 / m) as f32);
                }
            }
        }
        let truth = Plane::from_fn(40, 30, |x, y| (40.0 / true_m(y * 40 + x)) as f32).unwrap();
        let image = Plane::filled(40, 30, 0).unwrap();
        let pair = StereoPair::new(image.clone(), image).unwrap();
        let mut frame = Frame::new(pair, Geometry::Rectified(Some(rig)));
        frame.truth = Some(Truth::exact(truth, None));
        let mut errors = PixelErrors::default();
        let estimate = Estimate {
            algorithm: String::new(),
            grid: depth::grid(map.disparity(), GridSettings::default(), Some(&rig)),
            disparity: map,
            own_grid: false,
            unfiltered: None,
            range_px: None,
            times: None,
        };
        errors.add(&TruePixels::new(&frame, &CellRule::default()), &estimate);
        // Ends of narrow ranges.
        let range: DistanceRange = "2..8".parse().unwrap();
        let sums = errors.sums(range);
        let inside = || (0..1200).filter(|i| range.has(true_m(*i)));
        let known = inside().filter(|i| i % 5 > 0).count() as u64;
        let wrong: Vec<_> = inside().filter(|i| i % 5 > 0 && i % 7 == 0).collect();
        assert_eq!((sums.scored, sums.known), (600, known));
        assert_eq!((sums.errors(), sums.wrong), (known, wrong.len() as u64));
        let bias: f64 = wrong.iter().map(|i| 0.3 * true_m(*i)).sum();
        assert!((sums.errors_m - bias).abs() < 1e-3 * bias);
        let squares: f64 = wrong.iter().map(|i| (0.3 * true_m(*i)).powi(2)).sum();
        assert!((sums.squares_m2 - squares).abs() < 1e-3 * squares);
        assert!(sums.median_m().unwrap() < 1e-3);
        // Nothing is lost between ranges, and the sums of two halves are those of the whole.
        let mut twice = errors.clone();
        twice.merge(&errors);
        assert_eq!(twice.sums(DistanceRange::ALL).scored, 2400);
        // Neither what one camera sees nor what is scored by disparities.
        let tolerance_px = 2.0;
        let by_disparity = TruePixels::new(&frame, &CellRule::Disparity { tolerance_px });
        let mut visibility = Plane::filled(40, 30, Visibility::Occluded).unwrap();
        visibility.set(7, 5, Visibility::Visible);
        frame.truth.as_mut().unwrap().visibility = Some(visibility);
        let seen = TruePixels::new(&frame, &CellRule::default());
        assert_eq!((by_disparity.pixels.len(), seen.pixels.len()), (0, 1));
    }
}
