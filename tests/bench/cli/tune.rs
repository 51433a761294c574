//! `svl tune`, driven by scripts of keys and in a terminal.

use super::fixture::{Fixture, Ran, assert_says};
use crate::common::python;
use svl::scenario::Scenario;

/// Tunes with these keys.
fn tune(fixture: &Fixture, args: &str, keys: &str) -> Ran {
    fixture.write("keys", keys);
    fixture.svl(&format!("tune {args} --script keys"))
}

/// The screen without the parts that vary: times, and their changes.
fn timeless(screen: &str) -> String {
    let line = |line: &str| {
        line.find(" time  ")
            .map_or(line.to_owned(), |at| line[..at].to_owned() + " (time)")
    };
    screen.lines().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_screen_shows_knobs_and_what_they_are_worth() {
    let fixture = Fixture::recorded();
    let keys = "wait screen down down down down shift-right wait resize:120x40 screen q";
    let screens = tune(&fixture, "run.mcap --algo v3 --algo bm", keys).done();
    insta::assert_snapshot!(timeless(&screens));
}

#[test]
fn a_name_cannot_control_the_screen() {
    let fixture = Fixture::recorded();
    let name = "run\u{202e}\u{1b}[2J\u{9b}1m.mcap";
    std::fs::copy(fixture.path("run.mcap"), fixture.path(name)).unwrap();
    for line in [
        format!("tune {name} --algo v3"),
        format!("label checkpoints {name} -o new.toml"),
    ] {
        fixture.write("keys", "wait screen q");
        let text = fixture.svl(&format!("{line} --script keys")).done();
        assert_says(&text, &["run\\u202e\\u001b[2J\\u009b1m.mcap"]);
        assert!(!text.contains(['\u{202e}', '\u{1b}', '\u{9b}']), "{text:?}");
    }
}

/// The algorithms' thread needs the only thread to compute with while the tool waits for it.
#[test]
fn one_thread_suffices_for_a_script() {
    let fixture = Fixture::recorded();
    let keys = "wait down right wait screen q";
    let text = tune(&fixture, "run.mcap --algo v5 --threads 1", keys).done();
    assert_says(&text, &["12 pairs"]);
}

#[test]
fn keys_turn_type_undo_and_compare() {
    let fixture = Fixture::recorded();
    let args = "run.mcap --algo v3 --algo bm:block_size=11";
    for (keys, words) in [
        ("down right screen q", "max_disparity      81 (80)"),
        ("down shift-right screen q", "max_disparity      90 (80)"),
        ("down scroll-down screen q", "max_disparity      79 (80)"),
        (
            "down \"64\" enter screen q",
            "v3:max_disparity=64  compared with v3",
        ),
        (
            "down \"64\" screen esc screen q",
            "max_disparity (a whole number in -1024..=1024): 64_",
        ),
        (
            "down \"6400\" enter screen q",
            "max_disparity=6400: expected a whole number",
        ),
        ("down \"-1\" enter screen q", "max_disparity"),
        (
            "down enter backspace \"4\" enter screen q",
            "max_disparity      84 (80)",
        ),
        ("down right r screen q", " v3  (1 of 2, Tab)"),
        (
            "down right right u screen q",
            "v3:max_disparity=81  compared",
        ),
        (
            "down right u ctrl-r screen q",
            "v3:max_disparity=81  compared",
        ),
        ("u screen q", "there is nothing to undo"),
        ("ctrl-r screen q", "there is nothing to redo"),
        (
            "tab down down down right screen q",
            "bm:block_size=13  compared with bm:block_size=11",
        ),
        ("tab tab right screen q", "v3:min_disparity=1  compared"),
        ("right a screen q", "v3  as compared with; a: back"),
        ("right c screen q", "compared with this setting from now on"),
        ("down right down right R screen q", " v3  (1 of 2, Tab)"),
        ("up screen q", "clear_m: a number in 0.01..=100"),
        (
            "up up up up up up right wait screen q",
            "min_valid          0.21 (0.2)",
        ),
        ("click:3,5 screen q", ">texture_sigma"),
        ("[ screen q", "the sample is not run yet"),
        ("wait ] ] [ screen q", "wrong cells"),
        (". wait screen q", "frame 1 of 12"),
        ("g \"7\" enter screen q", "frame 7 of 12"),
        ("? screen esc q", "to a worse frame, a better one"),
        (
            "resize:200x60 wait screen q",
            "disparities of the setting compared with",
        ),
    ] {
        let text = tune(&fixture, args, keys).done();
        assert!(text.contains(words), "{keys}:\n{text}");
    }
    // Grid and cells apply to all algorithms, and determine the number of right cells.
    let keys = "up up up up up up up up left tab wait screen q";
    let text = tune(&fixture, args, keys).done();
    assert_says(&text, &["bm:block_size=11", " columns            4 (5)"]);
    let end = tune(&fixture, args, "down right wait q").done();
    assert_eq!(
        end,
        "v3:max_disparity=81  (began as v3)\nbm:block_size=11\n"
    );
}

#[test]
fn the_tuned_algorithm_is_written_and_scored() {
    let fixture = Fixture::recorded();
    let keys = "down \"70\" enter wait w enter w screen esc q";
    let text = tune(&fixture, "run.mcap --algo v3", keys).done();
    assert_says(
        &text,
        &["write to: tuned-2.toml", "tuned.toml and tuned.md\n"],
    );
    let scenario = Scenario::read(&fixture.path("tuned.toml")).unwrap();
    assert_eq!(scenario.labels(), ["v3:max_disparity=70", "v3"]);
    let page = fixture.text("tuned.md");
    assert_says(
        &page,
        &["`v3:max_disparity=70`, compared with `v3`", "right cells"],
    );
    fixture.run("-q score tuned.toml -o report");
    assert!(fixture.path("report/index.html").exists());
    // Nothing is overwritten, and an invalid name is refused.
    let keys = "w backspace enter screen q";
    let text = tune(&fixture, "run.mcap --algo v3 -o tuned.toml", keys).done();
    assert_says(&text, &["tuned.tom: must end in .toml"]);
    let text = tune(
        &fixture,
        "run.mcap --algo v3 -o tuned.toml",
        "w enter screen q",
    )
    .done();
    assert_says(&text, &["tuned.toml: exists already; name another file"]);
    assert!(!text.contains("--force"), "{text}");
    // The user's own scenario scores, and its settings are copied into the one written.
    let own = fixture
        .text("tuned.toml")
        .replace("columns = 5", "columns = 4");
    fixture.write("own.toml", own);
    let args = "run.mcap --algo v3 --scenario own.toml";
    let text = tune(&fixture, args, "up up up up up up up up screen w enter q").done();
    assert_says(&text, &[">columns            4"]);
    let written = Scenario::read(&fixture.path("tuned-2.toml")).unwrap();
    assert_eq!((written.grid.columns, written.labels()), (4, vec!["v3"]));
}

#[test]
fn other_sources_can_be_tuned_on() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 66);
    let text = tune(&fixture, "short.toml --algo v3 --seeds 3", "wait screen q").done();
    assert_says(&text, &["of 66", "64 pairs"]);
    // Cameras: the sample is what they see.
    let cameras = "sim:pictures=4,size=160x120 --algo v3:max_disparity=16";
    let text = tune(&fixture, cameras, "wait right wait w enter screen q").done();
    assert_says(
        &text,
        &["min_disparity      1 (0)", "1 pair ", "tuned.toml and"],
    );
    assert_says(
        &fixture.text("tuned.toml"),
        &["algorithms = [\"v3:min_disparity=1,max_disparity=16\", \"v3:max_disparity=16\"]"],
    );
    // Without a truth, metrics that need none are shown; raw pairs have no estimates.
    for (side, shift) in [("left", 0), ("right", 3)] {
        let rows = (shift..shift + 160 * 120).map(|i| (i * 7919 % 251) as u8);
        let rows: Vec<u8> = rows.collect();
        for i in 0..3 {
            std::fs::create_dir_all(fixture.path(&format!("pictures/{side}"))).unwrap();
            let name = format!("pictures/{side}/{i}.pgm");
            fixture.write(&name, super::fixture::pgm(160, 120, &rows));
        }
    }
    let text = tune(
        &fixture,
        "pictures --algo v3:max_disparity=16",
        "wait screen q",
    )
    .done();
    assert_says(&text, &["coverage", "tolerance_px"]);
    assert!(!text.contains("right  "), "{text}");
}

#[test]
fn pictures_go_to_rerun_and_a_viewer_that_is_gone_ends_nothing() {
    let fixture = Fixture::recorded();
    let args = "run.mcap --algo v3 --rerun out.rrd";
    tune(&fixture, args, "wait right wait right wait . wait q").done();
    assert!(fixture.path("out.rrd").metadata().unwrap().len() > 100_000);
    let again = tune(&fixture, args, "q");
    again.failed(1, &["out.rrd: already exists, and is not overwritten"]);
    let absent = "run.mcap --rerun rerun+http://127.0.0.1:9/proxy";
    tune(&fixture, absent, "q").failed(1, &["no Rerun viewer answers there"]);
}

#[test]
fn the_terminal_is_left_as_it_was() {
    let fixture = Fixture::recorded();
    let program = assert_cmd::cargo::cargo_bin!("svl").to_str().unwrap();
    let run = fixture.path("run.mcap");
    let run = run.to_str().unwrap();
    let tune = format!("{program} tune {run} --algo v3 --rerun none");
    for (keys, words) in [
        ("\t.5\rq", "v3:min_disparity=5  (began as v3)"),
        ("\t\u{3}", "stopped"),
    ] {
        let line = [keys, "sh", "-c", &format!("{tune}; echo ended")];
        // Only on Unix, for its terminals.
        let Some(screen) = python("terminal.py", "pty", line) else {
            return;
        };
        let screen = String::from_utf8_lossy(&screen);
        let (_, after) = screen
            .rsplit_once("\u{1b}[?1049l")
            .expect("left the screen");
        assert!(
            after.contains("\u{1b}[?25h"),
            "the cursor is back: {after:?}"
        );
        assert_says(after, &[words, "ended"]);
    }
}

#[test]
fn a_tool_ends_when_its_terminal_closes() {
    let fixture = Fixture::recorded();
    let program = assert_cmd::cargo::cargo_bin!("svl").to_str().unwrap();
    let run = fixture.path("run.mcap");
    let scenario = fixture.path("own.toml");
    let [run, scenario] = [&run, &scenario].map(|path| path.to_str().unwrap());
    let tune = vec!["tune", run, "--algo", "v3", "--rerun", "none"];
    let label = vec![
        "label",
        "checkpoints",
        run,
        "-o",
        scenario,
        "--rerun",
        "none",
    ];
    for line in [tune, label] {
        // A closed standard output ends it, too, so its own message is not awaited.
        let ends = format!("{program} {}; true", line.join(" "));
        python(
            "terminal.py",
            "pty",
            ["^", "sh", "-c", &format!("trap '' HUP; {ends}")],
        );
    }
}
