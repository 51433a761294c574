//! `svl label checkpoints`: labels of a person for cells in the frames of a source.

mod draft;
mod label;
mod reported;
mod scenario_file;
mod tool;

use super::input::{LabelInput, stepper};
use crate::cli::shared::stepper::{StepSession, Stepper};
use crate::cli::shared::viewer::{RerunChoice, viewer};
use crate::cli::shared::{source, usage};
use anyhow::bail;
use draft::{Draft, DraftFile};
use ratatui::layout::Rect;
use reported::Reported;
use scenario_file::ScenarioFile;
use std::path::{Path, PathBuf};
use svl::losses::LossLimit;
use svl::matcher::Algorithm;
use svl::scenario::{ScenarioSource, SourceOptions};
use svl::source::{Opened, Request};
use svl::stereo::GridShape;
use tool::Labelling;

/// The place in the source that is labelled.
type LabelStepper<'a> = Stepper<'a, Labelling>;

/// Label what cells of recorded frames show, for `svl score`
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl label checkpoints run.mcap                  begins or extends run.toml
  svl label checkpoints bag/ -o own.toml --algo v3 --rerun spawn
  svl score own.toml --algo v3 --algo sgm

Pick a cell with the arrows or the mouse and type its distance in metres, as
measured with a tape, and Enter; or = and a word: <0.5 or near 0.5 (something
nearer), >1.2 or far 1.2 (nothing before), free (nothing near), must (right by
the truth of the source), none. [ and ] set the first and the last frame, n
names the checkpoint, w writes it. ? shows all keys.

Labels that are not yet written are kept in SCENARIO.toml.draft: after Ctrl-C
or a crash the same command resumes there. A scenario that exists is extended
at its end; its text is not changed.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: LabelInput,
    /// The scenario to write or to extend [default: the source's name with .toml]
    #[arg(
        short, long, value_name = "SCENARIO.toml", value_parser = usage::ending(&["toml"]),
        help_heading = "Output"
    )]
    output: Option<PathBuf>,
    /// Cells of a new scenario's grid [default: 5x3]
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = grid, help_heading = "Input")]
    grid: Option<GridShape>,
    /// Show beside each cell what this algorithm reports there
    #[arg(long, value_name = "ALGO", value_parser = usage::algorithm, help_heading = "Input")]
    algo: Option<Algorithm>,
    /// Rerun, too: spawn, URL, FILE.rrd, or none
    ///
    /// A new viewer, a running one, a file, or none.
    #[arg(
        long,
        value_name = "WHERE",
        default_value = "none",
        help_heading = "Output"
    )]
    rerun: RerunChoice,
    /// Take the keys from a file instead of a terminal, one token per key: characters, "text",
    /// enter, esc, left, space, click:COLUMN,ROW, screen (prints it), ...
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Run",
        hide_short_help = true
    )]
    script: Option<PathBuf>,
}

/// Largest number of columns and of rows that can be told apart on a screen.
const MAX_CELLS: usize = 20;

fn grid(text: &str) -> Result<GridShape, String> {
    let shape = usage::grid(text, MAX_CELLS);
    shape.ok_or_else(|| format!("expected columns and rows, 1 to {MAX_CELLS} each, as 5x3"))
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let name = args.input.source.as_str();
    args.input.check()?;
    // Before anything takes time.
    let session = StepSession::new(args.script.as_deref())?;
    let stem = Path::new(name).file_stem().unwrap_or_default();
    let default = || Path::new(stem).with_extension("toml");
    let output = args.output.clone().unwrap_or_else(default);
    let existing = ScenarioFile::read(&output, name)?;
    if existing.is_some() {
        refuse_what_the_scenario_says(args, &output)?;
    }
    let request = request(args, existing.as_ref());
    let opened = source::open(request.clone(), quiet)?;
    let options = || with_own_losses(&opened, &request);
    let begin = || ScenarioFile::begin(&output, args, &opened, options());
    let file = existing.map_or_else(begin, Ok)?;
    file.check(&opened)?;

    let mut stepper: LabelStepper<'_> = stepper(opened.source, &request)?;
    if stepper.frame.rig().is_none() {
        bail!(
            "{name}: has no calibration, so no algorithm reports distances to compare with yours; \
             name one with --calib"
        );
    }
    let run = file.run(stepper.start_ns());
    file.check_pairs(&run, &mut stepper)?;
    let draft_file = DraftFile::open(&file.path, name)?;
    draft_file.resume(&mut stepper)?;
    let found = draft_file.written.as_ref();
    let draft = found.map_or_else(Draft::default, |table| table.draft.clone());
    let target = args.rerun.target().cloned();
    let mut tool = Labelling {
        file,
        draft_file,
        kept: (draft.clone(), (0, 0)),
        draft,
        viewer: target.map(|target| viewer()?.steps(target)).transpose()?,
        reported: args.algo.as_ref().map(Reported::new).transpose()?,
        run,
        picked: (0, 0),
        picture: Rect::ZERO,
        moved_by: None,
        written: Vec::new(),
    };
    let ended = session.run(&mut stepper, &mut tool)?;
    tool.finish(ended)
}

fn refuse_what_the_scenario_says(args: &Args, output: &Path) -> anyhow::Result<()> {
    let output = output.display();
    let says = format!("is set by {output}; leave it out, or name another scenario with -o");
    if args.grid.is_some() {
        return Err(usage::wrong(format!("--grid {says}")));
    }
    let given = args.input.options.keys()?;
    let given: Vec<_> = given.iter().map(String::as_str).collect();
    Ok(args.input.options.refuse(&given, &says)?)
}

/// The request for the source: that of the scenario, where there is one.
fn request<'a>(args: &'a Args, existing: Option<&ScenarioFile>) -> Request<'a> {
    match existing.map(|file| &file.scenario) {
        Some(scenario) if matches!(scenario.source, ScenarioSource::Recording(_)) => Request {
            options: scenario.options.clone(),
            ..Request::new(&args.input.source)
        },
        _ => args.input.request(),
    }
}

/// The options of a new scenario, which accepts the images that its recording lost.
fn with_own_losses(opened: &Opened, request: &Request) -> SourceOptions {
    let own_losses = || {
        let summary = opened.recording.as_ref()?.summary(&request.selection());
        let lost = summary.ok()?.unpaired?.inside;
        (lost > 0).then_some(LossLimit::Pairs(lost))
    };
    SourceOptions {
        allow_loss: request.options.allow_loss.or_else(own_losses),
        ..request.options.clone()
    }
}
