//! `svl merge`: makes one report of the parts that shards of a run left.

use crate::cli::shared::progress::Terminal;
use crate::cli::shared::report::{check_whole, print_report};
use crate::cli::shared::usage;
use std::path::PathBuf;
use svl::console::Console;
use svl::evaluation::Parts;
use svl::losses::LossLimit;
use svl::outputs::Outputs;
use svl::report::{BuildOptions, REPORT, build};

/// Make one report of the parts that `svl score --shard` left
///
/// Their units are copied into one folder, whose report is built. It has the tables and hashes of a
/// run on one machine, and lists the machines. Runs for Rerun stay where they are.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl score scenarios/drive.toml --shard 1/2 -o part1
  svl score scenarios/drive.toml --shard 2/2 -o part2
  svl merge part1 part2 -o reports/all

The order of the parts does not matter. All shards of one run are needed, of
one version of svl and one scenario with the same options, and each must be
complete. Their losses are added up: with more than --allow-loss the exit
status is 4.")]
pub(in crate::cli) struct Args {
    /// Folders that `svl score --shard` wrote
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,
    /// Folder for the report; an existing report of svl's is replaced
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Folder, new or empty, for each plot of the page as an SVG file
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Loss of all parts together with which the exit status is still 0: N pairs, or P per cent, as
    /// `svl score` counts them [default: the strictest of the parts'; 0]
    #[arg(long, value_name = "N|P%", allow_negative_numbers = true)]
    allow_loss: Option<LossLimit>,
    /// Explain the columns
    #[arg(long)]
    explain: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let parts = Parts::read(&args.parts)?;
    if let Some(folder) = parts.folder_at(&args.output) {
        let shown = folder.display();
        return Err(usage::wrong(format!(
            "{shown}: is a part; name another folder with -o"
        )));
    }
    let figures = args.figures.as_deref();
    let mut outputs = Outputs::claim_folder(&args.output, &REPORT)?.and_figures(figures)?;
    outputs.set_aside()?;
    parts.copy_into(&args.output)?;
    let options = BuildOptions {
        figures,
        allow_loss: args.allow_loss,
        warnings: &Terminal { quiet }.warnings(),
        ..BuildOptions::default()
    };
    let report = build(&args.output, &options)?;
    outputs.commit();
    print_report(
        &report,
        &report.scenario,
        &args.output,
        args.explain,
        args.json,
    )?;
    check_whole(&report.summary.ending)
}
