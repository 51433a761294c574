//! Merges the parts of a report that shards of a run left.

mod tables;

use super::folder::{COURSES, MANIFEST, ReportContent, ReportHead, read_ending};
use super::maps::maps;
use super::part::{PART, ReportPart, ReportRun};
use crate::console::{Console, Unit};
use crate::outputs::write_json;
use crate::report::{CellRow, CoursePlan, DriveRow, FailureRow, Summary, TrackRow, read_rows};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl_core::matcher::{Algorithm, ProgramRecord};
use svl_core::{Error, Result};
use svl_data::files::relative_path;
use svl_data::losses::{LossLimit, Missing, RunEnding, RunState};
use svl_data::manifest::{AlgorithmRecord, Manifest, PartRecord, Purpose, read_json};
use svl_data::score::ColumnChoice;
use tables::{FoundPart, MergeOrder, TableMerge};

/// All parts of one report.
pub struct Parts(Vec<FoundPart>);

impl Parts {
    /// Reads the folders that `svl score --shard` wrote.
    ///
    /// # Errors
    /// [`Error::Invalid`] for parts that are incomplete, missing, or of another run; [`Error::Io`],
    /// [`Error::Format`].
    pub fn read(folders: &[PathBuf]) -> Result<Self> {
        read_parts(folders).map(Self)
    }

    /// The folder of the part that is at that path.
    pub fn folder_at(&self, path: &Path) -> Option<&Path> {
        let path = path.canonicalize().ok()?;
        let mut folders = self.0.iter().map(|part| part.folder.as_path());
        folders.find(|folder| folder.canonicalize().is_ok_and(|folder| folder == path))
    }

    /// Writes their report into a folder, and its plots as files into `figures`. `allow_loss`: the
    /// limit of losses, in place of that of the run.
    ///
    /// # Errors
    /// As [`Parts::read`].
    pub fn merge(
        &self,
        out: &Path,
        figures: Option<&Path>,
        allow_loss: Option<LossLimit>,
        console: &dyn Console,
    ) -> Result<Summary> {
        merge(&self.0, (out, figures), allow_loss, console)
    }
}

/// The parts in the order of their shards, all of one run.
fn read_parts(folders: &[PathBuf]) -> Result<Vec<FoundPart>> {
    let mut parts: Vec<_> = folders
        .iter()
        .map(|folder| read_part(folder))
        .collect::<Result<_>>()?;
    parts.sort_by_key(|found| found.part.shard.number);
    let first = &parts[0];
    for pair in parts.windows(2) {
        let (before, found) = (&pair[0], &pair[1]);
        let shown = found.folder.display();
        if found.part.shard.of != first.part.shard.of {
            return Err(Error::Invalid(format!(
                "{shown}: is shard {}, but {} is {}: all parts need the same number of shards",
                found.part.shard,
                first.folder.display(),
                first.part.shard
            )));
        }
        let differences = first
            .manifest
            .differences(&found.manifest, Purpose::Merge)?;
        if !differences.is_empty() {
            let (first, why) = (first.folder.display(), differences.join("; "));
            return Err(Error::Invalid(format!(
                "{shown}: is not of the same run as {first}: {why}"
            )));
        }
        let of_first = ReportPart {
            shard: found.part.shard,
            tables: found.part.tables.clone(),
            inputs: found.part.inputs.clone(),
            ..first.part.clone()
        };
        if found.part != of_first {
            let first = first.folder.display();
            return Err(Error::Invalid(format!(
                "{shown}: is not of the same run as {first}: its runs or cell rule differ"
            )));
        }
        if found.part.shard == before.part.shard {
            let before = before.folder.display();
            return Err(Error::Invalid(format!(
                "{shown}: is shard {}, and so is {before}",
                found.part.shard
            )));
        }
    }
    check_inputs(&parts)?;
    let has = |number: usize| parts.iter().any(|found| found.part.shard.number == number);
    let of = first.part.shard.of;
    let missing: Vec<_> = (1..=of).filter(|&number| !has(number)).collect();
    if let [first, ..] = missing[..] {
        let names: Vec<_> = missing.iter().take(5).map(usize::to_string).collect();
        let more = if missing.len() > 5 { ", …" } else { "" };
        return Err(Error::Invalid(format!(
            "shard {}{more} of {of} missing: run it, svl score … --shard {first}/{of} -o DIR",
            names.join(", ")
        )));
    }
    Ok(parts)
}

/// The metrics that the tables of a run show.
fn columns(manifest: &Manifest) -> Result<ColumnChoice> {
    let written = manifest
        .description
        .as_ref()
        .and_then(|of| of.get("columns"));
    let columns = written.map(ColumnChoice::deserialize).transpose();
    let columns = columns.map_err(|e| Error::Invalid(format!("{MANIFEST}: columns: {e}")))?;
    Ok(columns.unwrap_or_default())
}

/// Refuses parts that read other pairs, or another truth, of one run.
fn check_inputs(parts: &[FoundPart]) -> Result<()> {
    let mut known: BTreeMap<&str, (&str, &Path)> = BTreeMap::new();
    for found in parts {
        for (run, inputs) in &found.part.inputs {
            let (first, folder) = *known.entry(run).or_insert((inputs, &found.folder));
            if first != inputs {
                return Err(Error::Invalid(format!(
                    "{}: is not of the same run as {}: the pairs, calibration or truth of {run} \
                     differ; score both parts again",
                    found.folder.display(),
                    folder.display()
                )));
            }
        }
    }
    Ok(())
}

fn read_part(folder: &Path) -> Result<FoundPart> {
    let shown = folder.display();
    if !folder.join(PART).is_file() {
        return Err(Error::Invalid(format!(
            "{shown}: is not a part of a report; `svl score --shard I/N` writes them"
        )));
    }
    let part = ReportPart::read(folder)?;
    let manifest = Manifest::read(folder)?;
    let again = "run it again, with --resume";
    let Some(ending) = read_ending(folder)? else {
        return Err(Error::Invalid(format!(
            "{shown}: is incomplete: it was killed; {again}"
        )));
    };
    if !ending.is_whole() {
        let why = ending.incomplete.unwrap_or_default();
        return Err(Error::Invalid(format!(
            "{shown}: is incomplete: {why}; {again}"
        )));
    }
    if part.tables.is_empty() {
        return Err(Error::Invalid(format!("{shown}: is incomplete; {again}")));
    }
    if let Some(table) = part.damaged(folder) {
        return Err(Error::Invalid(format!(
            "{shown}: {table} was changed after it was written; copy or run the part again"
        )));
    }
    Ok(FoundPart {
        folder: folder.to_owned(),
        part,
        manifest,
        missing: ending.missing,
    })
}

fn merge(
    parts: &[FoundPart],
    (out, figures): (&Path, Option<&Path>),
    allow_loss: Option<LossLimit>,
    console: &dyn Console,
) -> Result<Summary> {
    let part = &parts[0].part;
    let manifest = merged_manifest(parts, out)?;
    warn_of_unknown_programs(parts, &manifest);
    write_json(&out.join(MANIFEST), &manifest)?;
    let tables = TableMerge {
        parts,
        out,
        order: MergeOrder::new(part, &manifest),
        id: manifest.run_id.clone(),
        bar: console.bar("merge", Unit::Rows, None),
    };
    let mut collected = ReportContent::default();
    tables.merge("cells", |_: &[CellRow]| ())?;
    tables.merge("failures", |_: &[FailureRow]| ())?;
    tables.merge("rows", |rows| collected.rows.extend_from_slice(rows))?;
    if part.driven {
        merge_drives(&tables, &mut collected)?;
    } else {
        let kept = &mut collected.checkpoints;
        tables.merge("checkpoints", |rows| kept.extend_from_slice(rows))?;
    }
    drop(tables);
    let algorithms = manifest
        .algorithms
        .iter()
        .filter_map(algorithm)
        .collect::<Vec<_>>();
    let head = ReportHead {
        description: &part.description,
        rule: part.rule,
        measured: !part.driven,
        algorithms: &algorithms,
        columns: &columns(&manifest)?,
        sort: None,
        limits: &[],
        figures,
    };
    let mut missing = Missing::default();
    parts
        .iter()
        .for_each(|found| missing.add(found.missing.clone()));
    if !part.driven {
        // Shards with other algorithms read the same pairs; each algorithm has every pair once.
        let pairs = missing.algorithms.values().map(|of| of.pairs).max();
        missing.pairs = pairs.unwrap_or(missing.pairs);
    }
    let limits = match allow_loss {
        Some(limit) => vec![Some(limit)],
        None => {
            let limits = parts.iter().map(|found| found.manifest.allow_loss());
            limits.collect::<Result<_>>()?
        }
    };
    // The strictest of the parts' limits holds for all of them.
    let endings = limits.into_iter();
    let endings = endings.map(|limit| RunEnding::new(missing.clone(), limit));
    let endings: Vec<_> = endings.collect();
    let strictest = endings
        .iter()
        .find(|ending| ending.state == RunState::Lossy);
    let ending = strictest.unwrap_or(&endings[0]).clone();
    let (summary, _) = collected.write(out, head, manifest, ending, console)?;
    Ok(summary)
}

/// Warns of algorithms whose program may differ between the parts.
fn warn_of_unknown_programs(parts: &[FoundPart], manifest: &Manifest) {
    for record in manifest.algorithms.iter().filter(|_| parts.len() > 1) {
        let is_unknown = |p: &ProgramRecord| p.version.is_none() && p.model.is_none();
        if record.program.as_ref().is_some_and(is_unknown) {
            tracing::warn!(
                "{}: its program reports no version and no model, so the parts may have run \
                 different programs",
                record.label
            );
        }
    }
}

/// An algorithm of a manifest; those behind filters cannot be built of it.
fn algorithm(record: &AlgorithmRecord) -> Option<Algorithm> {
    let text = match record.parameters.as_str() {
        "" => record.name.clone(),
        parameters => format!("{}:{parameters}", record.name),
    };
    let algorithm: Algorithm = text.parse().ok()?;
    Some(algorithm.called(record.label.clone()))
}

fn merge_drives(tables: &TableMerge<'_>, collected: &mut ReportContent) -> Result<()> {
    let mut drives: Vec<DriveRow> = Vec::new();
    let mut plans: BTreeMap<Option<usize>, CoursePlan> = BTreeMap::new();
    for found in tables.parts {
        let folder = relative(&found.folder, tables.out);
        for mut row in read_rows::<DriveRow>(&found.folder.join("drives.csv"))? {
            row.recording = row.recording.map(|name| format!("{folder}/{name}"));
            drives.push(row);
        }
        let path = found.folder.join(COURSES);
        let own: Vec<CoursePlan> = read_json(&path)?;
        let place = |plan: &CoursePlan| tables.order.run(&ReportRun::course(plan.seed, None));
        plans.extend(own.into_iter().map(|plan| (place(&plan), plan)));
    }
    let mut track: Vec<TrackRow> = Vec::new();
    tables.merge("tracks", |rows| track.extend_from_slice(rows))?;
    let plans: Vec<_> = plans.into_values().collect();
    write_json(&tables.out.join(COURSES), &plans)?;
    collected.drives = tables.sort("drives", drives)?;
    collected.maps = maps(&plans, &collected.drives, &track);
    Ok(())
}

/// The manifest of the whole: that of the first part, with what the others add.
fn merged_manifest(parts: &[FoundPart], out: &Path) -> Result<Manifest> {
    let first = &parts[0].manifest;
    let record = |found: &FoundPart| PartRecord {
        shard: found.part.shard.to_string(),
        run_id: found.manifest.run_id.clone(),
        began: found.manifest.began.clone(),
        folder: relative(&found.folder, out),
        machine: found.manifest.machine.clone(),
    };
    let own = Manifest::new(&first.scenario, &[])?;
    let mut manifest = Manifest {
        run_id: own.run_id,
        began: own.began,
        shard: None,
        parts: parts.iter().map(record).collect(),
        warnings: warnings(parts),
        resumed: Vec::new(),
        ..first.clone()
    };
    for (i, record) in manifest.algorithms.iter_mut().enumerate() {
        let all = parts
            .iter()
            .filter_map(|found| found.manifest.algorithms.get(i));
        record.memory_bytes = all.clone().filter_map(|a| a.memory_bytes).max();
        record.failed_pairs = all.clone().map(|a| a.failed_pairs).sum();
        record.failure = all.clone().filter_map(|a| a.failure.clone()).next_back();
        let programs = all.filter_map(|a| a.program.clone());
        record.program = programs.reduce(|one, other| other.after(&one));
    }
    Ok(manifest)
}

/// The warnings of the parts, each once.
fn warnings(parts: &[FoundPart]) -> Vec<String> {
    let mut warnings = Vec::new();
    for warning in parts.iter().flat_map(|found| &found.manifest.warnings) {
        if !warnings.contains(warning) {
            warnings.push(warning.clone());
        }
    }
    warnings
}

/// A part's folder, as a link of the report's page has it.
fn relative(folder: &Path, from: &Path) -> String {
    relative_path(folder, from).to_string_lossy().into_owned()
}
