//! `svl label checkpoints`: labels of a person for cells in the frames of a source.

mod draft;
mod label;
mod reported;
mod scenario_file;
mod tool;
mod view;

use super::input::{LabelInput, stepper};
use crate::cli::shared::source;
use crate::cli::shared::stepper::{
    Ended, Key, Reaction, StepSession, StepTool, Stepper, ToolCanvas,
};
use crate::cli::shared::terminal::print;
use crate::cli::shared::usage;
use crate::cli::shared::viewer::{RerunChoice, viewer};
use anyhow::bail;
use draft::DraftFile;
use ratatui::layout::Rect;
use reported::Reported;
use scenario_file::{NewScenario, ScenarioFile};
use std::path::{Path, PathBuf};
use svl::counted;
use svl::losses::LossLimit;
use svl::matcher::Algorithm;
use svl::scenario::{ScenarioSource, SourceOptions};
use svl::source::{Opened, Request};
use svl::stereo::GridShape;
use tool::{Labelling, TypedLine};

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
    let shape = usage::two(text, 'x').map(|(columns, rows)| GridShape { columns, rows });
    let fits = |side| (1..=MAX_CELLS).contains(&side);
    shape
        .filter(|shape| fits(shape.columns) && fits(shape.rows))
        .ok_or_else(|| format!("expected columns and rows, 1 to {MAX_CELLS} each, as 5x3"))
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
    let request = request(args, existing.as_ref())?;
    let opened = source::open(request.clone(), quiet)?;
    let file = match existing {
        Some(file) => file,
        None => {
            let options = with_own_losses(&opened, &request, &args.input.options);
            ScenarioFile::begin(&output, &args.new_scenario(&opened, &options))?
        }
    };
    file.check(&opened)?;

    let mut stepper = stepper(opened.source, &request)?;
    if stepper.frame().rig().is_none() {
        bail!(
            "{name}: has no calibration, so no algorithm reports distances to compare with yours; \
             name one with --calib"
        );
    }
    let run = file.run(stepper.start_ns());
    file.check_pairs(&run, &mut stepper)?;
    let draft_file = DraftFile::open(file.path(), name)?;
    draft_file.check(&mut stepper)?;
    let found = draft_file.found();
    let draft = found.map(|table| table.draft.clone()).unwrap_or_default();
    let resumed = found.map(|table| (table.shown.frame, draft.cells.len()));
    let shown = args.rerun.target().cloned();
    let shown = shown.map(|target| viewer()?.steps(target)).transpose()?;
    let mut tool = Labelling {
        file,
        draft_file,
        draft,
        reported: args.algo.as_ref().map(Reported::new).transpose()?,
        viewer: shown,
        run,
        picked: (0, 0),
        picture: Rect::ZERO,
        asked: TypedLine::Cell,
        leaves: false,
        moved_by: None,
        written: Vec::new(),
    };
    if let Some((shown, cells)) = resumed {
        stepper.go_to(shown);
        let cells = counted(cells, "labelled cell");
        stepper.say(format!("resumed at frame {shown} with {cells}"));
    }
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
fn request<'a>(args: &'a Args, existing: Option<&ScenarioFile>) -> anyhow::Result<Request<'a>> {
    let name = args.input.source.as_str();
    if let Some(file) = existing
        && let ScenarioSource::Recording(_) = &file.scenario().source
    {
        return Ok(Request {
            options: file.scenario().options.clone(),
            ..Request::new(name)
        });
    }
    Ok(args.input.request())
}

impl Args {
    fn new_scenario<'a>(
        &'a self,
        opened: &'a Opened,
        options: &'a SourceOptions,
    ) -> NewScenario<'a> {
        NewScenario {
            source: &self.input.source,
            opened,
            grid: self.grid.unwrap_or_default(),
            algorithm: self.algo.as_ref(),
            options,
        }
    }
}

/// The options of a new scenario, which accepts the images that its recording lost.
fn with_own_losses(opened: &Opened, request: &Request, options: &SourceOptions) -> SourceOptions {
    let summary = opened.recording.as_ref();
    let summary = summary.and_then(|own| own.summary(&request.selection()).ok());
    let lost = summary.and_then(|own| Some(own.unpaired?.inside));
    let lost = lost.filter(|images| *images > 0).map(LossLimit::Pairs);
    SourceOptions {
        allow_loss: options.allow_loss.or(lost),
        ..options.clone()
    }
}

impl StepTool for Labelling {
    fn keys(&self) -> &'static [(&'static str, &'static str)] {
        tool::KEYS
    }

    fn show(&mut self, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        let scenario = self.file.scenario();
        if let Some(reported) = &mut self.reported
            && let Err(error) = reported.match_frame(stepper.frame(), scenario.grid, scenario.cells)
        {
            stepper.say(error.to_string());
        }
        self.show_in_viewer(stepper);
        self.draft_file.keep(stepper.frame(), &self.draft)
    }

    fn key(&mut self, key: Key, stepper: &mut Stepper<'_>) -> anyhow::Result<Reaction> {
        self.acting(stepper, |tool, stepper| tool.command(key, stepper))
    }

    fn answer(&mut self, text: &str, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        self.acting(stepper, |tool, stepper| tool.answered(text, stepper))
    }

    fn question(&self) -> Option<String> {
        let cells = counted(self.draft.cells.len(), "cell");
        self.leaves.then(|| {
            format!("{cells} not written: w write, k keep as a draft, d discard, Esc continue")
        })
    }

    fn draw(&mut self, stepper: &Stepper<'_>, canvas: &mut ToolCanvas<'_, '_>) {
        self.picture = view::draw(self, stepper.frame(), canvas);
    }
}

impl Labelling {
    /// Shows and keeps the draft if a key changes it.
    fn acting<'a, T>(
        &mut self,
        stepper: &mut Stepper<'a>,
        act: impl FnOnce(&mut Self, &mut Stepper<'a>) -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let before = (self.draft.clone(), self.picked);
        let acted = act(self, stepper)?;
        if before != (self.draft.clone(), self.picked) {
            self.show_in_viewer(stepper);
            self.draft_file.keep(stepper.frame(), &self.draft)?;
        }
        Ok(acted)
    }

    /// Reports the files that were written, and the draft.
    fn finish(&mut self, ended: Ended) -> anyhow::Result<()> {
        if let Some(viewer) = &self.viewer {
            viewer.finish()?;
        }
        let lines = self.written.iter().map(|line| line.clone() + "\n");
        print(&lines.collect::<String>())?;
        let draft = self.draft_file.path().display().to_string();
        let cells = counted(self.draft.cells.len(), "labelled cell");
        match ended {
            Ended::Interrupted => {
                bail!("stopped; {draft} keeps {cells}: the same command resumes there")
            }
            Ended::Quit if self.draft.is_empty() => self.draft_file.remove(),
            Ended::Quit => print(&format!(
                "{draft}: {cells}: the same command resumes there\n"
            )),
        }
    }
}
