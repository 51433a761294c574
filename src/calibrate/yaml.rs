//! A subset of YAML for calibrations and bags: aliases and deep nesting are rejected, tags are
//! ignored.

use quick_xml::events::attributes::AttrError;
use saphyr_parser::{Event, Parser, ScanError};
use std::collections::BTreeMap;

/// Limit on nesting; bags have up to nine levels, calibrations four.
pub(crate) const MAX_DEPTH: usize = 16;

/// A scalar as text, a sequence, or a mapping.
#[derive(Clone, Debug, PartialEq)]
pub enum YamlNode {
    Value(String),
    List(Vec<YamlNode>),
    Table(BTreeMap<String, YamlNode>),
}

/// Fault in a text of YAML or XML.
#[derive(Debug, thiserror::Error)]
pub enum MarkupFault {
    #[error("line {}: is not YAML: {}", .0.marker().line(), .0.info())]
    Yaml(#[from] ScanError),
    #[error("is not XML: {0}")]
    Xml(#[from] quick_xml::Error),
    /// The unit of its place, the place, and the fault there.
    #[error("{0} {1}: {2}")]
    At(&'static str, u64, #[source] Box<Self>),
    #[error("an alias (*), which is not read; write the value itself")]
    Alias,
    #[error("more than {MAX_DEPTH} levels, which no {0} has")]
    Depth(&'static str),
    #[error("a second {0}")]
    Second(&'static str),
    #[error("a key that is a list or a table")]
    Key,
    #[error("{0} twice")]
    Twice(String),
    #[error("<{0}> has attributes that are not XML: {1}")]
    Attributes(String, #[source] AttrError),
    #[error("ends inside <{0}>; is the file complete?")]
    Open(String),
    #[error("{0}")]
    Empty(&'static str),
}

impl MarkupFault {
    /// The same at a place.
    pub(crate) fn at(self, unit: &'static str, place: u64) -> Self {
        Self::At(unit, place, Box::new(self))
    }
}

/// # Errors
/// The fault, with its line.
pub fn parse(text: &str) -> Result<YamlNode, MarkupFault> {
    // OpenCV's first line, `%YAML:1.0`, is not a YAML directive; it becomes a comment.
    let comment = text.strip_prefix('%').map(|rest| format!("#{rest}"));
    let mut tree = Tree::default();
    for event in Parser::new_from_str(comment.as_deref().unwrap_or(text)) {
        let (event, span) = event?;
        let added = tree.add(event);
        added.map_err(|fault| fault.at("line", span.start.line() as u64))?;
    }
    tree.root.ok_or(MarkupFault::Empty("holds no YAML"))
}

/// The tree built so far from parser events.
#[derive(Default)]
struct Tree {
    root: Option<YamlNode>,
    open: Vec<OpenNode>,
}

/// A sequence or mapping that is still open, with the key that waits for its value.
enum OpenNode {
    List(Vec<YamlNode>),
    Table(BTreeMap<String, YamlNode>, Option<String>),
}

impl Tree {
    fn add(&mut self, event: Event<'_>) -> Result<(), MarkupFault> {
        match event {
            Event::Alias(_) => Err(MarkupFault::Alias),
            Event::Scalar(text, ..) => self.put(YamlNode::Value(text.into_owned())),
            Event::SequenceStart(..) => self.open(OpenNode::List(Vec::new())),
            Event::MappingStart(..) => self.open(OpenNode::Table(BTreeMap::new(), None)),
            Event::SequenceEnd | Event::MappingEnd => match self.open.pop() {
                Some(OpenNode::List(list)) => self.put(YamlNode::List(list)),
                Some(OpenNode::Table(table, _)) => self.put(YamlNode::Table(table)),
                None => Ok(()),
            },
            Event::Nothing | Event::StreamStart | Event::StreamEnd => Ok(()),
            Event::DocumentStart(_) | Event::DocumentEnd => Ok(()),
        }
    }

    fn open(&mut self, open: OpenNode) -> Result<(), MarkupFault> {
        // Bounded before nodes are built: recursion on drop would overflow the stack.
        if self.open.len() == MAX_DEPTH {
            return Err(MarkupFault::Depth("file that svl reads"));
        }
        self.open.push(open);
        Ok(())
    }

    fn put(&mut self, node: YamlNode) -> Result<(), MarkupFault> {
        match self.open.last_mut() {
            None if self.root.is_some() => {
                return Err(MarkupFault::Second("document, expected one"));
            }
            None => self.root = Some(node),
            Some(OpenNode::List(list)) => list.push(node),
            Some(OpenNode::Table(table, key)) => match (key.take(), node) {
                (None, YamlNode::Value(name)) => *key = Some(name),
                (None, _) => return Err(MarkupFault::Key),
                (Some(name), node) => {
                    // YAML forbids duplicate keys; most parsers silently use the last.
                    if table.insert(name.clone(), node).is_some() {
                        return Err(MarkupFault::Twice(format!("'{name}' occurs")));
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
            let YamlNode::Table(root) = parse(&text).unwrap() else {
                panic!()
            };
            let YamlNode::Table(matrix) = &root["K"] else {
                panic!()
            };
            let values = ["1.", "-2.5e-01", ".5"].map(|v| YamlNode::Value(v.into()));
            assert_eq!(matrix["data"], YamlNode::List(values.into()), "{header:?}");
        }
    }

    #[test]
    fn needless_syntax_is_refused_with_its_line() {
        let bomb = "a: &a [1, 1]\nb: &b [*a, *a]\n";
        let wrong = |text: &str| parse(text).unwrap_err().to_string();
        assert!(wrong(bomb).starts_with("line 2: an alias"));
        for (open, close) in [("[", "]"), ("{a: ", "}")] {
            let nested = |levels| format!("{}1{}", open.repeat(levels), close.repeat(levels));
            assert!(parse(&nested(16)).is_ok());
            assert!(wrong(&nested(17)).contains("levels"));
            assert!(parse(&nested(100_000)).is_err());
        }
        assert!(wrong("a: 1\na: 2").contains("'a' occurs twice"));
        assert!(wrong("a: [1, 2").starts_with("line "));
        assert!(wrong("").contains("no YAML"));
        assert!(wrong("---\na: 1\n---\nb: 2\n").contains("second"));
    }
}
