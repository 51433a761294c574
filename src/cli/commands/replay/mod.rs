//! `svl replay`: a recording through matchers.

mod verify;

use crate::cli::shared::outputs::Outputs;
use crate::cli::shared::rectify::{Recorded, Rectify};
use crate::cli::shared::source::{self, RECORDINGS};
use crate::cli::shared::terminal::{print, print_json};
use crate::cli::shared::{cache, runner, usage};
use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::counted;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::recording::{Header, ImageFormat, SCENARIO, Writer};
use svl::report::Summary;
use svl::run::{Matchers, Pace};
use svl::scenario::Scenario;
use svl::score::Judge;
use svl::sink::{RerunTarget, RunInfo, RunStart, SinkRequest, Sinks};
use svl::source::RecordingSource;
use verify::{Earlier, Verification};

/// Replay a recording through algorithms
///
/// Every pair goes through every algorithm, in order, none is skipped; the same recording gives the
/// same results on any machine and any number of threads.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl replay     the newest of recordings/, or else the arena
  svl replay run.mcap --algo v3 --algo v3:max_disparity=64 --rows rows.csv
  svl replay raw.mcap --calib calibration.xml
      pairs of raw cameras, rectified on the fly
  svl replay BAG                                 the folder of a ROS 2 bag
  svl replay run.mcap --rerun spawn              watch it in the Rerun viewer
  svl replay run.mcap --rerun run.rrd --rate 1   at the speed it was recorded
  svl replay run.mcap --algo v3 -o result.mcap
  svl replay result.mcap --verify                the same results again?
  svl replay run.mcap --verify=rows.csv
      against a table of rows, or the folder of a report")]
pub(crate) struct Args {
    /// Recording to replay, svl's or another program's, or the folder of a ROS 2 bag [default: the
    /// newest of recordings/, else the arena, recorded first]
    recording: Option<PathBuf>,
    /// Algorithm, as `svl algos` lists them; may be given more than once [default: v3; with
    /// --verify those of then]
    #[arg(long, value_name = "NAME[:key=value,…]", value_parser = usage::algorithm)]
    algo: Vec<Algorithm>,
    #[command(flatten)]
    topics: source::Topics,
    #[command(flatten)]
    rectify: Rectify,
    /// As soon as possible, or so many times the recorded speed
    #[arg(
        long, value_name = "asap|X", allow_negative_numbers = true, default_value = "asap",
        value_parser = pace
    )]
    rate: Pace,
    /// Write pairs and disparities to a recording
    #[arg(short, long, value_name = "RESULT.mcap", value_parser = usage::ending(&["mcap"]))]
    output: Option<PathBuf>,
    /// Write one row per pair and algorithm
    #[arg(
        long, value_name = "FILE.csv|.parquet",
        value_parser = usage::ending(&["csv", "parquet"])
    )]
    rows: Option<PathBuf>,
    /// Show the run in Rerun: a new viewer, a running one, or a file
    #[arg(long, value_name = "spawn|URL|FILE.rrd")]
    rerun: Option<RerunTarget>,
    /// Prove that the results are those of an earlier run, by default those in the recording itself
    #[arg(
        long, value_name = "RESULT.mcap|ROWS.csv|REPORT", num_args = 0..=1, require_equals = true
    )]
    verify: Option<Option<PathBuf>>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
}

fn pace(text: &str) -> Result<Pace, String> {
    if text == "asap" {
        return Ok(Pace::Asap);
    }
    let times = usage::within(0.001..=1000.0)(text);
    times
        .map(Pace::Times)
        .map_err(|why| format!("{why}, 2 being twice as fast, or 'asap'"))
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    args.recording
        .as_deref()
        .map_or(Ok(()), source::is_recorded)?;
    let inputs = args
        .recording
        .as_deref()
        .map(source::inputs)
        .unwrap_or_default();
    let rrd = args.rerun.as_ref().and_then(RerunTarget::file);
    let mut outputs = Outputs::claim(
        args.force,
        inputs.iter().map(PathBuf::as_path),
        [args.output.as_deref(), args.rows.as_deref(), rrd]
            .into_iter()
            .flatten(),
    )?;
    let source = match &args.recording {
        Some(path) => args.topics.open(path)?,
        None => newest_or_arena(quiet)?,
    };
    let opened = source.reader().recording().clone();
    let recording = opened.path().to_owned();
    let mut header = source
        .reader()
        .header()
        .cloned()
        .unwrap_or_else(|| Header::new(recording.display().to_string()));
    let scenario = header.scenario.clone().unwrap_or_else(|| stem(&recording));
    let scenario_text = source.scenario()?;
    let recorded = Recorded::of(&source)?;
    let (mut source, recorded) =
        args.rectify
            .pairs(Box::new(source), recorded, &mut header, quiet)?;
    let verify = args
        .verify
        .as_ref()
        .map(|path| path.as_deref().unwrap_or(&recording));
    let before = verify
        .map(|path| Earlier::read(path, &opened, header.seed))
        .transpose()?;
    let algorithms = match (&args.algo[..], &before) {
        ([], Some(before)) => before.algorithms()?,
        ([], None) => vec!["v3".parse()?],
        (named, _) => named.to_vec(),
    };
    let mut matchers = Matchers::new(&algorithms)?;

    outputs.set_aside()?;
    let manifest = Manifest::new(&scenario, scenario_text.as_deref(), &algorithms)?;
    let rerun = args.rerun.clone().map(|target| {
        let parsed = scenario_text
            .as_deref()
            .and_then(|text| Scenario::parse(text, &recording).ok());
        let wireframe = parsed.map_or_else(Vec::new, |s| s.wireframe(header.seed));
        (target, RunInfo::new(&manifest, wireframe))
    });
    let result = |path: &PathBuf| {
        let mut writer = Writer::create(path, &header, ImageFormat::Raw)?;
        writer.identify(&manifest)?;
        if let Some(text) = &scenario_text {
            writer.attach(SCENARIO, "application/toml", text.as_bytes())?;
        }
        recorded.attach(&mut writer)?;
        anyhow::Ok(writer)
    };
    let mut sinks = Sinks::open(SinkRequest {
        rows: args.rows.as_deref(),
        rerun,
        recording: args.output.as_ref().map(result).transpose()?,
        ..SinkRequest::default()
    })?;
    let judge = Judge::default();
    let start = RunStart {
        manifest: &manifest,
        seed: header.seed,
        judge: &judge,
    };
    let title = source.name();
    let (outcome, ran) = runner::run_through(
        &mut *source,
        &mut matchers,
        &start,
        args.rate,
        sinks.as_mut_slice(),
        &title,
        quiet,
    );
    // Everything that came before an error is kept and reported, so the sinks are finished first.
    let (results, finished) = sinks.finish();
    let rows = results.rows;
    let pairs = outcome.frames;
    let mut verification = None;
    if pairs > 0 || ran.is_ok() {
        match ran.is_ok() && finished.is_ok() {
            true => outputs.commit(),
            false => outputs.keep_both(),
        }
    }
    if finished.is_ok() && !(ran.is_err() && pairs == 0) {
        let incomplete = match &ran {
            Err(error) => Some(error.to_string()),
            Ok(()) => outcome.missing(),
        };
        let summary = Summary {
            incomplete,
            ..Summary::from_rows(&rows, &[])?
        };
        verification = before
            .map(|before| before.compare(&rows, &algorithms))
            .transpose()?;
        let text = || {
            format!(
                "{} ({})\n{summary}",
                recording.display(),
                counted(pairs, "pair")
            )
        };
        if args.json {
            print_json(&Answer {
                summary: &summary,
                verification: &verification,
            })?
        } else {
            print(&text())?
        }
    }
    ran?;
    finished?;
    if outcome.interrupted {
        bail!(
            "stopped by Ctrl-C after {}; what was written is kept",
            counted(outcome.frames, "pair")
        );
    }
    if let Some(verification) = verification {
        let proved = verification.proved()?;
        if !args.json {
            print(&proved)?;
        }
    }
    runner::complete(&outcome)
}

/// What `--json` prints.
#[derive(serde::Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    summary: &'a Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    verification: &'a Option<Verification>,
}

/// The newest recording there is, or else the arena, recorded for this.
fn newest_or_arena(quiet: bool) -> anyhow::Result<RecordingSource> {
    if let Some(path) = source::newest_recording() {
        return Ok(RecordingSource::open(path)?);
    }
    if !quiet {
        eprintln!("no recording in {RECORDINGS}/: recording the arena first");
    }
    cache::recording(&Scenario::arena()?, 1, quiet)
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .and_then(|s| s.to_str())
        .unwrap_or("recording")
        .to_owned()
}
