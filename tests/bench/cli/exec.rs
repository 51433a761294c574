//! A program as an algorithm, in every subcommand that takes one.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};

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
    let error = fixture.svl(&["match", "l.pgm", "r.pgm", "-o", "e.pfm", "--algo", FAILS]);
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
    assert_eq!(ran.code, Some(1));
    assert_says(&ran.stdout, &["v3", "(6 pairs)"]);
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
    assert!(
        ran.stderr
            .ends_with("error: algorithms failed on 6 pairs, as warned; all else is kept\n"),
        "{}",
        ran.stderr
    );
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
    fixture.write_short_arena("short.toml", 60);
    let alone = fixture.run(&[
        "score",
        "short.toml",
        "--algo",
        "v3",
        "--json",
        "--out",
        "alone",
    ]);
    let both = fixture.svl(&[
        "score",
        "short.toml",
        "--algo",
        FAILS,
        "--algo",
        "v3",
        "--json",
        "--out",
        "both",
    ]);
    assert_eq!(both.code, Some(1), "{}", both.stderr);
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

/// What a user of `adapters/python` writes, and what goes wrong there.
const DECORATED: &str = r#"
import numpy as np
import svl_matcher

@svl_matcher.matcher
def mine(left, right, request):
    print("a library prints")
    if request.sequence == 2:
        raise ValueError("no\nsuch texture")
    if request.sequence == 3:
        return np.zeros((2, 2))
    cells = [(5.0, 0.9)] + [None] * (request.grid[0] * request.grid[1] - 1)
    return np.where(left % 2 == 0, 5.0, np.nan), cells
"#;

#[test]
fn a_decorated_function_of_two_arrays_is_a_matcher() {
    let root = env!("CARGO_MANIFEST_DIR");
    let python = std::env::var("SVL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let package = format!("PYTHONPATH={root}/adapters/python/src");
    let has_numpy = std::process::Command::new(&python)
        .args(["-c", "import numpy"])
        .output();
    if !has_numpy.is_ok_and(|output| output.status.success()) {
        println!("skipped: no numpy; name a Python that has it in SVL_PYTHON");
        return;
    }
    let fixture = Fixture::new();
    fixture.write("mine.py", DECORATED);
    fixture.run(&["record", "--frames", "4", "-o", "a.mcap"]);
    let mine = format!("mine=exec:command='env' '{package}' '{python}' mine.py");
    let ran = fixture.svl(&[
        "score", "a.mcap", "--algo", &mine, "--out", "r", "--rerun", "none",
    ]);
    // Two of the four pairs fail, each with its own words.
    assert_eq!(ran.code, Some(1));
    assert_says(
        &ran.stderr,
        &[
            "ValueError: no such texture",
            "disparities of shape (2, 2), expected (240, 320)",
        ],
    );
    let cells = fixture.text("r/cells.csv");
    let known = cells.lines().filter(|line| line.contains(",0.9,")).count();
    assert_eq!(known, 2, "{cells}");
    let about = std::process::Command::new(&python)
        .args(["-c", "import mcap, mcap_protobuf, mcap_ros2, PIL"])
        .output();
    if !about.is_ok_and(|output| output.status.success()) {
        println!("skipped: reading, as the MCAP libraries are missing");
        return;
    }
    let read = "import svl_matcher\nfor p in svl_matcher.read('a.mcap'): print(p.left.shape, \
                p.right.dtype, p.depth_m.shape)";
    let output = std::process::Command::new("env")
        .args([&package, &python, "-c", read])
        .current_dir(fixture.path(""))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(
        text.matches("(240, 320) uint8 (240, 320)").count(),
        4,
        "{text}"
    );
}
