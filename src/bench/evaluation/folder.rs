//! The folder of a report of `svl score` and `svl merge`: its files, and those written at the end
//! of a run.

use super::part::PART;
use super::sweeps::sweeps;
use crate::console::Console;
use crate::outputs::{FolderRule, write, write_json};
use crate::report::html::{PartLink, ReportPage};
use crate::report::plot::CourseMap;
use crate::report::{
    CheckpointRow, DriveRow, GateResult, Row, Summary, limit_results, write_algorithms,
};
use crate::sink::{REPORT_RUN, ReportPictures};
use std::collections::BTreeMap;
use std::path::Path;
use svl_core::matcher::Algorithm;
use svl_core::stereo::CellRule;
use svl_core::{Result, counted};
use svl_data::losses::{RunEnding, RunState};
use svl_data::manifest::{Manifest, PartRecord, hash, read_json};
use svl_data::scenario::Limit;
use svl_data::score::{ColumnChoice, Metric};

/// Outlines and routes of the courses.
pub const COURSES: &str = "courses.json";

/// True if a file of that name is the recording of a drive.
pub fn is_recording(name: &str) -> bool {
    name.starts_with("course-") && name.ends_with(".mcap")
}

/// The texts of a report besides its numbers.
#[derive(Clone, Copy)]
pub struct ReportHead<'a> {
    pub description: &'a str,
    pub rule: CellRule,
    /// True if times are of matching alone.
    pub measured: bool,
    pub algorithms: &'a [Algorithm],
    pub columns: &'a ColumnChoice,
    /// Metric that the algorithms are sorted by.
    pub sort: Option<&'a Metric>,
    /// Limits that are checked.
    pub limits: &'a [Limit],
    /// The folder for the plots as files.
    pub figures: Option<&'a Path>,
}

/// The content of a report.
#[derive(Default)]
pub struct ReportContent {
    pub rows: Vec<Row>,
    pub checkpoints: Vec<CheckpointRow>,
    pub pictures: ReportPictures,
    pub drives: Vec<DriveRow>,
    pub maps: Vec<CourseMap>,
}

impl ReportContent {
    /// Writes all of a report but the tables that grow with the run, with the warnings of
    /// `console`.
    pub fn write(
        self,
        folder: &Path,
        head: ReportHead<'_>,
        mut manifest: Manifest,
        ending: RunEnding,
        console: &dyn Console,
    ) -> Result<(Summary, Vec<GateResult>)> {
        let mut summary = Summary::from_rows(&self.rows, &self.checkpoints)?;
        // Before the warnings are written.
        warn_of_nothing_scored(&manifest, &summary);
        let machines = manifest.machines().len();
        if machines > 1 {
            tracing::warn!(
                "{}: the parts ran on {machines} machines, so their times are not joined: each \
                 part's report has its own",
                manifest.scenario
            );
        }
        for warning in console.warnings() {
            if !manifest.warnings.contains(&warning) {
                manifest.warnings.push(warning);
            }
        }
        summary.add_drives(&self.drives);
        let ReportPictures { figures, scenes } = self.pictures;
        summary.ending = ending;
        summary.rule = head.rule;
        summary.columns = head.columns.clone();
        summary.measured = head.measured;
        summary.complete(&mut manifest);
        if machines > 1 {
            summary.remove_times();
        }
        if let Some(metric) = head.sort {
            summary.sort_by(metric);
        }
        summary.find_leads(&self.rows, &self.drives);
        for run in &mut manifest.runs {
            run.pairs_hash = pairs_hash(&self.rows, &run.name);
        }
        summary.write_tables(folder)?;
        write_algorithms(folder, head.algorithms)?;
        write(
            &folder.join("summary.md"),
            summary.markdown(&manifest.scenario),
        )?;
        write(&folder.join("summary.tex"), summary.headline().latex())?;
        write_json(&folder.join("summary.json"), &summary)?;
        write_json(&folder.join(MANIFEST), &manifest)?;
        let gate = head.limits.iter();
        let gate: Vec<_> = gate
            .flat_map(|limit| limit_results(limit, &summary, &manifest))
            .collect();
        let parts = manifest.parts.iter().map(|part| link(folder, part));
        let page = ReportPage {
            gate: (gate.iter())
                .map(|result| (result.state, result.to_string()))
                .collect(),
            description: head.description.to_owned(),
            times_ms: match machines {
                1 => times_ms(&self.rows),
                _ => Vec::new(),
            },
            cases: summary.case_table(&self.rows, &self.drives),
            summary: summary.clone(),
            sweeps: sweeps(head.algorithms),
            figures,
            scenes,
            maps: self.maps,
            parts: parts.collect(),
            manifest,
        };
        page.write(&folder.join("index.html"))?;
        // A run that is to be resumed leaves the folder empty for its end.
        let is_over = matches!(summary.ending.state, RunState::Complete | RunState::Lossy);
        if let Some(figures) = head.figures.filter(|_| is_over) {
            page.write_figures(figures)?;
        }
        Ok((summary, gate))
    }
}

/// Warns where frames have a truth, but no cell has enough of it to be scored. A part of a run does
/// not know the other parts.
fn warn_of_nothing_scored(manifest: &Manifest, summary: &Summary) {
    let mut of = summary.algorithms.iter();
    let of =
        of.find(|of| of.scored().is_some_and(|(_, cells)| cells == 0) && manifest.shard.is_none());
    if let Some(of) = of {
        tracing::warn!(
            "{}: no cell of {} has enough of a ground truth to be scored against it",
            manifest.scenario,
            counted(of.pairs, "pair")
        );
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

/// The end of a report's run; none for one that was killed.
pub fn read_ending(folder: &Path) -> Result<Option<RunEnding>> {
    let path = folder.join("summary.json");
    path.exists().then(|| read_json(&path)).transpose()
}

/// The file that identifies the run of a report.
pub const MANIFEST: &str = "manifest.json";

/// The folder of a report, which a later report replaces.
pub const REPORT: FolderRule = FolderRule {
    kind: "a report",
    owns: |name| REPORT_FILES.contains(&name) || is_recording(name),
    mark: MANIFEST,
    cure: "name another folder with -o",
};

const REPORT_FILES: &[&str] = &[
    "rows.csv",
    "rows.parquet",
    "cells.csv",
    "cells.parquet",
    "failures.csv",
    "failures.parquet",
    "checkpoints.csv",
    "checkpoints.parquet",
    MANIFEST,
    "algorithms.csv",
    "algorithms.parquet",
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
    "summary.tex",
    "summary.json",
    "index.html",
    REPORT_RUN,
];
