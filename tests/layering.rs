//! The structure of the sources: which room of `src/` may use which, no circles, no test file that
//! nothing runs, and the limits of style.

#[path = "layering/modules.rs"]
mod modules;
#[path = "layering/style.rs"]
mod style;

use modules::{Crate, Edge, Id};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The rooms in layers: a room uses those of the layers above its own.
const ORDER: [&[&str]; 11] = [
    &[
        "error",
        "interrupt",
        "timing",
        "yaml",
        "words",
        "statistics",
        "bounded",
        "pairing",
    ],
    &["stereo"],
    &["kernel"],
    &["depth", "files", "filter"],
    &[
        "matcher",
        "rectify",
        "calibrate",
        "arena",
        "overlay",
        "stress",
        "fetch",
    ],
    &["grab", "recording", "score", "manifest"],
    &["source", "sink", "report", "scenario"],
    &["run"],
    &["record", "train", "tune", "drive"],
    &["reproduce"],
    &["cli"],
];

/// Edges within a layer or against the order, with their reasons.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    (
        "bounded",
        "error",
        "reading beyond a limit is an error of the crate",
    ),
    (
        "recording",
        "manifest",
        "a recording's header holds the manifest of its run",
    ),
    (
        "scenario",
        "report",
        "a scenario's gate sets limits on the report's metrics",
    ),
    (
        "source",
        "scenario",
        "a scenario is one of the sources that a user names",
    ),
    (
        "sink",
        "report",
        "the table sink writes the report's rows, tables and page",
    ),
];

fn source() -> Crate {
    Crate::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs"))
}

fn name(id: &Id) -> String {
    if id.is_empty() {
        "crate".to_owned()
    } else {
        id.join("::")
    }
}

#[test]
fn rooms_use_only_the_layers_above() {
    let source = source();
    let layer = |room: &str| ORDER.iter().position(|rooms| rooms.contains(&room));
    let rooms = source.0.keys().filter_map(|id| id.first());
    for room in rooms.collect::<BTreeSet<_>>() {
        assert!(layer(room).is_some(), "room '{room}' has no layer");
    }
    let mut taken = BTreeSet::new();
    let mut wrong = Vec::new();
    for edge in source.edges() {
        let (Some(from), Some(to)) = (edge.from.first(), edge.to.first()) else {
            continue;
        };
        let exception = EXCEPTIONS.iter().find(|(a, b, _)| a == from && b == to);
        if let Some(exception) = exception {
            taken.insert(exception);
        } else if from != to && layer(to) >= layer(from) {
            wrong.push(format!(
                "{} must not use {}::{}",
                name(&edge.from),
                name(&edge.to),
                edge.name
            ));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert_eq!(
        taken.len(),
        EXCEPTIONS.len(),
        "of the exceptions only these are needed: {taken:?}"
    );
}

#[test]
fn commands_do_not_use_each_other() {
    let command = |id: &Id| match &id[..] {
        [cli, commands, name, ..] if cli == "cli" && commands == "commands" => Some(name.clone()),
        _ => None,
    };
    for edge in source().edges() {
        if let (Some(from), Some(to)) = (command(&edge.from), command(&edge.to)) {
            assert_eq!(
                from,
                to,
                "{} must not use {}",
                name(&edge.from),
                name(&edge.to)
            );
        }
    }
}

/// A parent that passes on what its child defines, and a child that uses a type, trait or constant
/// of its parent are no circle.
#[test]
fn files_form_no_circles() {
    let counts = |edge: &Edge| {
        let upper = edge.name.starts_with(|c: char| c.is_uppercase());
        !(edge.facade || upper && edge.from.starts_with(&edge.to))
    };
    let edges = source()
        .edges()
        .into_iter()
        .filter(counts)
        .collect::<Vec<_>>();
    let mut next: BTreeMap<&Id, BTreeSet<&Id>> = BTreeMap::new();
    for edge in &edges {
        next.entry(&edge.from).or_default().insert(&edge.to);
    }
    let reaches = |from| {
        let mut seen = BTreeSet::new();
        let mut left = vec![from];
        while let Some(id) = left.pop() {
            left.extend(
                next.get(id)
                    .into_iter()
                    .flatten()
                    .filter(|id| seen.insert(**id)),
            );
        }
        seen
    };
    let reached = next
        .keys()
        .map(|id| (*id, reaches(id)))
        .collect::<BTreeMap<_, _>>();
    let circular = |a: &Id, b: &Id| {
        reached[a].contains(b) && reached.get(b).is_some_and(|ids| ids.contains(a))
    };
    let mut circles: BTreeMap<&Id, Vec<String>> = BTreeMap::new();
    for edge in edges.iter().filter(|edge| circular(&edge.from, &edge.to)) {
        let first = *reached[&edge.from]
            .iter()
            .find(|id| circular(&edge.from, id))
            .unwrap();
        let line = format!("{} -> {}::{}", name(&edge.from), name(&edge.to), edge.name);
        circles.entry(first).or_default().push(line);
    }
    let list = circles
        .values()
        .map(|lines| lines.join("\n"))
        .collect::<Vec<_>>();
    assert!(
        list.is_empty(),
        "{} circles:\n{}",
        list.len(),
        list.join("\n\n")
    );
}
