//! Cells with sparse truth: points of a lidar, KITTI or a laser scan.
//!
//! What has no points (sky, glass, the upper edge of a lidar) depends on the scene, so the points
//! say nothing about the rest of the cell. Therefore every part of the cell that has points counts
//! equally, however many it has, and the others may hold anything: a percentile of the cell is only
//! known to lie in a range, and the cell is scored if that is narrow. The reports play no part, so
//! the same cells are scored for all algorithms. `tests/bench/arena/sparse.rs` compares the scores
//! with those of a dense truth.

use std::ops::Range;
use svl_core::stereo::{CellDepth, CellRule, Plane, Rig};

/// Parts of a cell along a side.
const PARTS: usize = 8;

/// Fewest points of a cell.
const MIN_POINTS: usize = 10;

/// The points of a cell.
#[derive(Clone, Debug)]
pub(super) struct SparseCell {
    /// Number of points.
    pub count: usize,
    /// Number of the cell's parts.
    parts: usize,
    /// Number of those with points.
    with_points: usize,
    /// Disparities in ascending order, each with its weight: those of a part add up to 1.
    points: Vec<(f32, f64)>,
}

impl SparseCell {
    /// The known pixels of a cell: all but `+∞`, which is unknown.
    pub fn new(truth: &Plane<f32>, columns: &Range<usize>, rows: &Range<usize>) -> Self {
        let part_of = |i: usize, side: &Range<usize>| (i - side.start) * PARTS / side.len();
        let known = || {
            rows.clone().flat_map(|y| {
                let row = truth.row(y);
                let known = columns.clone().filter(|&x| row[x] < f32::INFINITY);
                known.map(move |x| (x, y))
            })
        };
        let mut counts = [[0u32; PARTS]; PARTS];
        for (x, y) in known() {
            counts[part_of(y, rows)][part_of(x, columns)] += 1;
        }
        let weight = |x, y| 1.0 / f64::from(counts[part_of(y, rows)][part_of(x, columns)]);
        let mut points: Vec<_> = known()
            .map(|(x, y)| (truth.get(x, y), weight(x, y)))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self {
            count: points.len(),
            // A small cell has fewer parts.
            parts: columns.len().min(PARTS) * rows.len().min(PARTS),
            with_points: counts.iter().flatten().filter(|&&count| count > 0).count(),
            points,
        }
    }

    /// True if a part of the cell has no known pixel.
    pub fn has_holes(truth: &Plane<f32>, columns: &Range<usize>, rows: &Range<usize>) -> bool {
        let parts = |side: &Range<usize>| {
            let (start, length) = (side.start, side.len());
            let edge = move |part: usize| start + (part * length).div_ceil(PARTS);
            let parts = (0..PARTS).map(move |part| edge(part)..edge(part + 1));
            parts.filter(|part| !part.is_empty())
        };
        let is_unknown = |y: usize, x: &Range<usize>| {
            let mut row = truth.row(y)[x.clone()].iter();
            !row.any(|d| *d < f32::INFINITY)
        };
        parts(rows).any(|y| parts(columns).any(|x| y.clone().all(|y| is_unknown(y, &x))))
    }

    /// False for too few points to score the cell.
    pub fn is_enough(&self) -> bool {
        self.count >= MIN_POINTS
    }

    /// A percentile of the cell's disparities: the middle of its range, if that is as narrow as the
    /// rule's tolerance, or at infinity. `None` if not, or for too few points.
    pub fn percentile(
        &self,
        percent: usize,
        rule: CellRule,
        rig: Option<&Rig>,
    ) -> Option<CellDepth> {
        let range = self.range(percent).filter(|_| self.is_enough())?;
        let middle_px = (range[0] + range[1]) / 2.0;
        let rule = rule.proportional_at(middle_px.into());
        let [p20_px, p80_px] =
            [20, 80].map(|percent| self.at_rank(percent as f64 / 100.0 * self.with_points as f64));
        is_narrow(range, rule, rig)?.then(|| CellDepth {
            p20_px,
            p80_px,
            ..CellDepth::at(middle_px, rig)
        })
    }

    /// True if the cell's median is the same by a rule, whatever the parts without points hold.
    pub fn tells_median(&self, rule: CellRule, rig: Option<&Rig>) -> bool {
        let range = self.range(50);
        range.is_some_and(|range| is_narrow(range, rule, rig) == Some(true))
    }

    /// True if a function is so for a fraction of the cell, 0..=1; `None` if that depends on the
    /// parts without points.
    pub fn tells_share(&self, least: f64, is: impl Fn(f32) -> bool) -> Option<bool> {
        let among_points = self.share(is) * self.with_points as f64;
        let without = (self.parts - self.with_points) as f64;
        // Sums of weights are rounded.
        let wanted = least * self.parts as f64 - 1e-9;
        let [fewest, most] = [among_points, among_points + without].map(|parts| parts >= wanted);
        (fewest == most).then_some(most)
    }

    /// The least and the greatest value of a percentile (by nearest rank) for any content of the
    /// parts without points, pixels; `None` if it may lie in one of these.
    pub fn range(&self, percent: usize) -> Option<[f32; 2]> {
        let rank = percent as f64 / 100.0 * self.parts as f64;
        let without = (self.parts - self.with_points) as f64;
        let is_among_points = rank >= without && rank <= self.with_points as f64;
        // All parts without points are farther, or all are nearer.
        is_among_points.then(|| [rank - without, rank].map(|rank| self.at_rank(rank)))
    }

    /// The disparity with at least this weight up to and including it.
    fn at_rank(&self, rank: f64) -> f32 {
        // Sums of weights are rounded.
        let wanted = rank - 1e-9;
        let mut sum = 0.0;
        let mut reached = self.points.iter().skip_while(|(_, weight)| {
            sum += weight;
            sum < wanted
        });
        let last = reached.next().or(self.points.last());
        last.map_or(f32::INFINITY, |(value, _)| *value)
    }

    /// The fraction of the points' weight for which a function is true, 0..=1.
    pub fn share(&self, is: impl Fn(f32) -> bool) -> f64 {
        let weights = self.points.iter().filter(|(value, _)| is(*value));
        weights.map(|(_, weight)| weight).sum::<f64>() / self.with_points as f64
    }
}

/// True for a range of disparities as narrow as a rule's tolerance, or at infinity; `None` if its
/// distances are unknown.
fn is_narrow([far_px, near_px]: [f32; 2], rule: CellRule, rig: Option<&Rig>) -> Option<bool> {
    let depth_m = |px: f32| rig?.depth_m(px.into());
    Some(match rule {
        CellRule::Disparity { tolerance_px } => f64::from(near_px - far_px) <= tolerance_px,
        _ if CellDepth::at(near_px, rig).is_far() => true,
        CellRule::Distance { .. } => {
            let middle = CellDepth::at((far_px + near_px) / 2.0, rig);
            depth_m(far_px)? - depth_m(near_px)? <= rule.tolerance_at_m(middle.distance_m?)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NONE: f32 = f32::INFINITY;
    const RULE: CellRule = CellRule::Disparity { tolerance_px: 2.0 };

    /// The points of a cell of 16 x 16 pixels, four to a part.
    fn cell(truth: impl Fn(usize, usize) -> f32) -> SparseCell {
        let truth = Plane::from_fn(16, 16, truth).unwrap();
        SparseCell::new(&truth, &(0..16), &(0..16))
    }

    /// The points of a cell with these parts: each a disparity, or none.
    fn cell_of_parts(parts: &[Option<u8>]) -> SparseCell {
        cell(|x, y| parts[y / 2 * PARTS + x / 2].map_or(NONE, f32::from))
    }

    fn scored_px(cell: &SparseCell, percent: usize) -> Option<f32> {
        let depth = cell.percentile(percent, RULE, None);
        depth.map(|depth| depth.median_px)
    }

    /// A percentile by nearest rank of a cell whose parts without points hold `content`.
    fn completed(parts: &[Option<u8>], percent: usize, content: &[f32]) -> f32 {
        let mut unknown = content.iter().copied();
        let value = |part: &Option<u8>| part.map_or_else(|| unknown.next().unwrap(), f32::from);
        let mut values: Vec<_> = parts.iter().map(value).collect();
        values.sort_by(f32::total_cmp);
        values[(percent * values.len()).div_ceil(100) - 1]
    }

    /// Parts, each with one of a few disparities or none, with more of the one or the other.
    fn parts() -> impl Strategy<Value = Vec<Option<u8>>> {
        (0.0..0.7).prop_flat_map(|without| {
            let part = prop::option::weighted(1.0 - without, 10u8..20);
            prop::collection::vec(part, PARTS * PARTS)
        })
    }

    proptest! {
        #[test]
        fn a_percentile_is_in_its_range_whatever_the_other_parts_hold(
            parts in parts(),
            percent in prop::sample::select(vec![50, 75]),
            content in prop::collection::vec(0.0f32..30.0, PARTS * PARTS),
        ) {
            let without = parts.iter().filter(|part| part.is_none()).count();
            let extremes = [0.0, 30.0].map(|px| completed(&parts, percent, &[px; PARTS * PARTS]));
            let range = cell_of_parts(&parts).range(percent);
            // At exactly half, the lower median is the upper end of the parts without points.
            prop_assume!(2 * without != parts.len());
            if let Some([far_px, near_px]) = range {
                let any = completed(&parts, percent, &content);
                prop_assert!((far_px..=near_px).contains(&any), "{far_px} {any} {near_px}");
                // Both ends occur.
                prop_assert_eq!([far_px, near_px], extremes);
            } else {
                // The percentile may be that of a part without points.
                prop_assert!(extremes[0] == 0.0 || extremes[1] == 30.0);
            }
        }

        #[test]
        fn a_scored_cell_is_off_by_half_the_tolerance_at_most(
            parts in parts(),
            content in prop::collection::vec(0.0f32..30.0, PARTS * PARTS),
        ) {
            let without = parts.iter().filter(|part| part.is_none()).count();
            prop_assume!(2 * without != parts.len());
            if let Some(middle_px) = scored_px(&cell_of_parts(&parts), 50) {
                prop_assert!((completed(&parts, 50, &content) - middle_px).abs() <= 1.0);
            }
        }
    }

    /// All contents of two parts without points, in a cell of 2 x 3 pixels (its parts).
    #[test]
    fn a_small_cell_is_as_all_contents_of_its_parts_allow() {
        let known = [5.0, 1.0, 4.0, 2.0];
        let truth = Plane::from_vec(3, 2, [known.as_slice(), &[NONE; 2]].concat()).unwrap();
        let range = |percent| SparseCell::new(&truth, &(0..3), &(0..2)).range(percent);
        let contents = (0..=6).flat_map(|a| (0..=6).map(move |b| [a as f32, b as f32]));
        let medians = contents.map(|[a, b]| {
            let mut all = [known.as_slice(), &[a, b]].concat();
            all.sort_by(f32::total_cmp);
            // The third of six.
            all[2]
        });
        let medians: Vec<_> = medians.collect();
        let least = medians.iter().copied().fold(NONE, f32::min);
        let greatest = medians.iter().copied().fold(-NONE, f32::max);
        assert_eq!((least, greatest), (1.0, 4.0));
        assert_eq!(range(50), Some([least, greatest]));
        // The nearest quarter may be both parts without points.
        assert_eq!(range(75), None);
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
        assert_eq!(scored_px(&floor, 50), Some(7.0));
        assert_eq!(floor.share(|d| d < 8.0), 0.5);
    }

    #[test]
    fn a_cell_is_scored_where_its_median_is_known_to_the_tolerance() {
        // The upper rows of parts have no points: the sky, and a slanted surface below it.
        let below_sky = |rows: usize, px_per_part: f32| {
            cell(move |_, y| {
                if y < 2 * rows {
                    NONE
                } else {
                    20.0 + px_per_part * (y / 2) as f32
                }
            })
        };
        let scored = |rows, px_per_part| scored_px(&below_sky(rows, px_per_part), 50);
        // All of the sky is far or near: from the 4th row of parts to the 4th but 2 below.
        assert_eq!(below_sky(2, 1.0).range(50), Some([23.0, 25.0]));
        assert_eq!((scored(2, 1.0), scored(2, 1.1)), (Some(24.0), None));
        // Half of the parts are enough if they show one surface, and fewer never are.
        assert_eq!((scored(4, 0.0), scored(5, 0.0)), (Some(20.0), None));
        // The nearest quarter needs three quarters of them.
        let quarter = |rows| scored_px(&below_sky(rows, 0.0), 75);
        assert_eq!((quarter(2), quarter(3)), (Some(20.0), None));
        // Ten points in half of the parts of a small cell, and nine.
        let of_row = |points: usize| {
            let truth = Plane::from_fn(80, 1, |x, _| if x % 8 == 0 { 5.0 } else { NONE });
            SparseCell::new(&truth.unwrap(), &(0..8 * points), &(0..1))
        };
        assert_eq!(
            [10, 9].map(|n| scored_px(&of_row(n), 50)),
            [Some(5.0), None]
        );
    }

    #[test]
    fn the_tolerance_is_that_of_disparities_or_distances() {
        // Two rows of parts have no points; the median is that of one of two surfaces.
        let two = |far_px: f32, near_px: f32| {
            cell(move |_, y| match y {
                0..4 => NONE,
                4..9 => far_px,
                _ => near_px,
            })
        };
        let is_scored = |far_px, near_px, rule, rig: Option<Rig>| {
            let cell = two(far_px, near_px);
            cell.percentile(50, rule, rig.as_ref()).is_some()
        };
        // 2 px, and 5 % of the middle: 2.5 px at 50.
        let px = |far_px, near_px| is_scored(far_px, near_px, RULE, None);
        assert!(px(10.0, 12.0) && !px(10.0, 12.1));
        assert!(px(48.8, 51.2) && !px(48.7, 51.3));
        // One metre is 10 px: at 2 m, 20 %; at 0.25 m, 0.1 m.
        let rig = Rig::new(100.0, (8.0, 8.0), 0.1, 0.0).unwrap();
        let at_m = |far_m: f64, near_m: f64, rig: Option<Rig>| {
            let [far_px, near_px] = [far_m, near_m].map(|z| (10.0 / z) as f32);
            is_scored(far_px, near_px, CellRule::default(), rig)
        };
        assert!(at_m(2.19, 1.81, Some(rig)) && !at_m(2.22, 1.78, Some(rig)));
        assert!(at_m(0.30, 0.21, Some(rig)) && !at_m(0.31, 0.20, Some(rig)));
        // A cell of which a part may be at infinity has no distance, unless all of it is there.
        assert!(!at_m(f64::INFINITY, 50.0, Some(rig)) && !at_m(2.0, 2.0, None));
        assert!(at_m(f64::INFINITY, f64::INFINITY, Some(rig)));
        // The truth is the middle in pixels, and the distance there.
        let depth = two(4.8, 5.2)
            .percentile(50, CellRule::default(), Some(&rig))
            .unwrap();
        assert!(
            (depth.median_px - 5.0).abs() < 1e-5 && (depth.distance_m.unwrap() - 2.0).abs() < 1e-5
        );
    }
}
