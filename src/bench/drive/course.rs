//! Courses: random worlds by seed, with a route through them.
//!
//! A course is a room six metres from the start to the goal line, in which five sections follow
//! each other: corridors, blocks, balls, slanted walls, bridges and dead ends, in any order. Gaps
//! are at least as wide as the scenario says. Textures, floor and light vary with the seed.

use std::f64::consts::FRAC_PI_2;
use svl_core::Result;
use svl_score::drive::{GroundPoint, RobotState};
use svl_score::scenario::DriveConfig;
use svl_sim::arena::{ArenaConfig, ArenaWorld, Ball, Block, FloorPattern, Gait, WireObject};

/// A world with start, goal, and a route that leads there.
pub struct Course {
    pub seed: u64,
    pub(super) drive: DriveConfig,
    pub world: ArenaWorld,
    /// The way of the driver with perfect sight.
    route: Vec<RobotState>,
    /// Number of rejected layouts.
    pub rejected: u32,
}

/// Width of the room.
const WIDTH_M: f64 = 1.8;
const LENGTH_M: f64 = DriveConfig::LENGTH_M;
/// Before the start and behind the goal.
const MARGIN_M: f64 = 0.4;
/// Length of a section.
const SECTION_M: f64 = 1.1;
/// Beginning of the first section.
const FIRST_M: f64 = 0.95;
const SECTIONS: u32 = 5;

impl Course {
    /// A random layout, without a route.
    ///
    /// # Errors
    /// The errors of [`ArenaWorld::unpainted`].
    pub(super) fn draw(
        arena: &ArenaConfig,
        drive: &DriveConfig,
        seed: u64,
        attempt: u32,
    ) -> Result<Self> {
        let config = layout(arena, drive, seed, attempt);
        Ok(Self {
            seed,
            drive: drive.clone(),
            world: ArenaWorld::unpainted(&config, seed)?,
            route: Vec::new(),
            rejected: attempt,
        })
    }

    /// The course with its route, and painted.
    #[must_use]
    pub(super) fn with_route(mut self, route: Vec<RobotState>) -> Self {
        self.world.paint();
        Self { route, ..self }
    }

    /// The way of the driver with perfect sight, metres.
    pub fn route(&self) -> impl Iterator<Item = [f64; 2]> {
        self.route.iter().map(|state| state.at.into())
    }

    /// Closed outlines of the obstacles, metres.
    pub fn outlines(&self) -> Vec<Vec<[f64; 2]>> {
        self.world.plan(self.drive.height_m)
    }

    /// The outlines at the floor and at the robot's height, the route and the goal line, for a 3D
    /// viewer.
    pub fn wireframe(&self) -> Vec<WireObject> {
        let strip = |points: &mut dyn Iterator<Item = [f64; 2]>, z: f64| {
            points.map(|[x, y]| [x, y, z].map(|v| v as f32)).collect()
        };
        let obstacle = |outline: Vec<[f64; 2]>| {
            let closed = || outline.iter().chain(outline.first()).copied();
            let levels = [0.0, self.drive.height_m];
            WireObject {
                name: "obstacle".into(),
                strips: levels.map(|z| strip(&mut closed(), z)).into(),
            }
        };
        let line = |name: &str, points: &mut dyn Iterator<Item = [f64; 2]>| WireObject {
            name: name.to_owned(),
            strips: vec![strip(points, 0.0)],
        };
        let goal = [0.0, WIDTH_M].map(|x| [x, self.goal_m()]);
        let lines = [
            line("route", &mut self.route()),
            line("goal", &mut goal.into_iter()),
        ];
        let obstacles = self.outlines().into_iter().map(obstacle);
        obstacles.chain(lines).collect()
    }

    /// `y` of the goal line, metres.
    pub fn goal_m(&self) -> f64 {
        MARGIN_M + LENGTH_M
    }

    pub(super) fn gait(&self) -> Gait {
        Gait::new(self.world.config(), self.seed)
    }

    pub(super) fn start(&self) -> RobotState {
        RobotState {
            time_s: 0.0,
            at: GroundPoint::new(0.5 * WIDTH_M, MARGIN_M),
            heading: FRAC_PI_2,
        }
    }

    pub(super) fn frames(&self) -> u64 {
        self.world.config().frames
    }

    pub(super) fn rate_hz(&self) -> f64 {
        self.world.config().rate_hz
    }

    pub(super) fn frame_s(&self) -> f64 {
        1.0 / self.rate_hz()
    }

    pub(super) fn clearance_m(&self, at: GroundPoint) -> f64 {
        self.world.clearance(at.into(), self.drive.height_m).0 - self.drive.radius_m
    }

    /// Length of the route, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.length_to(self.route.len())
    }

    /// Length of the route up to its place that is nearest to `at`, metres.
    pub(super) fn along_m(&self, at: GroundPoint) -> f64 {
        self.length_to(self.nearest(at))
    }

    fn length_to(&self, place: usize) -> f64 {
        let steps = self.route.windows(2).take(place);
        steps.map(|pair| (pair[1].at - pair[0].at).norm()).sum()
    }

    /// The place of the route that is nearest to `at`.
    fn nearest(&self, at: GroundPoint) -> usize {
        let distance = |place: &usize| (self.route[*place].at - at).norm();
        let nearest = (0..self.route.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.unwrap_or_default()
    }

    /// The place of the route that is nearest to `at`, and `along_m` farther on.
    pub(super) fn route_after(&self, at: GroundPoint, along_m: f64) -> RobotState {
        let from = self.nearest(at);
        let mut left_m = along_m;
        for (i, pair) in self.route.windows(2).enumerate().skip(from) {
            left_m -= (pair[1].at - pair[0].at).norm();
            if left_m <= 0.0 {
                return self.route[i + 1];
            }
        }
        self.route.last().copied().unwrap_or_else(|| self.start())
    }
}

/// A random world.
fn layout(arena: &ArenaConfig, drive: &DriveConfig, seed: u64, attempt: u32) -> ArenaConfig {
    // The attempt is not part of the pictures' seed: they stay with the course.
    let mut dice = fastrand::Rng::with_seed(seed ^ (u64::from(attempt) << 48) ^ 0x5EED_C0DE);
    let mut config = arena.clone();
    let world = &mut config.world;
    world.width_m = WIDTH_M;
    world.length_m = LENGTH_M + 2.0 * MARGIN_M;
    world.blocks.clear();
    world.balls.clear();
    let mut sections: Vec<_> = SECTION_KINDS.to_vec();
    dice.shuffle(&mut sections);
    let mut things = Things {
        dice,
        gap_m: drive.gap_m,
        blocks: Vec::new(),
        balls: Vec::new(),
    };
    for (i, section) in (0..SECTIONS).zip(sections) {
        section(&mut things, FIRST_M + SECTION_M * f64::from(i));
    }
    (world.blocks, world.balls) = (things.blocks, things.balls);
    let dice = &mut things.dice;
    world.forest_contrast *= between(dice, 0.6, 1.1);
    world.floor_patterns = vec![dice.choice(PATTERNS).unwrap_or(FloorPattern::Linoleum)];
    world.floor_contrast *= between(dice, 0.5, 2.0);
    config.sensor.white_e_per_ms *= between(dice, 0.4, 1.2);
    config
}

const PATTERNS: [FloorPattern; 5] = [
    FloorPattern::Linoleum,
    FloorPattern::Noise,
    FloorPattern::Tiles,
    FloorPattern::Carpet,
    FloorPattern::Planks,
];

/// The obstacles of a section that begins at some `y`, metres.
type CourseSection = fn(&mut Things, f64);

const SECTION_KINDS: [CourseSection; 6] = [corridor, blocks, balls, slanted_wall, bridge, dead_end];

/// The obstacles of a course so far.
struct Things {
    dice: fastrand::Rng,
    gap_m: f64,
    blocks: Vec<Block>,
    balls: Vec<Ball>,
}

fn between(dice: &mut fastrand::Rng, from: f64, to: f64) -> f64 {
    from + (to - from) * dice.f64()
}

impl Things {
    fn between(&mut self, from: f64, to: f64) -> f64 {
        between(&mut self.dice, from, to)
    }

    fn block(&mut self, name: &str, at_m: [f64; 2], size_m: [f64; 3], heading_deg: f64) {
        self.blocks.push(Block {
            name: format!("{name} {}", self.blocks.len() + 1),
            at_m,
            size_m,
            above_floor_m: 0.0,
            heading_deg,
        });
    }

    /// A block from one `x` to another.
    fn wall(&mut self, name: &str, from_x: f64, to_x: f64, y: f64, thick_m: f64) {
        if to_x - from_x > 0.02 {
            let at_m = [0.5 * (from_x + to_x), y];
            self.block(name, at_m, [to_x - from_x, thick_m, 0.2], 0.0);
        }
    }
}

/// Two walls along the way, close together, and shoulders that lead into it.
fn corridor(things: &mut Things, from_m: f64) {
    let gap_m = things.gap_m + things.between(0.0, 0.15);
    let half = 0.5 * gap_m;
    let x = things.between(half + 0.15, WIDTH_M - half - 0.15);
    let y = from_m + 0.5;
    for side in [-1.0, 1.0] {
        let at_m = [x + side * (half + 0.03), y];
        things.block("corridor", at_m, [0.7, 0.06, 0.2], 90.0);
    }
    things.wall("shoulder", 0.0, x - half - 0.06, y - 0.32, 0.06);
    things.wall("shoulder", x + half + 0.06, WIDTH_M, y - 0.32, 0.06);
}

/// Scattered boxes.
fn blocks(things: &mut Things, from_m: f64) {
    let count = things.dice.u32(2..=3);
    let cell_m = WIDTH_M / f64::from(count);
    for i in 0..count {
        let side_m = things.between(0.12, (cell_m - things.gap_m).clamp(0.13, 0.3));
        let play_m = (cell_m - side_m - 0.5 * things.gap_m).max(0.0);
        let x = cell_m * f64::from(i) + 0.5 * cell_m + things.between(-0.5, 0.5) * play_m;
        let at_m = [x, from_m + things.between(0.25, 0.85)];
        let size_m = [side_m, things.between(0.1, 0.25), things.between(0.12, 0.3)];
        let heading_deg = things.between(-30.0, 30.0);
        things.block("block", at_m, size_m, heading_deg);
    }
}

fn balls(things: &mut Things, from_m: f64) {
    let count = things.dice.u32(2..=3);
    let cell_m = WIDTH_M / f64::from(count);
    for i in 0..count {
        let radius_m = things.between(0.06, 0.1);
        let play_m = (cell_m - 2.0 * radius_m - 0.5 * things.gap_m).max(0.0);
        let x = cell_m * f64::from(i) + 0.5 * cell_m + things.between(-0.5, 0.5) * play_m;
        let at_m = [x, from_m + things.between(0.25, 0.85)];
        things.balls.push(Ball {
            name: format!("ball {}", things.balls.len() + 1),
            at_m,
            radius_m,
            height_m: radius_m,
        });
    }
}

/// A wall from one side that leads the robot to a gap at the other.
fn slanted_wall(things: &mut Things, from_m: f64) {
    let is_left = things.dice.bool();
    let angle = things.between(15.0_f64, 40.0).to_radians();
    let gap_m = things.gap_m + things.between(0.05, 0.25);
    let reach_m = WIDTH_M - gap_m;
    let length_m = reach_m / angle.cos();
    // It begins at the wall, nearest to the start, and leads away.
    let x = if is_left {
        0.5 * reach_m
    } else {
        WIDTH_M - 0.5 * reach_m
    };
    let rise = 0.5 * length_m * angle.sin();
    let y = from_m + 0.1 + rise;
    let heading = if is_left { angle } else { -angle };
    let size_m = [length_m, 0.04, 0.2];
    things.block("slanted wall", [x, y], size_m, heading.to_degrees());
}

/// Two pillars with a deck, and walls beside them.
fn bridge(things: &mut Things, from_m: f64) {
    let gap_m = things.gap_m + things.between(0.0, 0.15);
    let half = 0.5 * gap_m;
    let x = things.between(half + 0.3, WIDTH_M - half - 0.3);
    let y = from_m + 0.5;
    for side in [-1.0, 1.0] {
        let at_m = [x + side * (half + 0.06), y];
        things.block("pillar", at_m, [0.12, 0.16, 0.16], 0.0);
    }
    things.block("deck", [x, y], [gap_m + 0.24, 0.14, 0.08], 0.0);
    if let Some(deck) = things.blocks.last_mut() {
        deck.above_floor_m = 0.16;
    }
    things.wall("wall", 0.0, x - half - 0.12, y, 0.06);
    things.wall("wall", x + half + 0.12, WIDTH_M, y, 0.06);
}

/// A pocket that opens to the start; the way out is beside it.
fn dead_end(things: &mut Things, from_m: f64) {
    let inside_m = things.gap_m + things.between(0.1, 0.25);
    let half = 0.5 * inside_m;
    let deep_m = things.between(0.25, 0.4);
    let is_left = things.dice.bool();
    // One side of it is free, the other may be narrow.
    let room_m = things.gap_m + things.between(0.05, 0.2);
    let x = if is_left {
        WIDTH_M - room_m - half - 0.04
    } else {
        room_m + half + 0.04
    };
    let y = from_m + 0.6;
    things.wall("dead end", x - half, x + half, y, 0.04);
    for side in [-1.0, 1.0] {
        let at_m = [x + side * (half + 0.02), y - 0.5 * deep_m + 0.02];
        things.block("side of a dead end", at_m, [deep_m, 0.04, 0.2], 90.0);
    }
}
