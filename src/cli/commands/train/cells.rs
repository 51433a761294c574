//! `svl train cells`: the table that decides which cells of v5 are known.

use crate::cli::shared::progress::{Terminal, interrupted};
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::usage;
use anyhow::bail;
use std::path::PathBuf;
use svl::console::{Console, Unit};
use svl::fit::{CellSample, CellTarget, FOLDS, fit_cells};
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::outputs::{Outputs, write};
use svl::runs;
use svl::scenario::{Scenario, SourceOptions};
use svl::train::{CellTraining, LearnedCells, samples_csv};

/// Fit the table that decides which cells of v5 are known
///
/// Runs an algorithm over scenarios with ground truth, and collects for every cell what was
/// measured and whether its report would be right. Fits a logistic regression, whose steps turn the
/// measurements into a probability, and writes it as a table that `--algo v5:table=FILE` reads,
/// with a page of its results. Runs and scenes are held out in five parts, never single cells, and
/// all figures are of held-out cells. Equal data give equal tables.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl train cells scenarios/arena.toml --seeds 4..10 -o table.toml
  svl train cells own.toml bag.toml -o own-table.toml
  svl replay run.mcap --algo v5:table=own-table.toml

The weight of a scenario is the square root of its number of cells, so that
few real scenes count beside many simulated ones.")]
pub(crate) struct Args {
    /// Scenarios whose frames have ground truth
    #[arg(value_name = "SCENARIO.toml", required = true)]
    scenarios: Vec<PathBuf>,
    /// Table to write; a page of the same name, .html, is written beside it
    #[arg(
        short, long, value_name = "FILE.toml",
        value_parser = usage::ending(&["toml"])
    )]
    output: PathBuf,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
    /// Algorithm whose cells are learned: v5, or any in scenarios with decision = "safe"
    #[arg(
        long, value_name = "ALGO", default_value = "v5",
        value_parser = usage::algorithm
    )]
    algo: Algorithm,
    /// Write the cells that were learned from
    #[arg(long, value_name = "FILE.csv")]
    samples: Option<PathBuf>,
    #[command(flatten)]
    source: SourceOptions,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Least probability of a known cell in the figures: that of revision 1, with which they compare.
const CONFIDENCE: f64 = 0.75;

/// Fewest cells of either kind that are worth a fit.
const FEWEST: usize = 20;

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let target = CellTarget::of(&args.algo)?;
    let page = args.output.with_extension("html");
    let paths = [&args.output, &page].into_iter().chain(&args.samples);
    let mut outputs = Outputs::claim(args.force, [], paths.map(PathBuf::as_path))?;
    let terminal = &Terminal { quiet };
    let mut learned = LearnedCells::default();
    let scenarios = args.scenarios.iter().map(|path| Scenario::read(path));
    let mut scenarios = scenarios.collect::<svl::Result<Vec<_>>>()?;
    let named = args.scenarios[0].display().to_string();
    runs::change(&mut scenarios, &args.source, &named)?;
    for (scenario, path) in scenarios.into_iter().zip(&args.scenarios) {
        learned.learn(scenario, path, &args.algo, target, terminal)?;
    }
    let LearnedCells {
        samples,
        groups,
        scenarios,
    } = learned;
    let of_kind = |right: bool| {
        let of_kind = |sample: &&CellSample| sample.is_reportable() && sample.right == right;
        samples.iter().filter(of_kind).count()
    };
    let [right, wrong] = [true, false].map(of_kind);
    if right.min(wrong) < FEWEST {
        bail!(
            "{right} right and {wrong} wrong cells are too few, at least {FEWEST} of each; take \
             more runs, scenes or scenarios"
        );
    }
    if groups.len() < 2 {
        bail!("one run cannot be held out of itself; take more seeds, scenes or recordings");
    }
    let bar = terminal.bar("fit", Unit::Pairs, Some(FOLDS as u64 + 1));
    let weights: Vec<_> = scenarios
        .iter()
        .flat_map(|(_, cells)| std::iter::repeat_n(1.0 / (*cells as f64).sqrt(), *cells))
        .collect();
    // The weights sum to the number of samples, so that the ridge's influence stays small.
    let scale = samples.len() as f64 / weights.iter().sum::<f64>();
    let weights: Vec<_> = weights.iter().map(|weight| weight * scale).collect();
    let fit = fit_cells(&samples, &weights, target.rank(), || {
        bar.step();
        !interrupted()
    });
    drop(bar);
    let Some(fit) = fit else {
        bail!("interrupted; nothing is written");
    };
    let algorithm = args.algo.label().to_owned();
    let training = CellTraining::new(algorithm, CONFIDENCE, &samples, &fit, &scenarios);
    let manifest = Manifest::new("train cells", std::slice::from_ref(&args.algo))?;
    outputs.set_aside()?;
    let head = header(&manifest, &groups, &training);
    write(&args.output, head + &fit.table.to_toml())?;
    write(&page, training.page(manifest.entries())?)?;
    if let Some(path) = &args.samples {
        write(path, samples_csv(&samples, &groups)?)?;
    }
    outputs.commit();
    if args.json {
        print_json(&training)
    } else {
        let (table, page) = (args.output.display(), page.display());
        let training = training.terminal(style());
        print(&format!("{training}\n{table}\n{page}"))
    }
}

/// Facts in the table's file.
fn header(manifest: &Manifest, groups: &[String], training: &CellTraining) -> String {
    let revision = manifest.git_revision.as_deref().unwrap_or("unknown");
    let algorithm = &training.algorithm;
    let scenarios = svl::joined(training.scenarios.iter().map(|of| &of.name));
    format!(
        "# Table of cells, made by `svl train cells`, svl {} ({revision}), {}.\n# Of {algorithm}, \
         from: {scenarios}.\n# Runs and scenes: {}\n\n",
        manifest.svl,
        manifest.began,
        groups.join(", ")
    )
}
