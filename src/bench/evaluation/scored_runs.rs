//! The runs of a scenario through the algorithms whose results are missing, one after the other.

use super::plan::EvaluationPlan;
use super::run_opener::{RunOpener, RunPlace, WantedResults, files_of_runs};
use super::session::{EvaluationSession, MeasuredUnits};
use crate::console::{Console, Watch};
use crate::run::{Matchers, Outcome, Pace, report_losses, run_through};
use crate::runs::warn_of_own_reference;
use crate::sink::{LiveTable, RunInfo, RunStart, SinkRequest, Sinks, UnitRequest, ViewerRequest};
use crate::source::{RunSource, Source};
use std::collections::BTreeSet;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput};
use svl_core::{Error, Result, interrupt};
use svl_report::hash_words;
use svl_report::units::{FileStamp, RunEndFacts, RunFacts, RunWarning};
use svl_score::judge::Judge;
use svl_score::manifest::Manifest;
use svl_score::plausibility::MeasuredScales;
use svl_score::scenario::{PairRange, Scenario, ScenarioSource};

/// Most algorithms that Rerun shows.
const MAX_SHOWN: usize = 32;

/// Matches what is missing of the runs of a scenario.
pub(super) fn measure(plan: &EvaluationPlan<'_>, console: &dyn Console) -> Result<MeasuredUnits> {
    let scenario = plan.scenario;
    let matchers =
        Matchers::new(&scenario.algorithms).map_err(|error| match plan.algorithms_file {
            // The file is wrong, not the command line.
            Some(file) => Error::format(file, error.to_string()),
            None => error,
        })?;
    let live = LiveTable::default();
    let opener = RunOpener::new(scenario, console, &live)?;
    warn_of_own_reference(&scenario.options, &scenario.algorithms)?;
    warn_of_unstressed(scenario);
    let pace = Pace::Measured {
        rounds: plan.rounds,
    };
    let mut manifest = plan.manifest(pace)?;
    manifest.runs = opener.records();
    let places = 0..opener.count();
    let runs: Vec<RunPlace> = plan
        .stresses()
        .flat_map(|stress| places.clone().map(move |place| (stress, place)))
        .collect();
    let keys = runs.iter().map(|run| opener.key(*run)).collect();
    let mut work = RunWork {
        plan,
        console,
        files: files_of_runs(scenario)?,
        session: EvaluationSession::open(plan, manifest, keys, console)?,
        runs,
        matchers,
    };
    work.check_inputs()?;
    work.check_programs()?;
    for run in &mut work.session.runs {
        let labels = work.matchers.with_run_memory();
        labels.for_each(|label| run.forget_partial(label));
    }
    work.run(opener, pace)
}

/// Warns of the maps that others computed, which are not those of perturbed pairs.
fn warn_of_unstressed(scenario: &Scenario) {
    let recorded = scenario
        .algorithms
        .iter()
        .filter(|a| a.spec().is_recorded());
    let labels: Vec<_> = recorded.map(Algorithm::label).collect();
    if !scenario.stress.is_empty() && !labels.is_empty() {
        tracing::warn!(
            "{}: computed before, so perturbed pairs are without: only the unperturbed ones are \
             scored",
            labels.join(", ")
        );
    }
}

/// The runs of an evaluation.
struct RunWork<'a> {
    plan: &'a EvaluationPlan<'a>,
    console: &'a dyn Console,
    runs: Vec<RunPlace>,
    /// Per run of the scenario the files that it reads, as they are.
    files: Vec<Vec<FileStamp>>,
    session: EvaluationSession,
    matchers: Matchers,
}

impl RunWork<'_> {
    /// A second look at the runs, apart from that of [`RunWork::run`].
    fn opener(&self) -> Result<RunOpener<'_>> {
        RunOpener::new(self.plan.scenario, self.console, &LiveTable::default())
    }

    fn are_recordings(&self) -> bool {
        matches!(self.plan.scenario.source, ScenarioSource::Recording(_))
    }

    /// True if the scenario asks for all pairs of its runs.
    fn are_all_pairs(&self) -> bool {
        self.plan.scenario.options.range() == PairRange::default()
    }

    /// The runs whose pairs are registered before those of a run.
    fn before(&self, i: usize) -> Vec<String> {
        let runs = self.runs[..i].iter().zip(&self.session.runs);
        let stressed = runs.filter(|(run, _)| run.0 == self.runs[i].0);
        let names = stressed.map(|(_, run)| run.run.folder());
        names.filter(|_| self.are_recordings()).collect()
    }

    /// Compares the pairs of runs with those that results are kept of, if files are others than
    /// they were.
    fn check_inputs(&mut self) -> Result<()> {
        let is_changed = |i: usize| {
            let facts = self.session.runs[i].facts.as_ref();
            let is_same = |facts: &RunFacts| {
                facts.files == self.files[self.runs[i].1] && facts.after == self.before(i)
            };
            // Results of unknown files are those of unknown pairs.
            let has_results = !self.session.runs[i].kept.seals().is_empty();
            facts.map_or(has_results, |facts| !is_same(facts))
        };
        let changed: Vec<_> = (0..self.runs.len()).map(is_changed).collect();
        if !changed.contains(&true) {
            return Ok(());
        }
        let mut found = Vec::new();
        let mut opener = self.opener()?;
        for (i, is_changed) in changed.into_iter().enumerate() {
            // A recording has no copies of pairs of those before it.
            if is_changed || self.are_recordings() {
                let warned = self.console.begin_warnings();
                let read = read_inputs(opener.open(self.runs[i])?, self.are_all_pairs())?;
                found.push((i, read, self.warnings(warned)));
            }
        }
        drop(opener);
        // Inputs do not have the maps of these.
        let recorded = self.plan.scenario.algorithms.iter();
        for algorithm in recorded.filter(|a| a.spec().is_recorded()) {
            self.session.forget_algorithm(algorithm.label());
        }
        for (i, (inputs, end), warnings) in found {
            let (files, after) = (self.files[self.runs[i].1].clone(), self.before(i));
            self.session.change_run(i, &inputs, |facts| {
                if facts.end != end {
                    facts.warnings.retain(|own| !own.algorithms.is_empty());
                }
                let new = warnings.into_iter();
                new.for_each(|warning| warning.add_to(&mut facts.warnings));
                (facts.files, facts.after, facts.end) = (files, after, end);
            });
        }
        Ok(())
    }

    /// Matches one pair again by each program that results are kept of, and forgets them if its
    /// answer is another: a command may run another program than before.
    fn check_programs(&mut self) -> Result<()> {
        for algorithm in &self.plan.scenario.algorithms {
            if !algorithm.spec().is_program() {
                continue;
            }
            let label = algorithm.label();
            for run in &mut self.session.runs {
                run.kept.forget_failures(label)?;
            }
            let mut runs = self.session.runs.iter().enumerate();
            let first = runs.find_map(|(i, run)| Some((i, run.kept.first_row(label)?)));
            let Some((i, first)) = first else {
                continue;
            };
            let (place, known) = first?;
            let (run, judge) = self.opener()?.open(self.runs[i])?;
            if result_hash(algorithm, run, &judge, place)? != Some(known.result_hash) {
                tracing::warn!(
                    "{label}: its result of pair {} is another than before: all its pairs are \
                     matched again",
                    known.sequence
                );
                self.session.forget_algorithm(label);
            }
        }
        Ok(())
    }

    fn wanted(&self, i: usize) -> WantedResults<'_> {
        WantedResults {
            kept: &self.session.runs[i].kept,
            run: i,
            shard: self.plan.shard,
            run_memory: self.matchers.with_run_memory().map(str::to_owned).collect(),
            labels: self.labels_of(i),
        }
    }

    /// The algorithms that match a run.
    fn labels_of(&self, i: usize) -> BTreeSet<String> {
        let labels = self.session.plan.labels_of(&self.session.runs[i].run);
        labels.into_iter().map(str::to_owned).collect()
    }

    /// True if results of a run are missing, of this shard.
    fn is_missing(&self, i: usize) -> bool {
        let (wanted, run) = (self.wanted(i), &self.session.runs[i].run);
        let labels = self.session.plan.labels_of(run);
        let pairs = self.session.runs[i].pairs();
        pairs.is_none_or(|pairs| (0..pairs).any(|place| wanted.wants_any(place, &labels)))
    }

    /// The runs that are read: those with missing results, and the recordings before them, which
    /// have pairs that later ones may have copies of.
    fn read(&self) -> Vec<usize> {
        let missing: Vec<_> = (0..self.runs.len()).map(|i| self.is_missing(i)).collect();
        let is_before = |i: usize| {
            let mut later = (i..self.runs.len()).filter(|j| self.runs[*j].0 == self.runs[i].0);
            self.are_recordings() && later.any(|j| missing[j])
        };
        let is_read = |i: &usize| missing[*i] || is_before(*i);
        (0..self.runs.len()).filter(is_read).collect()
    }

    /// Matches what is missing.
    fn run(mut self, mut opener: RunOpener<'_>, pace: Pace) -> Result<MeasuredUnits> {
        let read = self.read();
        // The first is opened before anything is written: Ctrl-C until then changes nothing.
        let mut warned = self.console.begin_warnings();
        let first = read.first().map(|i| opener.open(self.runs[*i]));
        let mut first = first.transpose()?;
        self.session.begin()?;
        if read.is_empty() {
            return Ok(MeasuredUnits {
                ran: Ok(()),
                session: None,
            });
        }
        let mut manifest = self.session.manifest();
        self.session.write(&manifest)?;
        let mut sinks = self.sinks(&manifest, opener.live())?;
        let mut ran = Ok(());
        for i in read {
            if first.is_none() {
                warned = self.console.begin_warnings();
            }
            ran = self.take(
                i,
                first.take(),
                &mut opener,
                &manifest,
                &mut sinks,
                pace,
                warned,
            );
            if ran.is_err() {
                break;
            }
        }
        let (_, finished) = sinks.finish();
        self.matchers.complete(&mut manifest);
        self.session.write(&manifest)?;
        Ok(MeasuredUnits {
            ran: ran.and(finished),
            session: Some(self.session.id().to_owned()),
        })
    }

    /// Scores a run, and writes its facts.
    #[expect(clippy::too_many_arguments)]
    fn take(
        &mut self,
        i: usize,
        opened: Option<(RunSource, Judge)>,
        opener: &mut RunOpener<'_>,
        manifest: &Manifest,
        sinks: &mut Sinks,
        pace: Pace,
        warned: usize,
    ) -> Result<()> {
        // Its files are known before its results come.
        self.session.units.write_facts(&self.begun(i)?)?;
        let (mut run, judge) = match opened.map_or_else(|| opener.open(self.runs[i]), Ok) {
            Ok(opened) => opened,
            Err(error) => {
                self.write_facts(i, None, Some(error.to_string()), warned)?;
                return Err(error);
            }
        };
        let mut matchers = std::mem::replace(&mut self.matchers, Matchers::none());
        let wanted = WantedResults {
            kept: &self.session.runs[i].kept,
            run: i,
            shard: self.plan.shard,
            run_memory: matchers.with_run_memory().map(str::to_owned).collect(),
            labels: self.labels_of(i),
        };
        let start = RunStart {
            wanted: Some(&wanted),
            ..RunStart::new(manifest, run.seed, &judge)
        };
        let title = self.title(&run, &judge);
        let watch = Watch::new(self.console, &title, run.pairs(), Some(opener.live()));
        let stress = match &judge.run.stress {
            None => sinks.as_mut_slice(),
            Some(_) => sinks.tables_mut(),
        };
        let (outcome, ran) = run_through(&mut run, &mut matchers, &start, pace, stress, watch);
        self.matchers = matchers;
        if outcome.interrupted {
            ran?;
            return Err(Error::Invalid(
                "interrupted; the report has what was scored before, and the same command \
                 continues"
                    .to_owned(),
            ));
        }
        let end = ran.is_ok().then_some((&run, &outcome));
        if end.is_some() && self.are_all_pairs() {
            run.warn_beyond(&judge);
        }
        let error = ran.as_ref().err().map(ToString::to_string);
        self.write_facts(i, end, error, warned)?;
        ran
    }

    fn title(&self, run: &RunSource, judge: &Judge) -> String {
        let title = match run.seed {
            Some(seed) => format!("score {}, seed {seed}", self.plan.scenario.name),
            None => format!("score {}", run.name()),
        };
        match &judge.run.stress {
            Some(stress) => format!("{title}, {stress}"),
            None => title,
        }
    }

    fn sinks(&self, manifest: &Manifest, live: &LiveTable) -> Result<Sinks> {
        let (plan, scenario) = (self.plan, self.plan.scenario);
        let sessions = self.session.units.sessions()?;
        let first = sessions.first().map(|first| first.manifest.run_id.clone());
        let info = RunInfo {
            // The files of all sessions are one recording.
            recording_id: first.unwrap_or_default(),
            ..RunInfo::new(manifest, scenario.wireframe(None))
        };
        // More do not fit into a viewer, nor the file on a disk.
        let viewer = plan.viewer.clone();
        let viewer = viewer.filter(|_| scenario.algorithms.len() <= MAX_SHOWN);
        let mut sinks = Sinks::open(SinkRequest {
            report: Some(UnitRequest {
                folder: plan.folder,
                plan: &self.session.plan,
                session: self.session.id(),
            }),
            viewer: viewer.map(|(viewer, target, detail)| ViewerRequest {
                viewer,
                target,
                detail,
                info,
            }),
            ..SinkRequest::default()
        })?;
        sinks.push(live.clone());
        Ok(sinks)
    }

    /// The warnings of a run since there were so many.
    fn warnings(&self, warned: usize) -> Vec<RunWarning> {
        let labels = self.session.plan.labels();
        let new = self.console.warnings().split_off(warned).into_iter();
        new.filter_map(|text| RunWarning::new(text, &labels))
            .collect()
    }

    /// The facts of a run as they are known before it is read.
    fn begun(&self, i: usize) -> Result<RunFacts> {
        let run = &self.session.runs[i].run;
        Ok(match self.session.units.facts(run)? {
            Some(known) => known,
            None => RunFacts {
                run: run.clone(),
                record: None,
                files: self.files[self.runs[i].1].clone(),
                end: None,
                error: None,
                warnings: Vec::new(),
                scales: MeasuredScales::default(),
                latency: Vec::new(),
                after: self.before(i),
            },
        })
    }

    /// Writes the facts of a run that was read: to its end, or up to an error.
    fn write_facts(
        &self,
        i: usize,
        end: Option<(&RunSource, &Outcome)>,
        error: Option<String>,
        warned: usize,
    ) -> Result<()> {
        let mut facts = self.begun(i)?;
        let new = self.warnings(warned).into_iter();
        new.for_each(|warning| warning.add_to(&mut facts.warnings));
        facts.error = error;
        if let Some((run, outcome)) = end {
            let kept = &self.session.runs[i].kept;
            let scales = &mut facts.scales;
            scales.algorithms.retain(|label, _| kept.count(label) > 0);
            scales.origin.clone_from(&outcome.scales.origin);
            for (label, scale) in &outcome.scales.algorithms {
                scales.algorithms.entry(label.clone()).or_insert(*scale);
            }
            facts.end = Some(RunEndFacts {
                pairs: outcome.frames,
                inputs: run.inputs(),
                losses: outcome.losses.clone(),
            });
            facts.record = run.record.clone();
            facts.latency.clone_from(&run.latency);
        }
        self.session.units.write_facts(&facts)
    }
}

/// The input hash of each pair of a run, and its end; none if a pair cannot be read, which is
/// reported when it is scored.
fn read_inputs(
    (mut run, judge): (RunSource, Judge),
    are_all: bool,
) -> Result<(Vec<String>, Option<RunEndFacts>)> {
    let mut inputs = Vec::new();
    let read = loop {
        match run.next() {
            Ok(Some(frame)) => inputs.push(hash_words(frame.input_hash(frame.pair.hash()))),
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
        if interrupt::requested() {
            return Err(Error::Interrupted);
        }
    };
    if read.is_err() {
        return Ok((inputs, None));
    }
    let losses = run.finish(inputs.len() as u64);
    report_losses(&run.name(), &losses);
    if are_all {
        run.warn_beyond(&judge);
    }
    let end = RunEndFacts {
        pairs: inputs.len() as u64,
        inputs: run.inputs(),
        losses,
    };
    Ok((inputs, Some(end)))
}

/// The hash of an algorithm's result of the pair at `place` of a run; none if it fails.
fn result_hash(
    algorithm: &Algorithm,
    mut run: RunSource,
    judge: &Judge,
    place: u64,
) -> Result<Option<String>> {
    let mut frame = run.next()?;
    for _ in 0..place {
        frame = run.next()?;
    }
    let Some(frame) = frame else {
        return Ok(None);
    };
    let (mut matcher, mut output) = (algorithm.build()?, MatchOutput::new()?);
    let context = MatchContext::for_frame(&frame, judge.grid, judge.cells);
    output.begin();
    let matched = matcher.compute(frame.rectified()?, &context, &mut output);
    Ok(matched.is_ok().then(|| {
        let hash = output.disparity.hash();
        hash_words(output.grid.as_ref().map_or(hash, |grid| grid.hash(hash)))
    }))
}
