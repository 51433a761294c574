//! A program as an algorithm, in every subcommand that accepts one.
#![cfg(unix)]

use super::fixture::{CommandLine, Fixture, assert_says};
use super::interrupt::interrupted;
use serde_json::Value;

const FAILS: &str = "exec:command=sh -c 'echo sorry >&2; exit 3'";

/// Answers a pair of 40x20 pixels with zeros.
const ZEROS: &str = r#"
read -r line
dd bs=1 count=1600 of=/dev/null 2>/dev/null
echo '{"seq":1,"millis":2}'
head -c 3200 /dev/zero
"#;

#[test]
fn a_program_matches_a_pair_and_says_why_it_does_not() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (40, 20), 3);
    fixture.write("zeros, all of them.sh", ZEROS);
    let zeros = "exec:command=sh 'zeros, all of them.sh'";
    let text = fixture.run(&["match", "l.pgm", "r.pgm", "-o", "d.pfm", "--algo", zeros]);
    assert_says(&text, &["100.0 % of the pixels"]);
    let line = [
        "match", "l.pgm", "r.pgm", "-q", "-o", "e.pfm", "--algo", FAILS,
    ];
    let error = fixture.svl(&line);
    error.failed(1, &["sh -c", "exit status: 3", "it said: sorry"]);
    assert!(!fixture.path("e.pfm").exists());
}

#[test]
fn the_others_go_on_when_one_fails() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 6");
    let ran = fixture.svl(&[
        "replay", "a.mcap", "--algo", FAILS, "--algo", "v3", "--rows", "rows.csv", "--rerun",
        "run.rrd", "-o", "r.mcap",
    ]);
    assert_eq!(ran.code, Some(4));
    assert_says(&ran.stdout, &["v3", ": 6 pairs of"]);
    let told = ran.stderr.lines().filter(|line| line.contains("on pair"));
    // Once for the same reason, once when it is not started again.
    let [first, last] = told.collect::<Vec<_>>()[..] else {
        panic!("{}", ran.stderr)
    };
    assert_says(first, &["exit status: 3", "sorry"]);
    assert_says(last, &["not started again"]);
    let end = "failed on 6 of 6 pairs; --allow-loss 6, or allow_loss = 6 of a scenario's [source], \
               accepts that; all else is kept\n";
    assert!(ran.stderr.ends_with(end), "{}", ran.stderr);
    assert_eq!(fixture.column("rows.csv", "algorithm"), ["v3"; 6]);
}

#[test]
fn a_score_lacks_what_failed_and_judges_the_rest_by_its_name() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let score = "score short.toml --rerun none --json --algo v3";
    let alone = fixture.json(&format!("{score} -o alone"));
    let failing = [FAILS, "-o", "both"];
    let both = fixture.svl(&[&score.arguments()[..], &["--algo"], &failing].concat());
    assert_eq!(both.code, Some(4), "{}", both.stderr);
    let both = both.json();
    for key in ["cells_right", "cells_wrong", "cells_unknown", "pairs"] {
        assert_eq!(alone["algorithms"][0][key], both["algorithms"][0][key]);
    }
    let passed = |json: &Value| {
        let checkpoints = json["checkpoints"].as_array().unwrap().iter();
        let own = checkpoints.filter(|c| c["algorithm"] == "v3");
        own.map(|c| (c["frames"].clone(), c["passed"].clone()))
            .collect::<Vec<_>>()
    };
    assert!(!passed(&alone).is_empty());
    assert_eq!(passed(&alone), passed(&both));
}

/// Answers every pair of 40x20 pixels except the third, which it refuses.
const REFUSES: &str = r#"
i=0
while read -r line; do
  i=$((i+1))
  dd bs=1 count=1600 of=/dev/null 2>/dev/null
  if [ $i = 3 ]; then echo '{"seq":'$i',"error":"too dark"}'; continue; fi
  echo '{"seq":'$i',"millis":2}'
  head -c 3200 /dev/zero
done
"#;

/// An algorithm that failed on every pair has a line without numbers.
#[track_caller]
fn assert_never_has_no_numbers(table: &str) {
    let mut table = csv::Reader::from_reader(table.as_bytes());
    let heads = table.headers().unwrap().clone();
    let lines = table.records().map(Result::unwrap);
    let never: Vec<_> = lines.filter(|line| &line[0] == "never").collect();
    assert_eq!(never.len(), 1);
    let cells = never[0].iter().zip(&heads);
    let filled: Vec<_> = cells.filter(|(cell, _)| !cell.is_empty()).collect();
    let expected = [
        ("never", "algorithm"),
        ("0", "pairs"),
        ("5", "failed_pairs"),
    ];
    assert_eq!(filled, expected);
}

#[test]
fn failures_are_in_a_table_the_manifest_and_the_page() {
    let fixture = Fixture::new();
    for i in 0..5 {
        let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}_{i}.pgm"));
        fixture.write_pair(&left, &right, (40, 20), 3 + i);
    }
    fixture.write("refuses.sh", REFUSES);
    let line = "score pairs -o r --rerun none --algo 'some=exec:command=sh refuses.sh' \
                --algo never=exec:command=false,restarts=0 --algo bm:max_disparity=8..16/1";
    // Fewer results are not better ones.
    let ran = fixture.svl(line);
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    assert_says(&ran.stdout, &["some failed on 1 pair: "]);
    let lines = ran.stdout.lines();
    assert_eq!(lines.filter(|line| line.starts_with("never ")).count(), 1);
    let [algorithms, reasons] =
        ["algorithm", "reason"].map(|name| fixture.column("r/failures.csv", name));
    let failures = |name: &str| {
        let failed = algorithms.iter().zip(&reasons);
        let own = failed.filter(|(algorithm, _)| *algorithm == name);
        own.map(|(_, reason)| reason.as_str()).collect::<Vec<_>>()
    };
    let (some, never) = (failures("some"), failures("never"));
    assert_eq!((some.len(), never.len()), (1, 5), "{reasons:?}");
    assert_says(some[0], &["too dark"]);
    assert_says(&never.join("\n"), &["failed 1 times"]);
    fixture.transcript(&format!(
        "cat r/manifest.json => /algorithms/0/failed_pairs = 1 \
        | /algorithms/0/failure has too dark | /warnings has too dark
        cat r/index.html => some failed on 1 pair:  | never failed on every pair:  \
        | id=\"failures\" | id=\"warnings\"
        {line} --force --json => /failed/0/pairs = 1 | /failed/1/on_every_pair = true \
        | /algorithms/never/pairs = 0 | /algorithms/never/failed_pairs = 5 => 4~"
    ));
    assert_never_has_no_numbers(&fixture.text("r/summary.csv"));
}

#[test]
fn an_algorithm_that_failed_on_every_pair_is_not_measured() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 4);
    let text = fixture.text("short.toml");
    let gate = "\n[[gate]]\nalgorithm = \"never\"\nmetric = \"wrong\"\nmax = 0.99\n\
                [[gate]]\nalgorithm = \"v3\"\nmetric = \"time\"\nrelative_to = \"never\"\n\
                max = 1000.0\n";
    let text = text.split("[[gate]]").next().unwrap();
    let algorithms = "algorithms = [\"never=exec:command=false,restarts=0\", \"v3\"]";
    let lines = text.lines().map(|line| match line {
        line if line.starts_with("algorithms =") => algorithms,
        line => line,
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    fixture.write("short.toml", text + gate);
    let score = "score short.toml --rerun none --json --algo never=exec:command=false,restarts=0";
    fixture.transcript(&format!(
        "{score} -o alone => /algorithms/0/failed_pairs = 8 | /algorithms/0/p50_ms = null => 4~
        test -e alone/index.html
        {score} -o both --gate --sort time --algo v3 => /algorithms/0/algorithm = v3 \
        | /algorithms/1/algorithm = never | /algorithms/1/pairs = 0 \
        | /algorithms/1/scored_pairs = 0 | /algorithms/1/cells_wrong = null \
        | /algorithms/1/results_hash = \"\" | /gate/# = 2 | /gate/*/state = not-measured => 3~"
    ));
}

/// Whatever svl is doing, Ctrl-C ends a program that never answers, and the processes it started.
#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_ends_a_program_that_never_answers() {
    use std::os::unix::fs::PermissionsExt;
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (40, 20), 3);
    fixture.record("a.mcap", "--frames 6");
    let hang = fixture.write("hang", "#!/bin/sh\nsleep 600 &\necho $! > child\nwait\n");
    std::fs::set_permissions(hang, PermissionsExt::from_mode(0o755)).unwrap();
    for line in [
        "replay a.mcap --algo exec:command=./hang,timeout_s=600 -o r.mcap",
        "score a.mcap --algo exec:command=./hang,timeout_s=600 -o r",
        "match l.pgm r.pgm -o d.pfm --algo exec:command=./hang,timeout_s=600",
        "bench --algo exec:command=./hang,timeout_s=600",
    ] {
        let child = || std::fs::read_to_string(fixture.path("child")).unwrap_or_default();
        let (code, stderr) = interrupted(&fixture, line, || child().ends_with('\n'));
        assert_ne!(code, Some(0), "{line}: {stderr}");
        assert!(!stderr.contains("timed out"), "{line}: {stderr}");
        assert!(
            !stderr.contains("on pair"),
            "no failure of the program: {stderr}"
        );
        // Killed with its group, it disappears a moment later; it is a zombie until its end was
        // seen.
        let stat = format!("/proc/{}/stat", child().trim());
        let state = || std::fs::read_to_string(&stat).unwrap_or_default();
        let began = std::time::Instant::now();
        while !state().is_empty() && !state().contains(") Z ") {
            assert!(began.elapsed().as_secs() < 30, "{line}: {}", state());
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        std::fs::remove_file(fixture.path("child")).unwrap();
    }
}
