//! The verdict on programs that are no good: none is called best, and none is better than v5.
#![cfg(unix)]

use super::fixture::Fixture;
use svl::arena::Arena;
use svl::scenario::{Scenario, ScenarioSource};

const PAIRS: u64 = 120;

/// Answers each pair of 320 x 240 pixels with the map in a file.
const CONSTANT: &str = r#"
i=0
while read -r line; do
  i=$((i+1))
  head -c 153600 > /dev/null
  echo '{"seq":'$i',"millis":1}'
  cat NAME.bin
done
"#;

/// The maps of programs that always answer alike, by their names: a distance everywhere, nothing,
/// or one per pixel, the truth of the first pair.
fn constants(fixture: &Fixture) -> Vec<(&'static str, Vec<u8>)> {
    let scenario = Scenario::read(&fixture.write_short_arena("short.toml", 1)).unwrap();
    let ScenarioSource::Arena { config, .. } = &scenario.source else {
        panic!("the arena");
    };
    let frame = Arena::new(config, 1).unwrap().frame(0).unwrap();
    let px = |m: f64| frame.rig().unwrap().disparity_px(m) as f32;
    let distances = [
        ("near", px(0.2)),
        ("clear", px(0.74)),
        ("far", 0.0),
        ("unknown", f32::INFINITY),
    ];
    let mut maps = distances
        .map(|(name, px)| (name, px.to_le_bytes().repeat(320 * 240)))
        .to_vec();
    let first = frame.truth.as_ref().unwrap().disparity.pixels();
    maps.push(("first", first.flat_map(f32::to_le_bytes).collect()));
    maps
}

fn names<'a>(json: &'a serde_json::Value, key: &str) -> Vec<&'a str> {
    let own = json[key].as_array().map_or(&[][..], Vec::as_slice);
    let names = own.iter().filter_map(|best| best["algorithm"].as_str());
    names.collect()
}

#[test]
fn nothing_that_ignores_the_images_is_best_or_better_than_a_matcher() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", &format!("arena --frames {PAIRS} --seed 304"));
    // The last one answers in easy cells alone, and is right in nearly all that it knows.
    let mut line = "score a.mcap --rerun none -o r --algo v5 --algo sgm --algo v3 --algo \
                    easy=v5:confidence=0.999"
        .to_owned();
    let constants = constants(&fixture);
    for (name, map) in &constants {
        fixture.write(&format!("{name}.sh"), CONSTANT.replace("NAME", name));
        fixture.write(&format!("{name}.bin"), map);
        line += &format!(" --algo '{name}=exec:command=sh {name}.sh'");
    }
    let words = "\\nexact  | Best: v5 by  | exact distances | x may not be best";
    fixture.transcript(&format!("{line} => {words}"));
    let json = fixture.json_file("r/summary.json");
    let best = names(&json, "best");
    assert!(
        !best.is_empty() && best.iter().all(|label| *label == "v5"),
        "{best:?}"
    );
    // Programs that differ are no settings of one, as those of v5 are.
    let choices = json["choices"].as_array().unwrap();
    assert!(
        choices.len() == 1 && choices[0]["setting"]["label"] == "v5",
        "{choices:?}"
    );
    let references = json["references"].as_array().unwrap();
    let exact = references
        .iter()
        .find(|own| own["algorithm"] == "exact")
        .unwrap();
    let numbers = ["right", "wrong", "unknown", "false"].map(|name| exact[name].as_f64());
    assert_eq!(numbers, [1.0, 0.0, 0.0, 0.0].map(Some));
    assert!(exact["missed"].as_f64() > Some(0.0));
    let algorithms = json["algorithms"].as_array().unwrap();
    let falsely = |label: &str| {
        let own = algorithms.iter().find(|own| own["algorithm"] == label);
        own.unwrap()["false"].as_u64().unwrap()
    };
    assert_eq!((falsely("v5"), falsely("far")), (0, 0));
    assert!(falsely("clear") > 100 && falsely("clear") == falsely("near"));
    for base in ["v5", "sgm", "v3"] {
        let names = constants.iter().map(|own| own.0);
        for name in names.chain(["easy"]) {
            let compared = fixture.json(&format!("compare r#{base} r#{name} --json"));
            let conclusion = &compared[0]["conclusion"];
            assert_ne!(conclusion, "better", "{base} {name}");
        }
        let compared = fixture.json(&format!("compare r#{base} r#exact --json"));
        let changes = compared[0]["algorithms"][0]["metrics"].as_array().unwrap();
        let worse = changes.iter().filter(|own| own["judgement"] == "worse");
        let worse: Vec<_> = worse.filter_map(|own| own["metric"].as_str()).collect();
        assert!(
            worse.iter().all(|name| ["missed", "found"].contains(name)),
            "{worse:?}"
        );
    }
    // A mark equals the comparison with the best.
    for best in json["best"].as_array().unwrap() {
        let metric = &best["metric"];
        for other in best["others"].as_array().unwrap() {
            let label = other["algorithm"].as_str().unwrap();
            if metric == "time" {
                continue;
            }
            let base = best["algorithm"].as_str().unwrap();
            let compared = fixture.json(&format!("compare r#{base} r#{label} --json"));
            let changes = compared[0]["algorithms"][0]["metrics"].as_array().unwrap();
            let change = changes.iter().find(|own| own["metric"] == *metric).unwrap();
            let is_clear = other["certainty"] == "clear";
            assert_eq!(change["judgement"] == "worse", is_clear, "{change}");
        }
    }
}

#[test]
fn references_are_no_labels_and_floor_judges_nobody() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "arena --frames 8 --seed 3");
    // One pair tells nothing, and says so.
    fixture.transcript(
        "
        score a.mcap --algo prior=v3 => 2: 'prior' is a name of svl's own in reports; give 'v3'
        score a.mcap --algo exact=v3 => 2: 'exact' is a name of svl's own in reports
        compare a b --fail-on worse:floor => 2: 'floor' has no better direction, as it counts true
        score a.mcap --every 8 --algo v3 --algo bm --rerun none -o one \
        => Too few pairs to tell which is best
        compare one#v3 one#bm => too few pairs
        ",
    );
}
