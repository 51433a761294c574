//! The description of a run: printed, repeated, and compared with other runs.

use super::fixture::{Fixture, assert_says};
use serde_json::Value;

/// The hashes of all pairs and of the results of each algorithm.
fn hashes(fixture: &Fixture, report: &str) -> Vec<String> {
    let manifest = fixture.json_file(&format!("{report}/manifest.json"));
    let algorithms = manifest["algorithms"].as_array().unwrap().iter();
    let results = algorithms.map(|algorithm| algorithm["results_hash"].to_string());
    results
        .chain([manifest["pairs_hash"].to_string()])
        .collect()
}

/// The run of a command line and the one of its printed scenario have equal hashes.
#[track_caller]
fn repeats(fixture: &Fixture, command: &str) {
    fixture.run(&format!("score {command} -o first --rerun none"));
    fixture.run(&format!(
        "score {command} --print-scenario=inner/again.toml"
    ));
    fixture.run("score inner/again.toml -o second --rerun none");
    assert_eq!(
        hashes(fixture, "first"),
        hashes(fixture, "second"),
        "{command}"
    );
    let [first, second] = ["first", "second"].map(|report| {
        let manifest = fixture.json_file(&format!("{report}/manifest.json"));
        manifest["description"].clone()
    });
    // Limits of algorithms that are not run are not printed.
    let without = |mut manifest: Value| {
        manifest.as_object_mut().unwrap().remove("gate");
        for path in ["files", "calib", "data"] {
            manifest["source"].as_object_mut().unwrap().remove(path);
        }
        manifest
    };
    assert_eq!(without(first), without(second), "{command}");
    // On the terminal: relative to the working folder.
    let printed = fixture.run(&format!("score {command} --print-scenario"));
    std::fs::write(fixture.path("printed.toml"), printed).unwrap();
    fixture.run("score printed.toml -o third --rerun none");
    assert_eq!(
        hashes(fixture, "first"),
        hashes(fixture, "third"),
        "{command}"
    );
    std::fs::remove_file(fixture.path("inner/again.toml")).unwrap();
}

#[test]
fn a_printed_scenario_repeats_the_run_of_each_kind_of_source() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 4);
    std::fs::create_dir(fixture.path("inner")).unwrap();
    repeats(
        &fixture,
        "short.toml --algo v3 --algo fast=bm:max_disparity=48 --seeds 4,5 --every 2",
    );
    fixture.run("record short.toml -o run.mcap");
    repeats(
        &fixture,
        "run.mcap --algo v3 --from 0.02 --crop 40,20,240,200 --scale 0.5",
    );
    repeats(
        &fixture,
        "run.mcap --algo v3 --reference sgm --stress gain=0.5",
    );
    let error = fixture.svl("score run.mcap --print-scenario=short.toml");
    error.failed(1, &["short.toml", "exists"]);
}

#[test]
fn a_scene_is_repeated_from_its_folder_of_data_sets() {
    let fixture = Fixture::new();
    std::fs::create_dir(fixture.path("inner")).unwrap();
    fixture.write_pair("data/cones/im0.pgm", "data/cones/im1.pgm", (80, 60), 5);
    std::fs::write(
        fixture.path("scenes.toml"),
        "name = \"s\"\n[cells]\njudge = \"disparity\"\ntolerance_px = 2\n[source]\n\
         kind = \"dataset\"\nscenes = [\"cones\"]\n",
    )
    .unwrap();
    repeats(&fixture, "scenes.toml --algo v3 --data data");
}

#[test]
fn runs_of_other_options_are_not_mixed() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 6);
    fixture.run("record short.toml -o run.mcap");
    let seals = || {
        let text = fixture.text("one/manifest.json");
        let manifest: Value = serde_json::from_str(&text).unwrap();
        manifest["sessions"].as_array().unwrap().clone()
    };
    let score = "score run.mcap --algo v3 -q -o one --rerun none";
    fixture.run(score);
    let first = seals();
    for options in ["--every 2", "--reference sgm"] {
        fixture.run(&format!("{score} {options}"));
        assert!(seals().len() == 1 && seals() != first, "{options}");
    }
    // Results of the first pairs and truth are still there, apart from the others.
    assert_says(&fixture.run(score), &["matched  nothing"]);
    assert_eq!(seals(), first);

    // Shards with other options are not parts of one run.
    fixture.run("score run.mcap --algo v3 --shard 1/2 -o part1 --rerun none");
    fixture.run("score run.mcap --algo v3 --shard 2/2 -o part2 --reference sgm --rerun none");
    let merged = fixture.svl("report part1 part2 -o whole");
    merged.failed(1, &["part2", "not of the same run", "source.reference"]);

    fixture.run("score run.mcap --algo v3 --every 2 -o two --rerun none");
    let compared = fixture.run("compare one two");
    assert_says(
        &compared,
        &["3 pairs, 3 with equal results", "in one report alone"],
    );
}

#[test]
fn labels_and_links_are_kept_or_refused() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.run("record short.toml -o run.mcap");
    std::os::unix::fs::symlink("run.mcap", fixture.path("latest.mcap")).unwrap();
    let printed = fixture.run("score latest.mcap --algo v3 --print-scenario");
    assert_says(&printed, &["files = [\"latest.mcap\"]"]);
    // Named sweeps, and limits as numbers and as texts.
    std::fs::create_dir(fixture.path("inner")).unwrap();
    let sweep = "run.mcap --algo L=bm:uniqueness=0..20/10,block_size=5/9 --algo v3 --allow-loss";
    repeats(&fixture, &format!("{sweep} 3"));
    let manifest = fixture.json_file("third/manifest.json");
    assert_eq!(
        manifest["algorithms"][3]["label"],
        "L:uniqueness=10,block_size=9"
    );
    for (limit, written) in [("3", "3"), ("1%", "\"1%\"")] {
        let printed = fixture.run(&format!("score {sweep} {limit} --print-scenario"));
        assert_says(&printed, &[&format!("allow_loss = {written}\n")]);
    }
    // Printed limits are those of algorithms that are run.
    let ran = fixture.svl("score short.toml --algo v3 --print-scenario");
    assert_says(&ran.stderr, &["limits of algorithms that are not run"]);
}

#[test]
fn another_program_behind_the_same_command_is_another_algorithm() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.run("record short.toml -o run.mcap");
    fixture.write("m.sh", "exit 1 # one");
    let line = [
        "score",
        "run.mcap",
        "--algo",
        "v3",
        "--algo",
        "m=exec:command='sh m.sh'",
    ];
    let score =
        |more: &[&str]| fixture.svl(&[&line[..], &["--rerun", "none", "-q"], more].concat());
    let sessions = || {
        std::fs::read_dir(fixture.path("r/units/sessions"))
            .unwrap()
            .count()
    };
    assert_eq!(score(&["-o", "r"]).code, Some(4));
    // What a program failed on is matched again.
    assert_eq!(score(&["-o", "r"]).code, Some(4));
    assert_eq!(sessions(), 2);
    let identity = || {
        let list = fixture.json_file("r/report.json");
        let algorithms = list["content"]["manifest"]["algorithms"]
            .as_array()
            .unwrap();
        let hashes = algorithms.iter().map(|own| own["parameters_hash"].clone());
        hashes.collect::<Vec<_>>()
    };
    let first = identity();
    fixture.write("m.sh", "exit 1 # two");
    assert_eq!(score(&["-o", "r"]).code, Some(4));
    let second = identity();
    assert_eq!(first[0], second[0]);
    assert_ne!(first[1], second[1]);
}

#[test]
fn an_unfinished_report_fails_no_comparison_unnoticed() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.run("record short.toml -o run.mcap");
    fixture.run("score run.mcap --algo v3 --rerun none -o one");
    fixture.run("score run.mcap --algo v3 --rerun none -o two");
    std::fs::remove_file(fixture.path("two/summary.json")).unwrap();
    let compared = fixture.svl("compare one two --fail-on worse");
    compared.failed(3, &["two: is incomplete (it was never finished)"]);
}
