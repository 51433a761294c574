//! The unit of a truth's values: what an option says, and the one that would be likely.

use svl_core::doubt::{TruthUnit, UnitCure, UnitOption, usual};
use svl_core::stereo::TruthOrigin;
use svl_core::{Error, Result};

/// Units of depth images, metres per step.
const UNITS_M: std::ops::RangeInclusive<f32> = 1e-6..=1e3;
/// Multiples of a disparity that images store.
const SCALES: std::ops::RangeInclusive<f32> = 1e-3..=65536.0;
const MILLIMETRE: f32 = 0.001;
/// Splits the value of `--truth` into a topic or pattern and the unit.
///
/// # Errors
/// [`Error::Usage`] for an unknown option and an impossible unit.
pub fn split_unit(text: &str) -> Result<(&str, Option<TruthUnit>)> {
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
            .map(TruthUnit::Depth)
            .ok_or_else(|| usage("the unit is metres per step, as unit=0.001")),
        Some(("disparity", value)) => number(value, SCALES)
            .map(TruthUnit::Disparity)
            .ok_or_else(|| usage("disparity is what images multiply it by, as disparity=256")),
        _ => Err(usage("its option is unit=METRES or disparity=SCALE")),
    };
    unit.map(|unit| (name, Some(unit)))
}

/// The unit in which distances are `factor` times as long.
pub(super) fn times(unit: TruthUnit, factor: f64) -> TruthUnit {
    let times = |unit: f32| (f64::from(unit) * factor) as f32;
    match unit {
        TruthUnit::Depth(unit_m) => TruthUnit::Depth(times(unit_m)),
        TruthUnit::Disparity(scale) => TruthUnit::Disparity(times(scale)),
    }
}

/// The unit of depths in place of disparities, or of disparities in place of depths, where
/// distances are `step` times what it takes for disparities.
pub(super) fn other_kind(unit: TruthUnit, step: f64) -> TruthUnit {
    let other = match unit {
        TruthUnit::Depth(unit_m) => TruthUnit::Disparity(1.0 / unit_m),
        TruthUnit::Disparity(scale) => TruthUnit::Depth(1.0 / scale),
    };
    near(times(other, step))
}

/// The usual unit that is near.
pub(super) fn near(unit: TruthUnit) -> TruthUnit {
    let near = |unit: f32| usual(unit.into()) as f32;
    match unit {
        TruthUnit::Depth(unit_m) => TruthUnit::Depth(near(unit_m)),
        TruthUnit::Disparity(scale) => TruthUnit::Disparity(near(scale)),
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

/// The cure for a truth whose distances should be `factor` times as long.
pub(super) fn unit_cure(origin: &TruthOrigin, factor: f64) -> UnitCure {
    let option = match origin {
        TruthOrigin::Sensor(name) => {
            let (name, unit) = split_unit(name).unwrap_or((name, None));
            match unit.or_else(|| usual_unit(name)) {
                Some(unit) => UnitOption::Unit {
                    name: name.to_owned(),
                    unit: near(times(unit, factor)),
                },
                None if name.contains('*') => UnitOption::Longer {
                    pattern: name.to_owned(),
                    factor,
                },
                None => UnitOption::Distances { factor },
            }
        }
        TruthOrigin::Exact | TruthOrigin::Board(_) => UnitOption::Disparities { factor },
    };
    UnitCure { factor, option }
}

/// The cure for depths that are disparities times `factor`; `None` for disparities.
pub(super) fn disparity_cure(name: &str, factor: f64) -> Option<Option<UnitOption>> {
    let (name, unit) = split_unit(name).ok()?;
    let Some(unit) = unit.or_else(|| usual_unit(name)) else {
        return Some(None);
    };
    let option = UnitOption::Unit {
        name: name.to_owned(),
        unit: other_kind(unit, factor),
    };
    matches!(unit, TruthUnit::Depth(_)).then_some(Some(option))
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

/// The factor of distances, of the usual ones, that `is_likely`.
pub(super) fn likely(
    origin: &TruthOrigin,
    is_shorter: bool,
    is_likely: impl Fn(f64) -> bool,
) -> Option<f64> {
    let has_depths = match origin {
        TruthOrigin::Sensor(name) => {
            let unit = split_unit(name).ok().and_then(|(_, unit)| unit);
            !matches!(unit, Some(TruthUnit::Disparity(_)))
        }
        TruthOrigin::Exact | TruthOrigin::Board(_) => false,
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
        let split = |text| split_unit(text).map_err(|e| e.to_string());
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
            ("d/*.png", 3.9, "likely --truth 'd/*.png:unit=0.00390625'"),
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
            assert_eq!(unit_cure(&sensor(name), factor).option.to_string(), words);
        }
        for (factor, name) in [(0.305, "feet"), (0.0254, "inches"), (0.01, "centimetres")] {
            let words = unit_cure(&sensor("/depth"), usual(factor)).to_string();
            assert!(
                words.contains(&format!(", as they are in {name}")),
                "{words}"
            );
        }
        let words = unit_cure(&sensor("d/*.png"), 0.5).to_string();
        assert_eq!(
            words,
            "likely --truth 'd/*.png:unit=0.0005', or the calibration is of images of half the \
             size, or its baseline half too short: --calib FILE"
        );
        let option = disparity_cure("d/*.png", 0.2561).unwrap().unwrap();
        assert_eq!(option.to_string(), "likely --truth 'd/*.png:disparity=256'");
        assert_eq!(disparity_cure("/depth", 0.2561), Some(None));
        assert_eq!(
            unit_cure(&TruthOrigin::Exact, 256.0).to_string(),
            "likely its disparities divided by 256"
        );
    }
}
