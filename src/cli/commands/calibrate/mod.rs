//! `svl calibrate`: calibration of cameras and distances, and conversion of calibration files.

mod ask;
mod board;
mod check;
mod collect;
mod convert;
mod distance;
mod report;

/// Calibrate cameras and distances, and convert calibrations
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl calibrate board pictures/ --squares 9x6 --square-m 0.025 -o calib.xml
  svl calibrate convert calibration.xml opencv.yml
  svl calibrate check run.mcap
  svl calibrate distance scenarios/annex-b.csv --figure curve.svg")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: CalibrateCommand,
}

#[derive(clap::Subcommand)]
enum CalibrateCommand {
    Check(check::Args),
    Board(board::Args),
    Convert(convert::Args),
    Distance(distance::Args),
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    match &args.command {
        CalibrateCommand::Check(args) => check::run(args, quiet),
        CalibrateCommand::Board(args) => board::run(args, quiet),
        CalibrateCommand::Convert(args) => convert::run(args),
        CalibrateCommand::Distance(args) => distance::run(args, quiet),
    }
}
