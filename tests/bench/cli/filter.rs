//! `svl train filter`, `svl label windows`, and filters in a run.

use super::fixture::{Fixture, assert_says};
use crate::common::{is_nightly, python};
use std::sync::LazyLock;
use svl::filter::{FilterKind, FilterModel, Spectrum};
use svl::fit::filter::FrameLabels;
use svl::stereo::Gray;

/// Textured floors, a few frames each.
fn write_floors(fixture: &Fixture, name: &str, frames: u64) {
    let text = format!(
        "name = \"{}\"\n[source]\nkind = \"arena\"\nseeds = \"11..15\"\n[arena]\nframes = \
         {frames}\n[arena.world]\nfloor_patterns = [\"noise\", \"tiles\"]\n",
        name.trim_end_matches(".toml")
    );
    fixture.write(name, text);
}

/// A filter trained once for all tests, and its page.
static FLOOR: LazyLock<(Vec<u8>, String)> = LazyLock::new(|| {
    let fixture = Fixture::new();
    write_floors(&fixture, "floors.toml", 12);
    let train = "-q train filter floors.toml --kind floor --hidden 8";
    let said = fixture.run(&format!("{train} -o floor.safetensors"));
    assert_says(
        &said,
        &[
            "filter floor: 8 hidden neurons, windows of 64, amplitude",
            "training          3 recordings: ",
            "validation        1 recording: ",
            "false acceptance",
            "area of the ROC   0.9",
            "floor.safetensors\nfloor.html",
        ],
    );
    assert!(
        said.lines().all(|line| line.chars().count() <= 80),
        "{said}"
    );
    let bytes = std::fs::read(fixture.path("floor.safetensors")).unwrap();
    if is_nightly() {
        // Equal data, equal bytes, on any number of threads.
        fixture.run(&format!("{train} -o again.safetensors --threads 1"));
        assert!(bytes == std::fs::read(fixture.path("again.safetensors")).unwrap());
    }
    (bytes, fixture.text("floor.html"))
});

fn write_filter(fixture: &Fixture) {
    std::fs::write(fixture.path("floor.safetensors"), &FLOOR.0).unwrap();
}

#[test]
fn a_recording_is_not_named_twice() {
    let fixture = Fixture::new();
    write_floors(&fixture, "floors.toml", 3);
    fixture.fails(
        "-q train filter floors.toml floors.toml --seeds 11 --kind floor -o f.safetensors => \
         2: floors seed 11: has 3 pairs of floors seed 11: name each recording once",
    );
}

#[test]
fn the_page_of_a_training_shows_errors_and_curves() {
    assert_says(
        &FLOOR.1,
        &[
            "Filter floor",
            "false rejection",
            "Training and validation",
            "Falsely accepted",
            "floors seed 12",
        ],
    );
}

#[test]
fn python_computes_the_same_spectrum_and_network() {
    let fixture = Fixture::new();
    write_filter(&fixture);
    fixture.write_pair("left.pgm", "right.pgm", (100, 90), 5);
    let model = fixture.path("floor.safetensors");
    let paths = [fixture.path("left.pgm"), model.clone()];
    let [image, file] = paths.each_ref().map(|path| path.to_str().unwrap());
    let Some(answer) = python("filter.py", "numpy", [image, "7", "11", file]) else {
        return;
    };
    let answer: serde_json::Value = serde_json::from_slice(&answer).unwrap();
    let pgm = std::fs::read(image).unwrap();
    let left = Gray::from_vec(100, 90, pgm[pgm.len() - 9000..].to_vec()).unwrap();
    let model = FilterModel::read(&model).unwrap();
    let features = model.features;
    let mut spectrum = Spectrum::new(features.window);
    let mut row = vec![0.0; features.stride()];
    spectrum.amplitudes(&left, [7, 11], &mut row);
    let theirs = answer["amplitudes"].as_array().unwrap();
    assert_eq!(theirs.len(), 2049);
    let theirs: Vec<_> = theirs.iter().map(|a| a.as_f64().unwrap()).collect();
    let largest = theirs.iter().copied().fold(0.0, f64::max);
    for (ours, theirs) in row.iter().zip(&theirs) {
        assert!((f64::from(*ours) - theirs).abs() < 1e-4 * largest);
    }
    spectrum.features(features, &left, [7, 11], &mut row);
    let mut score = [0.0];
    let isa = svl::kernel::isa().unwrap();
    model.network.scores(isa, &row, &mut Vec::new(), &mut score);
    let theirs = answer["score"].as_f64().unwrap();
    assert!(
        (f64::from(score[0]) - theirs).abs() < 1e-3,
        "{} {answer}",
        score[0]
    );
}

#[test]
fn algorithms_run_with_and_without_filters() {
    let fixture = Fixture::new();
    write_filter(&fixture);
    write_floors(&fixture, "floors.toml", 10);
    let json = fixture.json(
        "-q score floors.toml --seeds 3 --algo v3 --algo v5 --filter floor.safetensors --json \
         -o report",
    );
    let algorithms = json["algorithms"].as_array().unwrap();
    let labels: Vec<_> = algorithms
        .iter()
        .map(|a| a["algorithm"].as_str().unwrap())
        .collect();
    assert_eq!(labels, ["v3", "v3+floor", "v5", "v5+floor"]);
    let [v3, filtered, v5, filtered_v5] = &algorithms[..] else {
        panic!("{json}")
    };
    let count = |counts: &serde_json::Value, key: &str| counts[key].as_u64();
    // v3 sees the tiles before the robot, and no longer.
    let floor = |counts| count(counts, "floor_obstacles").unwrap();
    assert!(
        floor(v5) > 20 && 3 * floor(filtered_v5) < 2 * floor(v5),
        "{json}"
    );
    assert!(floor(filtered) <= floor(v3));
    assert_eq!(count(v3, "kept_obstacles"), None);
    assert!(count(filtered, "kept_obstacles").unwrap() > 0, "{json}");
    // The filter is part of the parameters, and its time of the algorithm's.
    let manifest = fixture.text("report/manifest.json");
    assert_says(&manifest, &["+floor="]);
    assert_says(
        &fixture.text("report/rows.csv"),
        &["filters_us", "v3+floor"],
    );

    // A recording of results contains them too, and is verified with the same filter.
    fixture.run("record floors.toml --seed 3 --frames 2 -o run.mcap");
    let replay = "-q replay run.mcap --filter floor.safetensors";
    fixture.run(&format!("{replay} --algo v3 -o result.mcap"));
    let verified = fixture.run("-q replay result.mcap --verify --filter floor.safetensors");
    assert_says(&verified, &["v3+floor"]);
    let bench = "bench --algo v3 --filter floor.safetensors --max-disparity 60 --size 96x64 \
                 --json";
    assert_eq!(fixture.json(bench)[1]["algo"], "v3:max_disparity=60+floor");
}

#[test]
fn a_scenario_trains_its_filter_first_and_keeps_it() {
    let fixture = Fixture::new();
    write_floors(&fixture, "floors.toml", 8);
    let filter = "[[filter]]\ndetects = \"floor\"\nscenario = \"floors.toml\"\n";
    let scored = |more: &str| {
        let text = fixture.text("floors.toml");
        let text = text
            .replace("\"11..15\"", "[3]")
            .replace("name = \"floors\"", "name = \"own\"");
        fixture.write("own.toml", text + more);
        fixture.svl("-q score own.toml --algo v3 --rerun none -o report")
    };
    let said = scored(filter).done();
    assert_says(&said, &["v3+floor"]);
    let kept = || {
        let files = std::fs::read_dir(fixture.path("recordings"))
            .unwrap()
            .flatten();
        let names = files.map(|file| file.file_name().into_string().unwrap());
        names
            .filter(|name| name.ends_with(".safetensors"))
            .collect::<Vec<_>>()
    };
    assert_eq!(kept().len(), 1);
    assert!(kept()[0].starts_with("floors-floor-"), "{:?}", kept());
    scored(filter).done();
    assert_eq!(kept().len(), 1);

    for (more, code, words) in [
        ("seeds = [3, 4]", 1, "seed 3 would be trained on and scored"),
        (
            "file = \"a.safetensors\"",
            1,
            "needs either file or scenario",
        ),
        (filter, 1, "filter floor occurs twice"),
    ] {
        scored(&format!("{filter}{more}\n")).failed(code, &[words]);
    }
    scored("[[filter]]\ndetects = \"flor\"\nfile = \"x\"").failed(1, &["did you mean 'floor'"]);
    scored("[[filter]]\ndetects = \"floor\"\nfile = \"x.safetensors\"")
        .failed(1, &["x.safetensors"]);
}

/// A table of labels without its last column, which contains a hash in every line.
fn labels_of(fixture: &Fixture, table: &str) -> String {
    let text = fixture.text(table);
    let mut lines = text.lines().map(|line| line.rsplit_once(',').unwrap());
    let (head, last) = lines.next().unwrap();
    assert_eq!(last, "pair_hash");
    let rows = lines.map(|(row, hash)| {
        assert_eq!(hash.len(), 33, "{row},{hash}");
        format!("{row}\n")
    });
    format!("{head}\n{}", rows.collect::<String>())
}

#[test]
fn a_person_labels_windows() {
    let fixture = Fixture::new();
    fixture.run("record --frames 6 -o run.mcap");
    let label = |what: &str, keys: &str| {
        fixture.write("keys", keys);
        fixture.svl(&format!("label {what} run.mcap --script keys"))
    };
    let said = label("windows --kind floor", "b b s a u a down a . screen q").done();
    assert_says(
        &said,
        &[
            "run.floor.csv: 2 floor, 2 other",
            "filter floor",
            "? all keys",
        ],
    );
    let table = "sequence,window,label\n0,0x0,other\n0,1x0,other\n0,3x0,floor\n0,4x1,floor\n";
    assert_eq!(labels_of(&fixture, "run.floor.csv"), table);
    // It resumes after the last label; Ctrl-C keeps the labels.
    let stopped = label("windows --kind floor", "screen a backspace u b ctrl-c");
    assert_says(
        &stopped.stdout,
        &["resumed at frame 0, window 0x2 with 4 labels"],
    );
    stopped.failed(1, &["the labels are kept"]);
    let table = table.to_owned() + "0,0x2,other\n";
    assert_eq!(labels_of(&fixture, "run.floor.csv"), table);

    label("windows --kind too-close", "B a b A u A s s b q").done();
    let table = "sequence,window,label\n0,0x0,clear\n0,1x0,clear\n1,0x0,too-close\n1,1x0,clear\n\
                 2,0x0,too-close\n2,1x0,too-close\n4,0x0,clear\n";
    assert_eq!(labels_of(&fixture, "run.too-close.csv"), table);
    let table = fixture.text("run.too-close.csv");
    fixture.write(
        "run.too-close.csv",
        table + &format!("9,0x0,clear,h{:032}\n", 0),
    );
    fixture.fails(
        "-q train filter run.mcap --kind too-close -o t.safetensors => 1: run.too-close.csv | \
         frame 9",
    );
}

#[test]
fn labels_resume_after_the_last_one() {
    let fixture = Fixture::new();
    fixture.run("record --frames 2 -o run.mcap");
    let label = |keys: &str| {
        fixture.write("keys", keys);
        fixture.run("label windows run.mcap --kind floor --script keys")
    };
    for (keys, words) in [
        ("a b s q", "1 floor, 1 other"),
        ("screen A q", "resumed at frame 0, window 2x0 with 2 labels"),
        ("B q", "15 floor, 15 other"),
        // All windows are labelled: the last one is shown, and no key leads to the first.
        (
            "screen q",
            "the last window of the last frame has a label: 30 labels",
        ),
        ("s screen q", "window 4x2: other"),
        ("a a q", "16 floor, 14 other"),
        (
            "? screen q q",
            "all windows of the frame, also labelled ones",
        ),
    ] {
        let said = label(keys);
        assert!(said.contains(words), "{keys}:\n{said}");
    }
    let cut = fixture.text("run.floor.csv");
    fixture.write("run.floor.csv", &cut[..cut.len() - 20]);
    let cut = "1: run.floor.csv: line 31: it is cut off; remove it";
    fixture.fails(&format!(
        "label windows run.mcap --kind floor --script keys => {cut}"
    ));
}

#[test]
fn labels_are_given_in_a_terminal() {
    let fixture = Fixture::new();
    fixture.run("record --frames 3 -o run.mcap");
    let run = fixture.path("run.mcap");
    let program = assert_cmd::cargo::cargo_bin!("svl").to_str().unwrap();
    let run = run.to_str().unwrap();
    let line = ["ab.bq", program, "label", "windows", run, "--kind", "floor"];
    // Only on Unix, for its terminals.
    let Some(screen) = python("terminal.py", "pty", line) else {
        return;
    };
    let screen = String::from_utf8_lossy(&screen);
    assert_says(&screen, &["Backspace", "run.floor.csv: 1 floor, 2 other"]);
    let table = "sequence,window,label\n0,0x0,floor\n0,1x0,other\n1,2x0,other\n";
    assert_eq!(labels_of(&fixture, "run.floor.csv"), table);
}

#[test]
fn labels_are_of_the_recording_that_was_labelled() {
    let fixture = Fixture::new();
    fixture.run("record --frames 4 -o run.mcap");
    fixture.write("keys", "B a b q");
    let label = "label windows run.mcap --kind floor --script keys";
    fixture.run(label);
    let table = fixture.text("run.floor.csv");
    // Pairs are identified as in the tables of a report.
    fixture.run("-q replay run.mcap --algo v3 --rows rows.csv");
    let rows = fixture.text("rows.csv");
    let hash = table.lines().nth(2).unwrap().rsplit(',').next().unwrap();
    assert_eq!(rows.lines().filter(|row| row.contains(hash)).count(), 1);

    let train = "-q train filter run.mcap --kind floor -o f.safetensors";
    let refused = "run.floor.csv: labels another frame | than run.mcap has | label again";
    fixture.run("record --frames 4 --seed 2 -o run.mcap --force");
    fixture.fails(&format!("{train} => 1: {refused}\n{label} => 1: {refused}"));
    assert_eq!(fixture.text("run.floor.csv"), table, "nothing is written");
    // The same recording, read differently: other windows.
    fixture.run("record --frames 4 -o run.mcap --force");
    fixture.fails(&format!(
        "{train} --scale 0.5 => 1: {refused}
        {train} => 1: 1 recording | three or more"
    ));

    // A table elsewhere.
    std::fs::create_dir(fixture.path("tables")).unwrap();
    std::fs::rename(
        fixture.path("run.floor.csv"),
        fixture.path("tables/run.floor.csv"),
    )
    .unwrap();
    fixture.write("keys", "b q");
    let said = fixture.run(&format!("{label} -o tables/run.floor.csv"));
    assert_says(&said, &["tables/run.floor.csv: 1 floor, 17 other"]);
    assert!(!fixture.path("run.floor.csv").exists());
    fixture.fails(&format!(
        "{train} => 1: run.mcap: has no labels in run.floor.csv
        {train} --labels tables => 1: 1 recording | three or more"
    ));

    let hash = table.lines().last().unwrap().rsplit(',').next().unwrap();
    fixture.write("run.floor.csv", format!("{table}0,0x0,floor,{hash}\n"));
    let both = "run.floor.csv: line 19: frame 0, window 0x0 is 'floor', and not in an earlier";
    fixture.fails(&format!("{train} => 1: {both}\n{label} => 1: {both}"));
}

#[test]
fn the_truth_labels_recordings_of_the_arena() {
    let fixture = Fixture::new();
    write_floors(&fixture, "floors.toml", 12);
    for run in 1..=3 {
        fixture.run(&format!("record floors.toml --seed {run} -o run{run}.mcap"));
        let said = fixture.run(&format!(
            "-q label windows run{run}.mcap --kind floor --from-truth"
        ));
        assert_says(&said, &[&format!("run{run}.floor.csv: ")]);
    }
    let labels = FrameLabels::read(&fixture.path("run1.floor.csv"), FilterKind::Floor).unwrap();
    let [floor, other] = labels.counts();
    // A window that shows both is skipped.
    assert!(
        floor >= 24 && other >= 80 && floor + other < 12 * 15,
        "{floor} {other}"
    );
    let json = fixture.json(
        "-q train filter run1.mcap run2.mcap run3.mcap --kind floor --hidden 2,4 -o \
         f.safetensors --json",
    );
    assert_eq!(json["trials"].as_array().unwrap().len(), 6);
    assert_eq!(json["samples"]["test"][0].as_u64().unwrap(), floor as u64);
    let model = FilterModel::read(&fixture.path("f.safetensors")).unwrap();
    assert_eq!(model.facts["recordings"], "3");
    assert!([2, 4].contains(&model.network.hidden()));
}

#[test]
fn frames_of_both_kinds_are_not_labelled_by_truth() {
    let fixture = Fixture::new();
    fixture.run("record --frames 3 -o run.mcap");
    fixture.write_pair("p/left/1.pgm", "p/right/1.pgm", (320, 240), 4);
    fixture.fails(
        "
        label windows p --kind floor --from-truth -q => 1: p: only recordings of the arena
        ",
    );
    let said = fixture.run("label windows run.mcap --kind floor --from-truth -q");
    assert_says(&said, &["run.floor.csv: ", "windows of both skipped"]);
}

#[test]
fn invalid_trainings_and_filters_are_refused_in_one_line() {
    let fixture = Fixture::new();
    write_filter(&fixture);
    fixture.write_short_arena("short.toml", 3);
    fixture.run("record --frames 3 -o run.mcap");
    for run in ["a", "b", "c"] {
        std::fs::copy(
            fixture.path("run.mcap"),
            fixture.path(&format!("{run}.mcap")),
        )
        .unwrap();
        fixture.write("keys", "a q");
        fixture.run(&format!(
            "label windows {run}.mcap --kind floor --script keys"
        ));
    }
    fixture.write("mine.safetensors", "mine");
    let cut = &FLOOR.0[..FLOOR.0.len() - 100];
    std::fs::write(fixture.path("cut.safetensors"), cut).unwrap();
    fixture.fails(
        "-q train filter short.toml --kind floor -o t.safetensors => 1: 2 recordings | three
        -q train filter a.mcap b.mcap c.mcap --kind floor -o t.safetensors => 2: b.mcap: has \
         3 pairs of a.mcap
        -q train filter short.toml --seeds 1..3 --kind too-close -o t.safetensors => 1: at least 20
        label windows v4l2:/dev/video0,/dev/video2 --kind floor => 1: record them first
        label windows a.mcap --kind floor --from-truth => 1: a.floor.csv
        replay run.mcap --filter mine.safetensors => 1: mine.safetensors | not a safetensors file
        replay run.mcap --filter cut.safetensors => 1: cut.safetensors | corrupt
        replay run.mcap --filter floor.safetensors --filter floor.safetensors => 2: both are of",
    );
    assert!(!fixture.path("t.safetensors").exists());
    assert_eq!(fixture.text("mine.safetensors"), "mine");
}
