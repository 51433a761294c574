//! `svl help`: the help of a command, or the options of sources.

use crate::cli::shared::help::sources_page;
use clap::ArgMatches;

/// Print the help of a command, or the options of sources
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  svl help score\n  svl help sources")]
pub(in crate::cli) struct Args {
    /// A command, or sources
    #[arg(value_name = "COMMAND|sources")]
    topic: Vec<String>,
}

impl Args {
    /// The page, as clap's error that prints it.
    pub(in crate::cli) fn page(&self, program: clap::Command) -> Result<ArgMatches, clap::Error> {
        if self.topic == ["sources"] {
            return sources_page().try_get_matches_from(["svl", "--help"]);
        }
        let topic = self.topic.iter().map(String::as_str);
        let line = ["svl"].into_iter().chain(topic).chain(["--help"]);
        program.try_get_matches_from(line)
    }
}
