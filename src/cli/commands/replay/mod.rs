//! `svl replay`: a recording through matchers.

mod verify;

use crate::cli::shared::filters::FilterArgs;
use crate::cli::shared::progress::{Terminal, listen_for_interrupt};
use crate::cli::shared::recordings;
use crate::cli::shared::source;
use crate::cli::shared::terminal::{print, print_error, print_json, style};
use crate::cli::shared::usage;
use crate::cli::shared::viewer::{RerunChoice, viewer};
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::console::Watch;
use svl::grab::GrabRequest;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::outputs::Outputs;
use svl::recording::{AlgorithmCells, ImageFormat, LEFT_FRAME, ResultOptions};
use svl::report::Summary;
use svl::run::{Matchers, Pace, complete, ending, run_through};
use svl::runs::{RECORDINGS, cached_run, open_recording, warn_of_own_reference};
use svl::scenario::{Scenario, SourceOptions};
use svl::score::{Judge, Judged};
use svl::sink::{
    CollectSink, PublishRequest, RerunDetail, RerunTarget, RunInfo, RunStart, SinkRequest, Sinks,
    ViewerRequest,
};
use svl::source::{PairRegister, RegisteredSource, Request, are_live_topics};
use svl::train::with_filters;
use svl::{Error, counted};
use verify::{Earlier, Verification};

/// Replay a recording through algorithms
///
/// Every pair goes through every algorithm, in order, none is skipped; the same recording gives the
/// same results on any machine and any number of threads.
#[derive(clap::Args)]
#[command(mut_args(|arg| source::hidden(arg, NOT_TAKEN)))]
#[command(after_help = "\
Examples:
  svl replay     the newest of recordings/, or else the arena
  svl replay run.mcap --algo v3 --algo v3:max_disparity=64 --rows rows.csv
  svl replay raw.mcap --calib calibration.xml
      pairs of raw cameras, rectified on the fly
  svl replay BAG                                 the folder of a ROS 2 bag
  svl replay ros2: --publish ros2:/svl           live topics, until Ctrl-C
  svl replay run.mcap --rerun spawn              watch it in the Rerun viewer
  svl replay run.mcap --rerun run.rrd --rate 1   at the speed it was recorded
  svl replay run.mcap --algo v3 -o result.mcap
  svl replay result.mcap --verify                the same results again?
  svl replay run.mcap --verify=rows.csv
      against a table of rows, or the folder of a report")]
pub(crate) struct Args {
    /// Recording, or the folder of a ROS 2 bag [default: the newest]
    ///
    /// svl's or another program's, or live topics: ros2:[LEFT,RIGHT],
    /// foxglove:ws://HOST:PORT[/LEFT,RIGHT] [default: the newest of recordings/, else the arena,
    /// recorded first].
    #[arg(value_parser = NonEmptyStringValueParser::new())]
    recording: Option<String>,
    /// Algorithm, as NAME[:key=value,…]; repeatable [default: v5]
    ///
    /// `svl algos` lists them [default: v5; with --verify those of the earlier run].
    #[arg(long, value_name = "ALGO", value_parser = usage::algorithm)]
    algo: Vec<Algorithm>,
    #[command(flatten)]
    filters: FilterArgs,
    #[command(flatten)]
    options: SourceOptions,
    /// As fast as possible (asap), or X times the recorded speed
    #[arg(
        long, value_name = "asap|X", allow_negative_numbers = true, default_value = "asap",
        value_parser = pace
    )]
    rate: Pace,
    /// Write pairs, disparities and cells to a recording
    #[arg(short, long, value_name = "RESULT.mcap", value_parser = usage::ending(&["mcap"]))]
    output: Option<PathBuf>,
    /// Write one row per pair and algorithm
    #[arg(
        long, value_name = "FILE.csv|.parquet",
        value_parser = usage::ending(&["csv", "parquet"])
    )]
    rows: Option<PathBuf>,
    /// Write one row per pair, algorithm and cell
    #[arg(
        long, value_name = "FILE.csv|.parquet",
        value_parser = usage::ending(&["csv", "parquet"])
    )]
    cells: Option<PathBuf>,
    /// Rerun: spawn, URL, FILE.rrd, or none [default: none]
    ///
    /// A new viewer, a running one, a file, or none.
    #[arg(long, value_name = "WHERE")]
    rerun: Option<RerunChoice>,
    /// Maps for Rerun: those of all pairs (full), SSDPI apart, or of every 30th and of the first 64
    /// scenes (light); images, overlays and numbers are always those of all pairs
    #[arg(
        long,
        value_name = "light|full",
        default_value = "full",
        requires = "rerun"
    )]
    rerun_detail: RerunDetail,
    /// Publish the results to ROS 2 topics below a prefix
    ///
    /// PREFIX/points, sensor_msgs/msg/PointCloud2 with a point and its probability per known cell;
    /// PREFIX/scan, sensor_msgs/msg/LaserScan; PREFIX/disparity, stereo_msgs/msg/DisparityImage;
    /// PREFIX/depth, sensor_msgs/msg/Image in metres; and /diagnostics once a second.
    #[arg(long, value_name = "ros2:/PREFIX", value_parser = publish_address)]
    publish: Option<String>,
    /// Publish a point and its grey value per pixel with a distance, in place of cells
    #[arg(long, requires = "publish")]
    dense: bool,
    /// Height of the camera above the floor, metres: the published scan then has obstacles below
    /// the camera, too
    #[arg(
        long, value_name = "M", allow_negative_numbers = true, requires = "publish",
        value_parser = usage::within(0.01..=100.0)
    )]
    camera_height: Option<f64>,
    /// Distance in the published scan of cells of state near, metres
    ///
    /// They have none of their own, and are unknown in the scan without this.
    #[arg(
        long, value_name = "M", allow_negative_numbers = true, requires = "publish",
        value_parser = usage::within(0.01..=100.0)
    )]
    near: Option<f64>,
    /// Compare the results with those of an earlier run
    ///
    /// By default with those in the recording itself.
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

/// Options that only scenarios accept.
pub(crate) const NOT_TAKEN: &[&str] = &["data", "scenes", "seeds"];

/// Pairs that may wait for matching while results are published.
const LIVE_QUEUE: usize = 4;
/// The newest pairs of live topics, which the summary is of: their number has no limit.
const LIVE_ROWS: usize = 3000;

fn publish_address(text: &str) -> Result<String, String> {
    if text.starts_with("ros2:") {
        Ok(text.to_owned())
    } else {
        Err("expected ros2:/PREFIX".to_owned())
    }
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
    // Before programs are started: svl has to end them after Ctrl-C.
    listen_for_interrupt();
    let named = args.recording.as_deref();
    let inputs = named.map(source::inputs).unwrap_or_default();
    let rerun = args.rerun.as_ref().and_then(RerunChoice::target);
    let rrd = rerun.and_then(RerunTarget::file);
    let mut outputs = Outputs::claim(
        args.force,
        inputs.iter().map(PathBuf::as_path),
        [
            args.output.as_deref(),
            args.rows.as_deref(),
            args.cells.as_deref(),
            rrd,
        ]
        .into_iter()
        .flatten(),
    )?;
    let name = match named {
        Some(name) => name.to_owned(),
        None => newest_or_arena(quiet)?.display().to_string(),
    };
    args.options
        .refuse(NOT_TAKEN, "is for scenarios; `svl score` accepts them")?;
    let request = Request {
        options: args.options.clone(),
        grab: GrabRequest {
            // A robot needs the newest pair: few may wait.
            queue: (args.publish.is_some() && are_live_topics(&name)).then_some(LIVE_QUEUE),
            ..GrabRequest::default()
        },
        ..Request::new(&name)
    };
    let terminal = Terminal { quiet };
    if args.publish.is_some() && args.algo.len() > 1 {
        let wrong = "--publish is for the results of one algorithm; name one with --algo";
        return Err(Error::Usage(wrong.into()).into());
    }
    let mut opened = open_recording(&request, &terminal)?;
    let seed = opened.header.seed;
    let verify = args.verify.as_ref();
    let before = verify
        .map(|path| {
            let path = path.as_deref().unwrap_or(Path::new(&name));
            Earlier::read(path, &name, opened.recording.as_ref(), seed)
        })
        .transpose()?;
    let filters = args.filters.models()?;
    let algorithms = match (&args.algo[..], &before) {
        ([], Some(before)) => before.algorithms()?,
        ([], None) => vec![Algorithm::default()],
        (named, _) => named.to_vec(),
    };
    let described = Scenario {
        filters: args.filters.of_scenario()?,
        ..Scenario::of_recordings(std::slice::from_ref(&name), algorithms.clone())?
    };
    let described = described.with(&args.options)?;
    let algorithms = with_filters(algorithms, &filters);
    let mut matchers = Matchers::new(&algorithms)?;
    warn_of_own_reference(&args.options, &algorithms)?;
    let run = (opened.source.name(), opened.header.simulated());
    let register = PairRegister::new(&algorithms)?;
    let source = RegisteredSource::new(opened.source, &register, run, true);
    opened.source = Box::new(source);

    outputs.set_aside()?;
    let mut manifest = Manifest {
        bits: opened.header.bits,
        description: Some(described.to_json()?),
        ..Manifest::new(opened.title(), &algorithms)?
    };
    manifest.set_rule(Judge::default().cells);
    manifest.times = Some(args.rate.times());
    manifest.runs = vec![opened.record(&opened.source.name(), Path::new(&name))];
    let shown = rerun.cloned().map(|target| {
        let scenario = opened.scenario.as_deref();
        let scenario = scenario.and_then(|text| Scenario::parse(text, Path::new(&name)).ok());
        let wireframe = scenario.map_or_else(Vec::new, |s| s.wireframe(seed));
        svl::Result::Ok(ViewerRequest {
            viewer: viewer()?,
            target,
            detail: args.rerun_detail,
            info: RunInfo::new(&manifest, wireframe),
        })
    });
    let result = |path: &PathBuf| opened.writer(path, ImageFormat::Raw, &manifest);
    let mut sinks = Sinks::open(SinkRequest {
        rows: args.rows.as_deref(),
        cells: args.cells.as_deref(),
        newest_rows: opened.is_live.then_some(LIVE_ROWS),
        viewer: shown.transpose()?,
        publish: args.publish.as_deref().map(|address| PublishRequest {
            address,
            options: ResultOptions {
                camera_height_m: args.camera_height,
                near_m: args.near,
                dense: args.dense,
                ..ResultOptions::new(opened.header.frame_id.as_deref().unwrap_or(LEFT_FRAME))
            },
        }),
        recording: args.output.as_ref().map(result).transpose()?,
        ..SinkRequest::default()
    })?;
    let now = before
        .as_ref()
        .filter(|before| before.has_cells())
        .map(|_| {
            let cells = CollectSink::new(|judged: &Judged| {
                let estimates = judged.estimates.iter().map(|scored| &scored.estimate);
                let cells = |estimate| AlgorithmCells::new(judged.frame.sequence, estimate);
                estimates.map(cells).collect::<Vec<_>>()
            });
            let outbox = cells.outbox();
            sinks.push(cells);
            outbox
        });
    let mut judge = Judge::default();
    // Its rows are known as those of live topics.
    if opened.is_live {
        judge.run.name.clone_from(&name);
    }
    let start = RunStart::new(&manifest, seed, &judge);
    let title = opened.source.name();
    let watch = Watch::new(
        &terminal,
        &format!("match {title}"),
        opened.source.pairs(),
        None,
    );
    let (outcome, ran) = run_through(
        &mut *opened.source,
        &mut matchers,
        &start,
        args.rate,
        sinks.as_mut_slice(),
        watch,
    );
    // Everything that came before an error is kept and reported, so the sinks are finished first.
    let (rows, finished) = sinks.finish();
    let pairs = outcome.frames;
    let mut verification = None;
    // Live topics have no other end.
    let interrupted = outcome.interrupted && !opened.is_live;
    let stopped = interrupted.then(|| {
        let done = counted(pairs, "pair");
        Err(Error::Invalid(format!("interrupted after {done}")))
    });
    let ran_to_end = stopped.as_ref().unwrap_or(&ran);
    let ending = ending(ran_to_end, outcome.missing(), args.options.allow_loss);
    if pairs > 0 || ran.is_ok() {
        if ran.is_ok() && finished.is_ok() && !interrupted {
            outputs.commit();
        } else {
            outputs.keep_both();
        }
    }
    if finished.is_ok() && !(ran.is_err() && pairs == 0) {
        let mut summary = Summary {
            ending: ending.clone(),
            ..Summary::from_rows(&rows, &[])?
        };
        matchers.complete(&mut manifest);
        summary.complete(&mut manifest);
        summary.find_leads(&rows, &[]);
        verification = before
            .map(|before| {
                let cells = now.map(|now| now.take().concat()).unwrap_or_default();
                before.compare(&rows, &cells, &algorithms)
            })
            .transpose()?;
        let grabber = outcome.losses.grabber.as_ref();
        if args.json {
            print_json(&Answer {
                summary: &summary,
                received: grabber.map(|grabber| &grabber.facts),
                verification: &verification,
            })?
        } else {
            let files = [&args.output, &args.rows, &args.cells]
                .into_iter()
                .flatten();
            let files: Vec<_> = files.map(|file| file.display().to_string()).collect();
            let written = match files.len() {
                0 => String::new(),
                _ => format!("\nwritten  {}\n", files.join(", ")),
            };
            let received = grabber.map(|grabber| format!("\nreceived {}\n", grabber.text));
            let received = received.unwrap_or_default();
            let received = match opened.is_live && rows.len() >= LIVE_ROWS {
                true => format!("\nsummary  of the last {LIVE_ROWS} results\n{received}"),
                false => received,
            };
            print(&(summary.terminal(&title, style(), false) + &received + &written))?
        }
    }
    ran?;
    finished?;
    if let (true, Some(why)) = (interrupted, &ending.incomplete) {
        bail!("{why}; what was written is kept");
    }
    if let Some(verification) = verification {
        let proved = verification.proved()?;
        if !args.json {
            print(&proved)?;
        }
    }
    Ok(complete(&ending)?)
}

/// The JSON that `--json` prints.
#[derive(serde::Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    summary: &'a Summary,
    /// The counts of live topics.
    #[serde(skip_serializing_if = "Option::is_none")]
    received: Option<&'a BTreeMap<String, String>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    verification: &'a Option<Verification>,
}

/// The newest recording, or else the arena, which is recorded first.
fn newest_or_arena(quiet: bool) -> anyhow::Result<PathBuf> {
    if let Some(path) = recordings::newest() {
        return Ok(path);
    }
    if !quiet {
        print_error(format_args!(
            "no recording in {RECORDINGS}/: recording the arena first"
        ));
    }
    Ok(cached_run(
        &Scenario::arena()?,
        1,
        &Terminal { quiet },
        None,
    )?)
}
