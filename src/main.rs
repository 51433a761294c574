//! The `svl` program: parse, run, exit code.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    svl::BUILD.hand_down();
    cli::Cli::main()
}
