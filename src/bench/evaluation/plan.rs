//! The plan of an evaluation: the scenario, the algorithms and the options.

use super::folder::ReportHead;
use super::part::Shard;
use crate::report::{GateResult, Summary};
use crate::run::Pace;
use crate::sink::{RerunDetail, RerunTarget, Viewer};
use std::path::{Path, PathBuf};
use svl_core::Result;
use svl_data::losses::Missing;
use svl_data::manifest::Manifest;
use svl_data::scenario::{Scenario, StressLevels};
use svl_data::score::Metric;
use svl_data::stress::Stress;

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
    /// True if the drives are kept as recordings.
    pub keep_drives: bool,
    pub shard: Option<Shard>,
    /// Pairs that were lost as live topics were recorded for it.
    pub lost: Option<Missing>,
    /// True if an earlier part of the run in the folder is resumed.
    pub resume: bool,
    pub sort: Option<&'static Metric>,
    /// True if the limits of the scenario are scored.
    pub gate: bool,
    /// The folder for the plots as files.
    pub figures: Option<&'a Path>,
    pub viewer: Option<(&'static dyn Viewer, RerunTarget, RerunDetail)>,
}

/// A run that is over, and its report.
pub(super) struct EndedRun {
    /// Reason why it ended early, if it did.
    pub(super) ran: Result<()>,
    /// The report, also of a run that ended early.
    pub(super) finished: Result<(Summary, Vec<GateResult>)>,
    /// Number of pairs that were scored.
    pub(super) pairs: u64,
    /// Folders of interrupted parts, whose results the report now contains.
    pub(super) others: Vec<PathBuf>,
    /// True if it contains all results of the report before it, even if it ended early.
    pub(super) holds_earlier: bool,
    /// Inputs of a part, as [`super::part::ReportPart`] has them.
    pub(super) inputs: Vec<(String, String)>,
}

impl EvaluationPlan<'_> {
    /// The manifest of the report.
    pub(super) fn manifest(&self, pace: Pace) -> Result<Manifest> {
        let scenario = self.scenario;
        let mut manifest = Manifest::new(&scenario.name, &scenario.algorithms)?;
        manifest.description = Some(self.description.clone());
        manifest.set_rule(scenario.cells);
        manifest.times = Some(pace.times());
        manifest.shard = self.shard.map(String::from);
        Ok(manifest)
    }

    /// The texts of the report besides its numbers. `measured`: times are of matching alone.
    pub(super) fn head(&self, measured: bool) -> ReportHead<'_> {
        let scenario = self.scenario;
        ReportHead {
            description: &scenario.description,
            rule: scenario.cells,
            measured,
            algorithms: &scenario.algorithms,
            columns: &scenario.columns,
            sort: self.sort,
            limits: if self.gate { &scenario.gate } else { &[] },
            figures: self.figures,
        }
    }

    /// No perturbation, then all levels of the scenario's.
    pub(super) fn stresses(&self) -> impl Iterator<Item = Option<Stress>> {
        let stresses = self.scenario.stress.iter().flat_map(StressLevels::stresses);
        std::iter::once(None).chain(stresses.copied().map(Some))
    }
}
