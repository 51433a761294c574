//! Arena configurations: rejected ones, and the wireframe of valid ones.

use super::{ball, empty};
use svl::arena::{Arena, ArenaConfig, Ball, Block};

#[test]
fn bad_configurations_are_named() {
    let refused = |change: &dyn Fn(&mut ArenaConfig), words: &str| {
        let mut config = ArenaConfig::default();
        change(&mut config);
        let error = Arena::new(&config, 1)
            .err()
            .unwrap_or_else(|| panic!("{words}: accepted"))
            .to_string();
        assert!(
            error.contains(words) && !error.contains('\n'),
            "'{error}' does not say '{words}'"
        );
    };
    refused(&|c| c.frames = 0, "frames = 0");
    refused(&|c| c.rate_hz = f64::NAN, "rate_hz = NaN");
    refused(&|c| c.rig.baseline_m = -0.1, "rig.baseline_m = -0.1");
    refused(&|c| c.rig.width_px = 0, "rig.width_px = 0");
    refused(
        &|c| c.rig.field_of_view_deg = 180.0,
        "rig.field_of_view_deg = 180",
    );
    refused(
        &|c| c.sensor.shutter_us = 200_000,
        "sensor.shutter_us = 200000",
    );
    refused(&|c| c.sensor.full_scale_e = 0.0, "sensor.full_scale_e = 0");
    refused(
        &|c| c.world.blocks[0].size_m[1] = 0.0,
        "'opening left' size_m = 0",
    );
    refused(
        &|c| c.world.balls = vec![ball(); 61],
        "number of world.blocks and world.balls = 68",
    );
    refused(&|c| c.robot.path.truncate(1), "robot.path has 1 points");
    refused(
        &|c| c.robot.path[1] = c.robot.path[0],
        "robot.path[0] and the next point",
    );
    refused(&|c| c.world.balls[0].at_m = [1.6, 0.8], "to 'ball' at (1.6");
    refused(&|c| c.world.width_m = 1.5, "robot.path");
    refused(
        &|c| c.robot.half_width_m = 0.2,
        "robot.half_width_m = 0.2 to",
    );
}

#[test]
fn the_wireframe_shows_everything_that_stands_there() {
    let mut config = empty();
    config.world.balls = vec![Ball {
        at_m: [1.5, 1.2],
        ..ball()
    }];
    config.world.blocks = vec![Block {
        name: "block".into(),
        at_m: [0.4, 2.0],
        size_m: [0.2, 0.4, 0.3],
        above_floor_m: 0.1,
        heading_deg: 90.0,
    }];
    let wires = Arena::wireframe(&config, 1).unwrap();
    let names: Vec<&str> = wires.iter().map(|w| w.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "floor",
            "wall y=0",
            "wall x=max",
            "wall y=max",
            "wall x=0",
            "block",
            "ball",
            "path"
        ]
    );
    let points: Vec<[f32; 3]> = wires[5].strips.concat();
    // The object's length of 0.2 m lies along y.
    for (axis, (low, high)) in [(0.2, 0.6), (1.9, 2.1), (0.1, 0.4)].into_iter().enumerate() {
        let values = points.iter().map(|p| p[axis]);
        let (from, to) = (
            values.clone().fold(f32::MAX, f32::min),
            values.fold(f32::MIN, f32::max),
        );
        assert!(
            (from - low).abs() < 1e-6 && (to - high).abs() < 1e-6,
            "axis {axis}: {from} to {to}"
        );
    }
}
