//! Pairs in memory that a search runs settings on.

use super::sample::{self, Sampler, spread_order};
use super::{Evaluated, Evaluator, FrontEntry, Goal, Search, Space, TrialValues, TunedAlgorithm};
use crate::console::{Bar, Console, Unit};
use crate::run::{Matchers, Monitor, Pace};
use crate::runs::{self, runs};
use crate::sink::{Outbox, RunStart, Sink, TableSink, finish};
use crate::source::PairRegister;
use std::sync::Arc;
use svl_core::matcher::Algorithm;
use svl_core::stereo::Frame;
use svl_core::{Error, Result, interrupt};
use svl_report::compare::{Change, changes, total};
use svl_report::{OBJECTIVES, Row, pareto_front};
use svl_score::judge::{Judge, Metric};
use svl_score::manifest::Manifest;
use svl_score::scenario::Scenario;

/// Largest memory of the frames of the search, and of those of the test, bytes.
const MAX_FRAME_BYTES: usize = 1 << 30;

/// The test has this many times as many pairs as the search, if there are as many.
const TEST_PAIRS: usize = 4;

/// Largest number of settings of a Pareto front that are shown.
const MAX_FRONT: usize = 16;

/// Frames of a run, in memory.
pub struct HeldRun {
    pub name: String,
    seed: Option<u64>,
    judge: Judge,
    pub frames: Vec<Arc<Frame>>,
}

impl HeldRun {
    pub(super) fn judge(&self) -> &Judge {
        &self.judge
    }

    /// Takes out the last third, or of scenes every third, with a caution for the former.
    fn hold_out(&mut self) -> (Self, Option<String>) {
        let frames = std::mem::take(&mut self.frames);
        let are_scenes = frames.iter().all(|frame| frame.name.is_some());
        let is_test = |i: usize| {
            if are_scenes {
                i % 3 == 2
            } else {
                i >= frames.len() * 2 / 3
            }
        };
        let side = |test: bool| {
            let frames = frames.iter().enumerate();
            let frames = frames.filter(|(i, _)| is_test(*i) == test);
            frames
                .map(|(_, frame)| Arc::clone(frame))
                .collect::<Vec<_>>()
        };
        self.frames = side(false);
        let caution = (!are_scenes).then(|| {
            "The test is the last third of the same recording: it says little about others; name \
             some with --test."
                .to_owned()
        });
        let held_out = Self {
            name: format!("{}, held out", self.name),
            seed: self.seed,
            judge: self.judge.clone(),
            frames: side(true),
        };
        (held_out, caution)
    }
}

/// The pairs of the search, and those of the test.
pub struct SearchData {
    pub training: Vec<HeldRun>,
    pub test: Vec<HeldRun>,
    /// Reason why the test is weaker than it could be.
    pub caution: Option<String>,
    /// The scenario of the test, if it is another.
    pub tested: Option<Scenario>,
}

impl SearchData {
    /// Number of the pairs of the search.
    pub fn training_pairs(&self) -> usize {
        self.training.iter().map(|part| part.frames.len()).sum()
    }

    /// True if a pair has a truth.
    pub fn has_truth(&self) -> bool {
        let parts = self.training.iter().chain(&self.test);
        let mut frames = parts.flat_map(|part| &part.frames);
        frames.any(|frame| frame.truth.is_some())
    }

    /// The evaluator of the search.
    pub fn evaluator(&self) -> HeldRuns<'_> {
        HeldRuns {
            parts: &self.training,
            has_truth: self.has_truth(),
            bar: None,
        }
    }

    /// Reads about `wanted` pairs of the runs of `scenario`, and those of `tested` for the test;
    /// without it a part is held out.
    ///
    /// # Errors
    /// Those of the sources; [`Error::Usage`] for recordings that share pairs.
    pub fn read(
        scenario: &Scenario,
        tested: Option<Scenario>,
        algorithms: &[Algorithm],
        wanted: usize,
        console: &dyn Console,
    ) -> Result<Self> {
        let register = PairRegister::new(algorithms)?;
        if let Some(tested) = tested {
            let training = parts(scenario, wanted, (&register, false), console)?;
            let test = parts(&tested, TEST_PAIRS * wanted, (&register, false), console)?;
            register.refuse_copies()?;
            return Ok(Self {
                training,
                test,
                caution: None,
                tested: Some(tested),
            });
        }
        // A part of the runs is held out, or of one run its end, or of scenes every third.
        let is_one = runs::count(scenario)? == 1;
        let mut training = parts(scenario, wanted * 3 / 2, (&register, is_one), console)?;
        register.refuse_copies()?;
        let (test, caution) = match &mut training[..] {
            [only] => {
                let (test, caution) = only.hold_out();
                (vec![test], caution)
            }
            all => {
                let held_out = (all.len() / 4).max(1);
                let first = all.len() - held_out;
                (training.split_off(first), None)
            }
        };
        Ok(Self {
            training,
            test,
            caution,
            tested: None,
        })
    }
}

/// About `wanted` pairs of the runs of a scenario, equally many of each. The others are registered
/// too, unless they may be skipped.
fn parts(
    scenario: &Scenario,
    wanted: usize,
    (register, skips): (&PairRegister, bool),
    console: &dyn Console,
) -> Result<Vec<HeldRun>> {
    let runs = runs(scenario, console)?;
    let count = runs.len().max(1);
    let mut parts = Vec::new();
    for run in runs {
        let (run, judge) = run.open(scenario, console, None)?;
        let run = run.registered(&scenario.name, register, skips);
        let (seed, name) = (run.seed, run.title(&scenario.name));
        let each = wanted.div_ceil(count);
        let bar = console.bar(&format!("read {name}"), Unit::Pairs, Some(each as u64));
        let sampler = Sampler::new(Box::new(run), each, MAX_FRAME_BYTES / count);
        let frames = sampler.read_all(|| {
            bar.step();
            !interrupt::requested()
        });
        drop(bar);
        if interrupt::requested() {
            return Err(Error::Invalid("interrupted; nothing is written".to_owned()));
        }
        let frames = frames?;
        if frames.iter().any(|frame| frame.rectified().is_err()) {
            tracing::warn!(
                "{name}: its pairs are raw, and taken as rectified; --calib names a calibration"
            );
        }
        parts.push(HeldRun {
            name,
            seed,
            judge,
            frames,
        });
    }
    Ok(parts)
}

/// Runs algorithms over the frames in memory.
pub struct HeldRuns<'a> {
    pub parts: &'a [HeldRun],
    /// True if some of the pairs have a truth.
    pub has_truth: bool,
    /// Counts matchings.
    pub bar: Option<Box<dyn Bar>>,
}

/// Counts matchings.
struct MatchingCount<'a> {
    bar: Option<&'a dyn Bar>,
    algorithms: usize,
}

impl Monitor for MatchingCount<'_> {
    fn go_on(&mut self, _: u64) -> bool {
        for bar in self.bar.iter().cycle().take(self.algorithms) {
            bar.step();
        }
        !interrupt::requested()
    }

    /// The algorithm has no result then, which suffices.
    fn failed(&mut self, _: &str) {}
}

impl HeldRuns<'_> {
    /// The rows per algorithm, of `pairs` spread over all; none when interrupted.
    fn rows(&self, algorithms: &[Algorithm], pairs: usize) -> Result<Option<Vec<Vec<Row>>>> {
        let labels: Vec<_> = (0..algorithms.len())
            .map(|i| format!("setting-{i}"))
            .collect();
        let labelled = algorithms.iter().cloned().zip(&labels);
        let labelled: Vec<_> = labelled.map(|(a, label)| a.called(label.clone())).collect();
        let manifest = Manifest::new("tune", &labelled)?;
        let mut matchers = Matchers::new(&labelled)?.without_warnings();
        let all: usize = self.parts.iter().map(|part| part.frames.len()).sum();
        let mut chosen = spread_order(all);
        chosen.truncate(pairs);
        chosen.sort_unstable();
        let mut by_label = vec![Vec::new(); labels.len()];
        let mut first = 0;
        for part in self.parts {
            let end = first + part.frames.len();
            let indices = chosen.iter().filter(|i| (first..end).contains(*i));
            let frames: Vec<_> = indices
                .map(|i| Arc::clone(&part.frames[i - first]))
                .collect();
            first = end;
            if frames.is_empty() {
                continue;
            }
            let judge = Judge {
                photometric: !self.has_truth,
                ..part.judge.clone()
            };
            let start = RunStart::new(&manifest, part.seed, &judge);
            let rows = Outbox::default();
            let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(TableSink::new(None, None, &rows)?)];
            let mut counting = MatchingCount {
                bar: self.bar.as_deref(),
                algorithms: labels.len(),
            };
            let pace = Pace::Measured { rounds: 1 };
            let outcome = sample::evaluate(
                &frames,
                &mut matchers,
                &start,
                pace,
                &mut sinks,
                &mut counting,
            )?;
            finish(sinks)?;
            if outcome.interrupted {
                return Ok(None);
            }
            for row in rows.take() {
                if let Some(place) = labels.iter().position(|label| *label == row.algorithm) {
                    by_label[place].push(row);
                }
            }
        }
        Ok(Some(by_label))
    }
}

impl HeldRuns<'_> {
    /// The changes from the first to the second setting over all pairs; none if they are equal, or
    /// the user ended it.
    fn compare(
        mut self,
        both: &[Algorithm; 2],
        title: &str,
        console: &dyn Console,
    ) -> Result<Vec<Change>> {
        let pairs: usize = self.parts.iter().map(|part| part.frames.len()).sum();
        let [base, other] = both;
        if interrupt::requested() || base.written() == other.written() || pairs == 0 {
            return Ok(Vec::new());
        }
        self.bar = Some(console.bar(title, Unit::Pairs, Some(2 * pairs as u64)));
        let rows = self.rows(both, pairs);
        self.bar = None;
        let rows = rows?.unwrap_or_default();
        let sides = rows.iter().map(|rows| rows.iter().collect::<Vec<_>>());
        Ok(match &sides.collect::<Vec<_>>()[..] {
            [base, other] if base.len() == other.len() => changes(base, other),
            _ => Vec::new(),
        })
    }
}

impl Evaluator for HeldRuns<'_> {
    fn evaluate(
        &mut self,
        algorithms: &[Algorithm],
        pairs: usize,
    ) -> Result<Option<Vec<Option<TrialValues>>>> {
        let rows = self.rows(algorithms, pairs)?;
        let values = |rows: Vec<Row>| {
            let rows: Vec<_> = rows.iter().collect();
            // Its value depends on the other algorithms of the run.
            let value = |metric: &'static Metric| match metric.name {
                "agreed" => None,
                _ => total(metric, &rows),
            };
            (rows.len() == pairs).then(|| TrialValues::from_fn(value))
        };
        Ok(rows.map(|rows| rows.into_iter().map(values).collect()))
    }
}

/// The result of a search, scored on the test.
///
/// # Errors
/// Those of the matchers.
pub fn found(
    space: &Space,
    search: &Search<'_>,
    goal: &Goal,
    data: &SearchData,
    console: &dyn Console,
) -> Result<TunedAlgorithm> {
    let best = search.best().clone();
    let ranked = search.ranked();
    let reference = ranked
        .iter()
        .find(|evaluated| evaluated.algorithm.written() == space.base.written())
        .map(|evaluated| evaluated.values.clone())
        .unwrap_or_default();
    let (_, front) = pareto_front(&ranked, &OBJECTIVES, |evaluated, metric| {
        evaluated.values.get(metric)
    });
    // The best comes first, though a setting that exceeds a bound may dominate it.
    let is_other = |evaluated: &&&Evaluated| evaluated.algorithm.written() != best.written();
    let first = ranked.first().into_iter();
    let front = first
        .chain(front.into_iter().filter(is_other))
        .take(MAX_FRONT);
    let front = front
        .map(|evaluated| FrontEntry::new(evaluated, goal, &reference))
        .collect();
    let both = [space.base.clone(), best.clone()];
    let compared = |part: &str, parts: &[HeldRun]| {
        let runs = HeldRuns {
            parts,
            has_truth: data.has_truth(),
            bar: None,
        };
        runs.compare(&both, &format!("{part} {}", space.base.label()), console)
    };
    let training = compared("train", &data.training)?;
    let test = compared("test", &data.test)?;
    let tried = search.tried();
    Ok(TunedAlgorithm {
        reference: space.base.written(),
        best: best.written(),
        objective: goal.objective.name,
        axes: space.axes.iter().map(ToString::to_string).collect(),
        tried,
        // The reference is among the ranked ones.
        finalists: ranked.len().saturating_sub(1),
        front,
        training,
        test,
        test_pairs: data.test.iter().map(|part| part.frames.len()).sum(),
    })
}
