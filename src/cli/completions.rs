//! `svl completions` and the hidden `svl man`: what packagers install beside the program.

use clap_complete::Shell;
use std::io::stdout;

/// Print a completion script for a shell
#[derive(clap::Args)]
#[command(after_help = "Example:\n  svl completions bash > /etc/bash_completion.d/svl")]
pub(super) struct Args {
    shell: Shell,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    clap_complete::generate(args.shell, &mut super::command(), "svl", &mut stdout());
    Ok(())
}

pub(super) fn man() -> anyhow::Result<()> {
    Ok(clap_mangen::Man::new(super::command()).render(&mut stdout())?)
}
