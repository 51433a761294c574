//! Facts that several files of a release state: the version, the Rust version, the address, the
//! workflows; and the steps that keep what SECURITY and CONTRIBUTING promise.

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
    assert!(text("src/python/pyproject.toml").contains("dynamic = [\"version\","));
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
    let workflows = ["advisories", "nightly", "packages", "tests"];
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
            } else if program.contains('/') && !program.contains('$') {
                assert!(!text(program).is_empty(), "{path}: {command}");
            }
        }
    }
}

/// The address is a line of Cargo.toml; workflows that a reader copies name the same repository.
#[test]
fn examples_name_the_repository() {
    let address = env!("CARGO_PKG_REPOSITORY");
    let repository = address.strip_prefix("https://github.com/").unwrap();
    for path in ["examples/ci/stereo.yml", "docs/tutorials/first-number.md"] {
        let uses = format!("- uses: {repository}@");
        assert!(text(path).contains(&uses), "{path}: no {uses}");
    }
}

/// What RELEASING publishes is what may be published.
#[test]
fn published_packages_are_those_of_the_releasing_page() {
    let steps = text("RELEASING.md");
    let (_, command) = steps.split_once("`cargo publish").unwrap();
    let (command, _) = command.split_once('`').unwrap();
    let mut packages = vec![".".to_owned(), "src/python".to_owned()];
    for entry in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        packages.push(format!("src/{name}"));
    }
    for package in packages {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join(&package);
        let Ok(manifest) = fs::read_to_string(manifest.join("Cargo.toml")) else {
            continue;
        };
        let name = value(&manifest, "name = ");
        let is_private = manifest.contains("\npublish = false\n");
        let mut words = command.split_whitespace();
        assert_ne!(words.any(|word| word == name), is_private, "{name}");
    }
}

const SECURITY: &str = "SECURITY.md";
const CONTRIBUTING: &str = "CONTRIBUTING.md";

/// Promises: the document, its words, and the step that keeps them: a file and what is in it.
const PROMISES: &[[&str; 4]] = &[
    [
        SECURITY,
        "`fuzz/` has targets for images, maps, recordings",
        ".ci/nightly",
        "|| step fuzz/run \"$name\"",
    ],
    [
        SECURITY,
        "Texts in the HTML page are escaped.",
        "tests/bench/report/page.rs",
        "fn the_page_escapes_and_fetches_nothing()",
    ],
    [
        SECURITY,
        "svl downloads nothing.",
        "tests/bench/report/page.rs",
        "fn the_page_escapes_and_fetches_nothing()",
    ],
    [
        SECURITY,
        "Unsafe code is confined to",
        "tests/bench/release.rs",
        "fn unsafe_code_is_where_it_is_promised()",
    ],
    [
        SECURITY,
        "Each block states why it is sound, which Clippy checks.",
        "Cargo.toml",
        "undocumented_unsafe_blocks = \"warn\"",
    ],
    [
        SECURITY,
        "Each block states why it is sound, which Clippy checks.",
        ".ci/run",
        "step cargo clippy --release --locked --all-targets -- -D warnings",
    ],
    [
        SECURITY,
        "Licences and sources of all dependencies are checked with every change",
        ".ci/run",
        "step cargo deny check licenses sources",
    ],
    [
        SECURITY,
        "Licences and sources of all dependencies are checked with every change",
        ".github/workflows/tests.yml",
        "cargo install --quiet --locked cargo-deny",
    ],
    [
        SECURITY,
        "advisories every week",
        ".github/workflows/advisories.yml",
        "cron: \"17 4 * * 1\"",
    ],
    [
        CONTRIBUTING,
        "`.ci/check` | before a commit | format, structure, lints, unit tests, `lean`, screens",
        ".ci/check",
        "step cargo test --profile work --locked --lib --test lean",
    ],
    [
        CONTRIBUTING,
        "`cargo test --release --locked` | before a change is proposed",
        ".ci/run",
        "step cargo test --release --locked\n",
    ],
    [
        CONTRIBUTING,
        "`.ci/nightly` | before a release | all cases",
        ".ci/nightly",
        "step env SVL_CASES=all cargo test --release --locked -- --include-ignored",
    ],
    [
        CONTRIBUTING,
        "the gate on all seeds",
        ".ci/nightly",
        "-q score scenarios/arena.toml --gate -o",
    ],
    [
        CONTRIBUTING,
        "AArch64, macOS, Windows, the wheel, fuzzing",
        ".ci/nightly",
        "step tests/aarch64.sh all",
    ],
    [
        CONTRIBUTING,
        "AArch64, macOS, Windows, the wheel, fuzzing",
        ".ci/nightly",
        "step tests/platforms.sh",
    ],
    [
        CONTRIBUTING,
        "AArch64, macOS, Windows, the wheel, fuzzing",
        ".github/workflows/nightly.yml",
        "run: .ci/nightly",
    ],
    [
        CONTRIBUTING,
        "`.ci/run` runs every check that a change has to pass.",
        ".github/workflows/tests.yml",
        "run: .ci/run",
    ],
    [
        CONTRIBUTING,
        "It lists what was skipped and how to install it.",
        ".ci/run",
        "missing, with the command that installs it:",
    ],
    [
        CONTRIBUTING,
        "`packaging/python-test.sh` tests the wheel",
        ".ci/nightly",
        "step packaging/python-test.sh",
    ],
    [
        CONTRIBUTING,
        "`packaging/python-test.sh` tests the wheel",
        ".github/workflows/tests.yml",
        "run: packaging/python-test.sh",
    ],
    [
        CONTRIBUTING,
        "`tests/v4l2.sh` and `tests/genicam.sh` record",
        "RELEASING.md",
        "`.ci/run`, `.ci/nightly`, `tests/v4l2.sh` and `tests/genicam.sh`",
    ],
    [
        CONTRIBUTING,
        "`fuzz/run` fuzzes the readers",
        ".ci/nightly",
        "|| step fuzz/run \"$name\"",
    ],
    [
        CONTRIBUTING,
        "Tests also run the examples of README and docs.",
        "tests/bench/documents.rs",
        "fn shell_examples_run(",
    ],
    [
        CONTRIBUTING,
        "Lines of a page have at most 120 columns. Pages have at most 1,500 words",
        "tests/bench/documents.rs",
        "fn pages_are_short_and_narrow()",
    ],
    [
        CONTRIBUTING,
        "A type name means one thing in the workspace.",
        "tests/layering/style.rs",
        "fn a_type_name_means_one_thing()",
    ],
    [
        CONTRIBUTING,
        "100 columns, rustfmt's defaults.",
        ".ci/run",
        "step cargo fmt --all --check",
    ],
];

#[test]
fn promises_are_kept_by_steps() {
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut failures = Vec::new();
    for [document, promised, file, step] in PROMISES {
        if !words(&text(document)).contains(promised) {
            failures.push(format!("{document}: no {promised:?}"));
        }
        if !text(file).contains(step) {
            failures.push(format!("{file}: no {step:?}, for {promised:?}"));
        }
    }
    // A script that these pages name is run by a step; those of docs make pictures and results.
    for document in [SECURITY, CONTRIBUTING] {
        let page = text(document);
        for script in page.split('`').skip(1).step_by(2) {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(script);
            let is_check = path.is_file() && !script.starts_with("docs/");
            let is_script = is_check && fs::read(path).unwrap().starts_with(b"#!");
            let named = format!("`{script}`");
            let mut promises = PROMISES.iter().map(|[_, promised, ..]| promised);
            if is_script && !promises.any(|promised| promised.contains(&named)) {
                failures.push(format!("{document}: no step is listed for {script}"));
            }
        }
    }
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

/// The places of SECURITY: folders, or files.
#[test]
fn unsafe_code_is_where_it_is_promised() {
    let page = text(SECURITY);
    let (_, places) = page.split_once("Unsafe code is confined to").unwrap();
    let (places, _) = places.split_once("Each block").unwrap();
    let places = places.split('`').filter(|place| place.starts_with("src/"));
    let places = places.collect::<Vec<_>>();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join("src")];
    let mut elsewhere = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(root).unwrap().display().to_string();
            let is_named = places.iter().any(|place| name.starts_with(place));
            if name.ends_with(".rs") && !is_named {
                let text = text(&name);
                let lines = text.lines().map(str::trim_start);
                let mut code = lines.filter(|line| !line.starts_with("//"));
                let is_unsafe = |line: &str| line.split(' ').any(|word| word == "unsafe");
                if code.any(is_unsafe) {
                    elsewhere.push(name);
                }
            }
        }
    }
    assert!(elsewhere.is_empty(), "{SECURITY} names no {elsewhere:?}");
}
