//! Test pieces in numbers: a row per pair of an approach, and per algorithm and piece the reach
//! from where on it is always seen.

use super::references::EXACT;
use crate::rows::records::record;
use crate::rows::samples::grouped;
use std::collections::BTreeMap;
use svl_core::statistics::lower_median;
use svl_score::judge::{Cases, Measured, size_words};

record! {
    #[derive(Default)]
    /// One pair of an approach to a test piece, through one algorithm.
    SightRow {
        /// Seed of the arena.
        seed: Option<u64>,
        /// Name of the recording, if the scenario has recordings.
        run: Option<String>,
        /// Number of the pair in its run.
        sequence: u64,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Width of the test piece.
        width_m: f64,
        /// Height of the test piece.
        height_m: f64,
        /// Nearer pairs do not count.
        least_m: f64,
        /// Distance of the nearest tenth of the piece; absent where it is not in view.
        piece_m: Option<f64>,
        /// A cell that shows the piece alone reports it.
        seen: bool,
        /// The mirrored cell, without the piece, reports the same.
        by_chance: bool,
        /// The true distances of the cells report it.
        exact_sees: bool,
        /// Number of cells reported nearer than anything in them.
        false_cells: u64,
        /// One of these is in the middle third, nearer than clear space: the robot would stop.
        stop: bool,
        /// Distance that the robot moved since the pair before, if poses are known.
        way_m: Option<f64>,
    }
}

record! {
    #[derive(Default)]
    /// The reach of one algorithm for one test piece.
    PieceRow {
        /// Label of the algorithm, as `v3:max_disparity=64`; `exact`: the limit of the cells.
        algorithm: String,
        /// Width of the test piece.
        width_m: f64,
        /// Height of the test piece.
        height_m: f64,
        /// Number of approaches.
        runs: u64,
        /// Number of approaches besides these that end before the nearest distance that counts, or
        /// never show the piece.
        short_runs: u64,
        /// Number of approaches that see the piece from their first pair on.
        whole_runs: u64,
        /// Distance from which 95 % of approaches always see it, with a confidence of 95 %; absent
        /// of fewer than 59.
        reach_m: Option<f64>,
        /// Median distance from which an approach always sees it.
        median_m: Option<f64>,
        /// Number of pairs that show the piece and count.
        pairs: u64,
        /// Number of pairs that do not show it, or not alone.
        hidden_pairs: u64,
        /// Fraction of the pairs that see it.
        seen: Option<f64>,
        /// Fraction of the pairs whose mirrored cells report the same.
        by_chance: Option<f64>,
        /// Cells of a pair that are reported nearer than anything in them: the mean.
        false_cells: f64,
        /// Needless stops per 100 m; absent without poses.
        stops_per_100m: Option<f64>,
    }
}

/// Part of the approaches that the reach is of, and its confidence.
const PART: f64 = 0.95;
/// Fewest approaches that have a reach.
pub const MIN_RUNS: u64 = 59;
/// Largest ratio of the nearest distance of an approach to the nearest one that counts.
const MAX_END: f64 = 1.25;

/// The rank of the reach among that many approaches, in ascending order from 1: the largest k of
/// which P(Bin(n, 0.05) < k) ≤ 0.05 (Wilks 1941). `None` for too few.
fn rank(runs: u64) -> Option<usize> {
    let n = runs as f64;
    // Terms of the binomial distribution, each from the one before.
    let mut term = PART.powf(n);
    let (mut sum, mut k) = (term, 0);
    while sum <= 1.0 - PART && (k as f64) < n {
        k += 1;
        term *= (n - k as f64 + 1.0) / k as f64 * (1.0 - PART) / PART;
        sum += term;
    }
    (k > 0).then_some(k)
}

/// The distance from which all pairs of an approach down to the nearest that counts see the piece;
/// true if that is its first pair.
fn reach<'a>(
    pairs: impl Iterator<Item = &'a SightRow>,
    sees: fn(&SightRow) -> bool,
) -> (f64, bool) {
    let seen = pairs.filter_map(|row| Some((row.piece_m?, row.least_m, sees(row))));
    let mut seen: Vec<_> = seen.filter(|(m, least, _)| m > least).collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let first = seen.iter().position(|own| !own.2);
    let last = first.unwrap_or(seen.len()).checked_sub(1);
    (last.map_or(0.0, |place| seen[place].0), first.is_none())
}

impl PieceRow {
    /// The rows of an algorithm with a piece, and how it sees it.
    fn new(rows: &[&SightRow], algorithm: &str, sees: fn(&SightRow) -> bool) -> Self {
        let mut runs: BTreeMap<_, Vec<&SightRow>> = BTreeMap::new();
        for &row in rows {
            runs.entry((&row.run, row.seed)).or_default().push(row);
        }
        let all = runs.len();
        runs.retain(|_, own| {
            let nearest = own.iter().filter_map(|row| row.piece_m);
            nearest.fold(f64::INFINITY, f64::min) <= MAX_END * own[0].least_m
        });
        let reaches = runs.values().map(|own| reach(own.iter().copied(), sees));
        let (mut reaches, is_whole): (Vec<_>, Vec<_>) = reaches.unzip();
        reaches.sort_by(f64::total_cmp);
        let counted = rows.iter().filter(|row| row.piece_m > Some(row.least_m));
        let pairs = counted.clone().count();
        let is_exact = algorithm == EXACT;
        let share = |is: &dyn Fn(&SightRow) -> bool| {
            let own = counted.clone().filter(|row| is(row)).count();
            (pairs > 0).then(|| own as f64 / pairs as f64)
        };
        let count = |own: fn(&SightRow) -> u64| {
            let own = rows.iter().filter(|_| !is_exact).map(|row| own(row));
            own.sum::<u64>() as f64
        };
        let way_m: f64 = rows.iter().filter_map(|row| row.way_m).sum();
        let stops = count(|row| row.stop.into());
        Self {
            algorithm: algorithm.to_owned(),
            width_m: rows[0].width_m,
            height_m: rows[0].height_m,
            runs: reaches.len() as u64,
            short_runs: (all - reaches.len()) as u64,
            whole_runs: is_whole.iter().filter(|is| **is).count() as u64,
            reach_m: rank(reaches.len() as u64).map(|k| reaches[k - 1]),
            median_m: lower_median(reaches),
            pairs: pairs as u64,
            hidden_pairs: rows.iter().filter(|row| row.piece_m.is_none()).count() as u64,
            seen: share(&sees),
            by_chance: share(&|row| row.by_chance && !is_exact),
            false_cells: count(|row| row.false_cells) / rows.len() as f64,
            stops_per_100m: (way_m > 0.0).then(|| 100.0 * stops / way_m),
        }
    }

    /// The reach as a metric, and the approaches that it rests on.
    pub(crate) fn measured(&self) -> Option<Measured> {
        Some(Measured {
            value: self.reach_m.or(self.median_m)?,
            cases: Cases::items(self.runs),
        })
    }

    /// Width and height, as `10 x 20 cm`.
    pub(crate) fn size(&self) -> String {
        size_words([self.width_m, self.height_m])
    }

    /// The reach in a sentence, with what it costs.
    pub(crate) fn words(&self) -> String {
        let (name, size, runs) = (&self.algorithm, self.size(), self.runs);
        let counted = |count: u64, words: &str| (count > 0).then(|| format!("; {words}: {count}"));
        let notes = [
            counted(
                self.whole_runs,
                "approaches that see it from their first pair on",
            ),
            counted(
                self.short_runs,
                "approaches that end too far away, and do not count",
            ),
            counted(self.hidden_pairs, "pairs that do not show it alone"),
        ];
        let notes = notes.into_iter().flatten().collect::<String>();
        let price = format!("{:.1} false cells per pair{notes}", self.false_cells);
        match (self.reach_m, self.median_m) {
            (Some(0.0), _) => format!(
                "{name} does not always see a piece of {size}, in {runs} approaches; {price}."
            ),
            (Some(reach), _) => format!(
                "{name} sees a piece of {size} from {reach:.1} m on, in 95 % of approaches ({runs} \
                 runs), with {price}."
            ),
            (None, Some(median)) => format!(
                "{name}: the reach of a piece of {size} needs {MIN_RUNS} approaches, there are \
                 {runs}: median {median:.1} m, with {price}."
            ),
            (None, None) => format!(
                "{name}: no approach shows a piece of {size} at the nearest distance that \
                 counts{notes}."
            ),
        }
    }
}

/// The rows of the narrowest piece.
pub(crate) fn narrowest(rows: &[PieceRow]) -> impl Iterator<Item = &PieceRow> {
    let width_m = rows
        .iter()
        .map(|row| row.width_m)
        .fold(f64::INFINITY, f64::min);
    rows.iter().filter(move |row| row.width_m == width_m)
}

/// The reaches of all algorithms and pieces, in their order, and of the exact distances last.
pub fn pieces(rows: &[SightRow]) -> Vec<PieceRow> {
    let all_rows: Vec<_> = rows.iter().collect();
    let by_size = |own: &[&SightRow], name: &str, sees: fn(&SightRow) -> bool| {
        let mut sizes: BTreeMap<[u64; 2], Vec<&SightRow>> = BTreeMap::new();
        own.iter()
            .for_each(|row| sizes.entry(size(row)).or_default().push(row));
        let rows = sizes.values().map(|own| PieceRow::new(own, name, sees));
        rows.collect::<Vec<_>>()
    };
    let own = grouped(
        &all_rows,
        |row| &row.algorithm,
        |own| by_size(own, &own[0].algorithm, |row| row.seen),
    );
    // All algorithms have the same pairs with the same truth.
    let first = all_rows.first().map(|row| &row.algorithm);
    let exact: Vec<_> = all_rows
        .iter()
        .copied()
        .filter(|row| Some(&row.algorithm) == first)
        .collect();
    let exact = by_size(&exact, EXACT, |row| row.exact_sees);
    own.into_iter().flatten().chain(exact).collect()
}

/// Width of the ranges of distances that the pairs of a plot are of, metres.
const RANGE_M: f64 = 0.25;

/// The part of the pairs that see a piece, by its distance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SeenShares {
    pub(crate) algorithm: String,
    pub(crate) size: String,
    /// Distance, metres, and per cent.
    pub(crate) points: Vec<(f64, f64)>,
}

/// The parts of the pairs that see a piece, by algorithm and piece.
pub(crate) fn seen_shares(rows: &[SightRow]) -> Vec<SeenShares> {
    let mut shares: BTreeMap<_, BTreeMap<u64, [f64; 2]>> = BTreeMap::new();
    for row in rows {
        let key = (size(row), &row.algorithm);
        let own = shares.entry(key).or_default();
        if let Some(m) = row.piece_m.filter(|m| *m > row.least_m) {
            let [seen, all] = own.entry((m / RANGE_M) as u64).or_default();
            *seen += f64::from(u8::from(row.seen));
            *all += 1.0;
        }
    }
    let points = |own: BTreeMap<u64, [f64; 2]>| {
        let point = |(range, [seen, all]): (u64, [f64; 2])| {
            ((range as f64 + 0.5) * RANGE_M, 100.0 * seen / all)
        };
        own.into_iter().map(point).collect()
    };
    let shares = shares.into_iter();
    let shares = shares.map(|((size, algorithm), own)| SeenShares {
        algorithm: algorithm.clone(),
        size: size_words(size.map(|tenths| 1e-4 * tenths as f64)),
        points: points(own),
    });
    shares.collect()
}

/// Width and height of a row's piece, tenths of a millimetre.
fn size(row: &SightRow) -> [u64; 2] {
    [row.width_m, row.height_m].map(|m| (1e4 * m).round() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rank_is_that_of_wilks() {
        let ranks = [58, 59, 92, 93, 123, 124].map(rank);
        assert_eq!(ranks, [None, Some(1), Some(1), Some(2), Some(2), Some(3)]);
    }

    /// An approach whose pairs at these distances see the piece, or do not.
    fn approach(seed: u64, pairs: &[(f64, bool)]) -> Vec<SightRow> {
        let row = |(sequence, &(m, seen)): (usize, &(f64, bool))| SightRow {
            seed: Some(seed),
            sequence: sequence as u64,
            algorithm: "a".to_owned(),
            width_m: 0.1,
            height_m: 0.2,
            least_m: 0.5,
            piece_m: Some(m),
            seen,
            exact_sees: true,
            false_cells: u64::from(!seen),
            way_m: Some(0.5),
            ..SightRow::default()
        };
        pairs.iter().enumerate().map(row).collect()
    }

    #[test]
    fn a_run_reaches_to_its_first_pair_without_sight() {
        let missed = approach(
            1,
            &[
                (2.5, true),
                (2.0, false),
                (1.5, true),
                (1.0, true),
                (0.4, false),
            ],
        );
        let late = approach(2, &[(2.5, true), (2.0, true), (1.5, true), (0.9, true)]);
        let whole = approach(3, &[(2.4, true), (1.2, true), (0.6, true)]);
        let rows = pieces(&[missed, late, whole].concat());
        let [own, exact] = &rows[..] else {
            panic!("{rows:?}");
        };
        // The second ends too far away, and does not count.
        assert_eq!((own.runs, own.short_runs, own.whole_runs), (2, 1, 1));
        assert_eq!((own.reach_m, own.median_m), (None, Some(1.5)));
        assert_eq!(own.pairs, 11);
        assert!(
            own.words()
                .contains("needs 59 approaches, there are 2: median 1.5 m")
        );
        assert_eq!((exact.median_m, exact.false_cells), (Some(2.4), 0.0));
        let many: Vec<_> = (0..59)
            .flat_map(|seed| approach(seed, &[(2.0 + 0.01 * seed as f64, true), (0.5, true)]))
            .collect();
        let row = &pieces(&many)[0];
        assert_eq!((row.reach_m, row.stops_per_100m), (Some(2.0), Some(0.0)));
        assert!(
            row.words()
                .contains("sees a piece of 10 x 20 cm from 2.0 m on")
        );
    }
}
