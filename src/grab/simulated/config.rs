//! What simulated cameras are asked for, as text: `size=640x480,right.arm_ms=40`.

use super::camera::Temper;
use crate::error::{Error, Result};
use crate::grab::Side;
use std::str::FromStr;

/// Two simulated cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedConfig {
    pub size: (usize, usize),
    /// A calibration board that is moved, instead of the arena.
    pub board: bool,
    /// Pictures rendered before, a second of them by default.
    pub pictures: usize,
    /// Brightness of the world, 1 as in the arena.
    pub light: f64,
    /// Of the left and of the right camera.
    pub tempers: [Temper; 2],
}

impl Default for SimulatedConfig {
    fn default() -> Self {
        Self { size: (640, 480), board: false, pictures: 60, light: 1.0, tempers: Default::default() }
    }
}

const KEYS: &str = "size=WxH, scene=arena|board, pictures=N, light=X; for both cameras or after left. or right.: arm_ms, jitter_ms, \
                    transfer_ms, phase_ms, drift_ppm, damage_at, hang_at, disconnect_at";

/// Longest side, and bytes of all pictures: they have to fit into a computer.
const MAX_SIDE: usize = 4096;
const MAX_BYTES: usize = 1 << 30;

impl FromStr for SimulatedConfig {
    type Err = Error;

    /// Reads `key=value,…`; nothing is the default.
    fn from_str(text: &str) -> Result<Self> {
        let mut config = Self::default();
        for setting in text.split(',').filter(|setting| !setting.is_empty()) {
            let understood = setting.split_once('=').and_then(|(key, value)| config.set(key.trim(), value.trim()));
            understood.ok_or_else(|| Error::Invalid(format!("sim: '{setting}' is none of {KEYS}")))?;
        }
        let (width, height) = config.size;
        let bytes = 2 * width * height * config.pictures;
        if bytes > MAX_BYTES {
            let reason =
                format!("sim: {} pictures of {width}x{height} are {bytes} bytes, at most {MAX_BYTES}", config.pictures);
            return Err(Error::Invalid(reason));
        }
        Ok(config)
    }
}

impl SimulatedConfig {
    fn set(&mut self, key: &str, value: &str) -> Option<()> {
        match key {
            "size" => {
                let (width, height) = value.split_once('x')?;
                self.size = (side_px(width)?, side_px(height)?);
            }
            "scene" => {
                self.board = ["arena", "board"].iter().position(|scene| *scene == value)? == 1;
            }
            "pictures" => self.pictures = value.parse().ok().filter(|n| (1..=10_000).contains(n))?,
            "light" => self.light = number(value, 1000.0)?,
            _ => {
                let (sides, key) = match key.split_once('.') {
                    Some(("left", key)) => (&[Side::Left][..], key),
                    Some(("right", key)) => (&[Side::Right][..], key),
                    _ => (&Side::BOTH[..], key),
                };
                sides.iter().try_for_each(|&side| set_temper(&mut self.tempers[side as usize], key, value))?;
            }
        }
        Some(())
    }
}

fn set_temper(temper: &mut Temper, key: &str, value: &str) -> Option<()> {
    const LONGEST_MS: f64 = 60_000.0;
    match key {
        "arm_ms" => temper.arm_ms = number(value, LONGEST_MS)?,
        "jitter_ms" => temper.jitter_ms = number(value, LONGEST_MS)?,
        "transfer_ms" => temper.transfer_ms = number(value, LONGEST_MS)?,
        "phase_ms" => temper.phase_ms = number(value, LONGEST_MS)?,
        "drift_ppm" => temper.drift_ppm = number(value, 1e5)?,
        "damage_at" => temper.damage_at = Some(value.parse().ok()?),
        "hang_at" => temper.hang_at = Some(value.parse().ok()?),
        "disconnect_at" => temper.disconnect_at = Some(value.parse().ok()?),
        _ => return None,
    }
    Some(())
}

fn side_px(text: &str) -> Option<usize> {
    text.parse().ok().filter(|side| (16..=MAX_SIDE).contains(side))
}

fn number(text: &str, max: f64) -> Option<f64> {
    text.parse().ok().filter(|number| (0.0..=max).contains(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_of_both_cameras_or_of_one() {
        let config: SimulatedConfig = "size=320x240,arm_ms=5,right.arm_ms=40,left.hang_at=3,light=0.5".parse().unwrap();
        assert_eq!((config.size, config.light), ((320, 240), 0.5));
        assert_eq!(config.tempers.clone().map(|t| t.arm_ms), [5.0, 40.0]);
        assert_eq!(config.tempers.map(|t| t.hang_at), [Some(3), None]);
        assert_eq!("".parse::<SimulatedConfig>().unwrap(), SimulatedConfig::default());
        for wrong in ["size=0x240", "arm_ms=-1", "light=NaN", "up.arm_ms=3", "arm_ms", "pictures=99999999", "x=1"] {
            let error = wrong.parse::<SimulatedConfig>().unwrap_err().to_string();
            assert!(error.contains(wrong) && error.contains("size=WxH"), "{error}");
        }
    }
}
