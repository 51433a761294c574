//! Limits of style, and test files that belong to no program.

use crate::modules::{children, code, without_texts};
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
const SMALL_FILES: usize = 8;
/// Limit on type names with two meanings.
const COLLIDING: usize = 19;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All Rust files below `folder`.
pub(crate) fn rust(folder: &Path) -> Vec<PathBuf> {
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

/// Limit on the lines of code of each folder below `src`, without tests: a change that raises one
/// says in its message what is worth the lines.
const LINES: [(&str, usize); 16] = [
    ("bench", 14266),
    ("c", 478),
    ("calibrate", 4988),
    ("cli", 11306),
    ("core", 19647),
    ("files", 2575),
    ("grab", 5139),
    ("live", 468),
    ("python", 394),
    ("recording", 13989),
    ("report", 16527),
    ("score", 9579),
    ("sim", 3550),
    ("thesis", 2644),
    ("train", 3435),
    ("viewer", 1792),
];

/// Lines of code of a file before its tests: without comments and empty lines.
fn lines_of_code(file: &Path) -> usize {
    let text = fs::read_to_string(file).unwrap();
    let is_code = |line: &&str| !line.trim().is_empty() && !line.trim().starts_with("//");
    let before_tests = text.lines().take_while(|line| *line != "#[cfg(test)]");
    before_tests.filter(is_code).count()
}

#[test]
fn packages_do_not_grow() {
    let mut grown = Vec::new();
    let mut folders: Vec<_> = fs::read_dir(root().join("src"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    for folder in folders {
        let files = rust(&folder);
        let files = files.iter().filter(|file| !file.ends_with("tests.rs"));
        let lines: usize = files.map(|file| lines_of_code(file)).sum();
        let name = folder.file_name().unwrap().to_str().unwrap();
        let limit = LINES.iter().find(|(folder, _)| *folder == name);
        if limit.is_none_or(|(_, limit)| lines > *limit) {
            grown.push(format!("(\"{name}\", {lines}),"));
        }
    }
    at_most(0, &grown, "packages above their limit of lines");
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
    // An entry of a table is as long as it is.
    let entries = [
        "/examples/",
        "core/matcher/",
        "inputs/dataset/",
        "judge/protocol/",
        "sim/stress/",
    ];
    let is_entry = |file: &Path| entries.iter().any(|entry| short(file).contains(entry));
    small.retain(|file| !is_root(file) && !is_entry(file) && lines(file) <= SMALL);
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

/// The complaint about `word`, which stands after `before` in the code.
fn unclear(before: &str, word: &str) -> Option<&'static str> {
    let is_function = before == "fn";
    let is_constant = ["const", "static"].contains(&before);
    let mut parts = word.split('_');
    if word == "of" {
        Some("names nothing")
    } else if is_function && word.starts_with("of_") {
        Some("is a function without a verb or a noun: new, from_…, for_…")
    } else if is_function && ["what_", "who_"].iter().any(|head| word.starts_with(head)) {
        Some("is a question: a test's name says what holds")
    } else if is_constant && parts.any(|part| ["MOST", "LEAST", "FEWEST"].contains(&part)) {
        Some("is a limit: MAX_… or MIN_…")
    } else {
        None
    }
}

#[test]
fn names_say_what_they_name() {
    let mut found = Vec::new();
    for folder in ["src", "tests", "benches", "examples", "fuzz"] {
        for file in rust(&root().join(folder)) {
            let text = fs::read_to_string(&file).unwrap();
            let mut before = String::new();
            for (i, line) in without_texts(&text).lines().enumerate() {
                let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
                for word in words.filter(|word| !word.is_empty()) {
                    let place = format!("{}:{}", short(&file), i + 1);
                    found
                        .extend(unclear(&before, word).map(|why| format!("{place}: {word} {why}")));
                    word.clone_into(&mut before);
                }
            }
        }
    }
    at_most(0, &found, "unclear names");
}

/// The words that no comment begins with: a comment begins with its subject.
const NO_SUBJECTS: [&str; 5] = ["Those", "Likewise", "Its", "As", "Of"];

/// The text of a line that is a comment.
fn comment(line: &str) -> Option<&str> {
    let text = line.trim_start().strip_prefix("//")?;
    Some(text.strip_prefix(['/', '!']).unwrap_or(text).trim())
}

#[test]
fn a_comment_begins_with_its_subject() {
    let mut found = Vec::new();
    for file in ["src", "tests"]
        .iter()
        .flat_map(|folder| rust(&root().join(folder)))
    {
        let text = fs::read_to_string(&file).unwrap();
        // True after code, an empty line and a heading.
        let mut begins = true;
        for (i, line) in text.lines().enumerate() {
            let comment = comment(line);
            let first = comment.and_then(|text| text.split(|c: char| !c.is_alphanumeric()).next());
            if begins && first.is_some_and(|first| NO_SUBJECTS.contains(&first)) {
                found.push(format!("{}:{}: {}", short(&file), i + 1, line.trim()));
            }
            begins = comment.is_none_or(|text| text.is_empty() || text.starts_with('#'));
        }
    }
    at_most(0, &found, "comments begin without a subject");
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

/// A new live source touches its own files and its entry of `SOURCES`: all others ask the entry.
#[test]
fn live_sources_are_named_in_their_table_alone() {
    // `--publish` of replay is the address of a sink.
    let own = [
        "src/live/",
        "src/bench/source/open/sources.rs",
        "src/bench/source/live/ros2.rs",
        "src/cli/commands/replay/mod.rs",
    ];
    let table = fs::read_to_string(root().join("src/bench/source/open/sources.rs")).unwrap();
    let entries = table
        .lines()
        .filter_map(|line| line.trim().strip_prefix("prefix: \""));
    let schemes = entries.filter_map(|entry| entry.split_once(':'));
    let schemes: Vec<_> = schemes.map(|(scheme, _)| scheme).collect();
    assert!(schemes.contains(&"ros2"), "{schemes:?}");
    let mut found = Vec::new();
    for file in rust(&root().join("src")) {
        let (name, text) = (short(&file), fs::read_to_string(&file).unwrap());
        if own.iter().any(|own| name.starts_with(own)) {
            continue;
        }
        // Test code differs in them.
        let (all, code) = (without_texts(&text), code(&text));
        let places = all.lines().zip(code.lines()).map(|(all, code)| all == code);
        for (i, (line, is_code)) in text.lines().zip(places).enumerate() {
            let names = |scheme: &&str| line.contains(&format!("\"{scheme}:"));
            let is_comment = line.trim_start().starts_with("//");
            if is_code && !is_comment && schemes.iter().any(names) {
                found.push(format!("{name}:{}: {}", i + 1, line.trim()));
            }
        }
    }
    at_most(0, &found, "names of live sources outside their table");
}
