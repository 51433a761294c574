//! Evaluates a scenario: matches the units that are missing, and builds the report of all.

use super::plan::EvaluationPlan;
use super::session::MeasuredUnits;
use super::{drives, scored_runs};
use crate::console::Console;
use std::collections::BTreeSet;
use svl_core::{Error, Result, joined};
use svl_report::outputs::Outputs;
use svl_report::units::{RunUnits, StoredSeal, Units};
use svl_report::{BuildOptions, BuiltReport, build};
use svl_score::scenario::ScenarioSource;

/// An evaluation that is over.
pub struct Evaluation {
    /// The report; none of a shard, as long as others are missing.
    pub report: Option<BuiltReport>,
    /// Reason why it ended early, if it did.
    pub ran: Result<()>,
    /// The session that matched; none if all results were in the folder.
    pub session: Option<String>,
}

impl EvaluationPlan<'_> {
    /// Runs the evaluation into the folder, which `outputs` claims.
    ///
    /// # Errors
    /// Those of sources, algorithms and files that leave no report. Results before an error during
    /// the run are reported, see [`Evaluation::ran`].
    pub fn evaluate(&self, outputs: Outputs, console: &dyn Console) -> Result<Evaluation> {
        let measure = match &self.scenario.source {
            ScenarioSource::Drive { .. } => drives::measure,
            _ => scored_runs::measure,
        };
        let MeasuredUnits { ran, session } = measure(self, console)?;
        let units = Units::for_report(self.folder);
        let is_whole = self.clear(&units, console)?;
        // Shards may share the folder: the last one builds the report.
        let _lock = self.shard.map(|_| units.lock()).transpose()?;
        let report = match self.shard {
            Some(_) if !is_whole => None,
            _ => Some(self.built()),
        };
        let report = match (report.transpose(), &ran) {
            (Ok(report), _) => report,
            // The reason of the run comes first.
            (Err(_), Err(_)) => None,
            (Err(error), Ok(())) => return Err(error),
        };
        outputs.commit();
        Ok(Evaluation {
            report,
            ran,
            session,
        })
    }

    fn built(&self) -> Result<BuiltReport> {
        let options = BuildOptions {
            area: self.area,
            sort: self.sort,
            gate: self.gate,
            figures: self.figures,
            ..BuildOptions::default()
        };
        build(self.folder, &options)
    }

    /// Removes units that are superseded, and, if asked, those that the plan does not ask for; they
    /// are named otherwise. True if nothing is missing.
    fn clear(&self, units: &Units, console: &dyn Console) -> Result<bool> {
        let (plan, sessions) = (units.plan()?, units.sessions()?);
        let (mut is_whole, mut others) = (true, BTreeSet::new());
        for run in &plan.runs {
            let run = RunUnits::read(units, &plan, run, &sessions, |_, _| ())?;
            is_whole &= run.is_whole(&plan);
            // A drive is one result.
            let pairs = if plan.is_driven() {
                Some(1)
            } else {
                run.pairs()
            };
            let unused = run.kept.unused(pairs.unwrap_or(u64::MAX));
            let superseded = unused.iter().filter(|(_, is_superseded)| *is_superseded);
            let superseded: Vec<_> = superseded.map(|(stored, _)| *stored).collect();
            units.remove(superseded.iter().copied())?;
            let is_unasked = |label: &str| plan.identity(label).is_none();
            let is_there = |stored: &&StoredSeal| {
                let mut removed = superseded.iter();
                removed.all(|removed| !std::ptr::eq(*removed, *stored))
            };
            for stored in run.kept.seals().iter().filter(is_there) {
                let labels = stored.seal.algorithms.iter().map(|own| own.label.as_str());
                let mut unasked = labels.filter(|label| is_unasked(label)).peekable();
                if !self.prune {
                    others.extend(unasked.map(str::to_owned));
                } else if unasked.peek().is_some() {
                    units.remove_algorithms(stored, is_unasked)?;
                }
            }
        }
        for folder in units.other_runs(&plan)? {
            if self.prune {
                std::fs::remove_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
            } else {
                let name = folder.file_name().unwrap_or_default();
                others.insert(name.to_string_lossy().into_owned());
            }
        }
        if !others.is_empty() {
            console.note(&format!(
                "{}: also in the folder, not asked for: {}; --prune removes them",
                self.folder.display(),
                joined(others.iter().map(String::as_str))
            ));
        }
        Ok(is_whole)
    }
}
