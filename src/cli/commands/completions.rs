//! `svl completions` and `svl man`: what packagers install beside the program.

use crate::cli::shared::terminal::print;
use clap_complete::Shell;

/// Print a completion script for a shell
#[derive(clap::Args)]
#[command(after_help = "Example:\n  svl completions bash > /etc/bash_completion.d/svl")]
pub(crate) struct Args {
    shell: Shell,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut crate::cli::command(), "svl", &mut script);
    print(&String::from_utf8(script)?)
}

pub(super) fn man() -> anyhow::Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(crate::cli::command()).render(&mut page)?;
    print(&String::from_utf8(page)?)
}
