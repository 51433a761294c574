//! Evaluates a scenario: its runs or its drives, into the report's folder.

use super::folder::read_ending;
use super::part::ReportPart;
use super::plan::{EndedRun, EvaluationPlan};
use super::{drives, scored_runs};
use crate::console::Console;
use crate::outputs::Outputs;
use crate::report::{GateResult, Summary};
use std::path::Path;
use svl_core::Result;
use svl_data::losses::RunState;
use svl_data::scenario::ScenarioSource;

/// A report that is written.
pub struct Evaluation {
    pub summary: Summary,
    /// The results of the limits, if they were asked for.
    pub gate: Vec<GateResult>,
    /// Reason why the run ended early, if it did.
    pub ran: Result<()>,
}

impl EvaluationPlan<'_> {
    /// Runs the evaluation into the folder, which `outputs` claims.
    ///
    /// # Errors
    /// Those of sources, algorithms and files that leave no report. Results before an error during
    /// the run are reported, see [`Evaluation::ran`].
    pub fn evaluate(&self, mut outputs: Outputs, console: &dyn Console) -> Result<Evaluation> {
        if !self.resume {
            warn_of_unfinished(self.folder);
        }
        let evaluate = match &self.scenario.source {
            ScenarioSource::Drive { .. } => drives::evaluate,
            _ => scored_runs::evaluate,
        };
        let EndedRun {
            ran,
            finished,
            pairs,
            others,
            holds_earlier,
            inputs,
        } = evaluate(self, &mut outputs, console)?;
        match (&ran, &finished) {
            (Ok(()), Ok(_)) => {
                if self.shard.is_some() {
                    ReportPart::complete(self.folder, inputs)?;
                }
                outputs.commit();
                // The report has the results that an interrupted part left there.
                for other in &others {
                    if let Err(error) = std::fs::remove_dir_all(other) {
                        tracing::warn!("{}: cannot be removed: {error}", other.display());
                    }
                }
            }
            (Err(_), Ok(_)) if holds_earlier => outputs.commit(),
            _ if finished.is_ok() || pairs > 0 => outputs.keep_both(),
            _ => drop(outputs),
        }
        let ran = match finished {
            Ok(_) => ran,
            Err(_) => Ok(ran?),
        };
        let (summary, gate) = finished?;
        Ok(Evaluation { summary, gate, ran })
    }
}

/// Warns that an unfinished run is dropped that could be resumed.
fn warn_of_unfinished(folder: &Path) {
    let rows = folder.join("rows.csv").metadata();
    let is_unfinished = || match read_ending(folder) {
        Ok(Some(ending)) => ending.state == RunState::Interrupted,
        Ok(None) => true,
        // Earlier versions of svl marked it in another way.
        Err(_) => false,
    };
    if rows.is_ok_and(|rows| rows.len() > 0) && is_unfinished() {
        tracing::warn!(
            "{}: contains an unfinished run, which is scored again; --resume would continue it",
            folder.display()
        );
    }
}
