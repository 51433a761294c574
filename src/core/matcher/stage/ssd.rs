//! Block matching by the sum of squared differences (thesis, section 5.3, equations 5.1 and 5.2).
//!
//! Departures from the thesis: the cost `SSD · (0.16 d + 1)` is scaled by 25, to integers, and uses
//! |d|, so that it is also a penalty behind the crossing of the optical axes.

use super::RowSearch;
use crate::error::{Error, Result};
use crate::kernel::{Isa, Lanes, Match, REACH, SsdSearch, WINDOW, accept_row, matches, weight};
use crate::matcher::{Parameter, Parameters, Range};
use crate::stereo::{Reason, RowMut};
use std::ops;

/// The disparities that a matcher searches, both ends included, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DisparityRange {
    min: i32,
    max: i32,
}

impl DisparityRange {
    /// Farthest disparity in either direction. With it the largest cost, 9 · 255² · weight(LIMIT),
    /// fits 32 bits.
    pub const LIMIT: i32 = 1024;

    /// Lowest disparity, as a parameter of the matchers.
    pub const MIN: Parameter = Parameter {
        name: "min_disparity",
        unit: "px",
        range: Range::int(0, -Self::LIMIT..=Self::LIMIT),
        description: "lowest disparity tried; below 0 for cameras whose view axes cross",
    };
    /// Highest disparity, as a parameter of the matchers.
    pub const MAX: Parameter = Parameter {
        name: "max_disparity",
        unit: "px",
        range: Range::int(80, -Self::LIMIT..=Self::LIMIT),
        description: "highest disparity tried: the nearest obstacle that can be seen",
    };

    /// # Errors
    /// [`Error::Usage`] if `min` is above `max` or either is beyond ±[`DisparityRange::LIMIT`].
    pub fn new(min: i32, max: i32) -> Result<Self> {
        if min <= max && -Self::LIMIT <= min && max <= Self::LIMIT {
            Ok(Self { min, max })
        } else {
            Err(Error::Usage(format!(
                "min_disparity={min}, max_disparity={max}: the first must not exceed the second, \
                 nor either ±{}",
                Self::LIMIT
            )))
        }
    }

    /// From the parameters of a matcher.
    ///
    /// # Errors
    /// The errors of [`DisparityRange::new`].
    pub fn from_parameters(parameters: &Parameters) -> Result<Self> {
        Self::new(
            parameters.int(Self::MIN.name),
            parameters.int(Self::MAX.name),
        )
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

    /// The columns of a row whose window has an admissible disparity: one that keeps it inside the
    /// right image.
    pub fn columns(self, width: usize) -> ops::Range<usize> {
        let (reach, width) = (REACH as i32, width as i32);
        let first = reach + self.min.max(0);
        let end = width - reach + self.max.min(0);
        if first < end {
            first as usize..end as usize
        } else {
            0..0
        }
    }

    /// The disparities that are admissible anywhere in rows of `width` pixels.
    pub fn within(self, width: usize) -> ops::RangeInclusive<i32> {
        let farthest = farthest_shift(width);
        self.min.max(-farthest)..=self.max.min(farthest)
    }

    /// The disparities that keep the window around `x` inside a right row of `width` pixels.
    pub fn admissible(self, x: usize, width: usize) -> ops::RangeInclusive<i32> {
        let (x, reach) = (x as i32, REACH as i32);
        self.min.max(x - (width as i32 - 1 - reach))..=self.max.min(x - reach)
    }
}

/// The search for the cheapest of the disparities of `range` in rows of `width` pixels.
pub(super) fn search(width: usize, range: DisparityRange) -> SsdSearch {
    let disparities = range.within(width);
    SsdSearch::new(
        width,
        // Disparities that no window of the row can have are not searched.
        *disparities.start(),
        disparities.map(weight).collect(),
    )
}

/// Finds the cheapest match of each textured pixel. It holds one thread's scratch.
pub struct BlockSearch {
    range: DisparityRange,
    search: SsdSearch,
    /// Row after row.
    matches: Vec<Match>,
}

impl BlockSearch {
    /// For rows of `width` pixels.
    pub fn new(width: usize, range: DisparityRange) -> Self {
        Self {
            range,
            search: search(width, range),
            matches: vec![Match::NONE; width * Lanes::COUNT],
        }
    }
}

impl RowSearch for BlockSearch {
    fn search(&mut self, isa: Isa, left: &[Lanes<u16>], right: &[Lanes<u16>], rows: usize) {
        matches(
            isa,
            left,
            right,
            &mut self.search,
            &mut self.matches[..rows * left.len()],
        );
    }

    fn write_row(
        &self,
        isa: Isa,
        lane: usize,
        _: [&[u8]; 2],
        textured: &[bool],
        row: &mut RowMut<'_>,
    ) {
        let (width, columns) = (row.width(), self.range.columns(row.width()));
        let matches = &self.matches[lane * width..][..width];
        row.part_mut(0..columns.start).clear(Reason::Border);
        row.part_mut(columns.end..width).clear(Reason::Border);
        let part = &mut row.part_mut(columns.clone());
        accept_row(
            isa,
            self.search.first(),
            &matches[columns.clone()],
            &textured[columns],
            part,
        );
    }
}

/// The largest distance between two windows of a row, −1 if there is no window.
pub(super) fn farthest_shift(width: usize) -> i32 {
    width as i32 - 2 * REACH as i32 - 1
}

/// The SSD of the windows around `x` in `left` and `u` in `right`.
pub(super) fn ssd(left: &[u8], x: usize, right: &[u8], u: usize) -> u32 {
    let window = |row: &[u8], x: usize| -> [u8; WINDOW] {
        // Windows lie inside their rows.
        *row[x - REACH..]
            .first_chunk()
            .expect("a window inside the row")
    };
    window(left, x)
        .iter()
        .zip(window(right, u))
        .map(|(&a, b)| u32::from(a.abs_diff(b)).pow(2))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_cost_fits() {
        assert!(
            (WINDOW as u32 * 255 * 255)
                .checked_mul(weight(DisparityRange::LIMIT))
                .is_some()
        );
    }

    #[test]
    fn columns_are_those_with_an_admissible_disparity() {
        for (min, max, width) in [
            (0, 80, 100),
            (-7, 3, 40),
            (5, 9, 20),
            (-9, -5, 20),
            (0, 0, 9),
            (30, 80, 20),
            (0, 8, 8),
        ] {
            let range = DisparityRange::new(min, max).unwrap();
            let inside = |x: i32| x >= 4 && x + 4 < width;
            let expected: Vec<usize> = (0..width)
                .filter(|&x| inside(x) && (min..=max).any(|d| inside(x - d)))
                .map(|x| x as usize)
                .collect();
            assert_eq!(
                range.columns(width as usize).collect::<Vec<_>>(),
                expected,
                "{min}..={max} in {width}"
            );
        }
    }

    #[test]
    fn an_upside_down_range_is_refused_in_one_line() {
        let error = DisparityRange::new(5, 4).unwrap_err().to_string();
        assert!(
            error.contains("min_disparity=5") && !error.contains('\n'),
            "{error}"
        );
    }
}
