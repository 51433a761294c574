//! `svl generate`: files that packagers install beside the program.

use crate::cli::shared::source;
use crate::cli::shared::terminal::print;
use clap_complete::Shell;
use std::path::PathBuf;
use svl::matcher::MATCHERS;
use svl::outputs::make_folder;
use svl::recording::Recording;
use svl::score::METRICS;

/// Stands for the topics in a script, which asks svl for those of the recording in the line.
const TOPICS: &str = "svl-topics";

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
    /// Print the topics of the recordings among words of a command line, for completions
    #[command(hide = true)]
    Topics {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        words: Vec<PathBuf>,
    },
}

/// `program`: the whole command line.
pub(super) fn run(args: &Args, program: clap::Command) -> anyhow::Result<()> {
    let mut text = Vec::new();
    match &args.what {
        Generated::Completions { shell } => {
            let mut program = with_all_values(program);
            clap_complete::generate(*shell, &mut program, "svl", &mut text);
            print(&with_files(&String::from_utf8(text)?))
        }
        Generated::Topics { words } => {
            let recordings = words.iter().filter(|word| word.exists());
            let topics = recordings.filter_map(|path| Recording::open(path).ok()?.topics().ok());
            let lines = topics.flatten().map(|topic| topic + "\n");
            print(&lines.collect::<String>())
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

fn with_all_values(command: clap::Command) -> clap::Command {
    command
        .mut_args(with_values)
        .mut_subcommands(with_all_values)
}

/// An option with the values that scripts offer.
fn with_values(arg: clap::Arg) -> clap::Arg {
    match arg.get_long().unwrap_or_default().to_owned().as_str() {
        "algo" => arg.value_parser(Vec::from_iter(MATCHERS.iter().map(|spec| spec.name))),
        "columns" | "sort" => arg.value_parser(Vec::from_iter(METRICS.iter().map(|own| own.name))),
        "left" | "right" | "left-info" | "right-info" | "truth" => arg.value_parser([TOPICS]),
        _ => arg,
    }
}

/// A script that asks for topics, and offers files where a value may be one: zsh offers nothing but
/// the values of an argument that has some.
fn with_files(script: &str) -> String {
    let names: Vec<_> = source::names().collect();
    let names = names.join(" ");
    let asked = |words: &str| format!("$(svl generate topics -- {words} 2>/dev/null)");
    let bash = asked("\"${COMP_WORDS[@]}\"");
    let zsh = asked("${words}");
    script
        .replace(
            &format!(":({names})'"),
            &format!(":{{compadd -- {names}; _default}}'"),
        )
        .replace(
            &format!(":({TOPICS})'"),
            &format!(":{{compadd -- {zsh}; _default}}'"),
        )
        .replace(
            &format!("compgen -W \"{TOPICS}\" -- \"${{cur}}\""),
            &format!("compgen -f -W \"{bash}\" -- \"${{cur}}\""),
        )
        .replace(
            &format!("-f -a \"{TOPICS}\\t''\""),
            "-F -a \"(svl generate topics -- (commandline -opc))\"",
        )
}
