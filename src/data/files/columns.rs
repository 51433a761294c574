//! The columns of a table by their names.

use std::collections::HashMap;

/// The index of each column by name.
#[derive(Clone, Debug)]
pub struct ColumnPlaces(HashMap<String, usize>);

impl ColumnPlaces {
    /// If two columns have one name, the first is used.
    pub fn new(heads: &csv::StringRecord) -> Self {
        let mut places = HashMap::new();
        for (place, head) in heads.iter().enumerate() {
            places.entry(head.to_owned()).or_insert(place);
        }
        Self(places)
    }

    /// The cell of a line in that column.
    pub fn cell<'a>(&self, line: &'a csv::StringRecord, column: &str) -> Option<&'a str> {
        line.get(*self.0.get(column)?)
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
