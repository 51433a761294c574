//! The arena of chapter 7 with aligned cameras, and still views built from its parts: a camera in
//! the middle of a large floor, and the objects in front of it.

use super::Context;
use svl_core::Result;
use svl_core::stereo::{Frame, GridShape};
use svl_score::judge::Judge;
use svl_sim::arena::{Arena, ArenaConfig, Ball, Block, RobotConfig, Waypoint, WorldConfig};

/// Position of the stereo head's centre; it faces along y.
const HEAD_M: [f64; 2] = [2.0, 1.0];

/// Seed of textures and noise.
pub(super) const SEED: u64 = 1;

/// The coarse grid, for still views.
pub(super) const GRID: GridShape = GridShape {
    columns: 6,
    rows: 3,
};

/// The judge of the coarse grid.
pub(super) fn judge() -> Judge {
    Judge {
        grid: GRID.into(),
        ..Judge::default()
    }
}

/// A run through the arena of chapter 7 with cameras that are aligned but for a row offset.
pub(super) fn aligned(right_row_offset_px: f64) -> Result<Arena> {
    let mut config = ArenaConfig::default();
    config.rig.right_row_offset_px = right_row_offset_px;
    // A rolled camera would add its own misalignment, which grows towards the sides.
    config.rig.right_roll_deg = 0.0;
    Arena::new(&config, SEED)
}

/// An empty arena of 4 m x 8 m around a stationary robot: forest walls of the usual height 2 m to
/// the side and 7 m ahead, the laboratory beyond them.
pub(super) fn empty() -> ArenaConfig {
    let [x, y] = HEAD_M;
    let ahead = |m: f64| Waypoint {
        at_m: [x, y + m],
        heading_deg: 90.0,
    };
    ArenaConfig {
        frames: 1,
        rate_hz: 1.0,
        robot: RobotConfig {
            half_width_m: 0.0,
            yaw_sway_deg: 0.0,
            roll_sway_deg: 0.0,
            pitch_sway_deg: 0.0,
            deviation_m: 0.0,
            // Two millimetres in a second: no blur.
            // The path needs two waypoints and a length.
            path: vec![ahead(0.0), ahead(0.002)],
            ..RobotConfig::default()
        },
        world: WorldConfig {
            width_m: 2.0 * x,
            length_m: 8.0,
            blocks: Vec::new(),
            balls: Vec::new(),
            ..WorldConfig::default()
        },
        ..ArenaConfig::default()
    }
}

/// A block whose nearest face or edge is `ahead_m` in front of the head, its centre `right_m` to
/// the right.
pub(super) fn block(ahead_m: f64, right_m: f64, size_m: [f64; 3], turned_deg: f64) -> Block {
    let (sin, cos) = turned_deg.to_radians().sin_cos();
    let half_m = 0.5 * (size_m[0] * sin.abs() + size_m[1] * cos.abs());
    Block {
        name: "block".into(),
        at_m: [HEAD_M[0] + right_m, HEAD_M[1] + ahead_m + half_m],
        size_m,
        above_floor_m: 0.0,
        heading_deg: turned_deg,
    }
}

/// A ball whose nearest point is `ahead_m` in front of the head, on the floor.
pub(super) fn ball(ahead_m: f64, right_m: f64, radius_m: f64) -> Ball {
    let at_m = [HEAD_M[0] + right_m, HEAD_M[1] + ahead_m + radius_m];
    Ball {
        name: "ball".into(),
        at_m,
        radius_m,
        height_m: radius_m,
    }
}

impl Context<'_> {
    /// A frame of an arena.
    pub(super) fn frame(&mut self, config: &ArenaConfig, index: u64) -> Result<Frame> {
        self.step()?;
        Arena::new(config, SEED)?.frame(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_sim::arena::RigConfig;

    #[test]
    fn a_block_stands_where_it_is_told() {
        let mut config = empty();
        config.rig = RigConfig {
            above_floor_m: 0.5,
            ..config.rig
        };
        for (turned_deg, size_m) in [(0.0, [0.4, 0.1, 1.0]), (90.0, [0.1, 0.4, 1.0])] {
            config.world.blocks = vec![block(0.8, 0.0, size_m, turned_deg)];
            let arena = Arena::new(&config, SEED).unwrap();
            let truth = arena
                .frame(0)
                .unwrap()
                .truth
                .unwrap()
                .disparity
                .get(160, 120);
            assert!(
                (f64::from(truth) - arena.rig().disparity_px(0.8)).abs() < 0.01,
                "{truth}"
            );
        }
    }
}
