//! Merges reports of shards: their units become those of one report.

use super::shard::Shard;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use svl_core::matcher::ProgramRecord;
use svl_core::{Error, Result, counted, joined};
use svl_files::outputs::remove_file;
use svl_report::units::{PlannedAlgorithm, ReportPlan, RunUnits, Units};
use svl_score::manifest::{Manifest, Purpose};
use svl_score::notice::Notice;

/// Reports of shards of one run.
pub struct Parts(Vec<FoundPart>);

struct FoundPart {
    folder: PathBuf,
    units: Units,
    plan: ReportPlan,
    /// That of the plan, with the programs of its algorithms.
    manifest: Manifest,
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
        for (i, run) in first.plan.runs.iter().enumerate() {
            let own = self.0.iter().map(|part| &part.runs[i]);
            let mut read = own.clone().filter(|run| run.is_read());
            if let Some(found) = read.next() {
                let mut facts = found.facts.clone();
                read.for_each(|other| facts.join(&other.facts));
                units.write_facts(run, &facts)?;
            }
            for (part, run) in self.0.iter().zip(own) {
                units.copy_from(&part.units, &run.run, run.all())?;
            }
        }
        for part in &self.0 {
            for path in recordings(&part.folder)? {
                let to = out.join(path.file_name().unwrap_or_default());
                remove_file(&to)?;
                let linked =
                    std::fs::hard_link(&path, &to).or_else(|_| std::fs::copy(&path, &to).map(drop));
                linked.map_err(|e| Error::io(&path, e))?;
            }
        }
        units.write_plan(&first.plan)
    }

    /// Refuses parts of other options or programs, and warns of programs that are not known.
    fn check_run(&self) -> Result<()> {
        let first = &self.0[0];
        for found in &self.0[1..] {
            let (own, other) = (&first.manifest, &found.manifest);
            let mut differences = own.differences(other, Purpose::Merge)?;
            if differences.is_empty() && first.plan.digest() != found.plan.digest() {
                differences.push("its options".to_owned());
            }
            if !differences.is_empty() {
                let (folder, other) = (found.folder.display(), first.folder.display());
                let differences = differences.join("; ");
                return Err(Error::Invalid(format!(
                    "{folder}: is not of the same run as {other}: {differences}"
                )));
            }
        }
        let algorithms = first.manifest.algorithms.iter();
        for record in algorithms.filter(|_| self.0.len() > 1) {
            let is_unknown = |own: &ProgramRecord| own.version.is_none() && own.model.is_none();
            if record.program.as_ref().is_some_and(is_unknown) {
                let text = "its program reports no version and no model, so the parts may have run \
                            different programs";
                Notice::new([&*record.label], text).warn();
            }
        }
        Ok(())
    }

    /// Refuses parts that read other pairs, or another truth, of one run.
    fn check_inputs(&self) -> Result<()> {
        let first = &self.0[0];
        for found in &self.0[1..] {
            for (own, other) in first.runs.iter().zip(&found.runs) {
                let are_read = own.is_read() && other.is_read();
                if are_read && own.facts.inputs() != other.facts.inputs() {
                    let (folder, other) = (found.folder.display(), first.folder.display());
                    let run = own.run.words();
                    return Err(Error::Invalid(format!(
                        "{folder}: is not of the same run as {other}: the pairs, calibration or \
                         truth of {run} differ; score both parts again"
                    )));
                }
            }
        }
        Ok(())
    }

    /// Refuses parts that together lack results.
    fn check_whole(&self) -> Result<()> {
        let plan = &self.0[0].plan;
        let (mut partial, mut absent) = (Vec::new(), None);
        for (i, run) in plan.runs.iter().enumerate() {
            let part_runs = || self.0.iter().map(|part| &part.runs[i]);
            let read = part_runs().find(|run| plan.is_driven() || run.is_read());
            let blocks = read.map(|run| run.blocks(plan));
            let lacked = |own: &PlannedAlgorithm<'_>| {
                let has = |block| part_runs().any(|run| run.unit(own.label, block).is_some());
                let block = (0..blocks?).find(|block| !has(*block))?;
                let name = own.unit_name(block, &read?.facts.pairs);
                Some(Units::for_report(Path::new("")).unit_path(run, &name))
            };
            let file = plan.algorithms_of(run).iter().find_map(lacked);
            if blocks.is_none() || file.is_some() {
                partial.push(run.words());
            }
            absent = absent.or(file);
        }
        let Some(first) = partial.first() else {
            return Ok(());
        };
        let sessions = self.0.iter().flat_map(|part| &part.sessions);
        let shards: BTreeSet<_> = sessions.filter_map(|own| own.shard.as_deref()).collect();
        let mut all = shards.iter().filter_map(|own| own.parse::<Shard>().ok());
        if let (Some(file), Some(shard)) = (absent, all.next())
            && shard.count == shards.len()
        {
            return Err(Error::Invalid(format!(
                "{}: is in none of the parts, which are of all {} shards; copy or run its part \
                 again",
                file.display(),
                shards.len()
            )));
        }
        let (runs, shards) = (counted(partial.len() as u64, "run"), joined(shards));
        Err(Error::Invalid(format!(
            "{runs} incomplete, from {first} on: the parts have shard {shards}; run the others, \
             or these again"
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
        let read = |run| RunUnits::read(&units, &plan, run, &sessions, |file| damaged = Some(file));
        let runs = plan.runs.iter().map(read).collect::<Result<Vec<_>>>()?;
        if let Some(file) = damaged {
            let file = file.display();
            return Err(Error::Invalid(format!(
                "{file}: was changed after it was written; copy or run the part again"
            )));
        }
        if let Some(error) = runs.iter().find_map(|run| run.facts.error.as_ref()) {
            return Err(Error::Invalid(format!(
                "{shown}: is incomplete: {error}; run it again"
            )));
        }
        let sessions: Vec<_> = sessions.into_iter().map(|own| own.manifest).collect();
        let mut manifest = plan.manifest.clone();
        for record in &mut manifest.algorithms {
            let own = sessions.iter().flat_map(|session| &session.algorithms);
            let own = own.filter(|own| own.label == record.label);
            record.program = own.filter_map(|own| own.program.clone()).next_back();
        }
        Ok(Self {
            folder: folder.to_owned(),
            units,
            plan,
            runs,
            manifest,
            sessions,
        })
    }
}

/// The recordings of drives in a report, and its runs for Rerun.
fn recordings(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    let paths = entries.flatten().map(|entry| entry.path());
    let is_recording = |path: &PathBuf| path.extension().is_some_and(|own| own == "mcap");
    Ok(paths.filter(is_recording).collect())
}
