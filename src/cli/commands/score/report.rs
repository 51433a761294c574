//! The report of `svl score` under way: manifest, sinks, and what is written at the end.

use super::Args;
use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::WarningLog;
use std::path::{Path, PathBuf};
use svl::console::Watch;
use svl::evaluation::{MANIFEST, ReportContent, ReportHead, Shard};
use svl::losses::RunEnding;
use svl::manifest::Manifest;
use svl::outputs::write_json;
use svl::report::{GateResult, ResultLog, Summary};
use svl::run::{Matchers, Outcome, Pace, run_through};
use svl::scenario::Scenario;
use svl::score::Judge;
use svl::sink::{
    LiveTable, RerunDetail, RerunTarget, RunInfo, RunStart, SinkRequest, Sinks, Viewer,
    ViewerRequest,
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
    description: serde_json::Value,
    pace: Pace,
    shard: Option<Shard>,
) -> anyhow::Result<Manifest> {
    let mut manifest = Manifest::new(&scenario.name, &scenario.algorithms)?;
    manifest.description = Some(description);
    manifest.set_rule(scenario.cells);
    manifest.times = Some(pace.times());
    manifest.shard = shard.map(String::from);
    Ok(manifest)
}

impl ScoreReport {
    pub(super) fn begin(
        scenario: &Scenario,
        folder: &Path,
        rerun: Option<(&'static dyn Viewer, RerunTarget, RerunDetail)>,
        (manifest, log): (Manifest, ResultLog),
        live: &LiveTable,
        pace: Pace,
    ) -> anyhow::Result<Self> {
        write_json(&folder.join(MANIFEST), &manifest)?;
        let info = RunInfo::new(&manifest, scenario.wireframe(None));
        let mut sinks = Sinks::open(SinkRequest {
            report: Some(folder),
            // More have no room in a viewer, nor the file on a disk.
            viewer: rerun
                .filter(|_| scenario.algorithms.len() <= MAX_SHOWN)
                .map(|(viewer, target, detail)| ViewerRequest {
                    viewer,
                    target,
                    detail,
                    info,
                }),
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
        let watch = Watch::new(&Terminal { quiet }, &title, run.pairs(), Some(&self.live));
        let sinks = match &judge.run.stress {
            None => self.sinks.as_mut_slice(),
            Some(_) => self.sinks.tables_mut(),
        };
        run_through(run, matchers, &start, self.pace, sinks, watch)
    }

    pub(super) fn finish(
        self,
        head: ReportHead<'_>,
        matchers: &Matchers,
        ending: RunEnding,
    ) -> anyhow::Result<(Summary, Vec<GateResult>)> {
        let Self {
            folder,
            mut manifest,
            ..
        } = self;
        let (results, finished) = self.sinks.finish();
        finished?;
        matchers.complete(&mut manifest);
        let collected = ReportContent {
            rows: results.rows,
            checkpoints: results.checkpoints,
            pictures: results.pictures,
            ..ReportContent::default()
        };
        Ok(collected.write(&folder, head, manifest, ending, WarningLog::lines())?)
    }
}

/// A run of `svl score` that is over, and what it wrote.
pub(super) struct Scored {
    /// Why it ended early, if it did.
    pub(super) ran: anyhow::Result<()>,
    /// What came before is reported all the same.
    pub(super) finished: anyhow::Result<(Summary, Vec<GateResult>)>,
    /// Pairs that were taken.
    pub(super) pairs: u64,
    /// Folders of interrupted parts, which the report holds now.
    pub(super) others: Vec<PathBuf>,
    /// Whether it holds all that the report before it had, even where it ended early.
    pub(super) holds_earlier: bool,
}

/// What the report says besides its numbers.
pub(super) fn head<'a>(args: &'a Args, scenario: &'a Scenario, measured: bool) -> ReportHead<'a> {
    ReportHead {
        description: &scenario.description,
        rule: scenario.cells,
        measured,
        algorithms: &scenario.algorithms,
        sort: args.sort,
        limits: if args.gate { &scenario.gate } else { &[] },
    }
}
