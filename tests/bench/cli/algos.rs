//! `svl algos`.

use super::fixture::Fixture;

#[test]
fn lists_every_parameter_with_range_and_default() {
    let text = Fixture::new().run("algos");
    insta::assert_snapshot!(text);
}

#[test]
fn json_is_complete() {
    let text = Fixture::new().run("algos v3 --json");
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let parameters = json[0]["parameters"].as_array().unwrap();
    let max = parameters
        .iter()
        .find(|p| p["name"] == "max_disparity")
        .unwrap();
    assert_eq!((&max["default"], &max["unit"]), (&80.into(), &"px".into()));
}

#[test]
fn unknown_names_suggest_the_nearest() {
    Fixture::new()
        .svl("algos v33")
        .failed(2, &["unknown algorithm 'v33'", "did you mean 'v3'?"]);
}
