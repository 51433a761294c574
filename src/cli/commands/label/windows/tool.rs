//! The categorizer: a key per category for each window.

use crate::cli::commands::label::input::replace;
use crate::cli::shared::stepper::Key::{self, Press};
use crate::cli::shared::stepper::{StepTool, Stepper, ToolCanvas, picture};
use anyhow::bail;
use ratatui::buffer::Buffer;
use ratatui::crossterm::event::KeyCode::{Backspace, Char, Down, Left, Right, Up};
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use std::ops::Range;
use std::path::PathBuf;
use svl::counted;
use svl::filter::FilterWindows;
use svl::fit::filter::FrameLabels;
use svl::outputs::make_folder;
use svl::stereo::{Frame, GridShape};

/// State of the labelling session.
pub(super) struct Categorizer {
    pub(super) labels: FrameLabels,
    pub(super) source: PathBuf,
    pub(super) window: usize,
    /// Labels that were set, with the labels before.
    pub(super) done: Vec<Labelled>,
}

/// The place in the source that is labelled.
type WindowStepper<'a> = Stepper<'a, Categorizer>;

/// Labels that a key gave to windows of a frame.
pub(super) struct Labelled {
    sequence: u64,
    /// The windows with their labels before.
    before: Vec<(usize, Option<bool>)>,
}

impl Categorizer {
    fn windows(&self) -> usize {
        FrameLabels::windows(self.labels.kind)
    }

    fn label(
        &mut self,
        windows: Range<usize>,
        is: bool,
        stepper: &mut WindowStepper<'_>,
    ) -> anyhow::Result<()> {
        let sequence = stepper.frame.sequence;
        self.labels.tie(sequence, stepper.frame.pair.hash());
        self.window = windows.end - 1;
        let before = windows.map(|window| (window, self.labels.set(sequence, window, Some(is))));
        let before = before.collect();
        self.done.push(Labelled { sequence, before });
        self.save()?;
        self.next(stepper);
        Ok(())
    }

    /// The table is intact at any moment.
    fn save(&self) -> anyhow::Result<()> {
        let path = &self.labels.path;
        if let Some(folder) = path.parent() {
            make_folder(folder)?;
        }
        replace(path, &self.labels.to_text(), false)
    }

    /// Goes to the next window; false at the last one of the source.
    fn next(&mut self, stepper: &mut WindowStepper<'_>) -> bool {
        if self.window + 1 < self.windows() {
            self.window += 1;
        } else if is_stepped(1, stepper) {
            self.window = 0;
        } else {
            return false;
        }
        true
    }

    /// Goes to the window after the last one that has a label.
    ///
    /// # Errors
    /// A frame that has labels is another pair in this source.
    pub(super) fn resume(&mut self, stepper: &mut WindowStepper<'_>) -> anyhow::Result<()> {
        let Some((_, window)) = self.labels.last() else {
            return Ok(());
        };
        let mut sequences: Vec<_> = self.labels.sequences().collect();
        sequences.dedup();
        for labelled in sequences {
            stepper.go_to(labelled);
            let frame = &stepper.frame;
            if frame.sequence != labelled {
                let (table, source) = (self.labels.path.display(), self.source.display());
                bail!(
                    "{table}: labels frame {labelled}, which {source} does not have; name the \
                     recording that was labelled, or another table with -o"
                );
            }
            let pair_hash = || frame.pair.hash();
            self.labels.check(&self.source, labelled, pair_hash)?;
        }
        self.window = window;
        let is_moved = self.next(stepper);
        let found = counted(self.labels.counts().iter().sum::<usize>() as u64, "label");
        let at = stepper.frame.sequence;
        let window = FrameLabels::window_name(self.labels.kind, self.window);
        stepper.say(if is_moved {
            format!("resumed at frame {at}, window {window} with {found}")
        } else {
            format!("the last window of the last frame has a label: {found}; a and b replace it")
        });
        Ok(())
    }

    fn back(&mut self, stepper: &mut WindowStepper<'_>) {
        if self.window > 0 {
            self.window -= 1;
        } else if is_stepped(-1, stepper) {
            self.window = self.windows() - 1;
        }
    }

    fn undo(&mut self, stepper: &mut WindowStepper<'_>) -> anyhow::Result<()> {
        let Some(Labelled { sequence, before }) = self.done.pop() else {
            stepper.say("there is nothing to undo");
            return Ok(());
        };
        stepper.go_to(sequence);
        self.window = before.first().map_or(0, |(window, _)| *window);
        for (window, label) in before {
            self.labels.set(sequence, window, label);
        }
        self.save()
    }

    fn pick(&mut self, arrow: Key) {
        let columns = FrameLabels::columns(self.labels.kind);
        let rows = self.windows() / columns;
        let picked = (self.window % columns, self.window / columns);
        let (column, row) = picture::beside(GridShape { columns, rows }, picked, arrow);
        self.window = row * columns + column;
    }

    /// Left upper corners of the windows in a frame.
    fn corners(&self, frame: &Frame) -> svl::Result<Vec<[usize; 2]>> {
        let (kind, shape) = (self.labels.kind, GridShape::default());
        let side = kind.spec().features.window;
        let windows = FilterWindows::new(kind, side, frame.pair.size(), shape)?;
        Ok(windows.corners.to_vec())
    }

    /// The text beside the image.
    fn lines(&self, frame: &Frame) -> Vec<String> {
        let kind = self.labels.kind;
        let [is, is_not] = kind.spec().categories;
        let [yes, no] = self.labels.counts();
        let window = FrameLabels::window_name(kind, self.window);
        let label = self.labels.get(frame.sequence, self.window);
        let label = label.map_or("no label", |is| self.labels.category(is));
        vec![
            format!("filter {kind}"),
            format!("{yes} {is}, {no} {is_not}"),
            String::new(),
            format!("window {window}: {label}"),
            String::new(),
            format!("a {is}, b {is_not}"),
            "s skip, u undo".to_owned(),
            "Backspace one back".to_owned(),
        ]
    }

    /// Reports the path of the table.
    pub(super) fn said(&self) -> String {
        let [yes, no] = self.labels.counts();
        let [is, is_not] = self.labels.kind.spec().categories;
        let path = self.labels.path.display();
        format!("{path}: {yes} {is}, {no} {is_not}\n")
    }
}

impl StepTool for Categorizer {
    const KEYS: &'static [(&'static str, &'static str)] = &[
        ("a", "it shows what the filter detects"),
        ("b", "it does not"),
        ("A B", "all windows of the frame, also labelled ones"),
        ("s", "skip: neither"),
        ("arrows", "pick a window"),
        ("Backspace", "back to the one before"),
        ("u", "undo the last label"),
    ];

    fn show(&mut self, stepper: &mut WindowStepper<'_>) -> anyhow::Result<()> {
        self.corners(&stepper.frame)?;
        Ok(())
    }

    fn key(&mut self, key: Key, stepper: &mut WindowStepper<'_>) -> anyhow::Result<bool> {
        match key {
            Press(Char(c @ ('a' | 'b'))) => {
                self.label(self.window..self.window + 1, c == 'a', stepper)?;
            }
            Press(Char(c @ ('A' | 'B'))) => self.label(0..self.windows(), c == 'A', stepper)?,
            Press(Char('s')) => {
                self.next(stepper);
            }
            Press(Char('u')) => self.undo(stepper)?,
            Press(Backspace) => self.back(stepper),
            Press(Left | Right | Up | Down) => self.pick(key),
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn draw(&mut self, stepper: &WindowStepper<'_>, canvas: &mut ToolCanvas<'_, '_>) {
        let frame = &stepper.frame;
        let image = picture::draw_beside(&self.lines(frame), frame.pair.left(), canvas);
        let side = self.labels.kind.spec().features.window;
        for (window, corner) in self.corners(frame).into_iter().flatten().enumerate() {
            let place = on_screen(corner, side, frame.pair.size(), image);
            let label = self.labels.get(frame.sequence, window);
            let label = label.map_or("", |is| self.labels.category(is));
            let is_picked = window == self.window;
            outline(place, is_picked, label, canvas.screen.buffer_mut());
        }
    }
}

/// Moves the frame; true if there is another one in that direction.
fn is_stepped(by: i64, stepper: &mut WindowStepper<'_>) -> bool {
    let at = stepper.frame.sequence;
    stepper.step(by);
    stepper.frame.sequence != at
}

/// A square of the image, in characters.
fn on_screen(
    [x, y]: [usize; 2],
    side: usize,
    (width, height): (usize, usize),
    image: Rect,
) -> Rect {
    let across = |px: usize| image.x + (px * usize::from(image.width) / width) as u16;
    let down = |px: usize| image.y + (px * usize::from(image.height) / height) as u16;
    let (left, top) = (across(x), down(y));
    Rect::new(left, top, across(x + side) - left, down(y + side) - top)
}

/// The corners of a window with its label; the picked one all around.
fn outline(place: Rect, is_picked: bool, label: &str, buffer: &mut Buffer) {
    if place.width < 2 || place.height < 2 {
        return;
    }
    let color = if is_picked {
        Color::Yellow
    } else {
        Color::Gray
    };
    let style = Style::reset().fg(color).bold();
    for (at, line) in picture::border(place) {
        if is_picked || !["━", "┃"].contains(&line.as_str()) {
            buffer[at].set_symbol(&line).set_style(style);
        }
    }
    let green = Style::reset().fg(Color::Green).bold();
    let room = usize::from(place.width - 2);
    buffer.set_stringn(place.x + 1, place.y + place.height / 2, label, room, green);
}
