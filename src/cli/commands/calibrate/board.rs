//! `svl calibrate board`: stereo calibration from images of a chessboard.

use super::ask::{Answers, ViewPrompt};
use super::collect::{Collected, collect};
use super::report::ReportFolder;
use crate::cli::shared::source::{self, CameraArgs};
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::usage;
use crate::cli::shared::viewer::RerunChoice;
use anyhow::{anyhow, bail};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use svl::calibrate::{Board, MIN_VIEWS, Solution, files, solve};
use svl::outputs::Outputs;
use svl::rectify::{Framing, bouguet, hidden_views};
use svl::report::calibration;
use svl::scenario::SourceOptions;
use svl::sink::RerunTarget;
use svl::source::{Opened, Request};
use svl::stereo::DistortionModel;

/// Calibrate two cameras from images of a chessboard
///
/// Detects the board in every pair and selects the pairs that help: all of the board in both
/// images, sharp, held still, in a new pose. Each is shown for you to accept (--yes accepts all)
/// until there are enough; then intrinsics, distortion and extrinsics of both cameras are computed,
/// with standard deviations. Move the board through all of the image, near and far, tilted to all
/// sides, and hold it still for a moment in each pose.
///
/// Ctrl-C ends the search and calibrates from the accepted pairs, which are kept as PNG files.
#[derive(clap::Args)]
#[command(mut_args(|arg| source::hidden(arg, NOT_TAKEN)))]
#[command(after_help = "\
Sources are those of `svl record`: a folder with left01.png, right01.png, ...
or left/ and right/, a recording (.mcap), cameras, or `board`, a simulated
board.

Examples:
  svl calibrate board pictures/ --squares 9x6 --square-m 0.025 -o calib.xml
  svl calibrate board run.mcap --yes -o calib.yaml
      from a recording, without questions
  svl calibrate board v4l2:/dev/video0,/dev/video2 -o calib.xml
  svl calibrate board calib-report --yes -o again.xml
      again, from the accepted pairs
  svl calibrate board pictures/ --model equidistant -o fisheye.yaml
  svl calibrate board board --square-m 0.03 --yes -o simulated.xml
      without any camera")]
pub(super) struct Args {
    /// Source of the pairs
    #[arg(value_parser = source::SourceParser, hide_possible_values = true)]
    source: String,
    /// Inner corners of the board along its sides, where four squares meet: one less than its
    /// squares
    #[arg(
        long, value_name = "COLUMNSxROWS", default_value = "9x6", value_parser = squares,
        help_heading = "Input"
    )]
    squares: (usize, usize),
    /// Side of a square, metres, as measured [default: unknown, and lengths are in squares]
    #[arg(
        long, value_name = "S", allow_negative_numbers = true,
        value_parser = usage::within(1e-4..=100.0), help_heading = "Input"
    )]
    square_m: Option<f64>,
    /// Distortion model of both cameras: plumb_bob; rational_polynomial, for wide lenses;
    /// equidistant, for fisheyes
    #[arg(long, value_name = "MODEL", default_value_t, help_heading = "Input")]
    model: DistortionModel,
    /// Accept every pair that helps, without asking
    #[arg(short, long, help_heading = "Run")]
    yes: bool,
    /// Calibration to write; the report and the accepted pairs go into a folder beside it,
    /// OUT-report
    #[arg(
        short, long, value_name = "OUT.xml|.yaml",
        value_parser = usage::ending(&["xml", "yaml", "yml"]), help_heading = "Output"
    )]
    output: PathBuf,
    /// Rerun: spawn, URL, FILE.rrd, or none [default: spawn, with --yes none]
    ///
    /// A new viewer, a running one, a file, or none.
    #[arg(long, value_name = "WHERE", help_heading = "Output")]
    rerun: Option<RerunChoice>,
    #[command(flatten)]
    options: SourceOptions,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
    #[command(flatten)]
    cameras: CameraArgs,
}

/// Boards are found in all raw pairs.
pub(crate) const NOT_TAKEN: &[&str] = &[
    "data",
    "scenes",
    "seeds",
    "allow_loss",
    "truth",
    "calib",
    "alpha",
    "crop",
    "scale",
    "every",
    "from_s",
    "to_s",
];

fn squares(text: &str) -> Result<(usize, usize), String> {
    let sides = usage::two(text, 'x').ok_or("expected inner corners along both sides, as 9x6")?;
    Board::new(sides, None).map_err(|e| e.to_string())?;
    Ok(sides)
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let board = Board::new(args.squares, args.square_m)?;
    let source = Path::new(&args.source);
    let rerun = args.rerun.as_ref().and_then(RerunChoice::target);
    let rrd = rerun.and_then(RerunTarget::file);
    let outputs = [args.output.as_path()].into_iter().chain(rrd);
    let outputs = Outputs::claim(args.force, [source], outputs)?;
    let can_ask = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
    if !args.yes && !can_ask {
        bail!("asking about each pair needs a terminal; add --yes to accept all that help");
    }
    args.options
        .refuse(NOT_TAKEN, "does not apply to a calibration's source")?;
    let mut request = Request {
        raw: true,
        options: args.options.clone(),
        ..Request::new(&args.source)
    };
    args.cameras.fill(&mut request);
    let opened = source::open(request, quiet)?;
    let (mut folder, claimed) = ReportFolder::claim(&args.output, source, args.force)?;
    // The calibration is written last, but its path is claimed before the user spends time on
    // views.
    let mut outputs = outputs.and(claimed);
    outputs.begin()?;
    let (report, picture) = (folder.path.clone(), folder.picture());
    folder.path = outputs.place(&report);
    let answers = if args.yes {
        Answers::AcceptAll
    } else {
        Answers::from_terminal()
    };
    let target = match &args.rerun {
        Some(choice) => choice.target().map(|target| target.placed(&outputs)),
        None => (!args.yes).then_some(RerunTarget::Spawn),
    };
    let prompt = ViewPrompt::new(answers, target, args.rerun.is_some(), &board, picture)?;

    let place = outputs.place(&args.output);
    let calibrated = calibrate(
        args,
        board,
        opened,
        prompt,
        (&mut folder, &place, &report),
        quiet,
    );
    match (&calibrated, folder.pairs()) {
        (Ok(()), _) => outputs.commit()?,
        // The accepted pairs are the source of another attempt.
        (Err(_), 1..) => outputs.keep_both(),
        (Err(_), 0) => {}
    }
    calibrated
}

fn calibrate(
    args: &Args,
    board: Board,
    opened: Opened,
    prompt: ViewPrompt,
    (folder, place, report): (&mut ReportFolder, &Path, &Path),
    quiet: bool,
) -> anyhow::Result<()> {
    let collected = collect(opened, board, prompt, folder, quiet)?;
    let (count, shown) = (folder.pairs(), folder.path.display());
    let kept = |error: anyhow::Error| match count {
        0 => error,
        _ => anyhow!("{error:#}; the accepted pairs are in {shown}"),
    };
    if collected.views.len() < MIN_VIEWS {
        return Err(kept(collected.too_few(&args.source, &board)));
    }
    let solution = solve(&board, collected.size, args.model, &collected.views);
    let mut solution = solution.map_err(|error| kept(error.into()))?;
    match bouguet(&solution.calibration, &Framing::default()) {
        Ok(rectification) => {
            solution.calibration = solution.calibration.with_rectification(rectification)
        }
        // Intrinsics and extrinsics are still useful without a rectification.
        Err(error) => tracing::warn!("not rectified: {error}"),
    }
    for hidden in hidden_views(&solution.calibration) {
        tracing::warn!("{hidden}");
    }
    for left_out in files::write(place, &solution.calibration)? {
        tracing::warn!("{}: {left_out}", args.output.display());
    }
    folder.finish(&args.source, &collected.accepted, &solution)?;
    print_result(args, &collected, &solution, report)
}

/// The JSON that `--json` prints.
#[derive(serde::Serialize)]
struct CalibrationJson<'a> {
    file: &'a Path,
    report: &'a Path,
    #[serde(flatten)]
    collected: &'a Collected,
    solution: &'a Solution,
}

fn print_result(
    args: &Args,
    collected: &Collected,
    solution: &Solution,
    report: &Path,
) -> anyhow::Result<()> {
    if args.json {
        return print_json(&CalibrationJson {
            file: &args.output,
            report,
            collected,
            solution,
        });
    }
    let unit = match args.square_m {
        Some(_) => "",
        None => "\nLengths are in squares of the board: add --square-m for metres.",
    };
    let solution = calibration::terminal(solution, style());
    let (output, report) = (args.output.display(), report.display());
    print(&format!(
        "{collected}\n{solution}{unit}\n{output}: calibration\n{report}: report\n"
    ))
}
