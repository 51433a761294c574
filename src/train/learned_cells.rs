//! Cells of scenarios that the tables of v5 are learned from.

use crate::fit::{
    CellFit, CellSample, CellSequence, CellTarget, PairCell, PairCells, fit_cells, pair_cells,
};
use std::collections::BTreeSet;
use std::path::Path;
use std::slice::from_ref;
use svl_bench::console::{Console, Watch};
use svl_bench::pass::{Matchers, frames_through};
use svl_bench::runs::runs;
use svl_bench::sink::{CollectSink, PassStart};
use svl_bench::source::{PairRegister, Source};
use svl_core::depth::decision::{DECIDES, SafeChoice, VerdictTable};
use svl_core::matcher::{Algorithm, V5Model};
use svl_core::stereo::FittedTo;
use svl_core::{Error, Result};
use svl_score::manifest::Manifest;
use svl_score::scenario::{Scenario, ScenarioSource};

/// A part of a scenario's runs, or of the scenes of a data set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrainingPart {
    All,
    /// Two of three, for the network.
    Network,
    /// The others, for the tables: on its own runs a network looks better than it is.
    Tables,
}

impl TrainingPart {
    pub(super) fn has(self, number: u64) -> bool {
        match self {
            Self::All => true,
            Self::Network => number % 3 != 2,
            Self::Tables => number % 3 == 2,
        }
    }
}

/// The algorithms whose cells are learned: v5 for the median, for the nearest quarter, and the
/// latter with the table for nearer surfaces.
pub struct CellAlgorithms {
    pub median: Algorithm,
    pub near: Algorithm,
    pub surface: Algorithm,
}

/// A table, by the images and cells that it is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TableRole {
    /// Images that are decided at their own size alone.
    Single,
    /// The finest size of images that are decided at several, the sizes between, the coarsest.
    Finest,
    Middle,
    Coarsest,
    /// Cells of few pixels, at any size.
    Small,
    /// Their nearer surfaces.
    NearSmall,
}

impl TableRole {
    /// Each role, in the order in which the tables are fitted: finer ones decide first.
    pub const ALL: [Self; 6] = [
        Self::Single,
        Self::Finest,
        Self::Middle,
        Self::Coarsest,
        Self::Small,
        Self::NearSmall,
    ];

    /// The role of a level, of that many, for cells of the usual size.
    fn for_level(level: usize, levels: usize) -> Self {
        if levels == 1 {
            Self::Single
        } else if level + 1 == levels {
            Self::Coarsest
        } else if level == 0 {
            Self::Finest
        } else {
            Self::Middle
        }
    }

    /// The images or cells that it is for.
    pub fn words(self) -> &'static str {
        match self {
            Self::Single => "images of one size",
            Self::Finest => "finest size of several",
            Self::Middle => "sizes between",
            Self::Coarsest => "coarsest size of several",
            Self::Small => "small cells",
            Self::NearSmall => "nearer surfaces of small cells",
        }
    }

    /// The table of a model for it.
    pub fn table(self, model: &V5Model) -> &VerdictTable {
        match self {
            Self::Single => &model.median,
            Self::Finest => &model.levels.finest,
            Self::Middle => &model.levels.middle,
            Self::Coarsest => &model.levels.coarsest,
            Self::Small => &model.levels.small,
            Self::NearSmall => model.near_small.as_ref().unwrap_or(&model.near),
        }
    }

    /// The table of a model for it, to be replaced.
    pub(super) fn table_mut(self, model: &mut V5Model) -> &mut VerdictTable {
        match self {
            Self::Single => &mut model.median,
            Self::Finest => &mut model.levels.finest,
            Self::Middle => &mut model.levels.middle,
            Self::Coarsest => &mut model.levels.coarsest,
            Self::Small => &mut model.levels.small,
            Self::NearSmall => model.near_small.get_or_insert_with(|| model.near.clone()),
        }
    }
}

/// A cell with a truth.
struct LearnedCell {
    /// Place of its scenario.
    scenario: usize,
    /// The role of its table, unless that depends on the level: of a cell of few pixels.
    role: Option<TableRole>,
    /// The decisions at each size; `None` for a report that failed a test.
    levels: Vec<Option<CellSample>>,
}

/// The cells of all scenarios.
#[derive(Default)]
pub struct LearnedCells {
    /// By the median of a cell, and small ones once more by their nearer surface.
    cells: Vec<LearnedCell>,
    /// By the nearest quarter, with their weights, of the scenarios that are fitted to.
    near: (Vec<CellSample>, Vec<f64>),
    /// The runs that are fitted to and whose pairs follow each other.
    pub runs: Vec<CellSequence>,
    /// Runs and scenes.
    groups: Vec<String>,
    scenarios: Vec<LearnedScenario>,
    register: PairRegister,
    /// By registered run: true if it is no part of the fit.
    tested_runs: Vec<bool>,
}

/// The samples of a table, by scenario: those that are only tested come last.
#[derive(Default)]
pub struct TableSamples {
    pub samples: Vec<CellSample>,
    pub scenarios: Vec<LearnedScenario>,
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
    /// Adds the cells of a share of the runs of a scenario, which is in the file at `path`.
    ///
    /// # Errors
    /// The errors of the runs; [`Error::Invalid`] for a scenario without cells to learn from,
    /// [`Error::Usage`] for recordings that share pairs.
    pub fn learn(
        &mut self,
        mut scenario: Scenario,
        path: &Path,
        algorithms: &CellAlgorithms,
        (share, tested): (TrainingPart, bool),
        console: &dyn Console,
    ) -> Result<()> {
        let CellAlgorithms {
            median,
            near,
            surface,
        } = algorithms;
        scenario.algorithms = vec![median.clone(), near.clone(), surface.clone()];
        let targets: [(CellTarget, SafeChoice); 3] = [
            (CellTarget::Median, safe_choice(median)?),
            (CellTarget::Near, safe_choice(near)?),
            (CellTarget::Surface, safe_choice(surface)?),
        ];
        let mut matchers = Matchers::new(&scenario.algorithms)?.without_warnings();
        let manifest = Manifest::new(&scenario.name, &scenario.algorithms)?;
        let [before, before_near, before_runs] =
            [self.cells.len(), self.near.0.len(), self.runs.len()];
        let are_scenes = matches!(scenario.source, ScenarioSource::Dataset { .. });
        for (i, run) in runs(&scenario, console)?.into_iter().enumerate() {
            if !are_scenes && !share.has(i as u64) {
                continue;
            }
            let (run, judge) = run.open(&scenario, console, None)?;
            let mut run = run.registered(&scenario.name, &self.register)?;
            self.tested_runs.push(tested);
            let (run_judge, targets) = (judge.clone(), targets.clone());
            let frame_cells = CollectSink::new(move |judged| {
                let is_own = !are_scenes || share.has(judged.frame.sequence);
                let cells = is_own.then(|| pair_cells(judged, &run_judge, &targets));
                (judged.frame.name.clone(), cells.unwrap_or_default())
            });
            let start = PassStart::new(&manifest, run.seed, &judge);
            // The same walk in another arena is not another scene.
            let kind = scenario.kind();
            let seed_name = run.seed.map(|seed| format!("{kind} seed {seed}"));
            let recording = run.record.as_ref().map(|record| record.path.clone());
            let name = seed_name.or(recording).unwrap_or_else(|| run.name());
            let title = format!("learn {}, {name}", scenario.name);
            let watch = Watch::new(console, &title, run.pairs(), None);
            let collected = frames_through(&mut run, &mut matchers, &start, frame_cells, watch)?;
            // Held out in one place, they would be fitted to in the other.
            self.register.refuse_copies()?;
            let collected = collected.into_iter().map(|(scene, cells)| {
                // The pairs of a recording resemble each other, whatever their names.
                let scene = scene.filter(|_| are_scenes);
                (scene.unwrap_or_else(|| name.clone()), cells)
            });
            let pairs = self.add_pairs(collected, tested);
            // The table of time is fitted to images of one size and cells of the usual one.
            let is_usual = pairs.iter().all(|pair| pair.levels == 1 && !pair.is_small);
            if !tested && !scenario.has_separate_pairs() && is_usual {
                let group = self.group(name);
                self.runs.push(CellSequence {
                    group,
                    weight: 1.0,
                    pairs,
                });
            }
        }
        let mut samples = self.cells[before..].iter().flat_map(|cell| &cell.levels);
        if !samples.any(|sample| sample.is_some_and(|sample| sample.is_reportable())) {
            let path = path.display();
            return Err(Error::Invalid(format!(
                "{path}: has no cells to learn from: frames need a truth, and of three runs or \
                 scenes one is for the tables; take six, or keep the network with --tables-only"
            )));
        }
        let near = self.near.0.len() - before_near;
        let weight = weight(near);
        self.near.1.extend(std::iter::repeat_n(weight, near));
        for run in &mut self.runs[before_runs..] {
            run.weight = weight;
        }
        self.scenarios.push(LearnedScenario {
            kind: scenario.kind().to_owned(),
            name: scenario.name,
            cells: 0,
            tested,
        });
        Ok(())
    }

    /// Adds the cells of pairs, each with the name of its group: by the median, and by the nearest
    /// quarter if they are fitted to. Returns those by the median.
    fn add_pairs(
        &mut self,
        collected: impl Iterator<Item = (String, Vec<PairCells>)>,
        tested: bool,
    ) -> Vec<PairCells> {
        let (mut pairs, scenario) = (Vec::new(), self.scenarios.len());
        for (name, cells) in collected {
            let group = self.group(name);
            let Ok([median, near, surface]) = <[PairCells; 3]>::try_from(cells) else {
                continue;
            };
            let small = |role| median.is_small.then_some(role);
            let levels = median.cells.chunks_exact(median.levels);
            let medians = levels.map(|levels| (small(TableRole::Small), levels));
            let surfaces = surface.cells.iter().filter(|cell| cell.is_wide());
            let surfaces = surfaces.map(|cell| (small(TableRole::NearSmall), from_ref(cell)));
            let surfaces = surfaces.filter(|(role, _)| role.is_some());
            for (role, levels) in medians.chain(surfaces) {
                let sample = |cell: &PairCell| cell.sample(group).filter(|_| !cell.is_refused);
                if levels.iter().any(|cell| cell.right.is_some()) {
                    self.cells.push(LearnedCell {
                        scenario,
                        role,
                        levels: levels.iter().map(sample).collect(),
                    });
                }
            }
            // The near table stays that of small images.
            if !tested && median.levels == 1 && !median.is_small {
                let samples = near.cells.iter().filter_map(|cell| cell.sample(group));
                self.near.0.extend(samples);
            }
            pairs.push(median);
        }
        pairs
    }

    /// The samples of a table: of levels, the cells that the finer tables of `model` leave open.
    pub fn samples(&self, role: TableRole, model: &V5Model) -> TableSamples {
        let mut own = vec![Vec::new(); self.scenarios.len()];
        for cell in &self.cells {
            let levels = cell.levels.len();
            for (level, sample) in cell.levels.iter().enumerate() {
                let by_level = || TableRole::for_level(level, levels);
                let level_role = cell.role.unwrap_or_else(by_level);
                let decides = sample.is_some_and(|sample| {
                    let score = |evidence| level_role.table(model).score(&evidence);
                    sample
                        .evidence
                        .is_some_and(|evidence| score(evidence) >= DECIDES)
                });
                // Reports of one size alone show how many cells there are, too.
                let sample = sample.filter(|sample| levels == 1 || sample.is_reportable());
                if level_role == role {
                    own[cell.scenario].extend(sample);
                }
                if decides {
                    break;
                }
            }
        }
        let mut samples = TableSamples::default();
        for tested in [false, true] {
            let scenarios = self.scenarios.iter().zip(&own);
            for (scenario, own) in scenarios.filter(|(scenario, _)| scenario.tested == tested) {
                if !own.is_empty() {
                    samples.samples.extend(own);
                    samples.scenarios.push(LearnedScenario {
                        cells: own.len(),
                        ..scenario.clone()
                    });
                }
            }
        }
        samples
    }

    /// Fits a table for the nearest quarter, as [`TableSamples::fit`], with its samples;
    /// the inner `None` without any.
    pub fn fit_near(
        &self,
        like: &VerdictTable,
        progress: impl Fn() -> bool + Sync,
    ) -> Option<Option<(CellFit, &[CellSample])>> {
        let (samples, mut weights) = (&self.near.0, self.near.1.clone());
        if samples.is_empty() {
            return Some(None);
        }
        scale(&mut weights);
        let kinds = vec![0; samples.len()];
        let fit = fit_cells(samples, &kinds, &weights, like, progress)?;
        Some(Some((fit, samples)))
    }

    /// The runs that were fitted to, with their pairs.
    pub fn fitted_to(&self) -> FittedTo {
        self.register.fitted(|run| !self.tested_runs[run])
    }

    fn group(&mut self, name: String) -> usize {
        let known = self.groups.iter().position(|group| *group == name);
        known.unwrap_or_else(|| {
            self.groups.push(name);
            self.groups.len() - 1
        })
    }
}

impl TableSamples {
    /// Number of samples to fit to.
    pub fn fitted(&self) -> usize {
        self.fitted_scenarios().map(|scenario| scenario.cells).sum()
    }

    /// Fits a table for the median, else like the one in use.
    ///
    /// The weight of a scenario is the square root of its number of cells, so that few real scenes
    /// count beside many simulated ones. `None` and `progress` as of [`fit_cells`].
    pub fn fit(&self, like: &VerdictTable, progress: impl Fn() -> bool + Sync) -> Option<CellFit> {
        let (fitted, kinds) = (self.fitted(), self.kinds());
        let mut kind_of = Vec::with_capacity(fitted);
        let mut weights = Vec::with_capacity(fitted);
        for scenario in self.fitted_scenarios() {
            let kind = kinds.iter().position(|kind| *kind == scenario.kind);
            kind_of.extend(std::iter::repeat_n(kind.unwrap_or(0), scenario.cells));
            weights.extend(std::iter::repeat_n(weight(scenario.cells), scenario.cells));
        }
        scale(&mut weights);
        fit_cells(&self.samples[..fitted], &kind_of, &weights, like, progress)
    }

    fn fitted_scenarios(&self) -> impl Iterator<Item = &LearnedScenario> {
        self.scenarios.iter().filter(|scenario| !scenario.tested)
    }

    /// The kinds of the scenes that are fitted to.
    pub(super) fn kinds(&self) -> Vec<&str> {
        let scenarios = self.fitted_scenarios();
        let kinds: BTreeSet<_> = scenarios.map(|own| own.kind.as_str()).collect();
        kinds.into_iter().collect()
    }
}

fn safe_choice(algorithm: &Algorithm) -> Result<SafeChoice> {
    let choice = algorithm.safe_choice()?;
    choice.ok_or_else(|| Error::Invalid("v5 decides on cells".to_owned()))
}

/// Weight of each cell of a scenario with that many.
fn weight(cells: usize) -> f64 {
    1.0 / (cells.max(1) as f64).sqrt()
}

/// Scales weights so that they sum to their number: the ridge's influence stays small.
fn scale(weights: &mut [f64]) {
    let scale = weights.len() as f64 / weights.iter().sum::<f64>();
    weights.iter_mut().for_each(|weight| *weight *= scale);
}
