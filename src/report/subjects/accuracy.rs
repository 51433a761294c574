//! Errors of distances by range, and their stability over time, from the cells of a run.
//!
//! Depth users judge a camera so: "Tuning depth cameras for best performance" (Grunnet-Jepsen,
//! Sweetser, Woodfill, Intel) names fill rate, Z accuracy, and temporal noise; AbsRel is that of
//! Eigen, Puhrsch and Fergus (Depth Map Prediction from a Single Image, NIPS 2014, section 4.2).

use crate::rows::records::{CellRow, record};
use std::collections::BTreeMap;
use svl_core::Result;
use svl_core::doubt::rounded;
use svl_core::statistics::nearest_rank;
use svl_core::stereo::{CellRule, CellState};
use svl_score::bootstrap::Sample;
use svl_score::judge::{AreaChoice, Cases, CellNumber, Measured, Metric, Verdict};
use svl_score::manifest::Manifest;
use svl_score::pixel_errors::{PixelErrors, narrow_from_m, narrow_range};
use svl_score::scenario::{DistanceRange, Limit, RangeEnds};

/// Largest change of a cell at rest between successive answers, of its true distance.
const MAX_MOTION: f64 = 0.01;
/// Longest time between successive answers, ns: pairs without a time are farther apart.
const MAX_GAP_NS: u64 = 1_000_000_000;
/// Number of ranges of equal counts.
const EQUAL_RANGES: u64 = 5;

record! {
    #[derive(Default)]
    /// Errors of an algorithm's distances by area of cells, then of all cells, then of pixels: of
    /// all distances, then by range of the true distance: the scenario's `ranges`, or five with
    /// equal counts of true cells, and those of limits. Unperturbed pairs only.
    AccuracyRow {
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// The cells: obstacle (with pixels), floor, beyond, or all.
        area: AreaChoice,
        /// True if it is of pixels, in place of cells: of about 4800 of each pair, of which those
        /// that both cameras see are scored; their ranges end at distances of two digits.
        is_of_pixels: bool,
        /// True if a limit asks for the range, beside those of the run.
        is_of_limit: bool,
        /// Least true distance.
        from_m: f64,
        /// True distances are nearer; absent for the last range and for all.
        to_m: Option<f64>,
        /// Number of cells or pixels with a reported and a true distance.
        cells: u64,
        /// Number of known ones with a true distance: also those that are reported at infinity.
        known: u64,
        /// Number of scored ones with a true distance.
        scored: u64,
        /// Mean true distance of the scored.
        mean_true_m: Option<f64>,
        /// Fraction of the scored that are right or wrong, and not unknown.
        fill: Option<f64>,
        /// Fraction of the scored that are wrong: cells by their verdict, pixels that are off by
        /// more than the tolerance of a right cell.
        wrong: Option<f64>,
        /// Mean of reported minus true distance.
        bias_m: Option<f64>,
        /// Root of the mean squared error.
        rmse_m: Option<f64>,
        /// Median absolute error, by nearest rank; of pixels to a twentieth, 0 below 1 mm.
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
    pub(crate) fn range(&self) -> DistanceRange {
        DistanceRange {
            from_m: self.from_m,
            to_m: self.to_m,
        }
    }

    /// The same in words.
    pub(crate) fn range_words(&self) -> String {
        let limit = if self.is_of_limit { " (gate)" } else { "" };
        match self.to_m {
            None if self.is_of_all() => "all".to_owned(),
            None => format!("from {}{limit}", rounded(self.from_m)),
            Some(to_m) => format!("{}–{}{limit}", rounded(self.from_m), rounded(to_m)),
        }
    }

    /// A share of cells that right, wrong, unknown and known are of.
    pub(crate) fn share(&self, metric: &Metric) -> Option<Measured> {
        let (fill, wrong) = (self.fill?, self.wrong?);
        let value = match metric.name {
            "right" => fill - wrong,
            "wrong" => wrong,
            "known" => fill,
            "unknown" => 1.0 - fill,
            _ => return None,
        };
        let cases = Cases {
            cells: Some(self.scored),
            ..Cases::none()
        };
        Some(Measured { value, cases })
    }

    /// True for the row of all distances.
    pub(crate) fn is_of_all(&self) -> bool {
        self.range() == DistanceRange::ALL
    }

    /// The row of an algorithm's pixels.
    fn from_pixels(algorithm: &str, pixels: &PixelErrors, range: DistanceRange) -> Self {
        let sums = pixels.sums(range);
        let cells = sums.errors();
        let mean = |sum: f64| ratio(sum, cells);
        Self {
            algorithm: algorithm.to_owned(),
            area: AreaChoice::All,
            is_of_pixels: true,
            cells,
            known: sums.known,
            mean_true_m: ratio(sums.true_m, sums.scored),
            fill: share(sums.known, sums.scored),
            wrong: share(sums.wrong, sums.scored),
            bias_m: mean(sums.errors_m),
            rmse_m: mean(sums.squares_m2).map(f64::sqrt),
            median_error_m: sums.median_m(),
            abs_rel: mean(sums.relative),
            scored: sums.scored,
            from_m: range.from_m,
            to_m: range.to_m,
            ..Self::default()
        }
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    ratio(part as f64, whole)
}

fn ratio(sum: f64, cases: u64) -> Option<f64> {
    (cases > 0).then(|| sum / cases as f64)
}

/// The ranges by which the errors of a run are told apart.
#[derive(Default)]
pub(crate) struct RunRanges {
    /// The distances at which the ranges of the scenario end.
    ends: RangeEnds,
    /// The ranges of its limits.
    limited: Vec<DistanceRange>,
}

impl RunRanges {
    /// # Errors
    /// [`svl_core::Error::Invalid`] for a manifest that is not what svl writes.
    pub(crate) fn new(manifest: &Manifest) -> Result<Self> {
        let limits: Vec<Limit> = manifest.part("gate")?.unwrap_or_default();
        Ok(Self {
            ends: manifest.part("ranges")?.unwrap_or_default(),
            limited: limits.iter().filter_map(|limit| limit.range).collect(),
        })
    }

    /// The distances at which any of them ends.
    fn ends_m(&self) -> Vec<f64> {
        let limited = self.limited.iter().flat_map(|range| range.ends_m());
        let mut ends_m: Vec<_> = limited.chain(self.ends.metres().iter().copied()).collect();
        ends_m.sort_by(f64::total_cmp);
        ends_m.dedup();
        ends_m
    }

    /// All distances, then the ranges of the scenario, or else those of equal counts, and those of
    /// limits.
    pub(crate) fn in_order(&self, tally: &AccuracyTally) -> Vec<AskedRange> {
        let mut ranges = vec![DistanceRange::ALL];
        if self.ends.is_empty() {
            ranges.extend(tally.equal_ranges());
        } else {
            ranges.extend(between(self.ends.metres()));
        }
        let mut asked: Vec<_> = ranges.into_iter().map(|range| (range, false)).collect();
        for range in &self.limited {
            if asked.iter().all(|(own, _)| own != range) {
                asked.push((*range, true));
            }
        }
        asked
    }
}

/// A range, and whether a limit alone asks for it.
pub(crate) type AskedRange = (DistanceRange, bool);

/// The ranges that end at ascending distances, and the one beyond; none without ends.
fn between(ends_m: &[f64]) -> Vec<DistanceRange> {
    if ends_m.is_empty() {
        return Vec::new();
    }
    let starts = [0.0].into_iter().chain(ends_m.iter().copied());
    let ends = ends_m.iter().copied().map(Some).chain([None]);
    let range = |(from_m, to_m)| DistanceRange { from_m, to_m };
    starts.zip(ends).map(range).collect()
}

/// The errors of an algorithm in a range, or in a pair.
#[derive(Clone, Default)]
pub(crate) struct RangeErrors {
    /// The last true distance of a cell.
    true_m: f64,
    /// Reported minus true distances.
    errors_m: Vec<f32>,
    relative: f64,
    /// Scored cells with a true distance, the sum of these, and the cells that are known, unknown
    /// by their verdict, and wrong.
    scored: u64,
    sum_true_m: f64,
    known: u64,
    unknown: u64,
    wrong: u64,
    resting: u64,
    flickers: u64,
    /// The pairs with cells at rest, by their numbers.
    followers: Vec<u32>,
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
    /// Distances that end a range.
    ends_m: Vec<f64>,
    /// By label.
    algorithms: BTreeMap<String, AlgorithmErrors>,
    /// True in a run whose pairs each show another scene.
    has_separate_pairs: bool,
    /// Number of pairs so far.
    pairs: u32,
}

/// A narrow range: its number, and that of the ends of ranges that are not farther.
type NarrowRange = (usize, usize);

/// The errors of an algorithm.
#[derive(Default)]
struct AlgorithmErrors {
    /// By [`AreaChoice`] and narrow range: each cell once, in the part that it is of, else in all.
    areas: [BTreeMap<NarrowRange, RangeErrors>; AreaChoice::ALL.len()],
    pixels: PixelErrors,
    /// By column and row.
    last: BTreeMap<(u32, u32), LastCell>,
}

impl AlgorithmErrors {
    /// The errors of an area by narrow range.
    fn ranges(&self, area: AreaChoice) -> impl Iterator<Item = (&NarrowRange, &RangeErrors)> {
        let has = move |own: &AreaChoice| [*own, AreaChoice::All].contains(&area);
        let areas = AreaChoice::ALL.into_iter().filter(has);
        areas.flat_map(|own| &self.areas[own as usize])
    }
}

impl AccuracyTally {
    pub(crate) fn new(rule: CellRule, ranges: &RunRanges) -> Self {
        Self {
            rule,
            ends_m: ranges.ends_m(),
            algorithms: BTreeMap::new(),
            has_separate_pairs: false,
            pairs: 0,
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
        self.pairs += 1;
        let stamp_ns = stamp_ns.filter(|_| !self.has_separate_pairs);
        for cell in cells.iter().filter(|cell| cell.stress.is_none()) {
            let is_scored = cell.verdict != Verdict::NoTruth;
            let Some(true_m) = cell.true_distance_m.filter(|_| is_scored) else {
                continue;
            };
            let is_answer = cell.verdict != Verdict::Unknown;
            let is_known = cell.state.map_or(is_answer, |state| {
                [CellState::Known, CellState::Far].contains(&state)
            });
            let reported_m = cell.distance_m.filter(|_| is_known);
            let ends = self.ends_m.partition_point(|end_m| *end_m <= true_m);
            let range = (narrow_range(true_m), ends);
            // Not by `entry`, which needs a label of its own for each cell.
            if !self.algorithms.contains_key(&cell.algorithm) {
                let new = AlgorithmErrors::default();
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
            let mut parts = AreaChoice::PARTS.into_iter();
            let area = parts.find(|area| area.has(cell.area));
            let area = area.unwrap_or(AreaChoice::All);
            let errors = own.areas[area as usize].entry(range).or_default();
            errors.true_m = true_m;
            errors.scored += 1;
            errors.sum_true_m += true_m;
            errors.unknown += u64::from(!is_answer);
            errors.known += u64::from(is_known);
            errors.wrong += u64::from(cell.verdict == Verdict::Wrong);
            if let Some(reported_m) = reported_m {
                errors.errors_m.push((reported_m - true_m) as f32);
                errors.relative += (reported_m - true_m).abs() / true_m;
            }
            if let Some(before) = before {
                errors.add_change(&self.rule, before, &now, self.pairs);
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
            let errors = AreaChoice::ALL.map(|area| {
                let own = own.ranges(area).map(|(_, errors)| errors);
                RangeErrors::merged(own)
            });
            own.areas = Default::default();
            errors
        })
    }

    /// Adds the pixels of some pairs of an algorithm.
    pub(crate) fn add_pixels(&mut self, label: &str, pixels: &PixelErrors) {
        let own = self.algorithms.entry(label.to_owned()).or_default();
        own.pixels.merge(pixels);
    }

    /// Ranges with about as many scored cells of true distances each, over all algorithms: of the
    /// headline's area, if there are any, else of all.
    fn equal_ranges(&self) -> Vec<DistanceRange> {
        let counts_in = |area: AreaChoice| {
            let mut counts: BTreeMap<usize, u64> = BTreeMap::new();
            let own = self.algorithms.values();
            for ((range, _), errors) in own.flat_map(|own| own.ranges(area)) {
                *counts.entry(*range).or_default() += errors.scored;
            }
            counts
        };
        let areas = [AreaChoice::default(), AreaChoice::All].map(counts_in);
        let counts = areas.into_iter().find(|counts| !counts.is_empty());
        let counts = counts.unwrap_or_default();
        let all: u64 = counts.values().sum();
        let (mut ends_m, mut seen, mut full) = (Vec::new(), 0, 0);
        for (range, count) in counts {
            // A range ends where it has its share; a narrow one may have those of several.
            let shares = seen * EQUAL_RANGES / all;
            if shares > full {
                ends_m.push(narrow_from_m(range));
                full = shares;
            }
            seen += count;
        }
        between(&ends_m)
    }

    /// Per algorithm, in the order of the labels, and per area the errors of all distances and of
    /// each range that has any; then those of its pixels.
    pub(crate) fn into_rows(mut self, labels: &[&str], ranges: &[AskedRange]) -> Vec<AccuracyRow> {
        let mut rows = Vec::new();
        for label in labels {
            let Some(all) = self.algorithms.remove(*label) else {
                continue;
            };
            let mut push = |row: &dyn Fn(DistanceRange) -> AccuracyRow| {
                let own = ranges.iter().map(|&(range, is_of_limit)| AccuracyRow {
                    is_of_limit,
                    ..row(range)
                });
                rows.extend(own);
            };
            for area in AreaChoice::ALL {
                let own = || all.ranges(area).map(|(_, errors)| errors);
                let inside = |range: DistanceRange| {
                    RangeErrors::merged(own().filter(|errors| range.has(errors.true_m)))
                };
                if own().next().is_some() {
                    push(&|range| inside(range).into_row(label, area, range));
                }
            }
            if !all.pixels.is_empty() {
                push(&|range| AccuracyRow::from_pixels(label, &all.pixels, range));
            }
        }
        rows
    }
}

/// The errors in a pair, by [`AreaChoice`].
pub(crate) type PairErrors = [RangeErrors; AreaChoice::ALL.len()];

impl RangeErrors {
    /// The sums of several.
    fn merged<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        let mut all = Self::default();
        for own in parts {
            all.errors_m.extend(&own.errors_m);
            all.followers.extend(&own.followers);
            all.relative += own.relative;
            all.scored += own.scored;
            all.sum_true_m += own.sum_true_m;
            all.unknown += own.unknown;
            all.known += own.known;
            all.wrong += own.wrong;
            all.resting += own.resting;
            all.flickers += own.flickers;
            all.resting_known += own.resting_known;
            all.resting_cells += own.resting_cells;
            all.squares += own.squares;
        }
        all.followers.sort_unstable();
        all.followers.dedup();
        all
    }

    /// Adds a cell of two successive answers, if it is at rest.
    /// `pair`: its number.
    fn add_change(&mut self, rule: &CellRule, before: &LastCell, now: &LastCell, pair: u32) {
        let true_m = now.true_m;
        if (true_m - before.true_m).abs() > MAX_MOTION * before.true_m {
            return;
        }
        self.resting += 1;
        if self.followers.last() != Some(&pair) {
            self.followers.push(pair);
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
        let own = pairs.iter().map(|own| &own[area as usize]);
        Self::merged(own).into_row("", area, DistanceRange::ALL)
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

    fn into_row(mut self, label: &str, area: AreaChoice, range: DistanceRange) -> AccuracyRow {
        let cells = self.errors_m.len() as u64;
        let mean = |sum: f64| (cells > 0).then(|| sum / cells as f64);
        let errors = || self.errors_m.iter().copied().map(f64::from);
        let (bias_m, square) = (mean(errors().sum()), mean(errors().map(|e| e * e).sum()));
        let abs_rel = mean(self.relative);
        self.errors_m
            .iter_mut()
            .for_each(|error| *error = error.abs());
        self.errors_m.sort_by(f32::total_cmp);
        let frames = self.followers.len() as u64;
        AccuracyRow {
            algorithm: label.to_owned(),
            area,
            cells,
            scored: self.scored,
            known: self.known,
            from_m: range.from_m,
            to_m: range.to_m,
            mean_true_m: ratio(self.sum_true_m, self.scored),
            fill: share(self.scored - self.unknown, self.scored),
            wrong: share(self.wrong, self.scored),
            bias_m,
            rmse_m: square.map(f64::sqrt),
            median_error_m: nearest_rank(&self.errors_m, 0.5).map(f64::from),
            abs_rel,
            resting: self.resting,
            frames: frames + u64::from(frames > 0),
            resting_known: self.resting_known,
            resting_cells: self.resting_cells,
            noise_m: (self.resting_cells > 0)
                .then(|| (self.squares / (2.0 * self.resting_cells as f64)).sqrt()),
            flicker: (self.resting > 0 && cells > 0)
                .then(|| self.flickers as f64 / self.resting as f64),
            ..AccuracyRow::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(true_m: f64) -> CellRow {
        CellRow {
            algorithm: "v3".into(),
            verdict: Verdict::Right,
            distance_m: Some(true_m),
            true_distance_m: Some(true_m),
            state: Some(CellState::Known),
            ..CellRow::default()
        }
    }

    #[test]
    fn ranges_have_equal_counts_or_the_ends_that_are_asked_for() {
        // The nearest is unknown, the next at infinity, and the farthest wrong by 1 m.
        let mut cells: Vec<_> = (0..100).map(|i| cell(1.0 + f64::from(i) / 10.0)).collect();
        (cells[0].verdict, cells[0].distance_m) = (Verdict::Unknown, None);
        cells[0].state = Some(CellState::Unknown);
        (cells[1].verdict, cells[1].distance_m) = (Verdict::Wrong, None);
        cells[1].state = Some(CellState::Far);
        (cells[99].verdict, cells[99].distance_m) = (Verdict::Wrong, Some(11.9));
        let rows = |ranges: &RunRanges| {
            let mut tally = AccuracyTally::new(CellRule::default(), ranges);
            tally.add(Some(0), &cells);
            let ranges = ranges.in_order(&tally);
            tally.into_rows(&["v3"], &ranges)
        };
        let equal = rows(&RunRanges::default());
        let scored: Vec<_> = equal.iter().map(|row| row.scored).collect();
        assert_eq!(scored[0], 100);
        assert_eq!(scored[1..].iter().sum::<u64>(), 100);
        assert!(scored.len() == 6 && scored[1..].iter().all(|n| (17..=23).contains(n)));
        let first = [equal[1].scored, equal[1].known, equal[1].cells];
        assert_eq!(first, [scored[1], scored[1] - 1, scored[1] - 2]);
        let shares = (share(scored[1] - 1, scored[1]), share(1, scored[1]));
        assert_eq!((equal[1].fill, equal[1].wrong), shares);
        assert_eq!(
            (equal[5].known, equal[5].wrong),
            (scored[5], Some(1.0 / scored[5] as f64))
        );
        // Most cells at one distance fill a range, and those beyond have one of their own.
        let mut wall = AccuracyTally::new(CellRule::default(), &RunRanges::default());
        let far = (0..20).map(|i| cell(3.0 + f64::from(i)));
        wall.add(
            Some(0),
            &(0..80).map(|_| cell(2.0)).chain(far).collect::<Vec<_>>(),
        );
        let words = |range: &DistanceRange| range.to_string();
        let ranges: Vec<_> = wall.equal_ranges().iter().map(words).collect();
        assert_eq!(ranges, ["0..3", "3.."]);
        // A cell at the end of a range is in the next one, wherever the narrow ranges end.
        let asked = RunRanges {
            ends: "1.7,5".parse().unwrap(),
            limited: vec!["0..5".parse().unwrap(), "1.7..5".parse().unwrap()],
        };
        let counts = rows(&asked)
            .into_iter()
            .map(|row| (row.range_words(), row.scored));
        let words = ["all", "0–1.7", "1.7–5", "from 5", "0–5 (gate)"].map(str::to_owned);
        assert_eq!(
            counts.collect::<Vec<_>>(),
            words
                .into_iter()
                .zip([100, 7, 33, 60, 40])
                .collect::<Vec<_>>()
        );
    }

    #[test]
    fn photographs_have_no_noise() {
        let cell = cell(1.0);
        let resting = |stamps: [Option<u64>; 2]| {
            let mut tally = AccuracyTally::new(CellRule::default(), &RunRanges::default());
            for stamp_ns in stamps {
                tally.add(stamp_ns, std::slice::from_ref(&cell));
            }
            let row = tally
                .into_rows(&["v3"], &[(DistanceRange::ALL, false)])
                .remove(0);
            (row.frames, row.resting_cells, row.noise_m, row.flicker)
        };
        assert_eq!(resting([Some(0), Some(9)]), (2, 1, Some(0.0), Some(0.0)));
        assert_eq!(resting([None, None]), (0, 0, None, None));
    }
}
