//! `svl report -o`: parts that do not belong together, and the contents that are not joined.
#![cfg(unix)]

use super::fixture::Fixture;
use super::results::{edit_checked, unit_files};

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
    // A quarter of the pairs fails: the limit is that of the whole.
    for part in [1, 2] {
        fixture.run(&format!(
            "score pairs --stress noise=8 -q --rerun none --shard {part}/2 --allow-loss 30% \
             -o p{part} --algo 'some=exec:command=sh refuses.sh'"
        ));
    }
    let unknown = "some: its program reports no version and no model";
    for (limit, code, state) in [("", 0, "complete"), ("--allow-loss 10%", 4, "lossy")] {
        fixture.transcript(&format!(
            "report p1 p2 -o all -q {limit} => {code}~
            cat all/manifest.json => 1x {unknown}
            cat all/summary.json => /state = {state}"
        ));
    }
    for version in ["1", "2"] {
        edit_checked(&fixture, &session(&fixture, version), |session| {
            let program = &mut session["manifest"]["algorithms"][0]["program"];
            program["name"] = "net".into();
            program["version"] = version.into();
        });
    }
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
    fixture.transcript(
        "report p1 p2 p3 -o all -q
        cat all/index.html => another",
    );
    let [all, whole] = ["all", "whole"].map(|report| {
        let summary = fixture.json_file(&format!("{report}/summary.json"));
        summary["algorithms"][0]["results_hash"].clone()
    });
    assert_eq!(all, whole);
    let manifest = fixture.json_file("all/manifest.json");
    let sessions = manifest["sessions"].as_array().unwrap().iter();
    let others = sessions.filter(|session| session["machine"]["processor"] == "another");
    assert_eq!(others.count(), 1);
    // The times of a report are those of its machines: none is compared.
    fixture.transcript(
        "compare whole all --json => /0/algorithms/0/metrics/# > 0 \
        | /0/algorithms/0/metrics/*/metric != time",
    );
}
