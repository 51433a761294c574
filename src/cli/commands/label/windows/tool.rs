//! The categorizer: a key per category for each window.

use crate::cli::shared::stepper::{Key, Reaction, StepTool, Stepper, ToolCanvas, picture};
use anyhow::{Context, bail};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use std::ops::Range;
use std::path::PathBuf;
use svl::counted;
use svl::filter::FilterWindows;
use svl::fit::filter::FrameLabels;
use svl::outputs::write;
use svl::stereo::{Frame, GridShape};

/// Keys beside those of the stepper.
const KEYS: &[(&str, &str)] = &[
    ("a", "it shows what the filter detects"),
    ("b", "it does not"),
    ("A B", "all windows of the frame, also labelled ones"),
    ("s", "skip: neither"),
    ("arrows", "pick a window"),
    ("Backspace", "back to the one before"),
    ("u", "undo the last label"),
];

/// State of the labelling session.
pub(super) struct Categorizer {
    pub(super) labels: FrameLabels,
    pub(super) source: PathBuf,
    pub(super) window: usize,
    /// Labels that were set, with the labels before.
    pub(super) done: Vec<Labelled>,
}

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
        stepper: &mut Stepper<'_>,
    ) -> anyhow::Result<()> {
        let sequence = stepper.frame().sequence;
        self.labels.tie(sequence, stepper.frame().pair.hash());
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
        let part = path.with_extension("csv.part");
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|error| svl::Error::io(folder, error))?;
        }
        write(&part, self.labels.to_text())?;
        std::fs::rename(&part, path).with_context(|| path.display().to_string())
    }

    /// Goes to the next window; false at the last one of the source.
    fn next(&mut self, stepper: &mut Stepper<'_>) -> bool {
        if self.window + 1 < self.windows() {
            self.window += 1;
            return true;
        }
        let at = stepper.frame().sequence;
        stepper.step(1);
        let is_moved = stepper.frame().sequence != at;
        if is_moved {
            self.window = 0;
        }
        is_moved
    }

    /// Goes to the window after the last one that has a label.
    ///
    /// # Errors
    /// A frame that has labels is another pair in this source.
    pub(super) fn resume(&mut self, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        let Some((_, window)) = self.labels.last() else {
            return Ok(());
        };
        let mut labelled: Vec<_> = self.labels.sequences().collect();
        labelled.dedup();
        for labelled in labelled {
            stepper.go_to(labelled);
            let frame = stepper.frame();
            if frame.sequence == labelled {
                let pair_hash = || frame.pair.hash();
                self.labels.check(&self.source, labelled, pair_hash)?;
            } else {
                let (table, source) = (self.labels.path.display(), self.source.display());
                bail!(
                    "{table}: labels frame {labelled}, which {source} does not have; name the \
                     recording that was labelled, or another table with -o"
                );
            }
        }
        self.window = window;
        let is_moved = self.next(stepper);
        let found = counted(self.labels.counts().iter().sum::<usize>() as u64, "label");
        let at = stepper.frame().sequence;
        let window = FrameLabels::window_name(self.labels.kind, self.window);
        stepper.say(if is_moved {
            format!("resumed at frame {at}, window {window} with {found}")
        } else {
            format!("the last window of the last frame has a label: {found}; a and b replace it")
        });
        Ok(())
    }

    fn back(&mut self, stepper: &mut Stepper<'_>) {
        if self.window > 0 {
            self.window -= 1;
        } else {
            let at = stepper.frame().sequence;
            stepper.step(-1);
            if stepper.frame().sequence != at {
                self.window = self.windows() - 1;
            }
        }
    }

    fn undo(&mut self, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
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

    fn pick(&mut self, key: Key) {
        let columns = FrameLabels::columns(self.labels.kind);
        let (column, last) = (self.window % columns, self.windows() - 1);
        self.window = match key {
            Key::Left if column > 0 => self.window - 1,
            Key::Right if column + 1 < columns => self.window + 1,
            Key::Up if self.window >= columns => self.window - columns,
            Key::Down if self.window + columns <= last => self.window + columns,
            _ => self.window,
        };
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
    fn keys(&self) -> &'static [(&'static str, &'static str)] {
        KEYS
    }

    fn show(&mut self, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        windows(self, stepper.frame())?;
        Ok(())
    }

    fn key(&mut self, key: Key, stepper: &mut Stepper<'_>) -> anyhow::Result<Reaction> {
        match key {
            Key::Char(c @ ('a' | 'b')) => {
                self.label(self.window..self.window + 1, c == 'a', stepper)?;
            }
            Key::Char(c @ ('A' | 'B')) => self.label(0..self.windows(), c == 'A', stepper)?,
            Key::Char('s') => {
                self.next(stepper);
            }
            Key::Char('u') => self.undo(stepper)?,
            Key::Backspace => self.back(stepper),
            Key::Left | Key::Right | Key::Up | Key::Down => self.pick(key),
            Key::Char('q') => return Ok(Reaction::Quit),
            _ => return Ok(Reaction::Ignored),
        }
        Ok(Reaction::Taken)
    }

    fn draw(&mut self, stepper: &Stepper<'_>, canvas: &mut ToolCanvas<'_, '_>) {
        let frame = stepper.frame();
        let lines = self.lines(frame);
        let image = picture::draw_beside(&lines, frame.pair.left(), canvas);
        let buffer = canvas.screen.buffer_mut();
        if let Ok(windows) = windows(self, frame) {
            for (window, &corner) in windows.corners().iter().enumerate() {
                let side = self.labels.kind.spec().features.window;
                let place = on_screen(corner, side, frame.pair.size(), image);
                let is_picked = window == self.window;
                let label = self.labels.get(frame.sequence, window);
                let label = label.map(|is| self.labels.category(is));
                outline(place, is_picked, label.unwrap_or_default(), buffer);
            }
        }
    }
}

/// The windows of the filter in a frame.
fn windows(tool: &Categorizer, frame: &Frame) -> svl::Result<FilterWindows> {
    let kind = tool.labels.kind;
    let side = kind.spec().features.window;
    FilterWindows::new(kind, side, frame.pair.size(), GridShape::default())
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
    let color = if is_picked {
        Color::Yellow
    } else {
        Color::Gray
    };
    let style = Style::reset().fg(color).add_modifier(Modifier::BOLD);
    if place.width < 2 || place.height < 2 {
        return;
    }
    for (at, line) in picture::border(place) {
        let is_corner = !["━", "┃"].contains(&line);
        if let Some(cell) = buffer.cell_mut(at)
            && (is_picked || is_corner)
        {
            cell.set_symbol(line).set_style(style);
        }
    }
    let bold = Style::reset().add_modifier(Modifier::BOLD).fg(Color::Green);
    let room = usize::from(place.width.saturating_sub(2));
    buffer.set_stringn(place.x + 1, place.y + place.height / 2, label, room, bold);
}
