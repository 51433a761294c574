//! Errors of distances of pixels, by narrow ranges of the true distance: exact sums for any range
//! whose ends are theirs, kept in few numbers.

use crate::plausibility::sampled_places;
use crate::scenario::DistanceRange;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use svl_core::stereo::{CellRule, Estimate, Frame, Plane, Visibility};

/// Pixels of a pair that are compared, about.
const PIXELS: f64 = 1200.0;
/// Bits of a single-precision number that ranges do not tell apart: of distances, 32 ranges per
/// factor of two; of the sizes of errors, 4.
const NARROW_BITS: u32 = 18;
const SIZE_BITS: u32 = 21;

/// The number of the narrow range of a distance, in their order.
pub fn narrow_range(true_m: f64) -> u32 {
    (true_m as f32).to_bits() >> NARROW_BITS
}

/// The least distance of a narrow range, metres.
pub fn narrow_from_m(number: u32) -> f64 {
    f32::from_bits(number << NARROW_BITS).into()
}

/// The errors of an algorithm's pixels by narrow ranges.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PixelErrors(BTreeMap<u32, PixelSums>);

/// Sums over the pixels of a range.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PixelSums {
    /// Pixels with a true distance, those of them with a disparity, and those of these that are
    /// off by more than the tolerance of a right cell.
    pub scored: u64,
    pub known: u64,
    pub wrong: u64,
    /// Errors, their squares, and their sizes over the true distances.
    pub errors_m: f64,
    pub squares_m2: f64,
    pub relative: f64,
    /// Number of errors by their size.
    sizes: BTreeMap<u32, u64>,
}

impl PixelErrors {
    /// Adds an estimate of a frame whose cells are scored by distances.
    pub fn add(&mut self, frame: &Frame, estimate: &Estimate, rule: &CellRule) {
        let (Some(truth), Some(rig)) = (&frame.truth, frame.rig()) else {
            return;
        };
        if !matches!(rule, CellRule::Distance { .. }) {
            return;
        }
        let map = estimate.disparity.disparity();
        for (x, y) in sampled_places(truth.disparity.size(), PIXELS) {
            let is_seen = |seen: &Plane<_>| seen.get(x, y) == Visibility::Visible;
            let true_px = truth.disparity.get(x, y);
            if !true_px.is_finite() || !truth.visibility.as_ref().is_none_or(is_seen) {
                continue;
            }
            let Some(true_m) = rig.depth_m(true_px.into()) else {
                continue;
            };
            let sums = self.0.entry(narrow_range(true_m)).or_default();
            let reported_px = map.get(x, y);
            sums.scored += 1;
            if !reported_px.is_finite() {
                continue;
            }
            sums.known += 1;
            let error_m = rig.depth_m(reported_px.into()).map(|m| m - true_m);
            let is_wrong = error_m.is_none_or(|m| m.abs() > rule.tolerance_at_m(true_m));
            sums.wrong += u64::from(is_wrong);
            if let Some(error_m) = error_m {
                sums.errors_m += error_m;
                sums.squares_m2 += error_m * error_m;
                sums.relative += error_m.abs() / true_m;
                let size = (error_m.abs() as f32).to_bits() >> SIZE_BITS;
                *sums.sizes.entry(size).or_default() += 1;
            }
        }
    }

    /// Adds those of other pairs.
    pub fn merge(&mut self, other: &Self) {
        for (range, sums) in &other.0 {
            self.0.entry(*range).or_default().merge(sums);
        }
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The sums over a range of distances; a narrow range in which it ends belongs to one side of
    /// that by its middle.
    pub fn sums(&self, range: DistanceRange) -> PixelSums {
        let mut all = PixelSums::default();
        for (number, sums) in &self.0 {
            let middle_m = (narrow_from_m(*number) + narrow_from_m(number + 1)) / 2.0;
            if range.has(middle_m) {
                all.merge(sums);
            }
        }
        all
    }
}

impl PixelSums {
    fn merge(&mut self, other: &Self) {
        self.scored += other.scored;
        self.known += other.known;
        self.wrong += other.wrong;
        self.errors_m += other.errors_m;
        self.squares_m2 += other.squares_m2;
        self.relative += other.relative;
        for (size, count) in &other.sizes {
            *self.sizes.entry(*size).or_default() += count;
        }
    }

    /// Number of pixels with a distance.
    pub fn errors(&self) -> u64 {
        self.sizes.values().sum()
    }

    /// The median size of an error, metres, to about a tenth.
    pub fn median_m(&self) -> Option<f64> {
        let middle = self.errors().div_ceil(2);
        let mut seen = 0;
        let mut sizes = self.sizes.iter();
        let (size, _) = sizes.find(|(_, count)| {
            seen += **count;
            seen >= middle
        })?;
        let edge_m = |size: u32| f64::from(f32::from_bits(size << SIZE_BITS));
        Some((edge_m(*size) + edge_m(size + 1)) / 2.0)
    }
}
