//! Two readings of a file of disparities, compared by the images of its pair.

use super::scale::sampled_places;
use svl_core::statistics::upper_median;
use svl_core::stereo::{Plane, StereoPair};

/// Pixels that are compared, at most, and at least.
const PIXELS: f64 = 20_000.0;
const MIN_PIXELS: usize = 200;
/// A match is better if its median difference of grey levels is less than this fraction of the
/// other's: a shift of 10 px doubles it on KITTI's pairs.
const BETTER: f64 = 0.7;

/// Disparities that are wrong by this much match worse, pixels.
const WRONG_PX: f32 = 7.0;
/// Median difference of grey levels of a good match.
const MAX_DIFFERENCE: f64 = 16.0;

/// True if the right image, shifted by `one`, is like the left image, and clearly more so than
/// shifted by `other` and by disparities beside `one`. A pixel that a disparity moves out of the
/// right image differs by as much as grey levels can.
pub fn is_better_match(pair: &StereoPair, one: &Plane<f32>, other: &Plane<f32>) -> bool {
    let (width, height) = pair.size();
    if one.size() != (width, height) || other.size() != (width, height) {
        return false;
    }
    let mut differences = [const { Vec::new() }; 4];
    for (x, y) in sampled_places((width, height), PIXELS) {
        let (d, of_other) = (one.get(x, y), other.get(x, y));
        let shifts = [d, of_other, d - WRONG_PX, d + WRONG_PX];
        if shifts.iter().any(|d| !d.is_finite()) {
            continue;
        }
        let left = pair.left().get(x, y);
        for (differences, d) in differences.iter_mut().zip(shifts) {
            let at = x as f64 - f64::from(d).round();
            let is_inside = (0.0..width as f64).contains(&at);
            differences.push(if is_inside {
                f64::from(left.abs_diff(pair.right().get(at as usize, y)))
            } else {
                255.0
            });
        }
    }
    if differences[0].len() < MIN_PIXELS {
        return false;
    }
    let [one, others @ ..] = differences.map(|values| upper_median(values).unwrap_or(255.0));
    // Two grey levels are noise.
    let is_better = |other: &f64| one < BETTER * other && other - one > 2.0;
    one <= MAX_DIFFERENCE && others.iter().all(is_better)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Gray;

    #[test]
    fn the_shift_of_the_images_wins_and_no_other() {
        let size = (120, 40);
        let texture = |x: usize, y: usize| {
            let mixed = ((x * 7919 + y * 104_729) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            // Without this, some shifts are like others.
            let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            (mixed >> 56) as u8
        };
        let image = |shift| Gray::from_fn(size.0, size.1, |x, y| texture(x + shift, y)).unwrap();
        let pair = StereoPair::new(image(0), image(7)).unwrap();
        let plane = |d: f32| Plane::filled(size.0, size.1, d).unwrap();
        let is_better = |one: f32, other: f32| is_better_match(&pair, &plane(one), &plane(other));
        assert!(is_better(7.0, 20.0) && is_better(7.0, 500.0));
        assert!(!is_better(20.0, 7.0) && !is_better(7.0, 7.0));
        assert!(
            (8..60).all(|d| !is_better(d as f32, 100.0)),
            "all are wrong"
        );
        assert!(!is_better(f32::INFINITY, 20.0));
        let plain = Gray::filled(size.0, size.1, 90).unwrap();
        let pair = StereoPair::new(plain.clone(), plain).unwrap();
        assert!(!is_better_match(&pair, &plane(7.0), &plane(20.0)));
    }
}
