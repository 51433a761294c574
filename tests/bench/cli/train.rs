//! `svl train`.

use super::fixture::{Fixture, assert_says};
use crate::recording::bag::png;
use svl::matcher::V5Model;

const TRAIN: &str = "-q train v5 short.toml --seeds 4..7 --tables-only --algo v5:max_disparity=64";

fn short_arena() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 12);
    fixture
}

#[test]
fn cells_are_learned_and_the_table_decides() {
    let fixture = short_arena();
    let text = fixture.run(&format!("{TRAIN} -o own.safetensors"));
    assert_says(
        &text,
        &[
            "images of one size: ",
            "steps; % of cells",
            "arena",
            "720",
            "predicted, %",
            "nearest quarter, held out",
            "earlier reports of",
            "own.safetensors",
            "own.html",
        ],
    );
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    assert_says(&fixture.text("own.html"), &["Reliability", "held out"]);
    // The same data give the same model, on any number of threads.
    let model = |name: &str| std::fs::read(fixture.path(name)).unwrap();
    fixture.run(&format!("{TRAIN} --threads 3 -o again.safetensors"));
    assert_eq!(model("own.safetensors"), model("again.safetensors"));

    // The model is part of the parameters, by its content.
    let right = |algorithm: &str, out: &str| {
        let to = format!("--rerun none -o {out} --json");
        let json = fixture.json(&format!("-q score short.toml --algo {algorithm} {to}"));
        let manifest = fixture.text(&format!("{out}/manifest.json"));
        let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
        let hash = manifest["algorithms"][0]["parameters_hash"].clone();
        let all = &json["algorithms"][0]["areas"]["all"];
        (all["cells_right"].as_u64().unwrap(), hash)
    };
    // A path with slashes is not a list of values.
    std::fs::create_dir(fixture.path("of")).unwrap();
    fixture.write("of/own.safetensors", model("own.safetensors"));
    let own = right("v5:model=of/own.safetensors", "a");
    assert!(own.0 > 200, "{own:?}");
    let mut cautious = V5Model::from_bytes(&model("own.safetensors")).unwrap();
    cautious.median.base -= 3000;
    fixture.write("of/own.safetensors", cautious.to_bytes());
    let cautious = right("v5:model=of/own.safetensors", "b");
    assert!(
        cautious.0 < own.0 && cautious.1 != own.1,
        "{own:?} {cautious:?}"
    );
}

/// A scenario of small random scenes with that kind.
fn random_scenes(kind: &str) -> String {
    format!(
        "name = \"{kind}\"\n[source]\nkind = \"arena\"\nseeds = [1, 2]\n[arena]\n\
         random = \"{kind}\"\nframes = 6\n[arena.rig]\nwidth_px = 320\nheight_px = 240\n"
    )
}

#[test]
fn kinds_are_held_out_and_tests_are_not_fitted() {
    let fixture = short_arena();
    for kind in ["worlds", "shapes"] {
        fixture.write(&format!("{kind}.toml"), random_scenes(kind));
    }
    let train = "-q train v5 worlds.toml shapes.toml --seeds 1..4 --tables-only";
    let json = fixture.json(&format!(
        "{train} --test short.toml -o tested.safetensors --json"
    ))["tables"][0]
        .clone();
    let kind = |i: usize| &json["kinds"][i];
    assert_eq!(kind(0)["name"], "worlds");
    assert_eq!(kind(0)["cells"], 4 * 6 * 15);
    assert_eq!(kind(1)["name"], "shapes");
    assert_eq!(kind(2)["name"], "arena");
    // --seeds changes only what is fitted to.
    assert_eq!(kind(2)["cells"], 2 * 12 * 15);
    let tested = json["scenarios"].as_array().unwrap().iter();
    let tested: Vec<_> = tested
        .map(|scenario| scenario["tested"].as_bool().unwrap())
        .collect();
    assert_eq!(tested, [false, false, true]);
    for i in 0..3 {
        for figures in ["held_out", "present"] {
            let figure = |name: &str| kind(i)[figures][name].as_f64().unwrap();
            assert!((0.0..=1.0).contains(&figure("known")), "{json}");
            assert!((0.5..=1.0).contains(&figure("area")), "{json}");
            assert!((0.0..0.5).contains(&figure("calibration_error")), "{json}");
        }
    }
    fixture.run(&format!("{train} -o alone.safetensors"));
    let model = |name: &str| std::fs::read(fixture.path(name)).unwrap();
    assert_eq!(model("tested.safetensors"), model("alone.safetensors"));
    assert!(fixture.text("tested.html").contains("Kinds of scenes"));
    // The file names only what it was fitted to, its network's runs included.
    let fitted = V5Model::from_bytes(&model("tested.safetensors"))
        .unwrap()
        .fitted;
    let has = |run: &str| fitted.runs.iter().any(|fitted_run| fitted_run == run);
    assert!(has("shapes seed 4") && has("arena seed 101..110") && !has("arena seed 1"));
}

#[test]
fn the_network_is_learned_and_the_tables_on_other_runs() {
    let fixture = short_arena();
    let train = "-q train v5 short.toml --seeds 4..9 --epochs 12";
    let text = fixture.run(&format!("{train} --threads 1 -o own.safetensors"));
    assert_says(
        &text,
        &[
            "pixels of gaps, 4 runs",
            "1 run",
            "12 epochs",
            "within 2 px",
        ],
    );
    let json = fixture.json(&format!("{train} --threads 3 -o again.safetensors --json"));
    let bytes = |name: &str| std::fs::read(fixture.path(name)).unwrap();
    assert_eq!(bytes("own.safetensors"), bytes("again.safetensors"));
    // It learns, and chooses better than the fill does.
    let network = &json["network"];
    let epochs = network["epochs"].as_array().unwrap();
    let number = |epoch: &serde_json::Value, key: &str| epoch[key].as_f64().unwrap();
    let [first, last] = [&epochs[0], &epochs[11]].map(|epoch| number(epoch, "held_out"));
    assert!(last < first - 0.05, "{json}");
    assert!(
        number(&epochs[11], "held_out_right") > number(network, "filled_right"),
        "{json}"
    );
    // The tables are of the third and the sixth run, from what votes measure, too.
    assert_eq!(json["tables"][0]["scenarios"][0]["groups"], 2, "{json}");
    // Earlier reports are evidence.
    let time = &json["time"];
    assert!(number(time, "loss") <= number(time, "loss_alone"), "{json}");
    let relation = |i: usize| time["relations"][i].as_u64().unwrap();
    assert!(relation(0) > relation(1) + relation(2), "{json}");
    fixture.run("-q score short.toml --rerun none --algo v5:model=own.safetensors -o r");
    fixture.write("table.toml", "rank = 50\n");
    fixture.write_pair("l.pgm", "r.pgm", (160, 96), 7);
    fixture.fails(
        "match l.pgm r.pgm -o d.pfm --algo v5:model=table.toml => 2: table.toml | safetensors | \
         svl train v5
        match l.pgm r.pgm -o d.pfm --algo v5:gaps=own.safetensors => 2: gaps",
    );
}

#[test]
fn invalid_training_data_are_refused_in_one_line() {
    let fixture = short_arena();
    fixture.fails(
        "-q train v5 short.toml --seeds 4..5 -o t.safetensors --algo v3 => 2: --algo v3 | only v5
        -q train v5 short.toml --seeds 4..5 -o t.safetensors --algo v5:target=near => 2: only v5
        -q train v5 short.toml --seeds 4 --tables-only -o t.safetensors => 1: one run cannot \
         be held out
        -q train v5 short.toml --seeds 4 -o t.safetensors => 1: one run cannot be held out
        -q train v5 short.toml --seeds 4..5 -o t.safetensors => 1: short.toml | three runs
        -q train v5 short.toml --tables-only --epochs 3 -o t.safetensors => 2: --epochs
        -q train v5 short.toml --test short.toml --tables-only -o t.safetensors => 2: arena \
         seed 1: has 12 pairs of arena seed 1: name each recording once",
    );
    assert!(!fixture.path("t.safetensors").exists());
}

/// Videos of eight pairs each, named alike, whose truth is wrong in the right half; a scenario of
/// each.
fn write_videos(fixture: &Fixture) {
    for (video, shift) in [("one", 5), ("two", 9), ("three", 13)] {
        for i in 0..8 {
            let [left, right] = ["left", "right"].map(|side| format!("{video}/{side}/{i}.pgm"));
            fixture.write_pair(&left, &right, (160, 96), shift + i % 2);
            // Focal length 100 px, baseline 0.1 m; in millimetres.
            let depth = (0..160 * 96).map(|at| match at % 160 {
                0..80 => 10_000 / (shift + i % 2) as u16,
                _ => 9000,
            });
            let depth: Vec<_> = depth.collect();
            fixture.write(&format!("{video}/depth/{i}.png"), png((160, 96), &depth));
        }
        let calib = "cam0=[100 0 80; 0 100 48; 0 0 1]\ncam1=[100 0 80; 0 100 48; 0 0 1]\n\
                     doffs=0\nbaseline=100\nwidth=160\nheight=96\nndisp=16\n";
        fixture.write(&format!("{video}/calib.txt"), calib);
        fixture.write(&format!("{video}.toml"), video_scenario(&[video]));
    }
}

fn video_scenario(videos: &[&str]) -> String {
    format!(
        "name = \"own\"\n[source]\nkind = \"recording\"\nfiles = {videos:?}\n\
         truth = \"depth/*.png\"\n"
    )
}

#[test]
fn recordings_are_held_out_whole() {
    let fixture = Fixture::new();
    write_videos(&fixture);
    fixture.write("both.toml", video_scenario(&["one", "two"]));
    fixture.fails(
        "-q train v5 one.toml --tables-only -o t.safetensors => 1: one run cannot be held out",
    );
    let train = "-q train v5 both.toml --tables-only --json";
    let json = fixture.json(&format!("{train} -o t.safetensors"))["tables"][0].clone();
    assert_eq!(json["scenarios"][0]["groups"], 2, "{json}");
    // Nothing is held out by kind where there is one.
    let kind = &json["kinds"][0];
    assert!(kind["held_out"].is_null(), "{kind}");
    // Names are alike in another video, and pairs in a copy with other names.
    fixture.run(&format!("{train} --test three.toml -o other.safetensors"));
    fixture.run("record two --truth depth/*.png -o two.mcap");
    fixture.write(
        "copy.toml",
        video_scenario(&["two.mcap"]).replace("truth = \"depth/*.png\"\n", ""),
    );
    fixture.fails(
        "-q train v5 both.toml --tables-only --test copy.toml -o u.safetensors => 2: two.mcap: \
         has 8 pairs of two: name each recording once
        -q train v5 both.toml copy.toml --tables-only -o u.safetensors => 2: two.mcap: has 8 pairs \
         of two: name each recording once",
    );
}
