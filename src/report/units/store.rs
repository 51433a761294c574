//! The folder of the units: read, checked, and cleared of what is superseded.

use super::block::{FAILURES, ROWS, Seal, SealedFile, json, write_whole};
use super::{FileStamp, ReportPlan, ReportRun, RunFacts, UNITS, unit_format};
use crate::csv_rows::RowReader;
use crate::rows::{FailureRow, Record, Row};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;
use svl_core::{Error, Result};
use svl_score::manifest::{Manifest, read_json};
use xxhash_rust::xxh3::Xxh3Default;

/// The facts of a run, in its folder.
const RUN: &str = "run.json";

/// The units of a report.
#[derive(Clone, Debug)]
pub struct Units {
    folder: PathBuf,
}

/// A session, in the order of all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredSession {
    pub number: u64,
    pub manifest: Manifest,
}

/// A seal with the place of its files.
#[derive(Clone, Debug)]
pub struct StoredSeal {
    pub seal: Seal,
    folder: PathBuf,
    /// Name of its files, without their extensions.
    name: String,
}

impl StoredSeal {
    /// The file of a table with the number of its sealed bytes, if the block has it.
    pub fn table(&self, table: &str) -> Option<(PathBuf, u64)> {
        let name = format!("{}.{table}.csv", self.name);
        let file = self.seal.files.get(&name)?;
        Some((self.folder.join(name), file.bytes))
    }

    /// The file of the pictures, if the block has some.
    pub fn pictures(&self) -> Option<PathBuf> {
        let names = self.seal.files.keys();
        let name = names.rev().find(|name| name.ends_with(".json"))?;
        Some(self.folder.join(name))
    }

    /// The rows of its pairs.
    ///
    /// # Errors
    /// Those of reading the table.
    pub fn rows(&self) -> Result<Vec<Row>> {
        self.whole(ROWS)
    }

    /// The pairs that algorithms failed on.
    ///
    /// # Errors
    /// Those of reading the table.
    pub fn failures(&self) -> Result<Vec<FailureRow>> {
        self.whole(FAILURES)
    }

    /// All rows of a table.
    pub(super) fn whole<R: Record>(&self, table: &str) -> Result<Vec<R>> {
        match self.table(table) {
            Some((path, bytes)) => RowReader::open_beginning(&path, bytes)?.collect(),
            None => Ok(Vec::new()),
        }
    }

    /// The first of its files that is not what was sealed.
    fn damaged(&self) -> Option<&str> {
        let is_other = |(name, sealed): &(&String, &SealedFile)| {
            !hash_of(&self.folder.join(name), sealed.bytes).is_ok_and(|hash| hash == sealed.hash)
        };
        let mut files = self.seal.files.iter();
        files.find(is_other).map(|(name, _)| name.as_str())
    }

    /// Removes its files, the seal first.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    fn remove(&self) -> Result<()> {
        let seal = format!("{}.json", self.name);
        std::iter::once(&seal)
            .chain(self.seal.files.keys())
            .try_for_each(|name| remove_file(&self.folder.join(name)))
    }
}

impl Units {
    /// Those of a report's folder, if there are any.
    pub fn for_report(report: &Path) -> Self {
        Self {
            folder: report.join(UNITS),
        }
    }

    /// True if the report has units.
    pub fn exist(&self) -> bool {
        self.plan_path().is_file()
    }

    /// The folder of a run, which is made.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn run_folder(&self, run: &ReportRun) -> Result<PathBuf> {
        let folder = self.folder.join(run.folder());
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        Ok(folder)
    }

    fn plan_path(&self) -> PathBuf {
        self.folder.join("plan.json")
    }

    /// Waits until no other process builds the report.
    ///
    /// # Errors
    /// The file of the lock cannot be made or locked.
    pub fn lock(&self) -> Result<File> {
        let path = self.folder.join("build.lock");
        let locked = File::create(&path).and_then(|file| file.lock().map(|()| file));
        locked.map_err(|e| Error::io(&path, e))
    }

    fn sessions_folder(&self) -> PathBuf {
        self.folder.join("sessions")
    }

    /// # Errors
    /// [`Error::Io`], [`Error::Format`]; [`Error::Invalid`] for units of another version of svl.
    pub fn plan(&self) -> Result<ReportPlan> {
        if !self.are_readable() {
            return Err(Error::Invalid(format!(
                "{}: its tables are of another version of svl; `svl score` with this folder \
                 matches them again",
                self.folder.display()
            )));
        }
        read_json(&self.plan_path())
    }

    /// True unless the units are of another version of svl.
    pub fn are_readable(&self) -> bool {
        let plan = read_json::<serde_json::Value>(&self.plan_path());
        // Reading a damaged plan says more.
        plan.map_or(true, |plan| {
            plan.get("manifest").is_none() || plan["format"] == unit_format()
        })
    }

    /// True if a svl with other sources wrote the plan.
    pub fn have_other_sources(&self, sources: Option<&str>) -> bool {
        let plan = read_json::<serde_json::Value>(&self.plan_path());
        let written = plan
            .as_ref()
            .ok()
            .and_then(|plan| plan.pointer("/manifest/sources"));
        written.is_some_and(|written| written.as_str() != sources)
    }

    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write_plan(&self, plan: &ReportPlan) -> Result<()> {
        std::fs::create_dir_all(&self.folder).map_err(|e| Error::io(&self.folder, e))?;
        write_whole(&self.plan_path(), &json(plan)?)
    }

    /// The sessions, in their order.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub fn sessions(&self) -> Result<Vec<StoredSession>> {
        let mut sessions: Vec<StoredSession> = Vec::new();
        for path in json_files(&self.sessions_folder())? {
            sessions.extend(read_or_warn::<StoredSession>(&path));
        }
        sessions.sort_by(|a, b| {
            let key = |session: &StoredSession| (session.number, session.manifest.run_id.clone());
            key(a).cmp(&key(b))
        });
        Ok(sessions)
    }

    /// Writes a session, which comes after those that are there; the same again changes it.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub fn write_session(&self, manifest: &Manifest) -> Result<()> {
        let folder = self.sessions_folder();
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        let sessions = self.sessions()?;
        let mut own = sessions.iter();
        let own = own.find(|stored| stored.manifest.run_id == manifest.run_id);
        let next = sessions.last().map_or(0, |last| last.number + 1);
        let session = StoredSession {
            number: own.map_or(next, |own| own.number),
            manifest: manifest.clone(),
        };
        let path = folder.join(format!("{}.json", manifest.run_id));
        write_whole(&path, &json(&session)?)
    }

    /// The facts of a run; none of one that no session began.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`].
    pub fn facts(&self, run: &ReportRun) -> Result<Option<RunFacts>> {
        let path = self.folder.join(run.folder()).join(RUN);
        Ok(path.is_file().then(|| read_or_warn(&path)).flatten())
    }

    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write_facts(&self, facts: &RunFacts) -> Result<()> {
        let folder = self.run_folder(&facts.run)?;
        write_whole(&folder.join(RUN), &json(facts)?)
    }

    /// The seals of a run whose files are what was sealed, in the order of their blocks and, in a
    /// block, of their sessions. `damaged` gets the file of each other one.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn seals(
        &self,
        run: &ReportRun,
        sessions: &[StoredSession],
        mut damaged: impl FnMut(&StoredSeal, PathBuf),
    ) -> Result<Vec<StoredSeal>> {
        let folder = self.folder.join(run.folder());
        let mut seals = Vec::new();
        for path in json_files(&folder)? {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            // `run.json`, and the pictures.
            if name == "run" || name.contains(".pictures-") {
                continue;
            }
            let Some(seal) = read_or_warn(&path) else {
                continue;
            };
            let stored = StoredSeal {
                seal,
                folder: folder.clone(),
                name: name.into_owned(),
            };
            match stored.damaged() {
                Some(file) => {
                    let file = folder.join(file);
                    damaged(&stored, file);
                }
                None => seals.push(stored),
            }
        }
        let place = |stored: &StoredSeal| {
            let session = &stored.seal.session;
            sessions
                .iter()
                .position(|session_of_seal| session_of_seal.manifest.run_id == *session)
        };
        seals.retain(|stored| place(stored).is_some());
        seals.sort_by_cached_key(|stored| (stored.seal.block, place(stored), stored.name.clone()));
        Ok(seals)
    }

    /// Removes the units of these seals.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn remove<'a>(&self, seals: impl IntoIterator<Item = &'a StoredSeal>) -> Result<()> {
        seals.into_iter().try_for_each(StoredSeal::remove)
    }

    /// Removes the results of algorithms from the units of a seal.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn remove_algorithms(
        &self,
        stored: &StoredSeal,
        is_removed: impl Fn(&str) -> bool,
    ) -> Result<()> {
        let mut seal = stored.seal.clone();
        seal.algorithms.retain(|own| !is_removed(&own.label));
        if seal.algorithms.is_empty() {
            return stored.remove();
        }
        let path = stored.folder.join(format!("{}.json", stored.name));
        write_whole(&path, &json(&seal)?)
    }

    /// The folders of runs that no run of the plan has.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn other_runs(&self, plan: &ReportPlan) -> Result<Vec<PathBuf>> {
        let own: BTreeSet<_> = plan.runs.iter().map(ReportRun::folder).collect();
        let mut others = Vec::new();
        for path in entries(&self.folder)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path.is_dir() && name != "sessions" && !own.contains(&*name) {
                others.push(path);
            }
        }
        others.sort();
        Ok(others)
    }

    /// Removes all units.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn clear(&self) -> Result<()> {
        match std::fs::remove_dir_all(&self.folder) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(Error::io(&self.folder, error))
            }
            _ => Ok(()),
        }
    }

    /// Copies the units of another report into this one.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn copy_from(&self, other: &Self, runs: &[ReportRun]) -> Result<()> {
        let names = runs.iter().map(ReportRun::folder);
        for name in names.chain(["sessions".to_owned()]) {
            let (from, to) = (other.folder.join(&name), self.folder.join(&name));
            std::fs::create_dir_all(&to).map_err(|e| Error::io(&to, e))?;
            for path in entries(&from)? {
                let file = path.file_name().unwrap_or_default();
                if file != RUN {
                    std::fs::copy(&path, to.join(file)).map_err(|e| Error::io(&path, e))?;
                }
            }
        }
        for run in runs {
            match (other.facts(run)?, self.facts(run)?) {
                (Some(facts), None) => self.write_facts(&facts)?,
                (Some(facts), Some(mut own)) => {
                    own.join(facts);
                    self.write_facts(&own)?;
                }
                (None, _) => {}
            }
        }
        Ok(())
    }
}

/// Removes a file, if it is there.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_file(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(Error::io(path, error)),
        _ => Ok(()),
    }
}

/// What a file has; none with a warning if it is damaged: what it is of is missing then.
fn read_or_warn<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let bytes = std::fs::read(path).ok();
    let value = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    if value.is_none() {
        tracing::warn!(
            "{}: is damaged: `svl score` matches again what it is of",
            path.display()
        );
    }
    value
}

/// The paths in a folder; none if there is no folder.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let read = std::fs::read_dir(folder);
    let paths = read.and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    paths.map_err(|e| Error::io(folder, e))
}

fn json_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = entries(folder)?;
    paths.retain(|path| {
        path.extension()
            .is_some_and(|extension| extension == "json")
    });
    paths.sort();
    Ok(paths)
}

/// Hash of the first bytes of a file.
fn hash_of(path: &Path, bytes: u64) -> std::io::Result<String> {
    let mut file = File::open(path)?.take(bytes);
    let (mut hasher, mut buffer, mut whole) = (Xxh3Default::new(), vec![0; 1 << 16], 0);
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            n => {
                hasher.update(&buffer[..n]);
                whole += n as u64;
            }
        }
    }
    let is_cut = whole < bytes;
    match is_cut {
        true => Err(ErrorKind::UnexpectedEof.into()),
        false => Ok(format!("{:032x}", hasher.digest128())),
    }
}

/// The files below these paths, as they are now; a file of several that belong together counts
/// with those of its folder that have its extension, and with what describes them.
pub fn files_of(paths: impl IntoIterator<Item = PathBuf>) -> Vec<FileStamp> {
    let mut stamps = BTreeMap::new();
    for path in paths {
        if path.is_dir() {
            add_files(&path, &mut stamps);
        } else {
            let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
            let is_alone = ["mcap", "bag"].iter().any(|alone| extension == *alone);
            if let Some(folder) = path.parent().filter(|_| !is_alone) {
                let folder = if folder == Path::new("") {
                    Path::new(".")
                } else {
                    folder
                };
                for beside in entries(folder).unwrap_or_default() {
                    let own = beside.extension().unwrap_or_default().to_ascii_lowercase();
                    let describes = own == "yaml" || own == "csv" || own == "txt" || own == "json";
                    if beside.is_file() && (own == extension || describes) {
                        add(&beside, &mut stamps);
                    }
                }
            }
            add(&path, &mut stamps);
        }
    }
    stamps.into_values().collect()
}

fn add_files(folder: &Path, stamps: &mut BTreeMap<PathBuf, FileStamp>) {
    for path in entries(folder).unwrap_or_default() {
        if path.is_dir() {
            add_files(&path, stamps);
        } else {
            add(&path, stamps);
        }
    }
}

fn add(path: &Path, stamps: &mut BTreeMap<PathBuf, FileStamp>) {
    let Ok(metadata) = path.metadata() else {
        return;
    };
    let modified = metadata.modified().ok();
    let since = modified.and_then(|at| at.duration_since(UNIX_EPOCH).ok());
    let stamp = FileStamp {
        path: path.display().to_string(),
        bytes: metadata.len(),
        modified_ns: since.map_or(0, |since| since.as_nanos() as u64),
    };
    stamps.insert(path.to_owned(), stamp);
}
