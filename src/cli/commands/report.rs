//! `svl report`: builds the report of a folder again.

use crate::cli::shared::report::{check_whole, pass_gate, print_report};
use crate::cli::shared::usage;
use std::path::PathBuf;
use svl::losses::LossLimit;
use svl::outputs::Outputs;
use svl::report::{BuildOptions, REPORT, build};
use svl::score::{AreaChoice, ColumnChoice, Metric};

/// Build the report of a folder again, and print it
///
/// Tables, plots and page are made of the units that `svl score` left in the folder, with other
/// columns or in another order. Nothing is matched.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl report reports/arena
  svl report reports/arena --columns all --sort wrong
  svl report reports/arena --gate --figures plots")]
pub(in crate::cli) struct Args {
    /// Folder that `svl score` wrote
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Metrics that the table shows: all or NAME,…
    ///
    /// `svl columns metrics` lists them [default: the scenario's, or those of its kind].
    #[arg(long, value_name = "NAMES")]
    columns: Option<ColumnChoice>,
    /// Cells that right, wrong, unknown and errors are of: obstacle, floor, beyond or all
    #[arg(long, value_name = "AREA", default_value_t)]
    area: AreaChoice,
    /// Sort the algorithms by a metric, the best first
    #[arg(long, value_name = "METRIC", value_parser = metric)]
    sort: Option<&'static Metric>,
    /// Fail if a limit of the scenario's [[gate]] fails or is not measured
    #[arg(long)]
    gate: bool,
    /// Folder, new or empty, for each plot of the page as an SVG file
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Loss with which the exit status is still 0: N pairs, or P per cent [default: the scenario's]
    #[arg(long, value_name = "N|P%", allow_negative_numbers = true)]
    allow_loss: Option<LossLimit>,
    /// Explain the columns
    #[arg(long)]
    explain: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

fn metric(name: &str) -> Result<&'static Metric, String> {
    Metric::named(name, Metric::is_of_frames)
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if !args.folder.is_dir() {
        let shown = args.folder.display();
        return Err(usage::wrong(format!("{shown}: no such folder")));
    }
    let figures = args.figures.as_deref();
    let outputs = Outputs::claim_folder(&args.folder, &REPORT)?.and_figures(figures)?;
    let options = BuildOptions {
        columns: args.columns.as_ref(),
        area: args.area,
        sort: args.sort,
        gate: args.gate,
        figures,
        allow_loss: args.allow_loss,
        ..BuildOptions::default()
    };
    let report = build(&args.folder, &options)?;
    outputs.commit();
    let scenario = report.scenario.clone();
    print_report(&report, &scenario, &args.folder, args.explain, args.json)?;
    if args.gate {
        pass_gate(&report.gate)?;
    }
    check_whole(&report.summary.ending)
}
