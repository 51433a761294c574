//! `svl merge`: parts that do not belong together, and the contents that are not joined.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
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

/// Changes a part's JSON file.
fn edit(fixture: &Fixture, file: &str, change: impl Fn(&mut Value)) {
    let mut value: Value = serde_json::from_str(&fixture.text(file)).unwrap();
    change(&mut value);
    fixture.write(file, value.to_string());
}

#[test]
fn parts_of_changed_pictures_are_refused() {
    let fixture = pairs();
    scored_part(&fixture, 1);
    scored_part(&fixture, 2);
    // The pictures have the same names and sizes, and the parts other levels of noise.
    write_pair(&fixture, 2, 4);
    scored_part(&fixture, 3);
    fixture.fails("merge p1 p2 p3 -o all => 1: p3: is not of the same run as p1 | of pairs differ");
    scored_part(&fixture, 1);
    scored_part(&fixture, 2);
    fixture.run("merge p3 p2 p1 -o all -q");
}

#[test]
fn broken_files_of_a_part_are_named_with_the_cure() {
    let fixture = pairs();
    (1..=3).for_each(|i| scored_part(&fixture, i));
    for file in ["manifest.json", "part.json", "summary.json"] {
        let whole = fixture.text(&format!("p2/{file}"));
        for (text, what) in [
            (&whole[..whole.len() / 2], "is cut off"),
            ("\0\0\0\0", "is damaged"),
            ("{}", "has other entries than this svl writes"),
        ] {
            fixture.write(&format!("p2/{file}"), text);
            fixture.fails(&format!(
                "merge p1 p2 p3 -o all => 1: p2/{file}: {what} | score it again"
            ));
        }
        fixture.write(&format!("p2/{file}"), whole);
    }
    fixture.write("p2/manifest.json", "{");
    fixture.fails("compare p1 p2 => 1: p2/manifest.json: is cut off | score it again");
}

#[test]
fn parts_of_another_program_are_refused_and_their_strictest_limit_holds() {
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
    // A quarter of the pairs fails in each part.
    for (limits, code) in [
        (["50%", "10%"], 4),
        (["10%", "50%"], 4),
        (["50%", "30%"], 0),
    ] {
        for (part, limit) in ["1", "2"].iter().zip(limits) {
            assert_eq!(score(part, limit), Some(if limit == "10%" { 4 } else { 0 }));
        }
        let ran = fixture.svl("merge p1 p2 -o all -q");
        assert_eq!(ran.code, Some(code), "{limits:?}: {}", ran.stderr);
        let unknown = "some: its program reports no version and no model";
        let manifest = fixture.text("all/manifest.json");
        assert_eq!(manifest.matches(unknown).count(), 1, "{manifest}");
        let summary: Value = serde_json::from_str(&fixture.text("all/summary.json")).unwrap();
        let state = if code == 4 { "lossy" } else { "complete" };
        assert_eq!(summary["state"], state, "{limits:?}");
    }
    let program = |version: &str| {
        edit(&fixture, &format!("p{version}/manifest.json"), |manifest| {
            let program = &mut manifest["algorithms"][0]["program"];
            program["name"] = "net".into();
            program["version"] = version.into();
        });
    };
    program("1");
    program("2");
    fixture
        .fails("merge p1 p2 -o all => 1: p2: is not of the same run as p1: some: net 1 and net 2");
}

#[test]
fn times_of_several_machines_are_not_joined() {
    let fixture = pairs();
    fixture.run(&format!("{SCORE} -o whole"));
    (1..=3).for_each(|i| scored_part(&fixture, i));
    let merged = |code: &str| {
        let ran = fixture.svl("merge p1 p2 p3 -o all --json");
        assert_eq!(ran.code, Some(0), "{code}: {}", ran.stderr);
        let summary: Value = serde_json::from_str(&ran.stdout).unwrap();
        (summary, ran.stderr)
    };
    let times = [
        "p50_ms",
        "p99_ms",
        "time_per_mp_s",
        "mde_per_s",
        "matching_ms",
        "outliers",
    ];
    let (summary, _) = merged("one machine");
    let has_time = |summary: &Value| times.map(|key| summary["algorithms"][0][key].is_number());
    assert_eq!(has_time(&summary), [true; 6]);
    let hashes = |summary: &Value| summary["algorithms"][0]["results_hash"].clone();
    let before = hashes(&summary);
    edit(&fixture, "p2/manifest.json", |manifest| {
        manifest["machine"]["processor"] = "another".into();
    });
    let (summary, stderr) = merged("two machines");
    assert_eq!(has_time(&summary), [false; 6]);
    assert_eq!(hashes(&summary), before);
    assert_says(&stderr, &["2 machines", "times are not joined"]);
    for file in ["manifest.json", "summary.md", "index.html"] {
        assert_says(
            &fixture.text(&format!("all/{file}")),
            &["times are not joined"],
        );
    }
    // Nor do they belong to the first part's machine.
    let history = fixture.json("compare --history whole all --json");
    let lines = history["scenarios"][0]["lines"].as_array().unwrap();
    let time = lines.iter().find(|line| line["metric"] == "time").unwrap();
    assert!(
        time["values"][0].is_number() && time["values"][1].is_null(),
        "{time}"
    );
    let compared = fixture.json("compare whole all --json");
    let metrics = compared[0]["algorithms"][0]["metrics"].as_array().unwrap();
    assert!(!metrics.is_empty() && metrics.iter().all(|of| of["metric"] != "time"));
}
