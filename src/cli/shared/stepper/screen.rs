//! The screen of a tool: the terminal, or for a script a screen in memory.

use crate::cli::shared::log;
use crate::cli::shared::terminal::{allows_color, print};
use anyhow::Context;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{DisableMouseCapture, EnableMouseCapture};
use ratatui::crossterm::{execute, terminal::size};
use ratatui::layout::Size;
use ratatui::{DefaultTerminal, Frame, Terminal};
use std::io::{IsTerminal, stdin, stdout};
use svl::printable_line;

/// Smallest screen that a tool can be drawn on.
pub(crate) const MIN_SIZE: Size = Size::new(60, 16);

/// The screen of a script, unless it says otherwise.
const SCRIPTED: Size = Size::new(80, 24);

/// The screen that a tool is drawn on.
pub(crate) enum Screen {
    Terminal(DefaultTerminal),
    Memory(Terminal<TestBackend>),
}

impl Screen {
    /// # Errors
    /// There is no terminal, or it is too small; in a line, with the cure.
    pub(crate) fn check_terminal() -> anyhow::Result<()> {
        if !(stdin().is_terminal() && stdout().is_terminal()) {
            anyhow::bail!(
                "needs a terminal, and standard input or output is not one; run it in one, or give \
                 the keys with --script FILE"
            );
        }
        let (columns, rows) = size().context("the terminal's size is not known")?;
        let Size { width, height } = MIN_SIZE;
        if columns < width || rows < height {
            anyhow::bail!(
                "the terminal has {columns}x{rows} characters, too few; make it at least \
                 {width}x{height}"
            );
        }
        Ok(())
    }

    /// Takes the terminal, which is restored when the screen is dropped, and before the message of
    /// a panic.
    pub(crate) fn from_terminal() -> anyhow::Result<Self> {
        log::hold();
        let taken = ratatui::try_init().and_then(|terminal| {
            execute!(stdout(), EnableMouseCapture)?;
            Ok(Self::Terminal(terminal))
        });
        if taken.is_err() {
            restore();
        }
        taken.context("the terminal cannot be used")
    }

    /// A screen in memory, of 80x24 characters until [`Screen::resize`].
    pub(crate) fn in_memory() -> anyhow::Result<Self> {
        let backend = TestBackend::new(SCRIPTED.width, SCRIPTED.height);
        Ok(Self::Memory(Terminal::new(backend)?))
    }

    /// True if shades can be shown; else characters replace them.
    pub(crate) fn has_shades(&self) -> bool {
        matches!(self, Self::Terminal(_)) && allows_color()
    }

    /// Redraws the screen, of another size where it is in memory.
    pub(crate) fn resize(&mut self, columns: u16, rows: u16) -> anyhow::Result<()> {
        match self {
            Self::Terminal(terminal) => terminal.clear()?,
            Self::Memory(terminal) => {
                // At least a character: an empty screen cannot be drawn on.
                let [columns, rows] = [columns, rows].map(|side| side.clamp(1, 500));
                terminal.backend_mut().resize(columns, rows);
            }
        }
        Ok(())
    }

    pub(crate) fn draw(&mut self, draw: impl FnOnce(&mut Frame<'_>)) -> anyhow::Result<()> {
        let draw = |canvas: &mut Frame<'_>| {
            draw(canvas);
            // Names from outside are in any widget, and a cell has no room for an escaped one.
            for cell in &mut canvas.buffer_mut().content {
                if printable_line(cell.symbol()) != cell.symbol() {
                    cell.set_symbol("?");
                }
            }
        };
        match self {
            Self::Terminal(terminal) => {
                let drawn = terminal.draw(draw);
                drawn.context("the terminal cannot be written to")?;
            }
            Self::Memory(terminal) => {
                terminal.draw(draw)?;
            }
        }
        Ok(())
    }

    /// Prints what a screen in memory shows, without colours: a line for each row.
    pub(crate) fn print(&self) -> anyhow::Result<()> {
        let Self::Memory(terminal) = self else {
            return Ok(());
        };
        let buffer = terminal.backend().buffer();
        let rows = buffer.content().chunks(buffer.area.width.max(1).into());
        let lines = rows.map(|row| {
            let line: String = row.iter().map(|cell| cell.symbol()).collect();
            line.trim_end().to_owned() + "\n"
        });
        print(&lines.collect::<String>())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if matches!(self, Self::Terminal(_)) {
            restore();
        }
    }
}

/// Leaves the terminal as it was. Where that fails, the terminal is gone.
fn restore() {
    let _ = execute!(stdout(), DisableMouseCapture);
    // The hook of a panic has left the screen before its message.
    if !std::thread::panicking() {
        let _ = ratatui::try_restore();
    }
    log::release();
}
