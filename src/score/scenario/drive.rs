//! A scenario's `[drive]` table: the robot that an algorithm steers, the courses, and the steering
//! rule.

use super::Latency;
use serde::{Deserialize, Serialize};
use svl_core::matcher::Algorithm;
use svl_core::stereo::{CellState, GridShape};
use svl_core::{Error, Result};
use svl_sim::arena::{NumberRange, check_range, check_ranges, number_ranges};

/// The robot, its courses and its steering rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveConfig {
    /// The robot's body is an upright cylinder of this radius about the middle of the stereo head,
    pub radius_m: f64,
    /// and of this height: it passes below anything that hangs higher.
    pub height_m: f64,
    pub max_speed_m_per_s: f64,
    pub max_turn_deg_per_s: f64,
    /// The narrowest gap of a course.
    pub gap_m: f64,
    /// A clearance below this is a near miss.
    pub near_miss_m: f64,
    /// A robot that advances less than 0.1 m in this time is put back on the route.
    pub stuck_s: f64,
    /// Time from a pair's stamp until the command that is decided on it takes effect; without it
    /// the time from pair to pair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency_ms: Option<Latency>,
    pub steering: SteeringRule,
}

/// The parameters of the steering rule, `drive/steering.rs`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SteeringRule {
    /// Rows of the depth grid that it uses, from 0 at the top.
    pub rows: Vec<usize>,
    /// Part of a cell that it uses.
    pub part: CellPart,
    /// Interpretation of an unknown cell.
    pub unknown: CellStandsFor,
    /// Interpretation of a cell that a filter reports as too close.
    pub too_close: CellStandsFor,
    /// Interpretation of an unknown cell with something near, state `near`; as of other unknown
    /// ones unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near: Option<CellStandsFor>,
    /// Assumed distance of an obstacle in such cells, and in those of state `near`.
    pub assumed_m: f64,
    pub near_m: f64,
    /// Length of the paths that are checked.
    pub lookahead_m: f64,
    /// Distance kept from obstacles in addition to the radius; of nearer surfaces, in narrow
    /// columns, from their middle.
    pub margin_m: f64,
    /// The robot stops if its path is free for less than this,
    pub stop_m: f64,
    /// and turns until it is free for this.
    pub resume_m: f64,
    /// Distance for which it keeps the new direction before it steers for the goal again.
    pub detour_m: f64,
    /// Time for which obstacles are remembered.
    pub memory_s: f64,
    /// Weight of the direction to the goal relative to the free distance.
    pub goal_weight: f64,
}

/// The part of a cell that the rule uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CellPart {
    /// The median of its disparities.
    Median,
    /// Their 80th percentile: a nearer part.
    Near,
}

/// Interpretation of a cell without a distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CellStandsFor {
    /// Nothing is there.
    Free,
    /// An obstacle `assumed_m` away, which is not remembered.
    Obstacle,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            radius_m: 0.08,
            height_m: 0.12,
            max_speed_m_per_s: 0.3,
            max_turn_deg_per_s: 90.0,
            gap_m: 0.45,
            near_miss_m: 0.02,
            stuck_s: 6.0,
            latency_ms: None,
            steering: SteeringRule::default(),
        }
    }
}

impl Default for SteeringRule {
    fn default() -> Self {
        Self {
            rows: vec![1],
            part: CellPart::Median,
            unknown: CellStandsFor::Free,
            too_close: CellStandsFor::Obstacle,
            near: None,
            assumed_m: 0.2,
            near_m: 0.5,
            lookahead_m: 0.8,
            margin_m: 0.05,
            stop_m: 0.12,
            resume_m: 0.5,
            detour_m: 0.4,
            memory_s: 6.0,
            goal_weight: 0.5,
        }
    }
}

impl SteeringRule {
    /// Interpretation of a cell in that state; `None` for a known one.
    pub fn stands_for(&self, state: CellState) -> Option<CellStandsFor> {
        match state {
            CellState::Known | CellState::Far => None,
            CellState::TooClose => Some(self.too_close),
            CellState::Near => Some(self.near.unwrap_or(self.unknown)),
            _ => Some(self.unknown),
        }
    }
}

const RANGES: &[NumberRange<DriveConfig>] = number_ranges! {DriveConfig:
    radius_m in 0.01, 0.5;
    height_m in 0.01, 1.0;
    max_speed_m_per_s in 0.01, 5.0;
    max_turn_deg_per_s in 1.0, 720.0;
    gap_m in 0.05, 0.6;
    near_miss_m in 0.0, 0.5;
    stuck_s in 0.5, 60.0;
    steering.assumed_m in 0.01, 5.0;
    steering.near_m in 0.01, 5.0;
    steering.lookahead_m in 0.1, 5.0;
    steering.margin_m in 0.0, 0.5;
    steering.detour_m in 0.0, 5.0;
    steering.memory_s in 0.0, 60.0;
    steering.goal_weight in 0.0, 10.0;
};

impl DriveConfig {
    /// Most pairs of a drive.
    pub const MAX_FRAMES: u64 = 400;
    /// From the start of a course to its goal line.
    pub const LENGTH_M: f64 = 6.0;

    /// # Errors
    /// [`Error::Invalid`] with the first key whose number is out of range, or that contradicts
    /// another, or with a latency of none of `algorithms` and of no other.
    pub fn validate(
        &self,
        grid: GridShape,
        frames: u64,
        rate_hz: f64,
        algorithms: &[Algorithm],
    ) -> Result<()> {
        let SteeringRule {
            rows,
            stop_m,
            resume_m,
            lookahead_m,
            margin_m,
            ..
        } = &self.steering;
        check_ranges("drive.", self, RANGES)?;
        match &self.latency_ms {
            Some(Latency::Measured(_)) => {
                let words = "drive.latency_ms: expected milliseconds, or a table of them";
                return Err(Error::Invalid(words.to_owned()));
            }
            latency => latency
                .iter()
                .try_for_each(|own| own.validate("drive.latency_ms", algorithms))?,
        }
        check_range("drive.", "steering.stop_m", *stop_m, 0.0, *lookahead_m)?;
        check_range(
            "drive.",
            "steering.resume_m",
            *resume_m,
            *stop_m,
            *lookahead_m,
        )?;
        if rows.is_empty() || rows.iter().any(|row| *row >= grid.rows) {
            return Err(Error::Invalid(format!(
                "drive.steering.rows = {rows:?}: needs rows of the grid, 0 to {}",
                grid.rows - 1
            )));
        }
        let width_m = 2.0 * (self.radius_m + margin_m);
        if width_m > self.gap_m {
            return Err(Error::Invalid(format!(
                "drive: the robot with its margin is {width_m:.2} m wide, and the gaps of a course \
                 are {} m: make drive.radius_m or drive.steering.margin_m smaller, or drive.gap_m \
                 larger",
                self.gap_m
            )));
        }
        let reach_m = self.max_speed_m_per_s * frames as f64 / rate_hz;
        if reach_m < Self::LENGTH_M {
            return Err(Error::Invalid(format!(
                "drive: at drive.max_speed_m_per_s = {} the robot comes {reach_m:.1} m far in \
                 arena.frames = {frames} at arena.rate_hz = {rate_hz}, and a course has {} m",
                self.max_speed_m_per_s,
                Self::LENGTH_M
            )));
        }
        if frames > Self::MAX_FRAMES {
            return Err(Error::Invalid(format!(
                "arena.frames = {frames}: a drive has at most {}",
                Self::MAX_FRAMES
            )));
        }
        Ok(())
    }
}
