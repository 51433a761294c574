//! `svl score`: scores algorithms on a scenario or on recordings, and writes a report.

mod live_topics;
mod scenario;
mod sizes;

use crate::cli::shared::filters::FilterArgs;
use crate::cli::shared::progress::{Terminal, listen_for_interrupt};
use crate::cli::shared::report::{AreaArgs, check_whole, pass_gate, print_report};
use crate::cli::shared::terminal::print;
use crate::cli::shared::usage;
use crate::cli::shared::viewer::{RerunChoice, viewer};
use clap::builder::NonEmptyStringValueParser;
use sizes::SizeArgs;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::evaluation::{
    Again, Algorithms, ChosenViewer, Evaluation, EvaluationPlan, MAX_ALGORITHMS, Shard,
};
use svl::outputs::{Outputs, write};
use svl::report::{
    BuildOptions, BuiltReport, GateResult, REPORT, Results, TestCase, TestResult, junit,
};
use svl::scenario::{Latency, RangeEnds, Scenario, ScenarioSource, SourceOptions, StressLevels};
use svl::score::{ColumnChoice, Metric, MetricOrigin, RobotSize};
use svl::sink::{RerunDetail, RerunTarget, next_report_run};

/// Score algorithms on a scenario or on recordings into a report
///
/// Replays the recordings through the algorithms (those of the arena are made first, and kept in
/// recordings/), scores every cell and every checkpoint, prints a summary, and writes a report:
/// index.html to read, summary.md, run-1.rrd for Rerun, and as .csv and .parquet the tables summary
/// (per algorithm), verdicts (per checkpoint), rows (per pair), cells and checkpoints (per run).
/// What is in the folder already, of the same pairs by the same algorithms, is not matched again.
#[derive(Clone, clap::Args)]
#[command(after_help = "\
Examples:
  svl score arena                                the thesis's arena
  svl score own.mcap --algo v3 --algo sgm        without truth: known cells
  svl score bags/*.mcap --every 10 --from 5
  svl score ros2: --to 30                        records 30 s first
  svl score own.toml                             with checkpoints of your own
  svl score own.mcap --algo zed=topic:/zed/depth --truth /lidar --near 2
      depth that the robot published, against a lidar
  svl score arena --algo v3 --algo v3:max_disparity=64
  svl score arena --algo v3 --algo bm:uniqueness=0..60/10
  svl score scenarios/middlebury.toml --data DATASETS -o reports/mine
  svl score scenarios/kitti2015.toml --data ~/kitti --scenes 'training/*'
  svl score arena --algo sgm:p1=5..20/5            again: resumes a killed run
  svl score arena --gate
      for CI: exit status 3 if a limit of the scenario fails

A number written FROM..TO/STEP is swept: bm:uniqueness=0..60/10 means
seven algorithms, uniqueness=0, 10, … 60; block_size=5/9 is a list. Several
make a grid, from which --sample N chooses N, spread evenly. In its plots of
accuracy against speed and of coverage against error, the report joins
algorithms that differ in one number by a line. A run has up to 1000
algorithms, Rerun shows up to 32.

  svl score arena --algo fast=v3:max_disparity=48 --algo net=exec:command=./n

NAME= before an algorithm is its name in tables, gates, files and plots.
The folder scenarios/ is in svl's repository.")]
pub(crate) struct Args {
    /// A scenario, the arena, or recordings, bags and folders of pairs
    #[arg(
        value_name = "SCENARIO.toml|arena|RECORDING", required = true,
        value_parser = NonEmptyStringValueParser::new()
    )]
    what: Vec<String>,
    /// Algorithm, as NAME[:key=value,…], or a sweep; repeatable
    ///
    /// `svl algos` lists them [default: the scenario's; of recordings v5].
    #[arg(long, value_name = "ALGO", help_heading = "Input")]
    algo: Vec<Algorithms>,
    /// At most N algorithms of each sweep, spread evenly over its grid, always the same ones
    #[arg(
        long, value_name = "N", requires = "algo", value_parser = usage::within(1..=MAX_ALGORITHMS),
        help_heading = "Input", hide_short_help = true
    )]
    sample: Option<usize>,
    #[command(flatten)]
    filters: FilterArgs,
    /// Score perturbed pairs, too: KIND or KIND=LEVEL/…
    ///
    /// For example row_offset, or row_offset=0.5/1 with levels of your own; may be given more than
    /// once [default: the scenario's].
    #[arg(long, value_name = "KIND", help_heading = "Scoring")]
    stress: Vec<StressLevels>,
    #[command(flatten)]
    sizes: SizeArgs,
    #[command(flatten)]
    source: SourceOptions,
    /// Match each pair N times; its time is the median
    ///
    /// In turns; all results must be equal.
    #[arg(
        long, value_name = "N", default_value_t = 1, value_parser = usage::within(1..=1000usize),
        help_heading = "Scoring"
    )]
    repeat: usize,
    /// Match by N threads, each one pair by one algorithm; no times are measured
    ///
    /// All else is as without it. Of drives the number at once [default: one per core].
    #[arg(
        long, value_name = "N", value_parser = usage::within(1..=1024usize),
        conflicts_with_all = ["repeat", "times"], help_heading = "Run"
    )]
    jobs: Option<usize>,
    /// Score the truth itself
    ///
    /// Fails when a checkpoint fails that a perfect matcher would pass. The report's folder is
    /// reports/SCENARIO-check.
    #[arg(long, conflicts_with_all = ["algo", "gate"], help_heading = "Scoring")]
    check: bool,
    /// Fail if a limit of the scenario's [[gate]] fails or is not measured
    #[arg(long, help_heading = "Scoring")]
    gate: bool,
    /// Folder for the report [default: reports/SCENARIO]
    ///
    /// A report that is there keeps its results: only what is missing or changed is matched.
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Match all again, also what the report's folder has
    #[arg(long, conflicts_with = "times", help_heading = "Output")]
    force: bool,
    /// Match again where the times of algorithms are of several sessions or measured otherwise, so
    /// that they are comparable
    #[arg(long, help_heading = "Run", hide_short_help = true)]
    times: bool,
    /// Remove what the folder has of algorithms and options that are not asked for any more
    #[arg(
        long,
        conflicts_with = "shard",
        help_heading = "Run",
        hide_short_help = true
    )]
    prune: bool,
    /// Folder, new or empty, for each plot of the page as an SVG file
    #[arg(
        long,
        value_name = "DIR",
        help_heading = "Output",
        hide_short_help = true
    )]
    figures: Option<PathBuf>,
    #[command(flatten)]
    area: AreaArgs,
    /// Sort the algorithms by a metric, the best first
    ///
    /// Without it by right minus wrong cells, or by the first column.
    #[arg(long, value_name = "METRIC", value_parser = usage::metric, help_heading = "Output")]
    sort: Option<&'static Metric>,
    /// Metrics that the table shows: all or NAME,…
    ///
    /// `svl columns metrics` lists them [default: the scenario's, or those of its kind].
    #[arg(long, value_name = "NAMES", help_heading = "Output")]
    columns: Option<ColumnChoice>,
    /// Distances in metres at which the ranges of errors end, as 2,4,8,16
    ///
    /// For the errors against distance [default: the scenario's, or five ranges with equal numbers
    /// of cells].
    #[arg(
        long,
        value_name = "M,…",
        help_heading = "Output",
        hide_short_help = true
    )]
    ranges: Option<RangeEnds>,
    /// Score cells also when their answer arrives: measured, or milliseconds as 80ms
    ///
    /// By the truth at that time. measured: depth of a topic by its latency on the robot, matchers
    /// by their median time on this machine. Only speed times latency counts: double it to see
    /// twice the speed [default: the scenario's, else none].
    #[arg(
        long,
        value_name = "measured|MS",
        help_heading = "Scoring",
        hide_short_help = true
    )]
    latency: Option<Latency>,
    /// Width and height of the robot's body in metres, as 0.50x0.40: what it drove through was free
    ///
    /// Needs poses. Tells phantoms, reports nearer than that, with a truth or without [default:
    /// the scenario's, else none].
    #[arg(
        long,
        value_name = "WxH",
        help_heading = "Scoring",
        hide_short_help = true
    )]
    robot: Option<RobotSize>,
    /// Explain the columns
    #[arg(long, help_heading = "Output")]
    explain: bool,
    /// Rerun: spawn, URL, FILE.rrd, or none
    ///
    /// A new viewer, a running one, a file, or none [default: run-N.rrd in the report, a file for
    /// each session, with the maps of every 30th pair and of every 10th that shows a checkpoint;
    /// none above 2000 pairs or 200 MB].
    #[arg(long, value_name = "WHERE", help_heading = "Output")]
    rerun: Option<RerunChoice>,
    /// Score only the I-th of N parts of the run
    ///
    /// All into one folder, or each into its own, for `svl report`.
    #[arg(
        long, value_name = "I/N", requires = "output", conflicts_with_all = ["gate", "check"],
        help_heading = "Run"
    )]
    shard: Option<Shard>,
    /// Which drives of kind = "drive" are kept as recordings in the report; each takes about 80 MB
    /// [default: all]
    #[arg(
        long,
        value_name = "all|none",
        hide_possible_values = true,
        help_heading = "Output",
        hide_short_help = true
    )]
    drives: Option<KeptDrives>,
    /// Write the limits of --gate as JUnit's XML; replaces the file
    #[arg(
        long,
        value_name = "FILE.xml",
        requires = "gate",
        help_heading = "Output",
        hide_short_help = true
    )]
    junit: Option<PathBuf>,
    /// Print the scenario that repeats this run, or write it to FILE, and score nothing
    #[arg(
        long, value_name = "FILE.toml", num_args = 0..=1, require_equals = true,
        value_parser = usage::ending(&["toml"]), help_heading = "Output", hide_short_help = true
    )]
    print_scenario: Option<Option<PathBuf>>,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

impl Args {
    fn asks_for_rerun(&self) -> bool {
        let choice = self.rerun.as_ref();
        choice.is_some_and(|choice| choice.target().is_some())
    }
}

pub(super) fn run(args: &Args, quiet: bool, has_threads: bool) -> anyhow::Result<()> {
    if has_threads && args.jobs.is_some() {
        return Err(usage::wrong(
            "--jobs and --threads: each job has one thread; omit one",
        ));
    }
    // Before programs are started: svl has to end them after Ctrl-C.
    listen_for_interrupt();
    let recorded = live_topics::recorded(args, quiet)?;
    let args = recorded.as_ref().map_or(args, |recorded| &recorded.args);
    let mut scenario = scenario::described(args)?;
    if let Some(file) = &args.print_scenario {
        return scenario::print_description(scenario, file.as_deref());
    }
    let description = scenario.to_json()?;
    scenario::add_filters(&mut scenario, args, quiet)?;
    check_plan(args, &scenario)?;
    let folder = folder(args, &scenario);
    let outputs = claim(args, &folder)?;
    let mut junit = JunitFile::claim(args.junit.as_deref())?;
    check_kind(args, &scenario)?;
    let plan = EvaluationPlan {
        scenario: &scenario,
        description,
        algorithms_file: args.algo.is_empty().then_some(args.what[0].as_str()),
        folder: &folder,
        rounds: args.repeat,
        jobs: args.jobs,
        keep_drives: args.drives != Some(KeptDrives::None),
        shard: args.shard,
        lost: recorded.as_ref().map(|recorded| recorded.lost.clone()),
        again: match (args.force, args.times) {
            (true, _) => Again::All,
            (false, true) => Again::Times,
            (false, false) => Again::Missing,
        },
        prune: args.prune,
        shown: BuildOptions {
            area: args.area.area,
            sort: args.sort,
            gate: args.gate,
            figures: args.figures.as_deref(),
            ..BuildOptions::default()
        },
        viewer: chosen_viewer(args, &folder)?,
    };
    junit.outputs.begin()?;
    let evaluated = plan.evaluate(outputs, &Terminal { quiet });
    junit.write(&scenario.name, &evaluated)?;
    answer(args, &scenario.name, &folder, evaluated?)
}

/// Checks what the arguments ask of the scenario, before anything is opened.
fn check_plan(args: &Args, scenario: &Scenario) -> anyhow::Result<()> {
    let algorithms = scenario.algorithms.len();
    if algorithms > MAX_ALGORITHMS {
        let words = format!("{algorithms} algorithms in one run; at most {MAX_ALGORITHMS}");
        return Err(usage::wrong(words));
    }
    if args.gate && scenario.gate.is_empty() {
        return Err(usage::wrong(format!(
            "{}: has no [[gate]], so there is nothing to fail; add one, as `svl score arena \
             --print-scenario` shows",
            args.what[0]
        )));
    }
    let needs = |what: &str| {
        let words = "needs times, which --jobs does not measure; omit one of them";
        Err(usage::wrong(format!("{}: {what} {words}", args.what[0])))
    };
    let is_late = matches!(scenario.latency, Some(Latency::Measured(_)));
    let mut limits = scenario.gate.iter().filter(|_| args.gate);
    match limits.find(|limit| matches!(limit.metric.origin, MetricOrigin::Time)) {
        Some(limit) if args.jobs.is_some() => needs(&format!("gate in line {}", limit.line)),
        None if args.jobs.is_some() && is_late => needs("a measured latency"),
        _ => Ok(()),
    }
}

/// The folder of the report.
fn folder(args: &Args, scenario: &Scenario) -> PathBuf {
    args.output.clone().unwrap_or_else(|| {
        let kind = if args.check { "-check" } else { "" };
        Path::new("reports").join(format!("{}{kind}", scenario.name))
    })
}

fn claim(args: &Args, folder: &Path) -> svl::Result<Outputs> {
    let claim = match args.shard {
        None => Outputs::claim_folder,
        // Others may write there, too.
        Some(_) => Outputs::claim_shared_folder,
    };
    let outputs = claim(folder, &REPORT)?.and_figures(args.figures.as_deref())?;
    let rerun = args.rerun.as_ref().and_then(RerunChoice::target);
    match rerun.and_then(RerunTarget::file) {
        Some(file) => Ok(outputs.and(Outputs::claim(false, [], [file])?)),
        None => Ok(outputs),
    }
}

/// The file of `--junit`, if it is asked for.
struct JunitFile<'a> {
    path: Option<&'a Path>,
    outputs: Outputs,
}

impl<'a> JunitFile<'a> {
    /// The file of an earlier run is replaced, as its report is.
    fn claim(path: Option<&'a Path>) -> svl::Result<Self> {
        let outputs = Outputs::claim(true, [], path)?;
        Ok(Self { path, outputs })
    }

    fn write(self, scenario: &str, evaluated: &svl::Result<Evaluation>) -> anyhow::Result<()> {
        let Some(path) = self.path else {
            return Ok(());
        };
        let report = evaluated.as_ref().ok().and_then(|run| run.report.as_ref());
        let gate = report.map_or(&[][..], |report| &report.gate);
        let error = match evaluated {
            Ok(run) => run.ran.as_ref().err(),
            Err(error) => Some(error),
        };
        let incomplete = || report.and_then(|report| report.summary.ending.incomplete.clone());
        let why = error.map(ToString::to_string).or_else(incomplete);
        let cases = gate.iter().map(GateResult::test_case);
        let cases: Vec<_> = cases.chain([losses_case(why)]).collect();
        write(
            &self.outputs.place(path),
            junit(&format!("svl score {scenario}"), &cases),
        )?;
        Ok(self.outputs.commit()?)
    }
}

/// Prints the report, and checks the limits that were asked for.
fn answer(args: &Args, scenario: &str, folder: &Path, evaluated: Evaluation) -> anyhow::Result<()> {
    let session = evaluated.session;
    let Some(report) = evaluated.report else {
        evaluated.ran?;
        let folder = folder.display();
        return print(&format!(
            "{folder}: this shard is complete; the last of the others builds the report, or `svl \
             report`\n"
        ));
    };
    print_report(&report, scenario, folder, args.explain, args.json)?;
    if !args.json {
        print(&matched_line(&report, session.as_deref()))?;
        if args.jobs.is_some() && !has_times(&report) {
            print("times    not measured with --jobs; --times measures them\n")?;
        }
    }
    if session.is_none() && args.asks_for_rerun() {
        tracing::warn!("nothing was matched, so Rerun shows nothing; --force matches all again");
    }
    evaluated.ran?;
    let BuiltReport { summary, gate, .. } = report;
    match (args.gate, args.check) {
        (true, _) => pass_gate(&gate)?,
        (_, true) => pass_check(&summary)?,
        _ => {}
    }
    check_whole(&summary.ending)?;
    let mut algorithms = summary.algorithms.iter();
    let is_any = algorithms.any(|algorithm| algorithm.scored().is_some_and(|(_, n)| n > 0));
    match &args.source.truth {
        Some(truth) if !is_any => Err(usage::incomplete(format!(
            "nothing was compared: no cell has enough of the truth {truth}"
        ))),
        _ => Ok(()),
    }
}

fn has_times(report: &BuiltReport) -> bool {
    let mut algorithms = report.summary.algorithms.iter();
    algorithms.any(|own| own.p50_ms.is_some())
}

/// The algorithms whose results were in the report, if there are some; without a session all were.
fn matched_line(report: &BuiltReport, session: Option<&str>) -> String {
    let Some(session) = session else {
        let times = report.last_session.as_ref();
        let times = times.filter(|_| has_times(report));
        let times = times.map_or(String::new(), |began| format!("; times of {began}"));
        return format!("matched  nothing: all results were in the report{times}\n");
    };
    let own = |counts: &BTreeMap<String, u64>| counts.get(session).copied().unwrap_or_default();
    let all = |counts: &BTreeMap<String, u64>| counts.values().sum::<u64>();
    let results = &report.results;
    if results.iter().all(|(_, counts)| own(counts) == all(counts)) {
        return String::new();
    }
    let matched = results.iter().filter(|(_, counts)| own(counts) > 0);
    let matched = matched.map(|(label, counts)| format!("{label} ({} pairs)", own(counts)));
    let kept = results
        .iter()
        .filter(|(_, counts)| own(counts) < all(counts));
    let kept = kept.map(|(label, counts)| format!("{label} ({})", all(counts) - own(counts)));
    let [matched, kept] = [matched.collect::<Vec<_>>(), kept.collect()].map(|own| own.join(", "));
    let matched = if matched.is_empty() {
        "nothing"
    } else {
        &matched
    };
    format!("matched  {matched}; in the report already {kept}\n")
}

/// Which drives are kept as recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum KeptDrives {
    All,
    None,
}

/// Refuses options that have no meaning for the scenario.
fn check_kind(args: &Args, scenario: &Scenario) -> anyhow::Result<()> {
    if !matches!(scenario.source, ScenarioSource::Drive { .. }) {
        let name = &scenario.name;
        return match args.drives {
            Some(_) => Err(usage::wrong(format!(
                "--drives is for scenarios of drives; '{name}' has none"
            ))),
            None => Ok(()),
        };
    }
    let given = if args.repeat > 1 {
        "--repeat is not for drives: the times of drives are not measured alone"
    } else if args.asks_for_rerun() {
        "--rerun is not for drives: each drive is a recording in the report's folder, which `svl \
         view` shows"
    } else if args.check {
        "--check is not for drives: the algorithm truth is the check of a drive"
    } else {
        return Ok(());
    };
    Err(usage::wrong(given))
}

/// The viewer that shows the run, and where: one that was asked for gets the maps of all pairs.
fn chosen_viewer(args: &Args, folder: &Path) -> anyhow::Result<Option<ChosenViewer>> {
    Ok(match &args.rerun {
        None => {
            let file = RerunTarget::File(next_report_run(folder));
            viewer()
                .ok()
                .map(|viewer| (viewer, file, RerunDetail::Light))
        }
        Some(choice) => match choice.target().cloned() {
            Some(target) => Some((viewer()?, target, RerunDetail::Full)),
            None => None,
        },
    })
}

/// Refuses a scenario whose checkpoints the truth itself fails.
fn pass_check(summary: &Results) -> anyhow::Result<()> {
    let failed = summary.checkpoints.iter().filter(|c| c.passed < c.frames);
    let failed = failed.map(|c| {
        let (number, name, frames) = (c.checkpoint, &c.name, c.frames);
        format!(
            "{number} {name} in {} of {frames} frames",
            frames - c.passed
        )
    });
    let failed = failed.collect::<Vec<_>>().join(", ");
    let why = if summary.checkpoints.is_empty() {
        "no checkpoint is scored; it needs checkpoints, and frames with truth".to_owned()
    } else if failed.is_empty() {
        return Ok(());
    } else {
        format!("even the truth fails checkpoint {failed}")
    };
    Err(usage::gate(format!("--check: {why}")))
}

/// Pairs that are missing, as a test beside the limits; `why` the run is not complete.
fn losses_case(why: Option<String>) -> TestCase {
    TestCase {
        name: "losses".to_owned(),
        result: why.map_or_else(|| TestResult::Passed(String::new()), TestResult::Failed),
    }
}
