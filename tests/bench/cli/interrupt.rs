//! Ctrl-C, as the terminal sends it.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::results::unit_files;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use svl::source::{RecordingSource, Source};

/// Waits until `ready` as long as the program runs, however slow the machine is.
#[track_caller]
pub fn wait_until(child: &mut Child, ready: impl Fn() -> bool) {
    while !ready() {
        let ended = child.try_wait().unwrap();
        assert!(ended.is_none() || ready(), "it ended before: {ended:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Starts `svl`, waits until `ready`, sends SIGINT and returns the exit code with what it printed
/// to standard error.
pub fn interrupted(
    fixture: &Fixture,
    line: &str,
    ready: impl Fn() -> bool,
) -> (Option<i32>, String) {
    interrupted_times(&[0], fixture, line, Stdio::null(), ready)
}

/// `pauses_ms`: the time before each signal.
pub fn interrupted_times(
    pauses_ms: &[u64],
    fixture: &Fixture,
    line: &str,
    stdout: Stdio,
    ready: impl Fn() -> bool,
) -> (Option<i32>, String) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
    command
        .current_dir(fixture.path(""))
        .args(line.split_whitespace())
        .stdout(stdout)
        .stderr(Stdio::piped());
    // Servers of tests are on this machine, whatever proxy there is.
    command.env("NO_PROXY", "127.0.0.1");
    // Programs of the test come first.
    let path = std::env::var("PATH").unwrap_or_default();
    command.env("PATH", format!("{}:{path}", fixture.path("bin").display()));
    let mut child = command.spawn().unwrap();
    wait_until(&mut child, ready);
    for pause_ms in pauses_ms {
        std::thread::sleep(Duration::from_millis(*pause_ms));
        let pid = child.id().to_string();
        let killed = Command::new("kill").args(["-INT", &pid]).status();
        assert!(killed.unwrap().success());
    }
    let output = child.wait_with_output().unwrap();
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn the_viewer_ends_with_svl() {
    let fixture = Fixture::new();
    fixture.run("record --frames 2 -o a.mcap");
    std::fs::create_dir(fixture.path("bin")).unwrap();
    // A script that starts another program, like that of pip.
    let script =
        "#!/bin/sh\n[ \"$1\" = --version ] && exit\nsleep 300 &\necho $! > started\nwait\n";
    fixture.write("bin/rerun", script);
    let program = fixture.path("bin/rerun");
    std::fs::set_permissions(
        &program,
        std::os::unix::fs::PermissionsExt::from_mode(0o755),
    )
    .unwrap();
    let started = || size(&fixture, "started") > 0;
    let (code, stderr) = interrupted(&fixture, "view a.mcap", started);
    assert_eq!(code, Some(0), "{stderr}");
    let sleeping = fixture.text("started");
    let state = ["-o", "stat=", "-p", sleeping.trim()];
    let state = Command::new("ps").args(state).output().unwrap().stdout;
    // Ended, and perhaps not yet reaped.
    assert!(state.is_empty() || state.starts_with(b"Z"), "{state:?}");
}

fn size(fixture: &Fixture, name: &str) -> u64 {
    fixture.path(name).metadata().map_or(0, |m| m.len())
}

#[test]
fn a_recording_is_whole_after_ctrl_c() {
    let fixture = Fixture::new();
    let (code, stderr) = interrupted(&fixture, "record -o a.mcap", || {
        size(&fixture, "a.mcap") > 1_000_000
    });
    assert_eq!(code, Some(1), "{stderr}");
    let mut source = RecordingSource::open(fixture.path("a.mcap")).unwrap();
    let pairs = source.pairs().expect("a whole recording knows its length");
    assert!((1..280).contains(&pairs), "{pairs}");
    let error = format!("error: interrupted after {pairs} of 280 pairs\n");
    assert!(stderr.ends_with(&error), "{stderr}");
    assert!(
        (0..pairs).all(|_| source.next().unwrap().is_some()) && source.next().unwrap().is_none()
    );
}

#[test]
fn an_interrupted_recording_replaces_none() {
    let fixture = Fixture::new();
    fixture.write("a.mcap", "earlier");
    let new = "a.mcap.unfinished/a.mcap";
    let line = "record --force -o a.mcap";
    let (code, stderr) = interrupted(&fixture, line, || size(&fixture, new) > 1_000_000);
    assert_eq!(code, Some(1), "{stderr}");
    let words = format!("a.mcap: the earlier one; the new one is incomplete: {new}");
    assert_says(&stderr, &[&words]);
    assert_eq!(fixture.text("a.mcap"), "earlier");
    assert!(RecordingSource::open(fixture.path(new)).is_ok());
}

/// Starts `svl`, waits until `ready`, and sends SIGKILL.
fn killed(fixture: &Fixture, line: &str, ready: impl Fn() -> bool) {
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("svl"))
        .current_dir(fixture.path(""))
        .args(line.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !ready() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let _ = child.kill();
    child.wait().unwrap();
}

#[test]
fn a_killed_recording_leaves_the_earlier_one_and_a_part_that_recovers() {
    let fixture = Fixture::new();
    fixture.run("record -q --frames 3 -o a.mcap");
    let earlier = fixture.bytes("a.mcap");
    let new = "a.mcap.unfinished/a.mcap";
    let line = "record -q --force -o a.mcap";
    killed(&fixture, line, || size(&fixture, new) > 2_000_000);
    assert_eq!(fixture.bytes("a.mcap"), earlier);
    assert_says(
        &fixture.run("info a.mcap"),
        &[new, "`svl recover` reads it"],
    );
    fixture.run(&format!("recover {new} -o part.mcap"));
    let part = RecordingSource::open(fixture.path("part.mcap")).unwrap();
    assert!(part.pairs().is_some_and(|pairs| pairs > 0));
    // The next one replaces both; without an earlier one, the part has its own name.
    fixture.run("record -q --frames 2 --force -o a.mcap");
    assert!(!fixture.path("a.mcap.unfinished").exists());
    let whole = RecordingSource::open(fixture.path("a.mcap")).unwrap();
    assert_eq!(whole.pairs(), Some(2));
    killed(&fixture, "record -q -o b.mcap", || {
        size(&fixture, "b.mcap") > 2_000_000
    });
    fixture.run("recover b.mcap -o c.mcap");
}

/// A killed command leaves the earlier or the whole file.
fn kills(fixture: &Fixture, line: &str, file: &str) {
    let ran = fixture.svl(line);
    assert!(fixture.path(file).exists(), "{line}: {}", ran.stderr);
    let length = fixture.bytes(file).len();
    for ms in [5, 40, 120, 300, 700] {
        let began = Instant::now();
        killed(fixture, line, || began.elapsed().as_millis() > ms);
        // Times differ from run to run, by some digits.
        let now = fixture.bytes(file).len();
        assert!(
            now.abs_diff(length) < length / 10,
            "{line}: {length}, {now}"
        );
    }
}

#[test]
fn a_killed_replay_leaves_the_earlier_or_the_whole_file() {
    let fixture = Fixture::new();
    fixture.record("in.mcap", "--frames 3");
    kills(
        &fixture,
        "replay in.mcap -q --algo bm --rows r.csv --force",
        "r.csv",
    );
}

#[test]
fn a_killed_score_or_report_leaves_the_earlier_or_the_whole_file() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 4);
    let line = "score short.toml -q --algo bm --force -o r";
    kills(&fixture, line, "r/summary.json");
    kills(&fixture, "report r", "r/index.html");
}

#[test]
fn a_killed_calibration_leaves_the_earlier_or_the_whole_file() {
    let fixture = Fixture::new();
    let line = "calibrate board board --square-m 0.03 --yes -o c.xml --force";
    kills(&fixture, line, "c.xml");
}

#[test]
fn an_interrupted_stream_of_pairs_is_an_error() {
    let fixture = Fixture::new();
    let pairs = std::fs::File::create(fixture.path("pairs")).unwrap();
    let line = "record -q -o -";
    let ready = || size(&fixture, "pairs") > 1_000_000;
    let (code, stderr) = interrupted_times(&[0], &fixture, line, pairs.into(), ready);
    assert_eq!(code, Some(1), "{stderr}");
    let words: Vec<_> = stderr.split_whitespace().collect();
    let [.., "interrupted", "after", pairs, "of", "280", "pairs"] = words[..] else {
        panic!("{stderr}");
    };
    assert_eq!(stderr.lines().count(), 1);
    // Headers and pixels of whole pairs, and of all that it says.
    let headers = fixture.bytes("pairs");
    let headers = headers.windows(9).filter(|bytes| *bytes == b"{\"width\":");
    assert_eq!(headers.count().to_string(), pairs);
}

#[test]
fn an_interrupt_that_comes_twice_at_once_is_one() {
    let fixture = Fixture::new();
    // `timeout` sends the signal to its child and then to its group.
    let line = "record -o a.mcap";
    let ready = || size(&fixture, "a.mcap") > 1_000_000;
    let (code, stderr) = interrupted_times(&[0, 0], &fixture, line, Stdio::null(), ready);
    assert_eq!(code, Some(1), "{stderr}");
    let source = RecordingSource::open(fixture.path("a.mcap")).unwrap();
    assert!(source.pairs().is_some_and(|pairs| pairs < 280));
}

/// The second ends a command that waits, here for the reader of its output.
#[test]
fn warnings_that_are_grouped_are_written_before_the_second_interrupt_ends() {
    let fixture = Fixture::new();
    for folder in ["a", "b"] {
        let [left, right] = ["left", "right"].map(|side| format!("{folder}/{side}/0.pgm"));
        fixture.write_pair(&left, &right, (40, 20), 3);
        fixture.write_pair(&format!("{folder}/left/1.pgm"), "other.pgm", (40, 20), 3);
    }
    // More than a pipe holds.
    let algorithms = (0..60).map(|i| format!(" --algo b{i}=bm:max_disparity=8"));
    let algorithms: String = algorithms.collect();
    let line = format!("score a b --rerun none --json -o r{algorithms}");
    let (_unread, pipe) = std::io::pipe().unwrap();
    let ready = || fixture.path("r/summary.json").exists();
    let (code, stderr) = interrupted_times(&[500, 500], &fixture, &line, pipe.into(), ready);
    assert_eq!(code, Some(130), "{stderr}");
    assert_says(&stderr, &["a: 1 image dropped", "b: 1 image dropped"]);
}

#[test]
fn cameras_stop_orderly() {
    let fixture = Fixture::new();
    let args = "record sim:size=320x240,pictures=2 --allow-loss 100% -o a.mcap";
    let (code, stderr) = interrupted(&fixture, args, || size(&fixture, "a.mcap") > 100_000);
    assert_eq!(code, Some(0), "{stderr}");
    let mut source = RecordingSource::open(fixture.path("a.mcap")).unwrap();
    let pairs = source.pairs().expect("a whole recording knows its length");
    assert!(
        pairs > 0
            && (0..pairs).all(|_| source.next().unwrap().is_some())
            && source.next().unwrap().is_none()
    );
}

#[test]
fn cameras_that_give_no_pair_can_be_stopped() {
    let fixture = Fixture::new();
    let sim = "sim:size=320x240,pictures=2,right.phase_ms=15";
    let line = format!("record {sim} --trigger free --max-skew-ms 1 --allow-loss 100% -o a.mcap");
    let (code, stderr) = interrupted(&fixture, &line, || fixture.path("a.mcap").exists());
    assert_eq!(code, Some(1), "{stderr}");
    assert!(
        stderr
            .lines()
            .last()
            .unwrap()
            .contains("stopped before the first pair"),
        "{stderr}"
    );
    assert!(
        !fixture.path("a.mcap").exists(),
        "a file without a pair stands in the way"
    );
}

#[test]
fn a_score_reports_what_it_had() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 100);
    let rows = "reports/arena/rows.csv";
    let line = "score short.toml -q --gate --junit j.xml";
    let sealed = || !unit_files(&fixture, "reports/arena", ".unit").is_empty();
    let (code, stderr) = interrupted(&fixture, line, sealed);
    assert_eq!(code, Some(1));
    assert!(
        stderr.starts_with("error: interrupted") && stderr.lines().count() == 1,
        "{stderr}"
    );
    let losses = "name=\"losses\"><failure message=\"interrupted";
    assert!(fixture.text("j.xml").contains(losses));
    // Also as soon as the report has its folder.
    std::fs::remove_file(fixture.path("j.xml")).unwrap();
    let begun = || fixture.path("new").exists();
    let (code, _) = interrupted(&fixture, &format!("{line} -o new"), begun);
    assert_eq!(code, Some(1));
    assert!(fixture.text("j.xml").contains(losses));
    // An incomplete report has rows and a page, but no summary.
    let text = fixture.text(rows);
    let lines = text.lines().count();
    assert!((2..1 + 2 * 4 * 100).contains(&lines), "{lines}");
    for ending in ["json", "csv", "parquet", "md", "tex"] {
        let file = format!("reports/arena/summary.{ending}");
        assert!(!fixture.path(&file).exists(), "{file}");
    }
    assert_says(&fixture.text("reports/arena/index.html"), &["incomplete"]);
    fixture
        .svl("report reports/arena")
        .failed(4, &["incomplete"]);
}

#[test]
fn a_reproduction_keeps_an_earlier_report_until_it_has_another() {
    let fixture = Fixture::new();
    fixture.write("reports/reproduce/reproduce.md", "earlier");
    fixture.write("reports/reproduce/reproduce.json", "{}");
    let recordings =
        || std::fs::read_dir(fixture.path("recordings")).is_ok_and(|files| files.count() > 0);
    // For 7.3 the arena's run is recorded first: there is nothing to report yet.
    let (code, stderr) = interrupted(&fixture, "reproduce 7.3 -q", recordings);
    assert_eq!(code, Some(1));
    assert!(
        stderr.starts_with("error: interrupted") && stderr.lines().count() == 1,
        "{stderr}"
    );
    assert_eq!(fixture.text("reports/reproduce/reproduce.md"), "earlier");
}

#[test]
fn a_calibration_uses_what_was_accepted() {
    let fixture = Fixture::new();
    let args = "calibrate board board --yes -o calib.xml";
    let (code, stderr) = interrupted(&fixture, args, || {
        fixture.path("calib-report/right08.png").exists()
    });
    assert_eq!(code, Some(0), "{stderr}");
    assert!(
        fixture.path("calib.xml").is_file() && fixture.path("calib-report/index.html").is_file()
    );
    assert!(
        !fixture.path("calib-report/left20.png").exists(),
        "it went on to the end"
    );
}
