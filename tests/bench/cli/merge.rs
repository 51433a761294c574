//! `svl report -o`: parts that do not belong together, and the contents that are not joined.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::results::{edit_checked, unit_files};
use serde_json::Value;

/// Answers every pair of 40x20 pixels with zeros, but refuses the third.
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

/// A folder of four pairs.
fn pairs() -> Fixture {
    let fixture = Fixture::new();
    (0..4).for_each(|i| write_pair(&fixture, i, 3));
    fixture
}

fn write_pair(fixture: &Fixture, i: usize, shift: usize) {
    let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}_{i}.pgm"));
    fixture.write_pair(&left, &right, (40, 20), shift);
}

const SCORE: &str = "score pairs --algo bm:max_disparity=8 --stress noise=4/8 -q --rerun none";

fn scored_part(fixture: &Fixture, i: usize) {
    fixture.run(&format!("{SCORE} --shard {i}/3 -o p{i}"));
}

/// The file of a part's only session.
fn session(fixture: &Fixture, part: &str) -> String {
    let mut files = unit_files(fixture, &format!("p{part}"), ".json");
    files.retain(|file| file.contains("/sessions/"));
    files.remove(0)
}

#[test]
fn parts_of_changed_pictures_are_refused() {
    let fixture = pairs();
    scored_part(&fixture, 1);
    scored_part(&fixture, 2);
    // The pictures have the same names and sizes, and the parts other levels of noise.
    write_pair(&fixture, 2, 4);
    scored_part(&fixture, 3);
    fixture.fails(
        "report p1 p2 p3 -o all => 1: p3: is not of the same run as p1 | calibration or truth of",
    );
    scored_part(&fixture, 1);
    scored_part(&fixture, 2);
    fixture.run("report p3 p2 p1 -o all -q");
}

#[test]
fn broken_files_of_a_part_are_named_with_the_cure() {
    let fixture = pairs();
    (1..=3).for_each(|i| scored_part(&fixture, i));
    let file = "p2/report.json";
    let whole = fixture.text(file);
    for text in [&whole[..whole.len() / 2], "\0\0\0\0", "{}"] {
        fixture.write(file, text);
        let words = format!("{file}: is damaged | `svl score` with the same options");
        fixture.fails(&format!("report p1 p2 p3 -o all => 1: {words}"));
    }
    fixture.write(file, whole);
    fixture.run("report p1 p2 p3 -o all -q");
    fixture.write("all/manifest.json", "{");
    fixture.fails("compare all all => 1: all/manifest.json: is cut off | score it again");
}

#[test]
fn parts_of_another_program_are_refused() {
    let fixture = pairs();
    fixture.write("refuses.sh", REFUSES);
    let score = |part: &str, limit: &str| {
        let line = format!(
            "score pairs --stress noise=8 -q --rerun none --shard {part}/2 --allow-loss {limit} \
             -o p{part} --algo"
        );
        let line: Vec<_> = line
            .split(' ')
            .chain(["some=exec:command=sh refuses.sh"])
            .collect();
        fixture.svl(&line).code
    };
    // A quarter of the pairs fails: the limit is that of the whole.
    for part in ["1", "2"] {
        assert_eq!(score(part, "30%"), Some(0));
    }
    for (limit, code) in [("", 0), ("--allow-loss 10%", 4)] {
        let ran = fixture.svl(&format!("report p1 p2 -o all -q {limit}"));
        assert_eq!(ran.code, Some(code), "{limit}: {}", ran.stderr);
        let unknown = "some: its program reports no version and no model";
        let manifest = fixture.text("all/manifest.json");
        assert_eq!(manifest.matches(unknown).count(), 1, "{manifest}");
        let summary = fixture.json_file("all/summary.json");
        let state = if code == 4 { "lossy" } else { "complete" };
        assert_eq!(summary["state"], state, "{limit}");
    }
    let program = |version: &str| {
        edit_checked(&fixture, &session(&fixture, version), |session| {
            let program = &mut session["manifest"]["algorithms"][0]["program"];
            program["name"] = "net".into();
            program["version"] = version.into();
        });
    };
    program("1");
    program("2");
    fixture
        .fails("report p1 p2 -o all => 1: p2: is not of the same run as p1: some: net 1 and net 2");
}

#[test]
fn a_merged_report_names_its_machines() {
    let fixture = pairs();
    fixture.run(&format!("{SCORE} -o whole"));
    (1..=3).for_each(|i| scored_part(&fixture, i));
    edit_checked(&fixture, &session(&fixture, "2"), |session| {
        session["manifest"]["machine"]["processor"] = "another".into();
    });
    fixture.run("report p1 p2 p3 -o all -q");
    let hash = |report: &str| {
        let text = fixture.text(&format!("{report}/summary.json"));
        let summary: Value = serde_json::from_str(&text).unwrap();
        summary["algorithms"][0]["results_hash"].clone()
    };
    assert_eq!(hash("all"), hash("whole"));
    let manifest = fixture.json_file("all/manifest.json");
    let sessions = manifest["sessions"].as_array().unwrap();
    let machines = sessions
        .iter()
        .map(|session| session["machine"]["processor"] == "another");
    assert_eq!(machines.filter(|is_another| *is_another).count(), 1);
    assert_says(&fixture.text("all/index.html"), &["another"]);
    // The times of a report are those of its machines: none is compared.
    let compared = fixture.json("compare whole all --json");
    let metrics = compared[0]["algorithms"][0]["metrics"].as_array().unwrap();
    assert!(!metrics.is_empty() && metrics.iter().all(|change| change["metric"] != "time"));
}
