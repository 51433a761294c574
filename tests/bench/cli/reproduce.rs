//! `svl reproduce`.

use super::fixture::{Fixture, assert_says, datasets};

/// The arena is the same on every machine, so verdicts and numbers are, too.
#[test]
fn figures_have_verdicts_and_a_report() {
    let fixture = Fixture::new();
    insta::assert_snapshot!(fixture.run("reproduce 5.11 5.1 -q"));
    let read =
        |name: &str| std::fs::read_to_string(fixture.path("reports/reproduce").join(name)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read("reproduce.json")).unwrap();
    let experiments = json["experiments"].as_array().unwrap();
    assert_eq!(
        experiments
            .iter()
            .map(|e| e["figure"].as_str().unwrap())
            .collect::<Vec<_>>(),
        ["5.1", "5.11"]
    );
    assert_eq!(experiments[0]["quantities"][0]["thesis"], "81");
    let html = read("index.html");
    assert!(html.contains("<svg class=\"plot\"") && html.contains("data:image/png;base64,"));
    let fetches = ["href=\"http", "src=", "url(", "@import", "<script", "<link"];
    assert!(
        !fetches.iter().any(|fetch| html.contains(fetch)),
        "one file that fetches nothing"
    );
    assert!(read("reproduce.md").contains("## Figure 5.11: "));

    // A second time, replacing the first.
    let printed = fixture.json("reproduce 5.1 -q --json");
    assert_eq!(printed["experiments"].as_array().unwrap().len(), 1);
    assert!(!read("reproduce.md").contains("## Figure 5.11: "));
}

#[test]
fn a_slip_is_guessed_and_a_folder_with_anything_else_left_alone() {
    let fixture = Fixture::new();
    fixture.svl("reproduce 5.10").failed(
        2,
        &[
            "unknown figure '5.10'",
            "did you mean '5.1'",
            "table5.1",
            "fps",
        ],
    );
    fixture.write("mine/thesis.tex", "years of work");
    let wrong = "
        reproduce 5.1 -o mine => 1: mine/thesis.tex | -o
        reproduce 5.1 --data mine => 1: mine: contains none of the scenes | tsukuba
    ";
    fixture.fails(wrong);
}

#[test]
fn the_arena_s_run_is_recorded_once() {
    let fixture = Fixture::new();
    for _ in 0..2 {
        let text = fixture.run("reproduce 7.3 -q");
        assert_says(&text, &["7.3       holds in part"]);
    }
    assert_eq!(
        std::fs::read_dir(fixture.path("recordings"))
            .unwrap()
            .count(),
        1
    );
}

#[test]
fn real_scenes_join_in() {
    let Some(datasets) = datasets() else { return };
    let fixture = Fixture::new();
    let text = fixture.run(&[
        "reproduce",
        "5.9",
        "-q",
        "--data",
        &datasets.display().to_string(),
    ]);
    assert_says(&text, &["in the real scenes the self check drops"]);
}
