//! The programs of `examples/` run.

#[path = "../../examples/collisions.rs"]
mod collisions;
#[path = "../../examples/match_two_images.rs"]
mod match_two_images;
#[path = "../../examples/own_matcher.rs"]
mod own_matcher;
#[path = "../../examples/own_sink.rs"]
mod own_sink;
#[path = "../../examples/read_recording.rs"]
mod read_recording;
#[path = "../../examples/scale.rs"]
mod scale;
#[path = "../../examples/simulated_cameras.rs"]
mod simulated_cameras;
#[path = "../../src/core/examples/stop_for_obstacles.rs"]
mod stop_for_obstacles;

use super::cli::fixture::Fixture;

#[test]
fn collisions_are_compared_with_metrics() {
    let fixture = Fixture::new();
    let drives = "\"drives\": [{\"algorithm\": \"a\", \"collisions_per_100m\": 1}, {\"algorithm\": \
                  \"b:x=1\", \"collisions_per_100m\": 2}, {\"algorithm\": \"c\", \
                  \"collisions_per_100m\": 4}]";
    let algorithm = |label: &str, wrong: u32| {
        format!(
            "{{\"algorithm\": \"{label}\", \"pairs\": 10, \"cells_right\": 50, \"cells_wrong\": \
             {wrong}, \"cells_unknown\": 10, \"missed\": 2}}"
        )
    };
    let algorithms = [("a", 3), ("b:x=1", 5), ("c", 9)].map(|(label, n)| algorithm(label, n));
    let algorithms = algorithms.join(", ");
    let summary = format!("{{\"algorithms\": [{algorithms}], \"checkpoints\": [], {drives}}}");
    fixture.write("drive/summary.json", &summary);
    let folder = fixture.path("drive");
    let svg = collisions::figure(&folder, &folder).unwrap();
    // In perfect order by wrong cells.
    assert!(
        svg.contains("tau +1.00") && svg.contains("wrong cells, %"),
        "{svg}"
    );
    assert!(collisions::main().is_err());
}

#[test]
fn two_images_are_matched() {
    let fixture = Fixture::new();
    fixture.write_pair("left.pgm", "right.pgm", (120, 90), 5);
    let [left, right, map] = ["left.pgm", "right.pgm", "map.pfm"].map(|name| fixture.path(name));
    match_two_images::match_images(&left, &right, &map).unwrap();
    assert!(map.exists() && match_two_images::main().is_err());
}

#[test]
fn a_matcher_is_scored() {
    own_matcher::main().unwrap();
}

#[test]
fn a_sink_counts() {
    own_sink::main().unwrap();
}

#[test]
fn a_recording_is_read() {
    let fixture = Fixture::new();
    fixture.run("record arena --frames 3 -o a.mcap");
    assert_eq!(read_recording::read(&fixture.path("a.mcap")).unwrap(), 3);
    assert!(read_recording::main().is_err());
}

/// tests/c has what it prints.
#[test]
fn a_robot_stops() {
    stop_for_obstacles::main().unwrap();
}

#[test]
fn cameras_are_grabbed_from() {
    simulated_cameras::main().unwrap();
}

#[test]
fn growth_has_an_exponent() {
    let cubes = [1.0, 2.0, 4.0, 8.0].map(|x: f64| (x, 5.0 * x.powi(3)));
    assert!((scale::exponent(&cubes) - 3.0).abs() < 1e-12);
    let pair = scale::pair(80).unwrap();
    assert!(scale::matching_ms("bm", 16, &pair, 1).unwrap() > 0.0);
    assert!(scale::main().is_err());
}
