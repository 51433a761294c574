//! Limits of style, and test files that belong to no program.

use crate::modules::{children, code};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Columns of a line.
const COLUMNS: usize = 100;
/// Limit on longer lines.
const LONG_LINES: usize = 0;
/// Lines of a small file: it should be part of its only user.
const SMALL: usize = 40;
/// Limit on small files, not counting the roots of modules and packages.
const SMALL_FILES: usize = 13;
/// Limit on type names with two meanings.
const COLLIDING: usize = 19;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All Rust files below `folder`.
fn rust(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            files.extend(rust(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// Path below the repository.
fn short(file: &Path) -> String {
    file.strip_prefix(root()).unwrap().display().to_string()
}

#[track_caller]
fn at_most(limit: usize, found: &[String], what: &str) {
    assert!(
        found.len() <= limit,
        "{} {what}:\n{}",
        found.len(),
        found.join("\n")
    );
}

#[test]
fn lines_are_no_longer_than_100_columns() {
    let mut long = Vec::new();
    for folder in ["src", "tests", "benches", "examples", "fuzz"] {
        for file in rust(&root().join(folder)) {
            let text = fs::read_to_string(&file).unwrap();
            let lines = text
                .lines()
                .enumerate()
                .filter(|(_, line)| line.chars().count() > COLUMNS);
            long.extend(lines.map(|(i, _)| format!("{}:{}", short(&file), i + 1)));
        }
    }
    at_most(LONG_LINES, &long, "long lines");
}

#[test]
fn small_files_are_few() {
    let lines = |file: &Path| fs::read_to_string(file).unwrap().lines().count();
    let mut small = rust(&root().join("src"));
    let is_root = |file: &Path| {
        ["mod.rs", "lib.rs", "main.rs"]
            .iter()
            .any(|name| file.ends_with(name))
    };
    small.retain(|file| !is_root(file) && lines(file) <= SMALL);
    let names = small.iter().map(|file| short(file)).collect::<Vec<_>>();
    at_most(SMALL_FILES, &names, "small files");
}

#[test]
fn a_type_name_means_one_thing() {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for file in rust(&root().join("src")) {
        let text = fs::read_to_string(&file).unwrap();
        for line in code(&text).lines() {
            let visible = match line.strip_prefix("pub") {
                Some(rest) if rest.starts_with('(') => rest.split_once(')').unwrap().1,
                Some(rest) => rest,
                None => line,
            };
            let mut words = visible.split(|c: char| !c.is_alphanumeric() && c != '_');
            let kind = words.find(|word| !word.is_empty()).unwrap_or_default();
            let is_type = ["struct", "enum", "trait", "type", "union"].contains(&kind);
            if let Some(name) = words.next().filter(|_| is_type && !line.starts_with(' ')) {
                places
                    .entry(name.to_owned())
                    .or_default()
                    .push(short(&file));
            }
        }
    }
    places.retain(|_, places| places.len() > 1);
    let list = places
        .iter()
        .map(|(name, places)| format!("{name}: {}", places.join(" ")));
    let list = list.collect::<Vec<_>>();
    at_most(COLLIDING, &list, "names collide");
}

#[test]
fn every_test_file_is_in_a_program_and_programs_are_few() {
    let tests = root().join("tests");
    let mut roots = Vec::new();
    for entry in fs::read_dir(&tests).unwrap() {
        let path = entry.unwrap().path();
        let main = path.join("main.rs");
        if main.exists() {
            roots.push(main);
            roots.extend(Some(path.join("memory.rs")).filter(|memory| memory.exists()));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            roots.push(path);
        }
    }
    assert!(roots.len() <= 6, "{} test programs", roots.len());
    let mut run = BTreeSet::new();
    while let Some(file) = roots.pop() {
        let text = fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", short(&file)));
        roots.extend(
            children(&file, &code(&text), &text)
                .into_iter()
                .map(|(_, child)| child),
        );
        run.insert(fs::canonicalize(file).unwrap());
    }
    for file in rust(&tests) {
        let file = fs::canonicalize(file).unwrap();
        assert!(
            run.contains(&file),
            "{} is in no test program",
            file.display()
        );
    }
}
