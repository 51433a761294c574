//! A recorder killed at any moment: everything it had synced is recovered.
#![cfg(unix)]

use super::frames::{full, read, recover};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use svl::recording::{Header, ImageFormat, Writer};

const SIZE: (usize, usize) = (160, 120);
const RATE_HZ: u64 = 60;
/// A second of pairs, and half as much for a busy machine.
const MAY_BE_LOST: u64 = RATE_HZ * 3 / 2;
/// Passes the file's path to the process that will be killed.
const FILE: &str = "SVL_TEST_KILLED_RECORDING";

/// The process that is killed: it records at a camera's rate, and prints the pairs handed to the
/// writer.
#[test]
#[ignore = "the others start it and kill it"]
fn recorder() {
    let Some(path) = std::env::var_os(FILE) else {
        return;
    };
    let mut writer = Writer::create(path, &Header::new("test"), ImageFormat::Raw).unwrap();
    let began = Instant::now();
    for i in 0.. {
        writer.write(&full(i, SIZE)).unwrap();
        println!("\nwritten {i}");
        std::io::stdout().flush().unwrap();
        let due = Duration::from_micros((i + 1) * 1_000_000 / RATE_HZ);
        std::thread::sleep(due.saturating_sub(began.elapsed()));
    }
}

/// Kills a recorder after `life` and returns the number of pairs it had written and of those
/// recovered, all of them right.
fn kill_after(folder: &Path, life: Duration) -> (u64, u64) {
    let (path, saved) = (folder.join("killed.mcap"), folder.join("saved.mcap"));
    for path in [&path, &saved] {
        let _ = std::fs::remove_file(path);
    }
    let mut recorder = Command::new(std::env::current_exe().unwrap())
        .args("recording::kill::recorder --exact --ignored --nocapture".split(' '))
        .env(FILE, &path)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(recorder.stdout.take().unwrap())
        .lines()
        .map_while(Result::ok);
    let written = |line: &String| line.strip_prefix("written ")?.parse::<u64>().ok();
    // The recorder's life begins with the first pair, not while the program starts.
    let first = lines.find_map(|line| written(&line)).expect("it begins");
    std::thread::sleep(life);
    // On Unix this is SIGKILL.
    recorder.kill().unwrap();
    let handed = 1 + lines
        .filter_map(|line| written(&line))
        .last()
        .unwrap_or(first);
    recorder.wait().unwrap();

    let recovery = recover(&path, &saved).unwrap();
    assert_eq!(recovery.losses.len(), 1, "{:?}", recovery.losses);
    assert!(recovery.missing.is_empty());
    let (frames, error) = read(&saved);
    // Without a single pair there is nothing to read.
    assert!(error.is_none() || frames.is_empty(), "{error:?}");
    let mut numbered = (0..).zip(&frames);
    assert!(numbered.all(|(i, frame)| frame.pair == full(i, SIZE).pair));
    assert_eq!(recovery.pairs, frames.len() as u64);
    (handed, recovery.pairs)
}

fn kill_many(seed: u64, times: usize, longest: Duration) {
    let folder = tempfile::tempdir().unwrap();
    let mut random = fastrand::Rng::with_seed(seed);
    let mut lost = Vec::new();
    for _ in 0..times {
        let life = Duration::from_micros(random.u64(..longest.as_micros() as u64));
        let (handed, recovered) = kill_after(folder.path(), life);
        assert!(
            recovered <= handed + 1 && handed <= recovered + MAY_BE_LOST,
            "{recovered} of {handed} pairs saved"
        );
        lost.push(handed.saturating_sub(recovered));
    }
    lost.sort_unstable();
    let mean = lost.iter().sum::<u64>() as f64 / times as f64;
    let (median, most) = (lost[times / 2], lost[times - 1]);
    println!(
        "{times} kills at {RATE_HZ} pairs a second: lost {mean:.1} pairs on average, median \
         {median}, most {most}"
    );
}

#[test]
fn a_killed_recorder_loses_no_more_than_a_second() {
    kill_many(1, 5, Duration::from_millis(1800));
}

#[test]
#[ignore = "two minutes: cargo test --release --test bench fifty_kills -- --ignored --nocapture"]
fn fifty_kills() {
    kill_many(2, 60, Duration::from_secs(4));
}
