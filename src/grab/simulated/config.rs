//! What simulated cameras are asked for, as text: `size=640x480,right.arm_ms=40`.

use super::camera::Temper;
use crate::error::Error;
use crate::grab::Side;
use std::ops::RangeInclusive;
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
        Self {
            size: (640, 480),
            board: false,
            pictures: 60,
            light: 1.0,
            tempers: Default::default(),
        }
    }
}

const KEYS: &str = "size=WxH, scene=arena|board, pictures=N, light=X; for both cameras or after \
                    left. or right.: arm_ms, jitter_ms, transfer_ms, phase_ms, drift_ppm, \
                    damage_at, hang_at, disconnect_at";

/// Sides, number and bytes of all pictures: they have to fit into a computer.
const SIDES: RangeInclusive<usize> = 16..=4096;
const PICTURES: RangeInclusive<usize> = 1..=10_000;
const MAX_BYTES: usize = 1 << 30;

impl FromStr for SimulatedConfig {
    type Err = Error;

    /// Reads `key=value,…`; nothing is the default.
    fn from_str(text: &str) -> Result<Self, Error> {
        let mut config = Self::default();
        for setting in text.split(',').filter(|setting| !setting.is_empty()) {
            let (key, value) = setting.split_once('=').unwrap_or((setting, ""));
            let understood = config.set(key.trim(), value.trim());
            understood.map_err(|expected| {
                Error::Invalid(format!("sim: {setting}: expected {expected}"))
            })?;
        }
        let (width, height) = config.size;
        let bytes = 2 * width * height * config.pictures;
        if bytes > MAX_BYTES {
            let reason = format!(
                "sim: {} pictures of {width}x{height} are {bytes} bytes, at most {MAX_BYTES}: \
                 take fewer or smaller ones",
                config.pictures
            );
            return Err(Error::Invalid(reason));
        }
        Ok(config)
    }
}

impl SimulatedConfig {
    /// # Errors
    /// What was expected instead.
    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "size" => self.size = size(value)?,
            "scene" => {
                let scene = ["arena", "board"].iter().position(|scene| *scene == value);
                self.board = scene.ok_or("scene=arena or scene=board")? == 1;
            }
            "pictures" => {
                let pictures = value
                    .parse()
                    .ok()
                    .filter(|pictures| PICTURES.contains(pictures));
                self.pictures = pictures.ok_or_else(|| format!("a number, {}", span(&PICTURES)))?;
            }
            "light" => self.light = number(value, "a number", 1000.0)?,
            _ => {
                let (sides, key) = match key.split_once('.') {
                    Some(("left", key)) => (&[Side::Left][..], key),
                    Some(("right", key)) => (&[Side::Right][..], key),
                    _ => (&Side::BOTH[..], key),
                };
                sides.iter().try_for_each(|&side| {
                    set_temper(&mut self.tempers[side as usize], key, value)
                })?;
            }
        }
        Ok(())
    }
}

fn set_temper(temper: &mut Temper, key: &str, value: &str) -> Result<(), String> {
    let milliseconds = || number(value, "milliseconds", 60_000.0);
    let exposure = || {
        value
            .parse()
            .map(Some)
            .map_err(|_| "the number of an exposure, from 0".to_owned())
    };
    match key {
        "arm_ms" => temper.arm_ms = milliseconds()?,
        "jitter_ms" => temper.jitter_ms = milliseconds()?,
        "transfer_ms" => temper.transfer_ms = milliseconds()?,
        "phase_ms" => temper.phase_ms = milliseconds()?,
        "drift_ppm" => temper.drift_ppm = number(value, "parts in a million", 1e5)?,
        "damage_at" => temper.damage_at = exposure()?,
        "hang_at" => temper.hang_at = exposure()?,
        "disconnect_at" => temper.disconnect_at = exposure()?,
        _ => return Err(format!("one of {KEYS}")),
    }
    Ok(())
}

fn size(text: &str) -> Result<(usize, usize), String> {
    let side = |text: &str| text.parse().ok().filter(|side| SIDES.contains(side));
    let sides = text
        .split_once('x')
        .and_then(|(width, height)| Some((side(width)?, side(height)?)));
    sides.ok_or_else(|| format!("WxH in pixels, each {}", span(&SIDES)))
}

fn number(text: &str, what: &str, max: f64) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|number| (0.0..=max).contains(number))
        .ok_or_else(|| format!("{what}, 0 to {max}"))
}

fn span(range: &RangeInclusive<usize>) -> String {
    format!("{} to {}", range.start(), range.end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_of_both_cameras_or_of_one() {
        let config: SimulatedConfig = "size=320x240,arm_ms=5,right.arm_ms=40,left.hang_at=3,\
                                       light=0.5"
            .parse()
            .unwrap();
        assert_eq!((config.size, config.light), ((320, 240), 0.5));
        assert_eq!(config.tempers.clone().map(|t| t.arm_ms), [5.0, 40.0]);
        assert_eq!(config.tempers.map(|t| t.hang_at), [Some(3), None]);
        assert_eq!(
            "".parse::<SimulatedConfig>().unwrap(),
            SimulatedConfig::default()
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_what_was_expected() {
        for (wrong, expected) in [
            ("size=8x8", "WxH in pixels, each 16 to 4096"),
            ("size=100000x100000", "16 to 4096"),
            ("arm_ms=abc", "milliseconds, 0 to 60000"),
            ("right.jitter_ms=-1", "milliseconds, 0 to 60000"),
            ("drift_ppm=1e9", "parts in a million, 0 to 100000"),
            ("light=NaN", "a number, 0 to 1000"),
            ("pictures=99999999", "a number, 1 to 10000"),
            ("hang_at=-3", "the number of an exposure"),
            ("scene=moon", "scene=arena or scene=board"),
            ("arm_ms", "milliseconds"),
            ("up.arm_ms=3", "one of size=WxH"),
            ("x=1", "one of size=WxH"),
        ] {
            let error = wrong.parse::<SimulatedConfig>().unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("sim: {wrong}: expected ")) && error.contains(expected),
                "{error}"
            );
        }
        let error = "size=4096x4096,pictures=100"
            .parse::<SimulatedConfig>()
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("100 pictures of 4096x4096") && error.contains("at most"),
            "{error}"
        );
    }
}
