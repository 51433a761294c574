//! The folder of the units: its files, each whole and with a checksum.

use super::facts::{PairFacts, RunFacts};
use super::io::{
    copy, entries, files, is_part, make_real_folder, read_checked, read_or_warn, write_checked,
};
use super::plan::{BLOCK, ReportPlan, ReportRun};
use super::unit::{StoredUnit, unit_format};
use serde::{Deserialize, Serialize};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};
use svl_files::outputs::remove_file;
use svl_score::manifest::Manifest;

/// The folder of the units in a report's.
pub const UNITS: &str = "units";

/// The list of a report.
pub const REPORT_LIST: &str = "report.json";

/// The facts of a run.
const RUN: &str = "run.json";

/// The extension of units.
const UNIT: &str = "unit";

/// The units of a report.
#[derive(Clone, Debug)]
pub struct Units {
    report: PathBuf,
    folder: PathBuf,
}

/// A process that matched pairs of the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredSession {
    /// Place among the sessions.
    number: u64,
    pub manifest: Manifest,
}

/// The part of the list that every version of svl has.
#[derive(Deserialize)]
struct PlanVersion {
    format: String,
}

/// The facts of a run with its digest: a file in the place of another is not taken.
#[derive(Serialize, Deserialize)]
struct StoredFacts<R> {
    run: String,
    facts: R,
}

/// True for the folder of a run, by its name.
fn is_run(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let digest = name.rsplit_once('-').map_or("", |(_, digest)| digest);
    let digits = digest.strip_prefix('h').unwrap_or_default();
    path.is_dir() && digits.len() == 15 && digits.bytes().all(|c| c.is_ascii_hexdigit())
}

impl Units {
    /// The units of a report's folder, if there are any.
    pub fn for_report(report: &Path) -> Self {
        Self {
            report: report.to_owned(),
            folder: report.join(UNITS),
        }
    }

    /// True if the folder is that of a report.
    pub fn exist(&self) -> bool {
        self.report.join(REPORT_LIST).is_file()
    }

    /// Waits until no other process builds the report or writes facts. Where folders cannot be
    /// opened or locked, nothing does.
    pub fn lock(&self) -> Option<File> {
        let locked = File::open(&self.folder).and_then(|file| file.lock().map(|()| file));
        locked.ok()
    }

    /// The list of the report.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`]; [`Error::Invalid`] for units of another version of svl.
    pub fn plan(&self) -> Result<ReportPlan> {
        let path = self.report.join(REPORT_LIST);
        let PlanVersion { format } = read_checked(&path)?;
        if format == unit_format() {
            return read_checked(&path);
        }
        Err(Error::Invalid(format!(
            "{}: its units are of another version of svl; `svl score` with this folder matches \
             them again",
            path.display()
        )))
    }

    /// The list of the report, if it can be used; else a warning.
    pub fn known_plan(&self) -> Option<ReportPlan> {
        let plan = self.exist().then(|| self.plan())?;
        plan.inspect_err(|error| tracing::warn!("{error}")).ok()
    }

    /// Writes the list of the report, and makes the folder of the units.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write_plan(&self, plan: &ReportPlan) -> Result<()> {
        make_real_folder(&self.folder)?;
        write_checked(&self.report.join(REPORT_LIST), plan)
    }

    fn sessions_folder(&self) -> PathBuf {
        self.folder.join("sessions")
    }

    /// The sessions, in their order; a damaged one is left out, with a warning.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn sessions(&self) -> Result<Vec<StoredSession>> {
        let paths = files(&self.sessions_folder(), "json")?;
        let mut sessions: Vec<StoredSession> = Vec::new();
        for path in &paths {
            let session = read_or_warn::<StoredSession>(path);
            let is_own = |session: &StoredSession| {
                path.file_stem()
                    .is_some_and(|stem| *stem == *session.manifest.run_id)
            };
            sessions.extend(session.filter(is_own));
        }
        let key = |session: &StoredSession| (session.number, session.manifest.run_id.clone());
        sessions.sort_by_cached_key(key);
        Ok(sessions)
    }

    /// Writes a session, which comes after those that are there; the same again changes it.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub fn write_session(&self, manifest: &Manifest) -> Result<()> {
        let sessions = self.sessions()?;
        let mut own = sessions.iter();
        let own = own.find(|stored| stored.manifest.run_id == manifest.run_id);
        let next = sessions.last().map_or(0, |last| last.number + 1);
        let session = StoredSession {
            number: own.map_or(next, |own| own.number),
            manifest: manifest.clone(),
        };
        make_real_folder(&self.sessions_folder())?;
        let name = format!("{}.json", manifest.run_id);
        write_checked(&self.sessions_folder().join(name), &session)
    }

    /// The facts of a run; none of one that was never read, or whose file is damaged.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn facts(&self, run: &ReportRun) -> Result<Option<RunFacts>> {
        let path = self.folder.join(run.folder()).join(RUN);
        let stored = path.exists();
        let stored = stored.then(|| read_or_warn::<StoredFacts<RunFacts>>(&path));
        let stored = stored.flatten().filter(|stored| stored.run == run.digest);
        Ok(stored.map(|stored| stored.facts))
    }

    /// Writes the facts of a run.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write_facts(&self, run: &ReportRun, facts: &RunFacts) -> Result<()> {
        let stored = StoredFacts {
            run: run.digest.clone(),
            facts,
        };
        write_checked(&self.run_folder(run)?.join(RUN), &stored)
    }

    /// The folder of a run, which is made.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn run_folder(&self, run: &ReportRun) -> Result<PathBuf> {
        let folder = self.folder.join(run.folder());
        make_real_folder(&folder)?;
        Ok(folder)
    }

    /// The file of a unit.
    pub fn unit_path(&self, run: &ReportRun, name: &str) -> PathBuf {
        let folder = self.folder.join(run.folder());
        folder.join(format!("{name}.{UNIT}"))
    }

    /// The pairs of a run as its units have them, up to the first that none has: what is known of a
    /// run that was killed.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn pairs_of_units(&self, run: &ReportRun) -> Result<Vec<PairFacts>> {
        let mut blocks = BTreeMap::new();
        for path in files(&self.folder.join(run.folder()), UNIT)? {
            if let Ok(Some(unit)) = StoredUnit::read(&path, &run.digest)
                && let Entry::Vacant(block) = blocks.entry(unit.block)
            {
                block.insert(unit.pairs()?);
            }
        }
        let mut pairs = Vec::new();
        for (number, (block, own)) in (0..).zip(blocks) {
            if number != block || pairs.len() as u64 != number * BLOCK {
                break;
            }
            pairs.extend(own);
        }
        Ok(pairs)
    }

    /// Removes all but these runs and units.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn prune<'a>(
        &self,
        runs: &[ReportRun],
        units: impl Iterator<Item = &'a StoredUnit>,
    ) -> Result<()> {
        let facts = runs.iter();
        let facts = facts.map(|run| self.folder.join(run.folder()).join(RUN));
        let mut kept: BTreeSet<PathBuf> = facts.collect();
        for unit in units {
            kept.insert(unit.path().to_owned());
            let session = format!("{}.json", unit.session);
            kept.insert(self.sessions_folder().join(session));
        }
        let folders: BTreeSet<_> = kept.iter().filter_map(|path| path.parent()).collect();
        for path in entries(&self.folder)? {
            if !folders.contains(&*path) {
                if is_run(&path) {
                    std::fs::remove_dir_all(&path).map_err(|e| Error::io(&path, e))?;
                }
            } else {
                let mut others = entries(&path)?;
                others.retain(|path| !kept.contains(path));
                others.iter().try_for_each(|path| remove_file(path))?;
            }
        }
        Ok(())
    }

    /// Removes links in the place of folders and files: what they lead to is neither written nor
    /// taken.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_links(&self) -> Result<()> {
        let remove = |path: &PathBuf| {
            let is_link = path.is_symlink();
            if is_link {
                tracing::warn!(
                    "{}: is a link, which svl does not follow: removed",
                    path.display()
                );
                remove_file(path)?;
            }
            Ok(is_link)
        };
        if !remove(&self.folder)? {
            for folder in entries(&self.folder)? {
                if !remove(&folder)? {
                    entries(&folder)?
                        .iter()
                        .try_for_each(|path| remove(path).map(drop))?;
                }
            }
        }
        Ok(())
    }

    /// The files that killed processes left, and those in the place of sessions that are none.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn unusable(&self, sessions: &[StoredSession]) -> Result<Vec<PathBuf>> {
        let mut paths = entries(&self.report)?;
        for folder in entries(&self.folder)? {
            paths.extend(entries(&folder)?);
        }
        let known = sessions.iter();
        let known = known.map(|own| format!("{}.json", own.manifest.run_id));
        let known = known.map(|name| self.sessions_folder().join(name));
        let known: BTreeSet<_> = known.collect();
        let is_session = |path: &PathBuf| path.parent() == Some(&*self.sessions_folder());
        paths.retain(|path| is_part(path) || is_session(path) && !known.contains(path));
        Ok(paths)
    }

    /// The number of folders of other runs than those of the report.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn other_runs(&self, plan: &ReportPlan) -> Result<usize> {
        let own = plan.runs.iter().map(|run| self.folder.join(run.folder()));
        let own: BTreeSet<_> = own.collect();
        let mut paths = entries(&self.folder)?;
        paths.retain(|path| is_run(path) && !own.contains(path));
        Ok(paths.len())
    }

    /// Copies units of a run, and the sessions that matched them, from another report.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn copy_from<'a>(
        &self,
        other: &Self,
        run: &ReportRun,
        units: impl Iterator<Item = &'a StoredUnit>,
    ) -> Result<()> {
        let folder = self.run_folder(run)?;
        make_real_folder(&self.sessions_folder())?;
        let mut sessions = BTreeSet::new();
        for unit in units {
            let path = unit.path();
            copy(path, &folder.join(path.file_name().unwrap_or_default()))?;
            sessions.insert(format!("{}.json", unit.session));
        }
        for name in sessions {
            let (from, to) = (other.sessions_folder(), self.sessions_folder());
            copy(&from.join(&name), &to.join(&name))?;
        }
        Ok(())
    }
}
