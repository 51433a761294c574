//! Merges reports of shards: their units become those of one report.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use svl_core::matcher::ProgramRecord;
use svl_core::{Error, Result, counted};
use svl_report::units::{ReportPlan, RunUnits, Units};
use svl_score::manifest::{Manifest, Purpose};

/// Reports of shards of one run.
pub struct Parts(Vec<FoundPart>);

struct FoundPart {
    folder: PathBuf,
    units: Units,
    plan: ReportPlan,
    runs: Vec<RunUnits>,
    sessions: Vec<Manifest>,
}

impl Parts {
    /// Reads the folders that `svl score --shard` wrote.
    ///
    /// # Errors
    /// [`Error::Usage`] for a part that is named twice; [`Error::Invalid`] for parts that are
    /// damaged, of another run, or not all; [`Error::Io`], [`Error::Format`].
    pub fn read(folders: &[PathBuf]) -> Result<Self> {
        let mut known = BTreeSet::new();
        for folder in folders {
            if !known.insert(folder.canonicalize().map_err(|e| Error::io(folder, e))?) {
                let shown = folder.display();
                return Err(Error::Usage(format!("{shown}: this part is named twice")));
            }
        }
        let parts = folders.iter().map(|folder| FoundPart::read(folder));
        let parts = Self(parts.collect::<Result<_>>()?);
        parts.check_run()?;
        parts.check_programs()?;
        parts.check_inputs()?;
        parts.check_whole()?;
        Ok(parts)
    }

    /// The folder of the part that a path is in, or is.
    pub fn folder_around(&self, path: &Path) -> Option<&Path> {
        let path = std::path::absolute(path).ok()?;
        // A path that is not there yet is in the nearest folder that is.
        let path = path.ancestors().find_map(|own| own.canonicalize().ok())?;
        let mut folders = self.0.iter().map(|part| part.folder.as_path());
        folders.find(|folder| folder.canonicalize().is_ok_and(|own| path.starts_with(own)))
    }

    /// Copies their units, and the recordings of drives, into the folder of a report.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn copy_into(&self, out: &Path) -> Result<()> {
        let (units, first) = (Units::for_report(out), &self.0[0]);
        units.clear()?;
        units.write_plan(&first.plan)?;
        for part in &self.0 {
            units.copy_from(&part.units, &first.plan.runs)?;
            for path in recordings(&part.folder)? {
                let to = out.join(path.file_name().unwrap_or_default());
                let linked =
                    std::fs::hard_link(&path, &to).or_else(|_| std::fs::copy(&path, &to).map(drop));
                linked.map_err(|e| Error::io(&path, e))?;
            }
        }
        Ok(())
    }

    fn check_run(&self) -> Result<()> {
        let first = &self.0[0];
        for found in &self.0[1..] {
            let purpose = Purpose::Merge;
            let differences = first
                .plan
                .manifest
                .differences(&found.plan.manifest, purpose)?;
            if !differences.is_empty() {
                return Err(Error::Invalid(format!(
                    "{}: is not of the same run as {}: {}",
                    found.folder.display(),
                    first.folder.display(),
                    differences.join("; ")
                )));
            }
        }
        Ok(())
    }

    /// Refuses parts that ran different programs, and warns of those that may have.
    fn check_programs(&self) -> Result<()> {
        for label in self.0[0].plan.labels() {
            let part_program = |part: &FoundPart| {
                let program = part.program(label)?;
                Some((part.folder.clone(), program))
            };
            let programs: Vec<_> = self.0.iter().filter_map(part_program).collect();
            let Some((folder, first)) = programs.first() else {
                continue;
            };
            let other = programs
                .iter()
                .find(|(_, program)| program.identity() != first.identity());
            if let Some((other, program)) = other {
                return Err(Error::Invalid(format!(
                    "{}: is not of the same run as {}: {label}: {} and {}",
                    other.display(),
                    folder.display(),
                    first.identity(),
                    program.identity()
                )));
            }
            if programs.len() > 1 && first.version.is_none() && first.model.is_none() {
                tracing::warn!(
                    "{label}: its program reports no version and no model, so the parts may have \
                     run different programs"
                );
            }
        }
        Ok(())
    }

    /// Refuses parts that read other pairs, or another truth, of one run.
    fn check_inputs(&self) -> Result<()> {
        let first = &self.0[0];
        for found in &self.0[1..] {
            for (own, other) in first.runs.iter().zip(&found.runs) {
                let [a, b] = [own, other].map(|run| run.facts.as_ref()?.end.as_ref());
                if let (Some(a), Some(b)) = (a, b)
                    && a.inputs != b.inputs
                {
                    return Err(Error::Invalid(format!(
                        "{}: is not of the same run as {}: the pairs, calibration or truth of {} \
                         differ; score both parts again",
                        found.folder.display(),
                        first.folder.display(),
                        own.run.words()
                    )));
                }
            }
        }
        Ok(())
    }

    /// Refuses parts that together lack results.
    fn check_whole(&self) -> Result<()> {
        let plan = &self.0[0].plan;
        let mut partial = Vec::new();
        for (i, run) in plan.runs.iter().enumerate() {
            let part_runs = || self.0.iter().map(|part| &part.runs[i]);
            let pairs = match plan.is_driven() {
                true => Some(1),
                false => part_runs().filter_map(RunUnits::pairs).next(),
            };
            let count = |label: &str| {
                let places = part_runs().filter_map(|run| run.kept.places(label));
                let places: BTreeSet<_> = places.flat_map(|places| places.keys()).collect();
                places.len() as u64
            };
            if pairs.is_none()
                || plan
                    .labels()
                    .iter()
                    .any(|label| Some(count(label)) != pairs)
            {
                partial.push(run.words());
            }
        }
        let Some(first) = partial.first() else {
            return Ok(());
        };
        let shards: Vec<_> = self.0.iter().flat_map(|part| &part.sessions).collect();
        let shards = shards
            .into_iter()
            .filter_map(|session| session.shard.clone());
        let mut shards: Vec<_> = shards.collect();
        shards.sort();
        shards.dedup();
        Err(Error::Invalid(format!(
            "{} incomplete, from {first} on: the parts have shard {}; run the others, or these \
             again",
            counted(partial.len() as u64, "run"),
            shards.join(", ")
        )))
    }
}

impl FoundPart {
    fn read(folder: &Path) -> Result<Self> {
        let (shown, units) = (folder.display(), Units::for_report(folder));
        if !units.exist() {
            return Err(Error::Invalid(format!(
                "{shown}: is not a report; `svl score --shard I/N` writes the parts of one"
            )));
        }
        let (plan, sessions) = (units.plan()?, units.sessions()?);
        let mut damaged = None;
        let runs = plan.runs.iter().map(|run| {
            RunUnits::read(&units, &plan, run, &sessions, |_, file| {
                damaged = Some(file);
            })
        });
        let runs = runs.collect::<Result<Vec<_>>>()?;
        if let Some(file) = damaged {
            return Err(Error::Invalid(format!(
                "{}: was changed after it was written; copy or run the part again",
                file.display()
            )));
        }
        let errors = runs.iter().flat_map(|run| &run.facts);
        if let Some(error) = errors.filter_map(|facts| facts.error.as_ref()).next() {
            return Err(Error::Invalid(format!(
                "{shown}: is incomplete: {error}; run it again"
            )));
        }
        Ok(Self {
            folder: folder.to_owned(),
            units,
            plan,
            runs,
            sessions: sessions
                .into_iter()
                .map(|session| session.manifest)
                .collect(),
        })
    }

    /// The program behind an algorithm.
    fn program(&self, label: &str) -> Option<ProgramRecord> {
        let records = self.sessions.iter().flat_map(|session| &session.algorithms);
        let own = records.filter(|record| record.label == label);
        own.filter_map(|record| record.program.clone()).next_back()
    }
}

/// The recordings of drives in a report, and its runs for Rerun.
fn recordings(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    let paths = entries.flatten().map(|entry| entry.path());
    let is_recording = |path: &PathBuf| {
        path.extension()
            .is_some_and(|extension| extension == "mcap")
    };
    Ok(paths.filter(is_recording).collect())
}
