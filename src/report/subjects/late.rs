//! Cells of answers that arrive late, scored by the truth of their cell when they do.
//!
//! Two pairs with a truth are around an arrival: the answer is scored by each, and both scores
//! count by how near in time they are. A truth between two is never made up.

use crate::rows::held::Row;
use crate::rows::records::CellRow;
use std::collections::{BTreeMap, VecDeque};
use svl_core::stereo::{Cell, CellDepth, CellRule, CellState};
use svl_score::judge::{AreaChoice, CellTruth, Verdict};

/// Longest time between the two pairs around an arrival.
const MAX_GAP_NS: u64 = 500_000_000;

/// Scores late answers, pair by pair.
pub(crate) struct LateTally {
    rule: CellRule,
    /// By label, of the run; an algorithm without one is not scored late.
    latencies_ns: BTreeMap<String, u64>,
    algorithms: BTreeMap<String, LateCells>,
    /// The last pair with a truth.
    before: Option<PairTruth>,
}

/// The late cells of an algorithm.
#[derive(Default)]
struct LateCells {
    /// Answers that have not arrived, the first to arrive first.
    due: VecDeque<LateAnswer>,
    /// By [`AreaChoice::PARTS`], then right, wrong and unknown: the cells of answers that arrived
    /// since its last row.
    scored: [[f64; 3]; AreaChoice::PARTS.len()],
}

struct LateAnswer {
    arrival_ns: u64,
    /// By column and row: the report, and true if it only claims to be nearer than its range.
    cells: Vec<((u32, u32), Option<CellDepth>, bool)>,
}

/// The truths of a pair's cells, by column and row, each with its rule.
struct PairTruth {
    stamp_ns: u64,
    cells: BTreeMap<(u32, u32), (CellTruth, CellRule)>,
}

impl LateTally {
    pub(crate) fn new(rule: CellRule) -> Self {
        Self {
            rule,
            latencies_ns: BTreeMap::new(),
            algorithms: BTreeMap::new(),
            before: None,
        }
    }

    /// A run begins, in which algorithms have these latencies, milliseconds.
    pub(crate) fn begin_run(&mut self, latencies_ms: &BTreeMap<String, f64>) {
        let ns = |(label, ms): (&String, &f64)| (label.clone(), (1e6 * ms).round() as u64);
        self.latencies_ns = latencies_ms.iter().map(ns).collect();
        self.algorithms.clear();
        self.before = None;
    }

    /// Adds a pair; the rows get the cells of the answers that arrived since the pair before.
    pub(crate) fn add(&mut self, pair: (u64, Option<f32>), rows: &mut [Row], cells: &[CellRow]) {
        let (stamp_ns, infinity_px) = pair;
        let now = PairTruth::new(stamp_ns, infinity_px, self.rule, cells);
        let cells = cells.chunk_by(|a, b| a.algorithm == b.algorithm);
        let cells: BTreeMap<_, _> = cells.map(|own| (own[0].algorithm.as_str(), own)).collect();
        for (label, latency_ns) in &self.latencies_ns {
            let own = self.algorithms.entry(label.clone()).or_default();
            if let Some(cells) = cells.get(label.as_str()) {
                let report = |cell: &CellRow| {
                    let is_too_close = cell.state == Some(CellState::TooClose);
                    let place = (cell.column, cell.row);
                    (place, cell.depth(infinity_px), is_too_close)
                };
                own.due.push_back(LateAnswer {
                    arrival_ns: stamp_ns + latency_ns,
                    cells: cells.iter().map(report).collect(),
                });
            }
            // An answer at once is of its own pair, with a truth or without.
            if !now.cells.is_empty() || *latency_ns == 0 {
                own.arrive(self.before.as_ref(), &now);
            }
            if let Some(row) = rows.iter_mut().find(|row| row.algorithm == *label) {
                own.tell(row);
            }
        }
        if !now.cells.is_empty() {
            self.before = Some(now);
        }
    }
}

impl PairTruth {
    /// The truths of the scored cells of any algorithm: all have the same.
    fn new(stamp_ns: u64, infinity_px: Option<f32>, rule: CellRule, cells: &[CellRow]) -> Self {
        let rule = rule.for_rig(infinity_px.is_some());
        let truth = |cell: &CellRow| {
            let px = cell.true_median_px?;
            let median = CellDepth {
                infinity_px,
                distance_m: cell.true_distance_m,
                ..CellDepth::at(px as f32, None)
            };
            let truth = CellTruth {
                area: cell.area,
                median: Some(median),
                near: None,
            };
            // Points have a tolerance of their own.
            let is_sparse = cell.true_points.is_some();
            let own = if is_sparse {
                rule.proportional_at(px)
            } else {
                rule
            };
            (cell.verdict != Verdict::NoTruth).then_some(((cell.column, cell.row), (truth, own)))
        };
        Self {
            stamp_ns,
            cells: cells.iter().filter_map(truth).collect(),
        }
    }
}

impl LateCells {
    /// Scores the answers that have arrived by this pair, and `before` it.
    fn arrive(&mut self, before: Option<&PairTruth>, now: &PairTruth) {
        let arrived = |own: &LateAnswer| own.arrival_ns <= now.stamp_ns;
        while let Some(answer) = self.due.pop_front_if(|own| arrived(own)) {
            if answer.arrival_ns == now.stamp_ns {
                self.score(&answer, &[(now, 1.0)]);
            } else if let Some(before) = before
                && (before.stamp_ns..=before.stamp_ns + MAX_GAP_NS).contains(&now.stamp_ns)
                && before.stamp_ns <= answer.arrival_ns
            {
                let since = |stamp_ns: u64| (stamp_ns - before.stamp_ns) as f64;
                let part = since(answer.arrival_ns) / since(now.stamp_ns);
                self.score(&answer, &[(before, 1.0 - part), (now, part)]);
            }
        }
    }

    /// Scores the cells that all of these have a truth of, which count by their parts.
    fn score(&mut self, answer: &LateAnswer, truths: &[(&PairTruth, f64)]) {
        for (place, depth, too_close) in &answer.cells {
            let cell = Cell {
                depth: *depth,
                too_close: *too_close,
                ..Cell::UNKNOWN
            };
            let known = truths.iter().filter_map(|(pair, part)| {
                let (truth, rule) = pair.cells.get(place)?;
                Some((truth, truth.judge(&cell, *rule).verdict, part))
            });
            let known: Vec<_> = known.collect();
            for (truth, verdict, part) in known.iter().filter(|_| known.len() == truths.len()) {
                let area = AreaChoice::PARTS.iter().position(|own| own.has(truth.area));
                let kinds = [Verdict::Right, Verdict::Wrong, Verdict::Unknown];
                let kind = kinds.iter().position(|own| own == verdict);
                if let Some((area, kind)) = area.zip(kind) {
                    self.scored[area][kind] += **part;
                }
            }
        }
    }

    /// Sets the cells that were scored since the last row.
    fn tell(&mut self, row: &mut Row) {
        for (area, scored) in AreaChoice::PARTS
            .iter()
            .zip(std::mem::take(&mut self.scored))
        {
            if scored.iter().sum::<f64>() > 0.0 {
                for (name, cells) in ["right_late", "wrong_late", "unknown_late"]
                    .iter()
                    .zip(scored)
                {
                    row.metrics.set_in(name, *area, Some(cells));
                }
            }
        }
        row.metrics.add_up();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_score::judge::{CellArea, MetricSource as _};

    const MS: u64 = 1_000_000;

    /// A cell of that true distance, and a report of it; a report or a truth may be missing.
    fn cell(reported_m: Option<f64>, true_m: Option<f64>, area: CellArea) -> CellRow {
        let px = |m: Option<f64>| m.map(|m| 10.0 / m);
        CellRow {
            algorithm: "a".into(),
            distance_m: reported_m,
            median_px: px(reported_m),
            p20_px: px(reported_m),
            p80_px: px(reported_m),
            true_distance_m: true_m,
            true_median_px: px(true_m),
            area: true_m.map(|_| area),
            verdict: match (true_m, reported_m) {
                (None, _) => Verdict::NoTruth,
                (_, None) => Verdict::Unknown,
                _ => Verdict::Right,
            },
            ..CellRow::default()
        }
    }

    /// Right, wrong and unknown cells by area: obstacles, then floor, of each of the pairs.
    fn told(latency_ms: f64, pairs: &[(u64, Option<CellRow>)]) -> Vec<[[Option<f64>; 3]; 2]> {
        let mut tally = LateTally::new(CellRule::default());
        tally.begin_run(&BTreeMap::from([("a".to_owned(), latency_ms)]));
        let told = pairs.iter().map(|(ms, cell)| {
            let mut rows = [Row {
                algorithm: "a".into(),
                ..Row::default()
            }];
            let cells: Vec<_> = cell.iter().cloned().collect();
            // A pair that it failed on has no row; the truth is that of another algorithm.
            let failed = cell.as_ref().is_some_and(|cell| cell.algorithm != "a");
            let own = if failed {
                &mut rows[..0]
            } else {
                &mut rows[..]
            };
            tally.add((ms * MS, Some(0.0)), own, &cells);
            [AreaChoice::Obstacle, AreaChoice::Floor].map(|area| {
                ["right_late", "wrong_late", "unknown_late"]
                    .map(|name| rows[0].metrics.get_in(name, area))
            })
        });
        told.collect()
    }

    const NONE: [Option<f64>; 3] = [None; 3];

    fn shares(parts: [f64; 3]) -> [Option<f64>; 3] {
        parts.map(Some)
    }

    #[test]
    fn scores_of_the_two_pairs_around_an_arrival_count_by_how_near_they_are() {
        use CellArea::{Floor, Obstacle};
        let at = |true_m, area| Some(cell(Some(1.0), Some(true_m), area));
        let pairs = [
            (0, at(1.0, Obstacle)),
            (100, at(2.0, Obstacle)),
            (200, at(2.0, Floor)),
        ];
        let found = told(25.0, &pairs);
        assert_eq!(found[0], [NONE, NONE]);
        assert_eq!(found[1], [shares([0.75, 0.25, 0.0]), NONE]);
        // Each score is of the area of its own truth.
        assert_eq!(
            found[2],
            [shares([0.0, 0.75, 0.0]), shares([0.0, 0.25, 0.0])]
        );
        // On a stamp that pair alone counts.
        let found = told(100.0, &pairs);
        assert_eq!(found[1], [shares([0.0, 1.0, 0.0]), NONE]);
        assert_eq!(found[2], [NONE, shares([0.0, 1.0, 0.0])]);
        // At once, each by its own pair, the last one, too.
        let found = told(0.0, &pairs);
        assert_eq!(found[0], [shares([1.0, 0.0, 0.0]), NONE]);
        assert_eq!(found[2], [NONE, shares([0.0, 1.0, 0.0])]);
        // Unknown stays unknown.
        let unknown = (0, Some(cell(None, Some(1.0), Obstacle)));
        let found = told(50.0, &[unknown, (100, at(1.0, Obstacle))]);
        assert_eq!(found[1], [shares([0.0, 0.0, 1.0]), NONE]);
    }

    #[test]
    fn an_arrival_between_pairs_without_truth_or_far_apart_is_not_scored() {
        let known = || Some(cell(Some(1.0), Some(1.0), CellArea::Obstacle));
        let without = || Some(cell(Some(1.0), None, CellArea::Obstacle));
        let right = |parts| [shares([parts, 0.0, 0.0]), NONE];
        // A pair without a truth is left out.
        let found = told(50.0, &[(0, known()), (100, without()), (200, known())]);
        assert_eq!(found, [[NONE; 2], [NONE; 2], right(2.0)]);
        // But an answer at once is of its own pair alone.
        let found = told(0.0, &[(0, known()), (100, without()), (200, known())]);
        assert_eq!(found, [right(1.0), [NONE; 2], right(1.0)]);
        // Before the first truth, over a gap, when time runs back, and after the end.
        let found = told(50.0, &[(0, without()), (100, known()), (601, known())]);
        assert_eq!(found, [[NONE; 2]; 3]);
        assert_eq!(
            told(50.0, &[(600, known()), (100, known())]),
            [[NONE; 2]; 2]
        );
        let found = told(400.0, &[(0, known()), (500, known())]);
        assert_eq!(found[1], right(1.0));
    }

    #[test]
    fn an_answer_that_arrives_at_a_pair_without_a_row_is_told_with_the_next() {
        let known = |name: &str| {
            let own = cell(Some(1.0), Some(1.0), CellArea::Obstacle);
            let algorithm = name.to_owned();
            Some(CellRow { algorithm, ..own })
        };
        let found = told(
            50.0,
            &[(0, known("a")), (100, known("b")), (200, known("a"))],
        );
        assert_eq!(found[2][0], shares([1.0, 0.0, 0.0]));
    }
}
