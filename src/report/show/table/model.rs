//! A table of texts and bars: one form for terminal, Markdown and HTML.
//!
//! [`Table::terminal`] and [`Table::markdown`] render it; a page gets it serialized and renders it
//! with the macro `table` of `tables.html`.

use crate::show::words::{NONE, ms};
use serde::Serialize;
use svl_core::printable_line;

/// A table whose first column names the rows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Table {
    /// May be empty.
    pub title: String,
    pub columns: Vec<TableColumn>,
    /// A cell per column each.
    pub rows: Vec<Vec<TableCell>>,
    /// Terms and their meanings.
    pub notes: Vec<(String, String)>,
}

/// A column of a kind of items: its group, its head, and its text of an item.
pub type TextColumn<T> = (&'static str, &'static str, fn(&T) -> String);

/// The head of a column.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TableColumn {
    /// Shown once above neighbours of the same group; may be empty.
    pub group: String,
    pub head: String,
    /// Aligned to the left.
    pub is_text: bool,
    /// The least of its numbers is the best.
    pub is_less_better: bool,
    /// Omitted where a terminal is too narrow for all columns.
    pub is_optional: bool,
}

/// The content of a row in a column.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TableCell {
    Text(String),
    /// A number that needs attention.
    Alert(String),
    /// Fractions of right and of wrong cells; the rest is unknown.
    Bar {
        right: f64,
        wrong: f64,
    },
    /// A difference with its interval, on pages: places between 0 and 100, 50 for no difference.
    Interval {
        low: f64,
        high: f64,
        value: f64,
    },
    /// A median time, ms, and its mark.
    Time {
        ms: f64,
        mark: String,
    },
    /// Per checkpoint the fraction of its frames that pass; absent if no frame shows it.
    Marks(Vec<Option<f64>>),
}

impl Table {
    /// A table without rows; `first` is the heading of the names of the rows.
    pub fn new(title: impl Into<String>, first: &str) -> Self {
        let empty = Self {
            title: title.into(),
            ..Self::default()
        };
        empty.with_texts([first])
    }

    /// Adds columns of numbers without groups.
    #[must_use]
    pub fn with_columns<T: Into<String>>(mut self, heads: impl IntoIterator<Item = T>) -> Self {
        let columns = heads.into_iter().map(|head| TableColumn::new("", head));
        self.columns.extend(columns);
        self
    }

    /// Adds columns of text without groups.
    #[must_use]
    pub fn with_texts<T: Into<String>>(mut self, heads: impl IntoIterator<Item = T>) -> Self {
        let columns = heads.into_iter().map(|head| TableColumn::text("", head));
        self.columns.extend(columns);
        self
    }

    /// A table with a row per item; the first column has their names.
    pub fn from_items<'a, T: 'a>(
        title: &str,
        columns: &[TextColumn<T>],
        items: impl IntoIterator<Item = &'a T>,
    ) -> Self {
        let heads = columns.iter();
        let heads = heads.map(|(group, head, _)| TableColumn::new(*group, *head));
        let row = |item: &T| {
            let cells = columns.iter().map(|(.., cell)| cell(item));
            cells.map(TableCell::Text).collect()
        };
        let mut table = Self {
            title: title.to_owned(),
            columns: heads.collect(),
            rows: items.into_iter().map(row).collect(),
            notes: Vec::new(),
        };
        table.columns[0].is_text = true;
        table
    }

    /// Adds a row of texts.
    pub fn push(&mut self, name: impl Into<String>, cells: impl IntoIterator<Item = String>) {
        let name = TableCell::Text(name.into());
        let cells = cells.into_iter().map(TableCell::Text);
        self.rows.push(std::iter::once(name).chain(cells).collect());
    }

    /// Adds a note.
    pub fn note(&mut self, term: impl Into<String>, meaning: impl Into<String>) {
        self.notes.push((term.into(), meaning.into()));
    }

    /// Adds notes, each as `term: meaning`.
    #[must_use]
    pub fn with_notes(mut self, notes: &[&str]) -> Self {
        let notes = notes.iter().filter_map(|note| note.split_once(": "));
        notes.for_each(|(term, meaning)| self.note(term, meaning));
        self
    }

    /// The table, if it has rows.
    pub fn if_any(self) -> Option<Self> {
        (!self.rows.is_empty()).then_some(self)
    }

    /// Removes the columns in which no row has a number.
    pub fn remove_empty_columns(&mut self) {
        let is_shown = |i: usize| i == 0 || self.rows.iter().any(|row| !row[i].is_none());
        let shown: Vec<_> = (0..self.columns.len()).map(is_shown).collect();
        self.keep(&shown);
    }

    /// Removes the optional columns if bars show the essential numbers.
    pub fn remove_optional_columns(&mut self) {
        let cells = self.rows.iter().flatten();
        let mut cells = cells.into_iter();
        let has_bars = cells.any(|c| matches!(c, TableCell::Bar { .. }));
        let columns = self.columns.iter();
        let shown: Vec<_> = columns.map(|c| !(has_bars && c.is_optional)).collect();
        self.keep(&shown);
    }

    /// The places of the columns without bars.
    pub(super) fn text_columns(&self) -> Vec<usize> {
        let is_bar = |row: &Vec<TableCell>, i: usize| matches!(row[i], TableCell::Bar { .. });
        let has_text = |i: &usize| !self.rows.iter().any(|row| is_bar(row, *i));
        (0..self.columns.len()).filter(has_text).collect()
    }

    /// Removes the columns that are not `shown`.
    pub(super) fn keep(&mut self, shown: &[bool]) {
        let mut places = shown.iter();
        self.columns.retain(|_| places.next() == Some(&true));
        for row in &mut self.rows {
            let mut places = shown.iter();
            row.retain(|_| places.next() == Some(&true));
        }
    }
}

impl TableColumn {
    /// A column of numbers.
    pub fn new(group: impl Into<String>, head: impl Into<String>) -> Self {
        Self {
            group: group.into(),
            head: head.into(),
            ..Self::default()
        }
    }

    /// A column of text.
    pub fn text(group: impl Into<String>, head: impl Into<String>) -> Self {
        Self {
            is_text: true,
            ..Self::new(group, head)
        }
    }
}

impl TableCell {
    fn is_none(&self) -> bool {
        matches!(self, Self::Text(text) if text == NONE || text.is_empty())
    }

    /// The cell without pictures.
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Text(text) | Self::Alert(text) => printable_line(text),
            Self::Time { ms: time_ms, mark } => ms(*time_ms) + mark,
            Self::Bar { .. } | Self::Interval { .. } => String::new(),
            Self::Marks(shares) => {
                let marks = shares.iter().map(|share| share.map_or('·', mark));
                let marks: Vec<_> = marks.map(String::from).collect();
                marks.join(" ")
            }
        }
    }
}

/// The fraction of frames that pass: full and empty circles are exact.
fn mark(share: f64) -> char {
    match share {
        ..=0.0 => '○',
        ..0.375 => '◔',
        ..0.625 => '◑',
        ..1.0 => '◕',
        _ => '●',
    }
}
