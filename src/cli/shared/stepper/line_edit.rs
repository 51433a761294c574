//! A line that is typed in answer to a question.

use super::keys::Key;
use std::fmt;

/// Largest number of characters that are taken.
const MAX_CHARACTERS: usize = 200;

/// A question, and as much of its answer as was typed.
pub(crate) struct LineEdit {
    question: String,
    text: String,
}

/// Result of a key for the answer.
pub(crate) enum Edited {
    Going,
    /// With the white space around it taken off.
    Done(String),
    Cancelled,
}

impl LineEdit {
    /// Begins with a text that may be changed.
    pub(crate) fn with(question: impl Into<String>, text: impl Into<String>) -> Self {
        let (question, text) = (question.into(), text.into());
        Self { question, text }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.text.is_empty()
    }

    /// Enter ends it, Escape cancels it.
    pub(crate) fn key(&mut self, key: Key) -> Edited {
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
        write!(f, "{}: {}_", self.question, self.text)
    }
}
