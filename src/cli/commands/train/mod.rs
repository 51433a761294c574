//! `svl train`: makes the tables and models by which algorithms decide.

mod filter;
mod v5;

use clap::Subcommand;

/// Train v5 and filters from runs with ground truth or labels
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl train filter a.mcap b.mcap c.mcap --kind floor -o floor.safetensors
  svl train v5 own.toml bag.toml --tables-only -o own.safetensors")]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Train,
}

#[derive(Subcommand)]
enum Train {
    Filter(filter::Args),
    V5(v5::Args),
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    match &args.what {
        Train::Filter(args) => filter::run(args, quiet),
        Train::V5(args) => v5::run(args, quiet),
    }
}
