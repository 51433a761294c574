//! Keys: from the terminal, or from a script.

use self::Key::Press;
use crate::cli::shared::usage::two;
use anyhow::{Context, bail};
use ratatui::crossterm::event::KeyCode::{self, Char};
use ratatui::crossterm::event::{
    self, Event, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind,
};
use std::path::Path;
use std::time::{Duration, Instant};

/// A key that was pressed, or a tick where none was for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Key {
    Press(KeyCode),
    /// Left and right with Shift.
    FarLeft,
    FarRight,
    /// Ctrl-R.
    Redo,
    /// Ctrl-C.
    Interrupt,
    /// The left mouse button, on that column and row of the screen.
    Click(u16, u16),
    /// The wheel of the mouse.
    ScrollUp,
    ScrollDown,
    /// The terminal has that many columns and rows now, or has to be redrawn.
    Resize(u16, u16),
    /// Nothing: time goes on.
    Tick,
    /// A script asks for the screen as it is.
    Screen,
    /// A script waits until nothing is under way.
    Wait,
    /// There is no more input.
    Closed,
}

/// The keys of a script by their names; any other character is its own name.
const NAMES: &[(&str, Key)] = &[
    ("space", Press(Char(' '))),
    ("enter", Press(KeyCode::Enter)),
    ("esc", Press(KeyCode::Esc)),
    ("backspace", Press(KeyCode::Backspace)),
    ("delete", Press(KeyCode::Delete)),
    ("left", Press(KeyCode::Left)),
    ("right", Press(KeyCode::Right)),
    ("up", Press(KeyCode::Up)),
    ("down", Press(KeyCode::Down)),
    ("shift-left", Key::FarLeft),
    ("shift-right", Key::FarRight),
    ("tab", Press(KeyCode::Tab)),
    ("ctrl-r", Key::Redo),
    ("ctrl-c", Key::Interrupt),
    ("tick", Key::Tick),
    ("scroll-up", Key::ScrollUp),
    ("scroll-down", Key::ScrollDown),
    ("wait", Key::Wait),
    ("screen", Key::Screen),
];

/// Largest script that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Source of keys.
pub(crate) enum Keys {
    Terminal,
    Script(std::vec::IntoIter<Key>),
}

impl Keys {
    /// A script: one token per key, white space between them, lines that begin with `# ` ignored. A
    /// token is a character, one of [`NAMES`], `click:COLUMN,ROW`, `resize:COLUMNSxROWS`, or
    /// `"text"`, which types each of its characters.
    pub(crate) fn script(path: &Path) -> anyhow::Result<Self> {
        let text = svl::files::read_text(path, MAX_BYTES)?;
        let mut keys = Vec::new();
        for (number, line) in text.lines().enumerate() {
            if line.trim() == "#" || line.starts_with("# ") {
                continue;
            }
            for token in line.split_whitespace() {
                let place = || format!("{}: line {}", path.display(), number + 1);
                parse(token, &mut keys).with_context(place)?;
            }
        }
        Ok(Self::Script(keys.into_iter()))
    }

    /// The next key, for which it waits at most `wait`.
    pub(crate) fn next(&mut self, wait: Duration) -> anyhow::Result<Key> {
        match self {
            Self::Script(keys) => Ok(keys.next().unwrap_or(Key::Closed)),
            Self::Terminal => terminal_key(wait).context("the terminal cannot be read"),
        }
    }
}

/// The next key of the terminal. A closed terminal is noticed here: crossterm would read its end
/// again and again.
fn terminal_key(wait: Duration) -> std::io::Result<Key> {
    let until = Instant::now() + wait;
    let mut left = Duration::ZERO;
    loop {
        if is_closed_within(left)? {
            return Ok(Key::Closed);
        }
        while event::poll(Duration::ZERO)? {
            if let Some(key) = key(event::read()?) {
                return Ok(key);
            }
        }
        left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(Key::Tick);
        }
    }
}

/// True if the terminal is closed. Waits until it is, or has input, or a signal comes.
#[cfg(unix)]
fn is_closed_within(wait: Duration) -> std::io::Result<bool> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::io::Errno;
    let stdin = std::io::stdin();
    let mut polled = [PollFd::new(&stdin, PollFlags::IN)];
    let wait = Timespec::try_from(wait).map_err(std::io::Error::other)?;
    match poll(&mut polled, Some(&wait)) {
        Ok(_) => Ok(polled[0]
            .revents()
            .intersects(PollFlags::HUP | PollFlags::ERR)),
        // A change of the terminal's size is a signal, too.
        Err(Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// False: a console of Windows that is closed ends its programs.
#[cfg(not(unix))]
fn is_closed_within(wait: Duration) -> std::io::Result<bool> {
    event::poll(wait).map(|_| false)
}

/// The key of a terminal's event; none for events without a meaning here.
fn key(event: Event) -> Option<Key> {
    let pressed = match event {
        Event::Key(event) if event.kind != KeyEventKind::Release => event,
        Event::Mouse(event) => {
            return match event.kind {
                MouseEventKind::Down(MouseButton::Left) => {
                    Some(Key::Click(event.column, event.row))
                }
                MouseEventKind::ScrollUp => Some(Key::ScrollUp),
                MouseEventKind::ScrollDown => Some(Key::ScrollDown),
                _ => None,
            };
        }
        Event::Resize(columns, rows) => return Some(Key::Resize(columns, rows)),
        _ => return None,
    };
    let is_control = pressed.modifiers.contains(KeyModifiers::CONTROL);
    let is_shifted = pressed.modifiers.contains(KeyModifiers::SHIFT);
    match pressed.code {
        Char('c' | 'C') if is_control => Some(Key::Interrupt),
        // The size is asked for where it is used.
        Char('l' | 'L') if is_control => Some(Key::Resize(0, 0)),
        Char('r' | 'R') if is_control => Some(Key::Redo),
        _ if is_control => None,
        KeyCode::Left if is_shifted => Some(Key::FarLeft),
        KeyCode::Right if is_shifted => Some(Key::FarRight),
        Char(c) => Some(Press(Char(c))),
        code => {
            let mut named = NAMES.iter().map(|(_, key)| *key);
            named.find(|key| *key == Press(code))
        }
    }
}

fn parse(token: &str, keys: &mut Vec<Key>) -> anyhow::Result<()> {
    let mut characters = token.chars();
    if let (Some(only), None) = (characters.next(), characters.next()) {
        keys.push(Press(Char(only)));
    } else if let Some((_, key)) = NAMES.iter().find(|(name, _)| *name == token) {
        keys.push(*key);
    } else if let Some(text) = token.strip_prefix('"').and_then(|t| t.strip_suffix('"')) {
        keys.extend(text.chars().map(|c| Press(Char(c))));
    } else if let Some((column, row)) = token.strip_prefix("click:").and_then(|t| two(t, ',')) {
        keys.push(Key::Click(column, row));
    } else if let Some((w, h)) = token.strip_prefix("resize:").and_then(|t| two(t, 'x')) {
        keys.push(Key::Resize(w, h));
    } else {
        let names: Vec<_> = NAMES.iter().map(|(name, _)| *name).collect();
        bail!(
            "'{token}' is not a key; expected a character, \"text\", click:COLUMN,ROW, \
             resize:COLUMNSxROWS or one of {}",
            names.join(", ")
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn script(text: &str) -> anyhow::Result<Vec<Key>> {
        let file = tempfile::NamedTempFile::new()?;
        std::fs::write(file.path(), text)?;
        let mut keys = Keys::script(file.path())?;
        let mut all = Vec::new();
        loop {
            match keys.next(Duration::ZERO)? {
                Key::Closed => return Ok(all),
                key => all.push(key),
            }
        }
    }

    #[test]
    fn a_token_is_a_key() {
        let keys = script("# a comment\n. # right \"0.4\"\nclick:3,4 resize:80x24\n").unwrap();
        let typed = ['0', '.', '4'].map(|c| Press(Char(c)));
        let mut expected = vec![Press(Char('.')), Press(Char('#')), Press(KeyCode::Right)];
        expected.extend(typed);
        expected.extend([Key::Click(3, 4), Key::Resize(80, 24)]);
        assert_eq!(keys, expected);
    }

    #[test]
    fn invalid_keys_are_named_with_their_lines() {
        let error = format!("{:#}", script("enter\nclick:3 q").unwrap_err());
        assert!(
            error.contains("line 2: 'click:3' is not a key; expected"),
            "{error}"
        );
    }
}
