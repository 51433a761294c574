//! `svl record` killed, with its folder removed, on a full disk; `svl recover` afterwards.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::interrupt::wait_until;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use svl::source::{RecordingSource, Source};
use svl::stereo::StereoPair;

/// Starts recording the arena into `file`.
fn record(fixture: &Fixture, file: &str) -> Child {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
    command
        .current_dir(fixture.path(""))
        .args(["record", "-q", "-o", file]);
    command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Waits until the recording has that many bytes.
fn wait_for(child: &mut Child, path: &Path, bytes: u64) {
    wait_until(child, || path.metadata().map_or(0, |m| m.len()) >= bytes);
}

fn failed_in_one_line(child: Child) -> String {
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.code() == Some(1)
            && stderr.starts_with("error: ")
            && stderr.lines().count() == 1,
        "{stderr}"
    );
    stderr
}

fn pairs(path: &Path) -> Vec<StereoPair> {
    let mut source = RecordingSource::open(path).unwrap();
    std::iter::from_fn(|| source.next().unwrap())
        .map(|frame| frame.pair)
        .collect()
}

/// Pairs are found by stamps; messages of `/stereo/sync` are not their number.
#[test]
fn a_truncated_bag_is_recovered_by_messages() {
    let fixture = Fixture::new();
    fixture.record("bag.mcap", "--frames 6 --ros2");
    let bag = fixture.bytes("bag.mcap");
    fixture.write("cut.mcap", &bag[..bag.len() * 6 / 10]);
    // Pairs are counted in recordings of svl alone.
    fixture.transcript(
        "recover cut.mcap -o saved.mcap => messages        /stereo | damaged parts   | !\\npairs ",
    );
}

#[test]
fn a_killed_recording_is_recovered() {
    let fixture = Fixture::new();
    let mut child = record(&fixture, "killed.mcap");
    wait_for(&mut child, &fixture.path("killed.mcap"), 3_000_000);
    child.kill().unwrap();
    child.wait().unwrap();
    fixture.write("text.mcap", "no recording");
    fixture.transcript(
        "info killed.mcap => intact          no | svl recover killed.mcap -o OUT.mcap
        recover killed.mcap -o saved.mcap => messages   | damaged parts  
        recover killed.mcap -o saved.mcap => 1: saved.mcap: exists already
        recover killed.mcap -o killed.mcap => 2: named twice
        recover none.mcap -o a.mcap => 1: none.mcap
        recover text.mcap -o a.mcap => 1: text.mcap: is not an MCAP file
        test ! -e a.mcap",
    );
    let saved = pairs(&fixture.path("saved.mcap"));
    fixture.run(&format!("record -o first.mcap --frames {}", saved.len()));
    let is_same = saved == pairs(&fixture.path("first.mcap"));
    assert!(saved.len() >= 5 && is_same, "{} pairs", saved.len());
}

/// Simulated cameras, whose recordings contain no scenario that could be found before the damage.
fn recorded_cameras() -> (Fixture, Vec<u8>) {
    let fixture = Fixture::new();
    let cameras = "sim:size=320x240,pictures=2 --frames 20 --allow-loss 100%";
    fixture.record("sim.mcap", cameras);
    let bytes = fixture.bytes("sim.mcap");
    (fixture, bytes)
}

#[test]
fn the_rest_of_an_unfinished_recording_is_replayed() {
    let (fixture, bytes) = recorded_cameras();
    fixture.write("cut.mcap", &bytes[..bytes.len() * 2 / 3]);
    fixture.transcript(
        "replay cut.mcap => cut.mcap:  | v5 => 1: incomplete or damaged | inside a record",
    );
}

#[test]
fn a_recovery_that_saves_less_than_the_file_has_is_incomplete() {
    let (fixture, mut bytes) = recorded_cameras();
    let middle = bytes.len() / 2;
    // Only the record in which it ends is lost.
    fixture.write("cut.mcap", &bytes[..middle]);
    bytes[middle] ^= 1;
    fixture.write("bad.mcap", &bytes);
    fixture.transcript(
        "recover bad.mcap -o saved.mcap => pairs   | damaged parts   | missing   \
        => 4: bad.mcap: recovered, but for 1 damaged part,
        recover cut.mcap -o rest.mcap",
    );
    assert!(!pairs(&fixture.path("saved.mcap")).is_empty());
}

#[test]
fn a_folder_removed_while_recording_is_told() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("gone")).unwrap();
    let mut child = record(&fixture, "gone/a.mcap");
    wait_for(&mut child, &fixture.path("gone/a.mcap"), 500_000);
    std::fs::remove_dir_all(fixture.path("gone")).unwrap();
    let stderr = failed_in_one_line(child);
    assert_says(&stderr, &["gone/a.mcap: no such file or folder"]);
}

#[test]
fn a_viewer_s_file_that_cannot_grow_ends_the_run() {
    let fixture = Fixture::new();
    let text = "name = \"small\"\nalgorithms = [\"bm\"]\n[source]\nkind = \"arena\"\nseeds = \
                [1]\n[arena]\nframes = 6\n[arena.rig]\nwidth_px = 160\nheight_px = 120\n";
    fixture.write("small.toml", text);
    fixture.run("score small.toml --rerun none -q");
    let svl = assert_cmd::cargo::cargo_bin!("svl").display();
    let limited = "trap '' XFSZ; ulimit -f 60; exec";
    let score = format!("{limited} {svl} score small.toml -o r -q");
    let mut bash = Command::new("bash");
    bash.args(["-c", &score]).current_dir(fixture.path(""));
    let ran = bash.output().unwrap();
    assert_eq!(ran.status.code(), Some(1));
    let words = "r/run-1.rrd: could not be written to its end";
    assert_says(&String::from_utf8_lossy(&ran.stderr), &[words]);
}

#[test]
fn a_full_disk_is_told_and_leaves_what_fitted() {
    let fixture = Fixture::new();
    let disk = fixture.path("disk");
    std::fs::create_dir(&disk).unwrap();
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=4m", "tmpfs"])
        .arg(&disk)
        .output();
    if !mounted.is_ok_and(|output| output.status.success()) {
        crate::common::skip("cannot mount a tmpfs");
        return;
    }
    let stderr = failed_in_one_line(record(&fixture, "disk/a.mcap"));
    let recovered = fixture.svl("recover disk/a.mcap -o saved.mcap");
    let unmounted = Command::new("umount").arg(&disk).status();
    assert_says(&stderr, &["disk/a.mcap: no space left"]);
    recovered.done();
    assert!(unmounted.unwrap().success() && pairs(&fixture.path("saved.mcap")).len() >= 5);
}
