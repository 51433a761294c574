//! Maps as planes of codes for a viewer's images: 16-bit numbers with 0 for none, and 8-bit
//! classes.

use svl_core::Result;
use svl_core::stereo::{DisparityMap, Plane, Reason, Rig};

/// Codes per pixel of disparity, the resolution of StereoBM and SGM.
pub const CODES_PER_PX: f32 = 16.0;
/// Codes per unit of ln(SSDPI + 1).
pub const CODES_PER_LN: f32 = 8.0;

/// Disparities in 1/16 px.
pub fn disparity_codes(map: &Plane<f32>) -> Plane<u16> {
    map.map(|d| code(d, CODES_PER_PX))
}

/// Disparities in 1/16 px for pixels with a depth.
pub fn depth_codes(map: &Plane<f32>, rig: &Rig) -> Plane<u16> {
    map.map(|d| {
        if has_depth(d, rig) {
            code(d, CODES_PER_PX)
        } else {
            0
        }
    })
}

/// 1 for pixels without a depth.
pub fn no_depth_classes(map: &Plane<f32>, rig: &Rig) -> Plane<u8> {
    map.map(|d| u8::from(!has_depth(d, rig)))
}

/// The disparities of every `step`-th column and row from `nearest_px` on; infinity elsewhere.
///
/// # Errors
/// The errors of [`Plane::from_fn`].
pub fn sparse_disparities(map: &Plane<f32>, step: usize, nearest_px: f32) -> Result<Plane<f32>> {
    let (width, height) = map.size();
    Plane::from_fn(width, height, |x, y| {
        let disparity = map.get(x, y);
        if x % step == 0 && y % step == 0 && disparity >= nearest_px {
            disparity
        } else {
            f32::INFINITY
        }
    })
}

/// ln(SSDPI + 1) in eighths.
pub fn ssdpi_codes(map: &Plane<u32>) -> Plane<u16> {
    map.map(|s| match s {
        DisparityMap::NO_SSDPI => 0,
        s => code((s as f32).ln_1p(), CODES_PER_LN),
    })
}

/// The reasons by number.
pub fn reason_classes(map: &Plane<Reason>) -> Plane<u8> {
    map.map(|reason| reason as u8)
}

/// The lowest disparity of a map, pixels; `None` if no pixel has one.
pub fn lowest_disparity(map: &Plane<f32>) -> Option<f32> {
    map.pixels().filter(|d| d.is_finite()).reduce(f32::min)
}

/// True if the disparity is valid and nearer than infinity.
fn has_depth(disparity: f32, rig: &Rig) -> bool {
    disparity.is_finite() && rig.depth_m(disparity.into()).is_some()
}

/// A value as a code, clamped to the largest; 0 if there is none.
fn code(value: f32, per_unit: f32) -> u16 {
    if value.is_finite() {
        // 0 is also a valid value, whose code must not be that for none.
        (value * per_unit).round().clamp(1.0, u16::MAX.into()) as u16
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_disparity_is_no_depth_and_not_0() {
        let rig = Rig::new(328.0, (159.5, 119.5), 0.05, 0.0).unwrap();
        let has = [8.2, 0.0, f32::INFINITY].map(|d| has_depth(d, &rig));
        assert_eq!(has, [true, false, false]);
        let codes = [f32::NAN, 0.0, 2.0, 1e9].map(|value| code(value, 16.0));
        assert_eq!(codes, [0, 1, 32, u16::MAX]);
    }
}
