//! The runs of a scenario through the algorithms whose results are missing, one after the other.

use super::plan::{ChosenViewer, EvaluationPlan};
use super::run_opener::{OpenedRun, OpeningResult, RunOpener, RunPlace, WantedResults};
use super::session::{EvaluationSession, MeasuredUnits};
use crate::console::{Console, Watch};
use crate::pass::{Matchers, Pace, run_through};
use crate::runs::RECORDINGS;
use crate::sink::{
    PassStart, RerunDetail, RunningTable, SeenPairs, Sink, SinkRequest, Sinks, UnitRequest,
    ViewedScene, ViewerRequest,
};
use crate::source::{RunSource, Source};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use svl_core::inputs::{FileChange, FileStamp};
use svl_core::matcher::Algorithm;
use svl_core::{Error, Result};
use svl_report::units::{RunFacts, RunUnits};
use svl_score::judge::Judge;
use svl_score::manifest::{Manifest, hash};
use svl_score::notice::Notice;
use svl_score::scenario::{PairRange, Scenario, ScenarioSource, WITNESS, witness};

/// Most algorithms that Rerun shows.
const MAX_SHOWN: usize = 32;

/// Limits of the file for Rerun that is written without being asked for, and the mean size of a
/// pixel in it: images are JPEG files, and few pairs have maps.
const MAX_FILE_PAIRS: u64 = 2000;
const MAX_FILE_BYTES: f64 = 200e6;
const BYTES_PER_PIXEL: f64 = 0.5;

/// Matches what is missing of the runs of a scenario.
pub(super) fn measure(plan: &EvaluationPlan<'_>, console: &dyn Console) -> Result<MeasuredUnits> {
    let scenario = plan.scenario;
    let mut matchers =
        Matchers::new(&scenario.algorithms).map_err(|error| match plan.algorithms_file {
            // The file is wrong, not the command line.
            Some(file) => Error::format(file, error.to_string()),
            None => error,
        })?;
    let live = RunningTable::default();
    let opener = RunOpener::new(scenario, console, &live)?;
    warn_of_unstressed(scenario);
    let measured = Pace::Measured {
        rounds: plan.rounds,
    };
    let pace = plan.jobs(console).map_or(measured, Pace::Jobs);
    let mut manifest = plan.manifest(pace)?;
    manifest.runs = opener.records();
    manifest.chain = opener.chain()?;
    for record in &mut manifest.algorithms {
        let mut labels = matchers.with_run_memory();
        record.has_run_memory = labels.any(|label| label == record.label);
    }
    let places = 0..opener.count();
    let runs = plan.stresses();
    let runs = runs.flat_map(|stress| places.clone().map(move |place| (stress, place)));
    let runs: Vec<RunPlace> = runs.collect();
    let keys = runs.iter().map(|run| opener.key(*run)).collect();
    let session = EvaluationSession::open(plan, manifest, keys)?;
    if session.list.witness.is_some() {
        matchers.append(Matchers::new(&[witness()])?.without_warnings());
    }
    let mut work = EvaluationWork {
        plan,
        console,
        session,
        runs,
        run_memory: matchers.with_run_memory().map(str::to_owned).collect(),
        matchers,
        pace,
        opened: opener.opened_files(),
        source: source_digest(&plan.description),
        pairs: SeenPairs::default(),
    };
    work.compare_changed()?;
    work.check_programs()?;
    work.run(opener)
}

/// Digest of the description of a source. Its files are known by what was opened.
fn source_digest(description: &serde_json::Value) -> String {
    let mut source = description["source"].clone();
    if let Some(keys) = source.as_object_mut() {
        keys.remove("files");
        keys.remove("seeds");
    }
    hash(&source.to_string())
}

/// Warns of the maps that others computed, which are not those of perturbed pairs.
fn warn_of_unstressed(scenario: &Scenario) {
    let recorded = scenario.algorithms.iter();
    let recorded = recorded.filter(|a| a.spec().is_recorded());
    let mut labels = recorded.map(Algorithm::label).peekable();
    if !scenario.stress.is_empty() && labels.peek().is_some() {
        let text = "computed before, so perturbed pairs are without: only the unperturbed ones are \
                    scored";
        Notice::new(labels, text).warn();
    }
}

/// The runs of an evaluation.
pub(super) struct EvaluationWork<'a> {
    pub(super) plan: &'a EvaluationPlan<'a>,
    console: &'a dyn Console,
    pub(super) runs: Vec<RunPlace>,
    pub(super) session: EvaluationSession,
    matchers: Matchers,
    /// Algorithms whose results depend on all earlier pairs of a run.
    pub(super) run_memory: BTreeSet<String>,
    pace: Pace,
    /// Per run of the scenario the files that opening it opened.
    opened: Vec<Vec<PathBuf>>,
    /// Digest of the description of the source.
    source: String,
    /// The pairs of the run under way.
    pairs: SeenPairs,
}

impl EvaluationWork<'_> {
    /// A second look at the runs, apart from that of [`EvaluationWork::run`].
    pub(super) fn opener(&self) -> Result<RunOpener<'_>> {
        RunOpener::new(self.plan.scenario, self.console, &RunningTable::default())
    }

    fn are_recordings(&self) -> bool {
        matches!(self.plan.scenario.source, ScenarioSource::Recording(_))
    }

    /// Digest of the pairs that are registered before those of a run.
    fn after(&self, i: usize) -> String {
        let runs = self.runs[..i].iter().zip(&self.session.runs);
        let before = runs.filter(|(run, _)| run.0 == self.runs[i].0 && self.are_recordings());
        let before = before.map(|(_, own)| format!("{:?} {}", own.run, own.facts.inputs()));
        hash(&before.collect::<Vec<_>>().join("\n"))
    }

    /// True if the files of a run are those that were read, so that its pairs are known.
    fn is_known(&self, i: usize) -> bool {
        let facts = &self.session.runs[i].facts;
        // svl's own recording of a simulation is that of its description.
        let is_simulated = matches!(self.plan.scenario.source, ScenarioSource::Arena { .. });
        let is_cached = |path| is_simulated && Path::starts_with(path, RECORDINGS);
        let mut files = facts.files.iter();
        let named: BTreeSet<_> = facts.files.iter().map(FileStamp::path).collect();
        let mut opened = self.opened[self.runs[i].1].iter();
        facts.losses.is_some()
            && facts.source == self.source
            && facts.after == self.after(i)
            && opened.all(|path| named.contains(&**path))
            && files.all(|file| match file.change() {
                FileChange::Unchanged => true,
                FileChange::Recent | FileChange::Gone => is_cached(file.path()),
                FileChange::Changed => false,
            })
    }

    /// Reads the runs again whose files are others than they were, and compares the pairs with
    /// those that results are kept of.
    fn compare_changed(&mut self) -> Result<()> {
        let mut changed = vec![false; self.runs.len()];
        for (i, changed) in changed.iter_mut().enumerate() {
            if !self.is_known(i) {
                *changed = self.session.runs[i].all().next().is_some();
                if !*changed {
                    // With nothing to compare, it is read as it is matched.
                    self.session.runs[i].facts = RunFacts::default();
                }
            }
        }
        self.compare(&changed)
    }

    /// Reads these runs, and with one of several recordings all: a recording has no copies of the
    /// pairs of those before it.
    pub(super) fn compare(&mut self, changed: &[bool]) -> Result<()> {
        if !changed.contains(&true) {
            return Ok(());
        }
        let scenario = self.plan.scenario;
        let mut opener = RunOpener::new(scenario, self.console, &RunningTable::default())?;
        let manifest = self.session.manifest();
        let nothing = RunUnits::default();
        for (i, changed) in changed.iter().enumerate() {
            if !changed && !self.are_recordings() {
                continue;
            }
            let begun = opener.begin(self.runs[i]);
            let mut sinks = self.sinks(None)?;
            let wanted = WantedResults {
                labels: BTreeSet::new(),
                ..self.wanted(i, &nothing)
            };
            let mut matchers = std::mem::take(&mut self.matchers);
            let pass = self.pass(i, begun, &mut matchers, &manifest, &mut sinks, &wanted);
            self.matchers = matchers;
            if pass.interrupted {
                return Err(Error::Interrupted);
            }
            self.session.set_facts(i, pass.facts)?;
        }
        Ok(())
    }

    fn wanted<'u>(&self, i: usize, units: &'u RunUnits) -> WantedResults<'u> {
        let asked = self.session.asked();
        let algorithms = self.session.list.algorithms_of(&self.session.list.runs[i]);
        let labels = algorithms.iter().map(|own| own.label);
        let labels = labels.filter(|label| asked.contains(label) || *label == WITNESS);
        WantedResults {
            units,
            run: i,
            shard: self.plan.shard,
            run_memory: self.run_memory.clone(),
            labels: labels.map(str::to_owned).collect(),
        }
    }

    /// True if results of a run are missing, of this shard.
    fn is_missing(&self, i: usize) -> bool {
        let run = &self.session.runs[i];
        !run.is_read()
            || self
                .wanted(i, run)
                .wants_any(run.blocks(&self.session.list))
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

    /// Leaves out the results of algorithms that depend on all earlier pairs, unless all are there.
    fn keep_whole_memory(&mut self) {
        for run in &mut self.session.runs {
            let blocks = run.blocks(&self.session.list);
            for label in &self.run_memory {
                let is_whole = run.is_read() && run.units(label).count() as u64 == blocks;
                run.retain(|own, _, _| own != label || is_whole);
            }
        }
    }

    /// Matches what is missing.
    fn run(mut self, mut opener: RunOpener<'_>) -> Result<MeasuredUnits> {
        self.keep_whole_memory();
        let read = self.read();
        // The first is opened before anything is written: Ctrl-C until then changes nothing.
        let first = read.first().map(|i| {
            let (notices, opened) = opener.begin(self.runs[*i]);
            opened.map(|opened| (notices, Ok(opened)))
        });
        let first = first.transpose()?;
        self.session.begin()?;
        let Some(first) = first else {
            return Ok(MeasuredUnits {
                ran: Ok(()),
                session: self.session,
                has_matched: false,
            });
        };
        let mut manifest = self.session.manifest();
        self.session.write(&manifest)?;
        let viewer = self.viewer(&read, first.1.as_ref().ok());
        let mut sinks = self.sinks(Some((&manifest, &opener.live, viewer)))?;
        let mut ran = self.read_runs(&read, first, &mut opener, &manifest, &mut sinks);
        // Files may have changed between the look at them and the reading of their pairs.
        self.keep_whole_memory();
        let again = self.read();
        if let (Ok(()), Some(i)) = (&ran, again.first()) {
            let name = self.session.list.runs[*i].words();
            tracing::warn!("{name}: its pairs changed while svl ran; they are matched again");
            let mut opener = RunOpener::new(self.plan.scenario, self.console, &opener.live)?;
            let begun = opener.begin(self.runs[*i]);
            ran = self.read_runs(&again, begun, &mut opener, &manifest, &mut sinks);
        }
        let (_, finished) = sinks.finish();
        self.matchers.complete(&mut manifest);
        self.session.write(&manifest)?;
        if self.plan.shard.is_some() {
            // Other shards wrote theirs.
            (0..self.runs.len()).try_for_each(|i| self.session.reload(i))?;
        }
        Ok(MeasuredUnits {
            ran: ran.and(finished),
            session: self.session,
            has_matched: true,
        })
    }

    /// Scores runs, the first of which is opened, up to the first error.
    fn read_runs(
        &mut self,
        runs: &[usize],
        first: OpeningResult,
        opener: &mut RunOpener<'_>,
        manifest: &Manifest,
        sinks: &mut Sinks,
    ) -> Result<()> {
        let mut first = Some(first);
        for &i in runs {
            let begun = first.take();
            let begun = begun.unwrap_or_else(|| opener.begin(self.runs[i]));
            let mut matchers = std::mem::take(&mut self.matchers);
            let wanted = self.wanted(i, &self.session.runs[i]);
            let pass = self.pass(i, begun, &mut matchers, manifest, sinks, &wanted);
            self.matchers = matchers;
            self.session.store_facts(i, pass.facts)?;
            pass.ran?;
            if pass.interrupted {
                return Err(Error::Invalid(
                    "interrupted; the report has what was scored before, and the same command \
                     continues"
                        .to_owned(),
                ));
            }
        }
        Ok(())
    }

    /// Reads a run through the matchers whose results are wanted.
    fn pass(
        &self,
        i: usize,
        (notices, opened): OpeningResult,
        matchers: &mut Matchers,
        manifest: &Manifest,
        sinks: &mut Sinks,
        wanted: &WantedResults<'_>,
    ) -> PassOutcome {
        let mut pass = PassOutcome {
            facts: RunFacts {
                source: self.source.clone(),
                after: self.after(i),
                ..RunFacts::default()
            },
            interrupted: false,
            ran: Ok(()),
        };
        let entered = notices.enter();
        match opened {
            Err(error) => pass.ran = Err(error),
            Ok(opened) => self.read_run(opened, matchers, manifest, sinks, wanted, &mut pass),
        }
        pass.facts.error = pass.ran.as_ref().err().map(ToString::to_string);
        let algorithms = self.session.list.algorithms_of(&self.session.list.runs[i]);
        drop(entered);
        pass.facts.add_notices(notices.notices(), &algorithms);
        pass
    }

    fn read_run(
        &self,
        opened: OpenedRun,
        matchers: &mut Matchers,
        manifest: &Manifest,
        sinks: &mut Sinks,
        wanted: &WantedResults<'_>,
        pass: &mut PassOutcome,
    ) {
        let OpenedRun {
            source: mut run,
            judge,
            files,
        } = opened;
        let entered = files.enter();
        let start = PassStart {
            wanted: Some(wanted),
            pairs: run.pairs(),
            ..PassStart::new(manifest, run.seed, &judge)
        };
        let title = self.title(&run, &judge);
        let watch = Watch::new(self.console, &title, run.pairs(), None);
        let sinks: &mut [Box<dyn Sink>] = match &judge.run.stress {
            None => sinks.as_mut_slice(),
            Some(_) => sinks.tables_mut(),
        };
        let (outcome, ran) = run_through(&mut run, matchers, &start, self.pace, sinks, watch);
        let is_read = ran.is_ok() && !outcome.interrupted;
        if is_read && self.plan.scenario.options.range() == PairRange::default() {
            run.warn_beyond(&judge);
        }
        drop(entered);
        pass.facts.files = files.stamps();
        pass.facts.pairs = std::mem::take(&mut *self.pairs.lock());
        pass.facts.losses = is_read.then_some(outcome.losses);
        pass.facts.latency.clone_from(&run.latency);
        pass.facts.start_ns = Some(judge.run.start_ns);
        pass.facts.record = run.record;
        (pass.interrupted, pass.ran) = (outcome.interrupted, ran);
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

    /// The viewer of the runs that are read, of which the first is open.
    fn viewer(&self, read: &[usize], first: Option<&OpenedRun>) -> Option<ChosenViewer> {
        // More do not fit into a viewer, nor the file on a disk.
        let is_shown = self.plan.scenario.algorithms.len() <= MAX_SHOWN;
        let viewer = self.plan.viewer.clone().filter(|_| is_shown)?;
        let plain = read.iter().filter(|i| self.runs[**i].0.is_none()).count() as u64;
        let first = first.and_then(|first| Some((first.source.pairs()?, first.source.size?)));
        // All runs are taken for as long as the first.
        let large = first.map(|(pairs, size)| (plain * pairs, size));
        let large = large.filter(|(pairs, size)| is_large(*pairs, *size));
        if let (Some((pairs, _)), RerunDetail::Light) = (large, viewer.2) {
            let line = "no file for Rerun, which would be large";
            let line = format!("{line} ({pairs} pairs); `--rerun FILE.rrd` writes it");
            self.console.note(&line);
            return None;
        }
        Some(viewer)
    }

    /// The sinks of runs: units, and for those that are matched the viewer and the table of the
    /// screen.
    fn sinks(&self, matched: Option<MatchedRuns<'_>>) -> Result<Sinks> {
        let (plan, scenario) = (self.plan, self.plan.scenario);
        let viewer = matched.as_ref().and_then(|(manifest, _, viewer)| {
            let (viewer, target, detail) = viewer.clone()?;
            Some(ViewerRequest {
                viewer,
                target,
                detail,
                info: ViewedScene {
                    // The files of all sessions are one recording.
                    recording_id: self.session.first_id(),
                    ..ViewedScene::new(manifest, scenario.wireframe(None))
                },
            })
        });
        let mut sinks = Sinks::open(SinkRequest {
            report: Some(UnitRequest {
                folder: plan.folder,
                plan: &self.session.list,
                session: self.session.id(),
                pairs: &self.pairs,
            }),
            viewer,
            ..SinkRequest::default()
        })?;
        if let Some((_, live, _)) = matched {
            sinks.push(live.clone());
        }
        Ok(sinks)
    }
}

/// The manifest of runs that are matched, the table of the screen, and the viewer.
type MatchedRuns<'a> = (&'a Manifest, &'a RunningTable, Option<ChosenViewer>);

/// True for a file for Rerun that is too large to be written without being asked for.
fn is_large(pairs: u64, (width, height): (usize, usize)) -> bool {
    let bytes = BYTES_PER_PIXEL * (width * height) as f64 * pairs as f64;
    pairs > MAX_FILE_PAIRS || bytes > MAX_FILE_BYTES
}

/// What came of reading a run.
struct PassOutcome {
    facts: RunFacts,
    interrupted: bool,
    ran: Result<()>,
}

#[cfg(test)]
mod tests {
    use super::is_large;

    #[test]
    fn a_file_for_rerun_is_large_by_its_pairs_or_its_pixels() {
        assert!(!is_large(2000, (320, 240)) && is_large(2001, (320, 240)));
        assert!(!is_large(300, (1280, 960)) && is_large(400, (1280, 960)));
    }
}
