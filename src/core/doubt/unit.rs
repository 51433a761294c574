//! The unit of a truth's values, and the cure for a wrong one.

use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};

/// Meaning of the values in the files or messages of a truth, as an option behind their name says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TruthUnit {
    /// Depths, metres per step: `:unit=0.0002`.
    Depth(f32),
    /// Multiples of the disparity: `:disparity=256`.
    Disparity(f32),
}

impl Display for TruthUnit {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Depth(unit_m) => write!(f, "unit={}", rounded(unit_m.into())),
            Self::Disparity(scale) => write!(f, "disparity={}", rounded(scale.into())),
        }
    }
}

/// The cure for a truth whose distances should be `factor` times as long, or for the calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnitCure {
    /// A [usual] one, if one is near.
    pub factor: f64,
    pub option: UnitOption,
}

/// What gives the values of a truth another unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnitOption {
    /// `--truth` with that name and unit.
    Unit { name: String, unit: TruthUnit },
    /// A longer unit of the files of that pattern, whose own is not known.
    Longer { pattern: String, factor: f64 },
    /// Messages with distances times that.
    Distances { factor: f64 },
    /// Disparities divided by that.
    Disparities { factor: f64 },
}

/// Factors that programs and formats differ by.
const USUAL: [f64; 13] = [
    2.0, 3.0, FEET, 4.0, 5.0, 8.0, 10.0, 16.0, INCHES, 100.0, 256.0, 1000.0, 5000.0,
];
/// Feet and inches in a metre.
const FEET: f64 = 1.0 / 0.3048;
const INCHES: f64 = 1.0 / 0.0254;
/// Units of which there are that many in a metre.
const LENGTHS: [(f64, &str); 4] = [
    (FEET, "feet"),
    (INCHES, "inches"),
    (100.0, "centimetres"),
    (1000.0, "millimetres"),
];
/// A factor that differs less from a usual one is that.
const SAME: f64 = 0.015;
/// Factors that a wrong calibration explains too.
const CAUSES: [(f64, &str); 5] = [
    (
        2.0,
        "the calibration is of images of twice the size, or its baseline twice too long",
    ),
    (
        0.5,
        "the calibration is of images of half the size, or its baseline half too short",
    ),
    (
        100.0,
        "the baseline is in centimetres where metres are expected",
    ),
    (
        1000.0,
        "the baseline is in millimetres where metres are expected",
    ),
    (
        0.001,
        "the truth is in millimetres where metres are expected, or the baseline in kilometres",
    ),
];

impl Display for UnitCure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let factor = usual(self.factor);
        match CAUSES.iter().find(|(known, _)| *known == factor) {
            Some((_, cause)) => write!(f, "{}, or {cause}: --calib FILE", self.option),
            None => write!(f, "{}", self.option),
        }
    }
}

impl Display for UnitOption {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unit { name, unit } => write!(f, "likely --truth '{name}:{unit}'"),
            Self::Longer { pattern, factor } => write!(
                f,
                "likely a unit {} times as long, --truth '{pattern}:unit=METRES'",
                rounded(*factor)
            ),
            Self::Distances { factor } => {
                write!(f, "likely its distances times {}", rounded(*factor))?;
                let is_unit = |per_metre: f64| (per_metre * factor - 1.0).abs() < 1e-6;
                if let Some((_, name)) = LENGTHS.iter().find(|(length, _)| is_unit(*length)) {
                    write!(f, ", as they are in {name}")?;
                }
                f.write_str(": messages have metres, 16-bit images millimetres")
            }
            Self::Disparities { factor } => {
                write!(f, "likely its disparities divided by {}", rounded(*factor))
            }
        }
    }
}

/// The usual factor that a factor differs from by less than a fraction.
pub fn usual_within(factor: f64, fraction: f64) -> Option<f64> {
    let known = USUAL.into_iter().flat_map(|usual| [usual, 1.0 / usual]);
    let apart = |known: &f64| (factor.abs() / known - 1.0).abs();
    let near = known.min_by(|a, b| apart(a).total_cmp(&apart(b)));
    near.filter(|near| apart(near) < fraction)
}

/// The usual factor that is near, else the factor to two digits.
pub fn usual(factor: f64) -> f64 {
    let size = usual_within(factor, SAME).unwrap_or_else(|| {
        let digit = 10f64.powf(factor.abs().log10().floor() - 1.0);
        (factor.abs() / digit).round() * digit
    });
    size.copysign(factor)
}

/// A number without the noise of its last digits.
pub fn rounded(number: f64) -> String {
    if number != 0.0 && !(1e-9..1e15).contains(&number.abs()) {
        return format!("{number:.2e}");
    }
    // Zero has no sign.
    let number = number + 0.0;
    let digits = (5.0 - number.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{number:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_the_usual_ones_where_they_are_near() {
        for (factor, known) in [
            (253.0, 256.0),
            (251.0, 250.0),
            (0.000202, 0.0002),
            (-0.99e-3, -1e-3),
            (0.00392, 1.0 / 256.0),
            (0.0041, 0.0041),
            (3.7, 3.7),
            (1.234e-5, 1.2e-5),
        ] {
            assert!((usual(factor) / known - 1.0).abs() < 1e-9, "{factor}");
        }
        assert_eq!(
            [256.0, 0.0002, 1.5e-6, usual(0.00388)].map(rounded),
            ["256", "0.0002", "0.0000015", "0.00390625"]
        );
        assert_eq!(rounded(-0.0), "0");
    }
}
