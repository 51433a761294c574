//! `svl score`: scores algorithms on a scenario or on recordings, and writes a report.

mod drive;
mod report;
mod scenario;
mod sweep;

use crate::cli::shared::filters::FilterArgs;
use crate::cli::shared::progress::{Terminal, listen_for_interrupt};
use crate::cli::shared::source::warn_of_own_reference;
use crate::cli::shared::terminal::{print, print_json, width};
use crate::cli::shared::usage;
use crate::cli::shared::viewer::{RerunChoice, viewer};
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use drive::KeptDrives;
use report::{ScoreReport, Scored, head, report_manifest};
use scenario::stresses;
use std::path::{Path, PathBuf};
use svl::evaluation::{REPORT, ReportPart, ReportRun, Shard, read_ending};
use svl::losses::{Missing, RunState};
use svl::outputs::{Outputs, write};
use svl::report::{GateResult, GateState, ResultLog, Summary, TestCase, TestResult, junit};
use svl::run::{Matchers, Pace, complete, ending};
use svl::runs::{self, ScoredSource, runs as open_runs};
use svl::scenario::{Scenario, ScenarioSource, SourceOptions, StressLevels};
use svl::score::{METRICS, Metric};
use svl::sink::{LiveTable, REPORT_RUN, RerunDetail, RerunTarget};
use svl::stress::Stress;
use sweep::{Algorithms, MAX_ALGORITHMS};

/// Score algorithms on a scenario or on recordings, and write a report
///
/// Replays the recordings through the algorithms (those of the arena are made first, and kept in
/// recordings/), scores every cell and every checkpoint, prints a summary, and writes a report:
/// index.html to read, summary.md, run.rrd for Rerun, and as .csv and .parquet the tables summary
/// (per algorithm), verdicts (per checkpoint), rows (per pair), cells and checkpoints (per run).
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl score arena                                the thesis's arena
  svl score own.mcap --algo v3 --algo sgm        without truth: known cells
  svl score bags/*.mcap --every 10 --from 5
  svl score own.toml                             with checkpoints of your own
  svl score scenarios/arena.toml --algo v3 --algo v3:max_disparity=64
  svl score scenarios/arena.toml --algo v3 --algo bm:uniqueness=0..60/10
  svl score scenarios/middlebury.toml --data DATASETS --out reports/mine
  svl score scenarios/kitti2015.toml --data ~/kitti --scenes 'training/*'
  svl score arena --algo sgm:p1=5..20/5 --resume   goes on where it was killed
  svl score scenarios/arena.toml --gate
      for a CI: exit 3 when a limit of the scenario is broken

A number written FROM..TO/STEP is swept: bm:uniqueness=0..60/10 stands for
seven algorithms, uniqueness=0, 10, … 60; block_size=5/9 is a list. Several
make a grid, of which --sample N takes N, spread evenly. The report joins what
differs in one number by a line, in its plots of accuracy against speed and of
coverage against error. Tables take up to 1000 algorithms, Rerun up to 32.

  svl score arena --algo fast=v3:max_disparity=48 --algo net=exec:command=./n

NAME= before an algorithm is how tables, gates, files and plots call it.")]
pub(crate) struct Args {
    /// A scenario, the arena, or recordings: svl's or another program's, bags, folders of pairs
    #[arg(
        value_name = "SCENARIO.toml|arena|RECORDING", required = true,
        value_parser = NonEmptyStringValueParser::new()
    )]
    what: Vec<String>,
    /// Algorithm, as `svl algos` lists them, or a sweep; may be given more than once [default: the
    /// scenario's; of recordings v5]
    #[arg(long, value_name = "NAME[:key=value,…]")]
    algo: Vec<Algorithms>,
    /// At most N algorithms of each sweep, spread evenly over its grid, always the same ones
    #[arg(
        long, value_name = "N", requires = "algo", allow_negative_numbers = true,
        value_parser = usage::within(1..=MAX_ALGORITHMS)
    )]
    sample: Option<usize>,
    /// Folder for the report; a report of svl's that is there is replaced [default:
    /// reports/SCENARIO]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    filters: FilterArgs,
    /// Score the pairs made worse, too, as row_offset, at levels of your own as row_offset=0.5/1;
    /// may be given more than once [default: the scenario's]
    #[arg(long, value_name = "KIND[=LEVEL/…]")]
    stress: Vec<StressLevels>,
    #[command(flatten)]
    source: SourceOptions,
    /// Match each pair N times, in turns; its time is the median, and all results must be equal
    #[arg(
        long, value_name = "N", default_value_t = 1, allow_negative_numbers = true,
        value_parser = usage::within(1..=1000usize)
    )]
    repeat: usize,
    /// Sort the algorithms by a metric, the best first [default: as named]
    #[arg(long, value_name = "METRIC", value_parser = metric)]
    sort: Option<&'static Metric>,
    /// Show the run in Rerun: a new viewer, a running one, a file, or none [default: run.rrd in the
    /// report]
    #[arg(long, value_name = "spawn|URL|FILE.rrd|none")]
    rerun: Option<RerunChoice>,
    /// Maps for Rerun: light has those of every 30th pair, of every 10th that shows a checkpoint,
    /// and of all scenes; images, overlays and numbers are always those of all pairs
    #[arg(long, value_name = "light|full", default_value = "light")]
    rerun_detail: RerunDetail,
    /// Score the truth itself: fail when a checkpoint fails that a perfect matcher would pass; the
    /// report's folder is reports/SCENARIO-check
    #[arg(long, conflicts_with_all = ["algo", "gate", "reference"])]
    check: bool,
    /// Score only the I-th of N shares of the run, for `svl merge`
    #[arg(long, value_name = "I/N", requires = "out", conflicts_with_all = ["gate", "check"])]
    shard: Option<Shard>,
    /// Go on with the killed or interrupted run in the report's folder: what its rows hold is not
    /// matched again
    #[arg(long)]
    resume: bool,
    /// Which drives of kind = "drive" are kept as recordings in the report; each takes about 80 MB
    /// [default: all]
    #[arg(long, value_name = "all|none", hide_possible_values = true)]
    drives: Option<KeptDrives>,
    /// Fail when a limit of the scenario's [[gate]] is broken
    #[arg(long)]
    gate: bool,
    /// Write the limits of --gate as JUnit's XML; replaces the file
    #[arg(long, value_name = "FILE.xml", requires = "gate")]
    junit: Option<PathBuf>,
    /// Print the scenario that repeats this run, or write it to FILE, and score nothing
    #[arg(
        long, value_name = "FILE.toml", num_args = 0..=1, require_equals = true,
        value_parser = usage::ending(&["toml"])
    )]
    print_scenario: Option<Option<PathBuf>>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    // Before programs are started, which svl ends.
    listen_for_interrupt();
    let mut scenario = scenario::described(args)?;
    if let Some(file) = &args.print_scenario {
        return scenario::print_description(scenario, file.as_deref());
    }
    let description = scenario.to_json()?;
    scenario::add_filters(&mut scenario, args, quiet)?;
    let named = &args.what[0];
    if scenario.algorithms.len() > MAX_ALGORITHMS {
        let many = scenario.algorithms.len();
        let words = format!("{many} algorithms in one run; at most {MAX_ALGORITHMS}");
        return Err(usage::wrong(words));
    }
    if args.gate && scenario.gate.is_empty() {
        return Err(usage::wrong(format!(
            "{named}: has no [[gate]], so there is nothing to fail; scenarios/arena.toml shows some"
        )));
    }
    let folder = args.out.clone().unwrap_or_else(|| {
        let kind = if args.check { "-check" } else { "" };
        Path::new("reports").join(format!("{}{kind}", scenario.name))
    });
    let mut outputs = Outputs::claim_folder(&folder, &REPORT)?;
    let rerun = args.rerun.as_ref().and_then(RerunChoice::target);
    if let Some(file) = rerun.and_then(RerunTarget::file) {
        outputs = outputs.and(Outputs::claim(false, [], [file])?);
    }
    // The file of the CI's run before is of no more use than its report.
    let junit_path = args.junit.iter().map(PathBuf::as_path);
    let mut junit_file = Outputs::claim(true, [], junit_path)?;
    if !args.resume {
        warn_of_unfinished(&folder);
    }
    let scored = match &scenario.source {
        ScenarioSource::Drive { .. } => drive::score(
            args,
            (&scenario, description),
            &folder,
            (&mut outputs, &mut junit_file),
            quiet,
        ),
        _ => score_runs(
            args,
            (&scenario, description),
            &folder,
            (&mut outputs, &mut junit_file),
            quiet,
        ),
    };
    let Scored {
        ran,
        finished,
        pairs,
        others,
        holds_earlier,
    } = scored?;
    // Decided before anything is printed: a full standard output costs no report, and a full disk
    // no row that was written.
    match (&ran, &finished) {
        (Ok(()), Ok(_)) => {
            if args.shard.is_some() {
                ReportPart::complete(&folder)?;
            }
            outputs.commit();
            // The report has what an interrupted part of it left there.
            for other in &others {
                if let Err(error) = std::fs::remove_dir_all(other) {
                    tracing::warn!("{}: cannot be removed: {error}", other.display());
                }
            }
        }
        (Err(_), Ok(_)) if holds_earlier => outputs.commit(),
        _ if finished.is_ok() || pairs > 0 => outputs.keep_both(),
        _ => drop(outputs),
    }
    let (summary, results) = match (finished, ran.is_err()) {
        (Err(_), true) => return ran,
        (finished, _) => finished?,
    };
    warn_of_nothing_scored(&scenario, &summary);
    if let Some(path) = &args.junit {
        let cases = results.iter().map(GateResult::test_case);
        let cases: Vec<_> = cases.chain([losses_case(&summary)]).collect();
        write(path, junit(&format!("svl score {}", scenario.name), &cases))?;
        junit_file.commit();
    }
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
    match (args.gate, args.check) {
        (true, _) => pass_gate(&results)?,
        (_, true) => pass_check(&summary)?,
        _ => {}
    }
    Ok(complete(&summary.ending)?)
}

/// Scores the runs of a scenario, one after the other.
fn score_runs(
    args: &Args,
    (scenario, description): (&Scenario, serde_json::Value),
    folder: &Path,
    (outputs, junit_file): (&mut Outputs, &mut Outputs),
    quiet: bool,
) -> anyhow::Result<Scored> {
    if args.drives.is_some() {
        let words = format!(
            "--drives is for scenarios of drives; '{}' has none",
            scenario.name
        );
        return Err(usage::wrong(words));
    }
    let mut matchers =
        Matchers::new(&scenario.algorithms).map_err(|error| match args.algo.is_empty() {
            // The file is wrong, not the command line.
            true => svl::Error::format(&args.what[0], error.to_string()),
            false => error,
        })?;
    let rerun = match &args.rerun {
        // Without a viewer the report is whole but for its run.rrd.
        None => viewer()
            .ok()
            .map(|viewer| (viewer, RerunTarget::File(folder.join(REPORT_RUN)))),
        Some(choice) => {
            let target = choice.target().cloned();
            target
                .map(|target| svl::Result::Ok((viewer()?, target)))
                .transpose()?
        }
    };
    let terminal = &Terminal { quiet };
    let runs = open_runs(scenario, terminal)?;
    warn_of_own_reference(&scenario.options, &scenario.algorithms)?;
    let pace = Pace::Measured {
        rounds: args.repeat,
    };
    let key = |(stress, place): (Option<Stress>, usize)| ReportRun {
        run: runs[place].record().map(|record| record.name),
        seed: runs[place].seed(),
        stress: stress.map(|stress| stress.to_string()),
    };
    let keys = groups(scenario, runs.len()).map(key).collect();
    let records = runs.iter().filter_map(ScoredSource::record);
    let mut manifest = report_manifest(scenario, description, pace, args.shard)?;
    manifest.runs = records.collect();
    let live = LiveTable::default();
    let units = RunUnit::all(scenario, &runs, args.shard);
    let mut runs: Vec<_> = runs.into_iter().map(Some).collect();
    let mut open = |unit: &RunUnit| {
        // Those that are perturbed are opened anew.
        let run = match runs[unit.place].take_if(|_| unit.stress.is_none()) {
            Some(run) => run,
            None => runs::run_at(scenario, unit.place, terminal)?,
        };
        let (mut run, mut judge) = run.open(scenario, terminal, Some(&live))?;
        if let Some(stress) = unit.stress {
            run = run.stressed(stress);
            judge = run.judge(&scenario.judge())?;
        }
        anyhow::Ok((run, judge))
    };
    // The first before the report is begun: Ctrl-C there leaves an earlier one as it is.
    let mut first = units.first().map(&mut open).transpose()?;
    let log = match args.resume {
        true => ResultLog::read(folder, &manifest, scenario.grid)?,
        false => ResultLog::default(),
    };
    log.continue_in(&mut manifest);
    let others = log.others().to_vec();
    outputs.set_aside()?;
    junit_file.set_aside()?;
    if let Some(shard) = args.shard {
        ReportPart::write(folder, scenario, shard, keys)?;
    }
    let mut report = {
        let rerun = rerun.map(|(viewer, target)| (viewer, target, args.rerun_detail));
        ScoreReport::begin(scenario, folder, rerun, (manifest, log), &live, pace)?
    };
    let mut missing = Missing::default();
    let ran = units.iter().try_for_each(|unit| {
        let mut run = first.take().map_or_else(|| open(unit), Ok)?;
        let mut own = matchers.take(&unit.labels);
        let (outcome, ran) = report.take(&mut run, &mut own, quiet);
        matchers.append(own);
        missing.add(outcome.missing());
        ran?;
        if outcome.interrupted {
            bail!(
                "interrupted; the report holds what was scored before, and --resume goes on with \
                 it"
            );
        }
        Ok(())
    });
    // What came before an error or Ctrl-C is reported all the same.
    let pairs = missing.pairs;
    let ran_to_end = ran.as_ref().map_err(usage::one_line).copied();
    let ending = ending(ran_to_end, missing, scenario.options.allow_loss);
    let finished = report.finish(head(args, scenario, true), &matchers, ending);
    Ok(Scored {
        ran,
        finished,
        pairs,
        others,
        holds_earlier: false,
    })
}

/// A run through some of the algorithms, as it is or made worse.
struct RunUnit<'a> {
    /// Of the run among those of the scenario.
    place: usize,
    stress: Option<Stress>,
    labels: Vec<&'a str>,
}

impl<'a> RunUnit<'a> {
    /// Those of a shard, in their order. The algorithms of a run of the arena are shared out; of
    /// other runs all stay together, as without truth they are compared with each other.
    fn all(scenario: &'a Scenario, runs: &[ScoredSource], shard: Option<Shard>) -> Vec<Self> {
        let labels = scenario.labels();
        let shares_out = matches!(scenario.source, ScenarioSource::Arena { .. });
        let groups = groups(scenario, runs.len());
        let unit = |(group, (stress, place)): (usize, (Option<Stress>, usize))| {
            let takes = |unit: usize| shard.is_none_or(|shard| shard.takes(unit));
            let labels = labels.iter().enumerate().filter(|(i, _)| match shares_out {
                true => takes(group * labels.len() + i),
                false => takes(group),
            });
            Self {
                place,
                stress,
                labels: labels.map(|(_, label)| *label).collect(),
            }
        };
        let units = groups.enumerate().map(unit);
        units.filter(|unit| !unit.labels.is_empty()).collect()
    }
}

/// All runs of a scenario, first as they are, then made worse.
fn groups(scenario: &Scenario, runs: usize) -> impl Iterator<Item = (Option<Stress>, usize)> {
    stresses(scenario).flat_map(move |stress| (0..runs).map(move |place| (stress, place)))
}

/// Says that a run goes lost that could go on.
fn warn_of_unfinished(folder: &Path) {
    let rows = folder.join("rows.csv").metadata();
    let is_unfinished = || match read_ending(folder) {
        Ok(Some(ending)) => ending.state == RunState::Interrupted,
        Ok(None) => true,
        // Of an earlier svl, which says it otherwise.
        Err(_) => false,
    };
    if rows.is_ok_and(|rows| rows.len() > 0) && is_unfinished() {
        tracing::warn!(
            "{}: holds an unfinished run, which is scored anew; --resume would go on with it",
            folder.display()
        );
    }
}

/// Warns where frames have a truth, but no cell has enough of it to be scored.
fn warn_of_nothing_scored(scenario: &Scenario, summary: &Summary) {
    let mut of = summary.algorithms.iter();
    if let Some(of) = of.find(|of| of.scored_cells == Some(0)) {
        let cells = of.pairs * scenario.grid.shape().cells() as u64;
        tracing::warn!(
            "{}: 0 of {cells} cells have a ground truth, so none is scored against it",
            scenario.name
        );
    }
}

/// Refuses a scenario whose checkpoints the truth itself fails.
fn pass_check(summary: &Summary) -> anyhow::Result<()> {
    let failed = summary.checkpoints.iter().filter(|c| c.passed < c.frames);
    let failed: Vec<_> = failed
        .map(|c| {
            let frames = c.frames - c.passed;
            format!(
                "{} {} in {} of {} frames",
                c.checkpoint, c.name, frames, c.frames
            )
        })
        .collect();
    if summary.checkpoints.is_empty() {
        let cure = "it needs checkpoints, and frames with truth";
        return Err(usage::gate(format!(
            "--check: no checkpoint is scored; {cure}"
        )));
    }
    match &failed[..] {
        [] => Ok(()),
        failed => Err(usage::gate(format!(
            "--check: even the truth fails checkpoint {}",
            failed.join(", ")
        ))),
    }
}

fn metric(name: &str) -> Result<&'static Metric, String> {
    let sortable = |metric: &&Metric| metric.is_of_frames();
    let names = METRICS.iter().filter(sortable).map(|metric| metric.name);
    let expected = || names.clone().collect::<Vec<_>>().join(", ");
    let found = Metric::find(name).filter(sortable);
    found.ok_or_else(|| format!("no such metric; expected one of {}", expected()))
}

/// What `--json` prints.
#[derive(serde::Serialize)]
struct ScoreAnswer<'a> {
    #[serde(flatten)]
    summary: &'a Summary,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    gate: &'a [GateResult],
}

/// Pairs that are missing, as a test beside the limits.
fn losses_case(summary: &Summary) -> TestCase {
    let why = summary.ending.incomplete.clone();
    TestCase {
        name: "losses".to_owned(),
        result: why.map_or(TestResult::Passed, TestResult::Failed),
    }
}

/// A result for the terminal.
fn gate_line(result: &GateResult) -> String {
    format!("{:<12}  {result}\n", result.state.words())
}

/// Refuses a run that broke a limit, or that no limit was for.
fn pass_gate(gate: &[GateResult]) -> anyhow::Result<()> {
    let broken: Vec<_> = gate.iter().filter(|result| result.state.fails()).collect();
    match broken[..] {
        [] if gate.iter().any(|result| result.state == GateState::Pass) => Ok(()),
        [] => Err(usage::wrong(
            "gate: none of the scenario's limits is for the algorithms that took part",
        )),
        [one] => Err(usage::gate(format!("gate: {one}"))),
        [first, ..] => Err(usage::gate(format!(
            "gate: {first}; and {} more",
            broken.len() - 1
        ))),
    }
}
