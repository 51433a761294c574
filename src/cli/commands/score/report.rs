//! The report of `svl score` under way: manifest, sinks, and what is written at the end.

use super::drive;
use super::sweep::sweeps;
use crate::cli::shared::live::LiveTable;
use crate::cli::shared::outputs::{FolderRule, write, write_json};
use crate::cli::shared::progress::Progress;
use crate::cli::shared::runner;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::manifest::{Manifest, RunRecord, hash};
use svl::report::html::ReportPage;
use svl::report::plot::CourseMap;
use svl::report::{CheckpointRow, DriveRow, GateResult, ResultLog, Row, Summary};
use svl::run::{Matchers, Outcome, Pace};
use svl::scenario::Scenario;
use svl::score::{Judge, Metric};
use svl::sink::{
    REPORT_RUN, ReportPictures, RerunDetail, RerunTarget, RunInfo, RunStart, SinkRequest, Sinks,
};
use svl::source::{RunSource, Source};

/// Most algorithms that Rerun shows.
const MAX_SHOWN: usize = 32;

pub(super) struct ScoreReport {
    folder: PathBuf,
    manifest: Manifest,
    /// What an earlier part of the run left.
    log: ResultLog,
    sinks: Sinks,
    live: LiveTable,
    pace: Pace,
}

/// What identifies a report, and where it goes on from.
pub(super) fn report_manifest(
    scenario: &Scenario,
    runs: Vec<RunRecord>,
    pace: Pace,
) -> anyhow::Result<Manifest> {
    let mut manifest = Manifest::new(&scenario.name, Some(&scenario.text), &scenario.algorithms)?;
    manifest.set_rule(scenario.cells);
    manifest.times = Some(pace.times());
    manifest.runs = runs;
    Ok(manifest)
}

impl ScoreReport {
    pub(super) fn begin(
        scenario: &Scenario,
        folder: &Path,
        rerun: Option<(RerunTarget, RerunDetail)>,
        (manifest, log): (Manifest, ResultLog),
        live: &LiveTable,
        pace: Pace,
    ) -> anyhow::Result<Self> {
        write_json(&folder.join(MANIFEST), &manifest)?;
        let info = RunInfo::new(&manifest, scenario.wireframe(None));
        let mut sinks = Sinks::open(SinkRequest {
            report: Some(folder),
            // More have no room in a viewer, nor the file on a disk.
            rerun: rerun
                .filter(|_| scenario.algorithms.len() <= MAX_SHOWN)
                .map(|(target, detail)| (target, detail, info)),
            ..SinkRequest::default()
        })?;
        sinks.push(live.clone());
        Ok(Self {
            folder: folder.to_owned(),
            manifest,
            log,
            sinks,
            live: live.clone(),
            pace,
        })
    }

    /// Scores a run.
    pub(super) fn take(
        &mut self,
        (run, judge): &mut (RunSource, Judge),
        matchers: &mut Matchers,
        quiet: bool,
    ) -> (Outcome, svl::Result<()>) {
        let start = RunStart {
            manifest: &self.manifest,
            log: Some(&self.log),
            seed: run.seed,
            judge,
        };
        let title = match run.seed {
            Some(seed) => format!("score {}, seed {seed}", self.manifest.scenario),
            None => format!("score {}", run.name()),
        };
        let title = match &judge.run.stress {
            Some(stress) => format!("{title}, {stress}"),
            None => title,
        };
        let progress = Progress::with_table(&title, run.pairs(), quiet, Some(&self.live));
        let sinks = match &judge.run.stress {
            None => self.sinks.as_mut_slice(),
            Some(_) => self.sinks.tables_mut(),
        };
        runner::run_through(run, matchers, &start, self.pace, sinks, progress)
    }

    pub(super) fn finish(
        self,
        scenario: &Scenario,
        matchers: &Matchers,
        sort: Option<&Metric>,
        gate: bool,
        incomplete: Option<String>,
    ) -> anyhow::Result<(Summary, Vec<GateResult>)> {
        let Self {
            folder,
            mut manifest,
            ..
        } = self;
        let (results, finished) = self.sinks.finish();
        finished?;
        matchers.complete(&mut manifest);
        let collected = Collected {
            rows: results.rows,
            checkpoints: results.checkpoints,
            pictures: results.pictures,
            ..Collected::default()
        };
        let measured = true;
        collected.write(
            &folder,
            scenario,
            manifest,
            (sort, gate),
            (measured, incomplete),
        )
    }
}

/// A run of `svl score` that is over, and what it wrote.
pub(super) struct Scored {
    /// Why it ended early, if it did.
    pub(super) ran: anyhow::Result<()>,
    /// What came before is reported all the same.
    pub(super) finished: anyhow::Result<(Summary, Vec<GateResult>)>,
    pub(super) total: Outcome,
    /// Folders of interrupted parts, which the report holds now.
    pub(super) others: Vec<PathBuf>,
}

/// What a report is written of.
#[derive(Default)]
pub(super) struct Collected {
    pub(super) rows: Vec<Row>,
    pub(super) checkpoints: Vec<CheckpointRow>,
    pub(super) pictures: ReportPictures,
    pub(super) drives: Vec<DriveRow>,
    pub(super) maps: Vec<CourseMap>,
}

impl Collected {
    /// Writes all of a report but the tables that grow with the run. `measured`: whether times are
    /// of matching alone; `incomplete`: why the run is.
    pub(super) fn write(
        self,
        folder: &Path,
        scenario: &Scenario,
        mut manifest: Manifest,
        (sort, gate): (Option<&Metric>, bool),
        (measured, incomplete): (bool, Option<String>),
    ) -> anyhow::Result<(Summary, Vec<GateResult>)> {
        let mut summary = Summary::from_rows(&self.rows, &self.checkpoints)?;
        summary.add_drives(&self.drives);
        let ReportPictures { figures, scenes } = self.pictures;
        summary.incomplete = incomplete;
        summary.rule = scenario.cells;
        summary.measured = measured;
        summary.complete(&mut manifest);
        if let Some(metric) = sort {
            summary.sort_by(metric);
        }
        for run in &mut manifest.runs {
            run.pairs_hash = pairs_hash(&self.rows, &run.name);
        }
        summary.write_tables(folder)?;
        write(&folder.join("summary.md"), summary.markdown(&scenario.name))?;
        write_json(&folder.join("summary.json"), &summary)?;
        write_json(&folder.join(MANIFEST), &manifest)?;
        let limits = if gate { &scenario.gate[..] } else { &[] };
        let limits = limits.iter();
        let gate: Vec<_> = limits
            .flat_map(|limit| limit.judge(&summary, &manifest))
            .collect();
        let rulings = gate.iter();
        let page = ReportPage {
            gate: rulings
                .map(|result| (result.word(), result.to_string()))
                .collect(),
            title: scenario.name.clone(),
            description: scenario.description.clone(),
            identity: manifest.entries(),
            times_ms: times_ms(&self.rows),
            summary: summary.clone(),
            sweeps: sweeps(&scenario.algorithms),
            figures,
            scenes,
            maps: self.maps,
        };
        page.write(&folder.join("index.html"))?;
        Ok((summary, gate))
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

/// What identifies the run of a report.
pub(super) const MANIFEST: &str = "manifest.json";

/// The folder of a report, which a later report replaces.
pub(super) const REPORT: FolderRule = FolderRule {
    kind: "a report",
    owns: |name| REPORT_FILES.contains(&name) || drive::is_recording(name),
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
    drive::COURSES,
    "summary.md",
    "summary.json",
    "index.html",
    REPORT_RUN,
];
