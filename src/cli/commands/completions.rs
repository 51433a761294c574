//! `svl completions` and `svl man`: what packagers install beside the program.

use crate::cli::shared::source;
use crate::cli::shared::terminal::print;
use clap_complete::Shell;

/// Print a completion script for a shell
#[derive(clap::Args)]
#[command(after_help = "Example:\n  svl completions bash > /etc/bash_completion.d/svl")]
pub(crate) struct Args {
    shell: Shell,
}

pub(super) fn run(args: &Args, mut program: clap::Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "svl", &mut script);
    print(&with_files(&String::from_utf8(script)?))
}

/// zsh offers nothing but the values of an argument that has some: a source may be a file too.
fn with_files(script: &str) -> String {
    let names: Vec<_> = source::names().collect();
    let names = names.join(" ");
    let both = format!(":{{compadd -- {names}; _default}}'");
    script.replace(&format!(":({names})'"), &both)
}

pub(super) fn man(program: clap::Command) -> anyhow::Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(program).render(&mut page)?;
    print(&String::from_utf8(page)?)
}
