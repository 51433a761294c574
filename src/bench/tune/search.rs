//! The search: quasi-random settings, of which few pairs decide which are run on more (successive
//! halving: Jamieson and Talwalkar, "Non-stochastic Best Arm Identification and Hyperparameter
//! Optimization", 2016), then settings near the best ones.

use super::goal::Goal;
use super::space::{Space, quasi_random};
use super::values::TrialValues;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::Result;
use svl_core::matcher::Algorithm;
use svl_score::judge::Metric;

/// Runs settings over pairs.
pub trait Evaluator {
    /// The values of each algorithm over `pairs`, spread over all; none for one that failed on a
    /// pair. `None` if the user ended it. The first algorithm is the reference.
    ///
    /// # Errors
    /// The reason why one of them cannot be run.
    fn evaluate(
        &mut self,
        algorithms: &[Algorithm],
        pairs: usize,
    ) -> Result<Option<Vec<Option<TrialValues>>>>;
}

/// Size of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchPlan {
    /// Settings that are tried.
    pub trials: usize,
    /// Number of pairs of those that are run to the end.
    pub pairs: usize,
    pub seed: u64,
}

/// Generations of settings: spread over the space, then nearer and nearer to the best ones, as
/// standard deviations along an axis.
const SPREADS: [Option<f64>; 4] = [None, Some(0.25), Some(0.12), Some(0.06)];

/// One of this number advances to the next number of pairs, which is as many times greater.
const HALVING: usize = 3;

/// Numbers of pairs that a setting is run on before all.
const RUNGS: u32 = 2;

/// Smallest number of pairs that a setting is run on.
const MIN_PAIRS: usize = 8;

/// Settings near which others are tried.
const ELITES: usize = 5;

/// Algorithms of one run beside the reference.
const BATCH: usize = 11;

/// A setting with its values over some pairs.
#[derive(Clone, Debug)]
pub struct Evaluated {
    pub algorithm: Algorithm,
    /// Generation of the search, from 0.
    pub generation: usize,
    pub pairs: usize,
    pub values: TrialValues,
}

/// A result, for a log.
pub struct LoggedTrial<'a> {
    /// As `--algo` takes it.
    pub setting: &'a str,
    pub generation: usize,
    pub pairs: usize,
    /// None for a setting that failed.
    pub values: Option<&'a TrialValues>,
}

/// Values of settings, by the setting as it is written and pairs; none for one that fails.
pub type Known = BTreeMap<(String, usize), Option<TrialValues>>;

/// A search under way.
pub struct Search<'a> {
    space: &'a Space,
    goal: &'a Goal,
    plan: SearchPlan,
    /// Values that were found, or read from a log: by the setting as it is written, and pairs.
    known: Known,
    /// Settings that were run, in order.
    evaluated: Vec<Evaluated>,
    generation: usize,
    interrupted: bool,
}

impl<'a> Search<'a> {
    /// `known`: what an earlier search found, which is not run again.
    pub fn new(space: &'a Space, goal: &'a Goal, plan: SearchPlan, known: Known) -> Self {
        Self {
            space,
            goal,
            plan,
            known,
            evaluated: Vec::new(),
            generation: 0,
            interrupted: false,
        }
    }

    /// Approximate number of matchings of a search without a log.
    pub fn matchings(plan: SearchPlan) -> u64 {
        let per_generation = plan.trials.div_ceil(SPREADS.len());
        let mut left = per_generation;
        let mut matchings = 0;
        for pairs in rungs(plan.pairs) {
            let runs = left.div_ceil(BATCH).max(1);
            matchings += (left + runs) * pairs;
            left = left.div_ceil(HALVING);
        }
        (matchings * SPREADS.len()) as u64
    }

    /// True if the user ended it.
    pub fn was_interrupted(&self) -> bool {
        self.interrupted
    }

    /// Runs it to its end, or until the evaluator ends it. `log` gets every result once.
    ///
    /// # Errors
    /// Those of the evaluator and of the log.
    pub fn run(
        &mut self,
        evaluator: &mut dyn Evaluator,
        log: &mut dyn FnMut(&LoggedTrial<'_>) -> Result<()>,
    ) -> Result<()> {
        let mut random = fastrand::Rng::with_seed(self.plan.seed);
        let mut seen = BTreeSet::from([self.space.base.written()]);
        for (generation, spread) in SPREADS.into_iter().enumerate() {
            self.generation = generation;
            let wanted = self.plan.trials.div_ceil(SPREADS.len());
            let mut left = match spread {
                None => self.spread(wanted, &mut seen, &mut random),
                Some(spread) => self.near_the_best(wanted, spread, &mut seen, &mut random),
            };
            for pairs in rungs(self.plan.pairs) {
                if !self.look_at(&left, pairs, evaluator, log)? {
                    self.interrupted = true;
                    return Ok(());
                }
                left.retain(|algorithm| self.value(algorithm, pairs).is_some());
                self.sort(&mut left, pairs);
                left.truncate(left.len().div_ceil(HALVING));
            }
        }
        Ok(())
    }

    /// Number of settings that were tried beside the reference.
    pub fn tried(&self) -> usize {
        let base = self.space.base.written();
        let tried: BTreeSet<_> = self.known.keys().map(|(written, _)| written).collect();
        tried
            .into_iter()
            .filter(|written| **written != base)
            .count()
    }

    /// The settings that were run on the most pairs, the best first; the reference is among them.
    pub fn ranked(&self) -> Vec<&Evaluated> {
        let base = self.space.base.written();
        let is_trial = |e: &&Evaluated| e.algorithm.written() != base;
        let most = self
            .evaluated
            .iter()
            .filter(is_trial)
            .map(|e| e.pairs)
            .max();
        let most = most.or(self.evaluated.iter().map(|e| e.pairs).max());
        let mut ranked: Vec<_> = self
            .evaluated
            .iter()
            .filter(|e| Some(e.pairs) == most)
            .collect();
        let reference = ranked.iter().find(|e| e.algorithm.written() == base);
        if let Some(reference) = reference.map(|e| e.values.clone()) {
            ranked.sort_by(|a, b| self.goal.compare(&a.values, &b.values, &reference));
        }
        ranked
    }

    /// The best setting so far, which may be the reference.
    pub fn best(&self) -> &Algorithm {
        self.ranked()
            .first()
            .map_or(&self.space.base, |best| &best.algorithm)
    }

    fn value(&self, algorithm: &Algorithm, pairs: usize) -> Option<&TrialValues> {
        self.known.get(&(algorithm.written(), pairs))?.as_ref()
    }

    fn sort(&self, algorithms: &mut [Algorithm], pairs: usize) {
        let Some(reference) = self.value(&self.space.base, pairs) else {
            return;
        };
        algorithms.sort_by(|a, b| match (self.value(a, pairs), self.value(b, pairs)) {
            (Some(a), Some(b)) => self.goal.compare(a, b, reference),
            (a, b) => b.is_some().cmp(&a.is_some()),
        });
    }

    /// Logs and keeps the values of a batch over `pairs`, of which the first is the reference.
    /// Times are scaled to its first one.
    fn take_in(
        &mut self,
        batch: &[Algorithm],
        values: Vec<Option<TrialValues>>,
        pairs: usize,
        log: &mut dyn FnMut(&LoggedTrial<'_>) -> Result<()>,
    ) -> Result<()> {
        let time = Metric::find("time").expect("a metric of METRICS");
        let mut found = batch.iter().zip(values);
        let base = self.space.base.clone();
        let Some((_, Some(reference))) = found.next() else {
            return Err(svl_core::Error::Invalid(format!(
                "{}: fails, so that nothing can be compared with it",
                base.label()
            )));
        };
        let first = self.value(&base, pairs).unwrap_or(&reference).get(time);
        let scale = first
            .zip(reference.get(time))
            .map(|(first, now)| first / now);
        let scaled = |mut values: TrialValues| {
            let ms = values.get(time).zip(scale).map(|(ms, scale)| ms * scale);
            values.set(time.name, ms);
            values
        };
        let found: Vec<_> = found.map(|(a, v)| (a.written(), v.map(scaled))).collect();
        let is_new = !self.known.contains_key(&(base.written(), pairs));
        let reference = is_new.then(|| (base.written(), Some(reference)));
        for (written, values) in reference.into_iter().chain(found) {
            log(&LoggedTrial {
                setting: &written,
                generation: self.generation,
                pairs,
                values: values.as_ref(),
            })?;
            self.known.insert((written, pairs), values);
        }
        Ok(())
    }

    /// Finds the values of algorithms and of the reference over `pairs`; false if the user ended
    /// it.
    fn look_at(
        &mut self,
        algorithms: &[Algorithm],
        pairs: usize,
        evaluator: &mut dyn Evaluator,
        log: &mut dyn FnMut(&LoggedTrial<'_>) -> Result<()>,
    ) -> Result<bool> {
        let base = self.space.base.clone();
        let is_unknown = |a: &&Algorithm| !self.known.contains_key(&(a.written(), pairs));
        let unknown: Vec<_> = algorithms.iter().filter(is_unknown).cloned().collect();
        let mut batches: Vec<_> = unknown.chunks(BATCH).collect();
        if batches.is_empty() && !self.known.contains_key(&(base.written(), pairs)) {
            batches.push(&[]);
        }
        for batch in batches {
            let run: Vec<_> = std::iter::once(&base).chain(batch).cloned().collect();
            let Some(values) = evaluator.evaluate(&run, pairs)? else {
                return Ok(false);
            };
            self.take_in(&run, values, pairs, log)?;
        }
        for algorithm in std::iter::once(&base).chain(algorithms) {
            let written = algorithm.written();
            let is_listed = |e: &Evaluated| e.pairs == pairs && e.algorithm.written() == written;
            if let Some(values) = self.value(algorithm, pairs).cloned()
                && !self.evaluated.iter().any(is_listed)
            {
                self.evaluated.push(Evaluated {
                    algorithm: algorithm.clone(),
                    generation: self.generation,
                    pairs,
                    values,
                });
            }
        }
        Ok(true)
    }

    /// Settings that differ from the reference in one to three parameters.
    fn spread(
        &self,
        wanted: usize,
        seen: &mut BTreeSet<String>,
        random: &mut fastrand::Rng,
    ) -> Vec<Algorithm> {
        let dimensions = self.space.axes.len();
        let offset = random.usize(0..1 << 16);
        let mut settings = Vec::new();
        // In a small space there are fewer.
        for i in 1..=20 * wanted {
            let place: Vec<_> = quasi_random(offset + i, dimensions).collect();
            let moved = some_axes(dimensions, 3, random);
            self.add(&self.space.base, &place, &moved, seen, &mut settings);
            if settings.len() == wanted {
                break;
            }
        }
        settings
    }

    /// Settings beside the best ones, and between them.
    fn near_the_best(
        &self,
        wanted: usize,
        spread: f64,
        seen: &mut BTreeSet<String>,
        random: &mut fastrand::Rng,
    ) -> Vec<Algorithm> {
        let elites: Vec<_> = self.ranked().into_iter().take(ELITES).collect();
        let dimensions = self.space.axes.len();
        let mut settings = Vec::new();
        for i in 0..20 * wanted {
            let parent = &elites[i % elites.len()].algorithm;
            let mut place = self.space.place(parent);
            let mut moved = some_axes(dimensions, 2, random);
            for &axis in &moved {
                place[axis] += spread * normal(random);
            }
            // Every third also takes after another of the best.
            if random.u8(0..3) == 0 {
                let other = self
                    .space
                    .place(&elites[random.usize(0..elites.len())].algorithm);
                for axis in 0..dimensions {
                    if random.bool() && !moved.contains(&axis) {
                        place[axis] = other[axis];
                        moved.push(axis);
                    }
                }
            }
            // Beyond an end the axis is reflected.
            place.iter_mut().for_each(|at| {
                *at = if *at < 0.0 { -*at } else { *at };
                *at = if *at > 1.0 { 2.0 - *at } else { *at };
            });
            self.add(parent, &place, &moved, seen, &mut settings);
            if settings.len() == wanted {
                break;
            }
        }
        settings
    }

    fn add(
        &self,
        from: &Algorithm,
        place: &[f64],
        moved: &[usize],
        seen: &mut BTreeSet<String>,
        settings: &mut Vec<Algorithm>,
    ) {
        if let Some(setting) = self.space.at(from, place, moved)
            && seen.insert(setting.written())
        {
            settings.push(setting);
        }
    }
}

/// Numbers of pairs, from few to all.
fn rungs(pairs: usize) -> impl Iterator<Item = usize> {
    let mut before = 0;
    let all = (0..=RUNGS).rev().map(move |power| {
        let part = pairs / HALVING.pow(power);
        part.max(MIN_PAIRS).min(pairs).max(1)
    });
    all.filter(move |&pairs| std::mem::replace(&mut before, pairs) != pairs)
}

/// One to `most` of the axes.
fn some_axes(dimensions: usize, most: usize, random: &mut fastrand::Rng) -> Vec<usize> {
    let count = random.usize(1..=most.min(dimensions));
    let mut axes = random.choose_multiple(0..dimensions, count);
    axes.sort_unstable();
    axes
}

/// A normal number, by Box and Muller.
fn normal(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Right cells grow with the nearness to a setting of bm, wrong ones beyond a block size.
    struct Known {
        matchings: usize,
        stops_after: usize,
    }

    impl Evaluator for Known {
        fn evaluate(
            &mut self,
            algorithms: &[Algorithm],
            pairs: usize,
        ) -> Result<Option<Vec<Option<TrialValues>>>> {
            self.matchings += algorithms.len() * pairs;
            if self.matchings > self.stops_after {
                return Ok(None);
            }
            let values = algorithms.iter().map(|algorithm| {
                let number = |name| f64::from(algorithm.parameters().int(name));
                let (uniqueness, size) = (number("uniqueness"), number("block_size"));
                let off = (uniqueness - 30.0).abs() / 30.0 + (size - 21.0).abs() / 20.0;
                let mut values = TrialValues::default();
                values.set("right", Some(1.0 - 0.3 * off));
                values.set("wrong", Some(if size > 23.0 { 0.2 } else { 0.05 }));
                values.set("time", Some(1.0));
                // Strict algorithms fail.
                (uniqueness < 90.0).then_some(values)
            });
            Ok(Some(values.collect()))
        }
    }

    fn found(seed: u64, stops_after: usize) -> (String, Vec<String>, usize, bool) {
        let space = Space::new(
            "bm".parse().unwrap(),
            &["uniqueness=0..100", "block_size", "speckle_size"].map(str::to_owned),
        )
        .unwrap();
        let bounds = ["wrong<=1x", "time<=1.5x"].map(|bound| bound.parse().unwrap());
        let goal = Goal::new("right", true, bounds.to_vec()).unwrap();
        let plan = SearchPlan {
            trials: 120,
            pairs: 90,
            seed,
        };
        let mut evaluator = Known {
            matchings: 0,
            stops_after,
        };
        let mut search = Search::new(&space, &goal, plan, BTreeMap::new());
        let mut log = Vec::new();
        search
            .run(&mut evaluator, &mut |trial| {
                let LoggedTrial {
                    setting,
                    pairs,
                    values,
                    ..
                } = trial;
                log.push(format!("{setting} {pairs} {}", values.is_some()));
                Ok(())
            })
            .unwrap();
        let best = search.best().written();
        (best, log, evaluator.matchings, search.was_interrupted())
    }

    #[test]
    fn the_best_is_found_within_the_constraints_and_again() {
        let (best, log, matchings, _) = found(1, usize::MAX);
        let best: Algorithm = best.parse().unwrap();
        let number = |name| best.parameters().int(name);
        assert!((25..=35).contains(&number("uniqueness")), "{best:?}");
        assert!((19..=23).contains(&number("block_size")), "{best:?}");
        // Few settings are run on all pairs.
        assert!(matchings < 120 * 90 / 2, "{matchings}");
        assert_eq!(found(1, usize::MAX).1, log, "equal seeds, equal searches");
        assert_ne!(found(2, usize::MAX).1, log);
    }

    #[test]
    fn an_interrupted_search_has_the_best_so_far() {
        let (best, log, _, interrupted) = found(1, 1200);
        assert!(interrupted && !log.is_empty());
        assert_ne!(best, "bm");
        // Before any other setting was run it is the reference.
        let (best, log, _, interrupted) = found(1, 5);
        assert!(interrupted && log.is_empty() && best == "bm");
    }
}
