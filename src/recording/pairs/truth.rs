//! True disparities as depths, and back.

use svl_core::stereo::{Plane, Rig};

/// Depths of the disparities in metres: NaN for invalid pixels, `+∞` at infinity. `None` if some
/// disparity is beyond infinity (`d + doffs < 0`), as no depth represents that.
///
/// The disparity of a 32-bit depth is exact to 2⁻²³ of `d + doffs`: 0.0001 px at 1000 px.
pub(crate) fn depths(disparity: &Plane<f32>, rig: &Rig) -> Option<Plane<f32>> {
    let beyond = |d: f32| d.is_finite() && f64::from(d) + rig.doffs_px() < 0.0;
    if disparity.pixels().any(beyond) {
        return None;
    }
    Some(disparity.map(|d| {
        if d.is_finite() {
            // d + doffs = 0 is a point at infinity; less was rejected above.
            rig.depth_m(d.into()).unwrap_or(f64::INFINITY) as f32
        } else {
            f32::NAN
        }
    }))
}

/// Disparities of the depths in pixels, `+∞` for invalid pixels; a depth of `+∞` is at infinity. A
/// negative depth has a disparity beyond infinity.
pub fn disparities(depth: &Plane<f32>, rig: &Rig) -> Plane<f32> {
    depth.map(|z| {
        // That is false for NaN, which is invalid.
        if z.abs() > 0.0 {
            rig.disparity_px(z.into()) as f32
        } else {
            f32::INFINITY
        }
    })
}

/// Disparities for a file: NaN for invalid pixels, as in ROS.
pub(crate) fn to_file(disparity: &Plane<f32>) -> Plane<f32> {
    disparity.map(|d| if d.is_finite() { d } else { f32::NAN })
}

/// Disparities from a file: `+∞` for invalid pixels.
pub(crate) fn from_file(disparity: &Plane<f32>) -> Plane<f32> {
    disparity.map(|d| if d.is_finite() { d } else { f32::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disparities_survive_as_depths() {
        let rig = Rig::new(3979.911, (1244.772, 1019.507), 0.193001, 124.343).unwrap();
        let truth = Plane::from_fn(512, 2, |x, y| {
            if y == 0 {
                x as f32 * 1.37
            } else {
                f32::INFINITY
            }
        })
        .unwrap();
        let back = disparities(&depths(&truth, &rig).unwrap(), &rig);
        for (d, b) in truth.pixels().zip(back.pixels()) {
            assert!(d == b || (d - b).abs() < 1e-4, "{d} came back as {b}");
        }
    }

    #[test]
    fn infinity_is_a_depth_and_beyond_is_none() {
        let rig = Rig::new(300.0, (0.0, 0.0), 0.1, -5.0).unwrap();
        let at = |d: f32| depths(&Plane::filled(1, 1, d).unwrap(), &rig);
        let infinite = at(5.0).unwrap();
        assert_eq!(
            (infinite.get(0, 0), disparities(&infinite, &rig).get(0, 0)),
            (f32::INFINITY, 5.0)
        );
        assert_eq!(at(4.9), None);
        assert!(at(f32::NAN).unwrap().get(0, 0).is_nan());
    }
}
