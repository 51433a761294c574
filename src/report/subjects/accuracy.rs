//! Errors of distances by range, and their stability over time, from the cells of a run.
//!
//! Depth users judge a camera so: "Tuning depth cameras for best performance" (Grunnet-Jepsen,
//! Sweetser, Woodfill, Intel) names fill rate, Z accuracy, and temporal noise; AbsRel is that of
//! Eigen, Puhrsch and Fergus (Depth Map Prediction from a Single Image, NIPS 2014, section 4.2).

use crate::rows::records::{CellRow, record};
use std::collections::BTreeMap;
use svl_core::statistics::nearest_rank;
use svl_core::stereo::{CellRule, CellState};
use svl_score::bootstrap::Sample;
use svl_score::judge::{AreaChoice, Cases, CellNumber, Measured, Verdict};

/// Largest change of a cell at rest between successive answers, of its true distance.
const MAX_MOTION: f64 = 0.01;
/// Longest time between successive answers, ns: pairs without a time are farther apart.
const MAX_GAP_NS: u64 = 1_000_000_000;
/// Nearest bound that doubles, metres, and the last one.
const BOUNDS_M: (f64, f64) = (1.0, 16.0);

record! {
    #[derive(Default)]
    /// Errors of an algorithm's distances by area, then of all cells: of all distances, then by
    /// range of the true distance. A cell counts if it is scored and has a distance. Unperturbed
    /// pairs only.
    AccuracyRow {
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// The cells: obstacle (with pixels), floor, beyond, or all.
        area: AreaChoice,
        /// Least true distance.
        from_m: f64,
        /// True distances are nearer; absent for the last range and for all.
        to_m: Option<f64>,
        /// Number of cells with a reported and a true distance.
        cells: u64,
        /// Number of known cells with a true distance: also those that are reported at infinity.
        known: u64,
        /// Mean of reported minus true distance.
        bias_m: Option<f64>,
        /// Root of the mean squared error.
        rmse_m: Option<f64>,
        /// Median absolute error, by nearest rank.
        median_error_m: Option<f64>,
        /// Mean of the absolute error over the true distance, a fraction.
        abs_rel: Option<f64>,
        /// Number of cells at rest: scored in two successive answers, with true distances that
        /// differ by at most 1 %.
        resting: u64,
        /// Number of frames with cells at rest, counting the one before the first of them.
        frames: u64,
        /// Number of cells at rest that are known in both answers.
        resting_known: u64,
        /// Number of these with a distance in both.
        resting_cells: u64,
        /// Standard deviation of the error over time: the root of half the mean squared difference
        /// of successive errors, of the cells at rest with both distances.
        noise_m: Option<f64>,
        /// Fraction of the cells at rest that change between known and unknown, or by more than the
        /// tolerance of a right cell.
        flicker: Option<f64>,
    }
}

impl AccuracyRow {
    /// The number of a metric, and the cases that it rests on.
    pub(crate) fn measured(&self, number: CellNumber) -> Option<Measured> {
        let value = match number {
            CellNumber::Bias => self.bias_m,
            CellNumber::Rmse => self.rmse_m,
            CellNumber::MedianError => self.median_error_m,
            CellNumber::AbsRel => self.abs_rel,
            CellNumber::Noise => self.noise_m,
            CellNumber::Flicker => self.flicker,
            CellNumber::ErrorCells => Some(self.cells as f64),
            CellNumber::RestingCells => Some(self.resting as f64),
        };
        let (items, cells, possible) = match number {
            CellNumber::Noise => (self.frames, self.resting_cells, Some(self.resting_known)),
            CellNumber::Flicker | CellNumber::RestingCells => (self.frames, self.resting, None),
            // They rest on cells, whatever their pairs.
            _ => (0, self.cells, Some(self.known)),
        };
        let cases = Cases {
            items,
            cells: Some(cells),
            possible,
        };
        value.map(|value| Measured { value, cases })
    }

    /// The range of true distances.
    pub(crate) fn range_words(&self) -> String {
        match self.to_m {
            None if self.is_of_all() => "all".to_owned(),
            None => format!("from {}", self.from_m),
            Some(to_m) => format!("{}–{to_m}", self.from_m),
        }
    }

    /// Middle of the range on a logarithmic scale, metres.
    pub(crate) fn middle_m(&self) -> f64 {
        let to_m = self.to_m.unwrap_or(2.0 * self.from_m);
        (self.from_m.max(to_m / 2.0) * to_m).sqrt()
    }

    /// True for the row of all distances.
    pub(crate) fn is_of_all(&self) -> bool {
        self.from_m == 0.0 && self.to_m.is_none()
    }
}

/// The errors of an algorithm in a range, or in a pair.
#[derive(Default)]
pub(crate) struct RangeErrors {
    /// Reported minus true distances.
    errors_m: Vec<f32>,
    relative: f64,
    /// Known cells with a true distance.
    known: u64,
    resting: u64,
    flickers: u64,
    /// Stamp of the newest pair with cells at rest, and the number of these pairs.
    newest_ns: Option<u64>,
    followers: u64,
    /// Cells at rest that are known in both pairs, those of them with both distances, and their
    /// squared differences of successive errors.
    resting_known: u64,
    resting_cells: u64,
    squares: f64,
}

/// A cell in the last answer of its algorithm.
struct LastCell {
    stamp_ns: u64,
    true_m: f64,
    is_known: bool,
    reported_m: Option<f64>,
}

/// The errors of all algorithms, while the cells of a run's pairs come in their order.
pub(crate) struct AccuracyTally {
    rule: CellRule,
    bounds_m: Vec<f64>,
    /// By label.
    algorithms: BTreeMap<String, AlgorithmErrors>,
    /// True in a run whose pairs each show another scene.
    has_separate_pairs: bool,
}

/// The errors of an algorithm.
struct AlgorithmErrors {
    /// By [`AreaChoice`] and range, that of all distances first.
    areas: [Vec<RangeErrors>; AreaChoice::ALL.len()],
    /// By column and row.
    last: BTreeMap<(u32, u32), LastCell>,
}

impl AccuracyTally {
    pub(crate) fn new(rule: CellRule) -> Self {
        let (near_m, _) = rule.obstacle_and_clear_m();
        let (mut next, end) = BOUNDS_M;
        let mut bounds_m = vec![near_m];
        while next <= end {
            if next > near_m {
                bounds_m.push(next);
            }
            next *= 2.0;
        }
        Self {
            rule,
            bounds_m,
            algorithms: BTreeMap::new(),
            has_separate_pairs: false,
        }
    }

    /// A run begins: its first pair follows none, and where each shows another scene, none does.
    pub(crate) fn begin_pass(&mut self, has_separate_pairs: bool) {
        self.has_separate_pairs = has_separate_pairs;
        let algorithms = self.algorithms.values_mut();
        algorithms.for_each(|own| own.last.clear());
    }

    /// Adds the cells of a pair. `stamp_ns`: none of a scene, which follows no other in time.
    pub(crate) fn add(&mut self, stamp_ns: Option<u64>, cells: &[CellRow]) {
        let stamp_ns = stamp_ns.filter(|_| !self.has_separate_pairs);
        for cell in cells.iter().filter(|cell| cell.stress.is_none()) {
            let is_scored = cell.verdict != Verdict::NoTruth;
            let Some(true_m) = cell.true_distance_m.filter(|_| is_scored) else {
                continue;
            };
            let is_answer = cell.verdict != Verdict::Unknown;
            let is_known = cell
                .state
                .map_or(is_answer, |state| state == CellState::Known);
            let reported_m = cell.distance_m.filter(|_| is_known);
            let range = 1 + self.bounds_m.partition_point(|bound| *bound <= true_m);
            // Not by `entry`, which needs a label of its own for each cell.
            if !self.algorithms.contains_key(&cell.algorithm) {
                let new = AlgorithmErrors::new(2 + self.bounds_m.len());
                self.algorithms.insert(cell.algorithm.clone(), new);
            }
            let Some(own) = self.algorithms.get_mut(&cell.algorithm) else {
                continue;
            };
            let now = LastCell {
                stamp_ns: stamp_ns.unwrap_or_default(),
                true_m,
                is_known,
                reported_m,
            };
            let before = own.last.get(&(cell.column, cell.row));
            let since = |before: &&LastCell| stamp_ns?.checked_sub(before.stamp_ns);
            let before = before.filter(|own| since(own).is_some_and(|ns| ns <= MAX_GAP_NS));
            let areas = AreaChoice::ALL
                .into_iter()
                .filter(|area| area.has(cell.area));
            for (area, i) in areas.flat_map(|area| [(area, 0), (area, range)]) {
                let errors = &mut own.areas[area as usize][i];
                errors.known += u64::from(is_known);
                if let Some(reported_m) = reported_m {
                    errors.errors_m.push((reported_m - true_m) as f32);
                    errors.relative += (reported_m - true_m).abs() / true_m;
                }
                if let Some(before) = before {
                    errors.add_change(&self.rule, before, &now);
                }
            }
            own.last.insert((cell.column, cell.row), now);
        }
    }

    /// [`AccuracyTally::add`] for the cells of one algorithm; returns the errors that they add,
    /// by [`AreaChoice`].
    pub(crate) fn take_pair(&mut self, stamp_ns: Option<u64>, cells: &[CellRow]) -> PairErrors {
        self.add(stamp_ns, cells);
        let label = cells.first().map(|cell| cell.algorithm.as_str());
        let own = label.and_then(|label| self.algorithms.get_mut(label));
        own.map_or_else(PairErrors::default, |own| {
            AreaChoice::ALL.map(|area| std::mem::take(&mut own.areas[area as usize][0]))
        })
    }

    /// Per algorithm, in the order of the labels, and per area the errors of all distances and of
    /// each range that has any.
    pub(crate) fn into_rows(mut self, labels: &[&str]) -> Vec<AccuracyRow> {
        let mut rows = Vec::new();
        for label in labels {
            let Some(all) = self.algorithms.remove(*label) else {
                continue;
            };
            let bounds = || self.bounds_m.iter().copied();
            let starts = [0.0, 0.0].into_iter().chain(bounds());
            let ends = [None].into_iter().chain(bounds().map(Some)).chain([None]);
            let ranges: Vec<_> = starts.zip(ends).collect();
            for (area, own) in AreaChoice::ALL.into_iter().zip(all.areas) {
                let own = own.into_iter().zip(&ranges);
                let own = own.filter(|(errors, _)| !errors.is_empty());
                rows.extend(own.map(|(errors, range)| errors.into_row(label, area, *range)));
            }
        }
        rows
    }
}

impl AlgorithmErrors {
    fn new(ranges: usize) -> Self {
        let own = |_| (0..ranges).map(|_| RangeErrors::default());
        Self {
            areas: AreaChoice::ALL.map(|area| own(area).collect()),
            last: BTreeMap::new(),
        }
    }
}

/// The errors in a pair, by [`AreaChoice`].
pub(crate) type PairErrors = [RangeErrors; AreaChoice::ALL.len()];

impl RangeErrors {
    fn is_empty(&self) -> bool {
        self.resting == 0 && self.known == 0
    }

    /// Adds a cell of two successive answers, if it is at rest.
    fn add_change(&mut self, rule: &CellRule, before: &LastCell, now: &LastCell) {
        let true_m = now.true_m;
        if (true_m - before.true_m).abs() > MAX_MOTION * before.true_m {
            return;
        }
        self.resting += 1;
        if self.newest_ns.replace(now.stamp_ns) != Some(now.stamp_ns) {
            self.followers += 1;
        }
        self.resting_known += u64::from(before.is_known && now.is_known);
        match (before.reported_m, now.reported_m) {
            (None, None) => {}
            (Some(was), Some(is)) => {
                self.resting_cells += 1;
                let difference = (is - true_m) - (was - before.true_m);
                self.squares += difference * difference;
                let flickers = (is - was).abs() > rule.tolerance_at_m(true_m);
                self.flickers += u64::from(flickers);
            }
            _ => self.flickers += 1,
        }
    }

    /// The row of the cells of an area in pairs.
    pub(crate) fn row_of(pairs: &[PairErrors], area: AreaChoice) -> AccuracyRow {
        let mut all = Self::default();
        for own in pairs.iter().map(|own| &own[area as usize]) {
            all.errors_m.extend(&own.errors_m);
            all.relative += own.relative;
            all.known += own.known;
            all.resting += own.resting;
            all.flickers += own.flickers;
            all.followers += own.followers;
            all.resting_known += own.resting_known;
            all.resting_cells += own.resting_cells;
            all.squares += own.squares;
        }
        all.into_row("", area, (0.0, None))
    }

    /// The values of a metric in the cells of an area in pairs, as [`RangeErrors::into_row`] has it
    /// over all of them.
    pub(crate) fn sample(number: CellNumber, pairs: &[PairErrors], area: AreaChoice) -> Sample {
        let pairs = || pairs.iter().map(move |own| &own[area as usize]);
        let errors = |own: &Self| -> Vec<f64> {
            let errors = own.errors_m.iter().copied();
            errors.map(f64::from).collect()
        };
        let parts = |part: &dyn Fn(&Self) -> [f64; 2]| pairs().map(part).collect::<Vec<_>>();
        let cells = |own: &Self| own.errors_m.len() as f64;
        match number {
            CellNumber::Bias => Sample::Ratio(parts(&|own| [errors(own).iter().sum(), cells(own)])),
            CellNumber::Rmse => Sample::Root(parts(&|own| {
                let squares = errors(own).into_iter().map(|error| error * error);
                [squares.sum(), cells(own)]
            })),
            CellNumber::MedianError => {
                let sizes = |own: &Self| errors(own).iter().map(|error| error.abs()).collect();
                Sample::Median(pairs().map(sizes).collect())
            }
            CellNumber::AbsRel => Sample::Ratio(parts(&|own| [own.relative, cells(own)])),
            CellNumber::Noise => {
                Sample::Root(parts(&|own| [own.squares, 2.0 * own.resting_cells as f64]))
            }
            CellNumber::ErrorCells => Sample::Count(pairs().map(cells).collect()),
            CellNumber::RestingCells => {
                Sample::Count(pairs().map(|own| own.resting as f64).collect())
            }
            CellNumber::Flicker if pairs().all(|own| own.errors_m.is_empty()) => {
                Sample::Ratio(Vec::new())
            }
            CellNumber::Flicker => {
                Sample::Ratio(parts(&|own| [own.flickers as f64, own.resting as f64]))
            }
        }
    }

    fn into_row(
        mut self,
        label: &str,
        area: AreaChoice,
        (from_m, to_m): (f64, Option<f64>),
    ) -> AccuracyRow {
        let cells = self.errors_m.len() as u64;
        let mean = |sum: f64| (cells > 0).then(|| sum / cells as f64);
        let errors = || self.errors_m.iter().copied().map(f64::from);
        let (bias_m, square) = (mean(errors().sum()), mean(errors().map(|e| e * e).sum()));
        let abs_rel = mean(self.relative);
        self.errors_m
            .iter_mut()
            .for_each(|error| *error = error.abs());
        self.errors_m.sort_by(f32::total_cmp);
        AccuracyRow {
            algorithm: label.to_owned(),
            area,
            from_m,
            to_m,
            cells,
            known: self.known,
            bias_m,
            rmse_m: square.map(f64::sqrt),
            median_error_m: nearest_rank(&self.errors_m, 0.5).map(f64::from),
            abs_rel,
            resting: self.resting,
            frames: self.followers + u64::from(self.followers > 0),
            resting_known: self.resting_known,
            resting_cells: self.resting_cells,
            noise_m: (self.resting_cells > 0)
                .then(|| (self.squares / (2.0 * self.resting_cells as f64)).sqrt()),
            flicker: (self.resting > 0 && cells > 0)
                .then(|| self.flickers as f64 / self.resting as f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of a cell at 1 m in pairs with these stamps.
    fn rows(stamps: &[Option<u64>]) -> Vec<AccuracyRow> {
        let cell = CellRow {
            algorithm: "v3".into(),
            verdict: Verdict::Right,
            distance_m: Some(1.0),
            true_distance_m: Some(1.0),
            state: Some(CellState::Known),
            ..CellRow::default()
        };
        let mut tally = AccuracyTally::new(CellRule::default());
        for stamp_ns in stamps {
            tally.add(*stamp_ns, std::slice::from_ref(&cell));
        }
        tally.into_rows(&["v3"])
    }

    #[test]
    fn a_range_has_its_nearer_bound() {
        let rows = rows(&[None]);
        let ranges: Vec<_> = rows.iter().map(AccuracyRow::range_words).collect();
        assert_eq!(ranges, ["all", "1–2"]);
    }

    #[test]
    fn photographs_have_no_noise() {
        let resting = |stamps: [Option<u64>; 2]| {
            let row = &rows(&stamps)[0];
            (row.frames, row.resting_cells, row.noise_m, row.flicker)
        };
        assert_eq!(resting([Some(0), Some(9)]), (2, 1, Some(0.0), Some(0.0)));
        assert_eq!(resting([None, None]), (0, 0, None, None));
    }
}
