//! `svl train cells`: the table that decides which cells of v5 are known.

use crate::cli::shared::progress::{Terminal, interrupted};
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::usage;
use anyhow::bail;
use std::path::PathBuf;
use svl::console::{Console, Unit};
use svl::fit::{CellSample, CellTarget};
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
/// with a page of its results. Runs and scenes are held out in five parts, never single cells: all
/// figures of the new table are of held-out cells. Those of the table in use are not, if it was
/// fitted to them. Each kind of scenes is held out as a whole, too: the arena
/// and its variants, random worlds, shapes, each data set. Equal data give equal tables.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl train cells scenarios/arena.toml --seeds 4..10 -o table.toml
  svl train cells own.toml bag.toml -o own-table.toml
  svl replay run.mcap --algo v5:table=own-table.toml
  svl train cells scenarios/worlds-training.toml \\
    scenarios/shapes-training.toml --test own.toml -o simulated.toml

The weight of a scenario is the square root of its number of cells, so that
few real scenes count beside many simulated ones.")]
pub(crate) struct Args {
    /// Scenarios whose frames have ground truth
    #[arg(
        value_name = "SCENARIO.toml", required = true, value_parser = usage::ending(&["toml"])
    )]
    scenarios: Vec<PathBuf>,
    /// Scenario that is no part of the fit, only of the figures; --seeds does not change it
    #[arg(
        long, value_name = "SCENARIO.toml", value_parser = usage::ending(&["toml"])
    )]
    test: Vec<PathBuf>,
    /// Table to write; a page of the same name, .html, is written beside it
    #[arg(
        short, long, value_name = "FILE.toml",
        value_parser = usage::ending(&["toml"])
    )]
    output: PathBuf,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
    /// v5 with the parameters that its cells are learned with
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

/// Fewest cells of either kind that are worth a fit.
const FEWEST: usize = 20;

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let label = args.algo.label();
    let Some(choice) = args.algo.safe_choice()? else {
        return Err(usage::wrong(format!(
            "--algo {label}: has no table of cells; v5 has one"
        )));
    };
    let target =
        CellTarget::of(&choice).map_err(|error| usage::wrong(format!("{label}: {error}")))?;
    let page = args.output.with_extension("html");
    let paths: Vec<_> = args.scenarios.iter().chain(&args.test).collect();
    let inputs = paths.iter().map(|path| path.as_path());
    let files = [&args.output, &page].into_iter().chain(&args.samples);
    let mut outputs = Outputs::claim(args.force, inputs, files.map(PathBuf::as_path))?;
    let terminal = &Terminal { quiet };
    let mut learned = LearnedCells::default();
    let scenarios = paths.iter().map(|path| Scenario::read(path));
    let mut scenarios = scenarios.collect::<svl::Result<Vec<_>>>()?;
    let named = args.scenarios[0].display().to_string();
    let others = SourceOptions {
        seeds: None,
        ..args.source.clone()
    };
    runs::change(&mut scenarios, &others, &named)?;
    let seeds = SourceOptions {
        seeds: args.source.seeds.clone(),
        ..SourceOptions::default()
    };
    let fitted = args.scenarios.len();
    runs::change(&mut scenarios[..fitted], &seeds, &named)?;
    for (i, (scenario, path)) in scenarios.into_iter().zip(paths).enumerate() {
        learned.learn(scenario, path, &args.algo, target, i >= fitted, terminal)?;
    }
    let samples = &learned.samples[..learned.fitted()];
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
    if samples.iter().all(|sample| sample.group == 0) {
        bail!("one run cannot be held out of itself; take more seeds, scenes or recordings");
    }
    let bar = terminal.bar("fit", Unit::Pairs, Some(learned.fits() as u64));
    let fit = learned.fit(target.rank(), || {
        bar.step();
        !interrupted()
    });
    drop(bar);
    let Some(mut fit) = fit else {
        bail!("interrupted; nothing is written");
    };
    fit.table.fitted = learned.fitted_to();
    fit.table.network = choice.network.clone().map(Into::into);
    let training = CellTraining::new(&args.algo, &choice, &learned, &fit);
    let manifest = Manifest::new("train cells", std::slice::from_ref(&args.algo))?;
    outputs.set_aside()?;
    let head = header(&manifest, &training);
    write(&args.output, head + &fit.table.to_toml())?;
    write(&page, training.page(manifest.entries())?)?;
    if let Some(path) = &args.samples {
        write(path, samples_csv(samples, &learned.groups)?)?;
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
fn header(manifest: &Manifest, training: &CellTraining) -> String {
    let revision = manifest.git_revision.as_deref().unwrap_or("unknown");
    let algorithm = &training.algorithm;
    let fitted = training.scenarios.iter().filter(|of| !of.tested);
    let scenarios = svl::joined(fitted.map(|of| &of.name));
    format!(
        "# Table of cells, made by `svl train cells`, svl {} ({revision}), {}.\n# Of {algorithm}, \
         from: {scenarios}.\n\n",
        manifest.svl, manifest.began,
    )
}
