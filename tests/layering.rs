//! The structure of the sources: the rooms that each room may use, no circles, no test file outside
//! all programs, and the limits of style.

#[path = "layering/modules.rs"]
mod modules;
#[path = "layering/style.rs"]
mod style;

use modules::{Crate, Edge, Id};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A package: its root file below `src/`, and its rooms in layers, lowest first. A room uses those
/// of lower layers. Cargo enforces the dependencies between packages. A package without layers is
/// one room.
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
            &["doubt", "kernel"],
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
            &["levels"],
            &["bit_depth"],
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
            &["holm", "notice"],
            &["bootstrap"],
            &["judge", "losses", "memory"],
            &["plausibility", "scenario"],
            &["drive", "manifest", "pixel_errors", "resize"],
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
        layers: &[
            &["stream"],
            &["message"],
            &["mcap"],
            &["bags"],
            &["decode"],
            &["cameras"],
            &["poses"],
            &["pairs"],
            &["sensor"],
            &["clocks"],
            &["results"],
            &["read"],
            &["write"],
        ],
    },
    Package {
        root: "grab/lib.rs",
        layers: &[
            &["camera", "clock", "device_clock", "queue", "trigger"],
            &["exposure", "mailbox", "pairing", "serial", "split"],
            &["acquire", "driver", "tally", "watchdog"],
            &["genicam", "request", "simulated", "triggering", "v4l2"],
            &["coordinator"],
            &["grabber"],
        ],
    },
    Package {
        root: "report/lib.rs",
        layers: &[
            &["show"],
            &["rows"],
            &["subjects"],
            &["results"],
            &["pages"],
            &["units"],
            &["compare"],
            &["build"],
        ],
    },
    Package {
        root: "train/lib.rs",
        layers: &[
            &["fit"],
            &["learned_cells", "report"],
            &["filter", "gaps", "kinds"],
            &["cells", "windows"],
            &["scenario_filters", "v5"],
        ],
    },
    Package {
        root: "viewer/lib.rs",
        layers: &[
            &["detail", "file", "info", "scale"],
            &["blueprint", "overlay", "picture", "world"],
            &["push", "target"],
            &["board", "layout", "step"],
        ],
    },
    Package {
        root: "thesis/lib.rs",
        layers: &[
            &["checks", "finding", "stage"],
            &["distance", "measure", "page", "speed"],
            &[
                "closeness",
                "filters",
                "hashing",
                "points",
                "situations",
                "smoothing",
                "stressed",
                "texture",
                "validity",
            ],
        ],
    },
    Package {
        root: "main.rs",
        layers: &[&["cli"]],
    },
];

/// A room of the bench that is a hall of its own.
const SOURCE: [&[&str]; 6] = [
    &["frames"],
    &["inputs"],
    &["layers"],
    &["opened"],
    &["live"],
    &["open"],
];

/// Folders below `src/` whose `lib.rs` and `mod.rs` define nothing: they name rooms.
const FACES: [&str; 3] = ["recording", "report", "bench/source"];

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

/// The uses of a room by one that may not use it, below `hall`.
fn upward(source: &Crate, hall: &[&str], layers: &[&[&str]]) -> Vec<String> {
    let room = |id: &Id| {
        let rest = id.strip_prefix(
            &hall
                .iter()
                .map(|name| (*name).to_owned())
                .collect::<Vec<_>>()[..],
        )?;
        rest.first().cloned()
    };
    let layer = |room: &str| layers.iter().position(|rooms| rooms.contains(&room));
    let mut wrong = Vec::new();
    for room in source.0.keys().filter_map(room).collect::<BTreeSet<_>>() {
        if layer(&room).is_none() {
            wrong.push(format!("room '{room}' has no layer"));
        }
    }
    for edge in source.edges() {
        let (Some(from), Some(to)) = (room(&edge.from), room(&edge.to)) else {
            continue;
        };
        if from != to && layer(&to) >= layer(&from) {
            wrong.push(format!(
                "{} must not use {}::{}",
                name(&edge.from),
                name(&edge.to),
                edge.name
            ));
        }
    }
    wrong
}

#[test]
fn rooms_use_only_lower_layers() {
    let mut wrong = Vec::new();
    for package in PACKAGES.iter().filter(|package| !package.layers.is_empty()) {
        let found = upward(&package.read(), &[], package.layers);
        wrong.extend(
            found
                .iter()
                .map(|found| format!("{}: {found}", package.root)),
        );
    }
    let bench = PACKAGES
        .iter()
        .find(|package| package.root == "bench/lib.rs");
    wrong.extend(upward(&bench.unwrap().read(), &["source"], &SOURCE));
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// An arrow to a higher room through `pub use` of a name, of a module and of a whole file.
#[test]
fn uses_are_followed_through_re_exports() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write(
        "lib.rs",
        "mod high;\nmod low;\npub use high::Name;\npub use high as face;\npub use high::*;\n",
    );
    write(
        "high.rs",
        "pub struct Name;\npub struct Other;\npub struct Third;\n",
    );
    for used in [
        "crate::Name",
        "crate::face::Other",
        "crate::Third",
        "crate::high::Name",
    ] {
        write("low.rs", &format!("use {used};\n"));
        let found = upward(
            &Crate::read(&folder.path().join("lib.rs")),
            &[],
            &[&["low"], &["high"]],
        );
        assert_eq!(found.len(), 1, "{used}: {found:?}");
    }
    write("low.rs", "pub struct Name;\n");
    write("high.rs", "use crate::low::Name;\n");
    let source = Crate::read(&folder.path().join("lib.rs"));
    assert!(upward(&source, &[], &[&["low"], &["high"]]).is_empty());
}

/// The map of `docs/architecture.md`: an indented tree of folders.
#[test]
fn the_map_draws_folders_that_exist() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(repository.join("docs/architecture.md")).unwrap();
    let map = page.split("```text\nsrc/\n").nth(1).expect("a map");
    let mut folders = vec![repository.join("src")];
    let mut count = 0;
    for line in map.lines().take_while(|line| !line.starts_with("```")) {
        let depth = (line.len() - line.trim_start().len()) / 2;
        let names = line.split_whitespace();
        for name in names.take_while(|word| word.ends_with('/')) {
            folders.truncate(depth);
            let folder = folders[depth - 1].join(name);
            assert!(folder.is_dir(), "no folder {}", folder.display());
            folders.push(folder);
            count += 1;
        }
    }
    assert!(count > 50, "{count} folders");
}

#[test]
fn roots_of_rooms_define_nothing() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files = FACES
        .iter()
        .flat_map(|face| style::rust(&sources.join(face)));
    for file in files.filter(|file| file.ends_with("mod.rs") || file.ends_with("lib.rs")) {
        let text = std::fs::read_to_string(&file).unwrap();
        let code = modules::code(&text);
        let defined = modules::definitions(&code);
        assert!(defined.is_empty(), "{}: {defined:?}", file.display());
    }
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
