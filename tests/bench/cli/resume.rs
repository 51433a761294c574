//! `svl score --resume`: a killed run resumes, and ends as it would have.

use super::fixture::{Fixture, assert_says, pgm};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SCORE: &str = "score short.toml --algo v3 --algo bm --algo v5 -o r";

fn short_arena() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 60);
    fixture
}

/// The lines of a table without the columns whose names begin or end with these, which vary.
fn columns_but(table: &str, but: &[&str]) -> Vec<Vec<String>> {
    let mut lines = csv::Reader::from_reader(table.as_bytes());
    let heads = lines.headers().unwrap().clone();
    let differs = |head: &str| but.iter().any(|of| head.ends_with(of));
    let kept = |line: csv::StringRecord| {
        let cells = line.iter().zip(&heads);
        let kept = cells.filter(|(_, head)| !differs(head));
        kept.map(|(cell, _)| cell.to_owned()).collect()
    };
    lines.records().map(|line| kept(line.unwrap())).collect()
}

/// Truncates a file after that fraction of its bytes.
fn cut(fixture: &Fixture, name: &str, share: f64) {
    let bytes = fixture.bytes(name);
    fixture.write(name, &bytes[..(bytes.len() as f64 * share) as usize]);
}

#[test]
fn a_resumed_run_ends_as_if_it_had_not_been_killed() {
    let fixture = short_arena();
    fixture.run(&format!("{SCORE} -q"));
    let tables = ["rows", "cells", "checkpoints", "verdicts", "summary"];
    let whole = tables.map(|table| fixture.text(&format!("r/{table}.csv")));
    let manifest = fixture.text("r/manifest.json");
    // The state after a kill: tables that end within a line, and no summary.
    let names = std::fs::read_dir(fixture.path("r")).unwrap();
    for name in names.map(|entry| entry.unwrap().file_name().into_string().unwrap()) {
        if !["rows.csv", "cells.csv", "manifest.json"].contains(&name.as_str()) {
            std::fs::remove_file(fixture.path(&format!("r/{name}"))).unwrap();
        }
    }
    cut(&fixture, "r/rows.csv", 0.61);
    cut(&fixture, "r/cells.csv", 0.58);
    let taken = fixture.text("r/cells.csv").matches('\n').count() / 15;
    let rows = fixture.text("r/rows.csv");
    let kept: Vec<_> = rows.lines().take(taken / 3 * 3).collect();
    fixture.run(&format!("{SCORE} -q --resume"));
    // The rows of complete pairs are the same to the last byte, with their times.
    let resumed = fixture.text("r/rows.csv");
    assert!(kept.len() > 150, "{}", kept.len());
    assert_eq!(resumed.lines().take(kept.len()).collect::<Vec<_>>(), kept);
    let differing = ["_us", "_ms", "_s", "outliers", "memory_mb"];
    for (table, whole) in tables.iter().zip(&whole) {
        let text = fixture.text(&format!("r/{table}.csv"));
        let [resumed, whole] = [&text, whole].map(|table| columns_but(table, &differing));
        assert_eq!(resumed, whole, "{table}");
    }
    let key = |manifest: &str, key: &str| {
        let json: serde_json::Value = serde_json::from_str(manifest).unwrap();
        json[key].clone()
    };
    let after = fixture.text("r/manifest.json");
    assert_eq!(key(&after, "run_id"), key(&manifest, "run_id"));
    assert_eq!(key(&after, "resumed").as_array().unwrap().len(), 1);
    assert!(!fixture.path("r.earlier-1").exists());
    // Nothing is left to do, so it ends soon.
    fixture.run(&format!("{SCORE} -q --resume"));
    let others = "
        score short.toml -q --algo v3 -o r --resume => 1: r: cannot be resumed | algorithms: v3
        score short.toml -q --algo v3 --algo bm --algo v5 -o r --resume --repeat 2 => \
            1: cannot be resumed | times: matching alone | without --resume
    ";
    fixture.fails(others);
    // Without anything to resume it starts.
    fixture.run("score short.toml -q --algo v3 -o new --resume");
}

/// Answers every pair with no disparities, and notes each in a file.
#[cfg(unix)]
const COUNTS: &str = r#"
while read -r line; do
  head -c 1536 > /dev/null
  echo >> matched
  echo '{"seq":'$(echo "$line" | sed 's/.*"seq":\([0-9]*\).*/\1/')',"millis":1}'
  head -c 3072 /dev/zero
done
"#;

#[cfg(unix)]
#[test]
fn a_killed_run_of_3000_pairs_repeats_little() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("pairs")).unwrap();
    for i in 0..3000 {
        let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}_{i:04}.pgm"));
        fixture.write_pair(&left, &right, (32, 24), i);
    }
    fixture.write("counts.sh", COUNTS);
    let line = "score pairs -q -o r --rerun none --algo exec:command='sh counts.sh'";
    let words: Vec<_> = line.split(" exec:").collect();
    let algorithm = format!("exec:{}", words[1]);
    let line: Vec<_> = words[0].split(' ').chain([algorithm.as_str()]).collect();
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
    command
        .current_dir(fixture.path(""))
        .args(&line)
        .stdout(Stdio::null());
    let mut child = command.spawn().unwrap();
    let began = Instant::now();
    let count = |name: &str| {
        let text = std::fs::read_to_string(fixture.path(name)).unwrap_or_default();
        text.matches('\n').count()
    };
    while count("r/rows.csv") < 2700 {
        assert!(child.try_wait().unwrap().is_none(), "it ended early");
        assert!(
            began.elapsed() < Duration::from_secs(300),
            "it never came that far"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    std::fs::remove_file(fixture.path("matched")).unwrap();
    fixture.run(&[&line[..], &["--resume"]].concat());
    assert_eq!(count("r/rows.csv"), 3001);
    let again = count("matched");
    assert!((1..600).contains(&again), "{again} pairs matched again");
}

#[cfg(unix)]
#[test]
fn a_run_that_is_killed_twice_goes_on_twice() {
    let fixture = short_arena();
    // Recorded before, so that the kills happen during scoring.
    fixture.run("score short.toml -q --algo v3 -o first");
    let kill_after = |rows: usize| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
        command
            .current_dir(fixture.path(""))
            .args(SCORE.split(' '))
            .args(["-q", "--resume"])
            .stdout(Stdio::null());
        let mut child = command.spawn().unwrap();
        let began = Instant::now();
        let path = fixture.path("r/rows.csv");
        let lines = || std::fs::read_to_string(&path).map_or(0, |text| text.lines().count());
        while lines() < rows && child.try_wait().unwrap().is_none() {
            assert!(began.elapsed() < Duration::from_secs(120), "it never began");
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        fixture.text("r/rows.csv")
    };
    let first = kill_after(100);
    let second = kill_after(150);
    fixture.run(&format!("{SCORE} -q --resume"));
    let rows = fixture.text("r/rows.csv");
    assert_eq!(rows.lines().count(), 1 + 2 * 60 * 3);
    for part in [first, second] {
        let whole = &part[..part.rfind('\n').unwrap()];
        let own: Vec<_> = whole.lines().collect();
        let cells_are_whole = own.len().saturating_sub(3);
        assert_eq!(
            rows.lines().take(cells_are_whole).collect::<Vec<_>>(),
            own[..cells_are_whole]
        );
    }
    assert!(!fixture.path("r.earlier-1").exists() && !fixture.path("r.earlier-2").exists());
    let page = fixture.text("r/index.html");
    assert_says(&page, &["resumed"]);
}

#[test]
fn an_unfinished_run_is_not_replaced_without_a_word() {
    let fixture = short_arena();
    fixture.run("score short.toml -q --algo v3 -o r");
    std::fs::remove_file(fixture.path("r/summary.json")).unwrap();
    let ran = fixture.svl("score short.toml --algo v3 -o r");
    assert_says(&ran.stderr, &["unfinished run", "--resume"]);
}

#[cfg(unix)]
#[test]
fn another_program_behind_the_same_command_does_not_go_on() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("pairs")).unwrap();
    for i in 0..60 {
        let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}_{i:04}.pgm"));
        fixture.write_pair(&left, &right, (32, 24), i);
    }
    let program = |byte: &str| {
        let text = COUNTS.replace("/dev/zero", &format!("answer-{byte}"));
        fixture.write("model", byte);
        fixture.write(
            "counts.sh",
            text.replace(&format!("answer-{byte}"), "answer"),
        );
        // Disparities of 0 or of 2.
        let float: &[u8] = if byte == "0" {
            &[0, 0, 0, 0]
        } else {
            &[0, 0, 0, 0x40]
        };
        fixture.write("answer", float.repeat(32 * 24));
    };
    program("0");
    let algorithm = "exec:command=sh -c '. ./counts.sh'";
    let line = [
        "score", "pairs", "-q", "-o", "r", "--rerun", "none", "--algo", algorithm,
    ];
    fixture.run(&line);
    let rows = fixture.text("r/rows.csv");
    let kept: Vec<_> = rows.lines().take(50).collect();
    fixture.write("r/rows.csv", kept.join("\n") + "\n");
    std::fs::remove_file(fixture.path("r/summary.json")).unwrap();
    let again = [&line[..], &["--resume"]].concat();
    program("1");
    let ran = fixture.svl(&again);
    ran.failed(1, &["its result of pair 0 differs", "without --resume"]);
}

/// Answers pairs of 40x20 pixels with 2.0, out of its range; in a folder named `dark`, those whose
/// first pixel is 1 with an error.
#[cfg(unix)]
const SOME_ARE_DARK: &str = r#"
while read -r line; do
  seq=${line#*'"seq":'}
  seq=${seq%%[,\}]*}
  first=$(head -c 1 | od -An -tu1)
  head -c 1599 > /dev/null
  if [ $first -eq 1 ] && [ -e dark ]; then
    echo "{\"seq\":$seq,\"error\":\"too dark\"}"
  else
    echo "{\"seq\":$seq,\"millis\":1}"
    cat answer
  fi
done
"#;

#[cfg(unix)]
#[test]
fn a_resumed_run_warns_of_all_its_parts_and_of_nothing_that_it_redid() {
    let fixture = Fixture::new();
    for pair in 0..4u8 {
        for side in ["left", "right"] {
            let mut pixels = vec![90; 800];
            pixels[0] = pair % 2;
            fixture.write(&format!("pairs/{side}/{pair}.pgm"), pgm(40, 20, &pixels));
        }
    }
    fixture.write("dark.sh", SOME_ARE_DARK);
    fixture.write("answer", 2f32.to_le_bytes().repeat(800));
    fixture.write("dark", "");
    let algorithm = "net=exec:command='sh dark.sh',max_disparity=1";
    let line = [
        "score", "pairs", "-q", "--rerun", "none", "-o", "r", "--resume", "--algo", algorithm,
    ];
    let manifest = || -> (Vec<String>, [u64; 3]) {
        let json: serde_json::Value =
            serde_json::from_str(&fixture.text("r/manifest.json")).unwrap();
        let warnings = json["warnings"].as_array().unwrap();
        let of_net = warnings.iter().map(|of| of.as_str().unwrap().to_owned());
        let program = &json["algorithms"][0]["program"];
        let counts = ["pairs", "disparities", "out_of_range"].map(|n| program[n].as_u64().unwrap());
        (of_net.filter(|of| of.starts_with("net")).collect(), counts)
    };
    assert_eq!(fixture.svl(&line).code, Some(4));
    let (warnings, [_, first, _]) = manifest();
    // The pairs 1 and 3, and the range.
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    std::fs::remove_file(fixture.path("dark")).unwrap();
    fixture.run(&line);
    assert_eq!(fixture.text("r/failures.csv").lines().count(), 1);
    let (warnings, [pairs, all, outside]) = manifest();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert_says(&warnings[0], &[&format!("{all} of the {all} disparities")]);
    assert!(
        all > first && first > 0 && outside == all && pairs > 3,
        "{first} {all} {pairs}"
    );
}
