//! Losses of a pass: missing pairs, the limit on them, and the state of the pass at its end.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};
use svl_core::counted;
use svl_core::doubt::Doubt;

mod counts;

pub use counts::{GrabberReport, Losses};

/// The work is done, but something is missing: a [`svl_core::Error::Other`], with what is missing.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Incomplete(pub String);

/// Losses with which a pass counts as complete, written `3` or `1%`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenLimit", into = "WrittenLimit")]
pub enum LossLimit {
    Pairs(u64),
    /// Per cent of the pairs.
    Percent(f64),
}

/// Form of a limit in a scenario.
#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number of pairs as 3, or per cent as \"1%\""
)]
enum WrittenLimit {
    Pairs(u64),
    Text(String),
}

impl LossLimit {
    /// True if more are lost than the limit permits; `pairs`: all of them.
    pub fn is_exceeded(self, lost: u64, pairs: u64) -> bool {
        match self {
            Self::Pairs(most) => lost > most,
            // One of 1000 is 0.1 %, despite rounding.
            Self::Percent(most) => 100.0 * lost as f64 > most * pairs as f64 * (1.0 + 1e-12),
        }
    }
}

impl Default for LossLimit {
    fn default() -> Self {
        Self::Pairs(0)
    }
}

impl std::str::FromStr for LossLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let limit = match text.strip_suffix('%') {
            Some(percent) => percent.trim().parse().ok().map(Self::Percent),
            None => text.parse().ok().map(Self::Pairs),
        };
        let is_share = |limit: &Self| match limit {
            Self::Pairs(_) => true,
            Self::Percent(percent) => (0.0..=100.0).contains(percent),
        };
        let expected = "expected a number of pairs as 3, or per cent as 1%, at most 100%";
        limit.filter(is_share).ok_or_else(|| expected.to_owned())
    }
}

impl TryFrom<WrittenLimit> for LossLimit {
    type Error = String;

    fn try_from(written: WrittenLimit) -> Result<Self, String> {
        match written {
            WrittenLimit::Pairs(pairs) => Ok(Self::Pairs(pairs)),
            WrittenLimit::Text(text) => text.parse(),
        }
    }
}

impl From<LossLimit> for WrittenLimit {
    fn from(limit: LossLimit) -> Self {
        match limit {
            LossLimit::Pairs(pairs) => Self::Pairs(pairs),
            LossLimit::Percent(_) => Self::Text(limit.to_string()),
        }
    }
}

impl Display for LossLimit {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Pairs(pairs) => write!(f, "{pairs}"),
            Self::Percent(percent) => write!(f, "{percent}%"),
        }
    }
}

/// Number of pairs of a pass, and of those missing from it: shards add up to the whole.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Missing {
    /// Pairs read, of every run and perturbation level.
    pub pairs: u64,
    #[serde(flatten)]
    pub losses: Losses,
    /// By the label of the algorithm.
    pub algorithms: BTreeMap<String, FailedPairs>,
    /// All doubts, each once.
    #[serde(skip_deserializing, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
}

/// Pairs of an algorithm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedPairs {
    pub pairs: u64,
    /// Number of them on which it failed.
    pub failed: u64,
}

impl Missing {
    /// Adds the missing pairs of another pass.
    pub fn add(&mut self, other: Self) {
        self.pairs += other.pairs;
        self.losses.add(other.losses);
        self.add_doubts(other.doubts);
        for (label, failures) in other.algorithms {
            self.add_failures(label, failures);
        }
    }

    /// Adds the doubts that it has not, of a run or of none.
    pub fn add_doubts(&mut self, doubts: Vec<Doubt>) {
        for doubt in doubts {
            let mut known = doubt.clone();
            let is_it = |own: &Doubt| {
                known.run = doubt.run.clone().or_else(|| own.run.clone());
                known == *own
            };
            if !self.doubts.iter().any(is_it) {
                self.doubts.push(doubt);
            }
        }
    }

    pub fn add_failures(&mut self, label: String, failures: FailedPairs) {
        let own = self.algorithms.entry(label).or_default();
        own.pairs += failures.pairs;
        own.failed += failures.failed;
    }

    /// True if the lost pairs, or those on which an algorithm failed, exceed the limit.
    fn exceeds(&self, limit: LossLimit) -> bool {
        let lost = self.losses.lost();
        let read = self.pairs + self.losses.skipped + lost;
        let mut algorithms = self.algorithms.values();
        limit.is_exceeded(lost, read)
            || algorithms.any(|failures| limit.is_exceeded(failures.failed, failures.pairs))
    }

    /// In words; `None` if nothing is missing.
    pub fn words(&self) -> Option<String> {
        let Losses {
            unpaired,
            unpaired_ns: _,
            late,
            unreadable,
            broken: _,
            dropped,
            replaced: _,
            lost_images,
            lost_pairs,
            cut,
            outside: _,
            without_truth: _,
            jumped: _,
            copies: _,
            impossible: _,
            skipped: _,
            grabber: _,
        } = self.losses;
        let failing = self.algorithms.iter().filter(|own| own.1.failed > 0);
        let others = failing.clone().count().saturating_sub(1) as u64;
        let others = if others > 0 {
            format!(" ({} on no more)", counted(others, "other algorithm"))
        } else {
            String::new()
        };
        let most = failing.max_by_key(|(_, failures)| failures.failed);
        let failures = most.map(|(label, failures)| {
            let pairs = counted(failures.pairs, "pair");
            format!("{label} failed on {} of {pairs}{others}", failures.failed)
        });
        let count = |n: u64, noun: &str| (n > 0).then(|| counted(n, noun));
        let missing = [
            count(unreadable, "pair").map(|n| n + " could not be read"),
            count(unpaired, "image").map(|n| n + " had no partner"),
            count(late, "image").map(|n| n + " came too late"),
            count(dropped, "pair").map(|n| n + " dropped by a full queue"),
            count(lost_images, "image").map(|n| n + " lost on the network"),
            count(lost_pairs, "pair").map(|n| n + " of which both images were lost"),
            count(cut, "frame").map(|n| n + " of a damaged or truncated video"),
            failures,
        ];
        let missing: Vec<_> = missing.into_iter().flatten().collect();
        (!missing.is_empty()).then(|| missing.join(" and "))
    }
}

/// State of a pass or of a whole report at its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EndState {
    /// At the end of its sources, with everything except allowed losses.
    #[default]
    Complete,
    /// At the end of its sources, with more losses than allowed.
    Lossy,
    /// Early, without an error: results are missing.
    Incomplete,
    /// Early, with an error.
    Failed,
}

/// The end of a pass or of a whole report, and its missing pairs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ending {
    pub state: EndState,
    /// The reason why it is not complete, in words.
    pub incomplete: Option<String>,
    pub missing: Missing,
}

impl Ending {
    /// For a pass that reached the end of its sources.
    pub fn new(missing: Missing, allowed: Option<LossLimit>) -> Self {
        let is_lossy = missing.exceeds(allowed.unwrap_or_default());
        let more = allowed.map(|limit| format!(", more than {limit}").replace('%', " %"));
        let more = more.unwrap_or_default();
        let words = missing.words().filter(|_| is_lossy);
        let failed = missing.algorithms.values().map(|own| own.failed);
        let most = failed.max().unwrap_or_default().max(missing.losses.lost());
        let cure = format!(
            "{more}; --allow-loss {most}, or allow_loss = {most} of a scenario's [source], accepts \
             that"
        );
        Self {
            state: if is_lossy {
                EndState::Lossy
            } else {
                EndState::Complete
            },
            incomplete: words.map(|words| words + &cure),
            missing,
        }
    }

    /// For a pass that ended early.
    pub fn early(state: EndState, why: String, missing: Missing) -> Self {
        Self {
            state,
            incomplete: Some(why),
            missing,
        }
    }

    /// True if it reached the end of its sources.
    pub fn is_whole(&self) -> bool {
        matches!(self.state, EndState::Complete | EndState::Lossy)
    }

    /// Everything that is not scored but does not make the pass incomplete, in words.
    pub fn note(&self) -> Option<String> {
        let allowed = self.missing.words();
        let allowed = allowed.filter(|_| self.state == EndState::Complete);
        let outside = counted(self.missing.losses.outside, "image");
        let outside = (self.missing.losses.outside > 0)
            .then(|| format!("{outside} outside the overlap of both cameras"));
        let jumped = counted(self.missing.losses.jumped, "pair");
        let jumped = (self.missing.losses.jumped > 0)
            .then(|| format!("{jumped} whose truth is of another time, between which poses jump"));
        let copies = self.missing.losses.copies.iter().map(|(run, pairs)| {
            let copies = if *pairs == 1 { "copy" } else { "copies" };
            format!("{pairs} {copies} of pairs of {run}, each scored once")
        });
        let impossible = counted(self.missing.losses.impossible, "pixel");
        let impossible = (self.missing.losses.impossible > 0)
            .then(|| format!("{impossible} of the truth that are impossible"));
        let parts = [
            allowed.map(|words| words + ", as is allowed"),
            outside,
            jumped,
            impossible,
        ];
        let parts: Vec<_> = parts.into_iter().flatten().chain(copies).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missing(pairs: u64, losses: Losses, failed: &[(u64, u64)]) -> Missing {
        let algorithm = |(i, &(pairs, failed)): (usize, &(u64, u64))| {
            (format!("a{i}"), FailedPairs { pairs, failed })
        };
        Missing {
            pairs,
            losses,
            algorithms: failed.iter().enumerate().map(algorithm).collect(),
            doubts: Vec::new(),
        }
    }

    #[test]
    fn a_doubt_of_a_run_is_kept_once() {
        let cure = svl_core::doubt::MapCure::RightView;
        let file = svl_core::doubt::Subject::File("z".to_owned());
        let doubt = cure.doubt(file, "right_error_of_left", 0.1, [0.25, f64::MAX]);
        let run = |run: &str| Doubt {
            run: Some(run.to_owned()),
            ..doubt.clone()
        };
        let mut all = missing(0, Losses::default(), &[]);
        all.add_doubts(vec![run("a"), run("b"), run("a"), doubt.clone()]);
        assert_eq!(all.doubts, [run("a"), run("b")]);
    }

    fn state(missing: &Missing, limit: Option<&str>) -> EndState {
        let limit = limit.map(|limit| limit.parse().unwrap());
        Ending::new(missing.clone(), limit).state
    }

    #[test]
    fn a_limit_is_a_number_or_per_cent() {
        for (text, limit) in [
            ("0", LossLimit::Pairs(0)),
            ("12", LossLimit::Pairs(12)),
            ("0.5%", LossLimit::Percent(0.5)),
            ("100 %", LossLimit::Percent(100.0)),
        ] {
            assert_eq!(text.parse(), Ok(limit));
            assert_eq!(limit.to_string().parse(), Ok(limit));
        }
        for wrong in ["", "%", "-1", "1.5", "101%", "-1%", "NaN%", "inf%", "one"] {
            assert!(wrong.parse::<LossLimit>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn pairs_of_live_topics_are_lost_unless_newer_ones_replaced_them() {
        let losses = |unpaired, dropped, lost_images, lost_pairs| Losses {
            unpaired,
            dropped,
            lost_images,
            lost_pairs,
            replaced: 40,
            ..Losses::default()
        };
        for (losses, lost, expected) in [
            (losses(0, 0, 0, 0), 0, None),
            (
                losses(0, 3, 0, 0),
                3,
                Some("3 pairs dropped by a full queue"),
            ),
            // The partner came alone, or after the end.
            (
                losses(1, 0, 1, 0),
                1,
                Some("1 image had no partner and 1 image lost on the network"),
            ),
            (losses(0, 0, 1, 0), 1, Some("1 image lost on the network")),
            (
                losses(0, 0, 2, 1),
                1,
                Some("2 images lost on the network and 1 pair of which both images were lost"),
            ),
        ] {
            assert_eq!(losses.lost(), lost);
            assert_eq!(missing(9, losses, &[]).words().as_deref(), expected);
        }
    }

    #[test]
    fn lost_pairs_are_per_cent_of_all_that_were_read() {
        let unpaired = |unpaired, skipped| Losses {
            unpaired,
            skipped,
            outside: 500,
            ..Losses::default()
        };
        let one = missing(199, unpaired(1, 0), &[]);
        let states = [None, Some("0"), Some("0.4%"), Some("0.5%"), Some("1")];
        assert_eq!(
            states.map(|limit| state(&one, limit) == EndState::Complete),
            [false, false, false, true, true]
        );
        // Every tenth of them was requested.
        let one = missing(20, unpaired(1, 179), &[]);
        assert_eq!(state(&one, Some("0.5%")), EndState::Complete);
        assert_eq!(
            state(&missing(9, unpaired(0, 0), &[]), None),
            EndState::Complete
        );
    }

    #[test]
    fn the_limit_of_losses_applies_to_each_algorithm() {
        let losses = Losses::default;
        let few = missing(200, losses(), &[(200, 2), (200, 2), (200, 2)]);
        assert_eq!(state(&few, Some("1%")), EndState::Complete);
        assert_eq!(state(&few, Some("1")), EndState::Lossy);
        let all = missing(200, losses(), &[(200, 0), (200, 200), (200, 0)]);
        assert_eq!(state(&all, Some("50%")), EndState::Lossy);
    }

    #[test]
    fn shards_add_up() {
        let losses = Losses {
            unreadable: 1,
            ..Losses::default()
        };
        let mut all = missing(10, losses.clone(), &[(10, 1)]);
        all.add(missing(5, losses, &[(5, 0), (5, 5)]));
        let words = "2 pairs could not be read and a1 failed on 5 of 5 pairs (1 other algorithm on \
                     no more)";
        assert_eq!(all.words().as_deref(), Some(words));
        assert_eq!((all.pairs, all.losses.lost()), (15, 2));
        let json = serde_json::to_string(&all).unwrap();
        assert_eq!(serde_json::from_str::<Missing>(&json).unwrap(), all);
    }
}
