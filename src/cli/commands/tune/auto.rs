//! A search in place of a person.

use super::Args;
use crate::cli::shared::progress::{Terminal, interrupted};
use crate::cli::shared::terminal::{print, print_json};
use crate::cli::shared::usage;
use anyhow::{Context, bail};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use svl::console::{Bar, Console, Unit};
use svl::filter::FilterModel;
use svl::grab;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::outputs::{self, Outputs};
use svl::report::compare::{changes, total};
use svl::report::{Row, pareto_front};
use svl::run::{Matchers, Monitor, Pace};
use svl::runs::{self, runs};
use svl::scenario::{Scenario, ScenarioKind, SourceOptions};
use svl::score::{Judge, METRICS, Metric};
use svl::sink::{Outbox, RunStart, Sink, TableSink, finish};
use svl::source::Source;
use svl::stereo::{Frame, Truth};
use svl::tune::{
    Evaluated, Evaluator, FrontEntry, Goal, Known, LoggedTrial, Sampler, Search, SearchPlan, Space,
    TrialValues, TuneFacts, TuneOutcome, TunedAlgorithm, evaluate, scenario_toml, spread_order,
};

/// Most memory of the frames that are searched on, and of those that judge, bytes.
const FRAME_BYTES: usize = 1 << 30;

/// Times as many pairs judge what was found, where there are as many.
const TEST_PAIRS: usize = 4;

/// Pairs that show which metrics there are.
const FIRST_PAIRS: usize = 8;

/// Settings of a Pareto front that are shown.
const FRONT: usize = 16;

/// Frames of a run, in memory.
struct HeldRun {
    name: String,
    seed: Option<u64>,
    judge: Judge,
    frames: Vec<Arc<Frame>>,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let terminal = &Terminal { quiet };
    let out = args.out.as_deref().context("--out is required")?;
    if let Some(cameras) = args.what.iter().find(|name| grab::driver(name).is_some()) {
        let cure = format!("record them first: svl record {cameras}");
        return Err(usage::wrong(format!("{cameras}: are cameras; {cure}")));
    }
    let (page, log) = (out.with_extension("md"), out.with_extension("csv"));
    let may_replace = args.force || args.search.resume;
    // What a search found is replaced by what it finds when it goes on; its log goes on.
    let claimed = Outputs::claim(may_replace, [], [out, &page])?;
    let logs = Outputs::claim(may_replace, [], [log.as_path()])?;
    let filters = args.filters.models()?;
    let files = args.filters.files(&filters);
    let algorithms = args.algorithms()?;
    let spaces = algorithms.iter().map(|algorithm| {
        let base: Algorithm = algorithm.written().parse()?;
        Space::new(base.filtered(&filters), &args.search.vary)
    });
    let spaces = spaces.collect::<svl::Result<Vec<_>>>()?;
    let plan = SearchPlan {
        trials: args.search.trials,
        pairs: args.search.pairs,
        seed: args.search.search_seed,
    };

    let mut scenario = args.scenario_of(&args.what)?;
    runs::change(
        std::slice::from_mut(&mut scenario),
        &args.source,
        &args.what[0],
    )?;
    let SearchData {
        training,
        test,
        caution,
        tested,
    } = SearchData::read(args, &scenario, terminal)?;
    let frames = || training.iter().chain(&test).flat_map(|part| &part.frames);
    let pairs: usize = training.iter().map(|part| part.frames.len()).sum();
    if pairs == 0 {
        bail!("{}: has no pairs", args.what[0]);
    }
    let has_truth = frames().any(|frame| frame.truth.is_some());
    let mut goal = goal(args, has_truth)?;
    let plan = SearchPlan {
        pairs: plan.pairs.min(pairs),
        ..plan
    };
    let mut log = TrialLog::open(&log, &training, &filters, args.search.resume, logs)?;
    let mut evaluator = HeldRuns {
        parts: &training,
        has_truth,
        bar: None,
    };
    let bases: Vec<_> = spaces.iter().map(|space| space.base.clone()).collect();
    let Some(values) = evaluator.evaluate(&bases, plan.pairs.min(FIRST_PAIRS))? else {
        bail!("interrupted; nothing is written");
    };
    let is_measured = |metric: &Metric| {
        let mut values = values.iter().flatten();
        values.all(|values| values.get(metric).is_some())
    };
    match args.search.subject_to.is_empty() {
        // A bound of what these pairs do not have says nothing.
        true => goal.constraints.retain(|of| is_measured(of.metric)),
        false => {
            if let Some(other) = goal.metrics().find(|metric| !is_measured(metric)) {
                let name = other.name;
                return Err(usage::wrong(format!(
                    "{name}: is not measured on these pairs"
                )));
            }
        }
    }
    let mut tuned = Vec::new();
    let mut was_interrupted = false;
    for space in &spaces {
        let known = log.known(&space.base);
        let title = format!("search {}", space.base.label());
        let matchings = Search::matchings(plan);
        evaluator.bar = Some(terminal.bar(&title, Unit::Pairs, Some(matchings)));
        let mut search = Search::new(space, &goal, plan, known);
        let ran = search.run(&mut evaluator, &mut |trial| log.write(&space.base, trial));
        evaluator.bar = None;
        ran?;
        was_interrupted |= search.was_interrupted();
        tuned.push(found(
            space, &search, &goal, &training, &test, has_truth, terminal,
        )?);
        if was_interrupted {
            break;
        }
    }
    let manifest = Manifest::new("tune", &algorithms)?;
    let names = |parts: &[HeldRun]| parts.iter().map(|part| part.name.clone()).collect();
    let outcome = TuneOutcome {
        facts: TuneFacts {
            goal: goal.words(),
            training: names(&training),
            training_pairs: plan.pairs,
            test: names(&test),
            caution,
            interrupted: was_interrupted,
            made: manifest.entries(),
        },
        algorithms: tuned,
    };
    let mut best = Vec::new();
    for of in &outcome.algorithms {
        for written in [&of.best, &of.reference] {
            if !best.contains(written) {
                best.push(written.clone());
            }
        }
    }
    let folder = out.parent().unwrap_or(Path::new(""));
    let head = format!(
        "# Found by `svl tune --auto`, svl {}, {}: {}.\n",
        manifest.svl,
        manifest.began,
        goal.words()
    );
    let toml = head + &scenario_toml(&tested.unwrap_or(scenario), &best, &files, folder)?;
    let markdown = outcome.markdown(&format!("Tuned on {}", args.what.join(", ")));
    drop(claimed);
    let written = write_both(out, &toml, &markdown, may_replace)?;
    match args.search.json {
        true => print_json(&outcome)?,
        false => print(&format!("{outcome}\n{written}\n"))?,
    }
    if was_interrupted {
        bail!("interrupted; the best so far is kept, and the same command with --resume goes on");
    }
    Ok(())
}

/// What is sought, checked against what there is.
fn goal(args: &Args, has_truth: bool) -> anyhow::Result<Goal> {
    let search = &args.search;
    let default = Goal::by_default(has_truth)?;
    let constraints = match &search.subject_to[..] {
        [] => default.constraints.clone(),
        given => given.to_vec(),
    };
    let goal = match (&search.maximize, &search.minimize) {
        (Some(name), _) => Goal::new(name, true, constraints)?,
        (None, Some(name)) => Goal::new(name, false, constraints)?,
        (None, None) => Goal {
            constraints,
            ..default
        },
    };
    if let Some(needs) = goal
        .metrics()
        .find(|metric| metric.against_truth && !has_truth)
    {
        let cure = "take unrivalled or coverage, or judge by another algorithm with --reference";
        return Err(usage::wrong(format!(
            "{} needs a truth, and no pair has one; {cure}",
            needs.name
        )));
    }
    if has_truth && goal.objective.name == "unrivalled" {
        let cure = "where a truth is known, take right";
        return Err(usage::wrong(format!(
            "unrivalled is of pairs without truth; {cure}"
        )));
    }
    if !goal.is_sensible() {
        let name = goal.objective.name;
        tracing::warn!("{name}: is better the other way round");
    }
    Ok(goal)
}

/// What is searched on, and what judges.
struct SearchData {
    training: Vec<HeldRun>,
    test: Vec<HeldRun>,
    /// Why the test says less than it could.
    caution: Option<String>,
    /// The scenario that judges, where it is another.
    tested: Option<Scenario>,
}

impl SearchData {
    fn read(args: &Args, scenario: &Scenario, terminal: &Terminal) -> anyhow::Result<Self> {
        let search = &args.search;
        let tested = match (&search.test[..], &search.test_seeds) {
            ([], None) => None,
            ([], Some(seeds)) => {
                if scenario.options.kind != ScenarioKind::Arena {
                    return Err(usage::wrong(format!(
                        "{}: is not of the arena; --test-seeds is for scenarios that are",
                        args.what[0]
                    )));
                }
                Some(scenario.with(&SourceOptions {
                    seeds: Some(seeds.clone()),
                    ..SourceOptions::default()
                })?)
            }
            // Read as what is searched on, but for seeds and scenes, which are others.
            (named, _) => Some(args.scenario_of(named)?.with(&SourceOptions {
                seeds: None,
                scenes: Vec::new(),
                ..args.source.clone()
            })?),
        };
        let wanted = search.pairs;
        if let Some(tested) = tested {
            let training = parts(scenario, wanted, terminal)?;
            let test = parts(&tested, TEST_PAIRS * wanted, terminal)?;
            refuse_same(&training, &test)?;
            return Ok(Self {
                training,
                test,
                caution: None,
                tested: Some(tested),
            });
        }
        // A part of the runs is held out, or of one run its end, or of scenes every third.
        let mut training = parts(scenario, wanted * 3 / 2, terminal)?;
        let (test, caution) = match &mut training[..] {
            [only] => {
                let frames = std::mem::take(&mut only.frames);
                let are_scenes = frames.iter().all(|frame| frame.name.is_some());
                let is_test = |i: usize| match are_scenes {
                    true => i % 3 == 2,
                    false => i >= frames.len() * 2 / 3,
                };
                let side = |test: bool| {
                    let frames = frames.iter().enumerate();
                    let frames = frames.filter(|(i, _)| is_test(*i) == test);
                    frames
                        .map(|(_, frame)| Arc::clone(frame))
                        .collect::<Vec<_>>()
                };
                let (kept, held_out) = (side(false), side(true));
                let caution = (!are_scenes).then(|| {
                    "The test is the last third of the same recording: it says little of others; \
                     name some with --test."
                        .to_owned()
                });
                let test = HeldRun {
                    name: format!("{}, held out", only.name),
                    seed: only.seed,
                    judge: only.judge.clone(),
                    frames: held_out,
                };
                only.frames = kept;
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

/// Refuses a test on what was searched on.
fn refuse_same(training: &[HeldRun], test: &[HeldRun]) -> anyhow::Result<()> {
    let hashes: std::collections::BTreeSet<_> = training
        .iter()
        .flat_map(|part| part.frames.iter().map(|frame| frame.pair.hash()))
        .collect();
    for part in test {
        if part
            .frames
            .iter()
            .any(|frame| hashes.contains(&frame.pair.hash()))
        {
            let cure = "a test on pairs that were searched on proves nothing: name others";
            return Err(usage::wrong(format!("{}: {cure}", part.name)));
        }
    }
    Ok(())
}

/// About `wanted` pairs of the runs of a scenario, equally many of each.
fn parts(scenario: &Scenario, wanted: usize, terminal: &Terminal) -> anyhow::Result<Vec<HeldRun>> {
    let runs = runs(scenario, terminal)?;
    let count = runs.len().max(1);
    let mut parts = Vec::new();
    for run in runs {
        let (run, judge) = run.open(scenario, terminal, None)?;
        let (seed, mut name) = (run.seed, run.name());
        if let Some(seed) = seed {
            name = format!("{} seed {seed}", scenario.name);
        }
        let each = wanted.div_ceil(count);
        let bar = terminal.bar(&format!("read {name}"), Unit::Pairs, Some(each as u64));
        let sampler = Sampler::new(Box::new(run), each, FRAME_BYTES / count);
        let frames = sampler.read_all(|| {
            bar.step();
            !interrupted()
        });
        drop(bar);
        if interrupted() {
            bail!("interrupted; nothing is written");
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
struct HeldRuns<'a> {
    parts: &'a [HeldRun],
    has_truth: bool,
    bar: Option<Box<dyn Bar>>,
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
        !interrupted()
    }

    /// It has no result then, which is all that matters.
    fn failed(&mut self, _: &str) {}
}

impl HeldRuns<'_> {
    /// The rows per algorithm, of `pairs` spread over all; nothing when interrupted.
    fn rows(&self, algorithms: &[Algorithm], pairs: usize) -> svl::Result<Option<Vec<Vec<Row>>>> {
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
        let mut of_labels = vec![Vec::new(); labels.len()];
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
            let start = RunStart {
                manifest: &manifest,
                log: None,
                seed: part.seed,
                judge: &judge,
            };
            let rows = Outbox::default();
            let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(TableSink::new(None, None, &rows)?)];
            let mut counting = MatchingCount {
                bar: self.bar.as_deref(),
                algorithms: labels.len(),
            };
            let pace = Pace::Measured { rounds: 1 };
            let outcome = evaluate(
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
                    of_labels[place].push(row);
                }
            }
        }
        Ok(Some(of_labels))
    }
}

impl Evaluator for HeldRuns<'_> {
    fn evaluate(
        &mut self,
        algorithms: &[Algorithm],
        pairs: usize,
    ) -> svl::Result<Option<Vec<Option<TrialValues>>>> {
        let rows = self.rows(algorithms, pairs)?;
        let values = |rows: Vec<Row>| {
            let rows: Vec<_> = rows.iter().collect();
            // The median of others depends on who they are.
            let value = |metric: &'static Metric| match metric.name {
                "agreed" => None,
                _ => total(metric, &rows),
            };
            (rows.len() == pairs).then(|| TrialValues::from_fn(value))
        };
        Ok(rows.map(|rows| rows.into_iter().map(values).collect()))
    }
}

/// What became of a search, judged on the test.
fn found(
    space: &Space,
    search: &Search<'_>,
    goal: &Goal,
    training: &[HeldRun],
    test: &[HeldRun],
    has_truth: bool,
    terminal: &Terminal,
) -> anyhow::Result<TunedAlgorithm> {
    let best = search.best().clone();
    let ranked = search.ranked();
    let reference = ranked
        .iter()
        .find(|of| of.algorithm.written() == space.base.written())
        .map(|of| of.values.clone())
        .unwrap_or_default();
    let (_, front) = pareto_front(&ranked, |of, metric| of.values.get(metric));
    // The best first, which a setting that breaks a bound may dominate.
    let is_other = |of: &&&Evaluated| of.algorithm.written() != best.written();
    let first = ranked.first().into_iter();
    let front = first.chain(front.into_iter().filter(is_other)).take(FRONT);
    let front = front
        .map(|of| FrontEntry::new(of, goal, &reference))
        .collect();
    let both = [space.base.clone(), best.clone()];
    let compared = |what: &str, parts: &[HeldRun]| -> anyhow::Result<_> {
        let pairs: usize = parts.iter().map(|part| part.frames.len()).sum();
        if interrupted() || best.written() == space.base.written() || pairs == 0 {
            return Ok((Vec::new(), pairs));
        }
        let title = format!("{what} {}", space.base.label());
        let mut runs = HeldRuns {
            parts,
            has_truth,
            bar: Some(terminal.bar(&title, Unit::Pairs, Some(2 * pairs as u64))),
        };
        let rows = runs.rows(&both, pairs);
        runs.bar = None;
        let changed = rows?.map(|rows| {
            let sides = rows.iter().map(|rows| rows.iter().collect::<Vec<_>>());
            match &sides.collect::<Vec<_>>()[..] {
                [base, other] if base.len() == other.len() => changes(base, other),
                _ => Vec::new(),
            }
        });
        Ok((changed.unwrap_or_default(), pairs))
    };
    let (training, _) = compared("train", training)?;
    let (test, test_pairs) = compared("test", test)?;
    let tried = search.tried();
    Ok(TunedAlgorithm {
        reference: space.base.written(),
        best: best.written(),
        objective: goal.objective.name,
        axes: space.axes.iter().map(ToString::to_string).collect(),
        tried,
        finalists: ranked.len(),
        front,
        training,
        test,
        test_pairs,
    })
}

/// The log of the trials: a row for each setting and number of pairs, written as it is known.
struct TrialLog {
    writer: csv::Writer<std::fs::File>,
    /// What the values depend on: the pairs, and how they are judged.
    key: String,
    /// Of an earlier search: algorithm, setting, pairs.
    known: BTreeMap<(String, String, usize), Option<TrialValues>>,
}

const HEAD: [&str; 5] = ["data", "algorithm", "generation", "pairs", "setting"];

impl TrialLog {
    fn open(
        path: &Path,
        training: &[HeldRun],
        filters: &[Arc<FilterModel>],
        resume: bool,
        logs: Outputs,
    ) -> anyhow::Result<Self> {
        let made = Manifest::new("tune", &[])?;
        let mut words = format!("{} {:?}", made.svl, made.git_revision);
        let filters = filters.iter().map(|filter| filter.hash());
        filters.for_each(|hash| words += &format!(" {hash:x}"));
        for part in training {
            words += &format!("{:?} {:?}", part.judge.grid, part.judge.cells);
            for frame in &part.frames {
                // The same pairs are judged otherwise by another sensor or reference.
                let truth = frame.truth.as_ref().map(Truth::hash);
                words += &format!(" {:x} {truth:x?}", frame.pair.hash());
            }
        }
        let key = svl::manifest::hash(&words)[..12].to_owned();
        let is_there = path.metadata().is_ok_and(|of| of.len() > 0);
        let mut known = BTreeMap::new();
        if resume && is_there {
            let text = std::fs::read(path).with_context(|| path.display().to_string())?;
            // What was being written when the search was killed is no row.
            let whole = text
                .iter()
                .rposition(|byte| *byte == b'\n')
                .map_or(0, |end| end + 1);
            let mut reader = csv::Reader::from_reader(&text[..whole]);
            for record in reader.deserialize() {
                let record: BTreeMap<String, String> =
                    record.with_context(|| format!("{}: is no log", path.display()))?;
                let Some((place, values)) = entry(&record, &key) else {
                    let cure = "remove it, or name another --out";
                    bail!(
                        "{}: is the log of a search on other pairs, or of another svl; {cure}",
                        path.display()
                    );
                };
                known.insert(place, values);
            }
            // It goes on.
            std::fs::OpenOptions::new()
                .write(true)
                .open(path)
                .and_then(|file| file.set_len(whole as u64))
                .with_context(|| path.display().to_string())?;
            logs.keep_both();
        } else {
            if resume {
                tracing::warn!("{}: there is no log to go on from", path.display());
            }
            let mut logs = logs;
            logs.set_aside()?;
            logs.commit();
        }
        let file = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(path)
            .with_context(|| path.display().to_string())?;
        let mut log = Self {
            writer: csv::Writer::from_writer(file),
            key,
            known,
        };
        if !(resume && is_there) {
            let metrics = METRICS.iter().map(|metric| metric.name);
            log.writer.write_record(HEAD.into_iter().chain(metrics))?;
        }
        Ok(log)
    }

    fn known(&self, base: &Algorithm) -> Known {
        let of = self.known.iter();
        let of = of.filter(|((algorithm, _, _), _)| *algorithm == base.written());
        of.map(|((_, setting, pairs), values)| ((setting.clone(), *pairs), values.clone()))
            .collect()
    }

    fn write(&mut self, base: &Algorithm, trial: &LoggedTrial<'_>) -> svl::Result<()> {
        let head = [
            self.key.clone(),
            base.written(),
            trial.generation.to_string(),
            trial.pairs.to_string(),
            trial.setting.to_owned(),
        ];
        let value = |metric| trial.values.and_then(|values| values.get(metric));
        let metrics = METRICS
            .iter()
            .map(|metric| value(metric).map_or(String::new(), |v| v.to_string()));
        let written = self.writer.write_record(head.into_iter().chain(metrics));
        let written = written
            .map_err(std::io::Error::from)
            .and_then(|()| self.writer.flush());
        written.map_err(|error| svl::Error::io("the log of the search", error))
    }
}

/// A row of a log with that key.
fn entry(
    record: &BTreeMap<String, String>,
    key: &str,
) -> Option<((String, String, usize), Option<TrialValues>)> {
    let text = |name: &str| record.get(name).map(String::as_str);
    if text("data")? != key {
        return None;
    }
    let place = (
        text("algorithm")?.to_owned(),
        text("setting")?.to_owned(),
        text("pairs")?.parse().ok()?,
    );
    let value = |metric: &'static Metric| text(metric.name)?.parse().ok();
    let values = TrialValues::from_fn(value);
    let is_failed = values == TrialValues::default();
    Some((place, (!is_failed).then_some(values)))
}

/// Writes a scenario and, beside it, what was tried; says where they are.
pub(super) fn write_both(
    path: &Path,
    toml: &str,
    markdown: &str,
    force: bool,
) -> anyhow::Result<String> {
    usage::ends_in(path, &["toml"]).map_err(usage::wrong)?;
    let page = path.with_extension("md");
    let mut outputs = Outputs::claim(force, [], [path, &page])?;
    outputs.set_aside()?;
    outputs::write(path, toml)?;
    outputs::write(&page, markdown)?;
    outputs.commit();
    Ok(format!("{} and {}", path.display(), page.display()))
}
