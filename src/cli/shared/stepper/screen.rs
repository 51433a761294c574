//! The screen of a tool: the terminal, or for a script a screen in memory.

use crate::cli::shared::log;
use crate::cli::shared::terminal::{allows_color, print};
use anyhow::Context;
use ratatui::backend::{CrosstermBackend, TestBackend};
use ratatui::buffer::Buffer;
use ratatui::crossterm::event::{DisableMouseCapture, EnableMouseCapture};
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode, size,
};
use ratatui::crossterm::{cursor, execute};
use ratatui::layout::Size;
use ratatui::{Frame, Terminal};
use std::io::{IsTerminal, Stdout, stdin, stdout};
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use svl::printable_line;

/// Smallest screen that a tool can be drawn on.
pub(crate) const MIN_SIZE: Size = Size::new(60, 16);

/// The screen of a script, unless it says otherwise.
const SCRIPTED: Size = Size::new(80, 24);

/// The screen that a tool is drawn on.
pub(crate) enum Screen {
    Terminal(Terminal<CrosstermBackend<Stdout>>),
    Memory(Terminal<TestBackend>),
}

/// True if the terminal is in raw mode, so that it is restored once.
static TAKEN: AtomicBool = AtomicBool::new(false);

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
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |panic| {
                restore();
                before(panic);
            }));
        });
        TAKEN.store(true, Ordering::Relaxed);
        log::hold();
        let taken = enable_raw_mode().and_then(|()| {
            execute!(
                stdout(),
                EnterAlternateScreen,
                EnableMouseCapture,
                cursor::Hide
            )?;
            Terminal::new(CrosstermBackend::new(stdout()))
        });
        if taken.is_err() {
            restore();
        }
        taken
            .map(Self::Terminal)
            .context("the terminal cannot be used")
    }

    /// A screen in memory, of 80x24 characters until [`Screen::resize`].
    pub(crate) fn in_memory() -> anyhow::Result<Self> {
        Ok(Self::Memory(Terminal::new(TestBackend::new(
            SCRIPTED.width,
            SCRIPTED.height,
        ))?))
    }

    /// True if shades can be shown; else characters replace them.
    pub(crate) fn has_shades(&self) -> bool {
        matches!(self, Self::Terminal(_)) && allows_color()
    }

    /// Redraws the screen, of another size where it is in memory.
    pub(crate) fn resize(&mut self, columns: u16, rows: u16) -> anyhow::Result<()> {
        match self {
            Self::Terminal(terminal) => Ok(terminal.clear()?),
            Self::Memory(terminal) => {
                // At least a character: an empty screen cannot be drawn on.
                terminal
                    .backend_mut()
                    .resize(columns.clamp(1, 500), rows.clamp(1, 500));
                Ok(())
            }
        }
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
            Self::Terminal(terminal) => terminal.draw(draw).map(|_| ()),
            Self::Memory(terminal) => return Ok(terminal.draw(draw).map(|_| ())?),
        }
        .context("the terminal cannot be written to")
    }

    /// Prints what a screen in memory shows, without colours.
    pub(crate) fn print(&self) -> anyhow::Result<()> {
        match self {
            Self::Terminal(_) => Ok(()),
            Self::Memory(terminal) => print(&text(terminal.backend().buffer())),
        }
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
    if TAKEN.swap(false, Ordering::Relaxed) {
        let _ = execute!(
            stdout(),
            DisableMouseCapture,
            LeaveAlternateScreen,
            cursor::Show
        );
        let _ = disable_raw_mode();
        log::release();
    }
}

/// The characters, a line for each row.
fn text(buffer: &Buffer) -> String {
    let mut text = String::new();
    for row in buffer
        .content()
        .chunks(usize::from(buffer.area.width).max(1))
    {
        let line: String = row.iter().map(|cell| cell.symbol()).collect();
        text += line.trim_end();
        text.push('\n');
    }
    text
}
