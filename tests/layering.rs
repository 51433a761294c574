//! Who may import whom: the house's doors (see the crate's documentation).

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Module → the modules it may import. `error`, `timing` and `words` are everyone's.
const ALLOWED: &[(&str, &[&str])] = &[
    ("error", &[]),
    ("timing", &[]),
    ("statistics", &[]),
    ("words", &[]),
    ("stereo", &[]),
    ("kernel", &["stereo"]),
    ("matcher", &["stereo", "kernel"]),
    ("depth", &["stereo", "kernel"]),
    ("rectify", &["stereo", "kernel"]),
    ("arena", &["stereo", "kernel"]),
    ("bounded", &[]),
    ("yaml", &[]),
    (
        "calibrate",
        &["stereo", "kernel", "depth", "bounded", "yaml"],
    ),
    ("files", &["stereo", "bounded"]),
    ("fetch", &["files"]),
    ("overlay", &["stereo"]),
    ("grab", &["stereo", "arena", "calibrate", "files"]),
    ("recording", &["stereo", "files", "manifest", "yaml"]),
    ("score", &["stereo", "depth", "overlay"]),
    (
        "source",
        &[
            "stereo",
            "recording",
            "arena",
            "files",
            "grab",
            "calibrate",
            "rectify",
        ],
    ),
    ("manifest", &["kernel", "matcher"]),
    ("report", &["score", "overlay", "manifest", "calibrate"]),
    (
        "sink",
        &[
            "stereo",
            "manifest",
            "recording",
            "score",
            "report",
            "overlay",
            "files",
        ],
    ),
    (
        "scenario",
        &[
            "stereo", "depth", "matcher", "score", "arena", "files", "report",
        ],
    ),
    (
        "reproduce",
        &[
            "stereo", "kernel", "matcher", "depth", "arena", "files", "overlay", "score", "report",
            "source", "sink", "scenario", "run", "manifest",
        ],
    ),
    (
        "run",
        &["stereo", "depth", "matcher", "scenario", "source", "sink"],
    ),
];

#[test]
fn every_import_goes_through_a_door() {
    let mut imports: BTreeMap<String, Vec<(String, String)>> = BTreeMap::new();
    collect(
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src")),
        None,
        &mut imports,
    );
    for (module, uses) in &imports {
        let allowed = ALLOWED.iter().find(|(name, _)| name == module);
        let (_, allowed) =
            allowed.unwrap_or_else(|| panic!("module '{module}' has no line in ALLOWED"));
        for (file, target) in uses {
            let everyones = [
                "error",
                "timing",
                "statistics",
                "Error",
                "Result",
                "counted",
                module.as_str(),
            ]
            .contains(&target.as_str());
            assert!(
                everyones || allowed.contains(&target.as_str()),
                "{file}: {module} must not import {target}"
            );
        }
    }
    assert_eq!(
        imports.len(),
        ALLOWED.len(),
        "ALLOWED names a module that is gone"
    );
}

/// Imports by top-level module, as (file, imported module). `cli` and the crate's roots may import
/// all.
fn collect(
    folder: &Path,
    module: Option<&str>,
    imports: &mut BTreeMap<String, Vec<(String, String)>>,
) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let top = module.unwrap_or(&stem);
        if ["cli", "lib", "main"].contains(&top) {
            continue;
        }
        if path.is_dir() {
            collect(&path, Some(top), imports);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            // Tests may look at anything.
            let text = text.split("#[cfg(test)]").next().unwrap();
            let code = text
                .lines()
                .filter(|line| !line.trim_start().starts_with("//"));
            let targets = code.flat_map(|line| {
                line.split("crate::")
                    .skip(1)
                    .flat_map(names)
                    .collect::<Vec<_>>()
            });
            let file = path.display().to_string();
            let found = targets.map(|target| (file.clone(), target));
            imports.entry(top.to_owned()).or_default().extend(found);
        }
    }
}

/// The first path segments after `crate::`: one, or those of a `{group}`.
fn names(rest: &str) -> Vec<String> {
    let ident = |s: &str| {
        s.trim()
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect::<String>()
    };
    match rest.strip_prefix('{') {
        Some(group) => group
            .split(',')
            .map(ident)
            .filter(|s| !s.is_empty())
            .collect(),
        None => vec![ident(rest)],
    }
}
