//! XML as a tree of names and values. Attributes and elements are treated the same; elements with
//! the same name become a list.
//!
//! Names are not validated: the example in annex E has attributes called `x(0,0)`, which XML does
//! not allow.

use crate::yaml::{MAX_DEPTH, MarkupFault, YamlNode as Node};
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use std::collections::BTreeMap;

/// The content of the outermost element.
///
/// # Errors
/// The reason, with its position in bytes.
pub(super) fn parse(text: &str) -> Result<Node, MarkupFault> {
    let mut reader = Reader::from_str(text);
    let mut open: Vec<OpenElement> = Vec::new();
    let mut root = None;
    loop {
        let event = reader.read_event();
        let event = event.map_err(|e| MarkupFault::from(e).at("byte", reader.error_position()))?;
        let at = |fault: MarkupFault| fault.at("byte", reader.buffer_position());
        let closed = match event {
            Event::Start(_) if open.len() == MAX_DEPTH => {
                return Err(at(MarkupFault::Depth("calibration")));
            }
            Event::Start(start) => {
                open.push(OpenElement::new(&start).map_err(at)?);
                None
            }
            Event::Empty(start) => Some(OpenElement::new(&start).map_err(at)?),
            Event::End(_) => open.pop(),
            Event::Text(text) => {
                if let Some(element) = open.last_mut() {
                    element.text.push_str(&text);
                }
                None
            }
            Event::Eof => break,
            _ => None,
        };
        if let Some(element) = closed {
            match open.last_mut() {
                Some(outer) => outer.take(element),
                None if root.is_some() => return Err(at(MarkupFault::Second("outermost element"))),
                None => root = Some(element.node()),
            }
        }
    }
    match open.pop() {
        Some(element) => Err(MarkupFault::Open(element.name)),
        None => root.ok_or(MarkupFault::Empty("contains no XML element")),
    }
}

/// An element whose end tag has not been read.
struct OpenElement {
    name: String,
    table: BTreeMap<String, Node>,
    text: String,
}

impl OpenElement {
    fn new(start: &BytesStart<'_>) -> Result<Self, MarkupFault> {
        let name = start.name().0.to_owned();
        let mut table = BTreeMap::new();
        // The library's check for duplicate names is quadratic; the map below finds them too.
        for attribute in start.attributes().with_checks(false) {
            let attribute = attribute.map_err(|e| MarkupFault::Attributes(name.clone(), e))?;
            let key = attribute.key.0.to_owned();
            let value = Node::Value(attribute.value.into_owned());
            if table.insert(key.clone(), value).is_some() {
                return Err(MarkupFault::Twice(format!("<{name}> has '{key}'")));
            }
        }
        Ok(Self {
            name,
            table,
            text: String::new(),
        })
    }

    fn take(&mut self, element: Self) {
        let (name, node) = (element.name.clone(), element.node());
        match self.table.get_mut(&name) {
            None => drop(self.table.insert(name, node)),
            Some(Node::List(list)) => list.push(node),
            Some(first) => {
                let earlier = std::mem::replace(first, Node::List(Vec::new()));
                *first = Node::List(vec![earlier, node]);
            }
        }
    }

    fn node(self) -> Node {
        if self.table.is_empty() {
            Node::Value(self.text)
        } else {
            Node::Table(self.table)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_elements_and_texts() {
        let text = "<?xml version=\"1.0\"?>\n<r><c a=\"1\"/><c a=\"2\"/><!-- --><d \
                    x(0,0)=\"3\"y=\"4\"/><e> 5 6 </e></r>\n";
        let Node::Table(root) = parse(text).unwrap() else {
            panic!()
        };
        let table = |pairs: &[(&str, &str)]| {
            Node::Table(
                pairs
                    .iter()
                    .map(|(k, v)| ((*k).to_owned(), Node::Value((*v).to_owned())))
                    .collect(),
            )
        };
        assert_eq!(
            root["c"],
            Node::List(vec![table(&[("a", "1")]), table(&[("a", "2")])])
        );
        assert_eq!(root["d"], table(&[("x(0,0)", "3"), ("y", "4")]));
        assert_eq!(root["e"], Node::Value(" 5 6 ".into()));
    }

    #[test]
    fn invalid_xml_is_refused() {
        for (text, word) in [
            ("<a><b></a>", "not XML"),
            ("<a><b x=\"1\"/>", "ends inside <a>"),
            ("<a x=\"1\" x=\"2\"/>", "'x' twice"),
            ("<a x=1/>", "attributes"),
            ("<a/><b/>", "second"),
            ("<!-- -->", "no XML element"),
            ("<a", "not XML"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(
                error.contains(word) && !error.contains('\n'),
                "{text}: {error}"
            );
        }
        let nested = parse(&"<a>".repeat(100_000)).unwrap_err().to_string();
        assert!(nested.contains("levels"), "{nested}");
    }
}
