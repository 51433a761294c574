//! Cells with sparse truth: points of a lidar, KITTI or a laser scan.
//!
//! Points are distributed differently in a cell than its pixels, so their median is not the cell's.
//! Therefore every part of the cell that has points counts equally, however many it has.
//! `tests/bench/arena/sparse.rs` compares the scores with those of a dense truth.

use super::cells::{depth_at, is_right};
use std::ops::Range;
use svl_core::stereo::{CellRule, Plane, Rig};

/// Parts of a cell along a side.
const PARTS: usize = 8;

/// Least fraction of a cell's parts that must have points for them to represent the cell, as half
/// of the pixels do.
const COVERED: f64 = 0.5;

/// Least fraction of the rows and of the columns of parts that must have points: the median of four
/// lines across a slanted surface is not the cell's.
const SPREAD: f64 = 0.75;

/// Fewest points of a cell.
const MIN_POINTS: usize = 10;

/// Greatest distance of the points' centre from the cell's, as a fraction of its sides, if they
/// cover only a part of it.
const OFF_CENTRE: f64 = 0.2;

/// The points of a cell.
#[derive(Clone, Debug)]
pub(super) struct SparseCell {
    /// Number of points.
    pub count: usize,
    /// The true disparities.
    pub truth: Weighted,
    /// True if enough parts have points.
    covered: bool,
    centred: bool,
}

/// Disparities in ascending order, each with its weight.
#[derive(Clone, Debug)]
pub(super) struct Weighted(Vec<(f32, f64)>);

impl SparseCell {
    /// The known pixels of a cell.
    pub fn new(truth: &Plane<f32>, columns: &Range<usize>, rows: &Range<usize>) -> Self {
        let part_of = |i: usize, side: &Range<usize>| (i - side.start) * PARTS / side.len();
        let known = || {
            rows.clone().flat_map(|y| {
                let row = truth.row(y);
                let known = columns.clone().filter(|&x| row[x].is_finite());
                known.map(move |x| (x, y))
            })
        };
        let mut counts = [[0u32; PARTS]; PARTS];
        for (x, y) in known() {
            counts[part_of(y, rows)][part_of(x, columns)] += 1;
        }
        let weight = |x, y| 1.0 / f64::from(counts[part_of(y, rows)][part_of(x, columns)]);
        let points: Vec<_> = known().map(|(x, y)| (x, y, weight(x, y))).collect();
        // A small cell has fewer parts.
        let parts = columns.len().min(PARTS) * rows.len().min(PARTS);
        let with_points = counts.iter().flatten().filter(|&&count| count > 0).count();
        let across = (0..PARTS).filter(|&i| counts.iter().any(|row| row[i] > 0));
        let down = counts
            .iter()
            .filter(|row| row.iter().any(|&count| count > 0));
        let is_spread = |lines: usize, side: &Range<usize>| {
            lines as f64 >= SPREAD * side.len().min(PARTS) as f64
        };
        let is_spread = is_spread(across.count(), columns) && is_spread(down.count(), rows);
        let offset = |at: fn(&(usize, usize, f64)) -> usize, side: &Range<usize>| {
            let sum = |(of, all), point: &(usize, usize, f64)| {
                let place = (at(point) - side.start) as f64 + 0.5;
                (of + point.2 * place, all + point.2)
            };
            let (of, all) = points.iter().fold((0.0, 0.0), sum);
            (of / (all * side.len() as f64) - 0.5).abs()
        };
        Self {
            truth: Weighted::new(
                points
                    .iter()
                    .map(|&(x, y, w)| (truth.get(x, y), w))
                    .collect(),
            ),
            covered: is_spread && with_points as f64 >= COVERED * parts as f64,
            centred: offset(|p| p.0, columns).max(offset(|p| p.1, rows)) <= OFF_CENTRE,
            count: points.len(),
        }
    }

    /// True if the points determine the score: those in half of the cell's parts do; others only if
    /// they lie about its centre and four fifths of them agree.
    pub fn is_scored(&self, rule: CellRule, rig: Option<&Rig>) -> bool {
        let points_agree = || {
            let [far, near] = [10, 90].map(|percent| depth_at(self.truth.percentile(percent), rig));
            // The nearer one has the smaller tolerance.
            is_right(&near, Some(&far), rule) == Some(true)
        };
        self.count >= MIN_POINTS && (self.covered || self.centred && points_agree())
    }
}

impl Weighted {
    fn new(mut values: Vec<(f32, f64)>) -> Self {
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self(values)
    }

    fn total(&self) -> f64 {
        self.0.iter().map(|(_, weight)| weight).sum()
    }

    /// By nearest rank; infinity if empty.
    pub fn percentile(&self, percent: usize) -> f32 {
        // Sums of weights are rounded.
        let wanted = percent as f64 / 100.0 * self.total() - 1e-9;
        let mut sum = 0.0;
        let mut reached = self.0.iter().skip_while(|(_, weight)| {
            sum += weight;
            sum < wanted
        });
        let last = reached.next().or(self.0.last());
        last.map_or(f32::INFINITY, |(value, _)| *value)
    }

    /// The fraction of the weight for which a function is true, 0..=1.
    pub fn share(&self, is: impl Fn(f32) -> bool) -> f64 {
        let of = self.0.iter().filter(|(value, _)| is(*value));
        of.map(|(_, weight)| weight).sum::<f64>() / self.total()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: f32 = f32::INFINITY;
    const RULE: CellRule = CellRule::Disparity { tolerance_px: 2.0 };

    /// The points of a cell of 16 x 16 pixels.
    fn cell(truth: impl Fn(usize, usize) -> f32) -> SparseCell {
        let truth = Plane::from_fn(16, 16, truth).unwrap();
        SparseCell::new(&truth, &(0..16), &(0..16))
    }

    #[test]
    fn parts_count_alike_however_many_points_they_have() {
        // A floor of 16 rows; all points of the upper half, every fourth of the lower one.
        let floor = cell(|x, y| {
            if y < 8 || (x + y) % 4 == 0 {
                y as f32
            } else {
                NONE
            }
        });
        assert!(floor.is_scored(RULE, None));
        assert_eq!(floor.truth.percentile(50), 7.0);
        assert_eq!(floor.truth.share(|d| d < 8.0), 0.5);
    }

    #[test]
    fn points_of_a_part_are_scored_where_one_surface_surrounds_the_middle() {
        let scored = |truth: &dyn Fn(usize, usize) -> f32| cell(truth).is_scored(RULE, None);
        // A line of a laser scan, and one at the border.
        let line = |at: usize, jump: f32| {
            move |x: usize, y: usize| match (y == at, x < 8) {
                (false, _) => NONE,
                (true, true) => 5.0,
                (true, false) => 5.0 + jump,
            }
        };
        assert!(scored(&line(8, 2.0)) && !scored(&line(8, 2.1)) && !scored(&line(13, 0.0)));
        // The whole cell may show two surfaces.
        let two = |x: usize, y: usize| match (y % 8, x < 8) {
            (0, true) => 5.0,
            (4, false) => 50.0,
            _ => NONE,
        };
        assert!(!scored(&two));
        let whole = |x: usize, y: usize| match (y % 2, x < 8) {
            (1, _) => NONE,
            (_, true) => 5.0,
            (_, false) => 50.0,
        };
        assert!(scored(&whole));
        // Four lines across a floor, and eight; both in half of the parts.
        let floor = |every: usize| {
            move |_: usize, y: usize| {
                if y.is_multiple_of(every) {
                    y as f32
                } else {
                    NONE
                }
            }
        };
        assert!(!scored(&floor(4)) && scored(&floor(2)));
        // Nine points.
        assert!(!scored(&|x, y| if x % 6 == 2 && y % 6 == 2 {
            5.0
        } else {
            NONE
        }));
    }
}
