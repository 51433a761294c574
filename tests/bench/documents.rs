//! The shell examples of README and docs. Every line with `svl` runs, in a folder with small inputs
//! under the names in the examples, or is at least parsed, for a reason given here.

use super::cli::adapters::python_with;
use super::cli::fixture::{Fixture, datasets, pgm};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use svl::arena::{Arena, ArenaConfig};
use svl::files::write_png;
use svl::source::Chain;

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
    ("svl record both.mp4", "needs a video; cli::videos has one"),
    (
        "svl record . --left left.mp4",
        "needs videos; cli::videos has them",
    ),
    ("svl record ros2:", "needs live topics; ros2:: has some"),
    ("svl replay ros2:", "needs live topics; ros2:: has some"),
    ("svl info ros2:", "needs live topics; ros2:: has some"),
    (
        "svl replay run.mcap --publish",
        "needs a network; ros2:: has one",
    ),
    (
        "svl replay run.mcap --verify=live.csv",
        "cli::replay has such rows",
    ),
    (
        "svl score pictures/ --truth 'd",
        "cli::folder_truth has such images",
    ),
    (
        "svl score drive_0001_sync/",
        "cli::folder_truth has such a folder",
    ),
    ("svl score 2011_09_26/", "cli::kitti_raw has such a drive"),
    (
        "svl score drive.mcap",
        "recording::recorded_depth follows the page",
    ),
    ("svl calibrate check drive.mcap", "cli::estimates runs it"),
    (
        "svl info drive.mcap",
        "recording::recorded_depth follows the page",
    ),
    (
        "svl report today",
        "recording::recorded_depth follows the page",
    ),
    (
        "svl score depth.toml",
        "recording::recorded_depth follows the page",
    ),
    (
        "svl score scenarios/pieces.toml",
        "takes minutes; cli::pieces has a short one",
    ),
    (
        "svl score arena --algo v5 --algo \"net=exec",
        "needs a network; cli::adapters has one",
    ),
    (
        "svl score approach*.mcap",
        "cli::pieces has such a recording",
    ),
    ("svl train v5", "takes minutes; cli::train is a short one"),
    ("svl view", "opens a window"),
    (
        "svl label checkpoints",
        "needs a terminal; cli::label drives it",
    ),
    (
        "svl label windows",
        "needs a terminal; cli::filter drives it",
    ),
    ("svl tune", "needs a terminal; cli::tune drives it"),
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
    ("svl report part1 part2", "cli::shard joins parts"),
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
    ("svl score arena --gate", "the short arena breaks limits"),
    ("svl score scenarios/middeval3.toml", "needs its data set"),
    ("svl score scenarios/kitti2015.toml", "needs its data set"),
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
        "svl score arena --algo v5 --algo \"mine=exec",
        "needs numpy; cli::adapters runs such a matcher",
    ),
    (
        "svl score arena --every 10",
        "needs a network; cli::adapters has small ones",
    ),
];

/// Replacements that make a line fast.
const SHORTER: [(&str, &str); 6] = [
    (" --seeds 1001..1020 --every 2", " --seeds 1001 --every 8"),
    (" --duration 60", ""),
    ("svl score arena", "svl score scenarios/arena.toml"),
    ("svl record arena", "svl record --frames 4 arena"),
    (
        "svl record sim:",
        "svl record --frames 4 --allow-loss 100% sim:pictures=4,size=160x120,",
    ),
    (
        "svl record sim ",
        "svl record --frames 4 --allow-loss 100% sim:pictures=4,size=160x120 ",
    ),
];

/// Other programs of the examples.
const OTHERS: [&str; 21] = [
    "cargo",
    "docker",
    "src/c/install.sh",
    "rustup",
    "export",
    "cc",
    "tests/aarch64.sh",
    "tests/aarch64/instructions.sh",
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
    "curl",
    "7z",
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
mkdir -p MiddEval3/trainingQ/Teddy results/Teddy
cp disp0GT.pfm MiddEval3/trainingQ/Teddy/; cp d.pfm results/Teddy/disp0v5.pfm
cp d.png results/0.png; cp d.png disp_occ_0/0.png; cp left.png obj_map/0.png
svl score scenarios/arena.toml --algo v3 -o reports/before
svl train v5 scenarios/arena.toml --seeds 1..2 --tables-only -o own.safetensors
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

/// Folders with documents.
const FOLDERS: [&str; 8] = [
    "",
    "docs",
    "docs/results",
    "docs/tutorials",
    "firmware",
    "fuzz",
    "recordings",
    "reports",
];

/// Pages of reference: they may be longer than a page to read. So may results.
const REFERENCES: [&str; 4] = [
    "CHANGELOG.md",
    "docs/scenario.md",
    "docs/tables.md",
    "firmware/README.md",
];

fn documents() -> Vec<PathBuf> {
    let mut documents = Vec::new();
    for folder in FOLDERS {
        let entries = fs::read_dir(root().join(folder)).into_iter().flatten();
        let files = entries.map(|entry| entry.unwrap().path());
        documents.extend(files.filter(|file| file.extension().is_some_and(|e| e == "md")));
    }
    documents.sort();
    documents
}

/// A fenced block of a document.
enum Block<'a> {
    /// The commands of a shell block, without their comments.
    Commands(Vec<String>),
    /// A file that the text before it names: "as `NAME`:".
    File(&'a str, &'a str),
    /// Lines that the commands before it print, among others.
    Output(&'a str),
}

fn blocks(text: &str) -> Vec<Block<'_>> {
    let mut blocks = Vec::new();
    let mut rest = text;
    while let Some((before, fenced)) = rest.split_once("```") {
        let (language, fenced) = fenced.split_once('\n').unwrap();
        let (body, after) = fenced.split_once("```").expect("an unclosed block");
        let named = before.trim_end().strip_suffix("`:");
        let name = named.and_then(|words| words.rsplit_once('`')).unzip().1;
        match (language, name) {
            ("sh", _) => blocks.push(Block::Commands(commands(body))),
            ("text", _) => blocks.push(Block::Output(body)),
            (_, Some(name)) => blocks.push(Block::File(name, body)),
            _ => {}
        }
        rest = after;
    }
    blocks
}

/// The loops of a page in several languages, each with the program that has it, and its indent.
const LOOPS: [(&str, &str, &str); 4] = [
    (
        "rust,ignore",
        "src/core/examples/stop_for_obstacles.rs",
        "    ",
    ),
    ("c", "src/c/examples/stop.c", "    "),
    ("cpp", "src/c/examples/stop.cpp", "    "),
    ("python", "examples/python/stop.py", ""),
];

#[test]
fn the_loops_of_the_library_are_those_of_programs() {
    let text = |path: &str| fs::read_to_string(root().join(path)).unwrap();
    let page = text("docs/library.md");
    for (language, program, indent) in LOOPS {
        let (_, block) = page.split_once(&format!("```{language}\n")).unwrap();
        let (block, _) = block.split_once("```").unwrap();
        for part in block.split("\n\n") {
            let lines = part.lines().map(|line| format!("{indent}{line}\n"));
            assert!(
                text(program).contains(&lines.collect::<String>()),
                "{program}: {part}"
            );
        }
        assert!(block.lines().count() <= 20, "{program}");
    }
}

fn commands(block: &str) -> Vec<String> {
    let block = block.replace("\\\n", " ");
    let commands = block.lines().map(|line| line.split(" #").next().unwrap());
    let commands = commands.map(|line| line.trim().replace("cargo run --release -- ", "svl "));
    commands
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .collect()
}

/// All commands of a document.
fn shell(text: &str) -> Vec<String> {
    let commands = |block| match block {
        Block::Commands(commands) => commands,
        Block::File(..) | Block::Output(_) => Vec::new(),
    };
    blocks(text).into_iter().flat_map(commands).collect()
}

/// Runs a line in `folder`, with the svl under test and the programs of `folder/bin`.
fn bash(folder: &Path, line: &str) -> Output {
    let svl = assert_cmd::cargo::cargo_bin!("svl");
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", svl.parent().unwrap().display());
    let path = format!("{}:{path}", folder.join("bin").display());
    let mut command = Command::new("bash");
    command
        .args(["-ec", line])
        .current_dir(folder)
        .env("PATH", path);
    command.output().unwrap()
}

/// Writes what the documents name into `inputs`.
fn write_inputs(fixture: &Fixture) {
    for entry in fs::read_dir(root().join("scenarios")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        fixture.write(
            &format!("inputs/scenarios/{name}"),
            fs::read(&path).unwrap(),
        );
    }
    fixture.write_short_arena("inputs/scenarios/arena.toml", 2);
    fixture.write("inputs/calib.txt", CALIBRATION);
    fixture.write("inputs/mask0nocc.png", pgm(320, 240, &[255; 320 * 240]));
    let arena = Arena::new(&ArenaConfig::default(), 1).unwrap();
    for side in ["left", "right"] {
        fs::create_dir_all(fixture.path(&format!("inputs/pictures/{side}"))).unwrap();
    }
    for i in 0..2 {
        let pair = arena.frame(60 * i).unwrap().pair;
        for (side, image) in [("left", pair.left()), ("right", pair.right())] {
            let file = fixture.path(&format!("inputs/pictures/{side}/{i}.png"));
            let pixels = image.pixels().collect::<Vec<_>>();
            write_png(&file, image.width(), image.height(), &pixels).unwrap();
            fs::copy(file, fixture.path(&format!("inputs/{side}.png"))).unwrap();
        }
    }
    let made = bash(&fixture.path("inputs"), INPUTS);
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
}

/// Output of a line that was run, or its failure.
fn ran(line: &str, folder: &Path) -> Result<String, String> {
    let mut words = line.split(' ');
    let (program, first) = (words.next().unwrap(), words.next().unwrap_or_default());
    let is_script = program == "python3" && folder.join(first).is_file();
    if !["svl", "cp", "mkdir"].contains(&program) && !is_script {
        let known = OTHERS.contains(&program);
        let unknown = || format!("'{program}' is not among the known programs");
        return if known {
            Ok(String::new())
        } else {
            Err(unknown())
        };
    }
    let mut command = line.to_owned();
    if PARSED
        .iter()
        .any(|(beginning, _)| line.starts_with(beginning))
    {
        command += " --help";
    } else if line.contains("DATASETS") && datasets().is_none() {
        return Ok(String::new());
    } else {
        if !line.contains("--frames") {
            for (long, short) in SHORTER {
                command = command.replace(long, short);
            }
        }
        // An input of that name is the output of the line.
        if let Some((_, output)) = line.split_once(" -o ") {
            let output = output.split(' ').next().unwrap();
            let _ = fs::remove_file(folder.join(output));
        }
    }
    let ran = bash(folder, &command);
    let stdout = String::from_utf8_lossy(&ran.stdout);
    let stderr = String::from_utf8_lossy(&ran.stderr);
    if ran.status.success() {
        Ok(format!("{stdout}\n{stderr}"))
    } else {
        Err(format!("{command}\n{stderr}"))
    }
}

/// Failures of a document's commands. A tutorial also prints what it shows.
fn failures(document: &Path, folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(document).unwrap();
    let is_tutorial = document.parent().unwrap().ends_with("tutorials");
    if is_tutorial && text.contains("onnxruntime") {
        let Some(python) = python_with("numpy, onnx, onnxruntime") else {
            return Vec::new();
        };
        fs::create_dir(folder.join("bin")).unwrap();
        let wrapper = format!("printf '#!/bin/sh\nexec {python} \"$@\"\n' >bin/python3");
        let made = bash(folder, &format!("{wrapper}; chmod +x bin/python3"));
        assert!(made.status.success());
    }
    let (mut failures, mut printed) = (Vec::new(), String::new());
    for block in blocks(&text) {
        match block {
            Block::Commands(commands) => {
                printed.clear();
                for command in commands {
                    match ran(&command, folder) {
                        Ok(text) => printed += &text,
                        Err(failure) => failures.push(failure),
                    }
                }
            }
            Block::File(name, text) => fs::write(folder.join(name), text).unwrap(),
            Block::Output(shown) if is_tutorial => {
                // Columns are as wide as their cells, times among them.
                let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
                let printed = printed.lines().map(words).collect::<Vec<_>>();
                let is_printed = |line: &&str| *line == "…" || printed.contains(&words(line));
                let absent = shown.lines().filter(|line| !is_printed(line));
                failures.extend(
                    absent.map(|line| format!("not printed: {line}\n{}", printed.join("\n"))),
                );
            }
            Block::Output(_) => {}
        }
    }
    failures
}

#[cfg(unix)]
parts! {
    // Shell examples of all documents run, each document in a folder of its own.
    |part| shell_examples_run(part, 8);
    shell_examples_1 = 0, shell_examples_2 = 1, shell_examples_3 = 2, shell_examples_4 = 3,
    shell_examples_5 = 4, shell_examples_6 = 5, shell_examples_7 = 6, shell_examples_8 = 7,
}

/// Runs the examples of one of `parts` parts of the documents.
fn shell_examples_run(part: usize, parts: usize) {
    let mut failed = Vec::new();
    for document in documents().iter().skip(part).step_by(parts) {
        let text = fs::read_to_string(document).unwrap();
        if shell(&text).is_empty() {
            continue;
        }
        let folder = Fixture::new();
        folder.write_made("inputs", "inputs of documents", write_inputs);
        let to = folder.path("inputs");
        if let Some(data) = datasets() {
            let data = data.canonicalize().unwrap();
            std::os::unix::fs::symlink(data, to.join("DATASETS")).unwrap();
        }
        let name = name(document);
        let own = failures(document, &to).into_iter();
        failed.extend(own.map(|failure| format!("{name}: {failure}")));
    }
    assert!(failed.is_empty(), "\n{}", failed.join("\n"));
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

/// Name of a document, from the root.
fn name(document: &Path) -> String {
    document.strip_prefix(root()).unwrap().display().to_string()
}

/// Rows of tables that are generated, or compared with the code, may be wider than a page.
#[test]
fn pages_are_short_and_narrow() {
    let mut failures = Vec::new();
    for document in documents() {
        let (text, name) = (fs::read_to_string(&document).unwrap(), name(&document));
        let is_result = name.starts_with("docs/results/");
        let words = text.split_whitespace().count();
        if words > 1500 && !is_result && !REFERENCES.contains(&name.as_str()) {
            failures.push(format!("{name}: {words} words; split it"));
        }
        let has_wide_rows = is_result || name == "docs/tables.md";
        for (i, line) in text.lines().enumerate() {
            let may_be_wide = has_wide_rows && line.starts_with('|');
            if line.chars().count() > 120 && !may_be_wide {
                failures.push(format!("{name}:{}: more than 120 columns", i + 1));
            }
        }
    }
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

/// Anchors of a document's headings.
fn anchors(text: &str) -> Vec<String> {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let is_kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    let anchor = |heading: &str| {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(is_kept).collect::<String>();
        kept.replace(' ', "-")
    };
    headings.map(anchor).collect()
}

/// Links lead to files and headings.
#[test]
fn links_lead_somewhere() {
    let mut failures = Vec::new();
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        for link in text.split("](").skip(1) {
            let link = link.split(')').next().unwrap();
            if link.starts_with("http") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => Ok(document.clone()),
                file => document.parent().unwrap().join(file).canonicalize(),
            };
            let at = format!("{}: {link}", name(&document));
            let Ok(target) = target else {
                failures.push(format!("{at}: no such file"));
                continue;
            };
            let has_anchor = || {
                let text = fs::read_to_string(&target).unwrap();
                anchors(&text).iter().any(|known| known == anchor)
            };
            if !anchor.is_empty() && !has_anchor() {
                failures.push(format!("{at}: no such heading"));
            }
        }
    }
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

#[test]
fn rust_examples_are_doctests() {
    let library = fs::read_to_string(root().join("src/lib.rs")).unwrap();
    for document in documents() {
        let name = name(&document);
        let has_rust = fs::read_to_string(&document).unwrap().contains("```rust");
        let is_listed = library.contains(&format!("include_str!(\"../{name}\")"));
        assert!(
            !has_rust || is_listed,
            "{name}: its Rust examples are in no doctest"
        );
    }
}

#[test]
fn the_drawn_chain_is_that_of_the_program() {
    let page = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let (_, drawn) = page.split_once("in a Chain: ").unwrap();
    let (drawn, _) = drawn.split_once("```").unwrap();
    let is_between = |c: char| c == '·' || c.is_whitespace();
    let drawn = drawn.split(is_between).filter(|layer| !layer.is_empty());
    assert_eq!(drawn.collect::<Vec<_>>(), Chain::LAYERS);
}

#[test]
fn the_page_of_tables_is_what_svl_columns_prints() {
    let page = Fixture::new().run("columns --markdown");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tables.md");
    let kept = fs::read_to_string(path).unwrap();
    assert!(page == kept, "svl columns --markdown > docs/tables.md");
}
