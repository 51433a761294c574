//! `svl reproduce`: repeats the thesis's experiments.

use crate::cli::shared::progress::{self, Terminal};
use crate::cli::shared::terminal::print_value;
use crate::cli::shared::usage;
use anyhow::{Context as _, bail};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use svl::console::Watch;
use svl::manifest::Manifest;
use svl::outputs::{FolderRule, Outputs, write, write_json};
use svl::reproduce::{
    Context, EXPERIMENTS, Experiment, ExperimentFinding, Finding, FindingsPage, find, scenes,
};
use svl::runs::{cached_run, data_folder};
use svl::scenario::Scenario;
use svl::source::dataset::Scene;
use svl::source::{RecordingSource, Source};

/// Repeat the thesis's experiments and report which of its claims hold
///
/// Each experiment runs in the simulated arena and, if a folder of data sets is named, on real
/// scenes. Prints a result per figure, and writes index.html with the figures, the numbers beside
/// the thesis's, and the conditions of each result.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl reproduce
  svl reproduce 5.9 7.3
  svl reproduce --data DATASETS -o reports/thesis")]
pub(crate) struct Args {
    /// Figure of the thesis, or `fps` for the speeds of its chapter 7; may be given more than once
    /// [default: all]
    #[arg(value_name = "FIGURE", value_parser = figure)]
    figures: Vec<NamedExperiment>,
    /// Folder for the report; an existing report of svl's is replaced
    #[arg(
        short,
        long,
        value_name = "DIR",
        default_value = "reports/reproduce",
        help_heading = "Output"
    )]
    output: PathBuf,
    /// Folder of the data sets, for experiments on real scenes [default: SVL_DATASETS, else none]
    #[arg(long, value_name = "DIR", help_heading = "Input")]
    data: Option<PathBuf>,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// An experiment named on the command line.
#[derive(Clone)]
struct NamedExperiment(&'static Experiment);

fn figure(text: &str) -> svl::Result<NamedExperiment> {
    find(text).map(NamedExperiment)
}

/// The folder of a report, which a later report replaces.
const REPORT: FolderRule = FolderRule {
    kind: "a report",
    owns: |name| ["index.html", "reproduce.md", JSON].contains(&name),
    inner: None,
    mark: JSON,
    cure: "name another folder with -o",
};

const JSON: &str = "reproduce.json";

const STOPPED: &str = "interrupted; the report holds what was found before";

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let asked = |e: &&Experiment| {
        let is_named = args.figures.iter().any(|f| f.0.figure() == e.figure());
        is_named || args.figures.is_empty()
    };
    let experiments: Vec<&'static Experiment> = EXPERIMENTS.iter().filter(asked).collect();
    let mut outputs = Outputs::claim_folder(&args.output, &REPORT)?;
    let data = data_folder(args.data.as_deref());
    let scenes = data.as_deref().map_or(Ok(Vec::new()), scenes)?;
    let records = experiments.iter().any(|e| e.records());
    let mut recording = records.then(|| arena_run(quiet)).transpose()?;
    let manifest = Manifest::new("reproduce", &[])?;
    let mut entries = Vec::new();
    let ran = experiments.iter().try_for_each(|experiment| {
        if progress::interrupted() {
            bail!("{STOPPED}");
        }
        let recording = recording.take_if(|_| experiment.records());
        let processor = &manifest.machine.processor;
        entries.push(ExperimentFinding {
            experiment,
            finding: repeat(experiment, processor, &scenes, recording, quiet)?,
        });
        Ok(())
    });
    // An error or Ctrl-C keeps the experiments before it.
    if entries.is_empty() {
        return ran;
    }
    let page = FindingsPage {
        entries: &entries,
        scenes: scenes.iter().map(|scene| scene.name().to_owned()).collect(),
        identity: manifest.entries(),
        incomplete: ran.as_ref().err().map(usage::one_line),
    };
    outputs.begin()?;
    let place = outputs.place(&args.output);
    write_json(&place.join(JSON), &page.json())?;
    write(&place.join("reproduce.md"), page.markdown())?;
    write(&place.join("index.html"), page.html()?)?;
    match &ran {
        Ok(()) => outputs.commit()?,
        Err(_) => outputs.keep_both(),
    }
    print_value(args.json, &page.json(), || text(&page, &args.output))?;
    ran
}

/// The arena of chapter 7, one run of it.
fn arena_run(quiet: bool) -> anyhow::Result<(Scenario, Box<dyn Source>)> {
    let scenario = Scenario::arena()?;
    let path = cached_run(&scenario, 1, &Terminal { quiet }, None)?;
    Ok((scenario, Box::new(RecordingSource::open(path)?)))
}

fn repeat(
    experiment: &Experiment,
    processor: &str,
    scenes: &[Scene],
    recording: Option<(Scenario, Box<dyn Source>)>,
    quiet: bool,
) -> anyhow::Result<Finding> {
    let title = format!("{} {}", experiment.figure(), experiment.title);
    let mut watch = Watch::new(&Terminal { quiet }, &title, None, None);
    let found = experiment.run(&mut Context::new(processor, scenes, recording, &mut watch));
    drop(watch);
    match found {
        Err(_) if progress::interrupted() => bail!("{STOPPED}"),
        found => found.with_context(|| format!("figure {}", experiment.figure())),
    }
}

/// The terminal's text: per figure a line with its result and a line with its numbers.
fn text(page: &FindingsPage<'_>, out: &Path) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    for entry in page.entries {
        let (figure, title) = (entry.experiment.figure(), entry.experiment.title);
        let verdict = entry.finding.verdict().words();
        writeln!(text, "{figure:<9} {verdict:<15} {title}")?;
        writeln!(text, "{:25} {}", "", entry.finding.why)?;
    }
    if page.scenes.is_empty() {
        writeln!(
            text,
            "\nOn the arena alone: --data DIR or SVL_DATASETS names a folder of real scenes."
        )?;
    }
    let (tally, index) = (page.tally(), out.join("index.html"));
    writeln!(text, "\n{tally}\n{}", index.display())?;
    Ok(text)
}
