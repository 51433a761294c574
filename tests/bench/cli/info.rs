//! `svl info`.

use super::fixture::{Fixture, assert_says};

#[test]
fn says_what_a_recording_holds() {
    let fixture = Fixture::new();
    fixture.run("record --frames 4 -o a.mcap");
    let text = fixture.run("info a.mcap");
    assert_says(
        &text,
        &[
            "/stereo/left/image",
            "foxglove.RawImage",
            "/truth/depth",
            "arena",
        ],
    );
    let json = fixture.json("info a.mcap --json");
    assert!(json["damage"].is_null());
}

#[test]
fn a_cut_recording_is_called_so() {
    let fixture = Fixture::new();
    fixture.run("record --frames 4 -o a.mcap");
    let bytes = fixture.bytes("a.mcap");
    fixture.write("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
    let json = fixture.json("info cut.mcap --json");
    assert!(json["damage"].is_string());
    fixture.write("empty.mcap", "");
    let wrong = "
        info empty.mcap => 1: empty.mcap
        info missing.mcap => 1: missing.mcap
    ";
    fixture.fails(wrong);
}

#[test]
fn the_spread_of_the_skew_is_drawn() {
    let fixture = Fixture::new();
    let sim = "sim:right.drift_ppm=2000,size=64x48,pictures=2";
    fixture.run(&format!(
        "record {sim} --trigger free --frames 40 -o a.mcap"
    ));
    let text = fixture.run("info a.mcap");
    let bars: Vec<_> = text.lines().filter(|line| line.contains('#')).collect();
    assert!((2..=12).contains(&bars.len()), "{text}");
    let pairs: u64 = bars
        .iter()
        .map(|bar| {
            bar.split_whitespace()
                .last()
                .unwrap()
                .parse::<u64>()
                .unwrap()
        })
        .sum();
    assert_eq!(pairs, 40, "{text}");
}
