//! `svl score`: scores algorithms on a scenario and writes a report.

mod sweep;

use crate::cli::shared::outputs::{FolderRule, Outputs, write, write_json};
use crate::cli::shared::source::{ReferenceArgs, data_folder};
use crate::cli::shared::terminal::{print, print_json, width};
use crate::cli::shared::{recordings, runner, usage};
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use std::path::{Path, PathBuf};
use svl::manifest::Manifest;
use svl::report::html::ReportPage;
use svl::report::{GateResult, Row, Summary};
use svl::run::{Matchers, Outcome, Pace};
use svl::scenario::{Scenario, ScenarioSource};
use svl::score::Judge;
use svl::sink::{ReportPictures, RerunTarget, RunInfo, RunStart, SinkRequest, Sinks};
use svl::source::dataset::{Scene, SceneSource};
use svl::source::{RecordingSource, Source};
use sweep::{Algorithms, MAX_ALGORITHMS, sweeps};

/// Score algorithms on a scenario and write a report
///
/// Records what is missing (recordings/ is a cache), replays it through the algorithms, scores
/// every cell and every checkpoint, prints a summary, and writes a report: index.html to read,
/// summary.md, run.rrd for Rerun, and as .csv and .parquet the tables summary (per algorithm),
/// verdicts (per checkpoint), rows (per pair), cells and checkpoints (per run).
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl score scenarios/arena.toml
  svl score scenarios/arena.toml --algo v3 --algo v3:max_disparity=64
  svl score scenarios/arena.toml --algo v3 --algo bm:uniqueness=0..60/10
  svl score scenarios/middlebury.toml --data DATASETS --out reports/mine
  svl score scenarios/kitti2015.toml --data ~/kitti --scenes 'training/*'
  svl score scenarios/arena.toml --gate
      for a CI: exit 1 when a limit of the scenario is broken

A number written FROM..TO/STEP is swept: bm:uniqueness=0..60/10 stands for
seven algorithms, uniqueness=0, 10, … 60. The report joins what differs in one
number by a line, in its plots of accuracy against speed and of coverage
against error. A run takes at most 32 algorithms.")]
pub(crate) struct Args {
    /// Scenario file
    scenario: PathBuf,
    /// Algorithm, as `svl algos` lists them, or a sweep; may be given more than once [default: the
    /// scenario's]
    #[arg(long, value_name = "NAME[:key=value,…]")]
    algo: Vec<Algorithms>,
    /// Folder for the report; a report of svl's that is there is replaced [default:
    /// reports/SCENARIO]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of the data sets, for scenarios that read scenes [default: what SVL_DATASETS names]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// These scenes below the folder of the data sets in place of the scenario's; DIR/* are all in
    /// a folder
    #[arg(
        long, value_name = "SCENE", num_args = 1..,
        value_parser = NonEmptyStringValueParser::new()
    )]
    scenes: Vec<String>,
    #[command(flatten)]
    reference: ReferenceArgs,
    /// Fail when a limit of the scenario's [[gate]] is broken
    #[arg(long)]
    gate: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let mut scenario = Scenario::read(&args.scenario)?;
    if !args.algo.is_empty() {
        scenario.algorithms = args
            .algo
            .iter()
            .flat_map(|Algorithms(all)| all.clone())
            .collect();
    }
    if scenario.algorithms.len() > MAX_ALGORITHMS {
        let many = scenario.algorithms.len();
        let words =
            format!("{many} algorithms in one run; at most {MAX_ALGORITHMS}: take larger steps");
        return Err(usage::wrong(words));
    }
    if args.gate && scenario.gate.is_empty() {
        bail!(
            "{}: has no [[gate]], so there is nothing to fail; scenarios/arena.toml shows some",
            args.scenario.display()
        );
    }
    if !args.scenes.is_empty() {
        let ScenarioSource::Dataset { scenes } = &mut scenario.source else {
            bail!(
                "{}: does not read scenes; --scenes is for scenarios that do",
                args.scenario.display()
            );
        };
        scenes.clone_from(&args.scenes);
        // The page and the scenario's hash identify the scenes.
        let named = args.scenes.join(", ");
        scenario.description.push_str(&format!(
            "\n\nOf other scenes than the scenario's: {named}."
        ));
        scenario.text.push_str(&format!("\n# --scenes {named}\n"));
    }
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| Path::new("reports").join(&scenario.name));
    let mut matchers =
        Matchers::new(&scenario.algorithms).map_err(|error| match args.algo.is_empty() {
            // The file is wrong, not the command line.
            true => svl::Error::format(&args.scenario, error.to_string()),
            false => error,
        })?;
    let mut outputs = Outputs::claim_folder(&folder, &REPORT)?;
    // Recorded first: Ctrl-C there leaves an earlier report as it is.
    let data = data_folder(args.data.as_deref());
    let mut runs = runs(&scenario, data.as_deref(), quiet)?
        .into_iter()
        .map(|run| run.against(&args.reference))
        .collect::<svl::Result<Vec<_>>>()?;
    args.reference.check(&scenario.algorithms);
    outputs.set_aside()?;
    let mut report = ScoreReport::begin(&scenario, &folder)?;
    let mut total = Outcome::default();
    let ran = runs.iter_mut().try_for_each(|run| {
        let (outcome, ran) = report.take(run, &mut matchers, quiet);
        total.frames += outcome.frames;
        total.failures += outcome.failures;
        total.losses.unreadable += outcome.losses.unreadable;
        ran?;
        if outcome.interrupted {
            bail!("stopped by Ctrl-C; the report holds what was scored before");
        }
        Ok(())
    });
    // What came before an error or Ctrl-C is reported all the same.
    let incomplete = match &ran {
        Err(error) => Some(usage::one_line(error)),
        Ok(()) => total.missing(),
    };
    let finished = report.finish(&scenario, incomplete);
    // Decided before anything is printed: a full standard output costs no report, and a full disk
    // no row that was written.
    match (&ran, &finished) {
        (Ok(()), Ok(_)) => outputs.commit(),
        _ if finished.is_ok() || total.frames > 0 => outputs.keep_both(),
        _ => drop(outputs),
    }
    let (summary, manifest) = match (finished, ran.is_err()) {
        (Err(_), true) => return ran,
        (finished, _) => finished?,
    };
    let limits = if args.gate { &scenario.gate[..] } else { &[] };
    let results: Vec<_> = limits
        .iter()
        .flat_map(|limit| limit.judge(&summary, &manifest))
        .collect();
    if args.json {
        print_json(&ScoreAnswer {
            summary: &summary,
            gate: &results,
        })?;
    } else {
        let gate: String = results.iter().map(gate_line).collect();
        let width = width();
        print(&format!(
            "{summary:width$}\n{}\n{gate}",
            folder.join("index.html").display()
        ))?;
    }
    ran?;
    runner::complete(&total)?;
    if args.gate {
        pass_gate(&results)
    } else {
        Ok(())
    }
}

/// What `--json` prints.
#[derive(serde::Serialize)]
struct ScoreAnswer<'a> {
    #[serde(flatten)]
    summary: &'a Summary,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    gate: &'a [GateResult],
}

/// A result for the terminal.
fn gate_line(result: &GateResult) -> String {
    let word = match result.kept {
        Some(true) => "kept",
        Some(false) => "BROKEN",
        None => "–",
    };
    format!("{word:<6}  {result}\n")
}

/// Refuses a run that broke a limit, or that no limit was for.
fn pass_gate(gate: &[GateResult]) -> anyhow::Result<()> {
    let broken: Vec<_> = gate
        .iter()
        .filter(|result| result.kept == Some(false))
        .collect();
    match broken[..] {
        [] if gate.iter().any(|result| result.kept.is_some()) => Ok(()),
        [] => bail!("gate: none of the scenario's limits is for the algorithms that took part"),
        [one] => bail!("gate: {one}"),
        [first, ..] => bail!("gate: {first}; and {} more", broken.len() - 1),
    }
}

/// One run of a scenario.
struct Run {
    /// Of an arena's run.
    seed: Option<u64>,
    source: Box<dyn Source>,
}

impl Run {
    /// The run, judged against the references, where there are some.
    fn against(self, references: &ReferenceArgs) -> svl::Result<Self> {
        Ok(Self {
            source: references.wrap(self.source)?,
            ..self
        })
    }
}

/// The scenario's runs; those of an arena are recorded where the cache does not hold them.
fn runs(scenario: &Scenario, data: Option<&Path>, quiet: bool) -> anyhow::Result<Vec<Run>> {
    match &scenario.source {
        ScenarioSource::Arena { seeds, .. } => {
            let run = |&seed| {
                Ok(Run {
                    seed: Some(seed),
                    source: recorded(scenario, seed, quiet)?,
                })
            };
            seeds.iter().map(run).collect()
        }
        ScenarioSource::Dataset { scenes } => {
            let Some(data) = data else {
                bail!(
                    "scenario '{}' reads scenes of data sets: name their folder with --data DIR \
                     or SVL_DATASETS",
                    scenario.name
                );
            };
            let source = Box::new(SceneSource::new(Scene::find_all(data, scenes)?));
            Ok(vec![Run { seed: None, source }])
        }
    }
}

fn recorded(scenario: &Scenario, seed: u64, quiet: bool) -> anyhow::Result<Box<dyn Source>> {
    let path = recordings::cached_run(scenario, seed, quiet)?;
    Ok(Box::new(RecordingSource::open(path)?))
}

/// The report under way.
struct ScoreReport {
    folder: PathBuf,
    manifest: Manifest,
    judge: Judge,
    sinks: Sinks,
}

impl ScoreReport {
    fn begin(scenario: &Scenario, folder: &Path) -> anyhow::Result<Self> {
        let manifest = Manifest::new(&scenario.name, Some(&scenario.text), &scenario.algorithms)?;
        write_json(&folder.join(MANIFEST), &manifest)?;
        let info = RunInfo::new(&manifest, scenario.wireframe(None));
        let sinks = Sinks::open(SinkRequest {
            report: Some(folder),
            rerun: Some((RerunTarget::File(folder.join("run.rrd")), info)),
            ..SinkRequest::default()
        })?;
        Ok(Self {
            folder: folder.to_owned(),
            manifest,
            judge: scenario.judge(),
            sinks,
        })
    }

    /// Scores a run.
    fn take(
        &mut self,
        run: &mut Run,
        matchers: &mut Matchers,
        quiet: bool,
    ) -> (Outcome, svl::Result<()>) {
        let start = RunStart {
            manifest: &self.manifest,
            seed: run.seed,
            judge: &self.judge,
        };
        let title = format!("score {}", run.source.name());
        runner::run_through(
            &mut *run.source,
            matchers,
            &start,
            Pace::Asap,
            self.sinks.as_mut_slice(),
            &title,
            quiet,
        )
    }

    fn finish(
        self,
        scenario: &Scenario,
        incomplete: Option<String>,
    ) -> anyhow::Result<(Summary, Manifest)> {
        let Self {
            folder,
            mut manifest,
            ..
        } = self;
        let (results, finished) = self.sinks.finish();
        finished?;
        let mut summary = Summary::from_rows(&results.rows, &results.checkpoints)?;
        let ReportPictures { figures, scenes } = results.pictures;
        summary.incomplete = incomplete;
        summary.rule = scenario.cells;
        summary.complete(&mut manifest);
        summary.write_tables(&folder)?;
        write(&folder.join("summary.md"), summary.markdown(&scenario.name))?;
        write_json(&folder.join("summary.json"), &summary)?;
        write_json(&folder.join(MANIFEST), &manifest)?;
        let page = ReportPage {
            title: scenario.name.clone(),
            description: scenario.description.clone(),
            identity: manifest.entries(),
            times_ms: times_ms(&results.rows),
            summary: summary.clone(),
            sweeps: sweeps(&scenario.algorithms),
            figures,
            scenes,
        };
        page.write(&folder.join("index.html"))?;
        Ok((summary, manifest))
    }
}

/// Per algorithm the time of each pair, ms.
fn times_ms(rows: &[Row]) -> Vec<(String, Vec<f64>)> {
    let mut times: Vec<(String, Vec<f64>)> = Vec::new();
    for row in rows {
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
const MANIFEST: &str = "manifest.json";

/// The folder of a report, which a later report replaces.
const REPORT: FolderRule = FolderRule {
    kind: "a report",
    owns: |name| REPORT_FILES.contains(&name),
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
    "summary.md",
    "summary.json",
    "index.html",
    "run.rrd",
];
