//! `svl train`.

use super::fixture::Fixture;
use super::transcript::assert_words;
use crate::recording::bag::png;
use svl::depth::decision::VerdictTable;
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
    assert_words(
        &text,
        "images of one size:  | steps; % of cells | arena | 720 | predicted, % \
        | nearest quarter, held out | earlier reports of | own.safetensors | own.html",
    );
    let is_narrow = |line: &str| line.chars().count() <= 80;
    assert!(text.lines().all(is_narrow), "{text}");
    // The same data give the same model, on any number of threads.
    fixture.transcript(&format!(
        "cat own.html => Reliability | held out
        {TRAIN} --threads 3 -o again.safetensors"
    ));
    let model = fixture.bytes("own.safetensors");
    assert_eq!(model, fixture.bytes("again.safetensors"));

    // The model is part of the parameters, by its content. A path with slashes is not a list of
    // values.
    let right = |out: &str, model: &[u8]| {
        fixture.write("of/own.safetensors", model);
        let line = "-q score short.toml --algo v5:model=of/own.safetensors --rerun none --json";
        let json = fixture.json(&format!("{line} -o {out}"));
        let manifest = fixture.json_file(&format!("{out}/manifest.json"));
        let hash = manifest["algorithms"][0]["parameters_hash"].clone();
        let all = &json["algorithms"][0]["areas"]["all"];
        (all["cells_right"].as_u64().unwrap(), hash)
    };
    let own = right("a", &model);
    assert!(own.0 > 200, "{own:?}");
    let mut cautious = V5Model::from_bytes(&model).unwrap();
    cautious.median.base -= 3000;
    let cautious = right("b", &cautious.to_bytes());
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
    let test = format!("{train} --test short.toml -o tested.safetensors --json");
    let text = fixture.run(&test);
    // --seeds changes only what is fitted to.
    assert_words(
        &text,
        "/tables/0/kinds/0/name = worlds | /tables/0/kinds/0/cells = 360 \
        | /tables/0/kinds/1/name = shapes \
        | /tables/0/kinds/2/name = arena | /tables/0/kinds/2/cells = 360 \
        | /tables/0/scenarios/# = 3 | /tables/0/scenarios/0/tested = false \
        | /tables/0/scenarios/1/tested = false | /tables/0/scenarios/2/tested = true",
    );
    for figures in ["held_out", "present"] {
        let figure = format!("/tables/0/kinds/*/{figures}");
        let known = format!("{figure}/known > -1e-9 | {figure}/known < 1.000001");
        let area = format!("{figure}/area > 0.4999999 | {figure}/area < 1.000001");
        let error = "calibration_error";
        let error = format!("{figure}/{error} > -1e-9 | {figure}/{error} < 0.5");
        assert_words(&text, &[known, area, error].join(" | "));
    }
    fixture.transcript(&format!(
        "{train} -o alone.safetensors
        cat tested.html => Kinds of scenes"
    ));
    let model = fixture.bytes("tested.safetensors");
    assert_eq!(model, fixture.bytes("alone.safetensors"));
    // The file names only what it was fitted to, its network's runs included.
    let fitted = V5Model::from_bytes(&model).unwrap().fitted;
    let has = |run: &str| fitted.runs.iter().any(|fitted_run| fitted_run == run);
    assert!(has("shapes seed 4") && has("arena seed 101..110") && !has("arena seed 1"));
}

#[test]
fn small_cells_have_tables_of_their_own() {
    let fixture = Fixture::new();
    let grid = "[grid]\ncolumns = 24\nrows = 12\n";
    for kind in ["worlds", "shapes"] {
        fixture.write(&format!("{kind}.toml"), random_scenes(kind) + grid);
    }
    let built_in = V5Model::built_in();
    let earlier = V5Model {
        near_small: None,
        ..built_in.clone()
    };
    fixture.write("earlier.safetensors", earlier.to_bytes());
    let train = "-q train v5 worlds.toml shapes.toml --seeds 1..3 --tables-only";
    let text = fixture.run(&format!("{train} -o own.safetensors --json"));
    assert_words(
        &text,
        "/tables/# = 2 | /tables/0/table = small | /tables/1/table = near_small",
    );
    fixture.transcript(&format!(
        "{train} --algo v5:model=earlier.safetensors -o again.safetensors"
    ));
    let [own, again] = ["own", "again"]
        .map(|name| V5Model::from_bytes(&fixture.bytes(&format!("{name}.safetensors"))).unwrap());
    let [table, before] = [&own, &built_in].map(|model| model.near_small.as_ref().unwrap());
    let rules = |table: &VerdictTable| (table.rank, table.slack, table.least_score);
    assert_eq!(rules(table), rules(before));
    assert!(table.time.is_none() && table.steps != before.steps);
    // It does not depend on a table before it; tables without cells are kept.
    assert_eq!(again.near_small, own.near_small);
    assert_eq!((own.median, own.near), (built_in.median, built_in.near));
    fixture.write("usual.toml", random_scenes("worlds"));
    fixture.transcript(
        "-q train v5 usual.toml --seeds 1..4 --tables-only --algo v5:model=earlier.safetensors \
         -o kept.safetensors",
    );
    let kept = V5Model::from_bytes(&fixture.bytes("kept.safetensors")).unwrap();
    assert_eq!(kept.near_small, None);
}

#[test]
fn the_network_is_learned_and_the_tables_on_other_runs() {
    let fixture = short_arena();
    let train = "-q train v5 short.toml --seeds 4..9 --epochs 12";
    fixture.transcript(&format!(
        "{train} --threads 1 -o own.safetensors => pixels of gaps, 4 runs | 1 run | 12 epochs \
        | within 2 px"
    ));
    let json = fixture.json(&format!("{train} --threads 3 -o again.safetensors --json"));
    let [own, again] = ["own", "again"].map(|name| fixture.bytes(&format!("{name}.safetensors")));
    assert_eq!(own, again);
    // It learns, and chooses better than the fill does.
    let network = &json["network"];
    let epochs = network["epochs"].as_array().unwrap();
    let number = |epoch: &serde_json::Value, key: &str| epoch[key].as_f64().unwrap();
    let [first, last] = [&epochs[0], &epochs[11]].map(|epoch| number(epoch, "held_out"));
    assert!(last < first - 0.05, "{json}");
    let chosen = number(&epochs[11], "held_out_right");
    assert!(chosen > number(network, "filled_right"), "{json}");
    // The tables are of the third and the sixth run, from what votes measure, too.
    assert_eq!(json["tables"][0]["scenarios"][0]["groups"], 2, "{json}");
    // Earlier reports are evidence.
    let time = &json["time"];
    assert!(number(time, "loss") <= number(time, "loss_alone"), "{json}");
    let relation = |i: usize| time["relations"][i].as_u64().unwrap();
    assert!(relation(0) > relation(1) + relation(2), "{json}");
    fixture.write("table.toml", "rank = 50\n");
    fixture.write_pair("l.pgm", "r.pgm", (160, 96), 7);
    fixture.transcript(
        "-q score short.toml --rerun none --algo v5:model=own.safetensors -o r
        match l.pgm r.pgm -o d.pfm --algo v5:model=table.toml => 2: table.toml | safetensors | \
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
    let copy = video_scenario(&["two.mcap"]).replace("truth = \"depth/*.png\"\n", "");
    fixture.write("both.toml", video_scenario(&["one", "two"]));
    fixture.write("copy.toml", copy);
    // Nothing is held out by kind where there is one. Names are alike in another video, and pairs
    // in a copy with other names.
    let train = "-q train v5 both.toml --tables-only";
    let copied = "2: two.mcap: has 8 pairs of two: name each recording once";
    fixture.transcript(&format!(
        "-q train v5 one.toml --tables-only -o t.safetensors => 1: one run cannot be held out
        {train} --json -o t.safetensors => /tables/0/scenarios/0/groups = 2 \
        | /tables/0/kinds/0/held_out = null
        {train} --json --test three.toml -o other.safetensors
        record two --truth depth/*.png -o two.mcap
        {train} --test copy.toml -o u.safetensors => {copied}
        -q train v5 both.toml copy.toml --tables-only -o u.safetensors => {copied}"
    ));
}
