//! `svl generate`: files that packagers install beside the program.

use crate::cli::shared::source;
use crate::cli::shared::terminal::print;
use clap_complete::Shell;
use std::path::PathBuf;
use svl::outputs::make_folder;

/// Print completions or the man page, for packagers
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl generate completions bash > /etc/bash_completion.d/svl
  svl generate man -o /usr/share/man/man1")]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Generated,
}

#[derive(clap::Subcommand)]
enum Generated {
    /// Print a completion script for a shell
    #[command(after_help = "Example:\n  svl generate completions zsh > _svl")]
    Completions {
        /// Shell that reads it
        shell: Shell,
    },
    /// Print the man page, or write those of all commands
    #[command(after_help = "Examples:\n  svl generate man > svl.1\n  svl generate man -o man1")]
    Man {
        /// Folder for a page per command; existing pages are replaced
        #[arg(short, long, value_name = "DIR", help_heading = "Output")]
        output: Option<PathBuf>,
    },
}

/// `program`: the whole command line.
pub(super) fn run(args: &Args, mut program: clap::Command) -> anyhow::Result<()> {
    let mut text = Vec::new();
    match &args.what {
        Generated::Completions { shell } => {
            clap_complete::generate(*shell, &mut program, "svl", &mut text);
            print(&with_files(&String::from_utf8(text)?))
        }
        Generated::Man {
            output: Some(folder),
        } => {
            make_folder(folder)?;
            Ok(clap_mangen::generate_to(program, folder)?)
        }
        Generated::Man { output: None } => {
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
