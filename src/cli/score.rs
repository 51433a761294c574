//! `svl score`: a scenario, judged and reported.

use super::output::{print, print_json};
use super::progress::Progress;
use super::{cache, folder, run_info};
use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::matcher::Algorithm;
use svl::report::html::Page;
use svl::report::{Summary, Tables};
use svl::run::{Lineup, Pace, run as run_loop};
use svl::scenario::{Scenario, ScenarioSource};
use svl::sink::{Judge, RerunSink, RerunTarget, Sink};
use svl::source::Source;
use svl::source::dataset::{Scene, SceneSource};

/// Score algorithms on a scenario and write a report
///
/// Records what is missing (recordings/ is a cache), replays it through the algorithms, judges every cell and every
/// checkpoint, prints a summary, and writes tables, index.html and run.rrd.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl score scenarios/arena.toml
  svl score scenarios/arena.toml --algo v3 --algo v3:max_disparity=64 --out reports/range
  svl score scenarios/middlebury.toml --data DATASETS")]
pub(super) struct Args {
    /// Scenario file
    scenario: PathBuf,
    /// Algorithm, as `svl algos` lists them; may be given more than once [default: the scenario's]
    #[arg(long, value_name = "NAME[:key=value,…]")]
    algo: Vec<Algorithm>,
    /// Folder for the report; a report of svl's that is there is replaced [default: reports/SCENARIO]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of the data sets, for scenarios that read scenes [default: what SVL_DATASETS names]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let mut scenario = Scenario::read(&args.scenario)?;
    if !args.algo.is_empty() {
        scenario.algorithms.clone_from(&args.algo);
    }
    let folder = args.out.clone().unwrap_or_else(|| Path::new("reports").join(&scenario.name));
    let mut lineup = Lineup::new(&scenario.algorithms)?;
    let earlier = folder::earlier_report(&folder, REPORT_FILES)?;
    // Recorded first: Ctrl-C there leaves an earlier report as it is.
    let data = args.data.clone().or_else(|| std::env::var_os("SVL_DATASETS").map(PathBuf::from));
    let mut runs = runs(&scenario, data.as_deref(), quiet)?;
    folder::remove(earlier)?;
    let mut report = Report::begin(&scenario, &folder)?;
    let mut failures = 0;
    let ran = runs.iter_mut().try_for_each(|run| {
        failures += report.take(run, &mut lineup, &scenario, quiet)?;
        Ok(())
    });
    // What came before an error or Ctrl-C is reported all the same.
    let incomplete = ran.as_ref().err().map(super::one_line);
    let summary = match (report.finish(&scenario, incomplete), ran.is_err()) {
        (Err(_), true) => return ran,
        (summary, _) => summary?,
    };
    if args.json {
        print_json(&summary)?;
    } else {
        print(&format!("{summary}\n{}\n", folder.join("index.html").display()))?;
    }
    ran?;
    run_info::complete(failures)
}

/// One run of a scenario.
struct Run {
    /// Of an arena's run.
    seed: Option<u64>,
    source: Box<dyn Source>,
}

/// The scenario's runs; those of an arena are recorded where the cache does not hold them.
fn runs(scenario: &Scenario, data: Option<&Path>, quiet: bool) -> anyhow::Result<Vec<Run>> {
    match &scenario.source {
        ScenarioSource::Arena { seeds, .. } => {
            let run = |&seed| Ok(Run { seed: Some(seed), source: Box::new(cache::recording(scenario, seed, quiet)?) });
            seeds.iter().map(run).collect()
        }
        ScenarioSource::Dataset { scenes } => {
            let Some(data) = data else {
                bail!(
                    "scenario '{}' reads scenes of data sets: name their folder with --data DIR or SVL_DATASETS",
                    scenario.name
                );
            };
            let source = Box::new(SceneSource::new(Scene::find_all(data, scenes)?));
            Ok(vec![Run { seed: None, source }])
        }
    }
}

/// The report under way.
struct Report {
    folder: PathBuf,
    run_id: String,
    judge: Judge,
    rerun: RerunSink,
}

impl Report {
    fn begin(scenario: &Scenario, folder: &Path) -> anyhow::Result<Self> {
        let run_id = run_info::run_id(&scenario.name);
        let shape = scenario.grid.shape();
        let identity = run_info::identity(&run_id, &scenario.name, &scenario.algorithms, scenario.cells, shape);
        let labels = scenario.labels().into_iter().map(str::to_owned).collect();
        let tables = Tables::create(folder)?;
        let info = run_info::rerun(&identity, &scenario.algorithms, run_info::wireframe(scenario, None));
        Ok(Self {
            folder: folder.to_owned(),
            run_id,
            judge: Judge::new(identity, labels, scenario.checkpoints.clone(), tables),
            rerun: RerunSink::new(RerunTarget::File(folder.join("run.rrd")), &info)?,
        })
    }

    /// Scores a run; how many estimates are missing because their algorithm failed.
    fn take(&mut self, run: &mut Run, lineup: &mut Lineup, scenario: &Scenario, quiet: bool) -> anyhow::Result<u64> {
        let source = &mut *run.source;
        self.judge.begin_run(run.seed);
        self.rerun.begin_run();
        let mut progress = Progress::new(&format!("score {}", source.name()), source.pairs(), quiet);
        let mut sinks: [&mut dyn Sink; 2] = [&mut self.judge, &mut self.rerun];
        let ran = run_loop(source, lineup, scenario.grid, Pace::Asap, &mut sinks, &mut progress);
        progress.clear();
        self.judge.end_run()?;
        let outcome = ran?;
        if outcome.interrupted {
            bail!("stopped by Ctrl-C; the report holds what was scored before");
        }
        Ok(outcome.failures)
    }

    fn finish(self, scenario: &Scenario, incomplete: Option<String>) -> anyhow::Result<Summary> {
        let Self { folder, run_id, judge, mut rerun } = self;
        let (mut summary, figures) = judge.finish()?;
        summary.incomplete = incomplete;
        rerun.verdicts(&summary.verdicts_markdown(&scenario.name))?;
        rerun.finish()?;
        folder::write(&folder, "summary.md", summary.markdown(&scenario.name))?;
        folder::write(&folder, "summary.json", serde_json::to_string_pretty(&summary)? + "\n")?;
        let page = Page {
            title: scenario.name.clone(),
            description: scenario.description.clone(),
            identity: run_info::manifest(&run_id, &scenario.algorithms)?,
            summary: summary.clone(),
            figures,
        };
        page.write(&folder.join("index.html"))?;
        Ok(summary)
    }
}

/// The files of a report, which a later report of the same folder replaces.
const REPORT_FILES: &[&str] = &[
    "rows.csv",
    "rows.parquet",
    "cells.csv",
    "cells.parquet",
    "checkpoints.csv",
    "checkpoints.parquet",
    "summary.md",
    "summary.json",
    "index.html",
    "run.rrd",
];
