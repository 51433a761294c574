//! `svl train v5`: the model of v5.

use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::{print_value, style};
use crate::cli::shared::usage;
use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::fit::GapSettings;
use svl::manifest::Manifest;
use svl::matcher::{Algorithm, V5Model, Value};
use svl::outputs::{Outputs, write};
use svl::runs;
use svl::scenario::{Scenario, SourceOptions};
use svl::train::{CellAlgorithms, CellTraining, TableRole, TrainingScenario, train_v5};

/// Train the model of v5: the network of its gaps, and the tables of its probabilities
///
/// Matches the frames of scenarios with ground truth. Two of three runs train the network, which
/// weighs the disparities of pixels without a certain one. The others are for the tables: a
/// logistic regression turns what was measured in a cell into the probability that its report is
/// right, for the median and for the nearest quarter, and another one what earlier reports add. All
/// figures are of runs that were held out of the fit which judged them; each kind of scenes is held
/// out as a whole, too. Equal data give equal files.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl train v5 scenarios/arena-training.toml scenarios/worlds-training.toml \\
    scenarios/shapes-training.toml --seeds 1..60 -o own.safetensors
  svl train v5 own.toml bag.toml --tables-only -o own.safetensors
  svl replay run.mcap --algo v5:model=own.safetensors

The weight of a scenario is the square root of its number of cells, so that
few real scenes count beside many simulated ones. Random worlds and shapes of
seeds up to 999 are for training.")]
pub(crate) struct Args {
    /// Scenarios whose frames have ground truth
    #[arg(
        value_name = "SCENARIO.toml", required = true, value_parser = usage::ending(&["toml"])
    )]
    scenarios: Vec<PathBuf>,
    /// Scenario that is no part of the fit, only of the figures; --seeds does not change it
    #[arg(
        long, value_name = "SCENARIO.toml", value_parser = usage::ending(&["toml"]),
        help_heading = "Input"
    )]
    test: Vec<PathBuf>,
    /// Model to write; a page of the same name, .html, is written beside it
    #[arg(
        short, long, value_name = "FILE.safetensors",
        value_parser = usage::ending(&["safetensors"]), help_heading = "Output"
    )]
    output: PathBuf,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// v5 with the parameters that its cells are learned with
    #[arg(
        long, value_name = "ALGO", default_value = "v5", value_parser = usage::algorithm,
        help_heading = "Input"
    )]
    algo: Algorithm,
    /// Keep the network of --algo and fit its tables to all runs: for a few recordings of your own
    #[arg(long, conflicts_with = "epochs", help_heading = "Training")]
    tables_only: bool,
    /// Number of passes of the network over its training set
    #[arg(
        long, value_name = "N", default_value_t = 25,
        value_parser = usage::within(1..=10_000_usize), help_heading = "Training",
        hide_short_help = true
    )]
    epochs: usize,
    #[command(flatten)]
    source: SourceOptions,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Seed of the network's initial weights and of the order of the pixels.
const SEED: u64 = 1;

fn check_algorithm(algorithm: &Algorithm) -> anyhow::Result<()> {
    let parameters = algorithm.parameters();
    if algorithm.spec().name == "v5" && parameters.choice("target") == "median" {
        return Ok(());
    }
    let label = algorithm.label();
    let words = format!("--algo {label}: only v5 is trained, without target=");
    Err(usage::wrong(words))
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    check_algorithm(&args.algo)?;
    let base = match args.algo.parameters().file("model") {
        None => V5Model::built_in(),
        // It was read as the algorithm was parsed.
        Some(file) => V5Model::from_bytes(&file.bytes).map_err(anyhow::Error::msg)?,
    };
    let page = args.output.with_extension("html");
    let paths: Vec<_> = args.scenarios.iter().chain(&args.test).collect();
    let inputs = paths.iter().map(|path| path.as_path());
    let mut outputs = Outputs::claim(args.force, inputs, [args.output.as_path(), &page])?;
    let settings = (!args.tables_only).then_some(GapSettings {
        seed: SEED,
        epochs: args.epochs,
    });
    let with = |model: &V5Model| {
        let algorithm = |name: &str, target: &'static str, model: &V5Model| {
            let file = Value::file(&args.output.display().to_string(), model.to_bytes());
            let with_model = args.algo.with("model", &file)?;
            let aimed = with_model.with("target", &Value::Choice(target))?;
            svl::Result::Ok(aimed.called(name.to_owned()))
        };
        let surfaces = V5Model {
            near: TableRole::NearSmall.table(model).clone(),
            ..model.clone()
        };
        Ok(CellAlgorithms {
            median: algorithm("v5", "median", model)?,
            near: algorithm("near", "near", model)?,
            surface: algorithm("surface", "near", &surfaces)?,
        })
    };
    let terminal = &Terminal { quiet };
    let trained = train_v5(scenarios(args, &paths)?, base, settings, &with, terminal);
    let trained = match trained {
        Err(svl::Error::Interrupted) => bail!("interrupted; nothing is written"),
        trained => trained?,
    };
    let training = &trained.training;
    let manifest = Manifest::new("train v5", std::slice::from_ref(&args.algo))?;
    outputs.begin()?;
    write(&outputs.place(&args.output), trained.model.to_bytes())?;
    let text = CellTraining::page(&training.tables, manifest.entries())?;
    write(&outputs.place(&page), text)?;
    outputs.commit()?;
    print_value(args.json, training, || {
        let (file, page) = (args.output.display(), page.display());
        let training = training.terminal(style());
        anyhow::Ok(format!("{training}\n{file}\n{page}"))
    })
}

/// The scenarios with the options of the command line.
fn scenarios(args: &Args, paths: &[&PathBuf]) -> anyhow::Result<Vec<TrainingScenario>> {
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
    let training = |(i, (scenario, path)): (usize, (Scenario, &&PathBuf))| TrainingScenario {
        path: Path::to_path_buf(path),
        scenario,
        tested: i >= fitted,
    };
    let scenarios = scenarios.into_iter().zip(paths).enumerate();
    Ok(scenarios.map(training).collect())
}
