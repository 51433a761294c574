//! Evaluates a scenario: matches the units that are missing, and builds the report of all.

use super::plan::EvaluationPlan;
use super::session::{EvaluationSession, MeasuredUnits};
use super::{drives, work};
use crate::console::Console;
use svl_core::{Result, counted, joined};
use svl_files::outputs::{Outputs, remove_special_files};
use svl_report::units::{RunUnits, Units};
use svl_report::{BuiltReport, REPORT, build};
use svl_score::notice::NoticeLog;
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
    /// The errors of sources, algorithms and files that leave no report. Results before an error
    /// during the run are reported, see [`Evaluation::ran`].
    pub fn evaluate(&self, outputs: Outputs, console: &dyn Console) -> Result<Evaluation> {
        let units = Units::for_report(self.folder);
        {
            // Notices about the folder do not belong to the report.
            let _entered = NoticeLog::default().enter();
            remove_special_files(self.folder, &REPORT)?;
            units.remove_links()?;
        }
        let measure = match &self.scenario.source {
            ScenarioSource::Drive { .. } => drives::measure,
            _ => work::measure,
        };
        let MeasuredUnits {
            ran,
            mut session,
            has_matched,
        } = measure(self, console)?;
        // Shards may share the folder: the last one builds the report.
        let _lock = self.shard.and_then(|_| units.lock());
        session.finish()?;
        if self.prune {
            let kept = session.runs.iter().flat_map(RunUnits::all);
            units.prune(&session.list.runs, kept)?;
        }
        self.note_others(&session, console)?;
        let report = match self.shard {
            Some(_) if !session.is_whole() => None,
            _ => Some(build(self.folder, &self.shown)),
        };
        let report = match (report.transpose(), &ran) {
            (Ok(report), _) => report,
            // The reason of the run comes first.
            (Err(_), Err(_)) => None,
            (Err(error), Ok(())) => return Err(error),
        };
        outputs.commit()?;
        Ok(Evaluation {
            report,
            ran,
            session: has_matched.then(|| session.id().to_owned()),
        })
    }

    /// Notes what the folder has besides what was asked for.
    fn note_others(&self, session: &EvaluationSession, console: &dyn Console) -> Result<()> {
        let labels = session.list.labels();
        let earlier = &labels[session.asked().len()..];
        let runs = session.units.other_runs(&session.list)? as u64;
        let runs = (runs > 0).then(|| format!("{} of other options", counted(runs, "run")));
        let others: Vec<_> = earlier.iter().copied().chain(runs.as_deref()).collect();
        if !others.is_empty() {
            let (folder, others) = (self.folder.display(), joined(others));
            console.note(&format!(
                "{folder}: also in the folder, not asked for: {others}; --prune removes them"
            ));
        }
        Ok(())
    }
}
