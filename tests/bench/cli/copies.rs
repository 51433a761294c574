//! Copies of recordings, and learned files that were fitted to what they are scored on.

use super::fixture::Fixture;
use crate::common::assert_says;
use crate::recording::bag::{self, ros_image};
use crate::recording::frames::image;
use serde_json::Value;
use svl::report::{Row, read_rows};

/// `run.mcap`, 12 pairs with truth, and copies of it: as it is, compressed, cut, and as a ROS 2
/// bag.
fn copied() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 12);
    fixture.run("record short.toml --seed 1 -q -o run.mcap");
    std::fs::copy(fixture.path("run.mcap"), fixture.path("copy.mcap")).unwrap();
    fixture.run("record run.mcap -q --compress -o packed.mcap");
    fixture.run("record run.mcap -q --from 0.3 -o cut.mcap");
    fixture.run("record run.mcap -q --ros2 -o ros.mcap");
    fixture
}

fn summary(fixture: &Fixture, report: &str) -> Value {
    serde_json::from_str(&fixture.text(&format!("{report}/summary.json"))).unwrap()
}

#[test]
fn copies_are_scored_once_and_reported() {
    let fixture = copied();
    let names = "run.mcap copy.mcap packed.mcap cut.mcap ros.mcap";
    let score = format!("score {names} --algo v3 --rerun none");
    let ran = fixture.svl(&format!("{score} -o all"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    for copy in ["copy.mcap", "packed.mcap", "ros.mcap"] {
        let words =
            format!("{copy}: 12 pairs dropped: copies of pairs of run.mcap, which are taken once");
        assert_says(&ran.stderr, &[words.as_str()]);
    }
    fixture.run("score run.mcap --algo v3 --rerun none -o alone");
    let rows = |report: &str| {
        let rows: Vec<Row> = read_rows(&fixture.path(&format!("{report}/rows.csv"))).unwrap();
        let hash = |row: Row| (row.run, row.sequence, row.pair_hash);
        rows.into_iter().map(hash).collect::<Vec<_>>()
    };
    assert_eq!(rows("all"), rows("alone"));
    let copies = summary(&fixture, "all")["missing"]["copies"]["run.mcap"].clone();
    assert!(copies.as_u64() > Some(3 * 12), "{copies}");
    for page in ["all/index.html", "all/summary.md"] {
        assert_says(
            &fixture.text(page),
            &["copies of pairs of run.mcap, each scored once"],
        );
    }
    // Shards score what the whole run does.
    for shard in ["1/2", "2/2"] {
        let part = &shard[..1];
        fixture.run(&format!("{score} --shard {shard} -q -o part{part}"));
    }
    fixture.run("report part1 part2 -q -o merged");
    assert_eq!(rows("merged"), rows("all"));
    // Perturbed, the pairs are those of the recording still.
    fixture.run("score run.mcap cut.mcap --algo v3 --rerun none --stress noise=4 -q -o stressed");
    let rows: Vec<Row> = read_rows(&fixture.path("stressed/rows.csv")).unwrap();
    assert_eq!(rows.len(), 24);
}

#[test]
fn pictures_of_a_camera_at_rest_stay_pairs() {
    let fixture = Fixture::new();
    fixture.write_pair("p/left/0.pgm", "p/right/0.pgm", (64, 32), 7);
    for i in 1..4 {
        for side in ["left", "right"] {
            let from = fixture.path(&format!("p/{side}/0.pgm"));
            std::fs::copy(from, fixture.path(&format!("p/{side}/{i}.pgm"))).unwrap();
        }
    }
    let ran = fixture.svl("score p --algo v3:max_disparity=8 --rerun none -o r");
    assert!(!ran.stderr.contains("dropped"), "{}", ran.stderr);
    let rows: Vec<Row> = read_rows(&fixture.path("r/rows.csv")).unwrap();
    assert_eq!(rows.len(), 4);
    fixture.run("record p -q -o p.mcap");
    fixture.run("record p.mcap --ros2 -q -o ros.mcap");
    for recording in ["p.mcap", "ros.mcap"] {
        let info = fixture.run(&format!("info {recording}"));
        assert_says(&info, &["repeated images 3, 3\n"]);
    }
}

#[test]
fn training_refuses_copies() {
    let fixture = copied();
    fixture.run("record short.toml --seed 2 -q -o other.mcap");
    let files = |name: &str, files: &str| {
        let text = format!(
            "name = \"{name}\"\nalgorithms = [\"v5\"]\n[source]\nkind = \"recording\"\n\
             files = [{files}]\n"
        );
        fixture.write(&format!("{name}.toml"), text);
    };
    files("mine", "\"run.mcap\", \"other.mcap\"");
    files("cut", "\"cut.mcap\"");
    let refused = "2: cut.mcap: has | pairs of run.mcap: name each recording once";
    fixture.fails(&format!(
        "-q train v5 mine.toml cut.toml --tables-only -o t.safetensors => {refused}
        -q train v5 mine.toml cut.toml --epochs 1 -o t.safetensors => {refused}"
    ));
}

/// Scores with the number of warnings that its numbers are of training.
fn warnings(fixture: &Fixture, line: &str) -> usize {
    let ran = fixture.svl(line);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    ran.stderr.matches("was fitted to pairs of").count()
}

#[test]
fn scores_on_what_was_fitted_to_are_warned_of() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 6);
    fixture.run("-q train v5 short.toml --seeds 204..209 --epochs 1 -o whole.safetensors");
    fixture.run("-q train v5 short.toml --seeds 107..109 --tables-only -o own.safetensors");
    for seed in [204, 206, 208, 108, 109] {
        fixture.run(&format!(
            "record short.toml --seed {seed} -q -o {seed}.mcap"
        ));
    }
    fixture.run("record 108.mcap --ros2 -q -o ros.mcap");
    let own = "--algo own=v5:model=own.safetensors";
    let score = |what: &str, algo: &str, report: &str| {
        let line = format!("score {what} {algo} --rerun none -o {report}");
        warnings(&fixture, &line)
    };
    let whole = "--algo v5:model=whole.safetensors";
    assert_eq!(score("short.toml --seeds 204..205", whole, "a"), 1);
    // The third and the sixth run are for the tables.
    assert_eq!(score("206.mcap", whole, "b"), 1);
    assert_eq!(score("204.mcap", whole, "c"), 1);
    // Each fifth run of the network is held out, of fewer the last: 208.
    assert_eq!(score("208.mcap", whole, "i"), 0);
    assert_eq!(score("204.mcap", own, "d"), 0);
    assert_eq!(score("108.mcap 109.mcap ros.mcap", own, "e"), 1);
    let words = "was fitted to pairs of";
    assert_eq!(
        summary(&fixture, "e")["warnings"]
            .to_string()
            .matches(words)
            .count(),
        1
    );
    for page in ["e/index.html", "e/summary.md"] {
        assert_eq!(fixture.text(page).matches(words).count(), 1, "{page}");
    }
    assert_eq!(
        warnings(&fixture, "replay ros.mcap --algo v5:model=own.safetensors"),
        1
    );
    assert_eq!(
        warnings(&fixture, "replay 206.mcap --algo v5:model=own.safetensors"),
        0
    );
    fixture.write("keys", "q\n");
    let tune = "tune 108.mcap --script keys --algo v5:model=own.safetensors";
    assert_eq!(warnings(&fixture, tune), 1);
    // Built-in tables know the names of simulated runs.
    assert_eq!(score("short.toml --seeds 40..41", "--algo v5", "f"), 1);
    assert_eq!(score("short.toml --seeds 40..40", "--algo v5", "g"), 0);
    fixture.run("record short.toml --seed 41 -q -o 4.mcap");
    assert_eq!(score("4.mcap", "--algo v5", "h"), 1);
}

#[test]
fn recordings_of_the_same_moments_are_warned_of() {
    let fixture = Fixture::new();
    fixture.write_euroc("60.0");
    for (recording, shift) in [("a.mcap", 3), ("b.mcap", 4)] {
        for (camera, shift) in [("cam0", 0), ("cam1", shift)] {
            let csv =
                "#timestamp [ns],filename\n1700000000000000000,a.pgm\n1700000000050000000,b.pgm\n";
            fixture.write(&format!("mav0/{camera}/data.csv"), csv);
            let image = |name: &str| format!("mav0/{camera}/data/{name}.pgm");
            fixture.write_pair(&image("a"), "other.pgm", (64, 48), shift);
            fixture.write_pair("other.pgm", &image("b"), (64, 48), shift);
        }
        fixture.run(&format!("record . --calib none -q -o {recording}"));
    }
    let ran = fixture.svl("score a.mcap b.mcap --algo v3:max_disparity=8 --rerun none -o r");
    let words = ["b.mcap: has pairs with the stamps of pairs of a.mcap, but other pixels"];
    assert_says(&ran.stderr, &words);
}

#[test]
fn shards_know_the_pairs_behind_one_that_cannot_be_read() {
    let fixture = Fixture::new();
    // The second pair of the first bag cannot be read.
    for (name, broken) in [("p", Some(1)), ("q", None)] {
        let images = (0..4_u64).flat_map(|i| {
            [("/left/image_rect", i), ("/right/image_rect", i + 9)].map(|(topic, seed)| {
                let pixels: Vec<u8> = image((64, 32), seed).pixels().collect();
                let cut = if broken == Some(i) { 10 } else { 0 };
                let stamp_ns = 1_700_000_000_000_000_000 + i * 50_000_000;
                ros_image(topic, stamp_ns, (64, 32), "mono8", &pixels[cut..])
            })
        });
        let bag = bag::write(&fixture.path(""), &images.collect::<Vec<_>>());
        std::fs::rename(bag, fixture.path(&format!("{name}.mcap"))).unwrap();
    }
    let score = "score p.mcap q.mcap --algo v3:max_disparity=8 --allow-loss 2 --rerun none -q";
    fixture.run(&format!("{score} -o whole"));
    for i in [1, 2] {
        fixture.run(&format!("{score} --shard {i}/2 -o part{i}"));
    }
    fixture.run("report part1 part2 -q -o merged");
    for report in ["whole", "merged"] {
        let rows: Vec<Row> = read_rows(&fixture.path(&format!("{report}/rows.csv"))).unwrap();
        let pairs = rows.into_iter().map(|row| (row.run.unwrap(), row.sequence));
        let pairs: Vec<_> = pairs.collect();
        let expected = [("p.mcap", 0), ("p.mcap", 2), ("p.mcap", 3), ("q.mcap", 1)];
        assert_eq!(
            pairs,
            expected.map(|(run, at)| (run.to_owned(), at)),
            "{report}"
        );
    }
}

#[test]
fn equal_pixels_with_other_stamps_are_warned_of() {
    let fixture = Fixture::new();
    for i in 0..3 {
        let [left, right] = ["left", "right"].map(|side| format!("p/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, (64, 32), i + 1);
    }
    fixture.run("record p --fps 5 -q -o run.mcap");
    fixture.run("record p --fps 8 -q -o again.mcap");
    let algo = "--algo v3:max_disparity=8 --rerun none";
    let ran = fixture.svl(&format!("score run.mcap again.mcap {algo} -o all"));
    let words = "again.mcap: has pairs with the pixels of pairs of run.mcap, but other stamps";
    assert_eq!(ran.stderr.matches(words).count(), 1, "{}", ran.stderr);
}

#[test]
fn a_renamed_recording_is_compared() {
    let fixture = copied();
    fixture.run("score run.mcap --algo v3 --rerun none -q -o before");
    fixture.run("score copy.mcap --algo v3 --rerun none -q -o after");
    let shown = fixture.run("compare before after --json");
    let shown: Value = serde_json::from_str(&shown).unwrap();
    let algorithm = &shown[0]["algorithms"][0];
    assert_eq!(algorithm["pairs"], 12, "{algorithm}");
    assert_eq!(algorithm["unmatched"], 0);
    assert_eq!(algorithm["equal_results"], 12);
}

#[test]
fn recordings_that_exchanged_their_names_are_compared() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 8);
    for (seed, name) in [(1, "a"), (2, "b")] {
        fixture.run(&format!(
            "record short.toml --seed {seed} -q -o {name}.mcap"
        ));
    }
    let score = "score a.mcap b.mcap --algo v3 --rerun none -q -o";
    fixture.run(&format!("{score} before"));
    let path = |name: &str| fixture.path(name);
    std::fs::rename(path("a.mcap"), path("c.mcap")).unwrap();
    std::fs::rename(path("b.mcap"), path("a.mcap")).unwrap();
    std::fs::rename(path("c.mcap"), path("b.mcap")).unwrap();
    fixture.run(&format!("{score} after"));
    let shown: Value = serde_json::from_str(&fixture.run("compare before after --json")).unwrap();
    let algorithm = &shown[0]["algorithms"][0];
    assert_eq!(algorithm["equal_results"], 16, "{algorithm}");
    assert_eq!(algorithm["unmatched"], 0);
}
