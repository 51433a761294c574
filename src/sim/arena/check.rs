//! Ranges of the numbers of a configuration, as a table, and those of the arena: each number on its
//! own; combinations are checked where they are used.

use super::config::{ArenaConfig, Ball, Block, Waypoint};
use svl_core::{Error, Result};

/// A number of a `T`: its key, its value, and the least and the largest valid value.
pub type NumberRange<T> = (&'static str, fn(&T) -> f64, f64, f64);

/// A table of [`NumberRange`]s, a line each: the path of a field, and its range.
#[macro_export]
macro_rules! number_ranges {
    ($config:ty: $($($field:ident).+ $([$i:literal])? in $from:literal, $to:literal;)+) => {
        &[$((
            stringify!($($field).+),
            |config: &$config| config.$($field).+$([$i])? as f64,
            $from,
            $to,
        )),+]
    };
}
pub use number_ranges;

/// # Errors
/// [`Error::Invalid`] with `prefix` and the key of the first number that is out of its range.
pub fn check_ranges<T>(prefix: &str, numbers: &T, ranges: &[NumberRange<T>]) -> Result<()> {
    ranges
        .iter()
        .try_for_each(|(key, value, from, to)| check_range(prefix, key, value(numbers), *from, *to))
}

/// # Errors
/// The errors of [`check_ranges`].
pub fn check_range(prefix: &str, key: &str, value: f64, from: f64, to: f64) -> Result<()> {
    if (from..=to).contains(&value) {
        Ok(())
    } else {
        let words = format!("{prefix}{key} = {value} is outside {from} ..= {to}");
        Err(Error::Invalid(words))
    }
}

/// Most blocks and balls, so that a set of them and the four walls fits 64 bits.
pub(super) const MAX_OBJECTS: usize = 60;

const RANGES: &[NumberRange<ArenaConfig>] = number_ranges! {ArenaConfig:
    frames in 1.0, 1e6;
    rate_hz in 0.1, 1e4;
    rig.width_px in 16.0, 4096.0;
    rig.height_px in 16.0, 4096.0;
    rig.field_of_view_deg in 5.0, 150.0;
    rig.baseline_m in 0.001, 1.0;
    rig.above_floor_m in 0.005, 10.0;
    rig.right_row_offset_px in -20.0, 20.0;
    rig.right_roll_deg in -5.0, 5.0;
    sensor.gain_db in -40.0, 60.0;
    sensor.right_gain_db in -20.0, 20.0;
    sensor.white_e_per_ms in 1e-3, 1e9;
    sensor.full_scale_e in 1.0, 1e9;
    sensor.read_noise_e in 0.0, 1e6;
    sensor.vignetting in 0.0, 1.0;
    sensor.lens_blur_px in 0.0, 0.7;
    sensor.aperture_mm in 0.0, 50.0;
    sensor.focus_m in 0.01, 1e6;
    robot.half_width_m in 0.0, 1.0;
    robot.sway_hz in 0.0, 20.0;
    robot.yaw_sway_deg in 0.0, 45.0;
    robot.roll_sway_deg in 0.0, 45.0;
    robot.pitch_sway_deg in 0.0, 45.0;
    robot.deviation_m in 0.0, 1.0;
    world.width_m in 0.1, 20.0;
    world.length_m in 0.1, 20.0;
    world.wall_height_m in 0.001, 10.0;
    world.room_margin_m in 0.1, 20.0;
    world.forest_contrast in 0.0, 10.0;
    world.floor_contrast in 0.0, 1.0;
};

const WAYPOINT: &[NumberRange<Waypoint>] = number_ranges! {Waypoint:
    at_m[0] in -100.0, 100.0;
    at_m[1] in -100.0, 100.0;
    heading_deg in -3600.0, 3600.0;
};

const BLOCK: &[NumberRange<Block>] = number_ranges! {Block:
    at_m[0] in -100.0, 100.0;
    at_m[1] in -100.0, 100.0;
    size_m[0] in 0.001, 50.0;
    size_m[1] in 0.001, 50.0;
    size_m[2] in 0.001, 50.0;
    above_floor_m in 0.0, 10.0;
    heading_deg in -3600.0, 3600.0;
};

const BALL: &[NumberRange<Ball>] = number_ranges! {Ball:
    at_m[0] in -100.0, 100.0;
    at_m[1] in -100.0, 100.0;
    radius_m in 0.001, 10.0;
    height_m in 0.0, 20.0;
};

impl ArenaConfig {
    /// # Errors
    /// [`Error::Invalid`] with the first key whose number is out of range.
    pub(super) fn check(&self) -> Result<()> {
        let world = &self.world;
        check_ranges("arena: ", self, RANGES)?;
        let number = |key: &str, value: f64, from: f64, to: f64| {
            check_range("arena: ", key, value, from, to)
        };
        // The exposure ends before the next one begins.
        let shutter_us = self.sensor.shutter_us.into();
        number("sensor.shutter_us", shutter_us, 1.0, 1e6 / self.rate_hz)?;
        let patterns = world.floor_patterns.len() as f64;
        number("number of world.floor_patterns", patterns, 1.0, 100.0)?;
        let objects = (world.blocks.len() + world.balls.len()) as f64;
        let most = MAX_OBJECTS as f64;
        number("number of world.blocks and world.balls", objects, 0.0, most)?;
        for (i, point) in self.robot.path.iter().enumerate() {
            check_ranges(&format!("arena: robot.path[{i}]."), point, WAYPOINT)?;
        }
        for block in &world.blocks {
            let prefix = format!("arena: world.blocks '{}' ", block.name);
            check_ranges(&prefix, block, BLOCK)?;
        }
        for ball in &world.balls {
            let prefix = format!("arena: world.balls '{}' ", ball.name);
            check_ranges(&prefix, ball, BALL)?;
        }
        Ok(())
    }
}
