//! Steps through the frames of a recorded source, in the terminal and in Rerun: the keys, the lines
//! above and below, the loop. What is done with a frame is a [`StepTool`]'s.

mod frames;
mod keys;
pub(crate) mod picture;
mod screen;

pub(crate) use frames::{FrameStore, Open, open_again};
pub(crate) use keys::Key;

use crate::cli::shared::log;
use crate::cli::shared::progress::{interrupted, listen_for_interrupt};
use keys::Key::Press;
use keys::Keys;
use ratatui::crossterm::event::KeyCode::{Backspace, Char, Enter, Esc};
use ratatui::layout::Constraint::{Fill, Length};
use ratatui::layout::{Layout, Rect};
use ratatui::style::Stylize;
use ratatui::text::Text;
use ratatui::widgets::{Block, Clear, Paragraph};
use screen::Screen;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use svl::printable_line;
use svl::stereo::Frame;

/// A tool that is used on the frames.
pub(crate) trait StepTool: Sized {
    /// Keys beside the stepper's, and what each does, for the help.
    const KEYS: &'static [(&'static str, &'static str)];

    /// The keys listed in the last line.
    const HINT: &'static str = ", . step  < > ten  space play  g go to  ? all keys  q quit";

    /// Another frame is shown.
    fn show(&mut self, stepper: &mut Stepper<'_, Self>) -> anyhow::Result<()>;

    /// Takes a key, before the stepper does; false if it is not one of the tool's.
    fn key(&mut self, key: Key, stepper: &mut Stepper<'_, Self>) -> anyhow::Result<bool>;

    /// A key was taken, by the tool, by the stepper or as an answer.
    fn acted(&mut self, _stepper: &mut Stepper<'_, Self>) -> anyhow::Result<()> {
        Ok(())
    }

    /// Receives the results of its work in the background; true if there is something to draw.
    fn poll(&mut self, _stepper: &mut Stepper<'_, Self>) -> bool {
        false
    }

    /// Waits until all that it does in the background is done, for a script.
    fn settle(&mut self) {}

    /// Draws what lies between the lines of the stepper.
    fn draw(&mut self, stepper: &Stepper<'_, Self>, canvas: &mut ToolCanvas<'_, '_>);
}

/// Takes the answer to a question: a line, or a key.
pub(crate) type Then<T, A> = fn(&mut T, A, &mut Stepper<'_, T>);

/// The part of the screen that a tool draws on.
pub(crate) struct ToolCanvas<'c, 'f> {
    pub(crate) screen: &'c mut ratatui::Frame<'f>,
    pub(crate) area: Rect,
    /// [`Screen::has_shades`].
    pub(crate) shades: bool,
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

/// Largest number of characters of a line that is typed.
const MAX_CHARACTERS: usize = 200;

/// A question, and as much of its answer as was typed.
struct LineEdit<T> {
    question: String,
    /// May begin with a proposal.
    text: String,
    /// Shown until something is typed.
    hint: &'static str,
    then: Then<T, String>,
}

/// The place in a source, and what the user is asked.
pub(crate) struct Stepper<'a, T> {
    /// Name of the source.
    pub(crate) name: String,
    store: FrameStore<'a>,
    index: u64,
    /// The frame that is shown.
    pub(crate) frame: Arc<Frame>,
    /// Display time of a frame during playback.
    period: Duration,
    /// Time of the next frame; `None` unless playing.
    due: Option<Instant>,
    /// The line that is typed.
    line: Option<LineEdit<T>>,
    /// The question that the next key answers.
    choice: Option<(String, Then<T, Key>)>,
    help: bool,
    message: String,
    /// True if the tool has to be shown the frame.
    is_new: bool,
    quits: bool,
}

impl<'a, T> Stepper<'a, T> {
    /// At the first frame.
    ///
    /// # Errors
    /// The errors of the source, and a source without frames.
    pub(crate) fn new(name: &str, mut store: FrameStore<'a>) -> anyhow::Result<Self> {
        let Some((index, frame)) = store.at_most(0)? else {
            match store.damage.take() {
                Some(damage) => anyhow::bail!(damage),
                None => anyhow::bail!("{name}: has no frames"),
            }
        };
        Ok(Self {
            name: name.to_owned(),
            // Cameras play all the time.
            due: store.is_live().then(Instant::now),
            store,
            index,
            frame,
            period: GLANCE,
            line: None,
            choice: None,
            help: false,
            message: String::new(),
            is_new: true,
            quits: false,
        })
    }

    /// Stamp of the source's first pair, which may be before its range.
    pub(crate) fn start_ns(&self) -> u64 {
        self.store.start_ns().unwrap_or(self.frame.stamp_ns)
    }

    /// Shows a message until the next key.
    pub(crate) fn say(&mut self, message: impl Into<String>) {
        self.message = message.into();
    }

    /// Ends the session.
    pub(crate) fn quit(&mut self) {
        self.quits = true;
    }

    /// Asks for a line, which `then` takes unless the user cancels it. `text`: what it begins
    /// with; `hint`: shown while it is empty.
    pub(crate) fn ask(
        &mut self,
        question: impl Into<String>,
        text: String,
        hint: &'static str,
        then: Then<T, String>,
    ) {
        self.line = Some(LineEdit {
            question: question.into(),
            text,
            hint,
            then,
        });
    }

    /// Asks a question that the next key answers.
    pub(crate) fn ask_key(&mut self, question: String, then: Then<T, Key>) {
        self.choice = Some((question, then));
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

    /// Goes to the frame whose number was typed.
    fn jump(_: &mut T, text: String, stepper: &mut Stepper<'_, T>) {
        match text.parse() {
            Ok(sequence) => stepper.go_to(sequence),
            Err(_) => stepper.say(format!("'{text}' is not the number of a frame")),
        }
    }

    /// Moves N frames forward or back.
    pub(crate) fn step(&mut self, by: i64) {
        let before = (self.index, self.frame.stamp_ns);
        let found = self.store.at_most(self.index.saturating_add_signed(by));
        self.moved(found);
        if self.index != before.0 {
            if by == 1 {
                // The rate at which the frames were taken, where a person can follow it.
                let passed = Duration::from_nanos(self.frame.stamp_ns.saturating_sub(before.1));
                self.period = passed.clamp(Duration::from_millis(20), Duration::from_secs(1));
            }
        } else if by > 0 && self.store.is_live() && self.message.is_empty() {
            // The next one has not come yet.
            self.period = Duration::from_millis(10);
        } else {
            self.due = None;
            if self.message.is_empty() {
                let end = if by < 0 { "first" } else { "last" };
                self.say(format!("the {end} frame"));
            }
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
        if let Some(damage) = self.store.damage.take() {
            self.say(damage);
        }
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
        let total = self.store.count.map(|count| format!(" of {count}"));
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
}

impl<T: StepTool> Stepper<'_, T> {
    /// Takes a key as an answer, else for the tool, else for itself.
    fn key(&mut self, key: Key, tool: &mut T) -> anyhow::Result<()> {
        if let Some((_, then)) = self.choice.take() {
            then(tool, key, self);
            return Ok(());
        }
        if let Some(mut line) = self.line.take() {
            match key {
                Press(Enter) => {
                    (line.then)(tool, line.text.trim().to_owned(), self);
                    return Ok(());
                }
                Press(Esc) => return Ok(()),
                Press(Backspace) => drop(line.text.pop()),
                Press(Char(c)) if !c.is_control() && line.text.chars().count() < MAX_CHARACTERS => {
                    line.text.push(c);
                }
                _ => {}
            }
            self.line = Some(line);
            return Ok(());
        }
        // Any key leaves the help.
        if std::mem::take(&mut self.help) || tool.key(key, self)? {
            return Ok(());
        }
        match key {
            Press(Char(',')) => self.step(-1),
            Press(Char('.')) => self.step(1),
            Press(Char('<')) => self.step(-10),
            Press(Char('>')) => self.step(10),
            Press(Char('g')) => self.ask("go to frame", String::new(), "", Self::jump),
            Press(Char('?')) => self.help = true,
            Press(Char(' ')) => self.due = self.due.is_none().then(Instant::now),
            Press(Char('q')) => self.quit(),
            Press(Char(c)) => self.say(format!("'{c}' does nothing here; ? shows the keys")),
            _ => {}
        }
        Ok(())
    }

    fn draw(&self, tool: &mut T, shades: bool, screen: &mut ratatui::Frame<'_>) {
        let area = screen.area();
        if area.width < screen::MIN_SIZE.width || area.height < screen::MIN_SIZE.height {
            let words = format!("make the terminal at least {} characters", screen::MIN_SIZE);
            return screen.render_widget(Paragraph::new(words), area);
        }
        let rows = Layout::vertical([Length(1), Fill(1), Length(1), Length(1)]);
        let [title, middle, message, keys] = rows.areas(area);
        let line = |words: &str| Paragraph::new(printable_line(words));
        screen.render_widget(line(&self.title()).reversed(), title);
        let mut canvas = ToolCanvas {
            screen,
            area: middle,
            shades,
        };
        tool.draw(self, &mut canvas);
        let words = match (&self.choice, &self.line) {
            (Some((question, _)), _) => question.clone(),
            (None, Some(line)) if line.text.is_empty() && !line.hint.is_empty() => {
                format!("{}: _ ({})", line.question, line.hint)
            }
            (None, Some(line)) => format!("{}: {}_", line.question, line.text),
            (None, None) => self.message.clone(),
        };
        screen.render_widget(line(&words), message);
        screen.render_widget(line(T::HINT).reversed(), keys);
        if self.help {
            let lines = KEYS.iter().chain(T::KEYS);
            let lines = lines.map(|(key, does)| format!(" {key:<14} {does}"));
            let text = Text::from_iter(lines);
            let size = [text.width() + 3, text.height() + 2].map(|side| Length(side as u16));
            let place = area.centered(size[0], size[1]);
            screen.render_widget(Clear, place);
            let frame = Block::bordered().title(" keys; any key closes this ");
            screen.render_widget(Paragraph::new(text).block(frame), place);
        }
    }
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
    pub(crate) fn run<T: StepTool>(
        mut self,
        stepper: &mut Stepper<'_, T>,
        tool: &mut T,
    ) -> anyhow::Result<Ended> {
        let mut screen = match self.0 {
            Keys::Script(_) => Screen::in_memory()?,
            Keys::Terminal => Screen::from_terminal()?,
        };
        listen_for_interrupt();
        let (shades, is_script) = (screen.has_shades(), matches!(self.0, Keys::Script(_)));
        let mut changed = true;
        while !stepper.quits {
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
                    stepper.key(key, tool)?;
                    tool.acted(stepper)?;
                }
            }
        }
        Ok(Ended::Quit)
    }
}
