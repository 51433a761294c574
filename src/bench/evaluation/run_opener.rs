//! Opens the runs of a scenario, in their order, and says which results are asked for.

use super::shard::Shard;
use crate::console::Console;
use crate::runs::{self, ScoredSource};
use crate::sink::{RunningTable, Wanted};
use crate::source::{Chain, PairRegister, RunSource};
use std::collections::BTreeSet;
use std::path::PathBuf;
use svl_core::Result;
use svl_core::inputs::InputLog;
use svl_report::units::{BLOCK, ReportRun, RunUnits};
use svl_score::judge::Judge;
use svl_score::manifest::InputRecord;
use svl_score::notice::NoticeLog;
use svl_score::scenario::Scenario;
use svl_sim::stress::Stress;

/// A run of a scenario, unperturbed or perturbed, by its place.
pub(super) type RunPlace = (Option<Stress>, usize);

/// A run that is opened, with the files that were opened for it.
pub(super) struct OpenedRun {
    pub(super) source: RunSource,
    pub(super) judge: Judge,
    pub(super) files: InputLog,
}

/// A run that is opened, unless that failed, with the notices of opening it.
pub(super) type OpeningResult = (NoticeLog, Result<OpenedRun>);

/// Opens the runs of a scenario, in their order.
pub(super) struct RunOpener<'a> {
    scenario: &'a Scenario,
    console: &'a dyn Console,
    pub(super) live: RunningTable,
    /// The recording of each run, or its seed; and whether it has a truth, and raw pairs.
    identities: Vec<(Option<InputRecord>, Option<u64>, [bool; 2])>,
    /// The runs that were not opened yet: perturbed, a run is opened anew.
    runs: Vec<Option<(ScoredSource, InputLog)>>,
    /// The pairs of the runs so far, of each perturbation anew.
    register: PairRegister,
    stress: Option<Stress>,
}

impl<'a> RunOpener<'a> {
    /// All that the user names is opened, so that an error in the last one is reported before the
    /// first is scored.
    ///
    /// # Errors
    /// The errors of [`runs::runs`].
    pub(super) fn new(
        scenario: &'a Scenario,
        console: &'a dyn Console,
        live: &RunningTable,
    ) -> Result<Self> {
        let count = runs::checked_count(scenario)?;
        let runs = (0..count).map(|place| logged(scenario, place, console));
        let runs = runs.collect::<Result<Vec<_>>>()?;
        let identity =
            |(run, _): &(ScoredSource, _)| (run.record(), run.seed(), run.pair_kinds(scenario));
        let identities = runs.iter().map(identity);
        Ok(Self {
            scenario,
            console,
            live: live.clone(),
            identities: identities.collect(),
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
    pub(super) fn records(&self) -> Vec<InputRecord> {
        let records = self.identities.iter().map(|(record, ..)| record);
        records.flatten().cloned().collect()
    }

    /// The files that were opened for each of them so far.
    pub(super) fn opened_files(&self) -> Vec<Vec<PathBuf>> {
        let paths = |files: &InputLog| {
            let stamps = files.stamps().into_iter();
            stamps.map(|file| file.path().to_owned()).collect()
        };
        let runs = self.runs.iter().flatten().map(|(_, files)| paths(files));
        runs.collect()
    }

    /// Names of the layers around the sources of the runs.
    pub(super) fn chain(&self) -> Result<Vec<String>> {
        let runs = self.runs.iter().flatten();
        let chains = runs.map(|(run, _)| run.chain(self.scenario));
        let chains = chains.collect::<Result<Vec<_>>>()?.concat();
        let layers = Chain::LAYERS.iter().map(|layer| (*layer).to_owned());
        Ok(layers.filter(|layer| chains.contains(layer)).collect())
    }

    /// The key of a run in the rows.
    pub(super) fn key(&self, (stress, place): RunPlace) -> ReportRun {
        let (record, seed, [has_truth, is_raw]) = &self.identities[place];
        ReportRun {
            run: record.as_ref().map(|record| record.name.clone()),
            seed: *seed,
            stress: stress.map(|stress| stress.to_string()),
            has_truth: *has_truth,
            is_raw: *is_raw,
            ..ReportRun::default()
        }
    }

    /// Opens a run, and takes the notices of that.
    pub(super) fn begin(&mut self, run: RunPlace) -> OpeningResult {
        let notices = NoticeLog::default();
        let _entered = notices.enter();
        let opened = self.open(run);
        (notices, opened)
    }

    /// Opens a run, recorded first if the cache does not have it.
    ///
    /// # Errors
    /// The errors of its source, and of checkpoints that no frame of it could pass.
    pub(super) fn open(&mut self, (stress, place): RunPlace) -> Result<OpenedRun> {
        if self.stress != stress {
            // The user was warned of what was fitted to.
            (self.stress, self.register) = (stress, PairRegister::default());
        }
        let opened = match self.runs[place].take_if(|_| stress.is_none()) {
            Some(opened) => opened,
            None => logged(self.scenario, place, self.console)?,
        };
        let (source, files) = opened;
        let entered = files.enter();
        let (run, mut judge) = source.open(self.scenario, self.console, Some(&self.live))?;
        let mut run = run.registered(&self.scenario.name, &self.register)?;
        if let Some(stress) = stress {
            run = run.stressed(stress)?;
            judge.run.stress = Some(stress.to_string());
        }
        drop(entered);
        Ok(OpenedRun {
            source: run,
            judge,
            files,
        })
    }
}

/// Opens the run at a place, and notes the files that it opens.
fn logged(
    scenario: &Scenario,
    place: usize,
    console: &dyn Console,
) -> Result<(ScoredSource, InputLog)> {
    let files = InputLog::default();
    let entered = files.enter();
    let run = runs::run_at(scenario, place, console)?;
    drop(entered);
    Ok((run, files))
}

/// The results of a run that are missing, of a shard.
pub(super) struct WantedResults<'a> {
    pub(super) units: &'a RunUnits,
    /// Place of the run among all.
    pub(super) run: usize,
    pub(super) shard: Option<Shard>,
    /// Algorithms whose results depend on all earlier pairs of a run.
    pub(super) run_memory: BTreeSet<String>,
    /// The algorithms that match the run.
    pub(super) labels: BTreeSet<String>,
}

impl WantedResults<'_> {
    /// True if any result is wanted of the blocks of the run.
    pub(super) fn wants_any(&self, blocks: u64) -> bool {
        let mut labels = self.labels.iter();
        labels.any(|label| (0..blocks).any(|block| self.wants(block * BLOCK, label)))
    }
}

impl Wanted for WantedResults<'_> {
    fn wants(&self, place: u64, algorithm: &str) -> bool {
        let block = place / BLOCK;
        // Blocks are dealt out in turn; of what depends on all pairs, runs.
        let dealt = match self.run_memory.contains(algorithm) {
            true => 0,
            false => block as usize,
        };
        let is_own = self.shard.is_none_or(|shard| shard.takes(self.run + dealt));
        let is_matched = self.labels.contains(algorithm);
        is_own && is_matched && self.units.unit(algorithm, block).is_none()
    }
}
