//! `svl generate`: what packagers install beside the program.

use crate::cli::shared::source;
use crate::cli::shared::terminal::print;
use clap_complete::Shell;

/// Print completions or the man page, for packagers
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl generate completions bash > /etc/bash_completion.d/svl
  svl generate man > /usr/share/man/man1/svl.1")]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Generated,
}

#[derive(clap::Subcommand)]
enum Generated {
    /// Print a completion script for a shell
    #[command(after_help = "Example:\n  svl generate completions zsh > _svl")]
    Completions { shell: Shell },
    /// Print the man page
    #[command(after_help = "Example:\n  svl generate man > svl.1")]
    Man,
}

/// `program`: the whole command line.
pub(super) fn run(args: &Args, mut program: clap::Command) -> anyhow::Result<()> {
    let mut text = Vec::new();
    match args.what {
        Generated::Completions { shell } => {
            clap_complete::generate(shell, &mut program, "svl", &mut text);
            print(&with_files(&String::from_utf8(text)?))
        }
        Generated::Man => {
            clap_mangen::Man::new(program).render(&mut text)?;
            print(&String::from_utf8(text)?)
        }
    }
}

/// zsh offers nothing but the values of an argument that has some: a source may be a file too.
fn with_files(script: &str) -> String {
    let names: Vec<_> = source::names().collect();
    let names = names.join(" ");
    let both = format!(":{{compadd -- {names}; _default}}'");
    script.replace(&format!(":({names})'"), &both)
}
