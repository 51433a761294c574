//! `svl train filter`: the networks of the filters (thesis, chapter 8).

use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::print_value;
use crate::cli::shared::usage;
use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::filter::FilterKind;
use svl::fit::filter::FrameLabels;
use svl::manifest::Manifest;
use svl::outputs::{Outputs, write};
use svl::runs;
use svl::scenario::{Scenario, SourceOptions};
use svl::train::{LabelledInputs, TrainSettings, train, windows};

/// Train a filter: floor, or too close to be matched
///
/// Makes the amplitude spectra of labelled windows and trains a network with one hidden layer on
/// them, by back-propagation. Recordings are split, never frames: each fifth for the test, each
/// fifth to decide when to stop. Equal data give equal files.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl train filter scenarios/floor-training.toml --kind floor \\
    -o floor.safetensors
  svl label windows run1.mcap --kind floor
  svl train filter run1.mcap run2.mcap run3.mcap --kind floor \\
    --hidden 25,50,100..1000/100 -o own-floor.safetensors
  svl replay run4.mcap --algo v3 --filter own-floor.safetensors

The labels of a recording are in the table beside it, which `svl label`
writes; the runs of an arena scenario are labelled by their ground truth.")]
pub(crate) struct Args {
    /// Recordings with labels beside them, or scenarios of the arena
    #[arg(value_name = "LABELLED", required = true)]
    labelled: Vec<PathBuf>,
    /// Class to detect: floor or too-close
    #[arg(long, value_name = "NAME", help_heading = "Input")]
    kind: FilterKind,
    /// Folder of the tables of labels [default: each beside its recording]
    #[arg(long, value_name = "FOLDER", help_heading = "Input")]
    labels: Option<PathBuf>,
    /// Filter to write; a page of the same name, .html, is written beside it
    #[arg(
        short, long, value_name = "FILE.safetensors",
        value_parser = usage::ending(&["safetensors"]), help_heading = "Output"
    )]
    output: PathBuf,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Hidden neurons, as 55 or 25,50,100..1000/100: of several sizes, each with three seeds, the
    /// one with the least validation error is kept [default: floor 55, too-close 100]
    #[arg(long, value_name = "LIST", value_parser = sizes, help_heading = "Training")]
    hidden: Option<Sizes>,
    /// Largest number of passes over the training set
    #[arg(
        long, value_name = "N", default_value_t = TrainSettings::EPOCHS,
        value_parser = usage::within(1..=10_000_usize), help_heading = "Training",
        hide_short_help = true
    )]
    epochs: usize,
    /// Range of disparities of too-close, pixels
    #[arg(
        long, value_name = "PX", default_value_t = 80.0, help_heading = "Training",
        value_parser = usage::within(1.0..=10_000.0)
    )]
    max_disparity: f64,
    #[command(flatten)]
    source: SourceOptions,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Seed of the initial weights and of the order of the windows.
const SEED: u64 = 1;
/// Seeds of each size, where several are tried.
const SEEDS: u64 = 3;

/// Most sizes of a sweep, and most neurons.
const MAX_SIZES: usize = 100;
const MAX_NEURONS: usize = 5000;

#[derive(Clone, Debug, PartialEq)]
struct Sizes(Vec<usize>);

fn sizes(text: &str) -> Result<Sizes, String> {
    let wrong = || {
        format!(
            "expected numbers of neurons up to {MAX_NEURONS}, as 55 or 25,50,100..1000/100, at \
             most {MAX_SIZES}"
        )
    };
    let number = |text: &str| {
        let number = text.trim().parse().ok();
        let number = number.filter(|n| (1..=MAX_NEURONS).contains(n));
        number.ok_or_else(wrong)
    };
    let mut sizes = Vec::new();
    for part in text.split(',') {
        let Some((first, rest)) = part.split_once("..") else {
            sizes.push(number(part)?);
            continue;
        };
        let (last, step) = rest.split_once('/').unwrap_or((rest, "1"));
        sizes.extend((number(first)?..=number(last)?).step_by(number(step)?));
    }
    sizes.sort_unstable();
    sizes.dedup();
    if (1..=MAX_SIZES).contains(&sizes.len()) {
        Ok(Sizes(sizes))
    } else {
        Err(wrong())
    }
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let page = args.output.with_extension("html");
    let mut outputs = Outputs::claim(args.force, [], [args.output.as_path(), &page])?;
    let spec = args.kind.spec();
    let terminal = &Terminal { quiet };
    let labelled = labelled(args, terminal)?;
    let (mut samples, fitted) = windows(args.kind, args.max_disparity, labelled, terminal)?;
    let (hidden, seeds) = match &args.hidden {
        None => (vec![spec.hidden], vec![SEED]),
        Some(Sizes(one)) if one.len() == 1 => (one.clone(), vec![SEED]),
        Some(Sizes(sizes)) => (sizes.clone(), (SEED..SEED + SEEDS).collect()),
    };
    let settings = TrainSettings {
        hidden,
        seeds,
        most_epochs: args.epochs,
        range_px: args.max_disparity,
    };
    let (model, training) = train(&mut samples, &fitted, &settings, terminal)?;
    let manifest = Manifest::new("train filter", &[])?;
    outputs.begin()?;
    write(&outputs.place(&args.output), model.to_bytes())?;
    let mut identity = manifest.entries();
    identity.push(("fitted to".to_owned(), fitted.runs.join(", ")));
    write(&outputs.place(&page), training.page(identity)?)?;
    outputs.commit()?;
    let (file, page) = (args.output.display(), page.display());
    let text = || anyhow::Ok(format!("{training}\n\n{file}\n{page}"));
    print_value(args.json, &training, text)?;
    if training.interrupted {
        bail!("interrupted; {file} is the best network so far")
    } else {
        Ok(())
    }
}

/// Recordings with the tables beside them, and scenarios.
fn labelled(args: &Args, terminal: &Terminal) -> anyhow::Result<Vec<LabelledInputs>> {
    let is_scenario = |path: &Path| path.extension().is_some_and(|ending| ending == "toml");
    let (mut scenarios, mut labels) = (Vec::new(), Vec::new());
    for path in &args.labelled {
        if is_scenario(path) {
            scenarios.push(Scenario::read(path)?);
            labels.push(None);
            continue;
        }
        let beside = FrameLabels::beside(path, args.kind);
        let table = match (&args.labels, beside.file_name()) {
            (Some(folder), Some(name)) => folder.join(name),
            _ => beside,
        };
        if !path.exists() {
            let path = path.display();
            bail!("{path}: no such file or folder; check the name");
        }
        if !table.exists() {
            let (path, table, kind) = (path.display(), table.display(), args.kind);
            bail!(
                "{path}: has no labels in {table}; `svl label windows {path} --kind {kind} -o \
                 {table}` makes them"
            );
        }
        let files = [path.display().to_string()];
        scenarios.push(Scenario::from_recordings(&files, Vec::new())?);
        let table = FrameLabels::read(&table, args.kind)?;
        labels.push(Some((path.clone(), table)));
    }
    let named = args.labelled[0].display().to_string();
    runs::change(&mut scenarios, &args.source, &named)?;
    let opened = scenarios.into_iter().zip(labels);
    opened
        .map(|(scenario, labels)| Ok(LabelledInputs::open(scenario, labels, terminal)?))
        .collect()
}
