//! References of a table, which look at no image. The *prior* reports per cell the median of the
//! truth in other runs, or, of a single run, in its other blocks: a matcher has seen what it has
//! beyond that. *Exact* reports the distance by which each cell is scored: it misses what any
//! matcher misses that is right in every cell.

use crate::rows::held::{Row, Rows};
use crate::rows::records::record;
use crate::rows::samples;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::stereo::{Cell, CellDepth, CellRule, Rig};
use svl_score::judge::{
    AreaChoice, CellArea, CellJudgement, CellTallies, CellTally, CellTruth, MetricValues,
    NearTruth, Verdict,
};
use svl_score::manifest::hash;

pub use svl_score::scenario::{EXACT, PRIOR};

record! {
    /// The truth of a cell, scored by distances: what decides the score of any report of it.
    TruthRow {
        /// Number of the pair in its run.
        sequence: u64,
        /// Column of the cell, from 0 at the left.
        column: u32,
        /// Row of the cell, from 0 at the top.
        row: u32,
        /// Area of the cell.
        area: Option<CellArea>,
        /// Median true disparity.
        true_median_px: Option<f64>,
        /// A quarter is an obstacle; absent if that is unknown.
        is_obstacle: Option<bool>,
        /// Nearly all is free.
        is_free: Option<bool>,
        /// Nothing but floor is not clear; absent also if floor is unknown.
        is_clear_floor: Option<bool>,
        /// Focal length times baseline.
        depth_px_m: f64,
        /// Difference of the principal points.
        doffs_px: f64,
    }
}

impl TruthRow {
    /// The truth of a frame's cells as rows, in raster order.
    pub fn for_cells(
        sequence: u64,
        rig: &Rig,
        knows_floor: bool,
        truths: impl Iterator<Item = ((usize, usize), CellTruth)>,
    ) -> Vec<Self> {
        let row = |((column, row), truth): ((usize, usize), CellTruth)| Self {
            sequence,
            column: column as u32,
            row: row as u32,
            area: truth.area,
            true_median_px: truth.median.map(|depth| depth.median_px.into()),
            is_obstacle: truth.near.map(|near| near.is_obstacle),
            is_free: truth.near.map(|near| near.is_free),
            is_clear_floor: truth
                .near
                .filter(|_| knows_floor)
                .map(|near| near.is_clear_floor),
            depth_px_m: rig.focal_px() * rig.baseline_m(),
            doffs_px: rig.doffs_px(),
        };
        truths.map(row).collect()
    }
}

/// A [`TruthRow`], as it is held: a report has one per cell of each pair.
struct ReferenceCell {
    /// Not a number without one.
    true_median_px: f32,
    column: u8,
    row: u8,
    area: Option<CellArea>,
    is_obstacle: Option<bool>,
    is_free: Option<bool>,
    is_clear_floor: Option<bool>,
}

impl ReferenceCell {
    fn new(cell: &TruthRow) -> Self {
        Self {
            true_median_px: cell.true_median_px.map_or(f32::NAN, |px| px as f32),
            column: cell.column as u8,
            row: cell.row as u8,
            area: cell.area,
            is_obstacle: cell.is_obstacle,
            is_free: cell.is_free,
            is_clear_floor: cell.is_clear_floor,
        }
    }

    fn true_px(&self) -> Option<f32> {
        Some(self.true_median_px).filter(|px| !px.is_nan())
    }

    fn truth(&self, rig: Option<&Rig>) -> CellTruth {
        let near = self.is_obstacle.zip(self.is_free);
        CellTruth {
            area: self.area,
            median: self.true_px().map(|px| CellDepth::at(px, rig)),
            near: near.map(|(is_obstacle, is_free)| NearTruth {
                is_obstacle,
                is_free,
                is_clear_floor: self.is_clear_floor.unwrap_or(false),
            }),
        }
    }

    /// The score of a report of this disparity, or of none.
    fn judge(&self, reported_px: Option<f32>, rig: Option<&Rig>, rule: CellRule) -> CellJudgement {
        let cell = Cell {
            depth: reported_px.map(|px| CellDepth::at(px, rig)),
            ..Cell::UNKNOWN
        };
        self.truth(rig).judge(&cell, rule)
    }
}

/// The truth of the pairs of a report.
#[derive(Default)]
pub(crate) struct ReferenceTally {
    /// A row of any algorithm per pair.
    rows: Rows,
    /// The cells of the pairs, one pair after the other.
    cells: Vec<ReferenceCell>,
    /// Per pair the end of its cells, the product of focal length and baseline, and the difference
    /// of the principal points.
    pairs: Vec<(usize, f64, f64)>,
}

impl ReferenceTally {
    /// Adds an unperturbed pair, with a row of any algorithm.
    pub(crate) fn add(&mut self, row: &Row, cells: &[TruthRow]) {
        if let Some(first) = cells.first().filter(|_| row.stress.is_none()) {
            self.rows.push(row);
            self.cells.extend(cells.iter().map(ReferenceCell::new));
            let end = self.cells.len();
            self.pairs.push((end, first.depth_px_m, first.doffs_px));
        }
    }

    /// The rows of each reference, in the order of the pairs.
    pub(crate) fn into_rows(self, rule: CellRule) -> Rows {
        let groups = self.groups();
        let medians = self.medians(&groups);
        let mut rows = Rows::default();
        for (pair, group) in groups.iter().enumerate() {
            let median = |cell: &ReferenceCell| {
                let own: &CellMedians = medians.get(&(cell.column, cell.row))?;
                own.beside.get(group).copied().unwrap_or(own.all)
            };
            rows.push(&self.scored(pair, PRIOR, median, rule));
        }
        for pair in 0..groups.len() {
            rows.push(&self.scored(pair, EXACT, ReferenceCell::true_px, rule));
        }
        rows
    }

    /// Per pair its run, or, of a single run, its block.
    fn groups(&self) -> Vec<usize> {
        let rows: Vec<_> = self.rows.iter().collect();
        let runs: BTreeSet<_> = rows.iter().map(|row| row.origin().run_key()).collect();
        if runs.len() == 1 {
            return samples::runs(&rows).block_numbers();
        }
        let runs: BTreeMap<_, _> = runs.into_iter().zip(0..).collect();
        rows.iter()
            .map(|row| runs[&row.origin().run_key()])
            .collect()
    }

    /// The cells of a pair.
    fn pair(&self, pair: usize) -> &[ReferenceCell] {
        let begin = pair.checked_sub(1).map_or(0, |before| self.pairs[before].0);
        &self.cells[begin..self.pairs[pair].0]
    }

    /// Per cell the medians of the true disparities of scored cells.
    fn medians(&self, groups: &[usize]) -> BTreeMap<(u8, u8), CellMedians> {
        let mut values: BTreeMap<(u8, u8), Vec<(f32, u32)>> = BTreeMap::new();
        for (pair, group) in groups.iter().enumerate() {
            for cell in self.pair(pair) {
                let own = values.entry((cell.column, cell.row)).or_default();
                own.extend(cell.true_px().map(|px| (px, *group as u32)));
            }
        }
        let medians = values.into_iter();
        medians
            .map(|(place, values)| (place, CellMedians::new(values)))
            .collect()
    }

    /// The row of a reference that reports those disparities of a pair.
    fn scored(
        &self,
        pair: usize,
        name: &str,
        reported_px: impl Fn(&ReferenceCell) -> Option<f32>,
        rule: CellRule,
    ) -> Row {
        let (cells, (_, depth_px_m, doffs_px)) = (self.pair(pair), self.pairs[pair]);
        // Only the product of focal length and baseline counts.
        let rig = Rig::new(depth_px_m, (0.0, 0.0), 1.0, doffs_px).ok();
        let reported: Vec<_> = cells.iter().map(reported_px).collect();
        let judge =
            |(cell, px): (&ReferenceCell, &Option<f32>)| cell.judge(*px, rig.as_ref(), rule);
        let judged: Vec<_> = cells.iter().zip(&reported).map(judge).collect();
        let knows_floor = cells.iter().any(|cell| cell.is_clear_floor.is_some());
        Row {
            algorithm: name.to_owned(),
            metrics: metrics(&judged, knows_floor, rule),
            // Nothing is matched.
            parameters_hash: String::new(),
            result_hash: hash(&format!("{reported:?}")),
            disparities: None,
            smoothing_us: None,
            texture_us: None,
            matching_us: None,
            checks_us: None,
            total_us: None,
            filters_us: None,
            ..self.rows.row(pair).to_row()
        }
    }
}

/// The medians of a cell's true disparities.
struct CellMedians {
    all: Option<f32>,
    /// Per group with a value that of the other groups.
    beside: BTreeMap<usize, Option<f32>>,
}

impl CellMedians {
    /// The medians of values with their groups; all are sorted once, however many groups there are.
    fn new(mut values: Vec<(f32, u32)>) -> Self {
        values.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
        let mut places: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (place, (_, group)) in values.iter().enumerate() {
            places.entry(*group as usize).or_default().push(place);
        }
        let median = |left_out: &[usize]| {
            let others = values.len() - left_out.len();
            let middle = others.checked_sub(1)? / 2;
            let place = left_out
                .iter()
                .fold(middle, |place, own| place + usize::from(*own <= place));
            Some(values[place].0)
        };
        let beside = places.iter().map(|(group, own)| (*group, median(own)));
        Self {
            all: median(&[]),
            beside: beside.collect(),
        }
    }
}

/// The metrics of scored cells that need no disparity map.
fn metrics(cells: &[CellJudgement], knows_floor: bool, rule: CellRule) -> MetricValues {
    let tallies = CellTallies::new(cells);
    let mut metrics = MetricValues::default();
    for area in AreaChoice::PARTS {
        let own = tallies.get(area);
        let counts = [
            ("right", own.right),
            ("wrong", own.wrong),
            ("unknown", own.unknown),
        ];
        for (name, count) in counts.into_iter().filter(|_| own.scored() > 0) {
            metrics.set_in(name, area, Some(count as f64));
        }
    }
    metrics.add_up();
    let all: &CellTally = tallies.get(AreaChoice::All);
    let near = [
        ("near", all.near),
        ("near_unknown", all.near_unknown),
        ("missed", all.missed),
        ("found", all.found),
    ];
    let falsely = rule.far_m().map(|_| ("false", all.falsely));
    let floor = knows_floor.then_some(("floor", all.floor));
    let near = near.into_iter().chain(falsely).chain(floor);
    for (name, count) in near.filter(|_| all.quarters > 0) {
        metrics.set(name, Some(count as f64));
    }
    let is_scored = cells.iter().any(|cell| cell.verdict != Verdict::NoTruth);
    metrics.set("scored_pairs", Some(f64::from(u8::from(is_scored))));
    metrics.set("scored_cells", Some(all.scored() as f64));
    metrics
}

#[cfg(test)]
mod tests {
    use super::super::speed::tests::row;
    use super::*;
    use crate::rows::held::RowRef;
    use svl_core::statistics::lower_median;
    use svl_score::judge::MetricSource as _;

    fn cell(column: u32, true_m: f64) -> TruthRow {
        TruthRow {
            sequence: 0,
            column,
            row: 0,
            area: Some(CellArea::Obstacle),
            true_median_px: Some(10.0 / true_m),
            is_obstacle: Some(true_m < 0.5),
            is_free: Some(true_m > 0.9375),
            is_clear_floor: Some(true_m > 0.75),
            depth_px_m: 10.0,
            doffs_px: 0.0,
        }
    }

    #[test]
    fn the_median_beside_a_group_is_that_of_the_others() {
        let mut random = fastrand::Rng::with_seed(1);
        for count in 0..60 {
            let values: Vec<_> = (0..count)
                .map(|_| (f32::from(random.u8(..9)), random.u32(..4)))
                .collect();
            let medians = CellMedians::new(values.clone());
            for group in 0..5 {
                let others = values.iter().filter(|(_, own)| *own != group);
                let expected = lower_median(others.map(|(px, _)| f64::from(*px)));
                let own = medians.beside.get(&(group as usize)).copied();
                assert_eq!(
                    own.unwrap_or(medians.all).map(f64::from),
                    expected,
                    "{values:?}"
                );
            }
        }
    }

    /// The right cells of the prior in each pair; pairs of a run are consecutive, of one cell each.
    fn right(runs: &[(u64, &[f64])]) -> Vec<Option<f64>> {
        let mut tally = ReferenceTally::default();
        for (seed, distances) in runs {
            for (i, true_m) in distances.iter().enumerate() {
                let row = Row {
                    seed: Some(*seed),
                    sequence: i as u64,
                    ..row(1000, (64, 48), None)
                };
                tally.add(&row, &[cell(0, *true_m)]);
            }
        }
        let rows = tally.into_rows(CellRule::default());
        let mut rows: Vec<_> = rows.iter().map(RowRef::to_row).collect();
        let exact = rows.split_off(rows.len() / 2);
        let is = |row: &Row, name: &str| row.algorithm == name && row.total_us.is_none();
        assert!(rows.iter().all(|row| is(row, PRIOR)));
        let right = |row: &Row| row.metrics.get("right");
        let is_exact = |row: &Row| is(row, EXACT) && right(row) == Some(1.0);
        assert!(exact.iter().all(is_exact));
        rows.iter().map(right).collect()
    }

    #[test]
    fn a_run_is_told_by_the_others() {
        let runs: [(u64, &[f64]); 2] = [(1, &[1.0, 1.0, 1.0]), (2, &[2.0, 2.0, 1.0])];
        let found = right(&runs);
        assert_eq!(found[..3], [Some(0.0); 3], "the median of the other is 2 m");
        assert_eq!(found[3..], [Some(0.0), Some(0.0), Some(1.0)]);
    }

    #[test]
    fn a_single_run_is_told_by_its_other_blocks() {
        // Blocks of six pairs of 27; the robot is parked.
        assert_eq!(right(&[(1, &[0.4; 27])]), [Some(1.0); 27]);
        // One pair has no others: its cells are unknown.
        assert_eq!(right(&[(1, &[0.4])]), [Some(0.0)]);
    }

    #[test]
    fn obstacles_are_found_or_missed() {
        let scored = |true_m, reported_m: Option<f32>| {
            let (own, rig) = (cell(0, true_m), Rig::new(10.0, (0.0, 0.0), 1.0, 0.0).ok());
            let px = reported_m.map(|m: f32| 10.0 / m);
            let judged = ReferenceCell::new(&own).judge(px, rig.as_ref(), CellRule::default());
            let near = judged.near;
            (judged.verdict, near.found, near.missed, near.falsely)
        };
        for (true_m, reported_m, expected) in [
            (0.4, Some(0.45), (Verdict::Right, true, false, false)),
            (0.4, Some(2.0), (Verdict::Wrong, false, true, false)),
            (0.4, None, (Verdict::Unknown, false, false, false)),
            (2.0, Some(0.74), (Verdict::Wrong, false, false, true)),
            (2.0, Some(0.4), (Verdict::Wrong, false, false, true)),
        ] {
            assert_eq!(scored(true_m, reported_m), expected);
        }
    }
}
