//! Measures of the scores' worth: rank correlations with the truth, and the rate at which they pick
//! the best, with bootstrap intervals.

use super::observe::Observation;
use super::{CELLS, PIXELS};
use std::collections::BTreeMap;
use svl_core::statistics::Concordance;
use svl_data::bootstrap::{Interval, Resamples};

/// All observations of the arena or of the real scenes.
pub(super) struct Observed {
    /// Per pair, per algorithm.
    pub(super) pairs: Vec<Vec<Observation>>,
    /// The pairs that are drawn together, by index.
    drawn: Vec<Vec<usize>>,
    resamples: Resamples,
}

/// A number and its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measured {
    pub(super) value: Option<f64>,
    pub(super) interval: Option<Interval>,
}

impl Measured {
    pub(super) fn is_above(&self, limit: f64) -> bool {
        self.interval.is_some_and(|(low, _)| low > limit)
    }

    pub(super) fn words(&self) -> String {
        match (self.value, self.interval) {
            (Some(value), Some((low, high))) => format!("{value:.2} [{low:.2}, {high:.2}]"),
            (Some(value), None) => format!("{value:.2}"),
            _ => "none".into(),
        }
    }
}

/// Kind of observations whose couples are counted.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Between {
    /// Algorithms on the same pair.
    Algorithms,
    /// Pairs of the same algorithm.
    Pairs,
}

/// Reference for a score; greater is better.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Target {
    /// The negated fraction of wrong cells, at equal coverage.
    NotWrong,
    /// The fraction of right cells.
    Right,
}

impl Target {
    fn of(self, observation: &Observation) -> Option<f64> {
        match self {
            Self::NotWrong => observation.wrong().map(|wrong| -wrong),
            Self::Right => Some(observation.right()),
        }
    }

    fn stratum(self, observation: &Observation) -> usize {
        match self {
            Self::NotWrong => observation.fifteenths,
            Self::Right => 0,
        }
    }
}

impl Observed {
    /// Pairs of runs of these lengths, one run after the other.
    pub(super) fn runs(pairs: Vec<Vec<Observation>>, lengths: &[usize]) -> Self {
        Self {
            drawn: (0..pairs.len()).map(|i| vec![i]).collect(),
            resamples: Resamples::draw(lengths, false),
            pairs,
        }
    }

    /// Scenes, each with one or more pairs.
    pub(super) fn scenes(scenes: Vec<Vec<Vec<Observation>>>) -> Self {
        let mut next = 0;
        let mut indices = |scene: &Vec<_>| {
            let first = next;
            next += scene.len();
            (first..next).collect()
        };
        Self {
            drawn: scenes.iter().map(&mut indices).collect(),
            resamples: Resamples::draw(&[scenes.len()], true),
            pairs: scenes.into_iter().flatten().collect(),
        }
    }

    /// Tau-b between a score and the target.
    pub(super) fn tau(&self, score: usize, between: Between, target: Target) -> Measured {
        let tau = |sum: Concordance| sum.tau_b();
        match between {
            // Couples are within one pair, so the counts of pairs are computed once.
            Between::Algorithms => {
                let counts: Vec<Concordance> = self
                    .pairs
                    .iter()
                    .map(|pair| concordance(pair.iter(), score, target))
                    .collect();
                self.measured(|pairs| tau(pairs.iter().map(|&i| counts[i]).sum()))
            }
            Between::Pairs => self.measured(|pairs| {
                let observations = pairs.iter().flat_map(|&i| &self.pairs[i]);
                tau(concordance_by(observations, score, target, |o| o.algorithm))
            }),
        }
    }

    /// Number of couples of algorithms, or of pairs, behind a tau.
    pub(super) fn couples(&self, score: usize, between: Between, target: Target) -> i64 {
        match between {
            Between::Algorithms => {
                let pairs = self.pairs.iter();
                let counts = pairs.map(|pair| concordance(pair.iter(), score, target));
                counts.sum::<Concordance>().couples()
            }
            Between::Pairs => {
                let all = self.pairs.iter().flatten();
                concordance_by(all, score, target, |o| o.algorithm).couples()
            }
        }
    }

    /// Rate at which the best by the score is truly the best, over the pairs where it has values.
    pub(super) fn picks(&self, score: usize) -> Measured {
        let hits = self.hits(score);
        self.measured(|pairs| mean(pairs.iter().filter_map(|&i| hits[i])))
    }

    /// The same, minus the rate at which the larger of the two coverages picks it, on the same
    /// pairs.
    pub(super) fn picks_beyond_coverage(&self, score: usize) -> Measured {
        let own = self.hits(score);
        let difference = |coverage: usize| {
            let hits = self.hits(coverage);
            let differences: Vec<_> = (0..hits.len())
                .map(|i| own[i].zip(hits[i]).map(|(own, other)| own - other))
                .collect();
            self.measured(|pairs| mean(pairs.iter().filter_map(|&i| differences[i])))
        };
        let (a, b) = (difference(CELLS), difference(PIXELS));
        // The one that is harder to beat.
        if a.value < b.value { a } else { b }
    }

    /// Rate at which a randomly drawn algorithm is the best.
    pub(super) fn chance(&self) -> Option<f64> {
        let pairs = self.pairs.iter().filter(|pair| !pair.is_empty());
        let share = |pair: &Vec<Observation>| {
            let best = best(&pair.iter().collect::<Vec<_>>(), Observation::net);
            best.len() as f64 / pair.len() as f64
        };
        mean(pairs.map(share))
    }

    fn hits(&self, score: usize) -> Vec<Option<f64>> {
        let hit = |pair: &Vec<Observation>| {
            let scored: Vec<_> = pair.iter().filter(|o| o.scores[score].is_some()).collect();
            let picked = best(&scored, |o| o.scores[score]);
            let truly = best(&scored, Observation::net);
            let hits = picked.iter().filter(|a| truly.contains(a)).count();
            (!picked.is_empty()).then(|| hits as f64 / picked.len() as f64)
        };
        self.pairs.iter().map(hit).collect()
    }

    /// A statistic of pairs by index, resampled repeatedly.
    fn measured(&self, statistic: impl Fn(&[usize]) -> Option<f64>) -> Measured {
        let all: Vec<_> = (0..self.pairs.len()).collect();
        Measured {
            value: statistic(&all),
            interval: self.resamples.interval(&|drawn| {
                let pairs = drawn.iter().flat_map(|&i| &self.drawn[i]).copied();
                statistic(&pairs.collect::<Vec<_>>())
            }),
        }
    }
}

/// Concordance of observations on one pair.
fn concordance<'a>(
    observations: impl Iterator<Item = &'a Observation>,
    score: usize,
    target: Target,
) -> Concordance {
    concordance_by(observations, score, target, |_| 0)
}

/// Concordance over couples with the same key and in one stratum of the target.
fn concordance_by<'a>(
    observations: impl Iterator<Item = &'a Observation>,
    score: usize,
    target: Target,
    key: impl Fn(&Observation) -> usize,
) -> Concordance {
    let mut strata = BTreeMap::<_, Vec<_>>::new();
    for observation in observations {
        if let Some(values) = observation.scores[score].zip(target.of(observation)) {
            let stratum = (key(observation), target.stratum(observation));
            strata.entry(stratum).or_default().push(values);
        }
    }
    let strata = strata.into_values();
    strata
        .map(|mut stratum| Concordance::of(&mut stratum))
        .sum()
}

/// The algorithms with the greatest value.
fn best<V: PartialOrd>(pair: &[&Observation], value: impl Fn(&Observation) -> V) -> Vec<usize> {
    let is_top = |o: &&&Observation| pair.iter().all(|other| value(other) <= value(o));
    pair.iter().filter(is_top).map(|o| o.algorithm).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::without_truth::SCORES;
    use svl_data::score::CellTally;

    /// Right, wrong and unknown cells out of fifteen, and a score; cell coverage follows.
    fn observation(algorithm: usize, cells: [usize; 3], score: f64) -> Observation {
        let [right, wrong, unknown] = cells;
        let mut scores = [None; SCORES.len()];
        scores[0] = Some(score);
        scores[CELLS] = Some((right + wrong) as f64 / 15.0);
        scores[PIXELS] = Some(1.0);
        Observation {
            algorithm,
            fifteenths: right + wrong,
            truth: CellTally {
                right,
                wrong,
                unknown,
                ..CellTally::default()
            },
            scores,
        }
    }

    fn twice_eight(pair: &[Observation]) -> Observed {
        Observed::runs(vec![pair.to_vec(); 16], &[8, 8])
    }

    #[test]
    fn coverage_is_equal_within_strata_alone() {
        // Two algorithms know all cells, and the one with the better score has fewer wrong ones;
        // the third knows a third of them, has no wrong cell and the worst score.
        let set = twice_eight(&[
            observation(0, [12, 3, 0], 0.8),
            observation(1, [9, 6, 0], 0.6),
            observation(2, [5, 0, 10], 0.3),
        ]);
        let tau = |target| set.tau(0, Between::Algorithms, target).value;
        assert_eq!(tau(Target::NotWrong), Some(1.0));
        assert_eq!(set.couples(0, Between::Algorithms, Target::NotWrong), 16);
        assert_eq!(tau(Target::Right), Some(1.0));
        assert_eq!(set.couples(0, Between::Algorithms, Target::Right), 48);
        // All pairs are equal.
        assert_eq!(set.tau(0, Between::Pairs, Target::Right).value, None);
        // Coverage is uninformative at equal coverage.
        let coverage = set.tau(CELLS, Between::Algorithms, Target::NotWrong);
        assert_eq!(coverage, Measured::default());
    }

    #[test]
    fn pairs_of_one_algorithm_are_compared_with_each_other() {
        let one = |right, score| vec![observation(0, [right, 15 - right, 0], score)];
        let set = Observed::runs(vec![one(15, 0.9), one(10, 0.5), one(5, 0.6)], &[3]);
        let tau = set.tau(0, Between::Pairs, Target::NotWrong);
        // Two couples concordant, one discordant; three blocks are too few for an interval.
        assert_eq!((tau.value, tau.interval), (Some(1.0 / 3.0), None));
        assert_eq!(
            set.tau(0, Between::Algorithms, Target::NotWrong).value,
            None
        );
    }

    #[test]
    fn the_best_has_the_most_right_minus_wrong_cells() {
        // Algorithm 0 knows most, 1 is best: 9 against 5.
        let of = |scores: [f64; 2]| {
            twice_eight(&[
                observation(0, [10, 5, 0], scores[0]),
                observation(1, [9, 0, 6], scores[1]),
            ])
        };
        let set = of([0.4, 0.5]);
        assert_eq!(
            (set.picks(0).value, set.picks(CELLS).value),
            (Some(1.0), Some(0.0))
        );
        assert_eq!(set.chance(), Some(0.5));
        // Both cover all pixels: chance.
        assert_eq!(set.picks(PIXELS).value, Some(0.5));
        assert_eq!(set.picks_beyond_coverage(0).value, Some(0.5));
        assert_eq!(of([0.5, 0.5]).picks(0).value, Some(0.5));
        assert_eq!(of([0.5, 0.4]).picks(0).value, Some(0.0));
    }

    #[test]
    fn scenes_are_drawn_whole() {
        let pair = vec![observation(0, [15, 0, 0], 1.0)];
        let set = Observed::scenes(vec![vec![pair.clone(), pair.clone()], vec![pair]]);
        assert_eq!(set.drawn, [vec![0, 1], vec![2]]);
    }
}
