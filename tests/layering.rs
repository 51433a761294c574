//! The structure of the sources: the rooms that each room may use, no circles, no test file outside
//! all programs, and the limits of style.

#[path = "layering/modules.rs"]
mod modules;
#[path = "layering/style.rs"]
mod style;

use modules::{Crate, Edge, Id};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A package: its root file below `src/`, and its rooms in layers. A room uses those of the layers
/// above its own. Cargo enforces the dependencies between packages. A package without layers is one
/// room.
struct Package {
    root: &'static str,
    layers: &'static [&'static [&'static str]],
}

const PACKAGES: [Package; 15] = [
    Package {
        root: "core/lib.rs",
        layers: &[
            &[
                "error",
                "inputs",
                "interrupt",
                "nanoseconds",
                "timing",
                "words",
                "statistics",
            ],
            &["bounded", "stereo"],
            &["kernel"],
            &["depth", "filter"],
            &["matcher", "rectify"],
            &["ranger"],
        ],
    },
    Package {
        root: "calibrate/lib.rs",
        layers: &[
            &["pattern", "yaml"],
            &["detect", "distance", "files", "simulated", "solve"],
            &["choose"],
        ],
    },
    Package {
        root: "c/lib.rs",
        layers: &[&["errors"], &["options"]],
    },
    Package {
        root: "files/lib.rs",
        layers: &[
            &["fault"],
            &[
                "build_info",
                "cloud",
                "columns",
                "decoded",
                "ffmpeg",
                "jpeg",
                "npz",
                "outputs",
                "overlay",
                "pairing",
                "pfm",
                "rvl",
            ],
            &["picture"],
            &["image"],
            &["map"],
            &["depth", "disparity"],
        ],
    },
    Package {
        root: "sim/lib.rs",
        layers: &[&["arena", "stress"]],
    },
    Package {
        root: "score/lib.rs",
        layers: &[
            &["notice"],
            &[
                "agreement",
                "bootstrap",
                "holm",
                "judge",
                "losses",
                "memory",
            ],
            &["plausibility", "scenario", "sign_test"],
            &["drive", "manifest", "resize"],
        ],
    },
    Package {
        root: "live/lib.rs",
        layers: &[&["dds"]],
    },
    Package {
        root: "bench/lib.rs",
        layers: &[
            &["source"],
            &["sink"],
            &["pass"],
            &["console", "drive", "record"],
            &["runs"],
            &["evaluation", "tune"],
        ],
    },
    Package {
        root: "recording/lib.rs",
        layers: &[],
    },
    Package {
        root: "grab/lib.rs",
        layers: &[],
    },
    Package {
        root: "report/lib.rs",
        layers: &[],
    },
    Package {
        root: "train/lib.rs",
        layers: &[],
    },
    Package {
        root: "viewer/lib.rs",
        layers: &[],
    },
    Package {
        root: "thesis/lib.rs",
        layers: &[],
    },
    Package {
        root: "main.rs",
        layers: &[&["cli"]],
    },
];

/// Edges within a layer or against the order, with their reasons.
const EXCEPTIONS: &[(&str, &str, &str)] = &[];

impl Package {
    fn read(&self) -> Crate {
        let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        Crate::read(&sources.join(self.root))
    }
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
    let mut taken = BTreeSet::new();
    let mut wrong = Vec::new();
    for package in PACKAGES.iter().filter(|package| !package.layers.is_empty()) {
        let layer = |room: &str| {
            package
                .layers
                .iter()
                .position(|rooms| rooms.contains(&room))
        };
        let source = package.read();
        let rooms = source.0.keys().filter_map(|id| id.first());
        for room in rooms.collect::<BTreeSet<_>>() {
            let root = package.root;
            assert!(
                layer(room).is_some(),
                "room '{room}' of {root} has no layer"
            );
        }
        for edge in source.edges() {
            let (Some(from), Some(to)) = (edge.from.first(), edge.to.first()) else {
                continue;
            };
            let exception = EXCEPTIONS.iter().find(|(a, b, _)| a == from && b == to);
            if let Some(exception) = exception {
                taken.insert(exception);
            } else if from != to && layer(to) >= layer(from) {
                wrong.push(format!(
                    "{}: {} must not use {}::{}",
                    package.root,
                    name(&edge.from),
                    name(&edge.to),
                    edge.name
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert_eq!(
        taken.len(),
        EXCEPTIONS.len(),
        "of the exceptions only these are needed: {taken:?}"
    );
}

/// The packages' manifests below the repository, with their dependencies.
fn dependencies() -> BTreeMap<String, toml::Table> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = PACKAGES.iter().map(|package| {
        let file = Path::new("src").join(package.root);
        let folder = file.parent().unwrap();
        let is_root = package.root == "main.rs";
        if is_root { Path::new("") } else { folder }.to_owned()
    });
    let read = |folder: std::path::PathBuf| {
        let text = std::fs::read_to_string(repository.join(&folder).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = toml::from_str(&text).unwrap();
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        (name, manifest["dependencies"].as_table().unwrap().clone())
    };
    folders.map(read).collect()
}

#[test]
fn heavy_crates_have_one_user() {
    for (package, heavy) in [
        ("svl-recording", &["mcap", "zstd", "rusqlite"][..]),
        ("svl-report", &["polars", "minijinja"]),
        ("svl-live", &["rustdds"]),
        ("svl-grab", &["aravis", "serial2"]),
        ("svl-viewer", &["rerun"]),
        ("svl", &["svl-thesis", "svl-viewer", "ratatui"]),
    ] {
        for heavy in heavy {
            let users: Vec<_> = dependencies()
                .into_iter()
                .filter(|(_, needs)| needs.contains_key(*heavy))
                .map(|(name, _)| name)
                .collect();
            assert_eq!(users, [package], "{heavy}");
        }
    }
}

/// Tests of other packages turn the feature on for all of the workspace, so no test of the program
/// would miss it.
#[test]
fn the_program_has_the_matcher_exec() {
    let core = &dependencies()["svl-bench"]["svl-core"];
    let features = core.get("features").and_then(toml::Value::as_array);
    let features = features.unwrap_or_else(|| panic!("svl-core of svl-bench: {core}"));
    assert!(features.iter().any(|name| name.as_str() == Some("exec")));
}

/// The program's commands.
#[test]
fn commands_do_not_use_each_other() {
    let command = |id: &Id| match &id[..] {
        [cli, commands, name, ..] if cli == "cli" && commands == "commands" => Some(name.clone()),
        _ => None,
    };
    let program = PACKAGES.iter().find(|package| package.root == "main.rs");
    let edges = program.unwrap().read().edges();
    assert!(
        edges.iter().any(|edge| command(&edge.from).is_some()),
        "no command was read"
    );
    for edge in edges {
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

/// A parent that re-exports definitions of its child, and a child that uses a type, trait or
/// constant of its parent, do not make a circle.
#[test]
fn files_form_no_circles() {
    let found: Vec<_> = PACKAGES.iter().flat_map(circles).collect();
    assert!(
        found.is_empty(),
        "{} circles:\n{}",
        found.len(),
        found.join("\n\n")
    );
}

/// The circles of a package, with the edges of each in lines.
fn circles(package: &Package) -> Vec<String> {
    let counts = |edge: &Edge| {
        let upper = edge.name.starts_with(|c: char| c.is_uppercase());
        !(edge.facade || upper && edge.from.starts_with(&edge.to))
    };
    let edges = package
        .read()
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
    let lines = circles.into_values().map(|lines| lines.join("\n"));
    lines.collect()
}
