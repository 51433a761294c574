//! `svl train filter`, `svl label windows`, and filters in a run.

use super::fixture::{Fixture, assert_says};
use super::transcript::assert_words;
use crate::common::{is_nightly, python};
use std::collections::BTreeSet;
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
    assert_words(
        &said,
        "filter floor: 8 hidden neurons, windows of 64, amplitude \
        | training          3 recordings:  | validation        1 recording:  | false acceptance \
        | area of the ROC   0.9 | floor.safetensors\\nfloor.html",
    );
    assert!(
        said.lines().all(|line| line.chars().count() <= 80),
        "{said}"
    );
    let bytes = fixture.bytes("floor.safetensors");
    if is_nightly() {
        // Equal data, equal bytes, on any number of threads.
        fixture.run(&format!("{train} -o again.safetensors --threads 1"));
        assert!(bytes == fixture.bytes("again.safetensors"));
    }
    (bytes, fixture.text("floor.html"))
});

fn write_filter(fixture: &Fixture) {
    fixture.write("floor.safetensors", &FLOOR.0);
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
    let words = "Filter floor | false rejection | Training and validation | Falsely accepted \
                 | floors seed 12";
    assert_words(&FLOOR.1, words);
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
    let labels: Vec<_> = algorithms.iter().map(|a| &a["algorithm"]).collect();
    assert_eq!(labels, ["v3", "v3+floor", "v5", "v5+floor"]);
    // v3 sees the tiles before the robot, and no longer.
    let count = |i: usize, key: &str| algorithms[i][key].as_u64();
    let [v3, filtered, v5, filtered_v5] =
        [0, 1, 2, 3].map(|i| count(i, "floor_obstacles").unwrap());
    assert!(
        v5 > 20 && 3 * filtered_v5 < 2 * v5 && filtered <= v3,
        "{json}"
    );
    assert_eq!(count(0, "kept_obstacles"), None);
    assert!(count(1, "kept_obstacles") > Some(0), "{json}");
    // The filter is part of the parameters, and its time of the algorithm's. A recording of results
    // contains them too, and is verified with the same filter.
    let hashes = fixture.column("report/rows.csv", "parameters_hash");
    assert_eq!(BTreeSet::from_iter(hashes).len(), 4);
    fixture.transcript(
        "cat report/manifest.json => +floor=
        cat report/rows.csv => filters_us | v3+floor
        record floors.toml --seed 3 --frames 2 -o run.mcap
        -q replay run.mcap --filter floor.safetensors --algo v3 -o result.mcap
        -q replay result.mcap --verify --filter floor.safetensors => v3+floor
        bench --algo v3 --filter floor.safetensors --max-disparity 60 --size 96x64 --json \
        => /1/algo = v3:max_disparity=60+floor",
    );
}

#[test]
fn a_scenario_trains_its_filter_first_and_keeps_it() {
    let fixture = Fixture::new();
    write_floors(&fixture, "floors.toml", 8);
    let filter = "[[filter]]\ndetects = \"floor\"\nscenario = \"floors.toml\"\n";
    let scored = |more: &str, expected: &str| {
        let edits = [
            ["\"11..15\"", "[3]"],
            ["name = \"floors\"", "name = \"own\""],
        ];
        fixture.edit("floors.toml", "own.toml", &edits);
        fixture.write("own.toml", fixture.text("own.toml") + more);
        let line = "-q score own.toml --algo v3 --rerun none -o report";
        fixture.transcript(&format!("{line} => {expected}"));
    };
    let kept = || {
        let files = std::fs::read_dir(fixture.path("recordings"))
            .unwrap()
            .flatten();
        let names = files.map(|file| file.file_name().into_string().unwrap());
        names
            .filter(|name| name.ends_with(".safetensors"))
            .collect::<Vec<_>>()
    };
    for _ in 0..2 {
        scored(filter, "v3+floor");
        assert_eq!(kept().len(), 1);
        assert!(kept()[0].starts_with("floors-floor-"), "{:?}", kept());
    }
    for (more, words) in [
        ("seeds = [3, 4]", "seed 3 would be trained on and scored"),
        ("file = \"a.safetensors\"", "needs either file or scenario"),
        (filter, "filter floor occurs twice"),
    ] {
        scored(&format!("{filter}{more}\n"), &format!("1: {words}"));
    }
    let file =
        |detects: &str| format!("[[filter]]\ndetects = \"{detects}\"\nfile = \"x.safetensors\"");
    scored(&file("flor"), "1: did you mean 'floor'");
    scored(&file("floor"), "1: x.safetensors");
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
    fixture.record("run.mcap", "--frames 6");
    let label = |kind: &str, keys: &str, expected: &str| {
        fixture.write("keys", keys);
        let line = format!("label windows --kind {kind} run.mcap --script keys");
        fixture.transcript(&format!("{line} => {expected}"));
    };
    let said = "run.floor.csv: 2 floor, 2 other | filter floor | ? all keys";
    label("floor", "b b s a u a down a . screen q", said);
    let table = "sequence,window,label\n0,0x0,other\n0,1x0,other\n0,3x0,floor\n0,4x1,floor\n";
    assert_eq!(labels_of(&fixture, "run.floor.csv"), table);
    // It resumes after the last label; Ctrl-C keeps the labels.
    let said = "resumed at frame 0, window 0x2 with 4 labels => 1: the labels are kept";
    label("floor", "screen a backspace u b ctrl-c", said);
    let table = table.to_owned() + "0,0x2,other\n";
    assert_eq!(labels_of(&fixture, "run.floor.csv"), table);

    label("too-close", "B a b A u A s s b q", "");
    let table = "sequence,window,label\n0,0x0,clear\n0,1x0,clear\n1,0x0,too-close\n1,1x0,clear\n\
                 2,0x0,too-close\n2,1x0,too-close\n4,0x0,clear\n";
    assert_eq!(labels_of(&fixture, "run.too-close.csv"), table);
    let table = fixture.text("run.too-close.csv") + &format!("9,0x0,clear,h{:032}\n", 0);
    fixture.write("run.too-close.csv", table);
    fixture.fails(
        "-q train filter run.mcap --kind too-close -o t.safetensors => 1: run.too-close.csv | \
         frame 9",
    );
}

#[test]
fn labels_resume_after_the_last_one() {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "--frames 2");
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
        fixture.write("keys", keys);
        let line = "label windows run.mcap --kind floor --script keys";
        fixture.transcript(&format!("{line} => {words}"));
    }
    let cut = fixture.text("run.floor.csv");
    fixture.write("run.floor.csv", &cut[..cut.len() - 20]);
    fixture.fails(
        "label windows run.mcap --kind floor --script keys \
        => 1: run.floor.csv: line 31: it is cut off; remove it",
    );
}

#[test]
fn labels_are_given_in_a_terminal() {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "--frames 3");
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
    fixture.record("run.mcap", "--frames 4");
    fixture.record("own.mcap", "--frames 4");
    fixture.record("other.mcap", "--frames 4 --seed 2");
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
    fixture.transcript(&format!(
        "mv other.mcap run.mcap
        {train} => 1: {refused}
        {label} => 1: {refused}"
    ));
    assert_eq!(fixture.text("run.floor.csv"), table, "nothing is written");
    // The same recording, read differently: other windows. A table elsewhere.
    fixture.write("keys", "b q");
    let hash = table.lines().last().unwrap().rsplit(',').next().unwrap();
    fixture.transcript(&format!(
        "mv own.mcap run.mcap
        {train} --scale 0.5 => 1: {refused}
        {train} => 1: 1 recording | three or more
        mkdir tables
        mv run.floor.csv tables/run.floor.csv
        {label} -o tables/run.floor.csv => tables/run.floor.csv: 1 floor, 17 other
        test ! -e run.floor.csv
        {train} => 1: run.mcap: has no labels in run.floor.csv
        {train} --labels tables => 1: 1 recording | three or more"
    ));
    fixture.write("run.floor.csv", format!("{table}0,0x0,floor,{hash}\n"));
    let both = "run.floor.csv: line 19: frame 0, window 0x0 is 'floor', and not in an earlier";
    fixture.fails(&format!("{train} => 1: {both}\n{label} => 1: {both}"));
}

#[test]
fn the_truth_labels_recordings_of_the_arena() {
    let fixture = Fixture::new();
    write_floors(&fixture, "floors.toml", 12);
    for run in 1..=3 {
        fixture.transcript(&format!(
            "record floors.toml --seed {run} -o run{run}.mcap
            -q label windows run{run}.mcap --kind floor --from-truth => run{run}.floor.csv:"
        ));
    }
    let labels = FrameLabels::read(&fixture.path("run1.floor.csv"), FilterKind::Floor).unwrap();
    let [floor, other] = labels.counts();
    // A window that shows both is skipped.
    assert!(
        floor >= 24 && other >= 80 && floor + other < 12 * 15,
        "{floor} {other}"
    );
    fixture.transcript(&format!(
        "-q train filter run1.mcap run2.mcap run3.mcap --kind floor --hidden 2,4 -o f.safetensors \
        --json => /trials/# = 6 | /samples/test/0 = {floor}"
    ));
    let model = FilterModel::read(&fixture.path("f.safetensors")).unwrap();
    assert_eq!(model.facts["recordings"], "3");
    assert!([2, 4].contains(&model.network.hidden()));
}

#[test]
fn frames_of_both_kinds_are_not_labelled_by_truth() {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "--frames 3");
    fixture.write_pair("p/left/1.pgm", "p/right/1.pgm", (320, 240), 4);
    fixture.transcript(
        "label windows p --kind floor --from-truth -q => 1: p: only recordings of the arena
        label windows run.mcap --kind floor --from-truth -q \
        => run.floor.csv:  | windows of both skipped",
    );
}

#[test]
fn invalid_trainings_and_filters_are_refused_in_one_line() {
    let fixture = Fixture::new();
    write_filter(&fixture);
    fixture.write_short_arena("short.toml", 3);
    fixture.write("keys", "a q");
    for run in ["a", "b", "c", "run"] {
        fixture.record(&format!("{run}.mcap"), "--frames 3");
    }
    for run in ["a", "b", "c"] {
        let run = format!("{run}.mcap --kind floor --script keys");
        fixture.run(&format!("label windows {run}"));
    }
    fixture.write("mine.safetensors", "mine");
    fixture.write("cut.safetensors", &FLOOR.0[..FLOOR.0.len() - 100]);
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
