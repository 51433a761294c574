//! Text from outside that would control a terminal: every command prints it escaped, as
//! [`Fixture::svl_with`] asserts of all commands.

use super::bag::{self, Message, ros_image_in, string};
use super::frames::image;
use crate::cli::fixture::Fixture;
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
    let pixels = [1, 2].map(|seed| image((64, 48), seed).pixels().collect::<Vec<_>>());
    let images = (0..4_u64).flat_map(|i| {
        let pixels = &pixels;
        [0, 1].map(move |side| {
            let (topic, pixels) = (TOPICS[side], &pixels[side]);
            let stamp = 1_700_000_000_000_000_000 + i * 50_000_000;
            ros_image_in(hostile!("frame"), topic, stamp, (64, 48), ("mono8", pixels))
        })
    });
    let other = string(hostile!("other"), "text");
    let odd = Message {
        schema: hostile!("schema"),
        ..other.clone()
    };
    let messages: Vec<_> = images.chain([other, odd]).collect();
    bag::write(&fixture.path(""), &messages);
}

#[test]
fn names_in_a_recording_do_not_control_the_terminal() {
    let fixture = Fixture::new();
    write(&fixture);
    let info = fixture.run("info bag.mcap");
    assert!(info.contains(ESCAPED), "{info}");
    assert_eq!(info.matches("\nusable").count(), 0, "{info}");
    // JSON has the name itself.
    let info = fixture.json("info bag.mcap --json");
    let topics = info["topics"].as_array().unwrap();
    assert!(
        topics.iter().any(|topic| topic["name"] == TOPICS[0]),
        "{topics:?}"
    );
    for command in [
        "replay bag.mcap --algo v3",
        "replay bag.mcap --algo v3 -v",
        "record bag.mcap -o own.mcap",
        "info own.mcap",
        "score bag.mcap --algo v3 --rerun none",
        "calibrate check bag.mcap",
    ] {
        let ran = fixture.svl(command);
        assert!(
            !ran.stderr.contains("\nusable"),
            "{command}: {}",
            ran.stderr
        );
    }
    let named = [
        "replay",
        "bag.mcap",
        "--algo",
        "v3",
        "--truth",
        hostile!("other"),
    ];
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
        let ran = fixture.svl(args);
        assert!(ran.stderr.contains(r"\u"), "{args:?}: {}", ran.stderr);
    }
    fixture.write_pair("l.pgm", "r.pgm", (64, 48), 3);
    fixture.write("program.sh", "printf '\\033[2J\\007gone' >&2; exit 3");
    let algorithm = "exec:command=sh program.sh";
    let ran = fixture.svl(&[
        "match", "l.pgm", "r.pgm", "-q", "-o", "a.pfm", "--algo", algorithm,
    ]);
    ran.failed(1, &[r"\u001b[2J\u0007gone"]);
    fixture.write("\u{1b}[2J/left/1.pgm", "no image");
    fixture.write("\u{1b}[2J/right/1.pgm", "no image");
    let ran = fixture.svl(&["replay", "\u{1b}[2J", "--algo", "v3"]);
    assert!(ran.stderr.contains(r"\u001b[2J"), "{}", ran.stderr);
}

/// `script` gives the program a terminal: svl's own colours are there, those of names are not.
#[test]
fn colours_of_svl_remain_on_a_terminal() {
    let has_script = Command::new("script").arg("--version").output();
    if !has_script.is_ok_and(|output| output.status.success()) {
        return crate::common::skip("no program script");
    }
    let fixture = Fixture::new();
    write(&fixture);
    let svl = assert_cmd::cargo::cargo_bin!("svl").display();
    let command =
        format!("TERM=xterm {svl} replay bag.mcap --algo v3 --reference sgm; {svl} info bag.mcap");
    let mut ran = Command::new("script");
    ran.args(["-qec", &command, "/dev/null"]);
    let ran = ran.current_dir(fixture.path("")).output().unwrap();
    let text = String::from_utf8(ran.stdout).unwrap();
    assert!(
        text.contains(ESCAPED) && !text.contains("\u{1b}[2J"),
        "{text:?}"
    );
}
