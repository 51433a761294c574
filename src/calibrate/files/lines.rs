//! `NAME=values` or `NAME: values`, line by line.

use crate::yaml::Node;
use std::collections::BTreeMap;

/// Lines without the mark are passed over, and of two of one name the second.
pub(super) fn parse(text: &str, mark: char) -> Node {
    let mut table = BTreeMap::new();
    for (name, value) in text.lines().filter_map(|line| line.split_once(mark)) {
        table
            .entry(name.trim().to_owned())
            .or_insert_with(|| Node::Value(value.trim().to_owned()));
    }
    Node::Table(table)
}
