//! Labelled windows of runs, and the training of filters on them.

use super::progress::{EpochBar, Progress, interrupted};
use super::runner;
use super::scenario_runs::{ScoredSource, runs};
use anyhow::{Context, bail};
use std::collections::BTreeSet;
use std::path::PathBuf;
use svl::filter::{Features, FilterKind, FilterModel, Spectrum};
use svl::fit::filter::{
    EpochError, FitSettings, FrameLabels, SamplePart, WindowLabels, WindowSamples,
};
use svl::manifest::Manifest;
use svl::run::{Matchers, Pace};
use svl::scenario::Scenario;
use svl::sink::{CollectSink, RunStart, Sink};
use svl::source::Source;
use svl::train::{FilterTraining, TrainSettings, train_filter};

/// Runs that are labelled in one way.
pub(crate) struct LabelledRuns {
    scenario: Scenario,
    runs: Vec<ScoredSource>,
    /// A person's, with the recording; else the truth labels.
    labels: Option<(PathBuf, FrameLabels)>,
}

impl LabelledRuns {
    /// Opens the runs of a scenario.
    pub(crate) fn open(
        scenario: Scenario,
        labels: Option<(PathBuf, FrameLabels)>,
        quiet: bool,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            runs: runs(&scenario, quiet)?,
            scenario,
            labels,
        })
    }
}

/// The windows of all runs, and the runs' names. `range_px` is the range of disparities.
pub(crate) fn windows(
    kind: FilterKind,
    features: Features,
    range_px: f64,
    labelled: Vec<LabelledRuns>,
    quiet: bool,
) -> anyhow::Result<(WindowSamples, Vec<String>)> {
    let recordings = labelled.iter().map(|of| of.runs.len()).sum();
    let mut samples = WindowSamples::new(kind, features, SamplePart::deal(recordings));
    let mut names = Vec::new();
    for of in labelled {
        let LabelledRuns {
            scenario,
            runs,
            labels,
        } = of;
        let mut frames = BTreeSet::new();
        for run in runs {
            let (mut run, judge) = run.open(&scenario, quiet, None)?;
            let name = match run.seed {
                Some(seed) => format!("{} seed {seed}", scenario.name),
                None => run.name(),
            };
            let manifest = Manifest::new(&scenario.name, &[])?;
            let group = names.len();
            let of_frame = {
                let (mut spectrum, empty) = (Spectrum::new(features.window), samples.empty());
                let labels = labels.clone();
                CollectSink::new(move |judged| {
                    let (mut samples, frame) = (empty.clone(), &judged.frame);
                    let labels = match &labels {
                        Some((path, labels)) => {
                            labels.check(path, frame.sequence, || judged.pair_hash())?;
                            WindowLabels::Given(labels)
                        }
                        None => WindowLabels::Truth { range_px },
                    };
                    let added = samples.add(&mut spectrum, frame, group, &labels);
                    added.map(|()| (frame.sequence, samples))
                })
            };
            let collected = of_frame.outbox();
            let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(of_frame)];
            let start = RunStart {
                manifest: &manifest,
                log: None,
                seed: run.seed,
                judge: &judge,
            };
            let progress = Progress::new(&format!("windows of {name}"), run.pairs(), quiet);
            let (mut none, pace) = (Matchers::none(), Pace::Asap);
            let (_, ran) =
                runner::run_through(&mut run, &mut none, &start, pace, &mut sinks, progress);
            ran?;
            sinks.drain(..).try_for_each(Sink::finish)?;
            if interrupted() {
                bail!("interrupted; nothing is written");
            }
            let before = samples.samples.len();
            for of_frame in collected.take() {
                let (sequence, of_frame) = of_frame.with_context(|| name.clone())?;
                frames.insert(sequence);
                samples.append(of_frame);
            }
            if samples.samples.len() == before && labels.is_none() {
                bail!(
                    "{name}: its truth does not label windows: only the arena knows what is \
                     {}; `svl label windows` lets a person say it",
                    kind.spec().categories[0]
                );
            }
            names.push(name);
        }
        if let Some((path, labels)) = labels
            && let Some(sequence) = labels.sequences().find(|of| !frames.contains(of))
        {
            let table = FrameLabels::path(&path, kind);
            let (table, path) = (table.display(), path.display());
            bail!("{table}: labels frame {sequence}, which {path} does not have");
        }
    }
    Ok((samples, names))
}

/// Trains with a progress bar; Ctrl-C ends it with the best network so far.
pub(crate) fn train(
    samples: &mut WindowSamples,
    settings: &TrainSettings,
    quiet: bool,
) -> anyhow::Result<(FilterModel, FilterTraining)> {
    let networks = settings.hidden.len() * settings.seeds.len();
    let title = format!("train {}", samples.kind);
    let bar = EpochBar::new(&title, networks, settings.most_epochs, quiet);
    let mut network = 0;
    let mut after = |fit: FitSettings, epoch, errors: EpochError| {
        network += usize::from(epoch == 1);
        let done = (network - 1) * settings.most_epochs + epoch;
        bar.step(done, fit.hidden, errors.validation)
    };
    let isa = svl::kernel::isa()?;
    let trained = train_filter(samples, settings, isa, &mut after);
    bar.clear();
    Ok(trained?)
}
