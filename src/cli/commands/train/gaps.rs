//! `svl train gaps`: the network that weighs disparities for the gaps of v5.

use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::{print, print_json};
use crate::cli::shared::usage;
use anyhow::bail;
use std::path::PathBuf;
use svl::fit::GapSettings;
use svl::outputs::{Outputs, write};
use svl::runs;
use svl::scenario::{Scenario, SourceOptions};
use svl::train::LearnedGaps;

/// Train the network that weighs disparities for the gaps of v5
///
/// Matches the frames of scenarios with ground truth, and collects pixels without a certain
/// disparity, with the disparities around them that each could have. Trains a network that gives
/// each of them, and none, a probability, and writes it in whole numbers as a file that
/// `--algo v5:gaps=FILE` reads. Each fifth run is held out. Equal data give equal files, on any
/// number of threads.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl train gaps scenarios/worlds-training.toml \\
    scenarios/shapes-training.toml -o gaps.safetensors
  svl train cells scenarios/worlds.toml scenarios/shapes.toml \\
    --seeds 41..60 --algo v5:gaps=gaps.safetensors -o table.toml
  svl score scenarios/worlds.toml \\
    --algo v5:gaps=gaps.safetensors,table=table.toml

The probabilities of cells change with the network, so fit a table to it, on
other runs. Random worlds of seeds up to 999 are for training.")]
pub(crate) struct Args {
    /// Scenarios whose frames have ground truth
    #[arg(
        value_name = "SCENARIO.toml", required = true, value_parser = usage::ending(&["toml"])
    )]
    scenarios: Vec<PathBuf>,
    /// Network to write
    #[arg(
        short, long, value_name = "FILE.safetensors",
        value_parser = usage::ending(&["safetensors"])
    )]
    output: PathBuf,
    /// Replace a file that exists
    #[arg(long)]
    force: bool,
    /// Seed of the initial weights and of the order of the pixels
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of passes over the training set
    #[arg(
        long, value_name = "N", default_value_t = 40,
        value_parser = usage::within(1..=10_000_usize)
    )]
    epochs: usize,
    #[command(flatten)]
    source: SourceOptions,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let mut outputs = Outputs::claim(args.force, [], [args.output.as_path()])?;
    let terminal = &Terminal { quiet };
    let scenarios = args.scenarios.iter().map(|path| Scenario::read(path));
    let mut scenarios = scenarios.collect::<svl::Result<Vec<_>>>()?;
    let named = args.scenarios[0].display().to_string();
    runs::change(&mut scenarios, &args.source, &named)?;
    let mut learned = LearnedGaps::default();
    for scenario in &scenarios {
        learned.learn(scenario, terminal)?;
    }
    let settings = GapSettings {
        seed: args.seed,
        epochs: args.epochs,
    };
    let (model, training) = learned.train(settings, terminal)?;
    outputs.set_aside()?;
    write(&args.output, model.to_bytes())?;
    outputs.commit();
    let file = args.output.display();
    if args.json {
        print_json(&training)?;
    } else {
        print(&format!("{training}\n\n{file}"))?;
    }
    if training.interrupted {
        bail!("interrupted; {file} is the network so far")
    } else {
        Ok(())
    }
}
