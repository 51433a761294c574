//! A table of texts and bars: one form for terminal, Markdown and HTML.

pub(crate) mod markdown;
pub(crate) mod model;
pub(crate) mod terminal;

pub use super::words::NONE;
pub use markdown::escape_prose;
pub use model::{Table, TableCell, TableColumn, TextColumn};
pub use terminal::TerminalStyle;
