//! A map of disparities: its values for unknown, and beside its truth the signs of another unit,
//! sign or view.

use super::scale::{MIN_PIXELS, MIN_PX, PIXELS, USUAL, constant, sampled_places};
use svl_core::doubt::{Doubt, MapCure, Subject, are_most, usual};
use svl_core::statistics::upper_median;
use svl_core::stereo::Plane;

/// A map is that of the right view if its median error there is less than this fraction of that in
/// the left view.
const OF_RIGHT: f64 = 0.25;
/// Median errors up to this are those of a good map, pixels.
const GOOD_PX: f64 = 1.0;
/// A usual factor is printed in place of the measured one if it differs by less than this.
const SAME: f64 = 0.02;

/// The disparities without the finite ones that stand for unknown by `is_none`, and their number.
///
/// # Errors
/// The map, unchanged, where most are such and of several values: of another sign or unit.
pub fn without(
    map: Plane<f32>,
    is_none: impl Fn(f32) -> bool,
) -> Result<(Plane<f32>, usize), Plane<f32>> {
    let is_none = |d: f32| d.is_finite() && is_none(d);
    if are_most(&map, is_none) {
        return Err(map);
    }
    let count = map.pixels().filter(|d| is_none(*d)).count();
    Ok((
        map.map(|d| if is_none(d) { f32::INFINITY } else { d }),
        count,
    ))
}

/// The doubt about a map whose disparities are negative.
pub fn sign_doubt(file: &str, map: &Plane<f32>) -> Option<Doubt> {
    let known = map.pixels().filter(|d| d.is_finite() && *d != 0.0);
    let median_px = upper_median(known.map(f64::from))?;
    let (subject, usual) = (Subject::File(file.to_owned()), [0.0, map.width() as f64]);
    let doubt = || MapCure::OppositeSign.doubt(subject, "disparity_px", median_px, usual);
    are_most(map, |d| d < 0.0).then(doubt)
}

/// The doubt about the estimate of a file, of one size with its truth: a constant factor, the
/// opposite sign, depths in place of disparities, or the map of the right view.
pub fn map_doubt(file: &str, estimate: &Plane<f32>, truth: &Plane<f32>) -> Option<Doubt> {
    let doubt = |quantity, value, usual, cure: MapCure| {
        let subject = Subject::File(file.to_owned());
        Some(cure.doubt(subject, quantity, value, usual))
    };
    let negative = sign_doubt(file, estimate);
    if negative.is_some() || estimate.size() != truth.size() {
        return negative;
    }
    let (mut factors, mut products) = (Vec::new(), Vec::new());
    let [mut of_left, mut of_right] = [const { Vec::new() }; 2];
    for (x, y) in sampled_places(truth.size(), PIXELS) {
        let [true_px, px] = [truth.get(x, y), estimate.get(x, y)].map(f64::from);
        if !true_px.is_finite() || !px.is_finite() || px == 0.0 || true_px < MIN_PX {
            continue;
        }
        factors.push(px / true_px);
        products.push(px * true_px);
        let partner = (x as f64 - true_px).round();
        if partner >= 0.0 {
            let of_partner = f64::from(estimate.get(partner as usize, y));
            of_left.push((px - true_px).abs());
            of_right.push((of_partner - true_px).abs());
        }
    }
    if factors.len() < MIN_PIXELS {
        return None;
    }
    let is_usual = |factor: f64| (USUAL[0]..=USUAL[1]).contains(&factor);
    match constant(&factors) {
        Some(factor) if is_usual(usual(factor)) => {}
        Some(factor) => {
            let near = Some(usual(factor)).filter(|near| (factor / near - 1.0).abs() < SAME);
            let factor = near.unwrap_or(factor);
            return doubt("scale", factor, USUAL, MapCure::Scaled { factor });
        }
        None => {
            if let Some(product) = constant(&products) {
                return doubt("product_px2", product, [0.0, 0.0], MapCure::Depths);
            }
        }
    }
    let [left, right] = [of_left, of_right].map(upper_median);
    let is_of_right = right? <= GOOD_PX && right? < OF_RIGHT * left?;
    let (name, usual) = ("right_error_of_left", [OF_RIGHT, f64::MAX]);
    is_of_right.then(|| doubt(name, right? / left?, usual, MapCure::RightView))?
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(estimate: &Plane<f32>, truth: &Plane<f32>) -> Option<String> {
        let doubt = map_doubt("z", estimate, truth);
        assert!(doubt.iter().all(Doubt::is_unusual), "{doubt:?}");
        doubt.map(|doubt| doubt.to_string())
    }

    #[test]
    fn each_fault_is_named_and_a_noisy_map_is_none() {
        let size = (160, 60);
        let at = |x: usize, y: usize| 8.0 + ((x / 20 * 7 + y / 15 * 3) % 40) as f32;
        let truth = Plane::from_fn(size.0, size.1, at).unwrap();
        let doubt = |change: &dyn Fn(f32) -> f32| words(&truth.map(change), &truth);
        for (name, doubt, words) in [
            (
                "times 16",
                doubt(&|d| 16.0 * d),
                "16 times those of the truth",
            ),
            ("sign", doubt(&|d| -d), "opposite sign"),
            (
                "noisy sign",
                doubt(&|d| -d * (d % 3.0 + 1.0)),
                "opposite sign",
            ),
            ("times 3.1", doubt(&|d| 3.1 * d), "3.1 times those"),
            ("times 3.4", doubt(&|d| 3.4 * d), "3.4 times those"),
            ("depth", doubt(&|d| 300.0 / d), "depths, not disparities"),
        ] {
            assert!(doubt.as_ref().unwrap().contains(words), "{name}: {doubt:?}");
        }
        let mut of_right = Plane::filled(size.0, size.1, f32::INFINITY).unwrap();
        for y in 0..size.1 {
            for x in 0..size.0 {
                let partner = x as f32 - at(x, y);
                if partner >= 0.0 {
                    of_right.row_mut(y)[partner as usize] = at(x, y);
                }
            }
        }
        let doubt_of_right = words(&of_right, &truth).unwrap();
        assert!(doubt_of_right.contains("right view"), "{doubt_of_right}");
        assert_eq!(doubt(&|d| d + 0.4), None);
        assert_eq!(doubt(&|_| 20.0), None, "a constant is only wrong");
        let noise =
            |x: usize, y: usize| at(x, y) * if (x + y).is_multiple_of(3) { 2.0 } else { 1.0 };
        let noisy = Plane::from_fn(size.0, size.1, noise).unwrap();
        assert_eq!(words(&noisy, &truth), None);
    }
    #[test]
    fn codes_for_unknown_are_none_and_another_sign_is_not() {
        let map = |values: &[f32]| Plane::from_vec(values.len(), 1, values.to_vec()).unwrap();
        let negative = |values: &[f32]| {
            let found = without(map(values), |d| d < 0.0).ok();
            found.map(|(map, count)| (map.row(0).to_vec(), count))
        };
        let inf = f32::INFINITY;
        for code in [-1.0, -16.0, f32::MIN] {
            let found = negative(&[4.0, code, 5.0, inf, code]);
            assert_eq!(found, Some((vec![4.0, inf, 5.0, inf, inf], 2)));
            // Most pixels, or all of them, are unknown.
            assert_eq!(negative(&[code; 20]), Some((vec![inf; 20], 20)));
        }
        assert_eq!(negative(&[-4.0, -5.0, 0.0, -6.0, inf]), None);
        let of_another_size = words(&map(&[-4.0, -5.0]), &map(&[4.0]));
        assert!(of_another_size.unwrap().contains("opposite sign"));
    }
}
