//! The arena's objects: walls, blocks and balls, with their names.

use super::config::{Block, WorldConfig};
use super::solid::{FaceHit, Solid, Vec3};
use super::view::Candidates;

/// The four walls, then blocks, then balls, in the order of the configuration.
pub(super) struct Objects {
    names: Vec<String>,
    pub(super) solids: Vec<Solid>,
}

/// Walls of the arena: the first objects.
pub(super) const WALLS: usize = 4;
/// Thickness of the arena's walls.
const WALL_M: f64 = 0.02;

impl Objects {
    pub(super) fn new(world: &WorldConfig) -> Self {
        let walls = walls(world);
        let blocks = walls.iter().chain(&world.blocks);
        let names = blocks
            .clone()
            .map(|b| &b.name)
            .chain(world.balls.iter().map(|b| &b.name))
            .cloned()
            .collect();
        Self {
            names,
            solids: blocks
                .map(Solid::block)
                .chain(world.balls.iter().map(Solid::ball))
                .collect(),
        }
    }

    pub(super) fn named(&self) -> impl Iterator<Item = (&str, &Solid)> {
        self.names.iter().map(String::as_str).zip(&self.solids)
    }

    /// Everything that a ray from the camera enters, with indices. `set`: the candidates of the
    /// ray.
    pub(super) fn enter(
        &self,
        candidates: &Candidates,
        set: u64,
        direction: &Vec3,
    ) -> impl Iterator<Item = (usize, FaceHit)> {
        let hit = |i: usize| self.solids[i].enter(&candidates.from[i], direction);
        bits(set).filter_map(move |i| hit(i).map(|hit| (i, hit)))
    }

    /// True if one of them lies between the camera and the surface point `direction` away from it.
    pub(super) fn hide(&self, candidates: &Candidates, set: u64, direction: &Vec3) -> bool {
        // A hit in the last thousandth is the surface itself.
        self.enter(candidates, set, direction)
            .any(|(_, (t, _))| t < 0.999)
    }
}

/// The arena's walls, inner faces on the floor's border.
fn walls(world: &WorldConfig) -> [Block; 4] {
    let (w, l, h) = (world.width_m, world.length_m, world.wall_height_m);
    let wall = |name: &str, at_m, length: f64, heading_deg| Block {
        name: name.into(),
        at_m,
        size_m: [length + 2.0 * WALL_M, WALL_M, h],
        above_floor_m: 0.0,
        heading_deg,
    };
    let out = 0.5 * WALL_M;
    [
        wall("wall y=0", [0.5 * w, -out], w, 0.0),
        wall("wall x=max", [w + out, 0.5 * l], l, 90.0),
        wall("wall y=max", [0.5 * w, l + out], w, 180.0),
        wall("wall x=0", [-out, 0.5 * l], l, 270.0),
    ]
}

/// Positions of the bits that are set.
fn bits(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (set != 0).then(|| {
            let bit = set.trailing_zeros() as usize;
            set &= set - 1;
            bit
        })
    })
}
