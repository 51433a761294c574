//! `svl train`: makes the tables and models that algorithms decide by.

mod cells;

use clap::Subcommand;

/// Train what algorithms decide by, from runs with a truth
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  svl train cells scenarios/arena.toml --seeds 4..10 -o table.toml"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Train,
}

#[derive(Subcommand)]
enum Train {
    Cells(cells::Args),
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    match &args.what {
        Train::Cells(args) => cells::run(args, quiet),
    }
}
