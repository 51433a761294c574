//! Text from outside that would control a terminal: every command prints it escaped, as
//! [`Fixture::svl_with`] asserts of all commands.

use super::bag::{Bag, CAMERA, Camera, STEREO, Stereo, string};
use super::says::Says;
use crate::cli::fixture::{Fixture, has};
use std::process::Command;

/// Clears the screen, rings, colours, reverses, and begins a line like one of svl's.
macro_rules! hostile {
    ($name:literal) => {
        concat!("/\u{1b}[2J\u{7}\u{9b}31m\u{202e}\nusable: ", $name)
    };
}

const TOPICS: [&str; 2] = [hostile!("left/image_rect"), hostile!("right/image_rect")];
const ESCAPED: &str = r"/\u001b[2J\u0007\u009b31m\u202e\u000ausable: left/image_rect";

fn write(fixture: &Fixture) {
    let camera = Camera {
        frame: hostile!("frame"),
        ..CAMERA
    };
    let cameras = Stereo {
        images: TOPICS,
        size: (64, 48),
        cameras: [camera; 2],
        ..STEREO
    };
    let stamp = |i: u64| 1_700_000_000_000_000_000 + i * 50_000_000;
    let images = (0..4).flat_map(|i| cameras.images_at(1, stamp(i)));
    let other = string(hostile!("other"), "text");
    let mut odd = other.clone();
    odd.schema = hostile!("schema");
    Bag::new(images).and([other, odd]).write(fixture);
}

#[test]
fn names_in_a_recording_do_not_control_the_terminal() {
    let fixture = Fixture::new();
    write(&fixture);
    let info = fixture.run("info bag.mcap");
    info.says(ESCAPED).lacks("\nusable");
    // JSON has the name itself.
    let info = fixture.json("info bag.mcap --json");
    let mut topics = info["topics"].as_array().unwrap().iter();
    assert!(topics.any(|topic| topic["name"] == TOPICS[0]), "{info}");
    for command in [
        "replay bag.mcap --algo v3",
        "replay bag.mcap --algo v3 -v",
        "record bag.mcap -o own.mcap",
        "info own.mcap",
        "score bag.mcap --algo v3 --rerun none",
        "calibrate check bag.mcap",
    ] {
        fixture.svl(command).lacks("\nusable");
    }
    let mut named: Vec<_> = "replay bag.mcap --algo v3 --truth".split(' ').collect();
    named.push(hostile!("other"));
    fixture.svl(&named).failed(1, &[r"\u001b[2J"]);
}

#[test]
fn names_of_files_and_words_of_programs_do_not_control_the_terminal() {
    let fixture = Fixture::new();
    for args in [
        &["info", "\u{1b}[2J.mcap"][..],
        &["record", "\u{9b}31m", "-o", "a.mcap"],
        &["record", "sim", "--rate", "\u{202e}1"],
        &["match", "\u{202e}l.png", "r.png", "-o", "a.pfm"],
        &["algos", "\u{9b}31m"],
    ] {
        fixture.svl(args).says(r"\u");
    }
    fixture.write_pair("l.pgm", "r.pgm", (64, 48), 3);
    fixture.write("program.sh", "printf '\\033[2J\\007gone' >&2; exit 3");
    let algorithm = "exec:command=sh program.sh";
    let mut args: Vec<_> = "match l.pgm r.pgm -q -o a.pfm --algo".split(' ').collect();
    args.push(algorithm);
    let ran = fixture.svl(&args);
    ran.failed(1, &[r"\u001b[2J\u0007gone"]);
    fixture.write("\u{1b}[2J/left/1.pgm", "no image");
    fixture.write("\u{1b}[2J/right/1.pgm", "no image");
    let ran = fixture.svl(&["replay", "\u{1b}[2J", "--algo", "v3"]);
    ran.says(r"\u001b[2J");
}

/// `script` gives the program a terminal: svl's own colours are there, those of names are not.
#[test]
fn colours_of_svl_remain_on_a_terminal() {
    if !has("script", &["--version"]) {
        return;
    }
    let fixture = Fixture::new();
    write(&fixture);
    let svl = assert_cmd::cargo::cargo_bin!("svl").display();
    let command = format!("TERM=xterm {svl} replay bag.mcap --algo v3; {svl} info bag.mcap");
    let mut ran = Command::new("script");
    ran.args(["-qec", &command, "/dev/null"]);
    let ran = ran.current_dir(fixture.path("")).output().unwrap();
    let text = String::from_utf8(ran.stdout).unwrap();
    text.says(ESCAPED).lacks("\u{1b}[2J");
}
