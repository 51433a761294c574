//! A result belongs to what it was made of: whatever changed between two commands, the report of
//! the second is that of a fresh run.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::losses::write_bag;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

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

pub(super) fn json(fixture: &Fixture, file: &str) -> serde_json::Value {
    serde_json::from_str(&fixture.text(file)).unwrap()
}

/// Changes a JSON file of a report's units, and its checksum.
pub(super) fn edit_checked(fixture: &Fixture, file: &str, edit: impl Fn(&mut serde_json::Value)) {
    let mut content = json(fixture, file)["content"].take();
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
        let manifest = json(fixture, &format!("{report}/manifest.json"));
        let texts = manifest["warnings"].as_array().cloned().unwrap_or_default();
        let warnings = texts.iter().map(|text| text.as_str().unwrap().to_owned());
        let hashes = manifest["algorithms"].as_array().unwrap().iter();
        let hashes: Vec<_> = hashes.map(|own| own["results_hash"].clone()).collect();
        let summary = json(fixture, &format!("{report}/summary.json"));
        (
            warnings.collect::<BTreeSet<_>>(),
            hashes,
            manifest["pairs_hash"].clone(),
            summary["missing"].clone(),
            summary["state"].clone(),
        )
    });
    assert_eq!(own, other, "{what}");
    assert_one_input(fixture, reports[0]);
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
fn change_all(fixture: &Fixture, folder: &str, change: impl Fn(&mut Vec<u8>)) {
    for file in std::fs::read_dir(fixture.path(folder)).unwrap().flatten() {
        let mut bytes = std::fs::read(file.path()).unwrap();
        change(&mut bytes);
        replace_with_time(&file.path(), &bytes);
    }
}

const SIZE: (usize, usize) = (40, 24);

/// Disparities as NPY.
fn map(px: f32) -> Vec<u8> {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (24, 40)}\n";
    let length = (header.len() as u16).to_le_bytes();
    let pixels = px.to_le_bytes().repeat(SIZE.0 * SIZE.1);
    [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &pixels].concat()
}

/// Three pairs of images in `folder`, and maps in `maps`.
fn write_pairs(fixture: &Fixture, folder: &str) {
    for i in 0..3 {
        let [left, right] = ["left", "right"].map(|side| format!("{folder}/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, SIZE, 3);
        fixture.write(&format!("maps/{i}.npy"), map(3.0));
    }
}

fn change_pixels(bytes: &mut Vec<u8>) {
    let pixels = bytes.len() - SIZE.0 * SIZE.1;
    bytes[pixels..].rotate_right(1);
}

fn change_map(bytes: &mut Vec<u8>) {
    let pixels = bytes.len() - 4 * SIZE.0 * SIZE.1;
    bytes[pixels..].copy_from_slice(&3.9_f32.to_le_bytes().repeat(SIZE.0 * SIZE.1));
}

/// What is done to a folder between two commands, of which the second has to be as fresh.
struct Case {
    prepare: fn(&Fixture),
    /// Without `-o`.
    first: &'static str,
    between: fn(&Fixture),
    second: &'static str,
    code: i32,
}

const BM: &str = " --algo bm:max_disparity=8";

/// Puts a bag with other pictures in the place of one, of its size and with its time.
fn replace_bag(fixture: &Fixture) {
    write_bag(fixture, "other.mcap", 0..20, 0..20, 7);
    let bytes = fixture.bytes("other.mcap");
    replace_with_time(&fixture.path("bag.mcap"), &bytes);
}

/// The report of the second command is that of a fresh run.
#[track_caller]
fn check(case: &Case) {
    let fixture = Fixture::new();
    (case.prepare)(&fixture);
    let score = |line: &str, report: &str| {
        fixture.svl(&format!("score {line} --rerun none -q -o {report}"))
    };
    score(case.first, "r");
    (case.between)(&fixture);
    for report in ["r", "fresh"] {
        let ran = score(case.second, report);
        assert_eq!(ran.code, Some(case.code), "{}", ran.stderr);
    }
    assert_same_report(&fixture, ["r", "fresh"], case.second);
}

#[test]
fn another_range_keeps_no_pairs_back() {
    check(&Case {
        prepare: |fixture| drop(fixture.write_recorded_arena("short.toml", 70)),
        first: "short.toml --seeds 1 --algo v3",
        between: |fixture| {
            fixture.run("score short.toml --seeds 1 --algo bm --every 20 --rerun none -q -o r");
        },
        second: "short.toml --seeds 1 --algo v3",
        code: 0,
    });
}

#[test]
fn losses_belong_to_their_range() {
    check(&Case {
        prepare: |fixture| {
            let rights = (0..20).filter(|i| *i != 5);
            write_bag(fixture, "bag.mcap", 0..20, rights, 0);
        },
        first: "bag.mcap --algo v3:max_disparity=8",
        between: |fixture| {
            let line = format!("score bag.mcap{BM} --from 0.35 --rerun none -q -o r");
            fixture.run(&line);
        },
        second: "bag.mcap --algo v3:max_disparity=8",
        code: 4,
    });
}

#[test]
fn truths_outside_the_folder_are_inputs() {
    check(&Case {
        prepare: |fixture| write_pairs(fixture, "p"),
        first: "p --truth ../maps/*.npy:disparity=1 --algo bm:max_disparity=8",
        between: |fixture| change_all(fixture, "maps", change_map),
        second: "p --truth ../maps/*.npy:disparity=1 --algo bm:max_disparity=8",
        code: 0,
    });
}

#[test]
fn images_outside_the_folder_are_inputs() {
    check(&Case {
        prepare: |fixture| {
            write_pairs(fixture, "images");
            fixture.write("p/empty.txt", "");
        },
        first: "p --left ../images/left/*.pgm --right ../images/right/*.pgm \
                    --algo bm:max_disparity=8",
        between: |fixture| change_all(fixture, "images/right", change_pixels),
        second: "p --left ../images/left/*.pgm --right ../images/right/*.pgm \
                     --algo bm:max_disparity=8",
        code: 0,
    });
}

#[test]
fn a_recording_of_equal_size_and_time_is_another() {
    check(&Case {
        prepare: |fixture| write_bag(fixture, "bag.mcap", 0..20, 0..20, 0),
        first: "bag.mcap --algo bm:max_disparity=8",
        between: replace_bag,
        second: "bag.mcap --algo bm:max_disparity=8",
        code: 0,
    });
}

#[test]
fn one_table_has_one_recording() {
    check(&Case {
        prepare: |fixture| write_bag(fixture, "bag.mcap", 0..20, 0..20, 0),
        first: "bag.mcap --algo bm:max_disparity=8",
        between: replace_bag,
        second: "bag.mcap --algo bm:max_disparity=8 --algo v3:max_disparity=8",
        code: 0,
    });
}

#[test]
fn maps_that_others_computed_are_inputs() {
    check(&Case {
        prepare: |fixture| write_pairs(fixture, "p"),
        first: "p --algo net=files:maps/*.npy",
        between: |fixture| change_all(fixture, "maps", change_map),
        second: "p --algo net=files:maps/*.npy",
        code: 0,
    });
}

#[test]
fn a_calibration_that_appears_is_an_input() {
    check(&Case {
        prepare: |fixture| write_pairs(fixture, "p"),
        first: "p --algo bm:max_disparity=8",
        between: |fixture| {
            let calib = "cam0=[50 0 20; 0 50 12; 0 0 1]\ncam1=[50 0 20; 0 50 12; 0 0 1]\n\
                             doffs=0\nbaseline=100\nwidth=40\nheight=24\nndisp=16\n";
            fixture.write("p/calib.txt", calib);
        },
        second: "p --algo bm:max_disparity=8",
        code: 0,
    });
}

#[test]
fn results_of_earlier_options_are_found_again() {
    let fixture = Fixture::new();
    write_pairs(&fixture, "p");
    let line = format!("score p{BM} --rerun none -o r");
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
    let line = format!("score p{BM} --rerun none -o r");
    fixture.run(&line);
    for name in ["left/1.pgm", "right/2.pgm"] {
        let path = format!("p/{name}");
        let bytes = fixture.bytes(&path);
        std::fs::remove_file(fixture.path(&path)).unwrap();
        fixture.write(&path, bytes);
    }
    assert_says(&fixture.run(&line), &["matched  nothing"]);
}
