//! `svl report`: builds the report of a folder again, or of the parts that shards of a run left.

use crate::cli::shared::report::{AreaArgs, check_whole, pass_gate, print_report};
use crate::cli::shared::usage;
use std::path::{Path, PathBuf};
use svl::evaluation::Parts;
use svl::losses::LossLimit;
use svl::notice::NoticeLog;
use svl::outputs::Outputs;
use svl::report::{BuildOptions, REPORT, build};
use svl::score::{ColumnChoice, Metric};

/// Build the report of a folder again, or of the parts of a run
///
/// Tables, plots and page are made of the units that `svl score` left in the folder, with other
/// columns or in another order. Nothing is matched. With -o the folders are parts of one run: their
/// units are copied into one folder. Its report has the tables and hashes of a run on one machine,
/// and lists the machines. Runs for Rerun stay where they are.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl report reports/arena
  svl report reports/arena --columns all --sort wrong
  svl report reports/arena --gate --figures plots
  svl score scenarios/drive.toml --shard 1/2 -o part1
  svl score scenarios/drive.toml --shard 2/2 -o part2
  svl report part1 part2 -o reports/all

The order of the parts does not matter. All shards of one run are needed, of
one version of svl and one scenario with the same options, and each must be
complete. Their losses are added up: with more than --allow-loss the exit
status is 4.")]
pub(in crate::cli) struct Args {
    /// Folder that `svl score` wrote; with -o, those of all shards of a run
    #[arg(value_name = "FOLDER", required = true)]
    folders: Vec<PathBuf>,
    /// Folder for the report of the parts; an existing report of svl's is replaced
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Metrics that the table shows: all or NAME,…
    ///
    /// `svl columns metrics` lists them [default: the scenario's, or those of its kind].
    #[arg(long, value_name = "NAMES", help_heading = "Output")]
    columns: Option<ColumnChoice>,
    #[command(flatten)]
    area: AreaArgs,
    /// Sort the algorithms by a metric, the best first
    #[arg(long, value_name = "METRIC", value_parser = usage::metric, help_heading = "Output")]
    sort: Option<&'static Metric>,
    /// Fail if a limit of the scenario's [[gate]] fails or is not measured
    #[arg(long, help_heading = "Scoring")]
    gate: bool,
    /// Folder, new or empty, for each plot of the page as an SVG file
    #[arg(
        long,
        value_name = "DIR",
        help_heading = "Output",
        hide_short_help = true
    )]
    figures: Option<PathBuf>,
    /// Loss with which the exit status is still 0: N pairs, or P per cent [default: the scenario's;
    /// of parts, the strictest of theirs]
    #[arg(
        long,
        value_name = "N|P%",
        allow_negative_numbers = true,
        help_heading = "Scoring"
    )]
    allow_loss: Option<LossLimit>,
    /// Explain the columns
    #[arg(long, help_heading = "Output")]
    explain: bool,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(folder) = args.folders.iter().find(|folder| !folder.is_dir()) {
        let shown = folder.display();
        return Err(usage::wrong(format!("{shown}: no such folder")));
    }
    let figures = args.figures.as_deref();
    let (folder, outputs) = match (&args.output, &args.folders[..]) {
        (Some(output), parts) => (output, joined(parts, output, figures)?),
        (None, [folder]) => (folder, claim(folder, figures)?),
        (None, _) => return Err(usage::wrong("the report of several parts needs -o FOLDER")),
    };
    let options = BuildOptions {
        columns: args.columns.as_ref(),
        area: args.area.area,
        sort: args.sort,
        gate: args.gate,
        figures,
        allow_loss: args.allow_loss,
        warnings: &NoticeLog::current().notices(),
    };
    let report = build(folder, &options)?;
    outputs.commit()?;
    print_report(&report, &report.scenario, folder, args.explain, args.json)?;
    if args.gate {
        pass_gate(&report.gate)?;
    }
    check_whole(&report.summary.ending)
}

fn claim(folder: &Path, figures: Option<&Path>) -> svl::Result<Outputs> {
    Outputs::claim_folder(folder, &REPORT)?.and_figures(figures)
}

/// Copies the parts of a run into the folder of their report.
fn joined(parts: &[PathBuf], output: &Path, figures: Option<&Path>) -> anyhow::Result<Outputs> {
    let parts = Parts::read(parts)?;
    for (option, path) in [("-o", Some(output)), ("--figures", figures)] {
        let Some((path, part)) = path.and_then(|path| Some((path, parts.folder_around(path)?)))
        else {
            continue;
        };
        let (path, part) = (path.display(), part.display());
        return Err(usage::wrong(format!(
            "{option} {path}: is in the part {part}; name a folder outside of the parts"
        )));
    }
    let outputs = claim(output, figures)?;
    parts.copy_into(output)?;
    Ok(outputs)
}
