//! The unit of a truth's values: what an option says, and the one that would be likely.

use svl_core::stereo::TruthOrigin;
use svl_core::{Error, Result};

/// Units of depth images, metres per step.
const UNITS_M: std::ops::RangeInclusive<f32> = 1e-6..=1e3;
/// Multiples of a disparity that images store.
const SCALES: std::ops::RangeInclusive<f32> = 1e-3..=65536.0;
/// Factors that programs and formats differ by.
const USUAL: [f64; 13] = [
    2.0, 3.0, FEET, 4.0, 5.0, 8.0, 10.0, 16.0, INCHES, 100.0, 256.0, 1000.0, 5000.0,
];
const MILLIMETRE: f32 = 0.001;
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
const SAME: f64 = 0.06;

/// Meaning of the values in the files or messages of a truth, as an option behind their name says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TruthUnit {
    /// Depths, metres per step: `:unit=0.0002`.
    Depth(f32),
    /// Multiples of the disparity: `:disparity=256`.
    Disparity(f32),
}

impl TruthUnit {
    /// Splits the value of `--truth` into a topic or pattern and the unit.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown option and an impossible unit.
    pub fn split(text: &str) -> Result<(&str, Option<Self>)> {
        let Some((name, option)) = text.rsplit_once(':').filter(|(_, o)| o.contains('=')) else {
            return Ok((text, None));
        };
        let usage = |why: &str| Error::Usage(format!("--truth '{text}': {why}"));
        let number = |value: &str, range: std::ops::RangeInclusive<f32>| {
            let number = value.parse().ok();
            number.filter(|number| range.contains(number))
        };
        let unit = match option.split_once('=') {
            Some(("unit", value)) => number(value, UNITS_M)
                .map(Self::Depth)
                .ok_or_else(|| usage("the unit is metres per step, as unit=0.001")),
            Some(("disparity", value)) => number(value, SCALES)
                .map(Self::Disparity)
                .ok_or_else(|| usage("disparity is what images multiply it by, as disparity=256")),
            _ => Err(usage("its option is unit=METRES or disparity=SCALE")),
        };
        unit.map(|unit| (name, Some(unit)))
    }

    /// The unit in which distances are `factor` times as long.
    pub(super) fn times(self, factor: f64) -> Self {
        let times = |unit: f32| (f64::from(unit) * factor) as f32;
        match self {
            Self::Depth(unit_m) => Self::Depth(times(unit_m)),
            Self::Disparity(scale) => Self::Disparity(times(scale)),
        }
    }

    /// The unit of depths in place of disparities, or of disparities in place of depths, where
    /// distances are `step` times what it takes for disparities.
    pub(super) fn other_kind(self, step: f64) -> Self {
        let other = match self {
            Self::Depth(unit_m) => Self::Disparity(1.0 / unit_m),
            Self::Disparity(scale) => Self::Depth(1.0 / scale),
        };
        other.times(step).near()
    }

    /// The usual unit that is near.
    pub(super) fn near(self) -> Self {
        let near = |unit: f32| usual(unit.into()) as f32;
        match self {
            Self::Depth(unit_m) => Self::Depth(near(unit_m)),
            Self::Disparity(scale) => Self::Disparity(near(scale)),
        }
    }
}

/// The unit of the maps of `files:`, by the complete parameters in their source.
pub(super) fn unit_of_files(source: &str) -> Option<TruthUnit> {
    let (pattern, options) = source.strip_prefix("files:")?.split_once(",unit=")?;
    let (unit, scale) = options.split_once(",disparity=")?;
    let scale = scale.split(',').next()?;
    let ending = usual_unit(pattern);
    Some(match (unit.parse().ok()?, scale.parse().ok()?) {
        (0.0, 0.0) if ending == Some(TruthUnit::Depth(MILLIMETRE)) => TruthUnit::Disparity(256.0),
        (0.0, 0.0) => TruthUnit::Disparity(1.0),
        (0.0, scale) => TruthUnit::Disparity(scale),
        (unit, _) => TruthUnit::Depth(unit),
    })
}

impl std::fmt::Display for TruthUnit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Depth(unit_m) => write!(f, "unit={}", rounded(unit_m.into())),
            Self::Disparity(scale) => write!(f, "disparity={}", rounded(scale.into())),
        }
    }
}

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

/// The cure for a truth whose distances should be `factor` times as long, or for the calibration.
pub(super) fn cure(origin: &TruthOrigin, factor: f64) -> String {
    let unit = unit_cure(origin, factor);
    match CAUSES.iter().find(|(known, _)| *known == usual(factor)) {
        Some((_, cause)) => format!("{unit}, or {cause}: --calib FILE"),
        None => unit,
    }
}

/// The cure by another unit.
fn unit_cure(origin: &TruthOrigin, factor: f64) -> String {
    let mut lengths = LENGTHS.iter();
    let length = lengths.find(|(per_metre, _)| (per_metre * factor - 1.0).abs() < 1e-6);
    let length = length.map_or(String::new(), |(_, name)| {
        format!(", as they are in {name}")
    });
    let times = rounded(factor);
    match origin {
        TruthOrigin::Sensor(name) => {
            let (name, unit) = TruthUnit::split(name).unwrap_or((name, None));
            match unit.or_else(|| usual_unit(name)) {
                Some(unit) => format!("likely --truth '{name}:{}'", unit.times(factor)),
                None if name.contains('*') => {
                    format!("likely a unit {times} times as long, --truth '{name}:unit=METRES'")
                }
                None => format!(
                    "likely its distances times {times}{length}: messages have metres, 16-bit \
                     images millimetres"
                ),
            }
        }
        TruthOrigin::Exact | TruthOrigin::Reference(_) => {
            format!("likely its disparities divided by {times}")
        }
    }
}

/// The cure for depths that are disparities times `scale`.
pub(super) fn disparity_cure(name: &str, factor: f64) -> Option<String> {
    let (name, unit) = TruthUnit::split(name).ok()?;
    let Some(unit) = unit.or_else(|| usual_unit(name)) else {
        let cure = "likely disparities, which a topic has as stereo_msgs/DisparityImage";
        return Some(cure.to_owned());
    };
    let is_depth = matches!(unit, TruthUnit::Depth(_));
    is_depth.then(|| format!("likely --truth '{name}:{}'", unit.other_kind(factor)))
}

/// The unit of files by their extension, where it does not depend on their content.
fn usual_unit(name: &str) -> Option<TruthUnit> {
    let ending = name.rsplit_once('.')?.1.to_lowercase();
    match ending.as_str() {
        "png" | "tif" | "tiff" => Some(TruthUnit::Depth(MILLIMETRE)),
        "pfm" | "npz" => Some(TruthUnit::Depth(1.0)),
        _ => None,
    }
}

/// The usual factor that is near, else the factor to two digits.
pub(super) fn usual(factor: f64) -> f64 {
    let known = USUAL.into_iter().flat_map(|usual| [usual, 1.0 / usual]);
    let mut near = known.filter(|known| (factor.abs() / known - 1.0).abs() < SAME);
    let size = near.next().unwrap_or_else(|| {
        let digit = 10f64.powf(factor.abs().log10().floor() - 1.0);
        (factor.abs() / digit).round() * digit
    });
    size.copysign(factor)
}

/// A number without the noise of its last digits.
pub(super) fn rounded(number: f64) -> String {
    let digits = (5.0 - number.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{number:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The factor of distances, of the usual ones, that `is_likely`.
pub(super) fn likely(
    origin: &TruthOrigin,
    is_shorter: bool,
    is_likely: impl Fn(f64) -> bool,
) -> Option<f64> {
    let has_depths = match origin {
        TruthOrigin::Sensor(name) => {
            let unit = TruthUnit::split(name).ok().and_then(|(_, unit)| unit);
            !matches!(unit, Some(TruthUnit::Disparity(_)))
        }
        TruthOrigin::Exact | TruthOrigin::Reference(_) => false,
    };
    let factors = if has_depths {
        [1000.0, 5000.0, 256.0, 100.0, 1e6]
    } else {
        [256.0, 16.0, 1000.0, 100.0, 65536.0]
    };
    let mut factors = factors.into_iter();
    factors.find_map(|factor| {
        let factor = if is_shorter { 1.0 / factor } else { factor };
        is_likely(factor).then_some(factor)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_split_off_and_refused_in_words() {
        let split = |text| TruthUnit::split(text).map_err(|e| e.to_string());
        let depth = Some(TruthUnit::Depth(0.0002));
        assert_eq!(split("d/*.png:unit=0.0002"), Ok(("d/*.png", depth)));
        let kitti = Some(TruthUnit::Disparity(256.0));
        assert_eq!(split("d/*.png:disparity=256"), Ok(("d/*.png", kitti)));
        assert_eq!(split("/depth"), Ok(("/depth", None)));
        for (wrong, why) in [
            ("d/*.png:unit=mm", "metres per step"),
            ("d/*.png:unit=0", "metres per step"),
            ("d/*.png:disparity=-1", "as disparity=256"),
            ("d/*.png:scale=2", "unit=METRES or disparity=SCALE"),
        ] {
            let reason = split(wrong).unwrap_err();
            assert!(reason.contains(why), "{reason}");
        }
    }

    #[test]
    fn the_cure_is_the_unit_to_write() {
        let sensor = |name: &str| TruthOrigin::Sensor(name.to_owned());
        for (name, factor, words) in [
            ("d/*.png", 0.2, "likely --truth 'd/*.png:unit=0.0002'"),
            ("d/*.pfm", 0.001, "likely --truth 'd/*.pfm:unit=0.001'"),
            (
                "d/*.png:unit=1",
                0.001,
                "likely --truth 'd/*.png:unit=0.001'",
            ),
            (
                "d/*.png:disparity=1",
                256.0,
                "likely --truth 'd/*.png:disparity=256'",
            ),
            (
                "/depth",
                256.0,
                "likely its distances times 256: messages have metres, 16-bit images millimetres",
            ),
        ] {
            assert_eq!(unit_cure(&sensor(name), factor), words);
        }
        for (factor, name) in [(0.3, "feet"), (0.0254, "inches"), (0.01, "centimetres")] {
            let words = unit_cure(&sensor("/depth"), usual(factor));
            assert!(
                words.contains(&format!(", as they are in {name}")),
                "{words}"
            );
        }
        let words = cure(&sensor("d/*.png"), 0.5);
        assert_eq!(
            words,
            "likely --truth 'd/*.png:unit=0.0005', or the calibration is of images of half the \
             size, or its baseline half too short: --calib FILE"
        );
        let words = disparity_cure("d/*.png", 0.2561);
        assert_eq!(
            words.as_deref(),
            Some("likely --truth 'd/*.png:disparity=256'")
        );
        let words = disparity_cure("/depth", 0.2561);
        assert!(words.unwrap().contains("stereo_msgs/DisparityImage"));
        assert_eq!(
            cure(&TruthOrigin::Exact, 256.0),
            "likely its disparities divided by 256"
        );
    }

    #[test]
    fn factors_are_the_usual_ones_where_they_are_near() {
        for (factor, known) in [
            (251.0, 256.0),
            (0.00021, 0.0002),
            (-0.98e-3, -1e-3),
            (3.7, 3.7),
            (1.234e-5, 1.2e-5),
        ] {
            assert!((usual(factor) / known - 1.0).abs() < 1e-9, "{factor}");
        }
        assert_eq!(
            [256.0, 0.0002, 1.5e-6].map(rounded),
            ["256", "0.0002", "0.0000015"]
        );
    }
}
