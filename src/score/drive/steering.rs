//! The steering rule: from the depth grid to a speed and a turn.
//!
//! Arcs of several curvatures are evaluated, in the manner of the dynamic window approach (Fox,
//! Burgard and Thrun, "The Dynamic Window Approach to Collision Avoidance", IEEE Robotics and
//! Automation Magazine 1997): how far is each free of obstacles, and how well does it lead to the
//! goal? The rule knows only the cells, now and a few seconds ago, and its position at that time
//! from odometry; the goal is a direction.
//!
//! 1. A cell nearer than the lookahead is an obstacle as wide as its column; a nearer surface is
//!    narrower than that by the margin on each side. It is remembered, until it is too old, or a
//!    cell sees through it.
//! 2. The arc with the best sum of free distance and direction is taken, slower where it is free
//!    for less.
//! 3. Where no arc is free for `stop_m`, the robot turns on the spot, to the side that is free
//!    farther, until the way straight on is free for `resume_m`. It keeps that direction for
//!    `detour_m`, before it steers for the goal again; where it is blocked again on the way, it
//!    turns to the same side. Each further stop within a metre of the first doubles the detour, up
//!    to four times: so it leaves dead ends instead of circling in them.
//!
//! Departures from the paper: accelerations have no limit, and the arcs are a fixed set.

use super::motion::{DriveCommand, GroundPoint, RobotState};
use crate::scenario::{CellPart, CellStandsFor, DriveConfig};
use svl_core::stereo::{Cell, CellState, DepthGrid, Rig};

/// The rule with its memory.
pub struct Steering {
    config: DriveConfig,
    seen: Vec<Obstacle>,
    curvature_per_m: f64,
    avoidance: Avoidance,
    /// Position of the first stop, and the number of stops since within a metre.
    stops: Option<(GroundPoint, i32)>,
}

/// A point of an obstacle in the world.
#[derive(Clone, Copy)]
struct Obstacle {
    at: GroundPoint,
    time_s: f64,
}

/// Avoidance of a blocked path.
#[derive(Clone, Copy, PartialEq)]
enum Avoidance {
    None,
    /// Turns on the spot, 1 to the left or -1 to the right.
    Turning(f64),
    /// Keeps the new heading until it has come this far, having turned to that side.
    Detour {
        heading: f64,
        from: GroundPoint,
        side: f64,
    },
}

/// Curvatures to each side, and the largest, 1/m.
const ARCS: i32 = 8;
const MAX_CURVATURE: f64 = 4.0;
/// Distance between the points checked along an arc.
const STEP_M: f64 = 0.02;
/// An arc is checked until it has turned by this, radians.
const MAX_TURN: f64 = 1.8;
/// A cell sees through anything that is nearer than its distance by this much.
const THROUGH_M: f64 = 0.15;
/// Stops within this distance of the first belong to the same dead end.
const NEAR_M: f64 = 1.0;
const MAX_DOUBLINGS: i32 = 2;
/// Points across a column.
const POINTS: i32 = 3;

impl Steering {
    pub fn new(config: &DriveConfig) -> Self {
        Self {
            config: config.clone(),
            seen: Vec::new(),
            curvature_per_m: 0.0,
            avoidance: Avoidance::None,
            stops: None,
        }
    }

    /// The command after a frame taken by `robot`. `rig` is that of the images, `width_px` wide;
    /// `then` is the robot's state when the command takes effect, and `goal` the direction to go,
    /// radians.
    pub fn decide(
        &mut self,
        grid: &DepthGrid,
        (rig, width_px): (&Rig, usize),
        [robot, then]: [&RobotState; 2],
        goal: f64,
    ) -> DriveCommand {
        let rule = self.config.steering.clone();
        let mut obstacles = Vec::new();
        self.seen
            .retain(|seen| robot.time_s - seen.time_s <= rule.memory_s);
        for ((column, row), cell) in grid.iter() {
            if rule.rows.contains(&row) {
                let column = CellColumn::new(column, grid.shape().columns, rig, width_px);
                let found = read(cell, rule.part, rig);
                self.see(&column, found, cell, robot, &mut obstacles);
            }
        }
        obstacles.extend(self.seen.iter().map(|seen| seen.at));
        self.steer(&obstacles, then, goal)
    }

    /// Processes a cell's report: obstacles go into memory, or only into `obstacles`.
    fn see(
        &mut self,
        column: &CellColumn,
        known_m: Option<f64>,
        cell: &Cell,
        robot: &RobotState,
        obstacles: &mut Vec<GroundPoint>,
    ) {
        let rule = &self.config.steering;
        let surface_m = cell.surface.map(|surface| surface.distance_m);
        let points = |distance_m: f64| {
            // A surface is a part of its cell: the margin covers some of the rest.
            let is_part = surface_m == Some(distance_m);
            let margin_m = if is_part { rule.margin_m } else { 0.0 };
            let part = (margin_m / distance_m).min((column.right - column.left) / 2.0);
            let (left, right) = (column.left + part, column.right - part);
            (0..POINTS).map(move |i| {
                let share = f64::from(i) / f64::from(POINTS - 1);
                let slope = left + share * (right - left);
                robot.to_world(distance_m, -slope * distance_m)
            })
        };
        let known_m = known_m.map(|known_m| surface_m.map_or(known_m, |z| z.min(known_m)));
        let state = match cell.state() {
            // The surface flags it.
            CellState::Unknown if surface_m.is_some() => CellState::Near,
            state => state,
        };
        let stands_for = rule.stands_for(state);
        if let (Some(known_m), None) = (known_m, stands_for) {
            self.seen.retain(|seen| {
                let (ahead, left) = robot.to_robot(seen.at);
                let is_in_column =
                    ahead > 0.0 && (column.left..=column.right).contains(&(-left / ahead));
                !is_in_column || ahead + THROUGH_M > known_m
            });
            if known_m <= rule.lookahead_m + self.config.radius_m {
                let time_s = robot.time_s;
                let points = points(known_m);
                self.seen.extend(points.map(|at| Obstacle { at, time_s }));
            }
        } else if stands_for == Some(CellStandsFor::Obstacle) {
            let distance_m = match state {
                CellState::Near if rule.near.is_some() => surface_m.unwrap_or(rule.near_m),
                _ => rule.assumed_m,
            };
            obstacles.extend(points(distance_m));
        }
    }

    fn steer(&mut self, obstacles: &[GroundPoint], robot: &RobotState, goal: f64) -> DriveCommand {
        let DriveConfig {
            steering: rule,
            max_speed_m_per_s: speed,
            max_turn_deg_per_s: turn,
            ..
        } = &self.config;
        let turn = turn.to_radians();
        let on_the_spot = |side: f64| DriveCommand {
            speed_m_per_s: 0.0,
            turn_rad_per_s: side * turn,
        };
        let free = |curvature| free_m(&self.config, obstacles, robot, curvature);
        if let Avoidance::Turning(side) = self.avoidance {
            if free(0.0) < rule.resume_m {
                return on_the_spot(side);
            }
            self.avoidance = Avoidance::Detour {
                heading: robot.heading,
                from: robot.at,
                side,
            };
        }
        let mut aim = goal;
        let mut side = None;
        if let Avoidance::Detour {
            heading,
            from,
            side: turned,
        } = self.avoidance
        {
            let stops = self.stops.map_or(0, |(_, stops)| stops.min(MAX_DOUBLINGS));
            if (robot.at - from).norm() < rule.detour_m * 2f64.powi(stops) {
                aim = heading;
                side = Some(turned);
            } else {
                self.avoidance = Avoidance::None;
            }
        }
        let candidates = (-ARCS..=ARCS).map(|i| {
            let curvature = MAX_CURVATURE * f64::from(i) / f64::from(ARCS);
            let free_m = free(curvature);
            let end = robot.heading + curvature * free_m.min(0.5 * rule.lookahead_m);
            let score = free_m / rule.lookahead_m + rule.goal_weight * (end - aim).cos()
                // Among equal ones the one that changes least.
                - 0.01 * (curvature - self.curvature_per_m).abs();
            (score, curvature, free_m)
        });
        let candidates = candidates.filter(|(.., free_m)| *free_m >= rule.stop_m);
        let best = candidates.max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, curvature, free_m)) = best else {
            let side = side.unwrap_or_else(|| freer_side(&self.config, obstacles, robot, goal));
            self.avoidance = Avoidance::Turning(side);
            self.stops = match self.stops {
                Some((first, stops)) if (robot.at - first).norm() < NEAR_M => {
                    Some((first, stops + 1))
                }
                _ => Some((robot.at, 0)),
            };
            self.curvature_per_m = 0.0;
            return on_the_spot(side);
        };
        self.curvature_per_m = curvature;
        // Full speed if half of the lookahead is free, a fifth of it in front of an obstacle.
        let share = (free_m - rule.stop_m) / (0.5 * rule.lookahead_m);
        // Straight on the turn is no limit: infinite.
        let speed_m_per_s = (speed * share.clamp(0.2, 1.0)).min(turn / curvature.abs());
        DriveCommand {
            speed_m_per_s,
            turn_rad_per_s: curvature * speed_m_per_s,
        }
    }
}

/// Distance along an arc until the body with its margin would touch an obstacle, at most the
/// lookahead.
fn free_m(
    config: &DriveConfig,
    obstacles: &[GroundPoint],
    robot: &RobotState,
    curvature: f64,
) -> f64 {
    let rule = &config.steering;
    let keep_m = config.radius_m + rule.margin_m;
    // Anything nearer already must not come nearer still.
    let limits = obstacles.iter().map(|at| {
        let now_m = (at - robot.at).norm();
        (*at, keep_m.min(now_m - 1.0e-3))
    });
    let is_near =
        |(at, _): &(GroundPoint, f64)| (at - robot.at).norm() <= rule.lookahead_m + keep_m;
    let limits: Vec<_> = limits.filter(is_near).collect();
    let mut along_m = 0.0;
    while along_m < rule.lookahead_m && (curvature * along_m).abs() < MAX_TURN {
        let next_m = along_m + STEP_M;
        let at = robot.moved(next_m, curvature * next_m).at;
        if limits.iter().any(|(other, m)| (other - at).norm() < *m) {
            return along_m;
        }
        along_m = next_m;
    }
    rule.lookahead_m
}

/// The side with more room: 1 for the left, -1 for the right.
fn freer_side(
    config: &DriveConfig,
    obstacles: &[GroundPoint],
    robot: &RobotState,
    goal: f64,
) -> f64 {
    let room = |side: f64| -> f64 {
        let directions = (1..=6).map(|i| side * f64::from(i) * 0.3);
        let free = |by: f64| free_m(config, obstacles, &robot.turned(by), 0.0);
        directions.map(free).sum()
    };
    let (left, right) = (room(1.0), room(-1.0));
    if (left - right).abs() >= 0.1 {
        (left - right).signum()
    } else if (goal - robot.heading).sin() < 0.0 {
        // The side of the goal.
        -1.0
    } else {
        1.0
    }
}

/// The slopes spanned by a column of cells, to the right of the optical axis.
struct CellColumn {
    left: f64,
    right: f64,
}

impl CellColumn {
    fn new(column: usize, columns: usize, rig: &Rig, width_px: usize) -> Self {
        let slope = |column: usize| {
            let x = (column * width_px / columns) as f64 - 0.5;
            (x - rig.center_px().0) / rig.focal_px()
        };
        Self {
            left: slope(column),
            right: slope(column + 1),
        }
    }
}

/// The distance that the rule uses for a cell; infinite without a disparity.
fn read(cell: &Cell, part: CellPart, rig: &Rig) -> Option<f64> {
    let depth = cell.depth?;
    let px = match part {
        CellPart::Median => depth.median_px,
        CellPart::Near => depth.p80_px,
    };
    Some(rig.depth_m(f64::from(px)).unwrap_or(f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{CellDepth, GridShape, NearSurface};

    fn rig() -> Rig {
        Rig::new(328.0, (159.5, 119.5), 0.044, 0.0).unwrap()
    }

    /// A grid with these distances in its middle row, metres; 0 is unknown.
    fn grid(distances: [f64; 5]) -> DepthGrid {
        let cell = |(column, row): (usize, usize)| {
            let distance_m = distances[column];
            let px = rig().disparity_px(distance_m) as f32;
            Cell {
                valid_share: 1.0,
                depth: (row == 1 && distance_m > 0.0).then(|| CellDepth::at(px, Some(&rig()))),
                ..Cell::UNKNOWN
            }
        };
        let shape = GridShape::default();
        DepthGrid::new(shape, shape.iter().map(cell).collect()).unwrap()
    }

    fn at(time_s: f64) -> RobotState {
        RobotState {
            time_s,
            at: GroundPoint::new(0.0, 0.0),
            heading: 0.0,
        }
    }

    fn decide(steering: &mut Steering, distances: [f64; 5], time_s: f64) -> DriveCommand {
        let (rig, robot) = (rig(), at(time_s));
        steering.decide(&grid(distances), (&rig, 320), [&robot, &robot], 0.0)
    }

    #[test]
    fn a_free_way_is_taken_straight_at_full_speed() {
        let mut steering = Steering::new(&DriveConfig::default());
        let command = decide(&mut steering, [3.0; 5], 0.0);
        assert_eq!((command.speed_m_per_s, command.turn_rad_per_s), (0.3, 0.0));
    }

    #[test]
    fn it_turns_away_from_an_obstacle_on_one_side() {
        for (distances, sign) in [
            ([3.0, 3.0, 0.5, 0.4, 0.4], 1.0),
            ([0.4, 0.4, 0.5, 3.0, 3.0], -1.0),
        ] {
            let mut steering = Steering::new(&DriveConfig::default());
            let command = decide(&mut steering, distances, 0.0);
            assert!(sign * command.turn_rad_per_s > 0.1, "{command:?}");
            assert!(command.speed_m_per_s > 0.0);
        }
    }

    #[test]
    fn before_a_wall_it_turns_on_the_spot_until_the_way_is_free() {
        let mut steering = Steering::new(&DriveConfig::default());
        let command = decide(&mut steering, [0.2; 5], 0.0);
        assert_eq!(command.speed_m_per_s, 0.0);
        assert!(command.turn_rad_per_s.abs() > 1.0);
        // Less is free than needed to continue.
        let again = decide(&mut steering, [0.4; 5], 0.1);
        assert_eq!(again, command);
        let on = decide(&mut steering, [3.0; 5], 0.2);
        assert!(on.speed_m_per_s > 0.0, "{on:?}");
    }

    #[test]
    fn obstacles_are_remembered_until_they_are_old_or_seen_through() {
        let config = DriveConfig::default();
        let blocked = |steering: &mut Steering, distances, time_s| {
            decide(steering, distances, time_s).speed_m_per_s == 0.0
        };
        let mut steering = Steering::new(&config);
        assert!(blocked(&mut steering, [0.2; 5], 0.0));
        // Unknown cells are ignored.
        assert!(blocked(&mut steering, [0.0; 5], 1.0));
        assert!(!blocked(
            &mut steering,
            [0.0; 5],
            1.0 + config.steering.memory_s
        ));
        let mut steering = Steering::new(&config);
        assert!(blocked(&mut steering, [0.2; 5], 0.0));
        assert!(!blocked(&mut steering, [3.0; 5], 0.1));
    }

    #[test]
    fn unknown_and_too_close_cells_are_what_the_scenario_says() {
        let mut config = DriveConfig::default();
        assert!(decide(&mut Steering::new(&config), [0.0; 5], 0.0).speed_m_per_s > 0.0);
        config.steering.unknown = CellStandsFor::Obstacle;
        assert_eq!(
            decide(&mut Steering::new(&config), [0.0; 5], 0.0).speed_m_per_s,
            0.0
        );
        let mut close = grid([3.0, 3.0, 0.2, 3.0, 3.0]);
        close
            .cells_mut()
            .for_each(|cell| cell.too_close = cell.depth.is_some());
        for (stands_for, stops) in [
            (CellStandsFor::Obstacle, true),
            (CellStandsFor::Free, false),
        ] {
            config.steering.too_close = stands_for;
            config.steering.unknown = CellStandsFor::Free;
            let (rig, robot) = (rig(), at(0.0));
            let command = Steering::new(&config).decide(&close, (&rig, 320), [&robot, &robot], 0.0);
            assert_eq!(command.speed_m_per_s == 0.0, stops, "{stands_for:?}");
        }
    }

    #[test]
    fn the_nearer_of_two_surfaces_counts() {
        let surfaced = |distances, at_m: f64| {
            let mut grid = grid(distances);
            let surface = NearSurface {
                px: rig().disparity_px(at_m) as f32,
                distance_m: at_m,
                probability: 0.9,
            };
            grid.cells_mut()
                .for_each(|cell| cell.surface = Some(surface));
            grid
        };
        let (rig, robot) = (rig(), at(0.0));
        let mut config = DriveConfig::default();
        let speed = |config: &DriveConfig, grid: &DepthGrid| {
            let mut steering = Steering::new(config);
            let command = steering.decide(grid, (&rig, 320), [&robot, &robot], 0.0);
            command.speed_m_per_s
        };
        let far = speed(&config, &grid([3.0; 5]));
        assert!(speed(&config, &surfaced([3.0; 5], 0.2)) < far);
        // A cell without a distance is as one that is flagged, at the surface's distance.
        let unknown = surfaced([0.0; 5], 0.2);
        assert_eq!(speed(&config, &unknown), speed(&config, &grid([0.0; 5])));
        config.steering.near = Some(CellStandsFor::Obstacle);
        assert_eq!(speed(&config, &unknown), 0.0);
        // A narrow robot passes between two posts 16 cm apart, not two walls as wide as their
        // columns.
        (config.radius_m, config.steering.margin_m) = (0.02, 0.04);
        let mut posts = surfaced([3.0; 5], 0.4);
        let between = posts
            .cells_mut()
            .enumerate()
            .filter(|(i, _)| i % 5 % 2 == 0);
        between.for_each(|(_, cell)| cell.surface = None);
        let is_straight = |grid: &DepthGrid| {
            let mut steering = Steering::new(&config);
            let command = steering.decide(grid, (&rig, 320), [&robot, &robot], 0.0);
            command.turn_rad_per_s == 0.0
        };
        assert!(is_straight(&posts));
        assert!(!is_straight(&grid([3.0, 0.4, 3.0, 0.4, 3.0])));
    }

    #[test]
    fn a_cell_with_something_near_is_an_unknown_one_unless_the_scenario_says_more() {
        let mut flagged = grid([0.0; 5]);
        flagged.cells_mut().for_each(|cell| cell.near = Some(0.9));
        let (rig, robot) = (rig(), at(0.0));
        let mut config = DriveConfig::default();
        let mut speed = |near, unknown| {
            (config.steering.near, config.steering.unknown) = (near, unknown);
            let mut steering = Steering::new(&config);
            let command = steering.decide(&flagged, (&rig, 320), [&robot, &robot], 0.0);
            command.speed_m_per_s
        };
        use CellStandsFor::{Free, Obstacle};
        let free = speed(None, Free);
        assert_eq!(speed(Some(Free), Obstacle), free);
        // An obstacle at 0.5 m leaves room to turn, and one at the 0.2 m of an unknown cell does
        // not.
        assert!(speed(Some(Obstacle), Free) > 0.0);
        assert_eq!(speed(None, Obstacle), 0.0);
    }
}
