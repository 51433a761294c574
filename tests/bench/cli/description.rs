//! The description of a run: printed, repeated, and compared with other runs.

use super::fixture::Fixture;
use clap::Parser;
use svl::scenario::SourceOptions;

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
    // On the terminal: relative to the working folder.
    let printed = fixture.run(&format!("score {command} --print-scenario"));
    fixture.write("printed.toml", printed);
    fixture.transcript(&format!(
        "mkdir inner
        score {command} -o first --rerun none
        score {command} --print-scenario=inner/again.toml
        score inner/again.toml -o second --rerun none
        score printed.toml -o third --rerun none
        rm inner/again.toml"
    ));
    let first = hashes(fixture, "first");
    assert_eq!(first, hashes(fixture, "second"), "{command}");
    assert_eq!(first, hashes(fixture, "third"), "{command}");
    // Limits of algorithms that are not run are not printed.
    let [first, second] = ["first", "second"].map(|report| {
        let mut manifest = fixture.json_file(&format!("{report}/manifest.json"));
        let mut description = manifest["description"].take();
        description.as_object_mut().unwrap().remove("gate");
        for path in ["files", "calib", "data"] {
            description["source"].as_object_mut().unwrap().remove(path);
        }
        description
    });
    assert_eq!(first, second, "{command}");
}

#[test]
fn a_printed_scenario_repeats_the_run_of_each_kind_of_source() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 4);
    fixture.record_short_arena("run.mcap", 4, 1);
    for command in [
        "short.toml --algo v3 --algo fast=bm:max_disparity=48 --seeds 4,5 --every 2",
        "run.mcap --algo v3 --from 0.02 --crop 40,20,240,200 --scale 0.5",
        "run.mcap --algo v3 --camera-height 0.3 --stress gain=0.5",
    ] {
        repeats(&fixture, command);
    }
    fixture.fails("score run.mcap --print-scenario=short.toml => 1: short.toml | exists");
}

#[test]
fn a_scene_is_repeated_from_its_folder_of_data_sets() {
    let fixture = Fixture::new();
    fixture.write_pair("data/cones/im0.pgm", "data/cones/im1.pgm", (80, 60), 5);
    fixture.write(
        "scenes.toml",
        "name = \"s\"\n[cells]\njudge = \"disparity\"\ntolerance_px = 2\n[source]\n\
         kind = \"dataset\"\nscenes = [\"cones\"]\n",
    );
    repeats(&fixture, "scenes.toml --algo v3 --data data");
}

#[test]
fn runs_of_other_options_are_not_mixed() {
    let fixture = Fixture::new();
    fixture.record_short_arena("run.mcap", 6, 1);
    let seals = || {
        let manifest = fixture.json_file("one/manifest.json");
        manifest["sessions"].as_array().unwrap().clone()
    };
    let score = "score run.mcap --algo v3 -q -o one --rerun none";
    fixture.run(score);
    let first = seals();
    for options in ["--every 2", "--scale 0.5"] {
        fixture.run(&format!("{score} {options}"));
        assert!(seals().len() == 1 && seals() != first, "{options}");
    }
    // Results of the first pairs and truth are still there, apart from the others.
    fixture.transcript(&format!("{score} => matched  nothing"));
    assert_eq!(seals(), first);

    // Shards with other options are not parts of one run.
    fixture.transcript(
        "score run.mcap --algo v3 --shard 1/2 -o part1 --rerun none
        score run.mcap --algo v3 --shard 2/2 -o part2 --scale 0.5 --rerun none
        report part1 part2 -o whole => 1: part2 | not of the same run | source.scale
        score run.mcap --algo v3 --every 2 -o two --rerun none
        compare one two => 3 pairs, 3 with equal results | in one report alone",
    );
}

#[test]
fn labels_and_links_are_kept_or_refused() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.record_short_arena("run.mcap", 3, 1);
    std::os::unix::fs::symlink("run.mcap", fixture.path("latest.mcap")).unwrap();
    // Named sweeps, and limits as numbers and as texts. Printed limits are those of algorithms that
    // are run.
    let sweep = "run.mcap --algo L=bm:uniqueness=0..20/10,block_size=5/9 --algo v3 --allow-loss";
    repeats(&fixture, &format!("{sweep} 3"));
    fixture.transcript(&format!(
        "score latest.mcap --algo v3 --print-scenario => files = [\"latest.mcap\"]
        cat third/manifest.json => /algorithms/3/label = L:uniqueness=10,block_size=9
        score {sweep} 3 --print-scenario => allow_loss = 3\\n
        score {sweep} 1% --print-scenario => allow_loss = \"1%\"\\n
        score short.toml --algo v3 --print-scenario => 0~ limits of algorithms that are not run"
    ));
}

#[test]
fn another_program_behind_the_same_command_is_another_algorithm() {
    let fixture = Fixture::new();
    fixture.record_short_arena("run.mcap", 2, 1);
    let line = "score run.mcap --algo v3 --algo 'm=exec:command=sh m.sh' --rerun none -q -o r";
    let scored = |program: &str| {
        fixture.write("m.sh", program);
        assert_eq!(fixture.svl(line).code, Some(4));
        let list = fixture.json_file("r/report.json");
        let algorithms = &list["content"]["manifest"]["algorithms"];
        [0, 1].map(|i| algorithms[i]["parameters_hash"].clone())
    };
    scored("exit 1 # one");
    // What a program failed on is matched again.
    let first = scored("exit 1 # one");
    let sessions = std::fs::read_dir(fixture.path("r/units/sessions"));
    assert_eq!(sessions.unwrap().count(), 2);
    let second = scored("exit 1 # two");
    assert_eq!(first[0], second[0]);
    assert_ne!(first[1], second[1]);
}

#[test]
fn an_unfinished_report_fails_no_comparison_unnoticed() {
    let fixture = Fixture::new();
    fixture.record_short_arena("run.mcap", 2, 1);
    fixture.transcript(
        "score run.mcap --algo v3 --rerun none -o one
        score run.mcap --algo v3 --rerun none -o two
        rm two/summary.json
        compare one two --fail-on worse => 3: two: is incomplete (it was never finished)",
    );
}

#[derive(clap::Parser)]
struct Line {
    #[command(flatten)]
    options: SourceOptions,
}

/// A report's commands repeat the options of its pairs.
#[test]
fn options_as_words_are_read_as_they_were() {
    let options = SourceOptions {
        left: Some("/left image".to_owned()),
        side_by_side: Some("top-bottom".parse().unwrap()),
        fps: Some(12.5),
        right_offset_ms: Some(-2.0),
        camera_height_m: Some(0.2),
        crop: Some([0, 40, 640, 400]),
        ..SourceOptions::default()
    };
    let all = SourceOptions {
        files: vec!["a.mcap".to_owned()],
        every: Some(3),
        from_s: Some(1.0),
        ..options.clone()
    };
    let words = all.words().unwrap();
    let line = Line::parse_from(["svl".to_owned()].into_iter().chain(words));
    assert_eq!(line.options, options);
}
