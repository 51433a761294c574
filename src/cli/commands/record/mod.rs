//! `svl record`: a source into a recording.

use crate::cli::shared::source::{self, CameraArgs, SCENARIO_OPTIONS};
use crate::cli::shared::terminal::{print, print_error};
use crate::cli::shared::{recordings, usage};
use std::io::{IsTerminal, stdout};
use std::path::{Path, PathBuf};
use std::time::Instant;
use svl::counted;
use svl::losses::Ending;
use svl::outputs::Outputs;
use svl::pass::{Outcome, complete};
use svl::recording::{Dialect, ImageFormat, RecordingFormat, StampOrigin};
use svl::scenario::SourceOptions;
use svl::source::{Chain, FirstPairs, Opened, Request, SourceKind};

/// Record pairs to an MCAP file
///
/// Ctrl-C ends the recording and leaves it intact.
#[derive(clap::Args)]
#[command(mut_args(|arg| source::hidden(arg, SCENARIO_OPTIONS)))]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Source to record, as `svl help sources` lists them [default: arena]
    #[arg(value_parser = source::SourceParser, hide_possible_values = true)]
    source: Option<String>,
    /// File to write [default: recordings/SOURCE-N.mcap]
    ///
    /// -: the rectified pairs to standard output, in the form of docs/exec-protocol.md.
    #[arg(
        short, long, value_name = "FILE.mcap", value_parser = usage::ending_or_stdout(&["mcap"]),
        help_heading = "Output"
    )]
    output: Option<PathBuf>,
    /// Largest number of pairs
    #[arg(
        long, value_name = "N", conflicts_with = "duration",
        value_parser = usage::within(1..=1_000_000_000_000u64), help_heading = "Input"
    )]
    frames: Option<u64>,
    /// Largest duration, seconds of the source's stamps
    #[arg(
        long, value_name = "S", value_parser = usage::within(0.001..=1e9), help_heading = "Input"
    )]
    duration: Option<f64>,
    /// Seed of the textures, path and noise of a simulated source [default: 1, or a scenario's
    /// first]
    #[arg(
        long, value_name = "N", value_parser = usage::within(0..=u64::MAX), help_heading = "Input"
    )]
    seed: Option<u64>,
    #[command(flatten)]
    options: SourceOptions,
    /// Store the images as PNG: smaller, slower
    #[arg(long, help_heading = "Output")]
    compress: bool,
    /// Write a ROS 2 bag: sensor_msgs and tf2_msgs in CDR, and as JSON in strings what ROS has no
    /// message for
    #[arg(long, help_heading = "Output")]
    ros2: bool,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// List the cameras and serial ports of this machine
    #[arg(long, exclusive = true, help_heading = "Input")]
    list: bool,
    #[command(flatten)]
    cameras: CameraArgs,
}

const EXAMPLES: &str = "\
Examples:
  svl record                                 recordings/arena-seed1-1.mcap
  svl record arena --seed 7 --duration 5 -o five-seconds.mcap
  svl record datasets/cones -o cones.mcap
  svl record bag.mcap --left /cam0/image_raw --right /cam1/image_raw
  svl record raw.mcap --calib calibration.xml -o rectified.mcap
  svl record run.mcap --ros2 -o bag.mcap     a recording as a ROS 2 bag
  svl record --list                          cameras and serial ports
  svl record sim --rate 60 --duration 60     triggered when both are armed
  svl record ros2:                           live topics, until Ctrl-C
  svl record v4l2:/dev/video0,/dev/video2    free-running webcams
  svl record genicam:LEFT,RIGHT --trigger serial:/dev/ttyACM0
      triggered by the trigger controller
  svl record sim:right.jitter_ms=12 --trigger fixed:60 --pairing order
      what a fixed rate does to the phase";

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    if args.list {
        return source::list();
    }
    let source = args.source.as_deref().unwrap_or("arena");
    args.options.refuse(
        SCENARIO_OPTIONS,
        "is for scenarios; `svl score` accepts them",
    )?;
    if args.output.as_deref() == Some(Path::new(usage::STDOUT)) {
        return stream(args, source, quiet);
    }
    let inputs = source::inputs(source);
    let claim =
        |path: &Path| Outputs::claim(args.force, inputs.iter().map(PathBuf::as_path), [path]);
    let claimed = args.output.as_deref().map(claim).transpose()?;
    let opened = limited(source::open(request(args, source), quiet)?, args)?;
    let (output, mut outputs) = match args.output.clone().zip(claimed) {
        Some(claimed) => claimed,
        None => {
            let path = recordings::free_name(&opened.stem)?;
            let claimed = claim(&path)?;
            (path, claimed)
        }
    };
    outputs.begin()?;
    let place = outputs.place(&output);
    if args.source.is_none() && !quiet {
        say_default(opened.source.pairs());
    }
    let stamps = opened.header.stamps.filter(|_| opened.recording.is_none());
    let is_live = opened.is_live;
    let began = Instant::now();
    let pairs = opened.source.pairs();
    let (outcome, ran) = recordings::record(opened, &place, format(args), quiet);
    let reached_end = reached_end(source, &outcome, pairs);
    let is_kept = place.exists();
    let is_whole = ran.is_ok() && reached_end.is_ok();
    let output = if is_whole { output } else { place };
    // Decided before anything is printed: a closed or full standard output costs no recording.
    match (is_whole, is_kept) {
        (true, _) => outputs.commit()?,
        (false, true) => outputs.keep_both(),
        (false, false) => drop(outputs),
    }
    let kept = is_kept.then(|| output.display().to_string());
    let printed = match outcome.losses.grabber.as_ref().filter(|_| !quiet) {
        Some(grabber) => {
            let whose = kept.as_deref().unwrap_or(source);
            print(&format!("{whose}: {}\n", grabber.text))
        }
        None => Ok(()),
    };
    ran?;
    printed?;
    let ending = Ending::new(outcome.missing(), args.options.allow_loss);
    if !quiet {
        if let Some(note) = ending.note() {
            print_error(format_args!("{source}: not recorded: {note}"));
        }
        // Waiting for the first pair of a live source is not recording.
        let time = if is_live && outcome.frames > 1 {
            outcome.duration
        } else {
            began.elapsed()
        };
        print(&report(&output, &outcome, pairs, time.as_secs_f64())?)?;
        if let Some(note) = stamps.as_ref().and_then(StampOrigin::note) {
            print_error(format_args!("{source}: {note}"));
        }
    }
    reached_end?;
    Ok(complete(&ending)?)
}

/// Fails for a source that was interrupted before its end; cameras and live topics have no other.
fn reached_end(source: &str, outcome: &Outcome, pairs: Option<u64>) -> svl::Result<()> {
    if SourceKind::without_files(source).is_some_and(SourceKind::is_live) {
        return Ok(());
    }
    outcome.reached_end(pairs)
}

/// Writes the pairs to standard output instead of a file.
fn stream(args: &Args, source: &str, quiet: bool) -> anyhow::Result<()> {
    if args.compress || args.ros2 || args.force {
        let of_files = "--compress, --ros2 and --force are for files; omit them or -o -";
        return Err(usage::wrong(of_files));
    }
    if stdout().is_terminal() {
        let cure = "pipe it to a program, or name a file with -o FILE.mcap";
        return Err(usage::wrong(format!("-o - writes binary pairs; {cure}")));
    }
    let opened = limited(source::open(request(args, source), quiet)?, args)?;
    let pairs = opened.source.pairs();
    let (outcome, ran) = recordings::stream(opened, quiet);
    ran?;
    reached_end(source, &outcome, pairs)?;
    let ending = Ending::new(outcome.missing(), args.options.allow_loss);
    Ok(complete(&ending)?)
}

/// The source, with the options of the command line.
fn request<'a>(args: &'a Args, source: &'a str) -> Request<'a> {
    let mut request = Request {
        seed: args.seed,
        options: args.options.clone(),
        live_s: args.duration,
        ..Request::new(source)
    };
    args.cameras.fill(&mut request);
    (request.grab.pairs, request.grab.duration_s) = (args.frames, args.duration);
    request
}

/// The pairs of the source from the first one that is taken.
fn limited(opened: Opened, args: &Args) -> svl::Result<Opened> {
    opened.over(Chain {
        take: FirstPairs::new(args.duration, args.frames),
        ..Chain::default()
    })
}

fn format(args: &Args) -> RecordingFormat {
    RecordingFormat {
        dialect: if args.ros2 {
            Dialect::Ros2
        } else {
            Dialect::Svl
        },
        images: if args.compress {
            ImageFormat::Png
        } else {
            ImageFormat::Raw
        },
    }
}

/// Says what is recorded without a SOURCE. `pairs`: their number, if it is known.
fn say_default(pairs: Option<u64>) {
    let pairs = pairs.map(|pairs| counted(pairs, "pair"));
    let pairs = pairs.map_or_else(String::new, |pairs| format!(", {pairs}"));
    let others = "`svl help sources` lists other sources";
    print_error(format!(
        "no SOURCE is named: records the arena{pairs}; {others}"
    ));
}

/// The line about the file. `pairs`: their number in the source, if it is known.
fn report(
    path: &Path,
    outcome: &Outcome,
    pairs: Option<u64>,
    seconds: f64,
) -> anyhow::Result<String> {
    let megabytes = path.metadata()?.len() as f64 / 1e6;
    let (path, recorded) = (path.display(), counted(outcome.frames, "pair"));
    let rate = outcome.frames as f64 / seconds;
    let stopped = if outcome.stopped_early(pairs) {
        ", interrupted"
    } else {
        ""
    };
    Ok(format!(
        "{path}: {recorded} in {seconds:.1} s ({rate:.0} a second), {megabytes:.1} MB{stopped}\n"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interrupt_at_the_last_pair_is_none() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let outcome = Outcome {
            frames: 2,
            interrupted: true,
            ..Outcome::default()
        };
        let line = |pairs| report(file.path(), &outcome, pairs, 1.0).unwrap();
        assert!(line(Some(2)).ends_with("2 pairs in 1.0 s (2 a second), 0.0 MB\n"));
        // A source of three pairs, and a live source.
        assert!(
            [Some(3), None]
                .map(line)
                .iter()
                .all(|line| line.ends_with(", interrupted\n"))
        );
    }
}
