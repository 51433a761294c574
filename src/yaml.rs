//! YAML without what no calibration and no bag needs: aliases and deep nesting are refused, tags
//! are passed over.

use saphyr_parser::{Event, Parser};
use std::collections::BTreeMap;

/// Deepest nesting; the deepest bag has nine levels, the deepest calibration four.
pub(crate) const MAX_DEPTH: usize = 16;

/// Text of a value, a list, or named values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Node {
    Value(String),
    List(Vec<Node>),
    Table(BTreeMap<String, Node>),
}

/// # Errors
/// What is wrong, with its line.
pub(crate) fn parse(text: &str) -> Result<Node, String> {
    // OpenCV's first line, `%YAML:1.0`, is no YAML; as a comment it does no harm.
    let text = match text.strip_prefix('%') {
        Some(rest) => format!("#{rest}"),
        None => text.to_owned(),
    };
    let mut tree = Tree::default();
    for event in Parser::new_from_str(&text) {
        let (event, span) =
            event.map_err(|e| format!("line {}: is no YAML: {}", e.marker().line(), e.info()))?;
        tree.add(event)
            .map_err(|reason| format!("line {}: {reason}", span.start.line()))?;
    }
    tree.root.ok_or_else(|| "holds no YAML".into())
}

/// A tree that grows with the events.
#[derive(Default)]
struct Tree {
    root: Option<Node>,
    open: Vec<Open>,
}

/// A node whose end is still to come.
enum Open {
    List(Vec<Node>),
    Table(BTreeMap<String, Node>, Option<String>),
}

impl Tree {
    fn add(&mut self, event: Event<'_>) -> Result<(), String> {
        match event {
            Event::Alias(_) => {
                Err("an alias (*), which is not read; write the value itself".into())
            }
            Event::Scalar(text, ..) => self.put(Node::Value(text.into_owned())),
            Event::SequenceStart(..) => self.open(Open::List(Vec::new())),
            Event::MappingStart(..) => self.open(Open::Table(BTreeMap::new(), None)),
            Event::SequenceEnd | Event::MappingEnd => match self.open.pop() {
                Some(Open::List(list)) => self.put(Node::List(list)),
                Some(Open::Table(table, _)) => self.put(Node::Table(table)),
                None => Ok(()),
            },
            Event::Nothing | Event::StreamStart | Event::StreamEnd => Ok(()),
            Event::DocumentStart(_) | Event::DocumentEnd => Ok(()),
        }
    }

    fn open(&mut self, open: Open) -> Result<(), String> {
        if self.open.len() == MAX_DEPTH {
            return Err(format!(
                "more than {MAX_DEPTH} levels, which no file that svl reads has"
            ));
        }
        self.open.push(open);
        Ok(())
    }

    fn put(&mut self, node: Node) -> Result<(), String> {
        match self.open.last_mut() {
            None if self.root.is_some() => return Err("a second document, expected one".into()),
            None => self.root = Some(node),
            Some(Open::List(list)) => list.push(node),
            Some(Open::Table(table, key)) => match (key.take(), node) {
                (None, Node::Value(name)) => *key = Some(name),
                (None, _) => return Err("a key that is a list or a table".into()),
                (Some(name), node) => {
                    if table.insert(name.clone(), node).is_some() {
                        return Err(format!("'{name}' stands twice"));
                    }
                }
            },
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_and_tags_of_opencv_are_passed_over() {
        for header in [
            "%YAML:1.0\n",
            "%YAML:1.0\n---\n",
            "%YAML 1.2\n---\n# said\n",
            "",
        ] {
            let text = format!(
                "{header}K: !!opencv-matrix\n   rows: 1\n   data: [ 1., -2.5e-01,\n       .5 ]\n"
            );
            let Node::Table(root) = parse(&text).unwrap() else {
                panic!()
            };
            let Node::Table(matrix) = &root["K"] else {
                panic!()
            };
            let values = ["1.", "-2.5e-01", ".5"].map(|v| Node::Value(v.into()));
            assert_eq!(matrix["data"], Node::List(values.into()), "{header:?}");
        }
    }

    #[test]
    fn what_no_file_needs_is_refused_with_its_line() {
        let bomb = "a: &a [1, 1]\nb: &b [*a, *a]\n";
        assert!(parse(bomb).unwrap_err().starts_with("line 2: an alias"));
        for (open, close) in [("[", "]"), ("{a: ", "}")] {
            let nested = |levels| format!("{}1{}", open.repeat(levels), close.repeat(levels));
            assert!(parse(&nested(16)).is_ok());
            assert!(parse(&nested(17)).unwrap_err().contains("levels"));
            assert!(parse(&nested(100_000)).is_err());
        }
        assert!(
            parse("a: 1\na: 2")
                .unwrap_err()
                .contains("'a' stands twice")
        );
        assert!(parse("a: [1, 2").unwrap_err().starts_with("line "));
        assert!(parse("").unwrap_err().contains("no YAML"));
        assert!(
            parse("---\na: 1\n---\nb: 2\n")
                .unwrap_err()
                .contains("second")
        );
    }
}
