//! Commands that show moments of a report's recordings in Rerun.

use crate::rows::held::PairOrigin;
use crate::show::words::shell_word;
use std::collections::{BTreeMap, BTreeSet};

/// The recordings of a report, and the options and algorithms of their pairs, as written.
#[derive(Default)]
pub struct Replays {
    /// Per seed and recording the file, and the stamp of its first pair.
    pub runs: BTreeMap<(Option<u64>, Option<String>), (String, u64)>,
    /// Recordings without times.
    pub untimed: BTreeSet<String>,
    pub options: Vec<String>,
    pub algorithms: Vec<String>,
}

impl Replays {
    /// Seconds of a pair since the first pair of its recording.
    pub(super) fn at_s(&self, pair: PairOrigin<'_>) -> Option<f64> {
        let (_, start_ns) = self.runs.get(&run(pair))?;
        Some(pair.stamp_ns.saturating_sub(*start_ns) as f64 / 1e9)
    }

    /// The same in whole seconds; of a recording without times the number of the pair.
    pub(super) fn second(&self, pair: PairOrigin<'_>) -> Option<u64> {
        let untimed = self.is_untimed(pair).then_some(pair.sequence);
        untimed.or_else(|| self.at_s(pair).map(|at_s| at_s as u64))
    }

    /// True if the stamps of a pair's recording are placeholders.
    pub(super) fn is_untimed(&self, pair: PairOrigin<'_>) -> bool {
        pair.run.is_some_and(|run| self.untimed.contains(run))
    }

    /// The command for the seconds of a pair's recording, without algorithms.
    pub(super) fn command(&self, pair: PairOrigin<'_>, [from_s, to_s]: [f64; 2]) -> Option<String> {
        let (file, _) = self.runs.get(&run(pair))?;
        let (from_s, file) = (from_s.max(0.0), shell_word(file));
        let options = self
            .options
            .iter()
            .map(|word| format!(" {}", shell_word(word)));
        let options: String = options.collect();
        Some(format!(
            "svl replay {file}{options} --from {from_s} --to {to_s} --rerun spawn"
        ))
    }

    /// The option for an algorithm; absent for one behind a filter.
    pub(super) fn algorithm(&self, label: &str) -> Option<String> {
        let mut written = self.algorithms.iter();
        let is_own = |own: &&String| {
            let renamed = own.strip_prefix(label);
            renamed.is_some_and(|rest| rest.is_empty() || rest.starts_with('='))
        };
        Some(format!("--algo {}", shell_word(written.find(is_own)?)))
    }
}

fn run(pair: PairOrigin<'_>) -> (Option<u64>, Option<String>) {
    (pair.seed, pair.run.map(str::to_owned))
}
