//! The shell examples of README and docs. Every line with `svl` runs, in a folder with small inputs
//! under the names in the examples, or is at least parsed, for a reason given here.

use super::cli::fixture::{Fixture, datasets, pgm};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use svl::arena::{Arena, ArenaConfig};
use svl::files::write_png;

/// Lines with this beginning are parsed but not run, for this reason.
const PARSED: &[(&str, &str)] = &[
    ("svl record v4l2:", "needs cameras"),
    (
        "svl record genicam:",
        "needs cameras, and a feature that is off",
    ),
    (
        "svl record sim:right.jitter_ms=10 --rate 60 --trigger serial:",
        "needs a controller",
    ),
    (
        "svl record both.mp4",
        "needs a video; cli::own_data has one",
    ),
    (
        "svl record . --left left.mp4",
        "needs videos; cli::own_data has them",
    ),
    ("svl datasets fetch", "needs the network"),
    (
        "svl train cells scenarios/arena.toml scenarios/arena-row.toml",
        "takes minutes; cli::train is a short one",
    ),
    ("svl view", "opens a window"),
    (
        "svl label checkpoints",
        "needs a terminal; cli::label drives it",
    ),
    (
        "svl label windows",
        "needs a terminal; cli::filter drives it",
    ),
    (
        "svl tune",
        "needs a terminal, or minutes; cli::tune drives it",
    ),
    (
        "svl train filter",
        "takes minutes; cli::filter has short ones",
    ),
    (
        "svl score scenarios/floor.toml",
        "trains first; cli::filter has a short one",
    ),
    (
        "svl score scenarios/drive.toml",
        "takes minutes; cli::drive has a short one",
    ),
    ("svl merge part1 part2", "cli::shard merges parts"),
    (
        "svl score scenarios/close.toml",
        "trains first; cli::filter has a short one",
    ),
    (
        "svl replay run.mcap --algo v3 --filter",
        "needs a filter; cli::filter trains one",
    ),
    (
        "svl replay run.mcap --algo v3 --rerun spawn",
        "opens a window",
    ),
    (
        "svl score scenarios/arena.toml --gate",
        "the short arena breaks limits",
    ),
    (
        "svl score scenarios/middeval3.toml",
        "needs a data set that is fetched",
    ),
    (
        "svl score scenarios/kitti2015.toml",
        "needs a data set that is fetched",
    ),
    (
        "svl score scenarios/middlebury.toml",
        "takes seconds; cli::score runs it",
    ),
    ("svl reproduce", "takes seconds; cli::reproduce runs it"),
    ("svl bench", "takes seconds; cli::bench runs it"),
    (
        "svl calibrate board",
        "takes seconds; cli::calibrate_board runs it",
    ),
    (
        "svl calibrate convert mav0",
        "lean::calibration_files reads EuRoC's files",
    ),
    (
        "svl match left.png right.png --algo \"exec:",
        "needs OpenCV; cli::exec runs it",
    ),
    (
        "svl score arena --every 10",
        "needs a network; cli::adapters has small ones",
    ),
];

/// Replacements that make a line fast.
const SHORTER: [(&str, &str); 5] = [
    (" --duration 60", ""),
    ("svl score arena ", "svl score scenarios/arena.toml "),
    ("svl record arena", "svl record --frames 4 arena"),
    (
        "svl record sim:",
        "svl record --frames 4 sim:pictures=4,size=160x120,",
    ),
    (
        "svl record sim ",
        "svl record --frames 4 sim:pictures=4,size=160x120 ",
    ),
];

/// Other programs of the examples.
const OTHERS: [&str; 12] = [
    "cargo",
    "apt-get",
    "sysctl",
    "make",
    "bash",
    "fuzz/run",
    "pip",
    "python3",
    "dpkg",
    "tar",
    "packaging/build.sh",
    "snakemake",
];

/// Commands that make the inputs of the examples from `left.png`, `right.png`, `pictures/` and
/// `calib.txt`.
const INPUTS: &str = "
svl record --frames 4 -o run.mcap
svl replay run.mcap --algo v3 -o result.mcap
svl record run.mcap --ros2 -o bag.mcap
svl record pictures/ -o raw.mcap
cp raw.mcap other.mcap
svl calibrate convert calib.txt calib.xml
head -c 200000 run.mcap >killed.mcap
svl match left.png right.png -o d.png
svl match left.png right.png -o d.pfm
cp d.pfm disparity.pfm; cp d.pfm disp0GT.pfm; cp d.png truth.png
cp left.png disp2.png; cp right.png disp6.png
mkdir results disp_occ_0 obj_map
cp d.png results/0.png; cp d.png disp_occ_0/0.png; cp left.png obj_map/0.png
svl score scenarios/arena.toml --algo v3 -o reports/before
cp -r reports/before reports/after";

const CALIBRATION: &str = "\
cam0=[300 0 159.5; 0 300 119.5; 0 0 1]
cam1=[300 0 159.5; 0 300 119.5; 0 0 1]
doffs=0
baseline=44
width=320
height=240
ndisp=80
";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn documents() -> Vec<PathBuf> {
    let mut documents = Vec::new();
    for folder in ["", "docs", "recordings", "reports", "firmware", "fuzz"] {
        let entries = fs::read_dir(root().join(folder)).into_iter().flatten();
        let files = entries.map(|entry| entry.unwrap().path());
        documents.extend(files.filter(|file| file.extension().is_some_and(|e| e == "md")));
    }
    documents.sort();
    documents
}

/// The lines of a document's shell blocks, without their comments.
fn shell(text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    for block in text.split("```sh\n").skip(1) {
        let block = block.split("\n```").next().unwrap().replace("\\\n", " ");
        for line in block.lines() {
            let command = line.split(" #").next().unwrap().trim();
            if !command.is_empty() && !command.starts_with('#') {
                lines.push(command.replace("cargo run --release -- ", "svl "));
            }
        }
    }
    lines
}

/// Runs a line in `folder`, with the svl under test.
fn bash(folder: &Path, line: &str) -> Output {
    let svl = assert_cmd::cargo::cargo_bin!("svl");
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", svl.parent().unwrap().display());
    let mut command = Command::new("bash");
    command
        .args(["-ec", line])
        .current_dir(folder)
        .env("PATH", path);
    command.output().unwrap()
}

fn inputs() -> Fixture {
    let fixture = Fixture::new();
    for entry in fs::read_dir(root().join("scenarios")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        fixture.write(&format!("scenarios/{name}"), fs::read(&path).unwrap());
    }
    fixture.write_short_arena("scenarios/arena.toml", 2);
    fixture.write("calib.txt", CALIBRATION);
    fixture.write("mask0nocc.png", pgm(320, 240, &[255; 320 * 240]));
    let arena = Arena::new(&ArenaConfig::default(), 1).unwrap();
    for side in ["left", "right"] {
        fs::create_dir_all(fixture.path(&format!("pictures/{side}"))).unwrap();
    }
    for i in 0..2 {
        let pair = arena.frame(60 * i).unwrap().pair;
        for (side, image) in [("left", pair.left()), ("right", pair.right())] {
            let file = fixture.path(&format!("pictures/{side}/{i}.png"));
            let pixels = image.pixels().collect::<Vec<_>>();
            write_png(&file, image.width(), image.height(), &pixels).unwrap();
            fs::copy(file, fixture.path(&format!("{side}.png"))).unwrap();
        }
    }
    let made = bash(&fixture.path(""), INPUTS);
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
    fixture
}

/// The fault of a line.
fn failure(line: &str, folder: &Path) -> Option<String> {
    let program = line.split(' ').next().unwrap();
    if program != "svl" && program != "cp" {
        let known = OTHERS.contains(&program);
        return (!known).then(|| format!("'{program}' is not among the known programs"));
    }
    let mut command = line.to_owned();
    if PARSED
        .iter()
        .any(|(beginning, _)| line.starts_with(beginning))
    {
        command += " --help";
    } else if line.contains("DATASETS") && datasets().is_none() {
        return None;
    } else {
        for (long, short) in SHORTER {
            command = command.replace(long, short);
        }
        // An input of that name is the output of the line.
        if let Some((_, output)) = line.split_once(" -o ") {
            let output = output.split(' ').next().unwrap();
            let _ = fs::remove_file(folder.join(output));
        }
    }
    let ran = bash(folder, &command);
    let stderr = String::from_utf8_lossy(&ran.stderr);
    (!ran.status.success()).then(|| format!("{command}\n{stderr}"))
}

#[cfg(unix)]
#[test]
fn shell_examples_run() {
    let inputs = inputs();
    let check = |document: &PathBuf| {
        let folder = Fixture::new();
        let (from, to) = (inputs.path(""), folder.path(""));
        let copied = Command::new("cp")
            .arg("-r")
            .arg(from.join("."))
            .arg(&to)
            .status();
        assert!(copied.unwrap().success());
        if let Some(data) = datasets() {
            let data = data.canonicalize().unwrap();
            std::os::unix::fs::symlink(data, to.join("DATASETS")).unwrap();
        }
        let text = fs::read_to_string(document).unwrap();
        let failures = shell(&text)
            .into_iter()
            .filter_map(|line| failure(&line, &to));
        let name = document.strip_prefix(root()).unwrap().display().to_string();
        failures
            .map(|failure| format!("{name}: {failure}"))
            .collect::<Vec<_>>()
    };
    let documents = documents();
    let failures = std::thread::scope(|scope| {
        let checks = documents
            .iter()
            .map(|document| scope.spawn(|| check(document)));
        let checks = checks.collect::<Vec<_>>();
        checks
            .into_iter()
            .flat_map(|check| check.join().unwrap())
            .collect::<Vec<_>>()
    });
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

#[test]
fn the_readme_is_short() {
    let text = fs::read_to_string(root().join("README.md")).unwrap();
    assert!(text.lines().count() <= 150, "move details to docs/");
}

#[test]
fn every_reason_is_needed() {
    let texts = documents()
        .into_iter()
        .map(|file| fs::read_to_string(file).unwrap());
    let lines = texts.flat_map(|text| shell(&text)).collect::<Vec<_>>();
    for (beginning, _) in PARSED {
        assert!(
            lines.iter().any(|line| line.starts_with(beginning)),
            "no example: {beginning}"
        );
    }
}

/// Links between the documents, and to files, are valid, also in the users' package.
#[test]
fn links_lead_to_files() {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let excluded = manifest
        .lines()
        .find_map(|line| line.strip_prefix("exclude = "))
        .unwrap();
    let excluded = excluded.split('"').filter(|path| path.starts_with('/'));
    let excluded = excluded
        .map(|path| root().join(&path[1..]))
        .collect::<Vec<_>>();
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        for link in text.split("](").skip(1) {
            let link = link.split([')', '#']).next().unwrap();
            if link.starts_with("http") || link.is_empty() {
                continue;
            }
            let name = format!("{}: {link}", document.display());
            let target = document.parent().unwrap().join(link).canonicalize();
            let target = target.unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!(
                !excluded.iter().any(|path| target.starts_with(path)),
                "{name}: not packaged"
            );
        }
    }
}

#[test]
fn rust_examples_are_doctests() {
    let library = fs::read_to_string(root().join("src/lib.rs")).unwrap();
    for document in documents() {
        let name = document.strip_prefix(root()).unwrap().display().to_string();
        let has_rust = fs::read_to_string(&document).unwrap().contains("```rust");
        let is_listed = library.contains(&format!("include_str!(\"../{name}\")"));
        assert!(
            !has_rust || is_listed,
            "{name}: its Rust examples are in no doctest"
        );
    }
}

#[test]
fn the_page_of_tables_is_what_svl_columns_prints() {
    let page = Fixture::new().run("columns --markdown");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tables.md");
    let kept = fs::read_to_string(path).unwrap();
    assert!(page == kept, "svl columns --markdown > docs/tables.md");
}
