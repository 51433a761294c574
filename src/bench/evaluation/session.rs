//! A session of an evaluation: what is in the folder, and what is to be matched.

use super::plan::{Again, EvaluationPlan};
use crate::console::Console;
use std::path::PathBuf;
use svl_core::{Error, Result};
use svl_report::units::{
    ReportPlan, ReportRun, RunFacts, RunUnits, StoredSeal, Units, unit_format,
};
use svl_score::manifest::{Manifest, Purpose, hash};

/// The units of a report as a session finds them.
pub(super) struct EvaluationSession {
    pub(super) units: Units,
    pub(super) plan: ReportPlan,
    /// Per run of the plan what is kept.
    pub(super) runs: Vec<RunUnits>,
    shard: Option<String>,
    /// Units that are not what was sealed, or of other pairs.
    invalid: Vec<StoredSeal>,
    /// Results of programs that answer otherwise now.
    other_programs: Vec<(StoredSeal, String)>,
    /// Runs whose facts are others than in the folder.
    changed: Vec<usize>,
}

impl EvaluationSession {
    /// Reads the units of the folder, of these runs, for the session of that manifest. Nothing is
    /// written.
    ///
    /// # Errors
    /// Those of the units' files.
    pub(super) fn open(
        plan: &EvaluationPlan<'_>,
        manifest: Manifest,
        runs: Vec<ReportRun>,
        console: &dyn Console,
    ) -> Result<Self> {
        let units = Units::for_report(plan.folder);
        let mut again = plan.again;
        let is_unreadable = units.exist() && !units.are_readable();
        // Shards of one run are of one svl, which is checked below.
        let is_other =
            plan.shard.is_none() && units.have_other_sources(manifest.sources.as_deref());
        if is_unreadable || is_other {
            let folder = plan.folder.display();
            tracing::warn!("{folder}: is of another version of svl: all is matched again");
            again = Again::All;
        }
        let mut plan_of_report = ReportPlan {
            format: unit_format(),
            identities: identities(&manifest)?,
            manifest,
            runs,
            limit_lines: plan.scenario.gate.iter().map(|limit| limit.line).collect(),
            lost: plan.lost.clone(),
        };
        // Those of the session.
        let shard = plan_of_report.manifest.shard.take();
        plan_of_report.manifest.warnings = console.warnings();
        if plan.shard.is_some() && again != Again::All && units.exist() {
            let folder_manifest = units.plan()?.manifest;
            let differences =
                folder_manifest.differences(&plan_of_report.manifest, Purpose::Merge)?;
            if !differences.is_empty() {
                return Err(Error::Invalid(format!(
                    "{}: has another run ({}); use the same options for all shards, another -o, \
                     or --force",
                    plan.folder.display(),
                    differences.join("; ")
                )));
            }
        }
        let sessions = units.sessions()?;
        let mut damaged: Vec<(StoredSeal, PathBuf)> = Vec::new();
        let mut found = Vec::new();
        for run in &plan_of_report.runs {
            found.push(RunUnits::read(
                &units,
                &plan_of_report,
                run,
                &sessions,
                |seal, file| damaged.push((seal.clone(), file)),
            )?);
        }
        for (_, file) in &damaged {
            tracing::warn!(
                "{}: was cut or edited: its pairs are matched again",
                file.display()
            );
        }
        let labels = plan_of_report.labels();
        let times = &plan_of_report.manifest.times;
        let is_other = |id: &str| {
            let mut sessions = sessions.iter().map(|session| &session.manifest);
            sessions.any(|manifest| manifest.run_id == id && manifest.times != *times)
        };
        for run in &mut found {
            if plan.rounds > 1 {
                // Matched fewer times, or more.
                run.kept.forget_sessions(is_other);
            }
            match again {
                Again::Missing => {}
                Again::Times => run.kept.forget_mixed_blocks(&labels),
                Again::All => labels.iter().for_each(|label| run.kept.forget(label)),
            }
        }
        Ok(Self {
            units,
            plan: plan_of_report,
            shard,
            runs: found,
            invalid: damaged.into_iter().map(|(seal, _)| seal).collect(),
            other_programs: Vec::new(),
            changed: Vec::new(),
        })
    }

    /// Its identifier.
    pub(super) fn id(&self) -> &str {
        &self.plan.manifest.run_id
    }

    /// Begins the session: the folder is of its plan from now on.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub(super) fn begin(&self) -> Result<()> {
        self.units.write_plan(&self.plan)?;
        self.units.remove(&self.invalid)?;
        for i in &self.changed {
            if let Some(facts) = &self.runs[*i].facts {
                self.units.write_facts(facts)?;
            }
        }
        self.other_programs
            .iter()
            .try_for_each(|(seal, label)| self.units.remove_algorithms(seal, |own| own == label))
    }

    /// Notes how a run is now: what is kept of other pairs is forgotten. `inputs`: the input hash
    /// of each pair.
    pub(super) fn change_run(
        &mut self,
        run: usize,
        inputs: &[String],
        change: impl FnOnce(&mut RunFacts),
    ) {
        let own = &mut self.runs[run];
        self.invalid.extend(own.kept.forget_other_inputs(inputs));
        if let Some(facts) = &mut own.facts {
            change(facts);
        }
        self.changed.push(run);
    }

    /// Forgets all results of an algorithm, which answers otherwise now.
    pub(super) fn forget_algorithm(&mut self, label: &str) {
        for run in &mut self.runs {
            let seals = run.kept.seals().iter();
            let own =
                seals.filter(|stored| stored.seal.algorithms.iter().any(|own| own.label == label));
            let own = own.map(|seal| (seal.clone(), label.to_owned()));
            self.other_programs.extend(own);
            run.kept.forget(label);
        }
    }

    /// Its manifest as it begins.
    pub(super) fn manifest(&self) -> Manifest {
        Manifest {
            shard: self.shard.clone(),
            warnings: Vec::new(),
            ..self.plan.manifest.clone()
        }
    }

    /// Writes what is known of the session itself.
    ///
    /// # Errors
    /// As [`Self::begin`].
    pub(super) fn write(&self, manifest: &Manifest) -> Result<()> {
        self.units.write_session(manifest)
    }
}

/// What was measured.
pub(super) struct MeasuredUnits {
    /// Reason why it ended early, if it did.
    pub(super) ran: Result<()>,
    /// The session, unless nothing was missing.
    pub(super) session: Option<String>,
}

/// Per algorithm the hash of all that its results depend on besides the pairs.
fn identities(manifest: &Manifest) -> Result<Vec<String>> {
    let run = manifest.identity_hash(Purpose::Keep)?;
    let identity = |record: &svl_score::manifest::AlgorithmRecord| {
        hash(&format!("{run} {}:{}", record.name, record.parameters_hash))
    };
    Ok(manifest.algorithms.iter().map(identity).collect())
}
