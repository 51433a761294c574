//! `svl label`: labels of a person for the frames of a source.

mod checkpoints;
mod input;
mod windows;

use clap::Subcommand;

/// Label frames with what a person measured or sees in them
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl label checkpoints run.mcap -o own.toml
  svl label windows run.mcap --kind floor")]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Label,
}

#[derive(Subcommand)]
enum Label {
    Checkpoints(checkpoints::Args),
    /// Label the windows of frames for the training of a filter
    #[command(after_help = "\
Examples:
  svl label windows run.mcap --kind floor          writes run.floor.csv
  svl label windows arena-1.mcap --kind floor --from-truth
  svl train filter run*.mcap --kind floor -o floor.safetensors

Keys: a shows it, b does not, A and B all windows of the frame (also labelled
ones), s skip, Backspace back, u undo, q quit; ? shows all. The table beside
the recording is written at every key: the same command resumes after the last
label. It can be edited by hand. Its pair_hash identifies the labelled pairs:
another recording of that name is refused.")]
    Windows(windows::Args),
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    match &args.what {
        Label::Checkpoints(args) => checkpoints::run(args, quiet),
        Label::Windows(args) => windows::run(args, quiet),
    }
}
