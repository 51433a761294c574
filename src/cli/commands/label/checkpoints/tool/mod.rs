//! The keys of labelling: cells are picked, what they must show is typed, the checkpoint is
//! written.

mod view;

use super::LabelStepper;
use super::draft::{Draft, DraftFile};
use super::label::{CellLabel, FORMS, NONE};
use super::reported::Reported;
use super::scenario_file::ScenarioFile;
use crate::cli::shared::stepper::Key::{self, Press};
use crate::cli::shared::stepper::{Ended, StepTool, Then, ToolCanvas, picture};
use crate::cli::shared::terminal::print;
use anyhow::bail;
use ratatui::crossterm::event::KeyCode::{Backspace, Char, Delete, Down, Enter, Left, Right, Up};
use ratatui::layout::Rect;
use svl::counted;
use svl::score::{ExpectedCell, FrameOrigin, LabelledPair, Verdict};
use svl::sink::{CellNote, StepView};
use svl::stereo::{Frame, GridShape};

/// Labels the cells of one checkpoint after the other.
pub(super) struct Labelling {
    pub(super) file: ScenarioFile,
    pub(super) draft_file: DraftFile,
    pub(super) draft: Draft,
    pub(super) reported: Option<Reported>,
    pub(super) viewer: Option<Box<dyn StepView>>,
    pub(super) run: FrameOrigin,
    /// Column and row of the cell that is picked.
    pub(super) picked: (usize, usize),
    /// The draft and the picked cell that were kept and shown last.
    pub(super) kept: (Draft, (usize, usize)),
    /// Place where the image was drawn last.
    pub(super) picture: Rect,
    /// The key before, if it moved to another frame and could begin a label.
    pub(super) moved_by: Option<char>,
    /// Files that were written, a line each.
    pub(super) written: Vec<String>,
}

impl StepTool for Labelling {
    const KEYS: &'static [(&'static str, &'static str)] = &[
        ("arrows, mouse", "pick a cell"),
        ("0.43 Enter", "what it shows: a distance, metres"),
        ("= <0.5 Enter", "in words: <0.5 >1.2 free must none"),
        ("f", "nothing is there: free"),
        ("x", "clear the cell"),
        ("[ ]", "first, last frame of the checkpoint"),
        ("n", "name the checkpoint"),
        ("Enter w", "write the checkpoint"),
    ];

    fn show(&mut self, stepper: &mut LabelStepper<'_>) -> anyhow::Result<()> {
        let scenario = &self.file.scenario;
        if let Some(reported) = &mut self.reported
            && let Err(error) = reported.match_frame(&stepper.frame, scenario.grid, scenario.cells)
        {
            stepper.say(error.to_string());
        }
        self.keep(stepper)
    }

    fn key(&mut self, key: Key, stepper: &mut LabelStepper<'_>) -> anyhow::Result<bool> {
        let frame = stepper.frame.sequence;
        if !matches!(key, Press(Char(c)) if c.is_ascii_digit()) {
            self.moved_by = match key {
                Press(Char(c @ (',' | '.' | '<' | '>'))) => Some(c),
                _ => None,
            };
        }
        match key {
            Press(Left | Right | Up | Down) => {
                self.picked = picture::beside(self.shape(), self.picked, key);
            }
            Key::Click(x, y) => {
                let hit = picture::cell_at(self.shape(), self.picture, (x, y));
                self.picked = hit.unwrap_or(self.picked);
            }
            Press(Char(c)) if c.is_ascii_digit() => self.ask_cell(c.into(), stepper),
            Press(Char('=')) => {
                let label = self.draft.label(self.picked.into());
                self.ask_cell(label.map(String::from).unwrap_or_default(), stepper);
            }
            Press(Char('f')) => self.label(Some(CellLabel::FREE), stepper),
            Press(Char('x') | Delete | Backspace) => self.label(None, stepper),
            Press(Char('n')) => self.ask_name(stepper, |tool, name, _| tool.draft.name = name),
            Press(Char('[')) => self
                .draft
                .begin(frame)
                .unwrap_or_else(|why| stepper.say(why)),
            Press(Char(']')) => self.draft.end(frame).unwrap_or_else(|why| stepper.say(why)),
            Press(Char('w') | Enter) => self.write(stepper),
            Press(Char('q')) if !self.draft.is_empty() => {
                let cells = counted(self.draft.cells.len(), "cell");
                let keys = "w write, k keep as a draft, d discard, Esc continue";
                stepper.ask_key(format!("{cells} not written: {keys}"), Self::leave);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn acted(&mut self, stepper: &mut LabelStepper<'_>) -> anyhow::Result<()> {
        if self.kept == (self.draft.clone(), self.picked) {
            return Ok(());
        }
        self.keep(stepper)
    }

    fn draw(&mut self, stepper: &LabelStepper<'_>, canvas: &mut ToolCanvas<'_, '_>) {
        self.picture = view::draw(self, &stepper.frame, canvas);
    }
}

impl Labelling {
    fn shape(&self) -> GridShape {
        self.file.scenario.grid.shape()
    }

    /// True if the reported cell is as the label expects.
    fn verdict(&self, (column, row): (usize, usize)) -> Option<Verdict> {
        let at = [column, row];
        let CellLabel::Seen(expectation) = self.draft.label(at)? else {
            return None;
        };
        let expected = ExpectedCell { at, expectation };
        let cell = self.reported.as_ref()?.grid.as_ref()?.cell(column, row);
        Some(expected.judge(cell, self.file.scenario.cells))
    }

    /// Names of the scenario's checkpoints that the frame shows.
    fn others(&self, frame: &Frame) -> Vec<String> {
        let checkpoints = self.file.scenario.checkpoints.iter();
        let here = checkpoints.filter(|checkpoint| checkpoint.covers(frame, &self.run));
        here.map(|checkpoint| format!("{} {}", checkpoint.number, checkpoint.name))
            .collect()
    }

    fn label(&mut self, label: Option<CellLabel>, stepper: &mut LabelStepper<'_>) {
        if label == Some(CellLabel::Must) && stepper.frame.truth.is_none() {
            return stepper.say("must is compared with true distances, and this source has none");
        }
        let pair = LabelledPair::new(&stepper.frame);
        self.draft.set(self.picked.into(), label, pair);
    }

    fn ask_cell(&self, text: String, stepper: &mut LabelStepper<'_>) {
        let (column, row) = self.picked;
        let question = format!("cell ({column}, {row}) shows");
        stepper.ask(question, text, FORMS, Self::typed);
    }

    /// Labels the cell by a text.
    fn typed(&mut self, text: String, stepper: &mut LabelStepper<'_>) {
        // A text behind a key that moved may be the rest of a label.
        let is_whole = |key: &char| ",.".contains(*key) && text.contains('.');
        if let Some(key) = self.moved_by.take_if(|key| !is_whole(key)) {
            stepper.say(format!(
                "not labelled: is it {text} or {key}{text}? {key} has moved; type = first"
            ));
        } else if text == NONE {
            self.label(None, stepper);
        } else {
            match text.parse() {
                Ok(label) => self.label(Some(label), stepper),
                Err(why) => stepper.say(why),
            }
        }
    }

    fn ask_name(&self, stepper: &mut LabelStepper<'_>, then: Then<Self, String>) {
        let question = "name of the checkpoint, or name: description";
        stepper.ask(question, self.draft.name.clone(), "", then);
    }

    /// Leaves with the draft written, kept or discarded, or continues.
    fn leave(&mut self, key: Key, stepper: &mut LabelStepper<'_>) {
        match key {
            Press(Char('w')) => self.write(stepper),
            Press(Char('d')) => self.draft = Draft::default(),
            _ => {}
        }
        if key == Press(Char('k')) || self.draft.is_empty() {
            stepper.quit();
        }
    }

    fn write(&mut self, stepper: &mut LabelStepper<'_>) {
        if self.draft.cells.is_empty() {
            return stepper.say("no cell is labelled: type a distance, = for words, f for free");
        }
        if self.draft.name.is_empty() {
            return self.ask_name(stepper, |tool, name, stepper| {
                tool.draft.name = name;
                if !tool.draft.name.is_empty() {
                    tool.write(stepper);
                }
            });
        }
        let shown = stepper.frame.sequence;
        let [first, last] = self.draft.frames(shown);
        let mut labelled = self.draft.labelled().into_iter();
        if let Some(pair) = labelled.find(|pair| !(first..=last).contains(&pair.frame)) {
            let frame = pair.frame;
            return stepper.say(format!(
                "frame {frame} has a label, and lies outside {first} to {last}: move [ or ], or x"
            ));
        }
        let number = match self.file.write(&self.draft, shown) {
            Ok(number) => number,
            Err(error) => return stepper.say(format!("not written: {error:#}")),
        };
        let (path, name) = (self.file.path.display(), &self.draft.name);
        let cells = counted(self.draft.cells.len(), "cell");
        let line =
            format!("{path}: checkpoint {number} '{name}': frames {first} to {last}, {cells}");
        stepper.say(&line);
        self.written.push(line);
        self.draft = Draft::default();
    }

    /// Shows frame and labels in Rerun, and keeps the draft.
    fn keep(&mut self, stepper: &mut LabelStepper<'_>) -> anyhow::Result<()> {
        self.kept = (self.draft.clone(), self.picked);
        self.show_in_viewer(stepper);
        self.draft_file.keep(&stepper.frame, &self.draft)
    }

    fn show_in_viewer(&mut self, stepper: &mut LabelStepper<'_>) {
        let Some(viewer) = &self.viewer else { return };
        let frame = &stepper.frame;
        let notes: Vec<_> = self.shape().iter().filter_map(|at| self.note(at)).collect();
        let [first, last] = self.draft.frames(frame.sequence);
        let name = match self.draft.name.as_str() {
            "" => "(no name yet)",
            name => name,
        };
        let (shown, number) = (frame.sequence, self.file.next_number());
        let state =
            format!("Frame **{shown}**. Checkpoint {number} **{name}**, frames {first} to {last}.");
        if let Err(error) = viewer.show(frame, self.shape(), &notes, &state) {
            self.viewer = None;
            stepper.say(format!("{error}; continuing without Rerun"));
        }
    }

    fn note(&self, at: (usize, usize)) -> Option<CellNote> {
        let label = self.draft.label(at.into()).map(String::from);
        let reported = self.reported.as_ref().map(|reported| reported.words(at));
        let texts: Vec<_> = label.into_iter().chain(reported).collect();
        let is_picked = at == self.picked;
        (is_picked || !texts.is_empty()).then(|| CellNote {
            at,
            text: texts.join(" | "),
            is_picked,
        })
    }

    /// Reports the files that were written, and the draft.
    pub(super) fn finish(&mut self, ended: Ended) -> anyhow::Result<()> {
        if let Some(viewer) = &self.viewer {
            viewer.finish()?;
        }
        let lines = self.written.iter().map(|line| line.clone() + "\n");
        print(&lines.collect::<String>())?;
        let draft = self.draft_file.path.display().to_string();
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
