//! The command line: global options, and from an error to the exit code.

mod commands;
mod shared;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser};
use commands::Command;
use shared::log::{self, NoticeLayer};
use shared::{help, usage};
use std::process::ExitCode;
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::{Layer, layer::SubscriberExt, util::SubscriberInitExt};

/// The record/replay bench for stereo vision.
///
/// Record synchronized pairs to MCAP, replay them through pluggable matchers, score them against
/// obstacle checkpoints and data sets with truth, and watch the run in Rerun.
#[derive(Parser)]
#[command(
    name = "svl", version, max_term_width = 100, after_help = EXAMPLES,
    disable_help_flag = true, disable_help_subcommand = true
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,

    /// Threads to compute with [default: one per core; bench: 1, or some to compare, as 1,2,4]
    #[arg(
        long, global = true, value_name = "N", value_parser = usage::within(1..=1024u16),
        value_delimiter = ',', num_args = 1, action = clap::ArgAction::Set, help_heading = "Run"
    )]
    threads: Option<Vec<u16>>,

    /// More messages: -v progress, -vv details
    ///
    /// With --version, the digest of svl's sources, which results depend on.
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = "Run")]
    verbose: u8,

    /// Print only results and errors
    #[arg(
        short,
        long,
        global = true,
        conflicts_with = "verbose",
        help_heading = "Run"
    )]
    quiet: bool,

    /// Print help: -h the options used most, --help all
    #[arg(
        short, long, global = true, action = clap::ArgAction::Help, display_order = 900,
        help_heading = "Run"
    )]
    help: Option<bool>,
}

const EXAMPLES: &str = "\
Examples:
  svl score arena                    score the arena, write reports/arena
  svl record -o run.mcap             record the simulated arena
  svl replay run.mcap --algo v3 --rerun spawn
  svl match left.png right.png --algo v3:max_disparity=64 -o disparity.pfm

Exit status: 0 done, 1 failed, 2 wrong usage, 3 a gate failed or was not
measured, 4 done, but something is missing.";

/// The whole command line, as help, completions and the man page show it.
fn program() -> clap::Command {
    help::arranged(Cli::command())
}

impl Cli {
    /// Parses, runs, and turns the result into the exit code.
    pub(crate) fn main() -> ExitCode {
        let parsed = program().try_get_matches();
        let cli = match parsed.and_then(|matches| Self::from_arg_matches(&matches)) {
            Ok(cli) => cli,
            Err(error) => {
                let code = usage::report_clap(&error, &program());
                // The version ends the parsing: -v may come after it.
                let is_verbose = |arg: String| ["-v", "-vv", "--verbose"].contains(&&*arg);
                if error.kind() == ErrorKind::DisplayVersion && std::env::args().any(is_verbose) {
                    // Results depend on these alone, whatever the build.
                    let sources = svl::BUILD.sources.unwrap_or("unknown");
                    let _ = shared::terminal::print(&format!("sources {sources}\n"));
                }
                return code;
            }
        };
        if let Command::Help(args) = &cli.command {
            return args.page(program()).map_or_else(
                |error| usage::report_clap(&error, &program()),
                |_| ExitCode::SUCCESS,
            );
        }
        let numbers = cli.threads.clone().unwrap_or_default();
        if numbers.len() > 1 && !matches!(cli.command, Command::Bench(_)) {
            let words = "--threads: several numbers are compared by `svl bench` alone; give one";
            return usage::report(&usage::wrong(words.to_owned()));
        }
        cli.configure();
        let waits_for_keys = cli.command.waits_for_keys();
        let run = || cli.command.run(cli.quiet, &numbers, program);
        // A command runs as one of rayon's threads: beside them it would be one too many for the
        // cores, and they wait for each other. A tool that waits for keys runs beside them: as one
        // of them it would hold a worker while its own threads wait for one, with --threads 1 for
        // ever.
        let ran = match waits_for_keys {
            true => run(),
            false => rayon::scope(|_| run()),
        };
        log::finish();
        match ran {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => usage::report(&error),
        }
    }

    fn configure(&self) {
        let level = match (self.quiet, self.verbose) {
            (true, _) => Level::ERROR,
            (_, 0) => Level::WARN,
            (_, 1) => Level::INFO,
            _ => Level::DEBUG,
        };
        // Only svl's own messages: what a library meets, svl's own errors report.
        let ours = Targets::new().with_target("svl", level.max(Level::WARN));
        tracing_subscriber::registry()
            .with(NoticeLayer(level).with_filter(ours))
            .init();
        let largest = self.threads.iter().flatten().max().copied();
        if let Some(threads) = largest.or(self.command.threads())
            && let Err(error) = rayon::ThreadPoolBuilder::new()
                .num_threads(threads.into())
                .build_global()
        {
            tracing::warn!("--threads {threads}: {error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// clap itself looks only in debug builds.
    #[test]
    fn no_option_stands_twice() {
        for subcommand in Cli::command().get_subcommands() {
            let mut longs: Vec<_> = subcommand
                .get_arguments()
                .filter_map(|argument| argument.get_long())
                .collect();
            let all = longs.len();
            longs.sort_unstable();
            longs.dedup();
            assert_eq!(longs.len(), all, "{}", subcommand.get_name());
        }
    }

    #[test]
    fn the_front_page_has_every_command_once() {
        let page = program().render_help().to_string();
        for command in Cli::command().get_subcommands() {
            let line = format!("\n  {} ", command.get_name());
            assert_eq!(page.matches(&line).count(), 1, "{}", command.get_name());
        }
    }

    #[test]
    fn a_synonym_names_existing_commands_and_is_no_command() {
        let program = Cli::command();
        for (synonym, commands) in usage::SYNONYMS {
            assert!(program.find_subcommand(synonym).is_none(), "{synonym}");
            for name in *commands {
                let name = name.split(' ').next().unwrap_or_default();
                let is_known = program.find_subcommand(name).is_some() || name == "--version";
                assert!(is_known, "{synonym}: {name}");
            }
        }
    }

    #[test]
    fn the_cure_for_an_option_names_existing_ones() {
        let program = Cli::command();
        let by_command = program
            .get_subcommands()
            .flat_map(|command| command.get_arguments());
        let options: Vec<_> = program
            .get_arguments()
            .chain(by_command)
            .filter_map(|own| own.get_long().map(|name| format!("--{name}")))
            .collect();
        for (synonyms, _, cure) in usage::OPTION_SYNONYMS {
            for option in usage::cured_by(cure) {
                let is_known = option.len() == 2 || options.iter().any(|own| own == option);
                assert!(is_known, "{synonyms:?}: {option}");
            }
        }
    }

    /// clap breaks longer lines and continues them at the margin.
    #[test]
    fn text_below_the_options_fits_into_78_columns() {
        fn check(command: &clap::Command) {
            let text = command.get_after_help().unwrap_or_default().to_string();
            assert!(
                text.contains("Example"),
                "{} --help shows no example",
                command.get_name()
            );
            let long: Vec<_> = text
                .lines()
                .filter(|line| line.chars().count() > 78)
                .collect();
            assert!(long.is_empty(), "{} --help: {long:#?}", command.get_name());
            let shown = command.get_subcommands().filter(|own| !own.is_hide_set());
            shown.for_each(check);
        }
        check(&Cli::command());
    }
}
