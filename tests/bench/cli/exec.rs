//! A program as an algorithm, in every subcommand that accepts one.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::interrupt::interrupted;

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
    fixture.run(&["record", "--frames", "6", "-o", "a.mcap"]);
    let ran = fixture.svl(&[
        "replay", "a.mcap", "--algo", FAILS, "--algo", "v3", "--rows", "rows.csv", "--rerun",
        "run.rrd", "-o", "r.mcap",
    ]);
    assert_eq!(ran.code, Some(4));
    assert_says(&ran.stdout, &["v3", ": 6 pairs of"]);
    let told: Vec<_> = ran
        .stderr
        .lines()
        .filter(|line| line.contains("on pair"))
        .collect();
    assert_eq!(
        told.len(),
        2,
        "once for the same reason, once when it is not started again:\n{}",
        ran.stderr
    );
    assert!(
        told[0].contains("exit status: 3")
            && told[0].contains("sorry")
            && told[1].contains("not started again"),
        "{told:?}"
    );
    let end = "failed on 6 of 6 pairs; --allow-loss 6, or allow_loss = 6 of a scenario's [source], \
               accepts that; all else is kept\n";
    assert!(ran.stderr.ends_with(end), "{}", ran.stderr);
    let mut rows = csv::Reader::from_path(fixture.path("rows.csv")).unwrap();
    let column = rows
        .headers()
        .unwrap()
        .iter()
        .position(|h| h == "algorithm")
        .unwrap();
    assert_eq!(
        rows.records()
            .map(|r| r.unwrap()[column].to_owned())
            .collect::<Vec<_>>(),
        ["v3"; 6]
    );
}

#[test]
fn a_score_lacks_what_failed_and_judges_the_rest_by_its_name() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let score = ["score", "short.toml", "--rerun", "none", "--json", "-o"];
    let alone = fixture.run(&[&score[..], &["alone", "--algo", "v3"]].concat());
    let both = ["both", "--algo", FAILS, "--algo", "v3"];
    let both = fixture.svl(&[&score[..], &both].concat());
    assert_eq!(both.code, Some(4), "{}", both.stderr);
    let [alone, both] =
        [alone, both.stdout].map(|text| serde_json::from_str::<serde_json::Value>(&text).unwrap());
    for key in ["cells_right", "cells_wrong", "cells_unknown", "pairs"] {
        assert_eq!(
            alone["algorithms"][0][key], both["algorithms"][0][key],
            "{key}"
        );
    }
    let passed = |json: &serde_json::Value| {
        let checkpoints = json["checkpoints"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|c| c["algorithm"] == "v3");
        checkpoints
            .map(|c| (c["frames"].clone(), c["passed"].clone()))
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

/// Algorithm and reason of each line of a table of failures.
fn failed_pairs(table: &str) -> Vec<[String; 2]> {
    let mut table = csv::Reader::from_reader(table.as_bytes());
    let heads = table.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let places = ["algorithm", "reason"].map(place);
    let failed = table.records().map(|line| {
        let line = line.unwrap();
        places.map(|place| line[place].to_owned())
    });
    failed.collect()
}

/// An algorithm that failed on every pair has a line without numbers.
#[track_caller]
fn assert_never_has_no_numbers(json: &serde_json::Value, table: &str) {
    let never = json["algorithms"].as_array().unwrap().iter();
    let never: Vec<_> = never.filter(|a| a["algorithm"] == "never").collect();
    assert_eq!(never.len(), 1);
    assert_eq!(
        (&never[0]["pairs"], &never[0]["failed_pairs"]),
        (&0.into(), &5.into())
    );
    let mut table = csv::Reader::from_reader(table.as_bytes());
    let heads = table.headers().unwrap().clone();
    let lines = table.records().map(Result::unwrap);
    let never: Vec<_> = lines.filter(|line| &line[0] == "never").collect();
    assert_eq!(never.len(), 1);
    let filled = never[0]
        .iter()
        .zip(&heads)
        .filter(|(cell, _)| !cell.is_empty());
    assert_eq!(
        filled.collect::<Vec<_>>(),
        [
            ("never", "algorithm"),
            ("0", "pairs"),
            ("5", "failed_pairs")
        ]
    );
}

#[test]
fn failures_are_in_a_table_the_manifest_and_the_page() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("pairs")).unwrap();
    for i in 0..5 {
        let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}_{i}.pgm"));
        fixture.write_pair(&left, &right, (40, 20), 3 + i);
    }
    fixture.write("refuses.sh", REFUSES);
    let refuses = "some=exec:command=sh refuses.sh";
    let never = "never=exec:command=false,restarts=0";
    let bms = "bm:max_disparity=8..16/1";
    let line = ["score", "pairs", "-o", "r", "--rerun", "none"];
    let line = [
        &line[..],
        &["--algo", refuses, "--algo", never, "--algo", bms],
    ]
    .concat();
    let ran = fixture.svl(&line);
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    let failed = failed_pairs(&fixture.text("r/failures.csv"));
    let failures = |name: &'static str| {
        failed
            .iter()
            .filter(move |[algorithm, _]| algorithm == name)
    };
    assert_eq!(
        (failures("some").count(), failures("never").count()),
        (1, 5),
        "{failed:?}"
    );
    assert!(failures("some").all(|[_, reason]| reason.contains("too dark")));
    assert!(failures("never").any(|[_, reason]| reason.contains("failed 1 times")));
    let manifest = fixture.json_file("r/manifest.json");
    let record = &manifest["algorithms"][0];
    assert_eq!(record["failed_pairs"], 1);
    assert!(record["failure"].as_str().unwrap().contains("too dark"));
    let warnings = manifest["warnings"].as_array().unwrap();
    assert!(
        warnings
            .iter()
            .any(|line| line.as_str().unwrap().contains("too dark"))
    );
    // Fewer results are not better ones.
    assert_says(&ran.stdout, &["some failed on 1 pair: "]);
    let page = fixture.text("r/index.html");
    assert_says(
        &page,
        &[
            "some failed on 1 pair: ",
            "never failed on every pair: ",
            "id=\"failures\"",
            "id=\"warnings\"",
        ],
    );
    let json = fixture.svl(&[&line[..], &["--force", "--json"]].concat());
    let summary = json.json();
    assert_eq!(summary["failed"][0]["pairs"], 1);
    assert_eq!(summary["failed"][1]["on_every_pair"], true);
    assert_never_has_no_numbers(&summary, &fixture.text("r/summary.csv"));
    assert_eq!(
        ran.stdout
            .lines()
            .filter(|line| line.starts_with("never "))
            .count(),
        1
    );
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
    let lines = text.lines().map(|line| {
        if line.starts_with("algorithms =") {
            algorithms
        } else {
            line
        }
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    fixture.write("short.toml", text + gate);
    let never = "never=exec:command=false,restarts=0";
    let score = ["score", "short.toml", "--rerun", "none", "--json", "-o"];
    let alone = [&score[..], &["alone", "--algo", never]].concat();
    let alone = fixture.svl(&alone);
    let alone = alone.json();
    assert_eq!(alone["algorithms"][0]["failed_pairs"], 8);
    assert_eq!(alone["algorithms"][0]["p50_ms"], serde_json::Value::Null);
    assert!(fixture.path("alone/index.html").exists());
    let both = [
        "both", "--gate", "--sort", "time", "--algo", never, "--algo", "v3",
    ];
    let both = fixture.svl(&[&score[..], &both].concat());
    assert_eq!(both.code, Some(3), "{}", both.stderr);
    let both = both.json();
    let number = |i: usize, key: &str| both["algorithms"][i][key].clone();
    assert_eq!(
        [number(0, "algorithm"), number(1, "algorithm")],
        ["v3", "never"]
    );
    assert_eq!(
        (number(1, "pairs"), number(1, "scored_pairs")),
        (0.into(), 0.into())
    );
    assert!(number(1, "cells_wrong").is_null() && number(1, "results_hash") == "");
    for i in 0..2 {
        assert_eq!(both["gate"][i]["state"], "not-measured", "{i}");
    }
}

/// Whatever svl is doing, Ctrl-C ends a program that never answers, and the processes it started.
#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_ends_a_program_that_never_answers() {
    use std::os::unix::fs::PermissionsExt;
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (40, 20), 3);
    fixture.run(&["record", "--frames", "6", "-o", "a.mcap"]);
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
