//! A line that is typed in answer to a question.

use super::keys::Key;
use std::fmt;

/// Largest number of characters that are taken.
const MAX_CHARACTERS: usize = 200;

/// A question, and as much of its answer as was typed.
pub(super) struct LineEdit {
    pub(super) question: String,
    /// May begin with a proposal.
    pub(super) text: String,
    /// Shown until something is typed.
    pub(super) hint: &'static str,
}

/// Result of a key for the answer.
pub(super) enum Edited {
    Going,
    /// With the white space around it taken off.
    Done(String),
    Cancelled,
}

impl LineEdit {
    /// Enter ends it, Escape cancels it.
    pub(super) fn key(&mut self, key: Key) -> Edited {
        match key {
            Key::Enter => return Edited::Done(self.text.trim().to_owned()),
            Key::Escape => return Edited::Cancelled,
            Key::Backspace => drop(self.text.pop()),
            Key::Char(c) if !c.is_control() && self.text.chars().count() < MAX_CHARACTERS => {
                self.text.push(c)
            }
            _ => {}
        }
        Edited::Going
    }
}

impl fmt::Display for LineEdit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}_", self.question, self.text)?;
        if self.text.is_empty() && !self.hint.is_empty() {
            write!(f, " ({})", self.hint)?;
        }
        Ok(())
    }
}
