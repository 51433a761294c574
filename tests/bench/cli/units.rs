//! The units of a report: what is matched again, and what is not.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::results::{assert_same_report, edit_checked, unit_files};
use serde_json::Value;
use std::collections::BTreeSet;

/// Answers every pair of 32x24 pixels with the file `answer`, and notes each in a file. In a folder
/// with the file `dark` it fails on every third pair.
const COUNTS: &str = r#"
i=0
while read -r line; do
  head -c 1536 > /dev/null
  i=$((i+1))
  seq=$(echo "$line" | sed 's/.*"seq":\([0-9]*\).*/\1/')
  echo "$line" >> matched
  if [ -e dark ] && [ $((i % 3)) = 0 ]; then
    echo '{"seq":'$seq',"error":"too dark"}'
    continue
  fi
  echo '{"seq":'$seq',"millis":1}'
  cat answer
done
"#;

/// A folder of pairs, and a program that counts those that it matches.
fn counted(pairs: usize) -> Fixture {
    let fixture = Fixture::new();
    (0..pairs).for_each(|i| write_pair(&fixture, i, i % 5));
    fixture.write("counts.sh", COUNTS);
    fixture.write("answer", [0_u8; 4].repeat(32 * 24));
    fixture
}

fn write_pair(fixture: &Fixture, i: usize, shift: usize) {
    let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}_{i:04}.pgm"));
    fixture.write_pair(&left, &right, (32, 24), shift);
}

/// Scores by the program, and returns the number of pairs that it matched, the exit status and the
/// warnings.
fn score(fixture: &Fixture, more: &[&str]) -> (usize, Option<i32>, String) {
    let _ = std::fs::remove_file(fixture.path("matched"));
    let program = "net=exec:command=sh -c '. ./counts.sh'";
    let line = [
        "score", "pairs", "--rerun", "none", "-o", "r", "--algo", program,
    ];
    let ran = fixture.svl(&[&line[..], more].concat());
    let text = std::fs::read_to_string(fixture.path("matched")).unwrap_or_default();
    (text.lines().count(), ran.code, ran.stderr)
}

#[test]
fn the_same_command_matches_nothing_and_one_algorithm_more_itself() {
    let fixture = counted(70);
    // One more sets up its memory.
    assert_eq!(score(&fixture, &[]).0, 71);
    // One pair of each block shows that the program is the same.
    assert_eq!(score(&fixture, &[]).0, 2);
    let page = fixture.text("r/index.html");
    assert_says(
        &page,
        &["net: 2 of 70 kept results were computed again, as before"],
    );
    assert_eq!(score(&fixture, &["--algo", "bm:max_disparity=8"]).0, 2);
    // In each session another pair of a block, by the milliseconds of its beginning.
    let matched = |_| {
        assert_eq!(score(&fixture, &[]).0, 2);
        fixture.text("matched")
    };
    let sessions: BTreeSet<_> = (0..5).map(matched).collect();
    assert!(sessions.len() > 1, "{sessions:?}");
    let rows = fixture.text("r/rows.csv");
    assert_eq!(rows.lines().count(), 1 + 2 * 70);
    let (matched, code, stderr) = score(&fixture, &[]);
    assert_eq!((matched, code), (2, Some(0)));
    let others = "r: also in the folder, not asked for: bm:max_disparity=8; --prune removes them";
    assert_says(&stderr, &[others]);
    // What is not asked for any more stays until it is pruned.
    assert_eq!(fixture.text("r/rows.csv").lines().count(), 1 + 2 * 70);
    let units = || unit_files(&fixture, "r", ".unit").len();
    // Two blocks of each algorithm, and of the witness.
    assert_eq!(units(), 6);
    score(&fixture, &["--prune"]);
    assert_eq!(units(), 4);
    assert_eq!(score(&fixture, &["--force"]).0, 71);
    assert_eq!(units(), 4);
}

#[test]
fn files_are_compared_by_their_pairs_where_their_times_differ() {
    let fixture = counted(70);
    score(&fixture, &[]);
    // The same pixels, written anew.
    write_pair(&fixture, 3, 3);
    assert_eq!(score(&fixture, &[]).0, 2);
    // Other pixels: the block is matched again, of the 70 pairs the second one.
    write_pair(&fixture, 66, 2);
    assert_eq!(score(&fixture, &[]).0, 1 + 1 + 6);
    // One pair more.
    write_pair(&fixture, 70, 2);
    assert_eq!(score(&fixture, &[]).0, 1 + 1 + 7);
    assert_eq!(fixture.text("r/rows.csv").lines().count(), 1 + 71);
}

#[test]
fn pairs_with_other_stamps_are_matched_again() {
    let fixture = Fixture::new();
    // Named by their stamps: v5 uses the cells of pairs that follow within a second.
    let write = |step_ms: u64| {
        let _ = std::fs::remove_dir_all(fixture.path("p"));
        for i in 0..6 {
            let ns = 1_700_000_000_000_000_000 + i * step_ms * 1_000_000;
            let [left, right] = ["left", "right"].map(|side| format!("p/{side}/{ns}.pgm"));
            fixture.write_pair(&left, &right, (160, 96), 5);
        }
    };
    let cells = |report: &str| {
        fixture.run(&format!("-q score p --algo v5 --rerun none -o {report}"));
        fixture.text(&format!("{report}/cells.csv"))
    };
    write(100);
    let followed = cells("r");
    write(3000);
    let alone = cells("r");
    assert_ne!(alone, followed);
    assert_eq!(alone, cells("fresh"));
}

#[test]
fn a_folder_of_another_version_is_matched_again() {
    let fixture = counted(3);
    let line = "score pairs --rerun none -o r --algo bm:max_disparity=8";
    fixture.run(line);
    let rows = fixture.text("r/rows.csv");
    for (field, can_be_read) in [("/format", false), ("/manifest/sources", true)] {
        edit_checked(&fixture, "r/report.json", |plan| {
            *plan.pointer_mut(field).unwrap() = "another".into();
        });
        if !can_be_read {
            let words = "r/report.json: its units are of another version of svl | svl score";
            fixture.fails(&format!("report r => 1: {words}"));
        }
        let ran = fixture.svl(line);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert_says(&ran.stderr, &["of another version of svl"]);
        let pairs = |rows: &str| rows.lines().count();
        assert_eq!(pairs(&fixture.text("r/rows.csv")), pairs(&rows));
        fixture.run("report r");
    }
}

#[test]
fn a_run_that_was_killed_at_its_first_file_is_no_foreign_folder() {
    let fixture = counted(3);
    let line = "score pairs --rerun none --algo bm:max_disparity=8 -o";
    std::fs::create_dir_all(fixture.path("r/units")).unwrap();
    fixture.write("r/units/plan.77.part", "{");
    fixture.run(&format!("{line} r"));
    // Anything else is not svl's.
    std::fs::create_dir_all(fixture.path("s/units")).unwrap();
    fixture.write("s/units/own.txt", "mine");
    fixture.fails(&format!(
        "{line} s => 1: s: contains files but no report.json"
    ));
}

#[test]
fn a_program_that_answers_otherwise_is_matched_again() {
    let fixture = counted(5);
    score(&fixture, &[]);
    // The program's command and files are the same, but not what it reads.
    fixture.write("answer", 2_f32.to_le_bytes().repeat(32 * 24));
    let (matched, code, stderr) = score(&fixture, &[]);
    assert_eq!((matched, code), (1 + 6, Some(0)));
    assert_says(
        &stderr,
        &["net: its result of pair ", " is another than before"],
    );
    assert_eq!(score(&fixture, &[]).0, 1);
    // The report has no program that the command does not name.
    fixture.run("score pairs --rerun none -o r --algo bm:max_disparity=8");
    assert!(!fixture.text("r/summary.csv").contains("net"));
}

#[test]
fn pairs_that_a_program_failed_on_are_matched_again_with_their_warnings() {
    let fixture = counted(6);
    fixture.write("dark", "");
    let warnings = || {
        let text = fixture.text("r/manifest.json");
        let manifest: Value = serde_json::from_str(&text).unwrap();
        let warnings = manifest["warnings"].as_array().cloned().unwrap_or_default();
        let pair_warnings = warnings
            .iter()
            .filter(|text| text.as_str().unwrap().contains("on pair"));
        pair_warnings.count()
    };
    // It fails on two pairs: the first matching sets up its memory.
    assert_eq!(score(&fixture, &[]).1, Some(4));
    assert_eq!(warnings(), 2);
    std::fs::remove_file(fixture.path("dark")).unwrap();
    let (matched, code, _) = score(&fixture, &[]);
    assert_eq!((matched, code), (1 + 6, Some(0)));
    assert_eq!(warnings(), 0);
    assert_eq!(fixture.text("r/failures.csv").lines().count(), 1);
}

#[test]
fn times_of_several_sessions_are_not_compared() {
    let fixture = counted(5);
    let line = "score pairs --rerun none -q -o r --algo bm:max_disparity=8";
    fixture.run(line);
    let more = format!("{line} --algo v3:max_disparity=8");
    let text = fixture.run(&more);
    assert_says(&text, &["times are of several sessions", "--times"]);
    let fastest = "the fastest";
    assert!(!text.contains(fastest), "{text}");
    let text = fixture.run(&format!("{more} --times"));
    assert!(!text.contains("several sessions"), "{text}");
    // What is built again says the same.
    assert!(!fixture.run("report r").contains("several sessions"));
}

#[test]
fn an_edited_table_is_not_compared() {
    let fixture = counted(3);
    let line = "score pairs --rerun none -q --algo bm:max_disparity=8";
    for folder in ["a", "b"] {
        fixture.run(&format!("{line} -o {folder}"));
    }
    let rows = fixture.text("b/rows.csv");
    fixture.write("b/rows.csv", rows.replace("bm", "mb"));
    fixture.fails("compare a b => 1: b/rows.csv: was changed | svl report b");
    fixture.run("report b");
    assert_eq!(fixture.text("b/rows.csv"), rows);
    fixture.run("compare a b");
}

/// What is damaged, and how many pairs of the 70 are matched again besides one of each block that
/// is kept.
const DAMAGES: &[(&str, usize)] = &[
    ("report.json", 0),
    // The pairs of the run are read again, and compared.
    ("units/pairs-*/run.json", 0),
    ("units/pairs-*/00000-*.unit", 1 + 64),
    ("units/pairs-*/00001-*.unit", 1 + 6),
    ("rows.csv", 0),
    ("cells.parquet", 0),
    ("summary.json", 0),
    ("index.html", 0),
];

#[test]
fn a_damaged_file_costs_its_unit_never_the_folder() {
    let fixture = counted(70);
    score(&fixture, &[]);
    std::fs::create_dir(fixture.path("outside")).unwrap();
    let find = |pattern: &str| {
        let parts: Vec<_> = pattern.split('*').collect();
        // The program counts its own pairs, not those of the witness.
        let is_witness = |file: &str| {
            let bytes = fixture.bytes(file);
            String::from_utf8_lossy(&bytes).contains("\"label\":\"witness\"")
        };
        let fits =
            |file: &String| parts.iter().all(|part| file.contains(part)) && !is_witness(file);
        let units = unit_files(&fixture, "r", "").into_iter();
        let mut found = units.filter(|file| pattern.contains("units/") && fits(file));
        found.next_back().unwrap_or_else(|| format!("r/{pattern}"))
    };
    type Damage = fn(&Fixture, &str);
    let kinds: [(&str, Damage); 5] = [
        ("cut", |fixture, file| {
            let bytes = fixture.bytes(file);
            fixture.write(file, &bytes[..bytes.len() / 2]);
        }),
        ("a bit flipped", |fixture, file| {
            let mut bytes = fixture.bytes(file);
            let middle = bytes.len() / 2;
            bytes[middle] ^= 4;
            fixture.write(file, bytes);
        }),
        ("a pipe", |fixture, file| {
            std::fs::remove_file(fixture.path(file)).unwrap();
            let made = std::process::Command::new("mkfifo")
                .arg(fixture.path(file))
                .status();
            assert!(made.unwrap().success());
        }),
        ("another file", |fixture, file| {
            fixture.write(file, "mine");
        }),
        ("a link", |fixture, file| {
            std::fs::remove_file(fixture.path(file)).unwrap();
            let outside = fixture.write("outside/mine.txt", "mine");
            std::os::unix::fs::symlink(outside, fixture.path(file)).unwrap();
        }),
    ];
    for (pattern, again) in DAMAGES {
        for (kind, damage) in kinds {
            let file = find(pattern);
            damage(&fixture, &file);
            let kept = if *again == 0 { 2 } else { 1 };
            let (matched, code, stderr) = score(&fixture, &[]);
            let what = format!("{kind}: {file}: {stderr}");
            assert_eq!((matched, code), (kept + again, Some(0)), "{what}");
            assert_same_report(&fixture, ["r", "r"], &what);
            assert_eq!(fixture.text("r/rows.csv").lines().count(), 1 + 70, "{what}");
        }
        assert_eq!(fixture.text("outside/mine.txt"), "mine");
    }
    // Without its session, a unit does not count.
    for file in unit_files(&fixture, "r", ".json") {
        if file.contains("/sessions/") {
            fixture.write(&file, "mine");
        }
    }
    assert_eq!(score(&fixture, &[]).0, 1 + 70);
    score(&fixture, &[]);
    assert!(!fixture.text("r/manifest.json").contains("is damaged"));
    // A file of another stays where it is.
    fixture.write("r/notes.txt", "mine");
    assert_eq!(score(&fixture, &["--prune"]).1, Some(0));
    assert_eq!(fixture.text("r/notes.txt"), "mine");
}
