//! `svl calibrate check`: vertical misalignment of a recording's pairs, and the scale of its rig.

use crate::cli::shared::data::{DataField, data_text, field};
use crate::cli::shared::source;
use crate::cli::shared::terminal::{print_value, style, width};
use crate::cli::shared::usage;
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use svl::Error;
use svl::calibrate::Board;
use svl::pass::report_losses;
use svl::recording::warn_of;
use svl::rectify::Alignment;
use svl::report::table::{NONE, Table};
use svl::scenario::{SourceOptions, within};
use svl::source::{BoardScale, PairAlignment, Request};

/// Measure how well the pairs of a recording are rectified, from the images alone
///
/// Matches points between both images and measures their vertical misalignment: in all, and by part
/// of the image, which distinguishes a shift from a rotation and from lens distortion. Fails when
/// the median exceeds half a pixel. With the size of a printed chessboard that it shows: how wrong
/// the distances are, from the board's squares. Fails above 2 %.
#[derive(clap::Args)]
#[command(mut_args(|arg| source::hidden(arg, NOT_TAKEN)))]
#[command(after_help = "\
Examples:
  svl calibrate check run.mcap
  svl calibrate check raw.mcap --calib calibration.xml
      how well that calibration rectifies it
  svl calibrate check bag.mcap --calib none
      misalignment of its raw images
  svl calibrate check bag.mcap --squares 9x6 --square-m 0.025
      by a printed board: are its distances too long?
  svl calibrate check FOLDER --json")]
pub(super) struct Args {
    /// Recording, or folder of pairs
    #[arg(value_parser = NonEmptyStringValueParser::new())]
    recording: String,
    #[command(flatten)]
    options: SourceOptions,
    /// Inner corners of a printed chessboard in view, where four squares meet
    #[arg(
        long,
        value_name = "COLUMNSxROWS",
        requires = "square_m",
        conflicts_with = "truth",
        help_heading = "Board"
    )]
    squares: Option<String>,
    /// Side of a square, metres, as measured
    #[arg(
        long, value_name = "M", requires = "squares", value_parser = within(0.001..=10.0),
        help_heading = "Board"
    )]
    square_m: Option<f64>,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Number of measured pairs, spread over all.
const MEASURED_PAIRS: u64 = 20;

const NOT_TAKEN: &[&str] = &["data", "scenes", "seeds", "allow_loss"];

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    args.options
        .refuse(NOT_TAKEN, "does not apply to this check")?;
    let request = Request {
        options: args.options.clone(),
        ..Request::new(&args.recording)
    };
    if let (Some(squares), Some(side_m)) = (&args.squares, args.square_m) {
        return check_scale(args, request, squares, side_m, quiet);
    }
    let mut source = source::open(request.clone(), quiet)?.source;
    // A source of unknown length is sampled in its first ten seconds or so.
    let step = source
        .pairs()
        .map_or(10, |pairs| pairs.div_ceil(MEASURED_PAIRS))
        .max(1);
    let mut pairs = PairAlignment::default();
    let mut taken = 0;
    while let Some(frame) = source.next()? {
        if taken % step == 0 {
            pairs.add(&frame);
        }
        taken += 1;
        pairs.keep(Some(&frame).filter(|_| taken % step == 0));
        if taken >= step * MEASURED_PAIRS {
            break;
        }
    }
    let (name, misaligned) = (source.name(), pairs.doubt(&*source));
    let meter = &pairs.meter;
    report_losses(&name, &source.finish(taken));
    let doubt = meter.doubt(None, 0..=i32::MAX);
    let Some(alignment) = meter.alignment() else {
        if let Some(doubt) = doubt {
            return Err(Error::format(name, doubt).into());
        }
        let points = meter.matches.len();
        bail!(
            "{name}: too few points matched between both images ({points}): show the cameras \
             something textured"
        );
    };
    doubt.iter().for_each(|doubt| warn_of(&name, doubt));
    print_value(args.json, &alignment, || text(&name, &alignment))?;
    // The report comes first; then the exit code says that the pairs are not rectified.
    let misaligned = misaligned.filter(|_| alignment.is_off());
    misaligned.map_or(Ok(()), |doubt| Err(Error::format(name, doubt).into()))
}

/// Measures the scale of the rig by the squares of a board.
fn check_scale(
    args: &Args,
    mut request: Request<'_>,
    squares: &str,
    side_m: f64,
    quiet: bool,
) -> anyhow::Result<()> {
    let board: Board = squares
        .parse()
        .map_err(|e| usage::wrong(format!("--squares: {e}")))?;
    let board = Board::new((board.columns(), board.rows()), Some(side_m))?;
    request.options.truth = Some(format!("board:{squares}"));
    let mut source = source::open(request, quiet)?.source;
    let (mut scale, mut taken) = (BoardScale::default(), 0);
    while let Some(frame) = source.next()? {
        if let Some((found, rig)) = source.board().zip(frame.rig()) {
            scale.add(&board, found, rig);
        }
        taken += 1;
    }
    let name = source.name();
    report_losses(&name, &source.finish(taken));
    let Some(scale) = scale.scale() else {
        bail!("{name}: no pair with the board has a calibration in metres: --calib FILE");
    };
    print_value(args.json, &scale, || {
        serde_json::Result::Ok(format!("{name}\n{}\n", scale.words()))
    })?;
    if scale.is_off() {
        return Err(Error::format(name, scale.words()).into());
    }
    Ok(())
}

const FIELDS: &[DataField] = &[
    field("pairs", "pairs"),
    field("matches", "points"),
    field("median_abs_px", "misaligned"),
    field("p90_abs_px", "90th percentile"),
    field("median_px", "right is lower"),
    field("misfit", "looks like"),
];

fn text(name: &str, alignment: &Alignment) -> serde_json::Result<String> {
    let fields = data_text(alignment, FIELDS, width())?;
    let mut table = Table::new("", "px lower").with_columns(["left", "middle", "right"]);
    for (name, row) in ["top", "middle", "bottom"].iter().zip(alignment.parts_px) {
        let part = |px: Option<f64>| px.map_or(NONE.to_owned(), |px| format!("{px:+.2}"));
        table.push(*name, row.map(part));
    }
    Ok(format!("{name}\n{fields}\n{}", table.terminal(style())))
}
