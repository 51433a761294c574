//! Copies of recordings, and learned files that were fitted to what they are scored on.

use super::fixture::Fixture;
use crate::recording::bag::{self, ros_image};
use crate::recording::frames::image;
use svl::report::{Row, read_rows};

/// `run.mcap`, 12 pairs with truth, and copies of it: as it is, compressed, cut, and as a ROS 2
/// bag.
fn copied() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 12);
    fixture.record_short_arena("run.mcap", 12, 1);
    fixture.transcript(
        "cp run.mcap copy.mcap
        record run.mcap -q --compress -o packed.mcap
        record run.mcap -q --from 0.3 -o cut.mcap
        record run.mcap -q --ros2 -o ros.mcap",
    );
    fixture
}

fn rows(fixture: &Fixture, report: &str) -> Vec<Row> {
    read_rows(&fixture.path(&format!("{report}/rows.csv"))).unwrap()
}

#[test]
fn copies_are_scored_once_and_reported() {
    let fixture = copied();
    let names = "run.mcap copy.mcap packed.mcap cut.mcap ros.mcap";
    let score = format!("score {names} --algo v3 --rerun none");
    let copies = [
        ("copy", ""),
        (
            "packed",
            " (likewise 2 others, numbers differ: cut.mcap, ros.mcap)",
        ),
    ];
    let copies = copies.map(|(copy, others)| {
        let words = "12 pairs dropped: copies of pairs of run.mcap, which are taken once";
        format!("{copy}.mcap: {words}{others}")
    });
    // Shards score what the whole run does. Perturbed, the pairs are those of the recording still.
    let words = "copies of pairs of run.mcap, each scored once";
    fixture.transcript(&format!(
        "{score} -o all => 0~ {}
        score run.mcap --algo v3 --rerun none -o alone
        cat all/index.html => {words}
        cat all/summary.md => {words}
        {score} --shard 1/2 -q -o part1
        {score} --shard 2/2 -q -o part2
        report part1 part2 -q -o merged
        score run.mcap cut.mcap --algo v3 --rerun none --stress noise=4 -q -o stressed",
        copies.join(" | ")
    ));
    let summary = fixture.json_file("all/summary.json");
    let copies = &summary["missing"]["copies"]["run.mcap"];
    assert!(copies.as_u64() > Some(3 * 12), "{copies}");
    let pairs = |report: &str| {
        let rows = rows(&fixture, report).into_iter();
        let pair = |row: Row| (row.run, row.sequence, row.pair_hash);
        rows.map(pair).collect::<Vec<_>>()
    };
    assert_eq!(pairs("all"), pairs("alone"));
    assert_eq!(pairs("merged"), pairs("all"));
    assert_eq!(pairs("stressed").len(), 24);
}

#[test]
fn pictures_of_a_camera_at_rest_stay_pairs() {
    let fixture = Fixture::new();
    fixture.write_pair("p/left/0.pgm", "p/right/0.pgm", (64, 32), 7);
    for i in 1..4 {
        fixture.transcript(&format!(
            "cp p/left/0.pgm p/left/{i}.pgm
            cp p/right/0.pgm p/right/{i}.pgm"
        ));
    }
    let ran = fixture.svl("score p --algo v3:max_disparity=8 --rerun none -o r");
    assert!(!ran.stderr.contains("dropped"), "{}", ran.stderr);
    assert_eq!(rows(&fixture, "r").len(), 4);
    fixture.transcript(
        "record p -q -o p.mcap
        record p.mcap --ros2 -q -o ros.mcap
        info p.mcap => repeated images 3, 3\\n
        info ros.mcap => repeated images 3, 3\\n",
    );
}

#[test]
fn training_refuses_copies() {
    let fixture = copied();
    fixture.record_short_arena("other.mcap", 12, 2);
    for (name, files) in [
        ("mine", "\"run.mcap\", \"other.mcap\""),
        ("cut", "\"cut.mcap\""),
    ] {
        let text = format!(
            "name = \"{name}\"\nalgorithms = [\"v5\"]\n[source]\nkind = \"recording\"\n\
             files = [{files}]\n"
        );
        fixture.write(&format!("{name}.toml"), text);
    }
    let refused = "2: cut.mcap: has | pairs of run.mcap: name each recording once";
    fixture.fails(&format!(
        "-q train v5 mine.toml cut.toml --tables-only -o t.safetensors => {refused}
        -q train v5 mine.toml cut.toml --epochs 1 -o t.safetensors => {refused}"
    ));
}

#[test]
fn scores_on_what_was_fitted_to_are_warned_of() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 6);
    fixture.run("-q train v5 short.toml --seeds 204..209 --epochs 1 -o whole.safetensors");
    fixture.run("-q train v5 short.toml --seeds 107..109 --tables-only -o own.safetensors");
    for seed in [204, 206, 208, 108, 109] {
        fixture.record_short_arena(&format!("{seed}.mcap"), 6, seed);
    }
    fixture.record_short_arena("4.mcap", 6, 41);
    fixture.write("keys", "q\n");
    fixture.run("record 108.mcap --ros2 -q -o ros.mcap");
    let own = "v5:model=own.safetensors";
    let whole = "v5:model=whole.safetensors";
    let words = "was fitted to pairs of";
    // The third and the sixth run are for the tables. Each fifth run of the network is held out, of
    // fewer the last: 208. Built-in tables know the names of simulated runs.
    for (count, line) in [
        (
            1,
            format!("score short.toml --seeds 204..205 --algo {whole} --rerun none -o a"),
        ),
        (
            1,
            format!("score 206.mcap --algo {whole} --rerun none -o b"),
        ),
        (
            1,
            format!("score 204.mcap --algo {whole} --rerun none -o c"),
        ),
        (
            0,
            format!("score 208.mcap --algo {whole} --rerun none -o i"),
        ),
        (
            0,
            format!("score 204.mcap --algo own={own} --rerun none -o d"),
        ),
        (
            1,
            format!("score 108.mcap 109.mcap ros.mcap --algo own={own} --rerun none -o e"),
        ),
        (1, format!("replay ros.mcap --algo {own}")),
        (0, format!("replay 206.mcap --algo {own}")),
        (1, format!("tune 108.mcap --script keys --algo {own}")),
        (
            1,
            "score short.toml --seeds 40..41 --algo v5 --rerun none -o f".to_owned(),
        ),
        (
            0,
            "score short.toml --seeds 40..40 --algo v5 --rerun none -o g".to_owned(),
        ),
        (1, "score 4.mcap --algo v5 --rerun none -o h".to_owned()),
    ] {
        fixture.transcript(&format!("{line} => 0~ {count}x {words}"));
    }
    let warnings = fixture.json_file("e/summary.json")["warnings"].to_string();
    assert_eq!(warnings.matches(words).count(), 1);
    fixture.transcript(&format!(
        "cat e/index.html => 1x {words}
        cat e/summary.md => 1x {words}"
    ));
}

#[test]
fn recordings_of_the_same_moments_are_warned_of() {
    let fixture = Fixture::new();
    fixture.write_euroc("60.0");
    for (recording, shift) in [("a.mcap", 3), ("b.mcap", 4), ("c.mcap", 5)] {
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
    fixture.transcript(
        "score a.mcap b.mcap c.mcap --algo v3:max_disparity=8 --rerun none -o r => 0~ \
        1x b.mcap: has pairs with the stamps of pairs of a.mcap, but other pixels \
        | 1x c.mcap: has pairs with the stamps of pairs of a.mcap
        cat r/index.html => 1x has pairs with the stamps | (likewise 1 other: c.mcap)
        cat r/summary.md => 1x has pairs with the stamps | (likewise 1 other: c.mcap)",
    );
    let warnings = fixture.json_file("r/summary.json")["warnings"].to_string();
    assert_eq!(warnings.matches("has pairs with the stamps").count(), 2);
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
    fixture.transcript(&format!(
        "{score} -o whole
        {score} --shard 1/2 -o part1
        {score} --shard 2/2 -o part2
        report part1 part2 -q -o merged"
    ));
    for report in ["whole", "merged"] {
        let rows = rows(&fixture, report).into_iter();
        let pairs: Vec<_> = rows.map(|row| (row.run.unwrap(), row.sequence)).collect();
        let expected = [("p.mcap", 0), ("p.mcap", 2), ("p.mcap", 3), ("q.mcap", 1)];
        let expected = expected.map(|(run, at)| (run.to_owned(), at));
        assert_eq!(pairs, expected, "{report}");
    }
}

#[test]
fn equal_pixels_with_other_stamps_are_warned_of() {
    let fixture = Fixture::new();
    for i in 0..3 {
        let [left, right] = ["left", "right"].map(|side| format!("p/{side}/{i}.pgm"));
        fixture.write_pair(&left, &right, (64, 32), i + 1);
    }
    fixture.transcript(
        "record p --fps 5 -q -o run.mcap
        record p --fps 8 -q -o again.mcap
        score run.mcap again.mcap --algo v3:max_disparity=8 --rerun none -o all => 0~ 1x \
        again.mcap: has pairs with the pixels of pairs of run.mcap, but other stamps",
    );
}

#[test]
fn a_renamed_recording_is_compared() {
    let fixture = Fixture::new();
    fixture.record_short_arena("run.mcap", 12, 1);
    fixture.transcript(
        "score run.mcap --algo v3 --rerun none -q -o before
        mv run.mcap copy.mcap
        score copy.mcap --algo v3 --rerun none -q -o after
        compare before after --json => /0/algorithms/0/pairs = 12 \
        | /0/algorithms/0/unmatched = 0 | /0/algorithms/0/equal_results = 12",
    );
}

#[test]
fn recordings_that_exchanged_their_names_are_compared() {
    let fixture = Fixture::new();
    for (seed, name) in [(1, "a.mcap"), (2, "b.mcap")] {
        fixture.record_short_arena(name, 12, seed);
    }
    fixture.transcript(
        "score a.mcap b.mcap --algo v3 --rerun none -q -o before
        mv a.mcap c.mcap
        mv b.mcap a.mcap
        mv c.mcap b.mcap
        score a.mcap b.mcap --algo v3 --rerun none -q -o after
        compare before after --json => /0/algorithms/0/equal_results = 24 \
        | /0/algorithms/0/unmatched = 0",
    );
}
