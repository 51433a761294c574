//! The results over time: cells per second of a recording, or per recording of several.

use super::replays::Replays;
use crate::rows::held::{RowRef, Rows};
use serde::Serialize;
use std::collections::BTreeMap;
use svl_core::counted;
use svl_score::judge::MetricSource as _;

/// Limit of the bins of an algorithm.
const MAX_BINS: u64 = 120;

/// Bins of all algorithms over the same axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Timeline {
    /// Words of the first and of the last bin.
    pub ends: [String; 2],
    /// Meaning of a bin.
    pub about: String,
    /// Per algorithm its bins, from the first to the last; empty where no pair is.
    pub lanes: Vec<(String, Vec<Bin>)>,
}

/// The cells of the pairs of a bin.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Bin {
    pub right: f64,
    pub wrong: f64,
    pub unknown: f64,
    pub missed: f64,
    pub words: String,
    /// The figure of the worst frame that is shown.
    pub figure: Option<usize>,
    /// The command that shows the second of the worst pair.
    pub command: Option<String>,
}

/// A frame that the page shows.
pub struct ShownFrame {
    pub algorithm: String,
    pub run: String,
    pub sequence: u64,
    /// Among the worst of its algorithm, from 1 on.
    pub rank: Option<usize>,
    /// The place of its figure.
    pub figure: usize,
}

impl Timeline {
    /// The results of the rows without stress, with the frames that are shown; empty without times
    /// or truth.
    pub fn new(rows: &Rows, shown: &[ShownFrame], replays: &Replays) -> Self {
        let scored =
            |row: &RowRef<'_>| row.stress().is_none() && row.metrics().get("wrong").is_some();
        let rows = || rows.iter().filter(scored);
        if rows().next().is_none() || rows().any(|row| row.origin().is_scene()) {
            return Self::default();
        }
        let (mut runs, mut places) = (Vec::new(), BTreeMap::new());
        for row in rows() {
            places.entry(row.origin().run_key()).or_insert_with(|| {
                runs.push(row.origin().run_name());
                runs.len() - 1
            });
        }
        let mut frames: BTreeMap<u64, Vec<&ShownFrame>> = BTreeMap::new();
        for frame in shown {
            frames.entry(frame.sequence).or_default().push(frame);
        }
        let figure = |row: RowRef<'_>| {
            let own = frames.get(&row.sequence())?.iter();
            let own = own.filter(|frame| {
                frame.algorithm == row.algorithm() && frame.run == row.origin().run_name()
            });
            own.map(|frame| (frame.rank.unwrap_or(usize::MAX), frame.figure))
                .min()
        };
        let is_untimed = rows().any(|row| replays.is_untimed(row.origin()));
        let stamps = || rows().map(|row| row.stamp_ns());
        let first_ns = stamps().min().unwrap_or_default();
        // A recording's own seconds, also if the first ones are omitted.
        let since = |row: RowRef<'_>| (row.stamp_ns() - first_ns) / 1_000_000_000;
        let whole = |row: RowRef<'_>| replays.second(row.origin()).unwrap_or_else(|| since(row));
        let first_s = rows().map(whole).min().unwrap_or_default();
        let last_s = rows().map(whole).max().unwrap_or_default();
        let seconds = (last_s - first_s + 1).div_ceil(MAX_BINS);
        let together = (runs.len() as u64).div_ceil(MAX_BINS) as usize;
        let place = |row: RowRef<'_>| match runs.len() {
            1 => ((whole(row) - first_s) / seconds) as usize,
            _ => places[&row.origin().run_key()] / together,
        };
        let name = |bin: usize| match runs.len() {
            1 if is_untimed => format!("frame {}", first_s + bin as u64 * seconds),
            1 => format!("{} s", first_s + bin as u64 * seconds),
            _ => runs[(bin * together).min(runs.len() - 1)].clone(),
        };
        let count = rows().map(place).max().unwrap_or(0) + 1;
        let lanes = lanes(rows(), count, place);
        let bin = |label: &str, i: usize, rows: &[RowRef<'_>]| {
            let Some(worst) = worst_pair(rows) else {
                return Bin::default();
            };
            let [right, wrong, unknown, missed] =
                ["right", "wrong", "unknown", "missed"].map(|name| sum(rows, name));
            let from_s = replays.at_s(worst.origin()).map(f64::floor);
            let command = from_s.and_then(|s| replays.command(worst.origin(), [s, s + 1.0]));
            let command = command.zip(replays.algorithm(label));
            let (name, pairs) = (name(i), counted(rows.len() as u64, "pair"));
            Bin {
                words: format!(
                    "{label}, {name}: {right} right, {wrong} wrong, {unknown} unknown, {missed} \
                     missed, of {pairs}"
                ),
                figure: rows
                    .iter()
                    .filter_map(|row| figure(*row))
                    .min()
                    .map(|own| own.1),
                command: command.map(|(command, algorithm)| format!("{command} {algorithm}")),
                right,
                wrong,
                unknown,
                missed,
            }
        };
        let lane = |(label, bins): (String, Vec<Vec<RowRef<'_>>>)| {
            let bins = bins.iter().enumerate();
            let bins = bins.map(|(i, rows)| bin(&label, i, rows)).collect();
            (label, bins)
        };
        let about = match (runs.len(), seconds, together) {
            (1, 1, _) if is_untimed => "a bar per frame".to_owned(),
            (1, frames, _) if is_untimed => format!("a bar per {frames} frames"),
            (1, 1, _) => "a bar per second".to_owned(),
            (1, seconds, _) => format!("a bar per {seconds} s"),
            (.., 1) => "a bar per recording".to_owned(),
            (.., together) => format!("a bar per {together} recordings"),
        };
        Self {
            ends: [name(0), name(count - 1)],
            about,
            lanes: lanes.into_iter().map(lane).collect(),
        }
    }
}

/// The rows of each algorithm by bins.
fn lanes<'a>(
    rows: impl Iterator<Item = RowRef<'a>>,
    count: usize,
    place: impl Fn(RowRef<'a>) -> usize,
) -> Vec<(String, Vec<Vec<RowRef<'a>>>)> {
    let mut lanes: Vec<(String, Vec<Vec<RowRef<'a>>>)> = Vec::new();
    for row in rows {
        let mut labels = lanes.iter().map(|(label, _)| label);
        let lane = labels.position(|label| *label == row.algorithm());
        let lane = lane.unwrap_or_else(|| {
            lanes.push((row.algorithm().to_owned(), vec![Vec::new(); count]));
            lanes.len() - 1
        });
        lanes[lane].1[place(row)].push(row);
    }
    lanes
}

/// The second, or frame without a time, in which an algorithm misses the most cells, then has the
/// most wrong ones.
pub struct WorstSecond {
    pub seed: Option<u64>,
    pub run: Option<String>,
    /// The worst pair in it.
    pub sequence: u64,
    pub stamp_ns: u64,
    pub words: String,
}

impl WorstSecond {
    /// That of the rows of an algorithm without stress; absent without times or truth.
    pub(crate) fn new(rows: &Rows, label: &str, replays: &Replays) -> Option<Self> {
        let mut seconds: BTreeMap<_, Vec<RowRef<'_>>> = BTreeMap::new();
        for row in rows
            .iter()
            .filter(|row| row.algorithm() == label && !row.origin().is_scene())
        {
            if row.stress().is_none() && row.metrics().get("wrong").is_some() {
                let second = replays.second(row.origin());
                let second = second.unwrap_or(row.stamp_ns() / 1_000_000_000);
                seconds
                    .entry((row.origin().run_key(), second))
                    .or_default()
                    .push(row);
            }
        }
        let sums = |rows: &[RowRef<'_>]| ["missed", "wrong"].map(|name| sum(rows, name));
        let seconds = seconds.into_values();
        let worst = seconds.reduce(|a, b| if sums(&b) > sums(&a) { b } else { a })?;
        let pair = worst_pair(&worst)?;
        let is_untimed = replays.is_untimed(pair.origin());
        let at_s = replays.at_s(pair.origin()).filter(|_| !is_untimed);
        let at = at_s.map(|at_s| format!("{at_s:.1} s"));
        let at = at.unwrap_or_else(|| format!("frame {}", pair.sequence()));
        let kind = if is_untimed { "frame" } else { "second" };
        let ([missed, wrong], run) = (sums(&worst), pair.origin().run_name());
        let run = pair.seed().map_or(run, |seed| format!("seed {seed}"));
        Some(Self {
            seed: pair.seed(),
            run: pair.run().map(str::to_owned),
            sequence: pair.sequence(),
            stamp_ns: pair.stamp_ns(),
            words: format!(
                "worst {kind}: {run} at {at} ({label}: {missed} cells missed, {wrong} wrong)"
            ),
        })
    }
}

/// The pair with the most missed cells, then the most wrong ones: the first of equal ones.
fn worst_pair<'a>(rows: &[RowRef<'a>]) -> Option<RowRef<'a>> {
    let bad =
        |row: RowRef<'_>| ["missed", "wrong"].map(|name| row.metrics().get(name).unwrap_or(0.0));
    let rows = rows.iter().copied();
    rows.reduce(|worst, row| if bad(row) > bad(worst) { row } else { worst })
}

fn sum(rows: &[RowRef<'_>], metric: &str) -> f64 {
    let values = rows.iter().filter_map(|row| row.metrics().get(metric));
    // The sum of nothing would be -0.
    values.fold(0.0, |sum, value| sum + value)
}
