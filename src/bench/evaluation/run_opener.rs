//! Opens the runs of a scenario, in their order, and says which results are asked for.

use super::shard::Shard;
use crate::console::Console;
use crate::runs::{self, ScoredSource, data_folder};
use crate::sink::{LiveTable, Wanted};
use crate::source::dataset::Scene;
use crate::source::{PairRegister, RunSource};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use svl_core::Result;
use svl_core::matcher::{Algorithm, MapPlace};
use svl_report::units::{BLOCK, FileStamp, KeptResults, ReportRun, files_of};
use svl_score::judge::Judge;
use svl_score::manifest::RunRecord;
use svl_score::scenario::{Scenario, ScenarioSource};
use svl_sim::stress::Stress;

/// A run of a scenario, unperturbed or perturbed, by its place.
pub(super) type RunPlace = (Option<Stress>, usize);

/// Opens the runs of a scenario, in their order.
pub(super) struct RunOpener<'a> {
    scenario: &'a Scenario,
    console: &'a dyn Console,
    live: LiveTable,
    /// The recording of each run, or its seed.
    identities: Vec<(Option<RunRecord>, Option<u64>)>,
    /// Those that were not opened yet: perturbed, a run is opened anew.
    runs: Vec<Option<ScoredSource>>,
    /// The pairs of the runs so far, of each perturbation anew.
    register: PairRegister,
    stress: Option<Stress>,
}

impl<'a> RunOpener<'a> {
    /// All that the user names is opened, so that an error in the last one is reported before the
    /// first is scored.
    ///
    /// # Errors
    /// As [`runs::runs`].
    pub(super) fn new(
        scenario: &'a Scenario,
        console: &'a dyn Console,
        live: &LiveTable,
    ) -> Result<Self> {
        let runs = runs::runs(scenario, console)?;
        Ok(Self {
            scenario,
            console,
            live: live.clone(),
            identities: runs.iter().map(|run| (run.record(), run.seed())).collect(),
            runs: runs.into_iter().map(Some).collect(),
            register: PairRegister::new(&scenario.algorithms)?,
            stress: None,
        })
    }

    /// Number of the runs.
    pub(super) fn count(&self) -> usize {
        self.runs.len()
    }

    /// The recordings among the runs.
    pub(super) fn records(&self) -> Vec<RunRecord> {
        let records = self.identities.iter().map(|(record, _)| record);
        records.flatten().cloned().collect()
    }

    pub(super) fn live(&self) -> &LiveTable {
        &self.live
    }

    /// The key of a run in the rows.
    pub(super) fn key(&self, (stress, place): RunPlace) -> ReportRun {
        let (record, seed) = &self.identities[place];
        ReportRun {
            run: record.as_ref().map(|record| record.name.clone()),
            seed: *seed,
            stress: stress.map(|stress| stress.to_string()),
        }
    }

    /// Opens a run, recorded first if the cache does not have it.
    ///
    /// # Errors
    /// Those of its source, and of checkpoints that no frame of it could pass.
    pub(super) fn open(&mut self, (stress, place): RunPlace) -> Result<(RunSource, Judge)> {
        if self.stress != stress {
            // The user was warned of what was fitted to.
            (self.stress, self.register) = (stress, PairRegister::default());
        }
        let source = match self.runs[place].take_if(|_| stress.is_none()) {
            Some(source) => source,
            None => runs::run_at(self.scenario, place, self.console)?,
        };
        let (run, mut judge) = source.open(self.scenario, self.console, Some(&self.live))?;
        let run = run.registered(&self.scenario.name, &self.register, true);
        let mut run = run.digested();
        if let Some(stress) = stress {
            run = run.stressed(stress);
            judge = run.judge(&self.scenario.judge())?;
        }
        Ok((run, judge))
    }
}

/// The results of a run that are missing, of a shard.
pub(super) struct WantedResults<'a> {
    pub(super) kept: &'a KeptResults,
    /// Place of the run among all.
    pub(super) run: usize,
    pub(super) shard: Option<Shard>,
    /// Algorithms whose results depend on all earlier pairs of a run.
    pub(super) run_memory: BTreeSet<String>,
    /// The algorithms that match the run.
    pub(super) labels: BTreeSet<String>,
}

impl WantedResults<'_> {
    /// True if any of these algorithms is wanted.
    pub(super) fn wants_any(&self, place: u64, labels: &[&str]) -> bool {
        labels.iter().any(|label| self.wants(place, label))
    }
}

impl Wanted for WantedResults<'_> {
    fn wants(&self, place: u64, algorithm: &str) -> bool {
        // Blocks are dealt out in turn; of what depends on all pairs, runs.
        let block = match self.run_memory.contains(algorithm) {
            true => 0,
            false => (place / BLOCK) as usize,
        };
        let is_own = self.shard.is_none_or(|shard| shard.takes(self.run + block));
        let is_matched = self.labels.contains(algorithm);
        is_own && is_matched && self.kept.seal(algorithm, place).is_none()
    }
}

/// Per run of a scenario the files that it reads, as they are; none of what is simulated, which its
/// description determines.
///
/// # Errors
/// Those of finding the scenes of a data set.
pub(super) fn files_of_runs(scenario: &Scenario) -> Result<Vec<Vec<FileStamp>>> {
    let maps = map_folders(&scenario.algorithms);
    Ok(match &scenario.source {
        ScenarioSource::Arena { seeds, .. } | ScenarioSource::Drive { seeds, .. } => {
            vec![files_of(maps); seeds.len()]
        }
        ScenarioSource::Dataset { scenes } => {
            let data = data_folder(scenario.options.data.as_deref()).unwrap_or_default();
            let scenes = Scene::find_all(&data, scenes)?;
            let scenes = scenes.iter().map(|scene| scene.folder().to_owned());
            vec![files_of(scenes.chain(maps))]
        }
        ScenarioSource::Recording(_) => {
            let options = &scenario.options;
            let named = [&options.left, &options.right, &options.truth];
            let mut named: Vec<&str> = named.into_iter().flatten().map(String::as_str).collect();
            named.extend(options.calib.iter().flat_map(|calib| calib.split(',')));
            let beside = named
                .into_iter()
                .map(PathBuf::from)
                .filter(|path| path.exists());
            let beside: Vec<_> = beside.chain(maps).collect();
            let files = |path: &Path| files_of(beside.iter().cloned().chain([path.to_owned()]));
            let runs = scenario.recordings()?;
            runs.iter().map(|run| files(&run.path)).collect()
        }
    })
}

/// The folders of the maps in files that these algorithms report.
fn map_folders(algorithms: &[Algorithm]) -> Vec<PathBuf> {
    let folder = |algorithm: &Algorithm| match algorithm.recorded()?.place {
        MapPlace::Topic(_) => None,
        MapPlace::Files { pattern, .. } => {
            let (before, _) = pattern.split_once('*')?;
            let folder = before.rsplit_once('/').map_or(".", |(folder, _)| folder);
            Some(PathBuf::from(folder))
        }
    };
    algorithms.iter().filter_map(folder).collect()
}
