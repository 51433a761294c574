//! `svl calibrate convert`: a calibration from one program's file to another's.

use super::super::output::{distinct, may_write};
use std::path::PathBuf;

/// Write a calibration in the format of another program
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl calibrate convert calibration.xml opencv.yml")]
pub(super) struct Args {
    /// Calibration to read
    input: PathBuf,
    /// File to write
    output: PathBuf,
    /// Replace a file that exists
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    distinct([args.input.as_path(), args.output.as_path()])?;
    may_write(&args.output, &["xml", "yaml", "yml", "txt"], args.force)?;
    anyhow::bail!("{}: no format is read yet", args.input.display())
}
