//! The `svl` program: parse, run, exit code.

mod cli;

use std::process::ExitCode;
use svl::memory::CountingAllocator;

/// Runs measure the memory of their algorithms by it.
#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    svl::BUILD.hand_down();
    cli::Cli::main()
}
