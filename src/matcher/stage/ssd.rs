//! Block matching by the sum of squared differences (thesis, section 5.3, equations 5.1 and 5.2).
//!
//! Departures from the thesis: the cost `SSD · (0.16 d + 1)` is taken 25 times, in integers, and with |d|, so that it is
//! also a penalty behind the point where the view axes cross.

use crate::error::{Error, Result};
use crate::kernel::{Isa, Search, Winner, winners};
use crate::matcher::{Parameter, Range};
use crate::stereo::{Reason, RowMut};
use std::ops;

/// Half of the one-dimensional window of nine pixels.
pub(super) const REACH: usize = 4;

/// The disparities a matcher tries, both ends included, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DisparityRange {
    min: i32,
    max: i32,
}

impl DisparityRange {
    /// Farthest disparity either way. With it the largest cost, `Search::MAX_SSD · weight(LIMIT)`, fits 32 bits.
    pub const LIMIT: i32 = 1024;

    /// Lowest disparity, as the matchers' tables have it.
    pub const MIN: Parameter = Parameter {
        name: "min_disparity",
        unit: "px",
        range: Range::Int { default: 0, min: -Self::LIMIT, max: Self::LIMIT },
        description: "lowest disparity tried; below 0 for cameras whose view axes cross",
    };
    /// Highest disparity, as the matchers' tables have it.
    pub const MAX: Parameter = Parameter {
        name: "max_disparity",
        unit: "px",
        range: Range::Int { default: 80, min: -Self::LIMIT, max: Self::LIMIT },
        description: "highest disparity tried: the nearest obstacle that can be seen",
    };

    /// # Errors
    /// [`Error::Invalid`] when `min` is above `max` or one of them beyond ±[`DisparityRange::LIMIT`].
    pub fn new(min: i32, max: i32) -> Result<Self> {
        if min <= max && -Self::LIMIT <= min && max <= Self::LIMIT {
            Ok(Self { min, max })
        } else {
            Err(Error::Invalid(format!(
                "min_disparity={min}, max_disparity={max}: the first must not exceed the second, nor either ±{}",
                Self::LIMIT
            )))
        }
    }

    pub fn min(self) -> i32 {
        self.min
    }

    pub fn max(self) -> i32 {
        self.max
    }

    /// The larger of |min| and |max|.
    pub fn farthest(self) -> i32 {
        self.min.abs().max(self.max.abs())
    }

    /// The x of a row whose window has an admissible disparity: one that keeps it inside the right image.
    pub fn columns(self, width: usize) -> ops::Range<usize> {
        let (reach, width) = (REACH as i32, width as i32);
        let first = reach + self.min.max(0);
        let end = width - reach + self.max.min(0);
        if first < end { first as usize..end as usize } else { 0..0 }
    }

    /// What multiplies an SSD to make it a cost: 25 · (0.16 |d| + 1).
    pub fn weight(disparity: i32) -> u32 {
        25 + 4 * disparity.unsigned_abs()
    }
}

/// Finds in a row the cheapest match of each textured pixel. It holds one thread's scratch.
pub struct BlockSearch {
    search: Search,
    weights: Vec<u32>,
    columns: ops::Range<usize>,
    windows: Vec<u32>,
    winners: Vec<Winner>,
}

impl BlockSearch {
    /// For rows of `width` pixels.
    pub fn new(width: usize, range: DisparityRange) -> Self {
        // A match at disparity d lies d pixels to the left: the kernel's ties to the higher offset are to the smaller d.
        let search = Search::new(width, -range.max, -range.min, true);
        Self {
            weights: search.offsets().map(DisparityRange::weight).collect(),
            search,
            columns: range.columns(width),
            windows: Vec::with_capacity(width),
            winners: Vec::with_capacity(width),
        }
    }

    /// Fills `row`: the winners, *border* where no disparity is admissible, *untextured* elsewhere.
    pub fn match_row(&mut self, isa: Isa, left: &[u8], right: &[u8], textured: &[bool], row: &mut RowMut<'_>) {
        row.clear(Reason::Border);
        self.windows.clear();
        for x in self.columns.clone() {
            if textured[x] {
                self.windows.push(x as u32);
            } else {
                row.reject(x, Reason::Untextured, crate::stereo::DisparityMap::NO_SSDPI);
            }
        }
        winners(isa, &mut self.search, left, right, &self.weights, &self.windows, &mut self.winners);
        for (&x, winner) in self.windows.iter().zip(&self.winners) {
            row.accept(x as usize, -winner.offset as f32, winner.ssd);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_cost_fits() {
        assert!(Search::MAX_SSD.checked_mul(DisparityRange::weight(DisparityRange::LIMIT)).is_some());
    }

    #[test]
    fn columns_are_those_with_an_admissible_disparity() {
        for (min, max, width) in
            [(0, 80, 100), (-7, 3, 40), (5, 9, 20), (-9, -5, 20), (0, 0, 9), (30, 80, 20), (0, 8, 8)]
        {
            let range = DisparityRange::new(min, max).unwrap();
            let inside = |x: i32| x >= 4 && x + 4 < width;
            let expected: Vec<usize> =
                (0..width).filter(|&x| inside(x) && (min..=max).any(|d| inside(x - d))).map(|x| x as usize).collect();
            assert_eq!(range.columns(width as usize).collect::<Vec<_>>(), expected, "{min}..={max} in {width}");
        }
    }

    #[test]
    fn an_upside_down_range_is_refused_in_one_line() {
        let error = DisparityRange::new(5, 4).unwrap_err().to_string();
        assert!(error.contains("min_disparity=5") && !error.contains('\n'), "{error}");
    }
}
