//! A session of an evaluation: what is in the folder, and what is to be matched.

use super::plan::{Again, EvaluationPlan};
use std::collections::BTreeSet;
use std::path::PathBuf;
use svl_core::{Error, Result};
use svl_files::outputs::remove_file;
use svl_report::units::{
    ReportPlan, ReportRun, RunFacts, RunUnits, StoredSession, Units, unit_format,
};
use svl_score::manifest::{Manifest, Purpose};
use svl_score::notice::{Notice, NoticeLog};

/// The units of a report as a session finds them, and as it leaves them.
pub(super) struct EvaluationSession {
    pub(super) units: Units,
    /// The list of the report, with the algorithms of earlier commands behind those asked for.
    pub(super) list: ReportPlan,
    /// Number of the algorithms asked for.
    asked: usize,
    pub(super) runs: Vec<RunUnits>,
    sessions: Vec<StoredSession>,
    again: Again,
    shard: Option<String>,
    /// True if units whose times were measured otherwise, or not, are not taken.
    compares_times: bool,
    /// True if other shards write into the folder.
    is_shared: bool,
    /// Files that are no units, and units that do not count any more.
    unusable: BTreeSet<PathBuf>,
    /// Runs whose facts were found by reading them.
    read: BTreeSet<usize>,
}

impl EvaluationSession {
    /// Reads the units of the folder, of these runs, for the session of that manifest. Nothing is
    /// written.
    ///
    /// # Errors
    /// The errors of the units' files; [`Error::Invalid`] for a shard of another run than the
    /// folder's.
    pub(super) fn open(
        plan: &EvaluationPlan<'_>,
        mut manifest: Manifest,
        runs: Vec<ReportRun>,
    ) -> Result<Self> {
        let units = Units::for_report(plan.folder);
        // That of the session.
        let shard = manifest.shard.take();
        let notices = NoticeLog::current().notices();
        manifest.warnings = notices.iter().map(ToString::to_string).collect();
        manifest.doubts = notices.into_iter().filter_map(|own| own.doubt).collect();
        let witness = plan.witness(&runs)?;
        let mut list = ReportPlan::new(unit_format(), manifest, runs)?;
        list.witness = witness;
        list.limit_lines = plan.scenario.gate.iter().map(|limit| limit.line).collect();
        list.lost.clone_from(&plan.lost);
        let (known, sessions) = (units.known_plan(), units.sessions()?);
        let is_other = |session: &StoredSession| session.manifest.shard != shard;
        let is_shared =
            shard.is_some() && sessions.iter().any(is_other) && plan.again != Again::All;
        let asked = list.manifest.algorithms.len();
        if let Some(known) = &known {
            if known.manifest.sources != list.manifest.sources && !is_shared {
                let folder = plan.folder.display();
                tracing::warn!("{folder}: is of another version of svl: all is matched again");
            }
            if is_shared && known.digest() != list.digest() {
                return Err(refused(plan, known, &list)?);
            }
            let is_union = shard.is_none() && !plan.prune && plan.again == Again::Missing;
            if is_union && known.has_runs_of(&list) {
                let labels: Vec<_> = list.labels().into_iter().map(str::to_owned).collect();
                let earlier = known.manifest.algorithms.iter();
                // A program that is not asked for cannot be asked if its answers are the same.
                let earlier =
                    earlier.filter(|own| !labels.contains(&own.label) && !own.is_program());
                list.manifest.algorithms.extend(earlier.cloned());
                list.witness = list.witness.or_else(|| known.witness.clone());
            }
        }
        let mut session = Self {
            units,
            list,
            asked,
            runs: Vec::new(),
            sessions,
            again: plan.again,
            shard,
            compares_times: plan.rounds > 1 || plan.again == Again::Times,
            is_shared,
            unusable: BTreeSet::new(),
            read: BTreeSet::new(),
        };
        for run in session.list.runs.clone() {
            let (list, sessions) = (&session.list, &session.sessions);
            let unusable = &mut session.unusable;
            let damaged = |file| {
                unusable.insert(file);
            };
            let found = RunUnits::read(&session.units, list, &run, sessions, damaged)?;
            session.runs.push(session.kept(found));
        }
        for file in &session.unusable {
            let file = file.display();
            tracing::warn!("{file}: was cut or edited: its pairs are matched again");
        }
        if session.shard.is_none() {
            let unusable = session.units.unusable(&session.sessions)?;
            session.unusable.extend(unusable);
        }
        Ok(session)
    }

    /// The units that need not be matched again.
    fn kept(&self, mut run: RunUnits) -> RunUnits {
        if self.compares_times {
            // Matched fewer times, or more, or by several jobs.
            let times = &self.list.manifest.times;
            let sessions = self.sessions.iter().map(|session| &session.manifest);
            let others = sessions.filter(|own| own.times != *times);
            let others: BTreeSet<_> = others.map(|own| own.run_id.as_str()).collect();
            run.retain(|_, _, unit| !others.contains(unit.session.as_str()));
        }
        let id = self.id();
        match self.again {
            Again::Missing => {}
            Again::Times => run.retain_equal_blocks(&self.list),
            Again::All => run.retain(|_, _, unit| unit.session == id),
        }
        run
    }

    /// Identifier of the session.
    pub(super) fn id(&self) -> &str {
        &self.list.manifest.run_id
    }

    /// The algorithms asked for.
    pub(super) fn asked(&self) -> Vec<&str> {
        self.list.manifest.labels().take(self.asked).collect()
    }

    /// Begins the session: the folder is of its list from now on.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub(super) fn begin(&self) -> Result<()> {
        self.units.write_plan(&self.list)?;
        for file in &self.unusable {
            match file.is_dir() && !file.is_symlink() {
                true => std::fs::remove_dir_all(file).map_err(|e| Error::io(file, e))?,
                false => remove_file(file)?,
            }
        }
        for i in &self.read {
            self.write_facts(*i)?;
        }
        Ok(())
    }

    fn write_facts(&self, i: usize) -> Result<()> {
        self.units
            .write_facts(&self.list.runs[i], &self.runs[i].facts)
    }

    /// Notes what was found by reading a run: units of other pairs do not count any more.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Invalid`] for other pairs than those of other shards.
    pub(super) fn set_facts(&mut self, i: usize, mut facts: RunFacts) -> Result<()> {
        let known = &self.runs[i].facts;
        let is_same = known.inputs() == facts.inputs();
        if self.is_shared && known.losses.is_some() && facts.losses.is_some() && !is_same {
            return Err(Error::Invalid(format!(
                "the pairs, calibration or truth of {} are others than those of the shards in the \
                 folder; use the same files for all shards, another -o, or --force",
                self.list.runs[i].words()
            )));
        }
        let is_part = facts.error.is_none() && known.pairs.starts_with(&facts.pairs);
        if facts.losses.is_none() && known.losses.is_some() && is_part {
            // More is known than an interrupted session read.
            return Ok(());
        }
        if is_same {
            facts.join(known);
        }
        self.load(i, facts)?;
        self.read.insert(i);
        Ok(())
    }

    /// [`Self::set_facts`], and writes them.
    ///
    /// # Errors
    /// The errors of [`Self::set_facts`].
    pub(super) fn store_facts(&mut self, i: usize, facts: RunFacts) -> Result<()> {
        // Another shard may have written its own.
        let _lock = self.shard.as_ref().and_then(|_| self.units.lock());
        let known = self.units.facts(&self.list.runs[i])?;
        if let Some(known) = known.filter(|_| self.shard.is_some()) {
            self.runs[i].facts = known;
        }
        self.set_facts(i, facts)?;
        self.write_facts(i)
    }

    /// Reads the units of a run again, with these facts.
    fn load(&mut self, i: usize, facts: RunFacts) -> Result<()> {
        let run = self.list.runs[i].clone();
        let (units, list) = (&self.units, &self.list);
        let found = RunUnits::with_facts(units, list, &run, &self.sessions, facts, |_| ())?;
        self.runs[i] = self.kept(found);
        Ok(())
    }

    /// Reads facts and units of a run again.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn reload(&mut self, i: usize) -> Result<()> {
        let facts = self.units.facts(&self.list.runs[i])?;
        self.load(i, facts.unwrap_or_default())
    }

    /// The identifier of the folder's first session.
    pub(super) fn first_id(&self) -> String {
        let first = self.sessions.first();
        first.map_or_else(String::new, |first| first.manifest.run_id.clone())
    }

    /// Forgets all results of an algorithm, which answers otherwise on that pair now.
    pub(super) fn forget_algorithm(&mut self, label: &str, pair: u64) {
        let text = format!(
            "its result of pair {pair} is another than before: all its pairs are matched again"
        );
        Notice::new([label], text).warn();
        for run in &mut self.runs {
            let own = run.units(label);
            let paths = own.map(|(_, unit)| unit.path().to_owned());
            self.unusable.extend(paths);
            run.retain(|own, _, _| own != label);
        }
    }

    /// Manifest of the session as it begins.
    pub(super) fn manifest(&self) -> Manifest {
        let mut manifest = Manifest {
            shard: self.shard.clone(),
            warnings: Vec::new(),
            ..self.list.manifest.clone()
        };
        manifest.algorithms.truncate(self.asked);
        manifest
    }

    /// Writes what is known of the session itself.
    ///
    /// # Errors
    /// The errors of [`Self::begin`].
    pub(super) fn write(&mut self, manifest: &Manifest) -> Result<()> {
        self.units.write_session(manifest)?;
        self.sessions = self.units.sessions()?;
        Ok(())
    }

    /// Completes the list: of the algorithms of earlier commands those with all results stay.
    ///
    /// # Errors
    /// The errors of [`Self::begin`].
    pub(super) fn finish(&mut self) -> Result<()> {
        let (list, runs) = (&self.list, &self.runs);
        let is_whole = |label: &str| {
            let mut own = runs.iter().filter(|run| {
                let algorithms = list.algorithms_of(&run.run);
                algorithms.iter().any(|own| own.label == label)
            });
            own.all(|run| run.has_all(list, std::iter::once(label.to_owned())))
        };
        let earlier = list.manifest.labels().skip(self.asked);
        let partial: BTreeSet<_> = earlier.filter(|label| !is_whole(label)).collect();
        let partial: BTreeSet<_> = partial.into_iter().map(str::to_owned).collect();
        if !partial.is_empty() {
            let algorithms = &mut self.list.manifest.algorithms;
            algorithms.retain(|own| !partial.contains(&own.label));
            for run in &mut self.runs {
                run.retain(|label, _, _| !partial.contains(label));
            }
            self.units.write_plan(&self.list)?;
        }
        Ok(())
    }

    /// True if all runs have all results.
    pub(super) fn is_whole(&self) -> bool {
        self.runs.iter().all(|run| run.is_whole(&self.list))
    }
}

/// The error that a folder has shards of another run.
fn refused(plan: &EvaluationPlan<'_>, known: &ReportPlan, own: &ReportPlan) -> Result<Error> {
    let manifests = (&known.manifest, &own.manifest);
    let mut differences = manifests.0.differences(manifests.1, Purpose::Merge)?;
    if differences.is_empty() {
        differences.push("its options".to_owned());
    }
    let (folder, differences) = (plan.folder.display(), differences.join("; "));
    Ok(Error::Invalid(format!(
        "{folder}: has another run ({differences}); use the same options for all shards, another \
         -o, or --force"
    )))
}

/// What was measured.
pub(super) struct MeasuredUnits {
    /// Reason why it ended early, if it did.
    pub(super) ran: Result<()>,
    pub(super) session: EvaluationSession,
    /// False if nothing was missing.
    pub(super) has_matched: bool,
}
