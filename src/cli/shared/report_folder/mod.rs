//! The folder of a report of `svl score` and `svl merge`: what is in it, and what is written at the
//! end of a run.

mod maps;
mod part;
mod sweeps;

pub(crate) use maps::maps;
pub(crate) use part::{PART, ReportPart, ReportRun, Shard};
#[cfg(test)]
pub(crate) use sweeps::number;

use super::outputs::{FolderRule, write, write_json};
use anyhow::Context;
use std::collections::BTreeMap;
use std::path::Path;
use svl::losses::RunEnding;
use svl::manifest::{Manifest, PartRecord, hash};
use svl::matcher::Algorithm;
use svl::report::html::{PartLink, ReportPage};
use svl::report::plot::CourseMap;
use svl::report::{CheckpointRow, DriveRow, GateResult, Row, Summary, limit_results};
use svl::scenario::Limit;
use svl::score::Metric;
use svl::sink::{REPORT_RUN, ReportPictures};
use svl::stereo::CellRule;
use sweeps::sweeps;

/// Outlines and routes of the courses.
pub(crate) const COURSES: &str = "courses.json";

/// Whether a file of that name is the recording of a drive.
pub(crate) fn is_recording(name: &str) -> bool {
    name.starts_with("course-") && name.ends_with(".mcap")
}

/// What a report says besides its numbers.
#[derive(Clone, Copy)]
pub(crate) struct ReportHead<'a> {
    pub(crate) description: &'a str,
    pub(crate) rule: CellRule,
    /// Whether times are of matching alone.
    pub(crate) measured: bool,
    pub(crate) algorithms: &'a [Algorithm],
    /// By what the algorithms are sorted.
    pub(crate) sort: Option<&'a Metric>,
    /// Limits that are judged.
    pub(crate) limits: &'a [Limit],
}

/// What a report is written of.
#[derive(Default)]
pub(crate) struct ReportContent {
    pub(crate) rows: Vec<Row>,
    pub(crate) checkpoints: Vec<CheckpointRow>,
    pub(crate) pictures: ReportPictures,
    pub(crate) drives: Vec<DriveRow>,
    pub(crate) maps: Vec<CourseMap>,
}

impl ReportContent {
    /// Writes all of a report but the tables that grow with the run.
    pub(crate) fn write(
        self,
        folder: &Path,
        head: ReportHead<'_>,
        mut manifest: Manifest,
        ending: RunEnding,
    ) -> anyhow::Result<(Summary, Vec<GateResult>)> {
        let mut summary = Summary::from_rows(&self.rows, &self.checkpoints)?;
        summary.add_drives(&self.drives);
        let ReportPictures { figures, scenes } = self.pictures;
        summary.ending = ending;
        summary.rule = head.rule;
        summary.measured = head.measured;
        summary.complete(&mut manifest);
        if let Some(metric) = head.sort {
            summary.sort_by(metric);
        }
        for run in &mut manifest.runs {
            run.pairs_hash = pairs_hash(&self.rows, &run.name);
        }
        summary.write_tables(folder)?;
        write(
            &folder.join("summary.md"),
            summary.markdown(&manifest.scenario),
        )?;
        write_json(&folder.join("summary.json"), &summary)?;
        write_json(&folder.join(MANIFEST), &manifest)?;
        let gate = head.limits.iter();
        let gate: Vec<_> = gate
            .flat_map(|limit| limit_results(limit, &summary, &manifest))
            .collect();
        let rulings = gate.iter();
        let mut identity = manifest.entries();
        let note = summary.ending.note();
        identity.extend(note.map(|note| ("not scored".to_owned(), note)));
        let page = ReportPage {
            gate: rulings
                .map(|result| (result.state.words(), result.to_string()))
                .collect(),
            title: manifest.scenario.clone(),
            description: head.description.to_owned(),
            identity,
            times_ms: times_ms(&self.rows),
            summary: summary.clone(),
            sweeps: sweeps(head.algorithms),
            figures,
            scenes,
            maps: self.maps,
            parts: (manifest.parts.iter())
                .map(|part| link(folder, part))
                .collect(),
        };
        page.write(&folder.join("index.html"))?;
        Ok((summary, gate))
    }
}

/// A part as the page links it.
fn link(folder: &Path, part: &PartRecord) -> PartLink {
    let run = format!("{}/{REPORT_RUN}", part.folder);
    PartLink {
        shard: part.shard.clone(),
        machine: format!("{}, {}", part.machine.processor, part.machine.isa),
        page: format!("{}/index.html", part.folder),
        run: folder.join(&run).exists().then_some(run),
    }
}

/// Digest of the pairs of a recording, each once, in their order.
fn pairs_hash(rows: &[Row], run: &str) -> Option<String> {
    let own = rows
        .iter()
        .filter(|row| row.run.as_deref() == Some(run) && row.stress.is_none());
    let pairs: BTreeMap<_, _> = own
        .map(|row| (row.sequence, row.pair_hash.as_str()))
        .collect();
    let hashes: Vec<_> = pairs.into_values().collect();
    (!hashes.is_empty()).then(|| hash(&hashes.join("\n")))
}

/// Per algorithm the time of each pair, ms.
fn times_ms(rows: &[Row]) -> Vec<(String, Vec<f64>)> {
    let mut times: Vec<(String, Vec<f64>)> = Vec::new();
    for row in rows.iter().filter(|row| row.stress.is_none()) {
        let ms = row.total_us as f64 / 1e3;
        match times
            .iter_mut()
            .find(|(algorithm, _)| *algorithm == row.algorithm)
        {
            Some((_, of_algorithm)) => of_algorithm.push(ms),
            None => times.push((row.algorithm.clone(), vec![ms])),
        }
    }
    times
}

/// How the run of a report ended; nothing of one that was killed.
pub(crate) fn read_ending(folder: &Path) -> anyhow::Result<Option<RunEnding>> {
    let path = folder.join("summary.json");
    let text = match std::fs::read_to_string(&path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(|e| svl::Error::io(&path, e))?,
    };
    let ending = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    Ok(Some(ending))
}

/// What identifies the run of a report.
pub(crate) const MANIFEST: &str = "manifest.json";

/// The folder of a report, which a later report replaces.
pub(crate) const REPORT: FolderRule = FolderRule {
    kind: "a report",
    owns: |name| REPORT_FILES.contains(&name) || is_recording(name),
    mark: MANIFEST,
    cure: "name another folder with --out",
};

const REPORT_FILES: &[&str] = &[
    "rows.csv",
    "rows.parquet",
    "cells.csv",
    "cells.parquet",
    "checkpoints.csv",
    "checkpoints.parquet",
    MANIFEST,
    "summary.csv",
    "summary.parquet",
    "verdicts.csv",
    "verdicts.parquet",
    "drives.csv",
    "drives.parquet",
    "tracks.csv",
    "tracks.parquet",
    COURSES,
    PART,
    "summary.md",
    "summary.json",
    "index.html",
    REPORT_RUN,
];
