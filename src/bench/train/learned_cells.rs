//! Cells of scenarios that the table of v5 is learned from.

use crate::console::{Console, Watch};
use crate::run::{Matchers, frames_through};
use crate::runs::runs;
use crate::sink::{CollectSink, RunStart};
use crate::source::{PairRegister, Source};
use std::path::Path;
use svl_core::depth::decision::Feature;
use svl_core::matcher::Algorithm;
use svl_core::stereo::{CellEvidence, FittedTo};
use svl_core::{Error, Result};
use svl_data::fit::{CellFit, CellSample, CellTarget, FOLDS, cell_samples, fit_cells};
use svl_data::manifest::Manifest;
use svl_data::scenario::{Scenario, ScenarioSource};

/// The cells of all scenarios.
#[derive(Default)]
pub struct LearnedCells {
    pub samples: Vec<CellSample>,
    /// Runs and scenes.
    pub groups: Vec<String>,
    pub scenarios: Vec<LearnedScenario>,
    register: PairRegister,
    /// By registered run: true if it is no part of the fit.
    tested_runs: Vec<bool>,
}

/// A scenario's part of the samples.
#[derive(Clone, Debug)]
pub struct LearnedScenario {
    pub name: String,
    /// That of [`Scenario::kind`].
    pub kind: String,
    /// Number of its samples.
    pub cells: usize,
    /// True if they are no part of the fit.
    pub tested: bool,
}

impl LearnedCells {
    /// Adds the cells of a scenario, which is in the file at `path`, through an algorithm.
    ///
    /// # Errors
    /// Those of the runs; [`Error::Invalid`] for a scenario without cells to learn from,
    /// [`Error::Usage`] for recordings that share pairs.
    pub fn learn(
        &mut self,
        mut scenario: Scenario,
        path: &Path,
        algorithm: &Algorithm,
        target: CellTarget,
        tested: bool,
        console: &dyn Console,
    ) -> Result<()> {
        scenario.algorithms = vec![algorithm.clone()];
        let mut matchers = Matchers::new(&scenario.algorithms)?.without_warnings();
        let manifest = Manifest::new(&scenario.name, &scenario.algorithms)?;
        let before = self.samples.len();
        let are_scenes = matches!(scenario.source, ScenarioSource::Dataset { .. });
        for run in runs(&scenario, console)? {
            let (run, judge) = run.open(&scenario, console, None)?;
            let mut run = run.registered(&scenario.name, &self.register, true);
            self.tested_runs.push(tested);
            let of_frame = CollectSink::new(move |judged| {
                let samples = cell_samples(judged, target, 0);
                (judged.frame.name.clone(), samples)
            });
            let start = RunStart::new(&manifest, run.seed, &judge);
            // The same walk in another arena is not another scene.
            let of_seed = run
                .seed
                .map(|seed| format!("{} seed {seed}", scenario.kind()));
            let recording = run.record.as_ref().map(|record| record.path.clone());
            let name = of_seed.or(recording).unwrap_or_else(|| run.name());
            let title = format!("learn {}, {name}", scenario.name);
            let watch = Watch::new(console, &title, run.pairs(), None);
            let collected = frames_through(&mut run, &mut matchers, &start, of_frame, watch)?;
            // Held out in one place, they would be fitted to in the other.
            self.register.refuse_copies()?;
            for (scene, samples) in collected {
                // The pairs of a recording resemble each other, whatever their names.
                let scene = scene.filter(|_| are_scenes);
                let group = self.group(scene.unwrap_or_else(|| name.clone()));
                let samples = samples.into_iter();
                self.samples
                    .extend(samples.map(|sample| CellSample { group, ..sample }));
            }
        }
        let cells = self.samples.len() - before;
        if !self.samples[before..].iter().any(CellSample::is_reportable) {
            return Err(Error::Invalid(format!(
                "{}: has no cells to learn from; frames need a truth",
                path.display()
            )));
        }
        self.scenarios.push(LearnedScenario {
            kind: scenario.kind().to_owned(),
            name: scenario.name,
            cells,
            tested,
        });
        Ok(())
    }

    /// Number of samples to fit to: those of scenarios that are only tested come after them.
    pub fn fitted(&self) -> usize {
        self.fitted_scenarios().map(|scenario| scenario.cells).sum()
    }

    /// Fits a table to them.
    ///
    /// The weight of a scenario is the square root of its number of cells, so that few real scenes
    /// count beside many simulated ones. `None` and `progress` as of [`fit_cells`].
    pub fn fit(&self, rank: i64, progress: impl Fn() -> bool + Sync) -> Option<CellFit> {
        let (fitted, kinds) = (self.fitted(), self.kinds());
        let mut kind_of = Vec::with_capacity(fitted);
        let mut weights = Vec::with_capacity(fitted);
        for scenario in self.fitted_scenarios() {
            let kind = kinds.iter().position(|kind| *kind == scenario.kind);
            kind_of.extend(std::iter::repeat_n(kind.unwrap_or(0), scenario.cells));
            let weight = 1.0 / (scenario.cells as f64).sqrt();
            weights.extend(std::iter::repeat_n(weight, scenario.cells));
        }
        // The weights sum to the number of samples, so that the ridge's influence stays small.
        let scale = fitted as f64 / weights.iter().sum::<f64>();
        weights.iter_mut().for_each(|weight| *weight *= scale);
        fit_cells(&self.samples[..fitted], &kind_of, &weights, rank, progress)
    }

    /// Number of fits that [`LearnedCells::fit`] reports.
    pub fn fits(&self) -> usize {
        let kinds = self.kinds().len();
        FOLDS + 1 + if kinds > 1 { kinds } else { 0 }
    }

    /// The runs that were fitted to, with their pairs.
    pub fn fitted_to(&self) -> FittedTo {
        self.register.fitted(|run| !self.tested_runs[run])
    }

    fn fitted_scenarios(&self) -> impl Iterator<Item = &LearnedScenario> {
        self.scenarios.iter().filter(|scenario| !scenario.tested)
    }

    /// The kinds of the scenes that are fitted to.
    pub(super) fn kinds(&self) -> Vec<&str> {
        let mut kinds: Vec<_> = self.fitted_scenarios().map(|of| of.kind.as_str()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        kinds
    }

    fn group(&mut self, name: String) -> usize {
        let known = self.groups.iter().position(|group| *group == name);
        known.unwrap_or_else(|| {
            self.groups.push(name);
            self.groups.len() - 1
        })
    }
}
/// The samples as CSV: run or scene, the evidence, whether the cell was right and known.
///
/// # Errors
/// [`Error::Invalid`] with the error of the csv crate.
pub fn samples_csv(samples: &[CellSample], groups: &[String]) -> Result<Vec<u8>> {
    let invalid = |e: csv::Error| Error::Invalid(e.to_string());
    let mut csv = csv::Writer::from_writer(Vec::new());
    let head = ["group", "report", "target"];
    csv.write_record(
        head.into_iter()
            .chain(Feature::ALL.map(Feature::name))
            .chain(["right", "known"]),
    )
    .map_err(invalid)?;
    for sample in samples {
        let numbers = |evidence: CellEvidence| {
            [evidence.report, evidence.target]
                .into_iter()
                .chain(evidence.features)
        };
        let text = |n: i64| match n {
            CellEvidence::NOT_MEASURED => String::new(),
            n => n.to_string(),
        };
        let numbers: Vec<_> = match sample.evidence {
            Some(evidence) => numbers(evidence).map(text).collect(),
            None => vec![String::new(); 2 + Feature::ALL.len()],
        };
        let ends = [sample.right, sample.known].map(|is| u8::from(is).to_string());
        let group = std::iter::once(groups[sample.group].clone());
        csv.write_record(group.chain(numbers).chain(ends))
            .map_err(invalid)?;
    }
    csv.into_inner().map_err(|e| Error::Invalid(e.to_string()))
}
