//! `svl train`.

use super::fixture::{Fixture, assert_says};
use crate::recording::bag::png;

const TRAIN: &str = "-q train cells short.toml --seeds 4..7 --algo v5:max_disparity=64";

fn short_arena() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 12);
    fixture
}

#[test]
fn cells_are_learned_and_the_table_decides() {
    let fixture = short_arena();
    let text = fixture.run(&format!("{TRAIN} -o own.toml --samples own.csv"));
    assert_says(
        &text,
        &[
            "steps; % of cells",
            "arena",
            "720",
            "predicted, %",
            "own.toml",
            "own.html",
        ],
    );
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    let samples = fixture.text("own.csv");
    assert!(samples.starts_with("group,report,target,margin,support,seen,shift,cost,"));
    assert_eq!(samples.lines().count(), 1 + 4 * 12 * 15);
    assert_says(&fixture.text("own.html"), &["Reliability", "held out"]);
    // The same data give the same table, except for its date.
    let table = fixture.text("own.toml");
    fixture.run(&format!("{TRAIN} -o again.toml"));
    let below_date = |table: &str| table.lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(below_date(&table), below_date(&fixture.text("again.toml")));

    // By the nearest quarter it is a different table.
    fixture.run("-q train cells short.toml --seeds 4..7 --algo v5:target=near -o near.toml");
    assert!(fixture.text("near.toml").contains("\nrank = 75\n"));

    // The table is part of the parameters, by its content.
    let right = |algorithm: &str, out: &str| {
        let to = format!("--rerun none -o {out} --json");
        let json = fixture.json(&format!("-q score short.toml --algo {algorithm} {to}"));
        let manifest = fixture.text(&format!("{out}/manifest.json"));
        let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
        let hash = manifest["algorithms"][0]["parameters_hash"].clone();
        (json["algorithms"][0]["cells_right"].as_u64().unwrap(), hash)
    };
    // A path with slashes is not a list of values.
    std::fs::create_dir(fixture.path("of")).unwrap();
    fixture.write("of/own.toml", &table);
    let own = right("v5:table=of/own.toml", "a");
    assert!(own.0 > 200, "{own:?}");
    fixture.write("of/own.toml", table.replace("base = ", "base = -9"));
    let cautious = right("v5:table=of/own.toml", "b");
    assert!(
        cautious.0 < own.0 && cautious.1 != own.1,
        "{own:?} {cautious:?}"
    );
}

/// A scenario of small random scenes with that kind.
fn random_scenes(kind: &str) -> String {
    format!(
        "name = \"{kind}\"\n[source]\nkind = \"arena\"\nseeds = [1, 2]\n[arena]\n\
         random = \"{kind}\"\nframes = 6\n[arena.rig]\nwidth_px = 160\nheight_px = 120\n"
    )
}

#[test]
fn kinds_are_held_out_and_tests_are_not_fitted() {
    let fixture = short_arena();
    for kind in ["worlds", "shapes"] {
        fixture.write(&format!("{kind}.toml"), random_scenes(kind));
    }
    let train = "-q train cells worlds.toml shapes.toml --seeds 1..4";
    let json = fixture.json(&format!("{train} --test short.toml -o tested.toml --json"));
    let kind = |i: usize| &json["kinds"][i];
    assert_eq!(kind(0)["name"], "worlds");
    assert_eq!(kind(0)["cells"], 4 * 6 * 15);
    assert_eq!(kind(1)["name"], "shapes");
    assert_eq!(kind(2)["name"], "arena");
    // --seeds changes only what is fitted to.
    assert_eq!(kind(2)["cells"], 2 * 12 * 15);
    let tested = json["scenarios"].as_array().unwrap().iter();
    let tested: Vec<_> = tested.map(|of| of["tested"].as_bool().unwrap()).collect();
    assert_eq!(tested, [false, false, true]);
    for i in 0..3 {
        for of in ["held_out", "present"] {
            let figure = |name: &str| kind(i)[of][name].as_f64().unwrap();
            assert!((0.0..=1.0).contains(&figure("known")), "{json}");
            assert!((0.5..=1.0).contains(&figure("area")), "{json}");
            assert!((0.0..0.5).contains(&figure("calibration_error")), "{json}");
        }
    }
    fixture.run(&format!("{train} -o alone.toml"));
    let steps = |name: &str| {
        let table = fixture.text(name);
        table.split_once("rank").unwrap().1.to_owned()
    };
    assert_eq!(steps("tested.toml"), steps("alone.toml"));
    assert!(fixture.text("tested.html").contains("Kinds of scenes"));
    // The file names only what it was fitted to.
    let head = fixture.text("tested.toml");
    assert!(
        head.contains("shapes seed 4") && !head.contains("arena seed"),
        "{head}"
    );
}

#[test]
fn gaps_are_learned_and_cells_after_them() {
    let fixture = short_arena();
    let train = "-q train gaps short.toml --seeds 4..6 --epochs 20";
    let text = fixture.run(&format!("{train} --threads 1 -o gaps.safetensors"));
    assert_says(
        &text,
        &[
            "pixels of gaps, 3 runs",
            "1 run",
            "20 epochs",
            "within 2 px",
        ],
    );
    let json = fixture.json(&format!("{train} --threads 3 -o again.safetensors --json"));
    let bytes = |name: &str| std::fs::read(fixture.path(name)).unwrap();
    assert_eq!(bytes("gaps.safetensors"), bytes("again.safetensors"));
    // It learns, and chooses better than the fill does.
    let epochs = json["epochs"].as_array().unwrap();
    let number = |of: &serde_json::Value, key: &str| of[key].as_f64().unwrap();
    let [first, last] = [&epochs[0], &epochs[19]].map(|of| number(of, "held_out"));
    assert!(last < first - 0.05, "{json}");
    assert!(
        number(&epochs[19], "held_out_right") > number(&json, "filled_right"),
        "{json}"
    );

    // A table on top of it, from what only votes measure.
    let learn = "-q train cells short.toml --seeds 7..9 -o own.toml --samples own.csv --algo";
    fixture.run(&format!("{learn} v5:gaps=gaps.safetensors"));
    let samples = fixture.text("own.csv");
    assert!(
        samples
            .lines()
            .next()
            .unwrap()
            .ends_with(",span,voted,agreed,right,known")
    );
    let filled = samples
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .all(|value| !value.is_empty());
    assert!(filled, "{samples}");
    let own = fixture.text("own.toml");
    let network = own.lines().find(|line| line.starts_with("gaps = "));
    let steps = "[steps]\nvoted = [[500, 9000]]\n";
    let plain = format!("rank = 50\nbase = 1\n{steps}");
    let voted = plain.replace(steps, &format!("{}\n{steps}", network.unwrap()));
    fixture.write("voted.toml", &voted);
    fixture.write("plain.toml", &plain);
    fixture.write("other.toml", voted.replace("gaps = \"", "gaps = \"0"));
    fixture.write_pair("l.pgm", "r.pgm", (160, 96), 7);
    let known = |algorithm: &str| {
        let line = format!("match l.pgm r.pgm -o d.pfm --force --json --algo {algorithm}");
        let cells = fixture.json(&line)["cells"].clone();
        let cells = cells.as_array().unwrap().iter();
        cells
            .filter(|cell| cell["disparity_px"].is_number())
            .count()
    };
    assert_eq!(known("v5:gaps=gaps.safetensors,table=voted.toml"), 15);
    // Without its table the probabilities are not the network's.
    let warned = |algorithm: &str| {
        let ran = fixture.svl(&format!(
            "match l.pgm r.pgm -o d.pfm --force --algo {algorithm}"
        ));
        ran.stderr.matches("no table= is given").count()
    };
    assert_eq!(warned("v5:gaps=gaps.safetensors"), 1);
    assert_eq!(warned("v5:gaps=gaps.safetensors,table=voted.toml"), 0);
    assert_eq!(warned("v5:revision=3"), 0);
    assert_eq!(warned("v5:revision=3,gaps=gaps.safetensors"), 1);
    let score = "score short.toml --rerun none --algo v5:gaps=gaps.safetensors -o r";
    let ran = fixture.svl(score);
    assert_eq!(
        ran.stderr.matches("no table= is given").count(),
        1,
        "{}",
        ran.stderr
    );
    assert!(
        fixture
            .text("r/summary.json")
            .contains("no table= is given")
    );
    fixture.fails(
        "match l.pgm r.pgm -o d.pfm --force --algo v5:table=voted.toml => 2: voted.toml | 'voted' \
         | gaps=FILE
        match l.pgm r.pgm -o d.pfm --force --algo v5:gaps=gaps.safetensors,table=plain.toml => 2: \
         plain.toml | fitted without a network
        match l.pgm r.pgm -o d.pfm --force --algo v5:gaps=gaps.safetensors,table=other.toml => 2: \
         other.toml | fitted with the network of hash 0
        match l.pgm r.pgm -o d.pfm --force --algo v5:gaps=voted.toml => 2: voted.toml | \
         safetensors | svl train gaps",
    );
}

#[test]
fn what_cannot_be_learned_is_refused_in_one_line() {
    let fixture = short_arena();
    fixture.fails(
        "-q train cells short.toml --seeds 4..5 -o t.toml --algo v3 => 2: --algo v3 | no table of \
         cells | v5
        -q train cells short.toml --seeds 4 -o t.toml => 1: one run cannot be held out
        -q train cells short.toml --test short.toml -o t.toml => 2: arena seed 1: has 12 pairs \
         of arena seed 1: name each recording once
        -q train cells short.toml --seeds 4..5 -o short.toml --force => 2: short.toml | named twice
        -q train gaps short.toml --seeds 4 -o t.safetensors => 1: one run cannot be held out",
    );
    assert!(!fixture.path("t.toml").exists());
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
        fixture.write(&format!("{video}.toml"), of_videos(&[video]));
    }
}

fn of_videos(videos: &[&str]) -> String {
    format!(
        "name = \"own\"\n[source]\nkind = \"recording\"\nfiles = {videos:?}\n\
         truth = \"depth/*.png\"\n"
    )
}

#[test]
fn recordings_are_held_out_whole() {
    let fixture = Fixture::new();
    write_videos(&fixture);
    fixture.write("both.toml", of_videos(&["one", "two"]));
    fixture.fails("-q train cells one.toml -o t.toml => 1: one run cannot be held out");
    let train = "-q train cells both.toml --json";
    let json = fixture.json(&format!("{train} -o t.toml --samples t.csv"));
    assert_eq!(json["scenarios"][0]["groups"], 2, "{json}");
    let samples = fixture.text("t.csv");
    let groups = samples.lines().skip(1).map(|line| line.split(',').next());
    let groups: std::collections::BTreeSet<_> = groups.flatten().collect();
    assert_eq!(groups.len(), 2, "{groups:?}");
    // Nothing is held out by kind where there is one.
    let kind = &json["kinds"][0];
    assert!(
        kind["held_out"].is_null() && kind["wrong_at_equal"].is_null(),
        "{kind}"
    );
    // Names are alike in another video, and pairs in a copy with other names.
    fixture.run(&format!("{train} --test three.toml -o other.toml"));
    fixture.run("record two --truth depth/*.png -o two.mcap");
    fixture.write(
        "copy.toml",
        of_videos(&["two.mcap"]).replace("truth = \"depth/*.png\"\n", ""),
    );
    fixture.fails(
        "-q train cells both.toml --test copy.toml -o u.toml => 2: two.mcap: has 8 pairs of two: \
         name each recording once
        -q train cells both.toml copy.toml -o u.toml => 2: two.mcap: has 8 pairs of two: name \
         each recording once
        -q train gaps both.toml copy.toml -o u.safetensors => 2: two.mcap: has 8 pairs of two: \
         name each recording once",
    );
    let with_test = format!("{train} --test three.toml -o tested.toml --samples tested.csv");
    fixture.run(&with_test);
    assert_eq!(fixture.text("tested.csv"), samples);
}

#[test]
fn a_table_of_ones_own_decides_the_cells() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (160, 96), 7);
    fixture.write("good.toml", "rank = 50\nbase = 9000\n");
    let known = |algorithm: &str| {
        let line = format!("match l.pgm r.pgm -o d.pfm --force --json --algo {algorithm}");
        let cells = fixture.json(&line)["cells"].clone();
        let cells = cells.as_array().unwrap().iter();
        cells
            .filter(|cell| cell["disparity_px"].is_number())
            .count()
    };
    assert_eq!(known("v5:table=good.toml"), 15);
    let ran = fixture.svl("match l.pgm r.pgm -o d.pfm --force --algo v5:rank=60");
    assert!(
        ran.stderr.contains("a table for another rank"),
        "{}",
        ran.stderr
    );
    fixture.write("good.toml", "rank = 50\nbase = -9000\n");
    assert_eq!(known("v5:table=good.toml"), 0);
}
