//! `svl compare`: compares reports.

use crate::cli::shared::terminal::{print, print_json};
use anyhow::bail;
use std::path::PathBuf;
use svl::report::compare::{Comparison, ScoredRun};

/// Compare reports: changes of metrics, with confidence intervals
///
/// Every report is compared with the first, algorithm by algorithm, over the pairs of both. A
/// change has a 95 % bootstrap interval over the pairs, drawn in blocks, as neighbouring pairs are
/// correlated. It is called better or worse only where the interval excludes 0, and never for fewer
/// than eight blocks or scenes. Times are shown as ratios and never called better or worse, as the
/// machine may have been slower that day.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl compare reports/before reports/after
  svl compare reports/v1 reports/v3     one algorithm each: v1 → v3
  svl compare reports/arena reports/range --json \\
      | jq '.[0].algorithms[0].metrics'")]
pub(crate) struct Args {
    /// Folders that `svl score` wrote; the first is what the others are compared with
    #[arg(required = true, num_args = 2.., value_name = "REPORT")]
    reports: Vec<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let runs = args
        .reports
        .iter()
        .map(|folder| ScoredRun::read(folder))
        .collect::<Result<Vec<_>, _>>()?;
    let [base, others @ ..] = &runs[..] else {
        bail!("name two reports or more")
    };
    let comparisons = others
        .iter()
        .map(|other| Comparison::from_runs(base, other))
        .collect::<Result<Vec<_>, _>>()?;
    if args.json {
        print_json(&comparisons)
    } else {
        print(
            &comparisons
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<_>>()
                .join("\n"),
        )
    }
}
