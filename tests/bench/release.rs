//! Facts that several files of a release state: the version, the Rust version, the workflows.

use super::cli::fixture::Fixture;
use std::fs;
use std::path::Path;
use svl_calibrate::yaml::{self, YamlNode};

const VERSION: &str = env!("CARGO_PKG_VERSION");
const RUST: &str = env!("CARGO_PKG_RUST_VERSION");

fn text(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The rest of the first line with this beginning, without quotes.
fn find<'a>(text: &'a str, beginning: &str) -> Option<&'a str> {
    let line = text.lines().find_map(|line| line.strip_prefix(beginning));
    line.map(|line| line.trim_matches('"'))
}

fn value(text: &str, beginning: &str) -> String {
    let found = find(text, beginning);
    found
        .unwrap_or_else(|| panic!("no line begins with {beginning:?}"))
        .to_owned()
}

#[test]
fn one_version_everywhere() {
    assert_eq!(value(&text("CITATION.cff"), "version: "), VERSION);
    let module = text("src/python/svl_bench/matcher.py");
    assert_eq!(value(&module, "__version__ = "), VERSION);
    for line in text("Cargo.toml")
        .lines()
        .filter(|l| l.starts_with("svl-") && l.contains("path"))
    {
        assert!(line.contains(&format!("version = \"{VERSION}\"")), "{line}");
    }
    assert!(text("src/python/pyproject.toml").contains("dynamic = [\"version\"]"));
}

/// Changes stand below "Unreleased" until a release renames it (RELEASING.md). A version that is
/// not released has no date.
#[test]
fn a_released_version_has_one_date() {
    let (changes, citation) = (text("CHANGELOG.md"), text("CITATION.cff"));
    let release = find(&changes, &format!("## {VERSION} "));
    let date = find(&citation, "date-released: ").map(|date| format!("({date})"));
    assert_eq!(release, date.as_deref());
    let newest = value(&changes, "## ");
    let is_released = release.is_some() && newest.starts_with(&format!("{VERSION} "));
    assert!(is_released || newest == "Unreleased", "{newest}");
}

#[test]
fn documents_name_the_rust_version() {
    for document in ["README.md", "docs/tutorials/first-number.md"] {
        let named = format!("[Rust](https://rustup.rs) {RUST} or later");
        assert!(text(document).contains(&named), "{document}: no {named}");
    }
    let toolchain = format!("--default-toolchain {RUST}\n");
    assert!(text("Dockerfile").contains(&toolchain), "{toolchain}");
    let library = text("docs/library.md");
    for package in ["core", "calibrate"] {
        let version = value(
            &text(&format!("src/{package}/Cargo.toml")),
            "rust-version = ",
        );
        assert!(
            library.contains(&format!("Rust {version}")),
            "svl-{package}: {version}"
        );
    }
}

/// All values of a key, at any depth.
fn values<'a>(node: &'a YamlNode, key: &str, found: &mut Vec<&'a str>) {
    match node {
        YamlNode::Value(_) => {}
        YamlNode::List(nodes) => nodes.iter().for_each(|node| values(node, key, found)),
        YamlNode::Table(table) => {
            for (name, node) in table {
                match node {
                    YamlNode::Value(text) if name == key => found.push(text),
                    node => values(node, key, found),
                }
            }
        }
    }
}

#[test]
fn workflows_are_yaml_and_pin_their_actions() {
    let workflows = ["advisories", "packages", "tests"];
    let workflows = workflows.map(|name| format!(".github/workflows/{name}.yml"));
    for path in workflows
        .iter()
        .map(String::as_str)
        .chain(["examples/ci/stereo.yml"])
    {
        let workflow = yaml::parse(&text(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
        let YamlNode::Table(keys) = &workflow else {
            panic!("{path}: no table");
        };
        assert!(
            ["name", "on", "permissions", "jobs"]
                .iter()
                .all(|key| keys.contains_key(*key))
        );
        let mut actions = Vec::new();
        values(&workflow, "uses", &mut actions);
        for action in actions {
            let commit = action.split_once('@').map_or("", |(_, commit)| commit);
            let is_commit = commit.len() == 40 && commit.bytes().all(|b| b.is_ascii_hexdigit());
            assert!(is_commit, "{path}: {action} is not pinned by its commit");
        }
        // Commands of the repository and of svl that a workflow runs.
        let mut commands = Vec::new();
        values(&workflow, "run", &mut commands);
        for command in commands.iter().flat_map(|run| run.lines()) {
            let command = command.split(" >").next().unwrap();
            let (program, arguments) = command.split_once(' ').unwrap_or((command, ""));
            if program == "svl" {
                Fixture::new().run(&format!("{arguments} --help"));
            } else if program.contains('/') {
                assert!(!text(program).is_empty(), "{path}: {command}");
            }
        }
    }
}
