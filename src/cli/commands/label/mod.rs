//! `svl label`: what a person measures or judges in the frames of a source.

mod checkpoints;

use clap::Subcommand;

/// Label frames: what a person measured or sees in them
#[derive(clap::Args)]
#[command(after_help = "Example:\n  svl label checkpoints run.mcap -o own.toml")]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Label,
}

#[derive(Subcommand)]
enum Label {
    Checkpoints(checkpoints::Args),
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    match &args.what {
        Label::Checkpoints(args) => checkpoints::run(args, quiet),
    }
}
