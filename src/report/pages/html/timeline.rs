//! The results over time: cells per second of a recording, or per recording of several.

use crate::rows::records::Row;
use crate::rows::samples::{is_scene, run_key};
use serde::Serialize;
use std::collections::BTreeMap;
use svl_core::counted;

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
    #[serde(skip)]
    pairs: u64,
    /// The figure of the worst frame that is shown, and its rank.
    #[serde(skip)]
    worst: Option<(usize, usize)>,
    pub figure: Option<usize>,
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

/// The name of a row's run, as in links to its frames.
pub(crate) fn run_name(row: &Row) -> String {
    let seed = || row.seed.map(|seed| seed.to_string());
    row.run.clone().or_else(seed).unwrap_or_default()
}

impl Timeline {
    /// The results of the rows without stress, with the frames that are shown; empty without times
    /// or truth.
    pub fn new(rows: &[Row], shown: &[ShownFrame]) -> Self {
        let scored = |row: &&Row| row.stress.is_none() && row.metrics.get("wrong").is_some();
        let rows: Vec<_> = rows.iter().filter(scored).collect();
        if rows.is_empty() || rows.iter().any(|row| is_scene(row)) {
            return Self::default();
        }
        let (mut runs, mut places) = (Vec::new(), BTreeMap::new());
        for row in &rows {
            places.entry(run_key(row)).or_insert_with(|| {
                runs.push(run_name(row));
                runs.len() - 1
            });
        }
        let mut frames: BTreeMap<u64, Vec<&ShownFrame>> = BTreeMap::new();
        for frame in shown {
            frames.entry(frame.sequence).or_default().push(frame);
        }
        let worst = |row: &Row| {
            let own = frames
                .get(&row.sequence)?
                .iter()
                .filter(|frame| frame.algorithm == row.algorithm && frame.run == run_name(row));
            own.map(|frame| (frame.rank.unwrap_or(usize::MAX), frame.figure))
                .min()
        };
        let stamps = || rows.iter().map(|row| row.stamp_ns);
        let first_ns = stamps().min().unwrap_or_default();
        let span_s = (stamps().max().unwrap_or_default() - first_ns) / 1_000_000_000 + 1;
        let seconds = span_s.div_ceil(MAX_BINS);
        let together = (runs.len() as u64).div_ceil(MAX_BINS) as usize;
        let place = |row: &Row| match runs.len() {
            1 => ((row.stamp_ns - first_ns) / 1_000_000_000 / seconds) as usize,
            _ => places[&run_key(row)] / together,
        };
        let name = |bin: usize| match runs.len() {
            1 => format!("{} s", bin as u64 * seconds),
            _ => runs[(bin * together).min(runs.len() - 1)].clone(),
        };
        let count = rows.iter().map(|row| place(row)).max().unwrap_or(0) + 1;
        let mut lanes: Vec<(String, Vec<Bin>)> = Vec::new();
        for row in &rows {
            let lane = lanes.iter().position(|(label, _)| *label == row.algorithm);
            let lane = lane.unwrap_or_else(|| {
                lanes.push((row.algorithm.clone(), vec![Bin::default(); count]));
                lanes.len() - 1
            });
            let bin = &mut lanes[lane].1[place(row)];
            let cells = |name| row.metrics.get(name).unwrap_or(0.0);
            bin.right += cells("right");
            bin.wrong += cells("wrong");
            bin.unknown += cells("unknown");
            bin.missed += cells("missed");
            bin.pairs += 1;
            bin.worst = bin.worst.into_iter().chain(worst(row)).min();
        }
        for (label, bins) in &mut lanes {
            for (i, bin) in bins.iter_mut().enumerate().filter(|(_, bin)| bin.pairs > 0) {
                bin.figure = bin.worst.map(|(_, figure)| figure);
                let pairs = counted(bin.pairs, "pair");
                let [right, wrong, unknown] = [bin.right, bin.wrong, bin.unknown];
                bin.words = format!(
                    "{label}, {}: {right} right, {wrong} wrong, {unknown} unknown, {} missed, of \
                     {pairs}",
                    name(i),
                    bin.missed
                );
            }
        }
        let about = match (runs.len(), seconds, together) {
            (1, 1, _) => "a bar per second".to_owned(),
            (1, seconds, _) => format!("a bar per {seconds} s"),
            (.., 1) => "a bar per recording".to_owned(),
            (.., together) => format!("a bar per {together} recordings"),
        };
        Self {
            ends: [name(0), name(count - 1)],
            about,
            lanes,
        }
    }
}
