//! `svl info`.

use super::fixture::Fixture;

#[test]
fn says_what_a_recording_holds() {
    let fixture = Fixture::new();
    fixture
        .svl(&["record", "--frames", "4", "-o", "a.mcap"])
        .done();
    let text = fixture.svl(&["info", "a.mcap"]).done();
    for word in [
        "/stereo/left/image",
        "foxglove.RawImage",
        "/truth/depth",
        "arena",
    ] {
        assert!(text.contains(word), "{word} is not in:\n{text}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&fixture.svl(&["info", "a.mcap", "--json"]).done()).unwrap();
    assert!(json["damage"].is_null());
}

#[test]
fn a_cut_recording_is_called_so() {
    let fixture = Fixture::new();
    fixture
        .svl(&["record", "--frames", "4", "-o", "a.mcap"])
        .done();
    let bytes = std::fs::read(fixture.path("a.mcap")).unwrap();
    fixture.write("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
    let json: serde_json::Value =
        serde_json::from_str(&fixture.svl(&["info", "cut.mcap", "--json"]).done()).unwrap();
    assert!(json["damage"].is_string());
    fixture.write("empty.mcap", "");
    fixture
        .svl(&["info", "empty.mcap"])
        .failed(1, &["empty.mcap"]);
    fixture
        .svl(&["info", "missing.mcap"])
        .failed(1, &["missing.mcap"]);
}

#[test]
fn the_spread_of_the_skew_is_drawn() {
    let fixture = Fixture::new();
    let record = [
        "record",
        "sim:right.drift_ppm=2000,size=64x48,pictures=2",
        "--trigger",
        "free",
        "--frames",
        "40",
    ];
    fixture
        .svl(&[&record[..], &["-o", "a.mcap"]].concat())
        .done();
    let text = fixture.svl(&["info", "a.mcap"]).done();
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
