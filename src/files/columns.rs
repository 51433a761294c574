//! The columns of a table: their text, and their places by their names.

use std::cell::Cell;
use std::collections::HashMap;

/// A value in a column of a row.
#[derive(serde::Serialize)]
#[serde(untagged)]
pub enum ColumnValue<'a> {
    Text(&'a str),
    Whole(Option<u64>),
    Real(Option<f64>),
    Flag(Option<bool>),
}

/// Rows as the text of a CSV file.
pub struct TableText(csv::Writer<Vec<u8>>);

impl Default for TableText {
    fn default() -> Self {
        let mut builder = csv::WriterBuilder::new();
        Self(builder.has_headers(false).from_writer(Vec::new()))
    }
}

impl TableText {
    /// Adds a row, the names of the columns before all others.
    ///
    /// # Errors
    /// It has another number of columns than the first since the last [`TableText::take`].
    pub fn push(&mut self, row: &[ColumnValue<'_>]) -> csv::Result<()> {
        self.0.serialize(row)
    }

    /// Number of bytes that can be taken, but for the last few thousand.
    pub fn bytes(&self) -> usize {
        self.0.get_ref().len()
    }

    /// Takes the bytes since the last call.
    pub fn take(&mut self) -> Vec<u8> {
        let text = std::mem::take(self).0.into_inner();
        text.expect("memory takes all")
    }
}

/// The index of each column by name.
#[derive(Clone, Debug)]
pub struct ColumnPlaces {
    places: HashMap<String, usize>,
    names: Vec<String>,
    /// The column that is probably asked for next: the one behind the last.
    next: Cell<usize>,
}

impl ColumnPlaces {
    /// If two columns have one name, the first is used.
    pub fn new(heads: &csv::StringRecord) -> Self {
        let mut places = HashMap::new();
        for (place, head) in heads.iter().enumerate() {
            places.entry(head.to_owned()).or_insert(place);
        }
        let name = |(place, head): (usize, &str)| match places[head] == place {
            true => head.to_owned(),
            // The second of a name is never found.
            false => String::new(),
        };
        Self {
            names: heads.iter().enumerate().map(name).collect(),
            places,
            next: Cell::new(0),
        }
    }

    /// The cell of a line in that column.
    pub fn cell<'a>(&self, line: &'a csv::StringRecord, column: &str) -> Option<&'a str> {
        let next = self.next.get();
        let place = match self.names.get(next) {
            Some(name) if name == column => next,
            _ => *self.places.get(column)?,
        };
        self.next.set(place + 1);
        line.get(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_two_columns_of_a_name_counts() {
        let places = ColumnPlaces::new(&csv::StringRecord::from(vec!["a", "b", "a"]));
        let line = csv::StringRecord::from(vec!["1", "2", "3"]);
        let cells = ["a", "b", "c"].map(|column| places.cell(&line, column));
        assert_eq!(cells, [Some("1"), Some("2"), None]);
    }
}
