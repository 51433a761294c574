//! `svl train`: makes the tables and models by which algorithms decide.

//STUB mod cells;
mod filter;
//STUB mod gaps;

use clap::Subcommand;

/// Train tables and filters from runs with ground truth or labels
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl train cells scenarios/arena.toml --seeds 4..10 -o table.toml
  svl train filter a.mcap b.mcap c.mcap --kind floor -o floor.safetensors
  svl train gaps scenarios/worlds-training.toml -o gaps.safetensors")]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Train,
}

#[derive(Subcommand)]
enum Train {
//STUB     Cells(cells::Args),
    Filter(filter::Args),
//STUB     Gaps(gaps::Args),
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    match &args.what {
//STUB         Train::Cells(args) => cells::run(args, quiet),
        Train::Filter(args) => filter::run(args, quiet),
//STUB         Train::Gaps(args) => gaps::run(args, quiet),
    }
}
