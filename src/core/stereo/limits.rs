//! Limits beyond which a stereo calibration is refused: lengths of another unit, a wrong offset of
//! disparities.

use crate::error::{Error, Result};
use nalgebra::Matrix3x4;

/// Baselines of stereo cameras, metres. A shorter one is rounding, or in metres where millimetres
/// are expected; a longer one is in millimetres.
const BASELINES_M: std::ops::RangeInclusive<f64> = 0.0005..=30.0;
/// A shorter one is rounding.
const MIN_WRITTEN_M: f64 = 1e-6;
/// The factor between the units that are mistaken for each other.
const MILLI: f64 = 1000.0;
/// Greatest difference of `doffs` from the distance of the principal points, pixels.
const DOFFS_TOLERANCE_PX: f64 = 1.0;
/// Unit of a calibration's lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthUnit {
    Metres,
    /// Squares of a calibration board of unknown size: directions are correct, distances unknown.
    Squares,
}

/// Checks that a baseline is one of stereo cameras, if it is in metres.
///
/// # Errors
/// [`Error::Rig`] with the unit that would be likely.
pub(super) fn check_baseline(baseline: f64, unit: LengthUnit) -> Result<()> {
    if unit != LengthUnit::Metres || BASELINES_M.contains(&baseline) {
        return Ok(());
    }
    let (factor, is, expected) = if baseline > *BASELINES_M.end() {
        (1.0 / MILLI, "millimetres", "metres")
    } else {
        (MILLI, "metres", "millimetres")
    };
    let likely = baseline * factor;
    let likely = if BASELINES_M.contains(&likely) {
        format!(": likely {likely:.4} m, written in {is} where {expected} are expected")
    } else {
        String::new()
    };
    Err(Error::Rig(format!(
        "its baseline of {baseline:.3e} m is not between 0.5 mm and 30 m{likely}"
    )))
}

/// Checks that the offsets of two projections are focal length times baseline, where this is in
/// metres.
///
/// # Errors
/// [`Error::Rig`] for one that is likely the baseline itself.
#[doc(hidden)]
pub fn check_offsets(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Result<()> {
    let offset = left[(0, 3)] - right[(0, 3)];
    let baseline_m = offset / left[(0, 0)];
    let is_long = |metres: f64| metres >= *BASELINES_M.start();
    if baseline_m <= MIN_WRITTEN_M || is_long(baseline_m) || !is_long(offset) {
        return Ok(());
    }
    Err(Error::Rig(format!(
        "P has an offset of {:.4}, which makes a baseline of {baseline_m:.3e} m: the offset is \
         likely the baseline itself, {offset:.4} m, and has to be multiplied by the focal length",
        -offset
    )))
}

/// Checks that the offset of disparities is the distance of the principal points.
///
/// # Errors
/// [`Error::Rig`] if it is not.
#[doc(hidden)]
pub fn check_doffs(doffs_px: f64, left_cx_px: f64, right_cx_px: f64) -> Result<()> {
    let apart = right_cx_px - left_cx_px;
    // NaN fails the comparison.
    if (doffs_px - apart).abs() <= DOFFS_TOLERANCE_PX {
        return Ok(());
    }
    Err(Error::Rig(format!(
        "its doffs is {doffs_px} px, and its principal points are cx1 - cx0 = {apart:.3} px apart, \
         which is the same number: correct the wrong one, or all distances are wrong"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::Rig;

    #[test]
    fn a_baseline_of_another_unit_is_refused_with_the_likely_one() {
        let refusal = |metres: f64| {
            let rig = Rig::new(500.0, (319.5, 239.5), metres, 0.0);
            rig.err().map(|e| e.to_string()).unwrap_or_default()
        };
        for metres in [0.0005, 0.044, 1.0, 30.0] {
            assert_eq!(refusal(metres), "", "{metres}");
        }
        for (metres, words) in [
            (
                100.0,
                "likely 0.1000 m, written in millimetres where metres",
            ),
            (
                1.93e-4,
                "likely 0.1930 m, written in metres where millimetres",
            ),
            (1e9, "not between 0.5 mm and 30 m"),
        ] {
            let refusal = refusal(metres);
            assert!(refusal.contains(words), "{refusal}");
        }
        // P has the baseline where its product with the focal length is expected.
        let p = |offset: f64| {
            Matrix3x4::new(
                328.0, 0.0, 160.0, offset, 0.0, 328.0, 120.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            )
        };
        let by = |offset| check_offsets(&p(0.0), &p(offset));
        let refusal = by(-0.044).unwrap_err().to_string();
        assert!(
            refusal.contains("likely the baseline itself, 0.0440 m"),
            "{refusal}"
        );
        assert!(by(-0.044 * 328.0).is_ok());
        // Squares of a board are no metres.
        assert!(Rig::in_unit(500.0, (9.0, 9.0), 100.0, 0.0, LengthUnit::Squares).is_ok());
    }

    #[test]
    fn doffs_is_the_distance_of_the_principal_points() {
        assert!(check_doffs(31.086, 311.193, 342.279).is_ok());
        assert!(check_doffs(30.2, 311.193, 342.279).is_ok());
        for doffs_px in [0.0, 62.0, f64::NAN] {
            let refusal = check_doffs(doffs_px, 311.193, 342.279).unwrap_err();
            let words = "cx1 - cx0 = 31.086 px";
            assert!(refusal.to_string().contains(words), "{refusal}");
        }
    }
}
