//! The plan of an evaluation: the scenario, the algorithms and the options.

use super::shard::Shard;
use crate::console::Console;
use crate::pass::{Matchers, Pace};
use crate::sink::{RerunDetail, RerunTarget, Viewer};
use std::path::Path;
use svl_core::depth::CellDecision;
use svl_core::{Result, counted};
use svl_report::BuildOptions;
use svl_report::units::{PlannedWitness, ReportRun};
use svl_score::judge::ColumnChoice;
use svl_score::losses::Missing;
use svl_score::manifest::Manifest;
use svl_score::scenario::{Scenario, ScenarioSource, StressLevels, is_of_witness, witness};
use svl_sim::stress::Stress;

/// A viewer, where it shows the run, and how much of it.
pub type ChosenViewer = (&'static dyn Viewer, RerunTarget, RerunDetail);

/// An evaluation: a scenario through its algorithms into a report.
pub struct EvaluationPlan<'a> {
    /// With its algorithms also behind its filters.
    pub scenario: &'a Scenario,
    /// The scenario as it is described, for the manifest.
    pub description: serde_json::Value,
    /// The file that names the algorithms, if they are not the user's.
    pub algorithms_file: Option<&'a str>,
    /// The folder of the report.
    pub folder: &'a Path,
    /// Number of times that each pair is matched.
    pub rounds: usize,
    /// Number of threads that match a pair by an algorithm each, so that no times are measured; of
    /// drives the number at once.
    pub jobs: Option<usize>,
    /// True if the drives are kept as recordings.
    pub keep_drives: bool,
    pub shard: Option<Shard>,
    /// Pairs that were lost as live topics were recorded for it.
    pub lost: Option<Missing>,
    pub again: Again,
    /// True if units that are not asked for any more are removed.
    pub prune: bool,
    /// The options of its report.
    pub shown: BuildOptions<'a>,
    pub viewer: Option<ChosenViewer>,
}

/// The results in the folder that are matched again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Again {
    /// Results that are missing.
    #[default]
    Missing,
    /// Also those of blocks whose times are of several sessions.
    Times,
    /// All.
    All,
}

impl EvaluationPlan<'_> {
    /// The jobs that are asked for, at most one per core.
    pub(super) fn jobs(&self, console: &dyn Console) -> Option<usize> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let asked = self.jobs?;
        if cores < asked {
            let cores = counted(cores, "core");
            console.note(&format!("--jobs {asked}: fewer, for {cores}"));
        }
        Some(asked.min(cores))
    }

    /// The manifest of the session.
    pub(super) fn manifest(&self, pace: Pace) -> Result<Manifest> {
        let scenario = self.scenario;
        let mut manifest = Manifest::new(&scenario.name, &scenario.algorithms)?;
        manifest.description = Some(self.description.clone());
        manifest.set_rule(scenario.cells);
        manifest.times = Some(pace.times());
        manifest.shard = self.shard.map(String::from);
        Ok(manifest)
    }

    /// The witness of the report, where one of these runs needs it.
    pub(super) fn witness(&self, runs: &[ReportRun]) -> Result<Option<PlannedWitness>> {
        let scenario = self.scenario;
        let named = match self.shown.columns.unwrap_or(&scenario.columns) {
            ColumnChoice::Named(all) => &all[..],
            _ => &[],
        };
        let limits = scenario.gate.iter().filter(|_| self.shown.gate);
        let named = named.iter().copied().chain(self.shown.sort);
        let mut asked = named.chain(limits.map(|limit| limit.metric));
        let is_asked = asked.any(|metric| metric.estimated().is_some());
        let is_driven = matches!(scenario.source, ScenarioSource::Drive { .. });
        let needs = |run: &ReportRun| !run.is_raw && (is_asked || !run.has_truth);
        let is_safe = scenario.grid.decision == CellDecision::Safe;
        let mut algorithms = scenario.algorithms.iter();
        let is_any = algorithms.any(|own| !is_of_witness(own.spec().name));
        if is_driven || is_safe || !(is_any || is_asked) || !runs.iter().any(needs) {
            return Ok(None);
        }
        let mut records = Manifest::new(&scenario.name, &[witness()])?.algorithms;
        let mut record = records.swap_remove(0);
        let matchers = Matchers::new(&[witness()])?;
        record.has_run_memory = matchers.with_run_memory().next().is_some();
        Ok(Some(PlannedWitness { record, is_asked }))
    }

    /// No perturbation, then all levels of the scenario's.
    pub(super) fn stresses(&self) -> impl Iterator<Item = Option<Stress>> {
        let stresses = self.scenario.stress.iter().flat_map(StressLevels::stresses);
        std::iter::once(None).chain(stresses.copied().map(Some))
    }
}
