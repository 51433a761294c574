//! Commands that messages offer as the cure: each one in the sources runs here with files of its
//! kind, or is listed with the reason why it does not.

use super::fixture::has;
use super::messages::inputs;
use crate::recording::bag;
use std::collections::BTreeSet;
use std::path::Path;

/// What is done with a command.
enum Cure {
    /// A command of svl of that form succeeds.
    Run(&'static str),
    /// A shell's line does where its program is installed, and then a command of svl.
    Shell(&'static str, &'static str),
    /// The first command of svl names the option; the second has it, and succeeds.
    Given(&'static str, &'static str),
    /// Nothing, for this reason.
    Left(&'static str),
}
use Cure::{Given, Left, Run, Shell};

/// The options that messages of sources name.
const OPTIONS: &[(&str, Cure)] = &[
    (
        "--calib",
        Given("info raw.mcap", "replay raw.mcap --calib mav0 --algo v3"),
    ),
    (
        "--fps",
        Given("record plain -o pl.mcap", "record plain --fps 10 -o f.mcap"),
    ),
    (
        "--left",
        Given("info three.mcap", "info three.mcap --left /a --right /b"),
    ),
    (
        "--right",
        Given(
            "info three.mcap",
            "record three.mcap --left /a --right /b -o n.mcap",
        ),
    ),
    ("--left-info", Left("recording::names runs it")),
    ("--right-info", Left("recording::names runs it")),
    (
        "--max-skew-ms",
        Given(
            "info skewed.mcap",
            "record skewed.mcap --max-skew-ms 9 -o k.mcap",
        ),
    ),
    (
        "--side-by-side",
        Given(
            "info wide.mcap",
            "record wide.mcap --side-by-side -o w.mcap",
        ),
    ),
    ("--allow-loss", Left("recording::clocks runs it")),
    ("--every", Left("recording::clocks runs it")),
    ("--right-offset-ms", Left("recording::clocks runs it")),
    ("--stamps", Left("recording::clocks runs it")),
    ("--camera-height", Left("recording::floor runs it")),
    ("--truth", Left("recording::depth_units runs it")),
    (
        "--from",
        Left("leaves a part out; cli::score_recordings has it"),
    ),
    (
        "--to",
        Left("leaves a part out; cli::score_recordings has it"),
    ),
    ("--pairing", Left("needs cameras; bench::grab has it")),
    ("--trigger", Left("needs cameras; bench::grab has it")),
    ("--scale", Left("cli::matching runs it")),
    ("--estimate-scale", Left("is of eval; cli::eval has it")),
    ("--alpha", Left("is refused where it is named")),
    ("--bits", Left("is refused where it is named")),
];

/// The commands as the sources write them, in the order in which they run.
const CURES: &[(&str, Cure)] = &[
    ("svl algos", Run("algos")),
    ("svl algos {algorithm}", Run("algos v3")),
    ("svl bench", Left("cli::bench runs it")),
    ("svl calibrate check", Run("calibrate check a.mcap")),
    (
        "svl calibrate convert --rectify",
        Run("calibrate convert cv.yml k.txt --to kitti --rectify --unit m"),
    ),
    (
        "svl calibrate convert --unit",
        Run("calibrate convert cv.yml u.yaml --unit m"),
    ),
    (
        "svl calibrate convert --unit squares=SIDE_IN_METRES",
        Run("calibrate convert cv.yml s.xml --unit squares=0.03"),
    ),
    ("svl columns metrics", Run("columns metrics")),
    ("svl compare", Left("cli::compare runs it")),
    ("svl compare BASE OTHER", Left("cli::compare runs it")),
    ("svl datasets --data {shown}", Run("datasets --data .")),
    ("svl help sources", Run("help sources")),
    ("svl info", Run("info a.mcap")),
    ("svl info {name}", Run("info pairs")),
    ("svl match LEFT RIGHT", Left("cli::matching runs it")),
    ("svl record", Run("record --frames 2 -o r.mcap")),
    (
        "svl record --calib FILE --alpha 1",
        Run("record mav0 --calib mav0 --alpha 1 -o e.mcap"),
    ),
    ("svl record --list", Run("record --list")),
    ("svl record FOLDER", Run("record pairs -o p.mcap")),
    ("svl recover", Run("recover cut.mcap -o cut2.mcap")),
    (
        "svl recover {} -o OUT.mcap",
        Run("recover cut.mcap -o whole.mcap"),
    ),
    ("svl replay", Run("replay whole.mcap --algo v3")),
    (
        "svl replay -o RESULT.mcap",
        Run("replay a.mcap --algo v3 -o result.mcap"),
    ),
    (
        "svl replay --rows ROWS.csv",
        Run("replay result.mcap --algo v3 --rows r.csv"),
    ),
    (
        "svl score",
        Run("score short.toml --algo v3 --rerun none -o out"),
    ),
    ("svl score --gate", Left("cli::score runs it")),
    (
        "svl score --near",
        Run("score short.toml --algo v3 --near 0.6 --rerun none -o near"),
    ),
    (
        "svl score --ranges",
        Run("score short.toml --algo v3 --ranges 1,2 --rerun none -o ranges"),
    ),
    (
        "svl score {name}",
        Run("score a.mcap --algo v3 --rerun none -o own"),
    ),
    (
        "svl score arena --print-scenario",
        Run("score arena --print-scenario"),
    ),
    (
        "svl score arena --seeds 1..3 --algo v3:texture_delta=3/3.35/4",
        Run("score short.toml --seeds 1..2 --algo v3:texture_delta=3/3.35/4 --rerun none -o t"),
    ),
    (
        "svl score FOLDER",
        Run("score pairs --algo v3 --rerun none -o folder"),
    ),
    (
        "svl view {shown}",
        Left("needs the viewer; rerun:: opens runs"),
    ),
    ("svl report", Run("report out")),
    ("svl report {folder}", Run("report out")),
    ("svl report {shown}", Run("report own")),
    (
        "tar xf FILE -C FOLDER",
        Shell(
            "mkdir tar && tar cf p.tar pairs && tar xf p.tar -C tar",
            "info tar/pairs",
        ),
    ),
    (
        "ffmpeg -i IN -r HZ OUT",
        Shell(
            "ffmpeg -v error -f lavfi -i testsrc=size=64x48:rate=9:d=1 in.mkv && \
             ffmpeg -v error -i in.mkv -r 5 out.mkv",
            "record out.mkv --side-by-side -o v.mcap",
        ),
    ),
    (
        "ffmpeg -i IN -vf hflip OUT",
        Shell(
            "ffmpeg -v error -y -i pairs/right/1700000000.pgm -vf hflip m.pgm",
            "match pairs/left/1700000000.pgm m.pgm --algo v3 -o m.pfm",
        ),
    ),
    (
        "ffmpeg -i IN -vf hflip,vflip OUT",
        Left("as that with hflip; a longer filter"),
    ),
    ("ffmpeg -i IN -vf {filter} OUT", Left("as that with hflip")),
    (
        "sqlite3 FILE .recover",
        Shell(
            "sqlite3 cut.db3 .recover | sqlite3 whole.db3",
            "info whole.db3",
        ),
    ),
    ("svl calibrate board", Left("cli::calibrate_board runs it")),
    (
        "svl calibrate convert --model equidistant",
        Left("lean::calibration_files reads such a file"),
    ),
    (
        "svl calibrate convert --size WxH",
        Left("lean::calibration_files reads such a file"),
    ),
    ("svl label", Left("needs a terminal; cli::label drives it")),
    (
        "svl label checkpoints",
        Left("needs a terminal; cli::label drives it"),
    ),
    (
        "svl label windows",
        Left("needs a terminal; cli::filter drives it"),
    ),
    (
        "svl label windows {path} --kind {kind} -o {table}",
        Left("needs a terminal; cli::filter drives it"),
    ),
    (
        "svl record FOLDER --left LEFT.mp4 --right RIGHT.mp4",
        Left("cli::videos has them"),
    ),
    ("svl report PART… -o FOLDER", Left("cli::shard joins parts")),
    ("svl score --shard I/N", Left("cli::shard has such parts")),
    (
        "svl train filter",
        Left("takes minutes; cli::filter has short ones"),
    ),
    (
        "svl train v5",
        Left("takes minutes; cli::train is a short one"),
    ),
    ("svl tune", Left("needs a terminal; cli::tune drives it")),
    (
        "svl tune RECORDING --algo v3",
        Left("needs a terminal; cli::tune drives it"),
    ),
    ("svl view", Left("opens a window")),
    ("apt install ffmpeg", Left("installs a program")),
    (
        "cargo install --locked --path . --features rerun",
        Left("installs a program"),
    ),
    (
        "cargo install --locked --path . --features ros2",
        Left("installs a program"),
    ),
    (
        "pip install rerun-sdk=={version}",
        Left("installs a program"),
    ),
    (
        "mcap sort FILE -o SORTED.mcap",
        Left("needs Foxglove's program"),
    ),
    ("ros2 bag convert", Left("needs ROS 2")),
    ("ros2 bag record", Left("needs ROS 2")),
    ("ros2 bag reindex {shown}", Left("needs ROS 2")),
    ("rosbag decrypt", Left("needs ROS 1")),
    ("rosbag fix {bag} NEW.bag", Left("needs ROS 1")),
    (
        "sudo sysctl -w net.core.rmem_max={RECEIVE_BYTES}",
        Left("changes the machine"),
    ),
    (
        "sudo usermod -aG dialout $USER",
        Left("changes the machine"),
    ),
];

/// Programs whose commands are cures.
const PROGRAMS: &[&str] = &[
    "svl",
    "apt",
    "cargo",
    "ffmpeg",
    "mcap",
    "pip",
    "ros2",
    "rosbag",
    "rosbags-convert",
    "sqlite3",
    "sudo",
    "tar",
];

/// Adds the cures in the literals of a folder's sources, by their lines.
fn add_offered(folder: &Path, cures: fn(&str) -> Vec<String>, offered: &mut BTreeSet<String>) {
    for path in std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
    {
        if path.is_dir() {
            add_offered(&path, cures, offered);
        } else if path.extension().is_some_and(|ending| ending == "rs")
            && !path.ends_with("tests.rs")
        {
            let text = std::fs::read_to_string(&path).unwrap();
            let text = text.split("#[cfg(test)]").next().unwrap_or_default();
            let lines = text.lines().map(str::trim_start);
            let lines = lines.filter(|line| !line.starts_with("//"));
            // A literal goes on behind a backslash at the end of a line.
            let text: String = lines
                .map(|line| {
                    line.strip_suffix('\\')
                        .map_or(format!("{line}\n"), str::to_owned)
                })
                .collect();
            offered.extend(text.lines().flat_map(cures));
        }
    }
}

fn is_command(text: &str) -> bool {
    let program = text.split_once(' ').map(|(program, _)| program);
    program.is_some_and(|program| PROGRAMS.contains(&program))
}

/// The commands between backticks.
fn commands(line: &str) -> Vec<String> {
    let quoted = line.split('`').skip(1).step_by(2);
    quoted
        .filter(|text| is_command(text))
        .map(str::to_owned)
        .collect()
}

/// The options that are no part of a command.
fn options(line: &str) -> Vec<String> {
    let parts = line.split('`').filter(|text| !is_command(text));
    let words = parts.flat_map(|part| part.split(|c: char| c != '-' && !c.is_ascii_lowercase()));
    let is_option = |word: &&str| word.strip_prefix("--").is_some_and(|word| !word.is_empty());
    words.filter(is_option).map(str::to_owned).collect()
}

#[test]
fn every_option_that_a_message_of_a_source_names_is_a_cure_or_says_why_not() {
    let mut offered = BTreeSet::new();
    for folder in ["src/core/doubt", "src/recording", "src/bench/source"] {
        add_offered(Path::new(folder), options, &mut offered);
    }
    let known: BTreeSet<_> = OPTIONS.iter().map(|(cure, _)| (*cure).to_owned()).collect();
    assert_eq!(offered, known, "offered, and known here");

    let fixture = inputs();
    fixture.write_euroc("60.0");
    fixture.run("record mav0 --calib raw -o raw.mcap");
    fixture.write_pair("plain/left/a.pgm", "plain/right/a.pgm", (64, 48), 4);
    let pixels = |topic: &str| -> Vec<u8> {
        let shift = u32::from(topic.as_bytes()[1]);
        (0..64 * 48)
            .map(|i| (i * 7 + i / 64 * 13 + shift) as u8)
            .collect()
    };
    let bag = |name: &str, topics: &[(&'static str, u64)]| {
        let images = (1..6u64).flat_map(|i| {
            topics
                .iter()
                .map(move |(topic, late_ms)| (topic, i * 100_000_000 + late_ms * 1_000_000))
        });
        let images = images
            .map(|(topic, stamp)| bag::ros_image(topic, stamp, (64, 48), "mono8", &pixels(topic)));
        let path = bag::write(&fixture.path(""), &images.collect::<Vec<_>>());
        std::fs::rename(path, fixture.path(name)).unwrap();
    };
    bag("three.mcap", &[("/a", 0), ("/b", 0), ("/c", 0)]);
    bag("wide.mcap", &[("/both", 0)]);
    bag("skewed.mcap", &[("/left", 0), ("/right", 8)]);
    for (option, how) in OPTIONS {
        let Given(without, with) = how else {
            continue;
        };
        let said = fixture.svl(*without);
        let said = said.stdout + &said.stderr;
        assert!(said.contains(option), "{without} names no {option}: {said}");
        let ran = fixture.svl(*with);
        assert_eq!(ran.code, Some(0), "{with}: {}", ran.stderr);
    }
}

#[test]
fn every_command_that_a_message_offers_runs_or_says_why_not() {
    let mut offered = BTreeSet::new();
    add_offered(Path::new("src"), commands, &mut offered);
    let known: BTreeSet<_> = CURES.iter().map(|(cure, _)| (*cure).to_owned()).collect();
    assert_eq!(offered, known, "offered, and known here");

    let fixture = inputs();
    fixture.write_euroc("60.0");
    fixture.record("long.mcap", "--frames 12");
    let whole = fixture.bytes("long.mcap");
    // Without its footer, every chunk is whole: so is every pair.
    fixture.write("cut.mcap", &whole[..whole.len() - 16]);
    let images = (0..40_u64).flat_map(|i| {
        ["/left/image_rect", "/right/image_rect"].map(|topic| {
            bag::ros_image(
                topic,
                1_000_000_000 * (i + 1),
                (64, 48),
                "mono8",
                &[9; 64 * 48],
            )
        })
    });
    let db3 = bag::write_sqlite(&fixture.path(""), &images.collect::<Vec<_>>());
    let whole = std::fs::read(db3).unwrap();
    fixture.write("cut.db3", &whole[..whole.len() * 3 / 4]);
    for (cure, how) in CURES {
        let line = match how {
            Run(line) => line,
            Shell(shell, line) => {
                let program = cure.split(' ').next().unwrap_or_default();
                if !has(program, &["--help"]) {
                    continue;
                }
                let ran = std::process::Command::new("sh")
                    .args(["-c", shell])
                    .current_dir(fixture.path(""))
                    .status();
                assert!(ran.unwrap().success(), "{cure}: {shell}");
                line
            }
            Given(..) => unreachable!("{cure} is a command"),
            Left(reason) => {
                println!("{cure}: {reason}");
                continue;
            }
        };
        let is_option = |word: &&str| word.starts_with('-');
        for option in cure
            .split(' ')
            .filter(is_option)
            .filter(|_| cure.starts_with("svl"))
        {
            assert!(line.contains(option), "{cure} is not {line}");
        }
        let ran = fixture.svl(*line);
        assert_eq!(ran.code, Some(0), "{cure}, as {line}: {}", ran.stderr);
    }
}
