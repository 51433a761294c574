//! Steps through the frames of a recorded source, in the terminal and in Rerun: the keys, the lines
//! above and below, the loop. What is done with a frame is a [`StepTool`]'s.

mod frames;
mod keys;
mod line_edit;
pub(crate) mod picture;
mod screen;

pub(crate) use frames::{FrameStore, Open, open_again};
pub(crate) use keys::Key;

use crate::cli::shared::log;
use crate::cli::shared::progress::{interrupted, listen_for_interrupt};
use keys::Keys;
use line_edit::{Edited, LineEdit};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::widgets::{Block, Clear, Paragraph};
use screen::Screen;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use svl::printable_line;
use svl::stereo::Frame;

/// A tool that is used on the frames.
pub(crate) trait StepTool {
    /// Keys beside the stepper's, and what each does, for the help.
    fn keys(&self) -> &'static [(&'static str, &'static str)];

    /// Another frame is shown.
    fn show(&mut self, stepper: &mut Stepper<'_>) -> anyhow::Result<()>;

    /// Takes a key, before the stepper does.
    fn key(&mut self, key: Key, stepper: &mut Stepper<'_>) -> anyhow::Result<Reaction>;

    /// Takes the line that it asked for by [`Stepper::ask`].
    fn answer(&mut self, _text: &str, _stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        Ok(())
    }

    /// Question that the next key answers, in place of the message.
    fn question(&self) -> Option<String> {
        None
    }

    /// Receives the results of its work in the background; true if there is something to draw.
    fn poll(&mut self, _stepper: &mut Stepper<'_>) -> bool {
        false
    }

    /// Waits until all that it does in the background is done, for a script.
    fn settle(&mut self) {}

    /// The keys listed in the last line.
    fn hint(&self) -> &'static str {
        ", . step  < > ten  space play  g go to  ? all keys  q quit"
    }

    /// Draws what lies between the lines of the stepper.
    fn draw(&mut self, stepper: &Stepper<'_>, canvas: &mut ToolCanvas<'_, '_>);
}

/// The part of the screen that a tool draws on.
pub(crate) struct ToolCanvas<'c, 'f> {
    pub(crate) screen: &'c mut ratatui::Frame<'f>,
    pub(crate) area: Rect,
    /// [`Screen::has_shades`].
    pub(crate) shades: bool,
}

/// Reaction of a tool to a key.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reaction {
    /// It is not one of the tool's keys.
    Ignored,
    Taken,
    Quit,
}

/// Reason of its end.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ended {
    Quit,
    /// By Ctrl-C, a signal, or the end of a script.
    Interrupted,
}

/// The keys of the stepper itself.
const KEYS: &[(&str, &str)] = &[
    (", .", "one frame back, forth"),
    ("< >", "ten frames back, forth"),
    ("space", "play, pause"),
    ("g 120 Enter", "go to frame 120"),
    ("Ctrl-L", "redraw the screen"),
    ("?", "this help"),
    ("q", "quit"),
];

/// Interval at which signals are looked for.
const GLANCE: Duration = Duration::from_millis(50);

/// The place in a source.
pub(crate) struct Stepper<'a> {
    name: String,
    store: FrameStore<'a>,
    index: u64,
    frame: Arc<Frame>,
    /// Display time of a frame during playback.
    period: Duration,
    /// Time of the next frame; `None` unless playing.
    due: Option<Instant>,
    /// The line that is typed, for the tool unless it is the number of a frame to go to.
    line: Option<LineEdit>,
    jumps: bool,
    help: bool,
    message: String,
    /// True if the tool has to be shown the frame.
    is_new: bool,
}

impl<'a> Stepper<'a> {
    /// At the first frame.
    ///
    /// # Errors
    /// The errors of the source, and a source without frames.
    pub(crate) fn new(name: &str, mut store: FrameStore<'a>) -> anyhow::Result<Self> {
        let Some((index, frame)) = store.at_most(0)? else {
            match store.take_damage() {
                Some(damage) => anyhow::bail!(damage),
                None => anyhow::bail!("{name}: has no frames"),
            }
        };
        let is_live = store.is_live();
        Ok(Self {
            name: name.to_owned(),
            store,
            index,
            frame,
            period: GLANCE,
            // Cameras play all the time.
            due: is_live.then(Instant::now),
            line: None,
            jumps: false,
            help: false,
            message: String::new(),
            is_new: true,
        })
    }

    /// The frame that is shown.
    pub(crate) fn frame(&self) -> &Arc<Frame> {
        &self.frame
    }

    /// Stamp of the source's first pair, which may be before its range.
    pub(crate) fn start_ns(&self) -> u64 {
        self.store.start_ns().unwrap_or(self.frame.stamp_ns)
    }

    /// Name of the source.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// True if the source is cameras.
    pub(crate) fn is_live(&self) -> bool {
        self.store.is_live()
    }

    /// Shows a message until the next key.
    pub(crate) fn say(&mut self, message: impl Into<String>) {
        self.message = message.into();
    }

    /// Asks for a line, the tool's [`StepTool::answer`] unless the user cancels it. `text`: what
    /// it begins with; `hint`: shown while it is empty.
    pub(crate) fn ask(&mut self, question: String, text: String, hint: &'static str) {
        self.jumps = false;
        self.line = Some(LineEdit {
            question,
            text,
            hint,
        });
    }

    /// Goes to the frame with that number, or to the next one that there is.
    pub(crate) fn go_to(&mut self, sequence: u64) {
        let found = self.store.numbered(sequence);
        self.moved(found);
        let at = self.frame.sequence;
        if at != sequence && self.message.is_empty() {
            self.say(format!("there is no frame {sequence}; this is {at}"));
        }
    }

    /// Moves N frames forward or back.
    pub(crate) fn step(&mut self, by: i64) {
        let to = self.index.saturating_add_signed(by);
        let found = self.store.at_most(to);
        let before = (self.index, self.frame.stamp_ns);
        self.moved(found);
        if self.index == before.0 && by > 0 && self.is_live() && self.message.is_empty() {
            // The next one has not come yet.
            self.period = Duration::from_millis(10);
        } else if self.index == before.0 {
            self.due = None;
            if self.message.is_empty() {
                self.say(if by < 0 {
                    "the first frame"
                } else {
                    "the last frame"
                });
            }
        } else if by == 1 {
            // The rate at which the frames were taken, where a person can follow it.
            let passed = Duration::from_nanos(self.frame.stamp_ns.saturating_sub(before.1));
            self.period = passed.clamp(Duration::from_millis(20), Duration::from_secs(1));
        }
    }

    /// Moves to another frame, or reports why it cannot and stays.
    fn moved(&mut self, found: anyhow::Result<Option<(u64, Arc<Frame>)>>) {
        match found {
            Ok(Some((index, frame))) => {
                self.is_new |= index != self.index;
                (self.index, self.frame) = (index, frame);
            }
            Ok(None) => {}
            Err(error) => self.say(format!("{error:#}")),
        }
        if let Some(damage) = self.store.take_damage() {
            self.say(damage);
        }
    }

    /// Takes a key for the line that is typed, else for the tool, else for itself.
    fn key(&mut self, key: Key, tool: &mut dyn StepTool) -> anyhow::Result<Reaction> {
        if let Some(line) = &mut self.line {
            match line.key(key) {
                Edited::Going => {}
                Edited::Cancelled => self.line = None,
                Edited::Done(text) => {
                    self.line = None;
                    if !self.jumps {
                        tool.answer(&text, self)?;
                    } else if let Ok(sequence) = text.parse() {
                        self.go_to(sequence);
                    } else {
                        self.say(format!("'{text}' is not the number of a frame"));
                    }
                }
            }
            return Ok(Reaction::Taken);
        }
        // Any key leaves the help.
        if std::mem::take(&mut self.help) {
            return Ok(Reaction::Taken);
        }
        let reaction = tool.key(key, self)?;
        if reaction != Reaction::Ignored {
            return Ok(reaction);
        }
        match key {
            Key::Char(',') => self.step(-1),
            Key::Char('.') => self.step(1),
            Key::Char('<') => self.step(-10),
            Key::Char('>') => self.step(10),
            Key::Char('g') => {
                self.ask("go to frame".to_owned(), String::new(), "");
                self.jumps = true;
            }
            Key::Char('?') => self.help = true,
            Key::Char(' ') => {
                self.due = self.due.is_none().then(Instant::now);
            }
            Key::Char(c) => self.say(format!("'{c}' does nothing here; ? shows the keys")),
            _ => {}
        }
        Ok(Reaction::Taken)
    }

    /// Plays on if the next frame is due; a script triggers it with a tick.
    fn tick(&mut self, is_script: bool) {
        let is_reached = |due| is_script || Instant::now() >= due;
        if self.due.is_some_and(is_reached) {
            self.due = Some(Instant::now() + self.period);
            self.step(1);
        }
    }

    fn wait(&self) -> Duration {
        let left = |due: Instant| due.saturating_duration_since(Instant::now());
        self.due.map_or(GLANCE, |due| left(due).min(GLANCE))
    }

    fn title(&self) -> String {
        let (source, sequence) = (&self.name, self.frame.sequence);
        let name = self.frame.name.as_ref().map(|name| format!(" '{name}'"));
        let total = self.store.count().map(|count| format!(" of {count}"));
        let (name, total) = (name.unwrap_or_default(), total.unwrap_or_default());
        let place = if sequence == self.index {
            total
        } else {
            format!(", pair {}{total}", self.index + 1)
        };
        let seconds = self.frame.stamp_ns as f64 / 1e9;
        let playing = if self.due.is_some() { "  playing" } else { "" };
        format!(" {source}  frame {sequence}{name}{place}  {seconds:.3} s{playing}")
    }

    fn draw(&self, tool: &mut dyn StepTool, shades: bool, canvas: &mut ratatui::Frame<'_>) {
        let area = canvas.area();
        if area.width < screen::MIN_SIZE.width || area.height < screen::MIN_SIZE.height {
            let words = format!("make the terminal at least {} characters", screen::MIN_SIZE);
            canvas.render_widget(Paragraph::new(words), area);
            return;
        }
        let lines = [1, 0, 1, 1].map(|rows| match rows {
            0 => Constraint::Fill(1),
            rows => Constraint::Length(rows),
        });
        let [title, middle, message, keys] = Layout::vertical(lines).areas(area);
        let bar = Style::new().add_modifier(Modifier::REVERSED);
        let words = printable_line(&self.title());
        canvas.render_widget(Paragraph::new(words).style(bar), title);
        let mut tool_canvas = ToolCanvas {
            screen: canvas,
            area: middle,
            shades,
        };
        tool.draw(self, &mut tool_canvas);
        let line = self.line.as_ref().map(LineEdit::to_string);
        let question = tool.question().or(line);
        let words = question.unwrap_or_else(|| self.message.clone());
        canvas.render_widget(Paragraph::new(printable_line(&words)), message);
        canvas.render_widget(Paragraph::new(tool.hint()).style(bar), keys);
        if self.help {
            help(tool, area, canvas);
        }
    }
}

fn help(tool: &dyn StepTool, area: Rect, canvas: &mut ratatui::Frame<'_>) {
    let keys = KEYS.iter().chain(tool.keys());
    let lines = keys.map(|(key, does)| format!(" {key:<14} {does}"));
    let lines: Vec<_> = lines.collect();
    let widths = lines.iter().map(|line| line.chars().count() + 3);
    let width = widths.max().unwrap_or(0) as u16;
    let height = lines.len() as u16 + 2;
    let place = area.centered(Constraint::Length(width), Constraint::Length(height));
    canvas.render_widget(Clear, place);
    let frame = Block::bordered().title(" keys; any key closes this ");
    canvas.render_widget(Paragraph::new(lines.join("\n")).block(frame), place);
}

/// A terminal, or a script with a screen in memory.
pub(crate) struct StepSession(Keys);

impl StepSession {
    /// `script`: a file of keys in place of a terminal.
    ///
    /// # Errors
    /// The errors of the script and of [`Screen::check_terminal`].
    pub(crate) fn new(script: Option<&Path>) -> anyhow::Result<Self> {
        if let Some(script) = script {
            return Ok(Self(Keys::script(script)?));
        }
        Screen::check_terminal()?;
        Ok(Self(Keys::Terminal))
    }

    /// Shows frames and takes keys until the tool or the user ends it, and restores the screen.
    ///
    /// # Errors
    /// The errors of the tool; a terminal that is gone.
    pub(crate) fn run(
        mut self,
        stepper: &mut Stepper<'_>,
        tool: &mut dyn StepTool,
    ) -> anyhow::Result<Ended> {
        let mut screen = match self.0 {
            Keys::Script(_) => Screen::in_memory()?,
            Keys::Terminal => Screen::from_terminal()?,
        };
        listen_for_interrupt();
        let (shades, is_script) = (screen.has_shades(), matches!(self.0, Keys::Script(_)));
        let mut changed = true;
        loop {
            if std::mem::take(&mut stepper.is_new) {
                tool.show(stepper)?;
                changed = true;
            }
            if let Some(warning) = log::take_last() {
                stepper.say(warning);
                changed = true;
            }
            if std::mem::take(&mut changed) {
                screen.draw(|canvas| stepper.draw(tool, shades, canvas))?;
            }
            if interrupted() {
                return Ok(Ended::Interrupted);
            }
            match self.0.next(stepper.wait())? {
                Key::Tick => {
                    stepper.tick(is_script);
                    changed |= tool.poll(stepper);
                }
                Key::Wait => {
                    tool.settle();
                    changed |= tool.poll(stepper);
                }
                Key::Screen => screen.print()?,
                Key::Resize(columns, rows) => {
                    screen.resize(columns, rows)?;
                    changed = true;
                }
                Key::Interrupt | Key::Closed => return Ok(Ended::Interrupted),
                key => {
                    changed = true;
                    stepper.message.clear();
                    if stepper.key(key, tool)? == Reaction::Quit {
                        return Ok(Ended::Quit);
                    }
                }
            }
        }
    }
}
