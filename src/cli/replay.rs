//! `svl replay`: a recording through matchers.

use super::output::{may_write, print, print_json};
use super::progress::Progress;
use super::run_info;
use super::source::{self, RECORDINGS};
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use svl::arena::Wire;
use svl::matcher::Algorithm;
use svl::recording::{Header, ImageFormat, Writer};
use svl::report::{Row, Summary, Table};
use svl::run::{Pace, run as run_loop};
use svl::scenario::{GridSettings, Scenario};
use svl::score::CellRule;
use svl::sink::{RecordingSink, RerunSink, RerunTarget, RowSink, Sink};
use svl::source::{RecordingSource, Source};

/// Replay a recording through algorithms
///
/// Every pair goes through every algorithm, in order, none is skipped; the same recording gives the same results on any
/// machine and any number of threads.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl replay                                      the newest of recordings/, or else the arena
  svl replay run.mcap --algo v3 --algo v3:max_disparity=64 --rows rows.csv
  svl replay run.mcap --rerun spawn               watch it in the Rerun viewer
  svl replay run.mcap --rerun run.rrd --rate 1    at the speed it was recorded")]
pub(super) struct Args {
    /// Recording to replay [default: the newest of recordings/, else the arena, recorded first]
    recording: Option<PathBuf>,
    /// Algorithm, as `svl algos` lists them; may be given more than once
    #[arg(long, value_name = "NAME[:key=value,…]", default_value = "v3")]
    algo: Vec<Algorithm>,
    /// As soon as possible, or so many times the recorded speed
    #[arg(long, value_name = "asap|X", default_value = "asap", value_parser = pace)]
    rate: Pace,
    /// Write pairs and disparities to a recording
    #[arg(short, long, value_name = "RESULT.mcap")]
    output: Option<PathBuf>,
    /// Write one row per pair and algorithm
    #[arg(long, value_name = "FILE.csv|.parquet")]
    rows: Option<PathBuf>,
    /// Show the run in Rerun: a new viewer, a running one, or a file
    #[arg(long, value_name = "spawn|URL|FILE.rrd")]
    rerun: Option<RerunTarget>,
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
    super::positive(text)
        .map(Pace::Times)
        .map_err(|_| "expected 'asap' or a positive number, 2 being twice as fast".into())
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let rrd = match &args.rerun {
        Some(RerunTarget::File(path)) => Some(path),
        _ => None,
    };
    for path in [args.output.as_ref(), args.rows.as_ref(), rrd].into_iter().flatten() {
        may_write(path, args.force)?;
        if args.force && path.exists() {
            std::fs::remove_file(path).with_context(|| format!("{}: cannot replace it", path.display()))?;
        }
    }
    let recording = match &args.recording {
        Some(path) => path.clone(),
        None => newest_or_arena(quiet)?,
    };
    let mut source = RecordingSource::open(&recording)?;
    let header = source.reader().header().cloned().unwrap_or_else(|| Header::new(recording.display().to_string()));
    let scenario = header.scenario.clone().unwrap_or_else(|| stem(&recording));

    let run_id = run_info::run_id(&scenario);
    let settings = GridSettings::default();
    let mut identity = run_info::identity(&run_id, &scenario, &args.algo, CellRule::Distance, settings.shape());
    identity.seed = header.seed;
    let table = args.rows.as_deref().map(Table::<Row>::create).transpose()?;
    let mut rows = RowSink::new(identity.clone(), table);
    let mut rerun = match &args.rerun {
        Some(target) => {
            Some(RerunSink::new(target.clone(), &run_info::rerun(&identity, &args.algo, wireframe(&recording)))?)
        }
        None => None,
    };
    let mut result = match &args.output {
        Some(path) => Some(RecordingSink::new(Writer::create(path, &header, ImageFormat::Raw)?)),
        None => None,
    };
    let mut sinks: Vec<&mut dyn Sink> = vec![&mut rows];
    sinks.extend(rerun.as_mut().map(|sink| sink as &mut dyn Sink));
    sinks.extend(result.as_mut().map(|sink| sink as &mut dyn Sink));

    let mut progress = Progress::new(&source.name(), source.pairs(), quiet);
    let ran = run_loop(&mut source, &args.algo, settings, args.rate, &mut sinks, &mut progress);
    progress.clear();
    // Everything that came before an error is kept, so the sinks are finished first.
    let finished = sinks.iter_mut().map(|sink| sink.finish()).fold(Ok(()), Result::and);
    if ran.is_err() && !rows.rows().is_empty() {
        tracing::warn!("what was replayed before the error below is kept");
    }
    let outcome = ran?;
    finished?;
    let summary = Summary::of_rows(rows.rows())?;
    if args.json {
        print_json(&summary)?;
    } else {
        print(&format!("{} ({} pairs)\n{summary}", recording.display(), outcome.frames))?;
    }
    if source.reader().unpaired() > 0 {
        tracing::warn!(
            "{}: {} images found no partner and were left out",
            recording.display(),
            source.reader().unpaired()
        );
    }
    if outcome.interrupted {
        bail!("stopped by Ctrl-C after {} pairs; what was written is kept", outcome.frames);
    }
    run_info::complete(outcome.failures)
}

/// The newest recording there is, or else a new one of the arena.
fn newest_or_arena(quiet: bool) -> anyhow::Result<PathBuf> {
    if let Some(path) = source::newest_recording() {
        return Ok(path);
    }
    source::make_recordings_folder()?;
    let opened = source::open("arena", 1)?;
    let path = source::free_name(Path::new(RECORDINGS), &opened.stem);
    if !quiet {
        eprintln!("no recording in {RECORDINGS}/: recording the arena to {} first", path.display());
    }
    super::record::write(opened, &path, ImageFormat::Raw, quiet)?;
    Ok(path)
}

/// The arena's true geometry, when the recording says which arena it is of.
fn wireframe(recording: &Path) -> Vec<Wire> {
    let scenario = svl::recording::attachment(recording, "scenario.toml").ok().flatten();
    let scenario = scenario.and_then(|bytes| String::from_utf8(bytes).ok());
    scenario.and_then(|text| Scenario::parse(&text, recording).ok()).map_or_else(Vec::new, |s| run_info::wireframe(&s))
}

fn stem(path: &Path) -> String {
    path.file_stem().and_then(|s| s.to_str()).unwrap_or("recording").to_owned()
}
