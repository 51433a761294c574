//! `svl score` of drives.

use super::fixture::{Fixture, assert_says};
use crate::common::python;
use svl::report::{DriveRow, TrackRow, read_rows};

/// Two courses with small images.
pub(super) fn courses(more: &str) -> String {
    format!(
        "name = \"small\"\nalgorithms = [\"truth\", \"blind\"]\n{more}\n[source]\nkind = \
         \"drive\"\nseeds = [1, 7]\n[arena]\nframes = 280\nrate_hz = 4.0\n[arena.rig]\nwidth_px = \
         80\nheight_px = 60\n"
    )
}

/// The courses, and the report of their drives in `r`, which are driven once for all tests.
pub(super) fn driven() -> Fixture {
    let fixture = Fixture::new();
    fixture.write("small.toml", courses(""));
    fixture.write_made("r", "small courses", |fixture| {
        fixture.write("small.toml", courses(""));
        fixture.run("score small.toml -q -o r");
    });
    fixture
}

#[test]
fn every_table_is_read_alike_by_other_libraries() {
    let fixture = driven();
    fixture.write_short_arena("short.toml", 40);
    fixture.run("score short.toml --algo v3 --algo v5 --algo sgm --rerun none -q -o arena");
    for (report, least) in [("r", 8), ("arena", 10)] {
        let modules = "pandas, polars, duckdb, pyarrow";
        let Some(printed) = python("tables.py", modules, [fixture.path(report)]) else {
            return;
        };
        let printed = String::from_utf8(printed).unwrap();
        let tables: u32 = printed.split(' ').next().unwrap().parse().unwrap();
        assert!(tables >= least, "{printed}");
    }
}

#[test]
fn drives_are_driven_counted_drawn_and_kept() {
    let fixture = driven();
    let text = fixture.run("report r");
    assert_says(&text, &["hits/100 m", "truth", "blind"]);
    let summary = fixture.json_file("r/summary.json");
    let [truth, blind] = [0, 1].map(|i| summary["drives"][i].clone());
    assert_eq!(
        (&truth["finished"], &truth["collisions"]),
        (&2.into(), &0.into())
    );
    assert_eq!(blind["finished"], 0);
    // The ends of the scale are no answer.
    assert!(summary.get("best").is_none(), "{summary}");
    assert!(blind["collisions"].as_u64().unwrap() > 1, "{blind}");
    assert!(truth["speed_m_per_s"].as_f64().unwrap() > 0.1, "{truth}");
    let page = fixture.text("r/index.html");
    assert_says(
        &page,
        &[
            "course 1",
            "course 7",
            "blind ×",
            "two seconds before it hit",
        ],
    );
    // The track contains what the row counts.
    let tracks = fixture.text("r/tracks.csv");
    let hits = tracks
        .lines()
        .filter(|line| line.contains(",collision,"))
        .count();
    assert_eq!(hits as u64, blind["collisions"].as_u64().unwrap());

    // Each drive is a recording, on which another algorithm can be replayed.
    fixture.run("replay r/course-1-truth.mcap --algo bm -q --rows rows.csv");
    let frames = |name: &str| fixture.text(name).lines().count() - 1;
    let drives = fixture.text("r/drives.csv");
    let truth = drives
        .lines()
        .find(|line| line.contains(",1,truth,"))
        .unwrap();
    assert!(
        truth.contains(&format!(",{},0,", frames("rows.csv"))),
        "{truth}"
    );

    // The same again, with another thread order: the same drives.
    let kept = |table: &str| {
        let text = fixture.text(table);
        text.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let before = (kept("r/tracks.csv"), fixture.text("r/courses.json"));
    fixture.run("score small.toml -q -o r --drives none --force");
    assert_eq!(
        (kept("r/tracks.csv"), fixture.text("r/courses.json")),
        before
    );
    assert!(!fixture.path("r/course-1-truth.mcap").exists());
}

#[test]
fn the_same_command_drives_only_what_is_missing() {
    let fixture = driven();
    let whole = fixture.text("r/drives.csv");
    let fastest = || {
        let page = fixture.text("r/index.html");
        let claims = page.split("The two seconds before it hit").skip(1);
        let claims = claims.map(|rest| rest.split('<').next().unwrap_or_default().to_owned());
        claims.collect::<Vec<_>>()
    };
    let claimed = fastest();
    let modified = |name: &str| {
        let metadata = fixture.path(&format!("r/{name}")).metadata();
        metadata.unwrap().modified().unwrap()
    };
    let [first, last] = ["course-1-truth.mcap", "course-7-blind.mcap"].map(modified);
    // The seals of one course, as if its drives had been killed.
    let units = std::fs::read_dir(fixture.path("r/units"))
        .unwrap()
        .flatten();
    let course = units
        .map(|entry| entry.path())
        .find(|path| path.to_str().unwrap().contains("seed-7"));
    std::fs::remove_dir_all(course.unwrap()).unwrap();
    let ran = fixture.svl("report r");
    ran.failed(4, &["1 of 2 courses incomplete, from seed 7 on"]);
    fixture.run("score small.toml -q -o r");
    assert_eq!(fixture.text("r/drives.csv"), whole);
    assert!(!claimed.is_empty());
    assert_eq!(fastest(), claimed);
    assert_eq!(modified("course-1-truth.mcap"), first);
    assert!(modified("course-7-blind.mcap") > last);
}

#[test]
fn drives_are_compared_course_by_course() {
    let fixture = driven();
    let text = fixture.run("compare r r");
    assert!(
        text.starts_with("no change: the results of 2 courses are equal to the bit\n"),
        "{text}"
    );
    let [truth, blind] = ["r#truth", "r#blind"];
    let compare = |more: &str| fixture.run(&format!("compare {truth} {blind} {more}"));
    let plain = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let json = fixture.json(&format!("compare {truth} {blind} --json"));
    let own = &json[0]["algorithms"][0];
    let driven = &own["courses"];
    let hits = driven["collisions"][1].as_u64().unwrap();
    assert!(hits > 1 && driven["collisions"][0] == 0, "{driven}");
    assert_eq!(driven["finished"], serde_json::json!([2, 0]));
    let changed = driven["changed"].as_array().unwrap();
    assert_eq!(changed.len(), 2);
    assert_eq!(changed[0]["finished"], serde_json::json!([true, false]));
    assert_eq!(json[0]["conclusion"], "too-few-courses");
    // Few courses are said to be few, and collisions come first.
    let few = "too few courses: 2 courses, of which at least 7 have to differ; --seeds";
    let sums = format!("collisions 0 → {hits}, courses finished 2 → 0");
    let lost = "not finished any more: courses ";
    assert_says(json[0]["verdict"].as_str().unwrap(), &[few]);
    assert_says(
        &plain(compare("")),
        &[few, &sums, lost, "more collisions on"],
    );
    let markdown = compare("--markdown");
    assert_says(&markdown, &[lost, "`-o FILE.html` shows courses"]);
    assert!(markdown.lines().count() <= 10, "{markdown}");
    compare("-o drives.html");
    let page = fixture.text("drives.html");
    let words = [
        "Courses that changed",
        ">yes → no<",
        "exact sign test",
        "--seeds 1..100 drives more",
    ];
    assert_says(&page, &words);
    assert!(!page.contains("Frames that changed most"));
    let both = fixture.run("compare r r --map blind=truth --map truth=blind");
    let words = [
        format!("truth → blind: collisions 0 → {hits}, "),
        format!("blind → truth: collisions {hits} → 0, "),
    ];
    assert_says(&plain(both), &words.each_ref().map(String::as_str));
    // Other rules are not compared.
    let other = courses("[drive]\nnear_miss_m = 0.03\n");
    fixture.write("slow.toml", other.replace("[1, 7]", "[1]"));
    fixture.run("score slow.toml -q --drives none -o slow");
    let text = plain(fixture.run("compare r slow"));
    let words = [
        "not comparable: scored differently (drive",
        "not compared: 1 course of truth in one report alone",
    ];
    assert_says(&text, &words);
    let failing = "compare r#truth r#blind --fail-on worse:collisions --junit drives.xml";
    fixture.svl(failing).failed(
        3,
        &["collisions: 0.0 per 100 m to", "too few courses to tell"],
    );
    let words = ["name=\"truth → blind: courses\"><system-out>2 courses, 0 with equal results"];
    assert_says(&fixture.text("drives.xml"), &words);
}

#[test]
fn time_counts_in_drives() {
    let fixture = Fixture::new();
    let algorithms = "[\"truth\", \"period=truth\", \"fast=truth\", \
                      \"slow=truth\"]";
    let scenario = courses("")
        .replace("[\"truth\", \"blind\"]", algorithms)
        .replace("[1, 7]", "[4, 6]")
        .replace("frames = 280\nrate_hz = 4.0", "frames = 400\nrate_hz = 8.0");
    let latencies = "[drive.latency_ms]\nfast = 5\nperiod = 125\nslow = 250\n";
    fixture.write("timed.toml", format!("{scenario}{latencies}"));
    fixture.run("score timed.toml -q --drives none -o r");
    let drives: Vec<DriveRow> = read_rows(&fixture.path("r/drives.csv")).unwrap();
    let own = |label: &'static str| drives.iter().filter(move |row| row.algorithm == label);
    let hits = |label| own(label).map(|row| row.collisions).sum::<u64>();
    let skipped = |label| own(label).map(|row| row.skipped).sum::<u64>();
    let hashes = |label| own(label).map(|row| &row.track_hash).collect::<Vec<_>>();
    assert_eq!(
        hashes("period"),
        hashes("truth"),
        "one period is what a drive has without"
    );
    assert!(hits("slow") > hits("fast"), "{drives:?}");
    assert_eq!(
        (skipped("truth"), skipped("fast"), skipped("period")),
        (0, 0, 0)
    );
    // Every second pair; the tracks and the rows agree.
    for row in own("slow") {
        assert_eq!(row.skipped, row.frames / 2);
    }
    let tracks: Vec<TrackRow> = read_rows(&fixture.path("r/tracks.csv")).unwrap();
    assert_eq!(
        tracks.iter().filter(|row| row.skipped).count() as u64,
        skipped("slow")
    );
    let rows = fixture.text("r/rows.csv");
    let matched = rows.lines().filter(|line| line.contains(",slow,")).count() as u64;
    let frames: u64 = own("slow").map(|row| row.frames).sum();
    assert_eq!(matched + skipped("slow"), frames);
    assert!(fixture.text("r/index.html").contains("latency, ms"));
}

#[test]
fn collisions_have_limits() {
    let fixture = Fixture::new();
    let limits = |collisions: u32| {
        format!(
            "gate = [\n{{ algorithm = \"truth\", metric = \"finished\", min = 0.9999 \
             }},\n{{ algorithm \
             = \"blind\", metric = \"collisions\", max = {collisions} }}]\n"
        )
    };
    fixture.write("kept.toml", courses(&limits(500)));
    let text = fixture.run("score kept.toml --gate -q --drives none --seeds 1");
    assert_says(
        &text,
        &[
            "pass          truth: courses finished 100.0000 % over 1 course, at least 99.99 %",
            " m driven, at most 500.0 per 100 m",
        ],
    );
    fixture.write("broken.toml", courses(&limits(1)));
    fixture.fails(
        "
        score broken.toml --gate -q --drives none --seeds 1 => 3: blind: collisions | at most 1.0
        ",
    );
    let text = fixture.run("score kept.toml -q --drives none --seeds 1 --sort collisions --json");
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let algorithms = json["algorithms"].as_array().unwrap();
    let own = |i: usize, key: &str| algorithms[i][key].as_f64();
    assert!(own(0, "collisions") <= own(1, "collisions"));
    assert_eq!(
        (
            own(0, "finished"),
            &algorithms[0]["cases"]["finished"]["items"]
        ),
        (Some(1.0), &1.into())
    );
}

#[test]
fn stresses_perturb_the_pairs_of_drives() {
    let fixture = Fixture::new();
    fixture.write("small.toml", courses(""));
    let text = fixture.run(
        "score small.toml --seeds 1 --algo seen=v5:max_disparity=24 --algo truth -q \
         --stress row_offset=6 -o r",
    );
    let words = [
        "Stress: row_offset, px",
        "collisions, 1/100 m",
        "too few courses to tell",
    ];
    assert_says(&text, &words);
    assert!(!text.contains("wrong"), "cells of two paths: {text}");
    assert!(fixture.path("r/course-1-seen-row_offset=6.mcap").exists());
    let summary = fixture.json_file("r/summary.json");
    // Two algorithms at two levels, the first of which is 0; `truth` ignores the images.
    let stress = summary["stress"].as_array().unwrap();
    assert_eq!(
        (summary["drives"].as_array().unwrap().len(), stress.len()),
        (2, 4)
    );
    assert!(
        stress
            .iter()
            .all(|s| s["collisions"].is_number() && s["finished"].is_number()),
        "{stress:?}"
    );
    let drives = fixture.text("r/drives.csv");
    let rows: Vec<Vec<&str>> = drives.lines().map(|l| l.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|head| *head == name).unwrap();
    let track = |algorithm: &str, stress: &str| {
        let is_own = |row: &&Vec<&str>| {
            row[column("algorithm")] == algorithm && row[column("stress")] == stress
        };
        rows.iter().find(is_own).unwrap()[column("track_hash")].to_owned()
    };
    assert_eq!(track("truth", ""), track("truth", "row_offset=6"));
    assert_ne!(track("seen", ""), track("seen", "row_offset=6"));
    // Each level has the numbers of its own drives.
    let finished = |level: f64| {
        let mut own = stress.iter().filter(|s| s["algorithm"] == "seen");
        own.find(|s| s["level"] == level).unwrap()["finished"].clone()
    };
    let row = |stress: &str| {
        let mut own = rows.iter().filter(|row| row[column("algorithm")] == "seen");
        own.find(|row| row[column("stress")] == stress).unwrap()[column("finished")] == "true"
    };
    for (level, stress) in [(0.0, ""), (6.0, "row_offset=6")] {
        assert_eq!(finished(level) == 1.0, row(stress), "{stress}");
    }
    assert_ne!(row(""), row("row_offset=6"));
    assert!(
        stress
            .iter()
            .all(|s| s.get("right").is_none() && s["late"].is_number())
    );
    assert!(
        fixture
            .text("r/index.html")
            .contains("near misses, 1/100 m")
    );
}

#[test]
fn a_course_that_cannot_be_passed_is_refused() {
    let fixture = Fixture::new();
    let steering = "steering = { lookahead_m = 0.1, stop_m = 0.1, resume_m = 0.1 }";
    fixture.write("near.toml", format!("{}[drive]\n{steering}\n", courses("")));
    let cause = "with drive.steering.lookahead_m = 0.8 in place of 0.1 one can";
    fixture.fails(&format!(
        "score near.toml => 1: course 1: none of 30 layouts can be passed | {cause}"
    ));
}

#[test]
fn drives_that_go_nowhere_or_run_out_of_pairs_are_said_to() {
    let fixture = Fixture::new();
    // All is unknown to blind, so it stands.
    let more = "gate = [{ algorithm = \"blind\", metric = \"collisions\", max = 1 }]\n\
                [drive.steering]\nunknown = \"obstacle\"\n";
    fixture.write("small.toml", courses(more));
    let line = "score small.toml --algo v3:max_disparity=4 --algo blind --seeds 1 --gate -q \
                --drives none -o r";
    let ran = fixture.svl(line);
    assert_eq!(ran.code, Some(3), "{}{}", ran.stdout, ran.stderr);
    let words = "NOT MEASURED  blind: collisions is not measured in this run: it rests on 0 m \
                 driven, and needs 1 m driven";
    assert_says(&ran.stdout, &[words]);
    let manifest = fixture.json_file("r/manifest.json");
    let warnings = manifest["warnings"].as_array().unwrap();
    let range = "v3:max_disparity=4: max_disparity sees nothing nearer than 0.90 m; obstacles at \
                 0.5 m need about 8 px";
    assert_eq!(*warnings, [range]);
    let summary = fixture.json_file("r/summary.json");
    let blind = &summary["algorithms"][1];
    assert_eq!(
        (&blind["late"], blind.get("collisions")),
        (&1.0.into(), None)
    );
    assert!(summary["drives"][1]["collisions_per_100m"].is_null());
    assert!(
        fixture
            .text("r/index.html")
            .contains("<th scope=\"col\">late</th>")
    );
}
