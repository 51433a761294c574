//! Training of the network of v5's gaps, with its figures.

use super::learned_cells::TrainingPart;

use crate::fit::{GapEpoch, GapSample, GapSettings, fit_gaps, gap_samples};
use serde::Serialize;
use svl_bench::console::{Console, Unit, Watch};
use svl_bench::pass::{Matchers, frames_through};
use svl_bench::runs::runs;
use svl_bench::sink::{CollectSink, PassStart};
use svl_bench::source::{PairRegister, Source};
use svl_core::filter::ModelFacts;
use svl_core::matcher::{GapSampler, GapWeights};
use svl_core::stereo::FittedTo;
use svl_core::{Error, Result, counted, interrupt};
use svl_score::manifest::Manifest;
use svl_score::scenario::{Scenario, ScenarioSource};

/// Pixels of a frame that are learned from.
const GAP_PIXELS: usize = 300;

/// One of this many runs is held out.
const FOLD: usize = 5;

/// Runs that a network is learned from: names, and pixels of gaps with their truth.
#[derive(Default)]
pub struct LearnedGaps {
    samples: Vec<Vec<GapSample>>,
    register: PairRegister,
}

/// Figures of a training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GapTraining {
    pub runs: usize,
    pub runs_held_out: usize,
    /// Pixels of gaps, and doubtful ones.
    pub pixels: usize,
    pub pixels_held_out: usize,
    pub epochs: Vec<GapEpoch>,
    /// Fraction of the held-out pixels that the fill along the row has within 2 px.
    pub filled_right: f64,
    pub interrupted: bool,
}

/// A trained network.
pub struct LearnedNetwork {
    pub weights: GapWeights,
    pub fitted: FittedTo,
    /// For the model's file.
    pub facts: ModelFacts,
    pub training: GapTraining,
}

impl LearnedGaps {
    /// Adds the gaps of a share of a scenario's runs.
    ///
    /// # Errors
    /// The errors of the runs; [`Error::Invalid`] for frames without truth, [`Error::Usage`] for
    /// recordings that share pairs.
    pub fn learn(
        &mut self,
        scenario: &Scenario,
        share: TrainingPart,
        console: &dyn Console,
    ) -> Result<()> {
        let manifest = Manifest::new(&scenario.name, &[])?;
        let are_scenes = matches!(scenario.source, ScenarioSource::Dataset { .. });
        for (i, run) in runs(scenario, console)?.into_iter().enumerate() {
            if !are_scenes && !share.has(i as u64) {
                continue;
            }
            let (run, judge) = run.open(scenario, console, None)?;
            let mut run = run.registered(&scenario.name, &self.register)?;
            let name = run.title(&scenario.name);
            let mut sampler = GapSampler::new(svl_core::kernel::isa()?)?;
            let frame_samples = CollectSink::new(move |judged| {
                if are_scenes && !share.has(judged.frame.sequence) {
                    return Ok(Vec::new());
                }
                gap_samples(&mut sampler, &judged.frame, GAP_PIXELS)
            });
            let start = PassStart::new(&manifest, run.seed, &judge);
            let watch = Watch::new(console, &format!("gaps of {name}"), run.pairs(), None);
            let collected = frames_through(
                &mut run,
                &mut Matchers::default(),
                &start,
                frame_samples,
                watch,
            )?;
            self.register.refuse_copies()?;
            let samples = collected.into_iter().collect::<Result<Vec<_>>>()?.concat();
            if samples.is_empty() {
                return Err(Error::Invalid(format!(
                    "{name}: has no gaps to learn from: its frames need a truth"
                )));
            }
            self.samples.push(samples);
        }
        Ok(())
    }

    /// Trains with a progress bar, each fifth run held out, of fewer the last; Ctrl-C ends it with
    /// the network so far.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a single run.
    pub fn train(&self, settings: GapSettings, console: &dyn Console) -> Result<LearnedNetwork> {
        let runs = self.samples.len();
        if runs < 2 {
            let cure = "take more seeds, scenes or recordings";
            let message = format!("one run cannot be held out of itself; {cure}");
            return Err(Error::Invalid(message));
        }
        let last = runs.min(FOLD) - 1;
        let is_held = move |run: usize| run % FOLD == last;
        let part = |is_held_out: bool| {
            let runs_of_part = move |(i, _): &(usize, _)| is_held(*i) == is_held_out;
            let runs_of_part = self.samples.iter().enumerate().filter(runs_of_part);
            runs_of_part
                .map(|(_, samples)| samples.clone())
                .collect::<Vec<_>>()
        };
        let (training, held_out) = (part(false).concat(), part(true));
        let runs_held_out = held_out.len();
        let held_out = held_out.concat();
        let bar = console.bar("train network", Unit::Epochs, Some(settings.epochs as u64));
        let mut after = |epoch, error: GapEpoch| {
            bar.set(epoch as u64);
            bar.show(format!("held-out loss {:.4}", error.held_out));
            !interrupt::requested()
        };
        let isa = svl_core::kernel::isa()?;
        let fit = fit_gaps(&training, &held_out, settings, isa, &mut after)?;
        drop(bar);
        let training = GapTraining {
            runs,
            runs_held_out,
            pixels: training.len(),
            pixels_held_out: held_out.len(),
            epochs: fit.epochs,
            filled_right: fit.filled_right,
            interrupted: fit.interrupted,
        };
        Ok(LearnedNetwork {
            weights: GapWeights::rounded(&fit.weights).map_err(Error::other)?,
            fitted: self.register.fitted(|run| !is_held(run)),
            facts: training.facts(settings),
            training,
        })
    }
}

impl GapTraining {
    /// Facts for the model's file.
    fn facts(&self, settings: GapSettings) -> ModelFacts {
        let last = self.epochs.last();
        let loss = last.map_or(f64::NAN, |last| last.held_out);
        let facts = [
            ("svl", env!("CARGO_PKG_VERSION").to_owned()),
            ("seed", settings.seed.to_string()),
            ("epochs", self.epochs.len().to_string()),
            ("held_out_loss", format!("{loss:.4}")),
        ];
        facts.map(|(key, text)| (key.to_owned(), text)).into()
    }
}

impl std::fmt::Display for GapTraining {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Some(last) = self.epochs.last() else {
            return write!(f, "no epoch");
        };
        let (pixels, runs) = (self.pixels + self.pixels_held_out, self.runs as u64);
        writeln!(f, "{pixels} pixels of gaps, {}", counted(runs, "run"))?;
        let pixels = counted(self.pixels_held_out as u64, "pixel");
        let runs = counted(self.runs_held_out as u64, "run");
        writeln!(f, "held out: {pixels} of {runs}")?;
        let epochs = counted(self.epochs.len() as u64, "epoch");
        let (training, held_out) = (last.training, last.held_out);
        writeln!(
            f,
            "loss after {epochs}: {training:.4}, held out {held_out:.4}"
        )?;
        let (right, filled) = (100.0 * last.held_out_right, 100.0 * self.filled_right);
        write!(
            f,
            "within 2 px, held out: {right:.1} %; filled along rows: {filled:.1} %"
        )
    }
}
