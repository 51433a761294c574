//! What stands where in the thesis's arena, and the way through it: six stations, counterclockwise
//! from the lower right.
//!
//! The thesis gives the floor's area, the walls' height and what each station shows (chapter 7),
//! but figure 7.1 no measures: the places are ours, chosen so that from each station its subject
//! stands 0.3 m to 0.9 m away.

use super::config::{Ball, Block, Waypoint};

pub(super) fn blocks() -> Vec<Block> {
    let block = |name: &str, at_m, size_m, above_floor_m, heading_deg| Block {
        name: name.into(),
        at_m,
        size_m,
        above_floor_m,
        heading_deg,
    };
    vec![
        block("opening left", [1.295, 1.175], [0.41, 0.15, 0.2], 0.0, 0.0),
        block(
            "opening right",
            [1.8325, 1.175],
            [0.335, 0.15, 0.2],
            0.0,
            0.0,
        ),
        block("close block", [1.66, 1.865], [0.68, 0.17, 0.2], 0.0, 0.0),
        block(
            "slanted wall",
            [0.394, 0.292],
            [1.0, 0.02, 0.2],
            0.0,
            -36.87,
        ),
        block(
            "bridge right pillar",
            [1.31, 0.325],
            [0.12, 0.18, 0.14],
            0.0,
            0.0,
        ),
        block(
            "bridge left pillar",
            [1.31, 0.705],
            [0.12, 0.18, 0.14],
            0.0,
            0.0,
        ),
        block("bridge deck", [1.31, 0.515], [0.12, 0.56, 0.08], 0.14, 0.0),
    ]
}

pub(super) fn balls() -> Vec<Ball> {
    vec![Ball {
        name: "ball".into(),
        at_m: [0.964, 2.41],
        radius_m: 0.06,
        height_m: 0.06,
    }]
}

pub(super) fn path() -> Vec<Waypoint> {
    let way = [
        (1.60, 0.30, 90.0),
        (1.60, 1.15, 90.0),
        (1.525, 1.395, 120.0),
        (1.485, 1.465, 120.0),
        (1.25, 1.72, 130.0),
        (1.115, 1.925, 105.0),
        (1.085, 2.035, 105.0),
        (0.80, 2.23, 135.0),
        (0.71, 2.32, 135.0),
        (0.49, 2.40, 180.0),
        (0.20, 2.08, 265.0),
        (0.33, 1.50, 275.0),
        (0.33, 1.12, 270.0),
        (0.33, 0.90, 270.0),
        (0.70, 0.50, 360.0),
        (1.62, 0.50, 360.0),
    ];
    way.into_iter()
        .map(|(x, y, heading_deg)| Waypoint {
            at_m: [x, y],
            heading_deg,
        })
        .collect()
}
