//! Random worlds: boxes, thin stands, lattices of bars and plates in the air in rooms of all
//! contrasts, seen by cameras of many kinds from a random path.
//!
//! No algorithm's constants fit them all, so they show which results are the arena's alone. Every
//! number is rounded to a thousandth, so that the platform's sine and logarithm cannot change one.

use super::config::{
    ArenaConfig, Block, FloorPattern, RandomScenes, RigConfig, RobotConfig, SensorConfig, Waypoint,
    WorldConfig,
};
use super::noise::{Dice, NoiseStream};
use super::objects::Objects;
use super::path::Walk;
use super::solid::Solid;
use super::{check, check_clearance, heads};
use nalgebra::{Rotation2, Vector2};
use std::borrow::Cow;
use svl_core::{Error, Result};

/// Distance that objects keep from the path.
const CLEAR_M: f64 = 0.12;
/// Objects that are tried; about half of them keep clear of the path.
const TRIES: (f32, f32) = (10.0, 26.0);
/// Paths that are tried; nearly every first one is possible.
const PATHS: usize = 100;

/// Contrasts from 5 to 100 %, evenly spaced by their logarithm.
const CONTRASTS: [f64; 9] = [0.05, 0.07, 0.1, 0.15, 0.22, 0.32, 0.47, 0.68, 1.0];
/// The same of floors, which are plainer.
const FLOOR_CONTRASTS: [f64; 9] = [0.01, 0.016, 0.025, 0.04, 0.06, 0.1, 0.16, 0.25, 0.5];

/// Distance of a test piece from the end of the robot's path, and its places beside it.
const PIECE_AHEAD_M: f64 = 0.3;
const PIECE_ASIDE_M: [f64; 6] = [0.07, 0.11, 0.15, -0.07, -0.11, -0.15];

const FLOORS: [FloorPattern; 5] = [
    FloorPattern::Linoleum,
    FloorPattern::Noise,
    FloorPattern::Tiles,
    FloorPattern::Carpet,
    FloorPattern::Planks,
];

impl ArenaConfig {
    /// The configuration of the run with that seed: itself, or a random one.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the first key that has no meaning for random scenes.
    pub(super) fn for_seed(&self, seed: u64) -> Result<Cow<'_, Self>> {
        self.check_random()?;
        Ok(match self.random {
            None if self.pieces_m.is_empty() => Cow::Borrowed(self),
            None => Cow::Owned(self.with_piece(seed)),
            Some(RandomScenes::Worlds) => Cow::Owned(self.random_world(seed)?),
            Some(RandomScenes::Shapes | RandomScenes::Boards) => {
                let mut dice = Dice::new(seed, NoiseStream::World);
                Cow::Owned(self.random_head(&mut dice))
            }
        })
    }

    /// The arena with the test piece of a seed, ahead of the end of the robot's path.
    fn with_piece(&self, seed: u64) -> Self {
        let mut own = self.clone();
        let pieces = std::mem::take(&mut own.pieces_m);
        let count = pieces.len() as u64;
        let [width_m, height_m] = pieces[(seed % count) as usize];
        let depth_m = width_m.min(height_m);
        let aside_m = PIECE_ASIDE_M[(seed / count % PIECE_ASIDE_M.len() as u64) as usize];
        // Beside the path even if it is wide: its mirrored place is free.
        let edge_m = 0.5 * width_m + 0.05;
        let aside_m = if aside_m.abs() > edge_m {
            aside_m
        } else {
            (edge_m + aside_m.abs() / 3.0).copysign(aside_m)
        };
        if let Some(end) = own.robot.path.last() {
            let ahead = Rotation2::new(end.heading_deg.to_radians()) * Vector2::x();
            let right = Vector2::new(ahead.y, -ahead.x);
            let at =
                Vector2::from(end.at_m) + (PIECE_AHEAD_M + 0.5 * depth_m) * ahead + aside_m * right;
            own.world.blocks.push(Block {
                name: "piece".to_owned(),
                at_m: [at.x, at.y].map(|m| (1e3 * m).round() / 1e3),
                size_m: [width_m, depth_m, height_m],
                above_floor_m: 0.0,
                heading_deg: end.heading_deg - 90.0,
            });
        }
        own
    }

    /// Refuses keys that a random scene would override.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the first table that is not the default.
    pub fn check_random(&self) -> Result<()> {
        if self.random.is_none() {
            return Ok(());
        }
        let default = Self::default();
        let size = RigConfig {
            width_px: self.rig.width_px,
            height_px: self.rig.height_px,
            ..default.rig
        };
        let tables = [
            ("rig, besides width_px and height_px,", self.rig != size),
            ("sensor", self.sensor != default.sensor),
            ("robot", self.robot != default.robot),
            ("world", self.world != default.world),
        ];
        match tables.iter().find(|(_, differs)| *differs) {
            Some((table, _)) => Err(Error::Invalid(format!(
                "arena.{table} is drawn by each seed of random scenes; remove it"
            ))),
            None => Ok(()),
        }
    }

    /// This configuration with a random rig and sensor.
    fn random_head(&self, dice: &mut Dice) -> Self {
        let white_e_per_ms = number(dice, 400.0, 1700.0);
        Self {
            rig: RigConfig {
                width_px: self.rig.width_px,
                height_px: self.rig.height_px,
                field_of_view_deg: number(dice, 42.0, 70.0),
                baseline_m: number(dice, 0.035, 0.08),
                above_floor_m: number(dice, 0.05, 0.18),
                right_row_offset_px: number(dice, -0.5, 0.5),
                right_roll_deg: number(dice, -0.1, 0.1),
            },
            sensor: SensorConfig {
                gain_db: number(dice, -4.0, 3.0),
                right_gain_db: number(dice, -1.0, 1.0),
                white_e_per_ms,
                // White is half to all of the range at 0 dB.
                full_scale_e: rounded(8.0 * white_e_per_ms * number(dice, 1.0, 2.0)),
                read_noise_e: number(dice, 10.0, 40.0),
                vignetting: number(dice, 0.0, 0.5),
                lens_blur_px: number(dice, 0.3, 0.7),
                aperture_mm: number(dice, 0.5, 2.0),
                ..SensorConfig::default()
            },
            ..self.clone()
        }
    }

    fn random_world(&self, seed: u64) -> Result<Self> {
        let mut dice = Dice::new(seed, NoiseStream::World);
        let head = self.random_head(&mut dice);
        let empty = Self {
            random: None,
            robot: RobotConfig {
                pitch_sway_deg: 2.0,
                path: Vec::new(),
                ..RobotConfig::default()
            },
            world: WorldConfig {
                width_m: number(&mut dice, 1.6, 3.0),
                length_m: number(&mut dice, 2.2, 4.0),
                wall_height_m: number(&mut dice, 0.1, 0.5),
                room_margin_m: number(&mut dice, 0.5, 3.0),
                forest_contrast: one_of(&mut dice, &CONTRASTS),
                floor_patterns: FLOORS.to_vec(),
                floor_contrast: one_of(&mut dice, &FLOOR_CONTRASTS),
                blocks: Vec::new(),
                balls: Vec::new(),
            },
            ..head
        };
        let mut config = with_path(empty, seed, &mut dice)?;
        let walk = Walk::new(&config, seed)?;
        let tries = dice.between(TRIES.0, TRIES.1) as usize;
        for place in 1..=tries {
            let group = ObjectGroup::draw(&config.world, place, &mut dice);
            let fits = config.world.blocks.len() + group.0.len() <= check::MAX_OBJECTS;
            if fits && group.is_clear(&config.rig, &walk) {
                config.world.blocks.extend(group.0);
            }
        }
        Ok(config)
    }
}

/// Draws a path around the middle of the room, from quarter to quarter, until it keeps inside.
fn with_path(empty: ArenaConfig, seed: u64, dice: &mut Dice) -> Result<ArenaConfig> {
    let mut wrong = None;
    for _ in 0..PATHS {
        let mut config = empty.clone();
        config.robot.path = path(&config.world, dice);
        let walk = Walk::new(&config, seed)?;
        match check_clearance(&config, &walk, &Objects::new(&config.world)) {
            Ok(()) => return Ok(config),
            Err(e) => wrong = Some(e),
        }
    }
    let why = wrong.map_or_else(String::new, |e| format!(": {e}"));
    Err(Error::Invalid(format!(
        "arena: the random world of seed {seed} has no path{why}"
    )))
}

/// A point in each quarter of the room, in turn to one side; the robot looks to the next one.
fn path(world: &WorldConfig, dice: &mut Dice) -> Vec<Waypoint> {
    let mut quarters = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let first = dice.between(0.0, 4.0) as usize;
    quarters.rotate_left(first.min(3));
    if dice.chance(0.5) {
        quarters.reverse();
    }
    let points = quarters.map(|[x, y]| {
        let mut at = |side: f64, length_m: f64| {
            let inwards = number(dice, 0.15, 0.42);
            rounded(length_m * (side + inwards - 2.0 * side * inwards))
        };
        Vector2::new(at(x, world.width_m), at(y, world.length_m))
    });
    let waypoint = |i: usize| {
        let ahead = points[(i + 1) % points.len()] - points[i];
        Waypoint {
            at_m: points[i].into(),
            heading_deg: rounded(ahead.y.atan2(ahead.x).to_degrees()),
        }
    };
    (0..points.len()).map(waypoint).collect()
}

/// Blocks that belong together.
struct ObjectGroup(Vec<Block>);

impl ObjectGroup {
    fn draw(world: &WorldConfig, place: usize, dice: &mut Dice) -> Self {
        let at_m = [
            number(dice, 0.1, world.width_m - 0.1),
            number(dice, 0.1, world.length_m - 0.1),
        ];
        let heading_deg = number(dice, -90.0, 90.0);
        let block = |name: &str, size_m, above_floor_m| Block {
            name: format!("{name} {place}"),
            at_m,
            size_m,
            above_floor_m,
            heading_deg,
        };
        Self(match dice.between(0.0, 4.0) as usize {
            0 => {
                let size_m = sides(dice, [(0.05, 0.6), (0.02, 0.3), (0.05, 0.3)]);
                vec![block("box", size_m, 0.0)]
            }
            1 => {
                let size_m = sides(dice, [(0.01, 0.03), (0.01, 0.03), (0.1, 0.35)]);
                vec![block("stand", size_m, 0.0)]
            }
            2 => {
                let size_m = sides(dice, [(0.1, 0.4), (0.05, 0.2), (0.03, 0.1)]);
                let above_m = number(dice, 0.05, 0.2);
                vec![block("plate", size_m, above_m)]
            }
            _ => lattice(&block("lattice", [0.0; 3], 0.0), dice),
        })
    }

    /// True if all of it keeps clear of the path.
    fn is_clear(&self, rig: &RigConfig, walk: &Walk) -> bool {
        let solids: Vec<_> = self.0.iter().map(Solid::block).collect();
        heads(walk, rig).all(|(_, head)| {
            let mut distances = solids.iter().map(|solid| f64::from(solid.distance(&head)));
            distances.all(|distance_m| distance_m > CLEAR_M)
        })
    }
}

/// Vertical bars beside each other, and horizontal ones across them, about the place of `middle`.
fn lattice(middle: &Block, dice: &mut Dice) -> Vec<Block> {
    let pitch_m = number(dice, 0.025, 0.08);
    let bar_m = number(dice, 0.006, 0.02);
    let height_m = number(dice, 0.15, 0.3);
    let bars = dice.between(4.0, 12.0) as usize;
    let spacing_m = rounded(pitch_m * number(dice, 1.0, 3.0)).max(0.02);
    let along = Rotation2::new(middle.heading_deg.to_radians()) * Vector2::x();
    let bar = |i: usize| {
        let offset = along * (pitch_m * (i as f64 - 0.5 * (bars - 1) as f64));
        let [x, y] = middle.at_m;
        Block {
            name: format!("{} bar {}", middle.name, i + 1),
            at_m: [rounded(x + offset.x), rounded(y + offset.y)],
            size_m: [bar_m, bar_m, height_m],
            ..middle.clone()
        }
    };
    let across = |i: usize| Block {
        name: format!("{} rail {}", middle.name, i + 1),
        size_m: [pitch_m * bars as f64, bar_m, bar_m],
        above_floor_m: rounded(i as f64 * spacing_m),
        ..middle.clone()
    };
    let rails = (height_m / spacing_m) as usize + 1;
    (0..bars).map(bar).chain((0..rails).map(across)).collect()
}

fn sides(dice: &mut Dice, ranges_m: [(f32, f32); 3]) -> [f64; 3] {
    ranges_m.map(|(from, to)| rounded(f64::from(dice.between(from, to))))
}

/// A number in a range, rounded to a thousandth.
fn number(dice: &mut Dice, from: f64, to: f64) -> f64 {
    rounded(f64::from(dice.between(from as f32, to as f32)))
}

fn rounded(number: f64) -> f64 {
    (number * 1000.0).round() / 1000.0
}

fn one_of(dice: &mut Dice, numbers: &[f64]) -> f64 {
    let place = dice.between(0.0, numbers.len() as f32) as usize;
    numbers[place.min(numbers.len() - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arena::{Arena, ArenaWorld};

    fn random() -> ArenaConfig {
        ArenaConfig {
            random: Some(RandomScenes::Worlds),
            frames: 4,
            ..ArenaConfig::default()
        }
    }

    #[test]
    fn every_seed_is_a_world_of_its_own() {
        let worlds: Vec<_> = (1..=200)
            .map(|seed| random().for_seed(seed).unwrap().into_owned())
            .collect();
        for (world, seed) in worlds.iter().zip(1..) {
            // Also that the path is possible.
            assert!(!Arena::wireframe(world, seed).unwrap().is_empty());
            let drawn = ArenaWorld::unpainted(&random(), seed).unwrap();
            assert_eq!(drawn.config(), world);
            assert_eq!(*world, *random().for_seed(seed).unwrap());
        }
        for (a, b) in worlds.iter().zip(&worlds[1..]) {
            assert_ne!(a.world, b.world);
            assert_ne!(a.rig, b.rig);
        }
        let blocks = || worlds.iter().flat_map(|config| &config.world.blocks);
        for kind in ["box", "stand", "plate", "lattice"] {
            let count = blocks().filter(|b| b.name.starts_with(kind)).count();
            assert!(count > 100, "{kind}: {count}");
        }
        let plain = worlds.iter().filter(|c| c.world.forest_contrast < 0.2);
        assert!((50..150).contains(&plain.count()));
    }

    #[test]
    fn keys_of_a_fixed_world_are_refused() {
        let mut config = random();
        config.rig.width_px = 160;
        assert!(config.for_seed(1).is_ok());
        config.rig.baseline_m = 0.1;
        let words = config.for_seed(1).unwrap_err().to_string();
        assert!(words.contains("arena.rig"), "{words}");
        assert!(words.contains("random scenes"), "{words}");
    }
}
