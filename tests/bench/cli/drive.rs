//! `svl score` of drives.

use super::fixture::{Fixture, assert_says};

/// Two courses with small images.
pub(super) fn courses(more: &str) -> String {
    format!(
        "name = \"small\"\nalgorithms = [\"truth\", \"blind\"]\n{more}\n[source]\nkind = \
         \"drive\"\nseeds = [1, 7]\n[arena]\nframes = 280\nrate_hz = 4.0\n[arena.rig]\nwidth_px = \
         80\nheight_px = 60\n"
    )
}

#[test]
fn drives_are_driven_counted_drawn_and_kept() {
    let fixture = Fixture::new();
    fixture.write("small.toml", courses(""));
    let text = fixture.run("score small.toml -q -o r");
    assert_says(&text, &["hits/100 m", "truth", "blind"]);
    let summary: serde_json::Value =
        serde_json::from_slice(&fixture.bytes("r/summary.json")).unwrap();
    let [truth, blind] = [0, 1].map(|i| summary["drives"][i].clone());
    assert_eq!(
        (&truth["finished"], &truth["collisions"]),
        (&2.into(), &0.into())
    );
    assert_eq!(blind["finished"], 0);
    // The ends of the scale are no answer.
    assert!(summary.get("leads").is_none(), "{summary}");
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
        text.lines()
            .map(|line| line[12..].to_owned())
            .collect::<Vec<_>>()
    };
    let before = (kept("r/tracks.csv"), fixture.text("r/courses.json"));
    fixture.run("score small.toml -q -o r --drives none");
    assert_eq!(
        (kept("r/tracks.csv"), fixture.text("r/courses.json")),
        before
    );
    assert!(!fixture.path("r/course-1-truth.mcap").exists());
}

#[test]
fn a_resumed_run_drives_only_what_is_missing() {
    let fixture = Fixture::new();
    fixture.write("small.toml", courses(""));
    fixture.run("score small.toml -q -o r");
    let whole = fixture.text("r/drives.csv");
    // The state that a kill within the last drive leaves.
    let lines: Vec<_> = whole.lines().collect();
    fixture.write(
        "r/drives.csv",
        lines[..4].join("\n") + "\n" + &lines[4][..30],
    );
    std::fs::remove_file(fixture.path("r/summary.json")).unwrap();
    let courses = fixture.text("r/courses.json");
    let fastest = || {
        let page = fixture.text("r/index.html");
        let claims = page.match_indices("Its fastest collision");
        let claims = claims.map(|(at, words)| page[at..at + words.len() + 14].to_owned());
        claims.collect::<Vec<_>>()
    };
    let claimed = fastest();
    std::fs::remove_file(fixture.path("r/courses.json")).unwrap();
    let [first, last] = ["r/course-1-truth.mcap", "r/course-7-blind.mcap"]
        .map(|name| fixture.path(name).metadata().unwrap().modified().unwrap());
    fixture.run("score small.toml -q -o r --resume");
    assert_eq!(fixture.text("r/drives.csv"), whole);
    assert_eq!(fixture.text("r/courses.json"), courses);
    assert!(!claimed.is_empty() && fastest().iter().all(|claim| claimed.contains(claim)));
    let modified = |name: &str| fixture.path(name).metadata().unwrap().modified().unwrap();
    assert_eq!(modified("r/course-1-truth.mcap"), first);
    assert!(modified("r/course-7-blind.mcap") > last);
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
            "pass          truth: courses finished 100.0000 %, at least 99.99 %",
            "per 100 m, at most 500.0 per 100 m",
        ],
    );
    // Two reports of drives have no pairs in common; over time they have numbers.
    fixture.fails("compare reports/small reports/small => 1: is of drives | --history");
    fixture.run("compare --history reports/small reports/small --page history.html -q");
    assert!(
        fixture
            .text("history.html")
            .contains("collisions per 100 m")
    );
    fixture.write("broken.toml", courses(&limits(1)));
    fixture.fails(
        "
        score broken.toml --gate -q --drives none --seeds 1 => 3: blind: collisions | at most 1.0
        score broken.toml --sort collisions => 2: there is no metric 'collisions'
        ",
    );
}

#[test]
fn what_the_driver_sees_is_made_worse() {
    let fixture = Fixture::new();
    fixture.write("small.toml", courses(""));
    let line = "score small.toml --seeds 1 --algo seen=v5:max_disparity=24 --algo truth -q \
                --stress row_offset=6";
    let text = fixture.run(&format!("{line} -o r"));
    assert_says(&text, &["Stress: row_offset, px: collisions per 100 m"]);
    assert!(fixture.path("r/course-1-seen-row_offset=6.mcap").exists());
    let summary: serde_json::Value =
        serde_json::from_slice(&fixture.bytes("r/summary.json")).unwrap();
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
    assert!(fixture.text("r/index.html").contains("Courses finished"));

    // In shards and resumed it is the same.
    for i in 1..=2 {
        fixture.run(&format!("{line} --drives none --shard {i}/2 -o p{i}"));
    }
    fixture.run("merge p1 p2 -o all -q");
    let hashes = |report: &str| {
        let text = fixture.text(&format!("{report}/drives.csv"));
        let lines = text.lines().skip(1);
        lines
            .map(|line| {
                line.split(',')
                    .nth(column("track_hash"))
                    .unwrap()
                    .to_owned()
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(hashes("all"), hashes("r"));
    let cut: Vec<_> = drives.lines().take(3).collect();
    fixture.write("r/drives.csv", cut.join("\n") + "\n");
    std::fs::remove_file(fixture.path("r/summary.json")).unwrap();
    fixture.run(&format!("{line} -o r --resume"));
    assert_eq!(hashes("r"), hashes("all"));
}

#[test]
fn a_course_that_cannot_be_passed_is_refused() {
    let fixture = Fixture::new();
    let steering = "steering = { lookahead_m = 0.1, stop_m = 0.1, resume_m = 0.1 }";
    fixture.write("near.toml", format!("{}[drive]\n{steering}\n", courses("")));
    fixture.fails("score near.toml => 1: course 1: none of 30 layouts can be passed");
}
