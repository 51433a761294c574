//! The command line: one file per subcommand, its arguments beside its run.

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Record, replay and score stereo vision.
#[derive(Parser)]
#[command(version, about)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {}

impl Cli {
    pub(crate) fn run(self) -> ExitCode {
        match self.command {}
    }
}
