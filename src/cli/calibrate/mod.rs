//! `svl calibrate`: from boards, measured distances and files of other programs to calibrated cameras.

mod convert;

/// Calibrate cameras, and convert calibrations
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl calibrate convert calibration.xml opencv.yml")]
pub(super) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    Convert(convert::Args),
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        Command::Convert(args) => convert::run(args),
    }
}
