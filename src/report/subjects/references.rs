//! References of a table, which look at no image. The *prior* reports per cell the median of the
//! truth in other runs, or, of a single run, in its other blocks: a matcher has seen what it has
//! beyond that. *Exact* reports the distance by which each cell is scored: it misses what any
//! matcher misses that is right in every cell.

use crate::rows::records::{Row, record};
use crate::rows::samples::{self, run_key};
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

    fn truth(&self, rig: Option<&Rig>) -> CellTruth {
        let near = self.is_obstacle.zip(self.is_free);
        let px = self.true_median_px;
        CellTruth {
            area: self.area,
            median: px.map(|px| CellDepth::at(px as f32, rig)),
            near: near.map(|(is_obstacle, is_free)| NearTruth {
                is_obstacle,
                is_free,
                is_clear_floor: self.is_clear_floor.unwrap_or(false),
            }),
        }
    }

    /// The score of a report of this disparity, or of none.
    fn judge(&self, reported_px: Option<f64>, rule: CellRule) -> CellJudgement {
        // Only the product of focal length and baseline counts.
        let rig = Rig::new(self.depth_px_m, (0.0, 0.0), 1.0, self.doffs_px).ok();
        let cell = Cell {
            depth: reported_px.map(|px| CellDepth::at(px as f32, rig.as_ref())),
            ..Cell::UNKNOWN
        };
        self.truth(rig.as_ref()).judge(&cell, rule)
    }
}

/// The truth of the pairs of a report.
#[derive(Default)]
pub(crate) struct ReferenceTally {
    pairs: Vec<TruePair>,
}

/// The truth of a pair, beside the row of an algorithm.
struct TruePair {
    row: Row,
    cells: Vec<TruthRow>,
}

impl ReferenceTally {
    /// Adds an unperturbed pair, with a row of any algorithm.
    pub(crate) fn add(&mut self, row: &Row, cells: Vec<TruthRow>) {
        if row.stress.is_none() && !cells.is_empty() {
            self.pairs.push(TruePair {
                row: row.clone(),
                cells,
            });
        }
    }

    /// The rows of each reference, in the order of the pairs.
    pub(crate) fn into_rows(self, rule: CellRule) -> Vec<Row> {
        let groups = self.groups();
        let medians = self.medians(&groups);
        let prior = self.pairs.iter().zip(&groups).map(|(pair, group)| {
            let median = |cell: &TruthRow| {
                let own: &CellMedians = medians.get(&(cell.column, cell.row))?;
                own.beside.get(group).copied().unwrap_or(own.all)
            };
            pair.scored(PRIOR, median, rule)
        });
        let exact = self.pairs.iter();
        let exact = exact.map(|pair| pair.scored(EXACT, |cell| cell.true_median_px, rule));
        prior.chain(exact).collect()
    }

    /// Per pair its run, or, of a single run, its block.
    fn groups(&self) -> Vec<usize> {
        let rows: Vec<_> = self.pairs.iter().map(|pair| &pair.row).collect();
        let runs: BTreeSet<_> = rows.iter().map(|row| run_key(row)).collect();
        if runs.len() == 1 {
            return samples::runs(&rows).block_numbers();
        }
        let place = |row: &&Row| runs.iter().position(|run| *run == run_key(row));
        rows.iter().filter_map(place).collect()
    }

    /// Per cell the medians of the true disparities of scored cells.
    fn medians(&self, groups: &[usize]) -> BTreeMap<(u32, u32), CellMedians> {
        let mut values: BTreeMap<(u32, u32), Vec<(f64, usize)>> = BTreeMap::new();
        for (pair, group) in self.pairs.iter().zip(groups) {
            for cell in &pair.cells {
                let own = values.entry((cell.column, cell.row)).or_default();
                own.extend(cell.true_median_px.map(|px| (px, *group)));
            }
        }
        let medians = values.into_iter();
        medians
            .map(|(place, values)| (place, CellMedians::new(values)))
            .collect()
    }
}

/// The medians of a cell's true disparities.
struct CellMedians {
    all: Option<f64>,
    /// Per group with a value that of the other groups.
    beside: BTreeMap<usize, Option<f64>>,
}

impl CellMedians {
    /// The medians of values with their groups; all are sorted once, however many groups there are.
    fn new(mut values: Vec<(f64, usize)>) -> Self {
        values.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
        let mut places: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (place, (_, group)) in values.iter().enumerate() {
            places.entry(*group).or_default().push(place);
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

impl TruePair {
    /// The row of a reference that reports those disparities.
    fn scored(
        &self,
        name: &str,
        reported_px: impl Fn(&TruthRow) -> Option<f64>,
        rule: CellRule,
    ) -> Row {
        let reported: Vec<_> = self.cells.iter().map(reported_px).collect();
        let cells = self.cells.iter().zip(&reported);
        let cells: Vec<_> = cells.map(|(cell, px)| cell.judge(*px, rule)).collect();
        let knows_floor = self.cells.iter().any(|cell| cell.is_clear_floor.is_some());
        Row {
            algorithm: name.to_owned(),
            metrics: metrics(&cells, knows_floor, rule),
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
            ..self.row.clone()
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
    use svl_core::statistics::lower_median;

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
                .map(|_| (f64::from(random.u8(..9)), random.usize(..4)))
                .collect();
            let medians = CellMedians::new(values.clone());
            for group in 0..5 {
                let others = values.iter().filter(|(_, own)| *own != group);
                let expected = lower_median(others.map(|(px, _)| *px));
                let own = medians.beside.get(&group).copied();
                assert_eq!(own.unwrap_or(medians.all), expected, "{values:?}");
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
                tally.add(&row, vec![cell(0, *true_m)]);
            }
        }
        let mut rows = tally.into_rows(CellRule::default());
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
        let scored = |true_m, reported_m: Option<f64>| {
            let judged = cell(0, true_m).judge(reported_m.map(|m| 10.0 / m), CellRule::default());
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
