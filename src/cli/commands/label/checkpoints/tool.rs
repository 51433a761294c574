//! The keys of labelling: cells are picked, what they must show is typed, the checkpoint is
//! written.

use super::draft::{Draft, DraftFile};
use super::label::{CellLabel, FORMS, NONE};
use super::reported::Reported;
use super::scenario_file::ScenarioFile;
use crate::cli::shared::stepper::{Key, Reaction, Stepper, picture};
use ratatui::layout::Rect;
use svl::counted;
use svl::score::{ExpectedCell, FrameOrigin, LabelledPair, Verdict};
use svl::sink::{CellNote, StepView};
use svl::stereo::{Frame, GridShape};

/// Keys for the help.
pub(super) const KEYS: &[(&str, &str)] = &[
    ("arrows, mouse", "pick a cell"),
    ("0.43 Enter", "what it shows: a distance, metres"),
    ("= <0.5 Enter", "in words: <0.5 >1.2 free must none"),
    ("f", "nothing is there: free"),
    ("x", "clear the cell"),
    ("[ ]", "first, last frame of the checkpoint"),
    ("n", "name the checkpoint"),
    ("Enter w", "write the checkpoint"),
];

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
    /// Place where the image was drawn last.
    pub(super) picture: Rect,
    /// The line that was asked for last.
    pub(super) asked: TypedLine,
    /// True if the next key says what becomes of the draft on leaving.
    pub(super) leaves: bool,
    /// The key before, if it moved to another frame and could begin a label.
    pub(super) moved_by: Option<char>,
    /// Files that were written, a line each.
    pub(super) written: Vec<String>,
}

/// Purpose of a line that the user types.
#[derive(Clone, Copy)]
pub(super) enum TypedLine {
    Cell,
    /// True if the checkpoint is written after the answer.
    Name(bool),
}

impl Labelling {
    pub(super) fn shape(&self) -> GridShape {
        self.file.scenario().grid.shape()
    }

    /// True if the reported cell is as the label expects.
    pub(super) fn verdict(&self, (column, row): (usize, usize)) -> Option<Verdict> {
        let at = [column, row];
        let CellLabel::Seen(expectation) = self.draft.label(at)? else {
            return None;
        };
        let expected = ExpectedCell { at, expectation };
        let cell = self.reported.as_ref()?.grid()?.cell(column, row);
        Some(expected.judge(cell, self.file.scenario().cells))
    }

    /// Names of the scenario's checkpoints that the frame shows.
    pub(super) fn others(&self, frame: &Frame) -> Vec<String> {
        let checkpoints = self.file.scenario().checkpoints.iter();
        let here = checkpoints.filter(|checkpoint| checkpoint.covers(frame, &self.run));
        here.map(|checkpoint| format!("{} {}", checkpoint.number, checkpoint.name))
            .collect()
    }

    fn label(&mut self, label: Option<CellLabel>, stepper: &mut Stepper<'_>) {
        if label == Some(CellLabel::Must) && stepper.frame().truth.is_none() {
            stepper.say("must is compared with true distances, and this source has none");
            return;
        }
        let pair = LabelledPair::new(stepper.frame());
        self.draft.set(self.picked.into(), label, pair);
    }

    /// True if a text behind a key that moved may be the rest of a label.
    fn is_doubtful(&self, text: &str) -> bool {
        match self.moved_by {
            Some(',' | '.') => !text.contains('.'),
            moved => moved.is_some(),
        }
    }

    /// Takes a line that was asked for.
    pub(super) fn answered(&mut self, text: &str, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        match self.asked {
            TypedLine::Cell if self.is_doubtful(text) => {
                let key = self.moved_by.take().unwrap_or_default();
                stepper.say(format!(
                    "not labelled: is it {text} or {key}{text}? {key} has moved; type = first"
                ));
            }
            TypedLine::Cell if text == NONE => self.label(None, stepper),
            TypedLine::Cell => match text.parse() {
                Ok(label) => self.label(Some(label), stepper),
                Err(why) => stepper.say(why),
            },
            TypedLine::Name(then_write) => {
                text.clone_into(&mut self.draft.name);
                if then_write && !self.draft.name.is_empty() {
                    self.write(stepper)?;
                }
            }
        }
        Ok(())
    }

    /// Leaves with the draft written, kept or discarded, or continues.
    fn leave(&mut self, key: Key, stepper: &mut Stepper<'_>) -> anyhow::Result<Reaction> {
        match key {
            Key::Char('w') => self.write(stepper)?,
            Key::Char('k') => return Ok(Reaction::Quit),
            Key::Char('d') => self.draft = Draft::default(),
            _ => return Ok(Reaction::Taken),
        }
        Ok(if self.draft.is_empty() {
            Reaction::Quit
        } else {
            Reaction::Taken
        })
    }

    fn write(&mut self, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        if self.draft.cells.is_empty() {
            stepper.say("no cell is labelled: type a distance, = for words, f for free");
            return Ok(());
        }
        if self.draft.name.is_empty() {
            self.ask_name(true, stepper);
            return Ok(());
        }
        let shown = stepper.frame().sequence;
        let [first, last] = self.draft.frames(shown);
        let labelled = self.draft.labelled();
        if let Some(pair) = labelled.iter().find(|p| p.frame < first || last < p.frame) {
            let frame = pair.frame;
            stepper.say(format!(
                "frame {frame} has a label, and lies outside {first} to {last}: move [ or ], or x"
            ));
            return Ok(());
        }
        let number = match self.file.write(&self.draft, shown) {
            Ok(number) => number,
            Err(error) => {
                stepper.say(format!("not written: {error:#}"));
                return Ok(());
            }
        };
        let (path, name) = (self.file.path().display(), &self.draft.name);
        let cells = counted(self.draft.cells.len(), "cell");
        let line =
            format!("{path}: checkpoint {number} '{name}': frames {first} to {last}, {cells}");
        stepper.say(&line);
        self.written.push(line);
        self.draft = Draft::default();
        Ok(())
    }

    fn ask_name(&mut self, then_write: bool, stepper: &mut Stepper<'_>) {
        let question = "name of the checkpoint, or name: description";
        self.asked = TypedLine::Name(then_write);
        stepper.ask(question.to_owned(), self.draft.name.clone(), "");
    }

    fn ask_cell(&mut self, text: impl Into<String>, stepper: &mut Stepper<'_>) {
        let (column, row) = self.picked;
        let question = format!("cell ({column}, {row}) shows");
        self.asked = TypedLine::Cell;
        stepper.ask(question, text.into(), FORMS);
    }

    fn pick(&mut self, key: Key) {
        let (column, row) = self.picked;
        let GridShape { columns, rows } = self.shape();
        self.picked = match key {
            Key::Left => (column.saturating_sub(1), row),
            Key::Right => ((column + 1).min(columns - 1), row),
            Key::Up => (column, row.saturating_sub(1)),
            Key::Down => (column, (row + 1).min(rows - 1)),
            Key::Click(x, y) => {
                picture::cell_at(self.shape(), self.picture, (x, y)).unwrap_or(self.picked)
            }
            _ => self.picked,
        };
    }

    pub(super) fn command(
        &mut self,
        key: Key,
        stepper: &mut Stepper<'_>,
    ) -> anyhow::Result<Reaction> {
        if std::mem::take(&mut self.leaves) {
            return self.leave(key, stepper);
        }
        let frame = stepper.frame().sequence;
        if !matches!(key, Key::Char(c) if c.is_ascii_digit()) {
            self.moved_by = match key {
                Key::Char(c @ (',' | '.' | '<' | '>')) => Some(c),
                _ => None,
            };
        }
        match key {
            Key::Left | Key::Right | Key::Up | Key::Down | Key::Click(..) => self.pick(key),
            Key::Char(c) if c.is_ascii_digit() => self.ask_cell(c, stepper),
            Key::Char('=') => {
                let label = self.draft.label(self.picked.into());
                self.ask_cell(label.map(String::from).unwrap_or_default(), stepper);
            }
            Key::Char('f') => self.label(Some(CellLabel::FREE), stepper),
            Key::Char('x') | Key::Delete | Key::Backspace => self.label(None, stepper),
            Key::Char('n') => self.ask_name(false, stepper),
            Key::Char(end @ ('[' | ']')) => {
                let set = match end {
                    '[' => self.draft.begin(frame),
                    _ => self.draft.end(frame),
                };
                if let Err(why) = set {
                    stepper.say(why);
                }
            }
            Key::Char('w') | Key::Enter => self.write(stepper)?,
            Key::Char('q') if self.draft.is_empty() => return Ok(Reaction::Quit),
            Key::Char('q') => self.leaves = true,
            _ => return Ok(Reaction::Ignored),
        }
        Ok(Reaction::Taken)
    }

    /// Shows frame and labels in Rerun.
    pub(super) fn show_in_viewer(&mut self, stepper: &mut Stepper<'_>) {
        let Some(viewer) = &self.viewer else { return };
        let frame = stepper.frame();
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
        let is_picked = at == self.picked;
        (label.is_some() || reported.is_some() || is_picked).then(|| {
            let texts: Vec<_> = label.into_iter().chain(reported).collect();
            CellNote {
                at,
                text: texts.join(" | "),
                is_picked,
            }
        })
    }
}
