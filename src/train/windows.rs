//! Labelled windows of runs, and the training of filters on them.

use super::{FilterTraining, TrainSettings, train_filter};
use crate::fit::filter::{
    EpochError, FitSettings, FrameLabels, SamplePart, WindowLabels, WindowSamples,
};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use svl_bench::console::{Console, Unit, Watch};
use svl_bench::pass::{Matchers, frames_through};
use svl_bench::runs::{ScoredSource, runs};
use svl_bench::sink::{CollectSink, PassStart};
use svl_bench::source::{PairRegister, Source};
use svl_core::filter::{Features, FilterKind, FilterModel, Spectrum};
use svl_core::stereo::FittedTo;
use svl_core::{Error, Result, interrupt};
use svl_score::judge::Judged;
use svl_score::manifest::Manifest;
use svl_score::scenario::Scenario;

/// Runs that are labelled in one way.
pub struct LabelledInputs {
    scenario: Scenario,
    runs: Vec<ScoredSource>,
    /// Labels of a person, with the recording; else those by the truth.
    labels: Option<(PathBuf, FrameLabels)>,
}

impl LabelledInputs {
    /// Opens the runs of a scenario.
    pub fn open(
        scenario: Scenario,
        labels: Option<(PathBuf, FrameLabels)>,
        console: &dyn Console,
    ) -> Result<Self> {
        Ok(Self {
            runs: runs(&scenario, console)?,
            scenario,
            labels,
        })
    }
}

/// The windows of all runs, and the runs that a filter of them is fitted to. `range_px` is the
/// range of disparities.
pub fn windows(
    kind: FilterKind,
    range_px: f64,
    labelled: Vec<LabelledInputs>,
    console: &dyn Console,
) -> Result<(WindowSamples, FittedTo)> {
    let features = kind.spec().features;
    let recordings = labelled.iter().map(|own| own.runs.len()).sum();
    let mut samples = WindowSamples::new(kind, features, SamplePart::deal(recordings));
    let register = PairRegister::default();
    let mut group = 0;
    for own in labelled {
        let (scenario, labels) = (own.scenario, own.labels);
        let mut frames = BTreeSet::new();
        for run in own.runs {
            let (run, judge) = run.open(&scenario, console, None)?;
            let mut run = run.registered(&scenario.name, &register)?;
            let name = run.title(&scenario.name);
            let manifest = Manifest::new(&scenario.name, &[])?;
            let read = (features, range_px);
            let look = frame_windows(read, group, labels.clone(), samples.empty());
            let sink = CollectSink::new(look);
            let start = PassStart::new(&manifest, run.seed, &judge);
            let watch = Watch::new(console, &format!("windows of {name}"), run.pairs(), None);
            let collected =
                frames_through(&mut run, &mut Matchers::default(), &start, sink, watch)?;
            // Training and test are never on the same pairs.
            register.refuse_copies()?;
            let before = samples.samples.len();
            for frame_samples in collected {
                let (sequence, frame_samples) =
                    frame_samples.map_err(|e| Error::Invalid(format!("{name}: {e}")))?;
                frames.insert(sequence);
                samples.append(frame_samples);
            }
            if samples.samples.len() == before && labels.is_none() {
                return Err(Error::Invalid(format!(
                    "{name}: its truth does not label windows: only the arena knows what is \
                     {}; `svl label windows` labels them by hand",
                    kind.spec().categories[0]
                )));
            }
            group += 1;
        }
        if let Some((path, labels)) = labels {
            check_frames(&path, &labels, &frames)?;
        }
    }
    let is_fitted = |run: usize| samples.parts[run] != SamplePart::Test;
    let fitted = register.fitted(is_fitted);
    Ok((samples, fitted))
}

/// # Errors
/// If a table labels a frame that the recording next to it does not have.
fn check_frames(path: &Path, labels: &FrameLabels, frames: &BTreeSet<u64>) -> Result<()> {
    let mut sequences = labels.sequences();
    let Some(sequence) = sequences.find(|sequence| !frames.contains(sequence)) else {
        return Ok(());
    };
    let (table, path) = (labels.path.display(), path.display());
    Err(Error::Invalid(format!(
        "{table}: labels frame {sequence}, which {path} does not have"
    )))
}

/// The windows of each frame, with its number; `empty`: samples without windows.
fn frame_windows(
    (features, range_px): (Features, f64),
    group: usize,
    labels: Option<(PathBuf, FrameLabels)>,
    empty: WindowSamples,
) -> impl FnMut(&Judged) -> Result<(u64, WindowSamples)> + Send {
    let mut spectrum = Spectrum::new(features.window);
    move |judged| {
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
    }
}

/// Trains with a progress bar; Ctrl-C ends it with the best network so far.
pub fn train(
    samples: &mut WindowSamples,
    fitted: &FittedTo,
    settings: &TrainSettings,
    console: &dyn Console,
) -> Result<(FilterModel, FilterTraining)> {
    let networks = settings.hidden.len() * settings.seeds.len();
    let title = format!("train {}", samples.kind);
    let bar = console.bar(
        &title,
        Unit::Epochs,
        Some((networks * settings.most_epochs) as u64),
    );
    let mut network = 0;
    let mut after = |fit: FitSettings, epoch, errors: EpochError| {
        network += usize::from(epoch == 1);
        let done = (network - 1) * settings.most_epochs + epoch;
        bar.set(done as u64);
        bar.show(format!("{} neurons: {:.4}", fit.hidden, errors.validation));
        !interrupt::requested()
    };
    let isa = svl_core::kernel::isa()?;
    let (mut model, training) = train_filter(samples, settings, isa, &mut after)?;
    model.facts.extend(fitted.facts());
    Ok((model, training))
}
