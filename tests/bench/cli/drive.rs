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
    fixture.write_recorded_arena("short.toml", 40);
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
    // The ends of the scale are no answer. Each drive is a recording, on which another algorithm
    // can be replayed.
    fixture.transcript(
        "report r => hits/100 m | truth | blind
        cat r/summary.json => /drives/0/finished = 2 | /drives/0/collisions = 0 \
        | /drives/0/speed_m_per_s > 0.1 | /drives/1/finished = 0 | /drives/1/collisions > 1 \
        | /best absent
        cat r/index.html => course 1 | course 7 | blind × | two seconds before it hit
        replay r/course-1-truth.mcap --algo bm -q --rows rows.csv",
    );
    let lines = |name: &str, words: &str| {
        let text = fixture.text(name);
        let lines = text.lines().filter(|line| line.contains(words));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    // The track contains what the row counts.
    let summary = fixture.json_file("r/summary.json");
    let hits = lines("r/tracks.csv", ",collision,").len();
    assert_eq!(summary["drives"][1]["collisions"], hits);
    let truth = &lines("r/drives.csv", ",1,truth,")[0];
    let frames = format!(",{},0,", lines("rows.csv", "").len() - 1);
    assert_says(truth, &[&frames]);

    // The same again, with another thread order: the same drives.
    let kept = || (fixture.text("r/tracks.csv"), fixture.text("r/courses.json"));
    let before = kept();
    fixture.transcript(
        "score small.toml -q -o r --drives none --force
        test ! -e r/course-1-truth.mcap",
    );
    assert_eq!(kept(), before);
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
    let mut units = std::fs::read_dir(fixture.path("r/units")).unwrap();
    let course = units.find_map(|entry| {
        let path = entry.unwrap().path();
        path.to_str().unwrap().contains("seed-7").then_some(path)
    });
    std::fs::remove_dir_all(course.unwrap()).unwrap();
    fixture.transcript(
        "report r => 4: 1 of 2 courses incomplete, from seed 7 on
        score small.toml -q -o r",
    );
    assert_eq!(fixture.text("r/drives.csv"), whole);
    assert!(!claimed.is_empty());
    assert_eq!(fastest(), claimed);
    assert_eq!(modified("course-1-truth.mcap"), first);
    assert!(modified("course-7-blind.mcap") > last);
}

#[test]
fn drives_are_compared_course_by_course() {
    let fixture = driven();
    let json = fixture.json("compare r#truth r#blind --json");
    let driven = &json[0]["algorithms"][0]["courses"];
    let hits = driven["collisions"][1].as_u64().unwrap();
    assert!(hits > 1 && driven["collisions"][0] == 0, "{driven}");
    assert_eq!(driven["finished"], serde_json::json!([2, 0]));
    // Few courses are said to be few, and collisions come first. Other rules are not compared.
    let few = "too few courses: 2 courses, of which at least 7 have to differ; --seeds";
    let lost = "not finished any more: courses ";
    let other = courses("[drive]\nnear_miss_m = 0.03\n");
    fixture.write("slow.toml", other.replace("[1, 7]", "[1]"));
    let courses = "/0/algorithms/0/courses/changed";
    fixture.transcript(&format!(
        "compare r r => ^no change: the results of 2 courses are equal to the bit\\n
        compare r#truth r#blind --json => {courses}/# = 2 | {courses}/0/finished = [true, false] \
        | /0/conclusion = too-few-courses | /0/verdict has {few}
        compare r#truth r#blind => {few} | collisions 0 → {hits}, courses finished 2 → 0 | {lost} \
        | more collisions on
        compare r#truth r#blind -o drives.html
        cat drives.html => Courses that changed | >yes → no< | exact sign test \
        | --seeds 1..100 drives more | !Frames that changed most
        compare r r --map blind=truth --map truth=blind => truth → blind: collisions 0 → {hits}, \
        | blind → truth: collisions {hits} → 0,
        score slow.toml -q --drives none -o slow
        compare r slow => not comparable: scored differently (drive \
        | not compared: 1 course of truth in one report alone
        compare r#truth r#blind --fail-on worse:collisions --junit drives.xml \
        => 3: collisions: 0.0 per 100 m to | too few courses to tell
        cat drives.xml => name=\"truth → blind: courses\"><system-out>2 courses, 0 with equal \
        results"
    ));
    let markdown = fixture.run("compare r#truth r#blind --markdown");
    assert_says(&markdown, &[lost, "`-o FILE.html` shows courses"]);
    assert!(markdown.lines().count() <= 10, "{markdown}");
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
    fixture.transcript(
        "score timed.toml -q --drives none -o r
        cat r/index.html => latency, ms",
    );
    let drives: Vec<DriveRow> = read_rows(&fixture.path("r/drives.csv")).unwrap();
    let own = |label: &'static str| drives.iter().filter(move |row| row.algorithm == label);
    let hits = |label| own(label).map(|row| row.collisions).sum::<u64>();
    let skipped = |label| own(label).map(|row| row.skipped).sum::<u64>();
    let hashes = |label| own(label).map(|row| &row.track_hash).collect::<Vec<_>>();
    let same = hashes("truth");
    assert_eq!(
        hashes("period"),
        same,
        "one period is what a drive has without"
    );
    assert!(hits("slow") > hits("fast"), "{drives:?}");
    assert_eq!(["truth", "fast", "period"].map(skipped), [0, 0, 0]);
    // Every second pair; the tracks and the rows agree.
    for row in own("slow") {
        assert_eq!(row.skipped, row.frames / 2);
    }
    let tracks: Vec<TrackRow> = read_rows(&fixture.path("r/tracks.csv")).unwrap();
    let unmatched = tracks.iter().filter(|row| row.skipped).count() as u64;
    assert_eq!(unmatched, skipped("slow"));
    let rows = fixture.text("r/rows.csv");
    let matched = rows.lines().filter(|line| line.contains(",slow,")).count() as u64;
    let frames: u64 = own("slow").map(|row| row.frames).sum();
    assert_eq!(matched + skipped("slow"), frames);
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
    fixture.write("broken.toml", courses(&limits(1)));
    let own = "-q --drives none --seeds 1";
    fixture.transcript(&format!(
        "score kept.toml --gate {own} => pass          truth: courses finished 100.0000 % over \
        1 course, at least 99.99 % |  m driven, at most 500.0 per 100 m
        score broken.toml --gate {own} => 3: blind: collisions | at most 1.0"
    ));
    let json = fixture.json(&format!("score kept.toml {own} --sort collisions --json"));
    let own = |i: usize| &json["algorithms"][i];
    assert!(own(0)["collisions"].as_f64() <= own(1)["collisions"].as_f64());
    assert_eq!(own(0)["finished"], 1.0);
    assert_eq!(own(0)["cases"]["finished"]["items"], 1);
}

#[test]
fn stresses_perturb_the_pairs_of_drives() {
    let fixture = Fixture::new();
    fixture.write("small.toml", courses(""));
    // Two algorithms at two levels, the first of which is 0; `truth` ignores the images. There are
    // no cells of two paths.
    fixture.transcript(
        "score small.toml --seeds 1 --algo seen=v5:max_disparity=24 --algo truth -q \
         --stress row_offset=6 -o r => Stress: row_offset, px | collisions, 1/100 m \
         | too few courses to tell | !wrong
        test -e r/course-1-seen-row_offset=6.mcap
        cat r/summary.json => /drives/# = 2 | /stress/# = 4 | /stress/*/collisions > -1 \
        | /stress/*/finished > -1 | /stress/*/right absent | /stress/*/late > -1
        cat r/index.html => near misses, 1/100 m",
    );
    let summary = fixture.json_file("r/summary.json");
    let stress = summary["stress"].as_array().unwrap();
    let drives: Vec<DriveRow> = read_rows(&fixture.path("r/drives.csv")).unwrap();
    let own = |algorithm: &str, stress: &str| {
        let is_own = |row: &&DriveRow| {
            row.algorithm == algorithm && row.stress.as_deref().unwrap_or("") == stress
        };
        drives.iter().find(is_own).unwrap()
    };
    let track = |algorithm: &str, stress: &str| &own(algorithm, stress).track_hash;
    assert_eq!(track("truth", ""), track("truth", "row_offset=6"));
    assert_ne!(track("seen", ""), track("seen", "row_offset=6"));
    // Each level has the numbers of its own drives.
    let finished = |level: f64| {
        let mut own = stress.iter().filter(|s| s["algorithm"] == "seen");
        own.find(|s| s["level"] == level).unwrap()["finished"].clone()
    };
    for (level, stress) in [(0.0, ""), (6.0, "row_offset=6")] {
        assert_eq!(
            finished(level) == 1.0,
            own("seen", stress).finished,
            "{stress}"
        );
    }
    assert_ne!(
        own("seen", "").finished,
        own("seen", "row_offset=6").finished
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
    fixture.transcript(
        "score small.toml --algo v3:max_disparity=4 --algo blind --seeds 1 --gate -q --drives none \
        -o r => NOT MEASURED  blind: collisions is not measured in this run: it rests on 0 m \
        driven, and needs 1 m driven => 3~
        cat r/manifest.json => /warnings/# = 1 | /warnings/0 = v3:max_disparity=4: max_disparity \
        sees nothing nearer than 0.90 m; obstacles at 0.5 m need about 8 px
        cat r/summary.json => /algorithms/1/late = 1.0 | /algorithms/1/collisions absent \
        | /drives/1/collisions_per_100m = null
        cat r/index.html => <th scope=\"col\">late</th>",
    );
}
