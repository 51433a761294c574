//! Options of the simulated cameras: `size=640x480,right.arm_ms=40`.

use super::camera::CameraBehavior;
use crate::driver::{Driver, Setting};
use std::ops::RangeInclusive;
use svl_core::matcher::{Parameter, Range, Value};
use svl_core::{Error, Result};

/// Two simulated cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedConfig {
    /// Columns and rows.
    pub size: (usize, usize),
    /// True if they see a moving calibration board instead of the arena.
    pub board: bool,
    /// Number of pictures rendered in advance.
    pub pictures: usize,
    /// Brightness of the world, 1 as in the arena.
    pub light: f64,
    /// Behaviour of the left and of the right camera.
    pub behaviors: [CameraBehavior; 2],
}

impl Default for SimulatedConfig {
    fn default() -> Self {
        Self {
            size: (640, 480),
            board: false,
            pictures: 60,
            light: 1.0,
            behaviors: Default::default(),
        }
    }
}

const SIDES: RangeInclusive<usize> = 16..=4096;
/// Bytes of all pictures, which are kept in memory.
const MAX_BYTES: usize = 1 << 30;

pub(super) const OPTIONS: &[Parameter] = &[
    Parameter {
        name: "size",
        unit: "px",
        range: Range::Text { default: "640x480" },
        description: "width and height",
    },
    Parameter {
        name: "scene",
        unit: "",
        range: Range::Choice {
            default: "arena",
            options: &["arena", "board"],
        },
        description: "the arena, or a moving calibration board",
    },
    Parameter {
        name: "pictures",
        unit: "",
        range: Range::int(60, 1..=10_000),
        description: "pictures of the arena rendered in advance, at most one per pair",
    },
    Parameter {
        name: "light",
        unit: "",
        range: real(1.0, 1000.0),
        description: "brightness of the world, 1 as in the arena",
    },
];

pub(super) const CAMERA_OPTIONS: &[Parameter] = &[
    Parameter {
        name: "arm_ms",
        unit: "ms",
        range: real(2.0, 60_000.0),
        description: "time from the order until it is armed",
    },
    Parameter {
        name: "jitter_ms",
        unit: "ms",
        range: real(0.0, 60_000.0),
        description: "largest random time added to arm_ms",
    },
    Parameter {
        name: "transfer_ms",
        unit: "ms",
        range: real(2.0, 60_000.0),
        description: "time from the end of the exposure to the image",
    },
    Parameter {
        name: "phase_ms",
        unit: "ms",
        range: real(0.0, 60_000.0),
        description: "free-running: start of the first period",
    },
    Parameter {
        name: "drift_ppm",
        unit: "ppm",
        range: real(0.0, 1e5),
        description: "free-running: excess of its period",
    },
    Parameter {
        name: "damage_at",
        unit: "",
        range: EXPOSURE,
        description: "number of the image that is damaged, -1 for none",
    },
    Parameter {
        name: "hang_at",
        unit: "",
        range: EXPOSURE,
        description: "number of the image at which it hangs, -1 for none",
    },
    Parameter {
        name: "disconnect_at",
        unit: "",
        range: EXPOSURE,
        description: "number of the image at which it is unplugged, -1 for none",
    },
];

/// Images are counted from 0.
const EXPOSURE: Range = Range::int(-1, -1..=i32::MAX);

const fn real(default: f64, max: f64) -> Range {
    Range::Real {
        default,
        min: 0.0,
        max,
    }
}

impl SimulatedConfig {
    /// Parses `option=value,…`; options not given keep their defaults.
    pub(super) fn parse(driver: &Driver, text: &str) -> Result<Self> {
        let mut config = Self::default();
        let texts = text.split(',').filter(|text| !text.is_empty());
        for Setting { name, sides, value } in driver.settings(texts)? {
            match (name, value) {
                ("size", Value::Text(size)) => config.size = driver.size(&size, SIDES)?,
                ("scene", Value::Choice(scene)) => config.board = scene == "board",
                ("pictures", Value::Int(pictures)) => config.pictures = pictures as usize,
                ("light", Value::Real(light)) => config.light = light,
                (name, value) => sides
                    .iter()
                    .for_each(|&side| config.behaviors[side as usize].set(name, &value)),
            }
        }
        let (width, height) = config.size;
        // Two cameras, one byte per pixel.
        let bytes = 2 * width * height * config.pictures;
        if bytes > MAX_BYTES {
            return Err(Error::Usage(format!(
                "sim: {} pictures of {width}x{height} are {bytes} bytes, limit {MAX_BYTES}; use \
                 fewer or smaller ones",
                config.pictures
            )));
        }
        Ok(config)
    }
}

impl CameraBehavior {
    fn set(&mut self, name: &str, value: &Value) {
        let number = match *value {
            Value::Real(number) => number,
            Value::Int(number) => f64::from(number),
            _ => unreachable!("a camera's options are numbers"),
        };
        let exposure = (number >= 0.0).then_some(number as u64);
        match name {
            "arm_ms" => self.arm_ms = number,
            "jitter_ms" => self.jitter_ms = number,
            "transfer_ms" => self.transfer_ms = number,
            "phase_ms" => self.phase_ms = number,
            "drift_ppm" => self.drift_ppm = number,
            "damage_at" => self.damage_at = exposure,
            "hang_at" => self.hang_at = exposure,
            "disconnect_at" => self.disconnect_at = exposure,
            _ => unreachable!("option {name} has no field"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::DRIVER;
    use super::*;

    fn parse(text: &str) -> Result<SimulatedConfig> {
        SimulatedConfig::parse(&DRIVER, text)
    }

    #[test]
    fn options_are_of_both_cameras_or_of_one() {
        let config = parse("size=320x240,arm_ms=5,right.arm_ms=40,left.hang_at=3,light=0.5");
        let config = config.unwrap();
        assert_eq!((config.size, config.light), ((320, 240), 0.5));
        assert_eq!(config.behaviors.clone().map(|t| t.arm_ms), [5.0, 40.0]);
        assert_eq!(config.behaviors.map(|t| t.hang_at), [Some(3), None]);
        assert_eq!(parse("").unwrap(), SimulatedConfig::default());
    }

    #[test]
    fn the_table_has_the_defaults() {
        let options = OPTIONS.iter().chain(CAMERA_OPTIONS);
        let texts: Vec<_> = options
            .map(|option| format!("{}={}", option.name, option.range.default()))
            .collect();
        assert_eq!(parse(&texts.join(",")).unwrap(), SimulatedConfig::default());
    }

    #[test]
    fn errors_say_what_was_expected() {
        for (wrong, expected) in [
            ("size=8x8", "size=8x8 is not WxH in pixels, each 16 to 4096"),
            ("size=100000x100000", "16 to 4096"),
            ("arm_ms=abc", "arm_ms=abc is not a number in 0..=60000"),
            (
                "right.jitter_ms=-1",
                "jitter_ms=-1 is not a number in 0..=60000",
            ),
            ("drift_ppm=1e9", "a number in 0..=100000"),
            ("light=NaN", "a number in 0..=1000"),
            ("pictures=99999999", "a whole number in 1..=10000"),
            ("hang_at=-3", "a whole number in -1..="),
            ("scene=moon", "scene=moon is not one of arena, board"),
            ("arm_ms", "a number in 0..=60000"),
            ("up.arm_ms=3", "no option 'up.arm_ms'"),
            ("left.size=64x48", "no option 'left.size'"),
            (
                "x=1",
                "options are size, scene, pictures, light, or of both cameras or after",
            ),
            ("arm=1", "no option 'arm'"),
        ] {
            let error = parse(wrong).unwrap_err().to_string();
            assert!(
                error.starts_with("sim: ") && error.contains(expected),
                "{error}"
            );
        }
        let error = parse("size=4096x4096,pictures=100")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("100 pictures of 4096x4096") && error.contains("limit"),
            "{error}"
        );
    }
}
