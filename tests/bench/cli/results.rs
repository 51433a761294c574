//! A result belongs to what it was made of: whatever changed between two commands, the report of
//! the second is that of a fresh run.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::losses::write_bag;
use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::Duration;

/// A table without the columns of times and of what belongs to a session.
fn untimed(text: &str) -> String {
    let mut lines = csv::Reader::from_reader(text.as_bytes());
    let heads = lines.headers().unwrap().clone();
    let but = ["_us", "_ms", "_s", "outliers", "memory_mb", "session"];
    let is_kept =
        |head: &str| head == "stood_s" || but.iter().all(|ending| !head.ends_with(ending));
    let mut kept = String::new();
    for line in lines.records() {
        let line = line.unwrap();
        let cells = line.iter().zip(&heads).filter(|(_, head)| is_kept(head));
        let cells: Vec<_> = cells.map(|(cell, _)| cell).collect();
        kept += &(cells.join(",") + "\n");
    }
    kept
}

/// Changes a JSON file of a report's units, and its checksum.
pub(super) fn edit_checked(fixture: &Fixture, file: &str, edit: impl Fn(&mut serde_json::Value)) {
    let mut content = fixture.json_file(file)["content"].take();
    edit(&mut content);
    let content = content.to_string();
    let checksum = svl::manifest::hash(&content);
    let text = format!("{{\"checksum\":\"{checksum}\",\"content\":{content}}}\n");
    fixture.write(file, text);
}

/// The files of a report's units with that extension, in order.
pub(super) fn unit_files(fixture: &Fixture, report: &str, extension: &str) -> Vec<String> {
    let mut files = Vec::new();
    let units = fixture.path(&format!("{report}/units"));
    for folder in std::fs::read_dir(units).into_iter().flatten().flatten() {
        for file in std::fs::read_dir(folder.path())
            .into_iter()
            .flatten()
            .flatten()
        {
            let [folder, file] = [folder.file_name(), file.file_name()];
            let [folder, file] = [&folder, &file].map(|name| name.to_str().unwrap());
            files.push(format!("{report}/units/{folder}/{file}"));
        }
    }
    files.retain(|file| file.ends_with(extension));
    files.sort();
    files
}

/// Two reports are the same, without times, dates and sessions; `what` is shown otherwise.
#[track_caller]
pub(super) fn assert_same_report(fixture: &Fixture, reports: [&str; 2], what: &str) {
    let tables = [
        "rows",
        "cells",
        "failures",
        "checkpoints",
        "verdicts",
        "algorithms",
        "summary",
    ];
    for table in tables.into_iter().chain(["drives", "tracks"]) {
        let [own, other] = reports.map(|report| {
            let name = format!("{report}/{table}.csv");
            let is_there = fixture.path(&name).is_file();
            is_there.then(|| untimed(&fixture.text(&name)))
        });
        assert!(own == other, "{table} differs: {what}");
    }
    let [own, other] = reports.map(|report| {
        let page = fixture.text(&format!("{report}/index.html"));
        let images = page.split("\"data:image/").skip(1);
        let images = images.map(|rest| rest.split('"').next().unwrap().to_owned());
        images.collect::<Vec<_>>()
    });
    assert!(own == other, "images differ: {what}");
    let [own, other] = reports.map(|report| {
        let manifest = fixture.json_file(&format!("{report}/manifest.json"));
        let texts = manifest["warnings"].as_array().cloned().unwrap_or_default();
        let warnings = texts.iter().map(|text| text.as_str().unwrap().to_owned());
        let hashes = manifest["algorithms"].as_array().unwrap().iter();
        let hashes: Vec<_> = hashes.map(|own| own["results_hash"].clone()).collect();
        let summary = fixture.json_file(&format!("{report}/summary.json"));
        (
            warnings.collect::<BTreeSet<_>>(),
            hashes,
            manifest["pairs_hash"].clone(),
            summary["missing"].clone(),
            summary["state"].clone(),
        )
    });
    assert_eq!(own, other, "{what}");
    // Each algorithm drives its own way.
    if !fixture.path(&format!("{}/drives.csv", reports[0])).exists() {
        assert_one_input(fixture, reports[0]);
    }
}

/// No pair of a report has two input hashes.
fn assert_one_input(fixture: &Fixture, report: &str) {
    let text = fixture.text(&format!("{report}/rows.csv"));
    let mut lines = csv::Reader::from_reader(text.as_bytes());
    let heads = lines.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let keys = ["run", "seed", "stress", "sequence"].map(place);
    let mut inputs = BTreeMap::new();
    for line in lines.records().map(Result::unwrap) {
        let key = keys.map(|column| line[column].to_owned());
        let input = line[place("input_hash")].to_owned();
        assert_eq!(*inputs.entry(key).or_insert_with(|| input.clone()), input);
    }
}

/// Puts a file in the place of another, with its time.
pub(super) fn replace_with_time(path: &Path, bytes: &[u8]) {
    let before = path.metadata().unwrap();
    assert_eq!(before.len(), bytes.len() as u64);
    let new = path.with_extension("new");
    std::fs::write(&new, bytes).unwrap();
    let file = std::fs::File::options().write(true).open(&new).unwrap();
    file.set_modified(before.modified().unwrap()).unwrap();
    std::fs::rename(new, path).unwrap();
}

/// Changes every file of a folder, and keeps sizes and times.
pub(super) fn change_all(fixture: &Fixture, folder: &str, change: impl Fn(&mut [u8])) {
    for file in std::fs::read_dir(fixture.path(folder)).unwrap().flatten() {
        let mut bytes = std::fs::read(file.path()).unwrap();
        change(&mut bytes);
        replace_with_time(&file.path(), &bytes);
    }
}

const SIZE: (usize, usize) = (40, 24);

const BM: &str = "bm:max_disparity=8";

/// Disparities as NPY.
fn map(px: f32) -> Vec<u8> {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (24, 40)}\n";
    let length = (header.len() as u16).to_le_bytes();
    let pixels = px.to_le_bytes().repeat(SIZE.0 * SIZE.1);
    [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &pixels].concat()
}

/// Three pairs of images in `folder`, and maps in `maps`.
pub(super) fn write_pairs(fixture: &Fixture, folder: &str) {
    for i in 0..3 {
        let [left, right] = ["left", "right"].map(|side| format!("{folder}/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, SIZE, 3);
        fixture.write(&format!("maps/{i}.npy"), map(3.0));
    }
}

const CALIB: &str = "cam0=[50 0 20; 0 50 12; 0 0 1]\ncam1=[50 0 20; 0 50 12; 0 0 1]\n\
                     doffs=0\nbaseline=100\nwidth=40\nheight=24\nndisp=16\n";

const ANSWERS: &str = r#"#!/bin/sh
while read -r line; do
  head -c BYTES > /dev/null
  seq=$(echo "$line" | sed 's/.*"seq":\([0-9]*\).*/\1/')
  echo '{"seq":'$seq',"millis":1}'
  cat answer
done
"#;

/// A program that answers each pair of this size with the file `answer`.
pub(super) fn write_program(fixture: &Fixture, (width, height): (usize, usize)) {
    let text = ANSWERS.replace("BYTES", &(2 * width * height).to_string());
    let path = fixture.write("answers.sh", text);
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
    fixture.write("answer", 3_f32.to_le_bytes().repeat(width * height));
}

pub(super) fn change_pixels(bytes: &mut [u8]) {
    let pixels = bytes.len() - SIZE.0 * SIZE.1;
    bytes[pixels..].rotate_right(1);
}

pub(super) fn change_map(bytes: &mut [u8]) {
    let pixels = bytes.len() - 4 * SIZE.0 * SIZE.1;
    bytes[pixels..].copy_from_slice(&3.9_f32.to_le_bytes().repeat(SIZE.0 * SIZE.1));
}

/// Puts a bag with other pictures in the place of one, of its size and with its time.
fn replace_bag(fixture: &Fixture) {
    write_bag(fixture, "other.mcap", 0..20, 0..20, 7);
    let bytes = fixture.bytes("other.mcap");
    replace_with_time(&fixture.path("bag.mcap"), &bytes);
}

fn write_arena(fixture: &Fixture) {
    fixture.write_recorded_arena("short.toml", 70);
}

/// Runs shards in this order, each in a folder of its own, and joins them.
fn join_parts(fixture: &Fixture, line: &str, numbers: &[usize]) {
    let part = |i: &usize| format!("part-{i}");
    for i in numbers {
        let shard = format!("--shard {i}/{}", numbers.len());
        fixture.run(&format!("{line} {shard} -o {}", part(i)));
    }
    let parts: Vec<_> = numbers.iter().map(part).collect();
    fixture.run(&format!("report {} -o r -q", parts.join(" ")));
}

/// A history of the folder `r`, and the last command into it.
struct Case {
    name: &'static str,
    prepare: fn(&Fixture),
    /// The last command without `-o`, which is run into a fresh folder too.
    line: &'static str,
    /// Leaves a folder in which the last command has to be as fresh.
    history: fn(&Fixture, &str),
    /// The status of the last command.
    code: i32,
}

const CASES: &[Case] = &[
    Case {
        name: "another range keeps no pairs back",
        prepare: write_arena,
        line: "score short.toml --seeds 1 --algo v3",
        history: |fixture, line| {
            fixture.run(&format!("{line} -o r"));
            fixture.run("score short.toml --seeds 1 --algo bm --every 20 --rerun none -q -o r");
        },
        code: 0,
    },
    Case {
        name: "losses belong to their range",
        prepare: |fixture| {
            let rights = (0..20).filter(|i| *i != 5);
            write_bag(fixture, "bag.mcap", 0..20, rights, 0);
        },
        line: "score bag.mcap --algo v3:max_disparity=8",
        history: |fixture, line| {
            fixture.svl(&format!("{line} -o r")).failed(4, &["1 image"]);
            let part = "--algo bm:max_disparity=8 --from 0.35";
            fixture.run(&format!("score bag.mcap {part} --rerun none -q -o r"));
        },
        code: 4,
    },
    Case {
        name: "truths outside the folder are inputs",
        prepare: |fixture| write_pairs(fixture, "p"),
        line: "score p --truth ../maps/*.npy:disparity=1 --algo bm:max_disparity=8",
        history: |fixture, line| {
            fixture.run(&format!("{line} -o r"));
            change_all(fixture, "maps", change_map);
        },
        code: 0,
    },
    Case {
        name: "images outside the folder are inputs",
        prepare: |fixture| {
            write_pairs(fixture, "images");
            fixture.write("p/empty.txt", "");
        },
        line: "score p --left ../images/left/*.pgm --right ../images/right/*.pgm \
               --algo bm:max_disparity=8",
        history: |fixture, line| {
            fixture.run(&format!("{line} -o r"));
            change_all(fixture, "images/right", change_pixels);
        },
        code: 0,
    },
    Case {
        name: "a recording of equal size and time is another",
        prepare: |fixture| write_bag(fixture, "bag.mcap", 0..20, 0..20, 0),
        line: "score bag.mcap --algo bm:max_disparity=8",
        history: |fixture, line| {
            fixture.run(&format!("{line} -o r"));
            replace_bag(fixture);
        },
        code: 0,
    },
    Case {
        name: "one table has one recording",
        prepare: |fixture| write_bag(fixture, "bag.mcap", 0..20, 0..20, 0),
        line: "score bag.mcap --algo bm:max_disparity=8 --algo v3:max_disparity=8",
        history: |fixture, _| {
            fixture.run("score bag.mcap --algo bm:max_disparity=8 --rerun none -q -o r");
            replace_bag(fixture);
        },
        code: 0,
    },
    Case {
        name: "maps that others computed are inputs",
        prepare: |fixture| write_pairs(fixture, "p"),
        line: "score p --algo net=files:maps/*.npy",
        history: |fixture, line| {
            fixture.run(&format!("{line} -o r"));
            change_all(fixture, "maps", change_map);
        },
        code: 0,
    },
    Case {
        name: "a calibration that appears is an input",
        prepare: |fixture| write_pairs(fixture, "p"),
        line: "score p --algo bm:max_disparity=8",
        history: |fixture, line| {
            fixture.run(&format!("{line} -o r"));
            fixture.write("p/calib.txt", CALIB);
        },
        code: 0,
    },
    Case {
        name: "another recording of the same name",
        prepare: |fixture| {
            for (folder, seed) in [("a", 0), ("b", 7)] {
                std::fs::create_dir(fixture.path(folder)).unwrap();
                write_bag(fixture, &format!("{folder}/bag.mcap"), 0..20, 0..20, seed);
            }
        },
        line: "score b/bag.mcap --algo bm:max_disparity=8",
        history: |fixture, line| {
            let other = line.replace("b/bag", "a/bag");
            fixture.run(&format!("{other} -o r"));
        },
        code: 0,
    },
    Case {
        name: "another calibration",
        prepare: |fixture| {
            write_pairs(fixture, "p");
            fixture.write("calib.txt", CALIB);
            fixture.write("wide.txt", CALIB.replace("baseline=100", "baseline=150"));
        },
        line: "score p --algo bm:max_disparity=8 --calib wide.txt",
        history: |fixture, line| {
            for other in ["calib.txt", "none"] {
                let line = line.replace("wide.txt", other);
                fixture.run(&format!("{line} -o r"));
                fixture.run(&format!("{line} -o of-{other}"));
                assert_same_report(fixture, ["r", &format!("of-{other}")], other);
            }
        },
        code: 0,
    },
    Case {
        name: "warnings and losses of files that are gone",
        prepare: |fixture| write_pairs(fixture, "p"),
        line: "score p --algo bm:max_disparity=8",
        history: |fixture, line| {
            let files = ["p/left/7.pgm", "p/right/7.pgm", "p/left/9.pgm"];
            for file in files {
                fixture.write(file, "no image");
            }
            fixture
                .svl(&format!("{line} -o r"))
                .failed(4, &["1 pair could not be read"]);
            for file in files {
                std::fs::remove_file(fixture.path(file)).unwrap();
            }
        },
        code: 0,
    },
    Case {
        name: "a program at the wheel",
        prepare: |fixture| {
            fixture.write("small.toml", super::drive::courses(""));
            write_program(fixture, (80, 60));
        },
        line: "score small.toml --drives none --seeds 1 --algo p=exec:command=./answers.sh",
        history: |fixture, line| {
            fixture.run(&format!("{line} -o r"));
            fixture.write("answer", 40_f32.to_le_bytes().repeat(80 * 60));
        },
        code: 0,
    },
    Case {
        name: "parts are joined in any order",
        prepare: write_arena,
        line: "score short.toml --algo v3 --algo bm --algo v1 --stress noise=8 --every 9",
        history: |fixture, line| join_parts(fixture, line, &[3, 1, 2]),
        code: 0,
    },
    Case {
        name: "more parts than units are joined",
        prepare: |fixture| write_pairs(fixture, "p"),
        line: "score p --algo v3:max_disparity=8 --algo bm:max_disparity=8",
        history: |fixture, line| join_parts(fixture, line, &[1, 2, 3, 4, 5]),
        code: 0,
    },
    Case {
        name: "drives are shared out too",
        prepare: |fixture| drop(fixture.write("small.toml", super::drive::courses(""))),
        line: "score small.toml --drives none",
        history: |fixture, line| join_parts(fixture, line, &[2, 1]),
        code: 0,
    },
    Case {
        name: "the last shard into one folder makes the report",
        prepare: write_arena,
        line: "score short.toml --algo v3 --algo bm --every 9",
        history: |fixture, line| {
            let first = fixture.run(&format!("{line} --shard 1/2 -o r"));
            assert_says(&first, &["r: this shard is complete"]);
            assert!(!fixture.path("r/summary.json").exists());
            let report = fixture.svl("report r");
            report.failed(4, &["1 of 2 runs incomplete, from seed 2 on"]);
            fixture.run(&format!("{line} --shard 2/2 -o r"));
            assert!(fixture.path("r/summary.json").exists());
        },
        code: 0,
    },
];

fn check(case: &Case) {
    let fixture = Fixture::new();
    (case.prepare)(&fixture);
    // Files are taken by their times once these are older than two seconds.
    std::thread::sleep(Duration::from_millis(2100));
    let line = format!("{} --rerun none -q", case.line);
    (case.history)(&fixture, &line);
    let score = |report: &str| {
        let ran = fixture.svl(&format!("{line} -o {report}"));
        assert_eq!(ran.code, Some(case.code), "{}: {}", case.name, ran.stderr);
    };
    score("fresh");
    if fixture.path("part-1").exists() {
        assert_same_report(&fixture, ["r", "fresh"], case.name);
    }
    score("r");
    assert_same_report(&fixture, ["r", "fresh"], case.name);
}

parts! {
    // Reports with a history equal fresh ones.
    |part| CASES.iter().skip(part).step_by(8).for_each(check);
    history_1 = 0, history_2 = 1, history_3 = 2, history_4 = 3,
    history_5 = 4, history_6 = 5, history_7 = 6, history_8 = 7,
}

#[test]
fn results_of_earlier_options_are_found_again() {
    let fixture = Fixture::new();
    write_pairs(&fixture, "p");
    let line = format!("score p --algo {BM} --rerun none -o r");
    let matched = |more: &str| {
        let text = fixture.run(&format!("{line}{more}"));
        !text.contains("matched  nothing")
    };
    assert!(matched(""));
    assert!(matched(" --every 2"));
    assert!(!matched(""));
    assert!(!matched(" --every 2"));
    assert_eq!(fixture.text("r/rows.csv").lines().count(), 1 + 2);
    // An algorithm more of the same options stands beside the earlier one.
    assert!(
        fixture
            .run("score p --algo v3:max_disparity=8 --every 2 --rerun none -o r")
            .contains("in the report already bm:max_disparity=8")
    );
    assert_eq!(fixture.text("r/rows.csv").lines().count(), 1 + 2 * 2);
    // Pruned, the folder has the last command's alone.
    let ran = fixture.svl("score p --algo v3:max_disparity=8 --every 2 --rerun none -o r --prune");
    assert_eq!(ran.code, Some(0));
    assert_eq!(fixture.text("r/rows.csv").lines().count(), 1 + 2);
    assert!(matched(""));
}

#[test]
fn the_pairs_of_copies_are_compared_and_nothing_is_matched() {
    let fixture = Fixture::new();
    write_pairs(&fixture, "p");
    let line = format!("score p --algo {BM} --rerun none -o r");
    fixture.run(&line);
    for name in ["left/1.pgm", "right/2.pgm"] {
        let path = format!("p/{name}");
        let bytes = fixture.bytes(&path);
        std::fs::remove_file(fixture.path(&path)).unwrap();
        fixture.write(&path, bytes);
    }
    assert_says(&fixture.run(&line), &["matched  nothing"]);
}
