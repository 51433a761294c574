use crate::fixture::Fixture;

#[test]
fn says_what_a_recording_holds() {
    let fixture = Fixture::new();
    fixture.svl(&["record", "--frames", "4", "-o", "a.mcap"]).done();
    let text = fixture.svl(&["info", "a.mcap"]).done();
    for word in ["/stereo/left/image", "foxglove.RawImage", "/truth/depth", "arena"] {
        assert!(text.contains(word), "{word} is not in:\n{text}");
    }
    let json: serde_json::Value = serde_json::from_str(&fixture.svl(&["info", "a.mcap", "--json"]).done()).unwrap();
    assert!(json["damage"].is_null());
}

#[test]
fn a_cut_recording_is_called_so() {
    let fixture = Fixture::new();
    fixture.svl(&["record", "--frames", "4", "-o", "a.mcap"]).done();
    let bytes = std::fs::read(fixture.path("a.mcap")).unwrap();
    fixture.write("cut.mcap", &bytes[..bytes.len() * 9 / 10]);
    let json: serde_json::Value = serde_json::from_str(&fixture.svl(&["info", "cut.mcap", "--json"]).done()).unwrap();
    assert!(json["damage"].is_string());
    fixture.write("empty.mcap", "");
    fixture.svl(&["info", "empty.mcap"]).failed(1, &["empty.mcap"]);
    fixture.svl(&["info", "missing.mcap"]).failed(1, &["missing.mcap"]);
}
