//! Ranges of the arena's numbers, each on its own; combinations are checked where they are used.

use super::config::{ArenaConfig, RigConfig, RobotConfig, SensorConfig, WorldConfig};
use svl_core::{Error, Result};

/// Most blocks and balls, so that a set of them and the four walls fits 64 bits.
pub(super) const MAX_OBJECTS: usize = 60;

impl ArenaConfig {
    /// # Errors
    /// [`Error::Invalid`] with the first key whose number is out of range.
    pub(super) fn check(&self) -> Result<()> {
        let Self {
            frames,
            random: _,
            rate_hz,
            rig,
            sensor,
            robot,
            world,
        } = self;
        within("frames", *frames as f64, 1.0, 1.0e6)?;
        within("rate_hz", *rate_hz, 0.1, 1.0e4)?;
        rig.check()?;
        sensor.check(*rate_hz)?;
        robot.check()?;
        world.check()
    }
}

impl RigConfig {
    fn check(&self) -> Result<()> {
        within("rig.width_px", self.width_px as f64, 16.0, 4096.0)?;
        within("rig.height_px", self.height_px as f64, 16.0, 4096.0)?;
        within("rig.field_of_view_deg", self.field_of_view_deg, 5.0, 150.0)?;
        within("rig.baseline_m", self.baseline_m, 0.001, 1.0)?;
        within("rig.above_floor_m", self.above_floor_m, 0.005, 10.0)?;
        within(
            "rig.right_row_offset_px",
            self.right_row_offset_px,
            -20.0,
            20.0,
        )?;
        within("rig.right_roll_deg", self.right_roll_deg, -5.0, 5.0)?;
        Ok(())
    }
}

impl SensorConfig {
    fn check(&self, rate_hz: f64) -> Result<()> {
        within(
            "sensor.shutter_us",
            f64::from(self.shutter_us),
            1.0,
            // The exposure ends before the next one begins.
            1.0e6 / rate_hz,
        )?;
        within("sensor.gain_db", self.gain_db, -40.0, 60.0)?;
        within("sensor.right_gain_db", self.right_gain_db, -20.0, 20.0)?;
        within("sensor.white_e_per_ms", self.white_e_per_ms, 1.0e-3, 1.0e9)?;
        within("sensor.full_scale_e", self.full_scale_e, 1.0, 1.0e9)?;
        within("sensor.read_noise_e", self.read_noise_e, 0.0, 1.0e6)?;
        within("sensor.vignetting", self.vignetting, 0.0, 1.0)?;
        within("sensor.lens_blur_px", self.lens_blur_px, 0.0, 0.7)?;
        within("sensor.aperture_mm", self.aperture_mm, 0.0, 50.0)?;
        within("sensor.focus_m", self.focus_m, 0.01, 1.0e6)?;
        Ok(())
    }
}

impl RobotConfig {
    fn check(&self) -> Result<()> {
        within("robot.half_width_m", self.half_width_m, 0.0, 1.0)?;
        within("robot.sway_hz", self.sway_hz, 0.0, 20.0)?;
        within("robot.yaw_sway_deg", self.yaw_sway_deg, 0.0, 45.0)?;
        within("robot.roll_sway_deg", self.roll_sway_deg, 0.0, 45.0)?;
        within("robot.pitch_sway_deg", self.pitch_sway_deg, 0.0, 45.0)?;
        within("robot.deviation_m", self.deviation_m, 0.0, 1.0)?;
        for (i, point) in self.path.iter().enumerate() {
            place(&format!("robot.path[{i}].at_m"), point.at_m)?;
            within(
                &format!("robot.path[{i}].heading_deg"),
                point.heading_deg,
                -3600.0,
                3600.0,
            )?;
        }
        Ok(())
    }
}

impl WorldConfig {
    fn check(&self) -> Result<()> {
        within("world.width_m", self.width_m, 0.1, 20.0)?;
        within("world.length_m", self.length_m, 0.1, 20.0)?;
        within("world.wall_height_m", self.wall_height_m, 0.001, 10.0)?;
        within("world.room_margin_m", self.room_margin_m, 0.1, 20.0)?;
        within("world.forest_contrast", self.forest_contrast, 0.0, 10.0)?;
        within(
            "number of world.floor_patterns",
            self.floor_patterns.len() as f64,
            1.0,
            100.0,
        )?;
        within("world.floor_contrast", self.floor_contrast, 0.0, 1.0)?;
        within(
            "number of world.blocks and world.balls",
            (self.blocks.len() + self.balls.len()) as f64,
            0.0,
            MAX_OBJECTS as f64,
        )?;
        for block in &self.blocks {
            let key = |field: &str| format!("world.blocks '{}' {field}", block.name);
            place(&key("at_m"), block.at_m)?;
            for side in block.size_m {
                within(&key("size_m"), side, 0.001, 50.0)?;
            }
            within(&key("above_floor_m"), block.above_floor_m, 0.0, 10.0)?;
            within(&key("heading_deg"), block.heading_deg, -3600.0, 3600.0)?;
        }
        for ball in &self.balls {
            let key = |field: &str| format!("world.balls '{}' {field}", ball.name);
            place(&key("at_m"), ball.at_m)?;
            within(&key("radius_m"), ball.radius_m, 0.001, 10.0)?;
            within(&key("height_m"), ball.height_m, 0.0, 20.0)?;
        }
        Ok(())
    }
}

fn place(key: &str, at_m: [f64; 2]) -> Result<()> {
    at_m.into_iter()
        .try_for_each(|v| within(key, v, -100.0, 100.0))
}

fn within(key: &str, value: f64, from: f64, to: f64) -> Result<()> {
    if (from..=to).contains(&value) {
        Ok(())
    } else {
        Err(Error::Invalid(format!(
            "arena: {key} = {value} is outside {from} ..= {to}"
        )))
    }
}
